"""What buttons say: floor names and the symbols and words of functions."""

from __future__ import annotations

import numpy as np

from fronto.synth.photo import glyphs
from fronto.synth.photo.draws import chance, pick, whole
from fronto.synth.photo.plan import Label

__all__ = ["FUNCTIONS", "floor_names", "function_label", "hall_label"]

#: The kinds that `function_label` knows.
FUNCTIONS = ("open", "close", "alarm", "stop", "key", "other")
GROUND = ("G", "L", "0", "1", "E", "K", "M", "UG", "LG", "*1", "PH", "GF", "H", "R", "P1")
WORDS = {
    "open": ("OPEN", "DOOR OPEN", "OP"),
    "close": ("CLOSE", "DOOR CLOSE", "CL"),
    "alarm": ("ALARM", "HELP", "CALL", "SOS", "BELL"),
    "stop": ("STOP", "EMERGENCY STOP", "RUN STOP"),
    "other": ("HOLD", "DOOR HOLD", "FAN", "LIGHT", "VIP", "CANCEL", "IND", "ON", "REAR"),
}
SYMBOLS = {
    "open": ("open",),
    "close": ("close",),
    "alarm": ("bell", "bell", "bell", "phone"),
    "stop": ("cross",),
    "other": ("fan", "bulb", "hat", "person", "speaker", "dot", "bar", "hanzi"),
}


def _symbol(rng: np.random.Generator, name: str) -> Label:
    return Label(symbol=name, variant=whole(rng, 0, glyphs.SYMBOLS[name] - 1))


def floor_names(rng: np.random.Generator, count: int) -> list[str]:
    """`count` floor labels from the lowest up."""
    names: list[str] = []
    if chance(rng, 0.4):
        under = whole(rng, 1, 4)
        pattern = pick(rng, ("B{}", "P{}", "-{}", "S{}", "{}B"))
        names = [pattern.format(k) for k in range(under, 0, -1)]
    if chance(rng, 0.6):
        names.append(pick(rng, GROUND))
    first = pick(rng, (1, 2, whole(rng, 3, 60)), (5, 3, 1))
    for floor in range(first, first + count):
        if floor == 13 and chance(rng, 0.4):
            names.append("12A")
        elif chance(rng, 0.02):
            names.append(f"{floor}{pick(rng, ('A', 'R', 'F', 'M'))}")
        else:
            names.append(str(floor))
    names = names[:count]
    if chance(rng, 0.1):
        names[-1] = pick(rng, ("PH", "R", "RF", "T"))
    return names


def function_label(rng: np.random.Generator, kind: str) -> tuple[str, str, Label]:
    """Category, text and label of a function button (of `FUNCTIONS`)."""
    if kind == "key":
        return "keyhole", "", _symbol(rng, "keyhole")
    if chance(rng, 0.25):
        text = pick(rng, WORDS[kind])
        return kind, text, Label(text)
    if kind != "other" and chance(rng, 0.08):
        return kind, "", _symbol(rng, "hanzi")
    return kind, "", _symbol(rng, pick(rng, SYMBOLS[kind]))


def hall_label(rng: np.random.Generator, kind: str) -> tuple[str, str, Label]:
    """Category, text and label of an "up" or "down" button."""
    if chance(rng, 0.05):
        text = kind.upper()
        return kind, text, Label(text)
    return kind, "", _symbol(rng, kind)
