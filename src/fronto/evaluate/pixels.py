"""Pixel by pixel: intersection over union of background, buttons and plates."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np
import numpy.typing as npt

from fronto.categories import PLATE
from fronto.datasets.records import LabeledImage
from fronto.evaluate.matching import Detection
from fronto.evaluate.regions import Region, polygon_region
from fronto.shapes import FloatArray

__all__ = ["PIXEL_CLASSES", "class_iou", "mean_iou", "pixel_confusion"]

PIXEL_CLASSES = ("background", "button", "plate")
IGNORE = 255

Counts = npt.NDArray[np.int64]


def pixel_confusion(image: LabeledImage, segments: Iterable[Detection]) -> Counts:
    """Count a photo's pixels by what they are and what they were taken for.

    Where segments overlap the surest one counts; where labels do, the button.

    Parameters
    ----------
    image
        The photo's labels, all with outlines; without one, only what is to be ignored.
    segments
        What was found in it.

    Returns
    -------
    Shape (3, 3): rows are the labels', columns the segments' background, button, plate.
    Pixels to be ignored are in none.
    """
    shape = (image.height, image.width)
    truth, found = np.zeros(shape, np.uint8), np.zeros(shape, np.uint8)
    order = sorted(image.objects, key=lambda o: (not o.ignore, o.category != PLATE))
    for item in order:
        x0, y0, x1, y1 = item.box
        corners = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
        outline = corners if item.polygon is None else item.polygon
        value = IGNORE if item.ignore else 1 + (item.category == PLATE)
        _paint(truth, polygon_region(outline, image.width, image.height), value)
    for segment in sorted(segments, key=lambda s: (s.confidence, s.box_px, s.category)):
        region = Region(segment.origin_px, segment.mask)
        _paint(found, region, 1 + (segment.category == PLATE))
    return np.array(
        [
            [np.count_nonzero((truth == row) & (found == column)) for column in range(3)]
            for row in range(3)
        ],
        dtype=np.int64,
    )


def _paint(picture: npt.NDArray[np.uint8], region: Region, value: int) -> None:
    height, width = picture.shape
    x0, y0, x1, y1 = region.bounds()
    x0, y0, x1, y1 = max(x0, 0), max(y0, 0), min(x1, width), min(y1, height)
    if x0 < x1 and y0 < y1:
        picture[y0:y1, x0:x1][region.cut(x0, y0, x1, y1)] = value


def class_iou(confusion: Counts) -> FloatArray:
    """Intersection over union of each class, (n,) from (n, n); NaN for what is nowhere."""
    common = np.diag(confusion).astype(np.float64)
    union = confusion.sum(axis=0) + confusion.sum(axis=1) - common
    return np.asarray(np.where(union > 0, common / np.maximum(union, 1), np.nan))


def mean_iou(confusion: Counts) -> float:
    """Mean of `class_iou` over the classes that occur; NaN if none does."""
    values = class_iou(confusion)
    values = values[~np.isnan(values)]
    return float(values.mean()) if len(values) else float("nan")
