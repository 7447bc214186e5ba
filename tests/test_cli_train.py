"""`fronto train`, `fronto relations`, `fronto masks`, `fronto export` and `fronto curves`."""

from __future__ import annotations

import csv
import json
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner, Result
from PIL import Image

from fronto.cli import main
from fronto.cli.train import TRAIN_MODULES

needs_torch = pytest.mark.skipif(
    any(find_spec(name) is None for name in TRAIN_MODULES), reason="the extra train is missing"
)
TINY = ["--batch", 2, "--size", 64, "--workers", 0, "--seed", 1, "--quiet"]
NETWORK = "[fit]\nsave_every = 1\nwarmup = 1\n[network]\nchannels = 4\ndecoder = 4\n"


def run(*arguments: Any) -> Result:
    return CliRunner().invoke(main, [str(argument) for argument in arguments])


def refused(result: Result, *words: object) -> None:
    assert result.exit_code == 2, result.output
    assert "Traceback" not in result.output
    for word in words:
        assert str(word) in result.stderr


@pytest.fixture
def data(tmp_path: Path) -> Path:
    """Two photos of bright squares, labelled in LabelMe."""
    folder = tmp_path / "data"
    folder.mkdir()
    for name in "ab":
        image = np.full((120, 160, 3), 40, np.uint8)
        image[30:70, 40:80] = 220
        Image.fromarray(image).save(folder / f"{name}.png")
        shape = {"label": "up", "points": [[40, 30], [80, 70]], "shape_type": "rectangle"}
        values = {
            "shapes": [shape],
            "imagePath": f"{name}.png",
            "imageWidth": 160,
            "imageHeight": 120,
        }
        (folder / f"{name}.json").write_text(json.dumps(values))
    return folder


@pytest.fixture
def options(tmp_path: Path) -> Path:
    path = tmp_path / "options.toml"
    path.write_text(NETWORK)
    return path


@pytest.mark.parametrize(
    "command",
    [
        ["train", "-o", "run"],
        ["export", "run", "-o", "out"],
        ["relations", "-o", "run", "-d", "out"],
        ["masks", "-o", "run", "-d", "out"],
    ],
)
def test_without_torch_it_says_what_to_install(
    command: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(
        "fronto.cli.shared.find_spec", lambda name: None if name == "torch" else find_spec(name)
    )
    result = run(*command)
    refused(result, "torch", "pip install 'fronto[train]'")
    assert result.stderr.count("\n") == 1


@needs_torch
def test_train_go_on_and_export(
    data: Path, options: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    out = tmp_path / "run"
    common = ["train", data, "-o", out, "--options", options, "--renders", 0, *TINY]
    first = run(*common, "--start", "none", "--steps", 2, "--val", data)
    assert first.exit_code == 0, first.output
    with (out / "metrics.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["step"] for row in rows] == ["1", "2"]
    assert "val_recall" in rows[0]
    noted = json.loads((out / "options.json").read_bytes())
    assert noted["data"] == ["data"]
    assert noted["fit"]["size"] == 64

    # The run's own network goes on, whatever it might start from otherwise.
    second = run(*common, "--steps", 3, "--val", data)
    assert second.exit_code == 0, second.output
    assert len((out / "metrics.csv").read_text().splitlines()) == 4

    # Another run goes on from its checkpoint.
    third = ["train", data, "-o", tmp_path / "third", "--renders", 0, *TINY, "--steps", 1]
    result = run(*third, "--start", out / "last.pt")
    assert result.exit_code == 0, result.output

    def export(network: Any, directory: Path, name: str, metadata: dict[str, str]) -> Path:
        assert network.options.decoder == 4
        assert metadata == {"version": "3", "license": "MIT", "training_data": "two photos"}
        directory.mkdir()
        (directory / f"{name}.onnx").write_bytes(b"weights")
        return directory / f"{name}.onnx"

    monkeypatch.setattr("fronto.train.export.export_onnx", export)
    stated = ["--name", "mine", "--version", "3", "--license", "MIT", "--data", "two photos"]
    exported = run("export", out, "-o", tmp_path / "weights", *stated)
    assert exported.exit_code == 0, exported.output
    assert exported.stdout.rstrip().endswith(str(tmp_path / "weights" / "mine.onnx"))


@needs_torch
def test_train_refuses(data: Path, options: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    common = ["train", data, "-o", out, *TINY, "--steps", 1]
    refused(run(*common, "--start", tmp_path / "none.pt"), "none.pt")
    refused(run(*common, "--start", tmp_path / "none.onnx"), "none.onnx")
    refused(run(*common, "--start", tmp_path / "none.npz"), "none.npz")
    refused(run(*common, "--start", "best"), "--start")
    refused(run(*common, "--options", tmp_path / "none.toml"), "none.toml")
    refused(run(*common, "--start", "none", "--val", tmp_path / "nowhere"), "nowhere")
    refused(run("train", tmp_path / "no data", "-o", out, *TINY), "no data")
    refused(run("train", "-o", out, *TINY, "--renders", 0.5), "DATA")
    options.write_text("[fit]\nstep = 3")
    refused(run(*common, "--options", options), options, "fit.step")
    refused(run(*common, "--size", 100, "--start", "none"), "fit.size")
    assert not out.exists()


@needs_torch
def test_export_refuses(tmp_path: Path) -> None:
    refused(run("export", tmp_path, "-o", tmp_path / "out"), "last.pt")
    bad = tmp_path / "bad.pt"
    bad.write_bytes(b"no checkpoint")
    refused(run("export", bad, "-o", tmp_path / "out"), bad)
    refused(run("export", bad, "-o", tmp_path / "out", "--name", "a/b"), "--name")


@needs_torch
def test_a_relation_head_for_the_packaged_network(data: Path, tmp_path: Path) -> None:
    from fronto.engine import Engine, RelationEngine, find_weights

    weights = tmp_path / find_weights().name
    weights.write_bytes(find_weights().read_bytes())
    assert Engine(weights).relations is None
    common = ["relations", data, "-o", tmp_path / "run", "--batch", 2, "--quiet"]
    common += ["--renders", 0, "--pictures", 3, "--steps", 2]
    result = run(*common, "--weights", weights, "--license", "MIT", "--data", "two photos")
    assert result.exit_code == 0, result.output
    head = Engine(weights).relations
    assert isinstance(head, RelationEngine)
    assert head.metadata["license"] == "MIT"
    assert head.metadata["training_data"] == "two photos"
    noted = json.loads((tmp_path / "run" / "options.json").read_bytes())
    assert (noted["pictures"], noted["fit"]["steps"]) == (3, 2)


@needs_torch
def test_relations_refuses(data: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    common = ["relations", data, "-o", out, "--steps", 1, "--pictures", 1]
    refused(run(*common), "--weights")
    refused(run(*common, "--weights", tmp_path / "none.onnx"), "none.onnx")
    common += ["-d", tmp_path]
    refused(run(*common, "--val", tmp_path / "nowhere"), "nowhere")
    refused(run("relations", tmp_path / "no data", "-o", out, "-d", tmp_path), "no data")
    refused(run("relations", "-o", out, "-d", tmp_path, "--renders", 0.5), "DATA")
    assert not out.exists()


@pytest.fixture
def outlined(tmp_path: Path) -> Path:
    """A rendered panel, its outlines labelled in LabelMe."""
    from fronto.synth.photo import render_photo

    folder = tmp_path / "outlined"
    folder.mkdir()
    photo = render_photo(np.random.default_rng(3), 320, 240)
    Image.fromarray(photo.image).save(folder / "a.png")
    shapes = [
        {"label": o.category, "points": o.polygon_px.tolist(), "shape_type": "polygon"}
        for o in photo.objects
    ]
    values = {"shapes": shapes, "imagePath": "a.png", "imageWidth": 320, "imageHeight": 240}
    (folder / "a.json").write_text(json.dumps(values))
    return folder


@needs_torch
def test_a_mask_head_for_the_packaged_network(
    outlined: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from fronto.engine import Engine, MaskEngine, find_weights

    monkeypatch.setattr("fronto.train.masks.collect.SIZES", ((160, 120),))
    weights = tmp_path / find_weights().name
    weights.write_bytes(find_weights().read_bytes())
    assert Engine(weights).masks is None
    common = ["masks", outlined, "-o", tmp_path / "run", "--batch", 8, "--quiet"]
    common += ["--pictures", 2, "--steps", 1, "--rate", 0.001, "--seed", 4]
    stated = ["--license", "MIT", "--data", "a render"]
    result = run(*common, "--weights", weights, *stated)
    assert result.exit_code == 0, result.output
    head = Engine(weights).masks
    assert isinstance(head, MaskEngine)
    assert head.path.parent == tmp_path
    assert head.metadata["license"] == "MIT"
    assert head.metadata["training_data"] == "a render"
    noted = json.loads((tmp_path / "run" / "options.json").read_bytes())
    assert (noted["pictures"], noted["photos"], noted["renders"]) == (2, 1, 0.7)
    assert (noted["seed"], noted["fit"]["seed"], noted["fit"]["steps"]) == (4, 4, 1)
    assert (noted["fit"]["batch"], noted["fit"]["rate"]) == (8, 0.001)


@needs_torch
def test_without_data_a_mask_head_learns_from_renders(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from fronto.engine import find_weights

    asked = []

    def train(photos: list, engine: Any, folder: Path, options: Any, *, progress: bool) -> None:
        asked.append((photos, engine.path, folder, options, progress))

    def publish(runs: list[Path], engine: Any, where: Path, metadata: dict[str, str]) -> Path:
        asked.append((runs, where, metadata))
        return find_weights()

    monkeypatch.setattr("fronto.train.masks.run.train_masks", train)
    monkeypatch.setattr("fronto.train.masks.run.publish_masks", publish)
    result = run("masks", "-o", tmp_path / "run", "-d", tmp_path / "out")
    assert result.exit_code == 0, result.output
    photos, path, folder, options, progress = asked[0]
    assert (photos, path, folder, progress) == ([], find_weights(), tmp_path / "run", True)
    assert (options.renders, options.pictures, options.seed) == (1.0, 9000, 0)
    assert (options.fit.steps, options.fit.batch, options.fit.rate) == (12_000, 96, 3e-3)
    assert asked[1] == ([tmp_path / "run"], tmp_path / "out", {})
    assert "0 photos" in result.stderr + result.stdout


@needs_torch
def test_masks_refuses(data: Path, outlined: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    common = ["masks", outlined, "-o", out, "--steps", 1, "--pictures", 1]
    refused(run(*common), "--weights")
    refused(run(*common, "--weights", tmp_path / "none.onnx"), "none.onnx")
    common += ["-d", tmp_path]
    refused(run(*common, "--split", "nowhere"), "nowhere")
    refused(run(*common, "--renders", 1.5), "--renders")
    refused(run(*common, "--rate", 0), "--rate")
    refused(run("masks", tmp_path / "no data", "-o", out, "-d", tmp_path), "no data")
    for renders in (0, 0.5):
        refused(run("masks", "-o", out, "-d", tmp_path, "--renders", renders), "DATA")
    # Boxes only do not help.
    refused(run("masks", data, "-o", out, "-d", tmp_path), "outlines")
    assert not out.exists()


def metrics(folder: Path, text: str) -> Path:
    folder.mkdir()
    (folder / "metrics.csv").write_text(text)
    return folder


def test_curves(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    first = metrics(tmp_path / "a", "step,classes,val_f1,seconds\n1,0.5,nan,3\n2,0.4,0.1,4\n")
    second = metrics(tmp_path / "b", "step,classes,seconds\n1,0.6,3\n")
    result = run("curves", first, second, "-o", tmp_path / "curves.png")
    assert result.exit_code == 0, result.output
    with Image.open(tmp_path / "curves.png") as picture:
        assert picture.width > picture.height


def test_curves_refuse(tmp_path: Path) -> None:
    pytest.importorskip("matplotlib")
    refused(run("curves", tmp_path, "-o", tmp_path / "c.png"), "metrics.csv")
    odd = metrics(tmp_path / "odd", "step,loss\n1,2\n2,3,4\n")
    refused(run("curves", odd, "-o", tmp_path / "c.png"), "line 3")
    other = metrics(tmp_path / "other", "a,b\n1,2\n")
    refused(run("curves", other, "-o", tmp_path / "c.png"), "step")
    good = metrics(tmp_path / "good", "step,loss\n1,2\n")
    refused(run("curves", good, "-o", tmp_path / "c.xyz"), "c.xyz")
    assert not (tmp_path / "c.png").exists()
