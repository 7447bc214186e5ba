"""Which button has a label: found, not there, or not sure; a wrong button is worse than none."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Literal

from fronto.errors import InputError
from fronto.labels.series import floor_of, label_key, normal_label
from fronto.results import Button, Panel

__all__ = [
    "SCHEMA",
    "Finding",
    "Found",
    "NotSure",
    "NotThere",
    "find_label",
    "finding_to_dict",
    "wanted_label",
]

SCHEMA = "fronto.find/1"

#: What a finding tells of its button, as the result does.
BUTTON_KEYS = (
    "label_source",
    "corners_px",
    "ellipse_px",
    "box_px",
    "center_px",
    "position_m",
    "position_std_m",
    "press_normal",
)
#: A button is found with this confidence at least, while no other has the label with more than
#: RUNNER_UP.
SURE, RUNNER_UP = 0.9, 0.1
#: A button that is not named may be the one that is looked for with more than this probability.
MAYBE = 0.1
#: Candidates worth naming, and buttons that a reason names at most.
LEAST, MOST = 0.01, 8


@dataclass(frozen=True, eq=False)
class Found:
    """The button with a label.

    Parameters
    ----------
    label
        What was looked for, in normal form.
    button
        It.
    confidence
        Probability that it is the right one, 0 to 1.
    reasons
        Remarks: where its label is from.
    """

    label: str
    button: Button
    confidence: float
    reasons: tuple[str, ...] = ()
    status: ClassVar[Literal["found"]] = "found"


@dataclass(frozen=True, eq=False)
class NotSure:
    """A label that some button may have.

    Parameters
    ----------
    label
        What was looked for, in normal form.
    candidates
        Buttons that may be it, likeliest first, with probabilities; may be empty. None of them
        should be pressed on this alone.
    reasons
        Why it is not sure, in words.
    """

    label: str
    candidates: tuple[tuple[Button, float], ...]
    reasons: tuple[str, ...]
    status: ClassVar[Literal["not_sure"]] = "not_sure"


@dataclass(frozen=True, eq=False)
class NotThere:
    """A label that no button of the panel has, as far as the photo shows it.

    Parameters
    ----------
    label
        What was looked for, in normal form.
    reasons
        What speaks for that, in words.
    """

    label: str
    reasons: tuple[str, ...]
    status: ClassVar[Literal["not_there"]] = "not_there"


Finding = Found | NotSure | NotThere


def find_label(panel: Panel, label: str, *, inferred: bool = False) -> Finding:
    r"""Find the button of a panel that has a label.

    Labels are compared in normal form, upper and lower case alike: "b1" finds B1, "1" the
    starred \*1, and words of a function find it ("bell" and "help" the alarm).

    Parameters
    ----------
    panel
        A result with its buttons named.
    label
        A floor ("12", "B1", "PH"), a function ("up", "down", "open", "close", "alarm", "stop",
        "keyhole"), or another text that is printed on a button ("FAN").
    inferred
        Take labels that only the neighbours' labels speak for as well.

    Returns
    -------
    `Found` if one button has the label for sure and no other may have it; `NotThere` if all
    buttons have other labels for sure; else `NotSure`.

    Raises
    ------
    InputError
        As of `wanted_label`.

    Examples
    --------
    >>> import fronto, numpy as np
    >>> from fronto.find import find_label
    >>> panel = fronto.rectify(np.zeros((480, 640, 3), np.uint8))
    >>> find_label(panel, "12").status
    'not_sure'
    """
    wanted = wanted_label(label)
    if not panel.buttons:
        return NotSure(wanted, (), ("no buttons were found in the photo",))
    named = [button for button in panel.buttons if _is_label(button.label, wanted)]
    named.sort(key=_confidence, reverse=True)
    others = [button for button in panel.buttons if not _is_label(button.label, wanted)]
    others.sort(key=lambda button: _guessed(button, wanted), reverse=True)
    if named:
        doubts = tuple(_doubts(named, others, wanted, inferred))
        if doubts:
            return NotSure(wanted, _candidates(named, others, wanted), doubts)
        return Found(wanted, named[0], _confidence(named[0]), _where_from(named[0]))
    unread = [button for button in others if _at_most(button, wanted) > MAYBE]
    if unread:
        which = "is" if len(unread) == 1 else "are"
        reason = f"no button has it for sure, and {_ids(unread)} {which} not read for sure"
        return NotSure(wanted, _candidates((), others, wanted), (reason,))
    loose = [p for p in panel.plates if p.button is None and _is_label(p.label, wanted)]
    if loose:
        return NotSure(wanted, (), ("a plate says so; which button it names is not sure",))
    around = _around(panel.buttons, wanted)
    if around:
        reason = f"{' and '.join(around)} are there: the button between may be hidden or missed"
        return NotSure(wanted, (), (reason,))
    return NotThere(wanted, (f"all {len(panel.buttons)} buttons found have other labels",))


def wanted_label(label: str) -> str:
    """The normal form of a label that somebody looks for.

    Raises
    ------
    InputError
        If it has no letter and no digit.
    """
    wanted = normal_label(label)
    if not wanted:
        raise InputError(
            "label",
            f"expected a floor, a function or another text, got {label!r}",
            'give one such as "12", "B1" or "open"',
        )
    return wanted


def _is_label(label: str, wanted: str) -> bool:
    return label_key(normal_label(label)) == label_key(wanted)


def _confidence(button: Button) -> float:
    """Of its label; one that came with the outlines is taken as known."""
    return 1.0 if button.label_confidence is None else button.label_confidence


def _guessed(button: Button, wanted: str) -> float:
    """Probability that a button has the wanted label, as far as it was read."""
    return sum(p for guess, p in button.label_guesses if _is_label(guess, wanted))


def _at_most(button: Button, wanted: str) -> float:
    """The same, and what nothing is known of."""
    if button.label and button.label_source != "inferred":
        return _guessed(button, wanted)
    left = max(0.0, 1 - sum(p for _, p in button.label_guesses))
    return _guessed(button, wanted) + left


def _candidates(
    named: Sequence[Button], others: Sequence[Button], wanted: str
) -> tuple[tuple[Button, float], ...]:
    guessed = [(button, _guessed(button, wanted)) for button in others]
    return (
        *((button, _confidence(button)) for button in named),
        *((button, p) for button, p in guessed if p >= LEAST),
    )


def _doubts(
    named: Sequence[Button], others: Sequence[Button], wanted: str, inferred: bool
) -> Iterator[str]:
    """Why a button with the wanted label is not found for sure."""
    first = named[0]
    if len(named) > 1:
        yield f"{_ids(named)} all have this label"
    if _confidence(first) < SURE:
        yield f"button {first.id} has it with a confidence of {_confidence(first):.2f} only"
    if first.label_source == "inferred" and not inferred:
        yield f"button {first.id} was not read: its neighbours' labels speak for it"
    rivals = [button for button in others if _guessed(button, wanted) > RUNNER_UP]
    if rivals:
        yield f"{_ids(rivals)} may have it as well"


def _ids(buttons: Sequence[Button]) -> str:
    shown = ", ".join(str(button.id) for button in buttons[:MOST])
    more = f" and {len(buttons) - MOST} more" if len(buttons) > MOST else ""
    return f"button{'s' if len(buttons) > 1 else ''} {shown}{more}"


def _where_from(button: Button) -> tuple[str, ...]:
    words = {
        "button": "read on the button",
        "plate": "read on the plate beside it",
        "inferred": "inferred from its neighbours' labels",
    }
    source = button.label_source
    return ("its label came with the outlines" if source is None else words[source],)


def _around(buttons: Sequence[Button], wanted: str) -> tuple[str, ...]:
    """The floors below and above a wanted one, if both are on a panel that counts one by one.

    A panel of odd floors, or of even ones, is none.
    """
    floor = floor_of(wanted)
    if floor is None:
        return ()
    floors = {found for b in buttons if (found := floor_of(normal_label(b.label))) is not None}
    below, above = floor.at(floor.number - 1), floor.at(floor.number + 1)
    one_by_one = any(f.at(f.number + 1) in floors for f in floors)
    return (below.label, above.label) if one_by_one and {below, above} <= floors else ()


def finding_to_dict(panel: Panel, finding: Finding) -> dict[str, Any]:
    """Plain values of a finding for JSON (schema ``fronto.find/1``, docs/result.md).

    Parameters
    ----------
    panel
        The result that was searched.
    finding
        As of `find_label`.

    Returns
    -------
    `button` and what follows it are null unless it is found.
    """
    from fronto.panelfile import button_to_dict

    found = button_to_dict(finding.button) if isinstance(finding, Found) else {}
    maybe = finding.candidates if isinstance(finding, NotSure) else ()
    return {
        "schema": SCHEMA,
        "photo": panel.image,
        "label": finding.label,
        "status": finding.status,
        "reasons": list(finding.reasons),
        "button": found.get("id"),
        "confidence": finding.confidence if isinstance(finding, Found) else None,
        **{name: found.get(name) for name in BUTTON_KEYS},
        "candidates": [{"button": button.id, "confidence": p} for button, p in maybe],
        "panel_status": panel.status,
    }
