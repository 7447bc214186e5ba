"""Small random draws that read as what they mean."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeVar

import numpy as np
import numpy.typing as npt

__all__ = ["Color", "Pixels", "chance", "log_uniform", "pick", "smooth_noise", "tint", "whole"]

T = TypeVar("T")
#: RGB, 0 to 255.
Color = tuple[float, float, float]
#: One value a pixel, or one a channel.
Pixels = npt.NDArray[np.float32]


def pick(rng: np.random.Generator, options: Sequence[T], weights: Sequence[float] = ()) -> T:
    """One of the options, evenly or by weights (of any sum)."""
    if not weights:
        return options[int(rng.random() * len(options))]
    edges = np.cumsum(weights)
    return options[int(np.searchsorted(edges, rng.random() * edges[-1], side="right"))]


def chance(rng: np.random.Generator, probability: float) -> bool:
    """True with that probability."""
    return bool(rng.random() < probability)


def whole(rng: np.random.Generator, low: int, high: int) -> int:
    """A whole number from `low` to `high`, both included."""
    return int(rng.integers(low, high + 1))


def log_uniform(rng: np.random.Generator, low: float, high: float) -> float:
    """A positive number whose logarithm is uniform."""
    return float(np.exp(rng.uniform(np.log(low), np.log(high))))


def tint(rng: np.random.Generator, color: Color, spread: float = 8.0, gain: float = 1.0) -> Color:
    """A colour near another: times `gain`, each channel off by up to `spread`."""
    r, g, b = np.clip(np.array(color) * gain + rng.uniform(-spread, spread, 3), 0, 255)
    return float(r), float(g), float(b)


def smooth_noise(
    rng: np.random.Generator, shape: tuple[int, int], cells: tuple[float, float]
) -> Pixels:
    """Noise of mean 0 and deviation about 1, shape (h, w).

    Parameters
    ----------
    shape
        Height and width in pixels.
    cells
        Height and width of a blob in pixels; very unequal ones give streaks.
    """
    import cv2

    coarse = [max(2, min(n, round(n / cell) + 1)) for n, cell in zip(shape, cells, strict=True)]
    noise = rng.standard_normal(coarse, dtype=np.float32)
    return np.asarray(cv2.resize(noise, shape[::-1], interpolation=cv2.INTER_LINEAR), np.float32)
