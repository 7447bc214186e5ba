"""Any data set of labelled photos, its format found out from what lies there."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from fronto.datasets.annotated import annotated_files, read_annotated
from fronto.datasets.coco import coco_files, read_coco
from fronto.datasets.cvat import cvat_files, read_cvat
from fronto.datasets.labelme import labelme_files, read_labelme
from fronto.datasets.reading import json_kind, split_folder
from fronto.datasets.records import LabeledImage
from fronto.datasets.yolo import NAMES_FILES, read_yolo, yolo_names_file
from fronto.errors import InputError

__all__ = ["open_dataset"]

Reader = Callable[[Path, str | None], list[LabeledImage]]

JSON_READERS: dict[str, Reader] = {
    "coco": read_coco,
    "labelme": read_labelme,
    "annotated": read_annotated,
}
#: For a folder, in this order: a format that says more before one that says less.
FORMATS: tuple[tuple[Callable[[Path], object], Reader], ...] = (
    (annotated_files, read_annotated),
    (cvat_files, read_cvat),
    (coco_files, read_coco),
    (yolo_names_file, read_yolo),
    (labelme_files, read_labelme),
)
LOOKED_FOR = (
    "labels/*.json with buttons (this project's annotations), annotations.xml (CVAT for images"
    " 1.1), JSON with images, annotations and categories (COCO), one of"
    f" {', '.join(NAMES_FILES)} (YOLO), JSON with shapes (LabelMe)"
)


def open_dataset(path: str | Path, split: str | None = None) -> list[LabeledImage]:
    """Read labelled photos in any format that the package knows.

    COCO, LabelMe, CVAT for images, YOLO, and the project's own annotations. Only the
    photos' headers are read. Boxes and outlines refer to the photo upright (its EXIF
    orientation applied), as annotation tools show it.

    Parameters
    ----------
    path
        The data set's folder, or its labels file.
    split
        "train", "val" (or "valid"), "test"; None: everything.

    Raises
    ------
    InputError
        Saying what was looked for, or naming the file and the field that is wrong.
    """
    root = Path(path)
    if root.is_file():
        reader = _file_reader(root)
        if reader is not None:
            return reader(root, split)
    elif root.is_dir():
        folders = [folder for folder in (root, split_folder(root, split)) if folder is not None]
        for present, reader in FORMATS:
            if any(present(folder) for folder in folders):
                return reader(root, split)
    else:
        raise InputError(
            f"data set {root}", "expected a folder or a file, there is none", "check the path"
        )
    raise InputError(
        f"data set {root}", f"expected one of {LOOKED_FOR}; found none", "export it as one of those"
    )


def _file_reader(path: Path) -> Reader | None:
    match path.suffix.lower():
        case ".json":
            kind = json_kind(path)
            return None if kind is None else JSON_READERS[kind]
        case ".xml":
            return read_cvat
        case ".yaml" | ".yml":
            return read_yolo
        case _:
            return read_yolo if path.name in NAMES_FILES else None
