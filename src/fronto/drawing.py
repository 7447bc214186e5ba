"""Strokes, dots and texts on pictures, each with a dark halo: seen on any photo."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from fronto.errors import InputError
from fronto.shapes import FloatArray

__all__ = [
    "HALO",
    "SHIFT",
    "Box",
    "Color",
    "Picture",
    "dot",
    "fixed_point",
    "polylines",
    "rgb_canvas",
    "text_size",
    "unit_of",
    "write_names",
    "write_text",
]

Picture = npt.NDArray[np.uint8]
Color = tuple[int, int, int]
Box = tuple[float, float, float, float]

HALO: Color = (20, 20, 20)
#: Letters' size for a 640 px wide photo, in cv2's measure.
FONT = 0.45
#: Sub-pixel bits of cv2's drawing functions.
SHIFT = 4


def rgb_canvas(image: npt.NDArray[Any], size: tuple[int, int] | None = None) -> Picture:
    """Copy the image as (h, w, 3), contiguous.

    Raises
    ------
    InputError
        If it is not uint8 with 1 or 3 channels, or its width and height are not `size`.
    """
    if not isinstance(image, np.ndarray) or image.dtype != np.uint8:
        found = image.dtype if isinstance(image, np.ndarray) else type(image).__name__
        raise InputError("image", f"expected an array of uint8, got {found}")
    pixels = image[:, :, None] if image.ndim == 2 else image
    if pixels.ndim != 3 or pixels.shape[2] not in (1, 3) or pixels.size == 0:
        raise InputError(
            "image",
            f"expected shape (h, w, 3), (h, w, 1) or (h, w), got {image.shape}",
            "drop the alpha channel",
        )
    height, width = pixels.shape[:2]
    if size not in (None, (width, height)):
        raise InputError(
            "image",
            f"expected the size {size[0]}x{size[1]} of what is drawn on it, got {width}x{height}",
            "give the photo itself",
        )
    canvas = np.empty((*pixels.shape[:2], 3), np.uint8)
    canvas[:] = pixels
    return canvas


def unit_of(canvas: Picture) -> float:
    """What a pixel of a 640 px wide photo is here."""
    return max(1.0, float(max(canvas.shape[:2])) / 640)


def fixed_point(points: FloatArray) -> npt.NDArray[np.int32]:
    """Pixels as cv2's numbers with `SHIFT` bits after the point."""
    # Far outside points would overflow cv2's fixed-point numbers.
    return np.rint(np.clip(points, -1e5, 1e5) * (1 << SHIFT)).astype(np.int32)


def polylines(
    canvas: Picture, lines: Sequence[FloatArray], closed: bool, color: Color, width: int
) -> None:
    """Draw lines, each through its points (n, 2), `width` pixels wide, with a common halo."""
    import cv2

    points = [fixed_point(line) for line in lines]
    for stroke, ink in ((width + 2 + width // 2, HALO), (width, color)):
        cv2.polylines(canvas, points, closed, ink, stroke, cv2.LINE_AA, SHIFT)


def dot(canvas: Picture, point: FloatArray, radius: float, color: Color) -> None:
    """Draw a dot with a halo."""
    import cv2

    x, y = (int(value) for value in fixed_point(point))
    for size, ink in ((radius + 1.0, HALO), (radius, color)):
        cv2.circle(canvas, (x, y), round(size * (1 << SHIFT)), ink, -1, cv2.LINE_AA, SHIFT)


def write_text(canvas: Picture, text: str, at: tuple[int, int], unit: float, color: Color) -> None:
    """Write text with a halo; `at` is the left end of its base line."""
    import cv2

    ascii_text = text.encode("ascii", "replace").decode()
    width, height = text_size(ascii_text, unit)
    rim = max(1, round(unit))
    # Letters in a heavier stroke would be wider (OpenCV 5), so the halo is grown instead.
    border = height + 2 * rim
    letters = np.zeros((height + 2 * border, width + 2 * border), np.uint8)
    font, stroke = cv2.FONT_HERSHEY_SIMPLEX, max(1, round(unit))
    origin = (border, border + height)
    cv2.putText(letters, ascii_text, origin, font, FONT * unit, (255,), stroke, cv2.LINE_AA)
    halo = cv2.dilate(letters, np.ones((2 * rim + 1, 2 * rim + 1), np.uint8))
    left, top = at[0] - border, at[1] - height - border
    rows = slice(max(0, top), max(0, min(canvas.shape[0], top + letters.shape[0])))
    columns = slice(max(0, left), max(0, min(canvas.shape[1], left + letters.shape[1])))
    part = canvas[rows, columns]
    if part.size == 0:
        return
    for mask, ink in ((halo, HALO), (letters, color)):
        cut = mask[rows.start - top : rows.stop - top, columns.start - left : columns.stop - left]
        weight = cut[..., None] * np.float32(1 / 255)
        mixed = part + weight * (np.array(ink, np.float32) - part)
        part[:] = np.rint(mixed).astype(np.uint8)


def text_size(text: str, unit: float) -> tuple[int, int]:
    """Width and height above the base line."""
    import cv2

    font = cv2.FONT_HERSHEY_SIMPLEX
    (width, height), _ = cv2.getTextSize(text, font, FONT * unit, max(1, round(unit)))
    return int(width), int(height)


def write_names(
    canvas: Picture,
    names: Sequence[str],
    boxes: Sequence[Box],
    colors: Sequence[Color],
    unit: float,
    *,
    gap: float,
    first: Literal["beside", "above"],
    short: Sequence[str] | None = None,
) -> None:
    """Write a name at each box, where it covers no other box or name; else on the box.

    Parameters
    ----------
    canvas
        To draw on.
    names, boxes, colors
        As many of each; boxes are x0, y0, x1, y1.
    unit
        Size of the letters, as of `write_text`.
    gap
        Between box and name, pixels.
    first
        Where to look for room first: right and left of the box, or above and below it.
    short
        What to write on the boxes instead; "" for nothing.
    """
    written: list[Box] = []
    for k, (name, (x0, y0, x1, y1)) in enumerate(zip(names, boxes, strict=True)):
        wide, high = text_size(name, unit)
        middle_x, middle_y = (x0 + x1 - wide) / 2, (y0 + y1 - high) / 2
        beside = [(x1 + gap, middle_y), (x0 - gap - wide, middle_y)]
        below, above = (middle_x, y1 + gap), (middle_x, y0 - gap - high)
        places = [*beside, below, above] if first == "beside" else [above, below, *beside]
        others = [*boxes[:k], *boxes[k + 1 :], *written]
        free = [p for p in places if _is_free((*p, p[0] + wide, p[1] + high), others, canvas)]
        if free:
            x, y = free[0]
        else:  # On a dense panel there is room on the button itself only.
            name = name if short is None else short[k]
            wide, high = text_size(name, unit)
            x, y = (x0 + x1 - wide) / 2, y1 - high - gap / 2
        x = min(max(x, 0.0), max(0.0, canvas.shape[1] - 1.0 - wide))
        y = min(max(y, 0.0), max(0.0, canvas.shape[0] - 1.0 - high))
        written.append((x, y, x + wide, y + high))
        write_text(canvas, name, (round(x), round(y + high)), unit, colors[k])


def _is_free(box: Box, others: Sequence[Box], canvas: Picture) -> bool:
    x0, y0, x1, y1 = box
    inside = x0 >= 0 and y0 >= 0 and x1 < canvas.shape[1] and y1 < canvas.shape[0]
    return inside and not any(x0 < b[2] and b[0] < x1 and y0 < b[3] and b[1] < y1 for b in others)
