"""What the buttons of a panel are called: readings, plates and the panel's order together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
import numpy.typing as npt

from fronto.labels.belief import Belief, best, combined, ranked
from fronto.labels.crops import crops
from fronto.labels.evidence import Evidence, Said, gather
from fronto.labels.layout import grid_of, panel_boxes, straightened
from fronto.labels.lit import lit_scores
from fronto.labels.order import in_order
from fronto.labels.series import is_floor, label_key, normal_label
from fronto.labels.turned import upright_readings
from fronto.results import Button, LabelSource, Panel, Plate

if TYPE_CHECKING:
    from fronto.labels.reader import LabelReader, Reading

__all__ = ["Reader", "name_buttons", "packaged_reader"]

#: A label less probable than this, or less than so many times as probable as the next, is none: the
#: button is declined. Of legible labels of photos (docs/labels.md) that leaves some 2 % wrong;
#: `label_confidence` is there for those who need to be surer.
NAMED, CLEARLY = 0.5, 1.5
#: The same for a floor, which the order bears out, and for another label, of a whole button, where
#: no other button of the panel is called so with that share of the probability: then the rest is
#: spread thin over many labels.
ALONE, SIGN_ALONE, CLEARLY_ALONE, CONTESTED = 0.3, 0.45, 2.0, 0.5
#: What readings alone make so probable is not overruled by the neighbours, only declined; and where
#: a button and its plate say different things, so much is asked for.
CERTAIN = 0.8
#: A label that readings alone make less probable than this is its neighbours' word.
READ = 0.5
#: What part of a button shows may be part of its label: "1" of "12".
TRUNCATED = 0.5
#: Guesses worth stating.
GUESSES, LEAST = 5, 1e-3


class Reader(Protocol):
    """What reads crops, such as :class:`fronto.labels.reader.LabelReader`."""

    def read(self, crops: npt.NDArray[np.uint8], /) -> Sequence[Reading]:
        """Read crops (n, 48, 48, 3), uint8, RGB."""


@cache
def packaged_reader(threads: int | None = None) -> LabelReader | None:
    """The label reader of the package; None as long as the package has no weights for one.

    Made on first use, then kept.

    Parameters
    ----------
    threads
        That work on one call; None: all usable cores.

    Raises
    ------
    InputError
        If there are weights, and they cannot be used.
    """
    from importlib.resources import files

    from fronto.engine import ReaderEngine
    from fronto.labels.reader import LabelReader

    names = [file.name for file in (files("fronto") / "weights").iterdir()]
    if not any(name.startswith("fronto-read-") for name in names):
        return None
    return LabelReader(ReaderEngine(threads=threads))


def name_buttons(panel: Panel, photo: npt.NDArray[Any], reader: Reader) -> Panel:
    """Read the labels of a panel's buttons and plates.

    Each button and plate is read by itself. A plate speaks for the button beside it
    (`fronto.labels.plates`), then all buttons are weighed by their neighbours
    (`fronto.labels.order`). A label that is not sure enough after that is left out. Labels that
    came with the outlines stay, and help to name the others.

    Parameters
    ----------
    panel
        The result, of any status; without a pose labels are read as the photo shows them.
    photo
        Shape (h, w, 3), uint8, RGB: the photo it is of.
    reader
        What reads the crops.

    Returns
    -------
    The result with `label`, `label_confidence`, `label_source`, `label_guesses` and `lit` of its
    buttons, with its `plates` named, and notes on floors that several buttons claim and on
    plates among the buttons.

    Raises
    ------
    InputError
        If the photo is of another size than the pose's camera.
    """
    things: list[Button | Plate] = [*panel.buttons, *panel.plates]
    if not things:
        return panel
    outlines = [thing.outline for thing in things]
    cut = crops(photo, outlines, panel.pose)
    readings, lying = _readings(reader, cut, len(panel.buttons))
    said = [_said(thing, reading) for thing, reading in zip(things, readings, strict=True)]
    boxes = panel_boxes(outlines, panel.pose)
    if panel.pose.status not in ("ok", "uncertain"):
        boxes = straightened(boxes)
    count = len(panel.buttons)
    evidence = gather(said[:count], said[count:], boxes)
    seen = [combined(*both) for both in zip(evidence.own, evidence.plate, strict=True)]
    final = in_order(seen, grid_of(boxes[:count]))
    alone = _uncontested(final)
    lit = lit_scores(cut[:count])
    buttons = tuple(
        replace(
            _named(button, final[k], seen[k], evidence.own[k], evidence.plate[k], alone=alone[k]),
            lit=None if lit is None else float(lit[k]),
        )
        for k, button in enumerate(panel.buttons)
    )
    ids = {pair.plate: panel.buttons[pair.button].id for pair in evidence.pairs}
    plates = tuple(
        _named_plate(plate, said[count + k].labels, ids.get(k))
        for k, plate in enumerate(panel.plates)
    )
    notes = [*lying, *_contested(panel.buttons, seen, final), *_strays(panel.buttons, evidence)]
    return replace(panel, buttons=buttons, plates=plates, notes=(*panel.notes, *notes))


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


def _given(thing: Button | Plate) -> str:
    """The label that came with the outline, in normal form; "" where none did."""
    return normal_label(thing.label) if thing.label_confidence is None else ""


def _said(thing: Button | Plate, reading: Reading) -> Said:
    """What a button or plate says by itself."""
    given = _given(thing)
    if given:
        return Said({given: 1.0}, "text")
    total = max(1.0, sum(p for _, p in reading.alternatives))  # they are rounded
    trust = TRUNCATED if thing.outline.truncated else 1.0
    labels = {label: trust * p / total for label, p in reading.alternatives if p > 0}
    return Said(labels, reading.kind, trust * reading.confidence)


def _uncontested(final: Sequence[Belief]) -> list[bool]:
    """Whether no other button may well have each one's likeliest label."""
    told = [best(belief) for belief in final]
    keyed = [{label_key(label): p for label, p in belief.items()} for belief in final]
    return [
        all(
            other.get(label_key(label), 0.0) < CONTESTED * p
            for j, other in enumerate(keyed)
            if j != k
        )
        for k, (label, p) in enumerate(told)
    ]


def _named(
    button: Button, final: Belief, seen: Belief, own: Belief, plate: Belief, *, alone: bool
) -> Button:
    """A button with what is sure enough of its label, which is its `alone` or others' too."""
    if _given(button):
        return button
    label, probability = best(final)
    probability = min(1.0, probability)
    guesses = tuple((guess, min(1.0, p)) for guess, p in ranked(final)[:GUESSES] if p >= LEAST)
    named = replace(button, label_confidence=probability, label_guesses=guesses)
    read, sure = best(seen)
    next_best = max((p for other, p in final.items() if other != label), default=0.0)
    likely = [said for said, p in (best(own), best(plate)) if said and p >= READ]
    disagree = len({label_key(said) for said in likely}) > 1
    unclear = probability < max(NAMED, CLEARLY * next_best)
    if alone and not button.outline.truncated:
        least = ALONE if is_floor(label) else SIGN_ALONE
        unclear &= probability < max(least, CLEARLY_ALONE * next_best)
    # The order does not settle what a button and its plate say against each other.
    unclear |= disagree and seen.get(label, 0.0) < CERTAIN
    if not label or unclear or (read != label and sure >= CERTAIN):
        return replace(named, label="", label_source=None)
    source: LabelSource = "button" if own.get(label, 0.0) >= plate.get(label, 0.0) else "plate"
    if is_floor(label) and (read != label or sure < READ):
        source = "inferred"
    return replace(named, label=label, label_source=source)


def _named_plate(plate: Plate, said: Belief, button: int | None) -> Plate:
    if _given(plate):
        return replace(plate, button=button)
    label, probability = best(said)
    sure = probability >= NAMED
    return replace(
        plate, label=label if sure else "", label_confidence=min(1.0, probability), button=button
    )


def _contested(
    buttons: Sequence[Button], seen: Sequence[Belief], final: Sequence[Belief]
) -> Iterator[str]:
    """Remarks on floors that several buttons claim by themselves."""
    claims: dict[str, list[int]] = {}
    for k, (label, p) in enumerate(map(best, seen)):
        if p >= READ and is_floor(label):
            claims.setdefault(label_key(label), []).append(k)
    for key, several in claims.items():
        if len(several) > 1:
            won = [k for k in several if label_key(best(final[k])[0]) == key]
            won = [k for k in won if best(final[k])[1] >= NAMED]
            kept = f"only {buttons[won[0]].id} is named so" if won else "none is named so"
            ids = ", ".join(str(buttons[k].id) for k in several)
            yield f"buttons {ids} all seem to be {key}: {kept}"


def _strays(buttons: Sequence[Button], evidence: Evidence) -> Iterator[str]:
    """Remarks on plates among the buttons."""
    for plate, button in evidence.strays:
        yield f"button {buttons[plate].id} is rather the plate of button {buttons[button].id}"
