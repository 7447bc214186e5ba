from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from fronto.draw import draw_before_after, draw_overlay
from fronto.errors import InputError
from fronto.results import PanelPose
from fronto.shapes import Outline
from fronto.warp import warp_panel
from test_warp import PAPER_CAMERA, make_pose, noise

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
    both = draw_before_after(GREY, None, pose, [])
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


@pytest.mark.parametrize("dtype", ["uint8", "uint16", "float32"])
def test_before_and_after_side_by_side(dtype: str) -> None:
    pose = make_pose(PAPER_CAMERA, ANGLES)
    view = warp_panel(noise(480, 640, dtype=dtype), PAPER_CAMERA, pose, crop="full")
    both = draw_before_after(GREY, view, pose, outlines_of(pose))
    factor = min(480 / view.height_px, 640 / view.width_px)
    right = round(factor * view.width_px)
    assert both.shape == (480, 640 + 8 + right, 3)
    np.testing.assert_array_equal(both[:, :640], draw_overlay(GREY, pose, outlines_of(pose)))
    # Transparent parts show the checkered ground, which is grey; the photo's noise is not.
    after = both[:, 648:].astype(int)
    flat = np.ptp(after, axis=2) == 0
    assert 0.05 < flat.mean() < 0.95
    assert set(np.unique(after[flat][:, 0])) >= {150, 190}


def test_before_and_after_without_a_view() -> None:
    pose = make_pose(PAPER_CAMERA, ANGLES, status="degenerate")
    both = draw_before_after(GREY, None, pose, [])
    assert both.shape == (480, 640 + 8 + 640, 3)
