"""What is where on a panel: buttons, plates, fixtures; drawn by the other modules.

Millimetres on the panel: x right, y down.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from fronto.synth.photo.forms import Form

__all__ = [
    "KEY_STYLE",
    "MUSHROOM_STYLE",
    "PLATE_STYLE",
    "Element",
    "Fixture",
    "Label",
    "Plan",
    "moved",
]

#: Styles of elements that look the same in every family of buttons.
PLATE_STYLE, KEY_STYLE, MUSHROOM_STYLE = -1, -2, -3

Box = tuple[float, float, float, float]


@dataclass(frozen=True)
class Label:
    """What is on a button or plate.

    Parameters
    ----------
    text
        Words, or "".
    symbol, variant
        One of ``glyphs.SYMBOLS`` and the way to draw it, or "".
    """

    text: str = ""
    symbol: str = ""
    variant: int = 0


@dataclass(frozen=True)
class Element:
    """A button or a plate.

    Parameters
    ----------
    x, y
        Middle.
    form
        Outline.
    category, text
        What it is, and what is printed on it or on the plate that belongs to it.
    label
        What is drawn on it.
    style
        Index of the button style, or one of the three above.
    lit
        Whether it is lit.
    braille
        Whether dots of braille are on it.
    """

    x: float
    y: float
    form: Form
    category: str
    text: str
    label: Label
    style: int = 0
    lit: bool = False
    braille: bool = False


@dataclass(frozen=True)
class Fixture:
    """Something that nobody presses: its kind (see ``fixtures.draw_fixture``), middle and size."""

    kind: str
    x: float
    y: float
    width: float
    height: float


@dataclass(frozen=True)
class Plan:
    """A panel: what is on it and its x0, y0, x1, y1."""

    box: Box
    elements: tuple[Element, ...]
    fixtures: tuple[Fixture, ...]
    unit: float


def moved(plan: Plan, dx: float, dy: float) -> Plan:
    """The same panel elsewhere on the wall."""
    x0, y0, x1, y1 = plan.box
    return Plan(
        (x0 + dx, y0 + dy, x1 + dx, y1 + dy),
        tuple(replace(e, x=e.x + dx, y=e.y + dy) for e in plan.elements),
        tuple(replace(f, x=f.x + dx, y=f.y + dy) for f in plan.fixtures),
        plan.unit,
    )
