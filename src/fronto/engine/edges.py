"""The edge head: which of the photo's edges is a button's."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache
from pathlib import Path

import numpy as np
import numpy.typing as npt

from fronto.engine.companion import check_companion, find_companion
from fronto.engine.onnxfile import FLOATS, OnnxFile, find_weights
from fronto.errors import InputError
from fronto.outlines.edgeprofiles import ABOUT, BINS, CHANNELS, CURVES

Floats = npt.NDArray[np.float32]

__all__ = ["FORMAT", "EdgeEngine", "packaged_edges"]

#: What the file's inputs and outputs mean; written into it by `fronto.train.edges`.
FORMAT = "fronto.edges/1"


class EdgeEngine:
    """An edge head, ready to run; several threads may share one.

    Parameters
    ----------
    path
        The ONNX file.
    network
        First eight hexadecimal digits of the SHA-256 of the network's file: the head was trained
        on the masks that are drawn for that network. None: of whichever.
    threads
        Threads that work on one call; it is so small that one is fastest.
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
        network: str | None = None,
        threads: int | None = 1,
        providers: Sequence[str] | None = None,
    ) -> None:
        file = OnnxFile(path, FORMAT, threads, providers)
        self.path, self.metadata = file.path, file.metadata
        if network is not None:
            check_companion(file, network)
        file.check_signature(
            {"profiles": (None, CURVES, BINS, CHANNELS), "about": (None, ABOUT)},
            {"places": (None, CURVES, BINS)},
            takes=FLOATS,
        )
        self._file = file

    def run(self, profiles: Floats, about: Floats) -> Floats:
        """Tell where the edges of one photo's outlines are.

        Parameters
        ----------
        profiles
            Shape (n, 8, 64, 4), float32, as `fronto.outlines.edgeprofiles.profiles` makes them, of
            all outlines of a photo: their edges are alike.
        about
            Shape (n, 3), float32, as `fronto.outlines.edgeprofiles.about` makes it.

        Returns
        -------
        Shape (n, 8, 64): probabilities of the places across each curve.

        Raises
        ------
        InputError
            If they are of another type or shape, or the network does not run on them, or answers
            with no numbers.
        """
        n = len(profiles)
        for name, values, shape in (
            ("profiles", profiles, (n, CURVES, BINS, CHANNELS)),
            ("about", about, (n, ABOUT)),
        ):
            if values.dtype != np.float32 or values.shape != shape:
                raise InputError(
                    name,
                    f"expected float32 of shape {shape}, got {values.dtype} of {values.shape}",
                    "fronto.outlines.edgeprofiles makes them",
                )
        if not n:
            return np.zeros((0, CURVES, BINS), np.float32)
        inputs = {"profiles": profiles, "about": about}
        places = {"places": (n, CURVES, BINS)}
        (told,) = self._file.run(inputs, places, "give another network", finite=True)
        return told


@cache
def packaged_edges() -> EdgeEngine | None:
    """The edge head of the packaged network; None where the package has none.

    Made on first use, then kept.

    Raises
    ------
    InputError
        If there is one, and it cannot be used.
    """
    path = find_companion(find_weights(), "edges")
    return None if path is None else EdgeEngine(path)
