import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fronto import Ellipse, InputError
from fronto.pose.circle import circle_normals
from fronto.synth import LayoutButton

fixed = settings(derandomize=True, deadline=None)
tilts = st.floats(-35, 35)

K = np.array([[320.0, 0, 320], [0, 320, 240], [0, 0, 1]])


def the_circle(radius_m=0.015):
    return [LayoutButton(0.0, 0.0, 2 * radius_m, 2 * radius_m, "ellipse")]


def angle_deg(u, v):
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(u, v)), u @ v))


def spread_on_plane(ellipse, normal):
    """Relative scatter of the distances from the centre, of the outline on a candidate plane."""
    rays = np.column_stack([ellipse.points(60), np.ones(60)]) @ np.linalg.inv(K).T
    points = rays / (rays @ normal)[:, None]
    # The points of a circle are on a sphere around its centre: |p|² - 2 c·p + c0 = 0.
    system = np.column_stack([2 * points, np.ones(60)])
    solution = np.linalg.lstsq(system, (points**2).sum(axis=1), rcond=1e-12)[0]
    distance = np.linalg.norm(points - solution[:3], axis=1)
    return distance.std() / distance.mean()


def test_near_frontal_is_the_false_one(view):
    # GEOMETRY: r = 15 mm on the ray of (420, 240), R(0, 30, 0); the true normal is R's
    # third row (sin 30°, 0, cos 30°).
    seen = view(the_circle(), (0, 30, 0), at_px=(420, 240))
    false, true = circle_normals(seen.outlines[0].ellipse_px, K)
    np.testing.assert_allclose(true, [0.5, 0, np.sqrt(0.75)], atol=1e-6)
    np.testing.assert_allclose(false, [0.082, 0, 0.997], atol=5e-4)


@fixed
@given(tilts, tilts, tilts, st.floats(60, 580), st.floats(60, 420), st.floats(0.01, 0.05))
def test_truth_is_a_candidate_and_both_cut_circles(view, tx, ty, tz, px, py, radius):
    seen = view(the_circle(radius), (tx, ty, tz), at_px=(px, py))
    normals = circle_normals(seen.outlines[0].ellipse_px, K)
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0, atol=1e-12)
    # Where both nearly coincide an error e in the ellipse moves them by √e.
    assert min(angle_deg(n, seen.rotation[2]) for n in normals) < 1e-3
    assert all(spread_on_plane(seen.outlines[0].ellipse_px, n) < 1e-6 for n in normals)
    assert normals[0, 2] >= normals[1, 2]


@fixed
@given(tilts, tilts, st.floats(60, 580), st.floats(60, 420))
def test_small_circles_mirror_about_the_ray_to_them(view, tx, ty, px, py):
    seen = view(the_circle(0.0005), (tx, ty, 0), at_px=(px, py))
    ray = np.linalg.solve(K, [px, py, 1.0])
    ray /= np.linalg.norm(ray)
    true = seen.rotation[2]
    mirrored = 2 * (true @ ray) * ray - true
    normals = circle_normals(seen.outlines[0].ellipse_px, K)
    if angle_deg(true, ray) > 2.0:
        assert min(angle_deg(n, mirrored) for n in normals) < 0.5
        assert angle_deg(*normals) == pytest.approx(2 * angle_deg(true, ray), abs=0.5)


def test_both_coincide_for_a_circle_that_faces_the_camera():
    normals = circle_normals(Ellipse(320.0, 240.0, 32.0, 32.0), K)
    np.testing.assert_allclose(normals, [[0, 0, 1], [0, 0, 1]], atol=1e-7)


def test_frontal_off_the_axis(view):
    # Frontal but at the right of the photo: the ellipse is longer along x; one is (0, 0, 1).
    seen = view(the_circle(), (0, 0, 0), at_px=(520, 240))
    normals = circle_normals(seen.outlines[0].ellipse_px, K)
    np.testing.assert_allclose(normals[0], [0, 0, 1], atol=1e-6)
    assert normals[1] @ [0, 0, 1] < 0.9


def test_pixels_need_not_be_square(view):
    seen = view(the_circle(), (10, 25, 0), at_px=(250, 300))
    stretch = np.diag([2.0, 1.0, 1.0])
    ellipse = seen.outlines[0].ellipse_px
    wide = Ellipse.from_shape_matrix(
        ellipse.center * [2, 1], stretch[:2, :2] @ ellipse.shape_matrix @ stretch[:2, :2]
    )
    np.testing.assert_allclose(
        circle_normals(wide, stretch @ K), circle_normals(ellipse, K), atol=1e-9
    )


def test_no_camera_matrix():
    with pytest.raises(InputError, match="camera matrix"):
        circle_normals(Ellipse(320, 240, 30, 20), np.eye(3) * 2)
