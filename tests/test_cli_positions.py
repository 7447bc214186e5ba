"""Options that state a length: parsed, checked, and turned into positions."""

from __future__ import annotations

import json
import pickle
from dataclasses import replace
from pathlib import Path
from typing import Any

import click
import numpy as np
import pytest
from click.testing import CliRunner, Result

from fronto import Panel, Template, TemplateButton
from fronto.cli import main
from fronto.cli.positions import LengthSource, length_source, position_options
from fronto.errors import InputError
from fronto.outlinefile import write_outlines
from fronto.pipeline import rectify_outlines
from fronto.synth import Layout, LayoutButton, sample_scene
from fronto.templatefile import read_template

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


# --- `fronto rectify` with a length


class Room:
    """A photo of a panel with its outlines and its camera, and `fronto rectify` there."""

    def __init__(self, folder: Path) -> None:
        from PIL import Image

        self.folder, self.out = folder, folder / "out"
        self.panel = panel()
        outlines = [button.outline for button in self.panel.buttons]
        write_outlines(folder / "hall.outlines.json", outlines, width_px=640, height_px=480)
        nameless = [replace(outline, text="") for outline in outlines[:7]]
        write_outlines(folder / "nameless.json", nameless, width_px=640, height_px=480)
        Image.new("RGB", (640, 480)).save(folder / "hall.png")
        matrix = self.panel.pose.camera.matrix.tolist()
        camera = {"matrix": matrix, "width": 640, "height": 480}
        (folder / "camera.json").write_text(json.dumps(camera), encoding="utf-8")

    def rectify(self, *arguments: str, outlines: str = "hall.outlines.json") -> Result:
        fixed = [
            "rectify",
            str(self.folder / "hall.png"),
            *("--outlines", str(self.folder / outlines)),
            *("--camera", str(self.folder / "camera.json")),
            *("-o", str(self.out)),
        ]
        return CliRunner().invoke(main, [*fixed, *arguments])

    def values(self) -> dict[str, Any]:
        values: dict[str, Any] = json.loads((self.out / "hall.json").read_bytes())
        return values


@pytest.fixture
def room(tmp_path: Path) -> Room:
    return Room(tmp_path)


def test_rectify_states_positions(room: Room) -> None:
    assert room.rectify("--no-labels").exit_code == 0
    plain = room.values()
    assert plain["buttons"][0]["position_m"] is None
    # The direction to press in needs no length.
    assert plain["buttons"][0]["press_normal"] == pytest.approx(room.panel.pose.normal, abs=0.01)
    assert room.rectify("--no-labels", "--pitch", "50,42").exit_code == 0
    stated = room.values()
    assert stated["run"] != plain["run"]
    places = np.array([button["position_m"] for button in stated["buttons"]])
    expected = fronto_positions(room.panel)
    np.testing.assert_allclose(places, expected, atol=0.005)
    assert all(max(button["position_std_m"]) < 0.02 for button in stated["buttons"])


def fronto_positions(result: Panel) -> np.ndarray:
    from fronto.positions import locate

    located = locate(result, pitch_m=(0.05, 0.042))
    return np.array([position.center_m for position in located.positions])


def test_rectify_reads_depth_again_when_it_changes(room: Room) -> None:
    depth = room.folder / "depth.npy"
    runs = []
    for metres in (0.5, 0.6):
        np.save(depth, np.full((480, 640), metres, np.float32))
        result = room.rectify("--no-labels", "--depth", str(depth), "--resume")
        assert result.exit_code == 0
        assert "done before" not in result.stdout
        runs.append(room.values()["run"])
    assert runs[0] != runs[1]
    again = room.rectify("--no-labels", "--depth", str(depth), "--resume")
    assert "done before" in again.stdout


def test_rectify_writes_a_template_for_the_next_photo(room: Room) -> None:
    file = room.folder / "car.yaml"
    result = room.rectify("--no-labels", "--pitch", "50,42", "--write-template", str(file))
    assert result.exit_code == 0, result.output
    layout = read_template(file)
    assert {button.label for button in layout.buttons} == {
        button.label for button in room.panel.buttons
    }
    used = room.rectify("--no-labels", "--template", str(file))
    assert used.exit_code == 0
    values = room.values()
    places = np.array([button["position_m"] for button in values["buttons"]])
    np.testing.assert_allclose(places, fronto_positions(room.panel), atol=0.005)
    # Without texts, and nothing read, there is nothing to find its buttons by.
    lost = room.rectify("--no-labels", "--template", str(file), outlines="nameless.json")
    assert lost.exit_code == 0
    assert any("template" in note for note in room.values()["notes"])
    assert room.values()["buttons"][0]["position_m"] is None


def test_rectify_refuses_what_it_cannot_use(room: Room) -> None:
    for arguments in (
        ["--write-template", str(room.folder / "car.yaml")],
        ["--pitch", "50", "--distance", "0.5"],
        ["--template", "car.yaml", "--write-template", "car.yaml"],
        ["--depth", str(room.folder / "missing.npy")],
        ["--pitch", "-3"],
    ):
        refused = room.rectify("--no-labels", *arguments)
        assert refused.exit_code == 2
        assert not room.out.exists()
