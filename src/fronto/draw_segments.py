"""Pictures of what segmentation found: tinted masks with names."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from fronto.draw import (
    HALO,
    Color,
    Picture,
    _is_free,
    _rgb,
    _text,
    _text_size,
    _unit,
)
from fronto.errors import InputError
from fronto.segments import Segments

__all__ = ["COLORS", "draw_segments"]

#: Of each category; plates, which nobody presses, are grey.
COLORS: dict[str, Color] = {
    "up": (60, 200, 160),
    "down": (255, 150, 60),
    "keyhole": (230, 130, 190),
    "number": (86, 180, 233),
    "open": (150, 220, 70),
    "close": (150, 160, 255),
    "alarm": (240, 200, 60),
    "stop": (255, 70, 60),
    "other": (200, 120, 255),
    "plate": (190, 190, 190),
}
#: Of a tinted pixel, and the size of the letters against other drawings'.
TINT, LETTERS = 0.45, 0.8


def draw_segments(image_rgb: npt.NDArray[Any], segments: Segments) -> Picture:
    """Tint what was found in its category's colour, with its name and confidence beside it.

    Parameters
    ----------
    image_rgb
        The photo: shape (h, w, 3), (h, w, 1) or (h, w), uint8, RGB.
    segments
        What was found in it.

    Returns
    -------
    Shape (h, w, 3), uint8, RGB.

    Raises
    ------
    InputError
        If the image is not uint8 with 1 or 3 channels, or not of the segments' size.
    """
    canvas = _rgb(image_rgb)
    height, width = canvas.shape[:2]
    if (width, height) != (segments.width_px, segments.height_px):
        raise InputError(
            "image",
            f"expected the size {segments.width_px}x{segments.height_px} that was segmented, "
            f"got {width}x{height}",
            "give the photo itself",
        )
    unit = _unit(canvas)
    for segment in reversed(segments.segments):
        _tint(canvas, segment.origin_px, segment.mask, COLORS[segment.category], unit)
    _draw_names(canvas, segments, unit)
    return canvas


def _tint(
    canvas: Picture,
    origin: tuple[int, int],
    mask: npt.NDArray[np.bool_],
    color: Color,
    unit: float,
) -> None:
    import cv2

    x, y = origin
    part = canvas[y : y + mask.shape[0], x : x + mask.shape[1]]
    part[mask] = np.rint(part[mask] * (1 - TINT) + np.array(color) * TINT).astype(np.uint8)
    lines, _ = cv2.findContours(
        mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE, offset=(x, y)
    )
    thick = max(1, round(unit))
    cv2.drawContours(canvas, lines, -1, HALO, thick + 2)
    cv2.drawContours(canvas, lines, -1, color, thick)


def _draw_names(canvas: Picture, segments: Segments, unit: float) -> None:
    """Beside each segment, where it covers no other one or its name; else on the segment."""
    boxes = [segment.box_px for segment in segments]
    written: list[tuple[float, float, float, float]] = []
    gap, letters = 2 * unit, LETTERS * unit
    for k, segment in enumerate(segments):
        name = f"{segment.category} {segment.confidence:.2f}"
        wide, high = _text_size(name, letters)
        x0, y0, x1, y1 = boxes[k]
        middle_x, middle_y = (x0 + x1 - wide) / 2, (y0 + y1 - high) / 2
        places = [
            (middle_x, y0 - gap - high),
            (middle_x, y1 + gap),
            (x1 + gap, middle_y),
            (x0 - gap - wide, middle_y),
        ]
        others = boxes[:k] + boxes[k + 1 :] + written
        free = [p for p in places if _is_free((*p, p[0] + wide, p[1] + high), others, canvas)]
        x, y = free[0] if free else (middle_x, middle_y)
        x = min(max(x, 0.0), max(0.0, canvas.shape[1] - 1.0 - wide))
        written.append((x, y, x + wide, y + high))
        _text(canvas, name, (round(x), round(y + high)), letters, COLORS[segment.category])
