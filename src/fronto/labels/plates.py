"""Which plate names which button: on one panel all plates are on one side, at one distance."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from fronto.errors import InputError
from fronto.shapes import FloatArray

__all__ = ["Pair", "pairs", "strays"]

#: Between the edges of a button and its plate, in mean sides of the button: they may overlap
#: by the first, and be apart by the second.
GAPS = (-0.4, 1.0)
#: Their centres are at most this far off one row or column, in heights or widths of the smaller.
ASIDE = 0.5
#: Gaps of a panel's pairs differ by less than this, in mean sides of the button.
SAME_GAP = 0.5
#: By so much a pair must be better than any other that its plate or its button could be in: of
#: what closeness, the panel's side and the readings say, each worth up to 1.
MARGIN = 0.15
#: So many pairs show how the plates of a panel lie: a stray's offset is theirs to within this, in
#: mean sides of the button.
SHOWING, SAME_OFFSET = 2, 0.35


class Pair(NamedTuple):
    """A plate and the button that it names, by their places in the lists."""

    plate: int
    button: int


class _Candidates(NamedTuple):
    """What may be pairs: arrays of one length each.

    Parameters
    ----------
    plate, button
        Places in the lists.
    side
        Where the plate is, seen from the button: 0 left, 1 right, 2 above, 3 below.
    gap
        Between their edges, in mean sides of the button.
    """

    plate: npt.NDArray[np.intp]
    button: npt.NDArray[np.intp]
    side: npt.NDArray[np.intp]
    gap: FloatArray


def pairs(
    buttons: FloatArray, plates: FloatArray, agreement: FloatArray | None = None
) -> tuple[Pair, ...]:
    """Pair plates with the buttons that they name.

    A plate names a button right beside it. Where it lies between two, the side decides that
    most plates of the panel are on, how close both are, and what the readings say. Where that
    leaves doubt, the plate names nobody.

    Parameters
    ----------
    buttons, plates
        Shapes (n, 4) and (m, 4): edges x0, y0, x1, y1 on the panel's plane, or in a photo whose
        rows are level; NaN for one that is in no pair.
    agreement
        Shape (m, n): what the readings say of a pair, from -1 (each says something else) to 1
        (both say the same, or the button nothing); None: nothing.

    Returns
    -------
    Pairs in the order of the plates, each plate and each button in one at most.

    Raises
    ------
    InputError
        If an array has another shape.
    """
    for name, boxes in (("buttons", buttons), ("plates", plates)):
        if boxes.ndim != 2 or boxes.shape[1] != 4:
            raise InputError(name, f"expected shape (n, 4), got {boxes.shape}")
    if agreement is None:
        agreement = np.zeros((len(plates), len(buttons)))
    if agreement.shape != (len(plates), len(buttons)):
        raise InputError(
            "agreement",
            f"expected a row for each of {len(plates)} plates and a column for each of "
            f"{len(buttons)} buttons, got shape {agreement.shape}",
        )
    if not (len(buttons) and len(plates)):
        return ()
    found = _candidates(buttons, plates)
    values = _values(found, agreement[found.plate, found.button])
    return tuple(sorted(_sure(found, values)))


def strays(buttons: FloatArray, plates: FloatArray, found: Sequence[Pair]) -> tuple[Pair, ...]:
    """Buttons that lie beside another one just as the panel's plates lie beside theirs.

    Plates are taken for buttons at times; pressed they do nothing.

    Parameters
    ----------
    buttons, plates
        As of `pairs`.
    found
        The panel's pairs.

    Returns
    -------
    Pairs of two buttons without plates, `plate` the one that may be the plate of the other.
    """
    if len(found) < SHOWING:
        return ()
    centers, unit = (buttons[:, :2] + buttons[:, 2:]) / 2, (buttons[:, 2:] - buttons[:, :2]).mean(1)
    beside = (plates[:, :2] + plates[:, 2:]) / 2
    offsets = np.array([(beside[p] - centers[b]) / unit[b] for p, b in found])
    usual = np.median(offsets, axis=0)
    if (np.abs(offsets - usual).max(axis=1) <= SAME_OFFSET).sum() < SHOWING:
        return ()
    free = sorted({*range(len(buttons))} - {pair.button for pair in found})
    return tuple(
        Pair(i, j)
        for i in free
        for j in free
        if i != j and np.abs((centers[i] - centers[j]) / unit[j] - usual).max() <= SAME_OFFSET
    )


def _candidates(buttons: FloatArray, plates: FloatArray) -> _Candidates:
    """Pairs that are close beside each other with nothing between them."""
    boxes = np.concatenate([plates, buttons])
    centers, sizes = (boxes[:, :2] + boxes[:, 2:]) / 2, boxes[:, 2:] - boxes[:, :2]
    offset = centers[None] - centers[:, None]  # from the first index to the second
    reach = (sizes[None] + sizes[:, None]) / 2
    least = np.minimum(sizes[None], sizes[:, None])
    m = len(plates)
    parts = []
    for side in range(4):
        axis = side // 2
        along = offset[..., axis] * (1 - 2 * (side % 2))  # the plate comes first on even sides
        aside = np.abs(offset[..., 1 - axis]) / least[..., 1 - axis]
        with np.errstate(invalid="ignore"):
            in_line = (along > 0) & (aside < ASIDE)
        # The nearest in line, of either kind, is the only one that nothing lies in front of.
        distance = np.where(in_line, along, np.inf)
        nearest = (distance == distance.min(axis=1, keepdims=True)) & in_line
        nearest &= distance == distance.min(axis=0, keepdims=True)
        plate, button = np.nonzero(nearest[:m, m:])
        unit = sizes[m + button].mean(axis=1)
        gap = (along[plate, m + button] - reach[plate, m + button, axis]) / unit
        kept = (gap > GAPS[0]) & (gap < GAPS[1])
        parts.append((plate[kept], button[kept], np.full(kept.sum(), side), gap[kept]))
    return _Candidates(*(np.concatenate(part) for part in zip(*parts, strict=True)))


def _values(found: _Candidates, agreement: FloatArray) -> FloatArray:
    """How well each candidate fits: the higher the better."""
    close = 1 - np.clip(found.gap, 0, None) / GAPS[1]
    plates = len(np.unique(found.plate))
    value = close + agreement
    for side in range(4):
        here = found.side == side
        if here.any():
            usual = np.abs(found.gap[here] - np.median(found.gap[here])) < SAME_GAP
            votes = np.clip(close[here] + agreement[here], 0, None) * usual
            value[here] += votes.sum() / plates
            value[here] -= ~usual
    return value


def _sure(found: _Candidates, values: FloatArray) -> list[Pair]:
    """The best pairs, best first, but for those that another comes close to."""
    left = np.ones(len(values), dtype=bool)
    sure = []
    while left.any():
        best = int(np.where(left, values, -np.inf).argmax())
        rivals = left & ((found.plate == found.plate[best]) | (found.button == found.button[best]))
        rivals[best] = False
        left[best] = False
        if (values[rivals] > values[best] - MARGIN).any():
            # Nobody knows which: what they share is in no pair at all.
            left &= found.plate != found.plate[best]
            continue
        if values[best] > 0:
            sure.append(Pair(int(found.plate[best]), int(found.button[best])))
        left &= ~rivals
    return sure
