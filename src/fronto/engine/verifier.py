"""The verifier: what each find is, by itself, from the photo around it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import numpy.typing as npt

from fronto.engine.companion import check_companion
from fronto.engine.onnxfile import OnnxFile, checked_bytes
from fronto.verification import KINDS, SIDE, Opinions

__all__ = ["FORMAT", "VerifierEngine"]

#: What the file's inputs and outputs mean; written into it by `fronto.train.verifier`.
FORMAT = "fronto.verifier/1"
#: Patches in one call: what memory there is sets no limit to the number of finds.
AT_ONCE = 64


class VerifierEngine:
    """A verifier, ready to run; several threads may share one.

    Parameters
    ----------
    path
        The ONNX file.
    network
        First eight hexadecimal digits of the SHA-256 of the network's file: the verifier was
        trained on what that network finds.
    classes
        Categories of the network.
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
        classes: int,
        threads: int | None = None,
        providers: Sequence[str] | None = None,
    ) -> None:
        file = OnnxFile(path, FORMAT, threads, providers)
        self.path, self.metadata = file.path, file.metadata
        check_companion(file, network)
        file.check_signature(
            {"patches": (None, SIDE, SIDE, 3)},
            {"kinds": (None, KINDS), "classes": (None, classes)},
        )
        self._file, self._classes = file, classes

    def run(self, patches: npt.NDArray[np.uint8]) -> Opinions:
        """Tell what finds are.

        Parameters
        ----------
        patches
            Shape (N, 64, 64, 3), uint8, RGB, as `fronto.verification.describe` cuts them.

        Raises
        ------
        InputError
            If they are of another type or shape, or the network does not run on them, or answers
            with no numbers.
        """
        checked_bytes(patches, (None, SIDE, SIDE, 3), "patches", f"(N, {SIDE}, {SIDE}, 3)")
        parts = [
            self._some(patches[k : k + AT_ONCE]) for k in range(0, max(len(patches), 1), AT_ONCE)
        ]
        kinds, classes = (np.concatenate(part) for part in zip(*parts, strict=True))
        return Opinions(kinds, classes)

    def _some(
        self, patches: npt.NDArray[np.uint8]
    ) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
        shapes = {"kinds": (len(patches), KINDS), "classes": (len(patches), self._classes)}
        kinds, classes = self._file.run(
            {"patches": patches}, shapes, "give another network", finite=True
        )
        return kinds, classes
