"""Template files: the known layout of a panel, as YAML or JSON (docs/files.md)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec

from fronto.errors import InputError
from fronto.files import convert_fields, decode_json, read_bytes
from fronto.pose.template import Template, TemplateButton

__all__ = ["read_template"]

MAX_BYTES = 1_000_000
#: Deeper nesting overflows the stack of libyaml's composer; a template needs four levels.
MAX_DEPTH = 20
MAX_BUTTONS = 1000

_Label = str | int | None


class _Button(msgspec.Struct):
    x_mm: float
    y_mm: float
    width_mm: float | None = None
    height_mm: float | None = None
    label: _Label = None


_Row = Annotated[list[_Label], msgspec.Meta(max_length=MAX_BUTTONS)]
_Positive = Annotated[float, msgspec.Meta(gt=0, le=1e6)]
_Pair = tuple[_Positive, _Positive]


class _File(msgspec.Struct):
    schema: Literal["fronto.template/1"] | None = None
    buttons: Annotated[list[_Button], msgspec.Meta(max_length=MAX_BUTTONS)] | None = None
    rows: Annotated[list[_Row], msgspec.Meta(max_length=MAX_BUTTONS)] | None = None
    pitch_mm: _Pair | None = None
    size_mm: _Pair | None = None


def read_template(path: str | Path) -> Template:
    """Read the known layout of a panel.

    Either ``buttons``, a list of ``x_mm``, ``y_mm`` and where known ``width_mm``,
    ``height_mm``, ``label``; or the grid form: ``rows`` of labels, the ``pitch_mm``
    [right, down] from one button's centre to the next, and where known one ``size_mm``
    [width, height]. An empty label (or null) in ``rows`` is a gap in the grid.

    Parameters
    ----------
    path
        YAML or JSON, UTF-8, at most 1 MB. In YAML labels need no quotes: 01 and no are
        taken as they are written.

    Raises
    ------
    InputError
        Naming the file and the field.
    """
    thing = f"template file {path}"
    content = read_bytes(Path(path), thing, MAX_BYTES)
    if Path(path).suffix.lower() == ".json":
        file = decode_json(content, _File, thing)
    else:
        file = convert_fields(_yaml(content, thing), _File, thing)
    try:
        if file.rows is not None:
            buttons = _grid(file, file.rows)
        elif file.buttons is not None:
            buttons = tuple(_button(k, button) for k, button in enumerate(file.buttons))
        else:
            raise InputError("", "expected buttons, or rows and pitch_mm, got neither", "give one")
        return Template(buttons)
    except InputError as error:
        named = f"{thing}, {error.thing}" if error.thing not in ("", "template") else thing
        raise InputError(named, error.expected, error.remedy) from None


def _button(k: int, button: _Button) -> TemplateButton:
    try:
        return TemplateButton(
            button.x_mm, button.y_mm, button.width_mm, button.height_mm, _text(button.label)
        )
    except InputError as error:
        raise InputError(f"buttons[{k}]", error.expected, "correct it") from None


def _grid(file: _File, rows: list[_Row]) -> tuple[TemplateButton, ...]:
    if file.buttons is not None:
        raise InputError("rows", "expected either rows or buttons, got both", "leave one out")
    if file.pitch_mm is None:
        raise InputError(
            "pitch_mm", "expected [right, down] along with rows, got none", "add it, in millimetres"
        )
    across, down = file.pitch_mm
    width, height = file.size_mm or (None, None)
    return tuple(
        TemplateButton(column * across, line * down, width, height, _text(label))
        for line, row in enumerate(rows)
        for column, label in enumerate(row)
        if _text(label)
    )


def _text(label: _Label) -> str:
    # YAML's two ways to write null arrive as the strings that they are.
    return "" if label in (None, "~", "null") else str(label)


def _yaml(content: bytes, thing: str) -> Any:
    """Decode YAML with all scalars as strings, so that a label stays as it is written."""
    import yaml

    loader: Any = getattr(yaml, "CBaseLoader", yaml.BaseLoader)
    depth = 0
    try:
        text = content.decode("utf-8-sig")
        for event in yaml.parse(text, Loader=loader):
            # Aliases of aliases are a megabyte that becomes a terabyte.
            if isinstance(event, yaml.AliasEvent):
                raise InputError(thing, "expected YAML without aliases (*name)", "write it out")
            depth += isinstance(event, yaml.CollectionStartEvent)
            depth -= isinstance(event, yaml.CollectionEndEvent)
            if depth > MAX_DEPTH:
                raise InputError(thing, "expected a template, got many nested levels", "correct it")
        return yaml.load(text, Loader=loader)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark
        where = f", line {mark.line + 1}, column {mark.column + 1}" if mark else ""
        raise InputError(
            f"{thing}{where}",
            f"expected YAML or JSON, got malformed text ({error.problem})",
            "correct it there",
        ) from None
    except (yaml.YAMLError, UnicodeDecodeError):
        raise InputError(
            thing, "expected YAML or JSON in UTF-8, got other data", "check that it is the file"
        ) from None
