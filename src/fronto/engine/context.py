"""The context head: what a panel's buttons are called, told of all of them together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from fronto.engine.companion import check_companion
from fronto.engine.onnxfile import FLOATS, OnnxFile
from fronto.errors import InputError
from fronto.labels.context import BESIDES, GEOMETRY, PAIR, Context

__all__ = ["FORMAT", "ContextEngine"]

#: What the file's inputs and outputs mean; written into it by `fronto.train.context`.
FORMAT = "fronto.context/1"
#: How far the sum of probabilities may be from 1.
SUM_TOLERANCE = 0.01


class ContextEngine:
    """A context head, ready to run; several threads may share one.

    Parameters
    ----------
    path
        The ONNX file.
    network
        First eight hexadecimal digits of the SHA-256 of the reader's file: the head knows how
        far that reader's word can be trusted.
    threads
        Threads that work on one call; None: as many as `usable_cores` counts.
    providers
        ONNX Runtime's names of what to compute on, best first; None: the processor.

    Raises
    ------
    InputError
        If the file is missing, damaged or another one than its name says, no ONNX, of another
        format or for another reader.

    Attributes
    ----------
    path
        The file.
    metadata
        What is written in the file.
    labels
        Those that it knows, in the order of its outputs.
    """

    path: Path
    metadata: Mapping[str, str]
    labels: tuple[str, ...]

    def __init__(
        self,
        path: Path,
        *,
        network: str,
        threads: int | None = None,
        providers: Sequence[str] | None = None,
    ) -> None:
        file = OnnxFile(path, FORMAT, threads, providers)
        self.path, self.metadata = file.path, file.metadata
        check_companion(file, network)
        self.labels = file.names("labels")
        if not self.labels or len(set(self.labels)) < len(self.labels):
            raise InputError(
                f"{file.thing}, labels",
                f"expected different labels, got {','.join(self.labels) or 'none'}",
                "export it again",
            )
        count = len(self.labels) + BESIDES
        file.check_signature(
            {
                "own": (None, count),
                "seen": (None, count),
                "ordered": (None, count),
                "geometry": (None, GEOMETRY),
                "pairs": (None, None, PAIR),
            },
            {"labels": (None, count)},
            takes=FLOATS,
        )
        self._file = file

    def run(self, context: Context) -> npt.NDArray[np.float32]:
        """Tell what the things of one panel may be called.

        Returns
        -------
        Shape (n, labels + 2): probabilities of `labels`, of none and of another label.

        Raises
        ------
        InputError
            If the network does not run on them, or answers with no probabilities.
        """
        shapes = {"labels": (len(context.own), len(self.labels) + BESIDES)}
        (found,) = self._file.run(vars(context), shapes, "train it again")
        off = np.abs(found.sum(axis=1) - 1)
        if not (found.min(initial=0) >= 0 and off.max(initial=0) <= SUM_TOLERANCE):
            raise InputError(
                f"{self._file.thing}, labels",
                "expected probabilities of sum 1, got other numbers",
                "train it again",
            )
        return found
