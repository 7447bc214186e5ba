"""Which detection is which label: pairs, ignored regions, plates, duplicates, ties."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from evaluation_cases import label, photo, same, segment
from hypothesis import given, settings
from hypothesis import strategies as st

from fronto.datasets.records import LabeledImage, LabeledObject
from fronto.errors import InputError
from fronto.evaluate import Finding, judge_image, match_greedy, photo_id
from fronto.segments import Segment


def verdicts(findings: tuple[Finding, ...]) -> Counter[str]:
    return Counter(f.verdict for f in findings)


def test_the_surest_chooses_first_and_each_is_taken_once() -> None:
    iou = [[0.9, 0.6], [0.8, 0.55], [0.7, 0.1]]
    assert match_greedy(iou, [0.5, 0.9, 0.4]) == {1: 0, 0: 1}
    assert match_greedy(iou, [0.9, 0.5, 0.7]) == {0: 0, 1: 1}
    assert match_greedy(iou, [0.9, 0.5, 0.7], 0.56) == {0: 0}


def test_of_equally_sure_ones_the_closer_goes_first() -> None:
    assert match_greedy([[0.6], [0.8]], [0.7, 0.7]) == {1: 0}
    assert match_greedy([[0.8], [0.6]], [0.7, 0.7]) == {0: 0}


def test_the_threshold_itself_is_enough() -> None:
    assert match_greedy([[0.5]], [0.1]) == {0: 0}
    assert match_greedy([[0.4999]], [0.1]) == {}


def test_nothing_on_either_side() -> None:
    assert match_greedy(np.zeros((0, 3)), []) == {}
    assert match_greedy(np.zeros((2, 0)), [0.5, 0.6]) == {}
    assert judge_image(photo(), []) == ()


@pytest.mark.parametrize("by", ["box", "mask"])
def test_found_missed_and_false_state_what_they_are_about(by: str) -> None:
    image = photo(label(10, 10, category="up"), label(60, 10, category="down"))
    findings = judge_image(image, [segment(12, 10, category="number"), segment(120, 60)], by=by)
    found, false, missed = findings
    assert (found.verdict, found.truth, found.category, found.truth_category) == (
        "found", 0, "number", "up",
    )  # fmt: skip
    assert found.iou == pytest.approx(18 / 22)
    assert (false.verdict, false.truth, false.box) == ("false", None, (119.5, 59.5, 139.5, 79.5))
    assert (missed.verdict, missed.truth, missed.truth_category) == ("missed", 1, "down")
    assert missed.confidence is None
    assert missed.iou is None


def test_a_second_detection_of_a_button_is_false() -> None:
    image = photo(label(10, 10))
    findings = judge_image(
        image, [segment(11, 10, confidence=0.6), segment(10, 11, confidence=0.8)]
    )
    assert [(f.verdict, f.confidence) for f in findings] == [("found", 0.8), ("false", 0.6)]
    assert findings[1].truth == 0  # it says what it covers


def test_masks_judge_otherwise_than_boxes() -> None:
    # A cross in a square has its box, but less than half of its pixels.
    mask = np.zeros((20, 20), np.float32)
    mask[8:12] = mask[:, 8:12] = 1
    cross = Segment("number", 0.9, (9.5, 9.5, 29.5, 29.5), (10, 10), mask)
    image = photo(label(10, 10))
    assert verdicts(judge_image(image, [cross], by="box")) == {"found": 1}
    assert verdicts(judge_image(image, [cross], by="mask")) == {"false": 1, "missed": 1}


def test_what_is_ignored_takes_any_number_and_counts_nowhere() -> None:
    image = photo(label(10, 10, 60, ignore=True), label(100, 10))
    small = [segment(12 + 22 * k, 12, confidence=0.5) for k in range(2)]
    findings = judge_image(image, [*small, segment(100, 10), segment(60, 40)])
    # The last lies in it with 10 of its 20 columns.
    assert verdicts(findings) == {"ignored": 3, "found": 1}
    assert verdicts(judge_image(image, [segment(61, 40)])) == {"false": 1, "missed": 1}


def test_a_button_takes_a_detection_before_what_is_ignored_does() -> None:
    image = photo(label(0, 0, 100, ignore=True), label(20, 20))
    assert verdicts(judge_image(image, [segment(20, 20)])) == {"found": 1}


def test_a_box_only_is_enough_to_be_ignored_but_not_to_compare_masks_with() -> None:
    box = LabeledObject("number", (9.5, 9.5, 29.5, 29.5), None, "")
    assert verdicts(judge_image(photo(box), [segment(10, 10)])) == {"found": 1}
    with pytest.raises(InputError, match="object 1"):
        judge_image(photo(box), [segment(10, 10)], by="mask")
    crowd = replace(box, ignore=True)
    assert verdicts(judge_image(photo(crowd), [segment(10, 10)], by="mask")) == {"ignored": 1}


def test_a_plate_reported_as_a_button_is_false_and_the_plate_is_missed() -> None:
    image = photo(label(10, 10, category="plate"), label(40, 10))
    findings = judge_image(image, [segment(10, 10), segment(40, 10)])
    buttons = [f for f in findings if not f.of_plate]
    assert sorted(f.verdict for f in buttons) == ["false", "found"]
    (false,) = [f for f in buttons if f.verdict == "false"]
    assert (false.truth, false.truth_category) == (0, "plate")
    assert [(f.verdict, f.truth) for f in findings if f.of_plate] == [("missed", 0)]


def test_a_button_reported_as_a_plate_is_missed() -> None:
    findings = judge_image(photo(label(10, 10)), [segment(10, 10, category="plate")])
    assert [(f.verdict, f.of_plate) for f in findings] == [("missed", False), ("false", True)]


def test_a_missing_label_excuses_one_detection_and_only_a_buttons() -> None:
    image = photo(label(100, 10))
    missing = [label(10, 10)]
    found = [segment(11, 10, confidence=0.9), segment(10, 12, confidence=0.8)]
    findings = judge_image(image, found, missing=missing)
    assert [(f.verdict, f.confidence) for f in findings] == [
        ("unlabeled", 0.9),
        ("false", 0.8),
        ("missed", None),
    ]
    plate = judge_image(image, [segment(10, 10, category="plate")], missing=missing)
    assert verdicts(plate) == {"false": 1, "missed": 1}


def test_labels_beyond_the_border_count_by_what_is_seen_of_them() -> None:
    image = photo(label(-10, 10, 20), label(-40, 10, 20))
    half = Segment("number", 0.9, (-0.5, 9.5, 9.5, 29.5), (0, 10), np.ones((20, 10), np.float32))
    for by in ("box", "mask"):
        (finding,) = judge_image(image, [half], by=by)
        assert (finding.verdict, finding.iou, finding.truth) == ("found", 1.0, 0)
        assert finding.truth_box == (-0.5, 9.5, 9.5, 29.5)


def test_an_unknown_category_of_a_detection_is_refused() -> None:
    class Odd:
        category = "lamp"
        confidence = 0.5
        box_px = (0.0, 0.0, 5.0, 5.0)
        origin_px = (0, 0)
        mask = np.ones((5, 5), bool)

    with pytest.raises(InputError, match="lamp"):
        judge_image(photo(), [Odd()])


def test_photos_have_short_names() -> None:
    assert photo_id(Path("data/panels/valid/images/1000.jpg")) == "valid/1000"
    assert photo_id(Path("data/mine/hall.png")) == "mine/hall"
    assert photo_id(Path("hall.png")) == "hall"


def test_halfway_between_two_the_order_of_labels_does_not_decide() -> None:
    # Its overlap with both is the same; either one may be it, but always the same one.
    one, other = label(10, 10, category="up"), label(14, 10, category="down")
    taken = set()
    for labels in ((one, other), (other, one)):
        for by in ("box", "mask"):
            found, missed = judge_image(photo(*labels), [segment(12, 10)], by=by)
            assert missed.verdict == "missed"
            taken.add(found.truth_category)
    assert len(taken) == 1


@settings(derandomize=True, deadline=None, max_examples=80)
@given(st.integers(0, 10**6))
def test_the_order_of_labels_and_detections_does_not_matter(seed: int) -> None:
    rng = np.random.default_rng(seed)

    def place() -> tuple[int, int, int]:
        x, y, side = rng.integers((0, 0, 8), (40, 40, 16))
        return int(x), int(y), int(side)

    def pick() -> str:
        return str(rng.choice(["up", "number", "plate"]))

    labels = [label(*place(), pick(), ignore=bool(rng.random() < 0.2)) for _ in range(6)]
    found = [segment(*place(), pick(), float(rng.integers(3)) / 2) for _ in range(5)]
    found += [same(labels[0], 0.5), same(labels[0], 0.5)]

    def told(image: LabeledImage, segments: list[Segment]) -> Counter[tuple[object, ...]]:
        findings = judge_image(image, segments, by="mask")
        return Counter(
            (f.verdict, f.category, f.box, f.confidence, f.truth_category, f.truth_box, f.iou)
            for f in findings
        )

    def shuffled(items: list) -> list:
        return [items[k] for k in rng.permutation(len(items))]

    assert told(photo(*labels), found) == told(photo(*shuffled(labels)), shuffled(found))


@settings(derandomize=True, deadline=None, max_examples=60)
@given(st.integers(0, 10**6))
def test_every_label_and_every_detection_has_one_verdict(seed: int) -> None:
    rng = np.random.default_rng(seed)
    labels = [label(*map(int, rng.integers((0, 0, 8), (60, 60, 20)))) for _ in range(5)]
    found = [segment(*map(int, rng.integers((0, 0, 8), (60, 60, 20)))) for _ in range(7)]
    told = verdicts(judge_image(photo(*labels), found))
    assert told["found"] + told["missed"] == 5
    assert told["found"] + told["false"] == 7
