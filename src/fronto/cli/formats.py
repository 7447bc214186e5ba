"""Data sets that the commands can write."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from fronto.errors import InputError

if TYPE_CHECKING:
    from fronto.datasets.records import LabeledImage

__all__ = ["FORMATS", "Format", "check_new_folder", "write_dataset"]

Format = Literal["coco", "labelme", "cvat", "yolo"]
FORMATS: tuple[Format, ...] = ("coco", "labelme", "cvat", "yolo")


def check_new_folder(folder: Path) -> None:
    """Refuse a folder that has something in it, before long work for it begins.

    Raises
    ------
    InputError
        Naming the folder.
    """
    if folder.exists() and not (folder.is_dir() and next(folder.iterdir(), None) is None):
        raise InputError(
            f"output folder {folder}", "expected a new or an empty folder", "choose another one"
        )


def write_dataset(images: Iterable[LabeledImage], directory: Path, kind: Format) -> None:
    """Write labelled photos in one of the `FORMATS`.

    Raises
    ------
    InputError
        If something lies there already, or cannot be written.
    """
    if kind == "coco":
        from fronto.datasets.coco import write_coco

        write_coco(images, directory)
    elif kind == "labelme":
        from fronto.datasets.labelme import write_labelme

        write_labelme(images, directory)
    elif kind == "cvat":
        from fronto.datasets.cvat import write_cvat

        write_cvat(images, directory)
    else:
        from fronto.datasets.yolo import write_yolo

        write_yolo(images, directory)
