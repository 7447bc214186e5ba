"""What is said of each button: by its own print, and by the plate beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from fronto.labels.belief import Belief, best
from fronto.labels.plates import Pair, pairs, strays
from fronto.labels.series import is_floor, label_key
from fronto.shapes import FloatArray

__all__ = ["Evidence", "Said", "gather"]

#: How far a plate is trusted to be that of its button.
PAIRED = 0.97
#: What a button without a print, and one with another label, say of a plate beside it, as `pairs`
#: has it: -1 to 1. Plates that contradict their buttons exist: a house that was renumbered.
BLANK, OTHER = 0.3, -0.5
#: Kinds that say nothing of a plate's label: "other" is a touch plate's ring, or a maker's sign.
SILENT = ("blank", "unreadable", "other")
#: A reading that is likelier than not.
READ = 0.5
#: Labels among the buttons are plates if so many, this share of the floors, have a blank button
#: beside them, and this share of the blank buttons a label. Of 1,669 labelled photos of panels
#: without plates 10 look like that, of which some may have plates.
MANY, FLOORS, BLANKS = 2, 0.6, 0.4
#: A plate with no more than the star of the way out names no floor.
STAR = "*"


@dataclass(frozen=True)
class Said:
    """What one outline says by itself.

    Parameters
    ----------
    labels
        What its label may be.
    kind
        What it shows, of `fronto.labels.alphabet.KINDS`.
    kind_confidence
        Probability of that kind, where there is no label.
    """

    labels: dict[str, float]
    kind: str
    kind_confidence: float = 1.0


@dataclass(frozen=True)
class Evidence:
    """What is said of the buttons of a panel.

    Parameters
    ----------
    own, plate
        What each button's label may be by its own print, and by its plate; "" stands for a symbol
        that is no label, and for what is no button.
    pairs
        Which plate names which button.
    strays
        Which button is rather the plate of which other one.
    """

    own: tuple[dict[str, float], ...]
    plate: tuple[dict[str, float], ...]
    pairs: tuple[Pair, ...]
    strays: tuple[Pair, ...]


def gather(buttons: Sequence[Said], plates: Sequence[Said], boxes: FloatArray) -> Evidence:
    """Pair plates with buttons, and tell what both say.

    Parameters
    ----------
    buttons, plates
        What they say by themselves.
    boxes
        Shape (n, 4): of the buttons, then of the plates, as of `fronto.labels.plates.pairs`.
    """
    count = len(buttons)
    agreement = _agreement(buttons, plates)
    found = pairs(boxes[:count], boxes[count:], agreement)
    # One plate alone that contradicts its button is rather something else that lies there.
    paired = tuple(pair for pair in found if len(found) > 1 or agreement[pair] >= 0)
    own = [dict(said.labels) for said in buttons]
    beside: list[dict[str, float]] = [{} for _ in buttons]
    for pair in paired:
        beside[pair.button] = _through_pair(plates[pair.plate].labels)
    lying = [
        pair
        for pair in strays(boxes[:count], boxes[count:], paired)
        if _may_be_plate(buttons[pair.plate], buttons[pair.button])
    ]
    settled = {k for pair in lying for k in pair} | {pair.button for pair in paired}
    lying += _beside_blank(buttons, boxes, settled)
    for pair in lying:
        beside[pair.button] = _through_pair(buttons[pair.plate].labels)
        own[pair.plate] = {"": PAIRED}
    named = {pair.button for pair in (*paired, *lying)} | {pair.plate for pair in lying}
    for k, said in enumerate(buttons):
        if said.kind == "other" and k not in named:
            total = max(1.0, said.kind_confidence + sum(own[k].values()))
            own[k] = {label: p / total for label, p in own[k].items()}
            own[k][""] = said.kind_confidence / total
    return Evidence(tuple(own), tuple(beside), paired, tuple(lying))


def _agreement(buttons: Sequence[Said], plates: Sequence[Said]) -> FloatArray:
    """What readings say of each plate and button, as of `fronto.labels.plates.pairs`."""
    agreement = np.zeros((len(plates), len(buttons)))
    likeliest = [best(button.labels) for button in buttons]
    for i, plate in enumerate(plates):
        label, p = best(plate.labels)
        if not label or label == STAR:
            continue
        for j, (other, q) in enumerate(likeliest):
            if buttons[j].kind in ("blank", "other"):
                agreement[i, j] = BLANK * p
            elif other:
                agreement[i, j] = p * q * (1 if label_key(label) == label_key(other) else OTHER)
    return agreement


def _may_be_plate(plate: Said, button: Said) -> bool:
    """Whether one thing among the buttons names another beside it, by what both show."""
    label, p = best(plate.labels)
    if p < READ or label == STAR:
        return False
    return button.kind in SILENT or label_key(best(button.labels)[0]) == label_key(label)


def _beside_blank(buttons: Sequence[Said], boxes: FloatArray, settled: set[int]) -> list[Pair]:
    """Plates among the buttons of a panel whose plates were not found as such."""
    left = [k for k in range(len(buttons)) if k not in settled]
    blank = [k for k in left if buttons[k].kind == "blank"]
    texts = [k for k in left if best(buttons[k].labels)[1] >= READ]
    floors = {k for k in texts if is_floor(best(buttons[k].labels)[0])}
    found = [Pair(texts[i], blank[j]) for i, j in pairs(boxes[blank], boxes[texts])]
    named = floors & {pair.plate for pair in found}
    few = len(found) < max(MANY, BLANKS * len(blank)) or len(named) < FLOORS * len(floors)
    return [] if few else found


def _through_pair(labels: Belief) -> dict[str, float]:
    """What a plate says of the button that it is paired with."""
    return {label: PAIRED * p for label, p in labels.items() if label != STAR}
