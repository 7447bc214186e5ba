"""What the buttons of a panel are called: readings, plates and the panel's order together."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy.typing as npt

from fronto.labels.belief import Belief, best, ranked
from fronto.labels.context import Head, beliefs
from fronto.labels.evidence import Evidence
from fronto.labels.lit import lit_scores
from fronto.labels.order import once_only
from fronto.labels.panelreading import Reader, given_label, read_panel
from fronto.labels.series import is_floor, label_key
from fronto.results import Button, LabelSource, Panel, Plate

if TYPE_CHECKING:
    from fronto.labels.reader import LabelReader

__all__ = ["name_buttons", "packaged_reader"]

#: A label less probable than this, all things considered, is none: the button is declined.
#: `label_confidence` is there for those who need to be surer.
NAMED = 0.5
#: What readings alone make so probable is not overruled by the neighbours, only declined; and where
#: a button and its plate say different things, so much is asked for.
CERTAIN = 0.8
#: What readings alone make likelier than not.
READ = 0.5
#: A label that readings alone make less probable than this is its neighbours' word.
HINTED = 0.25
#: Guesses worth stating.
GUESSES, LEAST = 5, 1e-3


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
    from fronto.engine import packaged_reader as packaged_engine
    from fronto.labels.reader import LabelReader

    engine = packaged_engine(threads)
    return None if engine is None else LabelReader(engine)


def name_buttons(
    panel: Panel, photo: npt.NDArray[Any], reader: Reader, head: Head | None = None
) -> Panel:
    """Read the labels of a panel's buttons and plates.

    Each button and plate is read by itself. A plate speaks for the button beside it
    (`fronto.labels.plates`), then all buttons are weighed by their neighbours
    (`fronto.labels.order`, `fronto.labels.context`). A label that is not sure enough after
    that is left out. Labels that came with the outlines stay, and help to name the others.

    Parameters
    ----------
    panel
        The result, of any status; without a pose labels are read as the photo shows them.
    photo
        Shape (h, w, 3), uint8, RGB: the photo it is of.
    reader
        What reads the crops.
    head
        The context head that weighs the buttons; None: the panel's order does.

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
    if not (panel.buttons or panel.plates):
        return panel
    told, cut, notes = read_panel(panel, photo, reader)
    evidence, seen = told.evidence, told.seen
    final: Sequence[Belief] = told.ordered
    if head is not None and panel.buttons:
        weighed = head.run(told.context(head.labels))[: len(final)]
        final = once_only(beliefs(weighed, final, head.labels))
    lit = lit_scores(cut)
    buttons = tuple(
        replace(
            _named(button, final[k], seen[k], evidence.own[k], evidence.plate[k]),
            lit=None if lit is None else float(lit[k]),
        )
        for k, button in enumerate(panel.buttons)
    )
    ids = {pair.plate: panel.buttons[pair.button].id for pair in evidence.pairs}
    plates = tuple(
        _named_plate(plate, told.said[len(seen) + k].labels, ids.get(k))
        for k, plate in enumerate(panel.plates)
    )
    notes += [*_contested(panel.buttons, seen, final), *_strays(panel.buttons, evidence)]
    return replace(panel, buttons=buttons, plates=plates, notes=(*panel.notes, *notes))


def _named(button: Button, final: Belief, seen: Belief, own: Belief, plate: Belief) -> Button:
    """A button with what is sure enough of its label."""
    if given_label(button):
        return button
    label, probability = best(final)
    probability = min(1.0, probability)
    guesses = tuple((guess, min(1.0, p)) for guess, p in ranked(final)[:GUESSES] if p >= LEAST)
    named = replace(button, label_confidence=probability, label_guesses=guesses)
    read, sure = best(seen)
    likely = [said for said, p in (best(own), best(plate)) if said and p >= READ]
    disagree = len({label_key(said) for said in likely}) > 1
    # The neighbours do not settle what a button and its plate say against each other.
    contradicted = disagree and seen.get(label, 0.0) < CERTAIN
    overruled = read != label and sure >= CERTAIN
    if not label or probability < NAMED or contradicted or overruled:
        return replace(named, label="", label_source=None)
    source: LabelSource = "button" if own.get(label, 0.0) >= plate.get(label, 0.0) else "plate"
    if read != label or sure < HINTED:
        source = "inferred"
    return replace(named, label=label, label_source=source)


def _named_plate(plate: Plate, said: Belief, button: int | None) -> Plate:
    if given_label(plate):
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
