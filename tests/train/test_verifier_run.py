"""A verifier from labelled pictures to a file beside its network's."""

from __future__ import annotations

import csv
import itertools
import json
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")
for module in ("onnx", "onnxscript", "kornia", "tqdm"):
    pytest.importorskip(module)

from click.testing import CliRunner
from PIL import Image

from fronto.categories import CATEGORIES
from fronto.cli import main
from fronto.datasets.records import LabeledImage, LabeledObject
from fronto.engine import Engine, VerifierEngine
from fronto.errors import InputError
from fronto.segmentation import finds_in, segment
from fronto.train.network import Network, NetworkOptions
from fronto.train.pools import joined, read_pool, write_pool
from fronto.train.shown import ShownOptions
from fronto.train.start import _layers
from fronto.train.verifier.collect import collect
from fronto.train.verifier.export import export_verifier
from fronto.train.verifier.fit import (
    VerifierBatch,
    VerifierFit,
    _batches,
    _disturbed,
    fit_verifier,
    verifier_losses,
)
from fronto.train.verifier.network import Told, VerifierNetwork, VerifierOptions
from fronto.train.verifier.pool import WIDER_SIDE, VerifierPool
from fronto.train.verifier.run import VerifierTrainOptions, publish_verifier, train_verifier
from fronto.train.verifier.validate import verifier_figures
from fronto.verification import SIDE
from onnxfiles import finder

CHANNELS = 5
SMALL = VerifierOptions(blocks=11, channels=8)
OPTIONS = VerifierTrainOptions(
    pictures=3,
    renders=0.0,
    size=96,
    pixels=4096,
    fit=VerifierFit(steps=2, batch=4, warmup=1, save_every=2),
    network=SMALL,
)


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """One thread, as several only wait for each other; test networks are no checkpoints."""
    monkeypatch.setattr("fronto.train.export.load_onnx", lambda _: Network(NetworkOptions()))
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


def engine_of(folder: Path, seed: int) -> Engine:
    path = folder / "weights" / f"network-{seed}.onnx"
    path.parent.mkdir(exist_ok=True)
    path.write_bytes(finder(CHANNELS, seed=seed))
    return Engine(path, threads=1)


@pytest.fixture
def engine(tmp_path: Path) -> Engine:
    return engine_of(tmp_path, 0)


def noise(seed: int = 0) -> np.ndarray:
    return np.random.default_rng(seed).integers(0, 256, (96, 128, 3), dtype=np.uint8)


@pytest.fixture
def photos(tmp_path: Path, engine: Engine) -> list[LabeledImage]:
    """Noise, in which some of what the network takes for buttons is labelled so."""
    path = tmp_path / "photo.png"
    Image.fromarray(noise()).save(path)
    finds, _ = finds_in(engine, noise(), 0.3)
    names = ("up", "plate", "unknown")
    objects = [
        LabeledObject(names[k % 3], tuple(find.box.tolist()), None, "x")
        for k, find in enumerate(finds[:9])
    ]
    return [LabeledImage(path, 128, 96, tuple(objects))]


def pool(n: int, seed: int = 0) -> VerifierPool:
    """Buttons are bright, plates are bright above, nothing is dark; up is red, down is green."""
    rng = np.random.default_rng(seed)
    kinds = rng.integers(0, 3, n).astype(np.uint8)
    classes = rng.integers(1, 3, n).astype(np.uint8)
    patches = rng.integers(0, 60, (n, WIDER_SIDE, WIDER_SIDE, 3))
    for k, kind in enumerate(kinds):
        if kind:
            patches[k, : WIDER_SIDE // int(kind), :, classes[k] - 1] += 150
    classes[kinds == 0] = VerifierPool.UNKNOWN
    classes[kinds == 2] = CATEGORIES.index("plate")
    return VerifierPool(patches.astype(np.uint8), kinds, classes)


def columns(run: Path) -> list[dict[str, str]]:
    with (run / "metrics.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def refused(*arguments: object) -> str:
    result = CliRunner().invoke(main, [str(a) for a in arguments])
    assert result.exit_code == 2, result.output
    return result.output


class TestCollect:
    def test_what_is_found_is_what_the_labels_say(
        self, engine: Engine, photos: list[LabeledImage]
    ) -> None:
        sources = ShownOptions(renders=0.0, plates=0.0, pixels=96 * 128).sources(photos)
        pools = list(itertools.islice(collect(engine, sources, size=96, seed=0), 12))
        together = joined(pools)
        assert set(together.kinds.tolist()) == {0, 1, 2}
        assert together.patches.shape[1:] == (WIDER_SIDE, WIDER_SIDE, 3)
        plate, up = CATEGORIES.index("plate"), CATEGORIES.index("up")
        assert set(together.classes[together.kinds == 0].tolist()) == {VerifierPool.UNKNOWN}
        assert set(together.classes[together.kinds == 2].tolist()) == {plate}
        assert set(together.classes[together.kinds == 1].tolist()) == {up, VerifierPool.UNKNOWN}

    def test_the_same_seed_gives_the_same(self, engine: Engine, photos: list[LabeledImage]) -> None:
        sources = ShownOptions(renders=0.0, plates=0.0, pixels=96 * 128).sources(photos)
        first, again, other = (
            next(collect(engine, sources, size=96, seed=seed)) for seed in (1, 1, 2)
        )
        np.testing.assert_array_equal(first.patches, again.patches)
        assert not np.array_equal(first.patches, other.patches)

    def test_files(self, tmp_path: Path) -> None:
        path = tmp_path / "patches.npz"
        write_pool(path, pool(5))
        np.testing.assert_array_equal(read_pool(path, VerifierPool).patches, pool(5).patches)
        path.write_bytes(b"none")
        with pytest.raises(InputError, match=r"patches\.npz"):
            read_pool(path, VerifierPool)

    @pytest.mark.parametrize("name", ["patches", "kinds", "classes"])
    def test_pools_of_other_shapes(self, name: str) -> None:
        fine = pool(4)
        with pytest.raises(InputError, match=name):
            replace(fine, **{name: getattr(fine, name).astype(np.int32)})
        with pytest.raises(InputError):
            replace(fine, **{name: getattr(fine, name)[:3]})


class TestNetwork:
    def test_it_starts_from_a_networks_backbone(self) -> None:
        torch.manual_seed(0)
        trained, started = Network(NetworkOptions()), VerifierNetwork(SMALL)
        started.start_from(trained.backbone)
        image = torch.rand(1, 3, SIDE, SIDE)
        with torch.no_grad():
            fine, low, *_ = started.eval().backbone(image)
            expected_fine, expected_low, *_ = trained.eval().backbone(image)
        torch.testing.assert_close(fine, expected_fine)
        torch.testing.assert_close(low, expected_low)

    def test_it_starts_later_blocks_from_another(self) -> None:
        torch.manual_seed(0)
        own, other = Network(NetworkOptions()), Network(NetworkOptions())
        started = VerifierNetwork(SMALL)
        started.start_from(own.backbone)
        started.start_from(other.backbone, first=3)
        for part in ("stem", "blocks.2"):
            ours = started.backbone.get_submodule(part).state_dict()
            theirs = own.backbone.get_submodule(part).state_dict()
            assert all(torch.equal(ours[k], theirs[k]) for k in ours)
        weight = "depthwise.0.weight"
        for k in (3, 10):
            ours = started.backbone.blocks[k].state_dict()[weight]
            assert torch.equal(ours, other.backbone.blocks[k].state_dict()[weight])
            assert not torch.equal(ours, own.backbone.blocks[k].state_dict()[weight])

    def test_what_is_frozen_stays(self, tmp_path: Path) -> None:
        torch.manual_seed(0)
        network = VerifierNetwork(replace(SMALL, frozen=2))
        before = {name: value.clone() for name, value in network.state_dict().items()}
        fit_verifier(network, pool(8), tmp_path, OPTIONS.fit, progress=False)
        after = network.state_dict()
        frozen = ("backbone.stem.", "backbone.blocks.0.", "backbone.blocks.1.")
        for name, value in before.items():
            if name.startswith(frozen):
                torch.testing.assert_close(after[name], value)
        moved = [n for n, v in before.items() if not torch.equal(after[n], v)]
        assert any(n.startswith("backbone.blocks.2.") for n in moved)

    @pytest.mark.parametrize(
        ("name", "value"),
        [("blocks", 10), ("blocks", 18), ("channels", 0), ("frozen", 12), ("dropout", 1.0)],
    )
    def test_options_that_are_refused(self, name: str, value: float) -> None:
        with pytest.raises(InputError, match=name):
            replace(SMALL, **{name: value})


class TestFit:
    def test_patches_are_cut_out_anew_and_stay_in_range(self) -> None:
        torch.manual_seed(0)
        wider = torch.from_numpy(pool(64).patches)
        first, second = _disturbed(wider), _disturbed(wider)
        assert first.shape == (64, 3, SIDE, SIDE)
        assert first.min() >= 0
        assert first.max() <= 1
        assert not torch.equal(first, second)
        # Not so much that bright and dark ones cannot be told apart.
        bright = pool(64).kinds == 1
        means = first.mean(dim=(1, 2, 3)).numpy()
        assert means[bright].mean() > means[pool(64).kinds == 0].mean() + 0.1

    def test_a_batch_knows_what_is_not_known(self) -> None:
        batch = next(_batches(pool(32), 32, 0))
        assert (batch.kinds >= 0).all()
        assert (batch.classes[batch.kinds == 0] == -1).all()
        assert (batch.classes[batch.kinds > 0] > 0).all()

    def test_losses(self) -> None:
        kinds = torch.tensor([0, 1, 2])
        classes = torch.tensor([-1, 3, 10])
        batch = VerifierBatch(torch.zeros(3, 3, SIDE, SIDE), kinds, classes)
        right = Told(20 * torch.eye(3), 20 * torch.eye(len(CATEGORIES))[torch.tensor([0, 3, 10])])
        wrong = Told(right.kinds.roll(1, 0), right.classes.roll(1, 0))
        assert verifier_losses(right, batch).total < 1 < verifier_losses(wrong, batch).total
        unknown = VerifierBatch(batch.patches, kinds, torch.full((3,), -1))
        assert verifier_losses(wrong, unknown).classes == 0

    def test_it_learns(self, tmp_path: Path) -> None:
        torch.manual_seed(0)
        options = VerifierFit(steps=40, batch=16, rate=0.01, warmup=4, average=0.8, save_every=40)
        network = VerifierNetwork(replace(SMALL, frozen=0, dropout=0.0))
        told = fit_verifier(network, pool(200), tmp_path, options, progress=False)
        figures = verifier_figures(told, pool(60, seed=1))
        assert figures["kinds_right"] > 0.9
        assert 0 <= figures["named_right"] <= 1
        assert 0 <= figures["plates_right"] <= 1


class TestRun:
    def test_from_photos_to_a_file(
        self,
        engine: Engine,
        photos: list[LabeledImage],
        tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        monkeypatch.setattr("fronto.train.verifier.run.HELD_OUT", 0.3)
        run = tmp_path / "run"
        network = train_verifier(photos, engine, run, OPTIONS, progress=False)
        assert not network.training
        noted = json.loads((run / "options.json").read_text(encoding="utf-8"))
        assert (noted["weights"], noted["photos"], noted["pictures"]) == (engine.digest, 1, 3)
        assert {"kinds_right", "plates_right", "named_right"} <= set(columns(run)[0])

        # Going on: the network is not asked again.
        with monkeypatch.context() as patched:
            patched.delattr(Engine, "run")
            longer = replace(OPTIONS, fit=replace(OPTIONS.fit, steps=4))
            train_verifier(photos, engine, run, longer, progress=False)
        assert [row["step"] for row in columns(run)] == ["2", "4"]

        path = publish_verifier([run], engine, engine.path.parent, {"license": "MIT"})
        used = Engine(engine.path, threads=1)
        assert used.verifier is not None
        assert used.verifier.path == path
        assert used.verifier.metadata["license"] == "MIT"
        assert used.verifier.metadata["version"] == noted["fronto"]
        found = segment(noise(), engine=used, min_confidence=0.01)
        assert len(found) > 0

    def test_the_file_gives_the_mean_of_several(self, engine: Engine) -> None:
        networks, told = [], []
        given = np.random.default_rng(0).integers(0, 256, (5, SIDE, SIDE, 3), dtype=np.uint8)
        for seed in range(2):
            torch.manual_seed(seed)
            network = VerifierNetwork(SMALL)
            with torch.no_grad():
                for _ in range(20):
                    network(torch.rand(8, 3, SIDE, SIDE))
                networks.append(network.eval())
                told.append(network(torch.from_numpy(given).permute(0, 3, 1, 2) / 255))
        old = engine.path.parent / f"{engine.path.stem}.verifier-01234567.onnx"
        old.write_bytes(b"an older one")
        path = export_verifier(networks, engine, engine.path.parent, {"version": "7"})
        assert not old.exists()
        used = VerifierEngine(path, network=engine.digest, classes=11)
        assert used.metadata["version"] == "7"
        found = used.run(given)
        for ours, theirs in (
            (found.kinds, [t.kinds.softmax(1).numpy() for t in told]),
            (found.classes, [t.classes.softmax(1).numpy() for t in told]),
        ):
            assert np.abs(theirs[0] - theirs[1]).max() > 1e-3
            np.testing.assert_allclose(ours, (theirs[0] + theirs[1]) / 2, atol=1e-4)

    def test_a_run_goes_on_from_the_weights_that_it_started_from(
        self, engine: Engine, photos: list[LabeledImage], tmp_path: Path
    ) -> None:
        run, start = tmp_path / "run", tmp_path / "start.npz"
        arrays = {}
        network = Network(NetworkOptions())
        state = network.state_dict()
        for module, convolution, normalization in _layers(network):
            parts = ("weight", "bias", "running_mean", "running_var")
            names = ("gamma", "beta", "moving_mean", "moving_variance")
            arrays[f"{convolution}.weight"] = state[f"{module}.0.weight"].numpy()
            for ours, theirs in zip(parts, names, strict=True):
                arrays[f"{normalization}.{theirs}"] = state[f"{module}.1.{ours}"].numpy()
        np.savez(start, **arrays)
        told = train_verifier(photos, engine, run, OPTIONS, start=start, progress=False)
        with pytest.raises(InputError, match="start"):
            train_verifier(photos, engine, run, OPTIONS, progress=False)
        # The same again, collected before or not.
        (run / "last.pt").unlink()
        again = train_verifier(photos, engine, run, OPTIONS, start=start, progress=False)
        for name, value in told.state_dict().items():
            torch.testing.assert_close(again.state_dict()[name], value)

    def test_a_run_is_for_one_network(
        self, engine: Engine, photos: list[LabeledImage], tmp_path: Path
    ) -> None:
        run = tmp_path / "run"
        train_verifier(photos, engine, run, OPTIONS, progress=False)
        another = engine_of(tmp_path, 1)
        for attempt in (
            lambda: train_verifier(photos, another, run, OPTIONS, progress=False),
            lambda: publish_verifier([run], another, tmp_path / "out", {}),
            lambda: train_verifier(
                photos, engine, run, replace(OPTIONS, plates=0.9), progress=False
            ),
            lambda: train_verifier(
                photos, engine, run, replace(OPTIONS, network=VerifierOptions()), progress=False
            ),
        ):
            with pytest.raises(InputError, match="run"):
                attempt()
        assert not (tmp_path / "out").exists()

    def test_without_photos_there_are_only_renders(self, engine: Engine, tmp_path: Path) -> None:
        with pytest.raises(InputError, match="photos"):
            train_verifier([], engine, tmp_path / "run", OPTIONS, progress=False)
        assert not (tmp_path / "run").exists()

    def test_a_network_that_finds_nothing(
        self,
        engine: Engine,
        photos: list[LabeledImage],
        tmp_path: Path,
        monkeypatch: pytest.MonkeyPatch,
    ) -> None:
        monkeypatch.setattr("fronto.train.shown.MOST_IN_VAIN", 3)
        monkeypatch.setattr("fronto.train.verifier.collect.group", lambda *_, **__: [])
        with pytest.raises(InputError, match=engine.path.name):
            train_verifier(photos, engine, tmp_path / "run", OPTIONS, progress=False)

    @pytest.mark.parametrize(
        ("name", "value"),
        [
            ("renders", 1.5),
            ("twins", -0.1),
            ("relief", 2),
            ("plates", -1),
            ("pictures", 0),
            ("pixels", 10),
            ("size", 100),
            ("size", 48),
        ],
    )
    def test_options_that_are_refused(self, name: str, value: float) -> None:
        with pytest.raises(InputError, match=name):
            replace(OPTIONS, **{name: value})


class TestCommand:
    def test_renders_only(
        self, engine: Engine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        from fronto.synth.photo import render_photo

        monkeypatch.setattr(
            "fronto.synth.photo.render_photo",
            lambda rng, **options: render_photo(rng, 160, 120, **options),
        )
        run = tmp_path / "run"
        arguments = ["verifier", "--weights", engine.path, "-o", run, "--pictures", 2]
        arguments += ["--steps", 1, "--batch", 4, "--license", "MIT", "-q"]
        result = CliRunner().invoke(main, [str(a) for a in arguments])
        assert result.exit_code == 0, result.output
        assert result.output == ""
        used = Engine(engine.path, threads=1).verifier
        assert used is not None
        assert used.metadata["license"] == "MIT"
        noted = json.loads((run / "options.json").read_text(encoding="utf-8"))
        assert noted["renders"] == 1

    def test_refusals(self, engine: Engine, tmp_path: Path) -> None:
        out = ["-o", tmp_path / "run"]
        assert "--weights" in refused("verifier", *out)
        weights = ["--weights", engine.path]
        assert "no data" in refused("verifier", tmp_path / "no data", *out, *weights)
        assert "DATA" in refused("verifier", *out, *weights, "--renders", 0.5)
        missing = refused("verifier", *out, *weights, "--start", tmp_path / "none.npz")
        assert "none.npz" in missing
        assert "none.onnx" in refused("verifier", *out, "--weights", tmp_path / "none.onnx")
        assert not (tmp_path / "run").exists()
