"""What rendered labels say: all that panels carry, and rare texts as often as common ones."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from fronto.labels.alphabet import normal_text
from fronto.labels.targets import ReadTarget
from fronto.synth.photo import glyphs
from fronto.synth.photo.draws import chance, pick, whole

__all__ = ["Marking", "random_marking"]

LETTERS = "ABCDEFGHIJKLMNOPQRSTUVWXYZ"
#: Floors by letters, common ones several times.
FLOORS = (
    *"GLBMPRKESUHTDCAF" * 2, *LETTERS, "LG", "UG", "GF", "PH", "RF", "LL", "UB", "SB", "MZ", "LB",
    "PB", "LG", "PH", "BR", "SL", "PL", "EG", "DG", "OG", "RC", "SS", "GL", "LP", "UL", "CP", "ST",
    "FB", "KG", "ZG", "EN", "EX", "MB", "BF", "TF", "AA", "REF", "MEZ", "LOB", "POD", "GYM", "TOR",
    "NS", "DH", "IR", "ALT", "HC",
)  # fmt: skip
WORDS = (
    "FAN", "HOLD", "LIGHT", "LOBBY", "GROUND", "MEZZ", "PASS", "DELAY", "FIRE", "VIP", "CANCEL",
    "IND", "REAR", "FRONT", "ROOF", "PARK", "PLAZA", "STREET", "BRIDGE", "LOWER", "UPPER", "POOL",
    "START", "RUN", "ON", "OFF", "AUTO", "BYPASS", "FULL", "PUSH", "BASEMENT", "RESET", "TEST",
)  # fmt: skip
#: Words of functions; several words stand below each other or in a row.
FUNCTIONS = {
    "open": ("OPEN", "DOOR OPEN", "OPEN DOOR", "DO", "OPEN", "OPEN HOLD"),
    "close": ("CLOSE", "DOOR CLOSE", "CLOSE DOOR", "DC", "CLOSE"),
    "alarm": ("ALARM", "HELP", "CALL", "SOS", "BELL", "ALARM BELL", "EMERG CALL", "EMERGENCY"),
    "stop": ("STOP", "EMERGENCY STOP", "RUN STOP", "STOP", "STOP", "PULL TO STOP"),
    "up": ("UP",),
    "down": ("DOWN", "DN"),
}
#: Signs of `fronto.synth.photo.glyphs`, and characters that fonts have for the same.
SIGNS = {
    "up": (("up",), "▲△▴↑⇧⬆∧"),
    "down": (("down",), "▼▽▾↓⇩⬇∨"),
    "open": (("open",), ("◀▶", "◁▷", "◂▸", "◄►", "◀|▶", "◁|▷", "<>", "<|>")),
    "close": (("close",), ("▶◀", "▷◁", "▸◂", "►◄", "▶|◀", "▷|◁", "><", ">|<")),
    "alarm": (("bell", "bell", "phone"), "☎☏✆"),
    "stop": (("cross",), "✕✖"),
    "keyhole": (("keyhole",), ()),
    "other": (("fan", "bulb", "hat", "person", "speaker", "hanzi", "hanzi"), "♿☀☂♫⚠⚡⇅↕#?!&"),
}
#: Shares of the kinds; "text" and "blank" besides.
SHARES = {
    "up": 3.5, "down": 3.5, "open": 6.0, "close": 6.0, "alarm": 7.5, "stop": 3.0, "keyhole": 6.0,
    "other": 4.0, "blank": 5.5, "text": 55.0,
}  # fmt: skip


@dataclass(frozen=True)
class Marking:
    """What is to be drawn on a face, and what the reader is to say of it.

    Parameters
    ----------
    target
        Of the reader.
    text
        As it is printed, lines parted by newlines; "" without words.
    symbol, variant
        Of `fronto.synth.photo.glyphs.symbol`, or "".
    characters
        A sign in characters that some fonts have, or "".
    """

    target: ReadTarget
    text: str = ""
    symbol: str = ""
    variant: int = 0
    characters: str = ""


def random_marking(rng: np.random.Generator) -> Marking:
    """Draw what a button or a plate says."""
    kind = pick(rng, tuple(SHARES), tuple(SHARES.values()))
    if kind == "text":
        text = pick(rng, FORMS, FORM_SHARES)(rng)
        if "?" in text:  # a star
            return Marking(ReadTarget("text", normal_text(text.replace("?", "*"))), text)
        return Marking(ReadTarget("text", normal_text(text)), text)
    target = ReadTarget(kind)
    if kind == "blank":
        return Marking(target)
    if kind in FUNCTIONS and chance(rng, 0.05 if kind in ("up", "down") else 0.25):
        words = pick(rng, FUNCTIONS[kind])
        return Marking(target, _cased(rng, words.replace(" ", "\n" if chance(rng, 0.75) else " ")))
    names, characters = SIGNS[kind]
    symbol = pick(rng, names)
    variant = whole(rng, 0, glyphs.SYMBOLS[symbol] - 1)
    special = pick(rng, characters) if characters and chance(rng, 0.5) else ""
    return Marking(target, "", symbol, variant, special)


def _cased(rng: np.random.Generator, words: str) -> str:
    """Mostly capitals; "Open", "open"."""
    return pick(rng, (words, words.title(), words.lower()), (8, 1, 1))


def _number(rng: np.random.Generator) -> str:
    return str(whole(rng, 1, 99))


def _digit(rng: np.random.Generator) -> str:
    return str(whole(rng, 0, 9))


def _hundreds(rng: np.random.Generator) -> str:
    return str(whole(rng, 100, 199))


def _letters(rng: np.random.Generator) -> str:
    return pick(rng, FLOORS)


def _lettered(rng: np.random.Generator) -> str:
    """B1, P12, LL2, G-1."""
    first = pick(rng, (*"BBBPPPLLGSUMRKHFCAED", "LG", "LL", "PH", "UG", "LL", "SB"))
    last = whole(rng, 1, 9) if chance(rng, 0.85) else whole(rng, 10, 40)
    end = pick(rng, LETTERS) if chance(rng, 0.08) else ""
    return f"{first}{last}{end}"


def _below(rng: np.random.Generator) -> str:
    return f"-{whole(rng, 1, 9)}{pick(rng, 'MAB') if chance(rng, 0.08) else ''}"


def _starred(rng: np.random.Generator) -> str:
    rest = pick(rng, ("1", _digit(rng), _number(rng), _letters(rng), _lettered(rng)))
    return "?" + rest


def _ended(rng: np.random.Generator) -> str:
    """12A, 3R, 2M."""
    number = whole(rng, 1, 9) if chance(rng, 0.5) else whole(rng, 10, 59)
    return f"{number}{pick(rng, 'AAAABBMRFUENSPCGDLT')}"


def _any(rng: np.random.Generator) -> str:
    """Two or three characters in any order: what no list foresees."""
    count = pick(rng, (2, 3))
    return "".join(pick(rng, LETTERS + "0123456789") for _ in range(count))


def _range(rng: np.random.Generator) -> str:
    first = whole(rng, 1, 30)
    return f"{first}-{first + whole(rng, 1, 40)}"


def _sign(rng: np.random.Generator) -> str:
    return pick(rng, ("-", "?", "?", "+"), (4, 2, 2, 0.5))


def _word(rng: np.random.Generator) -> str:
    return _cased(rng, pick(rng, WORDS))


#: How texts are formed, and how often each way.
FORMS: tuple[Callable[[np.random.Generator], str], ...] = (
    _number, _digit, _hundreds, _letters, _lettered, _below, _starred, _ended, _any, _range,
    _sign, _word,
)  # fmt: skip
FORM_SHARES = (38.0, 14.0, 2.0, 9.0, 11.0, 5.0, 6.0, 5.0, 3.0, 0.7, 2.0, 4.0)
