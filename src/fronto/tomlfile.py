"""Options from a TOML file into frozen dataclasses, checked field by field."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any, TypeVar, get_args, get_type_hints

import msgspec

from fronto.errors import InputError
from fronto.files import decode_json, read_bytes

__all__ = ["read_toml"]

T = TypeVar("T")

MAX_BYTES = 100_000


def read_toml(path: Path, kind: type[T]) -> T:
    """Read options from a TOML file; what it leaves out has its default.

    Parameters
    ----------
    path
        UTF-8, at most 100 kB.
    kind
        A dataclass; fields may be dataclasses themselves (TOML's tables).

    Raises
    ------
    InputError
        Naming the file and the field: no TOML, an unknown field, a wrong type or value.
    """
    thing = f"options file {path}"
    content = read_bytes(path, thing, MAX_BYTES)
    try:
        values = tomllib.loads(content.decode("utf-8-sig"))
    except UnicodeDecodeError:
        raise InputError(thing, "expected UTF-8, got other bytes", "save it as UTF-8") from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(thing, f"expected TOML, got: {error}", "correct it there") from None
    _check_names(values, kind, thing, "")
    try:
        text = msgspec.json.encode(values)
    except (TypeError, ValueError, OverflowError):
        raise InputError(thing, "expected plain numbers and texts", "correct it") from None
    return decode_json(text, kind, thing)


def _check_names(values: Mapping[str, Any], kind: type, thing: str, prefix: str) -> None:
    """Refuse names that are no fields: msgspec would pass over them."""
    assert is_dataclass(kind)
    names = [known.name for known in fields(kind)]
    hints = get_type_hints(kind)
    for name, value in values.items():
        if name not in names:
            raise InputError(
                f"{thing}, {prefix}{name}",
                f"expected one of {', '.join(names)}",
                "correct the name, or leave it out",
            )
        inner = next((t for t in (hints[name], *get_args(hints[name])) if is_dataclass(t)), None)
        if isinstance(inner, type) and isinstance(value, Mapping):
            _check_names(value, inner, thing, f"{prefix}{name}.")
