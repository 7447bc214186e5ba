"""What an evaluation found out: every figure of it, as values and as JSON."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import isinf, nan
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from fronto.categories import PLATE
from fronto.datasets.records import UNKNOWN
from fronto.evaluate.matching import By, Finding, photo_id
from fronto.evaluate.pixels import PIXEL_CLASSES, class_iou, mean_iou
from fronto.evaluate.scores import (
    FOUND_LABELS,
    TRUE_LABELS,
    CategoryScore,
    CurvePoint,
    Score,
    SizeScore,
    average_precision,
    category_scores,
    confusion_matrix,
    precision_recall,
    ratio,
    score,
    size_scores,
)

__all__ = ["ImageResult", "SegmentationReport"]

SCHEMA = "fronto.segmentation-report/1"
THRESHOLDS = tuple(k / 100 for k in range(5, 100, 5))


@dataclass(frozen=True, eq=False)
class ImageResult:
    """What was found in one photo.

    Parameters
    ----------
    path
        The photo.
    findings
        Of buttons and plates.
    pixels
        Shape (3, 3): its pixels by what they are and what they were taken for
        (`PIXEL_CLASSES`); None where only boxes are known.
    time_ms
        Wall time of the prediction, milliseconds.
    """

    path: Path
    findings: tuple[Finding, ...]
    pixels: npt.NDArray[np.int64] | None
    time_ms: float

    @property
    def name(self) -> str:
        """The photo's short name, as "valid/1000"."""
        return photo_id(self.path)

    @property
    def buttons(self) -> Score:
        """Of its buttons, as labelled."""
        return score(f for f in self.findings if not f.of_plate)

    @property
    def errors(self) -> int:
        """Buttons missed and false ones, those that the labels miss left out."""
        return sum(f.verdict in ("missed", "false") and not f.of_plate for f in self.findings)

    @property
    def mean_iou(self) -> float:
        """Pixelwise, the mean over the classes in it; NaN where only boxes are known."""
        return nan if self.pixels is None else mean_iou(self.pixels)


@dataclass(frozen=True, eq=False)
class SegmentationReport:
    """How well buttons are found: what `evaluate_segmentation` gives.

    Shares of nothing are NaN (null in JSON).

    Parameters
    ----------
    by
        Whether boxes or masks were compared.
    iou
        Least overlap of a detection and the object that it is.
    images
        What was found in each photo, in the order in which they were given.
    """

    by: By
    iou: float
    images: tuple[ImageResult, ...]

    @cached_property
    def _buttons(self) -> list[Finding]:
        return [f for image in self.images for f in image.findings if not f.of_plate]

    @cached_property
    def _plates(self) -> list[Finding]:
        return [f for image in self.images for f in image.findings if f.of_plate]

    @cached_property
    def buttons(self) -> Score:
        """Buttons, whatever their category, as labelled."""
        return score(self._buttons)

    @cached_property
    def buttons_reviewed(self) -> Score:
        """Buttons, where those on the list of missing labels are right."""
        return score(self._buttons, reviewed=True)

    @cached_property
    def plates(self) -> Score:
        """Plates."""
        return score(self._plates)

    @property
    def plates_as_buttons(self) -> float:
        """Share of the labelled plates that a detection takes for a button."""
        return ratio(self._taken(plates=True), self.plates.truths)

    @property
    def buttons_as_plates(self) -> float:
        """Share of the labelled buttons that a detection takes for a plate."""
        return ratio(self._taken(plates=False), self.buttons.truths)

    def _taken(self, plates: bool) -> int:
        """Labelled plates (or buttons) that detections take for the other kind."""
        return sum(
            len(
                {
                    f.truth
                    for f in image.findings
                    if f.verdict == "false"
                    and f.truth is not None
                    and f.of_plate != plates
                    and (f.truth_category == PLATE) == plates
                }
            )
            for image in self.images
        )

    @cached_property
    def average_precision(self) -> float:
        """Of buttons, as labelled: area under the curve of precision over recall."""
        return average_precision(self._buttons)

    @cached_property
    def average_precision_reviewed(self) -> float:
        """The same where buttons on the list of missing labels are right."""
        return average_precision(self._buttons, reviewed=True)

    @cached_property
    def curve(self) -> tuple[CurvePoint, ...]:
        """Precision and recall of buttons by the least confidence, as labelled."""
        return precision_recall(self._buttons, THRESHOLDS)

    @cached_property
    def curve_reviewed(self) -> tuple[CurvePoint, ...]:
        """The same where buttons on the list of missing labels are right."""
        return precision_recall(self._buttons, THRESHOLDS, reviewed=True)

    @cached_property
    def categories(self) -> tuple[CategoryScore, ...]:
        """Each category of buttons, and plates, as labelled."""
        return category_scores(image.findings for image in self.images)

    @cached_property
    def confusion(self) -> npt.NDArray[np.int64]:
        """What was taken for what, (12, 11); see `confusion_matrix`."""
        return confusion_matrix(image.findings for image in self.images)

    @cached_property
    def category_accuracy(self) -> float:
        """Share of the buttons found, of those with a known category, that are named right."""
        known = [f for f in self._buttons if f.verdict == "found" and f.truth_category != UNKNOWN]
        return ratio(sum(f.category == f.truth_category for f in known), len(known))

    @cached_property
    def sizes(self) -> tuple[SizeScore, ...]:
        """Buttons by their shorter side, as labelled."""
        return size_scores(self._buttons)

    @cached_property
    def iou_quartiles(self) -> tuple[float, float, float]:
        """First quartile, median and third of the overlap of the buttons found."""
        values = [f.iou for f in self._buttons if f.verdict == "found" and f.iou is not None]
        if not values:
            return nan, nan, nan
        first, median, third = np.percentile(values, [25, 50, 75])
        return float(first), float(median), float(third)

    @cached_property
    def pixel_iou(self) -> dict[str, float]:
        """Pixelwise overlap of background, button and plate over all photos."""
        return dict(zip(PIXEL_CLASSES, map(float, class_iou(self._pixels)), strict=True))

    @cached_property
    def mean_iou(self) -> float:
        """Mean of `pixel_iou` over the classes that occur; NaN where only boxes are known."""
        return mean_iou(self._pixels)

    @cached_property
    def _pixels(self) -> npt.NDArray[np.int64]:
        tables = [image.pixels for image in self.images if image.pixels is not None]
        return sum(tables, np.zeros((len(PIXEL_CLASSES),) * 2, np.int64))

    @cached_property
    def time_ms(self) -> float:
        """Median wall time of a prediction, milliseconds."""
        times = [image.time_ms for image in self.images]
        return float(np.median(times)) if times else nan

    @cached_property
    def false_positives(self) -> tuple[Finding, ...]:
        """False buttons, the surest first; without those that the labels miss."""
        false = (f for f in self._buttons if f.verdict == "false")
        return tuple(sorted(false, key=lambda f: -(f.confidence or 0)))

    @cached_property
    def misses(self) -> tuple[Finding, ...]:
        """Buttons that were not found, in the order of the photos."""
        return tuple(f for f in self._buttons if f.verdict == "missed")

    def worst(self, count: int) -> tuple[ImageResult, ...]:
        """The photos with the most errors, the worst first; none without an error."""
        wrong = [image for image in self.images if image.errors]
        return tuple(sorted(wrong, key=lambda image: (-image.errors, image.name))[:count])

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON (schema ``fronto.segmentation-report/1``)."""
        return {
            "schema": SCHEMA,
            "by": self.by,
            "iou": self.iou,
            "images": len(self.images),
            "buttons": {**_score(self.buttons), "average_precision": self.average_precision},
            "buttons_reviewed": {
                **_score(self.buttons_reviewed),
                "average_precision": self.average_precision_reviewed,
            },
            "plates": _score(self.plates),
            "plates_as_buttons": self.plates_as_buttons,
            "buttons_as_plates": self.buttons_as_plates,
            "category_accuracy": self.category_accuracy,
            "iou_quartiles": self.iou_quartiles,
            "mean_iou": self.mean_iou,
            "pixel_iou": self.pixel_iou,
            "time_ms": self.time_ms,
            "categories": [
                {
                    "category": c.category,
                    "truths": c.truths,
                    "found": c.found,
                    "right": c.right,
                    "detections": c.detections,
                    "recall": c.recall,
                    "precision": c.precision,
                }
                for c in self.categories
            ],
            "sizes": [
                {
                    "from_px": size.low,
                    "below_px": None if isinf(size.high) else size.high,
                    **_score(size.score),
                }
                for size in self.sizes
            ],
            "curve": [_point(point) for point in self.curve],
            "curve_reviewed": [_point(point) for point in self.curve_reviewed],
            "confusion": {
                "labels": TRUE_LABELS,
                "names": FOUND_LABELS,
                "counts": self.confusion.tolist(),
            },
            "photos": [
                {
                    "photo": image.name,
                    **_score(image.buttons),
                    "mean_iou": image.mean_iou,
                    "time_ms": image.time_ms,
                }
                for image in self.images
            ],
            "false_positives": [
                {
                    "photo": photo_id(f.path),
                    "box_px": f.box,
                    "category": f.category,
                    "confidence": f.confidence,
                    "on": f.truth_category,
                }
                for f in self.false_positives
            ],
            "misses": [
                {
                    "photo": photo_id(f.path),
                    "box_px": f.truth_box,
                    "category": f.truth_category,
                    "object": f.truth,
                }
                for f in self.misses
            ],
        }

    def to_json(self) -> bytes:
        """`to_dict` as JSON, null for NaN."""
        from fronto.files import json_bytes

        return json_bytes(self.to_dict())

    def to_markdown(self) -> str:
        """The figures as Markdown tables."""
        from fronto.evaluate.tables import report_tables

        return report_tables(self)


def _score(value: Score) -> dict[str, float]:
    return {
        "truths": value.truths,
        "found": value.found,
        "detections": value.detections,
        "right": value.right,
        "precision": value.precision,
        "recall": value.recall,
        "f1": value.f1,
    }


def _point(point: CurvePoint) -> dict[str, float]:
    return {
        "confidence": point.confidence,
        "precision": point.precision,
        "recall": point.recall,
    }
