"""Templates from results: written, read back, and used on the next photo of the same panel."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fronto import Panel, Template, TemplateButton, estimate_pose
from fronto.errors import InputError
from fronto.pipeline import rectify_outlines
from fronto.positions import locate
from fronto.synth import Layout, LayoutButton, Scene, imprecise, observe, sample_scene
from fronto.templatefile import read_template
from fronto.templatewriter import panel_template, template_yaml, write_template

PITCH = (0.05, 0.042)
LABELS = ("12A", "B1", "-2", "*1", "PH", "no", "07", "up", "1e3", "FAN", "G", "3")


def car(labels: tuple[str, ...] = LABELS, columns: int = 3) -> Layout:
    return Layout(
        "car",
        tuple(
            LayoutButton(
                (k % columns) * PITCH[0], (k // columns) * PITCH[1], 0.03, 0.03, text=label
            )
            for k, label in enumerate(labels)
        ),
    )


def seen(layout: Layout, seed: int, sigma_px: float = 0.1) -> Scene:
    rng = np.random.default_rng(seed)
    scene = sample_scene(rng, lambda _: layout, distance_m=(0.4, 0.4), spread=0.2, max_angle_deg=25)
    return observe(rng, scene, sigma_px, outlier_share=0.0)


def panel_of(scene: Scene) -> Panel:
    panel = rectify_outlines(np.zeros((480, 640, 3), np.uint8), scene.outlines, scene.camera)
    assert panel.status == "ok"
    return replace(panel, image="lobby, left.jpg")


def places(template: Template) -> np.ndarray:
    return np.array([(b.x_mm, b.y_mm) for b in template.buttons])


def test_grid_is_read_back_as_it_is(tmp_path: Path) -> None:
    layout = car()
    path = tmp_path / "panel.yaml"
    written = write_template(panel_of(seen(layout, 1)), path, pitch_m=PITCH)
    text = path.read_text(encoding="utf-8")
    assert "rows:" in text
    read = read_template(path)
    assert [b.label for b in read.buttons] == list(LABELS)
    assert places(read) == pytest.approx(places(written), abs=0.06)
    assert places(read) == pytest.approx(1e3 * layout.centers, abs=0.3)
    for button in read.buttons:
        assert (button.width_mm, button.height_mm) == pytest.approx((30, 30), abs=0.5)


def test_lines_and_steps_are_exact_after_snapping() -> None:
    rough = imprecise(np.random.default_rng(3), car(), 0.0002)
    template = panel_template(panel_of(seen(rough, 2)), pitch_m=PITCH)
    across, down = (np.unique(values.round(6)) for values in places(template).T)
    assert len(across) == 3
    assert len(down) == 4
    assert np.ptp(np.diff(across)) < 1e-5
    assert np.ptp(np.diff(down)) < 1e-5
    assert len({(b.width_mm, b.height_mm) for b in template.buttons}) == 1
    loose = panel_template(panel_of(seen(rough, 2)), pitch_m=PITCH, tolerance_mm=0)
    assert len(np.unique(places(loose)[:, 0].round(6))) > 3


def test_other_layouts_are_lists_in_order(tmp_path: Path) -> None:
    wide = (
        LayoutButton(0.003, 0.21, 0.045, 0.03, text="open"),
        LayoutButton(0.083, 0.225, 0.03, 0.03, "ellipse", text="alarm"),
    )
    layout = replace(car(), buttons=(*car().buttons, *wide))
    path = tmp_path / "panel.yaml"
    write_template(panel_of(seen(layout, 4)), path, pitch_m=PITCH)
    assert "buttons:" in path.read_text(encoding="utf-8")
    read = read_template(path)
    assert [b.label for b in read.buttons] == [b.text for b in layout.buttons]
    centers = 1e3 * (layout.centers - layout.centers.min(axis=0))
    assert places(read) == pytest.approx(centers, abs=0.5)
    assert read.buttons[-2].width_mm == pytest.approx(45, abs=1)
    assert read.buttons[-1].width_mm == read.buttons[-1].height_mm == pytest.approx(30, abs=1)


@pytest.mark.parametrize("rough_mm", [0.0, 0.2])
def test_the_next_photo_gives_the_same_positions(tmp_path: Path, rough_mm: float) -> None:
    layout = imprecise(np.random.default_rng(5), car(), 1e-3 * rough_mm)
    path = tmp_path / "panel.yaml"
    write_template(panel_of(seen(layout, 6)), path, pitch_m=PITCH)
    template = read_template(path)
    for seed in (7, 8, 9):
        scene = seen(layout, seed, 0.2)
        shuffled = np.random.default_rng(seed).permutation(len(scene.outlines))
        outlines = [scene.outlines[k] for k in shuffled]
        by_pitch = locate(estimate_pose(outlines, scene.camera), outlines=outlines, pitch_m=PITCH)
        pose = estimate_pose(outlines, scene.camera, template=template)
        by_template = locate(pose, outlines=outlines)
        assert by_pitch
        assert by_template
        for one, other in zip(by_pitch.positions, by_template.positions, strict=True):
            off = np.linalg.norm(one.center_m - other.center_m)
            assert off < 0.004
            assert off < 4 * np.hypot(one.std_m.max(), other.std_m.max()) + 0.001


def test_only_what_can_be_found_again_is_written() -> None:
    panel = panel_of(seen(car(("1", "2", "2", "", "5", "6")), 1))
    inferred = replace(panel.buttons[5], label_source="inferred")
    panel = replace(panel, buttons=(*panel.buttons[:5], inferred))
    template = panel_template(panel, pitch_m=PITCH)
    assert [b.label for b in template.buttons] == ["1", "5"]
    nameless = panel_template(panel_of(seen(car(("",) * 6), 1)), pitch_m=PITCH)
    assert [b.label for b in nameless.buttons] == [""] * 6
    set_aside = replace(panel.buttons[0], weight=0.1)
    panel = replace(panel, buttons=(set_aside, *panel.buttons[1:]))
    with pytest.raises(InputError, match="two buttons"):
        panel_template(panel, pitch_m=PITCH)


def test_panels_that_are_not_ok_are_refused(tmp_path: Path) -> None:
    scene = seen(car(), 1)
    panel = rectify_outlines(np.zeros((480, 640, 3), np.uint8), scene.outlines[:1], scene.camera)
    with pytest.raises(InputError, match="ok pose"):
        write_template(panel, tmp_path / "panel.yaml", button_size_m=0.03)
    with pytest.raises(InputError, match="tolerance_mm"):
        panel_template(panel_of(scene), pitch_m=PITCH, tolerance_mm=-1)
    with pytest.raises(InputError, match="output file"):
        write_template(panel_of(scene), tmp_path / "missing" / "panel.yaml", pitch_m=PITCH)
    assert not list(tmp_path.iterdir())


def test_one_column_and_gaps_are_grids_too() -> None:
    column = Template(tuple(TemplateButton(0, 40 * k, None, None, str(k)) for k in range(3)))
    assert "rows:" in template_yaml(column)
    gaps = [TemplateButton(50 * i, 40 * j, 30, 30, f"{i}{j}") for i in range(3) for j in range(3)]
    text = template_yaml(Template(tuple(gaps[:4] + gaps[5:])))
    assert '["01", "", "21"]' in text
    slanted = Template((TemplateButton(0, 0, label="1"), TemplateButton(50, 4, label="2")))
    assert "rows:" not in template_yaml(slanted)
    far = Template((*gaps, TemplateButton(0, 4000, 30, 30, "far")))
    assert "rows:" not in template_yaml(far)


TEXTS = st.text(st.characters(exclude_categories=("C", "Z")), min_size=1, max_size=6)


@settings(derandomize=True, deadline=None, max_examples=60)
@given(
    labels=st.lists(TEXTS, min_size=2, max_size=8, unique=True),
    regular=st.booleans(),
    sized=st.booleans(),
    seed=st.integers(0, 99),
    name=st.text(max_size=12),
)
def test_any_template_is_read_back(
    tmp_path_factory: pytest.TempPathFactory,
    labels: list[str],
    regular: bool,
    sized: bool,
    seed: int,
    name: str,
) -> None:
    rng = np.random.default_rng(seed)
    labels = [label for label in labels if label not in ("~", "null")]
    if len(labels) < 2:
        return
    size = (31.4, 29.6) if sized else (None, None)
    buttons = []
    for k, label in enumerate(labels):
        x, y = 47.3 * (k % 3), 52.125 * (k // 3)
        if not regular:
            x, y = x + rng.uniform(-3, 3), y + rng.uniform(-3, 3)
        buttons.append(TemplateButton(x, y, *size, label))
    path = tmp_path_factory.mktemp("templates") / "panel.yaml"
    path.write_text(template_yaml(Template(tuple(buttons)), name), encoding="utf-8")
    read = {button.label: button for button in read_template(path).buttons}
    assert sorted(read) == sorted(labels)
    start = buttons[0]
    for button in buttons:
        again = read[button.label]
        moved = (again.x_mm - read[labels[0]].x_mm, again.y_mm - read[labels[0]].y_mm)
        assert moved == pytest.approx((button.x_mm - start.x_mm, button.y_mm - start.y_mm), abs=0.2)
        assert (again.width_mm, again.height_mm) == size
