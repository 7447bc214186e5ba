"""The network that reads labels: crops of buttons and plates to probabilities."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from importlib.resources import files
from pathlib import Path

import numpy as np
import numpy.typing as npt

from fronto.cores import usable_cores
from fronto.engine.companion import find_companion, open_network
from fronto.engine.context import ContextEngine
from fronto.engine.onnxfile import checked_bytes, find_weights
from fronto.errors import InputError
from fronto.labels.alphabet import CROP_PX, KINDS

__all__ = ["FORMAT", "LabelScores", "ReaderEngine", "packaged_reader"]

#: What the file's inputs and outputs mean; written into it by `fronto.train.reader`.
FORMAT = "fronto.labels/1"
#: How far the sum of probabilities may be from 1: what half precision makes of it.
SUM_TOLERANCE = 0.01


@dataclass(frozen=True, eq=False)
class LabelScores:
    """What the network says about N crops.

    Parameters
    ----------
    text
        Shape (N, T, 1 + len(alphabet)): probabilities at T steps from left to right, of the
        blank of connectionist temporal classification and of each character.
    kind
        Shape (N, kinds): probabilities of `ReaderEngine.kinds`.
    """

    text: npt.NDArray[np.float32]
    kind: npt.NDArray[np.float32]


class ReaderEngine:
    """A network that reads labels, ready to run; several threads may share one.

    Parameters
    ----------
    path
        The ONNX file; None: the one in the package. Where its name ends in eight hexadecimal
        digits (``fronto-read-1a2b3c4d.onnx``), they must begin its SHA-256. The context head
        beside it (``fronto-read-1a2b3c4d.context-5e6f7a8b.onnx``) is used, where there is one.
    threads
        Threads that work on one call; None: as many as `usable_cores` counts.
    providers
        ONNX Runtime's names of what to compute on, best first; None: the processor.
    int8
        Whether it runs in 8 bits where such a file lies beside it
        (``fronto-read-1a2b3c4d.int8-5e6f7a8b.onnx``); None: on the processor, where that takes two
        fifths of its time.

    Raises
    ------
    InputError
        If a file is missing, damaged or another one than its name says, no ONNX, no
        network of this format, a head for another reader, or if a provider or the number of
        threads cannot be had.

    Attributes
    ----------
    path
        The file.
    metadata
        What is written in the file: version, license, training_data, ...
    alphabet
        The characters of `LabelScores.text`, in the order of its channels from 1.
    kinds
        Names of the channels of `LabelScores.kind`.
    threads
        As given or counted.
    digest
        First eight hexadecimal digits of the file's SHA-256.
    int8
        Whether it runs in 8 bits.
    context
        What weighs the buttons of a panel together; None where there is none.
    """

    path: Path
    metadata: Mapping[str, str]
    alphabet: str
    kinds: tuple[str, ...]
    threads: int
    digest: str
    int8: bool
    context: ContextEngine | None

    def __init__(
        self,
        path: Path | None = None,
        *,
        threads: int | None = None,
        providers: Sequence[str] | None = None,
        int8: bool | None = None,
    ) -> None:
        self.path = find_weights(stem="fronto-read") if path is None else Path(path)
        file, self.digest, self.int8 = open_network(self.path, FORMAT, threads, providers, int8)
        self.metadata, self.threads = file.metadata, file.threads
        self.alphabet, self.kinds = file.metadata.get("alphabet", ""), file.names("kinds")
        if not self.alphabet or len(set(self.alphabet)) < len(self.alphabet):
            raise InputError(
                f"{file.thing}, alphabet",
                f"expected different characters, got {self.alphabet!r}",
                "export it again",
            )
        if sorted(self.kinds) != sorted(KINDS):
            raise InputError(
                f"{file.thing}, kinds",
                f"expected {','.join(KINDS)}, got {','.join(self.kinds) or 'none'}",
                "export it again",
            )
        file.check_signature(
            {"crops": (None, CROP_PX, CROP_PX, 3)},
            {"text": (None, None, 1 + len(self.alphabet)), "kind": (None, len(self.kinds))},
        )
        self._file = file
        companion = find_companion(self.path, "context")
        self.context = None
        if companion is not None:
            self.context = ContextEngine(
                companion, network=self.digest, threads=threads, providers=providers
            )

    def run(self, crops: npt.NDArray[np.uint8]) -> LabelScores:
        """Run the network.

        Parameters
        ----------
        crops
            Shape (N, 48, 48, 3), uint8, RGB, as `fronto.labels.crops.crops` cuts them.

        Raises
        ------
        InputError
            If the crops are of another type or shape, or too many for the memory.
        """
        n, *_ = checked_bytes(
            crops, (None, CROP_PX, CROP_PX, 3), "crops", f"(N, {CROP_PX}, {CROP_PX}, 3)"
        )
        shapes = {"text": (n, None, 1 + len(self.alphabet)), "kind": (n, len(self.kinds))}
        outputs = self._file.run({"crops": crops}, shapes, "give fewer crops at a time")
        for name, values in zip(shapes, outputs, strict=True):
            off = np.abs(values.sum(axis=-1) - 1)
            if not (values.min(initial=0) >= 0 and off.max(initial=0) <= SUM_TOLERANCE):
                raise InputError(
                    f"{self._file.thing}, {name}",
                    "expected probabilities of sum 1, got other numbers",
                    "export it again",
                )
        return LabelScores(*outputs)


def packaged_reader(threads: int | None = None) -> ReaderEngine | None:
    """The reader of the package; None where the package has no weights for one.

    Made on first use, then kept.

    Parameters
    ----------
    threads
        That work on one call; None: all usable cores.

    Raises
    ------
    InputError
        If there are weights, and they cannot be used.
    """
    return _packaged(usable_cores() if threads is None else threads)


@cache
def _packaged(threads: int) -> ReaderEngine | None:
    names = [file.name for file in (files("fronto") / "weights").iterdir()]
    if not any(name.startswith("fronto-read-") for name in names):
        return None
    return ReaderEngine(threads=threads)
