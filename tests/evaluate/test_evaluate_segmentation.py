"""The figures of an evaluation, counted by hand."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence

import numpy as np
import pytest
from evaluation_cases import HEIGHT, WIDTH, answer, label, photo, same, segment
from hypothesis import given, settings
from hypothesis import strategies as st

from fronto.datasets.records import LabeledImage
from fronto.errors import InputError
from fronto.evaluate import SegmentationReport, evaluate_segmentation
from fronto.evaluate.scores import FOUND_LABELS, TRUE_LABELS
from fronto.segments import Segment


def evaluated(
    cases: Sequence[tuple[LabeledImage, list[Segment]]], by: str = "mask", **options: object
) -> SegmentationReport:
    images = [image for image, _ in cases]
    return evaluate_segmentation(images, answer(*(s for _, s in cases)), by=by, **options)


def cell(report: SegmentationReport, truth: str, found: str) -> int:
    return int(report.confusion[TRUE_LABELS.index(truth), FOUND_LABELS.index(found)])


@pytest.fixture
def report() -> SegmentationReport:
    """Two photos: 5 buttons, 3 of them found, 1 named wrong; 2 plates; 3 false positives."""
    first = photo(
        label(10, 10, category="up"),
        label(40, 10, category="down"),
        label(70, 10, category="unknown"),
        label(100, 10, category="plate"),
        label(10, 50, 50, ignore=True),
        name="first",
    )
    second = photo(
        label(10, 10, 10, category="number"),
        label(40, 10, 14, category="number"),
        label(70, 10, category="plate"),
        name="second",
    )
    found = [
        segment(10, 10, category="up", confidence=0.9),
        segment(40, 10, category="up", confidence=0.8),
        segment(70, 10, category="other", confidence=0.7),
        segment(100, 10, category="number", confidence=0.6),  # a plate
        segment(20, 60, category="number", confidence=0.95),  # ignored
        segment(150, 90, 10, category="stop", confidence=0.3),  # nothing
    ]
    rest = [
        segment(42, 10, 14, category="plate", confidence=0.5),  # a button, IoU 12/16
        segment(70, 10, category="plate", confidence=0.4),
        segment(150, 10, 30, category="number", confidence=0.2),  # nothing
    ]
    return evaluated([(first, found), (second, rest)])


def test_precision_and_recall_of_buttons(report: SegmentationReport) -> None:
    buttons = report.buttons
    assert (buttons.truths, buttons.found, buttons.detections, buttons.right) == (5, 3, 6, 3)
    assert buttons.precision == 3 / 6
    assert buttons.recall == 3 / 5
    assert buttons.f1 == pytest.approx(6 / 11)
    assert report.buttons_reviewed == buttons


def test_plates_are_a_kind_of_their_own(report: SegmentationReport) -> None:
    plates = report.plates
    assert (plates.truths, plates.found, plates.detections, plates.right) == (2, 1, 2, 1)
    assert report.plates_as_buttons == 1 / 2
    assert report.buttons_as_plates == 1 / 5


def test_a_plate_is_counted_once_however_often_it_is_reported() -> None:
    image = photo(label(10, 10, category="plate"), label(50, 10, category="plate"))
    found = [segment(10, 10), segment(11, 10), segment(10, 11, category="plate")]
    report = evaluated([(image, found)])
    assert report.plates_as_buttons == 1 / 2
    assert report.buttons.detections == 2
    assert report.plates.found == 1
    # A second detection as what it is takes it for nothing else.
    twice = [segment(50 + k, 10, category="plate") for k in range(2)]
    assert evaluated([(image, twice)]).plates_as_buttons == 0
    # Found as what it is, it is not confused; both buttons are nothing.
    assert cell(report, "plate", "plate") == 1
    assert cell(report, "nothing", "number") == 2


def test_names_are_judged_among_the_found_that_have_one(report: SegmentationReport) -> None:
    assert report.category_accuracy == 1 / 2
    scores = {c.category: c for c in report.categories}
    assert (scores["up"].truths, scores["up"].right, scores["up"].detections) == (1, 1, 2)
    assert scores["up"].precision == 1 / 2
    assert scores["up"].recall == 1
    assert (scores["down"].found, scores["down"].right, scores["down"].recall) == (1, 0, 0)
    assert math.isnan(scores["down"].precision)
    # On the unknown button it is neither right nor wrong.
    assert scores["other"].detections == 0
    # One on a plate, one on nothing; the ignored one does not count.
    assert scores["number"].detections == 2
    assert scores["number"].recall == 0
    assert (scores["plate"].found, scores["plate"].precision) == (1, 1 / 2)


def test_confusion_has_every_label_and_every_counted_detection_once(
    report: SegmentationReport,
) -> None:
    want = {
        ("up", "up"): 1,
        ("down", "up"): 1,
        ("unknown", "other"): 1,
        ("plate", "number"): 1,
        ("nothing", "stop"): 1,
        ("number", "nothing"): 1,
        ("number", "plate"): 1,
        ("plate", "plate"): 1,
        ("nothing", "number"): 1,
    }
    for (truth, found), count in want.items():
        assert cell(report, truth, found) == count, (truth, found)
    assert report.confusion.sum() == sum(want.values())


def test_sizes_go_by_the_shorter_side(report: SegmentationReport) -> None:
    sizes = {size.low: size.score for size in report.sizes}
    assert [size.high for size in report.sizes] == [12, 16, 24, 40, 80, math.inf]
    # 10 px: one missed, one false; 14 px: one missed; 20 px: 3 found, a plate; 30 px: false.
    assert (sizes[0].truths, sizes[0].found, sizes[0].detections) == (1, 0, 1)
    assert (sizes[12].truths, sizes[12].found, sizes[12].detections) == (1, 0, 0)
    assert (sizes[16].truths, sizes[16].found, sizes[16].detections) == (3, 3, 4)
    assert (sizes[24].truths, sizes[24].detections) == (0, 1)
    # A second detection of a button of 20 px, itself of 15 (IoU 225/400).
    twice = [segment(10, 10), segment(10, 10, 15, confidence=0.5)]
    sizes = {size.low: size.score for size in evaluated([(photo(label(10, 10)), twice)]).sizes}
    assert (sizes[12].detections, sizes[16].detections) == (1, 1)
    wide = photo(label(0, 0, 12), label(0, 40, 80))
    sizes = {size.low: size.score.truths for size in evaluated([(wide, [])]).sizes}
    assert sizes == {0: 0, 12: 1, 16: 0, 24: 0, 40: 0, 80: 1}


def test_average_precision_by_hand(report: SegmentationReport) -> None:
    # By confidence: right, right, right, false, false, false; 3 of 5 found.
    assert report.average_precision == pytest.approx(3 / 5)
    image = photo(label(10, 10), label(40, 10), label(70, 10), label(100, 10))
    found = [
        segment(10, 10, confidence=0.9),
        segment(10, 60, confidence=0.8),
        segment(40, 10, confidence=0.7),
        segment(70, 10, confidence=0.6),
    ]
    # Precision 1, 1/2, 2/3, 3/4; made monotone 1, 3/4, 3/4, 3/4.
    assert evaluated([(image, found)]).average_precision == pytest.approx((1 + 0.75 + 0.75) / 4)


def test_equally_sure_detections_enter_the_curve_together() -> None:
    image = photo(label(10, 10))
    found = [segment(10, 10, confidence=0.5), segment(60, 60, confidence=0.5)]
    for order in (found, found[::-1]):
        report = evaluated([(image, order)])
        assert report.average_precision == 0.5
        at = {point.confidence: point for point in report.curve}
        assert (at[0.5].precision, at[0.5].recall) == (0.5, 1)
        assert math.isnan(at[0.55].precision)
        assert at[0.55].recall == 0


def test_missing_labels_make_a_detection_right_but_no_button_more() -> None:
    image = photo(label(10, 10), label(40, 10), name="x")
    found = [
        segment(10, 10, confidence=0.6),
        segment(80, 10, confidence=0.9),
        segment(120, 60, confidence=0.2),
    ]
    report = evaluated([(image, found)], by="box", missing={"set/x": [label(81, 10)]})
    assert (report.buttons.right, report.buttons.detections) == (1, 3)
    assert (report.buttons_reviewed.right, report.buttons_reviewed.detections) == (2, 3)
    assert report.buttons.recall == report.buttons_reviewed.recall == 1 / 2
    assert report.average_precision == pytest.approx(1 / 2 * 1 / 2)
    assert report.average_precision_reviewed == pytest.approx(1 / 2)
    assert [f.confidence for f in report.false_positives] == [0.2]
    assert report.images[0].errors == 2
    other = evaluated([(image, found)], by="box", missing={"set/y": [label(81, 10)]})
    assert other.buttons_reviewed.right == 1


def test_pixels_by_hand(report: SegmentationReport) -> None:
    # A plate of 400 px half covered by a plate, half by a surer button; the rest is right.
    image = photo(label(10, 10, category="plate"), label(0, 60, 40, ignore=True))
    half = np.ones((20, 10), np.float32)
    found = [
        Segment("number", 0.9, (9.5, 9.5, 19.5, 29.5), (10, 10), half),
        segment(10, 10, category="plate", confidence=0.4),
        segment(10, 70, category="up"),  # on what is ignored
    ]
    report = evaluated([(image, found)])
    assert report.pixel_iou == {"background": 1, "button": 0, "plate": 0.5}
    assert report.mean_iou == pytest.approx(0.5)
    assert report.images[0].mean_iou == pytest.approx(0.5)
    assert report.images[0].pixels.sum() == WIDTH * HEIGHT - 1600
    assert math.isnan(evaluated([(image, found)], by="box").mean_iou)


def test_what_is_labelled_within_an_ignored_region_counts() -> None:
    image = photo(label(20, 20), label(60, 20, category="plate"), label(0, 0, 100, ignore=True))
    for objects in (image.objects, image.objects[::-1]):
        (result,) = evaluated([(photo(*objects), [segment(20, 20)])]).images
        assert result.pixels.sum() == WIDTH * HEIGHT - 100 * 100 + 2 * 400
        assert (result.pixels[1, 1], result.pixels[2, 0]) == (400, 400)


def test_classes_that_are_nowhere_do_not_count_in_the_mean() -> None:
    report = evaluated([(photo(label(10, 10)), [segment(10, 10)]), (photo(), [])])
    assert report.mean_iou == 1
    assert math.isnan(report.pixel_iou["plate"])
    assert report.images[1].mean_iou == 1


def test_masks_may_reach_beyond_the_photo() -> None:
    found = [segment(-10, -10), segment(WIDTH - 5, HEIGHT - 5), segment(WIDTH + 10, 10)]
    report = evaluated([(photo(), found)])
    pixels = report.images[0].pixels
    assert pixels[0, 1] == 10 * 10 + 5 * 5


def test_iou_quartiles_are_of_the_found() -> None:
    image = photo(*(label(40 * k, 10) for k in range(4)))
    found = [segment(40 * k + k, 10) for k in range(3)]
    report = evaluated([(image, found)])
    assert report.iou_quartiles[1] == pytest.approx(19 / 21)
    assert report.iou_quartiles[2] == pytest.approx((19 / 21 + 1) / 2)


def test_nothing_labelled_and_nothing_found() -> None:
    for report in (evaluated([(photo(), [])]), evaluated([])):
        for value in (report.buttons.precision, report.buttons.recall, report.buttons.f1):
            assert math.isnan(value)
        assert math.isnan(report.average_precision)
        assert report.worst(3) == ()
        json.loads(report.to_json())
        assert "–" in report.to_markdown()
    only_false = evaluated([(photo(), [segment(10, 10)])])
    assert (only_false.buttons.precision, only_false.buttons.f1) == (0, 0)
    only_missed = evaluated([(photo(label(10, 10)), [])])
    assert (only_missed.buttons.recall, only_missed.buttons.f1) == (0, 0)
    assert only_missed.average_precision == 0


def test_the_worst_photos_come_first(report: SegmentationReport) -> None:
    # The first has 2 false buttons; the second has 2 missed ones and a false one.
    assert [(image.name, image.errors) for image in report.worst(5)] == [
        ("set/second", 3),
        ("set/first", 2),
    ]
    assert [image.name for image in report.worst(1)] == ["set/second"]


def test_json_has_the_figures_and_no_folder(report: SegmentationReport) -> None:
    values = json.loads(report.to_json())
    assert values["buttons"]["recall"] == 3 / 5
    assert values["plates_as_buttons"] == 1 / 2
    assert values["categories"][1]["precision"] is None
    assert values["sizes"][-1]["below_px"] is None
    assert values["photos"][0]["photo"] == "set/first"
    assert [f["confidence"] for f in values["false_positives"]] == [0.6, 0.3, 0.2]
    assert values["false_positives"][0]["on"] == "plate"
    assert [m["object"] for m in values["misses"]] == [0, 1]
    assert "images/" not in report.to_json().decode()


def test_numbers_of_numpy_are_fine_too() -> None:
    class Found:
        category = "number"
        confidence = np.float32(0.5)
        box_px = tuple(np.array([9.5, 9.5, 29.5, 29.5]))
        origin_px = (10, 10)
        mask = np.ones((20, 20), bool)

    report = evaluate_segmentation(
        [photo(label(10, 10), name="a"), photo(name="b")], lambda image: [Found()]
    )
    assert json.loads(report.to_json())["buttons"]["found"] == 1


def test_tables_are_well_formed(report: SegmentationReport) -> None:
    tables = [part for part in report.to_markdown().split("\n\n") if part.startswith("|")]
    assert len(tables) >= 6
    for table in tables:
        assert len({line.count("|") for line in table.splitlines()}) == 1
    assert "| buttons, as labelled | 5 | 3 | 3 | 0.500 | 0.600 | 0.545 | 0.600 |" in tables[0]


def test_each_photo_is_predicted_once_and_timed() -> None:
    asked = []

    def predict(image: LabeledImage) -> list[Segment]:
        asked.append(image.path.stem)
        return []

    report = evaluate_segmentation((photo(name=n) for n in "abc"), predict)
    assert asked == ["a", "b", "c"]
    assert all(image.time_ms >= 0 for image in report.images)
    assert report.time_ms == sorted(image.time_ms for image in report.images)[1]


@pytest.mark.parametrize("options", [{"iou": 0.0}, {"iou": 1.5}, {"iou": math.nan}, {"by": "x"}])
def test_options_out_of_range_are_refused(options: dict) -> None:
    with pytest.raises(InputError):
        evaluate_segmentation([], answer(), **options)


def random_case(rng: np.random.Generator) -> tuple[LabeledImage, list[Segment]]:
    def draw() -> tuple[int, int, int]:
        x, y, side = rng.integers((0, 0, 8), (60, 60, 24))
        return int(x), int(y), int(side)

    def pick() -> str:
        return str(rng.choice(["up", "number", "plate"]))

    labels = [
        label(*draw(), pick(), ignore=bool(rng.random() < 0.2)) for _ in range(rng.integers(6))
    ]
    found = [segment(*draw(), pick(), float(rng.integers(5)) / 4) for _ in range(rng.integers(8))]
    found += [same(item, float(rng.random())) for item in labels if rng.random() < 0.5]
    return photo(*labels), found


@settings(derandomize=True, deadline=None, max_examples=50)
@given(st.integers(0, 10**6), st.sampled_from(["box", "mask"]))
def test_shares_are_shares(seed: int, by: str) -> None:
    rng = np.random.default_rng(seed)
    report = evaluated([random_case(rng) for _ in range(2)], by=by)
    scores = [report.buttons, report.plates, *(size.score for size in report.sizes)]
    values = [v for s in scores for v in (s.precision, s.recall, s.f1)]
    values += [report.average_precision, report.plates_as_buttons, report.buttons_as_plates]
    values += [report.category_accuracy, report.mean_iou, *report.iou_quartiles]
    values += [v for c in report.categories for v in (c.precision, c.recall)]
    assert all(math.isnan(value) or 0 <= value <= 1 for value in values)
    # Confidence as a threshold: with it recall only falls, from that of all detections.
    recalls = [point.recall for point in report.curve if not math.isnan(point.recall)]
    assert recalls == sorted(recalls, reverse=True)
    # Every label and every detection that counts is in the confusion once.
    known = report.confusion[:-1].sum()
    assert known == report.buttons.truths + report.plates.truths
    named = report.confusion[:, :-1].sum()
    assert named == report.buttons.detections + report.plates.detections
    assert sum(size.score.truths for size in report.sizes) == report.buttons.truths
    assert sum(size.score.detections for size in report.sizes) == report.buttons.detections


@settings(derandomize=True, deadline=None, max_examples=50)
@given(st.integers(0, 10**6), st.sampled_from(["box", "mask"]))
def test_what_is_all_right_scores_one(seed: int, by: str) -> None:
    rng = np.random.default_rng(seed)
    places = [(x, y) for x in range(0, 160, 30) for y in range(0, 90, 30)]
    kinds = ["up", "number", "other", "plate", "unknown"]
    labels = [
        label(x, y, int(rng.integers(8, 28)), str(rng.choice(kinds)), bool(rng.random() < 0.2))
        for x, y in places
        if rng.random() < 0.7
    ]
    labels += [label(0, 90), label(30, 90, category="plate")]
    found = [same(item, float(rng.random())) for item in labels]
    report = evaluated([(photo(*labels), found)], by=by)
    for score in (report.buttons, report.plates):
        assert (score.precision, score.recall, score.f1) == (1, 1, 1)
    assert report.average_precision == 1
    assert report.category_accuracy == 1
    assert report.iou_quartiles == (1, 1, 1)
    assert report.plates_as_buttons == report.buttons_as_plates == 0
    if by == "mask":
        assert report.mean_iou == 1


@settings(derandomize=True, deadline=None, max_examples=40)
@given(st.integers(0, 10**6))
def test_figures_do_not_depend_on_any_order(seed: int) -> None:
    rng = np.random.default_rng(seed)
    cases = [random_case(rng) for _ in range(3)]
    turned = [
        (photo(*rng.permutation(np.array(image.objects, object))), list(rng.permutation(found)))
        for image, found in cases
    ][::-1]
    first, second = evaluated(cases), evaluated(turned)
    assert first.buttons == second.buttons
    assert first.plates == second.plates
    assert first.sizes == second.sizes
    assert (first.confusion == second.confusion).all()
    np.testing.assert_equal(
        [first.average_precision, first.mean_iou, first.plates_as_buttons],
        [second.average_precision, second.mean_iou, second.plates_as_buttons],
    )
