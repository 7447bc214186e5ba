"""What a context head learns from: panels as they are read, and what their buttons are called."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np
import numpy.typing as npt

from fronto.errors import InputError
from fronto.labels.context import Context

__all__ = ["Example", "read_examples", "write_examples"]


@dataclass(frozen=True, eq=False)
class Example:
    """One panel with n things.

    Parameters
    ----------
    context
        What the head is told.
    target
        Shape (n,): number of the label, among those that the head knows and what there is
        besides; -1 for no verdict.
    weight
        Shape (n,): what each verdict counts.
    """

    context: Context
    target: npt.NDArray[np.int64]
    weight: npt.NDArray[np.float32]

    def part(self, kept: npt.NDArray[np.bool_]) -> Example:
        """Those things, (n,), that are kept."""
        c = self.context
        return Example(
            Context(
                c.own[kept],
                c.seen[kept],
                c.ordered[kept],
                c.geometry[kept],
                c.pairs[np.ix_(kept, kept)],
            ),
            self.target[kept],
            self.weight[kept],
        )


#: Parts of a context that have a row for each thing; of pairs there is one for each two.
ROWS = tuple(field.name for field in fields(Context) if field.name != "pairs")


def write_examples(path: Path, examples: Sequence[Example]) -> None:
    """Write examples, in one piece: a run that is killed meanwhile leaves no half file."""
    contexts = [e.context for e in examples]
    content: dict[str, Any] = {name: _joined([getattr(c, name) for c in contexts]) for name in ROWS}
    content["pairs"] = _joined([c.pairs.reshape(-1, c.pairs.shape[2]) for c in contexts])
    content["target"] = np.array([k for e in examples for k in e.target], np.int64)
    content["weight"] = np.array([w for e in examples for w in e.weight], np.float32)
    content["count"] = np.array([len(e.target) for e in examples], np.int64)
    partial = path.with_name(f"{path.stem}.part.npz")
    np.savez_compressed(partial, **content)
    partial.replace(path)


def _joined(parts: list[npt.NDArray[np.float32]]) -> npt.NDArray[np.float16]:
    # To three digits: readings are no more exact, and memory is short.
    return np.concatenate(parts).astype(np.float16) if parts else np.empty((0, 0), np.float16)


def read_examples(path: Path) -> list[Example]:
    """Read what `write_examples` wrote.

    Raises
    ------
    InputError
        If the file is no such file.
    """
    try:
        # Opened here: NumPy leaves a damaged archive open.
        with path.open("rb") as file, np.load(file, allow_pickle=False) as stored:
            content: dict[str, npt.NDArray[Any]] = {
                name: stored[name] for name in (*ROWS, "pairs", "target", "weight", "count")
            }
        return _examples(content)
    except (OSError, EOFError, ValueError, KeyError, TypeError, BadZipFile) as error:
        reason = " ".join(str(error).split())[:80]
        raise InputError(
            f"panels {path}", f"expected what a run has written, got: {reason}", "delete it"
        ) from None


def _examples(content: dict[str, npt.NDArray[Any]]) -> list[Example]:
    found = []
    counts = content["count"]
    ends, squares = np.cumsum(counts), np.cumsum(counts**2)
    for n, end, square in zip(counts.tolist(), ends, squares, strict=True):
        rows = {name: content[name][end - n : end] for name in (*ROWS, "target", "weight")}
        if any(len(values) != n for values in rows.values()):
            raise ValueError(f"fewer than {end} rows")
        target, weight = rows.pop("target"), rows.pop("weight")
        pairs = content["pairs"][square - n * n : square].reshape(n, n, -1)
        found.append(Example(Context(pairs=pairs, **rows), target, weight))
    return found
