"""Pixels of outlines, and overlaps of boxes and masks."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fronto.evaluate.regions import (
    Region,
    box_overlaps,
    clip_box,
    polygon_region,
    region_overlaps,
)


def full(region: Region, width: int, height: int) -> np.ndarray:
    picture = np.zeros((height, width), bool)
    x0, y0, x1, y1 = region.bounds()
    picture[y0:y1, x0:x1] = region.mask
    return picture


def inside(polygon: np.ndarray, width: int, height: int) -> np.ndarray:
    """Pixel by pixel: an odd number of sides to the left."""
    picture = np.zeros((height, width), bool)
    for y in range(height):
        for x in range(width):
            for (ax, ay), (bx, by) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
                if (ay > y) != (by > y) and ax + (y - ay) * (bx - ax) / (by - ay) <= x:
                    picture[y, x] ^= True
    return picture


def test_a_box_around_pixels_has_just_those() -> None:
    region = polygon_region([[2.5, 3.5], [7.5, 3.5], [7.5, 8.5], [2.5, 8.5]], 20, 20)
    want = np.zeros((20, 20), bool)
    want[4:9, 3:8] = True
    assert (full(region, 20, 20) == want).all()
    assert region.mask.sum() == 25


def test_neighbours_with_a_common_side_through_pixel_centres_share_no_pixel() -> None:
    left = polygon_region([[2, 2], [6, 2], [6, 9], [2, 9]], 20, 20)
    right = polygon_region([[6, 2], [10, 2], [10, 9], [6, 9]], 20, 20)
    assert left.mask.sum() == right.mask.sum() == 4 * 7
    assert region_overlaps([left], [right]).iou[0, 0] == 0


def test_what_lies_outside_of_the_photo_is_cut_off() -> None:
    square = np.array([[-10, -10], [4.5, -10], [4.5, 3.5], [-10, 3.5]])
    assert full(polygon_region(square, 20, 10), 20, 10)[:4, :5].sum() == 20
    assert polygon_region(square, 20, 10).mask.sum() == 20
    assert polygon_region(square - 100, 20, 10).mask.sum() == 0
    assert polygon_region(square + 100, 20, 10).mask.sum() == 0
    assert polygon_region([[-5, 2.5], [30, 2.5], [30, 4.5], [-5, 4.5]], 20, 10).mask.sum() == 40


@settings(derandomize=True, deadline=None, max_examples=60)
@given(st.integers(0, 10**6), st.integers(3, 9))
def test_pixels_are_those_whose_centres_are_inside(seed: int, count: int) -> None:
    rng = np.random.default_rng(seed)
    polygon = rng.uniform(-6, 26, (count, 2))
    if seed % 3 == 0:
        polygon = np.rint(polygon)
    region = polygon_region(polygon, 20, 16)
    assert (full(region, 20, 16) == inside(polygon, 20, 16)).all()


def test_overlap_of_boxes_by_hand() -> None:
    # 10x10 and the same shifted by 5: 50 common, 150 in all; a quarter of it: 25 common.
    overlaps = box_overlaps(
        [(0, 0, 10, 10)], [(5, 0, 15, 10), (0, 0, 5, 5), (10, 0, 20, 10), (0, 0, 10, 10)]
    )
    assert overlaps.iou[0] == pytest.approx([1 / 3, 0.25, 0, 1])
    assert overlaps.share[0] == pytest.approx([0.5, 0.25, 0, 1])
    assert box_overlaps([], [(0, 0, 1, 1)]).iou.shape == (0, 1)
    assert box_overlaps([(3, 3, 3, 3)], [(3, 3, 3, 3)]).iou[0, 0] == 0


@settings(derandomize=True, deadline=None, max_examples=40)
@given(st.integers(0, 10**6))
def test_overlap_of_masks_is_that_of_whole_pictures(seed: int) -> None:
    rng = np.random.default_rng(seed)
    regions = []
    for _ in range(4):
        x, y, w, h = rng.integers(0, 15, 4)
        regions.append(Region((int(x), int(y)), rng.random((h, w)) < 0.6))
    overlaps = region_overlaps(regions[:2], regions[2:])
    for i, a in enumerate(full(r, 30, 30) for r in regions[:2]):
        for j, b in enumerate(full(r, 30, 30) for r in regions[2:]):
            common, union = (a & b).sum(), (a | b).sum()
            assert overlaps.iou[i, j] == (common / union if union else 0)
            assert overlaps.share[i, j] == (common / a.sum() if a.any() else 0)


def test_boxes_are_cut_at_the_photos_border() -> None:
    assert clip_box((-4, 2, 5, 30), 20, 10) == (-0.5, 2, 5, 9.5)
    assert clip_box((20, 2, 25, 5), 20, 10) is None
