from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fronto.camera import Camera
from fronto.draw import draw_overlay, printable
from fronto.draw_before_after import draw_before_after
from fronto.errors import InputError
from fronto.results import Button, Panel, PanelPose, RectifiedView
from fronto.shapes import Ellipse, FloatArray, Outline
from fronto.warp import map_ellipse, map_points, warp_panel
from test_warp import BARREL, PAPER_CAMERA, make_pose, noise

GREY = np.full((480, 640, 3), 128, np.uint8)
ANGLES = (15.0, -20.0, 5.0)


def outlines_of(pose: PanelPose) -> list[Outline]:
    names = ["up", "number", "Tür"]
    return [
        Outline.quad(
            PAPER_CAMERA.project(np.column_stack([quad, np.ones(4)]) @ pose.rotation),
            category=name,
            text="12",
        )
        for quad, name in zip(pose.plane_corners, names, strict=True)
    ] + [Outline.ellipse(500, 300, 30, 20, 15, category="alarm")]


def panel_of(pose: PanelPose, outlines: list[Outline], view: RectifiedView | None) -> Panel:
    buttons = []
    for k, outline in enumerate(outlines):
        corners: FloatArray | None = None
        ellipse: Ellipse | None = None
        if view is not None and outline.corners_px is not None:
            corners = map_points(view, outline.corners_px)
        elif view is not None:
            ellipse = map_ellipse(view, outline.ellipse_px)  # type: ignore[arg-type]
        buttons.append(Button(k, outline, corners, None, 0.1, 1.0, ellipse, label=outline.text))
    return Panel("", 640, 480, pose.status, pose.reasons, pose, tuple(buttons), view)


def changed(picture: np.ndarray, x: float, y: float, reach: int = 1) -> bool:
    column, row = round(x), round(y)
    part = picture[row - reach : row + reach + 1, column - reach : column + reach + 1]
    return bool((part != 128).any())


def test_overlay_draws_on_the_outlines_and_leaves_the_photo_alone() -> None:
    pose = make_pose(PAPER_CAMERA, ANGLES)
    outlines = outlines_of(pose)
    image = GREY.copy()
    picture = draw_overlay(image, pose, outlines)
    np.testing.assert_array_equal(image, GREY)
    assert (picture.shape, picture.dtype) == ((480, 640, 3), np.dtype(np.uint8))
    for outline in outlines[:3]:
        assert outline.corners_px is not None
        for a, b in zip(outline.corners_px, np.roll(outline.corners_px, -1, axis=0), strict=True):
            assert changed(picture, *((a + b) / 2))
    for point in outlines[3].ellipse_px.points(12):  # type: ignore[union-attr]
        assert changed(picture, *point)
    assert not changed(picture, 40, 440, 20)  # far from everything
    # Categories differ in colour: a saturated pixel on the upper side of each button.
    colors = set()
    for outline in outlines[:3]:
        assert outline.corners_px is not None
        x, y = np.rint(outline.corners_px[:2].mean(axis=0)).astype(int)
        around = picture[y - 2 : y + 3, x - 2 : x + 3].reshape(-1, 3).astype(int)
        colors.add(tuple(around[np.argmax(np.ptp(around, axis=1))] // 32))
    assert len(colors) == 3


def test_axes_point_along_rows_and_columns() -> None:
    pose = make_pose(PAPER_CAMERA, (0, 0, 0))
    picture = draw_overlay(GREY, pose, []).astype(int)
    # Head-on the centroid is at (320, 240) and a button 32 px wide.
    red, green, _ = picture[240, 332]
    assert red > green + 100
    red, green, _ = picture[252, 320]
    assert green > red + 100


def test_first_corner_is_told_from_the_others() -> None:
    pose = make_pose(PAPER_CAMERA, (0, 0, 0), buttons=0)
    square = [[300.0, 300.0], [400.0, 300.0], [400.0, 400.0], [300.0, 400.0]]
    picture = draw_overlay(GREY, pose, [Outline.quad(square)])
    touched = [
        (picture[y - 6 : y + 7, x - 6 : x + 7] != 128).any(axis=2).sum()
        for x, y in ((300, 300), (400, 300), (400, 400), (300, 400))
    ]
    assert touched[0] > max(touched[1:]) + 10


@pytest.mark.parametrize("status", ["uncertain", "degenerate", "no_buttons"])
def test_what_is_not_ok_is_framed(status: Any) -> None:
    good = draw_overlay(GREY, make_pose(PAPER_CAMERA, ANGLES), [])
    pose = make_pose(PAPER_CAMERA, ANGLES, status=status, reasons=("two poses fit",))
    bad = draw_overlay(GREY, pose, [])
    for edge in (bad[-1], bad[:, 0][200:], bad[:, -1]):
        assert (edge == bad[-1, -1]).all()
    red, green, _ = bad[-1, -1].astype(int)
    assert red > green + 50  # a warning's colour
    assert (good[-1] == 128).all()
    assert (good[:, -1] == 128).all()
    both = draw_before_after(GREY, panel_of(pose, [], None))
    assert (both[:, -1] == bad[-1, -1]).all()


def test_banner_grows_with_the_reasons() -> None:
    few = make_pose(PAPER_CAMERA, ANGLES, status="uncertain", reasons=("a",))
    many = make_pose(PAPER_CAMERA, ANGLES, status="uncertain", reasons=("a", "b", "word " * 60))
    rows = [
        (draw_overlay(GREY, pose, [])[:200, 10] != 128).any(axis=1).sum() for pose in (few, many)
    ]
    assert rows[1] > rows[0] + 30


@pytest.mark.parametrize("status", ["degenerate", "no_buttons"])
def test_a_placeholder_rotation_is_not_shown(status: Any) -> None:
    def picture(angles: tuple[float, float, float], **changes: Any) -> np.ndarray:
        pose = make_pose(PAPER_CAMERA, angles, **({"status": status} | changes))
        return draw_overlay(GREY, pose, [])

    unknown = picture((0, 0, 0), rotation=np.full((3, 3), np.nan))
    np.testing.assert_array_equal(picture((0, 0, 0)), unknown)
    np.testing.assert_array_equal(picture(ANGLES), unknown)
    assert (unknown[200:-10, 10:-10] == 128).all()
    uncertain = picture(ANGLES, status="uncertain")
    assert (uncertain[200:-10, 10:-10] != 128).any()


@pytest.mark.parametrize(
    "changes",
    [
        {"rotation": np.full((3, 3), np.nan), "covariance": np.full((3, 3), np.nan)},
        {"covariance": np.full((3, 3), np.nan)},
        {"rotation": np.diag([1.0, -1.0, -1.0])},
    ],
)
def test_poses_without_numbers_are_drawn(changes: dict[str, Any]) -> None:
    pose = make_pose(PAPER_CAMERA, (0, 0, 0), status="uncertain", **changes)
    assert (draw_overlay(GREY, pose, []) != GREY).any()


def test_no_buttons_at_all() -> None:
    pose = make_pose(PAPER_CAMERA, (0, 0, 0), buttons=0, status="no_buttons")
    assert draw_overlay(GREY, pose, []).shape == GREY.shape


@pytest.mark.parametrize("shape", [(480, 640), (480, 640, 1)])
def test_grey_photos_are_drawn_on_in_color(shape: tuple[int, ...]) -> None:
    picture = draw_overlay(np.full(shape, 128, np.uint8), make_pose(PAPER_CAMERA, ANGLES), [])
    np.testing.assert_array_equal(picture, draw_overlay(GREY, make_pose(PAPER_CAMERA, ANGLES), []))


def test_tiny_and_huge_photos() -> None:
    for size in (4, 3000):
        camera = PAPER_CAMERA.scaled_to(4 * size // 3, size)
        pose = make_pose(camera, ANGLES, status="uncertain")
        image = np.full((size, 4 * size // 3, 3), 128, np.uint8)
        picture = draw_overlay(image, pose, [])
        assert picture.shape == image.shape
    # The frame is as thick in proportion: 5 px of 640.
    assert (picture[2000, :25] == picture[2000, 0]).all()


def test_wrong_photos_are_named() -> None:
    pose = make_pose(PAPER_CAMERA, ANGLES)
    for bad in (GREY.astype(float), GREY[..., :2], np.zeros((0, 4, 3), np.uint8), "photo"):
        with pytest.raises(InputError, match="image"):
            draw_overlay(bad, pose, [])  # type: ignore[arg-type]


def far_points(camera: Camera, pose: PanelPose) -> FloatArray:
    """Where the photo shows points of the panel's plane that are infinitely far away."""
    turn = np.radians(np.arange(0, 360, 0.02))
    directions = np.stack([np.cos(turn), np.sin(turn), np.zeros_like(turn)], axis=1)
    pixels = camera.project(directions @ pose.rotation)
    with np.errstate(invalid="ignore"):
        inside = ((pixels > 3) & (pixels < (636, 476))).all(axis=1)
    return pixels[inside]


@pytest.mark.parametrize("camera", [PAPER_CAMERA, BARREL], ids=["pinhole", "barrel"])
@pytest.mark.parametrize("angles", [(0, 65, 10), (-60, 10, 0), (50, 35, -30)])
def test_horizon_is_where_the_plane_ends_and_nowhere_else(camera: Camera, angles: Any) -> None:
    pose = make_pose(camera, angles, buttons=0)
    picture = draw_overlay(GREY, pose, [])
    expected = far_points(camera, pose)
    # Not below the banner, which the same pose without a horizon has too.
    frontal = draw_overlay(GREY, make_pose(camera, (10, 11, 12), buttons=0), [])
    rows, columns = np.nonzero((frontal != 128).any(axis=2))
    expected = expected[(expected[:, 0] > columns.max() + 60) | (expected[:, 1] > rows.max() + 2)]
    assert len(expected) > 50
    x, y = np.rint(expected).astype(int).T
    around = [picture[y + dy, x + dx].min(axis=1) for dx in (-1, 0, 1) for dy in (-1, 0, 1)]
    assert (np.max(around, axis=0) > 180).all()

    touched = (picture != 128).any(axis=2)
    touched[: rows.max() + 2, : columns.max() + 60] = False
    near = np.zeros_like(touched)
    for dx in range(-3, 4):
        for dy in range(-3, 4):
            near[y + dy, x + dx] = True
    elsewhere = np.argwhere(touched & ~near)
    elsewhere = elsewhere[((elsewhere > 4) & (elsewhere < (475, 635))).all(axis=1)]
    if len(elsewhere):  # its name, in one place
        assert (np.ptp(elsewhere, axis=0) < (25, 70)).all()


def test_horizons_that_nobody_sees_are_not_drawn() -> None:
    frontal = make_pose(PAPER_CAMERA, (10, 11, 12), buttons=0)
    assert (draw_overlay(GREY, frontal, [])[80:] == 128).all()
    tilted: dict[str, Any] = {"buttons": 0, "status": "degenerate"}
    picture = draw_overlay(GREY, make_pose(PAPER_CAMERA, (0, 65, 10), **tilted), [])
    assert (picture[80:-10, 10:-10] == 128).all()
    # In a corner, where the banner covers it, neither it nor its name is half seen.
    corner = make_pose(PAPER_CAMERA, (-35, 27, 0), buttons=0)
    hidden = draw_overlay(GREY, corner, [])
    assert len(far_points(PAPER_CAMERA, corner)) > 0
    np.testing.assert_array_equal(hidden[:, 400:], GREY[:, 400:])
    np.testing.assert_array_equal(hidden[70:], GREY[70:])
    assert (hidden[:60, :6] == hidden[0, 0]).all()


def test_deviations_are_in_the_banner() -> None:
    pictures = [
        draw_overlay(GREY, make_pose(PAPER_CAMERA, ANGLES, buttons=0, **changes), [])
        for changes in (
            {"sigma_px": None},
            {"sigma_px": 0.25},
            {"sigma_px": 0.75},
            {"sigma_px": 0.25, "covariance": 4e-4 * np.eye(3)},
        )
    ]
    for k, one in enumerate(pictures):
        for other in pictures[:k]:
            rows = np.flatnonzero((one != other).any(axis=(1, 2)))
            assert len(rows)
            assert rows.max() < 80


def test_signs_of_reasons_are_spelt_out() -> None:
    assert printable("rotation known to ±3.0° only, σ").isascii()


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32"])
def test_before_and_after_side_by_side(dtype: str) -> None:
    pose = make_pose(PAPER_CAMERA, ANGLES)
    view = warp_panel(noise(480, 640, dtype=dtype), PAPER_CAMERA, pose, crop="full")
    photo = GREY.copy()
    both = draw_before_after(photo, panel_of(pose, outlines_of(pose), view))
    np.testing.assert_array_equal(photo, GREY)
    factor = min(480 / view.height_px, 640 / view.width_px)
    right = round(factor * view.width_px)
    assert both.shape == (480, 640 + 8 + right, 3)
    np.testing.assert_array_equal(both[:, :640], draw_overlay(GREY, pose, outlines_of(pose)))
    # Transparent parts show the checkered ground, which is grey; the photo's noise is not.
    after = both[:, 648:].astype(int)
    flat = np.ptp(after, axis=2) == 0
    assert 0.05 < flat.mean() < 0.95
    assert set(np.unique(after[flat][:, 0])) >= {150, 190}


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32"])
def test_the_view_keeps_its_colors_and_blends_with_the_ground(dtype: str) -> None:
    pose = make_pose(PAPER_CAMERA, (0, 0, 0), buttons=0)
    top = {"uint8": 255, "uint16": 65535, "float32": 1.0}[dtype]
    image = np.zeros((240, 320, 4), dtype)
    image[...] = np.array([0.8, 0.4, 0.2, 1.0]) * top
    image[:, 160:, 3] = 0.5 * top
    image[120:, :, 3] = 0
    view = RectifiedView(image, np.eye(3), PAPER_CAMERA, "full", 1.0)
    after = draw_before_after(GREY, panel_of(pose, [], view))[:, 648:].astype(int)
    assert after.shape == (480, 640, 3)
    assert (np.abs(after[5:230, 5:310] - (204, 102, 51)) <= 1).all()
    ground = after[250:470, 10:300]
    assert set(np.unique(ground)) == {150, 190}
    half = 0.5 * np.array([204, 102, 51])
    light = np.abs(after[5:230, 330:630] - half - 75) <= 1.5
    dark = np.abs(after[5:230, 330:630] - half - 95) <= 1.5
    assert (light.all(axis=2) | dark.all(axis=2)).all()


def test_buttons_of_the_view_are_outlined_and_named() -> None:
    pose = make_pose(PAPER_CAMERA, ANGLES)
    outlines = outlines_of(pose)
    photo = np.full((480, 640, 3), 128, np.uint8)
    view = warp_panel(photo, PAPER_CAMERA, pose, crop="full")
    panel = panel_of(pose, outlines, view)
    bare = draw_before_after(GREY, replace(panel, buttons=()))[:, 648:]
    drawn = draw_before_after(GREY, panel)[:, 648:]
    scale = bare.shape[1] / view.width_px
    top = (480 - round(scale * view.height_px)) // 2
    touched = (drawn != bare).any(axis=2)
    elsewhere = touched.copy()
    for button in panel.buttons:
        if button.rectified_ellipse_px is not None:
            points = button.rectified_ellipse_px.points(40)
        else:
            corners = button.rectified_corners_px
            points = (corners + np.roll(corners, -1, axis=0)) / 2  # type: ignore[operator]
        columns, rows = np.rint(points * scale + (0, top)).astype(int).T
        assert touched[rows, columns].all()
        elsewhere[rows.min() - 9 : rows.max() + 10, columns.min() - 9 : columns.max() + 50] = False
    assert not elsewhere.any()
    renamed = tuple(replace(b, label="B2") for b in panel.buttons)
    assert (draw_before_after(GREY, replace(panel, buttons=renamed))[:, 648:] != drawn).any()
    # What has no place in the view is left out.
    lost = tuple(
        replace(b, rectified_corners_px=np.full((4, 2), np.nan), rectified_ellipse_px=None)
        for b in panel.buttons
    )
    both = draw_before_after(GREY, replace(panel, buttons=lost))
    np.testing.assert_array_equal(both[:, 648:], bare)


def test_before_and_after_without_a_view() -> None:
    pose = make_pose(PAPER_CAMERA, ANGLES, status="degenerate")
    both = draw_before_after(GREY, panel_of(pose, outlines_of(pose), None))
    assert both.shape == (480, 640 + 8 + 640, 3)
