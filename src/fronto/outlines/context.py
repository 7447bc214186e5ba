"""Long straight lines of the panel and around it that run along the buttons' rows and columns.

Plate edges, trims, door frames: whatever is horizontal or vertical on the wall shares the
panel's vanishing points, in whatever plane it lies, and is longer than any button.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from fronto.outlines.straight import END_STD, straight_segments
from fronto.shapes import Axis, FloatArray, LineSegment, Outline

__all__ = ["panel_lines"]

#: A line is at least this long, in buttons and in pixels looked at.
LENGTH, LENGTH_PX = 2.0, 40.0
#: It lies within this many buttons of the field of buttons.
NEAR = 3.0
#: It runs along rows or columns but for this much, degrees, and the field's own deviation.
ALONG_DEG, MOST_DEG = 1.2, 4.0
#: The most lines handed on, the longest.
MOST_LINES = 16
#: How fast directions may turn across the field of buttons, radians per size of the field;
#: and how far from the horizontal a row between two centres may run.
TURN, ROW_DEG = 0.15, 30.0


class _Field(NamedTuple):
    """Direction of the rows or of the columns, as a function of the place."""

    coefficients: FloatArray
    covariance: FloatArray
    center: FloatArray
    size: float

    def at(self, xy: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Angles (n,) and their deviations (n,), radians, at places (n, 2)."""
        rows = np.column_stack([np.ones(len(xy)), (xy - self.center) / self.size])
        variance = np.einsum("ni,ij,nj->n", rows, self.covariance, rows)
        return rows @ self.coefficients, np.sqrt(variance)


def panel_lines(rgb: npt.NDArray[np.uint8], buttons: Sequence[Outline]) -> list[LineSegment]:
    """Find lines that are horizontal or vertical on the wall.

    Parameters
    ----------
    rgb
        The photo, (h, w, 3).
    buttons
        Their outlines there, which tell where rows and columns run.

    Returns
    -------
    At most 16, the longest first; as `found`.
    """
    whole = [b for b in buttons if not b.truncated and not b.odd]
    if len(whole) < 2:
        return []
    boxes = np.array([b.box_px for b in whole])
    size = float(np.median(np.sqrt((boxes[:, 2:] - boxes[:, :2]).prod(axis=1))))
    low, high = boxes[:, :2].min(axis=0) - NEAR * size, boxes[:, 2:].max(axis=0) + NEAR * size
    ends, std_px = straight_segments(rgb, (low, high))
    middle = (ends[:, 0] + ends[:, 1]) / 2
    along = ends[:, 1] - ends[:, 0]
    length = np.hypot(along[:, 0], along[:, 1])
    keep = length >= max(LENGTH * size, LENGTH_PX * std_px / END_STD)
    keep &= ((middle > low) & (middle < high)).all(axis=1)
    ends, middle, along, length = ends[keep], middle[keep], along[keep], length[keep]
    found: list[tuple[float, LineSegment]] = []
    axes: tuple[tuple[Axis, float], ...] = (("horizontal", 0.0), ("vertical", np.pi / 2))
    for axis, turned in axes:
        field = _field(whole, axis)
        if field is None:
            continue
        angle, std = field.at(middle)
        off = np.degrees(np.abs(_wrapped(np.arctan2(along[:, 1], along[:, 0]) - turned - angle)))
        limit = np.minimum(ALONG_DEG + 2 * np.degrees(std), MOST_DEG)
        for k in np.flatnonzero(off <= limit):
            line = LineSegment(axis, ends[k], std_px, found=True)
            found.append((float(length[k]), line))
    found.sort(key=lambda item: -item[0])
    return [line for _, line in found[:MOST_LINES]]


def _field(buttons: Sequence[Outline], axis: Axis) -> _Field | None:
    """Directions of the buttons' sides, and of rows of round ones, as a plane over the photo."""
    places, angles, deviations = _directions(buttons, axis)
    if len(places) < 2:
        return None
    center = places.mean(axis=0)
    size = max(float(np.ptp(places, axis=0).max()), 1.0)
    rows = np.column_stack([np.ones(len(places)), (places - center) / size])
    weight = 1 / deviations**2
    prior = np.diag([0.0, TURN**-2, TURN**-2])
    coefficients = np.zeros(3)
    for _ in range(5):
        normal = (rows * weight[:, None]).T @ rows + prior
        coefficients = np.linalg.solve(normal, (rows * weight[:, None]).T @ angles)
        off = np.abs(angles - rows @ coefficients)
        scale = np.maximum(1.4826 * np.median(off), deviations)
        weight = 1 / deviations**2 / (1 + (off / (2 * scale)) ** 2)
    # What the residuals say about the deviations counts where it is more.
    excess = max(1.0, float(np.average((off / deviations) ** 2, weights=weight)))
    return _Field(coefficients, np.linalg.inv(normal) * excess, center, size)


def _directions(
    buttons: Sequence[Outline], axis: Axis
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Where (n, 2), angle (n,) against the axis, and its deviation (n,), radians."""
    vertical = axis == "vertical"
    places, vectors, std = [], [], []
    for b in buttons:
        if b.corners_px is None:
            continue
        c = b.corners_px
        for start, end in ((0, 3), (1, 2)) if vertical else ((0, 1), (3, 2)):
            places.append((c[start] + c[end]) / 2)
            vectors.append(c[end] - c[start])
            std.append(1.4 * b.std_px)
    round_ones = [b for b in buttons if b.ellipse_px is not None]
    for b in round_ones:
        for other in round_ones:
            v = other.center_px - b.center_px
            off = abs(v[0]) / max(v[1], 1e-9) if vertical else abs(v[1]) / max(v[0], 1e-9)
            near = np.linalg.norm(v) < 8 * b.ellipse_px.a  # type: ignore[union-attr]
            if near and (v[1] if vertical else v[0]) > 0 and off < np.tan(np.radians(ROW_DEG)):
                places.append(b.center_px + v / 2)
                vectors.append(v)
                std.append(1.4 * b.std_px + 0.02 * float(np.linalg.norm(v)))
    if not places:
        return np.zeros((0, 2)), np.zeros(0), np.zeros(0)
    v = np.array(vectors)
    angle = np.arctan2(v[:, 1], v[:, 0]) - (np.pi / 2 if vertical else 0)
    return np.array(places), _wrapped(angle), np.array(std) / np.hypot(v[:, 0], v[:, 1])


def _wrapped(angle: FloatArray) -> FloatArray:
    """Angles of lines, which have no direction: to -90 to 90 degrees."""
    return np.asarray((angle + np.pi / 2) % np.pi - np.pi / 2)
