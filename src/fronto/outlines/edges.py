"""From masks to the points where their edges run, finer than pixels.

The ctypes side of ``native/outline_edges.c``.
"""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from fronto.native import address, library
from fronto.segments import Segment
from fronto.shapes import FloatArray

__all__ = ["EdgePoints", "closed_mask", "edge_points"]

#: Side of the closing's kernel, as a share of the mask's shorter side; and its largest, pixels.
KERNEL, MAX_KERNEL = 0.08, 31


class EdgePoints(NamedTuple):
    """Edge points of n masks, in the photo's pixels, those of one mask together.

    Parameters
    ----------
    xy
        (N, 2).
    first
        (n + 1,): those of mask k are ``xy[first[k] : first[k + 1]]``.
    border
        (N,) whether it lies on the photo's border: the mask ends there, not the button.
    size
        (n,) square root of each mask's area, pixels; 0 for a mask without an area.
    blur
        (n,) pixels over which each mask's probability goes from 0 to 1 at its edge: 1 for a
        mask of 0 and 1, more where a network was not sure where the edge is.
    """

    xy: FloatArray
    first: npt.NDArray[np.int64]
    border: npt.NDArray[np.bool_]
    size: FloatArray
    blur: FloatArray

    @property
    def owner(self) -> npt.NDArray[np.intp]:
        """(N,): the mask that each point belongs to."""
        return np.repeat(np.arange(len(self.size)), np.diff(self.first))


def closed_mask(mask: npt.NDArray[np.bool_]) -> npt.NDArray[np.uint8]:
    """The mask's largest piece after a closing, without holes (paper, Section III.B).

    Parameters
    ----------
    mask
        Shape (h, w).

    Returns
    -------
    Shape (h, w), 0 and 1.
    """
    import cv2

    inside = np.ascontiguousarray(mask, bool).view(np.uint8)
    left, top, width, height = cv2.boundingRect(inside)
    shorter = min(width, height)
    if shorter == 0:
        return inside
    right, bottom = inside.shape[1] - left - width, inside.shape[0] - top - height
    reach = min(int(KERNEL * shorter), MAX_KERNEL) // 2
    if reach and min(left, top, right, bottom) >= 2 * reach:
        inside = np.asarray(cv2.morphologyEx(inside, cv2.MORPH_CLOSE, _kernel_of(reach)), np.uint8)
    elif reach:
        # A frame around it: at the array's border the erosion would eat, or the closing stick.
        framed = cv2.copyMakeBorder(
            inside, reach, reach, reach, reach, cv2.BORDER_CONSTANT, value=(0,)
        )
        closed = cv2.morphologyEx(framed, cv2.MORPH_CLOSE, _kernel_of(reach))
        inside = np.ascontiguousarray(closed[reach:-reach, reach:-reach])
    if _kernels()[0](*inside.shape, address(inside, np.uint8)):
        return inside
    contours, _ = cv2.findContours(inside, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    largest = max(range(len(contours)), key=lambda k: cv2.contourArea(contours[k]))
    filled = np.zeros_like(inside)
    cv2.drawContours(filled, contours, largest, (1,), cv2.FILLED)
    return np.asarray(filled)


@functools.cache
def _kernel_of(reach: int) -> npt.NDArray[np.uint8]:
    import cv2

    side = 2 * reach + 1
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (side, side)), np.uint8)


def edge_points(segments: Sequence[Segment], width: int, height: int) -> EdgePoints:
    """Where the masks' probabilities cross one half, between neighbouring pixels.

    Of masks of 0 and 1 these are the middles of the crack edges, without the half pixel that
    contours through pixel centres lie inside.

    Parameters
    ----------
    segments
        The masks.
    width, height
        The photo's size.
    """
    n = len(segments)
    shapes = np.array([s.probability.shape for s in segments], np.int64).reshape(-1, 2)
    room = int(2 * (shapes + 1).prod(axis=1).sum())
    xy, border, steps = np.empty((room, 2)), np.empty(room, bool), np.zeros((n, 2))
    points_of = _kernels()[1]
    at = (address(xy, np.float64), address(border, np.bool_), address(steps, np.float64))
    first, area = np.zeros(n + 1, np.int64), np.zeros(n)
    count = 0
    for k, segment in enumerate(segments):
        inside = closed_mask(segment.probability > 0.5)
        area[k] = np.count_nonzero(inside)
        if area[k]:
            values = np.ascontiguousarray(segment.probability, np.float32)
            count += points_of(
                *inside.shape,
                address(inside, np.uint8),
                address(values, np.float32),
                *segment.origin_px,
                height,
                width,
                at[0] + count * xy.strides[0],
                at[1] + count * border.strides[0],
                at[2] + k * steps.strides[0],
            )
        first[k + 1] = count
    total, number = steps.T
    blur = np.where(number > 0, 1 / np.maximum(total / np.maximum(number, 1), 0.05), 1.0)
    return EdgePoints(xy[:count].copy(), first, border[:count].copy(), np.sqrt(area), blur)


@functools.cache
def _kernels() -> tuple[Any, Any]:
    whole, points = library().fronto_is_whole, library().fronto_edge_points
    size, pointer = ctypes.c_int64, ctypes.c_void_p
    whole.argtypes, whole.restype = [size, size, pointer], ctypes.c_int
    points.argtypes = [size, size, pointer, pointer, *[size] * 4, *[pointer] * 3]
    points.restype = ctypes.c_int64
    return whole, points
