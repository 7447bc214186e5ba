"""A whole run of a relation head: rendered panels in, a file beside the network's out."""

from __future__ import annotations

import csv
import json
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")
for module in ("kornia", "onnx", "onnxscript", "tqdm"):
    pytest.importorskip(module)

from PIL import Image

from fronto.datasets.records import LabeledImage, LabeledObject
from fronto.engine import Engine, find_companion
from fronto.errors import InputError
from fronto.relations import Candidates
from fronto.segmentation import segment
from fronto.train.relations.export import export_relations
from fronto.train.relations.fit import RelationFit
from fronto.train.relations.network import RelationNetwork, RelationOptions
from fronto.train.relations.pool import read_pool
from fronto.train.relations.run import RelationTrainOptions, publish_relations, train_relations
from fronto.train.relations.validate import TorchRelations
from onnxfiles import finder

CHANNELS = 12
HEAD = RelationOptions(features=CHANNELS, reduced=4, width=16, layers=2, heads=2)
OPTIONS = RelationTrainOptions(
    pictures=5,
    renders=1.0,
    size=128,
    fit=RelationFit(steps=2, batch=2, warmup=1, save_every=2),
    network=HEAD,
)


def engine_of(folder: Path, seed: int) -> Engine:
    path = folder / "weights" / f"network-{seed}.onnx"
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(finder(CHANNELS, seed=seed))
    return Engine(path, threads=1)


@pytest.fixture
def engine(tmp_path: Path) -> Engine:
    return engine_of(tmp_path, 0)


def wild_head(seed: int = 0) -> RelationNetwork:
    torch.manual_seed(seed)
    network = RelationNetwork(HEAD).eval()
    for parameter in network.parameters():
        torch.nn.init.normal_(parameter, std=0.3)
    return network


def candidates(n: int) -> Candidates:
    rng = np.random.default_rng(n)
    shapes = ((n, 49, CHANNELS), (n, 24), (n, n, 8))
    return Candidates(*(rng.normal(size=shape).astype(np.float32) for shape in shapes))


def photo(folder: Path) -> LabeledImage:
    path = folder / "photo.png"
    picture = np.random.default_rng(0).integers(0, 256, (96, 128, 3), dtype=np.uint8)
    Image.fromarray(picture).save(path)
    objects = (LabeledObject("up", (20.0, 20.0, 60.0, 60.0), None, "up"),)
    return LabeledImage(path, 128, 96, objects)


def columns(run: Path) -> list[dict[str, str]]:
    with (run / "metrics.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_the_file_gives_the_same_numbers(engine: Engine) -> None:
    network = wild_head()
    path = export_relations([network], engine, engine.path.parent, {"license": "MIT"}, shown=0.5)
    assert find_companion(engine.path) == path
    head = Engine(engine.path, threads=1).relations
    assert head is not None
    assert head.metadata["license"] == "MIT"
    assert head.metadata["network"] == engine.digest
    assert json.loads(head.metadata["options"]) == asdict(HEAD)
    for n in (1, 2, 40):
        found, expected = head.run(candidates(n)), TorchRelations(network).run(candidates(n))
        for name in ("kinds", "classes", "shifts"):
            ours, theirs = getattr(found, name), getattr(expected, name)
            assert ours.shape == theirs.shape
            assert theirs.std() > 0.01
            assert np.abs(ours - theirs).max() <= 1e-4, name
        np.testing.assert_allclose(found.kinds.sum(axis=1), 1, atol=1e-5)


def test_what_is_found_less_surely_is_shown_too(engine: Engine) -> None:
    answers = {}
    for shown in (0.5, 0.35):
        export_relations([wild_head()], engine, engine.path.parent, {}, shown=shown)
        head = Engine(engine.path, threads=1).relations
        assert head is not None
        answers[shown] = head.run(candidates(40)).kinds
    plain, lifted = 1 - answers[0.5][:, 0], 1 - answers[0.35][:, 0]
    expected = plain / (plain + 0.35 / 0.65 * (1 - plain))
    np.testing.assert_allclose(lifted, expected, atol=1e-4)
    # Which kind of thing it is, does not change.
    np.testing.assert_array_equal(
        answers[0.5][:, 1] > answers[0.5][:, 2], answers[0.35][:, 1] > answers[0.35][:, 2]
    )


def test_several_heads_give_their_mean(engine: Engine) -> None:
    heads = [wild_head(seed) for seed in (0, 1)]
    export_relations(heads, engine, engine.path.parent, {}, shown=0.5)
    used = Engine(engine.path, threads=1).relations
    assert used is not None
    assert used.metadata["heads"] == "2"
    told = [TorchRelations(head).run(candidates(7)) for head in heads]
    found = used.run(candidates(7))
    for name in ("kinds", "classes", "shifts"):
        mean = (getattr(told[0], name) + getattr(told[1], name)) / 2
        assert np.abs(getattr(told[0], name) - mean).max() > 0.01
        np.testing.assert_allclose(getattr(found, name), mean, atol=1e-4)


def test_from_renders_to_a_file(
    engine: Engine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    run = tmp_path / "run"
    network = train_relations([], engine, run, OPTIONS, progress=False)
    assert not network.training
    (file,) = run.glob("pictures-*")
    pictures = read_pool(file)
    assert len(pictures) == 5
    assert all(p.looks.shape[1:] == (49, CHANNELS) for p in pictures)
    noted = json.loads((run / "options.json").read_text(encoding="utf-8"))
    assert (noted["weights"], noted["photos"], noted["pictures"]) == (engine.digest, 0, 5)

    # Going on: the network is not asked again.
    with monkeypatch.context() as patched:
        patched.delattr(Engine, "run")
        longer = replace(OPTIONS, fit=replace(OPTIONS.fit, steps=4))
        train_relations([], engine, run, longer, progress=False)
    assert [row["step"] for row in columns(run)] == ["2", "4"]

    path = publish_relations([run], engine, engine.path.parent, {"license": "MIT"})
    used = Engine(engine.path, threads=1)
    assert used.relations is not None
    assert used.relations.path == path
    found = segment(np.full((96, 128, 3), 90, np.uint8), engine=used)
    assert all(0 <= s.confidence <= 1 for s in found)


def test_a_run_is_for_one_network(engine: Engine, tmp_path: Path) -> None:
    run = tmp_path / "run"
    train_relations([], engine, run, replace(OPTIONS, pictures=2), progress=False)
    before = {path.name: path.read_bytes() for path in run.iterdir()}
    another = engine_of(tmp_path, 1)
    for attempt in (
        lambda: train_relations([], another, run, OPTIONS, progress=False),
        lambda: publish_relations([run], another, tmp_path / "out", {}),
    ):
        with pytest.raises(InputError, match=f"{engine.digest}.*{another.digest}"):
            attempt()
    assert {path.name: path.read_bytes() for path in run.iterdir()} == before
    assert not (tmp_path / "out").exists()


def test_going_on_with_other_options(engine: Engine, tmp_path: Path) -> None:
    run = tmp_path / "run"
    begun = replace(OPTIONS, pictures=2)
    train_relations([], engine, run, begun, progress=False)
    before = {path.name: path.read_bytes() for path in run.iterdir()}
    for changed in (
        replace(begun, size=256),
        replace(begun, twins=0.9),
        replace(begun, seed=1),
        replace(begun, network=replace(HEAD, layers=1)),
    ):
        with pytest.raises(InputError, match="run"):
            train_relations([], engine, run, changed, progress=False)
        assert {path.name: path.read_bytes() for path in run.iterdir()} == before
    longer = replace(begun, pictures=4, fit=replace(OPTIONS.fit, steps=3))
    train_relations([], engine, run, longer, progress=False)
    assert max(len(read_pool(file)) for file in run.glob("pictures-*")) == 4


def test_a_network_has_one_head(engine: Engine, tmp_path: Path) -> None:
    folder = engine.path.parent
    first = export_relations([wild_head()], engine, folder, {"version": "1"})
    second = export_relations([wild_head()], engine, folder, {"version": "2"})
    assert first != second
    assert find_companion(engine.path) == second


def test_a_network_that_finds_nothing(
    engine: Engine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("fronto.train.shown.MOST_IN_VAIN", 3)
    monkeypatch.setattr("fronto.train.relations.collect.candidates", lambda *_: [])
    with pytest.raises(InputError, match=engine.path.name):
        train_relations([], engine, tmp_path / "run", OPTIONS, progress=False)


def test_figures_of_photos_with_the_head_in_training(engine: Engine, tmp_path: Path) -> None:
    run = tmp_path / "run"
    images = [photo(tmp_path)]
    options = replace(OPTIONS, pictures=2, renders=0.0)
    train_relations(images, engine, run, options, held_out=images, progress=False)
    assert {"val_precision", "val_recall", "val_f1"} <= set(columns(run)[0])
    assert engine.relations is None


def test_without_photos_there_are_only_renders(engine: Engine, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="photos"):
        train_relations([], engine, tmp_path / "run", replace(OPTIONS, renders=0.5), progress=False)
    wide = replace(OPTIONS, network=replace(HEAD, features=7))
    with pytest.raises(InputError, match="features"):
        train_relations([], engine, tmp_path / "run", wide, progress=False)
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("renders", 1.5),
        ("plates", -0.1),
        ("twins", 2),
        ("pictures", 0),
        ("pixels", 100),
        ("size", 100),
        ("size", 16),
    ],
)
def test_options_that_are_refused(name: str, value: float) -> None:
    with pytest.raises(InputError, match=name):
        replace(OPTIONS, **{name: value})
