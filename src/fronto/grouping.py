"""From the network's maps to instances: one box, class and mask per button.

Each peak of the centres is an instance, as in Panoptic-DeepLab (Cheng et al., CVPR 2020); its
box and class are those that the cells around its middle tell.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from fronto.shapes import FloatArray

__all__ = ["Instance", "all_overlaps", "distinct", "group", "overlaps"]

#: Least probability of a centre that is looked at: weaker ones are nearly all false.
LEAST_CENTER = 0.30
#: Two peaks whose boxes overlap this much (intersection over union) are one.
SAME = 0.5
#: Most instances of one picture: more than any panel has.
MAX_INSTANCES = 400


@dataclass(frozen=True, eq=False)
class Instance:
    """One button or plate in network pixels.

    Parameters
    ----------
    plate
        Whether it is a plate.
    confidence
        Of the centre, 0 to 1.
    box
        x0, y0, x1, y1, pixel edges.
    scores
        Shape (11,): mean probability of each class over its cells.
    """

    plate: bool
    confidence: float
    box: tuple[float, float, float, float]
    scores: FloatArray


def _peaks(
    centers: npt.NDArray[np.float32], least: float
) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Rows and columns of local maxima of one map (h, w) above the least, highest first."""
    import cv2

    highest = cv2.dilate(centers, np.ones((3, 3), np.uint8))
    rows, columns = np.nonzero((centers >= highest) & (centers > least))
    order = np.argsort(-centers[rows, columns], kind="stable")[:MAX_INSTANCES]
    return rows[order], columns[order]


def _boxes(sides: FloatArray, x: npt.NDArray[Any], y: npt.NDArray[Any]) -> FloatArray:
    """Sides (4, n) around points to boxes (n, 4)."""
    left, top, right, bottom = sides
    return np.stack([x - left, y - top, x + right, y + bottom], axis=1).astype(np.float64)


def overlaps(box: FloatArray, boxes: FloatArray) -> FloatArray:
    """Intersection over union of one box (4,) with several (n, 4): x0, y0, x1, y1 each."""
    low = np.maximum(box[:2], boxes[:, :2])
    high = np.minimum(box[2:], boxes[:, 2:])
    shared = np.clip(high - low, 0, None).prod(axis=1)
    area = (box[2:] - box[:2]).prod()
    areas = (boxes[:, 2:] - boxes[:, :2]).prod(axis=1)
    return np.asarray(shared / np.maximum(area + areas - shared, 1e-9))


def all_overlaps(boxes: FloatArray) -> FloatArray:
    """`overlaps` of each box with all of them, (n, n)."""
    low = np.maximum(boxes[:, None, :2], boxes[None, :, :2])
    high = np.minimum(boxes[:, None, 2:], boxes[None, :, 2:])
    shared = np.clip(high - low, 0, None).prod(axis=-1)
    areas = (boxes[:, 2:] - boxes[:, :2]).prod(axis=1)
    return np.asarray(shared / np.maximum(areas[:, None] + areas - shared, 1e-9))


def distinct(boxes: FloatArray, same: float = SAME) -> list[int]:
    """Which of the boxes (n, 4) to keep: each one that overlaps no earlier one by this much."""
    left = np.ones(len(boxes), dtype=bool)
    kept: list[int] = []
    for k, alike in enumerate(all_overlaps(boxes) >= same):
        if left[k]:
            kept.append(k)
            left &= ~alike
    return kept


def group(
    centers: npt.NDArray[np.float32],
    sides: npt.NDArray[np.float32],
    classes: npt.NDArray[np.float32],
    stride: int,
    *,
    least: float = LEAST_CENTER,
) -> list[Instance]:
    """Find the instances of one picture.

    Parameters
    ----------
    centers, sides, classes
        Shapes (2, h, w), (4, h, w), (11, h, w) as `fronto.train.network.Maps` says, as
        probabilities and pixels.
    stride
        Pixels per cell.
    least
        Probability of a centre that is looked at.

    Returns
    -------
    Buttons and plates, surest first.
    """
    found: list[Instance] = []
    offset = (stride - 1) / 2
    for plane in (0, 1):
        rows, columns = _peaks(centers[plane], least)
        if len(rows) == 0:
            continue
        x, y = columns * stride + offset, rows * stride + offset
        boxes = _boxes(sides[:, rows, columns].astype(np.float64), x, y)
        scores = centers[plane, rows, columns]
        kept = distinct(boxes)
        for k, (left, top, right, bottom) in zip(
            kept, _around_middle(boxes[kept], stride, *classes.shape[1:]).tolist(), strict=True
        ):
            part = np.s_[:, top : bottom + 1, left : right + 1]
            x = np.arange(left, right + 1) * stride + offset
            y = np.arange(top, bottom + 1)[:, None] * stride + offset
            x0, y0, x1, y1 = _middle_box(sides[part], x, y)
            mean = classes[part].reshape(len(classes), -1).mean(axis=1)
            found.append(Instance(plane == 1, float(scores[k]), (x0, y0, x1, y1), mean))
    return sorted(found, key=lambda i: -i.confidence)


def _around_middle(boxes: FloatArray, stride: int, h: int, w: int) -> npt.NDArray[np.intp]:
    """First and last columns and rows of cells around the middles of boxes, as x0, y0, x1, y1."""
    offset, last = (stride - 1) / 2, (w - 1, h - 1)
    middle, half = (boxes[:, :2] + boxes[:, 2:]) / 2, (boxes[:, 2:] - boxes[:, :2]) / 2
    low = np.ceil((middle - 0.5 * half - offset) / stride).astype(int)
    high = np.floor((middle + 0.5 * half - offset) / stride).astype(int)
    nearest = np.clip(np.rint((middle - offset) / stride).astype(int), 0, last)
    low, high = np.minimum(low, nearest), np.maximum(high, nearest)
    return np.concatenate([np.maximum(low, 0), np.minimum(high, last)], axis=1)


def _middle_box(sides: npt.NDArray[np.float32], x: FloatArray, y: FloatArray) -> list[float]:
    """Median of the boxes that cells tell, whose sides are (4, h, w), at x (w,) and y (h, 1)."""
    left, top, right, bottom = sides.astype(np.float64)
    told = np.stack([x - left, y - top, x + right, y + bottom]).reshape(4, -1)
    # As np.median, which takes ten times as long for so few.
    told.sort(axis=1)
    n = told.shape[1]
    middle: list[float] = ((told[:, (n - 1) // 2] + told[:, n // 2]) / 2).tolist()
    return middle
