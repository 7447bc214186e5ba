"""A panel drawn head-on: the plate with its buttons, as a picture with alpha.

Drawn from signed distances in millimetres on the panel, so that edges are exact to a small
fraction of a texture pixel. Panel frame as in `fronto.synth.layouts`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fronto.shapes import FloatArray
from fronto.synth import symbols
from fronto.synth.layouts import Layout, LayoutButton
from fronto.synth.look import Look

__all__ = ["Plate", "draw_plate", "plate_box"]

Grey = npt.NDArray[np.float32]
Window = tuple[slice, slice]
Box = tuple[float, float, float, float]

#: Room around the plate for its shadow, and the shadow's blur, millimetres.
RIM_MM, BLUR_MM = 16.0, 4.0
CORNER_MM, BEVEL_MM, SCREW_MM = 4.0, 2.0, 3.2
#: Towards the lamp, up and to the left, in the plane of the panel.
LAMP = np.array([-0.5, -0.866])
BLACK, GLASS = (14.0, 14.0, 16.0), (22.0, 23.0, 27.0)


@dataclass(frozen=True, eq=False)
class Plate:
    """The drawn plate.

    Parameters
    ----------
    rgba
        Shape (h, w, 4), uint8, colour premultiplied by alpha; the shadow is black.
    origin_m
        Shape (2,): panel coordinates of the centre of the top-left pixel.
    px_per_m
        Texture pixels per metre.
    """

    rgba: npt.NDArray[np.uint8]
    origin_m: FloatArray
    px_per_m: float

    def pixels(self, points_m: FloatArray) -> FloatArray:
        """Texture pixels (..., 2) of panel points (..., 2) in metres."""
        return np.asarray((points_m - self.origin_m) * self.px_per_m)


def plate_box(layout: Layout, look: Look) -> Box:
    """The plate's x0, y0, x1, y1 on the panel, metres: the buttons, a margin, a display."""
    corners = layout.corners.reshape(-1, 2)
    side = float(np.median([min(b.width, b.height) for b in layout.buttons]))
    (x0, y0), (x1, y1) = corners.min(axis=0), corners.max(axis=0)
    top = 2.5 * side if look.fixtures else 0.8 * side
    return float(x0 - 0.9 * side), float(y0 - top), float(x1 + 0.9 * side), float(y1 + 0.9 * side)


class _Painter:
    """A canvas in millimetres with opaque colour and the plate's alpha."""

    def __init__(self, box_mm: Box, px_per_mm: float) -> None:
        self.scale = px_per_mm
        self.origin = np.array(box_mm[:2]) - RIM_MM + 0.5 / px_per_mm
        size = (np.array(box_mm[2:]) - box_mm[:2] + 2 * RIM_MM) * px_per_mm
        self.width, self.height = (int(value) for value in np.ceil(size))
        self.rgb = np.zeros((self.height, self.width, 3), np.float32)

    def window(self, box_mm: Box) -> tuple[Window, Grey, Grey]:
        """The pixels of a box, and the panel coordinates of their centres, millimetres."""
        low = np.floor((np.array(box_mm[:2]) - self.origin) * self.scale).astype(int)
        high = np.ceil((np.array(box_mm[2:]) - self.origin) * self.scale).astype(int) + 1
        x = slice(max(0, int(low[0])), max(0, min(self.width, int(high[0]))))
        y = slice(max(0, int(low[1])), max(0, min(self.height, int(high[1]))))
        xs = self.origin[0] + np.arange(x.start, x.stop) / self.scale
        ys = self.origin[1] + np.arange(y.start, y.stop) / self.scale
        return (y, x), xs[None].astype(np.float32), ys[:, None].astype(np.float32)

    def coverage(self, distance: Grey | FloatArray) -> Grey:
        """Share of each pixel inside of a signed distance in millimetres (inside < 0)."""
        share = np.clip(np.float32(0.5) - distance * np.float32(self.scale), 0, 1)
        return np.asarray(share, np.float32)

    def paint(self, window: Window, mask: Grey, color: npt.ArrayLike) -> None:
        """Paint one colour, or a picture of the window's size, as far as the mask covers."""
        part = self.rgb[window]
        part += mask[..., None] * (np.asarray(color, np.float32) - part)

    def shade(self, window: Window, mask: Grey, gain: Grey | float) -> None:
        """Lighten (gain > 0) or darken what is there."""
        part = self.rgb[window]
        part *= 1 + mask[..., None] * np.asarray(gain, np.float32)[..., None]

    def stamp(self, center_mm: tuple[float, float], mask: Grey, color: Sequence[float]) -> None:
        """Paint a mask in pixels around a point."""
        height, width = mask.shape
        corner = (np.array(center_mm) - self.origin) * self.scale - np.array([width, height]) / 2
        x, y = (round(float(value)) for value in corner)
        self.paint((slice(y, y + height), slice(x, x + width)), mask, color)


def _box_distance(x: Grey, y: Grey, half: tuple[float, float], radius: float) -> Grey:
    """Signed distance to a rounded box around (0, 0)."""
    dx = np.abs(x) - np.float32(half[0] - radius)
    dy = np.abs(y) - np.float32(half[1] - radius)
    outside = np.hypot(np.maximum(dx, 0), np.maximum(dy, 0))
    return np.asarray(outside + np.minimum(np.maximum(dx, dy), 0) - np.float32(radius))


def _relief(distance: Grey, width: float, step: float) -> Grey:
    """Light on a bevel of that width inside an outline, -1 to 1; 0 on the flat."""
    gy, gx = np.gradient(distance, step)
    slope = np.clip(1 + distance / np.float32(width), 0, 1)
    return np.asarray(slope * (gx * LAMP[0] + gy * LAMP[1]), np.float32)


def _blur(mask: Grey, sigma_px: float) -> Grey:
    import cv2

    return np.asarray(cv2.GaussianBlur(mask, (0, 0), max(sigma_px, 0.1)), np.float32)


def _brushing(rng: np.random.Generator, shape: tuple[int, int], px_per_mm: float) -> Grey:
    """Streaks along the rows, mean 0 and deviation about 1."""
    import cv2

    streaks = np.zeros(shape, np.float32)
    for across, along in ((0.25, 25.0), (0.8, 60.0)):
        size = tuple(
            max(2, round(extent / px_per_mm / reach))
            for extent, reach in ((shape[1], along), (shape[0], across))
        )
        coarse = rng.normal(0, 1, size[::-1]).astype(np.float32)
        streaks += cv2.resize(coarse, shape[::-1], interpolation=cv2.INTER_CUBIC)
    return streaks


def draw_plate(layout: Layout, look: Look, rng: np.random.Generator, px_per_mm: float) -> Plate:
    """Draw the panel head-on.

    Parameters
    ----------
    layout
        The panel.
    look
        Its materials.
    rng
        Draws the brushing, the screws' angles, the display and the lit button.
    px_per_mm
        Texture pixels per millimetre on the panel.
    """
    x0, y0, x1, y1 = (1000 * value for value in plate_box(layout, look))
    canvas = _Painter((x0, y0, x1, y1), px_per_mm)
    window, x, y = canvas.window((-1e9, -1e9, 1e9, 1e9))
    middle, half = ((x0 + x1) / 2, (y0 + y1) / 2), ((x1 - x0) / 2, (y1 - y0) / 2)
    distance = _box_distance(x - middle[0], y - middle[1], half, CORNER_MM)
    alpha = canvas.coverage(distance)
    metal = 1 + look.brushed * _brushing(rng, alpha.shape, px_per_mm)
    # A soft sheen across the plate, as a window behind the photographer makes it.
    sheen = np.exp(-(((x - middle[0] + 0.35 * (y - y0)) / (0.5 * half[0] + 20)) ** 2))
    metal = (metal * (1 + look.relief * (0.3 * sheen - 0.1))).astype(np.float32)
    canvas.rgb[:] = metal[..., None] * np.array(look.plate, np.float32)
    whole = np.ones_like(alpha)
    canvas.shade(window, whole, 1.2 * look.relief * _relief(distance, 1.2, 1 / px_per_mm))
    if look.fixtures:
        side = float(np.median([min(b.width, b.height) for b in layout.buttons])) * 1000
        _draw_screws(canvas, look, (x0, y0, x1, y1), rng)
        _draw_display(canvas, look, (middle[0], y0 + 1.15 * side), side, rng)
    pressed = int(rng.integers(len(layout.buttons))) if look.pressed else -1
    for index, button in enumerate(layout.buttons):
        _draw_button(canvas, look, button, metal, lit=index == pressed)
    return _plate(canvas, alpha, look)


def _plate(canvas: _Painter, alpha: Grey, look: Look) -> Plate:
    """Put the shadow below the plate and store both in 8 bits."""
    shift = np.rint(np.array([0.4, 0.9]) * BLUR_MM * canvas.scale).astype(int)
    shadow = np.float32(look.shadow) * _blur(alpha, BLUR_MM * canvas.scale)
    shadow = np.roll(shadow, tuple(shift[::-1]), axis=(0, 1))
    opacity = alpha + (1 - alpha) * shadow
    rgba = np.dstack([np.clip(canvas.rgb, 0, 255) * alpha[..., None], 255 * opacity])
    return Plate(np.rint(rgba).astype(np.uint8), canvas.origin / 1000, 1000 * canvas.scale)


def _draw_button(
    canvas: _Painter, look: Look, button: LayoutButton, metal: Grey, *, lit: bool
) -> None:
    x0, y0 = 1000 * button.x, 1000 * button.y
    half = (500 * button.width, 500 * button.height)
    reach = 3 * BEVEL_MM
    window, xs, ys = canvas.window(
        (x0 - half[0] - reach, y0 - half[1] - reach, x0 + half[0] + reach, y0 + half[1] + reach)
    )
    x, y = xs - np.float32(x0), ys - np.float32(y0)
    if button.shape == "ellipse":
        distance = np.asarray(np.hypot(x, y) - np.float32(half[0]))
    else:
        distance = _box_distance(x, y, half, 1000 * look.rounding_m)
    gap = 1000 * look.gap_m
    if look.shadow > 0:
        dark = _blur(canvas.coverage(distance - np.float32(1.5 * gap)), 0.8 * canvas.scale)
        canvas.shade(window, dark, -look.shadow)
    if gap > 0:
        canvas.paint(window, canvas.coverage(distance - np.float32(gap)), BLACK)
    face = canvas.coverage(distance)
    canvas.paint(window, face, metal[window][..., None] * np.array(look.button, np.float32))
    canvas.shade(window, face, look.relief * _relief(distance, BEVEL_MM, 1 / canvas.scale))
    if look.labels:
        _draw_label(canvas, look, button, (x0, y0), lit=lit)
    if lit:
        # A light guide runs round the face.
        inset = 1.25 * BEVEL_MM
        ring = canvas.coverage(np.abs(distance + np.float32(inset)) - np.float32(0.45))
        glow = _blur(ring, 0.9 * canvas.scale)
        canvas.paint(window, np.minimum(1.1 * glow, 0.55) * face, look.lit)
        canvas.paint(window, ring, look.lit)


def _draw_label(
    canvas: _Painter,
    look: Look,
    button: LayoutButton,
    center: tuple[float, float],
    *,
    lit: bool,
) -> None:
    share = 0.62 if button.shape == "ellipse" else 0.72
    size = round(share * 1000 * min(button.width, button.height) * canvas.scale)
    if size < 4:
        return
    if button.category in symbols.GLYPHS:
        mask = symbols.glyph(button.category, size)
    elif button.text:
        mask = symbols.text(button.text, size)
    else:
        return
    # Engraved: the lower lip catches the light.
    lip = (center[0] + 0.15, center[1] + 0.25)
    canvas.stamp(lip, 0.5 * mask, (255, 255, 255))
    red = button.category == "alarm" and not lit
    canvas.stamp(center, mask, (176, 30, 30) if red else look.lit if lit else look.ink)


def _draw_screws(canvas: _Painter, look: Look, box: Box, rng: np.random.Generator) -> None:
    inset = 2.6 * SCREW_MM
    for cx in (box[0] + inset, box[2] - inset):
        for cy in (box[1] + inset, box[3] - inset):
            reach = 2 * SCREW_MM
            window, xs, ys = canvas.window((cx - reach, cy - reach, cx + reach, cy + reach))
            x, y = xs - np.float32(cx), ys - np.float32(cy)
            distance = np.asarray(np.hypot(x, y) - np.float32(SCREW_MM))
            canvas.shade(window, _blur(canvas.coverage(distance - 0.4), 2.0), -look.shadow)
            head = canvas.coverage(distance)
            canvas.paint(window, head, np.array(look.plate) * 1.1)
            light = _relief(distance, 0.5 * SCREW_MM, 1 / canvas.scale)
            canvas.shade(window, head, 1.3 * look.relief * light)
            turn = rng.uniform(0, np.pi)
            u, v = x * np.cos(turn) + y * np.sin(turn), y * np.cos(turn) - x * np.sin(turn)
            for along, across in ((u, v), (v, u)):
                slot = _box_distance(along, across, (0.62 * SCREW_MM, 0.13 * SCREW_MM), 0.1)
                canvas.paint(window, canvas.coverage(slot), (58, 60, 64))


def _draw_display(
    canvas: _Painter,
    look: Look,
    center: tuple[float, float],
    side: float,
    rng: np.random.Generator,
) -> None:
    """A black glass with an arrow and a digit."""
    half = (0.86 * side, 0.62 * side)
    reach = 3.0
    window, xs, ys = canvas.window(
        (
            center[0] - half[0] - reach,
            center[1] - half[1] - reach,
            center[0] + half[0] + reach,
            center[1] + half[1] + reach,
        )
    )
    x, y = xs - np.float32(center[0]), ys - np.float32(center[1])
    distance = _box_distance(x, y, half, 1.5)
    frame = canvas.coverage(distance - np.float32(1.2))
    bezel = _relief(distance - np.float32(1.2), 1.2, 1 / canvas.scale)
    canvas.shade(window, frame, -2.0 * look.relief * bezel)
    glass = canvas.coverage(distance)
    canvas.paint(window, glass, GLASS)
    lights = np.zeros((canvas.height, canvas.width), np.float32)
    dim = np.zeros_like(lights)
    tall = round(0.82 * side * canvas.scale)
    wide = round(0.5 * tall)
    digit = symbols.seven_segment(str(rng.integers(2, 10)), wide, tall)
    arrow = symbols.glyph("up" if rng.uniform() < 0.5 else "down", round(0.62 * tall))
    for mask, offset, layer in (
        (digit, 0.32, lights),
        (symbols.seven_segment("8", wide, tall), 0.32, dim),
        (arrow, -0.42, lights),
    ):
        at = (np.array([center[0] + offset * side, center[1]]) - canvas.origin) * canvas.scale
        left = round(float(at[0]) - mask.shape[1] / 2)
        top = round(float(at[1]) - mask.shape[0] / 2)
        layer[top : top + mask.shape[0], left : left + mask.shape[1]] = mask
    canvas.paint(window, 0.10 * dim[window], look.lit)
    glow = _blur(lights[window], 1.4 * canvas.scale)
    canvas.paint(window, np.minimum(0.6 * glow, 1) * glass, look.lit)
    canvas.paint(window, lights[window], look.lit)
    # The room's reflection in the glass, above a slanted line.
    above = canvas.coverage((y + 0.5 * x) / np.float32(1.12) + np.float32(0.1 * side)) * glass
    canvas.paint(window, np.float32(0.10) * above, (255, 255, 255))
