"""What people name on the command line, as files: folders, patterns, standard input, videos."""

from __future__ import annotations

import os
import re
import sys
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from glob import glob, has_magic
from pathlib import Path

from fronto.errors import InputError

__all__ = ["STDIN", "expanded", "is_video", "read_stdin", "result_names"]

STDIN = Path("-")
#: What is taken out of a folder; named on its own, a file may be called anything.
PHOTOS = frozenset(
    [".jpg", ".jpeg", ".jpe", ".png", ".webp", ".tif", ".tiff", ".bmp",
     ".gif", ".ppm", ".pgm", ".pnm", ".jp2", ".avif"]
)  # fmt: skip
VIDEOS = frozenset([".mp4", ".m4v", ".mov", ".avi", ".mkv", ".webm", ".mpg", ".mpeg", ".wmv"])
#: Pictures that fronto itself has written are no photos; nor are hidden files.
OWN = re.compile(
    r".*\.(overlay|rectified|segments|outlines|steps|before_after)\.png|.*\.rectified\.mp4|\..*",
    re.IGNORECASE,
)
MAX_STDIN_BYTES = 200_000_000


def is_video(path: Path) -> bool:
    """Whether a file's name is that of a video."""
    return path.suffix.lower() in VIDEOS


def expanded(arguments: Iterable[Path]) -> list[Path]:
    """Files in folders (not below them), and those that a pattern stands for, in order.

    Numbers in names count as numbers: photo 2 comes before photo 10.

    Raises
    ------
    InputError
        If a folder or a pattern has no photo or video.
    """
    found: list[Path] = []
    for argument in arguments:
        if os.path.isdir(argument):  # noqa: PTH112, of any name: Path.is_dir raises for some
            found += _of_folder(argument)
        elif has_magic(str(argument)) and not os.path.exists(argument):  # noqa: PTH110
            # Shells expand patterns themselves, but for quoted ones, and not on Windows.
            matching = [Path(name) for name in glob(str(argument), recursive=True)]  # noqa: PTH207
            files = sorted((p for p in matching if _is_picture(p)), key=_order)
            if not files:
                raise InputError(
                    f"pattern {argument}",
                    "expected to match some photos, got none",
                    "check it, or name a folder",
                )
            found += files
        else:
            found.append(argument)
    once: dict[str, Path] = {}
    for path in found:
        # Two links to one photo have names of their own, as a result of each should have.
        once.setdefault(os.path.join(os.path.realpath(path.parent), path.name), path)  # noqa: PTH118
    return list(once.values())


def _of_folder(folder: Path) -> list[Path]:
    try:
        files = [path for path in folder.iterdir() if _is_picture(path)]
    except OSError as error:
        raise InputError(
            f"folder {folder}", f"expected a readable folder, got: {error.strerror}"
        ) from None
    if not files:
        raise InputError(
            f"folder {folder}",
            "expected photos or videos in it, got none",
            "name the folder that they are in, or the files themselves",
        )
    return sorted(files, key=_order)


def _is_picture(path: Path) -> bool:
    return (
        path.suffix.lower() in PHOTOS | VIDEOS and not OWN.fullmatch(path.name) and path.is_file()
    )


def _order(path: Path) -> tuple[list[tuple[bool, int, str]], str]:
    parts = re.split(r"(\d+)", str(path).casefold())
    return [(p.isdecimal(), int(p) if p.isdecimal() else 0, p) for p in parts], str(path)


def read_stdin(folder: Path) -> Path:
    """Standard input as a file in a folder.

    Raises
    ------
    InputError
        If nothing comes, or too much.
    """
    content = sys.stdin.buffer.read(MAX_STDIN_BYTES + 1)
    if not content:
        raise InputError("standard input", "expected a photo, got nothing", "pipe a file into it")
    if len(content) > MAX_STDIN_BYTES:
        raise InputError(
            "standard input", f"expected at most {MAX_STDIN_BYTES / 1e6:g} MB, got more"
        )
    path = folder / "stdin"
    path.write_bytes(content)
    return path


def result_names(photos: Sequence[Path]) -> Iterator[str]:
    """What the results of each are named after.

    Its stem; where two have the same (hall.jpg beside hall.png), the whole name.
    """
    # Some file systems do not tell upper from lower case.
    stems = Counter(photo.stem.casefold() for photo in photos)
    for photo in photos:
        yield photo.stem if stems[photo.stem.casefold()] == 1 else photo.name
