"""The panel's picture head-on, and what is painted into it."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from fronto.synth.photo.draws import Color, Pixels
from fronto.synth.photo.glyphs import Bits, resized

__all__ = ["Canvas", "Patch"]

#: Fractional bits of the coordinates that OpenCV's drawing functions take.
SHIFT = 4


@dataclass(frozen=True, eq=False)
class Patch:
    """A small picture around a middle pixel: colours times alpha, and alpha.

    Parameters
    ----------
    rgb
        Shape (h, w, 3), premultiplied, 0 to 255; h and w are odd.
    alpha
        Shape (h, w, 1), 0 to 1.
    """

    rgb: Pixels
    alpha: Pixels


class Layers:
    """A patch in the making: paint is laid over what is there.

    Parameters
    ----------
    shape
        Height and width of the patch.
    """

    def __init__(self, shape: tuple[int, int]) -> None:
        self.planes = np.zeros((3, *shape), np.float32)
        self.alpha = np.zeros(shape, np.float32)

    def over(self, mask: Pixels, color: Color) -> None:
        """Paint a colour as far as the mask (h, w) covers."""
        for plane, value in zip(self.planes, color, strict=True):
            plane += mask * (np.float32(value) - plane)
        self.alpha += mask * (1 - self.alpha)

    def light(self, amount: Pixels) -> None:
        """Lighten (> 0) or darken (< 0) by shares, shape (h, w)."""
        self.over(np.clip(amount, 0, 1), (255.0, 255.0, 255.0))
        self.over(np.clip(-amount, 0, 1), (0.0, 0.0, 0.0))

    def patch(self) -> Patch:
        """What has been painted."""
        rgb = np.ascontiguousarray(np.moveaxis(self.planes, 0, 2))
        return Patch(rgb, self.alpha[..., None])


@dataclass(eq=False)
class Canvas:
    """A picture in panel coordinates.

    Parameters
    ----------
    rgb
        Shape (h, w, 3), uint8.
    alpha
        Shape (h, w), uint8: where there is a panel.
    scale
        Pixels a millimetre.
    origin
        Millimetres of the centre of the top-left pixel.
    """

    rgb: npt.NDArray[np.uint8]
    alpha: npt.NDArray[np.uint8]
    scale: float
    origin: tuple[float, float]
    patches: dict[object, Patch] = field(default_factory=dict)

    def at(self, x: float, y: float) -> tuple[float, float]:
        """Pixels of a point in millimetres."""
        return (x - self.origin[0]) * self.scale, (y - self.origin[1]) * self.scale

    def snapped(self, x: float, y: float) -> tuple[float, float]:
        """The nearest point (millimetres) in the middle of a pixel; patches are exact there."""
        u, v = (round(value) / self.scale for value in self.at(x, y))
        return u + self.origin[0], v + self.origin[1]

    def sees(self, x: float, y: float, width: float, height: float) -> bool:
        """Whether a box around (x, y), millimetres, reaches into the picture."""
        u, v = self.at(x, y)
        half_w, half_h = width * self.scale / 2, height * self.scale / 2
        rows, columns = self.alpha.shape
        return bool(-half_w < u < columns + half_w and -half_h < v < rows + half_h)

    def stamp(self, patch: Patch, x: float, y: float) -> None:
        """Lay a patch with its middle on the pixel nearest to (x, y), millimetres."""
        u, v = (round(value) for value in self.at(x, y))
        height, width = patch.alpha.shape[:2]
        left, top = u - width // 2, v - height // 2
        x0, y0 = max(0, left), max(0, top)
        x1 = min(self.rgb.shape[1], left + width)
        y1 = min(self.rgb.shape[0], top + height)
        if x1 <= x0 or y1 <= y0:
            return
        part = (slice(y0 - top, y1 - top), slice(x0 - left, x1 - left))
        target = self.rgb[y0:y1, x0:x1]
        mixed = target * (1 - patch.alpha[part]) + patch.rgb[part]
        np.clip(mixed + np.float32(0.5), 0, 255, out=mixed)
        target[:] = mixed.astype(np.uint8)

    def ink(
        self,
        mask: Bits,
        x: float,
        y: float,
        size: tuple[float, float],
        color: Color,
        opacity: float = 1.0,
    ) -> None:
        """Print a mask of that size (millimetres) around (x, y)."""
        width, height = (max(1, round(extent * self.scale)) for extent in size)
        if width > 3 * self.rgb.shape[1] or height > 3 * self.rgb.shape[0]:
            return  # far too close to make out
        cover = np.float32(opacity) * resized(mask, width, height)[..., None]
        self.stamp(Patch(cover * np.array(color, np.float32), cover), x, y)

    def box(
        self,
        x: float,
        y: float,
        width: float,
        height: float,
        color: Color,
        radius: float = 0.0,
        line: float = 0.0,
    ) -> None:
        """Fill a box with rounded corners around (x, y), or draw its outline of that width.

        Edges are good to half a pixel.
        """
        import cv2

        a, b, r = width / 2, height / 2, min(radius, width / 2, height / 2)
        if r * self.scale < 1:
            points = np.array([(-a, -b), (a, -b), (a, b), (-a, b)])
        else:
            t = np.pi + np.linspace(0, np.pi / 2, 6) + np.pi / 2 * np.arange(4)[:, None]
            corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * [a - r, b - r]
            points = (corners[:, None] + r * np.stack([np.cos(t), np.sin(t)], 2)).reshape(-1, 2)
        pixels = (points - (np.array(self.origin) - (x, y))) * self.scale * (1 << SHIFT)
        polygon = [np.rint(pixels).astype(np.int32)]
        if line:
            thick = max(1, round(line * self.scale))
            cv2.polylines(self.rgb, polygon, True, color, thick, cv2.LINE_AA, SHIFT)
        else:
            cv2.fillPoly(self.rgb, polygon, color, cv2.LINE_AA, SHIFT)

    def disc(self, x: float, y: float, radius: float, color: Color, ring: float = 0.0) -> None:
        """Fill a disc, or draw a ring of that thickness."""
        import cv2

        u, v = (round(value * (1 << SHIFT)) for value in self.at(x, y))
        size = round(radius * self.scale * (1 << SHIFT))
        thick = max(1, round(ring * self.scale)) if ring else -1
        cv2.circle(self.rgb, (u, v), size, color, thick, cv2.LINE_AA, SHIFT)

    def line(
        self, first: tuple[float, float], last: tuple[float, float], width: float, color: Color
    ) -> None:
        """A line between two points, all in millimetres."""
        import cv2

        a, b = (
            tuple(round(value * (1 << SHIFT)) for value in self.at(*point))
            for point in (first, last)
        )
        thick = max(1, round(width * self.scale))
        cv2.line(self.rgb, (a[0], a[1]), (b[0], b[1]), color, thick, cv2.LINE_AA, SHIFT)
