"""COCO instances: one JSON file for many photos (https://cocodataset.org/#format-data).

Its coordinates count from the corner of the top-left pixel. Boxes refer to the photo upright.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from fronto.datasets.masks import coco_mask, join_pieces, mask_polygon
from fronto.datasets.names import check_names
from fronto.datasets.photos import check_size, copy_photos, find_photo
from fronto.datasets.reading import (
    CORNER,
    attributes_of,
    build_object,
    json_kind,
    located,
    read_json,
    split_folder,
    split_of,
)
from fronto.datasets.records import LABELS, Box, LabeledImage, LabeledObject
from fronto.errors import InputError
from fronto.files import json_bytes, write_bytes
from fronto.shapes import FloatArray

__all__ = ["coco_files", "read_coco", "write_coco"]


class _Category(msgspec.Struct):
    id: int
    name: str


class _Image(msgspec.Struct):
    id: int | str
    file_name: str
    width: int
    height: int


class _RunLengths(msgspec.Struct):
    size: tuple[int, int]
    counts: list[int] | str


class _Annotation(msgspec.Struct):
    image_id: int | str
    category_id: int
    bbox: tuple[float, float, float, float] | None = None
    segmentation: list[list[float]] | _RunLengths | None = None
    iscrowd: int = 0
    ignore: int | bool = 0
    attributes: dict[str, Any] = {}  # msgspec copies it


class _File(msgspec.Struct):
    images: list[_Image]
    annotations: list[_Annotation]
    categories: list[_Category]


def coco_files(path: Path, split: str | None = None) -> list[Path]:
    """The COCO files of a data set: in its folder, in "annotations", or in a split's folder.

    Parameters
    ----------
    path
        A folder, or one such file (taken as it is).
    split
        Only those whose name or folder names this split; None: all of them.
    """
    if path.is_file():
        return [path]
    folders = [path, path / "annotations"]
    folders += [f for f in sorted(path.glob("*")) if f.is_dir() and split_of(f.name)]
    found = [
        file
        for folder in folders
        for file in sorted(folder.glob("*.json"))
        if split is None
        or (split_of(split) or split) in (split_of(file.stem) or split_of(file.parent.name),)
    ]
    return [file for file in found if json_kind(file) == "coco"]


def read_coco(path: str | Path, split: str | None = None) -> list[LabeledImage]:
    """Read COCO instances: polygons, masks as run lengths (plain or compressed), or boxes.

    Several polygons of one object, and pieces of a mask, are joined by their convex hull.
    "iscrowd" and "ignore" make an object one to ignore.

    Parameters
    ----------
    path
        A JSON file, or a folder with such files. The photos are looked for beside it and
        in "images", in the split's folder, and in both below the folder above "annotations".
    split
        "train", "val" (or "valid"), "test"; None: everything.

    Raises
    ------
    InputError
        Naming the file and the field.
    """
    root = Path(path)
    files = coco_files(root, split)
    if not files:
        raise InputError(
            f"data set {path}",
            "expected a COCO file (with images, annotations and categories)"
            + (f" of the split {split!r}" if split else ""),
            "name the file itself",
        )
    return [image for file in files for image in _read_file(file, split)]


def _read_file(path: Path, split: str | None) -> list[LabeledImage]:
    thing = f"COCO file {path}"
    file = read_json(path, _File, thing)
    names = {category.id: category.name for category in file.categories}
    objects: dict[int | str, list[LabeledObject]] = {image.id: [] for image in file.images}
    if len(objects) < len(file.images):
        raise InputError(f"{thing}, images", "expected different ids, got one twice")
    sizes = {image.id: (image.width, image.height) for image in file.images}
    for index, annotation in enumerate(file.annotations):
        place = f"{thing}, annotations[{index}]"
        if annotation.image_id not in objects:
            raise InputError(
                f"{place}.image_id", f"expected an id among images, got {annotation.image_id!r}"
            )
        if annotation.category_id not in names:
            raise InputError(
                f"{place}.category_id",
                f"expected an id among categories, got {annotation.category_id}",
            )
        label = names[annotation.category_id]
        found = _object(annotation, label, sizes[annotation.image_id], place)
        if found is not None:
            objects[annotation.image_id].append(found)
    check_names((names[item.category_id] for item in file.annotations), thing)
    folders = _photo_folders(path, split)
    images = []
    for index, image in enumerate(file.images):
        place = f"{thing}, images[{index}]"
        photo = find_photo(image.file_name, folders, place)
        width, height = check_size(photo, (image.width, image.height), place)
        images.append(LabeledImage(photo, width, height, tuple(objects[image.id])))
    return images


def _photo_folders(path: Path, split: str | None) -> list[Path]:
    """Where the photos of a COCO file may lie, the likeliest first."""
    folders = [path.parent, path.parent / "images"]
    root = path.parent.parent if path.parent.name == "annotations" else path.parent
    named = root / path.stem.partition("_")[2]  # instances_val2017: val2017
    split = split or split_of(path.stem)
    split_folders = [split_folder(root, split), split_folder(root / "images", split)]
    return [*folders, named, *(f for f in split_folders if f), root, root / "images", root / "data"]


def _object(
    annotation: _Annotation, label: str, size: tuple[int, int], place: str
) -> LabeledObject | None:
    attributes = dict(annotation.attributes)
    attributes["ignore"] = bool(
        annotation.iscrowd or annotation.ignore or annotation.attributes.get("ignore")
    )
    with located(place):
        polygon = _polygon(annotation.segmentation, size)
        box: Box | None = None
        if annotation.bbox is not None:
            x, y, w, h = annotation.bbox
            box = x - CORNER, y - CORNER, x + w - CORNER, y + h - CORNER
        elif polygon is None:
            raise InputError("bbox", "expected a box or a segmentation, got neither")
    return build_object(label, place, box=box, polygon=polygon, attributes=attributes)


def _polygon(
    segmentation: list[list[float]] | _RunLengths | None, size: tuple[int, int]
) -> FloatArray | None:
    if not segmentation:
        return None
    if isinstance(segmentation, _RunLengths):
        height, width = segmentation.size
        if (width, height) != size:
            raise InputError(
                "segmentation.size",
                f"expected the image's height and width, {size[1]}, {size[0]},"
                f" got {height}, {width}",
            )
        return mask_polygon(coco_mask(segmentation.counts, height, width))
    if any(len(piece) < 6 or len(piece) % 2 for piece in segmentation):
        raise InputError("segmentation", "expected x, y of three or more points in each polygon")
    return join_pieces([np.reshape(piece, (-1, 2)) - CORNER for piece in segmentation])


def write_coco(images: Iterable[LabeledImage], directory: str | Path) -> None:
    """Write COCO instances: ``annotations.json``, and copies of the photos in ``images``.

    The categories are the package's own; names, texts and marks are kept as "attributes",
    and what is to be ignored is a crowd.

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
    listed: list[dict[str, Any]] = []
    annotations: list[dict[str, Any]] = []
    for image, name in copy_photos(images, directory / "images"):
        number = len(listed) + 1
        listed.append(
            {"id": number, "file_name": name, "width": image.width, "height": image.height}
        )
        annotations += (
            {"id": len(annotations) + index, "image_id": number, **_fields(item)}
            for index, item in enumerate(image.objects, 1)
        )
    categories = [
        {"id": index, "name": name, "supercategory": "panel"}
        for index, name in enumerate(LABELS, 1)
    ]
    values = {"images": listed, "annotations": annotations, "categories": categories}
    write_bytes(directory / "annotations.json", json_bytes(values))


def _fields(item: LabeledObject) -> dict[str, Any]:
    x0, y0, x1, y1 = item.box
    segmentation: Sequence[Sequence[float]] = []
    area = (x1 - x0) * (y1 - y0)
    if item.polygon is not None:
        segmentation = [(item.polygon + CORNER).ravel().tolist()]
        x, y = (item.polygon - item.polygon[0]).T
        area = abs(float(x @ np.roll(y, -1) - y @ np.roll(x, -1))) / 2
    return {
        "category_id": LABELS.index(item.category) + 1,
        "bbox": [x0 + CORNER, y0 + CORNER, x1 - x0, y1 - y0],
        "segmentation": segmentation,
        "area": area,
        "iscrowd": int(item.ignore),
        "attributes": attributes_of(item),
    }
