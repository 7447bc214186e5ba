"""Where training crops come from, and their batches."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from PIL import Image

from fronto.datasets.records import LabeledImage, LabeledObject
from fronto.labels.alphabet import KINDS
from fronto.labels.targets import ReadTarget
from fronto.train.reader.data import (
    PhotoCrops,
    RenderedCrops,
    collated,
    crop_batches,
    labelled_crops,
)
from fronto.train.reader.jitter import Sample


def photo(path: Path, names: list[str]) -> LabeledImage:
    """Boxes in a row, each of its own grey: 20, 40, ..."""
    image = np.zeros((30, 30 * len(names), 3), np.uint8)
    objects = []
    for k, name in enumerate(names):
        image[:, 30 * k : 30 * (k + 1)] = 20 * (k % 12 + 1)
        box = (30 * k + 4.5, 4.5, 30 * k + 24.5, 24.5)
        category = "number" if name.isdigit() else "unknown"
        objects.append(LabeledObject(category, box, None, name))
    Image.fromarray(image).save(path)
    return LabeledImage(path, image.shape[1], 30, tuple(objects))


def test_boxes_and_their_own_names(tmp_path: Path) -> None:
    image = photo(tmp_path / "a.png", ["12", "empty", "led", "blur", "open"])
    found = labelled_crops(image)
    assert [sample.target.kind for _, sample in found] == ["text", "blank", "unreadable", "open"]
    for labelled, sample in found:
        x0, y0, x1, y1 = sample.box
        middle = sample.image[round((y0 + y1) / 2), round((x0 + x1) / 2), 0]
        assert middle == 20 * (1 + image.objects.index(labelled))


def test_a_plate_shows_its_own_text(tmp_path: Path) -> None:
    image = photo(tmp_path / "a.png", ["7"])
    plate = LabeledObject("plate", image.objects[0].box, None, "7", "7")
    # The button that it names is of the category and text of its plate, and shows nothing.
    button = LabeledObject("number", image.objects[0].box, None, "empty", "7")
    marked = LabeledImage(image.path, image.width, image.height, (plate, button))
    targets = [sample.target for _, sample in labelled_crops(marked)]
    assert [(t.kind, t.text) for t in targets] == [("text", "7"), ("blank", "")]


def test_rare_texts_come_oftener_than_their_number_says(tmp_path: Path) -> None:
    image = photo(tmp_path / "a.png", ["1"] * 36 + ["2"] * 4)
    source = PhotoCrops([image])
    rng = np.random.default_rng(0)
    drawn = Counter(source.draw(rng).target.text for _ in range(2000))
    assert 0.15 < drawn["2"] / 2000 < 0.27  # their number says 0.1, all names alike 0.5


def test_renders_are_used_again_and_replaced() -> None:
    source = RenderedCrops(reuse=4)
    rng = np.random.default_rng(0)
    drawn = [source.draw(rng) for _ in range(250)]
    fresh = {id(sample) for sample in drawn}
    assert 80 < len(fresh) < 150  # the first 64, then one in four


def test_a_batch() -> None:
    crop = np.zeros((48, 48, 3), np.uint8)
    batch = collated(
        [crop] * 3, [ReadTarget("text", "1A"), ReadTarget("up"), ReadTarget("text", "*")]
    )
    assert batch.crops.shape == (3, 48, 48, 3)
    assert batch.crops.dtype == torch.uint8
    assert batch.kind.tolist() == [0, KINDS.index("up"), 0]
    assert batch.text.tolist() == [[2, 11], [0, 0], [37, 0]]
    assert batch.length.tolist() == [2, 0, 1]


def test_a_batch_without_texts() -> None:
    batch = collated([np.zeros((48, 48, 3), np.uint8)], [ReadTarget("blank")])
    assert batch.text.shape == (1, 1)
    assert batch.length.tolist() == [0]


class Shade:
    """One grey, always."""

    def __init__(self, shade: int, kind: str) -> None:
        image = np.full((20, 20, 3), shade, np.uint8)
        self.sample = Sample(image, (3.0, 3.0, 17.0, 17.0), ReadTarget(kind))

    def draw(self, rng: np.random.Generator) -> Sample:
        return self.sample


def test_sources_are_mixed_by_their_shares() -> None:
    sources = [(Shade(10, "blank"), 3.0), (Shade(200, "unreadable"), 1.0)]
    loader = iter(crop_batches(sources, batch=64, seed=3, workers=0))
    kinds = torch.cat([next(loader).kind for _ in range(8)])
    assert 0.65 < (kinds == KINDS.index("blank")).float().mean() < 0.85


def test_the_seed_decides() -> None:
    def first(seed: int) -> list[int]:
        loader = crop_batches([(Shade(90, "blank"), 1.0)], batch=4, seed=seed, workers=0)
        return next(iter(loader)).crops.flatten().tolist()

    assert first(1) == first(1)
    assert first(1) != first(2)
