"""How well labels are told: buttons that are found, and what they are called."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any, Literal

import numpy as np

from fronto.categories import PLATE
from fronto.datasets.records import Box, LabeledImage, LabeledObject
from fronto.evaluate.matching import match_greedy, photo_id
from fronto.evaluate.missing import Missing
from fronto.evaluate.regions import box_overlaps
from fronto.labels.series import FUNCTIONS, is_floor, label_key, normal_label
from fronto.labels.targets import read_target
from fronto.pose.checks import boxes_px
from fronto.results import Panel

__all__ = [
    "CLASSES",
    "SIZES",
    "LabelReport",
    "LabelScore",
    "ToldLabel",
    "evaluate_labels",
    "judge_labels",
    "label_class",
    "true_label",
]

SCHEMA = "fronto.label-report/1"

#: Kinds of labels, as they are reported.
CLASSES = ("one digit", "two digits", "other floor", *FUNCTIONS, "other text")
#: Edges of the size classes: the box's shorter side, pixels.
SIZES = (0.0, 12.0, 16.0, 24.0, 40.0, float("inf"))
#: Two boxes that overlap so much are one: of a box and the same one in a list of them.
SAME = 0.8

Outcome = Literal["right", "wrong", "declined"]


@dataclass(frozen=True)
class ToldLabel:
    """A button that was found, and what it is called.

    Parameters
    ----------
    path
        The photo.
    truth
        Its label in normal form; "" where it has none that could be read.
    told
        What it is called; "" where that is declined.
    confidence, source
        As of `fronto.Button`.
    side_px
        Shorter side of the labelled box.
    legible
        Whether its label can be read without those of its neighbours.
    """

    path: Path
    truth: str
    told: str
    confidence: float
    source: str | None
    side_px: float
    legible: bool = True

    @property
    def outcome(self) -> Outcome:
        r"""Whether it is right; a star (\*1), which marks the way out, may be left out."""
        if not self.told:
            return "declined"
        return "right" if label_key(self.told) == label_key(self.truth) else "wrong"


@dataclass(frozen=True)
class LabelScore:
    """Labelled buttons, how many of them were found, and what they are called.

    Parameters
    ----------
    labels
        Buttons with a label.
    right, wrong, declined
        Of those that were found.
    """

    labels: int
    right: int
    wrong: int
    declined: int

    @property
    def found(self) -> int:
        """Buttons that were found."""
        return self.right + self.wrong + self.declined

    def share(self, outcome: Outcome) -> float:
        """Of the buttons that were found; NaN where there is none."""
        return getattr(self, outcome) / self.found if self.found else float("nan")


@dataclass(frozen=True)
class PhotoLabels:
    """What became of one photo.

    Parameters
    ----------
    path
        The photo.
    told
        Buttons that were found, with a label or (`truth` "") without one that could be read.
    missed
        Labels of buttons that were not found, with the shorter side of their boxes.
    time_ms
        What it took.
    """

    path: Path
    told: tuple[ToldLabel, ...]
    missed: tuple[tuple[str, float], ...]
    time_ms: float


@dataclass(frozen=True)
class LabelReport:
    """Figures over photos.

    Parameters
    ----------
    photos
        One for each.
    """

    photos: tuple[PhotoLabels, ...]

    @cached_property
    def told(self) -> tuple[ToldLabel, ...]:
        """All buttons that have a label and were found."""
        return tuple(t for photo in self.photos for t in photo.told if t.truth)

    @cached_property
    def silent(self) -> tuple[ToldLabel, ...]:
        """All that were found and have no label that could be read."""
        return tuple(t for photo in self.photos for t in photo.told if not t.truth)

    @property
    def missed(self) -> list[tuple[str, float]]:
        """Labels of buttons that were not found, and sizes."""
        return [missed for photo in self.photos for missed in photo.missed]

    @property
    def all(self) -> LabelScore:
        """Of all labels."""
        return _score(self.told, len(self.missed))

    @property
    def legible(self) -> LabelScore:
        """Of buttons that were found and whose labels can be read without their neighbours'."""
        return _score([t for t in self.told if t.legible], 0)

    @property
    def classes(self) -> dict[str, LabelScore]:
        """By `label_class`, without those that do not occur."""
        missed = [label_class(label) for label, _ in self.missed]
        told = [(label_class(t.truth), t) for t in self.told]
        scores = {
            name: _score([t for c, t in told if c == name], missed.count(name)) for name in CLASSES
        }
        return {name: score for name, score in scores.items() if score.labels}

    @property
    def sizes(self) -> list[tuple[float, float, LabelScore]]:
        """By the shorter side of the box: from, below, score."""
        sides = np.array([side for _, side in self.missed])
        return [
            (
                low,
                high,
                _score(
                    [t for t in self.told if low <= t.side_px < high],
                    int(((sides >= low) & (sides < high)).sum()),
                ),
            )
            for low, high in pairwise(SIZES)
        ]

    @property
    def sources(self) -> dict[str, LabelScore]:
        """By what said so (`fronto.Button.label_source`)."""
        found = sorted({t.source for t in self.told if t.source})
        return {name: _score([t for t in self.told if t.source == name], 0) for name in found}

    @property
    def invented(self) -> float:
        """Share of the buttons without a label that could be read that are called something."""
        told = [bool(t.told) for t in self.silent]
        return sum(told) / len(told) if told else float("nan")

    @property
    def time_ms(self) -> float:
        """Median of a photo."""
        times = [photo.time_ms for photo in self.photos]
        return float(np.median(times)) if times else float("nan")

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON (schema ``fronto.label-report/1``)."""
        return {
            "schema": SCHEMA,
            "photos": len(self.photos),
            "all": _values(self.all),
            "legible": _values(self.legible),
            "classes": {name: _values(score) for name, score in self.classes.items()},
            "sizes": [
                {"from_px": low, "below_px": None if np.isinf(high) else high, **_values(score)}
                for low, high, score in self.sizes
            ],
            "sources": {name: _values(score) for name, score in self.sources.items()},
            "without_label": len(self.silent),
            "invented": self.invented,
            "time_ms": self.time_ms,
            "wrong": [
                {
                    "photo": photo_id(t.path),
                    "label": t.truth,
                    "told": t.told,
                    "confidence": t.confidence,
                    "source": t.source,
                }
                for t in self.told
                if t.outcome == "wrong"
            ],
        }

    def to_json(self) -> bytes:
        """`to_dict` as JSON, null for NaN."""
        from fronto.files import json_bytes

        return json_bytes(self.to_dict())

    def to_markdown(self) -> str:
        """The figures as Markdown tables."""
        from fronto.evaluate.tables import label_tables

        return label_tables(self)


def true_label(thing: LabeledObject) -> str:
    """What a labelled button is to be called, in normal form; "" where nothing says so."""
    if thing.category in FUNCTIONS:
        return thing.category
    if thing.text:
        return normal_label(thing.text)
    target = read_target(thing.name)
    return "" if target is None else target.text


def label_class(label: str) -> str:
    """Which of `CLASSES` a label in normal form is."""
    if label in FUNCTIONS:
        return label
    key = label_key(label)
    if key.isdigit() and len(key) < 3:
        return CLASSES[len(key) - 1]
    return "other floor" if is_floor(label) else "other text"


def judge_labels(
    image: LabeledImage, panel: Panel, *, iou: float = 0.5, illegible: Sequence[Box] = ()
) -> tuple[tuple[ToldLabel, ...], tuple[tuple[str, float], ...]]:
    """Compare what the buttons of a result are called with a photo's labels.

    Parameters
    ----------
    image
        The photo's labels; plates are no buttons, and what is to be ignored is.
    panel
        The result.
    iou
        Least overlap of a found button's box with a labelled one.
    illegible
        Boxes of buttons whose labels cannot be read by themselves.

    Returns
    -------
    Buttons that were found; labels of those that were not, with their sides in pixels.
    """
    things = [o for o in image.objects if o.category != PLATE and not o.ignore]
    boxes = [o.box for o in things]
    outlines = [button.outline for button in panel.buttons]
    found = boxes_px(outlines).tolist() if outlines else []
    overlaps = box_overlaps(found, boxes).iou if found and boxes else np.zeros((0, 0))
    pairs = match_greedy(overlaps, [outline.confidence for outline in outlines], iou)
    hidden = _listed(boxes, illegible)
    told = []
    for k, j in sorted(pairs.items()):
        button = panel.buttons[k]
        told.append(
            ToldLabel(
                image.path,
                true_label(things[j]),
                button.label,
                1.0 if button.label_confidence is None else button.label_confidence,
                button.label_source,
                _side(boxes[j]),
                not hidden[j],
            )
        )
    rest = [o for j, o in enumerate(things) if j not in pairs.values()]
    missed = tuple((label, _side(o.box)) for o in rest if (label := true_label(o)))
    return tuple(told), missed


def evaluate_labels(
    images: Iterable[LabeledImage],
    name: Callable[[LabeledImage], Panel],
    *,
    iou: float = 0.5,
    illegible: Missing | None = None,
) -> LabelReport:
    """Compare what buttons are called with labelled photos.

    Parameters
    ----------
    images
        Labelled photos.
    name
        Finds and names the buttons of a photo.
    iou
        As of `judge_labels`.
    illegible
        By the photos' ids: buttons whose labels cannot be read by themselves.
    """
    photos = []
    for image in images:
        begin = time.perf_counter()
        panel = name(image)
        taken = 1e3 * (time.perf_counter() - begin)
        listed: Mapping[str, Sequence[LabeledObject]] = illegible or {}
        boxes = [o.box for o in listed.get(photo_id(image.path), ())]
        told, missed = judge_labels(image, panel, iou=iou, illegible=boxes)
        photos.append(PhotoLabels(image.path, told, missed, taken))
    return LabelReport(tuple(photos))


def _listed(boxes: Sequence[Box], listed: Sequence[Box]) -> list[bool]:
    if not boxes or not listed:
        return [False] * len(boxes)
    return [bool(row.max() >= SAME) for row in box_overlaps(boxes, listed).iou]


def _side(box: Box) -> float:
    return min(box[2] - box[0], box[3] - box[1])


def _score(told: Sequence[ToldLabel], missed: int) -> LabelScore:
    outcomes = [t.outcome for t in told]
    counts = (outcomes.count(name) for name in ("right", "wrong", "declined"))
    return LabelScore(len(told) + missed, *counts)


def _values(score: LabelScore) -> dict[str, float]:
    return {
        "labels": score.labels,
        "found": score.found,
        "right": score.share("right"),
        "wrong": score.share("wrong"),
        "declined": score.share("declined"),
    }
