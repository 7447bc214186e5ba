"""Outlines of what is on a panel: signed distances, contours and their images in the photo."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from fronto.shapes import Ellipse, FloatArray, Outline
from fronto.synth.photo.draws import Pixels

__all__ = ["Form", "contour", "outline", "project", "signed_distance"]

#: Points on a quarter of a circle.
ARC = 12
#: Corners rounder than this share of the shorter side leave a pill, which has no corners.
MAX_ROUNDING = 0.36


@dataclass(frozen=True)
class Form:
    """An outline around (0, 0); lengths in millimetres.

    Parameters
    ----------
    kind
        A rounded "box" (with the radius at half a side: a pill), an "ellipse", an
        "octagon" or a triangle pointing "up" or "down".
    width, height
        Size.
    radius
        Radius of a box's corners.
    """

    kind: Literal["box", "ellipse", "octagon", "up", "down"]
    width: float
    height: float
    radius: float = 0.0

    @property
    def odd(self) -> bool:
        """Whether neither four corners nor an ellipse describe it exactly."""
        round_ends = self.radius > MAX_ROUNDING * min(self.width, self.height)
        return self.kind != "ellipse" and (self.kind != "box" or round_ends)

    def scaled(self, factor: float) -> Form:
        """The same form, `factor` times as large."""
        return Form(self.kind, *(factor * v for v in (self.width, self.height, self.radius)))


def _vertices(form: Form) -> FloatArray:
    a, b = form.width / 2, form.height / 2
    if form.kind == "octagon":
        c, d = a * np.tan(np.pi / 8), b * np.tan(np.pi / 8)
        points = [(-c, -b), (c, -b), (a, -d), (a, d), (c, b), (-c, b), (-a, d), (-a, -d)]
    elif form.kind == "up":
        points = [(0, -b), (a, b), (-a, b)]
    else:
        points = [(-a, -b), (a, -b), (0, b)]
    return np.array(points)


def contour(form: Form) -> FloatArray:
    """The exact contour, clockwise as seen, shape (n, 2), millimetres."""
    a, b, r = form.width / 2, form.height / 2, form.radius
    if form.kind == "ellipse":
        t = np.arange(4 * ARC) * (np.pi / 2 / ARC)
        return np.column_stack([a * np.cos(t), b * np.sin(t)])
    if form.kind != "box":
        return _vertices(form)
    if r <= 0:
        return np.array([(-a, -b), (a, -b), (a, b), (-a, b)])
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * [a - r, b - r]
    t = np.pi + np.linspace(0, np.pi / 2, ARC) + np.pi / 2 * np.arange(4)[:, None]
    arcs = corners[:, None] + r * np.stack([np.cos(t), np.sin(t)], axis=2)
    return np.asarray(arcs.reshape(-1, 2))


def signed_distance(form: Form, x: Pixels, y: Pixels) -> Pixels:
    """Distance to the contour, negative inside, in the unit of the form.

    Parameters
    ----------
    x, y
        Shapes (1, w) and (h, 1).

    Returns
    -------
    Shape (h, w); exact near the contour, which is all that edges need.
    """
    a, b, r = form.width / 2, form.height / 2, form.radius
    if form.kind == "ellipse":
        if a == b:
            return np.asarray(np.hypot(x, y) - np.float32(a), np.float32)
        size = np.hypot(x / np.float32(a), y / np.float32(b))
        slope = np.hypot(x / np.float32(a * a), y / np.float32(b * b))
        away = (size - 1) * size / np.maximum(slope, np.float32(1e-12))
        return np.asarray(np.where(size > 0, away, np.float32(-min(a, b))), np.float32)
    if form.kind == "box":
        dx, dy = np.abs(x) - np.float32(a - r), np.abs(y) - np.float32(b - r)
        outside = np.hypot(np.maximum(dx, 0), np.maximum(dy, 0))
        return np.asarray(outside + np.minimum(np.maximum(dx, dy), 0) - np.float32(r), np.float32)
    points = _vertices(form)
    sides = np.roll(points, -1, axis=0) - points
    normals = np.column_stack([sides[:, 1], -sides[:, 0]]) / np.hypot(*sides.T)[:, None]
    offsets = (normals * points).sum(axis=1)
    planes = [
        np.float32(nx) * x + np.float32(ny) * y - np.float32(c)
        for (nx, ny), c in zip(normals, offsets, strict=True)
    ]
    return np.asarray(np.maximum.reduce(planes), np.float32)


def project(homography: FloatArray, points: FloatArray) -> FloatArray:
    """Plane points (n, 2) to homogeneous photo pixels (n, 3); the last is the depth, metres."""
    return np.asarray(points @ homography[:, :2].T + homography[:, 2])


def outline(
    homography: FloatArray, form: Form, at_m: tuple[float, float], *, category: str, text: str
) -> Outline:
    """The form's outline in the photo; all of it must lie before the camera.

    Parameters
    ----------
    homography
        Shape (3, 3): panel metres to photo pixels.
    form, at_m
        The form in millimetres, and where its middle is on the panel.
    """
    a, b = form.width / 2000, form.height / 2000
    if form.kind == "ellipse":
        # The unit circle's dual conic through the homography from its plane to the photo.
        scale = np.array([[a, 0, at_m[0]], [0, b, at_m[1]], [0, 0, 1]])
        H = homography @ scale
        dual = H @ np.diag([1.0, 1.0, -1.0]) @ H.T
        center = dual[:2, 2] / dual[2, 2]
        shape = np.outer(center, center) - dual[:2, :2] / dual[2, 2]
        ellipse = Ellipse.from_shape_matrix(center, shape)
        return Outline("ellipse", ellipse_px=ellipse, category=category, text=text)
    corners = np.array([(-a, -b), (a, -b), (a, b), (-a, b)]) + at_m
    image = project(homography, corners)
    return Outline.quad(image[:, :2] / image[:, 2:], category=category, text=text, odd=form.odd)
