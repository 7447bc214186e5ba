"""Outlines for photos of which only boxes are labelled, from a network trained so far.

Self-training with the labels as judge: a mask becomes an object's outline only where it fills
the labelled box as a button would; confident finds that nobody labelled become regions to
ignore, not background (the labellers miss some).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace

import numpy as np

from fronto.datasets.records import Box, LabeledImage, LabeledObject
from fronto.grouping import overlaps
from fronto.segments import Segment, Segments
from fronto.shapes import FloatArray

__all__ = ["refine"]

#: A mask is believed if its box overlaps the labelled one this much, if it is nearly convex,
#: and if it fills this much of the box: an inscribed ellipse fills 0.785.
BOX_OVERLAP, CONVEX, FILL = 0.75, 0.93, 0.60
#: An unlabelled find of this confidence is not counted as background.
SURE = 0.6
#: One that overlaps a label this much is that label's.
KNOWN = 0.3


def refine(
    images: Iterable[LabeledImage], predict: Callable[[LabeledImage], Segments]
) -> list[LabeledImage]:
    """Give objects known by their box an outline where a network sees a clear one.

    Parameters
    ----------
    images
        Labelled photos; objects that have an outline keep it.
    predict
        Finds the segments of a photo.

    Returns
    -------
    The same photos; outlines are scaled to fill the labelled boxes exactly, unlabelled finds
    are appended with ``ignore=True``.
    """
    return [_refined(image, predict(image)) for image in images]


def _refined(image: LabeledImage, segments: Segments) -> LabeledImage:
    objects = [_with_outline(o, segments) if o.polygon is None else o for o in image.objects]
    boxes = np.array([o.box for o in image.objects]).reshape(-1, 4)
    objects += [
        LabeledObject(s.category, s.box_px, None, "unlabelled", ignore=True)
        for s in segments.buttons
        if s.confidence >= SURE and (overlaps(np.array(s.box_px), boxes) < KNOWN).all()
    ]
    return replace(image, objects=tuple(objects))


def _with_outline(labeled: LabeledObject, segments: Segments) -> LabeledObject:
    if not len(segments):
        return labeled
    found = overlaps(np.array(labeled.box), np.array([s.box_px for s in segments]))
    if found.max() < BOX_OVERLAP:
        return labeled
    outline = _outline(segments.segments[int(found.argmax())], labeled.box)
    return labeled if outline is None else replace(labeled, polygon=outline)


def _outline(segment: Segment, box: Box) -> FloatArray | None:
    """The mask's hull, scaled to the box; None where the mask is no plausible button."""
    import cv2

    # Four times as large: pixel masks of small buttons are coarse, their probabilities are not.
    height, width = segment.probability.shape
    fine = cv2.resize(segment.probability, (4 * width, 4 * height), interpolation=cv2.INTER_LINEAR)
    contours, _ = cv2.findContours(
        (fine > 0.5).astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE
    )
    if not contours:
        return None
    contour = max(contours, key=cv2.contourArea)
    hull = cv2.convexHull(contour)[:, 0].astype(np.float64)
    area = float(cv2.contourArea(hull.astype(np.float32)))
    if len(hull) < 4 or area == 0 or cv2.contourArea(contour) < CONVEX * area:
        return None
    low, high = hull.min(axis=0) - 0.5, hull.max(axis=0) + 0.5
    if area < FILL * float((high - low).prod()):
        return None
    ends = np.array(box).reshape(2, 2)
    found = np.stack([low, high]) / 4 + np.array(segment.origin_px) - 0.375
    if overlaps(ends.ravel(), found.reshape(1, 4))[0] < BOX_OVERLAP:
        return None
    corner, size = hull.min(axis=0), np.ptp(hull, axis=0)
    return np.asarray(ends[0] + (hull - corner) / size * (ends[1] - ends[0]))
