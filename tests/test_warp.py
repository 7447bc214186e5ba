from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from fronto.camera import Camera
from fronto.errors import InputError
from fronto.pose.rotation import rotation_from_angles
from fronto.results import PanelPose
from fronto.warp import map_points, warp_panel

PAPER_K = [[320.0, 0.0, 320.0], [0.0, 320.0, 240.0], [0.0, 0.0, 1.0]]
PAPER_CAMERA = Camera.from_matrix(PAPER_K, 640, 480)
BARREL = Camera.from_matrix(PAPER_K, 640, 480, distortion=(-0.2, 0.05, 0.001, -0.001))
SQUARE = np.array([[-0.05, -0.05], [0.05, -0.05], [0.05, 0.05], [-0.05, 0.05]])
CHECK = 0.1  # side of the texture's squares on the plane z = 1


def make_pose(
    camera: Camera,
    angles_deg: tuple[float, float, float],
    ray: tuple[float, float] = (0.0, 0.0),
    buttons: int = 3,
    **changes: Any,
) -> PanelPose:
    """A column of square buttons whose middle lies on the ray (x, y, 1)."""
    rotation = rotation_from_angles(*np.radians(angles_deg))
    x, y, w = rotation @ [*ray, 1.0]
    offsets = 0.15 * (np.arange(buttons) - (buttons - 1) / 2)
    corners = np.array([SQUARE + np.array([x / w, y / w + offset]) for offset in offsets])
    values: dict[str, Any] = {
        "status": "ok",
        "reasons": (),
        "solver": "refine",
        "rotation": rotation,
        "covariance": 1e-4 * np.eye(3),
        "camera": camera,
        "plane_corners": corners.reshape(-1, 4, 2),
        "residual_px": np.zeros(buttons),
        "weight": np.ones(buttons),
    }
    return PanelPose(**(values | changes))


def noise(height: int, width: int, channels: int = 3, dtype: str = "uint8") -> np.ndarray:
    rng = np.random.default_rng(7)
    values = rng.random((height, width, channels))
    top = {"uint8": 255, "uint16": 65535, "float32": 1}[dtype]
    return (values * top).astype(dtype)


def plane_of(camera: Camera, rotation: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    """Points of the plane z = 1 seen at photo pixels (n, 2), straight from the definition."""
    straight = camera.undistort_points(pixels)
    rays = np.column_stack([straight, np.ones(len(straight))]) @ np.linalg.inv(camera.matrix).T
    x, y, w = (rays @ rotation.T).T
    return np.stack([x, y], axis=1) / np.where(w > 0.05, w, np.nan)[:, None]


def texture(plane: np.ndarray) -> np.ndarray:
    """A checkerboard of 40 and 200 on the plane; 0 where there is none."""
    cells = np.floor(np.nan_to_num(plane, nan=1e6) / CHECK).astype(int).sum(axis=1)
    return np.where(np.isnan(plane).any(axis=1), 0.0, np.where(cells % 2 == 0, 40.0, 200.0))


def photograph(camera: Camera, rotation: np.ndarray, samples: int = 3) -> np.ndarray:
    """The photo of the checkerboard, averaged over each pixel."""
    total = np.zeros(camera.height_px * camera.width_px)
    x, y = np.meshgrid(np.arange(camera.width_px), np.arange(camera.height_px))
    pixels = np.column_stack([x.ravel(), y.ravel()]).astype(float)
    steps = (np.arange(samples) + 0.5) / samples - 0.5
    for dy in steps:
        for dx in steps:
            total += texture(plane_of(camera, rotation, pixels + np.array([dx, dy])))
    picture = total / samples**2
    return picture.round().astype(np.uint8).reshape(camera.height_px, camera.width_px)


@pytest.mark.parametrize("crop", ["input", "full"])
@pytest.mark.parametrize("resampling", ["auto", "area", "lanczos", "linear", "nearest"])
def test_head_on_photo_comes_back_unchanged(crop: Any, resampling: Any) -> None:
    image = noise(480, 640)
    pose = make_pose(PAPER_CAMERA, (0, 0, 0), (0.2, -0.1))
    view = warp_panel(image, PAPER_CAMERA, pose, crop=crop, resampling=resampling)
    np.testing.assert_array_equal(view.image[..., :3], image)
    assert (view.image[..., 3] == 255).all()
    np.testing.assert_allclose(view.homography, np.eye(3), atol=1e-9)
    assert view.scale == pytest.approx(1.0)


@pytest.mark.parametrize("camera", [PAPER_CAMERA, BARREL], ids=["pinhole", "barrel"])
@pytest.mark.parametrize("angles", [(20, -30, 8), (-35, 10, -20)])
def test_checkerboard_comes_out_square_where_it_should(camera: Camera, angles: Any) -> None:
    pose = make_pose(camera, angles, (0.15, 0.1))
    photo = photograph(camera, pose.rotation)
    view = warp_panel(photo, camera, pose, margin=2.0, scale=2.0)
    # The canvas is axis-parallel to the plane: two corners fix the whole map.
    corners = pose.plane_corners.reshape(-1, 2)
    low, high = corners.min(axis=0) - 0.2, corners.max(axis=0) + 0.2
    pixels_per_unit = (view.width_px - 1) / (high[0] - low[0])
    x, y = np.meshgrid(np.arange(view.width_px), np.arange(view.height_px))
    pixels = np.column_stack([x.ravel(), y.ravel()])
    photo_points = map_points(view, pixels, inverse=True)
    plane = plane_of(camera, pose.rotation, photo_points)
    fit_x = np.polyfit(pixels[:, 0], plane[:, 0], 1)
    fit_y = np.polyfit(pixels[:, 1], plane[:, 1], 1)
    np.testing.assert_allclose(np.polyval(fit_x, pixels[:, 0]), plane[:, 0], atol=1e-6)
    np.testing.assert_allclose(np.polyval(fit_y, pixels[:, 1]), plane[:, 1], atol=1e-6)
    assert fit_x[0] == pytest.approx(fit_y[0], rel=1e-6)  # square pixels
    assert 1 / fit_x[0] == pytest.approx(pixels_per_unit, rel=0.02)
    ideal = texture(plane)
    cell = np.abs(plane / CHECK - np.round(plane / CHECK)).min(axis=1) / (fit_x[0] / CHECK)
    shown = (view.image[..., 3] > 0).ravel()
    assert shown.mean() > 0.9
    inner = shown & (cell > 6.0)  # canvas pixels from the nearest edge; 3 in the photo
    assert inner.sum() > 500
    error = np.abs(view.image[..., 0].ravel() - ideal)[inner]
    assert error.mean() < 1.0
    # ... and each straight edge is where it belongs, to within the photo's resolution.
    near = shown & (cell > 2.5)
    assert (np.abs(view.image[..., 0].ravel() - ideal)[near] < 60).all()


@pytest.mark.parametrize("camera", [PAPER_CAMERA, BARREL], ids=["pinhole", "barrel"])
@pytest.mark.parametrize("crop", ["panel", "full", "input"])
@pytest.mark.parametrize("scale", [1.0, 1.7])
def test_area_at_the_centroid_is_preserved(camera: Camera, crop: Any, scale: float) -> None:
    pose = make_pose(camera, (25, -20, 10), (0.3, 0.2))
    view = warp_panel(noise(480, 640), camera, pose, crop=crop, scale=scale)
    x, y, z = pose.rotation.T @ [*pose.plane_corners.mean(axis=(0, 1)), 1.0]
    center = camera.project(np.array([[x, y, z]]))
    here, right, below = map_points(view, center + np.array([[0, 0], [1e-3, 0], [0, 1e-3]]))
    area = np.linalg.det(np.array([right - here, below - here])) / 1e-6
    assert area == pytest.approx(scale**2, rel=1e-3)
    assert view.scale == pytest.approx(scale, rel=1e-6)
    if crop == "input":
        np.testing.assert_allclose(here, center[0], atol=1e-6)
        assert view.image.shape == (480, 640, 4)


def test_panel_crop_is_the_buttons_and_the_margin() -> None:
    # Head-on, f = 320: buttons of 32 px, 48 px apart, so 32 x 128 px and 16 px around.
    pose = make_pose(PAPER_CAMERA, (0, 0, 0))
    view = warp_panel(noise(480, 640), PAPER_CAMERA, pose, margin=0.5)
    assert view.image.shape == (160, 64, 4)
    # Top-left button corner: photo (304, 176), 16 px into a canvas that begins at -0.5.
    np.testing.assert_allclose(map_points(view, [[304.0, 176.0]]), [[15.5, 15.5]], atol=1e-9)
    bare = warp_panel(noise(480, 640), PAPER_CAMERA, pose, margin=0.0, scale=2.0)
    assert bare.image.shape == (256, 64, 4)


def test_pixels_are_square_for_a_camera_whose_pixels_are_not() -> None:
    camera = Camera.from_matrix([[400, 0, 320], [0, 100, 240], [0, 0, 1]], 640, 480)
    pose = make_pose(camera, (0, 0, 0), buttons=1)
    view = warp_panel(noise(480, 640), camera, pose, margin=0.0)
    assert view.image.shape == (20, 20, 4)  # 0.1 x sqrt(400 x 100); 40 x 10 in the photo


def test_without_buttons_the_whole_photo_is_shown() -> None:
    pose = make_pose(PAPER_CAMERA, (0, 0, 0), buttons=0)
    view = warp_panel(noise(480, 640), PAPER_CAMERA, pose)
    assert (view.crop, view.image.shape) == ("full", (480, 640, 4))


def test_presupposed_corners_are_met() -> None:
    pose = make_pose(PAPER_CAMERA, (15, 20, 0), (0.1, 0.1))
    low = pose.plane_corners.min(axis=(0, 1))
    standard = (pose.plane_corners - low) * 700 + [50, 30]
    view = warp_panel(noise(480, 640), PAPER_CAMERA, pose, standard_corners=standard)
    flat = pose.plane_corners.reshape(-1, 2)
    space = np.column_stack([flat, np.ones(len(flat))]) @ pose.rotation  # Rᵀ (x, y, 1)
    mapped = map_points(view, PAPER_CAMERA.project(space))
    np.testing.assert_allclose(mapped, standard.reshape(-1, 2), atol=1e-6)
    # 35 px margin to the right and below, the standard's own 50 and 30 px before.
    assert (view.width_px, view.height_px) == (50 + 70 + 36, 30 + 280 + 36)
    with pytest.raises(InputError, match="standard_corners"):
        warp_panel(noise(480, 640), PAPER_CAMERA, pose, standard_corners=standard[:1])


@pytest.mark.parametrize("crop", ["panel", "full", "input"])
@pytest.mark.parametrize("max_pixels", [1, 999, 20_000])
def test_large_canvas_is_scaled_down_as_a_whole(crop: Any, max_pixels: int) -> None:
    pose = make_pose(PAPER_CAMERA, (10, 20, 5))
    free = warp_panel(noise(480, 640), PAPER_CAMERA, pose, crop=crop, scale=3.0)
    capped = warp_panel(
        noise(480, 640), PAPER_CAMERA, pose, crop=crop, scale=3.0, max_pixels=max_pixels
    )
    assert 1 <= capped.width_px * capped.height_px <= max_pixels
    factor = capped.scale / free.scale
    assert factor < 1
    # The far corner of the picture is still its far corner.
    end = np.array([[free.width_px - 0.5, free.height_px - 0.5]])
    seen = map_points(capped, map_points(free, end, inverse=True))
    np.testing.assert_allclose(seen + 0.5, factor * (end + 0.5), atol=1e-6)
    # Both canvases are rounded up to whole pixels.
    assert (seen + 0.5 < [[capped.width_px + 1, capped.height_px + 1]]).all()


def test_no_side_exceeds_what_opencv_addresses() -> None:
    pose = make_pose(PAPER_CAMERA, (0, 0, 0), buttons=1)
    corners = pose.plane_corners * [100.0, 0.01]
    pose = make_pose(PAPER_CAMERA, (0, 0, 0), buttons=1, plane_corners=corners)
    view = warp_panel(noise(480, 640), PAPER_CAMERA, pose, scale=100.0, margin=0.0)
    assert view.image.shape[:2] == (2, 16_384)


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32"])
@pytest.mark.parametrize("channels", [0, 1, 3, 4])
@pytest.mark.parametrize("camera", [PAPER_CAMERA, BARREL], ids=["pinhole", "barrel"])
def test_every_pixel_type_and_channel_count(camera: Camera, dtype: str, channels: int) -> None:
    top = {"uint8": 255, "uint16": 65535, "float32": 1}[dtype]
    image = np.full((480, 640, max(channels, 1)), top // 2 if top > 1 else 0.5, dtype)
    if channels == 4:
        image[..., 3] = top // 3 if top > 1 else 0.25
    pose = make_pose(camera, (10, 30, 0), (0.8, 0.5))
    before = image.copy()
    view = warp_panel(image[..., 0] if channels == 0 else image, camera, pose, margin=3.0)
    np.testing.assert_array_equal(image, before)
    assert view.image.dtype == np.dtype(dtype)
    assert view.image.shape[2] == 4
    alpha = view.image[..., 3]
    outside = alpha == 0
    assert 0 < outside.mean() < 1  # the margin reaches beyond the photo's border
    assert (view.image[outside] == 0).all()
    opaque = image[0, 0, 3] if channels == 4 else top
    np.testing.assert_allclose(alpha[~outside], opaque, rtol=1e-5)
    # A flat photo stays flat right up to its border: nothing rings there.
    np.testing.assert_allclose(view.image[~outside][:, :3], image[0, 0, 0], rtol=1e-5)


def test_channel_order_is_kept() -> None:
    image = np.zeros((480, 640, 3), np.uint8)
    image[:] = [10, 20, 30]
    view = warp_panel(image, PAPER_CAMERA, make_pose(PAPER_CAMERA, (10, 10, 0)))
    assert view.image[5, 5].tolist() == [10, 20, 30, 255]


@pytest.mark.parametrize("camera", [PAPER_CAMERA, BARREL], ids=["pinhole", "barrel"])
def test_alpha_is_where_the_photo_shows_something(camera: Camera) -> None:
    pose = make_pose(camera, (20, 25, 10))
    view = warp_panel(noise(480, 640), camera, pose, crop="full", scale=0.5)
    x, y = np.meshgrid(np.arange(view.width_px), np.arange(view.height_px))
    found = map_points(view, np.column_stack([x.ravel(), y.ravel()]), inverse=True)
    with np.errstate(invalid="ignore"):
        within = ((found >= -0.5) & (found <= [639.5, 479.5])).all(axis=1)
    rays = camera.rays(np.where(within[:, None], found, 0.0))
    within &= rays @ pose.rotation[2] >= 0.2
    smallest_w = (
        1 / (pose.plane_corners.reshape(-1, 2) @ pose.rotation[:2, 2] + pose.rotation[2, 2]).max()
    )
    within &= rays @ pose.rotation[2] >= 0.5 * smallest_w
    different = within != (view.image[..., 3] > 0).ravel()
    assert different.mean() < 1e-4  # pixels right on the border at most


@pytest.mark.parametrize("resampling", ["auto", "area"])
@pytest.mark.parametrize("camera", [PAPER_CAMERA, BARREL], ids=["pinhole", "barrel"])
@pytest.mark.parametrize("scale", [0.25, 0.22, 0.05])
def test_minified_checkerboard_does_not_alias(camera: Camera, resampling: Any, scale: Any) -> None:
    y, x = np.mgrid[:480, :640]
    fine = np.where((x + y) % 2 == 0, 0, 255).astype(np.uint8)
    pose = make_pose(camera, (12, -9, 5))
    options: dict[str, Any] = {"crop": "full", "scale": scale}
    view = warp_panel(fine, camera, pose, resampling=resampling, **options)
    grey = view.image[4:-4, 4:-4][view.image[4:-4, 4:-4, 3] > 0][:, 0].astype(float)
    aliased = warp_panel(fine, camera, pose, resampling="nearest", **options).image
    assert np.abs(grey - 127.5).mean() < 10
    assert aliased[aliased[..., 3] > 0][:, 0].std() > 100  # the test would notice


def test_wrong_input_is_named() -> None:
    pose = make_pose(PAPER_CAMERA, (0, 0, 0))
    image = noise(480, 640)
    with pytest.raises(InputError, match=r"640x480.*480x640.*scaled_to"):
        warp_panel(noise(640, 480), PAPER_CAMERA, pose)
    for bad in (image.astype(np.float64), noise(480, 640, 2), image[None], "photo"):
        with pytest.raises(InputError, match="image"):
            warp_panel(bad, PAPER_CAMERA, pose)  # type: ignore[arg-type]
    for name, value in (
        ("crop", "all"),
        ("resampling", "cubic"),
        ("margin", -1.0),
        ("margin", np.nan),
        ("scale", 0.0),
        ("scale", np.inf),
        ("max_pixels", 0),
    ):
        with pytest.raises(InputError, match=name):
            warp_panel(image, PAPER_CAMERA, pose, **{name: value})  # type: ignore[arg-type]


def test_pose_that_cannot_be_used_is_named_with_its_reasons() -> None:
    image = noise(480, 640)
    for changes in (
        {"rotation": np.full((3, 3), np.nan)},
        {"plane_corners": np.full((3, 4, 2), np.nan)},
        {"rotation": np.diag([1.0, -1.0, -1.0])},  # the panel behind the camera
    ):
        bad = make_pose(
            PAPER_CAMERA, (0, 0, 0), status="uncertain", reasons=("one line only",), **changes
        )
        with pytest.raises(InputError, match=r"uncertain.*one line only") as refused:
            warp_panel(image, PAPER_CAMERA, bad)
        assert refused.value.thing == "pose"


def test_pose_whose_status_stands_for_no_rotation_is_refused() -> None:
    image = noise(480, 640)
    for status in ("degenerate", "no_buttons"):
        pose = make_pose(PAPER_CAMERA, (10, 0, 0), status=status, reasons=("one line only",))
        with pytest.raises(InputError, match=rf"{status}.*one line only") as refused:
            warp_panel(image, PAPER_CAMERA, pose)
        assert refused.value.thing == "pose"
    uncertain = make_pose(PAPER_CAMERA, (10, 0, 0), status="uncertain")
    assert warp_panel(image, PAPER_CAMERA, uncertain).image.size
    edge_on = make_pose(PAPER_CAMERA, (0, 0, 0), buttons=0, rotation=np.diag([1.0, -1.0, -1.0]))
    with pytest.raises(InputError, match="horizon"):
        warp_panel(image, PAPER_CAMERA, edge_on)
