"""Which detection is which labelled button, and what remains on either side."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Literal, Protocol

import numpy as np
import numpy.typing as npt

from fronto.categories import CATEGORIES, PLATE
from fronto.datasets.masks import mask_polygon
from fronto.datasets.records import Box, LabeledImage, LabeledObject
from fronto.errors import InputError
from fronto.evaluate.regions import (
    Overlaps,
    Region,
    box_overlaps,
    clip_box,
    polygon_region,
    region_overlaps,
)
from fronto.shapes import FloatArray

__all__ = ["By", "Detection", "Finding", "Verdict", "judge_image", "match_greedy", "photo_id"]

By = Literal["box", "mask"]
#: "unlabeled": a button that the labels miss, as the list of those says.
Verdict = Literal["found", "missed", "false", "unlabeled", "ignored"]
#: A detection of which this share lies in what is to be ignored is neither right nor wrong.
IGNORED_SHARE = 0.5


class Detection(Protocol):
    """What the evaluation needs to know of a segment (`fronto.segments.Segment` is one)."""

    @property
    def category(self) -> str:
        """A name of `fronto.categories.CATEGORIES` except "background"."""

    @property
    def confidence(self) -> float:
        """Between 0 and 1."""

    @property
    def box_px(self) -> Box:
        """Edges x0, y0, x1, y1 in pixels."""

    @property
    def origin_px(self) -> tuple[int, int]:
        """x, y of the mask's top-left pixel in the photo."""

    @property
    def mask(self) -> npt.NDArray[np.bool_]:
        """Shape (h, w)."""


@dataclass(frozen=True, eq=False)
class Finding:
    """A detection, a labelled object, or the two as one: what became of it.

    Parameters
    ----------
    path
        The photo.
    verdict
        "found": a detection and the object that it is. "missed": an object without one.
        "false": a detection of nothing, or of what was found before, or of the other kind
        (a plate taken for a button, a button for a plate). "unlabeled": a detection that the
        list of missing labels has. "ignored": a detection on what is to be ignored.
    category, box, confidence, polygon
        The detection's; None where there is none. The polygon, shape (n, 2), is known only
        where masks were compared.
    truth
        Number in the image's objects of what was found or missed; of a false detection:
        what it covers; else None.
    truth_category, truth_box, truth_polygon
        The object's; its box as far as it lies in the photo.
    iou
        Of the two; None unless there are two.
    """

    path: Path
    verdict: Verdict
    category: str | None = None
    box: Box | None = None
    confidence: float | None = None
    polygon: FloatArray | None = None
    truth: int | None = None
    truth_category: str | None = None
    truth_box: Box | None = None
    truth_polygon: FloatArray | None = None
    iou: float | None = None

    @property
    def of_plate(self) -> bool:
        """Whether it counts among the plates: by its detection, if there is one."""
        return (self.category or self.truth_category) == PLATE


def photo_id(path: Path) -> str:
    """Short name of a photo: the data set's folder and the file's stem, as "valid/1000".

    The same as in the corrections of the panels' labels; a folder "images" is left out.
    """
    folder = path.parent.parent if path.parent.name == "images" else path.parent
    return f"{folder.name}/{path.stem}" if folder.name else path.stem


def match_greedy(
    iou: npt.ArrayLike, confidence: npt.ArrayLike, threshold: float = 0.5
) -> dict[int, int]:
    """One-to-one pairs: each detection, the surest first, takes what it overlaps the most.

    As PASCAL VOC and COCO do. Of equally sure ones the one that overlaps more goes first.

    Parameters
    ----------
    iou
        Shape (n, m), of detections with objects.
    confidence
        Shape (n,).
    threshold
        Least overlap of a pair.

    Returns
    -------
    From the detection's to the object's index.
    """
    table = np.array(iou, dtype=np.float64)
    if not table.size:
        return {}
    pairs = {}
    sure = np.asarray(confidence, dtype=np.float64)
    for detection in np.lexsort((-table.max(axis=1), -sure)):
        best = int(table[detection].argmax())
        if table[detection, best] >= threshold:
            pairs[int(detection)] = best
            table[:, best] = -1  # taken
    return pairs


def judge_image(
    image: LabeledImage,
    segments: Iterable[Detection],
    *,
    by: By = "box",
    iou: float = 0.5,
    missing: Sequence[LabeledObject] = (),
) -> tuple[Finding, ...]:
    """Match what was found in a photo with what is labelled there.

    Buttons are matched with buttons and plates with plates, whatever their categories; what
    is to be ignored takes any number of the detections that remain. The result does not
    depend on the order of segments or labels.

    Parameters
    ----------
    image
        The photo's labels.
    segments
        What was found in it.
    by
        Whether boxes or masks are compared; a mask needs an outline to be compared with.
    iou
        Least overlap of a pair.
    missing
        Buttons that are there but not among the labels; they are compared by their boxes.

    Raises
    ------
    InputError
        If masks are compared and a button has a box only, or a segment has an unknown
        category.
    """
    found = sorted(segments, key=lambda s: (-s.confidence, s.box_px, s.category))
    boxes = {k: clip_box(o.box, image.width, image.height) for k, o in enumerate(image.objects)}
    seen = {k: box for k, box in boxes.items() if box is not None}
    truths = sorted(seen, key=lambda k: (seen[k], image.objects[k].category))
    for segment in found:
        if segment.category not in CATEGORIES[1:]:
            raise InputError(
                f"segment of {image.path}",
                f"expected a category out of {', '.join(CATEGORIES[1:])}, got {segment.category!r}",
            )
    if by == "mask":
        regions = [Region(segment.origin_px, segment.mask) for segment in found]
        overlaps = region_overlaps(regions, [_truth_region(image, k, seen[k]) for k in truths])
    else:
        overlaps = box_overlaps([s.box_px for s in found], [seen[k] for k in truths])
    judge = _Judge(image, found, truths, seen, overlaps, by, iou, missing)
    return (*judge.kind(plates=False), *judge.kind(plates=True))


def _truth_region(image: LabeledImage, number: int, box: Box) -> Region:
    item = image.objects[number]
    polygon = item.polygon
    if polygon is None:
        if not item.ignore:
            raise InputError(
                f"labels of {image.path}, object {number + 1}",
                "expected an outline to compare masks with, got a box only",
                "compare boxes, or label outlines",
            )
        x0, y0, x1, y1 = box
        polygon = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
    return polygon_region(polygon, image.width, image.height)


def _edges(box: Sequence[float]) -> Box:
    """As plain numbers: a detector's own may be NumPy's."""
    x0, y0, x1, y1 = (float(edge) for edge in box)
    return x0, y0, x1, y1


@dataclass(frozen=True, eq=False)
class _Judge:
    """Detections (rows of the overlaps) and labels (columns, numbers of which are `truths`)."""

    image: LabeledImage
    found: Sequence[Detection]
    truths: Sequence[int]
    seen: dict[int, Box]
    overlaps: Overlaps
    by: By
    iou: float
    missing: Sequence[LabeledObject]

    def kind(self, plates: bool) -> list[Finding]:
        """What became of the buttons, or of the plates."""
        rows = [i for i, s in enumerate(self.found) if (s.category == PLATE) == plates]
        objects = [self.image.objects[k] for k in self.truths]
        columns = [
            j for j, o in enumerate(objects) if not o.ignore and (o.category == PLATE) == plates
        ]
        pairs = self._pairs(self.overlaps.iou[np.ix_(rows, columns)], rows)
        partner = {rows[i]: columns[j] for i, j in pairs.items()}
        rest = [i for i in rows if i not in partner]
        unlabeled: set[int] = set()
        if not plates:  # the list of missing labels is one of buttons
            listed = box_overlaps(
                [self.found[i].box_px for i in rest], [item.box for item in self.missing]
            )
            unlabeled = {rest[i] for i in self._pairs(listed.iou, rest)}
        ignore = [j for j, o in enumerate(objects) if o.ignore]
        counted = [j for j, o in enumerate(objects) if not o.ignore]
        findings = []
        for i in rows:
            if i in partner:
                findings.append(self._finding("found", i, partner[i]))
            elif i in unlabeled:
                findings.append(self._finding("unlabeled", i))
            elif (self.overlaps.share[i, ignore] >= IGNORED_SHARE).any():
                findings.append(self._finding("ignored", i))
            else:
                covered = max(counted, key=lambda j: float(self.overlaps.iou[i, j]), default=None)
                if covered is not None and self.overlaps.iou[i, covered] < self.iou:
                    covered = None
                findings.append(self._finding("false", i, covered))
        taken = set(partner.values())
        findings += [self._finding("missed", None, j) for j in columns if j not in taken]
        return findings

    def _pairs(self, iou: FloatArray, rows: Sequence[int]) -> dict[int, int]:
        return match_greedy(iou, [self.found[i].confidence for i in rows], self.iou)

    def _finding(self, verdict: Verdict, row: int | None, column: int | None = None) -> Finding:
        segment = None if row is None else self.found[row]
        number = None if column is None else self.truths[column]
        item = None if number is None else self.image.objects[number]
        polygon = None
        if segment is not None and self.by == "mask" and segment.mask.any():
            polygon = mask_polygon(segment.mask) + segment.origin_px
        return Finding(
            path=self.image.path,
            verdict=verdict,
            category=None if segment is None else segment.category,
            box=None if segment is None else _edges(segment.box_px),
            confidence=None if segment is None else float(segment.confidence),
            polygon=polygon,
            truth=number,
            truth_category=None if item is None else item.category,
            truth_box=None if number is None else self.seen[number],
            truth_polygon=None if item is None else item.polygon,
            iou=None if row is None or column is None else float(self.overlaps.iou[row, column]),
        )
