"""The reader's network and its training loop."""

from __future__ import annotations

import csv
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("tqdm")

from fronto.errors import InputError
from fronto.labels.alphabet import ALPHABET, KINDS, STEPS
from fronto.labels.targets import ReadTarget
from fronto.train.reader.data import collated
from fronto.train.reader.fit import (
    ReaderFit,
    fit_reader,
    load_reader,
    network_input,
    reader_losses,
    text_losses,
)
from fronto.train.reader.jitter import Sample
from fronto.train.reader.network import ReaderNetwork, ReaderOptions

SMALL = ReaderOptions(stem=4, stages=(4, 6, 8), kinds=4)
OPTIONS = ReaderFit(steps=3, batch=4, warmup=1, workers=0, save_every=2)


class Bars:
    """A bar across is "-", one from top to bottom "1", none "blank"."""

    def draw(self, rng: np.random.Generator) -> Sample:
        image = np.full((30, 30, 3), 220, np.uint8)
        choice = int(rng.integers(3))
        if choice == 0:
            image[13:17, 6:24] = 20
        elif choice == 1:
            image[6:24, 13:17] = 20
        target = (ReadTarget("text", "-"), ReadTarget("text", "1"), ReadTarget("blank"))[choice]
        return Sample(image, (3.0, 3.0, 27.0, 27.0), target)


SOURCES = [(Bars(), 1.0)]


def rows(run: Path) -> list[dict[str, str]]:
    with (run / "metrics.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_what_comes_out() -> None:
    network = ReaderNetwork(SMALL).eval()
    readings = network(torch.rand(3, 3, 48, 48))
    assert readings.text.shape == (3, STEPS, len(ALPHABET) + 1)
    assert readings.kind.shape == (3, len(KINDS))


def test_the_size_of_the_networks() -> None:
    network = ReaderNetwork()
    used = [p for name, p in network.named_parameters() if not name.startswith("spelling")]
    parameters = sum(p.numel() for p in used)
    assert 200_000 < parameters < 420_000


def test_brightness_and_contrast_make_no_difference() -> None:
    torch.manual_seed(0)
    network = ReaderNetwork(SMALL).eval()
    crops = torch.rand(2, 3, 48, 48)
    plain, faded = network(crops).text, network(0.4 * crops + 0.3).text
    other = network(crops.flip(3)).text
    assert (plain - faded).abs().max() < 0.1 * (plain - other).abs().max()


def test_crops_as_the_network_takes_them() -> None:
    crops = torch.zeros(1, 48, 48, 3, dtype=torch.uint8)
    crops[0, 5, 7] = torch.tensor([255, 51, 0])
    pixels = network_input(crops)
    assert pixels.shape == (1, 3, 48, 48)
    assert pixels[0, :, 5, 7].tolist() == pytest.approx([1, 0.2, 0])


def merged(path: tuple[int, ...]) -> tuple[int, ...]:
    kept = [c for k, c in enumerate(path) if k == 0 or c != path[k - 1]]
    return tuple(c for c in kept if c)


@pytest.mark.parametrize("text", [(1,), (2, 1), (1, 1)])
def test_the_probability_of_a_text_is_that_of_all_its_paths(text: tuple[int, ...]) -> None:
    torch.manual_seed(0)
    logits = torch.randn(1, 4, 3)
    steps = logits[0].softmax(dim=1).numpy()
    expected = sum(
        float(np.prod([steps[t, c] for t, c in enumerate(path)]))
        for path in product(range(3), repeat=4)
        if merged(path) == text
    )
    loss = text_losses(logits, torch.tensor([text]), torch.tensor([len(text)]))
    assert float(torch.exp(-loss[0])) == pytest.approx(expected, rel=1e-4)


def test_a_batch_without_texts() -> None:
    network = ReaderNetwork(SMALL)
    batch = collated([np.zeros((48, 48, 3), np.uint8)] * 2, [ReadTarget("up"), ReadTarget("blank")])
    losses = reader_losses(network.lesson(network_input(batch.crops)), batch, 0.5)
    assert losses.text.item() == losses.spelling.item() == 0
    assert losses.total.item() == pytest.approx(losses.kind.item())
    losses.total.backward()
    assert all(p.grad is None or bool(p.grad.isfinite().all()) for p in network.parameters())


def test_spelling_helps_at_first_and_texts_count_more_and_more() -> None:
    torch.manual_seed(0)
    network = ReaderNetwork(SMALL).eval()
    crops = list(np.random.default_rng(0).integers(0, 256, (2, 48, 48, 3), dtype=np.uint8))
    batch = collated(crops, [ReadTarget("text", "12345"), ReadTarget("text", "1")])
    lesson = network.lesson(network_input(batch.crops))
    first, last = (reader_losses(lesson, batch, share) for share in (0.0, 1.0))
    assert last.total.item() == pytest.approx((last.text + last.kind).item())
    expected = 0.2 * first.text + first.kind + first.spelling
    assert first.total.item() == pytest.approx(expected.item())
    spelled = lesson.spelling.log_softmax(dim=2)
    characters = spelled[0, range(4), [2, 3, 4, 5]].sum() + spelled[1, range(4), [2, 0, 0, 0]].sum()
    assert first.spelling.item() == pytest.approx(-characters.item() / 2, rel=1e-4)


def test_it_learns(tmp_path: Path) -> None:
    torch.manual_seed(0)
    options = ReaderFit(steps=60, batch=24, warmup=5, workers=0, save_every=20, rate=1e-2,
                        average=0.9)  # fmt: skip
    fit_reader(ReaderNetwork(SMALL), SOURCES, tmp_path, options, progress=False)
    losses = [float(row["total"]) for row in rows(tmp_path)]
    kinds = [float(row["kind"]) for row in rows(tmp_path)]
    assert losses[-1] < 0.35 * losses[0]
    assert kinds[-1] < 0.8 * kinds[0]


def test_a_run_and_going_on(tmp_path: Path) -> None:
    run = tmp_path / "run"
    seen = []

    def validate(network: ReaderNetwork) -> dict[str, float]:
        assert not network.training
        seen.append(network)
        return {"val_right": 0.25}

    torch.manual_seed(0)
    network = fit_reader(
        ReaderNetwork(SMALL), SOURCES, run, OPTIONS, validate=validate, progress=False
    )
    assert not network.training
    assert [row["step"] for row in rows(run)] == ["2", "3"]
    assert all(float(row["val_right"]) == 0.25 for row in rows(run))
    assert not (run / "last.part").exists()
    loaded = load_reader(run / "last.pt")
    assert loaded.options == SMALL
    for name, values in network.state_dict().items():
        assert torch.equal(values, loaded.state_dict()[name]), name

    more = replace(OPTIONS, steps=5)
    fit_reader(ReaderNetwork(SMALL), SOURCES, run, more, progress=False)
    assert [row["step"] for row in rows(run)] == ["2", "3", "4", "5"]
    assert rows(run)[-1]["val_right"] == "nan"
    assert int(torch.load(run / "last.pt", weights_only=True)["step"]) == 5
    assert len(seen) == 2


def test_a_run_of_another_network(tmp_path: Path) -> None:
    fit_reader(ReaderNetwork(SMALL), SOURCES, tmp_path, OPTIONS, progress=False)
    other = ReaderNetwork(replace(SMALL, stem=5))
    with pytest.raises(InputError, match="stem=5"):
        fit_reader(other, SOURCES, tmp_path, OPTIONS, progress=False)


@pytest.mark.parametrize("content", [None, b"", b"no checkpoint"])
def test_a_file_that_is_no_checkpoint(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "last.pt"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=r"last\.pt"):
        load_reader(path)


def test_a_checkpoint_of_something_else(tmp_path: Path) -> None:
    torch.save({"averaged": {}, "network_options": {}}, tmp_path / "last.pt")
    with pytest.raises(InputError, match="reader"):
        load_reader(tmp_path / "last.pt")
