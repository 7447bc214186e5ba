"""A second opinion on each find: by itself, from the photo's own pixels around it.

The network sees most buttons as a few cells of 4 x 4 pixels, and the relation head sees what the
network makes of these. So a classifier looks at each find again, scaled so that all finds are
equally large, as the second stage of R-CNN does (Girshick et al., CVPR 2014): arrows painted on a
wall, lamps of a floor indicator and plates look like buttons from afar, less so from nearby.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from fronto.categories import CATEGORIES, PLATE
from fronto.finds import Find
from fronto.grouping import Instance
from fronto.patches import photo_patch, region
from fronto.shapes import FloatArray

__all__ = ["KINDS", "LEAST", "REACH", "SIDE", "Opinions", "describe", "verified"]

#: A patch has this many by this many pixels ...
SIDE = 64
#: ... and shows the find's box, made larger by this: what is around a button tells as much.
REACH = 2.3
#: What a find may be: nothing, a button, a plate.
KINDS = 3
#: Finds that are less sure than this are not looked at again: hardly any is a button.
LEAST = 0.1
#: What both say of the kind, and of the category, is multiplied, each to the power of its weight.
FIRST, SECOND = 0.7, 0.5
#: What then is something with this probability gets the confidence 0.5, from which on it is shown.
SHOWN = 0.64
#: No probability counts as less than this.
FLOOR = 1e-4

Floats = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Opinions:
    """What the verifier says about N finds.

    Parameters
    ----------
    kinds
        Shape (N, 3): probability of being nothing, a button, a plate.
    classes
        Shape (N, classes): probability of each category, in the order of `CATEGORIES`.
    """

    kinds: Floats
    classes: Floats


def describe(rgb: npt.NDArray[np.uint8], boxes: FloatArray) -> npt.NDArray[np.uint8]:
    """Patches (n, 64, 64, 3), uint8, of boxes (n, 4) in a photo (h, w, 3), uint8, RGB."""
    return np.stack([photo_patch(rgb, region(box, REACH), SIDE) for box in boxes])


def verified(finds: Sequence[Find], opinions: Opinions) -> list[Find]:
    """Finds with what the network and the verifier say of them together.

    Parameters
    ----------
    finds
        One or more.
    opinions
        Of the verifier, in the same order.

    Returns
    -------
    In the same order. Boxes and masks stay as they are.
    """
    first = np.stack([_kinds(find.instance) for find in finds])
    kinds = _together(first, opinions.kinds)
    kinds[:, 0] *= SHOWN / (1 - SHOWN)
    kinds /= kinds.sum(axis=1, keepdims=True)
    named = _together(
        np.stack([find.instance.scores[1:-1] for find in finds]), opinions.classes[:, 1:-1]
    )
    result = []
    for find, kind, buttons in zip(finds, kinds, named, strict=True):
        plate = bool(kind[2] > kind[1])
        confidence = float(kind[1:].max())
        scores = np.array([kind[0], *(kind[1] * buttons), kind[2]])
        category = PLATE if plate else CATEGORIES[1 + int(np.argmax(buttons))]
        instance = Instance(plate, confidence, find.instance.box, scores)
        result.append(replace(find, instance=instance, confidence=confidence, category=category))
    return result


def _kinds(instance: Instance) -> FloatArray:
    """Probabilities of nothing, a button, a plate (3,); its confidence is that of its kind."""
    kinds = np.array([instance.scores[1:-1].sum(), instance.scores[-1]])
    kinds *= instance.confidence / max(float(kinds[int(instance.plate)]), FLOOR)
    kinds = np.minimum(kinds, instance.confidence)
    return np.array([max(1 - kinds.sum(), 0), *kinds])


def _together(first: FloatArray, second: npt.NDArray[np.floating]) -> FloatArray:
    """Probabilities (n, k) of both, multiplied."""
    logs = FIRST * np.log(np.maximum(first, FLOOR)) + SECOND * np.log(np.maximum(second, FLOOR))
    shares = np.exp(logs - logs.max(axis=1, keepdims=True))
    return np.asarray(shares / shares.sum(axis=1, keepdims=True))
