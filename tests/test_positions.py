"""Positions in the camera frame: from every kind of known length, with deviations that hold."""

from __future__ import annotations

import re
import shutil
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fronto import (
    Camera,
    Outline,
    PanelPose,
    Template,
    TemplateButton,
    estimate_pose,
    order_corners,
)
from fronto.errors import InputError
from fronto.metric import KnownLength, UnfitLength
from fronto.pipeline import rectify_outlines
from fronto.pose.rotation import rotation_from_angles
from fronto.positions import Positions, locate, with_positions
from fronto.synth import (
    PAPER_CAMERA,
    Layout,
    LayoutButton,
    Scene,
    car_layout,
    observe,
    sample_scene,
)

CHI2_95_3 = 7.815


def grid(
    columns: int = 3,
    rows: int = 5,
    pitch: tuple[float, float] = (0.05, 0.042),
    side: float = 0.03,
    shape: str = "quad",
) -> Layout:
    return Layout(
        "grid",
        tuple(
            LayoutButton(
                i * pitch[0] - 0.05, j * pitch[1] - 0.08, side, side, shape, text=f"{j}{i}"
            )
            for j in range(rows)
            for i in range(columns)
        ),
    )


def seen(
    layout: Layout, seed: int = 1, sigma_px: float = 0.0, *, outlier_share: float = 0.0
) -> Scene:
    rng = np.random.default_rng(seed)
    scene = sample_scene(rng, lambda _: layout, distance_m=(0.5, 0.5), spread=0.3, max_angle_deg=30)
    return observe(rng, scene, sigma_px, outlier_share=outlier_share)


def truth(scene: Scene) -> np.ndarray:
    flat = np.concatenate([scene.layout.centers, np.zeros((len(scene.layout.buttons), 1))], axis=1)
    return np.asarray((flat + scene.translation) @ scene.rotation)


def solved(scene: Scene, **more: object) -> PanelPose:
    return estimate_pose(scene.outlines, scene.camera, **more)  # type: ignore[arg-type]


def located(scene: Scene, **known: object) -> Positions:
    return locate(solved(scene), outlines=scene.outlines, **known)


def worst_mm(scene: Scene, found: Positions) -> float:
    centers = np.array([position.center_m for position in found.positions])
    assert [position.button for position in found.positions] == list(range(len(centers)))
    return 1e3 * float(np.linalg.norm(centers - truth(scene), axis=1).max())


def template(layout: Layout, labels: bool = True) -> Template:
    return Template(
        tuple(
            TemplateButton(
                1e3 * b.x + 7, 1e3 * b.y - 3, 1e3 * b.width, 1e3 * b.height, b.text * labels
            )
            for b in layout.buttons
        )
    )


def middle_px(scene: Scene) -> tuple[float, float, np.ndarray]:
    point = scene.translation @ scene.rotation
    x, y = scene.camera.project(point[None])[0]
    return float(x), float(y), point


def depths(scene: Scene, scale: int = 1) -> np.ndarray:
    """A depth image in metres, of the photo's size over `scale`."""
    camera = scene.camera.scaled_to(scene.camera.width_px // scale, scene.camera.height_px // scale)
    x, y = np.meshgrid(np.arange(camera.width_px), np.arange(camera.height_px))
    facing = camera.rays(np.stack([x.ravel(), y.ravel()], axis=1)) @ scene.rotation[2]
    depth = np.where(facing > 0.05, scene.translation[2] / np.maximum(facing, 0.05), np.nan)
    return np.asarray(depth.reshape(x.shape))


def lengths(scene: Scene) -> dict[str, dict[str, object]]:
    x, y, point = middle_px(scene)
    return {
        "pitch": {"pitch_m": (0.05, 0.042)},
        "pitch to the right": {"pitch_m": (0.05, None)},
        "pitch down": {"pitch_m": (None, 0.042)},
        "size": {"button_size_m": 0.03},
        "sizes": {"button_size_m": (0.03, 0.03)},
        "template": {"template": template(scene.layout)},
        "template in order": {"template": template(scene.layout, labels=False)},
        "depth": {"depth": (x, y, point[2])},
        "distance": {"distance_m": float(scene.translation[2])},
        "distance at a pixel": {"distance_m": (x, y, float(np.linalg.norm(point)))},
        "depth image": {"depth": depths(scene)},
    }


@pytest.mark.parametrize("kind", list(lengths(seen(grid()))))
@pytest.mark.parametrize("shape", ["quad", "ellipse"])
def test_every_length_places_buttons_exactly_seen(kind: str, shape: str) -> None:
    scene = seen(grid(shape=shape))
    found = located(scene, **lengths(scene)[kind])
    assert found
    assert worst_mm(scene, found) < 0.1
    assert found.plane_distance_m == pytest.approx(scene.translation[2], rel=1e-4)
    assert found.press_normal == pytest.approx(scene.rotation[2], abs=1e-4)
    assert np.linalg.norm(found.press_normal) == pytest.approx(1)
    assert found.basis


@settings(derandomize=True, deadline=None, max_examples=25)
@given(
    seed=st.integers(0, 10_000),
    columns=st.integers(2, 4),
    rows=st.integers(2, 6),
    right=st.floats(0.036, 0.06),
    down=st.floats(0.036, 0.06),
)
def test_pitches_place_buttons_in_any_view(
    seed: int, columns: int, rows: int, right: float, down: float
) -> None:
    scene = seen(grid(columns, rows, (right, down)), seed)
    found = located(scene, pitch_m=(right, down))
    if not found:  # a pose that is not ok says why
        assert found.reasons
        return
    assert worst_mm(scene, found) < 0.3


def test_deviations_hold() -> None:
    rng = np.random.default_rng(3)
    inside, lateral, error = [], [], []
    for _ in range(60):
        scene = sample_scene(rng, car_layout, distance_m=(0.5, 0.5))
        scene = observe(rng, scene, 0.3, outlier_share=0.0)
        steps = [np.diff(np.unique(v.round(6))).min() for v in scene.layout.centers.T]
        found = located(scene, pitch_m=tuple(steps))
        for position, true in zip(found.positions, truth(scene), strict=bool(found)):
            off = position.center_m - true
            ray = true / np.linalg.norm(true)
            error.append(np.linalg.norm(off))
            lateral.append(np.linalg.norm(off - (off @ ray) * ray))
            inside.append(off @ np.linalg.solve(position.covariance, off) < CHI2_95_3)
    assert len(inside) > 700
    assert 0.90 < np.mean(inside) < 0.995
    assert np.median(error) < 0.003
    assert np.quantile(error, 0.95) < 0.008
    assert np.median(lateral) < 0.0005


def test_deviations_grow_with_noise_and_with_the_lengths_own() -> None:
    calm, rough = (located(seen(grid(), 4, s), pitch_m=(0.05, 0.042)) for s in (0.1, 0.4))
    assert (rough.positions[0].std_m > 2 * calm.positions[0].std_m).all()
    assert rough.plane_distance_std_m > 2 * calm.plane_distance_std_m
    assert (rough.press_normal_std >= calm.press_normal_std).all()
    stated = located(seen(grid(), 4, 0.1), pitch_m=(0.05, 0.042), std_m=0.002)
    assert stated.plane_distance_std_m > 1.5 * calm.plane_distance_std_m
    one = located(seen(grid(pitch=(0.05, 0.05)), 4, 0.1), pitch_m=0.05, std_m=0.001)
    assert one.plane_distance_std_m / one.plane_distance_m == pytest.approx(0.02, rel=0.2)


def test_depth_of_a_button_is_what_is_unsure_not_its_direction() -> None:
    scene = seen(grid(), 4, 0.3)
    for position in located(scene, button_size_m=0.03).positions:
        ray = position.center_m / np.linalg.norm(position.center_m)
        along = float(np.sqrt(ray @ position.covariance @ ray))
        across = np.linalg.svd(np.eye(3) - np.outer(ray, ray))[0][:, :2]
        assert np.sqrt(np.trace(across.T @ position.covariance @ across)) < 0.2 * along


def test_an_outlier_is_told_apart() -> None:
    scene = seen(grid(), 5, 0.3, outlier_share=1.0)
    pose = solved(scene)
    assert scene.outlier is not None
    assert pose.weight[scene.outlier] < 0.5
    found = locate(pose, outlines=scene.outlines, pitch_m=(0.05, 0.042))
    others = [p.std_m.max() for p in found.positions if p.button != scene.outlier]
    wrong = found.of(scene.outlier)
    assert wrong is not None
    assert wrong.std_m.max() > max(others)


def missing(layout: Layout, *gone: int) -> Layout:
    return replace(layout, buttons=tuple(b for k, b in enumerate(layout.buttons) if k not in gone))


@pytest.mark.parametrize(
    "layout",
    [
        missing(grid(), 4, 7, 10),
        replace(
            grid(), buttons=(*grid().buttons, LayoutButton(-0.05, 0.17, 0.03, 0.03),
                             LayoutButton(0.015, 0.17, 0.03, 0.03))
        ),
        # Two columns, staggered by half a pitch.
        Layout("staggered", tuple(
            LayoutButton(0.055 * i, 0.042 * (j + 0.5 * i), 0.03, 0.03)
            for i in range(2) for j in range(6)
        )),
    ],
    ids=["gaps", "other row", "staggered"],
)  # fmt: skip
def test_pitch_is_that_of_most_neighbours(layout: Layout) -> None:
    scene = seen(layout)
    found = located(scene, pitch_m=(None, 0.042))
    assert worst_mm(scene, found) < 0.1


def test_one_pitch_for_two_must_be_told_which() -> None:
    with pytest.raises(UnfitLength, match="pitch_m") as caught:
        located(seen(grid()), pitch_m=0.05)
    assert "None" in str(caught.value)
    scene = seen(grid(pitch=(0.05, 0.05)))
    assert worst_mm(scene, located(scene, pitch_m=0.05)) < 0.1
    column = seen(grid(columns=1))
    pose = estimate_pose(column.outlines, column.camera, square=True)
    assert locate(pose, pitch_m=0.042, allow_uncertain=True)


@pytest.mark.parametrize("wrong", [(0.042, 0.05), (0.05, 0.03)])
def test_pitches_of_another_panel_are_refused(wrong: tuple[float, float]) -> None:
    with pytest.raises(UnfitLength, match="pitch_m"):
        located(seen(grid()), pitch_m=wrong)


def rolled_by(degrees: float) -> Scene:
    """A view so much turned that outlines are ordered as they look upright."""
    turn = np.radians(degrees)
    rotation = np.array(
        [[np.cos(turn), np.sin(turn), 0], [-np.sin(turn), np.cos(turn), 0], [0, 0, 1]]
    ) @ rotation_from_angles(0.2, 0.25, 0.0)
    scene = replace(seen(grid()), rotation=rotation, translation=rotation @ [0.0, 0.0, 0.5])
    outlines = tuple(
        Outline.quad(order_corners(corners), std_px=0.05) for corners in scene.corners_px
    )
    return replace(scene, outlines=outlines)


def test_rolled_photos_need_both_pitches_and_then_may_exchange_them() -> None:
    for degrees, exchanged in ((40, False), (52, True)):
        scene = rolled_by(degrees)
        with pytest.raises(UnfitLength, match="rolled"):
            located(scene, pitch_m=(None, 0.042))
        found = located(scene, pitch_m=(0.05, 0.042))
        assert worst_mm(scene, found) < 0.1
        assert any("exchanged" in note for note in found.notes) == exchanged


def test_pitch_needs_neighbours() -> None:
    places = [(0, 0), (0.11, 0.04), (0.03, 0.1), (-0.08, 0.06), (0.09, 0.13)]
    layout = Layout("scattered", tuple(LayoutButton(x, y, 0.03, 0.03) for x, y in places))
    scene = seen(layout)
    pose = estimate_pose(scene.outlines, scene.camera, aligned=False, square=True)
    with pytest.raises(UnfitLength, match="neighbouring"):
        locate(pose, pitch_m=0.05, allow_uncertain=True)
    # Their size tells as much.
    found = locate(pose, outlines=scene.outlines, button_size_m=0.03, allow_uncertain=True)
    assert worst_mm(scene, found) < 1


def test_size_is_that_of_most_buttons() -> None:
    wide = (LayoutButton(0.0, 0.15, 0.06, 0.03), LayoutButton(0.05, -0.12, 0.02, 0.02))
    scene = seen(replace(grid(), buttons=(*grid().buttons, *wide)))
    assert worst_mm(scene, located(scene, button_size_m=0.03)) < 0.2


def test_size_of_oblong_buttons_takes_two_numbers() -> None:
    layout = Layout("oblong", tuple(replace(b, height=0.02) for b in grid().buttons))
    scene = seen(layout)
    assert worst_mm(scene, located(scene, button_size_m=(0.03, 0.02))) < 0.2
    assert worst_mm(scene, located(scene, button_size_m=(0.02, 0.03))) < 0.2
    for wrong in (0.03, (0.03, 0.015)):
        with pytest.raises(UnfitLength, match="button_size_m"):
            located(scene, button_size_m=wrong)


def test_two_sizes_equally_often_are_refused() -> None:
    scene = seen(Layout("two", tuple(
        LayoutButton(0.06 * i, 0.06 * j, 0.03 + 0.012 * i, 0.03 + 0.012 * i)
        for i in range(2) for j in range(3)
    )))  # fmt: skip
    with pytest.raises(UnfitLength, match="sizes"):
        located(scene, button_size_m=0.03)


def test_template_of_another_panel_is_refused() -> None:
    scene = seen(grid())
    moved = [replace(b, x_mm=b.x_mm + 20 * (k == 7)) for k, b in
             enumerate(template(scene.layout).buttons)]  # fmt: skip
    with pytest.raises(UnfitLength, match="button 7"):
        located(scene, template=Template(tuple(moved)))
    with pytest.raises(UnfitLength, match="template"):
        located(scene, template=template(grid(2, 2), labels=False))


def test_pose_from_a_template_needs_no_length() -> None:
    scene = seen(grid(), 2, 0.2)
    pose = solved(scene, template=template(scene.layout))
    found = locate(pose, outlines=scene.outlines)
    assert found.plane_distance_m == pytest.approx(pose.plane_depth_m)
    assert worst_mm(scene, found) < 3
    again = locate(pose, outlines=scene.outlines, template=template(scene.layout))
    assert again.plane_distance_m == pytest.approx(found.plane_distance_m, rel=1e-3)


def test_depth_images_with_holes_millimetres_and_another_size() -> None:
    scene = seen(grid(), 6)
    rng = np.random.default_rng(1)
    metres = depths(scene) + rng.normal(0, 0.005, depths(scene).shape)
    metres[rng.uniform(size=metres.shape) < 0.5] = np.nan
    assert worst_mm(scene, located(scene, depth=metres)) < 1
    with np.errstate(invalid="ignore"):
        millimetres = np.rint(1e3 * np.nan_to_num(metres)).clip(0, 65535).astype(np.uint16)
    assert worst_mm(scene, located(scene, depth=millimetres)) < 1
    assert worst_mm(scene, located(scene, depth=depths(scene, 2)[..., None])) < 1


def test_depth_images_that_do_not_fit_are_refused() -> None:
    scene = seen(grid(), 6)
    good = depths(scene)
    with pytest.raises(InputError, match="size"):
        located(scene, depth=good[:, :400])
    with pytest.raises(UnfitLength, match="depth"):
        located(scene, depth=np.zeros_like(good))
    rough = good * np.random.default_rng(1).uniform(0.5, 1.5, good.shape)
    with pytest.raises(UnfitLength, match="one plane"):
        located(scene, depth=rough)
    with pytest.raises(InputError, match="uint8"):
        located(scene, depth=np.ones((480, 640), np.uint8))


def test_readings_have_to_be_on_the_panel() -> None:
    scene = seen(grid(), 6)
    with pytest.raises(InputError, match="pixel in the photo"):
        located(scene, depth=(900.0, 10.0, 0.5))
    # The panel's horizon lies in the photo of a wide camera.
    wide = Camera.from_fov(150, 640, 480)
    turn = np.array([[0.5, 0, -np.sqrt(0.75)], [0, 1, 0], [np.sqrt(0.75), 0, 0.5]])
    corners = grid().corners.reshape(-1, 2)
    points = np.column_stack([corners, np.zeros(len(corners))]) + turn @ np.array([0, 0, 0.5])
    quads = wide.project(points @ turn).reshape(-1, 4, 2)
    outlines = [Outline.quad(quad, std_px=0.1) for quad in quads]
    pose = estimate_pose(outlines, wide)
    assert pose.rotation == pytest.approx(turn, abs=0.02)
    with pytest.raises(UnfitLength, match="horizon"):
        locate(pose, outlines=outlines, distance_m=(5.0, 240.0, 0.5), allow_uncertain=True)


@pytest.mark.parametrize(
    "wrong",
    [
        {"pitch_m": 45},
        {"pitch_m": -0.04},
        {"pitch_m": float("nan")},
        {"pitch_m": (None, None)},
        {"pitch_m": (0.04, 0.05, 0.06)},
        {"pitch_m": "wide"},
        {"button_size_m": 0},
        {"button_size_m": (0.03, None)},
        {"depth": (1, 2)},
        {"depth": (1, 2, 0)},
        {"depth": (float("nan"), 2, 1)},
        {"distance_m": float("inf")},
        {"template": "panel.yaml"},
        {"pitch_m": 0.04, "std_m": -1},
        {"pitch_m": 0.04, "button_size_m": 0.03},
        {},
    ],
)
def test_wrong_lengths_are_refused_in_one_line(wrong: dict[str, object]) -> None:
    with pytest.raises(InputError) as caught:
        located(seen(grid()), **wrong)
    assert not isinstance(caught.value, UnfitLength)
    assert "\n" not in str(caught.value)


def test_lengths_of_something_else_are_refused_or_remarked() -> None:
    scene = seen(grid())
    with pytest.raises(UnfitLength, match="known length"):
        located(scene, pitch_m=(0.5, 0.42))
    small = located(scene, pitch_m=(0.02, 0.0168))
    assert small
    assert any("smaller" in note for note in small.notes)
    assert not located(scene, pitch_m=(0.05, 0.042)).notes


def test_poses_that_are_not_ok_have_no_positions() -> None:
    scene = seen(grid(1, 1))
    pose = solved(scene)
    assert pose.status != "ok"
    found = locate(pose, button_size_m=0.03)
    assert not found
    assert found.press_normal is None
    assert found.reasons
    nothing = estimate_pose([], PAPER_CAMERA)
    assert not locate(nothing, button_size_m=0.03, allow_uncertain=True)
    grid_pose = solved(seen(grid(2, 2)), solver="grid", range_deg=(-4, 4), step_deg=2.0)
    unsure = locate(grid_pose, distance_m=0.5, allow_uncertain=True)
    assert unsure
    assert np.isnan(unsure.positions[0].covariance).any()


def test_unknown_focal_length_counts() -> None:
    scene = seen(grid(4, 6), 12, 0.2)
    camera = Camera.default(scene.camera.width_px, scene.camera.height_px)
    pose = estimate_pose(scene.outlines, camera)
    assert pose.status == "ok"
    found = locate(pose, outlines=scene.outlines, pitch_m=(0.05, 0.042), allow_uncertain=True)
    known = located(scene, pitch_m=(0.05, 0.042))
    relative = found.plane_distance_std_m / found.plane_distance_m
    assert relative > 0.9 * pose.focal_std
    assert relative > 3 * known.plane_distance_std_m / known.plane_distance_m
    for position, true in zip(found.positions, truth(scene), strict=True):
        off = position.center_m - true
        assert off @ np.linalg.solve(position.covariance, off) < 16


def test_too_vague_a_distance_is_not_told() -> None:
    scene = seen(grid(), 1, 0.2)
    vague = {"distance_m": 0.5, "std_m": 0.1}
    found = located(scene, **vague)
    assert not found
    assert "20 %" in found.reasons[0]
    assert found.press_normal is not None
    assert locate(solved(scene), allow_uncertain=True, **vague)


def test_lens_distortion() -> None:
    matrix = PAPER_CAMERA.matrix
    camera = Camera.from_matrix(matrix, 640, 480, [-0.12, 0.02, 0.001, -0.001])
    rng = np.random.default_rng(2)
    scene = sample_scene(rng, lambda _: grid(), camera=camera, distance_m=(0.5, 0.5), spread=0.3)
    x, y, point = middle_px(scene)
    for known in ({"pitch_m": (0.05, 0.042)}, {"depth": (x, y, point[2])}):
        assert worst_mm(scene, located(scene, **known)) < 0.3


def test_outlines_of_another_pose_are_refused() -> None:
    scene = seen(grid())
    with pytest.raises(InputError, match="outlines"):
        locate(solved(scene), outlines=scene.outlines[1:], pitch_m=(0.05, 0.042))


def test_one_way_to_state_the_length() -> None:
    scene = seen(grid())
    known = KnownLength(pitch_m=(0.05, 0.042))
    same = locate(solved(scene), known, outlines=scene.outlines)
    assert worst_mm(scene, same) < 0.1
    with pytest.raises(InputError):
        locate(solved(scene), known, pitch_m=0.05)


def test_results_cannot_be_changed() -> None:
    found = located(seen(grid()), pitch_m=(0.05, 0.042))
    for array in (found.press_normal, found.positions[0].center_m, found.positions[0].covariance):
        assert array is not None
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0


def panel_of(scene: Scene):
    photo = np.zeros((480, 640, 3), np.uint8)
    return rectify_outlines(photo, scene.outlines, scene.camera)


def test_panels_are_filled_in() -> None:
    scene = seen(grid(), 3, 0.2)
    panel = with_positions(panel_of(scene), pitch_m=(0.05, 0.042))
    for button, true in zip(panel.buttons, truth(scene), strict=True):
        assert button.position_m is not None
        assert np.linalg.norm(button.position_m - true) < 0.005
        assert (button.position_std_m > 0).all()
        assert button.press_normal == pytest.approx(panel.pose.normal)
    assert any("pitch of 50 mm" in note for note in panel.notes)


def test_panels_without_a_length_have_directions_only() -> None:
    panel = with_positions(panel_of(seen(grid(), 3, 0.2)))
    assert all(button.position_m is None for button in panel.buttons)
    assert all(button.press_normal is not None for button in panel.buttons)
    assert not panel.notes


def test_lengths_that_do_not_apply_are_remarked_in_the_panel() -> None:
    panel = with_positions(panel_of(seen(grid(), 3, 0.2)), pitch_m=0.05)
    assert panel.buttons[0].position_m is None
    assert panel.buttons[0].press_normal is not None
    assert any(note.startswith("no positions") for note in panel.notes)
    unsure = with_positions(panel_of(seen(grid(1, 1))), pitch_m=0.05)
    assert unsure.buttons[0].press_normal is None
    assert any(note.startswith("no positions") for note in unsure.notes)
    with pytest.raises(InputError):
        with_positions(panel_of(seen(grid())), pitch_m=50)


def test_labels_of_buttons_find_their_places_in_the_template() -> None:
    scene = seen(grid(), 3, 0.2)
    panel = panel_of(replace(scene, outlines=tuple(replace(o, text="") for o in scene.outlines)))
    order = np.random.default_rng(1).permutation(len(scene.layout.buttons))
    shuffled = Template(tuple(template(scene.layout).buttons[k] for k in order))
    named = tuple(
        replace(button, label=made.text)
        for button, made in zip(panel.buttons, scene.layout.buttons, strict=True)
    )
    filled = with_positions(replace(panel, buttons=named), template=shuffled)
    for button, true in zip(filled.buttons, truth(scene), strict=True):
        assert np.linalg.norm(button.position_m - true) < 0.005


def test_documented_example(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    root = Path(__file__).parent.parent
    page = (root / "docs" / "positions.md").read_text(encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    shutil.copytree(root / "examples", tmp_path / "examples")
    names: dict[str, Any] = {}
    for code in re.findall(r"^```python\n(.*?)^```", page, re.DOTALL | re.MULTILINE):
        exec(compile(code, "positions.md", "exec"), names)
    told = re.search(r"the panel's plane is [0-9.]+ ± [0-9.]+ m away", page)
    assert told is not None
    assert told[0] in names["panel"].notes[-1]
    assert (tmp_path / "car.yaml").is_file()
