"""Named buttons where a context head weighs the readings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt
import pytest

import fronto
from fronto.labels.context import Context
from fronto.labels.name import name_buttons
from fronto.results import Panel, Plate
from test_labels_name import CAMERA, PLACES, Painted, Said, labels, named, quad, sources

KNOWN = (*(str(k) for k in range(1, 10)), "open", "alarm")
OTHER = "?"


@dataclass
class Telling:
    """Says of each thing what it was made to say: "" is none, "?" a label that it knows not."""

    said: Sequence[Mapping[str, float]]
    labels: tuple[str, ...] = KNOWN
    told: list[Context] = field(default_factory=list)

    def run(self, context: Context) -> npt.NDArray[np.float32]:
        self.told.append(context)
        places = [*self.labels, "", OTHER]
        rows = np.zeros((len(context.own), len(places)), np.float32)
        for row, said in zip(rows, self.said, strict=True):
            for label, p in said.items():
                row[places.index(label)] = p
        return rows


class Repeating:
    """Says what the order says."""

    labels = KNOWN

    def run(self, context: Context) -> npt.NDArray[np.float32]:
        return context.ordered


def weighed(
    said: Sequence[Said], head: Sequence[Mapping[str, float]], plates: Sequence[Said] = (), **more
) -> Panel:
    return named(said, plates, head=Telling(head), **more)


def test_the_heads_word_is_taken() -> None:
    panel = weighed([{"1": 0.4, "7": 0.3}, {"open": 0.6}], [{"7": 0.9}, {"alarm": 0.7, "": 0.2}])
    assert labels(panel) == ["7", "alarm"]
    first, second = panel.buttons
    assert first.label_confidence == pytest.approx(0.9)
    assert dict(second.label_guesses) == pytest.approx({"alarm": 0.7, "": 0.2})


def test_what_the_head_is_not_sure_of_is_declined() -> None:
    said: list[Said] = [{"1": 0.7}, {"open": 0.7}, {"3": 0.7}]
    panel = weighed(said, [{"1": 0.25}, {"": 0.8, "open": 0.1}, {}])
    assert labels(panel) == ["", "", ""]
    assert sources(panel) == [None] * 3
    assert panel.buttons[1].label_guesses[0][0] == ""


def test_what_is_read_surely_is_declined_rather_than_overruled() -> None:
    panel = weighed([{"1": 0.85}, {"1": 0.75}], [{"7": 0.95}, {"2": 0.95}])
    assert labels(panel) == ["", "2"]
    first = panel.buttons[0]
    assert first.label_guesses[0][0] == "7"
    assert first.label_source is None
    # Of its plate, too.
    panel = weighed(["blank"], [{"7": 0.95}, {"4": 1.0}], [{"4": 0.99}])
    assert labels(panel) == [""]


def test_a_floor_that_was_hardly_read_is_inferred() -> None:
    said: list[Said] = [{"1": 0.4, "7": 0.3}, "unreadable", {"3": 0.2}, {"4": 0.4}, {"open": 0.9}]
    panel = weighed(said, [{"7": 0.9}, {"2": 0.9}, {"3": 0.9}, {"4": 0.9}, {"open": 0.9}])
    assert labels(panel) == ["7", "2", "3", "4", "open"]
    assert sources(panel) == ["inferred", "inferred", "inferred", "button", "button"]
    # So is a sign.
    panel = weighed([{"alarm": 0.2}, {"open": 0.4}], [{"alarm": 0.9}, {"open": 0.9}])
    assert sources(panel) == ["inferred", "button"]


def test_labels_that_came_with_the_outlines_stay() -> None:
    outlines = [quad(place, text=text) for place, text in zip(PLACES, ["9", ""], strict=False)]
    head = Telling([{"1": 0.95}, {"8": 0.95}])
    panel = named([{"3": 0.99}, "unreadable"], outlines=outlines, head=head)
    assert labels(panel) == ["9", "8"]
    assert sources(panel) == [None, "inferred"]
    assert panel.buttons[0].label_confidence is None
    # The head is told what they are.
    (context,) = head.told
    assert context.own[0, KNOWN.index("9")] == 1


def test_a_star_and_unknown_labels_are_those_that_were_read() -> None:
    said: list[Said] = [{"*1": 0.7}, {"FAN": 0.6, "72": 0.1}, {"2": 0.7}]
    panel = weighed(said, [{"1": 0.9}, {OTHER: 0.9}, {OTHER: 0.9}])
    assert labels(panel) == ["*1", "FAN", ""]
    assert sources(panel)[:2] == ["button", "button"]
    # Or that the order has filled in.
    said = [{"13": 0.99}, "unreadable", {"11": 0.99}]
    panel = weighed(said, [{OTHER: 1.0}, {OTHER: 0.9}, {OTHER: 1.0}])
    assert labels(panel) == ["13", "12", "11"]
    assert sources(panel) == ["button", "inferred", "button"]


def test_floors_that_the_head_gives_twice() -> None:
    panel = weighed([{"1": 0.5}, {"1": 0.5}], [{"1": 0.6}, {"1": 0.6}])
    assert labels(panel) == ["", ""]
    assert labels(weighed([{"1": 0.5}, "blank"], [{"1": 0.6}, {}])) == ["1", ""]


def test_what_the_head_is_told() -> None:
    head = Telling([{}] * 4)
    named(["blank", {"1": 0.7}, {"72": 0.6}], [{"*2": 0.5}], head=head)
    (context,) = head.told
    one, two = KNOWN.index("1"), KNOWN.index("2")
    assert context.own.shape == (4, len(KNOWN) + 2)
    assert not context.own[0].any()
    assert context.own[1, one] == pytest.approx(0.7)
    assert context.own[2, -1] == pytest.approx(0.6)
    assert context.own[3, two] == pytest.approx(0.5)
    # With its plate, the blank one says something.
    assert 0.4 < context.seen[0, two] < 0.5
    assert context.ordered.shape == context.own.shape
    assert context.geometry[:, 12].tolist() == [0, 0, 0, 1]


def test_plates_are_named_by_what_they_say() -> None:
    said: list[Said] = ["blank", "blank"]
    head = [{"4": 0.9}, {"3": 0.9}, {"7": 1.0}, {"8": 1.0}]
    panel = weighed(said, head, [{"4": 0.99}, {"3": 0.98}])
    assert labels(panel) == ["4", "3"]
    assert sources(panel) == ["plate", "plate"]
    assert [(plate.label, plate.button) for plate in panel.plates] == [("4", 0), ("3", 1)]


READINGS: list[Said] = [{"6": 0.99}, {"5": 0.9}, "unreadable", {"3": 0.99}, {"8": 0.5, "2": 0.4}]


@pytest.mark.parametrize(
    ("said", "plates"),
    [
        (READINGS, []),
        (["blank", "unreadable", {"2": 0.6, "7": 0.3}], [{"4": 0.99}, {"3": 0.98}, {"2": 0.97}]),
        ([{"6": 0.98}, {"open": 0.99}, {"5": 0.98}, {"FAN": 0.9}, {"*1": 0.8}, "other"], []),
    ],
    ids=["column", "plates", "others"],
)
def test_a_head_that_says_what_the_order_says_changes_nothing(
    said: list[Said], plates: list[Said]
) -> None:
    plain, found = named(said, plates), named(said, plates, head=Repeating())
    assert labels(found) == labels(plain)
    assert any(labels(plain))
    assert sources(found) == sources(plain)
    for ours, theirs in zip(found.buttons, plain.buttons, strict=True):
        assert ours.label_confidence == pytest.approx(theirs.label_confidence, abs=1e-3)
    assert found.notes == plain.notes


def test_without_buttons_the_head_is_not_asked() -> None:
    photo = np.full((480, 640, 3), 5, np.uint8)
    panel = fronto.rectify_outlines(photo, [], CAMERA)
    panel = replace(panel, plates=(Plate(quad(PLACES[0])),))
    head = Telling([])
    found = name_buttons(panel, photo, Painted([{"4": 0.99}]), head)
    assert [plate.label for plate in found.plates] == ["4"]
    assert not head.told
