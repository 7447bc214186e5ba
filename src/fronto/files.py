"""Small files in and out: capped reading, writing in one piece, and JSON's errors in words."""

from __future__ import annotations

import contextlib
import re
import secrets
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any, TypeVar

import msgspec

from fronto.errors import InputError

__all__ = [
    "convert_fields",
    "decode_json",
    "json_bytes",
    "make_folder",
    "part_of",
    "read_bytes",
    "write_bytes",
    "writing",
]

T = TypeVar("T")

SEE = "correct it (docs/files.md describes the fields)"
#: What msgspec calls things, in JSON's words.
WORDS = {"float": "number", "int": "whole number", "str": "string", "bool": "true or false"}


def read_bytes(path: Path, thing: str, max_bytes: int) -> bytes:
    """Read a whole file.

    Raises
    ------
    InputError
        Naming `thing` ("outlines file hall.json"), if it is missing, no regular file,
        unreadable, empty, or larger than `max_bytes`.
    """
    try:
        if path.is_dir():
            raise InputError(thing, "expected a file, got a folder", "name the file in it")
        if path.exists() and not path.is_file():
            raise InputError(thing, "expected a file, got a device or pipe", "copy it first")
        with path.open("rb") as file:
            content = file.read(max_bytes + 1)
    except FileNotFoundError:
        raise InputError(thing, "expected a file, there is none", "check the path") from None
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        reason = getattr(error, "strerror", None) or "not a path"
        raise InputError(
            thing, f"expected a readable file, got: {reason}", "check the path and its permissions"
        ) from None
    if len(content) > max_bytes:
        raise InputError(
            thing, f"expected at most {max_bytes / 1e6:g} MB, got more", "give the right file"
        )
    if not content.strip():
        raise InputError(thing, "expected some content, got an empty file", "write it again")
    return content


def write_bytes(path: Path, content: bytes) -> None:
    """Write a file in one piece: under another name in its folder, then renamed.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    with writing(path):
        part = part_of(path)
        try:
            with part.open("xb") as file:
                file.write(content)
            part.replace(path)
        except BaseException:
            with contextlib.suppress(OSError):
                part.unlink(missing_ok=True)
            raise


def part_of(path: Path) -> Path:
    """Another name in the same folder, for a file that is not whole yet."""
    return path.with_name(f".{secrets.token_hex(8)}.part")


@contextlib.contextmanager
def writing(path: Path, thing: str = "output file") -> Iterator[None]:
    """Say in words why a file cannot be written, and what it was to be.

    Raises
    ------
    InputError
        Naming it, in place of what the system raises.
    """
    try:
        yield
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        reason = getattr(error, "strerror", None) or "not a path"
        raise InputError(
            f"{thing} {path}",
            f"expected a place to write to, got: {reason}",
            "choose another folder",
        ) from None


def decode_json(content: bytes, kind: type[T], thing: str) -> T:
    """Decode JSON (UTF-8) to a msgspec Struct.

    Raises
    ------
    InputError
        Naming `thing` and the field, or the line and column of malformed JSON (such as NaN).
    """
    content = content.removeprefix(b"\xef\xbb\xbf")
    try:
        content.decode()
        return msgspec.json.decode(content, type=kind)
    except msgspec.ValidationError as error:
        raise _field_error(error, thing) from None
    except UnicodeDecodeError as error:
        where, what = error.start, "a byte that is no UTF-8"
    except RecursionError:
        where, what = 0, "too many nested brackets"
    except msgspec.DecodeError as error:
        found = re.fullmatch(r"(?:JSON is malformed: )?(.*?)(?: \(byte (\d+)\))?", str(error))
        assert found is not None
        what = found[1]
        where = len(content) if found[2] is None else int(found[2])
    literal = re.match(rb"NaN|Infinity", content[where:])
    before = content[:where]
    line = before.count(b"\n") + 1
    column = len(before[before.rfind(b"\n") + 1 :].decode(errors="replace")) + 1
    place = f"{thing}, line {line}, column {column}"
    if literal is not None:
        raise InputError(
            place,
            f"expected a number, got {literal[0].decode()}, which is no number in JSON",
            "write the number, or leave out what has none",
        )
    raise InputError(
        place,
        f"expected JSON, got malformed text ({what[:1].lower()}{what[1:]})",
        "correct it there",
    )


def convert_fields(values: object, kind: type[T], thing: str) -> T:
    """Convert decoded YAML, all scalars of which are strings, to a msgspec Struct.

    Raises
    ------
    InputError
        Naming `thing` and the field.
    """
    try:
        return msgspec.convert(values, kind, strict=False)
    except msgspec.ValidationError as error:
        raise _field_error(error, thing) from None


def json_bytes(values: Mapping[str, Any]) -> bytes:
    """Strictly valid JSON, to be read by people too: a line for each key and each button."""
    lines = []
    for key, value in values.items():
        if isinstance(value, (list, tuple)) and value and isinstance(value[0], Mapping):
            text = b"[\n  " + b",\n  ".join(map(msgspec.json.encode, value)) + b"]"
        else:
            text = msgspec.json.encode(value)
        lines.append(b" " + msgspec.json.encode(key) + b": " + text)
    return b"{\n" + b",\n".join(lines) + b"\n}\n"


def _field_error(error: msgspec.ValidationError, thing: str) -> InputError:
    found = re.fullmatch(r"(.*?)(?: - at `(?:key in )?\$\.?(.*)`)?", str(error), re.DOTALL)
    assert found is not None
    what, field = found[1].replace("`", ""), found[2]
    what = re.sub(r"\b(float|int|str|bool)\b", lambda word: WORDS[word[0]], what)
    what = what[:1].lower() + what[1:]
    return InputError(f"{thing}, {field}" if field else thing, what, SEE)


def make_folder(folder: Path) -> None:
    """Make an output folder, if missing.

    Raises
    ------
    InputError
        If it cannot be made.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except (OSError, ValueError) as error:
        reason = getattr(error, "strerror", None) or "not a path"
        raise InputError(
            f"output folder {folder}",
            f"expected a folder to write to, got: {reason}",
            "choose another one",
        ) from None
