"""Options that state a length: parsed, checked, and turned into positions."""

from __future__ import annotations

import pickle
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest
from click.testing import CliRunner

from fronto import Panel, Template, TemplateButton
from fronto.cli.positions import LengthSource, length_source, position_options
from fronto.errors import InputError
from fronto.pipeline import rectify_outlines
from fronto.synth import Layout, LayoutButton, sample_scene

PHOTO = Path("hall.jpg")


def source(*arguments: str, template: Path | None = None) -> LengthSource:
    """What a command with these arguments gets; raises what it would print."""
    result: dict[str, Any] = {}

    @click.command()
    @position_options
    def command(**options: Any) -> None:
        result["source"] = length_source(options, template)
        assert not options

    command.main(list(arguments), standalone_mode=False)
    found = result["source"]
    assert isinstance(found, LengthSource)
    return found


def panel() -> Panel:
    layout = Layout(
        "car",
        tuple(
            LayoutButton(0.05 * i, 0.042 * j, 0.03, 0.03, text=f"{i}{j}")
            for i in range(3)
            for j in range(4)
        ),
    )
    rng = np.random.default_rng(1)
    scene = sample_scene(rng, lambda _: layout, distance_m=(0.5, 0.5), spread=0.2, max_angle_deg=20)
    return rectify_outlines(np.zeros((480, 640, 3), np.uint8), scene.outlines, scene.camera)


@pytest.mark.parametrize(
    ("arguments", "field", "value"),
    [
        (["--pitch", "45"], "pitch_m", 0.045),
        (["--pitch", "45,52.5"], "pitch_m", (0.045, 0.0525)),
        (["--pitch", "45x52.5"], "pitch_m", (0.045, 0.0525)),
        (["--pitch", ",52"], "pitch_m", (None, 0.052)),
        (["--pitch", "45,"], "pitch_m", (0.045, None)),
        (["--button-size", "30"], "button_size_m", 0.03),
        (["--button-size", "30, 40"], "button_size_m", (0.03, 0.04)),
        (["--button-size", "siemens-3su1-30"], "button_size_m", 0.038),
        (["--depth-at", "320,240,0.52"], "depth", (320.0, 240.0, 0.52)),
        (["--distance", "0.5"], "distance_m", 0.5),
        (["--distance", "320,240,0.5"], "distance_m", (320.0, 240.0, 0.5)),
    ],
)
def test_numbers(arguments: list[str], field: str, value: object) -> None:
    found = source(*arguments)
    assert found
    known = getattr(found.known(PHOTO), field)
    if isinstance(value, tuple) and None in value:
        assert [k is None for k in known] == [v is None for v in value]
        known, value = max(known, key=bool), max(value, key=bool)
    assert known == pytest.approx(value)
    assert pickle.loads(pickle.dumps(found)) == found


def test_nothing_is_stated_by_default() -> None:
    found = source()
    assert not found
    assert not found.known(PHOTO)


def test_deviations() -> None:
    assert source("--pitch", "45", "--length-std", "0.5").known(PHOTO).std_m == pytest.approx(5e-4)
    assert source("--button-size", "siemens-3su1-30").known(PHOTO).std_m == pytest.approx(3e-4)


@pytest.mark.parametrize(
    "arguments",
    [
        ["--pitch", "45", "--distance", "0.5"],
        ["--pitch", "wide"],
        ["--pitch", "1,2,3"],
        ["--pitch", ","],
        ["--depth-at", "320,240"],
        ["--distance", "1,2"],
        ["--button-size", "30,"],
        ["--length-std", "1"],
        ["--pitch", "45", "--length-std", "-1"],
    ],
)
def test_wrong_usage(arguments: list[str]) -> None:
    with pytest.raises(click.UsageError) as caught:
        source(*arguments)
    assert "\n" not in caught.value.format_message()


@pytest.mark.parametrize(
    ("arguments", "flag"),
    [
        (["--pitch", "45000"], "--pitch"),
        (["--pitch", "-45"], "--pitch"),
        (["--distance", "nan"], "--distance"),
        (["--depth-at", "1,2,inf"], "--depth-at"),
        (["--button-size", "0"], "--button-size"),
        (["--button-size", "ada"], "button size"),
    ],
)
def test_wrong_lengths_name_the_option(arguments: list[str], flag: str) -> None:
    with pytest.raises(InputError) as caught:
        source(*arguments)
    assert flag in caught.value.thing
    assert "\n" not in str(caught.value)


def test_a_template_is_a_length() -> None:
    with pytest.raises(click.UsageError, match="--template"):
        source("--pitch", "45", template=Path("panel.yaml"))
    assert not source(template=Path("panel.yaml"))
    template = Template((TemplateButton(0, 0), TemplateButton(0, 40)))
    assert source().known(PHOTO, template).template == template


def test_depth_images_of_one_photo_and_of_many(tmp_path: Path) -> None:
    depth = np.full((6, 8), 500, np.uint16)
    np.save(tmp_path / "hall.npy", depth)
    one = source("--depth", str(tmp_path / "hall.npy"))
    many = source("--depth", str(tmp_path))
    for found in (one, many):
        assert found
        found.check()
        image = found.known(PHOTO).depth_image
        assert image is not None
        assert image == pytest.approx(0.5)
    assert many.depth_file(PHOTO) == tmp_path / "hall.npy"
    with pytest.raises(InputError, match="lobby"):
        many.known(Path("lobby.png"))
    with pytest.raises(InputError, match="missing"):
        source("--depth", str(tmp_path / "missing.npy")).check()


def test_results_are_filled_in() -> None:
    result = panel()
    filled = source("--pitch", "50,42").fill(result, PHOTO)
    assert all(button.position_m is not None for button in filled.buttons)
    directions = source().fill(result, PHOTO)
    assert all(button.position_m is None for button in directions.buttons)
    assert directions.buttons[0].press_normal == pytest.approx(result.pose.normal)
    # What does not apply to one photo's panel costs that photo nothing but its positions.
    unfit = source("--pitch", "50").fill(result, PHOTO)
    assert unfit.buttons[0].position_m is None
    assert any("no positions" in note for note in unfit.notes)


def test_help_names_units() -> None:
    @click.command()
    @position_options
    def command(**options: Any) -> None:
        pass

    text = CliRunner().invoke(command, ["--help"]).output
    for words in ("--button-size MM", "--pitch MM", "--depth-at X,Y,METRES", "millimetres"):
        assert words in " ".join(text.split())
