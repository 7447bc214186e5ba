"""Candidates of many pictures, kept in a file: the network that finds them runs only once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
import numpy.typing as npt

from fronto.errors import InputError
from fronto.shapes import FloatArray

__all__ = ["Picture", "read_pool", "write_pool"]


@dataclass(frozen=True, eq=False)
class Picture:
    """The N candidates of one picture, and what they are.

    Parameters
    ----------
    shape
        Height and width of the picture.
    looks
        Shape (N, 49, C), float16: `fronto.relations.looks`.
    boxes
        Shape (N, 4).
    confidence, plates, scores
        As `fronto.grouping.Instance` has them; shapes (N,), (N,), (N, classes).
    kinds
        Shape (N,): 0 nothing, 1 a button, 2 a plate, -1 no verdict.
    classes
        Shape (N,): number of the category; -1 unknown, or nothing.
    shifts
        Shape (N, 4): to the labelled box, in sides; NaN where there is none near.
    """

    shape: tuple[int, int]
    looks: npt.NDArray[np.float16]
    boxes: FloatArray
    confidence: FloatArray
    plates: npt.NDArray[np.bool_]
    scores: FloatArray
    kinds: npt.NDArray[np.int64]
    classes: npt.NDArray[np.int64]
    shifts: FloatArray


#: What a file holds of each candidate, and as what.
COLUMNS: dict[str, type] = {
    "looks": np.float16,
    "boxes": np.float32,
    "confidence": np.float32,
    "plates": np.bool_,
    "scores": np.float32,
    "kinds": np.int8,
    "classes": np.int8,
    "shifts": np.float32,
}
#: And as what a picture has it.
WHOLE = {"kinds": np.int64, "classes": np.int64}


def write_pool(path: Path, pictures: Sequence[Picture]) -> None:
    """Write pictures, in one piece: a run that is killed meanwhile leaves no half file."""
    content: dict[str, Any] = {
        name: np.concatenate([getattr(p, name) for p in pictures]).astype(kind)
        for name, kind in COLUMNS.items()
    }
    partial = path.with_name(f"{path.stem}.part.npz")
    content["shape"] = np.array([p.shape for p in pictures])
    content["count"] = np.array([len(p.boxes) for p in pictures])
    np.savez(partial, **content)
    partial.replace(path)


def read_pool(path: Path) -> list[Picture]:
    """Read what `write_pool` wrote.

    Raises
    ------
    InputError
        If the file is no such file.
    """
    try:
        # Opened here: NumPy leaves a damaged archive open.
        with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            content: dict[str, npt.NDArray[Any]] = {
                name: stored[name] for name in (*COLUMNS, "shape", "count")
            }
        return _pictures(content)
    except (OSError, EOFError, ValueError, KeyError, TypeError, BadZipFile) as error:
        reason = " ".join(str(error).split())[:80]
        raise InputError(
            f"candidates {path}", f"expected what a run has written, got: {reason}", "delete it"
        ) from None


def _pictures(content: dict[str, npt.NDArray[Any]]) -> list[Picture]:
    ends = np.cumsum(content["count"])
    pictures = []
    for shape, end, count in zip(content["shape"].tolist(), ends, content["count"], strict=True):
        rows = {name: content[name][end - count : end] for name in COLUMNS}
        rows |= {name: rows[name].astype(kind) for name, kind in WHOLE.items()}
        if any(len(values) != count for values in rows.values()):
            raise ValueError(f"fewer than {end} rows")
        pictures.append(Picture((shape[0], shape[1]), **rows))
    return pictures
