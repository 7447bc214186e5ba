"""Crops: where they are cut, and what disturbances leave of them."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("torch")

from fronto.labels.alphabet import CROP_PX, CROP_SCALE
from fronto.labels.targets import ReadTarget
from fronto.train.reader.jitter import Sample, crop_of, jittered, surrounded


def ramps(width: int, height: int) -> np.ndarray:
    """Red grows by 2 a pixel to the right, green downwards."""
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    return np.stack([2 * x, 2 * y, 0 * x], axis=2).astype(np.uint8)


def test_a_crop_shows_its_box_a_little_enlarged() -> None:
    box = (20.0, 30.0, 80.0, 66.0)
    crop = crop_of(Sample(ramps(110, 100), box, ReadTarget("text", "1"))).astype(float)
    assert crop.shape == (CROP_PX, CROP_PX, 3)
    steps = (np.arange(CROP_PX) + 0.5) / CROP_PX - 0.5
    x = 2 * (50 + steps * 60 * CROP_SCALE)
    y = 2 * (48 + steps * 36 * CROP_SCALE)
    assert np.abs(crop[..., 0] - x).max() <= 1
    assert np.abs(crop[..., 1] - y[:, None]).max() <= 1


def test_large_boxes_are_averaged() -> None:
    """A checkerboard of single pixels becomes grey, not a pattern of its own."""
    x, y = np.meshgrid(np.arange(480), np.arange(480))
    board = np.repeat((255 * ((x + y) % 2))[..., None], 3, axis=2).astype(np.uint8)
    crop = crop_of(Sample(board, (10.0, 10.0, 460.0, 460.0), ReadTarget("blank")))
    assert np.abs(crop.astype(float) - 127.5).max() < 12


def test_beyond_the_border_its_colour_goes_on() -> None:
    image = np.full((20, 20, 3), 90, np.uint8)
    crop = crop_of(Sample(image, (-6.0, -6.0, 14.0, 14.0), ReadTarget("blank")))
    assert (crop == 90).all()


def test_the_same_box_with_its_surroundings() -> None:
    image = ramps(120, 110)
    target = ReadTarget("text", "1")
    whole = crop_of(Sample(image, (40.0, 50.0, 70.0, 75.0), target))
    part = surrounded(image, (40.0, 50.0, 70.0, 75.0), target)
    assert part.image.shape[0] < 60
    assert np.abs(crop_of(part).astype(int) - whole).max() <= 1
    corner = surrounded(image, (-3.0, 90.0, 20.0, 118.0), target)
    expected = crop_of(Sample(image, (-3.0, 90.0, 20.0, 118.0), target))
    assert np.abs(crop_of(corner).astype(int) - expected).max() <= 1


def test_jitter_is_reproducible_and_varied() -> None:
    sample = Sample(ramps(60, 60), (10.0, 10.0, 50.0, 50.0), ReadTarget("text", "12"))
    crops = [jittered(sample, np.random.default_rng(seed))[0] for seed in (1, 1, 2)]
    assert crops[0].shape == (CROP_PX, CROP_PX, 3)
    assert crops[0].dtype == np.uint8
    assert (crops[0] == crops[1]).all()
    assert (crops[0] != crops[2]).any()


def test_an_arrow_upside_down_is_the_other_one() -> None:
    """What is red above and blue below is "up"; mirrored upwards it must be "down"."""
    image = np.zeros((60, 60, 3), np.uint8)
    image[:30, :, 0] = image[30:, :, 2] = 200
    sample = Sample(image, (10.0, 10.0, 50.0, 50.0), ReadTarget("up", mirrors=True))
    rng = np.random.default_rng(0)
    seen = set()
    for _ in range(200):
        crop, target = jittered(sample, rng)
        upper, lower = crop[:16].mean(axis=(0, 1)), crop[-16:].mean(axis=(0, 1))
        red_above = (upper - lower)[0] - (upper - lower)[2]
        # Other colours, grey and inverted pictures do not tell which way up they are.
        if target.kind in ("up", "down") and abs(red_above) > 60:
            seen.add((target.kind, bool(red_above > 0)))
    assert {("up", True), ("down", False)} <= seen
    texts = Sample(image, (10.0, 10.0, 50.0, 50.0), ReadTarget("text", "6"))
    kinds = {jittered(texts, rng)[1].kind for _ in range(300)}
    assert kinds == {"text", "unreadable"}


def test_few_are_spoilt() -> None:
    sample = Sample(ramps(60, 60), (10.0, 10.0, 50.0, 50.0), ReadTarget("text", "6"))
    rng = np.random.default_rng(0)
    spoilt = np.mean([jittered(sample, rng)[1].kind == "unreadable" for _ in range(1500)])
    assert 0.003 < spoilt < 0.03
    blank = Sample(ramps(60, 60), (10.0, 10.0, 50.0, 50.0), ReadTarget("blank"))
    assert {jittered(blank, rng)[1].kind for _ in range(300)} == {"blank"}


@pytest.mark.parametrize("size", [2, 7, 300])
def test_boxes_of_any_size(size: int) -> None:
    rng = np.random.default_rng(size)
    image = rng.integers(0, 256, (size + 4, 2 * size + 4, 3), dtype=np.uint8)
    sample = Sample(
        image, (2.0, 2.0, 2.0 + 2 * size, 2.0 + size), ReadTarget("text", "GROUNDFLOOR")
    )
    for _ in range(60):
        assert jittered(sample, rng)[0].shape == (CROP_PX, CROP_PX, 3)
