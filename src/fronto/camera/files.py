"""Read a calibration file of any kind: bytes to plain values, and on to a camera.

What a file is, its content tells: a NumPy array, bare numbers, XML, JSON or YAML; the
fields of the latter three are read in `fronto.camera.calibration`.
"""

from __future__ import annotations

import io
import re
from collections.abc import Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from fronto.camera.calibration import FileCamera, read_fields
from fronto.camera.checks import checked_matrix, positive_int
from fronto.camera.model import Camera
from fronto.errors import InputError

__all__ = ["camera_from_file", "check_camera_file"]

MAX_BYTES = 10_000_000
MAX_DEPTH, MAX_ENTRIES = 50, 50_000
KINDS = "a ROS camera_info, OpenCV, Kalibr or fronto camera file, or a 3x3 matrix"


def camera_from_file(
    path: str | Path,
    width_px: int | None = None,
    height_px: int | None = None,
    *,
    projection: bool = False,
    name: str | None = None,
) -> Camera:
    """Read a camera; see `fronto.camera.Camera.from_file` for the parameters.

    Raises
    ------
    InputError
        Naming the file and the field.
    """
    path = Path(path)
    with _named(path):
        found = _read(_load(path), projection=projection, name=name)
        camera = _sized(found, width_px, height_px)
    detail = f"{found.kind} {path.name}" + (f" ({found.name})" if found.name else "")
    return replace(camera, detail=detail)


def check_camera_file(path: str | Path) -> None:
    """Refuse a file that is a camera for no photo, of whatever size.

    Raises
    ------
    InputError
        Naming the file and the field.
    """
    with _named(Path(path)):
        found = _read(_load(Path(path)), projection=False, name=None)
        size = found.size
        if size is None:  # stand in for the photo's: one that the principal point fits
            side = 1 + int(np.abs(checked_matrix(found.matrix)[:2, 2]).max())
            size = side, side
        _sized(found, *size)


@contextmanager
def _named(path: Path) -> Iterator[None]:
    """Name the file in errors."""
    try:
        yield
    except InputError as error:
        thing = f"camera file {path}" + (f", {error.thing}" if error.thing else "")
        raise InputError(thing, error.expected, error.remedy) from None


def _load(path: Path) -> bytes:
    if path.is_dir():
        raise InputError("", "expected a file, got a directory", "name the file in it")
    if path.is_fifo() or path.is_char_device():
        raise InputError("", "expected a regular file, got a device or pipe", "copy it first")
    try:
        with path.open("rb") as file:
            content = file.read(MAX_BYTES + 1)
    except FileNotFoundError:
        raise InputError("", "no such file", "check the path") from None
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "not a path"
        raise InputError("", f"cannot be read: {reason}", "check the path") from None
    if len(content) > MAX_BYTES:
        raise InputError("", "expected at most 10 MB, got more", f"give {KINDS}")
    if not content.strip():
        raise InputError("", f"expected {KINDS}, got an empty file", "write it again")
    return content


def _read(content: bytes, *, projection: bool, name: str | None) -> FileCamera:
    if content.startswith(b"\x93NUMPY"):
        matrix = _npy(content)
    else:
        text = _text(content)
        bare = _bare_matrix(text)
        if bare is None:
            fields = _fields(text)
            if isinstance(fields, Mapping):
                return read_fields(fields, projection=projection, name=name)
            bare = read_fields({"matrix": fields}, projection=False, name=None).matrix
        matrix = bare
    if projection or name is not None:
        raise InputError(
            "projection" if projection else "name",
            "expected a file that has it, got a bare matrix",
            "leave the option out",
        )
    return FileCamera("matrix file", matrix)


def _sized(found: FileCamera, width_px: int | None, height_px: int | None) -> Camera:
    wanted = None
    if width_px is not None and height_px is not None:
        wanted = positive_int(width_px, "width_px"), positive_int(height_px, "height_px")
    elif width_px is not None or height_px is not None:
        raise InputError(
            "image size",
            "expected both width_px and height_px, got one of them",
            "give the other one as well",
        )
    size = found.size or wanted
    if size is None:
        raise InputError(
            "image size",
            "expected one, the file states none",
            "give width_px and height_px (fronto camera: --width and --height)",
        )
    camera = replace(
        Camera.from_matrix(found.matrix, *size, found.distortion, found.model, source="file"),
        focal_std=found.focal_std,
    )
    return camera if wanted is None else camera.scaled_to(*wanted)


def _text(content: bytes) -> str:
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = "\0"
    if "\0" in text:
        raise InputError("", "expected text (UTF-8) or .npy, got binary data", f"give {KINDS}")
    return text.strip()


def _npy(content: bytes) -> list[list[float]]:
    """Read the array, its header first: a header may claim any size."""
    stream = io.BytesIO(content)
    try:
        version = np.lib.format.read_magic(stream)
        read = (
            np.lib.format.read_array_header_1_0
            if version == (1, 0)
            else np.lib.format.read_array_header_2_0
        )
        shape, _, dtype = read(stream)
        if shape != (3, 3) or dtype.kind not in "fiu":
            raise InputError(
                "matrix", f"expected numbers of shape (3, 3), got {dtype} of shape {shape}"
            )
        stream.seek(0)
        array = np.load(stream, allow_pickle=False)
    except InputError:
        raise
    except Exception as error:  # the header is parsed as a Python literal
        raise InputError(
            "", f"expected a .npy array, got a broken one ({type(error).__name__})", "save it again"
        ) from None
    return [[float(value) for value in row] for row in array]


def _bare_matrix(text: str) -> list[list[float]] | None:
    """Nine numbers with any of the usual separators and brackets; None if it is not numbers."""
    body = re.sub(r"#[^\n]*", "", text)
    try:
        values = [float(word) for word in re.sub(r"[\[\](),;]", " ", body).split()]
    except ValueError:
        return None
    if len(values) != 9:
        raise InputError(
            "matrix", f"expected 9 numbers (3x3), got {len(values)}", "write fx 0 cx 0 fy cy 0 0 1"
        )
    return [values[0:3], values[3:6], values[6:9]]


def _fields(text: str) -> Mapping[str, Any] | list[list[Any]]:
    """Read named fields, or the three rows of a matrix."""
    if text.startswith("<"):
        return _xml(text)
    content = _json(text) if text.startswith("{") else None
    if content is None:
        content = _yaml(text)
    if isinstance(content, list) and len(content) == 3:
        rows = [row for row in content if isinstance(row, list)]
        if len(rows) == 3:
            return rows
    if not isinstance(content, Mapping):
        raise InputError("", f"expected {KINDS}, got other text", "check that it is the right file")
    return content


def _json(text: str) -> Any:
    import msgspec

    try:
        return msgspec.json.decode(text)
    except (msgspec.DecodeError, RecursionError):
        return None  # YAML's flow style opens with a brace as well, and its errors say the line


def _yaml(text: str) -> Any:
    import yaml

    # OpenCV's header line "%YAML:1.0" is no valid directive.
    text = re.sub(r"\A%YAML[^\n]*\n?", "", text)
    loader = _yaml_loader()
    try:
        _check_nesting(yaml.parse(text, Loader=loader))
        # The first document: `rostopic echo` prints one for every message.
        for document in yaml.load_all(text, Loader=loader):
            if document is not None:
                return document
    except InputError:
        raise
    except yaml.MarkedYAMLError as error:
        line = f"line {error.problem_mark.line + 1}: " if error.problem_mark else ""
        raise InputError(
            "", f"expected YAML or JSON, got malformed text ({line}{error.problem})", "correct it"
        ) from None
    except (yaml.YAMLError, ValueError, RecursionError):
        raise InputError("", "expected YAML or JSON, got malformed text", f"give {KINDS}") from None
    return None


def _check_nesting(events: Iterable[Any]) -> None:
    """Refuse what overflows the stack of libyaml's recursive composer, or takes minutes."""
    import yaml

    depth, content = 0, False
    for count, event in enumerate(events):
        content = content or isinstance(event, yaml.CollectionStartEvent)
        depth += isinstance(event, yaml.CollectionStartEvent)
        depth -= isinstance(event, yaml.CollectionEndEvent)
        if depth > MAX_DEPTH or count > MAX_ENTRIES:
            raise InputError(
                "", "expected a calibration, got thousands of entries or levels", f"give {KINDS}"
            )
        if content and isinstance(event, yaml.DocumentEndEvent):
            return  # the document that is read; a later one may be cut off


def _yaml_loader() -> Any:
    """Build a safe loader that knows OpenCV's matrices and no merge keys.

    Merge keys (``<<``) copy what they refer to, so a few lines of them fill the memory;
    calibration files have none.
    """
    import yaml

    base: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
    loader: Any = type("CalibrationLoader", (base,), {"flatten_mapping": lambda self, node: None})
    for tag in ("opencv-matrix", "opencv-nd-matrix"):
        loader.add_constructor(
            f"tag:yaml.org,2002:{tag}",
            lambda self, node: self.construct_mapping(node, deep=True),
        )
    return loader


def _xml(text: str) -> dict[str, Any]:
    """OpenCV's XML: children of the root are fields, their children the parts of a matrix."""
    from xml.etree import ElementTree

    if re.search(r"<!(DOCTYPE|ENTITY)", text, re.IGNORECASE):
        raise InputError("", "expected XML without a document type", "remove the DOCTYPE")
    try:
        root = ElementTree.fromstring(text)
    except (ElementTree.ParseError, ValueError, RecursionError) as error:
        raise InputError("", f"expected XML, got malformed text ({error})", "correct it") from None
    return {
        child.tag: {part.tag: part.text or "" for part in child} if len(child) else child.text or ""
        for child in root
    }
