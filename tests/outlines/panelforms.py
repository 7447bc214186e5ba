"""Outlines of buttons, exactly: which points lie inside, where corners and ellipses are.

A button's outline lies at a distance `radius` around a convex core, in a plane that a
homography takes to the photo: a rectangle (quad), a point (circle), a segment (pill).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fronto import Ellipse
from fronto.shapes import FloatArray

FOCAL_PX = 900.0


def mapped(homography: FloatArray, xy: object) -> FloatArray:
    """Points (..., 2) through a homography."""
    p = np.asarray(xy, float) @ homography[:, :2].T + homography[:, 2]
    return np.asarray(p[..., :2] / p[..., 2:])


def view(roll_deg=0.0, tilt_x_deg=0.0, tilt_y_deg=0.0, origin=(0.0, 0.0)) -> FloatArray:
    """Where a camera sees a wall whose units are pixels at the origin; roll is clockwise."""
    (a, b, c), (x, y, z) = (
        f(np.radians([tilt_x_deg, tilt_y_deg, roll_deg])) for f in (np.cos, np.sin)
    )
    turn = np.array([[c, -z, 0], [z, c, 0], [0, 0, 1]])
    turn = (
        turn
        @ np.array([[1, 0, 0], [0, a, -x], [0, x, a]])
        @ np.array([[b, 0, y], [0, 1, 0], [-y, 0, b]])
    )
    wall = np.column_stack([turn[:, 0], turn[:, 1], [0, 0, FOCAL_PX]])
    return np.array([[FOCAL_PX, 0, origin[0]], [0, FOCAL_PX, origin[1]], [0, 0, 1]]) @ wall


def random_view(rng: np.random.Generator, roll_deg=30.0, tilt_deg=25.0) -> FloatArray:
    """A camera rolled and tilted by up to these angles."""
    return view(rng.uniform(-roll_deg, roll_deg), *rng.uniform(-tilt_deg, tilt_deg, 2))


@dataclass(frozen=True, eq=False)
class Form:
    """A button's outline in the photo; `core` (k, 2) runs clockwise as seen."""

    core: FloatArray
    radius: float
    to_px: FloatArray
    corners: FloatArray | None = None

    def inside(self, xy: FloatArray) -> np.ndarray:
        """Whether points of the photo (..., 2) lie in it."""
        p = mapped(np.linalg.inv(self.to_px), xy)
        within, near = np.full(p.shape[:-1], len(self.core) > 2), np.full(p.shape[:-1], np.inf)
        for start, end in zip(self.core, np.roll(self.core, -1, axis=0), strict=True):
            along, rel = end - start, p - start
            t = np.clip(rel @ along / max(along @ along, 1e-12), 0, 1)
            near = np.minimum(near, ((rel - t[..., None] * along) ** 2).sum(axis=-1))
            within &= along[0] * rel[..., 1] - along[1] * rel[..., 0] > 0
        return np.asarray(within | (near < self.radius**2))

    def edge(self, per_side=60, per_arc=30) -> FloatArray:
        """Points (N, 2) of the photo exactly on it: on its straight parts and on its arcs."""
        if len(self.core) == 1:
            return mapped(self.to_px, self.core[0] + self.radius * around(4 * per_arc))
        along = np.roll(self.core, -1, axis=0) - self.core
        out = np.stack([along[:, 1], -along[:, 0]], axis=1) / np.linalg.norm(along, axis=1)[:, None]
        t = ((np.arange(per_side) + 0.5) / per_side)[:, None]
        parts = [c + self.radius * o + t * a for c, o, a in zip(self.core, out, along, strict=True)]
        angles = np.arctan2(out[:, 1], out[:, 0])
        for k, corner in enumerate(self.core if self.radius else ()):
            turn = (angles[k] - angles[k - 1]) % (2 * np.pi)
            place = angles[k - 1] + turn * (np.arange(per_arc) + 0.5) / per_arc
            parts.append(corner + self.radius * np.stack([np.cos(place), np.sin(place)], axis=1))
        return mapped(self.to_px, np.concatenate(parts))

    @property
    def corners_px(self) -> FloatArray:
        """Of a quad (4, 2), as if they were sharp; in the order of `Outline`."""
        return mapped(self.to_px, self.corners)

    @property
    def ellipse_px(self) -> Ellipse:
        """Of a circle: its conic through the homography."""
        inverse = np.linalg.inv(self.to_px)
        x, y = self.core[0]
        circle = np.array([[1, 0, -x], [0, 1, -y], [-x, -y, x * x + y * y - self.radius**2]])
        conic = inverse.T @ circle @ inverse
        center = -np.linalg.solve(conic[:2, :2], conic[:2, 2])
        level = -(conic[2, 2] + conic[2, :2] @ center)
        return Ellipse.from_shape_matrix(center, np.linalg.inv(conic[:2, :2] / level))

    def grown(self, by: float) -> Form:
        """The same form, larger by this much on every side (with rounder corners)."""
        return Form(self.core, self.radius + by, self.to_px)

    def shifted(self, dx: float, dy: float) -> Form:
        """The same form elsewhere in the photo."""
        move = np.array([[1, 0, dx], [0, 1, dy], [0, 0, 1.0]])
        return Form(self.core, self.radius, move @ self.to_px, self.corners)


def around(count: int, phase=0.5) -> FloatArray:
    """Directions (count, 2) all around, clockwise as seen."""
    t = (np.arange(count) + phase) * (2 * np.pi / count)
    return np.stack([np.cos(t), np.sin(t)], axis=1)


SQUARE = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1.0]])


def quad(to_px, at=(0.0, 0.0), side=30.0, radius=0.0, ratio=1.0) -> Form:
    """A rectangle `side` wide and `ratio` times as high; the corners' radius in sides."""
    half = np.array([side, side * ratio]) / 2
    core = SQUARE * (half - radius * side) + at
    return Form(core, radius * side, to_px, SQUARE * half + at)


def circle(to_px, at=(0.0, 0.0), side=30.0) -> Form:
    return Form(np.array([at], float), side / 2, to_px)


def pill(to_px, at=(0.0, 0.0), side=30.0, ratio=2.0) -> Form:
    """`side` high and `ratio` times as long."""
    return Form(np.array([[-1, 0], [1, 0]]) * (ratio - 1) * side / 2 + at, side / 2, to_px)


def polygon(corners: int, turn=0.5) -> Callable[..., Form]:
    """A regular polygon `side` in diameter."""

    def made(to_px, at=(0.0, 0.0), side=30.0) -> Form:
        return Form(around(corners, turn) * side / 2 + at, 0.0, to_px)

    return made


triangle, octagon = polygon(3, 0.25), polygon(8)
