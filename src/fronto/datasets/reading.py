"""What the readers share: an object from a label, kinds of JSON, and the names of splits."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import numpy as np
import numpy.typing as npt

from fronto.datasets.names import category_of, printed_text
from fronto.datasets.records import Box, LabeledObject, polygon_box
from fronto.errors import InputError
from fronto.files import decode_json, read_bytes

__all__ = [
    "CORNER",
    "attributes_of",
    "build_object",
    "json_kind",
    "located",
    "read_json",
    "split_folder",
    "split_of",
]

T = TypeVar("T")

#: COCO, CVAT, LabelMe and YOLO count from the corner of the top-left pixel, where its centre
#: is (0.5, 0.5); here the centre is (0, 0).
CORNER = 0.5
MAX_BYTES = 1_000_000_000
#: The first of each is the name that it is compared by.
SPLITS = (("train", "training"), ("val", "valid", "validation"), ("test", "testing"))
#: Keys that a JSON file of labels has at least, by its format.
JSON_KEYS = {
    "coco": {"images", "annotations", "categories"},
    "labelme": {"shapes"},
    "annotated": {"buttons"},
}
TRUE = ("1", "true", "yes")


@contextmanager
def located(place: str) -> Iterator[None]:
    """Put the place, a file and a field, before whatever input is refused within."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{place}, {error.thing}", error.expected, error.remedy) from None


def build_object(
    label: str,
    place: str,
    *,
    box: Box | None = None,
    polygon: npt.ArrayLike | None = None,
    attributes: Mapping[str, Any] | None = None,
) -> LabeledObject | None:
    """A labelled object, from its polygon or else its box in this package's pixels.

    `attributes` may hold the original "name", the "text", "ignore" and "truncated", as
    `attributes_of` gives them. None for what is no button or plate.

    Raises
    ------
    InputError
        Naming `place`, if the polygon or the box bounds nothing.
    """
    category = category_of(label)
    if category is None:
        return None
    given = dict(attributes or {})
    name, text = given.get("name"), given.get("text")
    with located(place):
        if polygon is not None:
            box = polygon_box(polygon)
        assert box is not None
        return LabeledObject(
            category,
            box,
            None if polygon is None else np.asarray(polygon, dtype=np.float64),
            label if name in (None, "") else str(name),
            printed_text(label) if text is None else str(text),
            str(given.get("ignore")).lower() in TRUE,
            str(given.get("truncated")).lower() in TRUE,
        )


def attributes_of(item: LabeledObject) -> dict[str, str | bool]:
    """What the formats have no field for, as attributes that `build_object` takes."""
    return {
        "name": item.name,
        "text": item.text,
        "ignore": item.ignore,
        "truncated": item.truncated,
    }


def read_json(path: Path, kind: type[T], thing: str) -> T:
    """Decode a JSON file of labels.

    Raises
    ------
    InputError
        Naming `thing` and the field, line or column.
    """
    return decode_json(read_bytes(path, thing, MAX_BYTES), kind, thing)


def json_kind(path: Path) -> str | None:
    """Which format a JSON file looks like by its keys: "coco", "labelme", "annotated" or None.

    Raises
    ------
    InputError
        If it cannot be read, or is no JSON.
    """
    thing = f"labels file {path}"
    content = read_bytes(path, thing, MAX_BYTES)
    if not content.lstrip(b"\xef\xbb\xbf \t\r\n").startswith(b"{"):
        return None
    keys = decode_json(content, dict[str, msgspec.Raw], thing).keys()
    return next((kind for kind, needed in JSON_KEYS.items() if needed <= keys), None)


def split_of(name: str) -> str | None:
    """Which split a file or a folder is named after: "valid" and "instances_val2017" are "val"."""
    words = re.findall("[a-z]+", name.lower())
    return next((names[0] for names in SPLITS if any(word in names for word in words)), None)


def split_folder(folder: Path, split: str | None) -> Path | None:
    """The folder of a split (any of its names) in a folder; that folder itself for None."""
    if split is None:
        return folder
    wanted = split_of(split) or split
    for path in sorted(folder.iterdir()) if folder.is_dir() else []:
        if path.is_dir() and (path.name == split or split_of(path.name) == wanted):
            return path
    return None
