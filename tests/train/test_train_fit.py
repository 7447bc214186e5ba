"""The training loop: what a run leaves behind, and going on with it."""

from __future__ import annotations

import csv
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")
for module in ("kornia", "tensorboard", "tqdm"):
    pytest.importorskip(module)

from fronto.errors import InputError
from fronto.train.data import Renders, Sample
from fronto.train.fit import FitOptions, fit, load_checkpoint
from fronto.train.network import Network, NetworkOptions
from fronto.train.targets import Target

SMALL = NetworkOptions(channels=4, decoder=4)
OPTIONS = FitOptions(steps=3, batch=2, size=64, warmup=1, workers=0, save_every=2)


class Squares:
    """A source that costs nothing."""

    def draw(self, rng: np.random.Generator) -> Sample:
        image = rng.integers(0, 256, (96, 96, 3), dtype=np.uint8)
        square = np.array([[20, 20], [60, 20], [60, 60], [20, 60.0]])
        return Sample(image, (Target("number", square, True),))


SOURCES = [(Squares(), 1.0)]


def rows(run: Path) -> list[dict[str, str]]:
    with (run / "metrics.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def step_of(run: Path) -> int:
    return int(torch.load(run / "last.pt", weights_only=True)["step"])


def test_a_run_and_going_on(tmp_path: Path) -> None:
    run = tmp_path / "run"
    seen = []

    def validate(network: Network) -> dict[str, float]:
        assert not network.training
        seen.append(network)
        return {"val_f1": 0.25}

    torch.manual_seed(0)
    network = fit(Network(SMALL), SOURCES, run, OPTIONS, validate=validate, progress=False)
    assert not network.training
    assert [row["step"] for row in rows(run)] == ["2", "3"]
    assert all(float(row["val_f1"]) == 0.25 for row in rows(run))
    for name in ("classes", "masks", "centers", "sides", "rate"):
        assert all(float(row[name]) > 0 for row in rows(run))
    assert len(seen) == 2
    assert step_of(run) == 3
    assert any(path.name.startswith("events.") for path in run.iterdir())

    # The averaged weights are what is given back, and what the checkpoint keeps.
    kept = load_checkpoint(run / "last.pt")
    assert kept.options == SMALL
    for a, b in zip(network.state_dict().values(), kept.state_dict().values(), strict=True):
        assert torch.equal(a, b)

    # Done is done.
    again = fit(Network(SMALL), SOURCES, run, OPTIONS, validate=validate, progress=False)
    assert step_of(run) == 3
    assert len(rows(run)) == 2
    for a, b in zip(network.state_dict().values(), again.state_dict().values(), strict=True):
        assert torch.equal(a, b)

    # More steps go on from there.
    longer = replace(OPTIONS, steps=5)
    further = fit(Network(SMALL), SOURCES, run, longer, validate=validate, progress=False)
    assert step_of(run) == 5
    assert [row["step"] for row in rows(run)] == ["2", "3", "4", "5"]
    weights = [net.state_dict()["classes.weight"] for net in (network, further)]
    assert not torch.equal(*weights)


def test_the_columns_of_a_run_stay(tmp_path: Path) -> None:
    steps = (replace(OPTIONS, steps=1), replace(OPTIONS, steps=2), replace(OPTIONS, steps=3))
    network = Network(SMALL)
    fit(network, SOURCES, tmp_path, steps[0], validate=lambda _: {"val_f1": 1.0}, progress=False)
    fit(network, SOURCES, tmp_path, steps[1], progress=False)
    fit(network, SOURCES, tmp_path, steps[2], validate=lambda _: {"new": 2.0}, progress=False)
    assert [row["val_f1"] for row in rows(tmp_path)] == ["1", "nan", "nan"]
    assert all(None not in row and float(row["masks"]) > 0 for row in rows(tmp_path))


def test_a_step_on_renders_and_figures_that_nobody_watches(tmp_path: Path) -> None:
    options = replace(OPTIONS, steps=1)
    fit(Network(SMALL), [(Renders(), 1.0)], tmp_path, options, progress=False)
    assert [row["step"] for row in rows(tmp_path)] == ["1"]


def test_a_killed_run_has_its_last_checkpoint(tmp_path: Path) -> None:
    class Dying(Squares):
        left = 2 * 2 + 1  # two batches of two, and a half

        def draw(self, rng: np.random.Generator) -> Sample:
            if self.left == 0:
                raise KeyboardInterrupt
            self.left -= 1
            return super().draw(rng)

    with pytest.raises(KeyboardInterrupt):
        fit(Network(SMALL), [(Dying(), 1.0)], tmp_path, OPTIONS, progress=False)
    assert step_of(tmp_path) == 2
    assert not list(tmp_path.glob("*.part"))
    fit(Network(SMALL), SOURCES, tmp_path, OPTIONS, progress=False)
    assert step_of(tmp_path) == 3
    assert [row["step"] for row in rows(tmp_path)] == ["2", "3"]


def test_a_run_of_another_network_is_refused(tmp_path: Path) -> None:
    fit(Network(SMALL), SOURCES, tmp_path, replace(OPTIONS, steps=1), progress=False)
    other = Network(NetworkOptions(channels=6, decoder=4))
    with pytest.raises(InputError, match="channels"):
        fit(other, SOURCES, tmp_path, OPTIONS, progress=False)
    assert step_of(tmp_path) == 1


@pytest.mark.parametrize("content", [None, b"", b"no checkpoint", b"PK\x03\x04 half a file"])
def test_a_file_that_is_no_checkpoint(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "last.pt"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=r"last\.pt"):
        load_checkpoint(path)


def test_a_checkpoint_of_something_else(tmp_path: Path) -> None:
    torch.save({"weights": torch.zeros(3)}, tmp_path / "other.pt")
    with pytest.raises(InputError, match=r"other\.pt"):
        load_checkpoint(tmp_path / "other.pt")


def test_frozen_parts_stay_as_they_are(tmp_path: Path) -> None:
    torch.manual_seed(0)
    network = Network(SMALL)
    before = {name: value.clone() for name, value in network.state_dict().items()}
    trained = fit(network, SOURCES, tmp_path, replace(OPTIONS, frozen=3, rate=1e-2), progress=False)
    changed = {
        name for name, value in trained.state_dict().items() if not torch.equal(value, before[name])
    }
    frozen = ("backbone.stem.", *(f"backbone.blocks.{k}." for k in range(3)))
    assert not any(name.startswith(frozen) for name in changed)
    assert any(name.startswith("backbone.blocks.3.") for name in changed)
    assert "classes.weight" in changed
