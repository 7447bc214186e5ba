"""A whole run of a context head: photos in, what they say, a file beside the reader's out."""

from __future__ import annotations

import csv
import json
from collections.abc import Iterator
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")
for module in ("kornia", "onnx", "onnxscript", "tqdm"):
    pytest.importorskip(module)

import cv2
from PIL import Image

import fronto
from fronto.datasets.records import LabeledImage
from fronto.datasets.renders import labeled_render
from fronto.engine import Engine, ReaderEngine, find_companion
from fronto.errors import InputError
from fronto.images import as_rgb
from fronto.labels.context import Context
from fronto.labels.name import name_buttons
from fronto.labels.reader import LabelReader
from fronto.synth.photo import render_photo
from fronto.train.context.collect import known_labels
from fronto.train.context.examples import read_examples
from fronto.train.context.export import export_context
from fronto.train.context.fit import ContextFit
from fronto.train.context.network import ContextNetwork, ContextOptions
from fronto.train.context.run import ContextTrainOptions, publish_context, train_context
from fronto.train.context.validate import TorchContext
from onnxfiles import digits, reader
from onnxfiles import network as segmentation

LABELS = ("1", "2", "3", "open")
HEAD = ContextOptions(width=16, layers=1, heads=2)
OPTIONS = ContextTrainOptions(
    passes=2, fit=ContextFit(steps=2, batch=2, warmup=1, save_every=2), network=HEAD
)


@pytest.fixture(autouse=True)
def threads() -> Iterator[None]:
    """A run sets how many threads work."""
    before = torch.get_num_threads(), cv2.getNumThreads()
    yield
    torch.set_num_threads(before[0])
    cv2.setNumThreads(before[1])


def context(n: int, count: int = len(LABELS) + 2) -> Context:
    rng = np.random.default_rng(n)
    beliefs = [rng.dirichlet(np.full(count, 0.3), n) for _ in range(3)]
    parts = (*beliefs, rng.normal(size=(n, 31)), rng.normal(size=(n, n, 19)))
    return Context(*(part.astype(np.float32) for part in parts))


def wild_head(seed: int, labels: tuple[str, ...] = LABELS) -> ContextNetwork:
    torch.manual_seed(seed)
    network = ContextNetwork(labels, HEAD).eval()
    for parameter in network.parameters():
        torch.nn.init.normal_(parameter, std=0.3)
    return network


def columns(run: Path) -> list[dict[str, str]]:
    with (run / "metrics.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


@pytest.fixture
def small_reader(tmp_path: Path) -> ReaderEngine:
    content = reader()
    path = tmp_path / "weights" / f"fronto-read-{digits(content)}.onnx"
    path.parent.mkdir()
    path.write_bytes(content)
    return ReaderEngine(path, threads=1)


def test_the_file_gives_the_same_numbers(small_reader: ReaderEngine) -> None:
    folder = small_reader.path.parent
    older = folder / f"{small_reader.path.stem}.context-01234567.onnx"
    older.touch()
    heads = [wild_head(seed) for seed in (0, 1)]
    path = export_context(heads, small_reader, folder, {"license": "MIT"})
    # A reader has one head.
    assert not older.exists()
    assert find_companion(small_reader.path, "context") == path
    used = ReaderEngine(small_reader.path, threads=1).context
    assert used is not None
    assert (used.path, used.labels) == (path, LABELS)
    assert used.metadata["license"] == "MIT"
    assert used.metadata["network"] == small_reader.digest
    assert used.metadata["heads"] == "2"
    assert json.loads(used.metadata["options"]) == asdict(HEAD)
    for n in (1, 2, 30):
        found = used.run(context(n))
        told = [TorchContext(head).run(context(n)) for head in heads]
        mean = (told[0] + told[1]) / 2
        assert found.shape == (n, len(LABELS) + 2)
        assert np.abs(told[0] - mean).max() > 0.01
        assert np.abs(found - mean).max() <= 1e-4
        np.testing.assert_allclose(found.sum(axis=1), 1, atol=1e-5)


@pytest.fixture(scope="module")
def engine() -> Engine:
    return Engine(threads=1)


@pytest.fixture(scope="module")
def renders(tmp_path_factory: pytest.TempPathFactory) -> list[LabeledImage]:
    """A panel with plates, and one without."""
    folder = tmp_path_factory.mktemp("renders")
    images = []
    for seed in (8, 10):
        photo = render_photo(np.random.default_rng(seed), 320, 240)
        path = folder / f"{seed}.png"
        Image.fromarray(photo.image).save(path)
        images.append(labeled_render(photo, path))
    return images


def test_from_photos_to_a_file(
    renders: list[LabeledImage], engine: Engine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run, folder = tmp_path / "run", tmp_path / "weights"
    folder.mkdir()
    packaged = ReaderEngine(threads=1).path
    path = folder / packaged.name
    path.write_bytes(packaged.read_bytes())
    used = ReaderEngine(path, threads=1)
    tools = {"reader": used, "engine": engine, "progress": False}
    network = train_context(renders, run, OPTIONS, held_out=renders[:1], **tools)  # type: ignore[arg-type]
    assert not network.training
    assert network.labels == known_labels(renders)
    assert {"val_right", "val_wrong"} <= set(columns(run)[0])
    noted = json.loads((run / "options.json").read_text(encoding="utf-8"))
    assert (noted["reader"], noted["engine"]) == (used.digest, engine.digest)
    assert (noted["photos"], noted["passes"]) == (2, 2)
    plain, spoilt = (read_examples(file) for file in sorted(run.glob("panels-*")))
    assert len(plain) == 2
    # Each that is made worse comes once more, with labels hidden.
    assert spoilt
    for e, hidden in zip(spoilt[::2], spoilt[1::2], strict=True):
        np.testing.assert_array_equal(hidden.context.pairs, e.context.pairs)
        np.testing.assert_array_equal(hidden.target, e.target)
    for e in (*plain, *spoilt):
        assert e.context.own.shape == (len(e.target), len(network.labels) + 2)
    assert max((e.target >= 0).sum() for e in plain) > 3

    # Going on: photos are not read again,
    before = {file: file.read_bytes() for file in run.glob("panels-*")}
    longer = replace(OPTIONS, fit=replace(OPTIONS.fit, steps=4))
    with monkeypatch.context() as patched:
        patched.delattr(Engine, "run")
        patched.delattr(ReaderEngine, "run")
        network = train_context(renders, run, longer, **tools)  # type: ignore[arg-type]
    assert [row["step"] for row in columns(run)] == ["2", "4"]
    # unless they are to be read more often.
    train_context(renders, run, replace(longer, passes=3, workers=1), **tools)  # type: ignore[arg-type]
    after = {file: file.read_bytes() for file in run.glob("panels-*")}
    assert len(after) == 3
    assert {file: after[file] for file in before} == before

    head = publish_context([run], used, folder, {"license": "MIT"})
    used = ReaderEngine(path, threads=1)
    assert used.context is not None
    assert used.context.path == head
    assert used.context.labels == network.labels
    rectifier = fronto.Rectifier(fronto.RectifierOptions(read_labels=False), engine=engine)
    for photo in renders:
        pixels, panel = as_rgb(photo.path), rectifier(photo.path)
        assert panel.buttons
        found, expected = (
            name_buttons(panel, pixels, LabelReader(used), weighing)
            for weighing in (used.context, TorchContext(network))
        )
        assert [b.label for b in found.buttons] == [b.label for b in expected.buttons]
        assert [b.label_confidence for b in found.buttons] == pytest.approx(
            [b.label_confidence for b in expected.buttons], abs=1e-3
        )


def test_a_run_is_for_one_reader_engine_and_set_of_photos(
    renders: list[LabeledImage], engine: Engine, small_reader: ReaderEngine, tmp_path: Path
) -> None:
    run, photos = tmp_path / "run", renders[1:]
    once = replace(OPTIONS, passes=1)
    train_context(photos, run, once, reader=small_reader, engine=engine, progress=False)
    before = {path.name: path.read_bytes() for path in run.iterdir()}
    content = reader(version="0.8")
    (tmp_path / "other.onnx").write_bytes(content)
    other = ReaderEngine(tmp_path / "other.onnx", threads=1)
    for attempt in (
        lambda: train_context(photos, run, once, reader=other, engine=engine, progress=False),
        lambda: publish_context([run], other, tmp_path / "out", {}),
    ):
        with pytest.raises(InputError, match=f"{small_reader.digest}.*{other.digest}"):
            attempt()
    (tmp_path / "seg.onnx").write_bytes(segmentation())
    another = Engine(tmp_path / "seg.onnx", threads=1)
    for images, options, used in (
        (photos, once, another),
        (renders[:1], once, engine),  # as many, but other ones
        (renders, once, engine),
        (photos, replace(once, seed=1), engine),
        (photos, replace(once, network=replace(HEAD, layers=2)), engine),
    ):
        with pytest.raises(InputError, match="run"):
            train_context(images, run, options, reader=small_reader, engine=used, progress=False)
    assert {path.name: path.read_bytes() for path in run.iterdir()} == before
    assert not (tmp_path / "out").exists()


def test_nothing_to_learn_from(engine: Engine, small_reader: ReaderEngine, tmp_path: Path) -> None:
    tools = {"reader": small_reader, "engine": engine, "progress": False}
    with pytest.raises(InputError, match="photos"):
        train_context([], tmp_path / "run", OPTIONS, **tools)  # type: ignore[arg-type]
    assert not (tmp_path / "run").exists()
    Image.new("RGB", (320, 240), "gray").save(tmp_path / "gray.png")
    gray = LabeledImage(tmp_path / "gray.png", 320, 240, ())
    with pytest.raises(InputError, match="photos"):
        train_context([gray], tmp_path / "run", OPTIONS, **tools)  # type: ignore[arg-type]


def test_what_is_no_run_is_not_published(small_reader: ReaderEngine, tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"last\.pt"):
        publish_context([tmp_path], small_reader, tmp_path / "out", {})
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("name", "value"), [("passes", 0), ("workers", -1)])
def test_options_that_are_refused(name: str, value: int) -> None:
    with pytest.raises(InputError, match=name):
        replace(OPTIONS, **{name: value})
