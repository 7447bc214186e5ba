"""From outlines to a head-on view: geometry against exact truth, and failures as values."""

from __future__ import annotations

import dataclasses
from typing import Any

import cv2
import numpy as np
import pytest

import fronto
import fronto.pipeline
from fronto.camera import Camera
from fronto.errors import InputError
from fronto.pose.rotation import rotation_from_angles
from fronto.results import PanelPose
from fronto.shapes import Outline

CAMERA = Camera.from_matrix([[500, 0, 320], [0, 500, 240], [0, 0, 1]], 640, 480)
ROTATION = rotation_from_angles(*np.radians([25.0, -20.0, 4.0]))
# Two columns of three, 0.16 wide and 0.12 high on the plane at depth 1, near the middle of
# the photo, (0.40, 0.47).
CENTERS = np.array([(x, y) for y in (0.25, 0.45, 0.65) for x in (0.27, 0.52)])
CORNERS = CENTERS[:, None] + np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [0.08, 0.06]


def seen(plane: np.ndarray) -> np.ndarray:
    """Photo pixels of points on the panel's plane z = 1, exact."""
    rays = np.concatenate([plane, np.ones((*plane.shape[:-1], 1))], axis=-1) @ ROTATION
    pixels = rays @ CAMERA.matrix.T
    return np.asarray(pixels[..., :2] / pixels[..., 2:])


QUADS = seen(CORNERS)
OUTLINES = [Outline.quad(quad, text=str(k)) for k, quad in enumerate(QUADS)]


def photo() -> np.ndarray:
    image = np.full((480, 640, 3), 90, np.uint8)
    for quad in QUADS:
        cv2.fillPoly(image, [np.rint(quad).astype(np.int32)], (220, 60, 20))
    return image


def test_rectified_buttons_are_rectangles_of_one_size() -> None:
    panel = fronto.rectify_outlines(photo(), OUTLINES, CAMERA, image_name="hall.jpg")
    assert (panel.status, panel.reasons, panel.image) == ("ok", (), "hall.jpg")
    assert (panel.width_px, panel.height_px) == (640, 480)
    assert panel.view is not None
    assert np.allclose(panel.pose.rotation, ROTATION, atol=1e-3)
    quads = np.array([button.rectified_corners_px for button in panel.buttons])
    scale = (quads[0, 1, 0] - quads[0, 0, 0]) / 0.16
    shift = quads[0, 0] - scale * CORNERS[0, 0]
    assert np.allclose(quads, scale * CORNERS + shift, atol=0.05)
    centers = np.array([button.rectified_center_px for button in panel.buttons])
    assert np.allclose(centers, scale * CENTERS + shift, atol=0.05)
    assert [button.id for button in panel.buttons] == list(range(6))
    assert [button.label for button in panel.buttons] == list("012345")
    assert max(button.residual_px for button in panel.buttons) < 0.05
    # The picture shows them there.
    for center in centers:
        x, y = np.rint(center).astype(int)
        assert panel.view.image[y, x].tolist() == [220, 60, 20, 255]


def test_the_homography_maps_photo_to_rectified_pixels() -> None:
    panel = fronto.rectify_outlines(photo(), OUTLINES, CAMERA)
    assert panel.view is not None
    mapped = fronto.map_points(panel.view, QUADS[3])
    assert np.allclose(mapped, panel.buttons[3].rectified_corners_px)
    homogeneous = np.append(QUADS[3, 2], 1.0) @ panel.view.homography.T
    assert np.allclose(homogeneous[:2] / homogeneous[2], mapped[2])


def test_circles_become_circles() -> None:
    from fronto.camera.conic import fit_ellipse

    outlines = []
    angle = np.linspace(0, 2 * np.pi, 40, endpoint=False)
    for center in CENTERS:
        rim = center + 0.05 * np.stack([np.cos(angle), np.sin(angle)], axis=1)
        ellipse = fit_ellipse(seen(rim))
        outlines.append(Outline.ellipse(*dataclasses.astuple(ellipse)))
    panel = fronto.rectify_outlines(photo(), outlines, CAMERA)
    assert panel.view is not None
    found = [button.rectified_ellipse_px for button in panel.buttons]
    assert [button.rectified_corners_px for button in panel.buttons] == [None] * 6
    axes = np.array([(e.a, e.b) for e in found if e is not None])
    assert len(axes) == 6
    assert np.allclose(axes, axes[0, 0], rtol=1e-3)
    centers = np.array([button.rectified_center_px for button in panel.buttons])
    step = (centers[1, 0] - centers[0, 0]) / 0.25
    assert np.allclose(centers - centers[0], step * (CENTERS - CENTERS[0]), atol=0.05)


def test_lens_distortion_is_taken_out() -> None:
    coefficients = [-0.25, 0.05, 0.001, -0.001]
    bent = Camera.from_matrix(CAMERA.matrix, 640, 480, coefficients)
    outlines = [Outline.quad(bent.distort_points(quad)) for quad in QUADS]
    panel = fronto.rectify_outlines(photo(), outlines, bent)
    assert panel.status == "ok"
    assert panel.view is not None
    assert panel.view.homography_domain == "undistorted"
    centers = np.array([button.rectified_center_px for button in panel.buttons])
    step = (centers[1, 0] - centers[0, 0]) / 0.25
    assert np.allclose(centers - centers[0], step * (CENTERS - CENTERS[0]), atol=0.05)


def test_unknown_camera_is_guessed_and_the_guess_refined() -> None:
    panel = fronto.rectify_outlines(photo(), OUTLINES)
    assert panel.pose.camera.focal_px == pytest.approx(500, rel=0.05)  # 1.1 x 640 at first
    assert panel.view is not None
    assert panel.view.camera is panel.pose.camera


def test_timing_covers_the_stages() -> None:
    timing = fronto.rectify_outlines(photo(), OUTLINES, CAMERA).timing_ms
    assert set(timing) == {"pose", "warp", "total"}
    assert all(value >= 0 for value in timing.values())
    assert timing["pose"] + timing["warp"] <= timing["total"]


def test_a_picture_that_had_to_be_smaller_says_so() -> None:
    free = fronto.rectify_outlines(photo(), OUTLINES, CAMERA, scale=2.0)
    assert free.view is not None
    assert free.notes == ()
    area = free.view.width_px * free.view.height_px
    same = fronto.rectify_outlines(photo(), OUTLINES, CAMERA, scale=2.0, max_pixels=area)
    assert same.notes == ()
    small = fronto.rectify_outlines(photo(), OUTLINES, CAMERA, scale=2.0, max_pixels=area // 4)
    assert small.view is not None
    (note,) = small.notes
    assert f"{small.view.width_px}x{small.view.height_px}" in note
    assert "scaled down" in note
    assert (small.status, small.reasons) == (free.status, free.reasons)
    assert note in small.to_dict()["notes"]


def test_without_buttons_there_is_no_picture() -> None:
    panel = fronto.rectify_outlines(photo(), [], CAMERA)
    assert (panel.status, panel.view, panel.buttons) == ("no_buttons", None, ())
    assert panel.reasons


def test_one_button_is_never_ok() -> None:
    quad = fronto.rectify_outlines(photo(), OUTLINES[:1], CAMERA)
    assert quad.status in ("uncertain", "degenerate")
    circle = fronto.rectify_outlines(photo(), [Outline.ellipse(300, 200, 30, 28)], CAMERA)
    assert circle.status == "degenerate"
    assert circle.view is None
    (button,) = circle.buttons
    assert button.rectified_center_px is None
    assert button.rectified_ellipse_px is None
    assert button.outline.center_px.tolist() == [300, 200]


def test_grid_solver_and_its_options() -> None:
    panel = fronto.rectify_outlines(
        photo(), OUTLINES, CAMERA, solver="grid", range_deg=(-30, 30), step_deg=2.5
    )
    assert panel.pose.solver == "grid"
    assert panel.status == "uncertain"
    assert panel.pose.final_cr is not None
    # The truth, 25, -20 and 4 degrees, lies 1 degree from the nearest node.
    assert np.allclose(panel.pose.angles_deg, [25, -20, 4], atol=2.6)
    assert panel.view is not None


def test_grid_solver_beside_round_buttons() -> None:
    outlines = [OUTLINES[0], Outline.ellipse(500, 60, 20, 18), *OUTLINES[3:]]
    panel = fronto.rectify_outlines(photo(), outlines, CAMERA, solver="grid", step_deg=5.0)
    round_one = panel.buttons[1]
    assert round_one.rectified_corners_px is None
    assert round_one.weight == 0
    assert panel.view is not None
    expected = fronto.map_points(panel.view, QUADS[3])
    assert np.allclose(panel.buttons[2].rectified_corners_px, expected)


def test_a_pose_that_allows_no_picture_is_not_ok(monkeypatch: pytest.MonkeyPatch) -> None:
    honest = fronto.estimate_pose(OUTLINES, CAMERA)

    def edge_on(*_: Any, **__: Any) -> PanelPose:
        behind = np.array(honest.plane_corners)
        behind[0] = 100 * -honest.rotation[:2, 2]
        return dataclasses.replace(honest, plane_corners=behind)

    monkeypatch.setattr(fronto.pipeline, "estimate_pose", edge_on)
    panel = fronto.rectify_outlines(photo(), OUTLINES, CAMERA)
    assert (panel.status, panel.pose.status, panel.view) == ("uncertain", "uncertain", None)
    assert any("behind the camera" in reason for reason in panel.reasons)


@pytest.mark.parametrize(
    ("change", "thing"),
    [
        ({"camera": CAMERA.scaled_to(1280, 960)}, "camera"),
        ({"image": np.zeros(5)}, "image"),
        ({"image": [[1]]}, "image"),
        ({"image": np.zeros((480, 640, 3))}, "image"),
        ({"crop": "all"}, "crop"),
        ({"scale": -1.0}, "scale"),
        ({"solver": "magic"}, "solver"),
        ({"step_deg": 2.0}, "step_deg"),
        ({"outlines": [OUTLINES[0], OUTLINES[0]]}, "outlines 0 and 1"),
    ],
)
def test_wrong_arguments_are_refused(change: dict[str, Any], thing: str) -> None:
    arguments: dict[str, Any] = {"image": photo(), "outlines": OUTLINES, "camera": CAMERA, **change}
    with pytest.raises(InputError, match=thing):
        fronto.rectify_outlines(**arguments)


def test_arrays_of_the_result_are_read_only() -> None:
    panel = fronto.rectify_outlines(photo(), OUTLINES, CAMERA)
    assert panel.view is not None
    button = panel.buttons[0]
    for array in (
        panel.view.image,
        panel.view.homography,
        button.rectified_corners_px,
        button.rectified_center_px,
    ):
        assert array is not None
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
