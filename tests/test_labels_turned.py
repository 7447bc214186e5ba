"""Labels that lie on their side: read turned where that tells them, and left alone where not."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from fronto.labels.reader import Reading
from fronto.labels.turned import upright_readings


class Marks:
    """Reads crops whose corner pixel says what they are, while that corner is at the top left."""

    def __init__(self, labels: Sequence[str], confidence: float = 0.9, blank: bool = False) -> None:
        self.labels, self.confidence, self.blank, self.calls = labels, confidence, blank, 0

    def crops(self, turn: int) -> np.ndarray:
        """Crops that `turn` quarter turns counterclockwise make upright."""
        crops = np.zeros((len(self.labels), 48, 48, 3), np.uint8)
        crops[:, 0, 0, 0] = np.arange(len(self.labels)) + 1
        return np.ascontiguousarray(np.rot90(crops, -turn, axes=(1, 2)))

    def read(self, crops: np.ndarray) -> list[Reading]:
        self.calls += 1
        found = []
        for crop in crops:
            number = int(crop[0, 0, 0])
            text = self.labels[number - 1] if number else ""
            kind = "text" if text else "blank" if self.blank else "unreadable"
            found.append(Reading(text, kind, self.confidence if text else 0.6))
        return found


def upright(marks: Marks, crops: np.ndarray) -> tuple[list[str], str]:
    readings, way = upright_readings(marks.read, crops, marks.read(crops))
    return [reading.text for reading in readings], way


FLOORS = ["1", "2", "3", "4", "5"]


@pytest.mark.parametrize(
    ("turn", "way"), [(0, ""), (1, "to the right"), (2, "upside down"), (3, "to the left")]
)
def test_all_ways(turn: int, way: str) -> None:
    marks = Marks(FLOORS)
    assert upright(marks, marks.crops(turn)) == (FLOORS, way)
    assert marks.calls == (1 if turn == 0 else 4)  # nothing is read twice where it is clear


@pytest.mark.parametrize(
    ("labels", "confidence"),
    [
        (["1", "2"], 0.9),  # too few
        (["1", "1", "1", "1"], 0.9),  # the same all over
        (FLOORS, 0.7),  # not sure
        (["1", "2", "3", *[""] * 6], 0.9),  # most say nothing
        ([], 0.9),
    ],
    ids=str,
)
def test_what_is_left_alone(labels: list[str], confidence: float) -> None:
    marks = Marks(labels, confidence)
    assert upright(marks, marks.crops(3)) == ([""] * len(labels), "")


def test_blank_buttons_are_not_read_again() -> None:
    marks = Marks(FLOORS, blank=True)
    assert upright(marks, marks.crops(3)) == ([""] * 5, "")
    assert marks.calls == 1


def test_what_is_clear_stays() -> None:
    marks = Marks(FLOORS)
    crops = np.concatenate([marks.crops(3), np.zeros((1, 48, 48, 3), np.uint8)])
    arrow = Reading("open", "open", 0.99)
    readings = [*marks.read(crops[:5]), arrow]
    found, way = upright_readings(marks.read, crops, readings)
    assert [r.text for r in found] == [*FLOORS, "open"]
    assert way == "to the left"


def test_arrows_turn_with_the_floors() -> None:
    # Upside down, an arrow is read as the other one for sure.
    marks = Marks([*FLOORS, "up"])
    crops = marks.crops(2)
    readings = [*marks.read(crops)[:5], Reading("down", "down", 0.99)]
    found, way = upright_readings(marks.read, crops, readings)
    assert way == "upside down"
    assert found[5].text == "up"


def test_signs_do_not_turn_a_panel() -> None:
    crops = np.zeros((4, 48, 48, 3), np.uint8)

    def read(given: np.ndarray) -> list[Reading]:
        turned = given is not crops
        return [Reading("up", "up", 0.99) if turned else Reading("", "blank", 0.9)] * 4

    assert upright_readings(read, crops, read(crops))[1] == ""
