"""What the labels of a panel say: read one by one, put together with plates, and in order."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import numpy.typing as npt

from fronto.labels.belief import combined
from fronto.labels.context import Context, describe
from fronto.labels.crops import crops
from fronto.labels.evidence import Evidence, Said, gather
from fronto.labels.layout import grid_of, panel_boxes, straightened
from fronto.labels.order import in_order
from fronto.labels.series import normal_label
from fronto.labels.turned import upright_readings
from fronto.results import Button, Panel, Plate
from fronto.shapes import FloatArray

if TYPE_CHECKING:
    from fronto.labels.reader import Reading

__all__ = ["PanelReading", "Reader", "given_label", "put_together", "read_panel"]

#: What part of a button shows may be part of its label: "1" of "12".
TRUNCATED = 0.5


class Reader(Protocol):
    """What reads crops, such as :class:`fronto.labels.reader.LabelReader`."""

    def read(self, crops: npt.NDArray[np.uint8], /) -> Sequence[Reading]:
        """Read crops (n, 48, 48, 3), uint8, RGB."""


@dataclass(frozen=True, eq=False)
class PanelReading:
    """What the buttons and plates of a panel say.

    Parameters
    ----------
    things
        The buttons, then the plates.
    said
        What each of them says by itself.
    boxes
        Shape (n, 4): where they are on the panel, as of `fronto.labels.layout.panel_boxes`.
    posed
        Whether the panel's pose is sure ("ok").
    evidence
        What is made of that: which plate names which button.
    seen, ordered
        What each button's label may be: by its print and its plate; and in the panel's order.
    """

    things: tuple[Button | Plate, ...]
    said: tuple[Said, ...]
    boxes: FloatArray
    posed: bool
    evidence: Evidence
    seen: tuple[dict[str, float], ...]
    ordered: tuple[dict[str, float], ...]

    def context(self, labels: Sequence[str]) -> Context:
        """The same for a context head that knows these labels."""
        return describe(
            self.things,
            self.said,
            self.evidence,
            self.seen,
            self.ordered,
            self.boxes,
            labels,
            posed=self.posed,
        )


def read_panel(
    panel: Panel, photo: npt.NDArray[Any], reader: Reader
) -> tuple[PanelReading, npt.NDArray[np.uint8], list[str]]:
    """Read the buttons and plates of a panel that has some.

    Parameters
    ----------
    panel, photo, reader
        As of `fronto.labels.name.name_buttons`.

    Returns
    -------
    What they say; the buttons' crops (n, 48, 48, 3); remarks on labels that are turned.
    """
    things: list[Button | Plate] = [*panel.buttons, *panel.plates]
    count = len(panel.buttons)
    outlines = [thing.outline for thing in things]
    cut = crops(photo, outlines, panel.pose)
    readings, notes = _readings(reader, cut, count)
    said = [_said(thing, reading) for thing, reading in zip(things, readings, strict=True)]
    boxes = panel_boxes(outlines, panel.pose)
    if panel.pose.status not in ("ok", "uncertain"):
        boxes = straightened(boxes)
    told = put_together(things, said, boxes, count, posed=panel.pose.status == "ok")
    return told, cut[:count], notes


def put_together(
    things: Sequence[Button | Plate],
    said: Sequence[Said],
    boxes: FloatArray,
    count: int,
    *,
    posed: bool,
) -> PanelReading:
    """Pair plates with buttons, and look at the order of all.

    Parameters
    ----------
    things, said, boxes, posed
        As of `PanelReading`.
    count
        How many of the things are buttons.
    """
    evidence = gather(said[:count], said[count:], boxes)
    seen = tuple(combined(*both) for both in zip(evidence.own, evidence.plate, strict=True))
    ordered = in_order(seen, grid_of(boxes[:count]))
    return PanelReading(tuple(things), tuple(said), boxes, posed, evidence, seen, ordered)


def given_label(thing: Button | Plate) -> str:
    """The label that came with the outline, in normal form; "" where none did."""
    return normal_label(thing.label) if thing.label_confidence is None else ""


def _readings(
    reader: Reader, cut: npt.NDArray[np.uint8], count: int
) -> tuple[list[Reading], list[str]]:
    """What crops of so many buttons, then of plates, say; remarks on those that are turned."""
    readings = reader.read(cut)
    found: list[Reading] = []
    notes = []
    for name, part in (("buttons", slice(0, count)), ("plates", slice(count, None))):
        said, way = upright_readings(reader.read, cut[part], readings[part])
        found += said
        if way:
            notes.append(f"the labels on the {name} are turned {way}")
    return found, notes


def _said(thing: Button | Plate, reading: Reading) -> Said:
    """What a button or plate says by itself."""
    given = given_label(thing)
    if given:
        return Said({given: 1.0}, "text")
    total = max(1.0, sum(p for _, p in reading.alternatives))  # they are rounded
    trust = TRUNCATED if thing.outline.truncated else 1.0
    labels = {label: trust * p / total for label, p in reading.alternatives if p > 0}
    return Said(labels, reading.kind, trust * reading.confidence)
