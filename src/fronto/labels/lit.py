"""Which buttons are lit: those that shine beside the others of their panel."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fronto.labels.alphabet import CROP_PX
from fronto.shapes import FloatArray

__all__ = ["lit_scores"]

#: Of fewer buttons nobody can say which is the exception.
FEWEST = 3
#: Radii of a button's core, of its middle, and of its rim, in half crops.
CORE, MIDDLE, RIM = 0.5, 0.78, 0.72
#: Crops are averaged to so many cells along each side first.
CELLS = 16
#: Deviations from the panel's typical button are counted in typical deviations of its buttons,
#: these at least and at most so many.
LEAST, MOST = 0.02, 8.0
#: Logistic regression on 5,700 buttons of rendered panels (`fronto.synth.photo`): what each
#: deviation speaks for being lit, and what none does.
WEIGHTS = np.array([0.224, 0.268, -0.114, 0.184])
NONE = -3.337


def lit_scores(crops: npt.NDArray[np.uint8]) -> FloatArray | None:
    """How probable it is that each of a panel's buttons is lit.

    By comparison with the panel's other buttons: in how far the crop has parts brighter than
    the typical one, and how much more colour its face, and light its rim, have. Where all
    buttons or most are lit, none of them is an exception, and all scores are low.

    Parameters
    ----------
    crops
        Shape (n, 48, 48, 3), uint8, RGB: all buttons of one panel, as of
        `fronto.labels.crops.crops`.

    Returns
    -------
    (n,), from 0 to 1; None of fewer than three buttons.
    """
    if len(crops) < FEWEST:
        return None
    features = _features(crops)
    off = features - np.median(features, axis=0)
    typical = np.median(np.abs(off), axis=0) + LEAST
    evidence = np.clip(off / typical, -MOST, MOST) @ WEIGHTS + NONE
    return np.asarray(1 / (1 + np.exp(-evidence)))


def _features(crops: npt.NDArray[np.uint8]) -> FloatArray:
    """(n, 4): brightest excess, colour of the middle, light of the core, light of the rim."""
    cell = CROP_PX // CELLS
    cells = crops.reshape(len(crops), CELLS, cell, CELLS, cell, 3).mean(
        axis=(2, 4), dtype=np.float32
    )
    value = cells.max(axis=3)
    chroma = value - cells.min(axis=3)
    excess = (cells - np.median(cells, axis=0)).max(axis=3)
    away = np.hypot(*(np.indices((CELLS, CELLS)) - (CELLS - 1) / 2)) / (CELLS / 2)
    middle = (away >= CORE) & (away < MIDDLE)
    return np.stack(
        [
            np.quantile(excess.reshape(len(crops), -1), 0.98, axis=1) / 255,
            np.quantile(chroma[:, middle], 0.9, axis=1) / 255,
            np.log(np.quantile(value[:, away < CORE], 0.95, axis=1) + 10),
            np.log(np.quantile(value[:, (away >= RIM) & (away < 1)], 0.5, axis=1) + 10),
        ],
        axis=1,
    )
