"""What the context head is told of a panel, and what it makes of it.

A panel says more than each of its labels: floors count on, doors' buttons stand side by side, the
bell is below them, a plate lies beside what it names. `fronto.labels.order` knows the first of
that, by rule. The context head is a small network that has learnt the rest from photos: it is
told what each button and plate may be by itself, by its plate and by the order, how large each is
and how any two lie to each other, and tells anew what each button may be.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np
import numpy.typing as npt

from fronto.categories import CATEGORIES
from fronto.labels.belief import Belief
from fronto.labels.evidence import Evidence, Said
from fronto.labels.layout import ACROSS, grid_of
from fronto.labels.series import label_key
from fronto.pose.checks import boxes_px
from fronto.results import Button, Plate
from fronto.shapes import FloatArray

__all__ = ["BESIDES", "GEOMETRY", "PAIR", "Context", "Head", "beliefs", "describe", "probabilities"]

#: What there can be besides the labels that a head knows, in this order after them: no label
#: (another symbol, nothing, or no button), and a label that it does not know.
BESIDES = 2
#: What a thing can show instead of a label.
SHOWN = ("other", "blank", "unreadable")
#: Numbers that tell of one thing beside what it says, and of two.
GEOMETRY, PAIR = 17 + len(CATEGORIES) + len(SHOWN), 19
#: Sides are told between these, in those of the panel's typical button.
SIDES = (0.05, 20.0)
#: Offsets are told exactly up to this, in sides of the panel's typical button.
NEAR = 2.5
#: Less probable labels are not worth keeping.
LEAST = 1e-3

Floats = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Context:
    """What the context head is told of n things, buttons before plates.

    Parameters
    ----------
    own, seen, ordered
        Shape (n, labels + 2): probabilities of the labels that the head knows, of none and of
        another one: by its own print; with its plate's; and in the panel's order.
    geometry
        Shape (n, 31): what is told of each besides.
    pairs
        Shape (n, n, 19): how the second lies to the first.
    """

    own: Floats
    seen: Floats
    ordered: Floats
    geometry: Floats
    pairs: Floats


class Head(Protocol):
    """A context head, such as :class:`fronto.engine.ContextEngine`."""

    labels: tuple[str, ...]

    def run(self, context: Context, /) -> Floats:
        """Probabilities (n, labels + 2), as those of `Context`."""


def describe(
    things: Sequence[Button | Plate],
    said: Sequence[Said],
    evidence: Evidence,
    seen: Sequence[Belief],
    ordered: Sequence[Belief],
    boxes: FloatArray,
    labels: Sequence[str],
    *,
    posed: bool,
) -> Context:
    """Tell a head of a panel.

    Parameters
    ----------
    things
        The buttons, then the plates.
    said
        What each of them says by itself.
    evidence
        What is made of it.
    seen, ordered
        Of each button: what it and its plate say; the same in the panel's order.
    boxes
        Shape (n, 4), of all things, as of `fronto.labels.layout.panel_boxes`.
    labels
        Those that the head knows, in its order.
    posed
        Whether the panel's pose is sure ("ok").
    """
    plates = [one.labels for one in said[len(evidence.own) :]]
    place = {label: k for k, label in enumerate(labels)}
    return Context(
        probabilities([*evidence.own, *plates], place),
        probabilities([*seen, *plates], place),
        probabilities([*ordered, *plates], place),
        _geometry(things, said, boxes, len(evidence.own), posed=posed),
        _pairs(boxes, len(evidence.own)),
    )


def probabilities(beliefs: Sequence[Belief], place: dict[str, int]) -> Floats:
    """Beliefs as rows (n, labels + 2): labels at their places, none, and all others together."""
    rows = np.zeros((len(beliefs), len(place) + BESIDES), np.float32)
    for row, belief in zip(rows, beliefs, strict=True):
        for label, p in belief.items():
            row[place.get(label_key(label), -1) if label else -BESIDES] += p
    return rows


def beliefs(
    told: npt.NDArray[np.floating], before: Sequence[Belief], labels: Sequence[str]
) -> list[dict[str, float]]:
    """What a head tells, as beliefs.

    Parameters
    ----------
    told
        Shape (n, labels + 2), of the buttons.
    before
        What each button's label may have been before: it decides on a star before the label,
        and whether another label than the head knows is meant, and which.
    labels
        Those that the head knows.

    Returns
    -------
    What each button's label may be; "" stands for none.
    """
    place = {label: k for k, label in enumerate(labels)}
    found = []
    for row, belief in zip(told.tolist(), before, strict=True):
        forms: dict[int, str] = {}
        others = {}
        for label, p in sorted(belief.items(), key=lambda item: -item[1]):
            k = place.get(label_key(label))
            if k is not None:
                forms.setdefault(k, label)
            elif label:
                others[label] = p
        result = {forms.get(k, label): row[k] for k, label in enumerate(labels) if row[k] >= LEAST}
        total = sum(others.values())
        result |= {label: row[-1] * p / total for label, p in others.items() if total > 0}
        result[""] = row[-BESIDES]
        found.append({label: p for label, p in result.items() if p >= LEAST})
    return found


def _placed(boxes: FloatArray, count: int) -> tuple[FloatArray, FloatArray, npt.NDArray[np.bool_]]:
    """Centres and sides in those of the typical button, and which boxes there are.

    Boxes that are nowhere are put in the middle.
    """
    there = np.asarray(np.isfinite(boxes).all(axis=1))
    sides = boxes[:, 2:] - boxes[:, :2]
    usual = np.sqrt(np.abs(sides.prod(axis=1)))
    # Of the buttons; where none of them is anywhere, of the plates.
    usual = usual[:count][there[:count]] if there[:count].any() else usual[there]
    unit = float(np.median(usual)) if len(usual) else 1.0
    unit = max(unit, 1e-9)
    centers = np.where(there[:, None], (boxes[:, :2] + boxes[:, 2:]) / (2 * unit), 0.0)
    sides = np.clip(np.where(there[:, None], sides / unit, 1.0), *SIDES)
    if there.any():
        centers -= np.median(centers[there], axis=0)
        centers[~there] = 0.0
    return centers, sides, there


def _signed_log(offsets: FloatArray) -> FloatArray:
    return np.asarray(np.sign(offsets) * np.log1p(np.abs(offsets)))


def _geometry(
    things: Sequence[Button | Plate],
    said: Sequence[Said],
    boxes: FloatArray,
    count: int,
    *,
    posed: bool,
) -> Floats:
    centers, sides, there = _placed(boxes, count)
    low, high = centers.min(axis=0), centers.max(axis=0)
    extent = np.maximum(high - low, 1e-3)
    outlines = [thing.outline for thing in things]
    edges = boxes_px(outlines)
    side_px = np.minimum(edges[:, 2] - edges[:, 0], edges[:, 3] - edges[:, 1])
    n = len(things)
    told = np.concatenate(
        [
            np.log(sides),
            _signed_log(centers),
            (centers - low) / extent - 0.5,
            np.broadcast_to(np.log1p(extent) / 2, (n, 2)),
            np.array([[o.confidence, o.truncated, o.odd, o.shape == "ellipse"] for o in outlines]),
            (np.arange(n) >= count)[:, None],
            np.log(np.maximum(side_px, 1.0))[:, None] / 4,
            np.full((n, 1), np.log(count + 1) / 3),
            np.full((n, 1), float(posed)),
            there[:, None],
            np.array([[o.category == name for name in CATEGORIES] for o in outlines]),
            np.array([[s.kind_confidence * (s.kind == kind) for kind in SHOWN] for s in said]),
        ],
        axis=1,
    )
    return told.astype(np.float32)


def _pairs(boxes: FloatArray, count: int) -> Floats:
    centers, sides, there = _placed(boxes, count)
    n = len(boxes)
    offset = centers[None] - centers[:, None]
    line = np.abs(offset) < ACROSS * np.minimum(sides[:, None], sides[None])
    area = np.log(sides.prod(axis=1))
    next_to = np.zeros((n, n, 8))
    # Buttons and plates stand in rows of their own.
    for part in (np.arange(count), np.arange(count, n)):
        grid = grid_of(np.where(there[part, None], boxes[part], np.nan))
        for d in range(4):
            for k in range(len(part)):
                for rank, other in enumerate(grid.line(k, d, 2)):
                    next_to[part[k], part[other], d + 4 * rank] = 1
    told = np.concatenate(
        [
            _signed_log(offset),
            np.clip(offset, -NEAR, NEAR),
            np.exp(-np.abs(offset)),
            line,
            next_to,
            (area[None] - area[:, None])[..., None],
            np.eye(n)[..., None],
            np.broadcast_to((np.arange(n) >= count)[None, :, None], (n, n, 1)),
        ],
        axis=2,
    )
    return told.astype(np.float32)
