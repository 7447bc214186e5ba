"""How exact outlines are, from masks alone and with the photo; and what edges mislead."""

from dataclasses import replace

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from panelforms import around, circle, quad, view
from panelmaker import corner_errors, ellipse_errors, panel, rms

from fronto import outline
from fronto.outlines.fits import intersections, move_sides
from fronto.outlines.profiles import Stations, find_edges
from fronto.outlines.subpixel import _in_place

fixed = settings(derandomize=True, deadline=None, max_examples=60)
ERRORS = {quad: corner_errors, circle: ellipse_errors}


def panels(make, seed, count=4, **options):
    rng = np.random.default_rng(seed)
    return [panel(rng, make, **options) for _ in range(count)]


def errors(made, picture=None, off=None):
    found = outline(made.segments(off=off), picture, lines=False)
    make = quad if made.forms[0].corners is not None else circle
    return ERRORS[make](made, found.buttons)


# --- the targets


@pytest.mark.parametrize("radius", [0, 0.05, 0.1])
@pytest.mark.parametrize("side", [30, 45, 60])
def test_corners_from_masks_alone(side, radius):
    found = [errors(p) for p in panels(quad, 1, side=side, radius=radius)]
    assert rms(found) <= 0.3  # the issue asks for 0.4


@pytest.mark.parametrize("radius", [0, 0.1, 0.25])
@pytest.mark.parametrize("side", [15, 30, 60])
def test_corners_with_the_photo(side, radius):
    made = panels(quad, 2, side=side, radius=radius)
    found = [errors(p, p.picture(seed=k)) for k, p in enumerate(made)]
    assert rms(found) <= 0.15  # the issue asks for 0.2
    assert rms(found) < rms([errors(p) for p in made])


@pytest.mark.parametrize("side", [20, 30, 60])
def test_centres_and_axes_of_ellipses(side):
    made = panels(circle, 3, side=side)
    assert rms([errors(p) for p in made]) <= 0.15
    assert rms([errors(p, p.picture(seed=k)) for k, p in enumerate(made)]) <= 0.08


@pytest.mark.parametrize("make", [quad, circle])
@pytest.mark.parametrize(
    "options",
    [
        {"blur": 0.4},
        {"blur": 1.2},
        {"blur": 2.0},
        {"noise": 6.0},
        {"light": 0.8},
        {"ground": 200, "face": 110},
        {"ground": (150, 100, 100), "face": (100, 134, 100)},  # as bright as the wall
        {"ground": 20, "face": 250},
    ],
    ids=str,
)
def test_looks_of_the_photo(make, options):
    made = panels(make, 4, 2, side=36)
    assert rms([errors(p, p.picture(seed=k, **options)) for k, p in enumerate(made)]) <= 0.2


@pytest.mark.parametrize("make", [quad, circle])
@pytest.mark.parametrize("side", [15, 20, 30, 60])
def test_deviations_do_not_promise_too_much(make, side):
    z = []
    for k, made in enumerate(panels(make, 5, side=side)):
        for picture in (None, made.picture(seed=k)):
            found = outline(made.segments(), picture, lines=False).buttons
            off = ERRORS[make](made, found).reshape(len(found), -1)
            z.append(off / np.array([[o.std_px] for o in found]))
    assert rms(z) < 1.4


@pytest.mark.parametrize("make", [quad, circle])
def test_the_photo_makes_deviations_smaller(make):
    (made,) = panels(make, 6, 1, side=30)
    masks, photo = outline(made.segments()), outline(made.segments(), made.picture())
    assert masks.from_image == (0.0,) * 12
    assert photo.from_image == (1.0,) * 12
    for one, other in zip(photo.buttons, masks.buttons, strict=True):
        assert one.std_px < 0.7 * other.std_px


# --- the photo against the masks


@pytest.mark.parametrize("side", [20, 30, 60])
@pytest.mark.parametrize("make", [quad, circle])
@pytest.mark.parametrize("off", [[[1.0, 0.0]] * 12, around(12)], ids=["all", "each"])
def test_the_photo_corrects_masks_that_are_a_pixel_off(off, make, side):
    (made,) = panels(make, 7, 1, side=side)
    assert rms(errors(made, off=np.array(off))) > 0.45
    assert rms(errors(made, made.picture(), np.array(off))) < 0.1


@pytest.mark.parametrize("side", [20, 30, 60])
@pytest.mark.parametrize("make", [quad, circle])
@pytest.mark.parametrize("step", [60, 20])
def test_a_bezel_with_a_stronger_edge_beside_the_buttons_own(step, make, side):
    (made,) = panels(make, 8, 1, side=side)
    bezels = [f.grown(4) for f in made.forms]
    picture = made.picture([(bezels, 200), (made.forms, 200 - step)], ground=50)
    assert rms(errors(made, picture)) < 0.3


@pytest.mark.parametrize("side", [20, 30, 60])
@pytest.mark.parametrize("make", [quad, circle])
def test_a_bezels_edge_where_the_buttons_own_does_not_show(make, side):
    # When in doubt the mask's outline stays, with its larger deviation.
    (made,) = panels(make, 8, 1, side=side)
    picture = made.picture([([f.grown(4) for f in made.forms], 200)], ground=50)
    assert rms(errors(made, picture)) < 0.6


@pytest.mark.parametrize("side", [20, 30, 60])
@pytest.mark.parametrize("make", [quad, circle])
def test_a_shadow_beside_the_button(make, side):
    (made,) = panels(make, 9, 1, side=side)
    shadows = [f.shifted(4, 4) for f in made.forms]
    picture = made.picture([(shadows, 30), (made.forms, 165)], ground=120)
    assert rms(errors(made, picture)) < 0.3


@pytest.mark.parametrize("make", [quad, circle])
def test_something_bright_beside_one_button(make):
    (made,) = panels(make, 10, 1, side=30)
    bar = quad(made.forms[0].to_px, (49.5, 0), side=12, ratio=6)  # 3 px off three of them
    picture = made.picture([([bar], 255), (made.forms, 130)])
    assert np.abs(errors(made, picture)).max() < 0.4


@pytest.mark.parametrize("make", [quad, circle])
@pytest.mark.parametrize("noise", [0, 2, 4])
def test_a_photo_without_edges_changes_nothing(make, noise):
    (made,) = panels(make, 11, 1, side=30)
    found = outline(made.segments(), made.picture([((), 0)], noise=noise), lines=False)
    assert found.from_image == (0.0,) * 12
    for one, other in zip(found.buttons, outline(made.segments()).buttons, strict=True):
        assert one.std_px == other.std_px
        if make is quad:
            np.testing.assert_array_equal(one.corners_px, other.corners_px)
        else:
            assert one.ellipse_px == other.ellipse_px


@pytest.mark.parametrize("side", [15, 30, 60])
@pytest.mark.parametrize("make", [quad, circle])
def test_noise_is_no_edge(make, side):
    (made,) = panels(make, 11, 1, side=side)
    for noise in (8, 12, 20):
        picture = made.picture([((), 0)], noise=noise)
        assert rms(errors(made, picture)) < rms(errors(made)) + 0.1


@pytest.mark.parametrize("make", [quad, circle])
def test_tiny_buttons_keep_their_masks(make):
    (made,) = panels(make, 12, 1, side=5)
    found = outline(made.segments(), made.picture())
    assert len(found.buttons) + len(found.left_out) == 12
    assert set(found.from_image) == {0.0}


# --- edges across curves


def side_stations(offset, size=40.0):
    """Stations along the upper side of a square, off its edge outwards by `offset` pixels."""
    made = panel(
        np.random.default_rng(13), quad, side=size, columns=1, rows=1, to_px=view(10, 5, 5)
    )
    start, end = made.forms[0].corners_px[:2]
    along = (end - start) / np.linalg.norm(end - start)
    normal = np.tile([along[1], -along[0]], (1, 20, 1))
    xy = start + np.linspace(0.15, 0.85, 20)[:, None] * (end - start) + offset * normal
    return made, Stations(xy, normal, np.array([size]), np.array([2.0]), signed=True)


@pytest.mark.parametrize("face", [30, 160])
@pytest.mark.parametrize("offset", [-1.5, -0.5, 0.0, 0.25, 1.0])
def test_edges_are_found_where_they_are(offset, face):
    made, stations = side_stations(offset)
    picture = made.picture(face=face, noise=0)
    first = find_edges(picture, stations, 0)
    np.testing.assert_allclose(first.offset, -offset, atol=0.3)
    moved = stations._replace(xy=stations.xy - offset * stations.normal)
    closer = find_edges(picture, moved, 1)
    np.testing.assert_allclose(closer.offset, 0, atol=0.12)
    assert np.abs(closer.offset.mean()) < 0.05
    assert closer.step[0] > 2


def test_a_flat_photo_has_no_step():
    made, stations = side_stations(0.0)
    assert find_edges(made.picture([((), 0)], noise=0), stations, 0).step[0] == 0


BOX = np.array([[(0, -1, -10), (1, 0, 60), (0, 1, 40), (-1, 0, -20.0)]])  # 40 wide, 30 high


@fixed
@given(st.floats(-3, 3), st.floats(-2, 2), st.integers(0, 6), st.integers(0, 5))
def test_sides_move_to_what_stations_show(a, b, missing, wrong):
    t = np.linspace(-0.5, 0.5, 24)
    offset = np.tile(a + b * t, (1, 4, 1))
    offset[..., 3 : 3 + missing] = np.nan
    offset[..., 12 : 12 + wrong] += 2.5
    moved = move_sides(BOX, offset, t[None], BOX)
    np.testing.assert_allclose(moved.spread, 0, atol=1e-6)
    np.testing.assert_allclose(moved.seen, (24 - missing - wrong) / 24)
    away = abs(a) / np.hypot(1, b / np.array([[40, 30, 40, 30]]))
    np.testing.assert_allclose(moved.near, away, atol=1e-9)
    np.testing.assert_allclose(
        moved.turned, np.arctan(abs(b) / np.array([[40, 30, 40, 30]])), atol=1e-9
    )
    top, left = moved.lines[0, 0], moved.lines[0, 3]
    # The top runs from (20, 10) to (60, 10), outwards is up; the left side runs upwards.
    for x, y in ((20, 10 - a + b / 2), (60, 10 - a - b / 2)):
        np.testing.assert_allclose(top[:2] @ (x, y), top[2], atol=1e-6)
    for x, y in ((20 - a + b / 2, 40), (20 - a - b / 2, 10)):
        np.testing.assert_allclose(left[:2] @ (x, y), left[2], atol=1e-6)


def test_what_is_near_is_told_of_the_masks_sides():
    further = BOX + np.array([0, 0, 1.5])  # all around
    t = np.linspace(-0.5, 0.5, 20)[None]
    moved = move_sides(further, np.zeros((1, 4, 20)), t, BOX)
    np.testing.assert_allclose(moved.lines, further, atol=1e-9)
    np.testing.assert_allclose(moved.near, 1.5)
    np.testing.assert_allclose(moved.turned, 0, atol=1e-9)


@pytest.mark.parametrize("known", [0, 1, 2])
def test_too_few_stations_make_no_line(known):
    offset = np.full((1, 4, 20), np.nan)
    offset[..., :known] = 0.3
    moved = move_sides(BOX, offset, np.linspace(-0.5, 0.5, 20)[None], BOX)
    assert (moved.spread == np.inf).all()
    assert (moved.seen == 0).all()


def test_a_quad_in_the_place_of_another_one():
    rng = np.random.default_rng(4)
    forms = np.array([[(0, 0), (12, 1), (13, 9), (-1, 10.0)], [(3, 2), (9, 2), (9, 8), (2, 9.0)]])
    others = 1.4 * forms[::-1] + rng.uniform(-20, 20, (2, 1, 2))
    lines, masks = (
        sides_of(corners) for corners in (forms + rng.uniform(-20, 20, (2, 1, 2)), others)
    )
    found = intersections(_in_place(lines, masks))
    np.testing.assert_allclose(found.mean(axis=1), others.mean(axis=1), atol=1e-9)
    # Each has its own form still, and the other's area.
    grown = np.sqrt(area(others) / area(forms))[:, None, None]
    away = found - found.mean(axis=1, keepdims=True)
    np.testing.assert_allclose(away, grown * (forms - forms.mean(axis=1, keepdims=True)))


def sides_of(corners):
    along = np.roll(corners, -1, axis=1) - corners
    normal = np.stack([along[..., 1], -along[..., 0]], axis=2)
    normal /= np.linalg.norm(normal, axis=2, keepdims=True)
    return np.concatenate([normal, (normal * corners).sum(axis=2, keepdims=True)], axis=2)


def area(corners):
    x, y = corners[..., 0], corners[..., 1]
    return np.abs((x * np.roll(y, -1, 1) - np.roll(x, -1, 1) * y).sum(axis=1)) / 2


@pytest.mark.parametrize(("side", "free"), [(25, False), (60, True)])
def test_small_drawn_masks_keep_their_place_and_size(side, free):
    """Masks are a pixel too large; of small ones that a head has drawn the photo tells the form."""
    made = panel(np.random.default_rng(5), quad, side=side, columns=2, rows=2)
    grown = tuple(
        replace(s, probability=cv2.dilate(s.probability, np.ones((3, 3))))
        for s in made.segments().segments
    )
    forms = tuple(replace(s, forms=(0.9, 0.05, 0.05)) for s in grown)
    for given_segments, moves in ((grown, True), (forms, free)):
        masks = replace(made.segments(), segments=given_segments)
        found, alone = (
            np.stack(
                [b.corners_px for b in outline(masks, picture, lines=False, edges=False).buttons]
            )
            for picture in (made.picture(), None)
        )
        shrunk = np.sqrt(area(alone)) - np.sqrt(area(found))
        np.testing.assert_allclose(shrunk, 2.4 if moves else 0, atol=0.6 if moves else 1e-6)
