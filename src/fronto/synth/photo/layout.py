"""Random panels: bands of buttons and fixtures, one above the other."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from fronto.synth.photo.bands import Sheet, Side, grid, random_form, random_gap, random_side
from fronto.synth.photo.draws import chance, log_uniform, pick, whole
from fronto.synth.photo.forms import Form
from fronto.synth.photo.labels import FUNCTIONS, floor_names, function_label, hall_label
from fronto.synth.photo.plan import KEY_STYLE, MUSHROOM_STYLE, Element, Fixture, Label, Plan

__all__ = ["random_plan"]

KEYS = ("1", "2", "3", "4", "5", "6", "7", "8", "9", "*", "0", "#")
FIXTURES = {
    "display": 6,
    "speaker": 3,
    "notice": 3,
    "reader": 0.8,
    "lantern": 1.5,
    "logo": 1,
    "camera": 0.8,
    "hatch": 1,
    "indicator": 1,
}


def _floors(sheet: Sheet) -> None:
    rng = sheet.rng
    columns = pick(rng, (1, 2, 3, 4, 5, 8), (4, 6, 2.5, 1, 0.4, 0.25))
    rows = whole(rng, 2, 14) if columns < 3 else whole(rng, 2, 9)
    count = min(60, max(2, columns * rows - whole(rng, 0, columns - 1)))
    texts = floor_names(rng, count)
    if columns > 1 and chance(rng, 0.3):  # counted column by column
        texts = [
            texts[(k % columns) * rows + k // columns]
            for k in range(count)
            if (k % columns) * rows + k // columns < count
        ]
    names = [("number", text, Label(text)) for text in texts]
    if chance(rng, 0.05):  # the main floor
        names[whole(rng, 0, min(3, count - 1))] = ("number", "*", Label(symbol="star"))
    form = random_form(rng, sheet.unit)
    stagger = 0.5 if columns == 2 and chance(rng, 0.2) else 0.0
    grid(
        sheet,
        names,
        columns,
        form,
        0,
        gap=random_gap(rng, sheet.unit),
        side=random_side(sheet),
        stagger=stagger,
    )


def _keypad(sheet: Sheet) -> None:
    rng = sheet.rng
    pad = pick(rng, (rng.uniform(0, 1.0), sheet.unit * rng.uniform(0.05, 0.5)), (3, 2))
    names = [("number" if k != "#" else "other", k, Label(k)) for k in KEYS]
    if chance(rng, 0.3):
        names[9] = ("other", "-", Label("-"))
    if chance(rng, 0.3):
        names[11] = ("other", "", Label(symbol="person"))
    side = Side("on", 1, 0, False, 1, "")
    form = random_form(rng, sheet.unit, key=chance(rng, 0.6))
    grid(sheet, names, 3, form, 0, gap=(pad, pad), side=side, down=True)


def _functions(sheet: Sheet) -> None:
    rng = sheet.rng
    columns = whole(rng, 1, 4)
    count = columns if chance(rng, 0.75) else columns * 2
    kinds = [pick(rng, FUNCTIONS, (5, 5, 4, 1.2, 1.2, 2)) for _ in range(count)]
    if count > 1 and chance(rng, 0.6):
        kinds[:2] = ["open", "close"]
    names = [function_label(rng, kind) for kind in kinds]
    same = chance(rng, 0.6)
    form = sheet.elements[0].form if same and sheet.elements else random_form(rng, sheet.unit)
    if form.kind not in ("box", "ellipse") or (sheet.elements and sheet.elements[0].style < 0):
        form = random_form(rng, sheet.unit)
    style = 0 if same else 1
    gap = random_gap(rng, sheet.unit)
    grid(sheet, names, columns, form, style, gap=gap, side=random_side(sheet), down=True)


def _special(sheet: Sheet) -> None:
    """A row of key switches and mushroom buttons."""
    rng = sheet.rng
    count = whole(rng, 1, 3)
    size = sheet.unit * rng.uniform(0.6, 1.1)
    pitch = size * rng.uniform(1.3, 2.5)
    y = sheet.y + size / 2
    for k in range(count):
        at = ((k - (count - 1) / 2) * pitch, y)
        if chance(rng, 0.3):
            category = pick(rng, ("stop", "alarm"), (3, 1))
            forms = (
                Form("octagon", size, size),
                Form("ellipse", size, size),
                Form("box", 0.6 * size, size, 0.05 * size),  # a rocker switch
            )
            form = pick(rng, forms, (1, 2, 0.8))
            label = Label("STOP" if category == "stop" and chance(rng, 0.5) else "")
            element = Element(*at, form, category, label.text, label, MUSHROOM_STYLE)
        else:
            form = Form("ellipse", 0.8 * size, 0.8 * size)
            element = Element(*at, form, "keyhole", "", Label(), KEY_STYLE)
        sheet.elements.append(element)
        if chance(rng, 0.5):
            sheet.fixtures.append(
                Fixture("caption", at[0], y + 0.75 * size, pitch * 0.8, 0.22 * size)
            )
    sheet.room(count * pitch / 2)
    sheet.y = y + size * 0.9


def _hall(sheet: Sheet) -> None:
    rng = sheet.rng
    kinds = pick(rng, (["up", "down"], ["up"], ["down"]), (5, 1, 1))
    names = [hall_label(rng, kind) for kind in kinds]
    form = random_form(rng, sheet.unit)
    if chance(rng, 0.06):
        form = Form("up", form.width, form.height)
    columns = len(names) if chance(rng, 0.25) else 1
    side = Side("on", 1, 0, False, 1, "")
    if form.kind == "up":
        first = len(sheet.elements)
        for name in names:
            shape = Form("up" if name[0] == "up" else "down", form.width, form.height)
            grid(sheet, [name], 1, shape, 0, gap=(0, 0), side=side)
            sheet.y += 0.4 * sheet.unit
        assert len(sheet.elements) > first
        return
    grid(sheet, names, columns, form, 0, gap=random_gap(rng, sheet.unit), side=side, down=True)


def _fixture(sheet: Sheet) -> None:
    rng = sheet.rng
    kind = pick(rng, list(FIXTURES), list(FIXTURES.values()))
    wide = sheet.unit * rng.uniform(1.0, 3.2)
    tall = wide * rng.uniform(0.35, 1.1)
    if kind in ("reader", "camera", "lantern"):
        tall = wide = sheet.unit * rng.uniform(0.5, 1.4)
    elif kind == "indicator":
        wide = sheet.unit * rng.uniform(2, 6)
        tall = wide * rng.uniform(0.12, 0.25)
    sheet.fixtures.append(Fixture(kind, 0.0, sheet.y + tall / 2, wide, tall))
    sheet.room(wide / 2)
    sheet.y += tall


def _screws(sheet: Sheet, box: tuple[float, float, float, float]) -> None:
    inset = sheet.unit * sheet.rng.uniform(0.15, 0.35)
    size = sheet.unit * sheet.rng.uniform(0.12, 0.25)
    for x in (box[0] + inset, box[2] - inset):
        for y in (box[1] + inset, box[3] - inset):
            sheet.fixtures.append(Fixture("screw", x, y, size, size))


def random_plan(rng: np.random.Generator, *, twins: bool = False, pills: float = 0.1) -> Plan:
    """Draw a panel around x = 0; its buttons are 12 to 60 mm in size.

    With `twins` its labels are on plates that look like the buttons beside them; else a share of
    all panels, `pills`, have dark pills that hold each button together with its label.
    """
    sheet = Sheet(rng, unit=log_uniform(rng, 14, 45), twins=twins)
    sheet.lit = pick(rng, (0.0, 0.08, rng.uniform(0.2, 0.7), 1.0), (4, 4, 1, 0.7))
    sheet.pills = chance(rng, pills) and not twins
    kind = pick(rng, ("hall", "car", "keypad"), (4, 7, 1.2))
    bands: list[Callable[[Sheet], None]]
    if kind == "hall":
        bands = [_hall]
    elif kind == "keypad":
        bands = [_keypad]
    else:
        bands = [_floors]
    if kind != "hall" or chance(rng, 0.1):
        for _ in range(pick(rng, (0, 1, 2), (2, 6, 2) if kind == "car" else (6, 2, 1))):
            bands.insert(len(bands) if chance(rng, 0.7) else 0, _functions)
    if chance(rng, 0.35):
        bands.insert(len(bands) if chance(rng, 0.7) else 0, _special)
    for _ in range(pick(rng, (0, 1, 2, 3), (3, 4, 3, 1))):
        bands.insert(0 if chance(rng, 0.75) else len(bands), _fixture)
    for band in bands:
        band(sheet)
        sheet.y += sheet.unit * rng.uniform(0.25, 1.0)
    margin = sheet.unit * log_uniform(rng, 0.25, 1.5) * np.ones(4)
    if chance(rng, 0.3):  # the wall of the car is the panel
        margin += rng.uniform(2, 25, 4) * sheet.unit
    elif chance(rng, 0.4):
        margin[[1, 3]] += rng.uniform(0, 6, 2) * sheet.unit
    left, top, right, bottom = (float(value) for value in margin)
    box = (-sheet.half - left, -top, sheet.half + right, sheet.y + bottom)
    if chance(rng, 0.35):
        _screws(sheet, box)
    return Plan(box, tuple(sheet.elements), tuple(sheet.fixtures), sheet.unit)
