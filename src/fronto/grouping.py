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

__all__ = ["Instance", "distinct", "group", "overlaps"]

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


def distinct(boxes: FloatArray, same: float = SAME) -> list[int]:
    """Which of the boxes (n, 4) to keep: each one that overlaps no earlier one by this much."""
    alike = [overlaps(box, boxes) >= same for box in boxes]
    kept: list[int] = []
    for k, others in enumerate(alike):
        if not others[kept].any():
            kept.append(k)
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
        for k in distinct(boxes):
            box, mean = _pooled(boxes[k], sides, classes, stride)
            found.append(
                Instance(
                    plane == 1,
                    float(scores[k]),
                    (float(box[0]), float(box[1]), float(box[2]), float(box[3])),
                    mean,
                )
            )
    return sorted(found, key=lambda i: -i.confidence)


def _pooled(
    box: FloatArray,
    sides: npt.NDArray[np.float32],
    classes: npt.NDArray[np.float32],
    stride: int,
) -> tuple[FloatArray, FloatArray]:
    """Median of the boxes that the cells around the middle tell, and their mean classes."""
    h, w = classes.shape[1:]
    offset = (stride - 1) / 2
    middle, half = (box[:2] + box[2:]) / 2, (box[2:] - box[:2]) / 2
    low = np.ceil((middle - 0.5 * half - offset) / stride).astype(int)
    high = np.floor((middle + 0.5 * half - offset) / stride).astype(int)
    nearest = np.clip(np.rint((middle - offset) / stride).astype(int), 0, (w - 1, h - 1))
    low, high = np.minimum(low, nearest), np.maximum(high, nearest)
    low, high = np.maximum(low, 0), np.minimum(high, (w - 1, h - 1))
    part = np.s_[:, low[1] : high[1] + 1, low[0] : high[0] + 1]
    cells = sides[part].reshape(4, -1).astype(np.float64)
    y, x = np.mgrid[low[1] : high[1] + 1, low[0] : high[0] + 1] * stride + offset
    told = _boxes(cells, x.ravel(), y.ravel())
    # As np.median, which takes ten times as long for so few.
    told.sort(axis=0)
    n = len(told)
    return (told[(n - 1) // 2] + told[n // 2]) / 2, classes[part].reshape(len(classes), -1).mean(
        axis=1
    )
