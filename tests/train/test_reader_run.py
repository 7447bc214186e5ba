"""A whole run of the reader: photos in, an ONNX file out."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")
for module in ("onnx", "onnxscript", "tqdm"):
    pytest.importorskip(module)

from PIL import Image

from fronto.datasets.records import LabeledImage, LabeledObject
from fronto.engine import ReaderEngine
from fronto.errors import InputError
from fronto.train.reader.fit import ReaderFit
from fronto.train.reader.network import ReaderOptions
from fronto.train.reader.options import ReaderTrainOptions, read_reader_options
from fronto.train.reader.run import publish_reader, train_reader

SMALL = ReaderOptions(stem=4, stages=(4, 6, 8), kinds=4)
OPTIONS = ReaderTrainOptions(
    renders=0.5,
    fit=ReaderFit(steps=2, batch=4, warmup=1, workers=0, save_every=2),
    network=SMALL,
)


def photos(folder: Path, count: int) -> list[LabeledImage]:
    images = []
    for k in range(count):
        path = folder / f"{k}.png"
        picture = np.random.default_rng(k).integers(0, 256, (40, 90, 3), dtype=np.uint8)
        Image.fromarray(picture).save(path)
        named = zip(("12", "open", "empty"), (5, 35, 65), strict=True)
        objects = tuple(
            LabeledObject("unknown", (x, 8.0, x + 20.0, 30.0), None, name) for name, x in named
        )
        images.append(LabeledImage(path, 90, 40, objects))
    return images


def test_from_photos_to_a_file(tmp_path: Path) -> None:
    images = photos(tmp_path, 4)
    run = tmp_path / "run"
    train_reader(images, run, OPTIONS, held_out=images[:2], fonts=(), progress=False)
    noted = json.loads((run / "options.json").read_text(encoding="utf-8"))
    assert (noted["photos"], noted["fit"]["steps"], noted["fonts"]) == (4, 2, [])
    header, row = (run / "metrics.csv").read_text(encoding="utf-8").splitlines()
    assert "val_right" in header.split(",")
    assert "nan" not in row.split(",")[:7]

    path, figures = publish_reader(run, tmp_path / "out", images, {"license": "MIT"})
    assert ReaderEngine(path, threads=1).metadata["license"] == "MIT"
    assert path.name.startswith("fronto-read-")
    assert 0 <= figures["right"] <= 1
    assert {"calibration", "calibration_before"} <= set(figures)


def test_renders_only(tmp_path: Path) -> None:
    alone = replace(OPTIONS, renders=1.0)
    network = train_reader([], tmp_path / "run", alone, fonts=(), progress=False)
    assert not network.training
    with pytest.raises(InputError, match="photos"):
        train_reader([], tmp_path / "other", OPTIONS, fonts=(), progress=False)


@pytest.mark.parametrize(
    ("content", "match"),
    [
        ("renders = 1.5", "renders"),
        ("reuse = 0", "reuse"),
        ("threads = -1", "threads"),
        ("[fit]\nbatch = 1", "batch"),
        ("[fit]\nrate = 0.0", "rate"),
        ("[fit]\ndecay = -1.0", "decay"),
        ("[fit]\naverage = 1.0", "average"),
        ("[network]\nstages = [8, 8, 0]", "stages"),
        ("[network]\nwidth = 3", "width"),
        ("[fit", "options"),
    ],
)
def test_options_that_are_refused(tmp_path: Path, content: str, match: str) -> None:
    path = tmp_path / "options.toml"
    path.write_text(content, encoding="utf-8")
    with pytest.raises(InputError, match=match):
        read_reader_options(path)


def test_options_from_a_file(tmp_path: Path) -> None:
    path = tmp_path / "options.toml"
    path.write_text("renders = 0.3\n[fit]\nsteps = 7\n[network]\nstages = [8, 12, 16]\n")
    options = read_reader_options(path)
    assert (options.renders, options.fit.steps, options.fit.batch) == (0.3, 7, 128)
    assert options.network.stages == (8, 12, 16)
