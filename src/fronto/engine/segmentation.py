"""The network that finds buttons: pictures to maps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from fronto.engine.companion import find_companion, open_network
from fronto.engine.edges import EdgeEngine
from fronto.engine.masks import MaskEngine
from fronto.engine.onnxfile import checked_bytes, find_weights
from fronto.engine.reader import ReaderEngine, packaged_reader
from fronto.engine.relations import RelationEngine
from fronto.engine.verifier import VerifierEngine
from fronto.errors import InputError

__all__ = ["FORMAT", "Engine", "Maps"]

#: What the file's inputs and outputs mean; written into it by `fronto.train.export`.
FORMAT = "fronto.segmentation/2"

FloatMaps = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Maps:
    """What the network says about N pictures of H x W pixels.

    Cells are `Engine.stride` pixels wide: h = H / stride, w = W / stride, and the centre of
    cell (i, j) is at the pixel x = stride (j + 0.5) - 0.5, y = stride (i + 0.5) - 0.5.

    Parameters
    ----------
    masks
        Shape (N, 2, H, W): probability of "button" and of "plate" for each pixel.
    classes
        Shape (N, classes, h, w): probabilities of `Engine.classes`.
    centers
        Shape (N, 2, h, w): probability that the centre of a button (of a plate) is there.
    sides
        Shape (N, 4, h, w): pixels from the cell's centre to the left, top, right and bottom
        of the box around its button.
    features
        Shape (N, C, h, w): what the decoder tells all these from; None where there is no
        relation head to take them, and nobody asked.
    """

    masks: FloatMaps
    classes: FloatMaps
    centers: FloatMaps
    sides: FloatMaps
    features: FloatMaps | None = None


class Engine:
    """A segmentation network, ready to run; several threads may share one.

    On the processor it keeps the memory of its largest call (about 90 MB for each picture of
    640 x 640): running many pictures one by one needs less than one batch of them, and is
    no slower.

    Parameters
    ----------
    path
        The ONNX file, as ``fronto export`` writes it; None: the one in the package. Where
        its name ends in eight hexadecimal digits (``fronto-seg-1a2b3c4d.onnx``), they must
        begin its SHA-256. The relation head, the verifier, the mask head and the edge head that lie
        beside it (``fronto-seg-1a2b3c4d.relations-5e6f7a8b.onnx``, ``...verifier-5e6f7a8b.onnx``,
        ``...masks-5e6f7a8b.onnx``, ``...edges-5e6f7a8b.onnx``) are used, where there are any, and
        so is the same network in 8 bits (``...int8-5e6f7a8b.onnx``).
    threads
        Threads that work on one call; None: as many as `usable_cores` counts.
    providers
        ONNX Runtime's names of what to compute on, best first, such as
        ``["CUDAExecutionProvider", "CPUExecutionProvider"]``; None: the processor.
    int8
        Whether the network runs in 8 bits where such a file lies beside it; None: on the
        processor, where that takes about half of its time.

    Raises
    ------
    InputError
        If the file is missing, damaged or another one than its name says, no ONNX, no
        network of this format, or if a provider or the number of threads cannot be had.

    Attributes
    ----------
    path
        The file.
    digest
        First eight hexadecimal digits of the file's SHA-256.
    int8
        Whether it runs in 8 bits.
    metadata
        What is written in the file: version, license, training_data, ...
    classes
        Names of the channels of `Maps.classes`.
    stride
        Pixels of a cell.
    channels
        Of `Maps.features`.
    multiple
        Height and width of a picture must be multiples of this.
    threads
        As given or counted.
    relations
        The relation head; None where there is none.
    verifier
        What tells of each find by itself what it is; None where there is none.
    masks
        The mask head; None where there is none.
    edges
        The edge head, for `fronto.outline`; None where there is none.
    """

    path: Path
    digest: str
    int8: bool
    metadata: Mapping[str, str]
    classes: tuple[str, ...]
    stride: int
    channels: int
    multiple: int
    threads: int
    relations: RelationEngine | None
    verifier: VerifierEngine | None
    masks: MaskEngine | None
    edges: EdgeEngine | None

    def __init__(
        self,
        path: Path | None = None,
        *,
        threads: int | None = None,
        providers: Sequence[str] | None = None,
        int8: bool | None = None,
    ) -> None:
        self.path = find_weights() if path is None else Path(path)
        file, self.digest, self.int8 = open_network(self.path, FORMAT, threads, providers, int8)
        self.metadata, self.threads = file.metadata, file.threads
        self.classes = file.names("classes")
        self.stride, self.multiple = file.whole("stride"), file.whole("multiple")
        if self.multiple % self.stride or not self.classes:
            raise InputError(
                file.thing,
                "expected names of classes, and a multiple that the stride divides, "
                f"got {len(self.classes)}, {self.multiple} and {self.stride}",
                "export it again",
            )
        self._channels = {"masks": 2, "classes": len(self.classes), "centers": 2, "sides": 4}
        self.channels = file.whole("channels")
        file.check_signature(
            {"image": (None, None, None, 3)},
            {
                name: (None, count, None, None)
                for name, count in (*self._channels.items(), ("features", self.channels))
            },
        )
        companion = find_companion(self.path)
        self.relations = None
        if companion is not None:
            self.relations = RelationEngine(
                companion,
                network=self.digest,
                channels=self.channels,
                classes=len(self.classes),
                threads=threads,
                providers=providers,
            )
        companion = find_companion(self.path, "verifier")
        self.verifier = None
        if companion is not None:
            self.verifier = VerifierEngine(
                companion,
                network=self.digest,
                classes=len(self.classes),
                threads=threads,
                providers=providers,
            )
        companion = find_companion(self.path, "masks")
        self.masks = None
        if companion is not None:
            self.masks = MaskEngine(
                companion, network=self.digest, threads=threads, providers=providers
            )
        companion = find_companion(self.path, "edges")
        self.edges = None
        if companion is not None:
            self.edges = EdgeEngine(companion, network=self.digest, providers=providers)
        self._file = file

    @property
    def reader(self) -> ReaderEngine | None:
        """What reads prints on finds (`fronto.prints`): the package's; None where it has none."""
        return packaged_reader(self.threads)

    def run(self, images: npt.NDArray[np.uint8], *, features: bool | None = None) -> Maps:
        """Run the network.

        Parameters
        ----------
        images
            Shape (N, H, W, 3), uint8, RGB; H and W multiples of `multiple`.
        features
            Whether the decoder's features are given, too; None: if there is a relation head.

        Returns
        -------
        Its maps, in the pixels of the pictures.

        Raises
        ------
        InputError
            If the pictures are of another type or shape, or too large for the memory.
        """
        n, height, width, _ = checked_bytes(images, (None, None, None, 3), "images", "(N, H, W, 3)")
        if height % self.multiple or width % self.multiple:
            raise InputError(
                "images",
                f"expected height and width to be multiples of {self.multiple}, "
                f"got {images.dtype} of shape {images.shape}",
                "pad them (fronto.scales does)",
            )
        small = (height // self.stride, width // self.stride)
        channels = dict(self._channels)
        if features or (features is None and self.relations is not None):
            channels["features"] = self.channels
        shapes = {
            name: (n, count, *((height, width) if name == "masks" else small))
            for name, count in channels.items()
        }
        remedy = "give fewer or smaller pictures, or the network of the package"
        return Maps(*self._file.run({"image": images}, shapes, remedy))
