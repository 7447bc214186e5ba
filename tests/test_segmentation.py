"""Photo to masks through an engine that knows the answer."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fronto.categories import CATEGORIES
from fronto.engine import Maps, Verdicts
from fronto.errors import InputError
from fronto.finds import owned
from fronto.relations import Candidates
from fronto.segmentation import segment
from fronto.segments import Segment, Segments


class AllAlike:
    """A relation head to which all but the odd one out are buttons."""

    def run(self, candidates: Candidates) -> Verdicts:
        n = len(candidates.looks)
        odd = np.abs(candidates.geometry[:, 2]) > 0.5
        kinds = np.where(odd[:, None], [0.96, 0.03, 0.01], [0.2, 0.75, 0.05])
        classes = np.eye(11)[np.full(n, CATEGORIES.index("number"))]
        return Verdicts(
            kinds.astype(np.float32), classes.astype(np.float32), np.zeros((n, 4), np.float32)
        )


@dataclass
class Oracle:
    """Takes bright things for buttons: boxes are those of bright pieces in what it is shown."""

    relations: AllAlike | None = None
    verifier: None = None
    masks: None = None
    reader: None = None
    stride: int = 4
    shapes: list[tuple[int, ...]] = field(default_factory=list)

    def run(self, images: npt.NDArray[np.uint8]) -> Maps:
        import cv2

        self.shapes.append(images.shape)
        _, height, width, _ = images.shape
        h, w = height // 4, width // 4
        bright = images[0].min(axis=2) / np.float32(255)
        count, _, stats, _ = cv2.connectedComponentsWithStats(
            (bright > 0.5).astype(np.uint8), connectivity=4
        )
        centers = np.zeros((1, 2, h, w), np.float32)
        sides = np.ones((1, 4, h, w), np.float32)
        classes = np.zeros((1, 11, h, w), np.float32)
        classes[:, CATEGORIES.index("up")] = 1
        x, y = np.meshgrid(np.arange(w) * 4 + 1.5, np.arange(h) * 4 + 1.5)
        for k in range(1, count):
            left, top, wide, high, _ = stats[k]
            x0, y0, x1, y1 = left - 0.5, top - 0.5, left + wide - 0.5, top + high - 0.5
            near = (x >= x0 - 4) & (x <= x1 + 4) & (y >= y0 - 4) & (y <= y1 + 4)
            for part, values in enumerate((x - x0, y - y0, x1 - x, y1 - y)):
                sides[0, part][near] = values[near]
            j, i = round(((x0 + x1) / 2 - 1.5) / 4), round(((y0 + y1) / 2 - 1.5) / 4)
            centers[0, 0, min(max(i, 0), h - 1), min(max(j, 0), w - 1)] = 0.9
        masks = np.stack([bright, np.zeros_like(bright)])[None]
        features = None if self.relations is None else np.zeros((1, 3, h, w), np.float32)
        return Maps(masks, classes, centers, sides, features)


def _photo(
    boxes: list[tuple[int, int, int, int]], height: int = 480, width: int = 640
) -> npt.NDArray[np.uint8]:
    image = np.zeros((height, width, 3), np.uint8)
    for x0, y0, x1, y1 in boxes:
        image[y0:y1, x0:x1] = 255
    return image


def _run(image: npt.NDArray[np.uint8], **options: object) -> Segments:
    return segment(image, engine=Oracle(), **options)  # type: ignore[arg-type]


def test_masks_and_boxes_are_those_of_the_photo() -> None:
    found = _run(_photo([(100, 50, 140, 90), (300, 200, 380, 260)]))
    assert (found.width_px, found.height_px, len(found)) == (640, 480, 2)
    by_x = sorted(found, key=lambda s: s.box_px)
    np.testing.assert_allclose(by_x[0].box_px, (99.5, 49.5, 139.5, 89.5), atol=1e-4)
    assert [s.category for s in by_x] == ["up", "up"]
    assert (found.instance_map() > 0).sum() == 40 * 40 + 80 * 60
    assert not any(s.truncated for s in found)


@pytest.mark.parametrize(
    ("height", "width"), [(333, 517), (601, 799), (1200, 1601), (150, 203), (97, 1000), (1500, 211)]
)
def test_no_size_shifts_the_masks(height: int, width: int) -> None:
    x0, y0 = width // 3, height // 3
    box = (x0, y0, x0 + min(70, width // 4), y0 + min(90, height // 4))
    result = _run(_photo([box], height, width))
    (found,) = result
    tolerance = 0.6 * max(1.0, np.sqrt(width * height / 307_200))
    np.testing.assert_allclose(found.box_px, np.array(box) - 0.5, atol=tolerance)
    rows, columns = np.nonzero(result.instance_map())
    extent = (columns.min(), rows.min(), columns.max() + 1, rows.max() + 1)
    np.testing.assert_allclose(extent, box, atol=tolerance + 0.5)
    middle = (columns.mean(), rows.mean())
    expected = ((box[0] + box[2] - 1) / 2, (box[1] + box[3] - 1) / 2)
    np.testing.assert_allclose(middle, expected, atol=0.3 * max(1, tolerance))


@dataclass
class Unsure(Oracle):
    """Its masks are blurred, and no surer than this."""

    blur_px: float = 8.0
    most: float = 1.0

    def run(self, images: npt.NDArray[np.uint8]) -> Maps:
        import cv2

        maps = super().run(images)
        soft = cv2.GaussianBlur(maps.masks[0, 0], (0, 0), self.blur_px) * self.most
        return replace(maps, masks=np.stack([soft, maps.masks[0, 1]])[None].astype(np.float32))


def test_of_a_soft_mask_the_surest_part_is_kept_all_around() -> None:
    photo = _photo([(300, 200, 380, 280)])
    (found,) = segment(photo, engine=Unsure())  # type: ignore[arg-type]
    rows, columns = np.nonzero(found.mask)
    center = found.origin_px + np.array([columns.mean(), rows.mean()])
    np.testing.assert_allclose(center, (339.5, 239.5), atol=0.3)
    # Blurred alone, it is 77 pixels wide at a half.
    assert 0.8 * 80**2 < found.mask.sum() < 0.93 * 80**2


def test_a_find_whose_pixels_are_unsure_has_a_mask() -> None:
    photo = _photo([(300, 200, 380, 280), (100, 100, 160, 160)])
    found = segment(photo, engine=Unsure(blur_px=2.0, most=0.4))  # type: ignore[arg-type]
    assert len(found) == 2
    for s in found:
        x0, y0, x1, y1 = s.box_px
        assert 0.4 < s.mask.sum() / ((x1 - x0) * (y1 - y0)) < 1
    assert len(segment(photo, engine=Unsure(most=0.01))) == 0  # type: ignore[arg-type]


def test_a_button_at_the_border_is_marked() -> None:
    (found,) = _run(_photo([(0, 100, 30, 140)]))
    assert found.truncated
    assert found.box_px[0] == -0.5


def test_small_buttons_of_a_large_photo_are_looked_at_again() -> None:
    photo = _photo([(2000 + 90 * k, 1500, 2050 + 90 * k, 1550) for k in range(8)], 3000, 4000)
    engine = Oracle()
    found = segment(photo, engine=engine)  # type: ignore[arg-type]
    assert len(engine.shapes) > 1
    assert len(found) == 8
    once = Oracle()
    segment(photo, engine=once, second_look=False)  # type: ignore[arg-type]
    assert len(once.shapes) == 1
    boxes = sorted(s.box_px for s in found)
    np.testing.assert_allclose(boxes[0], (1999.5, 1499.5, 2049.5, 1549.5), atol=1.5)


def test_what_is_not_sure_enough_is_left_out() -> None:
    photo = _photo([(100, 50, 140, 90)])
    assert len(_run(photo, min_confidence=0.89)) == 1
    assert len(_run(photo, min_confidence=0.91)) == 0
    with pytest.raises(InputError, match="min_confidence"):
        _run(photo, min_confidence=1.5)


def test_a_relation_head_has_the_last_word() -> None:
    keys = [(100 + 80 * k, 50, 140 + 80 * k, 90) for k in range(4)]
    photo = _photo([*keys, (100, 200, 240, 340)])
    alone = segment(photo, engine=Oracle())  # type: ignore[arg-type]
    assert len(alone) == 5
    together = segment(photo, engine=Oracle(AllAlike()))  # type: ignore[arg-type]
    assert sorted(s.box_px[0] for s in together) == [x - 0.5 for x, *_ in keys]
    assert {(s.category, round(s.confidence, 3)) for s in together} == {("number", 0.75)}


def test_nothing_is_an_answer() -> None:
    found = _run(_photo([]))
    assert len(found) == 0
    assert not found.instance_map().any()
    assert found.timing_ms["total"] > 0


def test_masks_of_touching_boxes_do_not_overlap() -> None:
    photo = _photo([(100, 50, 140, 90)])
    photo[50:90, 140:142] = 120  # joined by a bridge that is not bright enough to be one piece
    photo[50:90, 142:182] = 255
    found = _run(photo)
    assert len(found) == 2
    whole = sum(int(s.mask.sum()) for s in found)
    assert whole == int((found.instance_map() > 0).sum())


@settings(derandomize=True, deadline=None, max_examples=25)
@given(st.integers(40, 700), st.integers(40, 700), st.integers(0, 2**31))
def test_every_result_lies_in_the_photo(height: int, width: int, seed: int) -> None:
    rng = np.random.default_rng(seed)
    photo = (rng.random((height, width, 3)) > 0.995).astype(np.uint8) * 255
    for found in _run(photo):
        x, y = found.origin_px
        rows, columns = found.mask.shape
        assert x >= 0
        assert y >= 0
        assert x + columns <= width
        assert y + rows <= height
        assert found.mask.any()


def test_masks_of_others_become_segments() -> None:
    masks = np.zeros((2, 30, 40), bool)
    masks[0, 5:10, 4:12] = True
    masks[1, 20:30, 30:40] = True
    found = Segments.from_masks(masks, ["up", "plate"])
    assert [s.category for s in found] == ["up", "plate"]
    assert found.segments[0].box_px == (3.5, 4.5, 11.5, 9.5)
    assert found.segments[1].truncated
    assert (found.buttons, found.plates) == (found.segments[:1], found.segments[1:])
    np.testing.assert_array_equal(found.instance_map(), masks[0] * 1 + masks[1] * 2)
    assert set(np.unique(found.category_map())) == {0, 1, 10}


@pytest.mark.parametrize(
    ("masks", "categories", "thing"),
    [
        (np.zeros((3, 4), bool), None, "masks"),
        (np.zeros((1, 3, 4), bool), None, r"masks\[0\]"),
        (np.full((1, 3, 4), 2.0), None, r"masks\[0\]"),
        (np.ones((1, 3, 4), np.int64), None, "masks"),
        (np.ones((2, 3, 4), bool), ["up"], "categories"),
        (np.ones((1, 3, 4), bool), ["lift"], "category"),
    ],
)
def test_wrong_masks_are_refused(masks: object, categories: list[str] | None, thing: str) -> None:
    with pytest.raises(InputError, match=thing):
        Segments.from_masks(masks, categories)  # type: ignore[arg-type]


def test_a_segment_keeps_its_own_copy() -> None:
    probability = np.ones((3, 4), np.float32)
    found = Segment("up", 0.9, (0.0, 0.0, 1.0, 1.0), (0, 0), probability)
    probability[:] = 0
    assert found.mask.all()
    with pytest.raises(ValueError, match="read-only"):
        found.probability[0, 0] = 0


@pytest.mark.parametrize("roll_deg", [0.0, 20.0, 45.0])
def test_neighbours_on_a_turned_keypad_keep_their_corners(roll_deg: float) -> None:
    """Boxes of turned neighbours overlap; what lies in both belongs to the nearer middle."""
    a = np.radians(roll_deg)
    turn = np.array([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]])
    grid = np.array([(i, j) for i in (-1, 0, 1) for j in (-1, 0, 1)], float)
    centers = 24 * grid @ turn + 60
    reach = 11 * (abs(np.cos(a)) + abs(np.sin(a)))
    boxes = np.hstack([centers - reach, centers + reach])
    at = np.arange(30.0, 91.0)
    own = owned(boxes, 4, at, at)
    y, x = np.mgrid[30:91, 30:91] - 60.0
    places = np.stack([x, y], axis=-1) @ turn.T
    assert own[(np.abs(places) <= 11).all(axis=-1)].all()
    neighbour = (np.abs(places - (24, 0)) <= 11).all(axis=-1)
    assert not own[neighbour].any()
