"""Where the bundle adjustment starts: a few tilts, each with the roll that the edges ask for."""

from __future__ import annotations

import functools
from typing import Any

import numpy as np
import numpy.typing as npt

from fronto.pose.bundle import (
    ELLIPSE,
    FIRST_GROUP,
    FOCAL,
    QUAD,
    Model,
    Observations,
    back_project,
)
from fronto.pose.rotation import rotation_x, rotation_y
from fronto.shapes import FloatArray

__all__ = [
    "initial_parameters",
    "lattice_rolls",
    "middle",
    "reflected",
    "starting_rotations",
]

#: Below this third coordinate a start sees the panel edge-on or from behind.
_FRONT = 0.05


def middle(values: npt.NDArray[Any], axis: int = 0) -> npt.NDArray[Any]:
    """Upper median: `np.median` takes longer on a handful of numbers than a solver step."""
    ordered = np.sort(values, axis=axis)
    return np.asarray(ordered.take(values.shape[axis] // 2, axis=axis))


def starting_rotations(seen: Observations, tilt_deg: float = 30.0) -> FloatArray:
    """Four rotations tilted by `tilt_deg` along the diagonals, (4, 3, 3).

    Tilts that would put part of the panel behind the camera are halved until none does.
    """
    points = _points(seen)
    angle = np.radians(tilt_deg) / np.sqrt(2)
    for _ in range(6):
        rotations = _tilts(angle)
        if (points @ rotations[:, 2].T).min() > _FRONT:
            break
        angle /= 2
    return rotations


@functools.lru_cache(maxsize=32)
def _tilts(angle: float) -> FloatArray:
    """R_x R_y with ± the angle about either axis, (4, 3, 3), read-only."""
    rotations = np.array(
        [rotation_x(a * angle) @ rotation_y(b * angle) for a in (1.0, -1.0) for b in (1.0, -1.0)]
    )
    rotations.setflags(write=False)
    return rotations


def _points(seen: Observations) -> FloatArray:
    """Rays (k, 3) of everything that must stay in front of the camera."""
    quads = seen.observed[seen.kind == QUAD, :8].reshape(-1, 2)
    if len(quads) == 4 * len(seen.kind):
        return np.concatenate([quads, np.ones((len(quads), 1))], axis=1)
    tangents = seen.observed[seen.kind == ELLIPSE].reshape(-1, 8, 3)
    # From the ellipse's centre straight to each tangent. Tangents 0 and 4 are parallel, so
    # are 2 and 6: their mid-lines meet in the centre.
    normal, h = tangents[..., :2], tangents[..., 2:]
    middle_h = 0.5 * (h[:, [0, 2]] - h[:, [4, 6]])
    center = np.linalg.solve(normal[:, [0, 2]], middle_h).transpose(0, 2, 1)
    feet = (center + normal * (h - (normal * center).sum(axis=2, keepdims=True))).reshape(-1, 2)
    points = np.concatenate([quads, feet])
    return np.concatenate([points, np.ones((len(points), 1))], axis=1)


def reflected(seen: Observations, rotation: FloatArray) -> FloatArray:
    """The other fold of a pose: its normal mirrored about the ray to the panel's middle, (3, 3).

    Under weak perspective a plane tilted to either side of the viewing ray looks the
    same (Schweighofer & Pinz, "Robust pose estimation from a planar target", 2006), so
    this is where a second optimum is, if there is one.
    """
    ray = np.array([seen.pivot[0], seen.pivot[1], 1.0])
    ray /= np.sqrt(ray @ ray)
    # Half a turn about the ray mirrors the normal; a half turn within the plane undoes
    # about what it does to the roll.
    half_turn = 2 * ray[:, None] * ray - np.eye(3)
    rotation = rotation @ half_turn
    rotation[:2] *= -1
    return np.asarray(rotation)


def initial_parameters(
    seen: Observations,
    model: Model,
    rotations: FloatArray,
    keep: int = 0,
    focal_scale: float = 1.0,
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Starting rotations (k, 3, 3), parameters (k, m) and centres (k, n, 2).

    Parameters
    ----------
    rotations
        (k, 3, 3); from number `keep` on they are rolled so that the quads' sides are
        upright.
    focal_scale
        Focal length to start from, over the one that the observations were normalised
        with.
    """
    xy, log_size, rotations = back_project(seen, rotations, focal_scale, keep)
    parameters = np.zeros((len(rotations), model.size))
    parameters[:, FOCAL] = np.log(focal_scale)
    for group in range(len(model.square_isd)):
        at = FIRST_GROUP + 2 * group
        members = log_size[:, model.group == group]
        parameters[:, at : at + 2] = middle(members, axis=1)
    return rotations, parameters, xy


def lattice_rolls(centers: FloatArray, width: float, most: int = 2) -> list[float]:
    """Turns (radians, within ±45°) that would make a lattice of centres upright, best first.

    Every pair of near neighbours votes for the turn that makes it a row or a column; the
    votes of a panel pile up at its rows and columns, but also at the diagonals of a
    staggered one, so turns with half as many votes are handed on to be tried as well.

    Parameters
    ----------
    centers
        (n, 2) on the plane.
    width
        Diameter of a button in the same units.
    most
        How many turns at the most; none for a single button.
    """
    n = len(centers)
    if n < 2:
        return []
    first, second = np.triu_indices(n, 1)
    offset = centers[second] - centers[first]
    distance = np.hypot(offset[:, 0], offset[:, 1])
    whole = np.full((n, n), np.inf)
    whole[first, second] = whole[second, first] = distance
    near = distance < 3.0 * np.maximum(*whole.min(axis=1)[[first, second]])
    angle, distance = np.arctan2(offset[near][:, 1], offset[near][:, 0]), distance[near]
    # Before rows and columns are known the plane is a few degrees askew.
    spread = np.hypot(0.1 * width / distance, np.radians(4.0))
    turns = np.radians(np.arange(-45, 45))
    miss = np.angle(np.exp(4j * (turns[:, None] - angle))) / 4
    votes = np.exp(-0.5 * (miss / spread) ** 2).sum(axis=1)
    peaks: list[float] = []
    for k in np.argsort(-votes, kind="stable"):
        if votes[k] < 0.5 * votes.max():
            break
        apart = [abs(np.angle(np.exp(4j * (turns[k] - peak)))) / 4 for peak in peaks]
        near_peak = np.abs(miss[k]) < 2 * spread
        if near_peak.any() and all(a > np.radians(12.0) for a in apart):
            weight = np.exp(-0.5 * (miss[k] / spread) ** 2) * near_peak
            peaks.append(float(turns[k] - (weight * miss[k]).sum() / weight.sum()))
        if len(peaks) == most:
            break
    return peaks
