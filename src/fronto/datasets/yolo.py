"""YOLO detection and segmentation folders (https://docs.ultralytics.com/datasets/).

A text file for each photo: ``class x y width height`` or ``class x1 y1 x2 y2 ...`` a line, as
shares of the photo's width and height, from the corner of its top-left pixel; the photo
upright. What the classes are called stands in ``data.yaml``, or a line each in ``names.txt``
or ``classes.txt``.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, Literal

import numpy as np

from fronto.datasets.names import check_names
from fronto.datasets.photos import copy_photos, list_photos, photo_size
from fronto.datasets.reading import CORNER, build_object, split_folder, split_of
from fronto.datasets.records import LABELS, LabeledImage, LabeledObject, polygon_box
from fronto.errors import InputError
from fronto.files import read_bytes, write_bytes
from fronto.shapes import FloatArray

__all__ = ["read_yolo", "write_yolo", "yolo_names_file"]

MAX_BYTES = 50_000_000
NAMES_FILES = ("data.yaml", "data.yml", "dataset.yaml", "names.txt", "classes.txt")
SPLITS = ("train", "val", "test")
#: Shares of width and height: labels reach a little beyond the photo, pixels far beyond.
LEAST, MOST = -1.0, 2.0


def yolo_names_file(path: Path) -> Path | None:
    """The file that names the classes of a YOLO data set: itself, or in its folder."""
    if path.is_file():
        return path
    return next((path / name for name in NAMES_FILES if (path / name).is_file()), None)


def read_yolo(path: str | Path, split: str | None = None) -> list[LabeledImage]:
    """Read a YOLO data set, whose lines may mix boxes and polygons.

    The photos are where ``data.yaml`` says, in ``train/images``, ``images/train``, ``images``
    or beside their labels; the labels where "images" reads "labels". A photo without a
    label file has nothing on it.

    Parameters
    ----------
    path
        The folder, or the file in it that names the classes.
    split
        "train", "val" (or "valid"), "test"; None: everything.

    Raises
    ------
    InputError
        Naming the file and the line.
    """
    names_file = yolo_names_file(Path(path))
    if names_file is None:
        raise InputError(
            f"data set {path}", f"expected one of {', '.join(NAMES_FILES)}, there is none"
        )
    names, fields = _class_names(names_file)
    photos = _photos(names_file.parent, fields, split)
    labels = {photo: _label_file(photo) for photo in photos}
    if not any(file.is_file() for file in labels.values()):
        where = f" of the split {split!r}" if split else ""
        raise InputError(
            f"data set {path}",
            f"expected photos{where} with label files (images/a.jpg, labels/a.txt), got"
            f" {len(photos)} photos and no label file",
            "check the folders' names",
        )
    used: set[int] = set()
    images = [_read_image(photo, file, names, used) for photo, file in labels.items()]
    check_names((names[index] for index in used), f"class names {names_file}")
    return images


def _class_names(path: Path) -> tuple[dict[int, str], dict[str, Any]]:
    """Names by class number, and the other fields of ``data.yaml``."""
    import yaml

    thing = f"class names {path}"
    content = read_bytes(path, thing, MAX_BYTES)
    try:
        text = content.decode("utf-8-sig")
        if path.suffix == ".txt":
            return dict(enumerate(text.splitlines())), {}
        fields = yaml.safe_load(text)
    except UnicodeDecodeError:
        raise InputError(thing, "expected UTF-8, got other bytes", "save it as UTF-8") from None
    except (yaml.YAMLError, ValueError, RecursionError) as error:
        mark = getattr(error, "problem_mark", None)
        place = thing if mark is None else f"{thing}, line {mark.line + 1}"
        raise InputError(place, "expected YAML, got malformed text", "correct it") from None
    names = fields.get("names") if isinstance(fields, dict) else None
    if isinstance(names, list):
        names = dict(enumerate(names))
    if not isinstance(names, dict) or not all(isinstance(key, int) for key in names):
        raise InputError(
            f"{thing}, names",
            "expected a list of names, or names by number",
            "write names: [up, down, ...]",
        )
    # YAML reads a floor label 12 as a number and NO as false.
    return {key: str(name) for key, name in names.items()}, fields


def _photos(root: Path, fields: dict[str, Any], split: str | None) -> list[Path]:
    wanted = None if split is None else split_of(split) or split
    stated = [
        folder
        for key, value in fields.items()
        if isinstance(key, str) and (key in SPLITS or key == "valid")
        if wanted is None or split_of(key) == wanted
        for entry in (value if isinstance(value, list) else [value])
        if isinstance(entry, str) and (folder := _stated(root, fields.get("path"), entry))
    ]
    folders = stated
    if not folders and wanted is not None:
        found = [split_folder(root / "images", split), split_folder(root, split)]
        folders = [folder for folder in found if folder is not None][:1]
    elif not folders:
        folders = [root]
    listed: dict[Path, None] = {}
    for folder in folders:
        listed.update(dict.fromkeys(_listed(folder) if folder.is_file() else list_photos(folder)))
    return list(listed)


def _stated(root: Path, base: object, entry: str) -> Path | None:
    """What ``data.yaml`` names, if it is there; Roboflow's exports name "../train/images"."""
    tail = entry.replace("\\", "/")
    bases = [root / base, root] if isinstance(base, str) else [root]
    tries = [folder / tail for folder in bases] + [root / tail.removeprefix("../")]
    return next((path for path in tries if path.exists()), None)


def _listed(path: Path) -> list[Path]:
    """The photos that a text file lists, one a line, relative to it."""
    return [path.parent / line.strip() for line in _lines(path) if line.strip()]


def _lines(path: Path) -> list[str]:
    """Lines of a text file, which may well be empty: nothing on the photo."""
    if path.stat().st_size > MAX_BYTES:
        raise InputError(f"file {path}", f"expected at most {MAX_BYTES / 1e6:g} MB, got more")
    return path.read_text(encoding="utf-8", errors="replace").splitlines()


def _label_file(photo: Path) -> Path:
    parts = list(photo.parts)
    for index in range(len(parts) - 2, -1, -1):
        if parts[index] == "images":
            parts[index] = "labels"
            break
    return Path(*parts).with_suffix(".txt")


def _read_image(photo: Path, file: Path, names: dict[int, str], used: set[int]) -> LabeledImage:
    width, height = photo_size(photo)
    objects = []
    if file.is_file():
        for number, line in enumerate(_lines(file), 1):
            if line.strip():
                place = f"labels file {file}, line {number}"
                index, values = _line(line, place)
                if index not in names:
                    raise InputError(
                        place,
                        f"expected a class among the {len(names)} that are named, got {index}",
                        "name it, or correct the number",
                    )
                used.add(index)
                found = _object(names[index], values, width, height, place)
                if found is not None:
                    objects.append(found)
    return LabeledImage(photo, width, height, tuple(objects))


def _line(line: str, place: str) -> tuple[int, list[float]]:
    try:
        first, *rest = map(float, line.split())
    except ValueError:
        raise InputError(place, f"expected numbers, got {line[:40]!r}", "correct it") from None
    if not first.is_integer() or len(rest) < 4 or len(rest) % 2:
        raise InputError(
            place,
            "expected a class and x, y, width, height, or a class and x, y of three or more"
            f" points, got {len(rest) + 1} numbers",
            "correct it",
        )
    if not all(LEAST <= value <= MOST for value in rest):
        raise InputError(
            place, "expected shares of width and height, 0 to 1, got others", "divide by the size"
        )
    return int(first), rest


def _object(
    label: str, values: list[float], width: int, height: int, place: str
) -> LabeledObject | None:
    if len(values) == 4:
        x, y, w, h = (v * side for v, side in zip(values, (width, height) * 2, strict=True))
        left, top = x - w / 2 - CORNER, y - h / 2 - CORNER
        return build_object(label, place, box=(left, top, left + w, top + h))
    points = np.reshape(values, (-1, 2)) * (width, height) - CORNER
    return build_object(label, place, polygon=points)


def write_yolo(
    images: Iterable[LabeledImage],
    directory: str | Path,
    *,
    split: str = "train",
    kind: Literal["segment", "detect"] = "segment",
) -> None:
    """Write a YOLO data set: ``images/SPLIT``, ``labels/SPLIT`` and ``data.yaml``.

    YOLO has no place for names, texts and marks: they are lost, and what is to be ignored
    is left out. Outlines are cut at the photo's border, beyond which YOLO's own tools
    refuse them.

    Parameters
    ----------
    images
        What to write.
    directory
        Where; other splits may be there already.
    split
        Name of the split: "train", "val" or "test".
    kind
        "segment": polygons, of which a mere box is one too (one line of another kind and
        YOLO's tools take the whole set for boxes); "detect": boxes.

    Raises
    ------
    InputError
        If the split is none, lies there already, or cannot be written.
    """
    if split not in SPLITS:
        raise InputError("split", f"expected one of {', '.join(SPLITS)}, got {split!r}")
    directory = Path(directory)
    labels = directory / "labels" / split
    for image, name in copy_photos(images, directory / "images" / split):
        labels.mkdir(parents=True, exist_ok=True)
        lines = [_written(item, image, kind) for item in image.objects if not item.ignore]
        write_bytes((labels / name).with_suffix(".txt"), "".join(lines).encode())
    there = [name for name in SPLITS if (directory / "images" / name).is_dir()]
    text = "".join(f"{name}: images/{name}\n" for name in there)
    text += "names:\n" + "".join(f"  {index}: {name}\n" for index, name in enumerate(LABELS))
    write_bytes(directory / "data.yaml", text.encode())


def _written(item: LabeledObject, image: LabeledImage, kind: str) -> str:
    from fronto.warp.polygon import clip_half_plane

    x0, y0, x1, y1 = item.box
    outline: FloatArray = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
    if item.polygon is not None and kind == "segment":
        outline = item.polygon
    right, bottom = image.width - CORNER, image.height - CORNER
    for line in ((1, 0, CORNER), (-1, 0, right), (0, 1, CORNER), (0, -1, bottom)):
        outline = clip_half_plane(outline, line)
    if len(outline) < 3:
        return ""
    size = np.array([image.width, image.height])
    if kind == "segment":
        shares = (outline + CORNER) / size
    else:
        box = np.reshape(polygon_box(outline), (2, 2)) + CORNER
        shares = np.array([box.mean(axis=0), box[1] - box[0]]) / size
    values = " ".join(f"{min(max(value, 0.0), 1.0):.12g}" for value in shares.ravel().tolist())
    return f"{LABELS.index(item.category)} {values}\n"
