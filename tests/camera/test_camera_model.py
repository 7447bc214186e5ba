"""The camera's constructors, checks, scaling, lens distortion and point mappings."""

from __future__ import annotations

import dataclasses
import json
import subprocess
import sys

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fronto.camera import Camera
from fronto.camera.conic import fit_ellipse
from fronto.errors import InputError
from fronto.shapes import Ellipse

K = [[320.0, 0.0, 320.0], [0.0, 320.0, 240.0], [0.0, 0.0, 1.0]]
LENSES = {
    "barrel": (None, [-0.3, 0.1, 0.001, -0.002, 0.01]),
    "pincushion": (None, [0.2, 0.05, -0.001, 0.002]),
    "rational": (None, [-0.1, 0.02, 0.001, 0.001, 0.0, 0.02, 0.01, 0.001]),
    "prism": (None, [-0.1, 0.02, 0.001, 0.001, 0.0, 0.02, 0.01, 0.001, 0.001, 0.002, 0.003, 0.001]),
    "tilt": (
        None,
        [-0.1, 0.02, 1e-3, 1e-3, 0, 0.02, 0.01, 1e-3, 1e-3, 2e-3, 3e-3, 1e-3, 0.05, -0.08],
    ),
    "fisheye": ("equidistant", [0.02, -0.01, 0.005, -0.001]),
    "ideal fisheye": ("equidistant", [0.0, 0.0, 0.0, 0.0]),
}


def lens(name: str, focal: float = 320.0) -> Camera:
    model, coefficients = LENSES[name]
    matrix = [[focal, 0, 320], [0, focal, 240], [0, 0, 1]]
    return Camera.from_matrix(matrix, 640, 480, coefficients, model)


def image_grid() -> np.ndarray:
    x, y = np.meshgrid(np.linspace(0, 639, 33), np.linspace(0, 479, 25))
    return np.stack([x.ravel(), y.ravel()], axis=1)


def test_pinhole_is_the_papers_matrix() -> None:
    camera = Camera.from_pinhole(0.004, 5e-6, 4e-6, 322.5, 238.25, 640, 480)
    assert camera.matrix == pytest.approx(
        np.array([[800, 0, 322.5], [0, 1000, 238.25], [0, 0, 1]]), abs=1e-9
    )
    assert camera.focal_px == pytest.approx(np.sqrt(800 * 1000))
    assert (camera.source, camera.focal_std, camera.distorted) == ("given", 0.0, False)


@pytest.mark.parametrize("position", [0, 1, 2])
@pytest.mark.parametrize("value", [0.0, -1.0, float("nan"), float("inf")])
def test_pinhole_refuses_lengths_that_are_none(position: int, value: float) -> None:
    lengths = [0.004, 5e-6, 5e-6]
    lengths[position] = value
    with pytest.raises(InputError, match="metres"):
        Camera.from_pinhole(*lengths, 320, 240, 640, 480)


def test_field_of_view_of_90_degrees() -> None:
    camera = Camera.from_fov(90.0, 640, 480)
    expected = [[320, 0, 319.5], [0, 320, 239.5], [0, 0, 1]]
    assert camera.matrix == pytest.approx(np.array(expected), abs=1e-9)
    assert camera.horizontal_fov_deg == pytest.approx(90.0, abs=1e-9)


@settings(derandomize=True, deadline=None)
@given(st.floats(1.0, 175.0), st.integers(2, 9000), st.integers(2, 9000))
def test_field_of_view_comes_back(fov: float, width: int, height: int) -> None:
    assert Camera.from_fov(fov, width, height).horizontal_fov_deg == pytest.approx(fov, rel=1e-9)


@pytest.mark.parametrize("fov", [0.0, 180.0, -5.0, float("nan")])
def test_field_of_view_out_of_range(fov: float) -> None:
    with pytest.raises(InputError, match="180"):
        Camera.from_fov(fov, 640, 480)


def test_fisheye_field_of_view() -> None:
    # Ideal equidistant: the edges at 320.5 and 319.5 px are at 320.5/320 and 319.5/320 rad.
    assert lens("ideal fisheye").horizontal_fov_deg == pytest.approx(np.degrees(2.0), abs=1e-9)
    # At f = 200 the edges are at 91.8 and 91.5 degrees: behind the plane at depth 1.
    assert np.isnan(lens("ideal fisheye", 200.0).horizontal_fov_deg)


def test_default_is_wide() -> None:
    camera = Camera.default(480, 640)
    assert camera.matrix == pytest.approx(
        np.array([[544, 0, 239.5], [0, 544, 319.5], [0, 0, 1]]), abs=1e-9
    )
    assert (camera.source, camera.focal_std) == ("default", 0.25)


@pytest.mark.parametrize(
    ("count", "model"),
    [(4, "plumb_bob"), (5, "plumb_bob"), (8, "rational_polynomial"), (12, "rational_polynomial"),
     (14, "rational_polynomial")],
)  # fmt: skip
def test_count_tells_the_model(count: int, model: str) -> None:
    camera = Camera.from_matrix(K, 640, 480, [0.01] * count)
    assert camera.distortion_model == model
    assert camera.distorted
    zero = Camera.from_matrix(K, 640, 480, [0.0] * count)
    assert (zero.distortion_model, len(zero.distortion), zero.distorted) == ("none", 0, False)


def test_a_fisheye_with_zero_coefficients_still_bends() -> None:
    camera = Camera.from_matrix(K, 640, 480, [0.0] * 4, "equidistant")
    assert camera.distorted
    # The ray at 45 degrees is imaged at f·π/4.
    assert camera.project([[1.0, 0.0, 1.0]])[0] == pytest.approx([320 + 320 * np.pi / 4, 240])


@pytest.mark.parametrize(
    ("matrix", "word"),
    [
        ([[0, 0, 320], [0, 320, 240], [0, 0, 1]], "focal length"),
        ([[320, 0, 320], [0, -320, 240], [0, 0, 1]], "focal length"),
        (np.zeros((3, 3)), "focal length"),
        ([[320, 0, 0], [0, 320, 0], [320, 240, 1]], "transposed"),
        ([[320, 0, 320], [5, 320, 240], [0, 0, 1]], "zeros"),
        ([[320, 0, 320], [0, 320, 240], [0, 0, 2]], "zeros"),
        ([[np.nan, 0, 320], [0, 320, 240], [0, 0, 1]], "finite"),
        ([[320, 0, 1281], [0, 320, 240], [0, 0, 1]], "principal point"),
        ([[320, 0, 320], [0, 320, -481], [0, 0, 1]], "principal point"),
        (np.eye(4), "shape"),
        ([["a", 0, 320], [0, 320, 240], [0, 0, 1]], "numbers"),
        ([[320, 0], [0, 320, 240], [0, 0, 1]], "shape"),
    ],
)
def test_bad_matrix(matrix: object, word: str) -> None:
    with pytest.raises(InputError, match=word) as caught:
        Camera.from_matrix(matrix, 640, 480)
    assert "camera matrix" in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("size", [(0, 480), (640, -1), (640.5, 480), ("640", 480), (True, 480)])
def test_bad_size(size: tuple[int, int]) -> None:
    for build in (lambda: Camera.from_matrix(K, *size), lambda: Camera.default(*size),
                  lambda: Camera.from_fov(60, *size)):  # fmt: skip
        with pytest.raises(InputError, match=r"(width|height)_px"):
            build()


@pytest.mark.parametrize(
    ("coefficients", "model", "word"),
    [
        ([0.1] * 3, None, "coefficients"),
        ([0.1] * 6, None, "coefficients"),
        ([0.1] * 8, "plumb_bob", "4 or 5"),
        ([0.1] * 5, "rational_polynomial", "8 or 12 or 14"),
        ([0.1] * 5, "equidistant", "expected 4 "),
        ([0.1] * 4, "none", "expected 0 "),
        ([0.1, np.inf, 0, 0], None, "finite"),
        ([0.1] * 4, "omni", "distortion_model"),
        ([[0.1] * 4], None, "shape"),
    ],
)
def test_bad_distortion(coefficients: list[float], model: str | None, word: str) -> None:
    with pytest.raises(InputError, match=word):
        Camera.from_matrix(K, 640, 480, coefficients, model)


def test_bad_source_and_deviation() -> None:
    with pytest.raises(InputError, match="source"):
        Camera.from_matrix(K, 640, 480, source="guess")
    for value in (-0.1, float("nan")):
        with pytest.raises(InputError, match="focal_std"):
            Camera(np.array(K), 640, 480, focal_std=value)


def test_arrays_are_read_only_copies() -> None:
    matrix = np.array(K)
    camera = Camera(matrix, np.int64(640), 480)
    matrix[0, 0] = 1.0
    assert camera.matrix[0, 0] == 320
    assert type(camera.width_px) is int
    with pytest.raises(ValueError, match="read-only"):
        camera.matrix[0, 0] = 2.0
    with pytest.raises(ValueError, match="read-only"):
        lens("barrel").distortion[0] = 0.0
    with pytest.raises(dataclasses.FrozenInstanceError):
        camera.width_px = 3


def test_scaling_keeps_pixel_centres() -> None:
    camera = Camera.from_matrix([[320, 2, 319.5], [0, 330, 239.5], [0, 0, 1]], 640, 480)
    half = camera.scaled_to(320, 240)
    # (319.5 + 0.5) / 2 - 0.5: the middle stays the middle.
    assert half.matrix == pytest.approx(np.array([[160, 1, 159.5], [0, 165, 119.5], [0, 0, 1]]))
    assert (half.width_px, half.height_px) == (320, 240)
    assert camera.scaled_to(640, 480).matrix.tolist() == camera.matrix.tolist()


@settings(derandomize=True, deadline=None)
@given(st.floats(-0.4, 0.9), st.floats(-0.4, 0.9), st.sampled_from([0.25, 0.5, 3.0]))
def test_scaled_camera_sees_the_same_rays(x: float, y: float, scale: float) -> None:
    camera = lens("barrel")
    scaled = camera.scaled_to(int(640 * scale), int(480 * scale))
    pixel = camera.project([[x, y, 2.0]])[0]
    assert scaled.project([[x, y, 2.0]])[0] == pytest.approx((pixel + 0.5) * scale - 0.5)


def test_scaling_allows_rounding_and_refuses_another_aspect() -> None:
    camera = Camera.from_fov(60, 4032, 3024)
    assert camera.scaled_to(101, 75).height_px == 75  # 75.75
    assert Camera.from_fov(60, 1920, 1080).scaled_to(1920, 1088).height_px == 1088  # 0.7 %
    with pytest.raises(InputError) as caught:
        camera.scaled_to(1920, 1080)
    assert "4032x3024" in str(caught.value)
    assert "1920x1080" in str(caught.value)
    assert "rotated" not in str(caught.value)
    with pytest.raises(InputError, match="rotated"):
        camera.scaled_to(3024, 4032)
    with pytest.raises(InputError, match="width_px"):
        camera.scaled_to(0, 480)


def test_with_focal() -> None:
    camera = Camera.from_matrix([[400, 3, 320], [0, 100, 240], [0, 0, 1]], 640, 480)
    other = camera.with_focal(400.0, 0.1)  # twice √(400·100)
    assert other.matrix == pytest.approx(np.array([[800, 6, 320], [0, 200, 240], [0, 0, 1]]))
    assert other.focal_px == pytest.approx(400.0)
    assert (other.source, other.focal_std) == ("estimated", 0.1)
    assert camera.matrix[0, 0] == 400
    for focal in (0.0, -1.0, float("nan")):
        with pytest.raises(InputError, match="focal_px"):
            camera.with_focal(focal, 0.1)


def test_an_estimated_focal_length_says_what_it_started_from() -> None:
    start = Camera.default(640, 480)
    once = start.with_focal(500.0, 0.05)
    assert once.detail == f"estimated from the panel, start: {start.detail}"
    assert once.with_focal(510.0, 0.04).detail == once.detail
    assert start.with_focal(500.0, 0.3, "default").detail == start.detail
    bare = Camera.from_matrix([[500, 0, 320], [0, 500, 240], [0, 0, 1]], 640, 480)
    assert bare.with_focal(510.0, 0.1).detail == "estimated from the panel"


def test_refused_numbers_come_with_a_remedy() -> None:
    good = [[500, 0, 320], [0, 500, 240], [0, 0, 1]]
    bad = [[500, 0, float("nan")], [0, 500, 240], [0, 0, 1]]
    for matrix, distortion in ((bad, ()), (good, (0.1, 0.0, 0.0)), (good, (float("nan"),) * 4)):
        with pytest.raises(InputError) as refused:
            Camera.from_matrix(matrix, 640, 480, distortion)
        assert refused.value.remedy
        assert refused.value.expected.startswith("expected")


def test_rays_and_projection_by_hand() -> None:
    camera = Camera.from_matrix([[300, 10, 320], [0, 200, 240], [0, 0, 1]], 640, 480)
    # (0.5, -0.25, 1): x = 300/2 - 10/4 + 320, y = -200/4 + 240.
    assert camera.project([[1.0, -0.5, 2.0]])[0] == pytest.approx([467.5, 190.0])
    assert camera.rays([[467.5, 190.0]])[0] == pytest.approx([0.5, -0.25, 1.0])
    behind = camera.project([[1.0, 1.0, 0.0], [1.0, 1.0, -1.0], [0.0, 0.0, 1.0]])
    assert np.isnan(behind[:2]).all()
    assert behind[2] == pytest.approx([320, 240])


def test_barrel_by_hand() -> None:
    camera = Camera.from_matrix(K, 640, 480, [-0.2, 0.0, 0.0, 0.0])
    # r² = 0.25: 0.5 (1 - 0.05) = 0.475.
    assert camera.project([[0.5, 0.0, 1.0]])[0] == pytest.approx([320 + 152, 240])
    assert camera.undistort_points([[472.0, 240.0]])[0] == pytest.approx([480.0, 240.0])
    assert camera.rays([[472.0, 240.0]])[0] == pytest.approx([0.5, 0.0, 1.0])


@pytest.mark.parametrize("name", [name for name in LENSES if "fisheye" not in name])
def test_agrees_with_opencv(name: str) -> None:
    camera = lens(name)
    rays = camera.rays(image_grid())
    pixels, _ = cv2.projectPoints(
        rays[:, None], np.zeros(3), np.zeros(3), camera.matrix, camera.distortion
    )
    assert np.abs(pixels.reshape(-1, 2) - image_grid()).max() < 1e-9
    assert np.abs(camera.project(rays * 3.0) - image_grid()).max() < 1e-9


@pytest.mark.parametrize("name", ["fisheye", "ideal fisheye"])
def test_agrees_with_opencvs_fisheye(name: str) -> None:
    camera = lens(name)
    points = image_grid()
    expected = cv2.fisheye.undistortPoints(
        points[:, None], camera.matrix, camera.distortion, None, None, camera.matrix
    )
    assert np.abs(camera.undistort_points(points) - expected.reshape(-1, 2)).max() < 1e-6


@pytest.mark.parametrize("name", LENSES)
def test_round_trip_in_the_whole_image(name: str) -> None:
    camera = lens(name)
    straight = camera.undistort_points(image_grid())
    assert np.isfinite(straight).all()
    assert np.abs(straight - image_grid()).max() > 10  # the lens does bend
    assert np.abs(camera.distort_points(straight) - image_grid()).max() < 1e-6


@settings(derandomize=True, deadline=None)
@given(
    st.tuples(*[st.floats(-0.4, 0.4)] * 2, *[st.floats(-0.005, 0.005)] * 2, st.floats(-0.1, 0.1)),
    st.floats(200, 900),
    st.floats(-20, 20),
)
def test_answers_are_exact_or_nan(k: tuple[float, ...], focal: float, skew: float) -> None:
    matrix = [[focal, skew, 310], [0, focal, 250], [0, 0, 1]]
    camera = Camera.from_matrix(matrix, 640, 480, k)
    for there, back in (
        (camera.undistort_points, camera.distort_points),
        (camera.distort_points, camera.undistort_points),
    ):
        points = there(image_grid())
        good = np.isfinite(points[:, 0])
        again = back(points[good])
        assert np.isfinite(again).all()
        assert np.abs(again - image_grid()[good]).max(initial=0.0) < 1e-6


def test_outside_the_models_validity_is_nan() -> None:
    # r (1 - 0.3 r²) turns at r = 1.0541 with the value 0.7027: 224.9 px at f = 320.
    camera = Camera.from_matrix(K, 640, 480, [-0.3, 0.0, 0.0, 0.0])
    straight = camera.undistort_points([[320 + 224.5, 240], [320 + 226.0, 240], [320, 240]])
    assert np.isnan(straight).all(axis=1).tolist() == [False, True, False]
    assert 1.0 < (straight[0, 0] - 320) / 320 < 1.0541
    bent = camera.distort_points([[320 + 337.0, 240], [320 + 338.0, 240]])
    assert np.isnan(bent).all(axis=1).tolist() == [False, True]


def test_fisheye_beyond_90_degrees_is_nan() -> None:
    camera = lens("ideal fisheye", 200.0)
    pixels = [[320 + 200 * np.radians(89), 240], [320 + 200 * np.radians(90.5), 240]]
    rays = camera.rays(pixels)
    assert rays[0, 0] == pytest.approx(np.tan(np.radians(89)))
    assert np.isnan(rays[1, :2]).all()


def test_pole_of_the_rational_model_is_outside() -> None:
    # The denominator 1 - r² vanishes at r = 1.
    camera = Camera.from_matrix(K, 640, 480, [0, 0, 0, 0, 0, -1.0, 0, 0])
    bent = camera.distort_points([[320 + 300.0, 240], [320 + 330.0, 240]])
    assert np.isnan(bent).all(axis=1).tolist() == [False, True]


@pytest.mark.parametrize("name", [None, *LENSES])
def test_no_points_and_nan_points(name: str | None) -> None:
    camera = Camera.from_matrix(K, 640, 480) if name is None else lens(name)
    for method in (camera.undistort_points, camera.distort_points):
        assert method(np.zeros((0, 2))).shape == (0, 2)
        mixed = method([[np.nan, 3.0], [320.0, 240.0]])
        assert np.isnan(mixed[0, 0])
        assert np.isfinite(mixed[1]).all()
    assert camera.rays(np.zeros((0, 2))).shape == (0, 3)
    assert camera.project(np.zeros((0, 3))).shape == (0, 2)


def test_points_of_another_shape() -> None:
    camera = lens("barrel")
    for bad in ([1.0, 2.0], [[1.0, 2.0, 3.0]], [["a", "b"]]):
        with pytest.raises(InputError, match="points"):
            camera.undistort_points(bad)
    with pytest.raises(InputError, match="points"):
        camera.project([[1.0, 2.0]])


def test_without_distortion_points_are_copied() -> None:
    points = image_grid()
    camera = Camera.from_matrix(K, 640, 480)
    straight = camera.undistort_points(points)
    assert straight.tolist() == points.tolist()
    straight[0] = 7
    assert points[0, 0] == 0


@settings(derandomize=True, deadline=None)
@given(st.floats(-50, 50), st.floats(1.0, 30.0), st.floats(0.2, 0.9), st.floats(0, 179))
def test_ellipse_fit_is_exact(cx: float, a: float, ratio: float, angle: float) -> None:
    ellipse = Ellipse(cx, 3.0, a, a * ratio, angle)
    fitted = fit_ellipse(ellipse.points(7))
    assert (fitted.cx, fitted.cy) == pytest.approx((cx, 3.0), abs=1e-7)
    assert fitted.shape_matrix == pytest.approx(ellipse.shape_matrix, abs=1e-6)


def test_ellipse_fit_refuses_what_is_none() -> None:
    t = np.linspace(-1, 1, 9)
    with pytest.raises(InputError, match="ellipse"):
        fit_ellipse(np.stack([np.cosh(t), np.sinh(t)], axis=1))
    with pytest.raises(InputError, match="at least 5"):
        fit_ellipse(np.eye(2))


def test_undistorted_ellipse() -> None:
    plain = Camera.from_matrix(K, 640, 480)
    bent = lens("barrel")
    straight = Ellipse(500.0, 330.0, 25.0, 18.0, 30.0)
    assert plain.undistort_ellipse(straight) is straight
    pixels = fit_ellipse(bent.distort_points(straight.points(64)))
    assert abs(pixels.cx - straight.cx) > 5
    found = bent.undistort_ellipse(pixels)
    assert (found.cx, found.cy) == pytest.approx((straight.cx, straight.cy), abs=0.05)
    assert (found.a, found.b) == pytest.approx((straight.a, straight.b), abs=0.1)
    narrow = Camera.from_matrix(K, 640, 480, [-0.3, 0.0, 0.0, 0.0])
    with pytest.raises(InputError, match="validity"):
        narrow.undistort_ellipse(Ellipse(620.0, 240.0, 10.0, 10.0))


def test_dictionary_is_plain_json() -> None:
    content = json.loads(json.dumps(lens("barrel").with_focal(320, 0.1).to_dict()))
    assert content == {
        "matrix": K,
        "distortion": [-0.3, 0.1, 0.001, -0.002, 0.01],
        "source": "estimated",
        "distortion_model": "plumb_bob",
        "focal_std": 0.1,
        "width_px": 640,
        "height_px": 480,
        "detail": "estimated from the panel",
    }


def test_import_and_plain_points_load_no_opencv() -> None:
    code = (
        "import sys; from fronto.camera import Camera; c = Camera.default(640, 480); "
        "c.project(c.rays([[1.0, 2.0]])); "
        "sys.exit(any(m in sys.modules for m in ('cv2', 'PIL', 'yaml', 'msgspec')))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
