"""Outlines finer than pixels: from the masks' edges, refined on the photo's own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from fronto.outlines.edgehead import Told
from fronto.outlines.fits import (
    NEXT,
    Ellipses,
    ellipse_frames,
    fit_ellipses,
    intersections,
    move_sides,
)
from fronto.outlines.kinds import Shapes
from fronto.outlines.profiles import Stations, find_edges
from fronto.shapes import FloatArray

__all__ = ["Refined", "refine"]

#: Stations along a side, over this share of it less its rounding; and around an ellipse.
ON_SIDE, MOST_SHARE, ON_ELLIPSE = 20, 0.8, 48
#: An edge must show at this share of the stations, on one line but for this much, pixels.
SEEN, STRAIGHT_PX = 0.5, 0.5
#: And stand out from what is around it; and be more than noise (Student's t).
LEAST_STEP, LEAST_ROUND_STEP, LEAST_SURE = 1.3, 1.5, 8.0
#: How far the mask's edge may be off: in pixels, in blurs of its edge, and in sizes; a
#: deviation. The photo's edge may lie this many of it away; and turned against it, degrees.
OFF_PX, OFF_BLUR, OFF_SHARE, AWAY = 0.3, 0.2, 0.004, 2.5
TURNED_RAD = np.radians(6.0)
#: Drawn masks of smaller quads tell their place and size better than the photo's edges.
SMALL_PX = 40.0
#: Larger quads that an edge head has told: their edges show their form better, this near, pixels.
CLOSE_PX, CLOSE_OFF_PX = 50.0, 0.3
#: Smaller buttons have too few pixels for an edge of their own.
LEAST_SIZE_PX = 6.0


@dataclass(frozen=True, eq=False)
class Refined:
    """Quads and ellipses after a look at the photo.

    Parameters
    ----------
    lines
        (n, 4, 3): the quads' sides.
    line_rms
        (n, 4): deviation of the edge points from them, pixels.
    from_image
        (n, 4): sides taken from the photo; the others are the mask's.
    shape
        (n, 5): the ellipses, as in `Ellipses`.
    ellipse_rms
        (n,): deviation of the edge points from them, pixels.
    ellipse_from_image
        (n,): ellipses taken from the photo.
    std, form_std
        (n,): deviation of the outline and of its form where an edge head has told it, pixels; NaN:
        it follows from the fits.
    """

    lines: FloatArray
    line_rms: FloatArray
    from_image: npt.NDArray[np.bool_]
    shape: FloatArray
    ellipse_rms: FloatArray
    ellipse_from_image: npt.NDArray[np.bool_]
    std: FloatArray
    form_std: FloatArray


def refine(
    image: npt.NDArray[Any] | None,
    shapes: Shapes,
    size: FloatArray,
    blur: FloatArray,
    drawn: npt.NDArray[np.bool_] | None = None,
    told: Told | None = None,
) -> Refined:
    """Move the outlines to the photo's edges where these agree with the masks.

    Small quads that a mask head has drawn take only their form from there: where they are, and
    how large, it knows better (measured, see docs/outlines.md). Outlines that an edge head has told
    are taken as they are; large quads of them are looked at once more, closely.

    Parameters
    ----------
    image
        (h, w, channels) uint8; None: the masks' outlines as they are.
    shapes
        From the masks.
    size
        (n,): square root of each mask's area, pixels.
    blur
        (n,): pixels over which each mask's edge goes from 0 to 1.
    drawn
        (n,): whether a mask head has drawn it; None: no mask.
    told
        What an edge head has told; None: nothing.
    """
    off = OFF_PX + OFF_BLUR * blur + OFF_SHARE * size
    quads, ellipses = shapes.quads, shapes.ellipses
    lines, rms = quads.lines.copy(), quads.rms.copy()
    from_image = np.zeros(rms.shape, bool)
    shape, ellipse_rms = ellipses.shape.copy(), ellipses.rms.copy()
    round_from_image = np.zeros(len(size), bool)
    std, form_std = np.full(len(size), np.nan), np.full(len(size), np.nan)
    open_ = np.ones(len(size), bool)
    if told is not None:
        open_[told.rows] = False
    if image is not None and len(size):
        kinds = np.array(shapes.kind)
        large = open_ & (size >= LEAST_SIZE_PX)
        rows = np.flatnonzero((kinds == "quad") & large)
        if len(rows):
            rows = rows[np.isfinite(intersections(quads.lines[rows])).all(axis=(1, 2))]
        if len(rows):
            found = _sides(image, quads.lines, quads.rms, shapes.radius, size, off, rows, (0, 1))
            lines[rows], rms[rows], from_image[rows] = found
        if drawn is not None:
            small = from_image.all(axis=1) & drawn & (size < SMALL_PX)
            if small.any():
                lines[small] = _in_place(lines[small], quads.lines[small])
        rows = np.flatnonzero((kinds == "ellipse") & large & np.isfinite(shape).all(axis=1))
        if len(rows):
            shape[rows], ellipse_rms[rows], round_from_image[rows] = _ellipses(
                image, ellipses, size, off, rows
            )
    if told is not None:
        lines[told.rows], shape[told.rows] = told.lines, told.shape
        from_image[told.rows], round_from_image[told.rows] = True, True
        std[told.rows], form_std[told.rows] = told.std, told.form_std
        rows = told.rows[size[told.rows] >= CLOSE_PX]
        rows = np.array([k for k in rows if shapes.kind[k] == "quad"], np.intp)
        if image is not None and len(rows):
            off = CLOSE_OFF_PX + OFF_SHARE * size
            found = _sides(image, lines, rms, shapes.radius, size, off, rows, (1,))
            sure = found[2].all(axis=1)
            rows = rows[sure]
            lines[rows], rms[rows], form_std[rows] = found[0][sure], found[1][sure], np.nan
    return Refined(lines, rms, from_image, shape, ellipse_rms, round_from_image, std, form_std)


def _sides(
    image: npt.NDArray[Any],
    start: FloatArray,
    start_rms: FloatArray,
    radius: FloatArray,
    size: FloatArray,
    off: FloatArray,
    rows: npt.NDArray[np.intp],
    looks: Sequence[int],
) -> tuple[FloatArray, FloatArray, npt.NDArray[np.bool_]]:
    own = np.isfinite(start_rms[rows])  # sides that are seen
    masks = start[rows]
    lines, rms = masks, start_rms[rows]
    share = np.minimum(MOST_SHARE, 1 - radius[rows])
    straight = np.maximum(STRAIGHT_PX, 0.012 * size[rows])[:, None]
    corners = intersections(masks)
    good = own
    for look in looks:
        stations, t = _side_stations(intersections(lines), share, size[rows], off[rows])
        edges = find_edges(image, stations, look)
        moved = move_sides(lines, edges.offset.reshape(*own.shape, -1), t, masks)
        good = (
            good
            & (moved.seen >= SEEN)
            & (moved.spread <= straight)
            & (edges.step.reshape(own.shape) >= LEAST_STEP)
            & (edges.sure.reshape(own.shape) >= LEAST_SURE)
            & (moved.near <= AWAY * off[rows, None])
            & (moved.turned <= TURNED_RAD)
        )
        # Sides that meet nowhere near are none of one quad.
        lines = np.where(good[..., None], moved.lines, masks)
        far = np.abs(intersections(lines) - corners).max(axis=(1, 2))
        good &= (far <= size[rows])[:, None]
        lines = np.where(good[..., None], moved.lines, masks)
        rms = np.where(good, moved.spread, start_rms[rows])
    return lines, rms, good


def _in_place(lines: FloatArray, masks: FloatArray) -> FloatArray:
    """Quads (n, 4, 3), moved and resized to have the middle and the area of others."""
    ours, theirs = intersections(lines), intersections(masks)
    factor = np.sqrt(_areas(theirs) / _areas(ours))[:, None]
    normal, middle = lines[..., :2], ours.mean(axis=1, keepdims=True)
    away = lines[..., 2] - (normal * middle).sum(axis=2)
    place = (normal * theirs.mean(axis=1, keepdims=True)).sum(axis=2)
    return np.concatenate([normal, (factor * away + place)[..., None]], axis=2)


def _areas(corners: FloatArray) -> FloatArray:
    """Areas (n,) of quads (n, 4, 2)."""
    first, second = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
    return np.asarray(np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / 2)


def _side_stations(
    corners: FloatArray, share: FloatArray, size: FloatArray, off: FloatArray
) -> tuple[Stations, FloatArray]:
    """Stations on all sides; and their places along each, from -1/2 to 1/2, (n, k)."""
    along = corners[:, NEXT] - corners
    length = np.maximum(np.linalg.norm(along, axis=2), 1e-9)
    tangent = along / length[..., None]
    normal = np.stack([tangent[..., 1], -tangent[..., 0]], axis=2)
    t = (np.arange(ON_SIDE) + 0.5) / ON_SIDE - 0.5
    place = t * share[:, None]
    xy = (corners + along / 2)[:, :, None] + place[:, None, :, None] * along[:, :, None]
    n = len(corners)
    normals = np.broadcast_to(normal[:, :, None], xy.shape).reshape(4 * n, ON_SIDE, 2)
    stations = Stations(
        xy.reshape(4 * n, ON_SIDE, 2), normals, np.repeat(size, 4), np.repeat(off, 4), signed=True
    )
    return stations, place


def _ellipses(
    image: npt.NDArray[Any],
    ellipses: Ellipses,
    size: FloatArray,
    off: FloatArray,
    rows: npt.NDArray[np.intp],
) -> tuple[FloatArray, FloatArray, npt.NDArray[np.bool_]]:
    masks = shape = ellipses.shape[rows]
    rms = ellipses.rms[rows]
    good = np.ones(len(rows), bool)
    for look in (0, 1):
        stations = _round_stations(shape, size[rows], off[rows])
        edges = find_edges(image, stations, look)
        seen = np.isfinite(edges.offset)
        points = stations.xy + np.nan_to_num(edges.offset)[..., None] * stations.normal
        first = np.concatenate([[0], np.cumsum(seen.sum(axis=1))]).astype(np.int64)
        fitted = fit_ellipses(points[seen], first, shape)
        near = _apart(fitted.shape, masks)
        good = (
            good
            & (seen.mean(axis=1) >= SEEN)
            & (fitted.rms <= np.maximum(STRAIGHT_PX, 0.012 * size[rows]))
            & (edges.step >= LEAST_ROUND_STEP)
            & (near <= AWAY * off[rows])
        )
        shape = np.where(good[:, None], fitted.shape, masks)
        rms = np.where(good, fitted.rms, ellipses.rms[rows])
    return shape, rms, good


def _round_stations(shape: FloatArray, size: FloatArray, off: FloatArray) -> Stations:
    t = 2 * np.pi * np.arange(ON_ELLIPSE) / ON_ELLIPSE
    unit = np.stack([np.cos(t), np.sin(t)], axis=1)
    frame = ellipse_frames(shape)
    xy = shape[:, None, :2] + unit @ frame.swapaxes(1, 2)
    normal = unit @ np.linalg.inv(frame)  # M (p - c) up to scale
    normal /= np.linalg.norm(normal, axis=2, keepdims=True)
    return Stations(xy, normal, size, off, signed=False)


def _apart(shape: FloatArray, other: FloatArray) -> FloatArray:
    """Largest distance between two ellipses' extents and centres, (n,), pixels."""
    with np.errstate(all="ignore"):
        center = np.abs(shape[:, :2] - other[:, :2]).max(axis=1)
        sizes = []
        for s in (shape, other):
            det = s[:, 2] * s[:, 4] - s[:, 3] ** 2
            sizes.append(np.sqrt(np.stack([s[:, 4] / det, s[:, 2] / det], axis=1)))
        return np.asarray(np.fmax(center, np.abs(sizes[0] - sizes[1]).max(axis=1)))
