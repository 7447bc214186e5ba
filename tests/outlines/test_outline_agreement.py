"""Outlines of one photo agree on where up is, and there is one for each button."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fronto.outlines.agreement import agreeing_orders, at_odds, doubles
from fronto.pose.checks import check_outlines
from fronto.shapes import Outline, order_corners


def turned_square(x: float, y: float, roll_deg: float, side: float = 20.0) -> np.ndarray:
    a = np.radians(roll_deg)
    square = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * side / 2
    return square @ np.array([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]]) + (x, y)


@settings(derandomize=True, deadline=None, max_examples=60)
@given(st.floats(-50, 50), st.lists(st.floats(-6, 6), min_size=3, max_size=8))
def test_near_45_degrees_all_begin_at_the_same_corner(roll: float, jitter: list[float]) -> None:
    outlines = [
        Outline.quad(order_corners(turned_square(40.0 * k, 0, roll + off)))
        for k, off in enumerate(jitter)
    ]
    agreed = agreeing_orders(outlines)
    check_outlines(agreed)  # refuses orders that differ
    for before, after in zip(outlines, agreed, strict=True):
        assert sorted(map(tuple, before.corners_px)) == sorted(map(tuple, after.corners_px))


def test_the_seen_sides_turn_with_the_corners() -> None:
    straight = [Outline.quad(turned_square(40.0 * k, 0, 0)) for k in range(4)]
    corners = np.roll(turned_square(160, 0, 0), -1, axis=0)  # begins at the top-right corner
    # The sides from there: right, bottom, left, top; the right one is not seen.
    odd = Outline.quad(corners, truncated=True, seen=(False, True, True, True))
    *_, fixed = agreeing_orders([*straight, odd])
    assert fixed.corners_px == pytest.approx(turned_square(160, 0, 0))
    assert fixed.seen == (True, False, True, True)


def test_round_buttons_and_single_quads_are_left_alone() -> None:
    outlines = [Outline.ellipse(0, 0, 5, 4), Outline.quad(turned_square(50, 0, 30))]
    assert agreeing_orders(outlines) == outlines


def test_of_two_outlines_of_one_button_the_surer_stays() -> None:
    first = Outline.quad(turned_square(0, 0, 0), confidence=0.6)
    outlines = [
        first,
        replace(first, confidence=0.9),
        Outline.ellipse(60, 0, 9, 8, confidence=0.5),
        Outline.ellipse(61, 0, 9, 9, confidence=0.4),
    ]
    assert sorted(doubles(outlines)) == [0, 3]
    assert doubles(outlines[1:3]) == doubles(outlines[:1]) == doubles([]) == []


def test_a_quad_that_runs_another_way_is_told() -> None:
    straight = [Outline.quad(turned_square(40.0 * k, 0, 5)) for k in range(4)]
    skewed = Outline.quad([(200, 0), (205, 30), (195, 60), (190, 30)])  # a sliver, on its tip
    outlines = [*straight[:2], skewed, *straight[2:], Outline.ellipse(0, 80, 9, 8)]
    assert at_odds(outlines) == [2]
    check_outlines([o for k, o in enumerate(outlines) if k != 2])
    assert at_odds(straight) == at_odds(straight[:1]) == []
