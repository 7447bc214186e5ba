"""Pictures of what outlining found: quads and ellipses with their deviations, and lines."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from fronto.categories import PLATE
from fronto.draw import X_AXIS, Y_AXIS
from fronto.draw_segments import COLORS, LETTERS
from fronto.drawing import Color, Picture, dot, polylines, rgb_canvas, unit_of, write_names
from fronto.outlines.result import Outlines
from fronto.shapes import FloatArray, Outline

__all__ = ["draw_outlines"]

#: Length of the dashes along sides that are not seen, pixels of a 640 px wide photo, and the
#: most of them along one side: a guessed corner may be far away.
DASH, MOST_DASHES = 4.0, 200


def draw_outlines(image_rgb: npt.NDArray[Any], outlines: Outlines) -> Picture:
    """Draw what was outlined on a copy of the photo.

    Each button is drawn in its category's colour, with a dot at a quad's first corner (the
    top-left one as the panel reads upright), sides that are not seen dashed, and its text
    (else its category) and its standard deviation in pixels beside it. Plates are grey; the
    panel's lines are thin, horizontal ones red and vertical ones green.

    Parameters
    ----------
    image_rgb
        The photo: shape (h, w, 3), (h, w, 1) or (h, w), uint8, RGB.
    outlines
        What was found in it.

    Returns
    -------
    Shape (h, w, 3), uint8, RGB.

    Raises
    ------
    InputError
        If the image is not uint8 with 1 or 3 channels, or not of the outlines' size.
    """
    canvas = rgb_canvas(image_rgb, (outlines.width_px, outlines.height_px))
    unit = unit_of(canvas)
    for line in outlines.lines:
        color = X_AXIS if line.axis == "horizontal" else Y_AXIS
        polylines(canvas, [line.ends_px], False, color, 1)
    # Buttons have the first choice of places for their names, and are drawn over plates.
    both = [*outlines.buttons, *outlines.plates]
    colors = [COLORS.get(button.category, COLORS["other"]) for button in outlines.buttons]
    colors += [COLORS[PLATE]] * len(outlines.plates)
    for outline, color in reversed(list(zip(both, colors, strict=True))):
        _draw(canvas, outline, color, unit)
    write_names(
        canvas,
        [_name(outline) for outline in both],
        [outline.box_px for outline in both],
        colors,
        LETTERS * unit,
        gap=6 * unit,
        first="above",
        # Colours tell the category where names have no room.
        short=[f"{b.std_px:.2f}" for b in outlines.buttons] + [""] * len(outlines.plates),
    )
    return canvas


def _name(outline: Outline) -> str:
    odd = " odd" if outline.odd else ""
    return f"{outline.text or outline.category}{odd} {outline.std_px:.2f}px"


def _draw(canvas: Picture, outline: Outline, color: Color, unit: float) -> None:
    width = max(1, round(unit))
    if outline.ellipse_px is not None:
        polylines(canvas, [outline.ellipse_px.points(96)], True, color, width)
        return
    corners = outline.corners_px
    assert corners is not None
    if all(outline.seen):
        polylines(canvas, [corners], True, color, width)
    else:
        lines: list[FloatArray] = []
        for k, seen in enumerate(outline.seen):
            side = corners[[k, (k + 1) % 4]]
            lines += [side] if seen else _dashes(side, unit)
        polylines(canvas, lines, False, color, width)
    dot(canvas, corners[0], 2.5 * unit, color)


def _dashes(ends: FloatArray, unit: float) -> list[FloatArray]:
    """Parts of a side, each of shape (2, 2), with gaps between them as long as they are."""
    length = float(np.linalg.norm(ends[1] - ends[0]))
    number = int(np.clip(round(length / (2 * DASH * unit) + 0.5), 1, MOST_DASHES))
    # From end to end: n dashes and n - 1 gaps.
    stops = np.linspace(0, 1, 2 * number)
    points = ends[0] + stops[:, None] * (ends[1] - ends[0])
    return list(points.reshape(number, 2, 2))
