"""An edge head from renders to a file beside its network's."""

from __future__ import annotations

import csv
import itertools
import json
import shutil
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")
for module in ("onnx", "onnxscript", "tqdm"):
    pytest.importorskip(module)

from click.testing import CliRunner
from PIL import Image

from fronto.cli import main
from fronto.engine import EdgeEngine, Engine, find_weights
from fronto.errors import InputError
from fronto.outlines.edgeprofiles import ABOUT, BINS, CHANNELS, CURVES, Curves
from fronto.shapes import Ellipse
from fronto.synth.photo import render_photo
from fronto.train.edges.collect import Shares, _to_ellipse, _to_quad, collect
from fronto.train.edges.export import export_edges
from fronto.train.edges.fit import (
    EdgeBatch,
    EdgeFit,
    _batches,
    _disturbed,
    _moved,
    edge_loss,
    fit_edges,
    load_edges,
)
from fronto.train.edges.network import EdgeNetwork, EdgeOptions
from fronto.train.edges.pool import EdgePool
from fronto.train.edges.run import EdgeTrainOptions, publish_edges, train_edges
from fronto.train.edges.validate import edge_figures
from fronto.train.pools import joined, read_pool, write_pool

SMALL = EdgeOptions(width=8, blocks=1)
OPTIONS = EdgeTrainOptions(
    pictures=2,
    fit=EdgeFit(steps=2, batch=8, warmup=1, save_every=2),
    network=SMALL,
)


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> Iterator[None]:
    """One thread, as several only wait for each other; small renders."""
    monkeypatch.setattr("fronto.train.edges.collect.SIZES", ((320, 240),))
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


@pytest.fixture
def engine(tmp_path: Path) -> Engine:
    """The packaged network with its mask head, alone in a folder."""
    packaged = find_weights()
    folder = tmp_path / "weights"
    folder.mkdir()
    for path in packaged.parent.glob(f"{packaged.stem}*.onnx"):
        if not any(f".{kind}-" in path.name for kind in ("edges", "relations", "verifier")):
            shutil.copy(path, folder)
    return Engine(folder / packaged.name, threads=1)


def pool(photos: int, each: int = 4, seed: int = 0) -> EdgePool:
    """The panel is dark and the button bright; the edge of a photo's buttons is at one place."""
    rng = np.random.default_rng(seed)
    n = photos * each
    offsets = np.repeat(rng.uniform(-0.7, 0.7, photos), each)[:, None]
    offsets = offsets + rng.normal(0, 0.02, (n, CURVES))
    places = (np.arange(BINS) + 0.5) / (BINS / 2) - 1
    bright = 60 + 120 * (places < offsets[..., None])
    profiles = np.repeat(bright[..., None], CHANNELS, axis=3) + rng.integers(0, 20, (n, 1, 1, 4))
    profiles[..., 3] = 5
    first = np.tile(np.arange(each) == 0, photos)
    return EdgePool(
        profiles.astype(np.uint8),
        rng.random((n, ABOUT), np.float32),
        np.full(n, 5, np.float32),
        offsets.astype(np.float32),
        first.astype(np.uint8),
    )


def columns(run: Path) -> list[dict[str, str]]:
    with (run / "metrics.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def refused(*arguments: object) -> str:
    result = CliRunner().invoke(main, [str(a) for a in arguments])
    assert result.exit_code == 2, result.output
    return result.output


class TestCollect:
    def test_true_edges_are_near_the_masks(self, engine: Engine) -> None:
        shares = Shares(0.1, 0.4)
        together = joined(list(itertools.islice(collect(engine, shares, seed=0), 4)))
        known = np.isfinite(together.offsets).all(axis=1)
        assert known.sum() >= 8
        assert np.median(np.abs(together.offsets[known])) < 0.5
        assert together.first.sum() == len(together.photos()) == 4
        assert (together.reaches >= 3).all()

    def test_photos_tell_which_edges_are_meant(self, engine: Engine, tmp_path: Path) -> None:
        photo = render_photo(np.random.default_rng(50_003), 640, 480)
        Image.fromarray(photo.image).save(tmp_path / "photo.png")
        found = next(collect(engine, Shares(0.0, 0.0, 1.0), [tmp_path / "photo.png"], seed=0))
        known = np.isfinite(found.offsets).all(axis=1)
        assert known.sum() >= 3
        assert np.median(np.abs(found.offsets[known])) < 0.6
        (tmp_path / "photo.png").write_bytes(b"none")
        with pytest.raises(InputError, match=r"photo\.png"):
            next(collect(engine, Shares(0.0, 0.0, 1.0), [tmp_path / "photo.png"], seed=0))

    def test_the_same_seed_gives_the_same(self, engine: Engine) -> None:
        first, again, other = (
            next(collect(engine, Shares(0.0, 0.0), seed=seed)) for seed in (1, 1, 2)
        )
        np.testing.assert_array_equal(first.profiles, again.profiles)
        assert first.profiles.shape != other.profiles.shape or (
            not np.array_equal(first.profiles, other.profiles)
        )

    def test_a_side_further_out(self) -> None:
        corners = np.array([[10, 10], [30, 10], [30, 40], [10, 40]], float)
        xy = np.zeros((8, 10, 2))
        normal = np.zeros((8, 10, 2))
        for k in range(8):
            a, b = corners[k // 2], corners[(k // 2 + 1) % 4]
            t = (np.linspace(0.1, 0.4, 10) + 0.5 * (k % 2))[:, None]
            xy[k] = a + t * (b - a)
            normal[k] = [(b - a)[1], -(b - a)[0]] / np.linalg.norm(b - a)
        true = corners + np.array([[-1, -2], [3, -2], [3, 4], [-1, 4]])
        for turn in range(4):
            away = _to_quad(Curves(xy, normal, np.array(5.0)), corners, np.roll(true, turn, axis=0))
            np.testing.assert_allclose(away, [2, 2, 3, 3, 4, 4, 1, 1])

    def test_a_larger_ellipse(self) -> None:
        t = 2 * np.pi * (np.arange(80) + 0.5) / 80
        normal = np.stack([np.cos(t), np.sin(t)], axis=1).reshape(8, 10, 2)
        curves = Curves(20 * normal + 50, normal, np.array(5.0))
        np.testing.assert_allclose(_to_ellipse(curves, Ellipse(50, 50, 23, 23, 0)), 3)
        elsewhere = _to_ellipse(curves, Ellipse(500, 50, 23, 23, 0))
        assert np.isnan(elsewhere).any()


class TestPool:
    def test_files(self, tmp_path: Path) -> None:
        path = tmp_path / "patches.npz"
        write_pool(path, pool(3))
        np.testing.assert_array_equal(read_pool(path, EdgePool).offsets, pool(3).offsets)
        path.write_bytes(b"none")
        with pytest.raises(InputError, match=r"patches\.npz"):
            read_pool(path, EdgePool)

    @pytest.mark.parametrize("name", ["profiles", "about", "reaches", "offsets", "first"])
    def test_other_types_and_shapes(self, name: str) -> None:
        fine = pool(2)
        with pytest.raises(InputError, match=name):
            replace(fine, **{name: getattr(fine, name).astype(np.int32)})
        with pytest.raises(InputError):
            replace(fine, **{name: getattr(fine, name)[:3]})

    def test_photos(self) -> None:
        assert [rows.tolist() for rows in pool(2, each=3).photos()] == [[0, 1, 2], [3, 4, 5]]
        cut = EdgePool(*(getattr(pool(2, each=3), f)[1:] for f in EdgePool.__annotations__))
        assert [len(rows) for rows in cut.photos()] == [2, 3]


class TestNetwork:
    def test_outlines_of_other_photos_do_not_matter(self) -> None:
        torch.manual_seed(0)
        network = EdgeNetwork(SMALL).eval()
        profiles, about = torch.rand(5, CURVES, BINS, CHANNELS), torch.rand(5, ABOUT)
        together = network(profiles, about, torch.tensor([0, 0, 1, 1, 1]))
        torch.testing.assert_close(together[:2], network(profiles[:2], about[:2]))
        torch.testing.assert_close(together[2:], network(profiles[2:], about[2:]))
        assert not torch.allclose(together[:2], network(profiles, about)[:2])

    def test_light_says_nothing(self) -> None:
        torch.manual_seed(0)
        network = EdgeNetwork(SMALL).eval()
        profiles, about = torch.rand(2, CURVES, BINS, CHANNELS), torch.rand(2, ABOUT)
        brighter = profiles.clone()
        brighter[..., :3] += 0.3
        torch.testing.assert_close(network(brighter, about), network(profiles, about))

    @pytest.mark.parametrize("name", ["width", "blocks"])
    def test_options_that_are_refused(self, name: str) -> None:
        with pytest.raises(InputError, match=name):
            replace(SMALL, **{name: 0})


class TestFit:
    def test_cells_of_other_sizes(self) -> None:
        network = EdgeNetwork(EdgeOptions(width=8, blocks=1, cell=8)).eval()
        profiles, about = torch.rand(3, CURVES, BINS, CHANNELS), torch.rand(3, ABOUT)
        assert network(profiles, about).shape == (3, CURVES, BINS)
        for cell in (0, 7, 128):
            with pytest.raises(InputError, match="cell"):
                EdgeOptions(cell=cell)

    def test_profiles_and_places_move_together(self) -> None:
        plain = torch.from_numpy(pool(2).profiles).float()
        zoom, shift = torch.tensor([1.25] * 8), torch.tensor([0.1] * 8)
        moved = _moved(plain, zoom, shift)
        step = (plain[..., :-1, 0] - plain[..., 1:, 0]).argmax(dim=-1)
        after = (moved[..., :-1, 0] - moved[..., 1:, 0]).argmax(dim=-1)
        place = (step + 1) / (BINS / 2) - 1
        wanted = (place - 0.1) * 1.25
        inside = wanted.abs() < 0.9
        assert inside.any()
        off = ((after + 1) / (BINS / 2) - 1 - wanted)[inside]
        assert off.abs().max() < 2.5 / (BINS / 2)
        torch.testing.assert_close(_moved(plain, torch.ones(8), torch.zeros(8)), plain)

    def test_disturbed(self) -> None:
        torch.manual_seed(0)
        plain = torch.from_numpy(pool(4).profiles).float() / 255
        first, second = _disturbed(plain), _disturbed(plain)
        assert first.shape == plain.shape
        assert torch.isfinite(first).all()
        assert not torch.equal(first, second)
        torch.testing.assert_close(first[..., 3], plain[..., 3])

    def test_batches_keep_photos_together(self) -> None:
        batch = next(_batches(pool(20), 32, 0))
        assert len(batch.profiles) >= 32
        assert (batch.photo.diff() >= 0).all()
        assert batch.photo[0] == 0

    def test_the_loss(self) -> None:
        offsets = torch.full((2, CURVES), 0.25)
        offsets[1] = torch.nan
        empty = torch.zeros(2, 1)
        batch = EdgeBatch(empty, empty, empty, torch.full((2,), 5.0), offsets)
        places = (torch.arange(BINS) + 0.5) / (BINS / 2) - 1
        right = (-0.5 * ((places - 0.25) / 0.04) ** 2).expand(2, CURVES, BINS)
        wrong = right.flip(-1)
        assert edge_loss(right, batch) < edge_loss(torch.zeros_like(right), batch)
        assert edge_loss(wrong, batch) > edge_loss(torch.zeros_like(right), batch)
        unknown = batch._replace(offsets=torch.full((2, CURVES), torch.nan))
        assert edge_loss(wrong, unknown) == 0

    def test_it_learns(self, tmp_path: Path) -> None:
        torch.manual_seed(0)
        options = EdgeFit(steps=60, batch=32, rate=0.01, warmup=4, average=0.8, save_every=60)
        told = fit_edges(EdgeNetwork(SMALL), pool(60), tmp_path, options, progress=False)
        figures = edge_figures(told, pool(20, seed=1))
        assert figures["off_px"] < 0.3 < figures["mask_off_px"]
        assert figures["missed"] < 0.2
        network = load_edges(tmp_path / "last.pt")
        assert edge_figures(network, pool(20, seed=1)) == figures

    def test_figures_of_nothing_known(self) -> None:
        fine = pool(2)
        unknown = replace(fine, offsets=np.full_like(fine.offsets, np.nan))
        assert np.isnan(list(edge_figures(EdgeNetwork(SMALL).eval(), unknown).values())).all()


class TestRun:
    def test_from_renders_to_a_file(
        self, engine: Engine, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        monkeypatch.setattr("fronto.train.edges.run.HELD_OUT", 0.3)
        run = tmp_path / "run"
        network = train_edges(engine, run, OPTIONS, progress=False)
        assert not network.training
        noted = json.loads((run / "options.json").read_text(encoding="utf-8"))
        assert (noted["weights"], noted["pictures"]) == (engine.digest, 2)
        assert {"off_px", "mask_off_px", "missed"} <= set(columns(run)[0])

        # Going on: the network is not asked again.
        with monkeypatch.context() as patched:
            patched.delattr(Engine, "run")
            longer = replace(OPTIONS, fit=replace(OPTIONS.fit, steps=4))
            train_edges(engine, run, longer, progress=False)
        assert [row["step"] for row in columns(run)] == ["2", "4"]

        path = publish_edges([run], engine, engine.path.parent, {"license": "MIT"})
        used = Engine(engine.path, threads=1).edges
        assert used is not None
        assert used.path == path
        assert used.metadata["license"] == "MIT"
        assert used.metadata["version"] == noted["fronto"]

        with pytest.raises(InputError, match="relief"):
            train_edges(engine, run, replace(OPTIONS, relief=0.9), progress=False)
        with pytest.raises(InputError, match="files"):
            train_edges(engine, run, OPTIONS, photos=[tmp_path / "a.jpg"], progress=False)
        with pytest.raises(InputError, match="run"):
            train_edges(engine, run, replace(OPTIONS, network=EdgeOptions()), progress=False)
        monkeypatch.setattr(engine, "digest", "01234567")
        for attempt in (
            lambda: train_edges(engine, run, OPTIONS, progress=False),
            lambda: publish_edges([run], engine, tmp_path / "out", {}),
        ):
            with pytest.raises(InputError, match="weights"):
                attempt()
        assert not (tmp_path / "out").exists()

    def test_the_file_gives_the_mean_of_several(self, engine: Engine) -> None:
        rng = np.random.default_rng(0)
        profiles = (255 * rng.random((5, CURVES, BINS, CHANNELS))).astype(np.float32)
        about = rng.random((5, ABOUT)).astype(np.float32)
        networks, told = [], []
        for seed in range(2):
            torch.manual_seed(seed)
            network = EdgeNetwork(SMALL).eval()
            networks.append(network)
            with torch.no_grad():
                given = torch.from_numpy(profiles) / 255, torch.from_numpy(about)
                told.append(network(*given).softmax(dim=-1).numpy())
        old = engine.path.parent / f"{engine.path.stem}.edges-01234567.onnx"
        old.write_bytes(b"an older one")
        path = export_edges(networks, engine, engine.path.parent, {"version": "7"})
        assert not old.exists()
        found = EdgeEngine(path, network=engine.digest).run(profiles, about)
        assert np.abs(told[0] - told[1]).max() > 1e-4
        np.testing.assert_allclose(found, (told[0] + told[1]) / 2, atol=1e-4)

    def test_a_network_without_a_mask_head(self, engine: Engine, tmp_path: Path) -> None:
        engine.masks = None
        with pytest.raises(InputError, match="mask head"):
            train_edges(engine, tmp_path / "run", OPTIONS, progress=False)
        assert not (tmp_path / "run").exists()

    @pytest.mark.parametrize(
        ("name", "value"), [("twins", -0.1), ("relief", 2), ("photos", 1.5), ("pictures", 0)]
    )
    def test_options_that_are_refused(self, name: str, value: float) -> None:
        with pytest.raises(InputError, match=name):
            replace(OPTIONS, **{name: value})


class TestCommand:
    def test_it_trains_and_writes(self, engine: Engine, tmp_path: Path) -> None:
        run = tmp_path / "run"
        arguments = ["edges", "--weights", engine.path, "-o", run, "--pictures", 2]
        arguments += ["--steps", 1, "--batch", 8, "--license", "MIT", "-q"]
        result = CliRunner().invoke(main, [str(a) for a in arguments])
        assert result.exit_code == 0, result.output
        assert result.output == ""
        used = Engine(engine.path, threads=1).edges
        assert used is not None
        assert used.metadata["license"] == "MIT"

    def test_refusals(self, engine: Engine, tmp_path: Path) -> None:
        out = ["-o", tmp_path / "run"]
        assert "--weights" in refused("edges", *out)
        assert "none.onnx" in refused("edges", *out, "--weights", tmp_path / "none.onnx")
        assert "no photos" in refused(
            "edges", tmp_path / "no photos", *out, "--weights", engine.path
        )
        assert "--steps" in refused("edges", *out, "--weights", engine.path, "--steps", 0)
        assert not (tmp_path / "run").exists()
