"""From the names of a data set's labels to what the reader is to say."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

from fronto.categories import PLATE
from fronto.datasets.names import category_of, printed_text
from fronto.datasets.records import UNKNOWN
from fronto.labels.alphabet import ALPHABET, KINDS, STEPS, normal_text

__all__ = ["ReadTarget", "encoded", "read_target", "readable"]

#: Names that say less than the crop shows (seen in photos of the panels set): "D0" is DO.
PRINTED = {"D0": "open"}
#: Functions by the letters on their buttons, which a mirror spoils as it spoils words.
LETTERED = ("DO", "DOR", "DC", "D0", "UP", "DN", "AL")
#: Functions whose buttons carry letters or words that name no floor: they are read as texts.
SPELLED = ("ns", "ir", "id", "iu", "dh", "dhb", "dhf", "dhr", "alt")


@dataclass(frozen=True)
class ReadTarget:
    """What a crop shows.

    Parameters
    ----------
    kind
        One of `fronto.labels.alphabet.KINDS`.
    text
        Of the kind "text": its text in normal form; else "".
    mirrors
        Whether the mirrored crop shows the same.
    """

    kind: str
    text: str = ""
    mirrors: bool = False

    def __post_init__(self) -> None:
        assert self.kind in KINDS
        assert (self.kind == "text") == bool(self.text)


def read_target(name: str) -> ReadTarget | None:
    r"""What a crop with this label shows, by the label of the box itself.

    Parameters
    ----------
    name
        A label of the panels set or one like it: "12", "s1" (\*1), "open", "text_HOLD",
        "empty", "blur".

    Returns
    -------
    None for what is no button, and where the name does not say what is printed ("number",
    "plate").
    """
    name = name.strip()
    lower = name.lower()
    words = lower.removeprefix("text_").split()
    category = PRINTED.get(name) or category_of(name)
    if category is None or category == PLATE:
        return None
    if category == UNKNOWN:
        if lower == "empty":
            return ReadTarget("blank", mirrors=True)
        # Most that are called "unknown" are in mirrored photos: a mirror would make them legible.
        return ReadTarget("unreadable") if words[0] in ("blur", "unknown") else None
    spelled = lower in SPELLED or (lower.startswith("text_") and len(words) == 1)
    if category == "number" or (category == "other" and spelled):
        text = normal_text(printed_text(name) or (name if lower in SPELLED else ""))
        return ReadTarget("text", text) if readable(text) else None
    mirrors = not lower.startswith("text_") and name not in LETTERED
    return ReadTarget(category, mirrors=mirrors)


def readable(text: str) -> bool:
    """Whether the text head has steps enough for a text (in normal form) that is not empty."""
    repeats = sum(a == b for a, b in pairwise(text))
    return bool(text) and len(text) + repeats <= STEPS


def encoded(text: str) -> list[int]:
    """Classes of the text head, from 1, for a text in normal form."""
    return [ALPHABET.index(character) + 1 for character in text]
