"""What is printed on buttons, plates and notices: cached coverage masks.

Symbols live in a square with u right and v down, each from -1 to 1.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
import numpy.typing as npt

__all__ = ["FONTS", "SIZE", "SYMBOLS", "Bits", "Pen", "resized", "symbol", "words"]

#: Coverage, 0 to 255, shape (h, w).
Bits = npt.NDArray[np.uint8]
Point = tuple[float, float]

SIZE = 96
FINE = 3
#: Number of typefaces and weights that `words` knows.
FONTS = 9

#: How many ways there are to draw each symbol.
SYMBOLS = {
    "up": 6,
    "down": 6,
    "open": 4,
    "close": 4,
    "bell": 2,
    "phone": 2,
    "keyhole": 2,
    "fan": 2,
    "star": 1,
    "cross": 1,
    "bulb": 1,
    "hat": 1,
    "hanzi": 24,
    "dot": 1,
    "ring": 1,
    "bar": 1,
    "person": 1,
    "speaker": 1,
}


class Pen:
    """Draws signs, three times as fine as they are wanted.

    Parameters
    ----------
    thick
        Of lines for which nothing else is said, in half sides of the square.
    """

    def __init__(self, thick: float = 0.12) -> None:
        self.image = np.zeros((SIZE * FINE, SIZE * FINE), np.uint8)
        self.thick = thick

    def _at(self, points: list[Point]) -> npt.NDArray[np.int32]:
        unit = (np.array(points, np.float64) + 1) / 2
        return np.rint((unit * SIZE * FINE - 0.5) * 16).astype(np.int32)

    def fill(self, points: list[Point], value: int = 255) -> None:
        """Fill a polygon."""
        import cv2

        cv2.fillPoly(self.image, [self._at(points)], (value,), cv2.LINE_AA, 4)

    def line(self, points: list[Point], closed: bool = False, thick: float = 0.0) -> None:
        """Draw a line through points; 0: as thick as lines are."""
        import cv2

        width = max(1, round((thick or self.thick) * SIZE * FINE / 2))
        cv2.polylines(self.image, [self._at(points)], closed, (255,), width, cv2.LINE_AA, 4)

    def disc(self, u: float, v: float, radius: float, value: int = 255) -> None:
        """Fill a circle."""
        import cv2

        x, y = (int(n) for n in self._at([(u, v)])[0])
        size = round(radius * SIZE * FINE / 2 * 16)
        cv2.circle(self.image, (x, y), size, (value,), -1, cv2.LINE_AA, 4)

    def arc(self, u: float, v: float, radius: float, first: float, last: float) -> None:
        """Draw a part of a circle, between two angles in degrees, clockwise from the right."""
        t = np.radians(np.linspace(first, last, 24))
        self.line([(u + radius * float(np.cos(a)), v + radius * float(np.sin(a))) for a in t])


def _up(pen: Pen, variant: int) -> None:
    triangle: list[Point] = [(0, -0.62), (0.72, 0.55), (-0.72, 0.55)]
    if variant == 0:
        pen.fill(triangle)
    elif variant == 1:
        pen.line(triangle, closed=True)
    elif variant == 2:
        pen.line([(-0.7, 0.35), (0, -0.4), (0.7, 0.35)], thick=0.2)
    elif variant == 3:
        pen.fill([(0, -0.85), (0.5, -0.1), (-0.5, -0.1)])
        pen.fill([(-0.14, -0.15), (0.14, -0.15), (0.14, 0.8), (-0.14, 0.8)])
    elif variant == 4:
        pen.line([(0, 0.8), (0, -0.75)])
        pen.line([(-0.45, -0.2), (0, -0.78), (0.45, -0.2)])
    else:
        pen.fill([(0, -0.45), (0.8, 0.4), (-0.8, 0.4)])


def _door(pen: Pen, variant: int, inward: bool) -> None:
    far, near, tall = 0.85, 0.22, 0.45
    for side in (-1, 1):
        tip, base = (near, far) if inward else (far, near)
        points: list[Point] = [(side * tip, 0), (side * base, -tall), (side * base, tall)]
        if variant == 1:
            pen.line(points, closed=True, thick=0.09)
        elif variant == 3:
            pen.line([points[1], points[0], points[2]])
        else:
            pen.fill(points)
    if variant == 0:
        pen.line([(0, -0.6), (0, 0.6)], thick=0.1)
    elif variant == 2:
        pen.line([(-0.08, -0.55), (-0.08, 0.55)], thick=0.07)
        pen.line([(0.08, -0.55), (0.08, 0.55)], thick=0.07)


def _bell(pen: Pen, variant: int) -> None:
    t = np.linspace(np.pi, 2 * np.pi, 24)
    dome = [(float(0.42 * np.cos(a)), float(-0.15 + 0.42 * np.sin(a))) for a in t]
    body: list[Point] = [*dome, (0.45, 0.2), (0.68, 0.42), (-0.68, 0.42), (-0.45, 0.2)]
    if variant:
        pen.line(body, closed=True, thick=0.1)
    else:
        pen.fill(body)
    pen.disc(0, 0.56, 0.15)
    pen.disc(0, -0.62, 0.1)


def _phone(pen: Pen, variant: int) -> None:
    if variant:
        pen.arc(0, 0.2, 0.6, 200, 340)
        pen.disc(-0.6, 0.1, 0.2)
        pen.disc(0.6, 0.1, 0.2)
    else:
        pen.arc(0.35, -0.35, 0.95, 95, 175)
        pen.disc(-0.5, -0.42, 0.2)
        pen.disc(0.42, 0.5, 0.2)


def _fan(pen: Pen, variant: int) -> None:
    for k in range(3 + variant):
        angle = 2 * np.pi * k / (3 + variant)
        c, s = float(np.cos(angle)), float(np.sin(angle))
        blade = [(0.1, 0.0), (0.35, -0.3), (0.75, -0.15), (0.7, 0.2), (0.3, 0.12)]
        pen.fill([(u * c - v * s, u * s + v * c) for u, v in blade])
    pen.disc(0, 0, 0.13)


def _star(pen: Pen) -> None:
    points: list[Point] = []
    for k in range(10):
        r, a = (0.85 if k % 2 == 0 else 0.35), np.pi * k / 5 - np.pi / 2
        points.append((float(r * np.cos(a)), float(r * np.sin(a))))
    pen.fill(points)


def _hanzi(pen: Pen, variant: int) -> None:
    """Strokes on a grid, which from afar look like a Chinese character."""
    rng = np.random.default_rng(variant)
    pen.thick = 0.1
    levels = np.linspace(-0.75, 0.75, 5)
    for _ in range(int(rng.integers(3, 6))):
        y, half = float(rng.choice(levels)), float(rng.uniform(0.3, 0.85))
        pen.line([(-half, y), (half, y)])
    for _ in range(int(rng.integers(1, 4))):
        x, top = float(rng.choice(levels)), float(rng.uniform(-0.85, 0))
        pen.line([(x, top), (x, top + float(rng.uniform(0.5, 0.9)))])
    if rng.random() < 0.6:
        pen.line([(0, -0.1), (-0.7, 0.85)])
        pen.line([(0, -0.1), (0.7, 0.85)])


@lru_cache(maxsize=256)
def symbol(name: str, variant: int = 0) -> Bits:
    """Draw one of `SYMBOLS`, shape (96, 96)."""
    import cv2

    pen = Pen()
    if name in ("up", "down"):
        _up(pen, variant)
    elif name in ("open", "close"):
        _door(pen, variant, inward=name == "close")
    elif name == "bell":
        _bell(pen, variant)
    elif name == "phone":
        _phone(pen, variant)
    elif name == "keyhole":
        if variant:
            pen.fill([(-0.12, -0.6), (0.12, -0.6), (0.12, 0.6), (-0.12, 0.6)])
        else:
            pen.disc(0, -0.2, 0.3)
            pen.fill([(-0.12, -0.1), (0.12, -0.1), (0.2, 0.6), (-0.2, 0.6)])
    elif name == "fan":
        _fan(pen, variant)
    elif name == "star":
        _star(pen)
    elif name == "cross":
        pen.line([(-0.6, -0.6), (0.6, 0.6)], thick=0.22)
        pen.line([(-0.6, 0.6), (0.6, -0.6)], thick=0.22)
    elif name == "bulb":
        pen.disc(0, -0.2, 0.5)
        pen.fill([(-0.22, 0.3), (0.22, 0.3), (0.22, 0.75), (-0.22, 0.75)])
    elif name == "hat":
        t = np.linspace(np.pi, 2 * np.pi, 24)
        pen.fill([(float(0.5 * np.cos(a)), float(0.1 + 0.65 * np.sin(a))) for a in t])
        pen.fill([(-0.85, 0.15), (0.85, 0.15), (0.7, 0.4), (-0.7, 0.4)])
    elif name == "hanzi":
        _hanzi(pen, variant)
    elif name == "dot":
        pen.disc(0, 0, 0.9)
    elif name == "ring":
        pen.disc(0, 0, 0.95)
        pen.disc(0, 0, 0.7, 0)
    elif name == "bar":
        pen.fill([(-0.6, -0.1), (0.6, -0.1), (0.6, 0.1), (-0.6, 0.1)])
    elif name == "person":
        pen.disc(0, -0.6, 0.22)
        pen.fill([(-0.35, -0.3), (0.35, -0.3), (0.22, 0.85), (-0.22, 0.85)])
    else:
        pen.fill([(-0.6, -0.2), (-0.3, -0.2), (0, -0.55), (0, 0.55), (-0.3, 0.2), (-0.6, 0.2)])
        pen.arc(0, 0, 0.35, -40, 40)
        pen.arc(0, 0, 0.65, -40, 40)
    image = pen.image[::-1] if name == "down" else pen.image
    return np.asarray(cv2.resize(image, (SIZE, SIZE), interpolation=cv2.INTER_AREA), np.uint8)


def _hershey(text: str, font: int) -> Bits:
    import cv2

    faces = (
        (cv2.FONT_HERSHEY_SIMPLEX, 8),
        (cv2.FONT_HERSHEY_SIMPLEX, 14),
        (cv2.FONT_HERSHEY_DUPLEX, 8),
        (cv2.FONT_HERSHEY_COMPLEX, 7),
        (cv2.FONT_HERSHEY_TRIPLEX, 8),
    )
    face, thick = faces[font]
    (width, height), base = cv2.getTextSize(text, face, 4.0, thick)
    image = np.zeros((height + base + 60, width + 60), np.uint8)
    cv2.putText(image, text, (30, height + 30), face, 4.0, (255,), thick, cv2.LINE_AA)
    return image


def _freetype(text: str, weight: int) -> Bits:
    from PIL import Image, ImageDraw, ImageFont

    font = ImageFont.load_default(110)
    x0, y0, x1, y1 = ImageDraw.Draw(Image.new("L", (8, 8))).textbbox((0, 0), text, font=font)
    image = Image.new("L", (int(x1 - x0) + 40, int(y1 - y0) + 40))
    at = (20 - x0, 20 - y0)
    ImageDraw.Draw(image).text(at, text, fill=255, font=font, stroke_width=weight)
    return np.asarray(image, np.uint8)


@lru_cache(maxsize=2048)
def words(text: str, font: int) -> Bits:
    """Write `text` in one of `FONTS` typefaces, cropped to the ink, shape (h, w)."""
    import cv2

    image = _freetype(text, font * 2) if font < 4 else _hershey(text, font - 4)
    x, y, width, height = cv2.boundingRect(image)
    if not (width and height):
        return np.zeros((SIZE, SIZE // 2), np.uint8)
    return np.ascontiguousarray(image[y : y + height, x : x + width])


def resized(mask: Bits, width: int, height: int) -> npt.NDArray[np.float32]:
    """The mask at another size, as coverage 0 to 1, shape (height, width)."""
    import cv2

    small = width < mask.shape[1]
    way = cv2.INTER_AREA if small else cv2.INTER_LINEAR
    out = cv2.resize(mask, (max(1, width), max(1, height)), interpolation=way)
    return np.asarray(out, np.float32) * np.float32(1 / 255)
