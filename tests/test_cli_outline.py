"""`fronto outline`: files, lines and exit codes.

The network is replaced by one that knows the masks of the rendered photo.
"""

from __future__ import annotations

import json
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from click.testing import CliRunner, Result

from fronto.categories import PLATE
from fronto.cli import main
from fronto.errors import InputError
from fronto.imageio import read_image, write_png
from fronto.outlinefile import read_outlines
from fronto.segments import Segments
from fronto.synth.photo import PanelPhoto, render_photo


@pytest.fixture(scope="module")
def panel() -> PanelPhoto:
    """Quads, two of them truncated, ellipses, and plates."""
    return render_photo(np.random.default_rng([3, 7]), 640, 480)


@pytest.fixture(autouse=True)
def asked(monkeypatch: pytest.MonkeyPatch, panel: PanelPhoto) -> list[dict[str, Any]]:
    """What engines and the segmentation were asked for."""
    calls: list[dict[str, Any]] = []

    def engine(path: Path | None = None, **options: Any) -> Any:
        if path is not None and not path.exists():
            raise InputError(f"weights {path}", "expected a file, there is none")
        calls.append({"path": path, **options})
        return SimpleNamespace(path=Path("net.onnx"), edges=None)

    def segment(image: Any, *, engine: Any, **options: Any) -> Segments:
        calls.append(options)
        if not np.array_equal(image, panel.image):
            return Segments(image.shape[1], image.shape[0], (), timing_ms={"total": 1.0})
        masks = np.zeros((len(panel.objects) + 1, 480, 640), np.uint8)
        for mask, thing in zip(masks, panel.objects, strict=False):
            cv2.fillPoly(mask, [np.rint(thing.polygon_px * 16).astype(np.int32)], (1,), 8, 4)
        masks[-1, 2:4, 3:6] = 1  # too small to be outlined
        names = [*(thing.category for thing in panel.objects), "stop"]
        return Segments.from_masks(masks.astype(bool), names)

    monkeypatch.setattr("fronto.engine.Engine", engine)
    monkeypatch.setattr("fronto.segmentation.segment", segment)
    return calls


def add_photo(path: Path, image: np.ndarray) -> Path:
    path.parent.mkdir(exist_ok=True)
    write_png(path, image)
    return path


@pytest.fixture
def photo(tmp_path: Path, panel: PanelPhoto) -> Path:
    return add_photo(tmp_path / "hall.png", panel.image)


def run(*arguments: Any) -> Result:
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def refused(result: Result, *words: object) -> None:
    assert result.exit_code == 2, result.output
    assert result.stderr.count("\n") == 1
    for word in words:
        assert str(word) in result.stderr


def counts(line: str) -> dict[str, float]:
    """Numbers of a line by what they count."""
    summary = line.split(": ", 1)[1].split(" -> ")[0]
    found = re.findall(r"(?:median (std) )?([\d.]+) (?:px|(ms|\w+?)s?(?: out)?)(?:,|$)", summary)
    return {std or what: float(number) for std, number, what in found}


def test_files_and_line(photo: Path, tmp_path: Path, asked: list[dict[str, Any]]) -> None:
    out = tmp_path / "out"
    result = run("outline", photo, "-o", out, "--threads", 3)
    assert result.exit_code == 0, result.output
    (line,) = result.stdout.splitlines()
    assert line.startswith("hall.png: ")
    assert line.endswith(f" -> {out / 'hall.outlines.png'}")
    assert {path.name for path in out.iterdir()} == {"hall.outlines.json", "hall.outlines.png"}
    assert asked[0] == {"path": None, "threads": 3}

    found = read_outlines(out / "hall.outlines.json")
    assert (found.image, found.width_px, found.height_px) == ("hall.png", 640, 480)
    assert found.plates
    assert {plate.category for plate in found.plates} == {PLATE}
    assert PLATE not in {button.category for button in found.outlines}
    told = counts(line)
    shapes = [outline.shape for outline in found.outlines]
    odd = sum(outline.odd for outline in found.outlines)
    assert told["quad"] == shapes.count("quad") - odd > 0
    assert told["ellipse"] == shapes.count("ellipse") > 0
    assert told.get("odd", 0) == odd
    assert told.get("truncated", 0) == sum(outline.truncated for outline in found.outlines)
    assert told["plate"] == len(found.plates)
    assert told["line"] == len(found.lines)
    assert told["left"] >= 1  # the tiny one
    std = np.median([outline.std_px for outline in found.outlines])
    assert told["std"] == pytest.approx(std, abs=0.006)
    assert told["ms"] > 0

    picture = read_image(out / "hall.outlines.png")
    assert picture.shape == (480, 640, 3)
    assert (picture != read_image(photo)).any()


def test_outlines_are_those_of_the_buttons(photo: Path, tmp_path: Path, panel: PanelPhoto) -> None:
    run("outline", photo, "-o", tmp_path / "out")
    found = read_outlines(tmp_path / "out" / "hall.outlines.json")
    truth = [o.outline for o in panel.objects if o.category != PLATE and not o.outline.odd]
    whole = [outline for outline in truth if not outline.truncated]
    centers = np.array([outline.center_px for outline in found.outlines])
    assert len(whole) > 10
    for outline in whole:
        nearest = np.linalg.norm(centers - outline.center_px, axis=1).argmin()
        assert found.outlines[nearest].box_px == pytest.approx(outline.box_px, abs=2.5)


def test_rectify_takes_them(photo: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    run("outline", photo, "-o", out)
    result = run("rectify", photo, "--outlines", out / "hall.outlines.json", "-o", out)
    assert result.exit_code == 0, result.output
    panel = json.loads((out / "hall.json").read_bytes())
    assert panel["status"] in ("ok", "uncertain")
    assert panel["image"] == "hall.png"
    assert len(panel["buttons"]) == len(read_outlines(out / "hall.outlines.json").outlines)


def test_options_reach_their_places(
    photo: Path, tmp_path: Path, asked: list[dict[str, Any]], monkeypatch: pytest.MonkeyPatch
) -> None:
    import fronto.outlines

    real, options = fronto.outlines.outline, []

    def outline(segments: Segments, image: Any, **given: Any) -> Any:
        options.append(given)
        return real(segments, image, **given)

    monkeypatch.setattr("fronto.outlines.outline", outline)
    out = tmp_path / "out"
    run("outline", photo, "-o", out, "--fast", "--min-confidence", 0.75)
    assert asked[-1] == {"min_confidence": 0.75, "second_look": False}
    sharp = read_outlines(out / "hall.outlines.json")
    run("outline", photo, "-o", out, "--no-lines", "--corners", "hough")
    assert asked[-1] == {"min_confidence": 0.5, "second_look": True}
    rough = read_outlines(out / "hall.outlines.json")
    assert options == [
        {"corners": "subpixel", "lines": True, "edges": False},
        {"corners": "hough", "lines": False, "edges": False},
    ]
    assert rough.lines == ()
    assert {o.std_px for o in rough.outlines} != {o.std_px for o in sharp.outlines}


def test_a_photo_without_buttons(tmp_path: Path) -> None:
    photo, out = add_photo(tmp_path / "wall.png", np.full((60, 80, 3), 90, np.uint8)), tmp_path
    result = run("outline", photo, "-o", out)
    assert result.exit_code == 0, result.output
    told = counts(result.stdout.strip())
    assert (told["quad"], told["ellipse"], "std" in told) == (0, 0, False)
    assert read_outlines(out / "wall.outlines.json").outlines == ()
    assert np.array_equal(read_image(out / "wall.outlines.png"), read_image(photo))
    assert run("outline", photo, "-o", out, "--strict").exit_code == 3
    quiet = run("outline", photo, "-o", out, "--quiet")
    assert (quiet.exit_code, quiet.output) == (0, "")


def test_a_bad_photo_is_skipped(photo: Path, tmp_path: Path) -> None:
    bad, out = tmp_path / "bad.png", tmp_path / "out"
    bad.write_bytes(b"no picture")
    result = run("outline", bad, photo, "-o", out, "--strict")
    assert result.exit_code == 1
    assert [line.split(":")[0] for line in result.stdout.splitlines()] == ["hall.png"]
    assert str(bad) in result.stderr
    assert result.stderr.count("\n") == 1
    assert [path.name for path in out.glob("*.json")] == ["hall.outlines.json"]
    refused(run("outline", bad, "-o", out), bad)


def test_bad_usage(photo: Path, tmp_path: Path, panel: PanelPhoto) -> None:
    out = tmp_path / "out"
    for arguments in (
        ["-o", out],
        [photo],
        [photo, "-o", out, "--threads", 0],
        [photo, "-o", out, "--min-confidence", 2],
        [photo, "-o", out, "--corners", "canny"],
    ):
        assert run("outline", *arguments).exit_code == 2
    refused(run("outline", photo, "-o", out, "--weights", tmp_path / "none.onnx"), "none.onnx")
    twin = add_photo(tmp_path / "more" / "HALL.png", panel.image)
    refused(run("outline", photo, twin, "-o", out), photo, twin)
    assert not out.exists()
    drawing = add_photo(tmp_path / "hall.outlines.png", panel.image)
    refused(run("outline", photo, drawing, "-o", tmp_path), drawing.name)
    refused(run("outline", photo, "-o", photo), photo)
    refused(run("outline", photo, "-o", photo / "out"), photo)


def test_no_old_outlines_beside_a_failed_drawing(photo: Path, tmp_path: Path) -> None:
    out = tmp_path / "out"
    run("outline", photo, "-o", out)
    (out / "hall.outlines.png").unlink()
    (out / "hall.outlines.png").mkdir()
    refused(run("outline", photo, "-o", out), "hall.outlines.png")
    assert not (out / "hall.outlines.json").exists()
