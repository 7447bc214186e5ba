"""Lines of the panel in the photo: those along rows and columns, and no others."""

from dataclasses import replace

import numpy as np
import pytest
from panelforms import Form, circle, quad, view
from panelmaker import Panel, panel

from fronto import LineSegment, outline
from fronto.outlines.context import panel_lines

VIEWS = [(0, 0, 0), (20, 10, -15), (-30, 20, 20), (30, -25, 10), (0, 25, 25)]
#: Upper, right, lower and left side of a plate.
AXES = ("horizontal", "vertical", "horizontal", "vertical")


def scene(make, angles, **options):
    """Buttons on a plate with a margin around; and the plate."""
    rng = np.random.default_rng(1)
    made = panel(rng, make, columns=3, rows=4, side=30, to_px=view(*angles), **options)
    plate = quad(made.forms[0].to_px, side=192, ratio=1.25).shifted(40, 40)
    forms = tuple(f.shifted(40, 40) for f in made.forms)
    return Panel(forms, made.width + 80, made.height + 80), plate


def off_plate(line, plate):
    """Distance of a line's ends from the nearest of the plate's sides, and its axis."""
    corners = plate.corners_px
    best = (np.inf, "")
    for k, axis in enumerate(AXES):
        start, end = corners[k], corners[(k + 1) % 4]
        along = (end - start) / np.linalg.norm(end - start)
        off = np.abs((line.ends_px - start) @ np.array([along[1], -along[0]])).max()
        best = min(best, (off, axis))
    return best


def photo(made, plate, *bars):
    return made.picture([([plate], 130), (bars, 250), (made.forms, 190)], ground=60)


@pytest.mark.parametrize("angles", VIEWS)
def test_the_plates_edges_are_found(angles):
    made, plate = scene(quad, angles)
    lines = outline(made.segments(), photo(made, plate)).lines
    found = [off_plate(line, plate) for line in lines]
    assert {axis for _, axis in found} == set(AXES)
    assert len(found) >= 4
    for line, (off, axis) in zip(lines, found, strict=True):
        assert isinstance(line, LineSegment)
        assert off < 0.5
        assert line.axis == axis
        assert 0 < line.std_px < 2
        assert line.found
    lengths = [np.linalg.norm(line.ends_px[1] - line.ends_px[0]) for line in lines]
    assert lengths == sorted(lengths, reverse=True)


@pytest.mark.parametrize("make", [quad, circle])
@pytest.mark.parametrize("angles", VIEWS)
@pytest.mark.parametrize("turn", [20, -40])
def test_oblique_lines_are_not_handed_on(turn, angles, make):
    made, plate = scene(make, angles)
    c, s = np.cos(np.radians(turn)), np.sin(np.radians(turn))
    turned = plate.to_px @ np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    for line in outline(
        made.segments(), photo(made, plate, quad(turned, side=300, ratio=0.012))
    ).lines:
        off, axis = off_plate(line, plate)
        assert off < 0.7
        assert line.axis == axis


@pytest.mark.parametrize("angles", [(0, 0, 0), (0, 25, 25)])
def test_rows_of_round_buttons_tell_directions_too(angles):
    made, plate = scene(circle, angles)
    lines = outline(made.segments(), photo(made, plate)).lines
    assert {line.axis for line in lines} == {"horizontal", "vertical"}
    for line in lines:
        off, axis = off_plate(line, plate)
        assert off < 0.7
        assert line.axis == axis


def test_buttons_own_edges_are_no_lines():
    made, _ = scene(quad, (0, 0, 0))
    assert outline(made.segments(), made.picture()).lines == ()


@pytest.mark.parametrize("count", [0, 1])
def test_no_directions_without_two_buttons(count):
    made, plate = scene(quad, (0, 0, 0))
    picture = photo(made, plate)
    few = Panel(made.forms[:count], made.width, made.height)
    assert outline(few.segments(), picture).lines == ()


def test_truncated_and_odd_buttons_tell_none():
    made, plate = scene(quad, (0, 0, 0))
    picture = photo(made, plate)
    buttons = outline(made.segments(), picture, lines=False).buttons
    assert panel_lines(picture, buttons)
    assert panel_lines(picture, [replace(b, truncated=True) for b in buttons]) == []
    assert panel_lines(picture, [replace(b, odd=True) for b in buttons]) == []


def test_off_by_a_switch():
    made, plate = scene(quad, (20, 10, -15))
    picture, segments = photo(made, plate), made.segments()
    with_lines, without = outline(segments, picture), outline(segments, picture, lines=False)
    assert with_lines.lines
    assert without.lines == ()
    assert outline(segments).lines == ()
    for one, other in zip(with_lines.buttons, without.buttons, strict=True):
        np.testing.assert_array_equal(one.corners_px, other.corners_px)
        assert one.std_px == other.std_px


def test_far_lines_are_others():
    made, plate = scene(quad, (0, 0, 0))
    wide = Panel(tuple(f.shifted(300, 0) for f in made.forms), made.width + 600, made.height)
    door = quad(view(origin=(30, 150)), side=12, ratio=22)
    picture = wide.picture([([door], 200), ([plate.shifted(300, 0)], 130), (wide.forms, 190)])
    for line in outline(wide.segments(), picture).lines:
        assert line.ends_px[:, 0].min() > 100


def test_at_most_sixteen():
    made, plate = scene(quad, (0, 0, 0))
    bars = [quad(plate.to_px, (0, y), side=180, ratio=0.012) for y in np.arange(-114, 115, 6)]
    lines = outline(made.segments(), photo(made, plate, *bars)).lines
    assert len(lines) == 16


def test_large_photos_are_looked_at_smaller():
    made, plate = scene(quad, (10, 5, 5))
    grow = np.diag([4.0, 4.0, 1.0])

    def larger(f):
        return Form(f.core, f.radius, grow @ f.to_px, f.corners)

    large = Panel(tuple(larger(f) for f in made.forms), 4 * made.width, 4 * made.height)
    found = outline(large.segments(), photo(large, larger(plate))).lines
    assert {line.axis for line in found} == {"horizontal", "vertical"}
    for line in found:
        off, axis = off_plate(line, larger(plate))
        assert off < 1.5
        assert line.axis == axis
