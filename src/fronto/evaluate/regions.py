"""Where things overlap: boxes by their edges, outlines by the pixels whose centres they hold.

Masks are compared within the rectangles around them, so that a photo of 50 megapixels costs
no more than its buttons do.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fronto.datasets.records import Box
from fronto.shapes import FloatArray

__all__ = ["Overlaps", "Region", "box_overlaps", "clip_box", "polygon_region", "region_overlaps"]

Mask = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Region:
    """A set of pixels.

    Parameters
    ----------
    origin
        x, y of the mask's top-left pixel in the photo.
    mask
        Shape (h, w), either may be 0.
    """

    origin: tuple[int, int]
    mask: Mask

    def cut(self, x0: int, y0: int, x1: int, y1: int) -> Mask:
        """The mask's part in pixels x0 <= x < x1, y0 <= y < y1, all of which it has."""
        x, y = self.origin
        return self.mask[y0 - y : y1 - y, x0 - x : x1 - x]

    def bounds(self) -> tuple[int, int, int, int]:
        """The pixels that the mask covers: x0 <= x < x1, y0 <= y < y1, as x0, y0, x1, y1."""
        x, y = self.origin
        return x, y, x + self.mask.shape[1], y + self.mask.shape[0]


@dataclass(frozen=True, eq=False)
class Overlaps:
    """How n regions overlap m others.

    Parameters
    ----------
    iou
        Shape (n, m): area of the intersection over that of the union.
    share
        Shape (n, m): area of the intersection over that of the first.
    """

    iou: FloatArray
    share: FloatArray


def clip_box(box: Box, width: int, height: int) -> Box | None:
    """The part of a box that lies in a photo of this size; None if there is none."""
    x0, y0 = max(box[0], -0.5), max(box[1], -0.5)
    x1, y1 = min(box[2], width - 0.5), min(box[3], height - 0.5)
    return (x0, y0, x1, y1) if x0 < x1 and y0 < y1 else None


def polygon_region(polygon: npt.ArrayLike, width: int, height: int) -> Region:
    """The pixels of a photo whose centres lie in a polygon (even-odd rule).

    Of centres on the polygon itself those on its left and upper sides count, so that two
    buttons which share a side share no pixel. (OpenCV's fillPoly takes every pixel that the
    outline touches, which makes a button of 12 pixels one of 13.)

    Parameters
    ----------
    polygon
        Shape (n, 2), n >= 3, pixels; it may reach beyond the photo.
    width, height
        Of the photo.
    """
    points = np.asarray(polygon, dtype=np.float64)
    limits = (width, height)
    x0, y0 = (int(v) for v in np.clip(np.ceil(points.min(axis=0)), 0, limits))
    x1, y1 = (int(v) for v in np.clip(np.floor(points.max(axis=0)) + 1, (x0, y0), limits))
    # Where each side crosses each row, the pixels from there to the right change sides.
    y = np.arange(y0, y1)[:, None]
    ends = np.roll(points, -1, axis=0)
    crossed = (points[:, 1] > y) != (ends[:, 1] > y)
    row, side = np.nonzero(crossed)
    (ax, ay), (bx, by) = points[side].T, ends[side].T
    crossing = ax + (row + y0 - ay) * (bx - ax) / (by - ay)
    column = np.clip(np.ceil(crossing), x0, x1).astype(np.intp) - x0
    changes = np.zeros((y1 - y0, x1 - x0 + 1), np.int32)
    np.add.at(changes, (row, column), 1)
    return Region((x0, y0), np.cumsum(changes, axis=1)[:, :-1] % 2 == 1)


def box_overlaps(first: Sequence[Box], second: Sequence[Box]) -> Overlaps:
    """Overlaps of boxes."""
    a = np.array(first, dtype=np.float64).reshape(-1, 1, 4)
    b = np.array(second, dtype=np.float64).reshape(1, -1, 4)
    sides = np.minimum(a[..., 2:], b[..., 2:]) - np.maximum(a[..., :2], b[..., :2])
    common = np.prod(np.maximum(sides, 0), axis=2)
    areas = [np.prod(np.maximum(box[..., 2:] - box[..., :2], 0), axis=2) for box in (a, b)]
    return _overlaps(common, *areas)


def region_overlaps(first: Sequence[Region], second: Sequence[Region]) -> Overlaps:
    """Overlaps of sets of pixels."""
    common = np.zeros((len(first), len(second)))
    for i, a in enumerate(first):
        for j, b in enumerate(second):
            ax0, ay0, ax1, ay1 = a.bounds()
            bx0, by0, bx1, by1 = b.bounds()
            x0, y0, x1, y1 = max(ax0, bx0), max(ay0, by0), min(ax1, bx1), min(ay1, by1)
            if x0 < x1 and y0 < y1:
                common[i, j] = np.count_nonzero(a.cut(x0, y0, x1, y1) & b.cut(x0, y0, x1, y1))
    areas = [
        np.array([np.count_nonzero(region.mask) for region in regions], dtype=np.float64)
        for regions in (first, second)
    ]
    return _overlaps(common, areas[0][:, None], areas[1][None, :])


def _overlaps(common: FloatArray, first: FloatArray, second: FloatArray) -> Overlaps:
    # What has no area overlaps nothing.
    tiny = np.finfo(np.float64).tiny
    union = np.maximum(first + second - common, tiny)
    return Overlaps(common / union, common / np.maximum(first, tiny))
