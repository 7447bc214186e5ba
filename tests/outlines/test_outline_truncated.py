"""Buttons that the photo's border cuts keep the sides that are seen."""

import numpy as np
import pytest
from panelforms import circle, quad, view
from panelmaker import Panel, ellipse_errors

from fronto import outline

WIDTH, HEIGHT, SIDE = 100, 80, 40
#: The side of the photo: which of the button's sides is cut (top, right, bottom, left), and
#: the centre of a button of which so many pixels are cut off there.
BORDERS = {
    "top": (0, lambda cut: (50.2, SIDE / 2 - 0.5 - cut)),
    "right": (1, lambda cut: (WIDTH - 0.5 - SIDE / 2 + cut, 40.3)),
    "bottom": (2, lambda cut: (50.2, HEIGHT - 0.5 - SIDE / 2 + cut)),
    "left": (3, lambda cut: (SIDE / 2 - 0.5 - cut, 40.3)),
}


def at(make, center, roll=0.0, **options):
    return Panel((make(view(roll, origin=center), side=SIDE, **options),), WIDTH, HEIGHT)


def side_offsets(found, true, k):
    """Distances of both ends of a found side from the true side's line."""
    start, end = true[k], true[(k + 1) % 4]
    along = (end - start) / np.linalg.norm(end - start)
    ends = found[[k, (k + 1) % 4]] - start
    return ends @ np.array([along[1], -along[0]])


@pytest.mark.parametrize("photo", [False, True])
@pytest.mark.parametrize("roll", [0, 12, -15])
@pytest.mark.parametrize("cut", [6, 14, 20])
@pytest.mark.parametrize("border", BORDERS)
def test_a_quad_keeps_the_sides_that_are_seen(border, cut, roll, photo):
    side, center = BORDERS[border]
    made = at(quad, center(cut), roll, radius=0.05)
    (found,) = outline(made.segments(), made.picture() if photo else None).buttons
    assert found.shape == "quad"
    assert found.truncated
    assert not found.odd
    assert found.seen == tuple(k != side for k in range(4))
    for k in range(4):
        if k != side:
            off = side_offsets(found.corners_px, made.forms[0].corners_px, k)
            assert np.abs(off).max() < (0.35 if photo else 0.7)
    # The cut side is a guess, and no further out than the photo.
    x0, y0, x1, y1 = found.box_px
    assert x0 > -12
    assert y0 > -12
    assert x1 < WIDTH + 12
    assert y1 < HEIGHT + 12


@pytest.mark.parametrize("x", [2.0, 98.0])
@pytest.mark.parametrize("y", [5.0, 75.0])
def test_two_sides_are_enough(x, y):
    made = at(quad, (x, y))
    (found,) = outline(made.segments()).buttons
    assert found.truncated
    top_bottom, left_right = (True, False) if y > 40 else (False, True), (x < 50, x > 50)
    assert found.seen == (top_bottom[0], left_right[0], top_bottom[1], left_right[1])
    for k in np.flatnonzero(found.seen):
        off = side_offsets(found.corners_px, made.forms[0].corners_px, k)
        assert np.abs(off).max() < 0.7


def test_one_side_is_not():
    form = quad(view(origin=(50, 50)), side=200, ratio=0.5)  # only its upper side, at y = 0
    made = Panel((form.shifted(0, 20),), WIDTH, HEIGHT)
    found = outline(made.segments())
    assert found.buttons == ()
    assert found.left_out[0].startswith("number at (50, ")


@pytest.mark.parametrize("photo", [False, True])
@pytest.mark.parametrize("cut", [3, 8, 13])
@pytest.mark.parametrize("border", BORDERS)
def test_a_circle_cut_by_up_to_a_third(border, cut, photo):
    made = at(circle, BORDERS[border][1](cut))
    found = outline(made.segments(), made.picture() if photo else None)
    assert found.left_out == ()
    assert found.buttons[0].shape == "ellipse"
    assert found.buttons[0].truncated
    assert np.abs(ellipse_errors(made, found.buttons)).max() < (0.5 if photo else 1.0)


@pytest.mark.parametrize("cut", [26, 32, 38])
@pytest.mark.parametrize("border", BORDERS)
def test_less_than_half_a_circle_is_left_out(border, cut):
    made = at(circle, BORDERS[border][1](cut))
    found = outline(made.segments("keyhole"))
    assert found.buttons == ()
    assert found.from_image == ()
    assert len(found.left_out) == 1
    assert found.left_out[0].startswith("keyhole at (")
    assert "seen" in found.left_out[0]


@pytest.mark.parametrize("make", [quad, circle])
def test_whole_ones_near_the_border_are_whole(make):
    for border in BORDERS.values():
        made = at(make, border[1](-1.5))
        (found,) = outline(made.segments()).buttons
        assert not found.truncated
        assert found.seen == (True,) * 4


def test_a_mask_of_the_whole_photo_has_no_outline():
    made = Panel((quad(view(origin=(50, 40)), side=300),), WIDTH, HEIGHT)
    found = outline(made.segments())
    assert found.buttons == ()
    assert len(found.left_out) == 1


def test_whole_neighbours_are_not_affected():
    cut, whole = at(quad, (5, 40)), at(quad, (60, 40))
    both = Panel((*cut.forms, *whole.forms), WIDTH, HEIGHT)
    found = outline(both.segments()).buttons
    assert [o.truncated for o in found] == [True, False]
    np.testing.assert_allclose(found[1].corners_px, whole.forms[0].corners_px, atol=0.7)
