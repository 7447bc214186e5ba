"""Distances of edge points from shapes: the kernels against plain NumPy."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fronto.outlines.edges import EdgePoints
from fronto.outlines.misfits import (
    CAP,
    CAPS,
    PILL,
    RADII,
    WAVES,
    best_radius,
    ellipse_misfit,
    from_square,
    half_sides,
    pill_misfits,
    rectangles,
    thinned,
)

fixed = settings(derandomize=True, deadline=None, max_examples=60)
SQUARE = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1.0)])


def points(groups, border=None):
    """Edge points of masks of about the size of what the points surround."""
    first = np.concatenate([[0], np.cumsum([len(g) for g in groups])]).astype(np.int64)
    xy = np.concatenate(groups) if groups else np.zeros((0, 2))
    flags = np.zeros(len(xy), bool) if border is None else np.asarray(border)
    size = np.array([np.sqrt(np.ptp(g, axis=0).prod()) for g in groups])
    return EdgePoints(np.ascontiguousarray(xy), first, flags, size, np.ones(len(groups)))


def around(rng, count, center=(50.0, 40.0), radius=20.0, noise=0.5):
    t = np.sort(rng.uniform(0, 2 * np.pi, count))
    circle = np.stack([np.cos(t), np.sin(t)], axis=1) * radius
    return center + circle + rng.normal(0, noise, (count, 2))


def some_quad(rng):
    corners = (SQUARE + rng.uniform(-0.3, 0.3, (4, 2))) * rng.uniform(8, 40, 2)
    return corners + rng.uniform(0, 400, 2)


def mean_square(distance, size, border):
    inner = ~border
    return np.minimum(distance[inner] ** 2, (CAP * size) ** 2).mean()


def in_square(corners, xy):
    p = np.column_stack([xy, np.ones(len(xy))]) @ np.linalg.inv(from_square(corners[None])[0]).T
    return p[:, 0] / p[:, 2], p[:, 1] / p[:, 2]


@fixed
@given(st.integers(0, 10_000))
def test_the_square_becomes_the_quad(seed):
    corners = some_quad(np.random.default_rng(seed))
    image = np.column_stack([SQUARE, np.ones(4)]) @ from_square(corners[None])[0].T
    np.testing.assert_allclose(image[:, :2] / image[:, 2:], corners, atol=1e-9)


def test_half_sides_are_means_of_opposite_sides():
    corners = np.array([[(0, 0), (10, 0), (8, 6), (0, 6.0)]])
    right = np.hypot(2, 6)
    np.testing.assert_allclose(half_sides(corners), [[(10 + 8) / 4, (right + 6) / 4]])


@fixed
@given(st.integers(0, 10_000), st.integers(5, 300))
def test_rounded_quads_as_numpy_has_them(seed, count):
    rng = np.random.default_rng(seed)
    corners = some_quad(rng)
    xy = corners.mean(axis=0) + rng.normal(0, 20, (count, 2))
    border = rng.random(count) < 0.2
    border[0] = False
    given_points = points([xy], border)
    every = max(count // 80, 1) | 1
    u, v = (np.abs(c[::every, None]) for c in in_square(corners, xy))
    half = half_sides(corners[None])[0]
    du, dv = u - (1 - RADII), v - (1 - RADII)
    corner = (np.hypot(du, dv) - RADII) * half.mean()
    side = np.where(du > dv, (u - 1) * half[0], (v - 1) * half[1])
    off = np.where((du > 0) & (dv > 0), corner, side)
    expected = [mean_square(o, given_points.size[0], border[::every]) for o in off.T]
    radius, misfit = best_radius(thinned(given_points), corners[None])
    np.testing.assert_allclose(misfit[0], min(expected), rtol=1e-9)
    assert radius[0] == RADII[int(np.argmin(expected))]


@pytest.mark.parametrize("rounding", [0.0, 0.3, 0.6])
def test_the_radius_that_points_have_is_found(rounding):
    t = np.linspace(0, np.pi / 2, 30)
    arc = 1 - rounding + rounding * np.stack([np.cos(t), np.sin(t)], axis=1)
    quarter = np.concatenate([np.stack([np.ones(30), np.linspace(0, 1 - rounding, 30)], 1), arc])
    turned = [quarter]
    for _ in range(3):
        turned.append(turned[-1] @ np.array([[0, 1], [-1, 0]]))
    xy = 15 * np.concatenate(turned) + 60
    radius, misfit = best_radius(thinned(points([xy])), 15 * SQUARE[None] + 60)
    assert abs(radius[0] - rounding) <= 0.04
    assert misfit[0] < 0.02


@fixed
@given(st.integers(0, 10_000), st.floats(0.4, 2.5))
def test_stadiums_as_numpy_has_them(seed, aspect):
    rng = np.random.default_rng(seed)
    xy = around(rng, 60) * [aspect, 1]
    corners = SQUARE * rng.uniform(10, 30, 2) + xy.mean(axis=0)
    border = rng.random(60) < 0.2
    given_points = points([xy], border)
    u, v = in_square(corners, xy)
    low, high = np.array([u.min(), v.min()]), np.array([u.max(), v.max()])
    half = half_sides(corners[None])[0]
    sides = half * (high - low) / 2
    x, y = (np.abs(c - m) * h for c, m, h in zip((u, v), (low + high) / 2, half, strict=True))
    along, across = (x, y) if sides[0] >= sides[1] else (y, x)
    long, short = max(sides), min(sides)
    cap = CAPS * short
    beyond = (along[:, None] - long + cap) / cap
    round_end = (np.hypot(beyond, across[:, None] / short) - 1) * (cap + short) / 2
    off = np.where(beyond > 0, round_end, across[:, None] - short)
    expected = min(mean_square(o, given_points.size[0], border) for o in off.T)
    misfit, extent = pill_misfits(thinned(given_points), corners[None])
    if long >= PILL * short:
        np.testing.assert_allclose(misfit[0], expected, rtol=1e-9)
    else:
        assert misfit[0] == np.inf
    bounds = rectangles(corners[None], extent)[0]
    np.testing.assert_allclose(bounds[[0, 2]], [xy.min(axis=0), xy.max(axis=0)], atol=1e-9)


def test_without_a_quad_the_bounds_are_the_points_box():
    xy = np.array([(3.0, 5), (10, 7), (6, 20)])
    nothing = np.full((1, 4, 2), np.nan)
    misfit, extent = pill_misfits(thinned(points([xy])), nothing)
    bounds = rectangles(nothing, extent)
    assert misfit[0] == np.inf
    np.testing.assert_allclose(bounds[0], [(3, 5), (10, 5), (10, 20), (3, 20)])
    assert best_radius(thinned(points([xy])), np.full((1, 4, 2), np.nan))[1][0] == np.inf


def ellipse_shape(rng):
    angle, axes = rng.uniform(0, np.pi), rng.uniform(5, 40, 2)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    m = turn @ np.diag(axes**-2.0) @ turn.T
    return np.array([*rng.uniform(0, 300, 2), m[0, 0], m[0, 1], m[1, 1]])


@fixed
@given(st.integers(0, 10_000), st.integers(6, 200))
def test_ellipses_as_numpy_has_them(seed, count):
    rng = np.random.default_rng(seed)
    shape = ellipse_shape(rng)
    xy = shape[:2] + rng.normal(0, 20, (count, 2))
    border = rng.random(count) < 0.2
    border[0] = False
    given_points = points([xy], border)
    every = max(count // 80, 1) | 1
    m = np.array([[shape[2], shape[3]], [shape[3], shape[4]]])
    d, edge = (xy - shape[:2])[::every], border[::every]
    gradient = d @ m
    q = np.sqrt((d * gradient).sum(axis=1))
    off = (q - 1) * q / np.linalg.norm(gradient, axis=1)
    circle = d @ np.linalg.cholesky(m)
    angle = np.arctan2(circle[:, 1], circle[:, 0])
    waves = [abs((np.where(edge, 0, off) * np.exp(1j * k * angle)).sum()) for k in WAVES]
    misfit, wave = ellipse_misfit(thinned(given_points), shape[None])
    np.testing.assert_allclose(misfit[0], mean_square(off, given_points.size[0], edge), rtol=1e-8)
    np.testing.assert_allclose(wave[0], 2 * max(waves) / len(d), rtol=1e-6)


def test_distances_from_a_circle_are_exact():
    # Sampson's approximation is exact for circles, however far.
    shape = np.array([[20, 30, 1 / 100, 0, 1 / 100]])
    for radius in (5, 8, 9.5, 10.1, 11):
        xy = np.array([20 + radius, 30.0]) + np.zeros((7, 2))
        given_points = points([xy])._replace(size=np.array([1000.0]))
        misfit, _ = ellipse_misfit(thinned(given_points), shape)
        np.testing.assert_allclose(misfit[0], (radius - 10) ** 2, atol=1e-9)


def test_points_on_the_border_only_say_nothing():
    xy = around(np.random.default_rng(0), 30)
    some = thinned(points([xy], np.ones(30, bool)))
    assert np.isnan(ellipse_misfit(some, np.array([[50, 40, 1 / 400, 0, 1 / 400]]))[0][0])
    assert best_radius(some, 20 * SQUARE[None] + (50, 40))[1][0] == np.inf


def test_no_masks():
    some = thinned(points([]))
    none = np.zeros((0, 4, 2))
    assert best_radius(some, none)[0].shape == (0,)
    assert pill_misfits(some, none)[1].shape == (0, 4)
    assert ellipse_misfit(some, np.zeros((0, 5)))[0].shape == (0,)


def test_each_mask_has_its_own_points():
    rng = np.random.default_rng(3)
    groups = [
        around(rng, n, center) for n, center in ((40, (30, 30)), (200, (90, 60)), (7, (9, 9)))
    ]
    shapes = np.stack([ellipse_shape(rng) for _ in groups])
    together = ellipse_misfit(thinned(points(groups)), shapes)
    for k, group in enumerate(groups):
        alone = ellipse_misfit(thinned(points([group])), shapes[k : k + 1])
        np.testing.assert_array_equal([t[k] for t in together], [a[0] for a in alone])
