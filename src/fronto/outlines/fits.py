"""Quads and ellipses through edge points.

The ctypes side of ``native/outline_fit.c`` and ``native/outline_ellipse.c``.
"""

from __future__ import annotations

import ctypes
import functools
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from fronto.native import address, library
from fronto.outlines.edges import EdgePoints
from fronto.shapes import FloatArray

__all__ = [
    "BEFORE",
    "NEXT",
    "Ellipses",
    "Moved",
    "Quads",
    "ellipse_frames",
    "fit_ellipses",
    "fit_quads",
    "intersections",
    "move_sides",
]


#: Of a quad's four corners or sides: the one after each, and the one before.
NEXT, BEFORE = np.array([1, 2, 3, 0]), np.array([3, 0, 1, 2])
#: Of `move_sides`.
MOST_STATIONS = 64


class Quads(NamedTuple):
    """A quad for each of n masks; the side k runs from corner k to the next one.

    Parameters
    ----------
    corners
        (n, 4, 2) pixels, clockwise as seen; NaN where there is no quad.
    lines
        (n, 4, 3): each side's unit normal, pointing outwards, and offset: n · x = offset.
    covered
        (n, 4): share of the side's central part along which it has edge points, 0 to 1.
    rms
        (n, 4): of their distances from the line, pixels; NaN: the side has no line of its own.
    number
        (n, 4): of those edge points.
    """

    corners: FloatArray
    lines: FloatArray
    covered: FloatArray
    rms: FloatArray
    number: FloatArray


class Ellipses(NamedTuple):
    """An ellipse {p : (p - c)ᵀ M (p - c) = 1} for each of n groups of points.

    Parameters
    ----------
    shape
        (n, 5): centre x, y and m11, m12, m22; NaN where there is none.
    rms
        (n,): of the points' distances, pixels.
    inverse
        (n, 5, 5): inverse of the normal matrix; times the points' variance it is the
        covariance of `shape`.
    """

    shape: FloatArray
    rms: FloatArray
    inverse: FloatArray


class Moved(NamedTuple):
    """Sides of n quads, moved to what was found at their stations.

    Parameters
    ----------
    lines
        (n, 4, 3): as in `Quads`.
    spread
        (n, 4): RMS of the stations' distances, pixels; infinity without stations.
    seen
        (n, 4): share of the stations that the side passes.
    near, turned
        (n, 4): how far it is from the mask's at the middle of that, pixels and radians.
    """

    lines: FloatArray
    spread: FloatArray
    seen: FloatArray
    near: FloatArray
    turned: FloatArray


@functools.cache
def _kernels() -> tuple[Any, Any, Any]:
    kernels = library()
    pointer = ctypes.c_void_p
    quads, ellipses = kernels.fronto_fit_quads, kernels.fronto_fit_ellipses
    quads.argtypes = [ctypes.c_int64, ctypes.c_double, *[pointer] * 11]
    quads.restype = ctypes.c_int
    ellipses.argtypes = [ctypes.c_int64, ctypes.c_double, *[pointer] * 7]
    ellipses.restype = ctypes.c_int
    sides = kernels.fronto_move_sides
    sides.argtypes, sides.restype = [ctypes.c_int64] * 2 + [pointer] * 9, None
    return quads, ellipses, sides


def fit_quads(
    points: EdgePoints,
    central: FloatArray,
    start: FloatArray | None = None,
    *,
    every: npt.NDArray[np.int64] | None = None,
    still_px: float = 1e-3,
) -> Quads:
    """Fit a quad to the edge points of each mask, each side by its own line.

    Parameters
    ----------
    points
        Of n masks' edges. Those on the photo's border help to find a start only.
    central
        (n,): share of each side, around its middle, whose points count: corners are rounded.
    start
        (n, 4, 2), clockwise as seen; None finds it: whitened points of a parallelogram lie on
        a square, and where its corners are is told by the fourth harmonic of its outline.
    every
        (n,): of each mask's points every so manieth is looked at; None: all are.
    still_px
        Corners that move by less from one step to the next are good enough, pixels.
    """
    n = len(points.size)
    corners = np.full((n, 4, 2), np.nan) if start is None else np.array(start, np.float64)
    lines, covered = np.empty((n, 4, 3)), np.empty((n, 4))
    rms, number = np.empty((n, 4)), np.empty((n, 4))
    given = (
        (points.first, np.int64),
        (np.ascontiguousarray(points.xy), np.float64),
        (points.border, np.bool_),
        (np.ones(n, np.int64) if every is None else every, np.int64),
        (np.ascontiguousarray(points.size), np.float64),
        (np.ascontiguousarray(central, np.float64), np.float64),
    )
    results = (corners, lines, covered, rms, number)
    done = _kernels()[0](
        n,
        still_px,
        *(address(a, t) for a, t in given),
        *(address(a, np.float64) for a in results),
    )
    if not done:
        raise MemoryError
    return Quads(*results)


def fit_ellipses(
    xy: FloatArray,
    first: npt.NDArray[np.int64],
    start: FloatArray | None = None,
    *,
    border: npt.NDArray[np.bool_] | None = None,
    every: npt.NDArray[np.int64] | None = None,
    still: float = 1e-4,
) -> Ellipses:
    """Fit an ellipse to each of n groups of points, for the least geometric distances.

    Gauss-Newton on Sampson's distance (CGIP 18, 1982), robust against points that belong to
    something else; nothing divides by the misfit, so that perfect points are no special case.

    Parameters
    ----------
    xy, first
        (N, 2) points; those of group k are ``xy[first[k] : first[k + 1]]``.
    start
        (n, 5) as in `Ellipses`; None: from the points' second moments, which needs points
        all around.
    border
        (N,): points that do not count; None: all do.
    every
        (n,): of each group's points every so manieth is looked at; None: all are.
    still
        Ellipses that move by less from one step to the next, in pixels and as a share of their
        shape, are good enough.
    """
    n = len(first) - 1
    border = np.zeros(len(xy), bool) if border is None else border
    every = np.ones(n, np.int64) if every is None else every
    shape = np.full((n, 5), np.nan) if start is None else np.array(start, np.float64)
    rms, inverse = np.empty(n), np.empty((n, 5, 5))
    xy = np.ascontiguousarray(xy, np.float64)
    done = _kernels()[1](
        n,
        still,
        address(first, np.int64),
        address(xy, np.float64),
        address(border, np.bool_),
        address(every, np.int64),
        *(address(a, np.float64) for a in (shape, rms, inverse)),
    )
    if not done:
        raise MemoryError
    return Ellipses(shape, rms, inverse)


def move_sides(lines: FloatArray, offset: FloatArray, t: FloatArray, masks: FloatArray) -> Moved:
    """Move the sides of n quads to where they were found, by robust lines offset = a + b t.

    Parameters
    ----------
    lines, masks
        (n, 4, 3): the sides, and those that the masks have.
    offset
        (n, 4, k): outwards from the stations of each side, pixels; NaN is none. k up to 64.
    t
        (n, k): places of the stations along the sides, from -1/2 at a corner to 1/2 at the next.
    """
    n, _, k = offset.shape
    assert k <= MOST_STATIONS
    moved = Moved(np.empty((n, 4, 3)), *(np.empty((n, 4)) for _ in range(4)))
    given = [np.ascontiguousarray(a, np.float64) for a in (lines, offset, t, masks)]
    _kernels()[2](n, k, *(address(a, np.float64) for a in (*given, *moved)))
    return moved


def ellipse_frames(shape: FloatArray) -> FloatArray:
    """L (n, 2, 2) with {c + L u : |u| = 1} the ellipse, symmetric; NaN where there is none.

    The root of M's inverse, in closed form (by Cayley and Hamilton, for 2 x 2).
    """
    m11, m12, m22 = shape[:, 2:].T
    with np.errstate(all="ignore"):
        det = m11 * m22 - m12 * m12
        root = 1 / np.sqrt(det)
        scale = np.sqrt((m11 + m22) / det + 2 * root)
        inverse = np.stack([m22, -m12, -m12, m11], axis=1) / det[:, None]
        inverse[:, [0, 3]] += root[:, None]
        return np.asarray((inverse / scale[:, None]).reshape(-1, 2, 2))


def intersections(lines: FloatArray) -> FloatArray:
    """Where each side (n, 4, 3) meets the one before it, (n, 4, 2): its first corner."""
    before = lines[:, BEFORE]
    with np.errstate(all="ignore"):
        scale = before[..., 0] * lines[..., 1] - before[..., 1] * lines[..., 0]
        x = (before[..., 2] * lines[..., 1] - before[..., 1] * lines[..., 2]) / scale
        y = (before[..., 0] * lines[..., 2] - before[..., 2] * lines[..., 0]) / scale
    return np.stack([x, y], axis=2)
