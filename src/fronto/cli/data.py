"""Labelled photos that a command is given."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from fronto.errors import InputError

if TYPE_CHECKING:
    from fronto.datasets.records import LabeledImage

__all__ = ["is_panels", "labeled_images"]


def is_panels(data: Path) -> bool:
    """Whether a folder is the panels set, whose labels need corrections of their own."""
    return (data / "names.txt").is_file() and all(
        (data / split / "labels").is_dir() for split in ("train", "valid")
    )


def labeled_images(data: Path, split: str | None, default: str) -> list[LabeledImage]:
    """Read a data set in any format, or the panels set.

    Parameters
    ----------
    data
        A folder, or a file of labels.
    split
        "train", "val" (or "valid"), "test"; None: the default one, or everything where the
        data set has no such split.
    default
        The default split.

    Raises
    ------
    InputError
        If it is no data set, a label is wrong, or there are no photos in it.
    """
    if split is not None:
        return _read(data, split)
    try:
        return _read(data, default)
    except InputError:
        # What is wrong with the data set itself comes up again.
        return _read(data, None)


def _read(data: Path, split: str | None) -> list[LabeledImage]:
    if is_panels(data):
        from fronto.datasets.panels import read_panels

        splits = ("train", "valid") if split is None else (split,)
        images = [
            image
            for name in splits
            for image in read_panels(data, "valid" if name == "val" else name)
        ]
    else:
        from fronto.datasets.opening import open_dataset

        images = open_dataset(data, split)
    if not images:
        raise InputError(
            f"data set {data}",
            f"expected labelled photos{f' of the split {split}' if split else ''}, found none",
            "check --split and the folder",
        )
    return images
