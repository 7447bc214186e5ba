"""What crops of buttons and plates say, and how sure that is."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fronto.datasets.names import CATEGORY
from fronto.engine import ReaderEngine
from fronto.engine.onnxfile import checked_bytes
from fronto.errors import InputError
from fronto.labels.alphabet import CROP_PX, KINDS
from fronto.labels.decode import decode

__all__ = ["LabelReader", "Reading"]

#: What a crop can show instead of a label.
NO_LABEL = ("other", "blank", "unreadable")
#: Kinds whose name is the label.
FUNCTIONS = tuple(kind for kind in KINDS if kind != "text" and kind not in NO_LABEL)
#: Texts that say a function: "OPEN", "DN", "BELL".
WORDS = {
    name.replace(" ", "").upper(): function
    for name, function in CATEGORY.items()
    if function in FUNCTIONS
}
#: Labels less probable than this are no alternatives.
LEAST = 1e-3
#: Crops at a time: more are no faster, and need more memory.
BATCH = 64
#: Each crop is read enlarged and reduced by these factors, and what is said of all is averaged:
#: errors at one scale are seldom those at another.
VIEWS = (1.1, 0.98, 0.88)


Probabilities = Mapping[str, float]


@dataclass(frozen=True)
class Reading:
    r"""What one crop says.

    Parameters
    ----------
    text
        The label: a text in normal form ("12", "B1", "-2", "\*1", "FAN"), or the word of a
        function: "up", "down", "open", "close", "alarm", "stop", "keyhole". "" for none.
    kind
        One of `fronto.labels.alphabet.KINDS`: "text", a function, or, where `text` is "",
        what there is instead: "other", "blank" or "unreadable".
    confidence
        Probability of this label; where there is none, that of the kind. From 0 to 1; a low one
        changes nothing else, and what to make of it is up to others.
    alternatives
        Labels and their probabilities, the most probable first, this one among them.
    """

    text: str
    kind: str
    confidence: float
    alternatives: tuple[tuple[str, float], ...] = ()

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise InputError("kind", f"expected one of {', '.join(KINDS)}, got {self.kind!r}")
        for name, value in (("confidence", self.confidence), *self.alternatives):
            if not 0 <= value <= 1:
                raise InputError(name, f"expected a probability from 0 to 1, got {value}")


class LabelReader:
    """Reads crops of buttons and plates; several threads may share one.

    Parameters
    ----------
    engine
        The network; None: the one in the package.
    views
        Enlargements at which each crop is read; None: those that were found to be best.

    Raises
    ------
    InputError
        If there is no such network.
    """

    def __init__(
        self, engine: ReaderEngine | None = None, *, views: Sequence[float] | None = None
    ) -> None:
        self.engine = ReaderEngine() if engine is None else engine
        self.views = tuple(VIEWS if views is None else views)

    def read(self, crops: npt.NDArray[np.uint8]) -> tuple[Reading, ...]:
        """Read crops.

        Parameters
        ----------
        crops
            Shape (n, 48, 48, 3), uint8, RGB, as :func:`fronto.labels.crops.crops` cuts them.

        Returns
        -------
        One reading for each.

        Raises
        ------
        InputError
            If the crops are of another type or shape.
        """
        if isinstance(crops, np.ndarray) and crops.shape == (0, CROP_PX, CROP_PX, 3):
            return ()
        checked_bytes(crops, (None, CROP_PX, CROP_PX, 3), "crops", f"(N, {CROP_PX}, {CROP_PX}, 3)")
        first = self._read(crops[:BATCH])
        rest = range(BATCH, len(crops), BATCH)
        return first + tuple(r for k in rest for r in self._read(crops[k : k + BATCH]))

    def _read(self, crops: npt.NDArray[np.uint8]) -> tuple[Reading, ...]:
        views = [self._said(_zoomed(crops, factor)) for factor in self.views]
        return tuple(
            _reading(*map(_mean, zip(*said, strict=True))) for said in zip(*views, strict=True)
        )

    def _said(self, crops: npt.NDArray[np.uint8]) -> list[tuple[Probabilities, Probabilities]]:
        """Of each crop the probabilities of labels, and of what there is instead."""
        scores = self.engine.run(crops)
        kinds = [
            dict(zip(self.engine.kinds, row, strict=True))
            for row in np.minimum(scores.kind, 1).tolist()
        ]
        # Looking for texts takes longest: only where there may be one.
        rows = [k for k, kind in enumerate(kinds) if kind["text"] >= LEAST]
        texts = dict(zip(rows, decode(scores.text[rows], self.engine.alphabet), strict=True))
        return [_labels(kind, texts.get(k, ())) for k, kind in enumerate(kinds)]


def _zoomed(crops: npt.NDArray[np.uint8], factor: float) -> npt.NDArray[np.uint8]:
    """Crops (n, 48, 48, 3), enlarged about their centres; beyond their border its pixels go on."""
    if factor == 1:
        return crops
    import cv2

    middle = (CROP_PX - 1) / 2
    shift = middle * (1 - 1 / factor)
    matrix = np.array([[1 / factor, 0, shift], [0, 1 / factor, shift]])
    result = np.empty_like(crops)
    for k, crop in enumerate(crops):
        result[k] = cv2.warpAffine(
            crop,
            matrix,
            (CROP_PX, CROP_PX),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_REPLICATE,
        )
    return result


def _mean(views: Sequence[Probabilities]) -> dict[str, float]:
    """Mean probability of each label that any of the views names."""
    total: dict[str, float] = {}
    for view in views:
        for label, probability in view.items():
            total[label] = total.get(label, 0.0) + probability / len(views)
    return total


def _labels(
    kinds: Mapping[str, float], texts: Sequence[tuple[str, float]]
) -> tuple[Probabilities, Probabilities]:
    """What the probabilities of kinds, and of texts where it is one, say of labels and of none."""
    labels = {function: kinds[function] for function in FUNCTIONS}
    nothing = {kind: kinds[kind] for kind in NO_LABEL}
    if not texts:
        nothing["unreadable"] += kinds["text"]
    for text, probability in texts:
        probability *= kinds["text"]
        if text:
            label = WORDS.get(text, text)
            labels[label] = labels.get(label, 0.0) + probability
        else:
            nothing["unreadable"] += probability
    return labels, nothing


def _reading(labels: Probabilities, nothing: Probabilities) -> Reading:
    """What probabilities of labels, and of what there is instead, come to."""
    ranked = sorted(labels.items(), key=lambda item: -item[1])
    alternatives = tuple((label, min(p, 1.0)) for label, p in ranked if p >= LEAST)
    # Whether there is a label comes first: several texts that are likely together are one
    # label that is not sure, even where each is less likely than none.
    if sum(nothing.values()) > 0.5 or not alternatives:
        kind = max(nothing, key=nothing.__getitem__)
        return Reading("", kind, min(nothing[kind], 1.0), alternatives)
    label, confidence = alternatives[0]
    return Reading(label, label if label in FUNCTIONS else "text", confidence, alternatives)
