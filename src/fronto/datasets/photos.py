"""The photos of a data set: their size without decoding them, where they lie, and copies."""

from __future__ import annotations

import shutil
import warnings
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

from fronto.datasets.records import LabeledImage
from fronto.errors import InputError

__all__ = ["SUFFIXES", "check_size", "copy_photos", "find_photo", "list_photos", "photo_size"]

#: What is taken for a photo where a folder says what there is.
SUFFIXES = frozenset((".bmp", ".jpeg", ".jpg", ".png", ".tif", ".tiff", ".webp"))
ORIENTATION = 0x0112
#: EXIF's orientations that exchange width and height.
LYING = (5, 6, 7, 8)
PNG_MARKERS = (b"eXIf", b"Raw profile type exif", b"XML:com.adobe.xmp")


def photo_size(path: Path) -> tuple[int, int]:
    """Width and height of a photo upright, from its header.

    The same as the shape of :func:`fronto.imageio.read_image`: EXIF's orientation counts.

    Raises
    ------
    InputError
        If there is no such file, or it is no image.
    """
    from PIL import Image

    thing = f"photo {path}"
    if not path.is_file():
        raise InputError(thing, "expected an image file, there is none", "check the path")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about sizes and odd metadata
            with Image.open(path) as image:
                width, height = image.size
                # Pillow turns TIFF itself, its size included.
                states = image.format != "TIFF" and (image.format != "PNG" or _has_exif(path))
                turned = states and image.getexif().get(ORIENTATION, 1) in LYING
    except Exception:  # Pillow's parsers raise whatever the bytes provoke
        raise InputError(
            thing, "expected an image, got a damaged file or another kind", "give JPEG or PNG"
        ) from None
    return (height, width) if turned else (width, height)


def _has_exif(path: Path) -> bool:
    """Whether a PNG may state an orientation, anywhere; Pillow would decode it to find out."""
    content = path.read_bytes()
    return any(marker in content for marker in PNG_MARKERS)


def check_size(path: Path, stated: tuple[int, int], thing: str) -> tuple[int, int]:
    """Size of a photo upright, which has to be the one that its labels state.

    Raises
    ------
    InputError
        Naming `thing` if they differ: its labels belong to other pixels.
    """
    size = photo_size(path)
    if size != stated:
        hint = " (on its side: EXIF orientation)" if size == stated[::-1] else ""
        raise InputError(
            thing,
            f"expected the upright size of photo {path}, {size[0]}x{size[1]},"
            f" got {stated[0]}x{stated[1]}{hint}",
            "label the photo as it is shown upright, or put the labelled one there",
        )
    return size


def find_photo(name: str, folders: Sequence[Path], thing: str) -> Path:
    """The photo of that name (with folders before it or without) in the first folder with one.

    Raises
    ------
    InputError
        Naming `thing`, if no folder has it.
    """
    path = Path(name.replace("\\", "/"))
    for tail in (path, Path(path.name)):
        for folder in folders:
            if (folder / tail).is_file():
                return folder / tail
    where = ", ".join(dict.fromkeys(str(folder) for folder in folders))
    raise InputError(
        thing, f"expected the photo {name!r} in {where}, there is none", "put it there"
    )


def list_photos(folder: Path) -> list[Path]:
    """The photos in a folder and in those below it, by name."""
    return sorted(
        path for path in folder.rglob("*") if path.suffix.lower() in SUFFIXES and path.is_file()
    )


def copy_photos(images: Iterable[LabeledImage], folder: Path) -> Iterator[tuple[LabeledImage, str]]:
    """Copy photos as they are into a new or empty folder; the image and its new file's name.

    Photos of one name get a number: also labels named after them must not collide.

    Raises
    ------
    InputError
        If the folder has something in it, or a photo cannot be copied.
    """
    thing = f"output folder {folder}"
    try:
        if folder.exists() and any(folder.iterdir()):
            raise InputError(thing, "expected a new or an empty folder", "choose another one")
        folder.mkdir(parents=True, exist_ok=True)
        taken: set[str] = set()
        for image in images:
            stem, number = image.path.stem, 1
            while stem.casefold() in taken:
                number += 1
                stem = f"{image.path.stem}-{number}"
            taken.add(stem.casefold())
            name = stem + image.path.suffix
            shutil.copyfile(image.path, folder / name)
            yield image, name
    except OSError as error:
        raise InputError(
            thing, f"expected to copy photos there, got: {error.strerror}", "check both places"
        ) from None
