"""The relation head: which candidates of a picture are buttons, judged together."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from fronto.engine.companion import check_companion
from fronto.engine.onnxfile import FLOATS, OnnxFile
from fronto.relations import CELLS, GEOMETRY, PAIR, Candidates

__all__ = ["FORMAT", "RelationEngine", "Verdicts"]

#: What the file's inputs and outputs mean; written into it by `fronto.train.relations`.
FORMAT = "fronto.relations/1"
#: Nothing, a button, a plate.
KINDS = 3


@dataclass(frozen=True, eq=False)
class Verdicts:
    """What the relation head says about N candidates.

    Parameters
    ----------
    kinds
        Shape (N, 3): probability of being nothing, a button, a plate.
    classes
        Shape (N, classes): probabilities of `Engine.classes`, if it is something; the
        background's is about 0.
    shifts
        Shape (N, 4): how far the left, top, right and bottom edge of the box are off, in
        shares of its sides, right and down positive.
    """

    kinds: npt.NDArray[np.float32]
    classes: npt.NDArray[np.float32]
    shifts: npt.NDArray[np.float32]


class RelationEngine:
    """A relation head, ready to run; several threads may share one.

    Parameters
    ----------
    path
        The ONNX file.
    network
        First eight hexadecimal digits of the SHA-256 of the network's file: the head
        understands the features of that network only.
    channels, classes
        The network's, of its features and of its classes.
    threads
        Threads that work on one call; None: as many as `usable_cores` counts.
    providers
        ONNX Runtime's names of what to compute on, best first; None: the processor.

    Raises
    ------
    InputError
        If the file is missing, damaged or another one than its name says, no ONNX, of another
        format or for another network.

    Attributes
    ----------
    path
        The file.
    metadata
        What is written in the file.
    """

    path: Path
    metadata: Mapping[str, str]

    def __init__(
        self,
        path: Path,
        *,
        network: str,
        channels: int,
        classes: int,
        threads: int | None = None,
        providers: Sequence[str] | None = None,
    ) -> None:
        file = OnnxFile(path, FORMAT, threads, providers)
        self.path, self.metadata = file.path, file.metadata
        check_companion(file, network)
        file.check_signature(
            {
                "looks": (None, CELLS**2, channels),
                "geometry": (None, GEOMETRY),
                "pairs": (None, None, PAIR),
            },
            {"kinds": (None, KINDS), "classes": (None, classes), "shifts": (None, 4)},
            takes=FLOATS,
        )
        self._file, self._classes = file, classes

    def run(self, candidates: Candidates) -> Verdicts:
        """Judge the candidates of one picture.

        Raises
        ------
        InputError
            If the network does not run on them, or answers with no numbers.
        """
        n = len(candidates.looks)
        inputs = {
            "looks": candidates.looks,
            "geometry": candidates.geometry,
            "pairs": candidates.pairs,
        }
        shapes = {"kinds": (n, KINDS), "classes": (n, self._classes), "shifts": (n, 4)}
        return Verdicts(*self._file.run(inputs, shapes, "give another network", finite=True))
