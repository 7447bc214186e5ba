import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fronto import Camera, Ellipse, InputError, LineSegment, Outline
from fronto.pose.bundle import ELLIPSE, QUAD
from fronto.pose.observations import observations, undistorted

fixed = settings(derandomize=True, deadline=None)

CAMERA = Camera.from_matrix([[200, 0, 320], [0, 100, 240], [0, 0, 1]], 640, 480)
SQUARE = np.array([[300, 200], [340, 200], [340, 240], [300, 240]], dtype=float)


def test_quads_by_hand():
    seen = observations([Outline.quad(SQUARE, std_px=0.5)], CAMERA, tolerance=0)
    assert seen.kind.tolist() == [QUAD]
    # u = (x - 320)/200, v = (y - 240)/100
    expected = [-0.1, -0.4, 0.1, -0.4, 0.1, 0.0, -0.1, 0.0]
    np.testing.assert_allclose(seen.observed[0], expected + [0] * 16, atol=1e-15)
    # f = √(200 · 100), over the deviation; a quad has no tangents.
    np.testing.assert_allclose(seen.inverse_sd[0], [np.sqrt(20000) / 0.5] * 4 + [0] * 4)
    # Middle of the box (320, 220).
    np.testing.assert_allclose(seen.pivot, [0.0, -0.2], atol=1e-15)
    assert len(seen.axis) == 0


def test_form_by_hand():
    def gains(**options):
        outlines = [Outline.quad(SQUARE, std_px=2.0, **options), Outline.ellipse(100, 100, 20, 20)]
        return observations(outlines, CAMERA, tolerance=0.01).gain.tolist()

    assert gains() == [1, 1]
    # The tolerance, 0.4 px of 40, is in both.
    # And of two outlines three tenths of the variance are common.
    assert gains(form_std_px=0.3)[0] == pytest.approx(np.hypot(2, 0.4) / 0.5 / np.sqrt(1.3))
    assert gains(form_std_px=5.0) == [1, 1]
    assert gains(form_std_px=0.3, seen=(True, True, True, False)) == [1, 1]


def test_the_form_of_circles_by_hand():
    def gains(**options):
        circle = Outline.ellipse(100, 100, 20, 20, std_px=2.0, **options)
        return observations([circle] * 5, CAMERA, tolerance=0.01).gain.tolist()

    assert gains() == [1] * 5
    alike = np.sqrt(1 + 0.3 * 4)
    assert gains(form_std_px=0.3) == pytest.approx([np.hypot(2, 0.4) / 0.5 / alike] * 5)


def test_forms_that_err_alike_count_less():
    def gain(count):
        circle = Outline.ellipse(100, 100, 20, 20, std_px=2.0, form_std_px=0.3)
        return observations([circle] * count, CAMERA, tolerance=0.0).gain[0]

    assert gain(1) == pytest.approx(2 / 0.3)
    assert gain(8) < gain(2) < gain(1)
    # Never less sure than all of it.
    assert gain(1000) == 1


def test_lines_by_hand():
    lines = [
        LineSegment("vertical", [[320, 140], [420, 340]], std_px=0.4),
        LineSegment("horizontal", [[0, 240], [520, 240]], std_px=1.0),
    ]
    seen = observations([Outline.quad(SQUARE)], CAMERA, lines)
    assert seen.axis.tolist() == [1, 0]
    np.testing.assert_allclose(seen.segment, [[0, -1, 0.5, 1], [-1.6, 0, 1, 0]], atol=1e-15)
    np.testing.assert_allclose(seen.line_isd, [np.sqrt(20000) / 0.4, np.sqrt(20000)])


@fixed
@given(
    st.floats(0, 640), st.floats(0, 480), st.floats(2, 80), st.floats(0.2, 1.0), st.floats(0, 180)
)
def test_tangents_touch_the_ellipse(cx, cy, a, ratio, angle):
    ellipse = Ellipse(cx, cy, a, a * ratio, angle)
    seen = observations([Outline("ellipse", ellipse_px=ellipse)], CAMERA)
    assert seen.kind.tolist() == [ELLIPSE]
    tangents = seen.observed[0].reshape(8, 3)
    normals, h = tangents[:, :2], tangents[:, 2]
    np.testing.assert_allclose(np.linalg.norm(normals, axis=1), 1.0)
    points = (ellipse.points(3600) - [320, 240]) / [200, 100]
    # The outermost point along each normal is on the tangent.
    np.testing.assert_allclose((points @ normals.T).max(axis=0), h, atol=1e-5)
    # Opposite tangents are parallel.
    np.testing.assert_allclose(normals[4:], -normals[:4], atol=1e-9)


def test_tangents_fix_a_circles_center_to_its_deviation():
    square_pixels = Camera.from_matrix([[300, 0, 320], [0, 300, 240], [0, 0, 1]], 640, 480)
    seen = observations(
        [Outline.ellipse(350, 260, 20, 20, std_px=0.25)], square_pixels, tolerance=0
    )
    normals = seen.observed[0].reshape(8, 3)[:, :2]
    information = (normals * seen.inverse_sd[0][:, None] ** 2).T @ normals
    np.testing.assert_allclose(information, np.eye(2) * (300 / 0.25) ** 2, rtol=1e-9, atol=1e-3)


def test_distortion_is_removed_from_everything():
    camera = Camera.from_matrix(
        [[400, 0, 320], [0, 400, 240], [0, 0, 1]], 640, 480, [-0.2, 0.05, 0, 0]
    )
    corners = np.array([[500, 100], [560, 110], [555, 170], [495, 160]], dtype=float)
    circle = Ellipse(150, 350, 30, 25, 20)
    ends = np.array([[40.0, 40.0], [600.0, 30.0]])

    flat = undistorted([Outline.quad(corners), Outline("ellipse", ellipse_px=circle)], camera)
    np.testing.assert_allclose(camera.distort_points(flat[0].corners_px), corners, atol=1e-6)
    assert np.linalg.norm(flat[0].corners_px - corners) > 5
    # The fitted ellipse goes through the undistorted outline.
    offset = camera.undistort_points(circle.points(40)) - flat[1].ellipse_px.center
    value = np.einsum("ni,ij,nj->n", offset, np.linalg.inv(flat[1].ellipse_px.shape_matrix), offset)
    np.testing.assert_allclose(value, 1.0, atol=0.01)

    seen = observations(flat, camera, [LineSegment("horizontal", ends)])
    straight = camera.rays(ends)[:, :2]
    np.testing.assert_allclose(seen.segment.reshape(2, 2), straight, atol=1e-9)
    np.testing.assert_allclose(
        seen.observed[0, :8].reshape(4, 2), camera.rays(corners)[:, :2], atol=1e-9
    )


def test_without_distortion_nothing_changes():
    outlines = (Outline.quad(SQUARE), Outline.ellipse(100, 100, 9, 8))
    assert undistorted(outlines, CAMERA) == outlines


def test_beyond_the_lens_model():
    camera = Camera.from_matrix(
        [[200, 0, 320], [0, 200, 240], [0, 0, 1]], 640, 480, [-0.4, 0.0, 0, 0]
    )
    far = [[0.0, 0.0], [30.0, 0.0], [30.0, 30.0], [0.0, 30.0]]
    with pytest.raises(InputError):
        undistorted([Outline.quad(far)], camera)
    with pytest.raises(InputError):
        undistorted([Outline.ellipse(20, 20, 12, 12)], camera)
