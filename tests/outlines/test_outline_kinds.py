"""Quad, ellipse or odd: from masks alone, of any size, roll and tilt."""

from collections import Counter

import numpy as np
import pytest
from panelforms import circle, octagon, pill, quad, random_view, triangle, view
from panelmaker import panel

from fronto import Segments, outline
from fronto.outlines.edges import edge_points
from fronto.outlines.kinds import find_shapes
from fronto.shapes import order_corners


def shapes_of(made):
    return find_shapes(edge_points(made.segments().segments, made.width, made.height))


def singles(make, seed, count=20, **options):
    """Each alone in its photo: nothing but its own outline tells what it is."""
    rng = np.random.default_rng(seed)
    for _ in range(count):
        yield panel(rng, make, columns=1, rows=1, **options)


@pytest.mark.parametrize("radius", [0, 0.1, 0.25])
@pytest.mark.parametrize("side", [15, 30, 60])
def test_rectangles_are_quads(side, radius):
    kinds = [shapes_of(p).kind[0] for p in singles(quad, 1, side=side, radius=radius)]
    assert set(kinds) == {"quad"}


@pytest.mark.parametrize("ratio", [0.6, 1.8])
def test_oblong_ones_too(ratio):
    made = panel(np.random.default_rng(2), quad, side=40, radius=0.1, ratio=ratio)
    assert Counter(shapes_of(made).kind) == {"quad": 12}


@pytest.mark.parametrize("side", [16, 20, 30, 60])
def test_circles_are_ellipses(side):
    kinds = [shapes_of(p).kind[0] for p in singles(circle, 3, side=side)]
    assert set(kinds) == {"ellipse"}


@pytest.mark.parametrize("side", [30, 40, 60])
@pytest.mark.parametrize("make", [pill, triangle, octagon])
def test_others_are_odd(make, side):
    rng = np.random.default_rng(4)
    found = Counter()
    for _ in range(2):
        found.update(shapes_of(panel(rng, make, side=side)).kind)
    assert found == {"odd": 24}


@pytest.mark.parametrize("make", [pill, triangle, octagon])
def test_others_are_odd_facing_the_camera(make):
    made = panel(np.random.default_rng(5), make, side=40, to_px=view())
    assert Counter(shapes_of(made).kind) == {"odd": 12}


@pytest.mark.parametrize("make", [pill, triangle, octagon])
def test_odd_ones_are_bounded(make):
    # A rectangle (in the button's own directions) that the form touches on all sides.
    made = panel(np.random.default_rng(6), make, side=40, to_px=view())
    found = outline(made.segments())
    assert found.left_out == ()
    for o, form in zip(found.buttons, made.forms, strict=True):
        assert (o.shape, o.odd, o.truncated) == ("quad", True, False)
        edge = form.edge()
        np.testing.assert_array_equal(order_corners(o.corners_px), o.corners_px)
        for start, end in zip(o.corners_px, np.roll(o.corners_px, -1, axis=0), strict=True):
            along = (end - start) / np.linalg.norm(end - start)
            inwards = (edge - start) @ np.array([-along[1], along[0]])
            assert -1.0 < inwards.min() < 1.0


@pytest.mark.parametrize("radius", [0.0, 0.1, 0.2, 0.3])
def test_radius_of_the_corners(radius):
    made = panel(np.random.default_rng(7), quad, side=50, radius=radius)
    # In half sides; tilted ones differ a little along both sides.
    assert shapes_of(made).radius == pytest.approx(2 * radius, abs=0.12)


@pytest.mark.parametrize("make", [quad, circle, pill, octagon])
def test_confidence_is_a_probability_that_grows_with_size(make):
    means = []
    for side in (8, 16, 40):
        found = [shapes_of(p).confidence[0] for p in singles(make, 8, 8, side=side)]
        assert min(found) > 0.33
        assert max(found) <= 1
        means.append(np.mean(found))
    assert means[2] > 0.9
    assert means[2] > means[0]


@pytest.mark.parametrize("make", [quad, circle])
def test_company_makes_small_ones_surer(make):
    rng = np.random.default_rng(9)
    to_px = random_view(rng, tilt_deg=15)
    alone = panel(np.random.default_rng(1), make, side=10, columns=1, rows=1, to_px=to_px)
    among = panel(np.random.default_rng(1), make, side=10, columns=5, rows=4, to_px=to_px)
    assert np.mean(shapes_of(among).confidence) > shapes_of(alone).confidence[0]


def test_company_does_not_overrule_what_is_clear():
    to_px = view(12, 10, -10)
    made = panel(np.random.default_rng(10), circle, side=40, to_px=to_px)
    round_ones, at = made.segments().segments, made.forms[0].to_px
    square = panel(np.random.default_rng(10), quad, side=40, columns=1, rows=1, to_px=at)
    segments = Segments(made.width, made.height, (*round_ones, *square.segments().segments))
    points = edge_points(segments.segments, made.width, made.height)
    assert find_shapes(points).kind == ("ellipse",) * 12 + ("quad",)


def test_misfit_of_what_was_decided():
    for make in (quad, circle, octagon):
        made = panel(np.random.default_rng(11), make, side=40)
        rms = shapes_of(made).rms
        assert (rms > 0).all()
        # Pixels' own steps are 0.29 px RMS.
        assert (rms < (2.0 if make is octagon else 0.6)).all()


def test_no_masks_no_shapes():
    found = find_shapes(edge_points([], 10, 10))
    assert found.kind == ()
    assert found.confidence.shape == (0,)
    assert found.quads.corners.shape == (0, 4, 2)
