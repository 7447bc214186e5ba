"""Floors as numbers: which labels count on from each other, "3" from "2" and "B3" from "B2"."""

from __future__ import annotations

import functools
import re
from typing import NamedTuple

from fronto.datasets.names import CATEGORY
from fronto.labels.alphabet import KINDS, normal_text

__all__ = ["FUNCTIONS", "Floor", "floor_of", "is_floor", "label_key", "normal_label"]

#: Labels that are symbols, or words of one meaning; several buttons may share one.
FUNCTIONS = KINDS[1:8]
_NUMBERED = re.compile(r"([A-Z]{0,2})(-?)(\d{1,3})([A-Z]?)")
#: What floors are called beside numbers.
_LETTERS = re.compile(r"\*?[A-Z]{1,2}")


class Floor(NamedTuple):
    """A floor's place in a series of labels that count on.

    Parameters
    ----------
    before, after
        Letters around the number, "" for plain ones.
    number
        Its place.
    """

    before: str
    number: int
    after: str

    @property
    def label(self) -> str:
        """The label, without a star."""
        return f"{self.before}{self.number}{self.after}"

    def at(self, number: int) -> Floor:
        """Another floor of the series."""
        return Floor(self.before, number, self.after)

    def counts_with(self, other: Floor) -> bool:
        """Whether both are of one series."""
        return (self.before, self.after) == (other.before, other.after)


def normal_label(text: str) -> str:
    """A label as results have it: the word of a function ("open"), or the text in normal form.

    Other words of a function mean it, too: "bell" and "help" are "alarm".
    """
    meaning = CATEGORY.get(" ".join(re.split(r"[\s_]+", text.strip().lower())))
    return meaning if meaning in FUNCTIONS else normal_text(text)


def label_key(label: str) -> str:
    r"""What the labels of one floor share: "\*1" and "1" are one, the star marks the way out."""
    return label[1:] if len(label) > 1 and label[0] == "*" else label


@functools.lru_cache(maxsize=4096)
def floor_of(label: str) -> Floor | None:
    """Where a label in normal form is in its series; None for what has no number."""
    found = _NUMBERED.fullmatch(label_key(label))
    if found is None or (found[1] and found[2]):
        return None
    floor = Floor(found[1], int(found[2] + found[3]), found[4])
    return floor if floor.label == label_key(label) else None  # "01" is not what "1" is written as


@functools.lru_cache(maxsize=4096)
def is_floor(label: str) -> bool:
    """Whether a label names a floor: a number with letters around it, or one or two letters.

    A panel has each floor once.
    """
    return floor_of(label) is not None or _LETTERS.fullmatch(label) is not None
