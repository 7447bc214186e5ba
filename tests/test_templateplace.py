"""Laying a known layout over a panel whose buttons were found and read."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import fronto
from fronto import InputError, Panel, Template, TemplateButton
from fronto.pipeline import rectify_outlines
from fronto.synth import LayoutButton, Scene, observe, sample_scene
from fronto.synth.layouts import Layout
from fronto.templateplace import place_template, with_template

LABELS = (*"123456789", "open", "close", "alarm")
PITCH_MM = (50.0, 42.0)
PHOTO = np.zeros((480, 640, 3), np.uint8)


def template(labels: tuple[str, ...] = LABELS) -> Template:
    return Template(
        tuple(
            TemplateButton((k % 3) * PITCH_MM[0], (k // 3) * PITCH_MM[1], 30, 30, label)
            for k, label in enumerate(labels)
        )
    )


def scene(seed: int) -> Scene:
    layout = Layout(
        "car",
        tuple(
            LayoutButton(b.x_mm / 1e3, b.y_mm / 1e3, 0.03, 0.03, text=b.label)
            for b in template().buttons
        ),
    )
    rng = np.random.default_rng(seed)
    found = sample_scene(rng, lambda _: layout, distance_m=(0.5, 0.5), spread=0.2, max_angle_deg=25)
    return observe(rng, found, 0.2, outlier_share=0.0)


def read_panel(seed: int, labels: dict[int, tuple[str, float]]) -> tuple[Panel, list[str]]:
    """Found in an order of no meaning, some buttons read as told; the true label of each."""
    seen = scene(seed)
    order = np.random.default_rng(seed).permutation(len(seen.outlines))
    outlines = [replace(seen.outlines[k], text="") for k in order]
    panel = rectify_outlines(PHOTO, outlines, seen.camera)
    buttons = [
        replace(b, label=labels[k][0], label_confidence=labels[k][1], label_source="button")
        if k in labels
        else replace(b, label_confidence=0.1)
        for k, b in zip(order, panel.buttons, strict=True)
    ]
    return replace(panel, buttons=tuple(buttons)), [LABELS[k] for k in order]


@pytest.mark.parametrize("seed", range(6))
def test_a_few_readings_place_all_buttons(seed):
    panel, true = read_panel(seed, {0: ("1", 0.9), 4: ("5", 0.9), 10: ("close", 0.95)})
    placed = place_template(panel, template())
    assert [LABELS[p] for p in placed.partner if p is not None] == true
    assert (placed.agree, placed.contradict) == (3, 0)


@pytest.mark.parametrize("seed", range(6))
def test_a_wrong_reading_is_outvoted(seed):
    readings = {k: (LABELS[k], 0.9) for k in (0, 2, 3, 7)} | {5: ("8", 0.9)}
    panel, true = read_panel(seed, readings)
    placed = place_template(panel, template())
    assert [LABELS[p] for p in placed.partner if p is not None] == true
    assert (placed.agree, placed.contradict) == (4, 1)


@pytest.mark.parametrize(
    "readings",
    [
        {},
        {4: ("5", 0.9)},
        {4: ("5", 0.9), 0: ("1", 0.3)},
        # Any two can be laid over the layout, wherever they are.
        {4: ("5", 0.9), 0: ("1", 0.9)},
        {4: ("8", 0.9), 0: ("2", 0.9)},
        {k: (f"B{k}", 0.9) for k in range(12)},
        # As many for one place as against it.
        {0: ("1", 0.9), 1: ("2", 0.9), 4: ("7", 0.9), 8: ("4", 0.9)},
    ],
)
def test_too_few_readings_place_nothing(readings):
    panel, _ = read_panel(1, readings)
    with pytest.raises(InputError, match="template"):
        place_template(panel, template())


def test_a_layout_of_other_sizes_is_another_panel_s():
    panel, _ = read_panel(1, {k: (label, 0.9) for k, label in enumerate(LABELS)})
    buttons = template().buttons
    place_template(panel, Template(tuple(replace(b, width_mm=32) for b in buttons)))
    place_template(panel, Template(tuple(replace(b, width_mm=None) for b in buttons)))
    with pytest.raises(InputError, match="template"):
        place_template(panel, Template(tuple(replace(b, width_mm=20) for b in buttons)))


def test_a_layout_needs_labels_of_its_own():
    panel, _ = read_panel(1, {k: (label, 0.9) for k, label in enumerate(LABELS)})
    for labels in (("",) * 12, (*LABELS[:11], "1")):
        with pytest.raises(InputError, match="labels"):
            place_template(panel, template(labels))


def test_without_a_rotation_nothing_is_placed():
    with pytest.raises(InputError, match="rotation"):
        place_template(rectify_outlines(PHOTO, []), template())


def test_solving_again_tells_distance_and_labels():
    panel, true = read_panel(2, {0: ("1", 0.9), 4: ("5", 0.99), 10: ("close", 0.95), 3: ("9", 0.6)})
    layout = template()
    camera = panel.pose.camera

    def solve(outlines):
        return rectify_outlines(PHOTO, outlines, camera, template=layout)

    solved = with_template(panel, layout, solve)
    assert solved.status == "ok"
    assert abs(solved.pose.plane_depth_m - 0.5) < 0.1
    assert [b.label for b in solved.buttons] == true
    by_label = {b.label: b for b in solved.buttons}
    assert by_label["5"].label_source == "button"
    assert by_label["5"].label_confidence == 0.99
    for label in ("4", "9"):  # one was read wrongly, one not at all
        assert by_label[label].label_source == "template"
        assert by_label[label].label_confidence == pytest.approx(4 / 6)


def test_what_cannot_be_placed_stays_with_a_note():
    panel, _ = read_panel(1, {})
    same = with_template(panel, template(), lambda outlines: pytest.fail("nothing to solve"))
    assert same.buttons == panel.buttons
    assert any("template" in note for note in same.notes)


def test_a_rectifier_uses_a_template_on_found_buttons():
    seen = scene(3)
    texts = [outline.text for outline in seen.outlines]
    found = fronto.Outlines(640, 480, tuple(replace(o, text="") for o in seen.outlines), ())

    def read(photo, panel):
        names = zip(panel.buttons, texts, strict=True)
        buttons = [
            replace(b, label=t, label_confidence=0.9, label_source="button") for b, t in names
        ]
        return replace(panel, buttons=tuple(buttons))

    rectifier = fronto.Rectifier(
        fronto.RectifierOptions(rectified_look=False),
        camera=seen.camera,
        template=template(),
        segment=lambda photo: fronto.Segments(640, 480, ()),
        outline=lambda segments, photo: found,
        read=read,
    )
    panel = rectifier(PHOTO)
    assert panel.pose.plane_depth_m == pytest.approx(np.linalg.norm(seen.translation), rel=0.1)
    assert [b.label for b in panel.buttons] == texts
