"""What of the photo lies in front of the panel's horizon, as a polygon."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from fronto.shapes import FloatArray

if TYPE_CHECKING:
    from fronto.camera import Camera

__all__ = ["apply_homography", "clip_half_plane", "photo_outline"]

#: Samples along a side of the photo: the chords between them miss 1/4000 of its bulge.
GRID = 65
#: A lens that bends rays may show more than a plane can hold: at 85 degrees off its axis a
#: fisheye's pixel grows 1/cos² = 130 times as long. Rays beyond this angle widen no canvas.
WIDEST_DEG = 70.0


def clip_half_plane(polygon: npt.ArrayLike, line: npt.ArrayLike) -> FloatArray:
    """Cut a polygon by a half plane (one step of Sutherland and Hodgman, CACM 17, 1974).

    Parameters
    ----------
    polygon
        Shape (n, 2), the vertices in order.
    line
        Shape (3,), (a, b, c): the side a x + b y + c >= 0 is kept.

    Returns
    -------
    Shape (m, 2); m = 0 if nothing is left.
    """
    points = np.asarray(polygon, dtype=np.float64).reshape(-1, 2)
    a, b, c = np.asarray(line, dtype=np.float64)
    height = points @ np.array([a, b]) + c
    kept: list[FloatArray] = []
    for i in range(len(points)):
        here, before = height[i], height[i - 1]
        if (here >= 0) != (before >= 0):
            t = before / (before - here)
            kept.append(points[i - 1] + t * (points[i] - points[i - 1]))
        if here >= 0:
            kept.append(points[i])
    return np.array(kept).reshape(-1, 2)


def photo_outline(camera: Camera) -> FloatArray:
    """Outline the photo in undistorted pixels, shape (n, 2).

    The pixels' outer edges: from -0.5 to width - 0.5. With lens distortion it is the convex
    hull of a grid of points, without those that cannot be undistorted (the corners of a
    fisheye's photo, where a border alone would not close), and those more than `WIDEST_DEG`
    off the axis drawn in to that angle.
    """
    import cv2

    right, bottom = camera.width_px - 0.5, camera.height_px - 0.5
    if not camera.distorted:
        return np.array([[-0.5, -0.5], [right, -0.5], [right, bottom], [-0.5, bottom]])
    x, y = np.linspace(-0.5, right, GRID), np.linspace(-0.5, bottom, GRID)
    rays = camera.rays(np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2))
    rays = rays[np.isfinite(rays).all(axis=1)]
    widest = np.tan(np.radians(WIDEST_DEG))
    radius = np.hypot(rays[:, 0], rays[:, 1])
    rays[:, :2] *= (widest / np.maximum(radius, widest))[:, None]
    points = np.asarray((rays @ camera.matrix.T)[:, :2])
    if len(points) < 3:
        return points
    hull = cv2.convexHull(points.astype(np.float32), returnPoints=False)
    return np.asarray(points[hull.ravel()])


def apply_homography(matrix: FloatArray, points: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    """Map points (n, 2) by a homography; return them (n, 2) and their w (n,).

    Points with w <= 0 (on or behind the horizon) come out as NaN.
    """
    array = np.asarray(points, dtype=np.float64).reshape(-1, 2)
    homogeneous = array @ matrix[:, :2].T + matrix[:, 2]
    w = homogeneous[:, 2]
    safe = np.where(w > 0, w, np.nan)
    return homogeneous[:, :2] / safe[:, None], w
