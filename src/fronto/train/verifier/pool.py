"""Patches of many finds, and what these are."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fronto.train.pools import check_arrays
from fronto.verification import REACH, SIDE

__all__ = ["WIDER_REACH", "WIDER_SIDE", "VerifierPool"]

#: Patches are kept a little wider than the verifier takes them, to be cut out anew each time: their
#: side, and how far they reach.
WIDER_SIDE = SIDE + 8
WIDER_REACH = REACH * WIDER_SIDE / SIDE

Bytes = npt.NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class VerifierPool:
    """N finds.

    Parameters
    ----------
    patches
        Shape (N, 72, 72, 3), uint8, RGB: the picture around each.
    kinds
        Shape (N,), uint8: 0 nothing, 1 a button, 2 a plate.
    classes
        Shape (N,), uint8: number of the category; `UNKNOWN` where nobody knows, or nothing.
    """

    patches: Bytes
    kinds: Bytes
    classes: Bytes

    #: Of what has no known category.
    UNKNOWN = 255

    def __post_init__(self) -> None:
        n = len(self.patches)
        check_arrays(self, ((n, WIDER_SIDE, WIDER_SIDE, 3), (n,), (n,)))

    def __len__(self) -> int:
        return len(self.patches)
