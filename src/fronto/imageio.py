"""Photos in, upright and RGB; pictures out as PNG."""

from __future__ import annotations

import io
import logging
import re
import time
import warnings
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import numpy as np
import numpy.typing as npt

from fronto.errors import InputError
from fronto.files import write_bytes

if TYPE_CHECKING:
    from PIL import Image
    from PIL.ImageFile import ImageFile

__all__ = ["open_image", "photo_name", "read_image", "upright_pixels", "write_png"]

#: Pillow itself refuses more than 179 million pixels, and that limit is global.
MAX_PIXELS = 150_000_000
#: What decodes within 2 GB and a few seconds: most formats take up to 12 bytes a pixel while
#: they do, WebP and AVIF 24; JPEG 2000 is slow; some of the others are decoded in Python.
PIXELS_OF_FORMAT = {
    **dict.fromkeys(("BMP", "DIB", "GIF", "JPEG", "MPO", "PNG", "PPM", "TIFF"), MAX_PIXELS),
    **dict.fromkeys(("AVIF", "HEIF", "WEBP"), 64_000_000),
    "JPEG2000": 25_000_000,
}
PIXELS_OF_OTHERS = 10_000_000
#: A drawing is run by another program (Ghostscript), which may never end; an icon holds
#: pictures of other sizes than it states.
REFUSED = {"EPS": "a drawing", "WMF": "a drawing", "ICNS": "an icon"}
#: Each of a progressive JPEG's scans goes over all pixels, and takes as little as 48 bytes.
MAX_SCANNED_PIXELS = 3_000_000_000
#: More than `MAX_PIXELS` of RGB; some decoders take the whole file into memory.
MAX_FILE_BYTES = 500_000_000
#: Of computing, not of waiting. Pillow parses some headers byte by byte, in Python.
MAX_SECONDS = 4.0
#: Converted at a time: an image and its copies in other modes do not fit side by side.
STRIP_PIXELS = 500_000
ORIENTATION = 0x0112
#: EXIF's orientations that exchange width and height, and those that undo another one.
LYING = (5, 6, 7, 8)
UNDO = {6: 8, 8: 6}
#: Pillow's modes whose values are 16-bit grey, and those with more than that.
GREY_16 = ("I;16", "I;16L", "I;16B", "I;16N")
WIDE = ("I", "F")
NO_LOG = logging.NullHandler()
#: How files begin that are photos where they are whole, and others that are taken for photos.
PHOTOS = (
    (rb"\xff\xd8", "JPEG"),
    (rb"\x89PNG", "PNG"),
    (rb"GIF8", "GIF"),
    (rb"RIFF....WEBP", "WebP"),
    (rb"(II|MM)([*+]\0|\0[*+])", "TIFF"),
    (rb"....ftypavif", "AVIF"),
)
OTHERS = (
    (rb"....ftyp(hei|hev|mif1)", "HEIC"),
    (rb"....ftyp", "a video"),
    (rb"#\?(RADIANCE|RGBE)", "Radiance HDR"),
    (rb"v/1\x01", "OpenEXR"),
    (rb"%PDF", "PDF"),
    (rb"PK\x03\x04", "a ZIP archive"),
    (rb"\s*<(\?xml|svg)", "XML or SVG"),
    (rb"\s*<(!doctype html|html)", "a web page"),
)


def read_image(path: str | Path, *, max_pixels: int = MAX_PIXELS) -> npt.NDArray[Any]:
    """Read a photo as displayed upright (its EXIF orientation applied).

    Any raster format and mode that Pillow reads. Grey becomes three equal channels; palettes
    and CMYK are converted to RGB; alpha is dropped and the colours stay as stored, also where
    they are transparent. 16-bit grey stays 16 bit; Pillow reads 16-bit colour with 8. Of
    several frames the first is taken.

    Parameters
    ----------
    path
        The file.
    max_pixels
        Larger images are refused, before they are decoded; and so are those that could not
        be decoded within 2 GB of memory and a few seconds: above 64 million pixels of WebP,
        AVIF and HEIF, 25 million of JPEG 2000, 10 million of rare formats.

    Returns
    -------
    Shape (h, w, 3), RGB, uint8 or (16-bit grey) uint16; read-only.

    Raises
    ------
    InputError
        If the file is missing, no image, damaged, too large, or of floating-point or
        32-bit pixels.
    """
    thing = photo_name(path)
    with open_image(path) as image:
        _check_decodable(image, thing, max_pixels)
        image.load()
        pixels = upright_pixels(image, thing)
    pixels.setflags(write=False)
    return pixels


@contextmanager
def open_image(path: str | Path) -> Iterator[ImageFile]:
    """Open a photo to look at its metadata, in a ``with`` block; its pixels are not decoded.

    What the file's bytes provoke in the block is told as an InputError, too.

    Raises
    ------
    InputError
        If the file is missing, no image, or damaged.
    """
    from PIL import Image

    path = Path(path)
    thing = photo_name(path)
    _check_regular(path, thing)
    # Pillow logs some damage besides raising; without any handler Python would print that.
    logging.getLogger("PIL").addHandler(NO_LOG)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about sizes and odd metadata; checked here
            with (
                io.BufferedReader(_Timed(path, thing), 1 << 16) as file,
                Image.open(file) as image,
            ):
                yield image
    except InputError:
        raise
    except Image.DecompressionBombError:
        raise _too_large(thing, MAX_PIXELS) from None
    except MemoryError:
        what = "expected an image that fits into memory"
        raise InputError(thing, what, "scale it down") from None
    except PermissionError:
        raise InputError(
            thing, "expected a file that may be read, this one may not", "check its permissions"
        ) from None
    except Exception as error:  # Pillow's decoders raise whatever the bytes provoke
        raise _unreadable(path, thing, error) from None


def photo_name(path: str | Path) -> str:
    """What messages call a photo; they can be printed, whatever bytes its name is made of."""
    return "photo " + "".join(c if c.isprintable() else "\ufffd" for c in str(path))


class _Timed(io.FileIO):
    """A file that cannot be read any more when what reads it has computed for too long."""

    def __init__(self, path: Path, thing: str) -> None:
        super().__init__(path)
        self._thing = thing
        self._end = time.thread_time() + MAX_SECONDS

    def readinto(self, buffer: Any) -> int | None:
        if time.thread_time() > self._end:
            raise InputError(
                self._thing,
                f"expected an image that is decoded within {MAX_SECONDS:g} s, got a slower one",
                "convert it to JPEG or PNG",
            )
        return super().readinto(buffer)


def _check_decodable(image: ImageFile, thing: str, max_pixels: int) -> None:
    """Refuse what would run other programs, or take too long or too much memory."""
    from PIL import Image

    kind, area = image.format or "", image.width * image.height
    if kind in REFUSED:
        raise InputError(
            thing, f"expected a photo, got {REFUSED[kind]} ({kind})", "convert it to JPEG or PNG"
        )
    limit = PIXELS_OF_FORMAT.get(kind, PIXELS_OF_OTHERS)
    # DECODERS are those written in Python: run-length BMP, PPM as text or with 16 bits.
    if any(tile[0] in Image.DECODERS for tile in image.tile):
        limit = PIXELS_OF_OTHERS
    if area > (limit := min(limit, max_pixels)):
        raise _too_large(thing, limit)
    if image.info.get("progressive") and (file := image.fp) is not None:
        file.seek(0)  # where its decoding begins, too
        scans = sum(block.count(b"\xff\xda") for block in iter(lambda: file.read(1 << 20), b""))
        file.seek(0)
        if scans * area > MAX_SCANNED_PIXELS:
            raise InputError(
                thing,
                f"expected a JPEG of at most {MAX_SCANNED_PIXELS // area} scans, got {scans}",
                "convert it to PNG",
            )


def write_png(path: str | Path, image: npt.NDArray[Any]) -> None:
    """Write a PNG in one piece: a reader sees the old file or the new one, never half.

    Parameters
    ----------
    path
        The file; its folder must exist.
    image
        Shape (h, w), (h, w, 3) RGB or (h, w, 4) RGBA, uint8 or uint16.

    Raises
    ------
    InputError
        If the image is of another type or too large for PNG, or the file cannot be written.
    """
    import cv2

    if image.dtype.name not in ("uint8", "uint16") or image.size == 0:
        raise InputError(
            f"picture for {path}",
            f"expected pixels of uint8 or uint16, got {image.dtype} of shape {image.shape}",
        )
    channels = image.shape[2] if image.ndim == 3 else 1
    order = {1: None, 3: cv2.COLOR_RGB2BGR, 4: cv2.COLOR_RGBA2BGRA}
    if image.ndim not in (2, 3) or channels not in order:
        raise InputError(
            f"picture for {path}", f"expected 1, 3 or 4 channels, got shape {image.shape}"
        )
    code = order[channels]
    swapped = image if code is None else cv2.cvtColor(image, code)
    try:
        # As OpenCV is tuned: level 1 with other filters takes 60 % longer for a sixth of the bytes,
        # the levels 2 to 9 up to eight times as long.
        encoded, content = cv2.imencode(".png", swapped)
    except cv2.error:  # OpenCV's versions differ in which failures they raise
        encoded = False
    if not encoded:
        raise InputError(
            f"picture for {path}",
            f"expected a size that PNG's encoder takes, got shape {image.shape}",
            "scale it down",
        )
    write_bytes(Path(path), content.tobytes())


def _unreadable(path: Path, thing: str, error: Exception) -> InputError:
    """What to say about a file that Pillow cannot identify or decode."""
    from PIL import UnidentifiedImageError

    head = b""
    with suppress(OSError), path.open("rb") as file:
        head = file.read(256)
    photo = _begins(head, PHOTOS)
    if not photo and isinstance(error, UnidentifiedImageError):
        return InputError(
            thing,
            f"expected an image, got {_begins(head, OTHERS) or 'a file of an unknown kind'}",
            "convert it to JPEG or PNG",
        )
    found = f"a damaged or unusual {photo} file" if photo else "a damaged or unusual file"
    if not isinstance(error, UnidentifiedImageError):
        found += f" ({' '.join(str(error).split())[:80] or type(error).__name__})"
    return InputError(
        thing, f"expected a whole image, got {found}", "copy it again, or convert it to JPEG or PNG"
    )


def _begins(head: bytes, kinds: tuple[tuple[bytes, str], ...]) -> str:
    return next((name for start, name in kinds if re.match(start, head, re.I | re.S)), "")


def _check_regular(path: Path, thing: str) -> None:
    try:
        if path.is_dir():
            raise InputError(thing, "expected an image file, got a folder", "name the files in it")
        if not path.exists():
            raise InputError(thing, "expected an image file, there is none", "check the path")
        if not path.is_file():
            raise InputError(thing, "expected an image file, got a device or pipe", "copy it first")
        size = path.stat().st_size
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        reason = getattr(error, "strerror", None) or "not a path"
        raise InputError(
            thing, f"expected an image file, got: {reason}", "check the path"
        ) from None
    if size == 0:
        raise InputError(thing, "expected an image file, got an empty one", "copy it again")
    if size > MAX_FILE_BYTES:
        raise InputError(
            thing,
            f"expected an image file of at most {MAX_FILE_BYTES / 1e6:g} MB, got more",
            "scale it down, or convert it to JPEG or PNG",
        )


def _too_large(thing: str, max_pixels: int) -> InputError:
    return InputError(
        thing,
        f"expected an image of at most {max_pixels / 1e6:g} million pixels, got more",
        "scale it down",
    )


def upright_pixels(image: Image.Image, thing: str) -> npt.NDArray[Any]:
    """Decoded pixels (h, w, 3), turned upright, contiguous."""
    deep = image.mode in GREY_16
    if image.mode in WIDE:
        low, high = cast("tuple[float, float]", image.getextrema())
        deep = image.mode == "I" and low >= 0 and high <= 65535
        if not deep:
            raise InputError(
                thing,
                "expected 8 or 16 bits a pixel, got 32-bit values",
                "convert it to an 8-bit image",
            )
    turn = _orientation(image)
    width, height = image.size
    shape = (width, height) if turn in LYING else (height, width)
    pixels = np.empty((*shape, 3), np.uint16 if deep else np.uint8)
    stored = _upright(pixels, UNDO.get(turn, turn))
    rows = max(STRIP_PIXELS // max(width, 1), 1)
    for top in range(0, height, rows):
        bottom = min(top + rows, height)
        strip = image if rows >= height else image.crop((0, top, width, bottom))
        stored[top:bottom] = np.asarray(strip)[..., None] if deep else _rgb(strip)
    return pixels


def _rgb(image: Image.Image) -> npt.NDArray[np.uint8]:
    if image.mode in ("P", "PA"):
        image = image.convert("RGBA")  # a palette's transparency is lost only knowingly
    return np.asarray(image if image.mode == "RGB" else image.convert("RGB"))


def _orientation(image: Image.Image) -> int:
    try:
        return int(image.getexif().get(ORIENTATION, 1))
    except Exception:  # broken EXIF data: Pillow's parsers raise whatever the bytes provoke
        return 1


def _upright(pixels: npt.NDArray[Any], orientation: int) -> npt.NDArray[Any]:
    """Undo EXIF's orientation (CIPA DC-008, tag 0x0112): 5 to 8 are transposed too."""
    if orientation in LYING:
        pixels = pixels.swapaxes(0, 1)
    if orientation in (3, 4, 7, 8):
        pixels = pixels[::-1]
    if orientation in (2, 3, 6, 7):
        pixels = pixels[:, ::-1]
    return pixels
