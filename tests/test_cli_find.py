"""`fronto find`: lines, JSON, the table, and exit codes."""

from __future__ import annotations

import csv
import json
import shutil
from collections.abc import Callable, Sequence
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result
from PIL import Image

from fronto.cli import main
from fronto.labels.reader import Reading

EXAMPLES = Path(__file__).parent.parent / "examples"
HALL, CAMERA = EXAMPLES / "hall.png", EXAMPLES / "camera.yaml"

Readable = Callable[..., None]


class Stub:
    """Says of the crops of one photo what it was told to, whatever they show."""

    def __init__(self, said: Sequence[tuple[str, float]]) -> None:
        self.said = said
        self.engine = SimpleNamespace(path=HALL, context=None)  # stands for the weights' file

    def read(self, crops: np.ndarray) -> tuple[Reading, ...]:
        return tuple(
            Reading(label, "text", p, ((label, p),)) if label else Reading("", "unreadable", p)
            for label, p in self.said[: len(crops)]
        )


@pytest.fixture
def readable(monkeypatch: pytest.MonkeyPatch) -> Readable:
    """Lets the three buttons of the hall be read."""

    def say(*said: tuple[str, float]) -> None:
        for module in ("fronto.labels.name", "fronto.rectifier"):
            monkeypatch.setattr(f"{module}.packaged_reader", lambda threads=None: Stub(said))

    return say


@pytest.fixture
def wall(tmp_path: Path) -> Path:
    path = tmp_path / "wall.png"
    Image.fromarray(np.full((240, 320, 3), 120, np.uint8)).save(path)
    return path


def run(*arguments: object) -> Result:
    return CliRunner().invoke(main, ["find", *(str(a) for a in arguments)])


def lines(result: Result) -> list[dict[str, Any]]:
    return [json.loads(line) for line in result.stdout.splitlines()]


SAID = (("12", 0.98), ("14", 0.97), ("open", 0.99))


def test_a_button_that_is_there(readable: Readable) -> None:
    readable(*SAID)
    result = run(HALL, "--label", "12", "--camera", CAMERA, "--pitch", "60")
    assert result.exit_code == 0, result.output
    (line,) = result.stdout.splitlines()
    assert "hall.png" in line
    assert "found" in line
    (values,) = lines(run(HALL, "-l", "12", "--camera", CAMERA, "--json", "--pitch", "60"))
    assert (values["schema"], values["status"]) == ("fronto.find/1", "found")
    assert (values["photo"], values["label"]) == ("hall.png", "12")
    assert (values["confidence"], values["label_source"]) == (pytest.approx(0.98), "button")
    x, y = values["center_px"]
    assert 0 < x < 800
    assert 0 < y < 600
    if values["panel_status"] == "ok":
        assert values["position_m"][2] > 0
        assert np.linalg.norm(values["press_normal"]) == pytest.approx(1)


def test_a_label_that_is_not_there_and_one_that_is_not_sure(readable: Readable) -> None:
    readable(*SAID)
    result = run(HALL, "--label", "16")
    assert result.exit_code == 4
    assert "not there" in result.stdout
    readable(("12", 0.6), *SAID[1:])
    result = run(HALL, "--label", "12")
    assert result.exit_code == 4
    assert "not sure" in result.stdout
    (values,) = lines(run(HALL, "--label", "12", "--json"))
    assert values["status"] == "not_sure"
    assert values["button"] is values["center_px"] is None
    assert values["candidates"][0]["confidence"] == pytest.approx(0.6, abs=0.1)
    assert values["reasons"]


def test_a_photo_without_buttons_is_not_sure(readable: Readable, wall: Path) -> None:
    readable()
    result = run(wall, "--label", "12")
    assert result.exit_code == 4
    assert "not sure" in result.stdout


def test_a_folder_gives_files_and_a_table(readable: Readable, wall: Path) -> None:
    readable(*SAID)
    folder, out = wall.parent, wall.parent / "out"
    shutil.copy(HALL, folder / "hall.png")
    (folder / "broken.png").write_bytes(b"no picture")
    result = run(folder, "--label", "B1 ", "-o", out, "--jobs", "1", "--fast", "-q")
    assert result.exit_code == 1
    assert result.stdout == ""
    assert "broken.png" in result.stderr
    with (out / "find.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(row["photo"], row["status"]) for row in rows] == [
        ("broken.png", "failed"),
        ("hall.png", "not_there"),
        ("wall.png", "not_sure"),
    ]
    assert {row["label"] for row in rows} == {"B1"}
    assert rows[0]["reasons"]
    assert not rows[1]["x_px"]
    written = {path.name: json.loads(path.read_text("utf-8")) for path in out.glob("*.json")}
    assert written.keys() == {"broken.find.json", "hall.find.json", "wall.find.json"}
    assert written["hall.find.json"]["status"] == "not_there"
    assert written["broken.find.json"]["schema"] == "fronto.error/1"

    (folder / "broken.png").unlink()
    result = run(folder, "--label", "14", "-o", out, "--jobs", "1", "--json")
    assert result.exit_code == 4  # the wall has none
    with (out / "find.csv").open(encoding="utf-8", newline="") as file:
        found = next(csv.DictReader(file))
    assert (found["status"], float(found["confidence"])) == ("found", pytest.approx(0.97))
    first = lines(result)[0]
    assert [float(found["x_px"]), float(found["y_px"])] == pytest.approx(first["center_px"])
    assert int(found["button"]) == first["button"]


def test_only_broken_photos(readable: Readable, tmp_path: Path) -> None:
    readable()
    (tmp_path / "a.png").write_bytes(b"no picture")
    result = run(tmp_path / "a.png", tmp_path / "none.png", "--label", "1", "--json")
    assert result.exit_code == 2
    assert [line["schema"] for line in lines(result)] == ["fronto.error/1"] * 2


@pytest.mark.parametrize(
    "wrong",
    [
        (HALL,),
        ("--label", "1"),
        (HALL, "--label", "?"),
        (HALL, "--label", "1", "--hfov", "60", "--focal-px", "500"),
        (HALL, "--label", "1", "--pitch", "40", "--distance", "0.5"),
        (HALL, "--label", "1", "--camera", "none.yaml"),
        (HALL, "--label", "1", "--weights", "none.onnx"),
        ("film.mp4", "--label", "1"),
    ],
)
def test_wrong_arguments(wrong: tuple[object, ...], readable: Readable) -> None:
    readable()
    result = run(*wrong)
    assert result.exit_code == 2
    assert len(result.stderr.strip().splitlines()) in (1, 3, 4)  # click's usage has more


def test_results_overwrite_no_input(readable: Readable, tmp_path: Path) -> None:
    readable(*SAID)
    photo = tmp_path / "find.csv"
    shutil.copy(HALL, photo)
    result = run(photo, "--label", "12", "-o", tmp_path)
    assert result.exit_code == 2
    assert photo.read_bytes() == HALL.read_bytes()


def test_a_package_without_reader_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(*folder: object, stem: str = "") -> Path:
        from fronto import InputError

        raise InputError("weights folder", f"expected one file {stem}-*.onnx, got none")

    monkeypatch.setattr("fronto.labels.name.packaged_reader", lambda threads=None: None)
    monkeypatch.setattr("fronto.engine.find_weights", missing)
    segmenting = next((Path(__file__).parent.parent / "src/fronto/weights").glob("fronto-seg-*"))
    result = run(HALL, "--label", "12", "--weights", segmenting)
    assert result.exit_code == 2
    assert "fronto-read" in result.stderr


def test_rectify_names_buttons_too(readable: Readable, tmp_path: Path) -> None:
    readable(*SAID)
    arguments = ["rectify", HALL, "--camera", CAMERA, "-o", tmp_path]
    for more, labels in (([], {"12", "14", "open"}), (["--no-labels"], {None})):
        result = CliRunner().invoke(main, [str(a) for a in (*arguments, *more)])
        assert result.exit_code == 0, result.output
        values = json.loads((tmp_path / "hall.json").read_text(encoding="utf-8"))
        assert {button["label"] for button in values["buttons"]} == labels
    outlines = EXAMPLES / "hall.outlines.json"
    given = json.loads(outlines.read_text(encoding="utf-8"))
    result = CliRunner().invoke(main, [str(a) for a in (*arguments, "--outlines", outlines)])
    assert result.exit_code == 0, result.output
    values = json.loads((tmp_path / "hall.json").read_text(encoding="utf-8"))
    for button, outline in zip(values["buttons"], given["buttons"], strict=True):
        read = button["label_confidence"] is not None
        assert read != bool(outline.get("text"))
