"""Maps to instances: hand-made maps with known boxes."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fronto.grouping import Instance, distinct, group, overlaps

STRIDE = 4
Maps = tuple[npt.NDArray[np.float32], npt.NDArray[np.float32], npt.NDArray[np.float32]]


def _maps(
    boxes: list[tuple[float, float, float, float]],
    *,
    plates: tuple[int, ...] = (),
    classes: list[int] | None = None,
    height: int = 40,
    width: int = 60,
) -> Maps:
    """What a perfect network says of some boxes (network pixels)."""
    centers = np.zeros((2, height, width), np.float32)
    sides = np.ones((4, height, width), np.float32)
    scores = np.zeros((11, height, width), np.float32)
    scores[0] = 1
    x = np.arange(width) * STRIDE + 1.5
    y = (np.arange(height) * STRIDE + 1.5)[:, None]
    for k, (x0, y0, x1, y1) in enumerate(boxes):
        inside = (x > x0) & (x < x1) & (y > y0) & (y < y1)
        for part, values in enumerate((x - x0, y - y0, x1 - x, y1 - y)):
            sides[part][inside] = np.broadcast_to(values, inside.shape)[inside]
        scores[:, inside] = 0
        scores[10 if k in plates else (classes[k] if classes else 4)][inside] = 1
        distance = ((x - (x0 + x1) / 2) / (x1 - x0)) ** 2 + ((y - (y0 + y1) / 2) / (y1 - y0)) ** 2
        plane = centers[int(k in plates)]
        np.maximum(plane, np.exp(-40 * distance).astype(np.float32) * inside, out=plane)
        plane[round(((y0 + y1) / 2 - 1.5) / STRIDE), round(((x0 + x1) / 2 - 1.5) / STRIDE)] = 0.99
    return centers, sides, scores


def _found(maps: Maps) -> list[Instance]:
    return group(*maps, STRIDE)


def test_one_button_comes_out_with_its_box_and_class() -> None:
    (found,) = _found(_maps([(20.0, 30.0, 61.0, 75.0)], classes=[5]))
    assert not found.plate
    np.testing.assert_allclose(found.box, (20, 30, 61, 75), atol=1e-4)
    assert int(np.argmax(found.scores)) == 5
    assert found.confidence > 0.9


def test_buttons_that_touch_stay_apart() -> None:
    keys = [
        (20.0 + 16 * i, 20.0 + 16 * j, 36.0 + 16 * i, 36.0 + 16 * j)
        for i in range(3)
        for j in range(4)
    ]
    found = _found(_maps(keys))
    assert len(found) == 12
    boxes = sorted(tuple(np.round(f.box, 3)) for f in found)
    np.testing.assert_allclose(boxes, sorted(keys), atol=1e-3)


def test_a_plate_is_told_from_the_button_beside_it() -> None:
    found = _found(_maps([(20.0, 20.0, 60.0, 60.0), (64.0, 20.0, 104.0, 60.0)], plates=(1,)))
    assert [(f.plate, round(f.box[0])) for f in sorted(found, key=lambda f: f.box[0])] == [
        (False, 20),
        (True, 64),
    ]


def test_nothing_is_found_in_an_empty_picture() -> None:
    assert _found(_maps([])) == []


def test_surest_comes_first() -> None:
    centers, sides, scores = _maps([(20.0, 20.0, 50.0, 50.0), (100.0, 60.0, 140.0, 100.0)])
    centers[:, :, :20] *= 0.5
    found = group(centers, sides, scores, STRIDE)
    assert [round(f.box[0]) for f in found] == [100, 20]
    assert found[0].confidence > found[1].confidence


def test_two_peaks_of_one_button_are_one() -> None:
    centers, sides, scores = _maps([(20.0, 20.0, 120.0, 100.0)])
    centers[0, 13, 15], centers[0, 17, 19] = 0.97, 0.99
    assert len(group(centers, sides, scores, STRIDE)) == 1


def test_weaker_centres_are_found_where_they_are_asked_for() -> None:
    centers, sides, scores = _maps([(20.0, 20.0, 50.0, 50.0), (100.0, 60.0, 140.0, 100.0)])
    centers[:, :, :20] *= 0.2
    assert len(group(centers, sides, scores, STRIDE)) == 1
    weak = group(centers, sides, scores, STRIDE, least=0.15)
    assert [round(f.box[0]) for f in weak] == [100, 20]
    assert group(centers, sides, scores, STRIDE, least=0.995) == []


def test_of_boxes_on_one_thing_the_first_is_kept() -> None:
    boxes = np.array([[x, 0.0, x + 20.0, 20.0] for x in (0, 30, 3, 9)])
    assert distinct(boxes) == [0, 1, 3]
    assert distinct(boxes[::-1]) == [0, 2, 3]  # the last hides the third, not the first
    assert distinct(boxes, same=0.3) == [0, 1]
    assert distinct(boxes, same=0.8) == [0, 1, 2, 3]
    assert distinct(boxes[:0]) == []


def test_overlaps_of_known_boxes() -> None:
    box = np.array([0.0, 0.0, 2.0, 2.0])
    others = np.array([[0.0, 0, 2, 2], [1, 0, 3, 2], [2, 2, 3, 3], [5, 5, 6, 6]])
    assert overlaps(box, others) == pytest.approx([1, 1 / 3, 0, 0])


@settings(derandomize=True, deadline=None, max_examples=60)
@given(st.floats(2, 100), st.floats(2, 60), st.floats(9, 120), st.floats(9, 90))
def test_any_box_is_found_exactly(x0: float, y0: float, width: float, height: float) -> None:
    box = (x0, y0, x0 + width, y0 + height)
    (found,) = _found(_maps([box]))
    np.testing.assert_allclose(found.box, box, atol=1e-3)
