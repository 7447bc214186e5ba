"""`fronto segment`, `fronto evaluate` and `fronto render`: files, lines and exit codes.

The network is replaced by one that finds bright squares.
"""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import cv2
import numpy as np
import pytest
from click.testing import CliRunner, Result
from PIL import Image

from fronto.cli import COMMANDS, main
from fronto.datasets.opening import open_dataset
from fronto.errors import InputError
from fronto.imageio import read_image
from fronto.segments import Segment, Segments

BOXES = ((20, 30, 60, 70), (90, 30, 130, 70), (30, 100, 50, 120))


def add_photo(path: Path, boxes: tuple[tuple[int, int, int, int], ...] = BOXES) -> Path:
    image = np.full((160, 200, 3), 40, np.uint8)
    for x0, y0, x1, y1 in boxes:
        image[y0:y1, x0:x1] = 230
    path.parent.mkdir(exist_ok=True)
    Image.fromarray(image).save(path)
    return path


def bright_squares(
    image: Any, *, engine: Any = None, min_confidence: float = 0.5, second_look: bool = True
) -> Segments:
    """Squares of 20 px are plates, larger ones are numbers."""
    pixels = np.array(read_image(image)) if isinstance(image, Path) else image
    bright = (pixels[..., 0] > 128).astype(np.uint8)
    _, _, stats, _ = cv2.connectedComponentsWithStats(bright)
    segments = [
        Segment(
            "plate" if w < 30 else "number",
            0.9,
            (x - 0.5, y - 0.5, x + w - 0.5, y + h - 0.5),
            (int(x), int(y)),
            np.ones((h, w), np.float32),
        )
        for x, y, w, h, _ in stats[1:]
    ]
    seen = [s for s in segments if s.confidence >= min_confidence]
    notes = () if second_look else ("one look",)
    height, width = bright.shape
    return Segments(width, height, tuple(seen), notes=notes, timing_ms={"total": 4.2})


@pytest.fixture(autouse=True)
def engines(monkeypatch: pytest.MonkeyPatch) -> list[dict[str, Any]]:
    """What engines were asked for."""
    asked: list[dict[str, Any]] = []

    def engine(path: Path | None = None, **options: Any) -> Any:
        if path is not None and not path.exists():
            raise InputError(f"weights {path}", "expected a file, there is none")
        asked.append({"path": path, **options})
        return SimpleNamespace(path=Path("net.onnx"))

    monkeypatch.setattr("fronto.engine.Engine", engine)
    monkeypatch.setattr("fronto.segmentation.segment", bright_squares)
    return asked


def run(*arguments: Any) -> Result:
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def refused(result: Result, *words: object) -> None:
    assert result.exit_code == 2, result.output
    assert result.stderr.count("\n") == 1
    for word in words:
        assert str(word) in result.stderr


def test_one_photo(tmp_path: Path, engines: list[dict[str, Any]]) -> None:
    photo, out = add_photo(tmp_path / "hall.png"), tmp_path / "out"
    result = run("segment", photo, "-o", out, "--threads", 3)
    assert result.exit_code == 0, result.output
    (line,) = result.stdout.splitlines()
    assert line.startswith("hall.png: 2 buttons (2 number), 1 plate, 4 ms")
    assert line.endswith(str(out / "hall.overlay.png"))
    assert engines == [{"path": None, "threads": 3}]
    values = json.loads((out / "hall.segments.json").read_bytes())
    assert values["schema"] == "fronto.segments/1"
    assert values["image"] == "hall.png"
    assert values["weights"] == "net.onnx"
    assert [s["category"] for s in values["segments"]] == ["number", "number", "plate"]
    instances = read_image(out / "hall.segments.png")[..., 0]
    for s in values["segments"]:
        assert (instances == s["id"]).sum() == s["area_px"]
    assert sorted(path.name for path in out.iterdir()) == [
        "hall.overlay.png",
        "hall.segments.json",
        "hall.segments.png",
    ]


def test_options_reach_the_segmentation(tmp_path: Path) -> None:
    photo, out = add_photo(tmp_path / "hall.png"), tmp_path / "out"
    assert "one look" in run("segment", photo, "-o", out, "--fast").stdout
    sure = run("segment", photo, "-o", out, "--min-confidence", 0.95)
    assert sure.stdout.startswith("hall.png: 0 buttons, ")
    assert sure.exit_code == 0
    assert run("segment", photo, "-o", out, "--min-confidence", 0.95, "--strict").exit_code == 3
    assert run("segment", photo, "-o", out, "--strict").exit_code == 0
    quiet = run("segment", photo, "-o", out, "--quiet")
    assert (quiet.exit_code, quiet.output) == (0, "")


def test_a_bad_photo_is_skipped(tmp_path: Path) -> None:
    photos = [add_photo(tmp_path / f"{name}.png") for name in "abc"]
    photos[1].write_bytes(b"no picture")
    result = run("segment", *photos, "-o", tmp_path / "out")
    assert result.exit_code == 1
    assert [line.split(":")[0] for line in result.stdout.splitlines()] == ["a.png", "c.png"]
    assert str(photos[1]) in result.stderr
    assert result.stderr.count("\n") == 1
    written = {path.name for path in (tmp_path / "out").glob("*.json")}
    assert written == {"a.segments.json", "c.segments.json"}
    refused(run("segment", photos[1], "-o", tmp_path / "out"), photos[1])


def test_bad_usage(tmp_path: Path) -> None:
    photo = add_photo(tmp_path / "a.png")
    out = tmp_path / "out"
    for arguments in (
        ["-o", out],
        [photo],
        [photo, "-o", out, "--threads", 0],
        [photo, "-o", out, "--min-confidence", "nan"],
        [photo, "-o", out, "--format", "voc"],
    ):
        assert run("segment", *arguments).exit_code == 2
    refused(run("segment", photo, "-o", out, "--weights", tmp_path / "none.onnx"), "none.onnx")
    twin = add_photo(tmp_path / "more" / "A.png")
    refused(run("segment", photo, twin, "-o", out), photo, twin)
    assert not out.exists()
    overlay = add_photo(tmp_path / "a.overlay.png")
    refused(run("segment", photo, overlay, "-o", tmp_path), "a.overlay.png")


@pytest.mark.parametrize("kind", ["coco", "labelme", "cvat", "yolo"])
def test_a_data_set_of_what_was_found(tmp_path: Path, kind: str) -> None:
    photos = [add_photo(tmp_path / f"{name}.png") for name in "ab"]
    photos.append(tmp_path / "none.png")
    out = tmp_path / "out"
    result = run("segment", *photos, "-o", out, "--format", kind)
    assert result.exit_code == 1
    images = open_dataset(out / kind)
    assert sorted(image.path.name for image in images) == ["a.png", "b.png"]
    for image in images:
        assert sorted(o.category for o in image.objects) == ["number", "number", "plate"]
        box = min(o.box for o in image.objects)
        assert box == pytest.approx((19.5, 29.5, 59.5, 69.5), abs=0.01)
    again = run("segment", photos[0], "-o", out, "--format", kind)
    refused(again, out / kind)


@pytest.fixture
def labeled(tmp_path: Path) -> Path:
    """Three photos; of one the labels miss a button, of one they have one too many."""
    folder = tmp_path / "data"
    names = {"a": BOXES[:2], "b": BOXES[:1], "c": (*BOXES[:2], (150, 100, 190, 140))}
    for name, boxes in names.items():
        photo = add_photo(folder / f"{name}.png", BOXES[:2])
        shapes = [
            {
                "label": "number",
                "points": [[x0, y0], [x1, y0], [x1, y1], [x0, y1]],
                "shape_type": "polygon",
            }
            for x0, y0, x1, y1 in boxes
        ]
        values = {"shapes": shapes, "imagePath": photo.name, "imageWidth": 200, "imageHeight": 160}
        (folder / f"{name}.json").write_text(json.dumps(values))
    return folder


def test_evaluate(labeled: Path, tmp_path: Path) -> None:
    json_file, sheet = tmp_path / "report.json", tmp_path / "sheet.png"
    result = run("evaluate", labeled, "--json", json_file, "--sheet", sheet, "--worst", 1)
    assert result.exit_code == 0, result.output
    assert "| buttons, as labelled |" in result.stdout
    values = json.loads(json_file.read_bytes())
    assert values["by"] == "mask"  # every label has an outline
    assert values["images"] == 3
    # Of 6 labelled buttons 5 are found; 6 are reported.
    assert values["buttons"]["recall"] == pytest.approx(5 / 6)
    assert values["buttons"]["precision"] == pytest.approx(5 / 6)
    assert read_image(sheet).ndim == 3
    by_box = run("evaluate", labeled, "--by", "box", "--json", json_file, "--quiet")
    assert by_box.exit_code == 0
    assert json.loads(json_file.read_bytes())["by"] == "box"


def test_evaluate_with_missing_labels(labeled: Path, tmp_path: Path) -> None:
    missing = tmp_path / "missing.yaml"
    missing.write_text(f"{labeled.name}/b:\n- [89.5, 29.5, 129.5, 69.5, number]\n")
    json_file = tmp_path / "report.json"
    result = run("evaluate", labeled, "--missing", missing, "--json", json_file)
    assert result.exit_code == 0, result.output
    values = json.loads(json_file.read_bytes())
    assert values["buttons"]["precision"] == pytest.approx(5 / 6)
    assert values["buttons_reviewed"]["precision"] == pytest.approx(1)


def test_evaluate_refuses(labeled: Path, tmp_path: Path) -> None:
    refused(run("evaluate", tmp_path / "none"), "none")
    refused(run("evaluate", labeled, "--missing", tmp_path / "none.yaml"), "none.yaml")
    assert run("evaluate", labeled, "--iou", 0).exit_code == 2
    (labeled / "b.json").write_text("{")
    refused(run("evaluate", labeled), "b.json")


def test_no_error_no_sheet(labeled: Path, tmp_path: Path) -> None:
    for name in "bc":
        (labeled / f"{name}.json").unlink()
        (labeled / f"{name}.png").unlink()
    result = run("evaluate", labeled, "--sheet", tmp_path / "sheet.png")
    assert result.exit_code == 0, result.output
    assert not (tmp_path / "sheet.png").exists()


@pytest.mark.parametrize("kind", ["coco", "yolo"])
def test_render(tmp_path: Path, kind: str) -> None:
    out = tmp_path / "set"
    result = run("render", "-n", 2, "-o", out, "--size", "96x64", "--format", kind, "--seed", 5)
    assert result.exit_code == 0, result.output
    assert result.stdout.startswith("2 photos with ")
    images = open_dataset(out)
    assert len(images) == 2
    assert all((image.width, image.height) == (96, 64) for image in images)
    objects = [o for image in images for o in image.objects]
    assert objects
    assert all(o.polygon is not None for o in objects)
    refused(run("render", "-n", 2, "-o", out), out)


def test_renders_are_those_of_the_seed(tmp_path: Path) -> None:
    for name, number, seed in (("a", 2, 1), ("b", 1, 1), ("c", 1, 2)):
        run("render", "-n", number, "-o", tmp_path / name, "--size", "64x64", "--seed", seed)
    first, again, other = (
        read_image(sorted((tmp_path / name / "images").iterdir())[0]) for name in "abc"
    )
    assert np.array_equal(first, again)
    assert not np.array_equal(first, other)


@pytest.mark.parametrize("size", ["640", "0x0", "10x10", "-5x5", "axb"])
def test_render_refuses_sizes(tmp_path: Path, size: str) -> None:
    result = run("render", "-n", 1, "-o", tmp_path / "set", f"--size={size}")
    assert result.exit_code == 2
    assert "Traceback" not in result.output


def test_help_of_every_command_loads_nothing_heavy() -> None:
    code = (
        "import sys\nfrom fronto.cli import COMMANDS, main\n"
        "for arguments in [['--help'], *([name, '--help'] for name in COMMANDS)]:\n"
        "    try:\n        main(arguments)\n    except SystemExit:\n        pass\n"
        "heavy = {'numpy', 'cv2', 'PIL', 'yaml', 'msgspec', 'torch', 'onnxruntime', 'onnx',"
        " 'matplotlib'} & set(sys.modules)\n"
        "sys.exit(', '.join(heavy) or 0)"
    )
    command = [sys.executable, "-c", code]
    done = subprocess.run(command, capture_output=True, check=False, timeout=120)
    assert done.returncode == 0, done.stderr
    for name in COMMANDS:
        assert name.encode() in done.stdout


def test_an_unknown_command() -> None:
    result = run("shared")
    assert result.exit_code == 2
    assert "No such command" in result.stderr
