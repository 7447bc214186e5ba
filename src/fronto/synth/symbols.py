"""What is printed on buttons and displays, as coverage masks of any size.

Glyph frame: a square with u right and v down, each from -1 to 1.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

__all__ = ["GLYPHS", "Mask", "glyph", "seven_segment", "text"]

#: Coverage of each pixel, 0 to 1, shape (h, w).
Mask = npt.NDArray[np.float32]
Polygon = list[tuple[float, float]]

#: Glyphs are drawn this much larger and averaged, for smooth edges.
OVERSAMPLING = 4

_ARROW_UP: Polygon = [(0, -0.62), (0.66, 0.5), (-0.66, 0.5)]
_TRIANGLE_LEFT: Polygon = [(-0.78, 0.0), (-0.16, -0.46), (-0.16, 0.46)]
_TRIANGLE_IN: Polygon = [(-0.16, 0.0), (-0.78, -0.46), (-0.78, 0.46)]
_BAR: Polygon = [(-0.05, -0.62), (0.05, -0.62), (0.05, 0.62), (-0.05, 0.62)]


def _mirrored(polygon: Polygon) -> Polygon:
    return [(-u, v) for u, v in polygon]


def _disc(u: float, v: float, radius: float) -> Polygon:
    t = np.linspace(0, 2 * np.pi, 48, endpoint=False)
    points = np.column_stack([u + radius * np.cos(t), v + radius * np.sin(t)])
    return [(float(x), float(y)) for x, y in points]


def _bell() -> Polygon:
    """A bell's body: a dome on a flared skirt."""
    t = np.linspace(np.pi, 2 * np.pi, 24)
    dome = [(float(0.36 * np.cos(a)), float(-0.16 + 0.36 * np.sin(a))) for a in t]
    return [*dome, (0.40, 0.18), (0.62, 0.40), (-0.62, 0.40), (-0.40, 0.18)]


#: The polygons of each glyph.
GLYPHS: dict[str, list[Polygon]] = {
    "up": [_ARROW_UP],
    "down": [[(u, -v) for u, v in _ARROW_UP]],
    "open": [_TRIANGLE_LEFT, _mirrored(_TRIANGLE_LEFT), _BAR],
    "close": [_TRIANGLE_IN, _mirrored(_TRIANGLE_IN), _BAR],
    "keyhole": [_disc(0, -0.2, 0.3), [(-0.11, -0.1), (0.11, -0.1), (0.22, 0.6), (-0.22, 0.6)]],
    "alarm": [_bell(), _disc(0, -0.58, 0.10), _disc(0, 0.54, 0.14)],
}


def _fill(polygons: list[Polygon], width: int, height: int) -> Mask:
    """Fill polygons of the unit square (0 to 1) in a picture of `width` by `height`."""
    import cv2

    shift = 4
    size = np.array([width, height]) * OVERSAMPLING
    large = np.zeros((int(size[1]), int(size[0])), np.uint8)
    for polygon in polygons:
        # The square's edge lies half a pixel before the centre of pixel 0.
        points = np.array(polygon) * size - 0.5
        cv2.fillPoly(large, [np.rint(points * (1 << shift)).astype(np.int32)], (255,), 8, shift)
    small = cv2.resize(large, (width, height), interpolation=cv2.INTER_AREA)
    return np.asarray(small, np.float32) / np.float32(255)


def glyph(name: str, size: int) -> Mask:
    """Draw one of `GLYPHS`, shape (size, size)."""
    polygons = [[((u + 1) / 2, (v + 1) / 2) for u, v in polygon] for polygon in GLYPHS[name]]
    return _fill(polygons, size, size)


def text(words: str, size: int) -> Mask:
    """Write `words` in the middle of a square, as large as fits, shape (size, size)."""
    from PIL import Image, ImageDraw, ImageFont

    large = size * OVERSAMPLING
    image = Image.new("L", (large, large))
    draw = ImageDraw.Draw(image)
    font = ImageFont.load_default(0.6 * large)
    box = draw.textbbox((0, 0), words, font=font)
    width = box[2] - box[0]
    if width > 0.82 * large:
        font = ImageFont.load_default(0.6 * large * 0.82 * large / width)
        box = draw.textbbox((0, 0), words, font=font)
    origin = ((large - box[0] - box[2]) / 2, (large - box[1] - box[3]) / 2)
    # The built-in font has one weight; a rim makes it bold enough to read from afar.
    draw.text(origin, words, fill=255, font=font, stroke_width=round(0.012 * large))
    small = image.resize((size, size), Image.Resampling.BOX)
    return np.asarray(small, np.float32) / np.float32(255)


#: Which of the segments a (top), b, c, d, e, f (clockwise) and g (middle) each digit lights.
_SEGMENTS = {
    "0": "abcdef",
    "1": "bc",
    "2": "abged",
    "3": "abgcd",
    "4": "fgbc",
    "5": "afgcd",
    "6": "afgedc",
    "7": "abc",
    "8": "abcdefg",
    "9": "abcdfg",
}


def seven_segment(digit: str, width: int, height: int) -> Mask:
    """Draw a digit of a seven-segment display, shape (height, width)."""
    thick = 0.075  # half a segment's width, in widths of the digit
    aspect = width / height
    left, right, top, bottom = 0.12, 0.88, 0.12 * aspect, 1 - 0.12 * aspect
    rows = {"a": top, "g": 0.5, "d": bottom}
    columns = {"b": (right, top, 0.5), "c": (right, 0.5, bottom)}
    columns |= {"e": (left, 0.5, bottom), "f": (left, top, 0.5)}
    gap = 0.03
    polygons: list[Polygon] = []
    for name in _SEGMENTS[digit]:
        if name in rows:
            y, dx, dy = rows[name], thick, thick * aspect
            a, b = left + gap, right - gap
            upper = [(a, y), (a + dx, y - dy), (b - dx, y - dy)]
            polygons.append([*upper, (b, y), (b - dx, y + dy), (a + dx, y + dy)])
        else:
            x, high, low = columns[name]
            a, b, dy = high + gap * aspect, low - gap * aspect, thick * aspect
            right_side = [(x, a), (x + thick, a + dy), (x + thick, b - dy)]
            polygons.append([*right_side, (x, b), (x - thick, b - dy), (x - thick, a + dy)])
    # Italic, as such displays are.
    slanted = [[(u + 0.10 * (0.5 - v), v) for u, v in polygon] for polygon in polygons]
    return _fill(slanted, width, height)
