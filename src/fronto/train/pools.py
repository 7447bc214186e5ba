"""Patches of many finds, kept in a file: the network that finds them runs only once."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Iterator, Sequence
from dataclasses import fields
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar
from zipfile import BadZipFile

import numpy as np

from fronto.errors import InputError

if TYPE_CHECKING:
    from _typeshed import DataclassInstance

    P = TypeVar("P", bound=DataclassInstance)
else:
    P = TypeVar("P")

__all__ = ["check_arrays", "collected", "divided", "joined", "read_pool", "write_pool"]


def check_arrays(pool: DataclassInstance, wanted: Sequence[tuple[int, ...]]) -> None:
    """Check that a pool's arrays are bytes of these shapes.

    Raises
    ------
    InputError
        Naming the array that is not.
    """
    for part, shape in zip(fields(pool), wanted, strict=True):
        array = getattr(pool, part.name)
        if array.shape != shape or array.dtype != np.uint8:
            raise InputError(part.name, f"expected uint8 {shape}, got {array.dtype} {array.shape}")


def joined(pools: Sequence[P]) -> P:
    """Several pools, dataclasses of arrays of one length each, as one."""
    kind = type(pools[0])
    return kind(
        **{p.name: np.concatenate([getattr(pool, p.name) for pool in pools]) for p in fields(kind)}
    )


def divided(pool: P, share: float) -> tuple[P, P]:
    """The first finds of a pool, this share of them, and the others."""
    kind, names = type(pool), [part.name for part in fields(pool)]
    count = int(share * len(getattr(pool, names[0])))

    def part(rows: slice) -> P:
        return kind(**{name: getattr(pool, name)[rows] for name in names})

    return part(slice(count)), part(slice(count, None))


def write_pool(path: Path, pool: DataclassInstance) -> None:
    """Write patches, in one piece: a run that is killed meanwhile leaves no half file."""
    partial = path.with_name(f"{path.stem}.part.npz")
    content: dict[str, Any] = {part.name: getattr(pool, part.name) for part in fields(pool)}
    np.savez(partial, allow_pickle=False, **content)
    partial.replace(path)


def read_pool(path: Path, kind: type[P]) -> P:
    """Read what `write_pool` wrote of a pool of this kind.

    Raises
    ------
    InputError
        If the file is no such file.
    """
    try:
        # Opened here: NumPy leaves a damaged archive open.
        with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            return kind(**{part.name: stored[part.name] for part in fields(kind)})
    except (OSError, EOFError, ValueError, KeyError, TypeError, BadZipFile) as error:
        reason = " ".join(str(error).split())[:80]
        raise InputError(
            f"patches {path}", f"expected what a run has written, got: {reason}", "delete it"
        ) from None


def collected(
    run: Path,
    pools: Callable[[int], Iterator[P]],
    *,
    pictures: int,
    in_one: int,
    seed: int,
    progress: bool,
) -> list[Path]:
    """The files of patches of a run; those that it has are not made again.

    Parameters
    ----------
    run
        Its folder.
    pools
        From a seed to the pools of one picture after the other.
    pictures, in_one
        How many pictures in all, and in one file.
    seed
        Of the run.
    progress
        Whether a progress bar with the time left is shown.
    """
    from tqdm import tqdm

    counts = [min(in_one, pictures - k) for k in range(0, pictures, in_one)]
    files = [run / f"patches-{k:03d}-{count}.npz" for k, count in enumerate(counts)]
    missing = [k for k, file in enumerate(files) if not file.exists()]
    total = sum(counts[k] for k in missing)
    with tqdm(total=total, unit="picture", disable=not progress) as bar:
        for k in missing:
            found = []
            for pool in itertools.islice(pools(10_000 * seed + k), counts[k]):
                found.append(pool)
                bar.update()
            write_pool(files[k], joined(found))
    return files
