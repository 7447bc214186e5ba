"""Where masks' edges run: half pixels, soft probabilities, closing, the photo's border."""

import cv2
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from panelforms import circle, view
from panelmaker import panel

from fronto import Segment
from fronto.native import address
from fronto.outlines.edges import _kernels, closed_mask, edge_points

fixed = settings(derandomize=True, deadline=None, max_examples=60)


def segment(probability, origin=(0, 0)):
    return Segment("number", 1.0, (0, 0, 1, 1), origin, np.asarray(probability, np.float32))


def box(x0, y0, x1, y1, width=60, height=50):
    """A mask of the pixels x0..x1, y0..y1."""
    mask = np.zeros((height, width), bool)
    mask[y0 : y1 + 1, x0 : x1 + 1] = True
    return mask


def points_of(mask, origin=(0, 0), size=None):
    height, width = np.shape(mask)
    return edge_points([segment(mask, origin)], *(size or (width, height)))


def off_box(xy, x0, y0, x1, y1):
    """Distance of points inside or outside from the box's outline."""
    dx, dy = np.abs(xy[:, 0] - (x0 + x1) / 2) - (x1 - x0) / 2, np.abs(xy[:, 1] - (y0 + y1) / 2)
    dy -= (y1 - y0) / 2
    return np.abs(
        np.hypot(np.maximum(dx, 0), np.maximum(dy, 0)) + np.minimum(np.maximum(dx, dy), 0)
    )


def test_pixels_3_to_7_end_at_2_5_and_7_5():
    found = points_of(box(3, 4, 7, 9, 14, 16))
    assert found.xy.min(axis=0).tolist() == [2.5, 3.5]
    assert found.xy.max(axis=0).tolist() == [7.5, 9.5]
    assert len(found.xy) == 2 * (5 + 6)
    assert off_box(found.xy, 2.5, 3.5, 7.5, 9.5).max() == 0
    assert found.size[0] == pytest.approx(np.sqrt(30))
    assert found.blur[0] == pytest.approx(1)
    assert not found.border.any()


def test_one_pixel():
    found = points_of(box(3, 4, 3, 4, 9, 9))
    expected = [[2.5, 4.0], [3.0, 3.5], [3.0, 4.5], [3.5, 4.0]]
    assert sorted(found.xy.tolist()) == expected


@fixed
@given(st.floats(6, 14), st.floats(6, 14), st.floats(12, 30), st.floats(12, 30), st.floats(2, 5))
def test_soft_probabilities_cross_one_half_where_the_edge_is(x0, y0, wide, high, blur):
    x1, y1 = x0 + wide, y0 + high
    y, x = np.mgrid[:50, :50]
    depth = np.minimum(np.minimum(x - x0, x1 - x), np.minimum(y - y0, y1 - y))
    probability = np.clip(0.5 + depth / blur, 0, 1)
    assume((np.abs(probability - 0.5) > 1e-6).all())  # see below
    found = points_of(probability)
    # At the corners two ramps meet, and the crossing between neighbours is not linear.
    inner = (
        np.abs(found.xy - [(x0 + x1) / 2, (y0 + y1) / 2]) < np.array([wide, high]) / 2 - 1
    ).any(1)
    assert inner.sum() > 30
    assert off_box(found.xy[inner], x0, y0, x1, y1).max() < 1e-4
    assert found.blur[0] == pytest.approx(blur, rel=0.1)


def test_a_crossing_by_hand():
    row = np.zeros((3, 8))
    row[1] = [0, 0.1, 0.9, 1, 1, 0.75, 0.25, 0]
    found = points_of(row, size=(8, 3))
    across = found.xy[found.xy[:, 1] == 1]
    np.testing.assert_allclose(np.sort(across[:, 0]), [1.5, 5.5], atol=1e-6)
    row[1] = [0, 0.3, 0.7, 1, 1, 0.9, 0.4, 0]
    found = points_of(row, size=(8, 3))
    across = found.xy[found.xy[:, 1] == 1]
    np.testing.assert_allclose(np.sort(across[:, 0]), [1.5, 5.8], atol=1e-6)


@pytest.mark.parametrize("inner", [0.6, 1.0])
def test_a_probability_of_exactly_one_half_is_the_edge_itself(inner):
    # An anti-aliased mask whose edge runs through pixel centres.
    row = np.zeros((3, 8))
    row[1] = [0, 0.5, inner, 1, 1, inner, 0.5, 0]
    found = points_of(row, size=(8, 3))
    across = found.xy[found.xy[:, 1] == 1]
    np.testing.assert_allclose(np.sort(across[:, 0]), [1, 6], atol=1e-6)


def test_exactly_one_half_is_outside():
    assert len(points_of(np.full((9, 9), 0.5)).xy) == 0
    soft = np.where(box(3, 3, 8, 8), 1.0, 0.5)
    assert points_of(soft).size[0] == pytest.approx(6)


@fixed
@given(st.integers(-500, 2000), st.integers(-500, 2000))
def test_the_origin_moves_the_points(dx, dy):
    mask = box(3, 4, 20, 30)
    here, there = points_of(mask, size=(4000, 4000)), points_of(mask, (dx, dy), (4000, 4000))
    np.testing.assert_allclose(there.xy - here.xy, np.tile([dx, dy], (len(here.xy), 1)), atol=1e-9)


def test_points_on_the_photos_border_are_flagged():
    found = points_of(box(0, 30, 25, 49))
    left, low = found.xy[:, 0] < 0, found.xy[:, 1] > 49
    assert left.sum() == 20
    assert low.sum() == 26
    np.testing.assert_array_equal(found.border, left | low)
    # The array's border is not the photo's.
    assert not points_of(box(0, 30, 25, 49), (10, 10), (200, 200)).border.any()


def test_a_soft_mask_at_the_border_is_flagged_too():
    found = points_of(np.full((9, 12), 0.6))
    assert found.border.all()
    assert len(found.xy) == 2 * (9 + 12)


def test_holes_are_filled_and_specks_left_out():
    whole = points_of(box(10, 10, 40, 40))
    mask = box(10, 10, 40, 40)
    mask[15:30, 15:22] = False  # a glyph
    mask[2:5, 50:53] = True
    mask[45, ::2] = True
    found = points_of(mask)
    assert sorted(found.xy.tolist()) == sorted(whole.xy.tolist())
    assert found.size[0] == pytest.approx(31)


@pytest.mark.parametrize(("side", "notch"), [(30, 1), (40, 1), (60, 2), (90, 3)])
def test_notches_are_closed(side, notch):
    whole = box(10, 10, 9 + side, 9 + side, side + 20, side + 20)
    middle = 10 + side // 2
    mask = whole.copy()
    mask[10 : 10 + side // 3, middle : middle + notch] = False
    mask[middle : middle + notch, 10 : 10 + side // 3] = False
    # A round kernel leaves a dent of a pixel at each mouth.
    left = np.argwhere(closed_mask(mask) != whole)
    assert len(left) <= 2 * notch
    assert (left.min(axis=1) == 10).all()
    assert off_box(points_of(mask).xy, 9.5, 9.5, 9.5 + side, 9.5 + side).max() <= 1


def test_wide_dents_stay():
    mask = box(10, 10, 49, 49)
    mask[10:20, 22:37] = False
    assert closed_mask(mask)[12:18, 25:34].max() == 0


@fixed
@given(st.integers(0, 20), st.integers(0, 20), st.integers(1, 39), st.integers(1, 39))
def test_closing_leaves_boxes_alone_also_at_the_border(x, y, wide, high):
    mask = box(x, y, min(x + wide, 39), min(y + high, 39), 40, 40)
    closed = closed_mask(mask)
    assert closed.dtype == np.uint8
    np.testing.assert_array_equal(closed, mask)


def test_closing_leaves_discs_alone():
    made = panel(np.random.default_rng(0), circle, side=40, to_px=view())
    for s in made.segments():
        np.testing.assert_array_equal(closed_mask(s.mask), s.mask)


def test_several_masks_and_none():
    masks = [box(3, 3, 12, 12), np.zeros((50, 60), bool), box(20, 20, 50, 40)]
    found = edge_points([segment(m) for m in masks], 60, 50)
    np.testing.assert_array_equal(np.diff(found.first), [40, 0, 104])
    np.testing.assert_array_equal(found.size, [10, 0, np.sqrt(31 * 21)])
    np.testing.assert_array_equal(np.bincount(found.owner), [40, 0, 104])
    assert found.first.dtype == np.int64
    assert np.isfinite(found.blur).all()
    none = edge_points([], 60, 50)
    assert none.xy.shape == (0, 2)
    assert none.first.tolist() == [0]
    assert none.size.shape == none.blur.shape == (0,)


def test_masks_are_left_as_they_are():
    made = segment(box(3, 3, 12, 12))
    before = made.probability.copy()
    edge_points([made], 60, 50)
    np.testing.assert_array_equal(made.probability, before)


@fixed
@given(
    arrays(bool, st.tuples(st.integers(1, 9), st.integers(1, 30)), elements=st.booleans()),
    st.booleans(),
)
def test_one_piece_without_holes_is_told_from_others(mask, filled):
    padded = np.pad(mask, 1)
    if filled:  # random pixels hardly ever are one piece
        padded = rows_filled(padded)
    inside = padded[1:-1, 1:-1]
    contours, _ = cv2.findContours(padded.astype(np.uint8), cv2.RETR_CCOMP, cv2.CHAIN_APPROX_SIMPLE)
    pixels = np.ascontiguousarray(inside, np.uint8)
    whole = _kernels()[0](*pixels.shape, address(pixels, np.uint8))
    assert bool(whole) == (len(contours) <= 1)


def rows_filled(mask):
    """The hull of each row's pixels."""
    reached = np.maximum.accumulate(mask, axis=1)
    return reached & np.maximum.accumulate(mask[:, ::-1], axis=1)[:, ::-1]
