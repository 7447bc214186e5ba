"""Buttons drawn with exactly known outlines, and their exact masks."""

from __future__ import annotations

from dataclasses import dataclass

import cv2
import numpy as np

from fronto import Ellipse, Outline, Segments
from fronto.segments import Segment

#: Subpixels that the picture is drawn with, and OpenCV's fixed point.
FINE, SHIFT = 8, 6


@dataclass(frozen=True, eq=False)
class Drawing:
    """A picture, the masks of its buttons, and their true outlines."""

    image: np.ndarray
    segments: Segments
    truths: list[Outline]


def contour(side: float, radius: float | None) -> np.ndarray:
    """Of a square with round corners around the origin; radius in sides, None: a circle."""
    if radius is None:
        t = np.arange(256) * (2 * np.pi / 256)
        return side / 2 * np.stack([np.cos(t), np.sin(t)], axis=1)
    r, half, parts = radius * side, side / 2, []
    for k, (sx, sy) in enumerate(((-1, -1), (1, -1), (1, 1), (-1, 1))):
        t = np.pi * (1 + k / 2) + np.linspace(0, np.pi / 2, 24)
        arc = np.stack([np.cos(t), np.sin(t)], axis=1)
        parts.append(np.array([sx, sy]) * (half - r) + r * arc)
    return np.concatenate(parts)


def inside(polygon: np.ndarray, width: int, height: int) -> np.ndarray:
    """Which pixels' centres lie in a polygon, (height, width)."""
    y, x = np.mgrid[:height, :width].astype(float)
    odd = np.zeros((height, width), bool)
    for (x0, y0), (x1, y1) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        if y0 == y1:
            continue
        odd ^= ((y0 > y) != (y1 > y)) & (x < x0 + (y - y0) * (x1 - x0) / (y1 - y0))
    return odd


def buttons_drawn(
    rng: np.random.Generator,
    side: int,
    radius: float | None,
    *,
    columns: int = 4,
    rows: int = 3,
    noise: float = 2.0,
    blur: float = 0.7,
    light: float = 0.3,
    roll_deg: float = 30.0,
) -> Drawing:
    """Draw buttons, each turned and tilted by itself.

    `side` in pixels; `radius` of the corners in sides, None for circles; `noise` in grey levels,
    `blur` in pixels, `light`: by which share it changes across the picture.
    """
    pitch = side + 24
    width, height = columns * pitch, rows * pitch
    fine = np.full((height * FINE, width * FINE), 110, np.uint8)
    segments, truths = [], []
    for k in range(rows * columns):
        cell = np.array([k % columns + 0.5, k // columns + 0.5]) * pitch
        shift = cell + rng.uniform(-0.5, 0.5, 2)
        angle = np.radians(rng.uniform(-roll_deg, roll_deg))
        cos, sin = np.cos(angle), np.sin(angle)
        matrix = np.array([[cos, -0.9 * sin, 0], [sin, 0.9 * cos, 0], [0, 0, 1]])
        matrix[2, :2] = rng.uniform(-1, 1, 2) * 0.045 / side
        polygon = mapped(matrix, contour(side, radius)) + shift
        # OpenCV fills every subpixel that a polygon touches: half of one too much all around.
        middle = polygon.mean(axis=0)
        away = polygon - middle
        length = np.linalg.norm(away, axis=1, keepdims=True)
        drawn = middle + away * (1 - 0.5 / FINE / length)
        at = (drawn + 0.5) * FINE - 0.5
        cv2.fillPoly(fine, [np.rint(at * 2**SHIFT).astype(np.int32)], (170,), shift=SHIFT)
        low = np.floor(polygon.min(axis=0)).astype(int) - 3
        wide, high = np.ceil(polygon.max(axis=0)).astype(int) + 4 - low
        mask = inside(polygon - low, int(wide), int(high)).astype(np.float32)
        box = (low[0] - 0.5, low[1] - 0.5, low[0] + wide - 0.5, low[1] + high - 0.5)
        origin = (int(low[0]), int(low[1]))
        segments.append(Segment("number", 1.0, tuple(map(float, box)), origin, mask))
        if radius is None:
            truths.append(true_ellipse(matrix, side, shift))
        else:
            corners = mapped(matrix, contour(side, 0.0)[[0, 24, 48, 72]]) + shift
            truths.append(Outline.quad(corners))
    image = cv2.resize(fine, (width, height), interpolation=cv2.INTER_AREA).astype(float)
    image = cv2.GaussianBlur(image, (0, 0), blur) * (1 + light * (np.arange(width) / width - 0.5))
    image = np.clip(np.rint(image + rng.normal(0, noise, image.shape)), 0, 255).astype(np.uint8)
    found = Segments(width, height, tuple(segments))
    return Drawing(np.repeat(image[..., None], 3, axis=2), found, truths)


def mapped(matrix: np.ndarray, points: np.ndarray) -> np.ndarray:
    plane = np.column_stack([points, np.ones(len(points))]) @ matrix.T
    return plane[:, :2] / plane[:, 2:]


def true_ellipse(matrix: np.ndarray, side: float, shift: np.ndarray) -> Outline:
    """The image of a circle, by its dual conic."""
    dual = matrix @ np.diag([side**2 / 4, side**2 / 4, -1.0]) @ matrix.T
    center = dual[:2, 2] / dual[2, 2]
    shape = np.outer(center, center) - dual[:2, :2] / dual[2, 2]
    e = Ellipse.from_shape_matrix(center + shift, shape)
    return Outline.ellipse(e.cx, e.cy, e.a, e.b, e.angle_deg)
