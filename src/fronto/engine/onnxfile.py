"""A network's file: found, checked, loaded and run. Nothing else touches ONNX Runtime."""

from __future__ import annotations

import hashlib
import re
from collections.abc import Mapping, Sequence
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

__all__ = [
    "FLOATS",
    "OnnxFile",
    "Sizes",
    "checked_bytes",
    "file_digest",
    "find_weights",
    "on_processor",
]

#: Far above any network that would be usable on a processor; ONNX itself ends at 2 GB.
MAX_BYTES = 1_000_000_000
#: ``fronto-seg-1a2b3c4d.onnx``: the first digits of the file's SHA-256.
HASHED = re.compile(r"-([0-9a-f]{8})\.onnx\Z")
CPU = "CPUExecutionProvider"
#: ONNX Runtime's "fatal": errors come as exceptions, and nothing is to be printed beside them.
SILENT = 4
BYTES, FLOATS = "tensor(uint8)", "tensor(float)"

#: Sizes of an array; None: any.
Sizes = tuple[int | None, ...]


class OnnxFile:
    """An ONNX file of one of fronto's formats, ready to run; several threads may share one.

    Parameters
    ----------
    path
        The file. Where its name ends in eight hexadecimal digits, they must begin its SHA-256.
    form
        The format that it must state, such as ``fronto.segmentation/2``.
    threads
        Threads that work on one call; None: as many as `usable_cores` counts.
    providers
        ONNX Runtime's names of what to compute on, best first; None: the processor.

    Raises
    ------
    InputError
        If the file is missing, damaged or another one than its name says, no ONNX, or of
        another format, or if a provider or the number of threads cannot be had.

    Attributes
    ----------
    path
        The file.
    thing
        The file, as messages name it.
    metadata
        What is written in the file.
    threads
        As given or counted.
    digest
        First eight hexadecimal digits of its SHA-256.
    """

    def __init__(
        self, path: Path, form: str, threads: int | None, providers: Sequence[str] | None
    ) -> None:
        self.path = path
        self.threads = usable_cores() if threads is None else _check_threads(threads)
        self.thing = f"weights {path}"
        content, self.digest = _checked_file(path)
        self._session = _session(content, self.threads, _providers(providers), self.thing)
        self.metadata: Mapping[str, str] = MappingProxyType(
            dict(self._session.get_modelmeta().custom_metadata_map)
        )
        _check_format(self.metadata, form, self.thing)

    def whole(self, key: str) -> int:
        """A positive whole number of the metadata.

        Raises
        ------
        InputError
            If it is none.
        """
        text = self.metadata.get(key, "")
        if not (text.isascii() and text.isdigit() and int(text) > 0):
            raise InputError(
                f"{self.thing}, {key}",
                f"expected a positive whole number, got {text!r}",
                "export it again",
            )
        return int(text)

    def names(self, key: str) -> tuple[str, ...]:
        """Names of the metadata, which are written with commas in between."""
        return tuple(filter(None, self.metadata.get(key, "").split(",")))

    def check_signature(
        self, inputs: Mapping[str, Sizes], outputs: Mapping[str, Sizes], takes: str = BYTES
    ) -> None:
        """Check names, types and sizes: of bytes going in, or what it `takes`; floats come out.

        Raises
        ------
        InputError
            Naming the first that is another one.
        """
        for kind, type_of, wanted, values in (
            ("inputs", takes, inputs, self._session.get_inputs()),
            ("outputs", FLOATS, outputs, self._session.get_outputs()),
        ):
            found = {value.name: value for value in values}
            if set(found) != set(wanted):
                raise InputError(
                    self.thing,
                    f"expected the {kind} {', '.join(wanted)}, got {', '.join(found) or 'none'}",
                    "export it again",
                )
            for name, shape in wanted.items():
                value = found[name]
                sizes = tuple(value.shape)
                if value.type != type_of or not _fits(sizes, shape):
                    raise InputError(
                        f"{self.thing}, {name}",
                        f"expected {type_of} of {_sizes(shape)}, "
                        f"got {value.type} of {_sizes(sizes)}",
                        "export it again",
                    )

    def run(
        self,
        inputs: Mapping[str, npt.NDArray[Any]],
        outputs: Mapping[str, Sizes],
        remedy: str,
        *,
        finite: bool = False,
    ) -> list[npt.NDArray[np.float32]]:
        """Run the network.

        Parameters
        ----------
        inputs
            What goes in, by name.
        outputs
            Names of the outputs and the shapes that they must have.
        remedy
            What the user can do where the network does not run.
        finite
            Whether answers that are no numbers are refused.

        Returns
        -------
        The outputs, in the order of `outputs`.

        Raises
        ------
        InputError
            If it does not run on them, or an output has another shape or is refused.
        """
        try:
            found = self._session.run(
                list(outputs), {name: np.ascontiguousarray(v) for name, v in inputs.items()}
            )
        except Exception as error:  # ONNX Runtime's own types, which are not public
            given = ", ".join(f"{name} of shape {v.shape}" for name, v in inputs.items())
            raise InputError(
                self.thing,
                f"expected a network that runs on {given}, got: {_reason(error)}",
                remedy,
            ) from None
        for (output, shape), values in zip(outputs.items(), found, strict=True):
            if not _fits(values.shape, shape):
                raise InputError(
                    self.thing,
                    f"expected {output} of shape {_sizes(shape)}, got {_sizes(values.shape)}",
                    "export the network again",
                )
            if finite and not np.isfinite(values).all():
                raise InputError(
                    f"{self.thing}, {output}",
                    "expected finite numbers, got others",
                    "train it again",
                )
        return list(found)


def checked_bytes(
    images: npt.NDArray[np.uint8], shape: Sizes, thing: str, words: str
) -> tuple[int, ...]:
    """The shape of what goes into a network.

    Parameters
    ----------
    images
        Must be uint8, not empty.
    shape
        What its sizes must be.
    thing
        What messages call it.
    words
        The shape as messages put it, such as "(N, H, W, 3)".

    Raises
    ------
    InputError
        If it is anything else.
    """
    array = isinstance(images, np.ndarray)
    if not array or images.dtype != np.uint8 or images.size == 0 or not _fits(images.shape, shape):
        found = f"{images.dtype} of shape {images.shape}" if array else type(images).__name__
        raise InputError(thing, f"expected uint8 of shape {words}, got {found}")
    return images.shape


def find_weights(folder: Traversable | None = None, *, stem: str = "fronto-seg") -> Path:
    """A network in the package, or the one in another folder.

    Parameters
    ----------
    folder
        Where to look; None: the package's weights.
    stem
        Beginning of its name: "fronto-seg" finds buttons, "fronto-read" reads labels.

    Raises
    ------
    InputError
        If there is none, or more than one.
    """
    folder = files("fronto") / "weights" if folder is None else folder
    found = sorted(str(f) for f in folder.iterdir()) if folder.is_dir() else []
    found = [name for name in found if name.endswith(".onnx")]
    whole = re.compile(rf"{re.escape(stem)}-[^.]*\.onnx")  # a relation head's name has two dots
    fitting = [name for name in found if whole.fullmatch(Path(name).name)]
    if len(fitting) != 1:
        names = ", ".join(Path(name).name for name in fitting or found) or "none"
        raise InputError(
            f"weights folder {folder}",
            f"expected one file {stem}-*.onnx, got {names}",
            "install fronto again, or name a file of your own",
        )
    return Path(fitting[0])


def file_digest(path: Path) -> str:
    """First eight hexadecimal digits of the SHA-256 of a network's file, which is not loaded.

    Raises
    ------
    InputError
        If the file cannot be read, or is another one than its name says.
    """
    return _checked_file(path)[1]


def on_processor(providers: Sequence[str] | None) -> bool:
    """Whether these are ONNX Runtime's names of the processor, and of nothing else."""
    return providers is None or providers == CPU or list(providers) == [CPU]


def _checked_file(path: Path) -> tuple[bytes, str]:
    """What is in a network's file, and its digest, which its name may say."""
    thing = f"weights {path}"
    content = read_bytes(path, thing, MAX_BYTES)
    digest = hashlib.sha256(content).hexdigest()[:8]
    _check_hash(digest, path.name, thing)
    return content, digest


def _fits(sizes: Sequence[int | str | None], shape: Sizes) -> bool:
    return len(sizes) == len(shape) and all(
        want in (None, have) for have, want in zip(sizes, shape, strict=True)
    )


def _check_threads(threads: int) -> int:
    if not isinstance(threads, int) or isinstance(threads, bool) or threads < 1:
        raise InputError("threads", f"expected a whole number from 1, got {threads!r}")
    return threads


def _check_hash(found: str, name: str, thing: str) -> None:
    expected = HASHED.search(name)
    if expected is not None and found != expected[1]:
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


def _check_format(metadata: Mapping[str, str], form: str, thing: str) -> None:
    found = metadata.get("format", "")
    if found == form:
        return
    family, _, number = form.partition("/")
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
        f"expected the format {form}, got {found or 'an ONNX file of something else'}",
        remedy,
    )


def _sizes(shape: Sequence[int | str | None]) -> str:
    return "(" + ", ".join(str(n) if isinstance(n, int) else "?" for n in shape) + ")"


def _reason(error: Exception) -> str:
    return " ".join(str(error).split())[:120] or type(error).__name__
