"""Any picture that people have at hand, as 8-bit RGB."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from fronto.errors import InputError
from fronto.imageio import MAX_PIXELS, photo_name, read_image, upright_pixels

if TYPE_CHECKING:
    from PIL import Image

    Picture = str | Path | Image.Image | npt.NDArray[Any]

__all__ = ["MIN_SIDE_PX", "as_rgb"]

#: A button needs about as many pixels to be one.
MIN_SIDE_PX = 16
#: Floats may overshoot 0..1 by what rounds to 0 and 255 anyway (resampling does that).
OVERSHOOT = 0.5 / 255


def as_rgb(image: Picture, *, order: Literal["rgb", "bgr"] = "rgb") -> npt.NDArray[np.uint8]:
    """Any picture as 8-bit RGB.

    Alpha is dropped and the colours stay as stored, as in `fronto.imageio.read_image`. Of
    16-bit pixels the upper 8 of the bits in use are taken, counted from the brightest pixel
    and at least 8: a 12-bit camera's 4095 becomes 255, and so does 65535; where nothing
    exceeds 255 the values stay.

    Parameters
    ----------
    image
        The path of a photo; a Pillow image (its EXIF orientation is applied); or an array of
        shape (h, w), (h, w, 1), (h, w, 2) grey and alpha, (h, w, 3) or (h, w, 4) colour and
        alpha, of uint8, uint16, bool, or floats from 0 to 1.
    order
        Order of an array's colours: "bgr" as OpenCV reads them. Files and Pillow images
        know their own.

    Returns
    -------
    Shape (h, w, 3), uint8, RGB, contiguous, read-only; it may share the array's memory.

    Raises
    ------
    InputError
        If the picture is of another kind, type, shape or range, has NaN, is smaller than
        16 pixels a side or larger than 150 million pixels; or as of `read_image`.
    """
    if order not in ("rgb", "bgr"):
        raise InputError("order", f'expected "rgb" or "bgr", got {order!r}')
    thing = "image"
    if isinstance(image, (str, Path)):
        thing, pixels = photo_name(image), read_image(image)
    elif isinstance(image, np.ndarray):
        pixels = _colours(image, order)
    else:
        pixels = _from_pillow(image)
    height, width = pixels.shape[:2]
    if min(height, width) < MIN_SIDE_PX:
        raise InputError(
            thing,
            f"expected at least {MIN_SIDE_PX} pixels a side, got {width}x{height}",
            "give the photo at its original size",
        )
    narrow = np.ascontiguousarray(_bytes(pixels, thing)).view()
    narrow.setflags(write=False)
    return narrow


def _from_pillow(image: object) -> npt.NDArray[Any]:
    from PIL import Image

    if not isinstance(image, Image.Image):
        raise InputError(
            "image",
            f"expected a path, a Pillow image or a NumPy array, got {type(image).__name__}",
            "convert it to one of them",
        )
    _check_area(image.width, image.height)
    try:
        image.load()
        return upright_pixels(image, "image")
    except InputError:
        raise
    except Exception as error:  # Pillow's decoders raise whatever the bytes provoke
        reason = " ".join(str(error).split())[:80] or type(error).__name__
        raise InputError(
            "image",
            f"expected a Pillow image with readable pixels, got: {reason}",
            "open it again, or convert it to RGB",
        ) from None


def _colours(image: npt.NDArray[Any], order: str) -> npt.NDArray[Any]:
    """An array as (h, w, 3) RGB of its own type, without copying where that is possible."""
    channels = image.shape[2] if image.ndim == 3 else 1
    if image.ndim not in (2, 3) or channels not in (1, 2, 3, 4) or image.size == 0:
        first = image.ndim == 3 and image.shape[0] in (1, 3, 4)
        raise InputError(
            "image",
            f"expected shape (h, w) or (h, w, channels), got {image.shape}",
            "move the channels to the end: np.moveaxis(image, 0, -1)" if first else "",
        )
    _check_area(image.shape[1], image.shape[0])
    array = np.asarray(image)
    if channels > 2:
        return array[..., :3] if order == "rgb" else array[..., 2::-1]
    grey = array if array.ndim == 2 else array[..., 0]
    return np.broadcast_to(grey[..., None], (*grey.shape, 3))


def _check_area(width: int, height: int) -> None:
    if width * height > MAX_PIXELS:
        raise InputError(
            "image",
            f"expected at most {MAX_PIXELS / 1e6:g} million pixels, got {width}x{height}",
            "scale it down",
        )


def _bytes(pixels: npt.NDArray[Any], thing: str) -> npt.NDArray[np.uint8]:
    kind = pixels.dtype
    if kind == np.uint8:
        return np.asarray(pixels, dtype=np.uint8)
    if kind == np.bool_:
        return np.asarray(pixels, dtype=np.uint8) * np.uint8(255)
    if kind.kind == "u" and kind.itemsize == 2:
        bits = max(int(pixels.max()).bit_length(), 8)
        narrow = np.empty(pixels.shape, np.uint8)
        np.right_shift(pixels, bits - 8, out=narrow, casting="unsafe")  # and no wide copy
        return narrow
    if kind.kind == "f":
        return _from_floats(pixels, thing)
    raise InputError(
        thing,
        f"expected pixels of uint8, uint16, bool or floats from 0 to 1, got {kind}",
        "convert it: image.astype(np.uint8) if its values are 0 to 255",
    )


def _from_floats(pixels: npt.NDArray[Any], thing: str) -> npt.NDArray[np.uint8]:
    low, high = float(pixels.min()), float(pixels.max())
    if np.isnan(low) or np.isnan(high):
        raise InputError(
            thing, "expected numbers, got NaN", "fill what has no value: np.nan_to_num(image)"
        )
    if low < -OVERSHOOT or high > 1 + OVERSHOOT:
        raise InputError(
            thing,
            f"expected floats from 0 to 1, got {low:g} to {high:g}",
            "divide by the value of white, or give uint8",
        )
    scaled = np.multiply(pixels, 255, dtype=np.float32)
    np.rint(scaled, out=scaled)
    return np.asarray(np.clip(scaled, 0, 255, out=scaled), dtype=np.uint8)
