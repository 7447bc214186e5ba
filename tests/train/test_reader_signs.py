"""Signs drawn anew, key switches close up, and labels beside knobs."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("torch")

from fronto.labels.targets import ReadTarget
from fronto.train.reader.beside import beside
from fronto.train.reader.data import BesideCrops, RenderedCrops
from fronto.train.reader.jitter import Sample
from fronto.train.reader.locks import draw_lock
from fronto.train.reader.signs import SIGNED, random_sign

MANY = 40


def drawn(kind: str) -> list[np.ndarray]:
    rng = np.random.default_rng(7)
    return [random_sign(kind, rng) for _ in range(MANY)]


@pytest.mark.parametrize("kind", SIGNED)
def test_every_sign_shows_and_leaves_room(kind: str) -> None:
    for mask in drawn(kind):
        assert mask.shape == (96, 96)
        assert mask.dtype == np.uint8
        assert 0.01 < mask.mean() / 255 < 0.75
    assert len({mask.tobytes() for mask in drawn(kind)}) == MANY


def weight_above(mask: np.ndarray) -> float:
    """How much wider the lower half of what is drawn is than the upper one."""
    rows = np.flatnonzero(mask.any(axis=1))
    spans = [np.ptp(np.flatnonzero(mask[row])) for row in rows]
    half = len(spans) // 2
    return float(np.mean(spans[half:]) - np.mean(spans[:half]))


def test_arrows_point_up_and_down() -> None:
    # Arrows with a thin shaft are wider above.
    up = np.median([weight_above(mask) for mask in drawn("up")])
    down = np.median([weight_above(mask) for mask in drawn("down")])
    assert up > 5
    assert down < -5


def test_doors_are_the_same_mirrored_and_differ() -> None:
    for kind in ("open", "close"):
        for mask in drawn(kind):
            shifted = np.abs(mask[:, ::-1].astype(int) - mask)
            assert shifted.mean() < 12  # but for rounding at edges

    def outwards(mask: np.ndarray) -> float:
        tall = mask.astype(bool).sum(axis=0)
        columns = np.flatnonzero(tall)
        outer = columns[: max(2, len(columns) // 6)]
        return float(tall[outer].mean() / tall.max())

    assert np.mean([outwards(m) for m in drawn("close")]) > 2 * np.mean(
        [outwards(m) for m in drawn("open")]
    )


def test_a_lock_is_drawn_where_it_is_told() -> None:
    rng = np.random.default_rng(3)
    for _ in range(MANY):
        picture = np.full((88, 88, 3), 128, np.uint8)
        draw_lock(picture, 44, 44, 40, rng)
        changed = (picture != 128).any(axis=2)
        assert changed[34:54, 34:54].mean() > 0.5
        assert not changed[:8, :8].any()
        assert picture[24:64, 24:64].std() > 8


def plain(shade: int, target: ReadTarget) -> Sample:
    return Sample(np.full((60, 60, 3), shade, np.uint8), (10.0, 10.0, 50.0, 50.0), target)


def test_a_label_beside_a_knob_is_one_button() -> None:
    rng = np.random.default_rng(1)
    label, knob = plain(30, ReadTarget("text", "7")), plain(220, ReadTarget("blank"))
    first = 0
    for _ in range(MANY):
        sample = beside(label, knob, rng)
        assert sample.target == label.target
        x0, y0, x1, y1 = sample.box
        height, width = sample.image.shape[:2]
        assert 0 < x0 < x1 < width
        assert 0 < y0 < y1 < height
        row = sample.image[round((y0 + y1) / 2), :, 0].astype(int)
        first += abs(row[round(x0) + 3] - 30) < 30
    assert first > MANY / 2  # mostly the label comes first, left or on top


def test_labels_of_all_sources_come_beside_knobs() -> None:
    class One:
        def __init__(self, text: str) -> None:
            self.sample = plain(90, ReadTarget("text", text))

        def draw(self, rng: np.random.Generator) -> Sample:
            return self.sample

    source = BesideCrops([(One("1"), 0.25), (One("2"), 0.75)], RenderedCrops(reuse=4))
    rng = np.random.default_rng(0)
    texts = [source.draw(rng).target.text for _ in range(200)]
    assert 0.1 < texts.count("1") / 200 < 0.4
    assert set(texts) == {"1", "2"}
