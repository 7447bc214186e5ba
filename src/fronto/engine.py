"""The only room that touches ONNX Runtime: a segmentation network's file, loaded and run."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
import numpy.typing as npt

from fronto._version import __version__
from fronto.cores import usable_cores
from fronto.errors import InputError
from fronto.files import read_bytes

__all__ = ["FORMAT", "Engine", "Maps", "find_weights"]

#: What the file's inputs and outputs mean; written into it by `fronto.train.export`.
FORMAT = "fronto.segmentation/1"
#: Far above any network that would be usable on a processor; ONNX itself ends at 2 GB.
MAX_BYTES = 1_000_000_000
#: ``fronto-seg-1a2b3c4d.onnx``: the first digits of the file's SHA-256.
HASHED = re.compile(r"-([0-9a-f]{8})\.onnx\Z")
CPU = "CPUExecutionProvider"
#: ONNX Runtime's "fatal": errors come as exceptions, and nothing is to be printed beside them.
SILENT = 4

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
    """

    masks: FloatMaps
    classes: FloatMaps
    centers: FloatMaps
    sides: FloatMaps


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
        begin its SHA-256.
    threads
        Threads that work on one call; None: as many as `usable_cores` counts.
    providers
        ONNX Runtime's names of what to compute on, best first, such as
        ``["CUDAExecutionProvider", "CPUExecutionProvider"]``; None: the processor.

    Raises
    ------
    InputError
        If the file is missing, damaged or another one than its name says, no ONNX, no
        network of this format, or if a provider or the number of threads cannot be had.

    Attributes
    ----------
    path
        The file.
    metadata
        What is written in the file: version, license, training_data, ...
    classes
        Names of the channels of `Maps.classes`.
    stride
        Pixels of a cell.
    multiple
        Height and width of a picture must be multiples of this.
    threads
        As given or counted.
    """

    path: Path
    metadata: Mapping[str, str]
    classes: tuple[str, ...]
    stride: int
    multiple: int
    threads: int

    def __init__(
        self,
        path: Path | None = None,
        *,
        threads: int | None = None,
        providers: Sequence[str] | None = None,
    ) -> None:
        self.path = find_weights() if path is None else Path(path)
        self.threads = usable_cores() if threads is None else _check_threads(threads)
        self._thing = f"weights {self.path}"
        content = read_bytes(self.path, self._thing, MAX_BYTES)
        _check_hash(content, self.path.name, self._thing)
        self._session = _session(content, self.threads, _providers(providers), self._thing)
        self.metadata = MappingProxyType(dict(self._session.get_modelmeta().custom_metadata_map))
        _check_format(self.metadata, self._thing)
        self.classes = tuple(filter(None, self.metadata.get("classes", "").split(",")))
        self.stride = _whole(self.metadata, "stride", self._thing)
        self.multiple = _whole(self.metadata, "multiple", self._thing)
        if self.multiple % self.stride or not self.classes:
            raise InputError(
                self._thing,
                "expected names of classes, and a multiple that the stride divides, "
                f"got {len(self.classes)}, {self.multiple} and {self.stride}",
                "export it again",
            )
        self._channels = {"masks": 2, "classes": len(self.classes), "centers": 2, "sides": 4}
        _check_signature(self._session, self._channels, self._thing)

    def run(self, images: npt.NDArray[np.uint8]) -> Maps:
        """Run the network.

        Parameters
        ----------
        images
            Shape (N, H, W, 3), uint8, RGB; H and W multiples of `multiple`.

        Returns
        -------
        Its maps, in the pixels of the pictures.

        Raises
        ------
        InputError
            If the pictures are of another type or shape, or too large for the memory.
        """
        shape = self._check_images(images)
        try:
            outputs = self._session.run(
                list(self._channels), {"image": np.ascontiguousarray(images)}
            )
        except Exception as error:  # ONNX Runtime's own types, which are not public
            raise InputError(
                self._thing,
                f"expected a network that runs on pictures of shape {shape}, got: {_reason(error)}",
                "give fewer or smaller pictures, or the network of the package",
            ) from None
        n, height, width, _ = shape
        for (name, channels), output in zip(self._channels.items(), outputs, strict=True):
            step = 1 if name == "masks" else self.stride
            expected = (n, channels, height // step, width // step)
            if output.shape != expected:
                raise InputError(
                    self._thing,
                    f"expected {name} of shape {expected}, got {output.shape}",
                    "export the network again",
                )
        return Maps(*outputs)

    def _check_images(self, images: npt.NDArray[np.uint8]) -> tuple[int, ...]:
        found = (
            f"{images.dtype} of shape {images.shape}"
            if isinstance(images, np.ndarray)
            else type(images).__name__
        )
        if not isinstance(images, np.ndarray) or images.dtype != np.uint8:
            raise InputError("images", f"expected uint8 of shape (N, H, W, 3), got {found}")
        if images.ndim != 4 or images.shape[3] != 3 or images.size == 0:
            raise InputError("images", f"expected uint8 of shape (N, H, W, 3), got {found}")
        if images.shape[1] % self.multiple or images.shape[2] % self.multiple:
            raise InputError(
                "images",
                f"expected height and width to be multiples of {self.multiple}, got {found}",
                "pad them (fronto.scales does)",
            )
        return images.shape


def find_weights(folder: Traversable | None = None) -> Path:
    """The network in the package, or the one in another folder.

    Raises
    ------
    InputError
        If there is none, or more than one.
    """
    folder = files("fronto") / "weights" if folder is None else folder
    found = sorted(str(f) for f in folder.iterdir()) if folder.is_dir() else []
    found = [name for name in found if name.endswith(".onnx")]
    if len(found) != 1:
        names = ", ".join(Path(name).name for name in found) or "none"
        raise InputError(
            f"weights folder {folder}",
            f"expected one .onnx file, got {names}",
            "install fronto again, or name a file of your own",
        )
    return Path(found[0])


def _check_threads(threads: int) -> int:
    if not isinstance(threads, int) or isinstance(threads, bool) or threads < 1:
        raise InputError("threads", f"expected a whole number from 1, got {threads!r}")
    return threads


def _check_hash(content: bytes, name: str, thing: str) -> None:
    expected = HASHED.search(name)
    if expected is None:
        return
    found = hashlib.sha256(content).hexdigest()[:8]
    if found != expected[1]:
        raise InputError(
            thing,
            f"expected the SHA-256 in its name, {expected[1]}, got {found}: a damaged copy",
            "copy it again or install fronto again, or rename it if you changed it yourself",
        )


def _providers(providers: Sequence[str] | None) -> list[str]:
    if providers is None:
        return [CPU]
    import onnxruntime  # type: ignore[import-untyped]

    available = onnxruntime.get_available_providers()
    names = [providers] if isinstance(providers, str) else list(providers)
    unknown = [name for name in names if name not in available]
    if unknown or not names:
        raise InputError(
            "providers",
            f"expected some of {', '.join(available)}, got {unknown[0] if unknown else 'none'}",
            "install the ONNX Runtime that has it, or choose another one",
        )
    return names


def _session(content: bytes, threads: int, providers: list[str], thing: str) -> Any:
    """An `onnxruntime.InferenceSession`."""
    import onnxruntime

    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = threads
    options.inter_op_num_threads = 1
    options.log_severity_level = SILENT
    # Threads that wait for work by spinning take the cores from others between calls.
    options.add_session_config_entry("session.intra_op.allow_spinning", "0")
    try:
        # Its fallback prints, and hides that the provider asked for does not work.
        session = onnxruntime.InferenceSession(
            content, options, providers=providers, enable_fallback=0
        )
    except Exception as error:  # ONNX Runtime's own types, which are not public
        raise InputError(
            thing,
            f"expected a whole ONNX file, got: {_reason(error)}",
            "copy it again, or give one that fronto wrote",
        ) from None
    missing = [name for name in providers if name not in session.get_providers()]
    if missing:
        raise InputError(
            "providers",
            f"expected {missing[0]} to start, it did not",
            "install what it needs (drivers, libraries), or choose another one",
        )
    return session


def _check_format(metadata: Mapping[str, str], thing: str) -> None:
    found = metadata.get("format", "")
    if found == FORMAT:
        return
    family, _, number = FORMAT.partition("/")
    remedy = "give a file that fronto wrote"
    if found.startswith(f"{family}/"):
        newer = found.removeprefix(f"{family}/").isdigit() and int(found.split("/")[1]) > int(
            number
        )
        writer = metadata.get("version")
        by = f" (its version: {writer})" if writer else ""
        remedy = (
            f"it needs a newer fronto than this {__version__}{by}"
            if newer
            else f"it needs an older fronto than this {__version__}{by}; or export it again"
        )
    raise InputError(
        thing,
        f"expected the format {FORMAT}, got {found or 'an ONNX file of something else'}",
        remedy,
    )


def _whole(metadata: Mapping[str, str], key: str, thing: str) -> int:
    text = metadata.get(key, "")
    if not (text.isascii() and text.isdigit() and int(text) > 0):
        raise InputError(
            f"{thing}, {key}", f"expected a positive whole number, got {text!r}", "export it again"
        )
    return int(text)


def _check_signature(session: Any, channels: Mapping[str, int], thing: str) -> None:
    """Names, types and fixed sizes of what goes in and comes out."""
    wanted_in = {"image": ("tensor(uint8)", (None, None, None, 3))}
    wanted_out = {
        name: ("tensor(float)", (None, count, None, None)) for name, count in channels.items()
    }
    for kind, wanted, values in (
        ("inputs", wanted_in, session.get_inputs()),
        ("outputs", wanted_out, session.get_outputs()),
    ):
        found = {value.name: value for value in values}
        if set(found) != set(wanted):
            raise InputError(
                thing,
                f"expected the {kind} {', '.join(wanted)}, got {', '.join(found) or 'none'}",
                "export it again",
            )
        for name, (kind_of, shape) in wanted.items():
            value = found[name]
            sizes = tuple(value.shape)
            if (
                value.type != kind_of
                or len(sizes) != 4
                or any(want not in (None, have) for have, want in zip(sizes, shape, strict=True))
            ):
                raise InputError(
                    f"{thing}, {name}",
                    f"expected {kind_of} of {_sizes(shape)}, got {value.type} of {_sizes(sizes)}",
                    "export it again",
                )


def _sizes(shape: Sequence[int | str | None]) -> str:
    return "(" + ", ".join(str(n) if isinstance(n, int) else "?" for n in shape) + ")"


def _reason(error: Exception) -> str:
    return " ".join(str(error).split())[:120] or type(error).__name__
