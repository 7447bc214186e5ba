"""How far edge points are from shapes: the ctypes side of ``native/outline_shapes.c``."""

from __future__ import annotations

import ctypes
import functools
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from fronto.native import address, library
from fronto.outlines.edges import EdgePoints
from fronto.outlines.fits import NEXT
from fronto.shapes import FloatArray

__all__ = [
    "Thinned",
    "best_radius",
    "ellipse_misfit",
    "from_square",
    "half_sides",
    "pill_misfits",
    "rectangles",
    "thinned",
]

#: Radii of a quad's corners that are tried, in half sides, up to a square with hardly a
#: straight part; pills (whose short sides are half circles) this much longer than wide.
RADII = np.arange(0.0, 0.78, 0.075)
PILL = 1.3
#: Half the length of a pill's round ends that are tried, in half its shorter sides.
CAPS = np.array([0.7, 0.85, 1.0, 1.15, 1.3])
#: Deviations above this, in sizes, say as much as any other.
CAP = 0.12
#: Waves around its ellipse that a polygon's sides make.
WAVES = np.array([3, 5, 6, 7, 8])
#: Edge points of a mask that shapes are compared on.
ENOUGH = 80


class Thinned(NamedTuple):
    """Edge points of n masks, and which of them shapes are compared on.

    Parameters
    ----------
    points
        All of them.
    every
        (n,): each mask's are taken at this distance, about `ENOUGH` of them.
    limit
        (n,): squared distances above this count as it, square pixels.
    """

    points: EdgePoints
    every: npt.NDArray[np.int64]
    limit: FloatArray


def thinned(points: EdgePoints) -> Thinned:
    """Take as many points of each mask as shapes need, evenly."""
    every = np.maximum(np.diff(points.first) // ENOUGH, 1)
    # Points come row by row, the left edge and the right one in turn: an odd step takes both.
    every += 1 - every % 2
    return Thinned(points, every, (CAP * points.size) ** 2)


def best_radius(some: Thinned, corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Radius (n,) of the quads' corners, in half sides, that fits best.

    Parameters
    ----------
    some
        The points.
    corners
        (n, 4, 2): the quads.

    Returns
    -------
    The radii, and the mean square distances with them; infinity without a quad.
    """
    misfit = np.empty((len(corners), len(RADII)))
    corners = np.ascontiguousarray(corners)
    arrays = (corners, RADII, misfit)
    _kernels().fronto_rounded_misfits(*_given(some), *_shapes(arrays))
    misfit[np.isnan(misfit)] = np.inf
    best = misfit.argmin(axis=1)
    return RADII[best], misfit[np.arange(len(best)), best]


def pill_misfits(some: Thinned, corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Mean square distance (n,) from a stadium in the directions of quads (n, 4, 2).

    Infinite where it is not long enough. And the points' extent (n, 4) where the quads' corners
    are (±1, ±1): lowest u and v, highest u and v.
    """
    n = len(corners)
    corners = np.ascontiguousarray(corners)
    misfit, extent, sides = np.empty((n, len(CAPS))), np.empty((n, 4)), np.empty((n, 2))
    arrays = (corners, CAPS, misfit, extent, sides)
    _kernels().fronto_pill_misfits(*_given(some), *_shapes(arrays))
    misfit = np.where(np.isnan(misfit), np.inf, misfit).min(axis=1, initial=np.inf)
    with np.errstate(invalid="ignore"):
        elongated = sides.max(axis=1) >= PILL * sides.min(axis=1)
    return np.where(elongated, misfit, np.inf), extent


def rectangles(corners: FloatArray, extent: FloatArray) -> FloatArray:
    """Rectangles (n, 4, 2) of some extent (n, 4) where the corners of quads (n, 4, 2) are (±1, ±1).

    In the photo, pixels; without a quad they are upright.
    """
    u, v = extent[:, [0, 2, 2, 0]], extent[:, [1, 1, 3, 3]]
    with np.errstate(all="ignore"):
        found = np.stack([u, v, np.ones_like(u)], axis=2) @ from_square(corners).swapaxes(1, 2)
        return np.asarray(found[..., :2] / found[..., 2:])


def ellipse_misfit(some: Thinned, shape: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Mean square distance (n,) from ellipses (n, 5), and the height (n,) of waves around them.

    The highest of `WAVES`, pixels.
    """
    n = len(shape)
    misfit, wave = np.empty(n), np.empty(n)
    shape = np.ascontiguousarray(shape)
    _kernels().fronto_ellipse_misfits(
        *_given(some),
        address(shape, np.float64),
        len(WAVES),
        address(WAVES, np.int64),
        address(misfit, np.float64),
        address(wave, np.float64),
    )
    return misfit, wave


def half_sides(corners: FloatArray) -> FloatArray:
    """Half width and half height (n, 2) of quads, pixels."""
    along = np.linalg.norm(corners[:, NEXT] - corners, axis=2)
    return np.asarray((along[:, :2] + along[:, 2:]) / 4)


def from_square(corners: FloatArray) -> FloatArray:
    """Homographies (n, 3, 3) from (-1, -1), (1, -1), (1, 1), (-1, 1) to quads (n, 4, 2).

    In closed form (Heckbert, "Fundamentals of Texture Mapping", 1989, Section 2.2.3).
    """
    p0, p1, p2, p3 = corners.swapaxes(0, 1)
    d1, d2, s = p1 - p2, p3 - p2, p0 - p1 + p2 - p3
    det = d1[:, 0] * d2[:, 1] - d1[:, 1] * d2[:, 0]
    with np.errstate(all="ignore"):
        g = (s[:, 0] * d2[:, 1] - s[:, 1] * d2[:, 0]) / det
        h = (d1[:, 0] * s[:, 1] - d1[:, 1] * s[:, 0]) / det
    unit = np.empty((len(corners), 3, 3))
    unit[:, :2, 0] = p1 - p0 + g[:, None] * p1
    unit[:, :2, 1] = p3 - p0 + h[:, None] * p3
    unit[:, :2, 2] = p0
    unit[:, 2] = np.stack([g, h, np.ones_like(g)], axis=1)
    unit[~np.isfinite(unit).all(axis=(1, 2))] = np.eye(3)
    return np.asarray(unit @ np.array([[0.5, 0, 0.5], [0, 0.5, 0.5], [0, 0, 1]]))


def _given(some: Thinned) -> tuple[int, ...]:
    """The first six arguments of all kernels; the points keep their arrays alive."""
    points, every, limit = some
    return (
        len(points.size),
        address(points.first, np.int64),
        address(points.xy, np.float64),
        address(points.border, np.bool_),
        address(every, np.int64),
        address(limit, np.float64),
    )


def _shapes(arrays: tuple[FloatArray, ...]) -> tuple[int, ...]:
    """Addresses of quads, of a list (after its length) and of results."""
    quads, tried, *results = (address(a, np.float64) for a in arrays)
    return quads, len(arrays[1]), tried, *results


@functools.cache
def _kernels() -> Any:
    kernels = library()
    size, pointer = ctypes.c_int64, ctypes.c_void_p
    given: list[Any] = [size, *[pointer] * 5]
    for kernel, results in (
        (kernels.fronto_rounded_misfits, 1),
        (kernels.fronto_pill_misfits, 3),
        (kernels.fronto_ellipse_misfits, 2),
    ):
        kernel.argtypes = [*given, pointer, size, pointer, *[pointer] * results]
        kernel.restype = None
    return kernels
