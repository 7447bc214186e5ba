"""Buttons that are plainly in a photo but not among its labels: a list kept by hand.

A detector is not wrong to find them. The list is YAML, photo ids as `photo_id` gives them:

    valid/1000:
    - [10.5, 20.5, 40.5, 50.5, number]  # x0, y0, x1, y1 in pixels, and the category

One for the panels' labels comes with the package, ``panels_missing.yaml``.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from importlib.resources import files
from pathlib import Path
from typing import Any

from fronto.categories import PLATE
from fronto.datasets.reading import located
from fronto.datasets.records import LabeledObject
from fronto.errors import InputError
from fronto.files import convert_fields, read_bytes, write_bytes

__all__ = ["Missing", "panels_illegible", "panels_missing", "read_missing", "write_missing"]

#: By the photo's id.
Missing = dict[str, tuple[LabeledObject, ...]]

MAX_BYTES = 10_000_000
REMEDY = "correct it there"


def panels_missing() -> Missing:
    """The buttons that the labels of the panels' validation photos miss."""
    return _packaged("panels_missing.yaml")


def panels_illegible() -> Missing:
    """Buttons of the panels' validation photos whose labels cannot be read by themselves."""
    return _packaged("panels_illegible.yaml")


def _packaged(name: str) -> Missing:
    return _parse((files("fronto.evaluate") / name).read_bytes(), f"missing labels file {name}")


def read_missing(path: str | Path) -> Missing:
    """Read a list of missing labels.

    Parameters
    ----------
    path
        A YAML file.

    Returns
    -------
    By the photos' ids, in the file's order.

    Raises
    ------
    InputError
        Naming the file, the photo and the entry: if it cannot be read, names a photo twice,
        or has a box that bounds nothing or a category that is no button's.
    """
    thing = f"missing labels file {path}"
    return _parse(read_bytes(Path(path), thing, MAX_BYTES), thing)


def write_missing(path: str | Path, missing: Mapping[str, Sequence[LabeledObject]]) -> None:
    """Write a list of missing labels, sorted by photo, one line a button; no comments.

    Raises
    ------
    InputError
        If it cannot be written.
    """
    import yaml

    lines = []
    for photo in sorted(missing):
        if missing[photo]:
            lines.append(yaml.safe_dump({photo: None}, width=math.inf).replace(" null", "", 1))
        for item in missing[photo]:
            edges = ", ".join(f"{round(edge, 2):g}" for edge in item.box)
            lines.append(f"- [{edges}, {item.category}]\n")
    write_bytes(Path(path), "".join(lines or ["{}\n"]).encode())


def _parse(content: bytes, thing: str) -> Missing:
    missing = {}
    for photo, values in _yaml(content, thing).items():
        place = f"{thing}, {photo}"
        entries = convert_fields(values, list[tuple[float, float, float, float, str]], place)
        missing[photo] = tuple(_button(entry, f"{place}[{k}]") for k, entry in enumerate(entries))
    return missing


def _yaml(content: bytes, thing: str) -> dict[str, Any]:
    """Lists by the photos' ids, all scalars as strings."""
    import yaml

    try:
        loader = yaml.BaseLoader(content.decode())
        node = loader.get_single_node()
        if not isinstance(node, yaml.MappingNode):
            raise InputError(thing, "expected photo ids with lists of boxes", REMEDY)
        seen: set[str] = set()
        for key, _ in node.value:
            if not isinstance(key, yaml.ScalarNode):
                raise InputError(
                    f"{thing}, line {key.start_mark.line + 1}", "expected a photo's id", REMEDY
                )
            if key.value in seen:  # YAML would keep the last one only
                raise InputError(
                    f"{thing}, line {key.start_mark.line + 1}",
                    f"expected each photo once, got {key.value!r} again",
                    "join the two lists",
                )
            seen.add(key.value)
        fields: dict[str, Any] = loader.construct_document(node)
        return fields
    except (yaml.YAMLError, UnicodeDecodeError, RecursionError) as error:
        raise InputError(thing, f"expected YAML, got: {error}", REMEDY) from None


def _button(entry: tuple[float, float, float, float, str], place: str) -> LabeledObject:
    *box, category = entry
    if category == PLATE:
        raise InputError(place, "expected a button, got a plate", "leave it out")
    x0, y0, x1, y1 = (float(edge) for edge in box)
    with located(place):
        return LabeledObject(category, (x0, y0, x1, y1), None, name="")
