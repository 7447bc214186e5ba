"""The mask head: the exact mask of each find, from the photo around it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from fronto.engine.companion import check_companion
from fronto.engine.onnxfile import OnnxFile
from fronto.maskhead import FORMS, SIDE, Patches

__all__ = ["FORMAT", "DrawnMasks", "MaskEngine"]

#: What the file's inputs and outputs mean; written into it by `fronto.train.masks`.
FORMAT = "fronto.masks/1"
#: Patches in one call: what memory there is sets no limit to the number of finds.
AT_ONCE = 64


@dataclass(frozen=True, eq=False)
class DrawnMasks:
    """What the mask head says about N patches.

    Parameters
    ----------
    masks
        Shape (N, 48, 48): probability that a pixel of the patch belongs to the find.
    forms
        Shape (N, 3): probability of each of `fronto.maskhead.FORMS`.
    """

    masks: npt.NDArray[np.float32]
    forms: npt.NDArray[np.float32]


class MaskEngine:
    """A mask head, ready to run; several threads may share one.

    Parameters
    ----------
    path
        The ONNX file.
    network
        First eight hexadecimal digits of the SHA-256 of the network's file: the head was
        trained on the rough masks of that network.
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
        threads: int | None = None,
        providers: Sequence[str] | None = None,
    ) -> None:
        file = OnnxFile(path, FORMAT, threads, providers)
        self.path, self.metadata = file.path, file.metadata
        check_companion(file, network)
        file.check_signature(
            {"photo": (None, SIDE, SIDE, 3), "rough": (None, SIDE, SIDE)},
            {"masks": (None, SIDE, SIDE), "forms": (None, len(FORMS))},
        )
        self._file = file

    def run(self, patches: Patches) -> DrawnMasks:
        """Draw the masks of one photo's finds.

        Raises
        ------
        InputError
            If the network does not run on them, or answers with no numbers.
        """
        n = len(patches.photo)
        parts = [
            self._some(patches.photo[k : k + AT_ONCE], patches.rough[k : k + AT_ONCE])
            for k in range(0, n, AT_ONCE)
        ]
        return DrawnMasks(
            np.concatenate([masks for masks, _ in parts]),
            np.concatenate([forms for _, forms in parts]),
        )

    def _some(
        self, photo: npt.NDArray[np.uint8], rough: npt.NDArray[np.uint8]
    ) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
        shapes = {"masks": (len(photo), SIDE, SIDE), "forms": (len(photo), len(FORMS))}
        masks, forms = self._file.run(
            {"photo": photo, "rough": rough}, shapes, "give another network", finite=True
        )
        return masks, forms
