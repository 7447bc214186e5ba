"""Patches of many finds and their true masks, kept in a file: the network runs only once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from zipfile import BadZipFile

import numpy as np
import numpy.typing as npt

from fronto.errors import InputError
from fronto.maskhead import SIDE

__all__ = ["Pool", "divided", "joined", "read_pool", "write_pool"]

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
        wanted = ((n, SIDE, SIDE, 3), (n, SIDE, SIDE), (n, SIDE, SIDE), (n,))
        for part, shape in zip(fields(self), wanted, strict=True):
            array = getattr(self, part.name)
            if array.shape != shape or array.dtype != np.uint8:
                raise InputError(
                    part.name, f"expected uint8 {shape}, got {array.dtype} {array.shape}"
                )

    def __len__(self) -> int:
        return len(self.photo)


def joined(pools: Sequence[Pool]) -> Pool:
    """Several pools as one."""
    return Pool(*(np.concatenate([getattr(p, part.name) for p in pools]) for part in fields(Pool)))


def divided(pool: Pool, share: float) -> tuple[Pool, Pool]:
    """The first finds of a pool, this share of them, and the others."""
    count = int(share * len(pool))

    def part(rows: slice) -> Pool:
        return Pool(*(getattr(pool, f.name)[rows] for f in fields(Pool)))

    return part(slice(count)), part(slice(count, None))


def write_pool(path: Path, pool: Pool) -> None:
    """Write patches, in one piece: a run that is killed meanwhile leaves no half file."""
    partial = path.with_name(f"{path.stem}.part.npz")
    np.savez(partial, allow_pickle=False, **vars(pool))
    partial.replace(path)


def read_pool(path: Path) -> Pool:
    """Read what `write_pool` wrote.

    Raises
    ------
    InputError
        If the file is no such file.
    """
    try:
        # Opened here: NumPy leaves a damaged archive open.
        with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            return Pool(*(stored[part.name] for part in fields(Pool)))
    except (OSError, EOFError, ValueError, KeyError, TypeError, BadZipFile) as error:
        reason = " ".join(str(error).split())[:80]
        raise InputError(
            f"patches {path}", f"expected what a run has written, got: {reason}", "delete it"
        ) from None
