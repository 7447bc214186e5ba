"""The panel's rotation from straight segments of a photo alone: two orthogonal vanishing points.

Walls, door frames and panels are full of edges that are horizontal or vertical, and longer than any
button. Hartley and Zisserman, "Multiple View Geometry", 8.6: the vanishing point of parallel lines
is where they meet, and with known intrinsics it tells their direction. Two lines of one direction
and one of another make a rotation; the one that most other segments agree with is the panel's,
where anything near it looks like that.
"""

from __future__ import annotations

import math

import numpy as np

from fronto.camera import Camera
from fronto.shapes import FloatArray

__all__ = ["AGREES", "misses", "rotation_of_lines"]

#: Of how many of the longest segments near either axis rotations are made.
MOST = 8
#: Lines whose planes through the camera are turned by less than this (sine) are one line: they
#: have no vanishing point.
APART = 0.03
#: A segment agrees with a rotation that predicts its direction to this, radians.
AGREES = np.radians(1.0)
#: Panels are looked at rather than glanced along, and upright: cosines.
FACING, UPRIGHT = math.cos(math.radians(65.0)), math.cos(math.radians(45.0))
#: What counts of a long segment, pixels: one edge is one edge.
LONG_PX = 150.0


def rotation_of_lines(ends_px: FloatArray, camera: Camera) -> FloatArray | None:
    """The rotation that the longest segments make and that most agree with.

    Parameters
    ----------
    ends_px
        Shape (n, 2, 2): segments, free of lens distortion.
    camera
        Its intrinsics.

    Returns
    -------
    Shape (3, 3), camera to panel; None where the segments make none.
    """
    length = np.hypot(*(ends_px[:, 1] - ends_px[:, 0]).T)
    order = np.argsort(-length, kind="stable")
    along = np.abs(ends_px[order, 1] - ends_px[order, 0])
    steep = along[:, 1] > along[:, 0]
    flat, upright = order[~steep][:MOST], order[steep][:MOST]
    made = [
        _rotations(_planes(ends_px[two], camera), _planes(ends_px[one], camera), axis)
        for axis, two, one in ((0, flat, upright), (1, upright, flat))
    ]
    rotations = np.concatenate(made)
    if not len(rotations):
        return None
    counts = np.minimum(length, LONG_PX) * (misses(rotations, ends_px, camera) < AGREES).any(axis=1)
    return np.asarray(rotations[int(counts.sum(axis=1).argmax())])


def misses(rotations: FloatArray, ends_px: FloatArray, camera: Camera) -> FloatArray:
    """By which angle segments miss the vanishing points of rotations.

    Parameters
    ----------
    rotations
        Shape (k, 3, 3).
    ends_px
        Shape (n, 2, 2), free of lens distortion.

    Returns
    -------
    Shape (k, 2, n), radians: from the direction towards the horizontals' and the verticals'.
    """
    v = rotations[:, :2] @ camera.matrix.T
    middle, along = ends_px.mean(axis=1), ends_px[:, 1] - ends_px[:, 0]
    x = v[..., :1] - middle[:, 0] * v[..., 2:]
    y = v[..., 1:2] - middle[:, 1] * v[..., 2:]
    cross = x * along[:, 1] - y * along[:, 0]
    dot = x * along[:, 0] + y * along[:, 1]
    return np.asarray(np.arctan2(np.abs(cross), np.abs(dot)))


def _planes(ends_px: FloatArray, camera: Camera) -> FloatArray:
    """Unit normals (n, 3) of the planes through the camera and each segment."""
    rays = np.concatenate([ends_px, np.ones((*ends_px.shape[:2], 1))], axis=2)
    rays = rays @ np.linalg.inv(camera.matrix).T
    normal = np.cross(rays[:, 0], rays[:, 1])
    return np.asarray(normal / np.linalg.norm(normal, axis=1, keepdims=True))


def _rotations(two: FloatArray, one: FloatArray, axis: int) -> FloatArray:
    """Rotations (k, 3, 3) whose `axis` lies in pairs of planes, and the other one in a third."""
    first, second = np.triu_indices(len(two), 1)
    direction = np.cross(two[first], two[second])
    sine = np.linalg.norm(direction, axis=1)
    direction = direction[sine > APART] / sine[sine > APART, None]
    # Of either sign: to the right, and down.
    direction *= np.where(direction[:, axis] < 0, -1.0, 1.0)[:, None]
    direction = direction.repeat(len(one), axis=0)
    other = np.cross(direction, np.tile(one, (len(direction) // max(len(one), 1), 1)))
    sine = np.linalg.norm(other, axis=1)
    good = sine > APART
    direction, other = direction[good], other[good] / sine[good, None]
    other *= np.where(other[:, 1 - axis] < 0, -1.0, 1.0)[:, None]
    right, down = (direction, other) if axis == 0 else (other, direction)
    rotations = np.stack([right, down, np.cross(right, down)], axis=1)
    level = right[:, 0] / np.maximum(np.hypot(right[:, 0], right[:, 1]), 1e-12)
    return np.asarray(rotations[(rotations[:, 2, 2] > FACING) & (level > UPRIGHT)])
