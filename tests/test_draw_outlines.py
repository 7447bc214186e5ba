"""Drawings of outlines show each button, what is seen of it, and how exact it is."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fronto.draw_outlines import draw_outlines
from fronto.draw_segments import COLORS
from fronto.errors import InputError
from fronto.outlines import Outlines
from fronto.shapes import LineSegment, Outline

GREY = np.full((240, 320, 3), 120, np.uint8)
SQUARE = [[100.0, 100.0], [160.0, 100.0], [160.0, 160.0], [100.0, 160.0]]


def drawing(*buttons: Outline, **others: Any) -> np.ndarray:
    return draw_outlines(GREY, Outlines(320, 240, buttons, **others))


def touched(picture: np.ndarray) -> np.ndarray:
    return (picture != GREY).any(axis=2)


def has(picture: np.ndarray, color: tuple[int, int, int]) -> np.ndarray:
    """Pixels of this colour, blended a little with the dark halo."""
    return (np.abs(picture - 0.9 * np.array(color)) < 0.1 * np.max(color)).all(axis=2)


def test_quads_and_ellipses_have_their_categories_colors() -> None:
    quad = Outline.quad(SQUARE, category="up")
    ellipse = Outline.ellipse(240, 130, 35, 20, 30, category="stop")
    before = GREY.copy()
    picture = drawing(quad, ellipse)
    assert np.array_equal(GREY, before)
    assert (picture.shape, picture.dtype) == (GREY.shape, np.dtype(np.uint8))
    assert has(picture, COLORS["up"])[100, 110:150].all()
    assert has(picture, COLORS["up"])[110:150, 160].all()
    on = np.rint(ellipse.ellipse_px.points(90)).astype(int)  # type: ignore[union-attr]
    assert touched(picture)[on[:, 1], on[:, 0]].all()
    reddish = picture[on[:, 1], on[:, 0]].astype(int)
    assert np.median(reddish[:, 0] - reddish[:, 1]) > 100
    # Nothing is written over what was outlined.
    assert not touched(picture)[110:150, 110:150].any()
    assert not touched(picture)[125:136, 235:246].any()
    assert not touched(picture)[200:].any()


def test_the_first_corner_has_a_dot() -> None:
    marks = touched(drawing(Outline.quad(SQUARE)))
    corners = [marks[y - 5 : y + 6, x - 5 : x + 6].sum() for x, y in np.array(SQUARE, int)]
    assert corners[0] > max(corners[1:]) + 10


@pytest.mark.parametrize("side", range(4))
def test_sides_that_are_not_seen_are_dashed(side: int) -> None:
    seen = [True] * 4
    seen[side] = False
    picture = drawing(Outline.quad(SQUARE, seen=(seen[0], seen[1], seen[2], seen[3])))
    ink = has(picture, COLORS["other"])
    sides = [ink[100, 110:150], ink[110:150, 160], ink[160, 110:150], ink[110:150, 100]]
    for k, line in enumerate(sides):
        if k == side:
            assert 0.2 < line.mean() < 0.8
            assert np.count_nonzero(np.diff(line)) >= 6
        else:
            assert line.all()


def test_plates_are_grey_and_lines_thin() -> None:
    plate = Outline.quad(SQUARE, category="plate")
    lines = (
        LineSegment("horizontal", np.array([[20.0, 20.0], [300.0, 20.0]])),
        LineSegment("vertical", np.array([[30.0, 40.0], [30.0, 220.0]])),
    )
    picture = drawing(plates=(plate,), lines=lines)
    assert has(picture, COLORS["plate"])[100, 110:150].all()
    across, down = picture[20, 100:250].astype(int), picture[60:200, 30].astype(int)
    assert (across[:, 0] > across[:, 1] + 100).all()
    assert (down[:, 1] > down[:, 0] + 100).all()
    saturated = np.ptp(picture.astype(int), axis=2) > 60
    assert saturated[10:31, 200].sum() == 1


def test_name_and_deviation_are_written_beside() -> None:
    pictures = [
        drawing(Outline.quad(SQUARE, std_px=std, text=text))
        for std, text in ((0.25, "12"), (0.75, "12"), (0.25, "G"))
    ]
    for other in pictures[1:]:
        rows, columns = np.nonzero((pictures[0] != other).any(axis=2))
        assert len(rows)
        assert rows.max() < 98  # above the button, not on it
        assert rows.min() > 70
        assert columns.min() > 60
        assert columns.max() < 200


def test_where_there_is_no_room_the_deviation_is_on_the_button() -> None:
    photo = np.full((64, 64, 3), 120, np.uint8)
    corners = [[4.0, 4.0], [60.0, 4.0], [60.0, 60.0], [4.0, 60.0]]

    def inside(std: float, **where: Any) -> np.ndarray:
        outline = Outline.quad(corners, std_px=std)
        kinds = {"buttons": (), "plates": (), where["kind"]: (outline,)}
        return draw_outlines(photo, Outlines(64, 64, **kinds))[10:57, 10:57]

    first, second = inside(0.25, kind="buttons"), inside(0.75, kind="buttons")
    assert (first != second).any()
    assert (first[:20] == 120).all()  # at the bottom: what is printed on it stays readable
    assert (inside(0.25, kind="plates") == 120).all()


def test_odd_ones_are_said_to_be() -> None:
    plain, odd = (drawing(Outline.quad(SQUARE, odd=odd)) for odd in (False, True))
    assert (plain != odd).any()


def test_unknown_categories_and_grey_photos() -> None:
    outlines = Outlines(320, 240, (Outline.quad(SQUARE, category="fan"),))
    picture = draw_outlines(GREY[..., 0], outlines)
    assert np.array_equal(picture, draw_outlines(GREY, outlines))
    assert has(picture, COLORS["other"])[100, 110:150].all()


def test_nothing_found() -> None:
    assert np.array_equal(drawing(), GREY)


def test_larger_photos_have_thicker_strokes() -> None:
    photo = np.full((1600, 2400, 3), 120, np.uint8)
    corners = np.array(SQUARE) * 8
    large = draw_outlines(photo, Outlines(2400, 1600, (Outline.quad(corners),)))
    column = (large[700:900, 1040] != 120).any(axis=1)
    assert column.sum() > touched(drawing(Outline.quad(SQUARE)))[90:110, 130].sum()


@settings(derandomize=True, deadline=None, max_examples=40)
@given(
    corner=st.tuples(st.floats(-1e6, 1e6), st.floats(-1e6, 1e6)),
    seen=st.tuples(*[st.booleans()] * 4),
)
def test_guessed_corners_may_be_anywhere(
    corner: tuple[float, float], seen: tuple[bool, bool, bool, bool]
) -> None:
    try:
        outline = Outline.quad([SQUARE[0], SQUARE[1], list(corner), SQUARE[3]], seen=seen)
    except InputError:
        return
    picture = drawing(outline)
    assert picture.shape == GREY.shape
    assert touched(picture)[97:104, 97:104].any()


def test_another_photo_is_refused() -> None:
    outlines = Outlines(320, 240, ())
    with pytest.raises(InputError, match="320x240"):
        draw_outlines(GREY[:200], outlines)
    for bad in (GREY.astype(float), GREY[..., :2]):
        with pytest.raises(InputError, match="image"):
            draw_outlines(bad, outlines)
