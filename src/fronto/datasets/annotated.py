"""The project's own annotations: quads and ellipses of buttons, one JSON file a photo.

In ``labels``, beside the photos in ``images``; coordinates are the package's own, from the
centre of the top-left pixel, in the photo upright.
"""

from __future__ import annotations

from pathlib import Path
from typing import Literal

import msgspec

from fronto.datasets.names import category_of
from fronto.datasets.photos import check_size, find_photo
from fronto.datasets.reading import build_object, json_kind, located, read_json, split_folder
from fronto.datasets.records import LABELS, LabeledImage, LabeledObject
from fronto.errors import InputError
from fronto.shapes import Ellipse, FloatArray, check_corners

__all__ = ["annotated_files", "read_annotated"]

ELLIPSE_POINTS = 72


class _Ellipse(msgspec.Struct):
    cx: float
    cy: float
    a: float
    b: float
    angle_deg: float = 0.0


class _Button(msgspec.Struct):
    shape: Literal["quad", "ellipse"]
    category: str
    corners: list[tuple[float, float]] | None = None
    ellipse: _Ellipse | None = None
    text: str = ""
    unsure: bool = False
    truncated: bool = False


class _File(msgspec.Struct):
    image: str
    width: int
    height: int
    buttons: list[_Button]


def annotated_files(path: Path, split: str | None = None) -> list[Path]:
    """The annotation files in a folder's "labels" or in itself, or in a split's folder."""
    if path.is_file():
        return [path]
    folder = split_folder(path, split)
    files = [] if folder is None else sorted(folder.glob("labels/*.json"))
    if folder is not None and not files:
        files = sorted(folder.glob("*.json"))
    return [file for file in files if json_kind(file) == "annotated"]


def read_annotated(directory: str | Path, split: str | None = None) -> list[LabeledImage]:
    """Read the project's annotations; an ellipse becomes a polygon of 72 points.

    What is unsure is to be ignored.

    Parameters
    ----------
    directory
        The folder that has "labels" and "images", or one annotation file.
    split
        Only what lies in the folder of that name.

    Raises
    ------
    InputError
        Naming the file and the field.
    """
    files = annotated_files(Path(directory), split)
    if not files:
        raise InputError(
            f"data set {directory}",
            "expected annotation files (JSON with buttons) in its folder labels",
            "name the folder above labels and images",
        )
    return [_read_file(file) for file in files]


def _read_file(path: Path) -> LabeledImage:
    thing = f"annotation file {path}"
    file = read_json(path, _File, thing)
    folders = [path.parent.parent / "images", path.parent]
    photo = find_photo(file.image, folders, f"{thing}, image")
    width, height = check_size(photo, (file.width, file.height), f"{thing}, width, height")
    objects = tuple(
        _object(button, f"{thing}, buttons[{index}]") for index, button in enumerate(file.buttons)
    )
    return LabeledImage(photo, width, height, objects)


def _object(button: _Button, place: str) -> LabeledObject:
    if category_of(button.category) is None:
        raise InputError(
            f"{place}.category", f"expected one of {', '.join(LABELS)}, got {button.category!r}"
        )
    with located(place):
        polygon: FloatArray
        if button.shape == "quad" and button.corners is not None:
            polygon = check_corners(button.corners)
        elif button.shape == "ellipse" and button.ellipse is not None:
            given = button.ellipse
            ellipse = Ellipse(given.cx, given.cy, given.a, given.b, given.angle_deg)
            polygon = ellipse.points(ELLIPSE_POINTS)
        else:
            raise InputError(
                "shape", f"expected the corners or the ellipse of the {button.shape}, got none"
            )
    found = build_object(
        button.category,
        place,
        polygon=polygon,
        attributes={
            "text": button.text,
            "ignore": button.unsure,
            "truncated": button.truncated,
        },
    )
    assert found is not None  # checked above
    return found
