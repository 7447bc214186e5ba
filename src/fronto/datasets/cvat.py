"""CVAT for images 1.1: one XML file (https://docs.cvat.ai/docs/dataset_management/formats/).

Its coordinates count from the corner of the top-left pixel, in the photo as CVAT shows it,
upright.
"""

from __future__ import annotations

import re
from collections.abc import Iterable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from fronto.datasets.masks import mask_polygon, row_mask
from fronto.datasets.names import category_of, check_names
from fronto.datasets.photos import check_size, copy_photos, find_photo
from fronto.datasets.reading import (
    CORNER,
    attributes_of,
    build_object,
    located,
    split_folder,
    split_of,
)
from fronto.datasets.records import LABELS, Box, LabeledImage, LabeledObject
from fronto.errors import InputError
from fronto.files import read_bytes, write_bytes
from fronto.shapes import Ellipse, FloatArray

__all__ = ["cvat_files", "read_cvat", "write_cvat"]

MAX_BYTES = 500_000_000
ELLIPSE_POINTS = 72
#: Characters that XML 1.0 cannot hold, escaped or not.
NO_XML = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\ufffe\uffff]")
#: Attributes as CVAT declares them.
ATTRIBUTES = (("name", "text"), ("text", "text"), ("ignore", "checkbox"), ("truncated", "checkbox"))
SHAPES = ("box", "polygon", "ellipse", "mask")
#: Shapes that bound no area, or have no outline.
OTHER_SHAPES = ("polyline", "points", "cuboid", "skeleton")


class _Builder(ElementTree.TreeBuilder):
    """Refuses document types: only they can declare entities that grow without end."""

    def doctype(self, name: str, pubid: str | None, system: str | None) -> None:
        raise InputError("DOCTYPE", "expected none, as CVAT writes none", "take it out")


def cvat_files(path: Path, split: str | None = None) -> list[Path]:
    """The XML files with CVAT's root in a folder, or one in the folder of a split."""
    if path.is_file():
        return [path]
    below = [f for f in sorted(path.glob("*")) if f.is_dir() and split_of(f.name)]
    chosen = [path] if split is None else [split_folder(path, split)]
    for folders in (chosen, below if split is None else [path]):
        files = [file for folder in folders if folder for file in sorted(folder.glob("*.xml"))]
        if found := [file for file in files if _looks_right(file)]:
            return found
    return []


def _looks_right(path: Path) -> bool:
    with path.open("rb") as file:
        return b"<annotations" in file.read(4096)


def read_cvat(path: str | Path, split: str | None = None) -> list[LabeledImage]:
    """Read boxes, polygons, ellipses and masks of "CVAT for images 1.1".

    A turned box becomes a polygon. Attributes "text", "name", "ignore" and "truncated"
    count.

    Parameters
    ----------
    path
        The XML file, or its folder; the photos are looked for beside it and in "images".
    split
        Only the images of this subset, or what lies in the folder of that name.

    Raises
    ------
    InputError
        Naming the file, the image and the field.
    """
    root = Path(path)
    files = cvat_files(root, split)
    if not files:
        raise InputError(
            f"data set {path}", "expected CVAT's annotations.xml", "export CVAT for images 1.1"
        )
    return [image for file in files for image in _read_file(file, root, split)]


def _read_file(path: Path, root: Path, split: str | None) -> list[LabeledImage]:
    thing = f"CVAT file {path}"
    tree = _parse(path, thing)
    if tree.tag != "annotations" or tree.find("track") is not None:
        found = "tracks" if tree.tag == "annotations" else f"<{tree.tag}>"
        raise InputError(
            thing,
            f"expected <annotations> with <image>s, got {found}",
            "export as CVAT for images 1.1",
        )
    names: list[str] = []
    images = []
    in_folder = split is not None and path.parent != root and root.is_dir()
    for number, element in enumerate(tree.iterfind("image")):
        name = element.get("name")
        place = f"{thing}, image {name or number}"
        if name is None:
            raise InputError(f"{place}, name", "expected the photo's name, got none")
        subset = element.get("subset") or ""
        if split is not None and not in_folder:
            wanted = split_of(split) or split
            if wanted not in (split_of(subset) or subset, split_of(str(Path(name).parent))):
                continue
        folders = [path.parent, path.parent / "images", path.parent / "images" / subset]
        photo = find_photo(name, folders, place)
        size = int(_number(element, "width", place)), int(_number(element, "height", place))
        width, height = check_size(photo, size, f"{place}, width, height")
        objects = []
        for index, shape in enumerate(element):
            label = shape.get("label", "")
            if shape.tag not in SHAPES + OTHER_SHAPES:
                continue  # tags
            names.append(label)
            if category_of(label) is not None:
                where = f"{place}, {shape.tag} {index + 1}"
                objects.append(_object(shape, label, width, height, where))
        images.append(LabeledImage(photo, width, height, tuple(objects)))
    if split is not None and not images:
        raise InputError(
            thing, f"expected images of the subset {split!r}, got none", "leave out the split"
        )
    check_names(names, thing)
    return images


def _parse(path: Path, thing: str) -> ElementTree.Element:
    content = read_bytes(path, thing, MAX_BYTES)
    parser = ElementTree.XMLParser(target=_Builder())
    try:
        with located(thing):
            parser.feed(content)
        tree = parser.close()
    except ElementTree.ParseError as error:
        line, column = error.position
        raise InputError(
            f"{thing}, line {line}, column {column + 1}",
            "expected XML, got malformed text",
            "export it again",
        ) from None
    assert isinstance(tree, ElementTree.Element)
    return tree


def _number(element: ElementTree.Element, key: str, place: str, default: str = "") -> float:
    text = element.get(key, default)
    try:
        value = float(text)
    except ValueError:
        value = np.nan
    if not abs(value) < 1e9:
        raise InputError(f"{place}, {key}", f"expected a number, got {text!r}")
    return value


def _object(
    shape: ElementTree.Element, label: str, width: int, height: int, place: str
) -> LabeledObject:
    box: Box | None = None
    polygon: FloatArray | None = None

    def numbers(*keys: str) -> list[float]:
        return [_number(shape, key, place) for key in keys]

    turn = _number(shape, "rotation", place, "0")
    with located(place):
        match shape.tag:
            case "box":
                x0, y0, x1, y1 = np.subtract(numbers("xtl", "ytl", "xbr", "ybr"), CORNER).tolist()
                if turn % 360:
                    polygon = _turned(x0, y0, x1, y1, turn)
                else:
                    box = x0, y0, x1, y1
            case "polygon":
                polygon = _points(shape.get("points", "")) - CORNER
            case "ellipse":
                cx, cy, rx, ry = numbers("cx", "cy", "rx", "ry")
                if rx < ry:
                    rx, ry, turn = ry, rx, turn + 90
                ellipse = Ellipse(cx - CORNER, cy - CORNER, rx, ry, turn)
                polygon = ellipse.points(ELLIPSE_POINTS)
            case "mask":
                left, top, columns, rows = map(int, numbers("left", "top", "width", "height"))
                if columns > width or rows > height:
                    raise InputError("mask", "expected it within the photo, got a larger one")
                counts = _numbers(shape.get("rle", ""), "rle")
                outline = mask_polygon(row_mask(list(map(int, counts)), rows, columns))
                polygon = np.add(outline, (left, top))
            case other:
                raise InputError(
                    other, f"expected one of {', '.join(SHAPES)}", "outline the button with those"
                )
    attributes: dict[str, Any] = {
        attribute.get("name", ""): attribute.text or "" for attribute in shape.iterfind("attribute")
    }
    found = build_object(label, place, box=box, polygon=polygon, attributes=attributes)
    assert found is not None  # the caller left out what is no button
    return found


def _turned(x0: float, y0: float, x1: float, y1: float, turn_deg: float) -> FloatArray:
    """Corners (4, 2) of a box turned clockwise as seen about its centre."""
    center = np.array([(x0 + x1) / 2, (y0 + y1) / 2])
    cos, sin = np.cos(np.radians(turn_deg)), np.sin(np.radians(turn_deg))
    corners = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]) - center
    return np.asarray(corners @ np.array([[cos, sin], [-sin, cos]]) + center)


def _numbers(text: str, field: str) -> list[float]:
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        values = [np.nan]
    if not np.isfinite(values).all():
        raise InputError(field, f"expected numbers and commas, got {text[:40]!r}")
    return values


def _points(text: str) -> FloatArray:
    pairs = [_numbers(pair, "points") for pair in text.split(";") if pair.strip()]
    if any(len(pair) != 2 for pair in pairs):
        raise InputError("points", f"expected x,y;x,y;..., got {text[:40]!r}")
    return np.array(pairs, dtype=np.float64).reshape(-1, 2)


def write_cvat(images: Iterable[LabeledImage], directory: str | Path) -> None:
    """Write ``annotations.xml`` for CVAT, and copies of the photos in ``images``.

    The labels are the package's categories; names, texts and marks are attributes.

    Parameters
    ----------
    images
        What to write.
    directory
        Its folder "images" must be empty or new.

    Raises
    ------
    InputError
        If something lies there already, or cannot be written.
    """
    directory = Path(directory)
    tree = ElementTree.Element("annotations")
    ElementTree.SubElement(tree, "version").text = "1.1"
    labels = ElementTree.SubElement(
        ElementTree.SubElement(ElementTree.SubElement(tree, "meta"), "task"), "labels"
    )
    for category in LABELS:
        label = ElementTree.SubElement(labels, "label")
        ElementTree.SubElement(label, "name").text = category
        attributes = ElementTree.SubElement(label, "attributes")
        for key, kind in ATTRIBUTES:
            attribute = ElementTree.SubElement(attributes, "attribute")
            ElementTree.SubElement(attribute, "name").text = key
            ElementTree.SubElement(attribute, "mutable").text = "False"
            ElementTree.SubElement(attribute, "input_type").text = kind
    for number, (image, name) in enumerate(copy_photos(images, directory / "images")):
        parent = ElementTree.SubElement(tree, "image", id=str(number), name=name)
        parent.set("width", str(image.width))
        parent.set("height", str(image.height))
        for item in image.objects:
            _write_shape(parent, item)
    ElementTree.indent(tree)
    content = ElementTree.tostring(tree, encoding="utf-8", xml_declaration=True)
    write_bytes(directory / "annotations.xml", content)


def _write_shape(parent: ElementTree.Element, item: LabeledObject) -> None:
    fields = {"label": item.category, "source": "manual", "occluded": "0", "z_order": "0"}
    if item.polygon is None:
        edges = zip(("xtl", "ytl", "xbr", "ybr"), item.box, strict=True)
        fields.update((key, repr(edge + CORNER)) for key, edge in edges)
    else:
        pairs = (item.polygon + CORNER).tolist()
        fields["points"] = ";".join(f"{x!r},{y!r}" for x, y in pairs)
    tag = "box" if item.polygon is None else "polygon"
    shape = ElementTree.SubElement(parent, tag, fields)
    for key, value in attributes_of(item).items():
        attribute = ElementTree.SubElement(shape, "attribute", name=key)
        attribute.text = str(value).lower() if isinstance(value, bool) else NO_XML.sub("", value)
