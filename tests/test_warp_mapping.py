from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fronto.camera import Camera
from fronto.errors import InputError
from fronto.results import RectifiedView
from fronto.shapes import Ellipse
from fronto.warp import map_box, map_ellipse, map_points, warp_panel
from test_warp import BARREL, PAPER_CAMERA, make_pose, noise

QUICK = settings(derandomize=True, deadline=None, max_examples=40)
ANGLE = st.floats(-30.0, 30.0)
CAMERAS = st.sampled_from([PAPER_CAMERA, BARREL])
X, Y = st.floats(240.0, 400.0), st.floats(180.0, 300.0)


def view_of(camera: Camera, tx: float, ty: float, tz: float) -> RectifiedView:
    pose = make_pose(camera, (tx, ty, tz))
    return warp_panel(noise(480, 640), camera, pose, resampling="nearest", max_pixels=400)


@QUICK
@given(CAMERAS, ANGLE, ANGLE, ANGLE, st.lists(st.tuples(X, Y), min_size=1, max_size=9))
def test_points_come_back(
    camera: Camera, tx: float, ty: float, tz: float, points: list[tuple[float, float]]
) -> None:
    view = view_of(camera, tx, ty, tz)
    there = map_points(view, points)
    np.testing.assert_allclose(map_points(view, there, inverse=True), points, atol=1e-6)


@QUICK
@given(CAMERAS, ANGLE, ANGLE, ANGLE, X, Y)
def test_boxes_come_back_corner_by_corner(
    camera: Camera, tx: float, ty: float, tz: float, x: float, y: float
) -> None:
    view = view_of(camera, tx, ty, tz)
    there = map_box(view, (x, y, x + 20, y + 10))
    back = map_points(view, there, inverse=True)
    expected = [[x, y], [x + 20, y], [x + 20, y + 10], [x, y + 10]]
    np.testing.assert_allclose(back, expected, atol=1e-6)
    x0, y0, x1, y1 = (*there[0], *there[2])
    around = map_box(view, (x0, y0, x1, y1), inverse=True)
    np.testing.assert_allclose(around[[0, 2]], [[x, y], [x + 20, y + 10]], atol=1e-6)


@QUICK
@given(ANGLE, ANGLE, ANGLE, X, Y, st.floats(2.0, 30.0), st.floats(0.3, 1.0), st.floats(0, 179))
def test_ellipses_are_mapped_exactly(
    tx: float, ty: float, tz: float, x: float, y: float, a: float, ratio: float, angle: float
) -> None:
    view = view_of(PAPER_CAMERA, tx, ty, tz)
    ellipse = Ellipse(x, y, a, a * ratio, angle)
    there = map_ellipse(view, ellipse)
    # Each point of the ellipse lands on its image: (p - c)ᵀ S⁻¹ (p - c) = 1.
    offset = map_points(view, ellipse.points(16)) - there.center
    level = np.einsum("ni,ij,nj->n", offset, np.linalg.inv(there.shape_matrix), offset)
    np.testing.assert_allclose(level, 1.0, atol=1e-7)
    back = map_ellipse(view, there, inverse=True)
    np.testing.assert_allclose(back.center, ellipse.center, atol=1e-6)
    np.testing.assert_allclose(back.shape_matrix, ellipse.shape_matrix, atol=1e-5)


@QUICK
@given(ANGLE, ANGLE, ANGLE, X, Y, st.floats(3.0, 15.0))
def test_ellipses_come_back_through_a_lens(
    tx: float, ty: float, tz: float, x: float, y: float, a: float
) -> None:
    view = view_of(BARREL, tx, ty, tz)
    ellipse = Ellipse(x, y, a, 0.7 * a, 30.0)
    back = map_ellipse(view, map_ellipse(view, ellipse), inverse=True)
    np.testing.assert_allclose(back.center, ellipse.center, atol=0.02)
    np.testing.assert_allclose([back.a, back.b], [a, 0.7 * a], atol=0.02)


def test_circle_under_a_shift_and_scale_by_hand() -> None:
    homography = np.array([[2.0, 0.0, 10.0], [0.0, 2.0, -5.0], [0.0, 0.0, 1.0]])
    circle = map_ellipse(homography, Ellipse(3.0, 4.0, 1.0, 1.0))
    np.testing.assert_allclose([circle.cx, circle.cy, circle.a, circle.b], [16, 3, 2, 2])
    np.testing.assert_allclose(map_points(homography, [[3, 4]]), [[16, 3]])
    np.testing.assert_allclose(
        map_box(homography, (0, 0, 1, 1)), [[10, -5], [12, -5], [12, -3], [10, -3]]
    )
    np.testing.assert_allclose(map_points(homography, [[16, 3]], inverse=True), [[3, 4]])


def test_ellipse_centre_is_not_the_mapped_centre() -> None:
    # x' = x / (1 - x/100): the circle about 0 of radius 50 spans -50/1.5 to 50/0.5.
    homography = np.array([[1.0, 0, 0], [0, 1, 0], [-0.01, 0, 1]])
    image = map_ellipse(homography, Ellipse(0.0, 0.0, 50.0, 50.0))
    assert image.cx == pytest.approx((100 - 100 / 3) / 2)
    assert image.a == pytest.approx((100 + 100 / 3) / 2)


@pytest.mark.parametrize("x", [61.0, 100.0, 130.0, 170.0])
def test_ellipse_at_the_horizon_is_refused(x: float) -> None:
    homography = np.array([[1.0, 0, 0], [0, 1, 0], [-0.01, 0, 1]])  # horizon: x = 100
    with pytest.raises(InputError, match="horizon"):
        map_ellipse(homography, Ellipse(x, 0.0, 40.0, 40.0))
    assert np.isnan(map_points(homography, [[100.0, 5.0], [130.0, 5.0]])).all()


def test_wrong_arguments_are_named() -> None:
    with pytest.raises(InputError, match="points"):
        map_points(np.eye(3), [1.0, 2.0])
    with pytest.raises(InputError, match="points"):
        map_points(np.eye(3), [["a", "b"]])
    with pytest.raises(InputError, match="homography"):
        map_points(np.eye(2), [[1.0, 2.0]])
    with pytest.raises(InputError, match="homography"):
        map_points(np.zeros((3, 3)), [[1.0, 2.0]], inverse=True)
    with pytest.raises(InputError, match="box"):
        map_box(np.eye(3), [1.0, 2.0, 3.0])


def test_points_a_lens_cannot_reach_are_nan() -> None:
    # k1 = -0.3 folds at r² = 1/0.9: past r = 1.054 two rays share a pixel.
    camera = Camera.from_matrix(
        [[320, 0, 320], [0, 320, 240], [0, 0, 1]], 640, 480, distortion=(-0.3, 0, 0, 0)
    )
    view = warp_panel(noise(480, 640), camera, make_pose(camera, (0, 0, 0)), crop="full")
    assert not np.allclose(view.homography[:2, 2], 0)
    origin = map_points(view, [[320.0, 240.0]])
    beyond = origin + np.array([[320 * 1.2, 0.0]])
    assert np.isnan(map_points(view, beyond, inverse=True)).all()
    inside = map_points(view, origin + np.array([[320 * 0.8, 0.0]]), inverse=True)
    np.testing.assert_allclose(inside, [[320 + 320 * 0.8 * (1 - 0.3 * 0.64), 240]], atol=1e-6)
