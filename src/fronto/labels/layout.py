"""Where buttons are on the panel: boxes on its plane, and who is whose neighbour."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fronto.results import PanelPose
from fronto.shapes import FloatArray, Outline

__all__ = ["DIRECTIONS", "Grid", "grid_of", "panel_boxes", "straightened"]

#: Columns of `Grid.next_to`, and where they are: x right, y down.
DIRECTIONS = ("left", "right", "above", "below")
#: Steps in these directions.
STEPS = np.array([[-1, 0], [1, 0], [0, -1], [0, 1]])
#: Neighbours of a row are at most this much apart across it, in heights of the lower one (of a
#: column likewise).
ACROSS = 0.4
#: In a photo rows and columns slant: up to this (tangent) they are searched for.
SLANT = 0.5
#: Points that stand for an ellipse on its way to the plane.
ELLIPSE_POINTS = 32


@dataclass(frozen=True, eq=False)
class Grid:
    """Boxes and their neighbours in rows and columns.

    Parameters
    ----------
    centers, sizes
        Shape (n, 2) each: centres x, y and sizes width, height of the boxes, in one unit.
    next_to
        Shape (n, 4): the nearest box to the left, to the right, above and below that is in
        the same row or column and has this one as its nearest in turn; -1 where there is none.
    """

    centers: FloatArray
    sizes: FloatArray
    next_to: npt.NDArray[np.intp]

    def line(self, box: int, direction: int, most: int = 2) -> list[int]:
        """The boxes next to this one in a direction, the nearest first."""
        found: list[int] = []
        while len(found) < most and (box := int(self.next_to[box, direction])) >= 0:
            found.append(box)
        return found

    def gap(self, one: int, other: int) -> float:
        """Distance of the centres of two boxes."""
        (x0, y0), (x1, y1) = self.centers[one], self.centers[other]
        return math.hypot(x1 - x0, y1 - y0)


def panel_boxes(outlines: Sequence[Outline], pose: PanelPose | None) -> FloatArray:
    """Boxes around outlines on the panel's plane, in the photo where there is no pose.

    Parameters
    ----------
    outlines
        Of buttons or plates, in the photo's pixels.
    pose
        Where it is "ok" or "uncertain", the boxes are on the plane z = 1 of its panel frame.

    Returns
    -------
    Shape (n, 4): edges x0, y0, x1, y1; NaN where an outline reaches the panel's horizon, or
    lies where the lens model does not hold.
    """
    if not outlines:
        return np.empty((0, 4))
    if pose is None or pose.status not in ("ok", "uncertain"):
        return np.array([outline.box_px for outline in outlines])
    points = np.stack([_points(outline) for outline in outlines])
    flat = pose.camera.undistort_points(points.reshape(-1, 2))
    rays = np.column_stack([flat, np.ones(len(flat))]) @ np.linalg.inv(pose.camera.matrix).T
    seen = rays @ pose.rotation.T
    with np.errstate(divide="ignore", invalid="ignore"):
        plane = np.where(seen[:, 2:] > 0, seen[:, :2] / seen[:, 2:], np.nan)
    plane = plane.reshape(len(outlines), -1, 2)
    return np.concatenate([plane.min(axis=1), plane.max(axis=1)], axis=1)


def _points(outline: Outline) -> FloatArray:
    """Shape (ELLIPSE_POINTS, 2): points whose box is the outline's, on any plane."""
    if outline.ellipse_px is not None:
        return outline.ellipse_px.points(ELLIPSE_POINTS)
    assert outline.corners_px is not None
    return np.repeat(outline.corners_px, ELLIPSE_POINTS // 4, axis=0)


def grid_of(boxes: FloatArray) -> Grid:
    """Find the rows and columns of boxes.

    Parameters
    ----------
    boxes
        Shape (n, 4): edges x0, y0, x1, y1. Those with NaN have no neighbours.
    """
    centers = (boxes[:, :2] + boxes[:, 2:]) / 2
    sizes = boxes[:, 2:] - boxes[:, :2]
    across = ACROSS * np.minimum(sizes[:, None], sizes[None])
    return Grid(centers, sizes, _mutual(centers, across))


def straightened(boxes: FloatArray) -> FloatArray:
    """Boxes of a photo without pose with their rows turned level and their columns upright.

    Takes out the slant that rows, and that columns, have in common. Sizes stay.

    Parameters
    ----------
    boxes
        Shape (n, 4): edges x0, y0, x1, y1.
    """
    centers = (boxes[:, :2] + boxes[:, 2:]) / 2
    offsets = np.abs(centers[None] - centers[:, None])
    next_to = _mutual(centers, SLANT * offsets[..., ::-1])
    moved = centers.copy()
    for axis, direction in ((0, 1), (1, 3)):
        one = np.flatnonzero(next_to[:, direction] >= 0)
        if not len(one):
            continue
        steps = centers[next_to[one, direction]] - centers[one]
        slant = float(np.median(steps[:, 1 - axis] / steps[:, axis]))
        moved[:, 1 - axis] -= slant * centers[:, axis]
    shift = moved - centers
    return np.asarray(boxes + np.concatenate([shift, shift], axis=1))


def _mutual(centers: FloatArray, across: FloatArray) -> npt.NDArray[np.intp]:
    """Neighbours (n, 4), of which each has the other.

    `across` (n, n, 2) is how far off a column (x) and off a row (y) they may be.
    """
    n = len(centers)
    next_to = np.full((n, 4), -1, dtype=np.intp)
    if n < 2:
        return next_to
    offset = centers[None] - centers[:, None]  # from the first index to the second
    for d, step in enumerate(STEPS):
        axis = int(step[1] != 0)
        along = offset[..., axis] * step[axis]
        aside = np.abs(offset[..., 1 - axis])
        with np.errstate(invalid="ignore"):
            fits = (along > aside) & (aside <= across[..., 1 - axis])
        distance = np.where(fits, np.hypot(along, aside), np.inf)
        nearest = distance.argmin(axis=1)
        next_to[:, d] = np.where(np.isfinite(distance.min(axis=1)), nearest, -1)
    for d in (0, 2):
        for one, other in ((d, d + 1), (d + 1, d)):
            there = next_to[:, one]
            back = np.where(there >= 0, next_to[there, other], -1)
            next_to[:, one] = np.where(back == np.arange(n), there, -1)
    return next_to
