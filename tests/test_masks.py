"""From finds to segments, with a mask head that knows the answer, and without one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
import pytest

from fronto.categories import CATEGORIES, PLATE
from fronto.engine import DrawnMasks
from fronto.finds import Find
from fronto.grouping import Instance
from fronto.maskhead import REACH, SIDE, Patches, mask_in_photo, region
from fronto.masks import LEAST_DRAWN, drawn
from fronto.scales import first_look
from fronto.segmentation import segment
from fronto.segments import Segment
from fronto.units import label_place
from test_segmentation import Oracle

WIDTH, HEIGHT = 160, 120
PHOTO = np.full((HEIGHT, WIDTH, 3), 90, np.uint8)
VIEW = first_look(PHOTO)
BOX = (40.5, 30.5, 80.5, 70.5)
Box = tuple[float, float, float, float]
Floats = npt.NDArray[np.float32]
FORMS = (0.7, 0.2, 0.1)


def find(box: Box = BOX, mask: Floats | None = None, confidence: float = 0.9) -> Find:
    """A find whose network drew a mask of its box, exactly, or another one."""
    edges = VIEW.to_network(np.reshape(box, (2, 2))).ravel()
    if mask is None:
        v, u = np.indices(VIEW.image.shape[:2])
        x0, y0, x1, y1 = edges
        mask = ((u > x0) & (u < x1) & (v > y0) & (v < y1)).astype(np.float32)
    u0, v0, u1, v1 = edges.tolist()
    scores = np.eye(len(CATEGORIES))[3]
    return Find(
        Instance(False, confidence, (u0, v0, u1, v1), scores),
        np.array(box),
        VIEW,
        mask,
        confidence,
        CATEGORIES[3],
        False,
    )


def disc(share: float, at: tuple[float, float] = (0.5, 0.5)) -> Floats:
    """A patch's mask: a disc in the box of the find, of this share of its area."""
    rows, columns = np.indices((SIDE, SIDE)) + 0.5
    middle = SIDE * (0.5 + (np.array(at) - 0.5) / REACH)
    radius = np.sqrt(share / np.pi) * SIDE / REACH
    away = np.hypot(columns - middle[0], rows - middle[1])
    return np.asarray(np.clip(radius - away + 0.5, 0, 1), np.float32)


NOTHING = np.zeros((SIDE, SIDE), np.float32)


@dataclass
class Head:
    """Answers so, find by find; keeps what it has been asked."""

    masks: Sequence[Floats]
    forms: Sequence[tuple[float, float, float]] | None = None
    asked: list[Patches] = field(default_factory=list)

    def run(self, patches: Patches) -> DrawnMasks:
        self.asked.append(patches)
        forms = self.forms or [FORMS] * len(self.masks)
        return DrawnMasks(np.stack(self.masks), np.array(forms, np.float32))


def segments(
    finds: Sequence[Find], head: Head | None, photo: npt.NDArray[np.uint8] = PHOTO
) -> tuple[Segment, ...]:
    return drawn(finds, photo, head)  # type: ignore[arg-type]


def same(first: Segment, second: Segment) -> None:
    assert first.origin_px == second.origin_px
    assert first.forms == second.forms
    assert first.box_px == second.box_px
    np.testing.assert_array_equal(first.probability, second.probability)


class TestLabelPlace:
    BOX = np.array([10.0, 20, 110, 60])

    @pytest.mark.parametrize(
        ("tight", "place"),
        [
            ((66, 22, 106, 58), (10, 20, 66, 60)),  # the label is at the left
            ((14, 22, 54, 58), (54, 20, 110, 60)),
            ((12, 22, 108, 46), (10, 46, 110, 60)),  # below
            ((12, 35, 108, 59), (10, 20, 110, 35)),
        ],
    )
    def test_the_rest_of_the_box_is_the_labels(self, tight: Box, place: Box) -> None:
        found = label_place(self.BOX, np.array(tight, float))
        assert found is not None
        assert found.tolist() == list(place)

    @pytest.mark.parametrize(
        "tight",
        [
            (12, 22, 108, 58),  # all of it
            (36, 22, 106, 58),  # too little is left
            (40, 22, 80, 58),  # the middle: a button in a ring
            (66, 38, 106, 58),  # in a corner
            (-30, 10, 150, 70),  # larger than the box
            (-30, 22, 108, 58),
        ],
    )
    def test_where_there_is_none(self, tight: Box) -> None:
        assert label_place(self.BOX, np.array(tight, float)) is None


def knob(share: float, at: float, axis: int = 0) -> Floats:
    """A patch's mask: this share of the box of a find along an axis, its middle there."""
    places = (np.arange(SIDE) + 0.5) / SIDE * REACH - (REACH - 1) / 2
    along, across = np.abs(places - at) < share / 2, np.abs(places - 0.5) < 0.45
    mask = np.outer(across, along) if axis == 0 else np.outer(along, across)
    return np.asarray(mask, np.float32)


class TestUnits:
    """Buttons that were found together with the labels beside them."""

    UNIT = (20.5, 40.5, 100.5, 80.5)

    def test_a_label_becomes_a_plate(self) -> None:
        button, label = segments([find(self.UNIT)], Head([knob(0.45, 0.75)]))
        assert (button.category, label.category) == (CATEGORIES[3], PLATE)
        assert button.box_px == self.UNIT
        columns = np.nonzero(button.mask.any(axis=0))[0] + button.origin_px[0]
        assert columns.min() == pytest.approx(100.5 - 0.475 * 80, abs=2)
        x0, y0, x1, y1 = label.box_px
        assert (x0, y0, y1) == (20.5, 40.5, 80.5)
        assert x1 == columns.min() - 0.5
        assert label.confidence == button.confidence

    def test_its_mask_is_its_box(self) -> None:
        _, label = segments([find(self.UNIT)], Head([knob(0.45, 0.25)]))
        rows, columns = np.nonzero(label.mask)
        x0, y0, x1, y1 = label.box_px
        left, top = label.origin_px
        assert (columns.min() + left - 0.5, columns.max() + left + 0.5) == (x0, x1)
        assert (rows.min() + top - 0.5, rows.max() + top + 0.5) == (y0, y1)

    def test_a_plate_is_not_divided(self) -> None:
        plate = find(self.UNIT)
        instance = replace(plate.instance, plate=True)
        finds = [replace(plate, instance=instance, category=PLATE)]
        (found,) = segments(finds, Head([knob(0.45, 0.75)]))
        assert found.category == PLATE

    @pytest.mark.parametrize(
        ("box", "known"), [((22.5, 42.5, 60.5, 78.5), True), ((22.5, 82.5, 60.5, 110.5), False)]
    )
    def test_a_label_that_is_known_is_not_told_twice(self, box: Box, known: bool) -> None:
        plate = find(box)
        plate = replace(plate, instance=replace(plate.instance, plate=True), category=PLATE)
        found = segments([find(self.UNIT), plate], Head([knob(0.45, 0.75), knob(0.9, 0.5)]))
        assert [s.category for s in found].count(PLATE) == (1 if known else 2)

    def test_without_a_head_there_is_none(self) -> None:
        half = np.zeros(VIEW.image.shape[:2], np.float32)
        u0, v0, u1, v1 = VIEW.to_network(np.reshape(self.UNIT, (2, 2))).ravel().astype(int)
        half[v0:v1, (u0 + u1) // 2 : u1] = 1
        (found,) = segments([find(self.UNIT, mask=half)], None)
        assert found.category == CATEGORIES[3]

    def test_a_label_at_the_photos_border_is_cut(self) -> None:
        _, label = segments([find((-0.5, 40.5, 79.5, 80.5))], Head([knob(0.45, 0.75)]))
        assert label.truncated
        _, label = segments([find((-0.5, 40.5, 79.5, 80.5))], Head([knob(0.45, 0.25)]))
        assert not label.truncated


class TestWithAHead:
    def test_its_masks_and_forms_are_handed_on(self) -> None:
        head = Head([disc(0.6)])
        (found,) = segments([find()], head)
        expected, origin = mask_in_photo(disc(0.6), region(BOX), WIDTH, HEIGHT)
        np.testing.assert_array_equal(found.probability, expected)
        assert found.origin_px == origin
        assert found.forms == pytest.approx(FORMS)
        assert all(type(form) is float for form in found.forms)
        assert found.mask.sum() == pytest.approx(0.6 * 40**2, rel=0.02)
        assert (found.category, found.confidence) == (CATEGORIES[3], 0.9)
        assert found.scores == tuple(np.eye(len(CATEGORIES))[3])
        assert found.box_px == BOX
        assert not found.truncated

    def test_it_is_asked_once_for_all_and_shown_the_photo(self) -> None:
        photo = PHOTO.copy()
        photo[:, 90:] = 200
        boxes = [BOX, (100.5, 30.5, 140.5, 70.5)]
        head = Head([disc(0.6), disc(0.5)], [(1, 0, 0), (0, 1, 0)])
        found = segments([find(box) for box in boxes], head, photo)
        (asked,) = head.asked
        assert asked.regions == tuple(region(box) for box in boxes)
        assert [int(np.median(patch)) for patch in asked.photo] == [90, 200]
        assert [s.forms for s in found] == [(1, 0, 0), (0, 1, 0)]
        for s, share in zip(found, (0.6, 0.5), strict=True):
            assert s.mask.sum() == pytest.approx(share * 40**2, rel=0.03)

    @pytest.mark.parametrize("answer", [NOTHING, disc(LEAST_DRAWN - 0.02), disc(1) / 2])
    def test_where_it_draws_too_little_the_network_has_drawn(self, answer: Floats) -> None:
        (found,) = segments([find()], Head([answer]))
        (alone,) = segments([find()], None)
        same(found, alone)
        assert found.forms == ()

    def test_a_little_is_enough(self) -> None:
        (found,) = segments([find()], Head([disc(LEAST_DRAWN + 0.02)]))
        assert found.forms
        assert found.mask.sum() == pytest.approx((LEAST_DRAWN + 0.02) * 40**2, rel=0.05)

    @pytest.mark.parametrize("share", [0.6, 0.45, 0.2])
    def test_the_box_stays_as_it_was_found(self, share: float) -> None:
        (found,) = segments([find()], Head([disc(share)]))
        assert found.box_px == BOX
        assert found.mask.sum() == pytest.approx(share * 40**2, rel=0.03)

    def test_only_a_mask_at_the_border_is_cut(self) -> None:
        inside, across = (-0.5, 30.5, 39.5, 70.5), (-10.5, 30.5, 29.5, 70.5)
        for box, at, cut in ((inside, 0.7, False), (across, 0.3, True), (across, 0.7, False)):
            (found,) = segments([find(box)], Head([disc(0.2, at=(at, 0.5))]))
            assert found.forms
            assert found.truncated == cut
            assert found.box_px == (-0.5, *box[1:])

    def test_where_neither_draws_anything_there_is_none(self) -> None:
        dark = np.zeros(VIEW.image.shape[:2], np.float32)
        assert segments([find(mask=dark)], Head([NOTHING])) == ()
        (found,) = segments([find(mask=dark)], Head([disc(0.6)]))
        assert found.forms

    def test_one_may_fail_while_others_do_not(self) -> None:
        boxes = [(10.5, 30.5, 40.5, 60.5), (60.5, 30.5, 90.5, 60.5), (110.5, 30.5, 140.5, 60.5)]
        found = segments([find(box) for box in boxes], Head([disc(0.6), NOTHING, disc(0.5)]))
        assert [s.box_px for s in found] == boxes
        assert [bool(s.forms) for s in found] == [True, False, True]
        areas = [int(s.mask.sum()) for s in found]
        np.testing.assert_allclose(areas, [0.6 * 900, 900, 0.5 * 900], rtol=0.05)

    def test_specks_are_dropped(self) -> None:
        answer = disc(0.5)
        answer[2:5, 2:6] = 1  # hangs together with nothing
        answer[40, 40] = 0.4  # no speck, but a doubt
        (found,) = segments([find()], Head([answer]))
        expected, _ = mask_in_photo(answer, region(BOX), WIDTH, HEIGHT)
        clean, _ = mask_in_photo(disc(0.5), region(BOX), WIDTH, HEIGHT)
        assert (expected > 0.5).sum() > (clean > 0.5).sum() + 5
        np.testing.assert_array_equal(found.mask, clean > 0.5)
        assert (found.probability == expected)[found.probability > 0].all()
        assert found.probability[-12:, -12:].max() > 0.1

    def test_specks_do_not_make_it_enough(self) -> None:
        answer = disc(LEAST_DRAWN - 0.03)
        answer[1:46:4, 1:6] = answer[1:46:4, 42:47] = 1
        whole, _ = mask_in_photo(answer, region(BOX), WIDTH, HEIGHT)
        assert (whole > 0.5).sum() > (LEAST_DRAWN + 0.05) * 40**2
        (found,) = segments([find()], Head([answer]))
        assert found.forms == ()

    @pytest.mark.parametrize(
        "box",
        [
            (-60.0, 20.0, -10.0, 60.0),
            (170.0, 20.0, 200.0, 60.0),
            (40.0, -50.0, 80.0, -0.5),
            (40.0, 119.5, 80.0, 160.0),
        ],
    )
    def test_a_find_outside_of_the_photo_is_left_out(self, box: Box) -> None:
        blind = np.ones(VIEW.image.shape[:2], np.float32)
        finds = [find(), find(box, blind), find((100.5, 30.5, 140.5, 70.5))]
        # The head is not asked about it; the others keep what is theirs.
        head = Head([disc(0.6), disc(0.5)], [(1, 0, 0), (0, 0, 1)])
        found = segments(finds, head)
        assert [s.forms for s in found] == [(1, 0, 0), (0, 0, 1)]
        assert [s.box_px[0] for s in found] == [40.5, 100.5]
        assert len(segments(finds, None)) == 2

    def test_what_the_border_cuts(self) -> None:
        # The left half of the box is outside; so is that of the disc.
        (found,) = segments([find((-20.5, 30.5, 19.5, 70.5))], Head([disc(0.7)]))
        assert found.truncated
        assert found.box_px == (-0.5, 30.5, 19.5, 70.5)
        assert found.origin_px[0] == 0
        assert found.forms
        assert found.mask.sum() == pytest.approx(0.35 * 40**2, rel=0.05)

    def test_what_is_left_in_the_photo_must_fill_its_box_too(self) -> None:
        # All that it draws is outside.
        (found,) = segments([find((-20.5, 30.5, 19.5, 70.5))], Head([disc(0.3, at=(0.1, 0.5))]))
        assert found.forms == ()
        assert found.mask.sum() == pytest.approx(20 * 40, rel=0.05)

    def test_without_finds_it_is_not_asked(self) -> None:
        head = Head([])
        assert segments([], head) == ()
        assert head.asked == []


class TestWithoutAHead:
    def test_a_crisp_mask_stays_as_it_is(self) -> None:
        (found,) = segments([find()], None)
        rows, columns = np.nonzero(found.mask)
        x, y = found.origin_px
        assert (columns.min() + x, columns.max() + x) == (41, 80)
        assert (rows.min() + y, rows.max() + y) == (31, 70)
        assert found.mask.sum() == 40**2
        assert found.forms == ()

    def test_order_and_neighbours(self) -> None:
        boxes = [(80.5, 30.5, 120.5, 70.5), BOX]
        both = find((40.5, 30.5, 120.5, 70.5)).mask
        found = segments([find(box, both) for box in boxes], None)
        assert [s.box_px for s in found] == boxes
        for s, (first, last) in zip(found, ((81, 120), (41, 80)), strict=True):
            columns = np.nonzero(s.mask)[1] + s.origin_px[0]
            assert (columns.min(), columns.max()) == (first, last)
            assert s.mask.sum() == 40**2

    def test_a_network_that_draws_nothing(self) -> None:
        dark = np.zeros(VIEW.image.shape[:2], np.float32)
        assert segments([find(mask=dark)], None) == ()


@dataclass
class Sighted(Oracle):
    """An engine with a mask head."""

    masks: Head | None = None  # type: ignore[assignment]


def test_a_photos_segments_are_the_heads() -> None:
    photo = np.zeros((480, 640, 3), np.uint8)
    photo[200:260, 300:380] = 255
    head = Head([disc(0.6)])
    (found,) = segment(photo, engine=Sighted(masks=head))  # type: ignore[arg-type]
    (alone,) = segment(photo, engine=Oracle())  # type: ignore[arg-type]
    assert alone.mask.sum() == 80 * 60
    assert found.box_px == alone.box_px
    assert found.mask.sum() == pytest.approx(0.6 * 80 * 60, rel=0.02)
    assert found.forms == pytest.approx(FORMS)
    (asked,) = head.asked
    assert (asked.rough[0] > 127).mean() == pytest.approx(1 / REACH**2, abs=0.03)


def square_find(share: float, box: Box = BOX) -> Find:
    """A find whose network's mask is a square in the middle of its box, this share of it."""
    x0, y0, x1, y1 = VIEW.to_network(np.reshape(box, (2, 2))).ravel()
    half = np.sqrt(share) * np.array([x1 - x0, y1 - y0]) / 2
    v, u = np.indices(VIEW.image.shape[:2])
    away = np.maximum(np.abs(u - (x0 + x1) / 2) / half[0], np.abs(v - (y0 + y1) / 2) / half[1])
    return find(box, (away < 1).astype(np.float32))


class TestSize:
    """The head draws the form; how large a button is, the network knows better."""

    def area(self, segment: Segment) -> float:
        x0, y0, x1, y1 = segment.box_px
        return float(segment.mask.sum() / ((x1 - x0) * (y1 - y0)))

    @pytest.mark.parametrize("share", [0.5, 0.6, 0.75])
    def test_as_large_as_the_networks(self, share: float) -> None:
        (found,) = segments([square_find(share)], Head([disc(0.6)]))
        assert found.forms == pytest.approx(FORMS)
        assert self.area(found) == pytest.approx(share, rel=0.08)

    def test_what_is_of_something_else_stays_as_it_is(self) -> None:
        (found,) = segments([square_find(0.3)], Head([disc(0.75)]))
        assert self.area(found) == pytest.approx(0.75, rel=0.05)

    def test_all_of_a_photo_alike(self) -> None:
        boxes = [(40.5, 30.5, 80.5, 70.5), (100.5, 30.5, 140.5, 70.5), (40.5, 75.5, 80.5, 115.5)]
        shares = (0.5, 0.5, 0.7)  # the network errs about one of them
        finds = [square_find(s, b) for s, b in zip(shares, boxes, strict=True)]
        found = segments(finds, Head([disc(0.6)] * 3))
        assert [self.area(f) for f in found] == pytest.approx([0.5] * 3, rel=0.08)
