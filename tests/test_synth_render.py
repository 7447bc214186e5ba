"""Rendered edges lie where the scene's truth says, by areas, centroids and edge profiles."""

from __future__ import annotations

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

from fronto.camera import Camera
from fronto.errors import InputError
from fronto.shapes import FloatArray
from fronto.synth import (
    PAPER_CAMERA,
    Layout,
    LayoutButton,
    Scene,
    car_layout,
    circle_layout,
    hall_layout,
    sample_scene,
)
from fronto.synth.look import FLAT, STEEL, Look
from fronto.synth.render import render_panel

FRONTAL = np.eye(3)
ONE = Layout("one", (LayoutButton(0.0, 0.0, 0.1, 0.1, text="7"),))


def render(scene: Scene, look: Look = FLAT, seed: int = 0, **options: Any) -> np.ndarray:
    rng = np.random.default_rng(seed)
    view = (scene.layout, scene.camera, scene.rotation, scene.translation)
    return render_panel(*view, rng=rng, look=look, **options)


def area_and_centroid(polygon: FloatArray) -> tuple[float, FloatArray]:
    x, y = polygon.T
    x2, y2 = np.roll(polygon, -1, axis=0).T
    cross = x * y2 - x2 * y
    area = cross.sum() / 2
    return area, np.array([((x + x2) * cross).sum(), ((y + y2) * cross).sum()]) / (6 * area)


def perimeter(polygon: FloatArray) -> float:
    return float(np.hypot(*(np.roll(polygon, -1, axis=0) - polygon).T).sum())


def measured(image: np.ndarray, polygon: FloatArray) -> tuple[float, FloatArray]:
    """Area and centroid of what is white in a convex polygon with a rim of three pixels."""
    rows, columns = np.indices(image.shape[:2])
    near = np.ones(rows.shape, bool)
    for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        turn = (b[0] - a[0]) * (rows - a[1]) - (b[1] - a[1]) * (columns - a[0])
        near &= turn > -3 * np.hypot(*(b - a))
    white = image[..., 0] / 255.0 * near
    area = white.sum()
    return float(area), np.array([(columns * white).sum(), (rows * white).sum()]) / area


def edge_offsets(image: np.ndarray, points: FloatArray, normals: FloatArray) -> FloatArray:
    """How far outside of each point white ends, by the profile's integral along the normal."""
    reach, step = 3.0, 0.05
    along = np.arange(-reach + step / 2, reach, step)
    at = points[:, None] + along[:, None] * normals[:, None]
    x, y = at[..., 0], at[..., 1]
    i, j = np.floor(y).astype(int), np.floor(x).astype(int)
    v, u = y - i, x - j
    grey = image[..., 0] / 255.0
    upper = (1 - u) * grey[i, j] + u * grey[i, j + 1]
    lower = (1 - u) * grey[i + 1, j] + u * grey[i + 1, j + 1]
    return np.asarray(((1 - v) * upper + v * lower).sum(axis=1) * step - reach)


def sides(corners: FloatArray) -> list[tuple[FloatArray, FloatArray]]:
    """Points in the middle of each side, and its outward normal."""
    result = []
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        points = a + np.linspace(0.25, 0.75, 30)[:, None] * (b - a)
        normal = np.array([b[1] - a[1], a[0] - b[0]]) / np.hypot(*(b - a))
        result.append((points, np.broadcast_to(normal, points.shape)))
    return result


def test_pixel_convention_by_hand() -> None:
    # 0.1 m wide at 1 m with f = 100 px: 10 px around (20, 15), so from 15.0 to 25.0 across.
    # Pixel 15 spans 14.5 to 15.5: half white.
    camera = Camera.from_matrix([[100, 0, 20], [0, 100, 15], [0, 0, 1]], 40, 30)
    rng = np.random.default_rng(0)
    image = render_panel(ONE, camera, FRONTAL, [0, 0, 1], rng=rng, look=FLAT)
    assert image.shape == (30, 40, 3)
    assert image.dtype == np.uint8
    row = image[15, :, 0].astype(int)
    assert (row[:15] == 0).all()
    assert (row[26:] == 0).all()
    assert (row[16:25] == 255).all()
    assert row[15] == pytest.approx(127.5, abs=4)
    assert row[25] == pytest.approx(127.5, abs=4)
    column = image[:, 20, 0].astype(int)
    assert column[10] == pytest.approx(127.5, abs=4)
    assert column[20] == pytest.approx(127.5, abs=4)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("layout", [hall_layout, partial(car_layout, buttons=12)])
def test_quads_lie_where_the_truth_says(layout: Any, seed: int) -> None:
    scene = sample_scene(np.random.default_rng(seed), layout, min_side_px=25)
    image = render(scene)
    for outline in scene.truth:
        assert outline.corners_px is not None
        area, center = area_and_centroid(outline.corners_px)
        seen_area, seen_center = measured(image, outline.corners_px)
        assert abs(seen_area - area) / perimeter(outline.corners_px) < 0.02
        assert seen_center == pytest.approx(center, abs=0.02)
        for points, normals in sides(outline.corners_px):
            assert abs(edge_offsets(image, points, normals).mean()) < 0.05


@pytest.mark.parametrize("seed", range(3))
def test_circles_lie_where_the_truth_says(seed: int) -> None:
    scene = sample_scene(np.random.default_rng(seed), circle_layout, min_side_px=25)
    image = render(scene)
    for outline in scene.truth:
        ellipse = outline.ellipse_px
        assert ellipse is not None
        points = ellipse.points(90)
        seen_area, seen_center = measured(image, points)
        assert abs(seen_area - np.pi * ellipse.a * ellipse.b) / perimeter(points) < 0.02
        assert seen_center == pytest.approx(ellipse.center, abs=0.02)
        tangents = np.roll(points, -1, axis=0) - np.roll(points, 1, axis=0)
        normals = np.column_stack([tangents[:, 1], -tangents[:, 0]])
        normals /= np.hypot(*normals.T)[:, None]
        offsets = edge_offsets(image, points, normals)
        assert abs(offsets.mean()) < 0.05
        assert np.abs(offsets).max() < 0.2


@pytest.mark.parametrize("k1", [-0.25, 0.15])
def test_lens_distortion_bends_the_picture(k1: float) -> None:
    camera = Camera.from_matrix(PAPER_CAMERA.matrix, 640, 480, [k1, 0.02, 0.001, -0.002])
    layout = partial(hall_layout, buttons=3)
    scene = sample_scene(np.random.default_rng(3), layout, camera=camera, min_side_px=40)
    image = render(scene)
    moved = []
    for corners, outline in zip(scene.layout.corners, scene.truth, strict=True):
        share = np.linspace(0, 1, 50, endpoint=False)[:, None]
        pairs = zip(corners, np.roll(corners, -1, axis=0), strict=True)
        bound = np.concatenate([a + share * (b - a) for a, b in pairs])
        points = np.column_stack([bound, np.zeros(len(bound))]) + scene.translation
        bent = camera.project(points @ scene.rotation)
        straight = PAPER_CAMERA.project(points @ scene.rotation)
        area, center = area_and_centroid(bent)
        assert outline.corners_px is not None
        seen_area, seen_center = measured(image, outline.corners_px)
        assert abs(seen_area - area) / perimeter(bent) < 0.02
        assert seen_center == pytest.approx(center, abs=0.02)
        moved.append(np.abs(area_and_centroid(straight)[1] - center).max())
    assert max(moved) > 1.0  # else the test could not tell


def test_steel_buttons_end_at_their_outlines() -> None:
    # Close by: the dark gap is many pixels wide, so half its step marks the edge.
    camera = Camera.from_matrix([[2400, 0, 320], [0, 2400, 240], [0, 0, 1]], 640, 480)
    side = LayoutButton(0.0, 0.0, 0.03, 0.03)
    look = replace(STEEL, gap_m=0.0012, labels=False, pressed=False, rounding_m=0)
    image = render_panel(
        Layout("one", (side,)),
        camera,
        FRONTAL,
        [0, 0, 0.2],
        rng=np.random.default_rng(0),
        look=look,
    )
    grey = image.astype(float).mean(axis=2)
    edges = [320 - 180, 320 + 180, 240 - 180, 240 + 180]  # 0.015 m / 0.2 m * 2400
    lines = [grey[200:280].mean(axis=0)] * 2 + [grey[:, 280:360].mean(axis=1)] * 2
    for edge, line, outward in zip(edges, lines, (-1, 1, -1, 1), strict=True):
        dark, bright = line[edge + 6 * outward], line[edge - 4 * outward]
        assert bright - dark > 60
        profile = (line[edge - 4 : edge + 5] - dark) / (bright - dark)
        inside = profile if outward > 0 else profile[::-1]
        # The face fills 4.5 of the 9 pixels around its edge.
        assert inside.sum() == pytest.approx(4.5, abs=0.25)


def test_same_seed_same_picture() -> None:
    scene = sample_scene(np.random.default_rng(1), hall_layout)
    small = replace(scene, camera=scene.camera.scaled_to(160, 120))
    first = render(small, STEEL, 7, noise_std=2.0)
    assert (first == render(small, STEEL, 7, noise_std=2.0)).all()
    assert (first != render(small, STEEL, 8, noise_std=2.0)).any()


def test_noise_has_the_stated_deviation() -> None:
    scene = sample_scene(np.random.default_rng(1), hall_layout)
    grey = replace(FLAT, wall=(100, 100, 100), plate=(100, 100, 100), button=(100, 100, 100))
    image = render(scene, grey, noise_std=3.0).astype(float)
    assert image.mean() == pytest.approx(100, abs=0.05)
    # Rounding to whole grey levels adds 1/12 to the variance.
    assert image.std() == pytest.approx(np.sqrt(9 + 1 / 12), rel=0.01)


def test_labels_show_on_the_buttons() -> None:
    camera = Camera.from_fov(60, 160, 120)
    with_text, without = (
        render_panel(
            Layout("one", (LayoutButton(0, 0, 0.1, 0.1, category=category, text=text),)),
            camera,
            FRONTAL,
            [0, 0, 0.3],
            rng=np.random.default_rng(0),
            look=replace(FLAT, labels=True),
        )
        for category, text in (("number", "12"), ("other", ""))
    )
    ink = (without.astype(int) - with_text)[..., 0] > 100
    rows, columns = np.nonzero(ink)
    assert 40 < ink.sum() < 800
    # In the middle of the button, which is projected on the picture's middle.
    assert (rows.min() + rows.max()) / 2 == pytest.approx(59.5, abs=1.5)
    assert (columns.min() + columns.max()) / 2 == pytest.approx(79.5, abs=1.5)


@pytest.mark.parametrize(
    "category", ["up", "down", "open", "close", "alarm", "keyhole", "number", "other"]
)
@pytest.mark.parametrize("shape", ["quad", "ellipse"])
def test_every_category_renders(category: str, shape: Any) -> None:
    button = LayoutButton(0, 0, 0.03, 0.03, shape, category=category, text="12")
    image = render_panel(
        Layout("one", (button,)),
        Camera.from_fov(60, 80, 60),
        FRONTAL,
        [0, 0, 0.06],
        rng=np.random.default_rng(0),
    )
    assert image.std() > 20


def test_rays_that_meet_no_wall_are_filled() -> None:
    # Turned by 60 degrees with 45 degrees of half field of view: one side looks past the horizon.
    c, s = np.cos(np.radians(60)), np.sin(np.radians(60))
    turned = np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])
    image = render_panel(
        ONE, PAPER_CAMERA.scaled_to(64, 48), turned, [0, 0, 0.5], rng=np.random.default_rng(0)
    )
    assert image[:, -1].std(axis=0).max() == 0
    assert image[24, 10].tolist() != image[24, -1].tolist()


@pytest.mark.parametrize(
    "change",
    [
        {"rotation": np.diag([1, 1, -1])},
        {"rotation": np.eye(3) * 2},
        {"rotation": np.full((3, 3), np.nan)},
        {"translation": [0, 0, -1]},
        {"translation": [0, 1]},
        {"layout": Layout("none", ())},
        {"supersampling": 0},
        {"supersampling": 17},
        {"noise_std": -1},
        {"noise_std": np.nan},
        {"texture_px_per_mm": 0},
        {"texture_px_per_mm": np.nan},
        {"texture_px_per_mm": 1000},
    ],
)
def test_bad_arguments_are_refused_in_one_line(change: dict[str, Any]) -> None:
    arguments: dict[str, Any] = {
        "layout": ONE,
        "camera": PAPER_CAMERA,
        "rotation": FRONTAL,
        "translation": [0, 0, 1],
        "rng": np.random.default_rng(0),
    }
    with pytest.raises(InputError) as caught:
        render_panel(**(arguments | change))
    assert "\n" not in str(caught.value)
