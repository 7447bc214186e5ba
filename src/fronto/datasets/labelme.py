"""LabelMe: one JSON file beside each photo (https://github.com/wkentaro/labelme).

Its coordinates are those of its canvas, whose origin is the corner of the top-left pixel. It
shows photos upright.
"""

from __future__ import annotations

import base64
import binascii
import math
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from fronto.datasets.masks import mask_polygon
from fronto.datasets.names import category_of, check_names
from fronto.datasets.photos import check_size, copy_photos, find_photo, photo_size
from fronto.datasets.reading import (
    CORNER,
    attributes_of,
    build_object,
    json_kind,
    located,
    read_json,
    split_folder,
)
from fronto.datasets.records import Box, LabeledImage, LabeledObject, polygon_box
from fronto.errors import InputError
from fronto.files import json_bytes, write_bytes
from fronto.shapes import Ellipse, FloatArray

__all__ = ["labelme_files", "read_labelme", "write_labelme"]

#: Points on a circle, as `read_annotated` takes for an ellipse.
CIRCLE_POINTS = 72


class _Shape(msgspec.Struct):
    label: str
    points: list[tuple[float, float]]
    shape_type: str | None = "polygon"
    flags: dict[str, Any] | None = None
    mask: str | None = None
    name: str | None = None
    text: str | None = None


class _File(msgspec.Struct, rename={"path": "imagePath", "w": "imageWidth", "h": "imageHeight"}):
    shapes: list[_Shape]
    path: str
    w: int | None = None
    h: int | None = None


def labelme_files(path: Path, split: str | None = None) -> list[Path]:
    """The LabelMe files in a folder (or its folder of that split) and in those below it."""
    if path.is_file():
        return [path]
    folder = split_folder(path, split)
    files = sorted(folder.rglob("*.json")) if folder else []
    return [file for file in files if json_kind(file) == "labelme"]


def read_labelme(path: str | Path, split: str | None = None) -> list[LabeledImage]:
    """Read LabelMe's polygons, rectangles (boxes only), circles and masks.

    A flag "ignore" or "truncated" of a shape counts. Photos without a JSON file have not
    been labelled and are left out.

    Parameters
    ----------
    path
        A folder, or one JSON file.
    split
        Only what lies in the folder of that name.

    Raises
    ------
    InputError
        Naming the file and the field.
    """
    files = labelme_files(Path(path), split)
    if not files:
        raise InputError(
            f"data set {path}",
            "expected LabelMe files (JSON with shapes)"
            + (f" in a folder of the split {split!r}" if split else ""),
            "name their folder",
        )
    names: list[str] = []
    images = [_read_file(file, names) for file in files]
    check_names(names, f"data set {path}")
    return images


def _read_file(path: Path, names: list[str]) -> LabeledImage:
    thing = f"LabelMe file {path}"
    file = read_json(path, _File, thing)
    folders = [path.parent, path.parent / "images", path.parent.parent / "images"]
    photo = find_photo(file.path, folders, f"{thing}, imagePath")
    if file.w is None or file.h is None:
        width, height = photo_size(photo)
    else:
        width, height = check_size(photo, (file.w, file.h), f"{thing}, imageWidth, imageHeight")
    objects = []
    for index, shape in enumerate(file.shapes):
        names.append(shape.label)
        if category_of(shape.label) is not None:
            objects.append(_object(shape, f"{thing}, shapes[{index}]"))
    return LabeledImage(photo, width, height, tuple(objects))


def _object(shape: _Shape, place: str) -> LabeledObject:
    box: Box | None = None
    polygon: FloatArray | None = None
    points = np.array(shape.points, dtype=np.float64).reshape(-1, 2) - CORNER
    with located(place):
        match shape.shape_type or "polygon":
            case "polygon":
                polygon = points
            case "rectangle":
                box = polygon_box(points)
            case "circle" if len(points) == 2:
                (cx, cy), (x, y) = points.tolist()
                radius = math.hypot(x - cx, y - cy)
                polygon = Ellipse(cx, cy, radius, radius).points(CIRCLE_POINTS)
            case "mask" if len(points) == 2 and shape.mask:
                polygon = _mask_outline(shape.mask) + np.round(points[0] + CORNER)
            case other:
                raise InputError(
                    "shape_type",
                    "expected polygon, rectangle, circle (two points) or mask,"
                    f" got {other} of {len(points)} points",
                    "outline the button with one of those",
                )
    flags = shape.flags or {}
    attributes = {**flags, "name": shape.name, "text": shape.text}
    found = build_object(shape.label, place, box=box, polygon=polygon, attributes=attributes)
    assert found is not None  # the caller left out what is no button
    return found


def _mask_outline(mask: str) -> FloatArray:
    """Outline of a mask that is kept as a PNG in base64, from its own top-left pixel."""
    import cv2

    try:
        content = np.frombuffer(base64.b64decode(mask, validate=True), np.uint8)
        pixels = cv2.imdecode(content, cv2.IMREAD_GRAYSCALE) if content.size else None
    except (binascii.Error, ValueError, cv2.error):
        pixels = None
    if pixels is None:
        raise InputError("mask", "expected a PNG in base64, got something else", "save it again")
    return mask_polygon(np.asarray(pixels) > 0)


def write_labelme(images: Iterable[LabeledImage], directory: str | Path) -> None:
    """Write LabelMe files beside copies of the photos; the labels are the package's categories.

    Boxes become rectangles; names and texts are kept as fields that LabelMe passes on.

    Parameters
    ----------
    images
        What to write.
    directory
        An empty or a new folder.

    Raises
    ------
    InputError
        If the folder is not empty, or cannot be written to.
    """
    directory = Path(directory)
    for image, name in copy_photos(images, directory):
        values: dict[str, Any] = {
            "version": "5.5.0",
            "flags": {},
            "shapes": [_fields(item) for item in image.objects],
            "imagePath": name,
            "imageData": None,
            "imageHeight": image.height,
            "imageWidth": image.width,
        }
        write_bytes((directory / name).with_suffix(".json"), json_bytes(values))


def _fields(item: LabeledObject) -> dict[str, Any]:
    attributes = attributes_of(item)
    corners = np.reshape(item.box, (2, 2))
    points = corners if item.polygon is None else item.polygon
    return {
        "label": item.category,
        "points": (points + CORNER).tolist(),
        "group_id": None,
        "description": "",
        "shape_type": "rectangle" if item.polygon is None else "polygon",
        "flags": {key: attributes[key] for key in ("ignore", "truncated")},
        "name": item.name,
        "text": item.text,
    }
