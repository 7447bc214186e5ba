"""Patches of many finds and their true masks."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fronto.maskhead import SIDE
from fronto.train.pools import check_arrays

__all__ = ["Pool"]

Bytes = npt.NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Pool:
    """N finds.

    Parameters
    ----------
    photo, rough
        Shapes (N, 48, 48, 3) and (N, 48, 48), uint8: as `fronto.maskhead.Patches` has them.
    masks
        Shape (N, 48, 48), uint8: the share of each pixel that belongs to the find, of 255.
    forms
        Shape (N,), uint8: index into `fronto.maskhead.FORMS`; `UNKNOWN` where nobody knows.
    """

    photo: Bytes
    rough: Bytes
    masks: Bytes
    forms: Bytes

    #: Of a find whose form is not known.
    UNKNOWN = 255

    def __post_init__(self) -> None:
        n = len(self.photo)
        check_arrays(self, ((n, SIDE, SIDE, 3), (n, SIDE, SIDE), (n, SIDE, SIDE), (n,)))

    def __len__(self) -> int:
        return len(self.photo)
