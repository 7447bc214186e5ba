"""Where the bundle adjustment starts: a few tilts, each with the roll that the edges ask for."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from fronto.pose.bundle import ELLIPSE, FIRST_GROUP, QUAD, Model, Observations, depth_one
from fronto.pose.rotation import rotation_x, rotation_y, rotation_z
from fronto.shapes import FloatArray

__all__ = [
    "initial_parameters",
    "lattice_rolls",
    "measured",
    "middle",
    "reflected",
    "starting_rotations",
    "upright",
]

#: Below this third coordinate a start sees the panel edge-on or from behind.
_FRONT = 0.05


def middle(values: npt.NDArray[Any], axis: int = 0) -> npt.NDArray[Any]:
    """Upper median: `np.median` takes longer on a handful of numbers than a solver step."""
    ordered = np.sort(values, axis=axis)
    return np.asarray(ordered.take(values.shape[axis] // 2, axis=axis))


def starting_rotations(seen: Observations, tilt_deg: float = 30.0) -> FloatArray:
    """Four rotations tilted by `tilt_deg` along the diagonals, rolled upright, (4, 3, 3).

    The roll of each comes from the mean direction of the quads' sides after the tilt; it
    is zero where there are only ellipses. Tilts that would put part of the panel behind
    the camera are halved until none does.
    """
    points = _points(seen)
    angle = np.radians(tilt_deg) / np.sqrt(2)
    for _ in range(6):
        rotations = np.array(
            [rotation_x(a * angle) @ rotation_y(b * angle) for a in (1, -1) for b in (1, -1)]
        )
        if (points @ rotations[:, 2].T).min() > _FRONT:
            break
        angle /= 2
    return upright(seen, rotations)


def _points(seen: Observations) -> FloatArray:
    """Rays (k, 3) of everything that must stay in front of the camera."""
    quads = seen.observed[seen.kind == QUAD, :8].reshape(-1, 2)
    points = quads
    if len(quads) < 4 * len(seen.kind):
        points = np.concatenate([quads, _ellipse_centers(seen)])
    return np.concatenate([points, np.ones((len(points), 1))], axis=1)


def _ellipse_centers(seen: Observations) -> FloatArray:
    tangents = seen.observed[seen.kind == ELLIPSE].reshape(-1, 8, 3)
    # Tangents at opposite anomalies have opposite normals: their mid-line goes through
    # the centre. Two such pairs, a quarter turn apart, give it.
    n0, n1 = tangents[:, 0, :2], tangents[:, 2, :2]
    h = 0.5 * (tangents[:, [0, 2], 2] - tangents[:, [4, 6], 2])
    return np.asarray(np.linalg.solve(np.stack([n0, n1], axis=1), h[:, :, None])[:, :, 0])


def reflected(seen: Observations, rotation: FloatArray) -> FloatArray:
    """The other fold of a pose: its normal mirrored about the ray to the panel's middle, (3, 3).

    Under weak perspective a plane tilted to either side of the viewing ray looks the
    same (Schweighofer & Pinz, "Robust pose estimation from a planar target", 2006), so
    this is where a second optimum is, if there is one.
    """
    points = _points(seen)
    ray = (points / np.linalg.norm(points, axis=1, keepdims=True)).mean(axis=0)
    ray /= np.linalg.norm(ray)
    # Half a turn about the ray mirrors the normal; a half turn within the plane undoes
    # what it does to the roll.
    half_turn = 2 * np.outer(ray, ray) - np.eye(3)
    return np.asarray(upright(seen, (rotation_z(np.pi) @ rotation @ half_turn)[None])[0])


def upright(seen: Observations, rotations: FloatArray) -> FloatArray:
    """Turn rotations (k, 3, 3) within the plane so that the quads' sides are upright.

    Without quads they come back as they are.
    """
    quads = seen.observed[seen.kind == QUAD, :8].reshape(-1, 2)
    if not len(quads):
        return rotations
    plane = _on_plane(quads, rotations)
    a, b, c, d = (plane[:, k::4] for k in range(4))
    across = (b - a + c - d).sum(axis=1)
    down = (d - a + c - b).sum(axis=1)
    # A quarter turn back makes the vertical sides vote for the same direction.
    roll = np.arctan2(across[:, 1] - down[:, 0], across[:, 0] + down[:, 1])
    return np.asarray(np.array([rotation_z(turn) for turn in roll]) @ rotations)


def _on_plane(points: FloatArray, rotations: FloatArray) -> FloatArray:
    """Normalised points (n, 2) on the plane at depth 1 of each rotation, (k, n, 2)."""
    plane = points @ rotations[:, :, :2].transpose(0, 2, 1) + rotations[:, None, :, 2]
    return np.asarray(plane[..., :2] / np.maximum(plane[..., 2:], _FRONT))


def measured(
    seen: Observations, rotations: FloatArray, focal_scale: float = 1.0
) -> tuple[FloatArray, FloatArray]:
    """Back-project each outline by itself with each rotation.

    Parameters
    ----------
    rotations
        (k, 3, 3).
    focal_scale
        True focal length over the one that the observations were normalised with.

    Returns
    -------
    Centres (k, n, 2) on the panel, from the pivot, and logarithms of width and height
    (k, n, 2); of a circle both are the diameter. In units of the pivot's depth.
    """
    count, n = len(rotations), len(seen.kind)
    xy, log_size = np.zeros((count, n, 2)), np.zeros((count, n, 2))
    quads, round_ = seen.kind == QUAD, seen.kind == ELLIPSE
    if quads.any():
        corners = seen.observed[quads, :8].reshape(-1, 2) / focal_scale
        plane = _on_plane(corners, rotations)
        a, b, c, d = (plane[:, k::4] for k in range(4))
        xy[:, quads] = 0.25 * (a + b + c + d)
        across, down = b - a + c - d, d - a + c - b
        log_size[:, quads, 0] = np.log(0.5 * np.hypot(across[..., 0], across[..., 1]) + 1e-9)
        log_size[:, quads, 1] = np.log(0.5 * np.hypot(down[..., 0], down[..., 1]) + 1e-9)
    if round_.any():
        centers = _ellipse_centers(seen) / focal_scale
        tangents = seen.observed[round_].reshape(-1, 8, 3)
        reach = 0.5 * (tangents[:, [0, 2], 2] + tangents[:, [4, 6], 2]) / focal_scale
        plane = centers @ rotations[:, :, :2].transpose(0, 2, 1) + rotations[:, None, :, 2]
        depth = np.maximum(plane[..., 2], _FRONT)
        xy[:, round_] = plane[..., :2] / depth[..., None]
        # Under a pure rotation area scales with 1 / depth³; the diameter with its root.
        diameter = np.log(2 * np.sqrt(reach.prod(axis=1))) - 1.5 * np.log(depth)
        log_size[:, round_] = diameter[..., None]
    for k, rotation in enumerate(rotations):
        offset, distance = depth_one(seen, rotation, focal_scale)
        xy[k] = xy[k] * distance - offset
        log_size[k] += np.log(max(distance, _FRONT))
    return xy, log_size


def initial_parameters(
    seen: Observations, model: Model, rotations: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Starting parameters (k, m) and centres (k, n, 2) for each rotation (k, 3, 3)."""
    xy, log_size = measured(seen, rotations)
    parameters = np.zeros((len(rotations), model.size))
    for group in range(len(model.square_isd)):
        at = FIRST_GROUP + 2 * group
        members = log_size[:, model.group == group]
        parameters[:, at : at + 2] = middle(members, axis=1)
    return parameters, xy


def lattice_rolls(centers: FloatArray, width: float, most: int = 2) -> list[float]:
    """Turns (radians, within ±45°) that would make a lattice of centres upright, best first.

    Every pair of near neighbours votes for the turn that makes it a row or a column; the
    votes of a panel pile up at its rows and columns, but also at the diagonals of a
    staggered one, so several turns are handed on to be tried.

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
        apart = [abs(np.angle(np.exp(4j * (turns[k] - peak)))) / 4 for peak in peaks]
        if all(a > np.radians(12.0) for a in apart):
            near_peak = np.abs(miss[k]) < 2 * spread
            weight = np.exp(-0.5 * (miss[k] / spread) ** 2) * near_peak
            peaks.append(float(turns[k] - (weight * miss[k]).sum() / weight.sum()))
        if len(peaks) == most:
            break
    return peaks
