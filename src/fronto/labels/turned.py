"""Labels that lie on their side or stand on their head: all of a panel's are turned alike.

Some makers print plates to be read with the head tilted, and some photos are turned.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from fronto.labels.reader import Reading

__all__ = ["upright_readings"]

Crops = npt.NDArray[np.uint8]

#: A reading that is hardly ever wrong.
SURE = 0.8
#: Nothing is turned where this share of the labels is sure as it is, or so few are unclear.
ENOUGH, FEW = 0.3, 3
#: What is seen where there is no label, whichever way it is turned.
EMPTY = ("blank", "other")
#: What means something else when it is turned.
ARROWS = ("up", "down")
#: Turned, this share of the labels has to be sure, of so many different ones, and this many times
#: as many and two more than upright: what is seen from aside sometimes looks like something.
SHARE, DIFFERENT, TIMES = 0.4, 3, 2
#: So many labels, spread over all, tell which way they lie.
PROBED = 8
#: What turning makes upright, by quarter turns counterclockwise.
WAYS = {1: "to the right", 2: "upside down", 3: "to the left"}


def upright_readings(
    read: Callable[[Crops], Sequence[Reading]], crops: Crops, readings: Sequence[Reading]
) -> tuple[Sequence[Reading], str]:
    """Read crops turned, where that is what tells them.

    Parameters
    ----------
    read
        Reads crops.
    crops
        Shape (n, 48, 48, 3), uint8, RGB: of the buttons or of the plates of one panel.
    readings
        Of the crops as they are.

    Returns
    -------
    The readings that are to be used, and how the labels lie: "", or "to the right", say.
    """
    labels = [k for k, reading in enumerate(readings) if reading.kind not in EMPTY]
    unclear = sum(readings[k].confidence < SURE for k in labels)
    if unclear < FEW or _sure(readings) >= ENOUGH * len(labels):
        return readings, ""
    some = labels[:: -(-len(labels) // PROBED)]
    least = max(SHARE * len(some), DIFFERENT, TIMES * _sure([readings[k] for k in some]) + 2)
    probed = {turn: read(_turned(crops[some], turn)) for turn in WAYS}
    turn = max(probed, key=lambda turn: _sure(probed[turn]))
    if _sure(probed[turn]) < least:
        return readings, ""
    turned = probed[turn] if len(some) == len(labels) else read(_turned(crops[labels], turn))
    found = list(readings)
    for k, reading in zip(labels, turned, strict=True):
        # Door symbols are upright beside turned floors; but what turned ones show of an arrow
        # points elsewhere, and a turned 4 looks like one.
        text = reading.kind == "text" and reading.confidence >= SURE
        if text or found[k].kind in ARROWS or found[k].confidence < SURE:
            found[k] = reading
    return found, WAYS[turn]


def _turned(crops: Crops, turn: int) -> Crops:
    return np.ascontiguousarray(np.rot90(crops, turn, axes=(1, 2)))


def _sure(readings: Sequence[Reading]) -> int:
    """How many different texts are read for sure."""
    return len({r.text for r in readings if r.kind == "text" and r.confidence >= SURE})
