"""Outlines of one photo do not contradict each other."""

from dataclasses import replace

import numpy as np
import pytest
from panelforms import circle, mapped, pill, quad, view
from panelmaker import Panel, panel

from fronto import Outline, Segments, order_corners, outline
from fronto.outlines.agreement import agreeing_orders


def grid(roll, tilt_x, tilt_y):
    to_px = view(roll, tilt_x, tilt_y)
    return panel(np.random.default_rng(1), quad, side=40, columns=4, rows=4, to_px=to_px)


def first_corners(made, corners):
    """Where on the wall, from the buttons' centres, the first corners lie."""
    walls = [mapped(np.linalg.inv(f.to_px), c) for f, c in zip(made.forms, corners, strict=True)]
    return {tuple(np.sign(w[0] - w.mean(axis=0)).tolist()) for w in walls}


@pytest.mark.parametrize("way", ["subpixel", "hough"])
@pytest.mark.parametrize("angles", [(37, 30, 30), (-37, 30, -30), (37, -30, -30)])
def test_all_quads_begin_at_the_same_corner(angles, way):
    # Tilted, some buttons look rolled by more than 45 degrees, and some by less.
    made = grid(*angles)
    assert len(first_corners(made, [order_corners(f.corners_px) for f in made.forms])) == 2
    found = outline(made.segments(), corners=way).buttons
    assert len(first_corners(made, [o.corners_px for o in found])) == 1


@pytest.mark.parametrize("way", ["subpixel", "hough"])
@pytest.mark.parametrize("angles", [(30, 30, 30), (-33, 30, -30), (30, -30, 30), (-30, 0, 0)])
def test_what_each_says_alone_stays_where_they_agree(angles, way):
    made = grid(*angles)
    assert first_corners(made, [order_corners(f.corners_px) for f in made.forms]) == {(-1, -1)}
    found = outline(made.segments(), corners=way).buttons
    assert first_corners(made, [o.corners_px for o in found]) == {(-1, -1)}


@pytest.mark.parametrize("turns", [1, 2, 3])
def test_seen_sides_turn_with_their_corners(turns):
    made = panel(np.random.default_rng(2), quad, side=40, to_px=view(30, 10, 10))
    seen = (True, False, True, True)
    given = [Outline.quad(f.corners_px, seen=seen, category="up") for f in made.forms]
    turned = list(given)
    turned[5] = Outline.quad(
        np.roll(given[5].corners_px, turns, axis=0), seen=tuple(np.roll(seen, turns).tolist())
    )
    for one, other in zip(agreeing_orders(turned), given, strict=True):
        np.testing.assert_array_equal(one.corners_px, other.corners_px)
        assert one.seen == other.seen
    assert turned[5].seen == tuple(np.roll(seen, turns))  # and the given ones stay


@pytest.mark.parametrize("other", [quad, circle, pill])
@pytest.mark.parametrize("shift", [0.0, 3.0])
def test_one_outline_for_one_button(shift, other):
    to_px = view(10, 5, 5, (60, 60))
    forms = (quad(to_px, side=30), other(to_px, (shift, 0), side=34))
    segments = Panel(forms, 120, 120).segments().segments
    for surer in (0, 1):
        pair = tuple(
            replace(s, confidence=0.9 if k == surer else 0.4, category=("up", "down")[k])
            for k, s in enumerate(segments)
        )
        found = outline(Segments(120, 120, pair))
        assert [o.category for o in found.buttons] == [("up", "down")[surer]]
        assert len(found.from_image) == 1
        assert len(found.left_out) == 1
        assert found.left_out[0].startswith(("down", "up")[surer] + " at (")


def test_neighbours_and_their_plates_stay():
    made = panel(np.random.default_rng(3), quad, side=20, columns=5, rows=4, pitch=1.15)
    named = [
        replace(s, category="plate" if k % 2 else "number")
        for k, s in enumerate(made.segments().segments)
    ]
    found = outline(Segments(made.width, made.height, tuple(named)))
    assert (len(found.buttons), len(found.plates)) == (10, 10)
    assert found.left_out == ()
