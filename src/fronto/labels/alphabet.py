"""What the label reader's network takes and tells: crops, characters, kinds."""

from __future__ import annotations

import unicodedata

__all__ = ["ALPHABET", "CROP_PX", "CROP_SCALE", "KINDS", "STEPS", "normal_text"]

#: Characters of labels; class of the text head = position + 1, 0 is CTC's blank.
ALPHABET = "0123456789ABCDEFGHIJKLMNOPQRSTUVWXYZ*-+"
#: What a crop shows, index = class of the kind head. "text": what the text head says;
#: "other": another symbol (a fan, ...); "blank": a button without a print; "unreadable": a
#: print that nobody can read.
KINDS = (
    "text",
    "up",
    "down",
    "open",
    "close",
    "alarm",
    "stop",
    "keyhole",
    "other",
    "blank",
    "unreadable",
)
#: Width and height of a crop in pixels.
CROP_PX = 48
#: A crop shows the button's box, this much larger about its centre.
CROP_SCALE = 1.06
#: Steps of the text head along x.
STEPS = 24

_MINUS = "\N{MINUS SIGN}\N{HYPHEN}\N{NON-BREAKING HYPHEN}\N{FIGURE DASH}\N{EN DASH}\N{EM DASH}"
_STARS = "\N{BLACK STAR}\N{WHITE STAR}\N{ASTERISK OPERATOR}\N{HEAVY ASTERISK}\N{STAR OPERATOR}"
_SAME = str.maketrans(dict.fromkeys(_MINUS, "-") | dict.fromkeys(_STARS, "*"))


def normal_text(text: str) -> str:
    r"""A label's text as the reader tells it: capitals of `ALPHABET`, no spaces.

    Minus signs, dashes and stars become "-" and "\*", accents are dropped, wide and encircled
    forms become plain ones; whatever else is not in `ALPHABET` is left out. A small s before
    a digit or a capital is the star of the exit floor, as the panels set writes it ("s1" is
    "\*1").

    Parameters
    ----------
    text
        Any text.

    Returns
    -------
    The text in normal form, which may be empty; the normal form of it is itself.
    """
    text = text.strip()
    if text[:1] == "s" and (text == "s" or text[1].isdigit() or text[1].isupper()):
        text = "*" + text[1:]
    return "".join(map(_plain, text.translate(_SAME).upper()))


def _plain(character: str) -> str:
    """The character of `ALPHABET` that this one is a form of, or none."""
    parts = unicodedata.normalize("NFKD", character).translate(_SAME)
    single = all(unicodedata.combining(mark) for mark in parts[1:])  # one half would become 12
    return parts[0] if single and parts[0] in ALPHABET else ""
