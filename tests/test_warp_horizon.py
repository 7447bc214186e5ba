from __future__ import annotations

import numpy as np
import pytest

from fronto.camera import Camera
from fronto.pose.rotation import rotation_from_angles
from fronto.warp import map_points, warp_panel
from fronto.warp.polygon import clip_half_plane
from test_warp import PAPER_CAMERA, make_pose, noise


def w_of(rotation: np.ndarray, pixels: np.ndarray) -> np.ndarray:
    rays = np.column_stack([(pixels - [320, 240]) / 320, np.ones(len(pixels))])
    return rays @ rotation[2]


def all_pixels() -> np.ndarray:
    x, y = np.meshgrid(np.arange(640), np.arange(480))
    return np.column_stack([x.ravel(), y.ravel()]).astype(float)


def test_a_photo_corner_lies_behind_the_horizon_at_30_degrees() -> None:
    # R[2] = (cos 30 sin 30, -sin 30, cos² 30) = (0.433, -0.5, 0.75) by hand, and the ray of
    # (0, 479) is (-1, 0.747, 1): w = -0.433 - 0.373 + 0.75.
    pose = make_pose(PAPER_CAMERA, (30, 30, 0))
    corners = np.array([[0.0, 479.0], [639.0, 479.0]])
    np.testing.assert_allclose(w_of(pose.rotation, corners), [-0.056, 0.808], atol=5e-4)
    view = warp_panel(noise(480, 640), PAPER_CAMERA, pose, crop="full")
    mapped = map_points(view, corners)
    assert np.isnan(mapped[0]).all()
    assert np.isfinite(mapped[1]).all()


def test_8_percent_of_the_photo_lie_behind_the_horizon_at_40_degrees() -> None:
    pose = make_pose(PAPER_CAMERA, (40, 40, 0))
    view = warp_panel(noise(480, 640), PAPER_CAMERA, pose, crop="full")
    behind = np.isnan(map_points(view, all_pixels())).any(axis=1)
    np.testing.assert_array_equal(behind, w_of(pose.rotation, all_pixels()) <= 0)
    assert 0.07 < behind.mean() < 0.09


def test_nothing_beyond_the_clip_is_drawn() -> None:
    # Photo pixels beyond the clip are red, all others green: red must not appear.
    pose = make_pose(PAPER_CAMERA, (40, 40, 0))
    w = w_of(pose.rotation, all_pixels()).reshape(480, 640)
    buttons = pose.plane_corners.reshape(-1, 2)
    bound = 0.5 / (np.column_stack([buttons, np.ones(12)]) @ pose.rotation[:, 2]).max()
    assert bound > 0.2
    image = np.where((w >= bound)[..., None], [0, 255, 0], [255, 0, 0]).astype(np.uint8)
    view = warp_panel(image, PAPER_CAMERA, pose, crop="full", resampling="nearest")
    shown = view.image[view.image[..., 3] > 0]
    assert len(shown) > 1e5
    # A pixel on the bound may round to its neighbour beyond.
    assert (shown[:, 0] == 255).mean() < 0.01
    assert view.width_px < 2000
    assert view.height_px < 2000
    x, y = np.nonzero((view.image[..., 0] == 255) & (view.image[..., 3] > 0))[::-1]
    back = map_points(view, np.column_stack([x, y]), inverse=True)
    assert (w_of(pose.rotation, back) > bound - 1e-9).all()


def test_full_crop_touches_the_canvas_on_all_sides() -> None:
    for angles in ((40, 40, 0), (30, -30, 10), (0, 15, 0)):
        pose = make_pose(PAPER_CAMERA, angles)
        view = warp_panel(noise(480, 640), PAPER_CAMERA, pose, crop="full")
        shown = view.image[..., 3] > 0
        # A corner may be so sharp that no pixel's centre lies in its last few.
        for side in (shown[:8], shown[-8:], shown[:, :8], shown[:, -8:]):
            assert side.any()


@pytest.mark.parametrize("tilt", [70, 80, 86])
def test_buttons_are_never_cut_off_however_tilted(tilt: float) -> None:
    pose = make_pose(PAPER_CAMERA, (0, tilt, 0), buttons=1)
    corners = pose.plane_corners.reshape(4, 2)
    middle = corners.mean(axis=0)
    pose = make_pose(
        PAPER_CAMERA,
        (0, tilt, 0),
        plane_corners=((corners - middle) * 0.2 + middle)[None],
    )
    view = warp_panel(noise(480, 640), PAPER_CAMERA, pose, margin=0.0, scale=4.0)
    assert (view.image[..., 3] > 0).all()


def test_homography_is_of_norm_1_where_the_horizon_meets_the_first_pixel() -> None:
    # R[2]·K⁻¹(0, 0, 1) = cos 45 - sin 45 = 0 for a photo that reaches 45 degrees to the left.
    pose = make_pose(PAPER_CAMERA, (0, 45, 0), (0.5, 0.0))
    rotation = rotation_from_angles(0, np.radians(45), 0)
    assert w_of(rotation, np.zeros((1, 2)))[0] == pytest.approx(0, abs=1e-12)
    view = warp_panel(noise(480, 640), PAPER_CAMERA, pose)
    assert np.linalg.norm(view.homography) == pytest.approx(1.0)
    assert (view.homography @ [480, 240, 1])[2] > 0
    other = warp_panel(noise(480, 640), PAPER_CAMERA, make_pose(PAPER_CAMERA, (0, 20, 0)))
    assert other.homography[2, 2] == 1.0


def test_fisheye_whose_photo_shows_more_than_a_half_space() -> None:
    camera = Camera.from_matrix(
        [[160, 0, 320], [0, 160, 240], [0, 0, 1]],
        640,
        480,
        distortion=(0.0, 0.0, 0.0, 0.0),
        distortion_model="equidistant",
    )
    # Along the row the photo reaches 2 rad; a plane shows what lies within 90 degrees.
    pose = make_pose(camera, (0, 0, 0))
    view = warp_panel(noise(480, 640), camera, pose, crop="full", max_pixels=10_000)
    shown = view.image[..., 3] > 0
    # Head-on w = 1 everywhere, nothing is clipped but what the lens cannot undistort.
    assert shown.any()
    middle = map_points(view, [[320.0, 240.0], [640.0, 240.0]])
    assert np.isfinite(middle[0]).all()
    assert np.isnan(middle[1]).all()


def test_fisheye_corners_far_off_axis_do_not_make_the_canvas_large() -> None:
    # The photo's corners lie 799 px = 88 degrees off the axis: tan 88° = 30 focal lengths.
    matrix = [[520, 0, 639.5], [0, 525, 479.5], [0, 0, 1]]
    camera = Camera.from_matrix(matrix, 1280, 960, np.zeros(4), "equidistant")
    photo = np.full((960, 1280), 90, np.uint8)
    view = warp_panel(photo, camera, make_pose(camera, (-16, -15, 31)), crop="full", scale=0.25)
    assert view.scale == pytest.approx(0.25)
    assert (view.image[..., 3] > 0).mean() > 0.3
    # Head-on it is sqrt(520 x 525) tan 70° = 1435.5 px wide to either side. Upwards the photo
    # reaches 480 / 525 = 0.914 rad of the 1.222 rad that are 70°: tan 70° x 0.914 / 1.222 =
    # 2.056 focal lengths or 1074 px, where its border meets that circle.
    head_on = warp_panel(photo, camera, make_pose(camera, (0, 0, 0)), crop="full", scale=0.25)
    assert head_on.width_px == pytest.approx(0.5 * 1435.5, abs=2)
    assert head_on.height_px == pytest.approx(0.5 * 1074, rel=0.1)  # the border is sampled
    middle = map_points(head_on, [[639.5, 479.5]])[0]
    size = np.array([head_on.width_px, head_on.height_px])
    np.testing.assert_allclose(middle + 0.5, size / 2, atol=1.0)
    # Of what lies further off the axis the canvas shows what falls on it.
    y, x = np.nonzero(head_on.image[..., 3])
    rays = camera.rays(map_points(head_on, np.column_stack([x, y]), inverse=True))
    assert np.hypot(rays[:, 0], rays[:, 1]).max() > np.tan(np.radians(70.5))


def test_a_wide_pinhole_is_shown_as_a_whole() -> None:
    # 640 px at f = 80: 76 degrees to either side, with no needles, since the photo is flat.
    camera = Camera.from_matrix([[80, 0, 319.5], [0, 80, 239.5], [0, 0, 1]], 640, 480)
    view = warp_panel(noise(480, 640), camera, make_pose(camera, (0, 0, 0)), crop="full")
    assert view.image.shape == (480, 640, 4)


def test_clip_of_a_square_by_hand() -> None:
    square = [[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]]
    kept = clip_half_plane(square, [1.0, 1.0, -1.0])  # x + y >= 1 cuts the first corner
    assert {tuple(p) for p in kept.tolist()} == {(1, 0), (2, 0), (2, 2), (0, 2), (0, 1)}
    assert clip_half_plane(square, [0.0, 0.0, -1.0]).shape == (0, 2)
    np.testing.assert_array_equal(clip_half_plane(square, [0.0, 0.0, 1.0]), square)
