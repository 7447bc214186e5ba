"""Quads, ellipses and lines through points: exact data, outliers, arcs, degenerate input."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from panelforms import around, circle, mapped, quad, view

from fronto import Ellipse
from fronto.outlines.edges import EdgePoints
from fronto.outlines.fits import (
    fit_ellipses,
    fit_quads,
    intersections,
)

fixed = settings(derandomize=True, deadline=None, max_examples=80)
views = st.builds(
    view,
    st.floats(-30, 30),
    st.floats(-35, 35),
    st.floats(-35, 35),
    st.tuples(st.floats(-300, 3000), st.floats(-300, 3000)),
)
ellipses = st.builds(
    lambda cx, cy, a, ratio, angle: Ellipse(cx, cy, a, a * ratio, angle),
    st.floats(-300, 3000),
    st.floats(-300, 3000),
    st.floats(4, 200),
    st.floats(0.3, 1),
    st.floats(0, 180),
)


def points(*groups, size=None, border=None):
    xy = np.concatenate([np.asarray(g, float).reshape(-1, 2) for g in groups])
    first = np.concatenate([[0], np.cumsum([len(g) for g in groups])]).astype(np.int64)
    sizes = [30.0] * len(groups) if size is None else size
    flags = np.zeros(len(xy), bool) if border is None else border
    return EdgePoints(xy, first, flags, np.array(sizes, float), np.ones(len(groups)))


def fitted_quad(xy, central=0.6, size=30.0, **options):
    return fit_quads(points(xy, size=[size], **options), np.array([central]))


def corner_error(found, true):
    """Largest error; the fit may start at any of the corners."""
    turned = [np.abs(np.roll(found, k, axis=0) - true).max() for k in range(4)]
    return min(turned)


def as_ellipse(shape):
    cx, cy, m11, m12, m22 = shape
    return Ellipse.from_shape_matrix((cx, cy), np.linalg.inv([[m11, m12], [m12, m22]]))


def ellipse_error(found, true):
    """Of centre and shape, pixels."""
    matrices = found.shape_matrix - true.shape_matrix
    return max(np.abs(found.center - true.center).max(), np.abs(matrices).max() / true.b)


# --- quads


@fixed
@given(views, st.floats(10, 200), st.floats(0, 0.2), st.floats(0.5, 2))
def test_exact_points_give_the_exact_quad(to_px, side, radius, ratio):
    form = quad(to_px, (0, 0), side, radius * min(1, ratio), ratio)
    found = fitted_quad(form.edge(), 0.55, side * np.sqrt(ratio))
    assert corner_error(found.corners[0], form.corners_px) < 1e-6
    assert found.rms.max() < 1e-6
    assert (found.covered == 1).all()
    assert (found.number[0] >= 25).all()


def test_sides_run_clockwise_with_normals_outwards():
    form = quad(view(20, 15, -10, (100, 80)), side=40)
    found = fitted_quad(form.edge())
    corners, lines = found.corners[0], found.lines[0]
    for k in range(4):
        start, end = corners[k], corners[(k + 1) % 4]
        np.testing.assert_allclose(lines[k, :2] @ start, lines[k, 2], atol=1e-6)
        np.testing.assert_allclose(lines[k, :2] @ end, lines[k, 2], atol=1e-6)
        np.testing.assert_allclose(np.hypot(*lines[k, :2]), 1)
        assert lines[k, :2] @ corners.mean(axis=0) < lines[k, 2]
        x, y = end - start
        np.testing.assert_allclose(lines[k, :2], np.array([y, -x]) / np.hypot(x, y), atol=1e-6)
    np.testing.assert_allclose(intersections(found.lines)[0], corners, atol=1e-9)


@pytest.mark.parametrize("share", [0.05, 0.1])
def test_quads_ignore_outliers(share):
    rng = np.random.default_rng(4)
    for _ in range(20):
        form = quad(view(*rng.uniform(-25, 25, 3), (50, 50)), side=40)
        xy = form.edge()
        wrong = rng.random(len(xy)) < share
        xy[wrong] += rng.uniform(-6, 6, (wrong.sum(), 2))
        assert corner_error(fitted_quad(xy, size=40).corners[0], form.corners_px) < 0.1


def test_a_bump_on_one_side_does_not_bend_it():
    form = quad(view(origin=(50, 50)), side=40)
    xy = form.edge(per_side=80)
    xy[30:38, 1] -= 3  # a tenth of the top side
    assert corner_error(fitted_quad(xy, size=40).corners[0], form.corners_px) < 0.1


def test_points_on_the_photos_border_make_no_side():
    form = quad(view(origin=(50, 50)), side=40)
    xy = form.edge()
    border = xy[:, 0] < 30.01
    found = fitted_quad(xy, size=40, border=border)
    missing = np.isnan(found.rms[0])
    assert missing.sum() == 1
    assert found.covered[0][missing] == 0
    assert found.lines[0][missing][0, 0] == pytest.approx(-1, abs=0.01)
    assert corner_error(found.corners[0], form.corners_px) < 1e-3


def test_a_start_is_kept_to():
    form = quad(view(10, 20, 5, (50, 50)), side=40)
    near = mapped(form.to_px, form.corners * 1.08 + 1)
    found = fit_quads(points(form.edge(), size=[40.0]), np.array([0.6]), near[None])
    np.testing.assert_allclose(found.corners[0], form.corners_px, atol=1e-6)
    np.testing.assert_allclose(near, mapped(form.to_px, form.corners * 1.08 + 1))


DEGENERATE = {
    "none": np.zeros((0, 2)),
    "one": [[3, 4]],
    "three": [[3, 4], [9, 4], [5, 8]],
    "one place": np.full((50, 2), 7.0),
    "a level line": np.stack([np.arange(50.0), np.full(50, 3.0)], axis=1),
    "an oblique line": np.stack([np.arange(50.0), 2 * np.arange(50.0)], axis=1),
}


@pytest.mark.parametrize("name", DEGENERATE)
def test_nothing_to_fit_is_nan(name):
    xy = np.asarray(DEGENERATE[name], float)
    found = fitted_quad(xy)
    assert np.isnan(found.corners).all()
    assert np.isnan(found.rms).all()
    assert (found.number == 0).all()
    round_one = fit_ellipses(xy, np.array([0, len(xy)]))
    assert np.isnan(round_one.shape).all()
    assert np.isnan(round_one.rms).all()


def test_masks_do_not_touch_each_other():
    one, other = quad(view(origin=(50, 50)), side=40), circle(view(origin=(90, 20)), side=20)
    alone = fitted_quad(one.edge())
    with_others = fit_quads(points(np.zeros((0, 2)), one.edge(), other.edge()), np.full(3, 0.6))
    np.testing.assert_array_equal(with_others.corners[1], alone.corners[0])
    assert np.isnan(with_others.corners[0]).all()
    first = np.array([0, 3, 3 + 120], np.int64)
    shapes = fit_ellipses(np.concatenate([np.zeros((3, 2)), other.edge()]), first).shape
    assert np.isnan(shapes[0]).all()
    assert ellipse_error(as_ellipse(shapes[1]), other.ellipse_px) < 1e-6


def test_some_of_the_points_of_each_mask() -> None:
    forms = [quad(view(10, 20, 5, (50, 50)), side=40), quad(view(origin=(90, 20)), side=30)]
    edges = [form.edge() for form in forms]
    every = np.array([1, 3])
    kept = points(*(edge[::k] for edge, k in zip(edges, every, strict=True)))
    some = fit_quads(points(*edges), np.full(2, 0.6), every=every)
    alone = fit_quads(kept, np.full(2, 0.6))
    for one, other in zip(some, alone, strict=True):
        np.testing.assert_array_equal(one, other)
    assert (some.number[1] < 15).all()


def test_an_ellipse_is_left_where_it_stands_still() -> None:
    form = circle(view(10, 20, 5, (50, 50)), side=40)
    edge = form.edge() + np.random.default_rng(0).normal(0, 0.3, (len(form.edge()), 2))
    start = np.array([[52.0, 49.0, 1 / 300, 0, 1 / 300]])
    first = np.array([0, len(edge)])
    exact, rough = (fit_ellipses(edge, first, start, still=s).shape for s in (1e-6, 1e3))
    again = fit_ellipses(edge, first, rough, still=1e-6).shape
    assert np.abs(exact - rough).max() > 1e-4
    np.testing.assert_allclose(again, exact, rtol=1e-4)


def test_parallel_sides_meet_nowhere():
    lines = np.array([[[0, -1, 0], [1, 0, 1], [1, 0, 5], [-1, 0, 0.0]]])
    found = intersections(lines)
    assert not np.isfinite(found[0, 2]).all()
    np.testing.assert_allclose(found[0, 0], [0, 0], atol=1e-12)


# --- ellipses


@fixed
@given(ellipses, st.integers(8, 200))
def test_exact_points_give_the_exact_ellipse(true, count):
    found = fit_ellipses(true.points(count), np.array([0, count]))
    assert ellipse_error(as_ellipse(found.shape[0]), true) < 1e-6
    assert found.rms[0] < 1e-6


@fixed
@given(views, st.floats(10, 150))
def test_circles_seen_from_any_side(to_px, side):
    form = circle(to_px, side=side)
    found = fit_ellipses(form.edge(), np.array([0, 120]))
    assert ellipse_error(as_ellipse(found.shape[0]), form.ellipse_px) < 1e-6


@pytest.mark.parametrize("phase", [0, 0.25, 0.5])
@pytest.mark.parametrize("count", [6, 8, 12, 100])
def test_perfect_circles(count, phase):
    found = fit_ellipses(around(count, phase) * 10 + [20, 30], np.array([0, count]))
    np.testing.assert_allclose(found.shape[0], [20, 30, 0.01, 0, 0.01], atol=1e-9)
    assert np.isfinite(found.inverse).all()


@fixed
@given(ellipses, st.floats(0, 1), st.floats(0.62, 0.95))
def test_arcs_of_two_thirds(true, begin, share):
    xy = np.roll(true.points(240), int(240 * begin), axis=0)[: int(240 * share)]
    found = fit_ellipses(xy, np.array([0, len(xy)]))
    assert ellipse_error(as_ellipse(found.shape[0]), true) < 1e-5


def test_ellipses_ignore_outliers():
    rng = np.random.default_rng(5)
    for _ in range(20):
        true = Ellipse(50, 60, 20, rng.uniform(12, 20), rng.uniform(0, 180))
        xy = true.points(100)
        xy[rng.integers(0, 100, 10)] += rng.uniform(3, 8, (10, 2))
        assert ellipse_error(as_ellipse(fit_ellipses(xy, np.array([0, 100])).shape[0]), true) < 0.02


def test_covariance_of_an_ellipse():
    # The spread over many noisy circles is what the inverse says.
    rng = np.random.default_rng(6)
    xy = around(60) * 15 + rng.normal(0, 0.2, (300, 60, 2))
    found = fit_ellipses(xy.reshape(-1, 2), np.arange(301) * 60)
    spread = np.cov(found.shape.T) / 0.2**2
    expected = found.inverse.mean(axis=0)
    np.testing.assert_allclose(np.diag(spread) / np.diag(expected), 1, atol=0.35)
