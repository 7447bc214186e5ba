"""Categories by what is printed on finds."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pytest

from fronto.categories import CATEGORIES, PLATE
from fronto.engine import LabelScores
from fronto.finds import Find
from fronto.grouping import Instance
from fronto.labels.alphabet import CROP_PX, KINDS
from fronto.prints import Prints, named, read_prints
from fronto.scales import first_look

RGB = np.full((120, 160, 3), 40, np.uint8)
VIEW = first_look(RGB)


def find(category: str, share: float, box: tuple[float, ...] = (20, 20, 60, 60)) -> Find:
    """A button of which this share of the probability says this category, and the rest "number"."""
    scores = np.zeros(len(CATEGORIES))
    scores[0], scores[-1] = 0.06, 0.04
    scores[CATEGORIES.index("number")] += 0.9 * (1 - share)
    scores[CATEGORIES.index(category)] += 0.9 * share
    instance = Instance(category == PLATE, 0.9, (0.0, 0, 1, 1), scores)
    mask = np.zeros(VIEW.image.shape[:2], np.float32)
    return Find(instance, np.array(box, float), VIEW, mask, 0.9, category, False)


def prints(**read: float) -> Prints:
    categories = np.zeros((1, len(CATEGORIES) - 2))
    for category, probability in read.items():
        categories[0, CATEGORIES.index(category) - 1] = probability
    return Prints(categories)


class TestNamed:
    def test_a_print_corrects_the_looks(self) -> None:
        (one,) = named([find("open", 0.7)], prints(close=0.95, open=0.01))
        assert one.category == "close"
        assert one.instance.scores.sum() == pytest.approx(1)
        assert one.instance.scores[[0, -1]].tolist() == [0.06, 0.04]
        assert one.confidence == 0.9

    def test_of_a_blank_button_the_looks_decide(self) -> None:
        assert named([find("alarm", 0.8)], prints())[0].category == "alarm"
        assert named([find("alarm", 0.8)], prints(number=0.1))[0].category == "alarm"

    def test_looks_weigh_where_the_print_is_unsure(self) -> None:
        assert named([find("up", 0.9)], prints(up=0.4, number=0.5))[0].category == "up"

    def test_plates_stay(self) -> None:
        plate = find(PLATE, 0.9)
        assert named([plate], prints(number=0.99)) == [plate]


@dataclass
class Red:
    """Takes what is red for keyholes, and all else for texts."""

    kinds: tuple[str, ...] = KINDS

    def run(self, crops: npt.NDArray[np.uint8]) -> LabelScores:
        assert crops.shape[1:] == (CROP_PX, CROP_PX, 3)
        red = crops[..., 0].mean(axis=(1, 2)) > 150
        kind = np.zeros((len(crops), len(KINDS)), np.float32)
        kind[:, KINDS.index("keyhole")] = red
        kind[:, KINDS.index("text")] = ~red
        return LabelScores(np.zeros((len(crops), 1, 1), np.float32), kind)


def test_finds_are_read_where_they_are() -> None:
    photo = RGB.copy()
    photo[18:62, 18:62, 0] = 255
    found = [find("number", 1.0), find("number", 1.0, (80, 20, 120, 60))]
    read = read_prints(found, photo, Red())  # type: ignore[arg-type]
    np.testing.assert_allclose(read.keyholes, [1, 0])
    np.testing.assert_allclose(read.printed, [0, 1])
    assert [f.category for f in named(found, read)] == ["keyhole", "number"]


def test_many_finds() -> None:
    photo = RGB.copy()
    photo[18:62, 18:62, 0] = 255
    boxes = [(20.0, 20, 60, 60), (80.0, 20, 120, 60)] * 50
    read = read_prints([find("number", 1.0, box) for box in boxes], photo, Red())  # type: ignore[arg-type]
    np.testing.assert_allclose(read.keyholes, [1, 0] * 50)


def test_kinds_that_a_reader_tells() -> None:
    from fronto.prints import CATEGORY

    assert set(CATEGORY) == set(KINDS) - {"other", "blank", "unreadable"}
    assert set(CATEGORY.values()) <= set(CATEGORIES[1:-1])
