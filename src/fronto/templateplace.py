"""Where a known layout lies on a panel whose buttons were found and read."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from fronto.errors import InputError
from fronto.labels.series import label_key, normal_label
from fronto.pose.template import Template
from fronto.results import Button, Panel
from fronto.shapes import FloatArray, Outline

__all__ = ["Placement", "place_template", "with_template"]

#: How far from its place a button may be, in button widths: rectified views of a first look are
#: not exact, and the next button is a width away at least.
NEAR = 0.35
#: A reading counts as a vote from this probability on.
VOTE = 0.5
#: So many votes at least (of a panel of two buttons both), and so many more than against, place a
#: layout: any two readings can be laid over it somehow.
VOTES, MORE = 3, 2
#: Sizes of placed buttons whose logarithm misses the layout's by more than this are another
#: panel's.
MISSIZED = 0.25


@dataclass(frozen=True)
class Placement:
    """Which button of a layout each button of a panel is.

    Parameters
    ----------
    partner
        For each button of the panel the index of the layout's, or None.
    agree, contradict
        Buttons whose own label is the one that the layout has there, or another.
    """

    partner: tuple[int | None, ...]
    agree: int
    contradict: int

    @property
    def confidence(self) -> float:
        """Probability that a button is what the layout says (Laplace's rule of succession)."""
        return (self.agree + 1) / (self.agree + self.contradict + 2)


def place_template(panel: Panel, template: Template) -> Placement:
    """Lay a layout over a panel, so that as many readings as possible agree with it.

    Parameters
    ----------
    panel
        With a rotation, its buttons named as far as they can be read.
    template
        The layout; its labels are all different.

    Raises
    ------
    InputError
        If the panel does not show where the layout lies: why, in words.
    """
    keys = [label_key(normal_label(b.label)) for b in template.buttons]
    if "" in keys or len(set(keys)) < len(keys):
        raise _unplaced("its buttons need labels, all of them different, to be found by")
    if panel.pose.status not in ("ok", "uncertain"):
        raise _unplaced("the panel's rotation is not known")
    centers, width = _on_plane(panel)
    layout = np.array([(b.x_mm, b.y_mm) for b in template.buttons])
    read = [_vote(button) for button in panel.buttons]
    votes = [(k, keys.index(label)) for k, label in enumerate(read) if label in keys]
    best: Placement | None = None
    for one, other in combinations(votes, 2):
        fit = _laid(centers, layout, one, other)
        if fit is None or _missized(panel, template, fit[0], (one, other)):
            continue
        partner = _partners(centers, layout * fit[0] + fit[1], NEAR * width)
        seen = [(read[k], keys[p]) for k, p in enumerate(partner) if p is not None and read[k]]
        agree = sum(label == key for label, key in seen)
        found = Placement(partner, agree, len(seen) - agree)
        if best is None or agree - found.contradict > best.agree - best.contradict:
            best = found
    few = 0 if best is None else best.agree
    if best is None or few < min(VOTES, len(keys)) or few - best.contradict < MORE:
        raise _unplaced(f"{few} of its labels were read where it has them, too few")
    return best


def with_template(
    panel: Panel, template: Template, solve: Callable[[Sequence[Outline]], Panel]
) -> Panel:
    """Solve a panel again with the layout that its labels show it to have.

    Parameters
    ----------
    panel
        Found, solved and read without the layout.
    template
        The layout.
    solve
        Solves with the layout, from outlines that have its labels as their texts.

    Returns
    -------
    The new result, its labels those of the layout ("template") where nothing was read; the
    same one with a note where the layout cannot be placed.
    """
    try:
        placed = place_template(panel, template)
    except InputError as error:
        return replace(panel, notes=(*panel.notes, str(error)))
    texts = ["" if p is None else template.buttons[p].label for p in placed.partner]
    outlines = [
        replace(button.outline, text=text)
        for button, text in zip(panel.buttons, texts, strict=True)
    ]
    solved = solve(outlines)
    buttons = tuple(
        _labelled(new, old, text, placed.confidence)
        for new, old, text in zip(solved.buttons, panel.buttons, texts, strict=True)
    )
    note = f"template: {sum(map(bool, texts))} of {len(template.buttons)} buttons are in the photo"
    return replace(
        solved, buttons=buttons, plates=panel.plates, notes=(*panel.notes, *solved.notes, note)
    )


def _unplaced(why: str) -> InputError:
    return InputError("template", f"not used: {why}", "check that it is this panel's")


def _vote(button: Button) -> str:
    """The key of what a button was read as, "" where that is not sure."""
    label, sure = button.label, button.label_confidence
    if label and sure is None:  # it came with the outline
        sure = 1.0
    if not label and button.label_guesses:
        label, sure = button.label_guesses[0]
    return label_key(normal_label(label)) if label and (sure or 0.0) >= VOTE else ""


def _on_plane(panel: Panel) -> tuple[FloatArray, float]:
    """Centres (n, 2) on the panel's plane and the typical width, in one unit."""
    corners = panel.pose.plane_corners
    sizes = corners[:, 2] - corners[:, 0]
    return corners.mean(axis=1), float(np.median(sizes[:, 0]))


def _laid(
    centers: FloatArray, layout: FloatArray, one: tuple[int, int], other: tuple[int, int]
) -> tuple[float, FloatArray] | None:
    """Scale and offset that put the layout on two of the buttons; None if nothing does."""
    between = centers[other[0]] - centers[one[0]]
    stated = layout[other[1]] - layout[one[1]]
    length = float(stated @ stated)
    scale = float(between @ stated) / length if length > 0 else 0.0
    if scale <= 0:
        return None
    middle = 0.5 * (centers[one[0]] + centers[other[0]])
    offset = middle - scale * 0.5 * (layout[one[1]] + layout[other[1]])
    return scale, offset


def _missized(
    panel: Panel, template: Template, scale: float, pairs: Sequence[tuple[int, int]]
) -> bool:
    """Whether buttons, with the layout's that they would be, have another size than it states."""
    for k, p in pairs:
        stated = template.buttons[p].width_mm
        corners = panel.pose.plane_corners[k]
        width = float(np.linalg.norm(corners[1] - corners[0]))
        if stated is not None and abs(np.log(width / (scale * stated))) > MISSIZED:
            return True
    return False


def _partners(centers: FloatArray, places: FloatArray, reach: float) -> tuple[int | None, ...]:
    """For each centre the place that is near, where each is the other's nearest."""
    apart = np.linalg.norm(centers[:, None] - places[None], axis=2)
    nearest, back = apart.argmin(axis=1), apart.argmin(axis=0)
    return tuple(
        int(p) if apart[k, p] < reach and back[p] == k else None for k, p in enumerate(nearest)
    )


def _labelled(new: Button, old: Button, text: str, confidence: float) -> Button:
    """The old button's label in the new one, where the layout has no other to say."""
    new = replace(new, lit=old.lit)
    same = label_key(normal_label(text)) == label_key(normal_label(old.label))
    if text and not same:
        label = normal_label(text)
        guesses = ((label, confidence),)
        return replace(
            new,
            label=label,
            label_confidence=confidence,
            label_source="template",
            label_guesses=guesses,
        )
    return replace(
        new,
        label=old.label,
        label_confidence=old.label_confidence,
        label_source=old.label_source,
        label_guesses=old.label_guesses,
    )
