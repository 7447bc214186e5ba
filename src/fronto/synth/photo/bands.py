"""Rows and columns of buttons with their plates."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from fronto.synth.photo.draws import chance, log_uniform, pick
from fronto.synth.photo.forms import Form
from fronto.synth.photo.plan import KEY_STYLE, PLATE_STYLE, Element, Fixture, Label

__all__ = ["Sheet", "Side", "grid", "random_form", "random_gap", "random_side"]


@dataclass
class Sheet:
    """A panel in the making: bands are stacked downwards from y, around x = 0; millimetres.

    Parameters
    ----------
    rng
        Draws everything.
    unit
        Size of a button.
    y, half
        Where the next band starts, and half the width so far.
    elements, fixtures
        What has been placed.
    lit
        Probability that a button is lit.
    pills
        Whether a dark pill holds each button together with its label.
    twins
        Whether the labels are on plates that look like the buttons beside them.
    """

    rng: np.random.Generator
    unit: float
    y: float = 0.0
    half: float = 0.0
    elements: list[Element] = field(default_factory=list)
    fixtures: list[Fixture] = field(default_factory=list)
    lit: float = 0.0
    pills: bool = False
    twins: bool = False

    def room(self, half: float) -> None:
        """Make the panel at least that wide on both sides."""
        self.half = max(self.half, half)


def random_form(rng: np.random.Generator, unit: float, *, key: bool = False) -> Form:
    """A button's outline with a shorter side of about `unit`."""
    kinds = ("square", "rounded", "circle", "pill", "wide", "oval")
    kind = "wide" if key else pick(rng, kinds, (3, 4, 6.5, 0.8, 1.6, 0.25))
    if kind == "circle":
        return Form("ellipse", unit, unit)
    if kind == "oval":
        return Form("ellipse", unit * rng.uniform(1.15, 1.6), unit)
    aspect = rng.uniform(0.88, 1.12) if chance(rng, 0.5) else 1.0
    radius = 0.0
    if kind in ("rounded", "wide") and chance(rng, 0.7):
        radius = unit * rng.uniform(0.04, 0.25)
    if kind == "pill":
        aspect, radius = rng.uniform(1.4, 2.3), unit / 2
    elif kind == "wide":
        aspect = pick(rng, (rng.uniform(1.05, 1.4), rng.uniform(1.4, 3.0)), (1, 0.3 if key else 1))
    height = unit if aspect > 1 else unit * aspect
    width = unit * aspect if aspect > 1 else unit
    return Form(
        "box",
        width,
        height,
        min(radius, 0.25 * min(width, height)) if kind != "pill" else height / 2,
    )


@dataclass(frozen=True)
class Side:
    """Where the labels of a band are: on the buttons, or on plates beside them.

    Parameters
    ----------
    side
        "on" the buttons, or on plates "left", "right", "above", or "outer" (away from the
        middle of the panel).
    share
        Height of the plates in heights of the buttons.
    gap
        Between plate and button, in heights of the plates.
    both
        Whether the buttons say it, too.
    aspect
        Width of the plates over their height.
    blank
        Symbol on buttons that say nothing.
    hoop
        Whether a line runs round each button and its plate.
    twin
        Whether the plates have the buttons' form and size.
    """

    side: str
    share: float
    gap: float
    both: bool
    aspect: float
    blank: str
    hoop: bool = False
    twin: bool = False

    def height(self, form: Form) -> float:
        """Height of the plates beside buttons of that form."""
        return form.height if self.twin else self.share * min(form.width, form.height)

    def width(self, form: Form, label: Label) -> float:
        """Width of such a plate for a label."""
        if self.twin:
            return form.width
        height = self.height(form)
        long = max(1.0, 0.55 * len(label.text))
        return height * min(self.aspect * long, 2.2)


def random_side(sheet: Sheet) -> Side:
    """Draw where a band's labels are."""
    rng = sheet.rng
    if sheet.twins:
        return Side(
            side=pick(rng, ("left", "right", "above"), (6, 2, 2)),
            share=1.0,
            gap=rng.uniform(0.05, 0.4),
            both=chance(rng, 0.08),
            aspect=1.0,
            blank=pick(rng, ("", "dot", "ring"), (5, 1, 0.6)),
            twin=True,
        )
    side = pick(rng, ("on", "left", "right", "above", "outer"), (6, 2.4, 1.2, 0.5, 0.5))
    if sheet.pills and side in ("on", "above"):
        side = "left"
    return Side(
        side=side,
        share=rng.uniform(0.5, 1.05),
        gap=rng.uniform(0.05, 0.5),
        both=chance(rng, 0.15),
        aspect=rng.uniform(0.85, 1.5),
        blank=pick(rng, ("", "dot", "ring"), (3, 1, 0.6)),
        hoop=chance(rng, 0.12),
    )


def put(
    sheet: Sheet,
    at: tuple[float, float],
    form: Form,
    name: tuple[str, str, Label],
    style: int,
    side: Side,
    left: bool,
) -> None:
    """One button, and the plate beside it where the band has plates."""
    rng = sheet.rng
    category, text, label = name
    lit = chance(rng, sheet.lit)
    braille = chance(rng, 0.35)
    if category == "keyhole":
        size = min(form.width, form.height)
        form, style = Form("ellipse", size, size), KEY_STYLE
    if side.side == "on" or category == "keyhole":
        sheet.elements.append(Element(*at, form, category, text, label, style, lit, braille))
        return
    face = label if side.both else Label(symbol=side.blank)
    sheet.elements.append(Element(*at, form, category, text, face, style, lit))
    size, width = side.height(form), side.width(form, label)
    x, y = at
    if side.side == "above":
        y -= form.height / 2 + size / 2 + side.gap * size
    else:
        away = form.width / 2 + width / 2 + side.gap * size
        x += -away if left else away
        if side.hoop or sheet.pills:
            tall = 1.2 * max(form.height, size)
            span = form.width + width + side.gap * size + 0.5 * tall
            middle = at[0] + (-1 if left else 1) * (width + side.gap * size) / 2
            sheet.fixtures.append(Fixture("pill" if sheet.pills else "hoop", middle, y, span, tall))
    plate = form if side.twin else Form("box", width, size)
    sheet.elements.append(Element(x, y, plate, "plate", text, label, PLATE_STYLE, False, braille))


def grid(
    sheet: Sheet,
    names: list[tuple[str, str, Label]],
    columns: int,
    form: Form,
    style: int,
    *,
    gap: tuple[float, float],
    side: Side,
    stagger: float = 0.0,
    down: bool = False,
) -> None:
    """Buttons in rows; the first name is at the bottom left (`down`: at the top left)."""
    rows = -(-len(names) // columns)
    size = side.height(form)
    beside = side.side in ("left", "right", "outer")
    widest = max(side.width(form, label) for _, _, label in names)
    extra_x = widest + size * side.gap if beside else 0.0
    extra_y = size * (1 + 1.5 * side.gap) if side.side == "above" else 0.0
    step = np.array([form.width + extra_x + gap[0], form.height + extra_y + gap[1]])
    top = sheet.y + extra_y + form.height / 2
    lean = {"left": extra_x / 2, "right": -extra_x / 2}.get(side.side, 0.0)
    if chance(sheet.rng, 0.15):
        tall = (rows + stagger) * step[1] + 0.1 * sheet.unit
        middle = sheet.y + ((rows + stagger) * step[1] - gap[1]) / 2
        wide = columns * step[0] + 0.2 * sheet.unit
        sheet.fixtures.append(Fixture("strip", 0.0, float(middle), float(wide), float(tall)))
    middle_last = not down and chance(sheet.rng, 0.5)
    for index, name in enumerate(names):
        row, column = divmod(index, columns)
        count = columns if (row + 1) * columns <= len(names) else len(names) - row * columns
        x = (column - (columns - 1) / 2) * step[0] + lean
        if count < columns and middle_last:
            x = (column - (count - 1) / 2) * step[0] + lean
        line = row if down else rows - 1 - row
        y = top + line * step[1] + stagger * (column % 2) * step[1]
        left = side.side == "left" or (side.side == "outer" and column < columns / 2)
        put(sheet, (float(x), float(y)), form, name, style, side, left)
    if side.side in ("on", "left", "right") and chance(sheet.rng, 0.06):
        _legends(sheet, float(columns * step[0] / 2), float(top), rows, float(step[1]), form)
    sheet.room(float(columns * step[0] / 2))
    sheet.y = float(top + (rows - 1 + stagger) * step[1] + form.height / 2)


def _legends(sheet: Sheet, x: float, top: float, rows: int, pitch: float, form: Form) -> None:
    """What is on each floor, in words beside the rows: nothing that anybody presses."""
    wide = form.width * sheet.rng.uniform(1.5, 4)
    side = -1 if chance(sheet.rng, 0.5) else 1
    for row in range(rows):
        at = (side * (x + 0.55 * wide), top + row * pitch)
        tall = min(0.9 * pitch, form.height)
        sheet.fixtures.append(Fixture("legend", *at, wide, tall))
    sheet.room(x + 1.1 * wide)


def random_gap(rng: np.random.Generator, unit: float) -> tuple[float, float]:
    """Room between buttons: from touching to far apart, in both directions."""
    if chance(rng, 0.15):
        tight = rng.uniform(0, 1.2)
        return (tight, tight) if chance(rng, 0.6) else (unit * rng.uniform(0.1, 0.8), tight)
    return unit * log_uniform(rng, 0.06, 1.8), unit * log_uniform(rng, 0.06, 1.2)
