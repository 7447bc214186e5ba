"""Which straight segments of a photo run along the panel's axes, given a first pose.

Plate edges, trims, door frames: whatever is horizontal or vertical on the wall shares the
panel's vanishing points, in whatever plane it lies, and is longer than any button. A pose from
the buttons tells, with its deviation, which segments those can be; they make it exact; and so on.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from fronto.pose.checks import boxes_px
from fronto.pose.rotation import angle_between, rotation_exp
from fronto.pose.vanishing import AGREES, misses, rotation_of_lines
from fronto.results import PanelPose
from fronto.shapes import Axis, FloatArray, LineSegment, Outline

__all__ = ["agreeing_lines", "axis_direction", "with_frame", "with_lines", "wrapped"]

#: A segment may miss the predicted direction by this much, and by so many of the prediction's
#: own deviations, but never by more than the last.
OFF_RAD, OFF_STD, MOST_RAD = np.radians(1.0), 3.0, np.radians(8.0)
#: A segment is at least this long; one that may be a button's own side is also this much
#: longer than the buttons. Others lie outside of the buttons' boxes, grown by this share.
LENGTH_PX, LENGTH, GROWN = 40.0, 2.0, 0.2
#: Real trims and frames are this far from parallel to the buttons' rows and columns, radians.
SLANT = 0.003
#: The most segments used, the longest.
MOST_LINES = 40
#: Poses and lines are found in turns, at most so often.
ROUNDS = 3
#: Some of any segments agree with any pose, and turn it to agree with them even better. So it
#: takes more of them than chance would give with this probability ...
CHANCE = 0.05
#: ... and of the pose that they have made this share, or more than chance would give with this
#: probability besides the three that any rotation can be turned to.
SHARE, LAST_CHANCE, FREE = 0.4, 0.001, 3
#: What a rotation is taken for that the buttons alone do not determine (deviation).
UNSURE_RAD = np.radians(10.0)
#: A rotation that lines alone make is believed where more of them agree with it than chance would
#: give with this probability, at least so many of either axis (more where there is one button
#: only), and this share of their length.
FRAME_CHANCE, FRAME_LINES, FRAME_SHARE = 1e-4, 2, 0.6
#: It is another one than the buttons' beyond so many degrees and so many of their deviations, and
#: the same as the one that both make up to so many degrees.
FRAME_APART_DEG, FRAME_STD, FRAME_SAME_DEG = 3.0, 3.0, 3.0
#: What the rotation of lines is taken for (deviation).
FRAME_RAD = np.radians(0.5)
#: Step of numerical derivatives, radians.
STEP = 1e-4
AXES: tuple[Axis, Axis] = ("horizontal", "vertical")


def with_lines(
    pose: PanelPose,
    outlines: Sequence[Outline],
    ends_px: FloatArray,
    std_px: float,
    solve: Callable[[list[LineSegment]], PanelPose],
) -> PanelPose:
    """Solve again with the segments that agree with the pose, until they stay the same.

    Parameters
    ----------
    pose
        From the buttons alone.
    outlines
        The buttons.
    ends_px
        Shape (n, 2, 2): the photo's straight segments.
    std_px
        Standard deviation of their ends across.
    solve
        Gives the pose of the buttons and these lines.

    Returns
    -------
    The last pose that is "ok" or "uncertain"; `pose` itself where there is none, or where no
    more segments agree with it than would of those that run anyhow.
    """
    alone, chosen = pose, set[bytes]()
    if _chance(_compared(pose, outlines, ends_px)) > CHANCE:
        return alone
    for _ in range(ROUNDS):
        lines = agreeing_lines(pose, outlines, ends_px, std_px)
        found = {line.ends_px.tobytes() for line in lines}
        if not lines or found == chosen:
            break
        chosen = found
        solved = solve(lines)
        if solved.status not in ("ok", "uncertain"):
            break
        pose = solved
    compared = _compared(pose, outlines, ends_px)
    agree = compared.off < compared.limit
    trusted = agree.any(axis=0).mean() >= SHARE or _chance(compared, FREE) < LAST_CHANCE
    return pose if trusted else alone


def with_frame(
    pose: PanelPose,
    outlines: Sequence[Outline],
    ends_px: FloatArray,
    std_px: float,
    solve: Callable[[list[LineSegment]], PanelPose],
) -> PanelPose:
    """Solve again with the rotation that the segments tell by themselves.

    Outlines that a blurred photo draws out all alike tell a wrong rotation, one button tells
    none, and no line agrees with either. Where many segments make a rotation of their own, the
    buttons are asked whether they can be seen from there.

    Parameters
    ----------
    pose
        Of `with_lines`.
    outlines, ends_px, std_px, solve
        As of `with_lines`.

    Returns
    -------
    The pose with the lines of that rotation where it is "ok"; `pose` itself where it is not, where
    it is sure and not far from that rotation, or costs less without those lines.
    """
    frame = _frame(pose, outlines, ends_px)
    if frame is None:
        return pose
    if pose.status == "ok":
        std = math.degrees(math.sqrt(float(np.linalg.eigvalsh(pose.covariance)[-1])))
        apart = math.degrees(angle_between(pose.rotation, frame))
        if apart <= FRAME_APART_DEG + FRAME_STD * std:
            return pose
    near = replace(pose, status="ok", rotation=frame, covariance=FRAME_RAD**2 * np.eye(3))
    lines = agreeing_lines(near, outlines, ends_px, std_px)
    found = solve(lines)
    if found.status != "ok":
        return pose
    if math.degrees(angle_between(found.rotation, frame)) > FRAME_SAME_DEG:
        return pose
    if pose.status == "ok" and not _cost(found) <= _cost(pose):
        return pose
    return found


def _cost(pose: PanelPose) -> float:
    return math.inf if pose.cost is None else pose.cost


def _frame(pose: PanelPose, outlines: Sequence[Outline], ends_px: FloatArray) -> FloatArray | None:
    """The rotation of the segments alone, where they make one that can be believed."""
    if not len(ends_px) or not outlines or pose.camera.focal_std > 0:
        return None
    ends = ends_px[_apart(ends_px, outlines)]
    ends = ends[_in_model(pose, ends)]
    straight = pose.camera.undistort_points(ends.reshape(-1, 2)).reshape(-1, 2, 2)
    rotation = rotation_of_lines(straight, pose.camera)
    if rotation is None:
        return None
    agree = misses(rotation[None], straight, pose.camera)[0] < AGREES
    either = agree.any(axis=0)
    length = np.hypot(*(straight[:, 1] - straight[:, 0]).T)
    enough = agree.sum(axis=1).min() >= FRAME_LINES + (len(outlines) == 1)
    if not enough or length[either].sum() < FRAME_SHARE * length.sum():
        return None
    by_chance = _more(int(either.sum()) - FREE, 4 * AGREES / np.pi * len(straight))
    return rotation if by_chance < FRAME_CHANCE else None


def agreeing_lines(
    pose: PanelPose, outlines: Sequence[Outline], ends_px: FloatArray, std_px: float
) -> list[LineSegment]:
    """Choose the segments that run along the panel's rows or columns, the longest first.

    Parameters
    ----------
    pose
        The rotation may be a rough one ("degenerate").
    outlines
        The buttons; segments on them are their own sides or labels.
    ends_px
        Shape (n, 2, 2).
    std_px
        Standard deviation of their ends across, where they are exactly parallel.
    """
    ends, off, limit = _compared(pose, outlines, ends_px)
    axis = off.argmin(axis=0)
    every = np.arange(len(ends))
    length = np.hypot(*(ends[:, 1] - ends[:, 0]).T)
    good = np.flatnonzero(off[axis, every] < limit[axis, every])
    good = good[np.argsort(-length[good], kind="stable")][:MOST_LINES]
    return [
        LineSegment(AXES[axis[i]], ends[i], float(np.hypot(std_px, SLANT * length[i])))
        for i in good
    ]


class _Compared(NamedTuple):
    """Segments (m, 2, 2) that may be lines; how far off both axes they are, and may be, (2, m)."""

    ends: FloatArray
    off: FloatArray
    limit: FloatArray


def _compared(pose: PanelPose, outlines: Sequence[Outline], ends_px: FloatArray) -> _Compared:
    if not len(ends_px) or not outlines:
        return _Compared(np.zeros((0, 2, 2)), np.zeros((2, 0)), np.zeros((2, 0)))
    ends = ends_px[_apart(ends_px, outlines)]
    ends = ends[_in_model(pose, ends)]
    straight = pose.camera.undistort_points(ends.reshape(-1, 2)).reshape(-1, 2, 2)
    middle, along = straight.mean(axis=1), straight[:, 1] - straight[:, 0]
    off = np.empty((2, len(ends)))
    limit = np.empty((2, len(ends)))
    for k in range(2):
        predicted, deviation = _predicted(pose, middle, k)
        off[k] = np.abs(wrapped(np.arctan2(along[:, 1], along[:, 0]) - predicted))
        limit[k] = np.minimum(OFF_RAD + OFF_STD * deviation, MOST_RAD)
    return _Compared(ends, off, limit)


def _chance(compared: _Compared, free: int = 0) -> float:
    """Probability that so many agree, less the `free` ones, if they ran anyhow (Poisson)."""
    count = int((compared.off < compared.limit).any(axis=0).sum()) - free
    return _more(count, float((2 * compared.limit / np.pi).sum()))


def _more(count: int, expected: float) -> float:
    """Probability of so many or more where this many are expected (Poisson)."""
    fewer = (math.exp(k * math.log(expected) - expected - math.lgamma(k + 1)) for k in range(count))
    return 1.0 - sum(fewer)


def _apart(ends: FloatArray, outlines: Sequence[Outline]) -> FloatArray:
    """Which segments (n,) are long enough, and no button's own."""
    boxes = boxes_px(outlines)
    sides = boxes[:, 2:] - boxes[:, :2]
    length = np.hypot(*(ends[:, 1] - ends[:, 0]).T)
    long = length >= LENGTH * float(np.median(np.sqrt(sides.prod(axis=1))))
    middle = ends.mean(axis=1)[:, None]
    low, high = boxes[:, :2] - GROWN * sides, boxes[:, 2:] + GROWN * sides
    on_button = ((middle > low) & (middle < high)).all(axis=2).any(axis=1)
    return np.asarray((length >= LENGTH_PX) & (long | ~on_button))


def _in_model(pose: PanelPose, ends: FloatArray) -> FloatArray:
    """Which segments (n,) lie where the lens model holds."""
    if not pose.camera.distorted:
        return np.ones(len(ends), dtype=bool)
    straight = pose.camera.undistort_points(ends.reshape(-1, 2))
    return np.asarray(np.isfinite(straight).all(axis=1).reshape(-1, 2).all(axis=1))


def _predicted(pose: PanelPose, middle: FloatArray, axis: int) -> tuple[FloatArray, FloatArray]:
    """Direction (n,) towards the axis' vanishing point at (n, 2), and its deviation, radians."""
    here = axis_direction(pose, pose.rotation, middle, axis)
    turns = [
        wrapped(axis_direction(pose, pose.rotation @ rotation_exp(step), middle, axis) - here)
        for step in STEP * np.eye(3)
    ]
    jacobian = np.stack(turns, axis=1) / STEP
    known = bool(np.isfinite(pose.covariance).all())
    covariance = pose.covariance if known else UNSURE_RAD**2 * np.eye(3)
    variance = np.einsum("ni,ij,nj->n", jacobian, covariance, jacobian)
    return here, np.sqrt(np.maximum(variance, 0.0))


def axis_direction(
    pose: PanelPose, rotation: FloatArray, middle: FloatArray, axis: int
) -> FloatArray:
    """Direction (n,), radians, of the panel's x or y axis (0, 1) where it is seen at (n, 2) pixels.

    Of the pose's camera without its lens distortion, and of another rotation of it.
    """
    # Of a vanishing point v, homogeneous, which may be at infinity.
    v = pose.camera.matrix @ rotation[axis]
    toward = v[:2] - middle * v[2]
    return np.asarray(np.arctan2(toward[:, 1], toward[:, 0]))


def wrapped(angle: FloatArray) -> FloatArray:
    """Angles of lines, which have no direction: to -90 to 90 degrees."""
    return np.asarray((angle + np.pi / 2) % np.pi - np.pi / 2)
