"""Evaluate a segmentation on labelled photos."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence

from fronto.datasets.records import LabeledImage, LabeledObject
from fronto.errors import InputError
from fronto.evaluate.matching import By, Detection, judge_image, photo_id
from fronto.evaluate.pixels import pixel_confusion
from fronto.evaluate.report import ImageResult, SegmentationReport

__all__ = ["evaluate_segmentation"]


def evaluate_segmentation(
    images: Iterable[LabeledImage],
    predict: Callable[[LabeledImage], Iterable[Detection]],
    *,
    by: By = "box",
    iou: float = 0.5,
    missing: Mapping[str, Sequence[LabeledObject]] | None = None,
) -> SegmentationReport:
    """Find buttons on labelled photos, and compare.

    A detection and a labelled object are a pair if they overlap by at least `iou`; the
    surest detection chooses first, and each object is found once. Buttons pair with buttons
    of any category (naming them right is counted apart), plates with plates: a plate taken
    for a button is a false positive. What is labelled to be ignored counts neither way.

    Parameters
    ----------
    images
        Labelled photos (`fronto.datasets.opening.open_dataset`).
    predict
        What is found in one, in its pixels: `fronto.segments.Segments`, for example.
    by
        Compare "box" with box, or "mask" with labelled outline, pixel by pixel.
    iou
        Least intersection over union of a pair, above 0, at most 1.
    missing
        Buttons that the labels miss, by the photos' ids (`fronto.evaluate.read_missing`).
        As labelled, detecting one is a false positive; in the reviewed figures it is right.

    Raises
    ------
    InputError
        If masks are to be compared and a label has no outline, or `iou` is out of range.
    """
    if not 0 < iou <= 1:
        raise InputError("iou", f"expected a number above 0, at most 1, got {iou}")
    if by not in ("box", "mask"):
        raise InputError("by", f'expected "box" or "mask", got {by!r}')
    listed = {} if missing is None else missing
    results = []
    for image in images:
        start = time.perf_counter()
        segments = tuple(predict(image))
        took = time.perf_counter() - start
        findings = judge_image(
            image, segments, by=by, iou=iou, missing=listed.get(photo_id(image.path), ())
        )
        pixels = pixel_confusion(image, segments) if by == "mask" else None
        results.append(ImageResult(image.path, findings, pixels, took * 1000))
    return SegmentationReport(by, float(iou), tuple(results))
