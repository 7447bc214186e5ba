"""Pictures of what segmentation found: tinted masks with names."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from fronto.drawing import HALO, Color, Picture, rgb_canvas, unit_of, write_names
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
    canvas = rgb_canvas(image_rgb, (segments.width_px, segments.height_px))
    unit = unit_of(canvas)
    for segment in reversed(segments.segments):
        _tint(canvas, segment.origin_px, segment.mask, COLORS[segment.category], unit)
    names = [f"{segment.category} {segment.confidence:.2f}" for segment in segments]
    boxes = [segment.box_px for segment in segments]
    colors = [COLORS[segment.category] for segment in segments]
    write_names(canvas, names, boxes, colors, LETTERS * unit, gap=2 * unit, first="above")
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
