"""Corners the paper's way (Section III.B): closing, edge, Hough transform, four lines."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fronto.outlines.edges import closed_mask
from fronto.outlines.fits import intersections
from fronto.segments import Segment
from fronto.shapes import FloatArray

__all__ = ["hough_corners"]

#: The accumulator's cells: pixels and radians.
RHO, THETA = 1.0, np.pi / 180
#: A line needs this many votes, as a share of the mask's shorter side; and at least.
VOTES, LEAST_VOTES = 0.2, 3
#: The most lines looked at: those with the most votes.
MOST_LINES = 400
#: Lines of a pair differ by less than this angle, radians, and are this far apart in sizes;
#: the two pairs differ by more.
PARALLEL, APART, CROSSING = np.radians(25), 0.35, np.radians(40)


def hough_corners(segment: Segment) -> FloatArray | None:
    """The four corners of a mask.

    The accumulator's strongest line, the strongest one that runs beside it, and the
    strongest pair that crosses these two; the corners are where they meet.

    Parameters
    ----------
    segment
        The button's mask.

    Returns
    -------
    Shape (4, 2), the photo's pixels, clockwise as seen; None where no four lines are found.
    """
    mask = closed_mask(segment.probability > 0.5)
    lines = _lines(mask)
    if lines is None:
        return None
    rows, columns = np.nonzero(mask)
    center = np.array([columns.mean(), rows.mean()])
    four = _two_pairs(lines, center, float(np.sqrt(len(rows))))
    if four is None:
        return None
    # Edge pixels lie half a pixel inside the edge.
    four[:, 2] += 0.5
    corners = intersections(four[None])[0] + segment.origin_px
    return corners if np.isfinite(corners).all() else None


def _lines(mask: npt.NDArray[np.uint8]) -> FloatArray | None:
    """Unit normals and offsets (k, 3) of the lines through the mask's edge, strongest first."""
    import cv2

    framed = cv2.copyMakeBorder(mask, 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=(0,))
    edge = framed - cv2.erode(framed, np.ones((3, 3), np.uint8))
    box = cv2.boundingRect(framed)
    votes = max(LEAST_VOTES, int(VOTES * min(box[2:])))
    found = cv2.HoughLines(edge[1:-1, 1:-1] * 255, RHO, THETA, votes)
    if found is None:
        return None
    rho, theta = np.asarray(found, np.float64).reshape(-1, 2)[:MOST_LINES].T
    return np.stack([np.cos(theta), np.sin(theta), rho], axis=1)


def _two_pairs(lines: FloatArray, center: FloatArray, size: float) -> FloatArray | None:
    """Four lines (4, 3) around the centre, clockwise as seen, normals outwards."""
    # Seen from the centre: outwards, at a distance.
    distance = lines[:, 2] - lines[:, :2] @ center
    outwards = np.where(distance < 0, -1.0, 1.0)[:, None]
    lines, distance = lines * outwards, np.abs(distance)
    angle = np.arctan2(lines[:, 1], lines[:, 0])
    first = _pair(angle, distance, 0, size)
    if first is None:
        return None
    turn = _between(angle, angle[0])
    for k in np.flatnonzero((turn > CROSSING) & (turn < np.pi - CROSSING)):
        second = _pair(angle, distance, int(k), size)
        if second is not None:
            four = lines[[*first, *second]]
            return np.asarray(four[np.argsort(np.arctan2(four[:, 1], four[:, 0]))])
    return None


def _pair(angle: FloatArray, distance: FloatArray, k: int, size: float) -> tuple[int, int] | None:
    """A line and the strongest one on the other side of the centre."""
    opposite = _between(angle, angle[k]) > np.pi - PARALLEL
    opposite &= distance + distance[k] > APART * size
    return (k, int(np.argmax(opposite))) if opposite.any() else None


def _between(angle: FloatArray, other: FloatArray) -> FloatArray:
    """Angle between directions, 0 to pi."""
    return np.asarray(np.abs((angle - other + np.pi) % (2 * np.pi) - np.pi))
