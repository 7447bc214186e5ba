"""Plates that look like the buttons beside them: what is printed tells which are which.

On many panels each button is blank, and has a plate of its own size and form beside it that says
what it is for. One by one such plates look like buttons, and even together: they stand in the same
rows. But all of them bear a print, and all that lie beside them on one side do not; buttons that
are labelled themselves do not come in such pairs.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from fronto.categories import PLATE
from fronto.finds import Find
from fronto.prints import Prints
from fronto.shapes import FloatArray

__all__ = ["Twins", "plates_among", "told_apart", "twins"]

#: Fewer pairs than this show nothing, and no panel has more things.
FEWEST, MANY = 5, 150
#: How far two twins are apart, and how far aside of a row or column, in sides of the usual button.
APART, ASIDE = 2.6, 0.45
#: By how much a pair may lie otherwise than another, in sides of the smaller; and how much larger
#: one twin may be than the other.
OFF, LARGER = 0.3, 1.6
#: The log odds of bearing a print differ by more than this in a pair that shows it, and such are so
#: many of all; and those of what bears a print and of what bears none are above and below these.
DIFFER, SHARE, PRINTED, BLANK = 1.0, 0.8, 2.0, 0.0
#: Where more of the others are keyholes than this, nothing is the plate of anything.
KEYHOLES = 0.6
#: So many of all things that are no keyholes are twins, at least: where fewer are, labels that
#: could not be read look like blanks.
MOST = 0.6
#: No probability counts as closer to 0 or 1 than this.
FLOOR = 0.03


class Twins(NamedTuple):
    """Things that lie beside others, all in the same way: indices, (n,) each."""

    first: npt.NDArray[np.intp]
    second: npt.NDArray[np.intp]


def twins(boxes: FloatArray) -> list[Twins]:
    """Ways in which things of one size lie beside each other in pairs, none in two of them.

    Parameters
    ----------
    boxes
        Shape (n, 4): x0, y0, x1, y1.
    """
    if not 2 * FEWEST <= len(boxes) <= MANY:
        return []
    centers, sides = (boxes[:, :2] + boxes[:, 2:]) / 2, boxes[:, 2:] - boxes[:, :2]
    sizes = np.sqrt(sides.prod(axis=1))
    usual = float(np.median(sizes))
    smaller, larger = np.minimum.outer(sizes, sizes), np.maximum.outer(sizes, sizes)
    offsets = centers[None] - centers[:, None]
    alike = (larger < LARGER * smaller) & ~np.eye(len(boxes), dtype=bool)
    near = np.hypot(offsets[..., 0], offsets[..., 1]) < APART * usual
    in_line = np.abs(offsets).min(axis=-1) < ASIDE * usual
    i, j = np.nonzero(alike & near)
    steps, tolerance = offsets[i, j], OFF * smaller[i, j]
    found: dict[tuple[bytes, bytes], Twins] = {}
    for step in steps[in_line[i, j]]:
        same = np.hypot(*(steps - step).T) < tolerance
        first, second = i[same], j[same]
        both = {*first.tolist()} | {*second.tolist()}
        if len(first) >= FEWEST and len(both) == 2 * len(first):
            found[first.tobytes(), second.tobytes()] = Twins(first, second)
    return list(found.values())


def plates_among(
    found: list[Twins], printed: FloatArray, keyholes: FloatArray
) -> npt.NDArray[np.intp]:
    """Which things are the plates of others, (m,): those that bear a print beside blank ones.

    Parameters
    ----------
    found
        The ways in which they lie beside each other, as `twins` tells.
    printed
        Shape (n,): probability that each bears a print.
    keyholes
        Shape (n,): probability that each is a keyhole: these are blank whatever lies beside them.
    """
    share = np.clip(printed, FLOOR, 1 - FLOOR)
    odds = np.log(share / (1 - share))
    others = int((keyholes < KEYHOLES).sum())
    best, plates = 0.0, np.zeros(0, np.intp)
    for first, second in found:
        more = odds[first] - odds[second]
        told = (
            (more > DIFFER).mean() >= SHARE
            and odds[first].mean() > PRINTED
            and odds[second].mean() < BLANK
            and keyholes[second].mean() < KEYHOLES
            and 2 * len(first) >= MOST * others
        )
        if told and more.sum() > best:
            best, plates = float(more.sum()), first
    return plates


def told_apart(finds: Sequence[Find], prints: Prints) -> list[Find]:
    """Finds of one photo, in their order, with plates as such that were taken for buttons."""
    result = list(finds)
    buttons = [k for k, find in enumerate(finds) if not find.instance.plate]
    found = twins(np.array([finds[k].box for k in buttons]).reshape(-1, 4))
    for k in plates_among(found, prints.printed[buttons], prints.keyholes[buttons]):
        result[buttons[k]] = _as_plate(finds[buttons[k]])
    return result


def _as_plate(find: Find) -> Find:
    scores = find.instance.scores.copy()
    scores[-1] += scores[1:-1].sum()
    scores[1:-1] = 0
    instance = replace(find.instance, plate=True, scores=scores)
    return replace(find, instance=instance, category=PLATE)
