"""From masks to the points where their edges run, finer than pixels."""

from __future__ import annotations

import ctypes
import functools
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from fronto.native import library
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

    inside = mask.astype(np.uint8)
    shorter = min(cv2.boundingRect(inside)[2:])
    if shorter == 0:
        return inside
    reach = min(int(KERNEL * shorter), MAX_KERNEL) // 2
    if reach:
        # A frame around it: at the array's border the erosion would eat, or the closing stick.
        kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * reach + 1, 2 * reach + 1))
        framed = cv2.copyMakeBorder(
            inside, reach, reach, reach, reach, cv2.BORDER_CONSTANT, value=(0,)
        )
        closed = cv2.morphologyEx(framed, cv2.MORPH_CLOSE, kernel)
        inside = np.ascontiguousarray(closed[reach:-reach, reach:-reach])
    contours, _ = cv2.findContours(inside, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)
    largest = max(range(len(contours)), key=lambda k: cv2.contourArea(contours[k]))
    filled = np.zeros_like(inside)
    cv2.drawContours(filled, contours, largest, (1,), cv2.FILLED)
    return np.asarray(filled)


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
    parts = [_points(segment, width, height) for segment in segments]
    counts = [len(xy) for xy, _, _, _ in parts]
    return EdgePoints(
        np.concatenate([xy for xy, _, _, _ in parts] or [np.zeros((0, 2))]),
        np.concatenate([[0], np.cumsum(counts)]).astype(np.int64),
        np.concatenate([border for _, border, _, _ in parts] or [np.zeros(0, bool)]),
        np.array([size for _, _, size, _ in parts], dtype=np.float64),
        np.array([blur for _, _, _, blur in parts], dtype=np.float64),
    )


def _points(
    segment: Segment, width: int, height: int
) -> tuple[FloatArray, npt.NDArray[np.bool_], float, float]:
    probability = segment.probability
    inside = closed_mask(probability > 0.5)
    area = int(inside.sum())
    if area == 0:
        return np.zeros((0, 2)), np.zeros(0, bool), 0.0, 1.0
    rows, columns = inside.shape
    values = np.ascontiguousarray(probability, np.float32)
    found = np.empty((2 * (rows + 1) * (columns + 1), 3))
    count = _kernel()(rows, columns, inside.ctypes.data, values.ctypes.data, found.ctypes.data)
    xy = found[:count, :2] + segment.origin_px
    # Beyond the photo's outermost pixels nobody knows.
    border = np.asarray(((xy < 0) | (xy > (width - 1, height - 1))).any(axis=1))
    inner = found[:count][~border, 2]
    blur = 1 / max(float(inner.mean()), 0.05) if len(inner) else 1.0
    return xy, border, float(np.sqrt(area)), blur


@functools.cache
def _kernel() -> Any:
    kernel = library().fronto_edge_points
    kernel.argtypes = [ctypes.c_int64] * 2 + [ctypes.c_void_p] * 3
    kernel.restype = ctypes.c_int64
    return kernel
