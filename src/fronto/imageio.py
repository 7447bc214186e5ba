"""Photos in, upright and RGB; pictures out as PNG."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from fronto.errors import InputError
from fronto.files import write_bytes

if TYPE_CHECKING:
    from PIL import Image

__all__ = ["read_image", "upright_pixels", "write_png"]

#: Pillow itself refuses more than 179 million pixels, and that limit is global.
MAX_PIXELS = 150_000_000
#: zlib: levels 2 to 9 cost up to five times as much for a tenth of the bytes.
PNG_COMPRESSION = 1
ORIENTATION = 0x0112
#: Pillow's modes whose values are 16-bit grey, and those with more than that.
GREY_16 = ("I;16", "I;16L", "I;16B", "I;16N")
WIDE = ("I", "F")


def read_image(path: str | Path, *, max_pixels: int = MAX_PIXELS) -> npt.NDArray[Any]:
    """Read a photo as displayed upright (its EXIF orientation applied).

    Any format and mode that Pillow reads. Grey becomes three equal channels; palettes and
    CMYK are converted to RGB; alpha is dropped and the colours stay as stored, also where
    they are transparent. 16-bit grey stays 16 bit; Pillow reads 16-bit colour with 8. Of
    several frames the first is taken.

    Parameters
    ----------
    path
        The file.
    max_pixels
        Larger images are refused, before they are decoded.

    Returns
    -------
    Shape (h, w, 3), RGB, uint8 or (16-bit grey) uint16; read-only.

    Raises
    ------
    InputError
        If the file is missing, no image, damaged, too large, or of floating-point or
        32-bit pixels.
    """
    from PIL import Image, UnidentifiedImageError

    path = Path(path)
    thing = f"photo {path}"
    _check_regular(path, thing)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # about sizes and odd metadata; checked here
            with Image.open(path) as image:
                if image.width * image.height > max_pixels:
                    raise _too_large(thing, max_pixels)
                image.load()
                pixels = upright_pixels(image, thing)
    except InputError:
        raise
    except Image.DecompressionBombError:
        raise _too_large(thing, max_pixels) from None
    except UnidentifiedImageError:
        raise InputError(
            thing, "expected an image, got a file of another or an unknown kind", "give JPEG or PNG"
        ) from None
    except MemoryError:
        raise InputError(thing, "expected an image that fits into memory", "scale it down") from (
            None
        )
    except Exception as error:  # Pillow's decoders raise whatever the bytes provoke
        reason = " ".join(str(error).split())[:80] or type(error).__name__
        raise InputError(
            thing,
            f"expected a readable, whole image, got: {reason}",
            "copy it again, or convert it to JPEG or PNG",
        ) from None
    pixels.setflags(write=False)
    return pixels


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
    options = [cv2.IMWRITE_PNG_COMPRESSION, PNG_COMPRESSION]
    try:
        encoded, content = cv2.imencode(".png", swapped, options)
    except cv2.error:  # OpenCV's versions differ in which failures they raise
        encoded = False
    if not encoded:
        raise InputError(
            f"picture for {path}",
            f"expected a size that PNG's encoder takes, got shape {image.shape}",
            "scale it down",
        )
    write_bytes(Path(path), content.tobytes())


def _check_regular(path: Path, thing: str) -> None:
    try:
        if path.is_dir():
            raise InputError(thing, "expected an image file, got a folder", "name the files in it")
        if not path.exists():
            raise InputError(thing, "expected an image file, there is none", "check the path")
        if not path.is_file():
            raise InputError(thing, "expected an image file, got a device or pipe", "copy it first")
        empty = path.stat().st_size == 0
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        reason = getattr(error, "strerror", None) or "not a path"
        raise InputError(
            thing, f"expected an image file, got: {reason}", "check the path"
        ) from None
    if empty:
        raise InputError(thing, "expected an image file, got an empty one", "copy it again")


def _too_large(thing: str, max_pixels: int) -> InputError:
    return InputError(
        thing,
        f"expected an image of at most {max_pixels / 1e6:g} million pixels, got more",
        "scale it down",
    )


def upright_pixels(image: Image.Image, thing: str) -> npt.NDArray[Any]:
    """Decoded pixels (h, w, 3), turned upright."""
    turn = _orientation(image)
    if image.mode in GREY_16 or image.mode in WIDE:
        grey = np.asarray(image)
        if image.mode in WIDE and not (
            image.mode == "I" and int(grey.min()) >= 0 and int(grey.max()) <= 65535
        ):
            raise InputError(
                thing,
                "expected 8 or 16 bits a pixel, got 32-bit values",
                "convert it to an 8-bit image",
            )
        pixels = np.repeat(grey.astype(np.uint16)[..., None], 3, axis=2)
    else:
        if image.mode in ("P", "PA"):
            image = image.convert("RGBA")  # a palette's transparency is lost only knowingly
        pixels = np.asarray(image if image.mode == "RGB" else image.convert("RGB"))
    return np.ascontiguousarray(_upright(pixels, turn))


def _orientation(image: Image.Image) -> int:
    try:
        return int(image.getexif().get(ORIENTATION, 1))
    except Exception:  # broken EXIF data: Pillow's parsers raise whatever the bytes provoke
        return 1


def _upright(pixels: npt.NDArray[Any], orientation: int) -> npt.NDArray[Any]:
    """Undo EXIF's orientation (CIPA DC-008, tag 0x0112): 5 to 8 are transposed too."""
    if orientation in (5, 6, 7, 8):
        pixels = pixels.swapaxes(0, 1)
    if orientation in (3, 4, 7, 8):
        pixels = pixels[::-1]
    if orientation in (2, 3, 6, 7):
        pixels = pixels[:, ::-1]
    return pixels
