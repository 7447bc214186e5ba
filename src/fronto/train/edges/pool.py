"""What the photo shows across many outlines, and where their edges are."""

from __future__ import annotations

from dataclasses import dataclass, fields

import numpy as np
import numpy.typing as npt

from fronto.errors import InputError
from fronto.outlines.edgeprofiles import ABOUT, BINS, CHANNELS, CURVES

__all__ = ["EdgePool"]


@dataclass(frozen=True, eq=False)
class EdgePool:
    """N outlines.

    Parameters
    ----------
    profiles
        Shape (N, 8, 64, 4), uint8: as `fronto.outlines.edgeprofiles.profiles` makes them, rounded.
    about
        Shape (N, 3), float32: as `fronto.outlines.edgeprofiles.about` makes it.
    reaches
        Shape (N,), float32: of the profiles, pixels.
    offsets
        Shape (N, 8), float32: where the true edge is across each curve, in reaches; NaN: unknown.
    first
        Shape (N,), uint8: 1 where the outlines of another photo begin.

    Raises
    ------
    InputError
        If an array is of another type or shape.
    """

    profiles: npt.NDArray[np.uint8]
    about: npt.NDArray[np.float32]
    reaches: npt.NDArray[np.float32]
    offsets: npt.NDArray[np.float32]
    first: npt.NDArray[np.uint8]

    def __post_init__(self) -> None:
        n = len(self.profiles)
        wanted = (
            (np.uint8, (n, CURVES, BINS, CHANNELS)),
            (np.float32, (n, ABOUT)),
            (np.float32, (n,)),
            (np.float32, (n, CURVES)),
            (np.uint8, (n,)),
        )
        for part, (dtype, shape) in zip(fields(self), wanted, strict=True):
            array = getattr(self, part.name)
            if array.shape != shape or array.dtype != dtype:
                name = np.dtype(dtype).name
                raise InputError(
                    part.name, f"expected {name} {shape}, got {array.dtype} {array.shape}"
                )

    def __len__(self) -> int:
        return len(self.profiles)

    def photos(self) -> list[npt.NDArray[np.intp]]:
        """The outlines of each photo."""
        begins = np.flatnonzero(self.first)
        return np.split(np.arange(len(self)), begins[begins > 0])
