"""The paper's way: closing, edge, Hough transform, two pairs of lines, intersections."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from panelforms import circle, mapped, quad, view
from panelmaker import corner_errors, panel, rms

from fronto import Segment, Segments, outline
from fronto.outlines.hough import hough_corners
from fronto.shapes import order_corners

fixed = settings(derandomize=True, deadline=None, max_examples=30)


def segment(mask, origin=(0, 0)):
    return Segment("number", 1.0, (0, 0, 1, 1), origin, np.asarray(mask, np.float32))


def test_corners_of_an_upright_rectangle():
    mask = np.zeros((60, 80))
    mask[10:40, 20:65] = 1
    found = order_corners(hough_corners(segment(mask)))
    expected = [[19.5, 9.5], [64.5, 9.5], [64.5, 39.5], [19.5, 39.5]]
    np.testing.assert_allclose(found, expected, atol=1.0)
    # In the photo: the mask's place is added.
    there = order_corners(hough_corners(segment(mask, (300, 200))))
    np.testing.assert_allclose(there, np.add(found, [300, 200]), atol=1e-9)


@fixed
@given(st.floats(-30, 30), st.floats(-20, 20), st.floats(-20, 20), st.integers(0, 99))
def test_corners_in_the_papers_order(roll, x, y, seed):
    made = panel(
        np.random.default_rng(seed),
        quad,
        side=45,
        radius=0.05,
        columns=1,
        rows=1,
        to_px=view(roll, x, y),
    )
    found = outline(made.segments(), corners="hough").buttons
    errors = corner_errors(made, found)
    assert np.abs(errors).max() < 4.0
    center = mapped(made.forms[0].to_px, [0, 0])
    top_left = found[0].corners_px[0] - center
    c, s = np.cos(np.radians(roll)), np.sin(np.radians(roll))
    upright = np.array([[c, s], [-s, c]]) @ top_left
    assert upright[0] < 0 > upright[1]


@pytest.mark.parametrize("radius", [0, 0.1])
@pytest.mark.parametrize("side", [30, 60])
def test_coarser_than_subpixel_on_the_same_masks(side, radius):
    rng = np.random.default_rng(side)
    errors = {"hough": [], "subpixel": []}
    for _ in range(5):
        made = panel(rng, quad, side=side, radius=radius)
        for way, values in errors.items():
            values.append(corner_errors(made, outline(made.segments(), corners=way).buttons))
    coarse, fine = rms(errors["hough"]), rms(errors["subpixel"])
    assert fine < coarse < 1.2
    assert coarse > 0.2


def test_deviations_are_said_to_be_coarser():
    made = panel(np.random.default_rng(1), quad, side=40)
    segments = made.segments()
    coarse = outline(segments, corners="hough").buttons
    fine = outline(segments).buttons
    assert min(o.std_px for o in coarse) > max(o.std_px for o in fine)


def test_holes_notches_and_specks_are_closed_first():
    mask = np.zeros((80, 80), bool)
    mask[10:70, 10:70] = True
    whole = hough_corners(segment(mask))
    mask[20:50, 30:40] = False
    mask[10:30, 45:47] = False
    mask[2:5, 2:5] = True
    np.testing.assert_allclose(hough_corners(segment(mask)), whole, atol=1.0)


def test_round_buttons_stay_ellipses():
    made = panel(np.random.default_rng(2), circle, side=30)
    segments = made.segments()
    found = outline(segments, corners="hough").buttons
    assert [o.shape for o in found] == ["ellipse"] * 12
    for one, other in zip(found, outline(segments).buttons, strict=True):
        assert one.ellipse_px == other.ellipse_px


def test_the_photo_changes_nothing():
    made = panel(np.random.default_rng(3), quad, side=30)
    segments = made.segments()
    without = outline(segments, corners="hough")
    found = outline(segments, made.picture(), corners="hough")
    assert found.lines == ()
    assert found.from_image == (0.0,) * 12
    for one, other in zip(found.buttons, without.buttons, strict=True):
        np.testing.assert_array_equal(one.corners_px, other.corners_px)


@pytest.mark.parametrize("wide", [1, 2, 40])
def test_no_four_lines(wide):
    mask = np.zeros((50, 50))
    mask[20, 5 : 5 + wide] = 1
    assert hough_corners(segment(mask)) is None


def test_an_empty_mask():
    assert hough_corners(segment(np.zeros((9, 9)))) is None


def test_a_disc_has_no_sides_or_some_that_bound_it():
    y, x = np.mgrid[:60, :60]
    found = hough_corners(segment((x - 30) ** 2 + (y - 30) ** 2 < 20**2))
    assert found is None or (found.shape == (4, 2) and np.isfinite(found).all())


def test_what_has_no_lines_is_told():
    mask = np.zeros((1, 40, 40), bool)
    mask[0, 10:13, 10:13] = True
    found = outline(Segments.from_masks(mask, ["up"]), corners="hough")
    assert len(found.buttons) + len(found.left_out) == 1
