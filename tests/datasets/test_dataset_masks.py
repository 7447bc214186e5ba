"""Masks to outlines along the pixels' edges; run lengths of COCO."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fronto.datasets.masks import coco_mask, join_pieces, mask_polygon, row_mask
from fronto.datasets.records import polygon_box
from fronto.errors import InputError


def rasterized(polygon: np.ndarray, shape: tuple[int, int]) -> np.ndarray:
    """Pixels whose centres lie inside (even-odd rule)."""
    y, x = np.mgrid[: shape[0], : shape[1]].astype(float)
    inside = np.zeros(shape, bool)
    for (x0, y0), (x1, y1) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        crosses = (y0 > y) != (y1 > y)
        with np.errstate(divide="ignore", invalid="ignore"):
            inside ^= crosses & (x < x0 + (y - y0) / (y1 - y0) * (x1 - x0))
    return inside


def test_a_box_of_pixels_reaches_from_edge_to_edge() -> None:
    mask = np.zeros((20, 30), bool)
    mask[4:9, 3:8] = True
    polygon = mask_polygon(mask)
    assert polygon_box(polygon) == (2.5, 3.5, 7.5, 8.5)
    assert len(polygon) == 4
    corner = np.zeros((5, 5), bool)
    corner[0, 0] = True
    assert polygon_box(mask_polygon(corner)) == (-0.5, -0.5, 0.5, 0.5)


@settings(derandomize=True, deadline=None, max_examples=60)
@given(st.integers(0, 10**6))
def test_outline_holds_the_same_pixels(seed: int) -> None:
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[:40, :50]
    a, b, angle = rng.uniform(2, 15), rng.uniform(2, 15), rng.uniform(0, 3)
    u = (x - 25) * np.cos(angle) + (y - 20) * np.sin(angle)
    v = (y - 20) * np.cos(angle) - (x - 25) * np.sin(angle)
    mask = (u / a) ** 2 + (v / b) ** 2 <= 1
    assert (rasterized(mask_polygon(mask), mask.shape) == mask).all()


def test_specks_holes_and_pieces() -> None:
    mask = np.zeros((40, 40), bool)
    mask[10:20, 10:20] = True
    mask[14:16, 14:16] = False
    mask[35, 35] = True
    assert polygon_box(mask_polygon(mask)) == (9.5, 9.5, 19.5, 19.5)
    mask[24:34, 10:20] = True
    assert polygon_box(mask_polygon(mask)) == (9.5, 9.5, 19.5, 33.5)
    with pytest.raises(InputError):
        mask_polygon(np.zeros((4, 4), bool))


def test_join_pieces() -> None:
    square = np.array([[0, 0], [4, 0], [2, 1], [4, 4], [0, 4.0]])
    assert (join_pieces([square]) == square).all()
    hull = join_pieces([square, np.add(square, (6, 0))])
    assert sorted(map(tuple, hull.tolist())) == [(0, 0), (0, 4), (10, 0), (10, 4)]


def test_run_lengths_by_hand() -> None:
    # Columns: 2 rows, 3 columns, the second column and the pixel after it.
    expected = [[False, True, True], [False, True, False]]
    assert coco_mask([2, 3, 1], 2, 3).tolist() == expected
    assert coco_mask("231", 2, 3).tolist() == expected  # small lengths are their own digits
    assert row_mask([1, 2, 3], 2, 3).tolist() == [[False, True, True], [False] * 3]


def test_compressed_run_lengths() -> None:
    # What pycocotools 2.0.11 encodes for the pixels 3..8 by 4..11 of 20 rows by 30 columns.
    mask = np.zeros((20, 30), bool)
    mask[3:9, 4:12] = True
    assert (coco_mask("c26>0000000000000U;", 20, 30) == mask).all()


@settings(derandomize=True, deadline=None, max_examples=50)
@given(st.integers(0, 10**6))
def test_against_pycocotools(seed: int) -> None:
    codec = pytest.importorskip("pycocotools.mask")
    rng = np.random.default_rng(seed)
    mask = rng.random(rng.integers(1, 60, 2)) < rng.choice([0.02, 0.5, 0.98])
    encoded = codec.encode(np.asfortranarray(mask.astype(np.uint8)))
    assert (coco_mask(encoded["counts"].decode(), *mask.shape) == mask).all()


@pytest.mark.parametrize(
    "counts", [[], [3], [7], [2, -3, 7], "", "2", "23", "c2", "c26>000", "\x00", "é", "o" * 40]
)
def test_other_run_lengths_are_refused(counts: list[int] | str) -> None:
    with pytest.raises(InputError):
        coco_mask(counts, 2, 3)


@pytest.mark.parametrize(("height", "width"), [(0, 3), (-2, -3), (10**6, 10**6)])
def test_sizes_of_no_mask_are_refused(height: int, width: int) -> None:
    with pytest.raises(InputError):
        row_mask([6], height, width)
