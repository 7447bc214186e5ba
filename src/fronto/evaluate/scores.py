"""From findings to figures: precision, recall, and the same by confidence, size and category."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from math import inf, nan

import numpy as np
import numpy.typing as npt

from fronto.categories import BUTTONS, CATEGORIES, PLATE
from fronto.datasets.records import UNKNOWN, Box
from fronto.evaluate.matching import Finding
from fronto.shapes import FloatArray

__all__ = [
    "NOTHING",
    "CategoryScore",
    "CurvePoint",
    "Score",
    "SizeScore",
    "average_precision",
    "category_scores",
    "confusion_matrix",
    "precision_recall",
    "score",
    "size_scores",
]

#: Neither a button nor a plate: the row of false detections, the column of what was missed.
NOTHING = "nothing"
#: Rows and columns of the confusion matrix.
TRUE_LABELS, FOUND_LABELS = (*CATEGORIES[1:], UNKNOWN, NOTHING), (*CATEGORIES[1:], NOTHING)
#: Shorter side of a button in pixels: from the first, below the second.
SIZES = ((0.0, 12.0), (12.0, 16.0), (16.0, 24.0), (24.0, 40.0), (40.0, 80.0), (80.0, inf))


def ratio(part: float, whole: float) -> float:
    """NaN where there is nothing to take a share of."""
    return part / whole if whole else nan


@dataclass(frozen=True)
class Score:
    """How many were found, and how many of the detections are right.

    Parameters
    ----------
    truths
        Labelled objects.
    found
        Those of them that were found.
    detections
        Detections that count: neither ignored nor, where the list of missing labels is
        not used, excused by it.
    right
        Those of them that are objects, labelled or (by that list) not.
    """

    truths: int
    found: int
    detections: int
    right: int

    @property
    def precision(self) -> float:
        """Share of the detections that are right; NaN without any."""
        return ratio(self.right, self.detections)

    @property
    def recall(self) -> float:
        """Share of the labelled objects that were found; NaN without any."""
        return ratio(self.found, self.truths)

    @property
    def f1(self) -> float:
        """Harmonic mean of precision and recall, 0 if nothing was found; NaN if nothing was to."""
        if not self.truths and self.right == self.detections:
            return nan
        if not self.found:
            return 0.0
        return 2 * self.precision * self.recall / (self.precision + self.recall)


@dataclass(frozen=True)
class CategoryScore:
    """How one category was found and named.

    Parameters
    ----------
    category
        Its name.
    truths, found
        Labelled objects of it, and those found, under whichever name.
    right
        Found under this name.
    detections
        Detections of this name that count, but for those of objects with unknown category.
    """

    category: str
    truths: int
    found: int
    right: int
    detections: int

    @property
    def recall(self) -> float:
        """Share of its objects that were found under its name."""
        return ratio(self.right, self.truths)

    @property
    def precision(self) -> float:
        """Share of its detections that are such objects."""
        return ratio(self.right, self.detections)


@dataclass(frozen=True)
class SizeScore:
    """Buttons whose shorter side has `low` <= px < `high`.

    What was found counts by the label's size, false detections by their own.
    """

    low: float
    high: float
    score: Score


@dataclass(frozen=True)
class CurvePoint:
    """Precision and recall of the detections at least this sure; NaN as in `Score`."""

    confidence: float
    precision: float
    recall: float


def score(findings: Iterable[Finding], reviewed: bool = False) -> Score:
    """Count findings of one kind.

    Parameters
    ----------
    findings
        Of buttons or of plates.
    reviewed
        Whether detections on the list of missing labels are right; else they are false.
    """
    verdicts = [finding.verdict for finding in findings]
    found, false = verdicts.count("found"), verdicts.count("false")
    unlabeled = verdicts.count("unlabeled")
    return Score(
        truths=found + verdicts.count("missed"),
        found=found,
        detections=found + false + unlabeled,
        right=found + (unlabeled if reviewed else 0),
    )


def _ranked(findings: Sequence[Finding], reviewed: bool) -> tuple[FloatArray, FloatArray, int]:
    """Confidences of what counts, from high to low, (n,); what is what, (2, n); the truths.

    The rows of the second: right, found.
    """
    counted = [f for f in findings if f.verdict in ("found", "false", "unlabeled")]
    good = ("found", "unlabeled") if reviewed else ("found",)
    confidence = np.array([f.confidence for f in counted], dtype=np.float64)
    flags = np.array(
        [[f.verdict in good for f in counted], [f.verdict == "found" for f in counted]],
        dtype=np.float64,
    )
    order = np.argsort(-confidence, kind="stable")
    truths = sum(f.verdict in ("found", "missed") for f in findings)
    return confidence[order], flags[:, order], truths


def average_precision(findings: Sequence[Finding], reviewed: bool = False) -> float:
    """Area under the precision-recall curve of what was reported, NaN without truths.

    All points, precision made monotone, as in PASCAL VOC from 2010 on. Detections that are
    equally sure come in together. What was too unsure to be reported adds nothing.
    """
    confidence, (right, found), truths = _ranked(findings, reviewed)
    if not truths:
        return nan
    if not len(confidence):
        return 0.0
    last = np.append(np.diff(confidence) != 0, True)
    precision = (np.cumsum(right) / np.arange(1, len(right) + 1))[last]
    recall = np.cumsum(found)[last] / truths
    best_from_here = np.maximum.accumulate(precision[::-1])[::-1]
    return float(np.sum(np.diff(recall, prepend=0.0) * best_from_here))


def precision_recall(
    findings: Sequence[Finding], thresholds: Iterable[float], reviewed: bool = False
) -> tuple[CurvePoint, ...]:
    """Precision and recall of the detections that are at least as sure as each threshold."""
    confidence, (right, found), truths = _ranked(findings, reviewed)
    points = []
    for threshold in thresholds:
        count = int(np.count_nonzero(confidence >= threshold))
        points.append(
            CurvePoint(
                float(threshold),
                ratio(float(right[:count].sum()), count),
                ratio(float(found[:count].sum()), truths),
            )
        )
    return tuple(points)


def size_scores(findings: Iterable[Finding], reviewed: bool = False) -> tuple[SizeScore, ...]:
    """Count findings by the size of the button, small to large."""
    groups: list[list[Finding]] = [[] for _ in SIZES]
    for finding in findings:
        # A false detection may state the plate that it covers, which is not its size.
        known = finding.verdict in ("found", "missed")
        box = finding.truth_box if known else finding.box
        assert box is not None  # it has one of the two
        groups[_size_class(box)].append(finding)
    return tuple(
        SizeScore(low, high, score(group, reviewed))
        for (low, high), group in zip(SIZES, groups, strict=True)
    )


def _size_class(box: Box) -> int:
    side = min(box[2] - box[0], box[3] - box[1])
    return next(k for k, (_, high) in enumerate(SIZES) if side < high)


def confusion_matrix(images: Iterable[Iterable[Finding]]) -> npt.NDArray[np.int64]:
    """What was taken for what, as labelled.

    Each labelled object is in one cell, each detection that counts in one: together where
    they are a pair, or where the detection is the surest of those that took a missed object
    for one of the other kind; else with "nothing". What the labels miss is nothing here.

    Parameters
    ----------
    images
        The findings of each image.

    Returns
    -------
    Shape (12, 11): rows are the labels (`TRUE_LABELS`), columns the names given.
    """
    table = np.zeros((len(TRUE_LABELS), len(FOUND_LABELS)), np.int64)

    def count(truth: str, found: str) -> None:
        table[TRUE_LABELS.index(truth), FOUND_LABELS.index(found)] += 1

    for findings in map(list, images):
        missed = {f.truth: f.truth_category for f in findings if f.verdict == "missed"}
        for f in sorted(findings, key=lambda f: -(f.confidence or 0)):
            if f.verdict == "found":
                count(f.truth_category or NOTHING, f.category or NOTHING)
            elif f.verdict in ("false", "unlabeled"):
                count(missed.pop(f.truth, None) or NOTHING, f.category or NOTHING)
        for category in missed.values():
            count(category or NOTHING, NOTHING)
    return table


def category_scores(images: Iterable[Sequence[Finding]]) -> tuple[CategoryScore, ...]:
    """Score each category of buttons, and the plates, as labelled."""
    findings = [finding for image in images for finding in image]
    scores = []
    for category in (*BUTTONS, PLATE):
        of_it = [f for f in findings if f.truth_category == category]
        found = [f for f in of_it if f.verdict == "found"]
        named = [
            f
            for f in findings
            if f.category == category
            and f.verdict != "ignored"
            and not (f.verdict == "found" and f.truth_category == UNKNOWN)
        ]
        scores.append(
            CategoryScore(
                category,
                truths=len(found) + sum(f.verdict == "missed" for f in of_it),
                found=len(found),
                right=sum(f.category == category for f in found),
                detections=len(named),
            )
        )
    return tuple(scores)
