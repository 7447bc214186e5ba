"""Plates that look like the buttons beside them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
import pytest

from fronto.categories import CATEGORIES, PLATE
from fronto.engine import LabelScores
from fronto.finds import Find
from fronto.grouping import Instance
from fronto.labels.alphabet import KINDS
from fronto.prints import Prints
from fronto.scales import first_look
from fronto.segmentation import segment
from fronto.shapes import FloatArray
from fronto.twins import Twins, plates_among, told_apart, twins
from test_segmentation import Oracle

SIDE = 20.0


def boxes(centers: list[tuple[float, float]], side: float = SIDE) -> FloatArray:
    middle = np.array(centers)
    return np.concatenate([middle - side / 2, middle + side / 2], axis=1)


def columns(
    count: int = 5, *, apart: float = 28, down: float = 34, lean: float = 0.0
) -> FloatArray:
    """Plates in a column and buttons beside them: 0, 2, 4, ... and 1, 3, 5, ..."""
    rows = [(100 + lean * k, 100 + down * k) for k in range(count)]
    return boxes([place for x, y in rows for place in ((x, y), (x + apart, y + lean))])


def among(found: list[Twins], printed: list[float], keyholes: list[float] | None = None) -> set:
    keyholes = [0.0] * len(printed) if keyholes is None else keyholes
    return set(plates_among(found, np.array(printed), np.array(keyholes)).tolist())


class TestTwins:
    @pytest.mark.parametrize("lean", [0.0, 3.0, -4.0])
    def test_two_columns(self, lean: float) -> None:
        ways = {
            (tuple(t.first.tolist()), tuple(t.second.tolist())) for t in twins(columns(lean=lean))
        }
        left, right = (0, 2, 4, 6, 8), (1, 3, 5, 7, 9)
        assert ways == {(left, right), (right, left)}

    def test_one_column_is_none(self) -> None:
        assert twins(boxes([(100, 100 + 30 * k) for k in range(9)])) == []

    def test_a_keypad_is_none(self) -> None:
        assert (
            twins(boxes([(100 + 30 * i, 100 + 30 * j) for i in range(3) for j in range(4)])) == []
        )

    @pytest.mark.parametrize("far", [{"apart": 60.0}, {"count": 3}])
    def test_too_far_and_too_few(self, far: dict[str, float]) -> None:
        assert twins(columns(**far)) == []  # type: ignore[arg-type]

    def test_other_sizes_are_none(self) -> None:
        unequal = columns()
        unequal[1::2] = boxes([((b[0] + b[2]) / 2, (b[1] + b[3]) / 2) for b in unequal[1::2]], 8)
        assert twins(unequal) == []

    @pytest.mark.parametrize("count", [0, 1, 2])
    def test_few_things(self, count: int) -> None:
        assert twins(columns()[:count]) == []


class TestPlatesAmong:
    def test_prints_beside_blanks_are_plates(self) -> None:
        assert among(twins(columns()), [0.98, 0.02] * 5) == {0, 2, 4, 6, 8}
        assert among(twins(columns()), [0.02, 0.98] * 5) == {1, 3, 5, 7, 9}

    @pytest.mark.parametrize(
        "printed",
        [[0.98, 0.97] * 5, [0.03, 0.02] * 5, [0.5, 0.02] * 5, [0.9, 0.7] * 5],
        ids=["two columns of buttons", "blanks", "nothing can be read", "unsure blanks"],
    )
    def test_all_else_is_left_alone(self, printed: list[float]) -> None:
        assert among(twins(columns()), printed) == set()

    def test_one_that_cannot_be_read_changes_nothing(self) -> None:
        printed = [0.98, 0.02] * 5
        printed[4] = 0.1
        assert among(twins(columns()), printed) == {0, 2, 4, 6, 8}

    def test_two_of_five_do(self) -> None:
        printed = [0.98, 0.02] * 5
        printed[4] = printed[6] = 0.05
        assert among(twins(columns()), printed) == set()

    def test_beside_keyholes_there_are_no_plates(self) -> None:
        assert among(twins(columns()), [0.98, 0.02] * 5, [0.0, 0.9] * 5) == set()


@dataclass
class Reader:
    """Takes bright crops for blank ones, and those with a dark middle for texts."""

    kinds: tuple[str, ...] = KINDS
    asked: list[int] = field(default_factory=list)

    def run(self, crops: npt.NDArray[np.uint8]) -> LabelScores:
        self.asked.append(len(crops))
        dark = (crops[:, 16:32, 16:32].mean(axis=(1, 2, 3)) < 200).astype(np.float32)
        kind = np.full((len(crops), len(KINDS)), 0.001, np.float32)
        kind[:, KINDS.index("text")] = dark
        kind[:, KINDS.index("blank")] = 1 - dark
        return LabelScores(np.zeros((len(crops), 1, 1), np.float32), kind)


def finds(places: FloatArray, plates: set[int]) -> list[Find]:
    view = first_look(np.zeros((480, 640, 3), np.uint8))
    scores = np.zeros(len(CATEGORIES))
    scores[1], scores[0], scores[-1] = 0.9, 0.06, 0.04
    result = []
    for k, box in enumerate(places):
        instance = Instance(k in plates, 0.9, (0.0, 0, 1, 1), scores)
        mask = np.zeros((480, 640), np.float32)
        result.append(Find(instance, box, view, mask, 0.9, "up", False))
    return result


def photo(places: FloatArray, printed: set[int]) -> npt.NDArray[np.uint8]:
    rgb = np.zeros((480, 640, 3), np.uint8)
    for k, (x0, y0, x1, y1) in enumerate(np.rint(places).astype(int)):
        rgb[y0:y1, x0:x1] = 255
        if k in printed:
            rgb[y0 + 5 : y1 - 5, x0 + 5 : x1 - 5] = 130  # bright enough to be found as one
    return rgb


def prints(texts: list[float], keyholes: float = 0.0) -> Prints:
    categories = np.zeros((len(texts), len(CATEGORIES) - 2))
    categories[:, CATEGORIES.index("number") - 1] = texts
    categories[:, CATEGORIES.index("keyhole") - 1] = keyholes
    return Prints(categories)


def test_told_apart() -> None:
    told = told_apart(finds(columns(), set()), prints([0.98, 0.02] * 5))
    assert [f.category == PLATE for f in told] == [True, False] * 5
    assert [f.instance.plate for f in told] == [True, False] * 5
    assert told[0].instance.scores[-1] == pytest.approx(0.94)
    assert told[0].instance.scores.sum() == pytest.approx(1)
    assert told[0].confidence == 0.9


def test_what_is_known_to_be_a_plate_is_no_twin() -> None:
    before = finds(columns(), {0, 2, 4, 6, 8})
    assert told_apart(before, prints([0.98, 0.02] * 5)) == before


@pytest.mark.parametrize("count", [0, 1, 3])
def test_few_finds(count: int) -> None:
    before = finds(columns()[:count], set())
    assert told_apart(before, prints([0.98] * count)) == before


def test_in_a_photo() -> None:
    places = columns()
    engine = Oracle()
    rgb = photo(places, {0, 2, 4, 6, 8})
    assert len(segment(rgb, engine=engine).plates) == 0  # type: ignore[arg-type]
    engine.reader = Reader()  # type: ignore[assignment]
    found = segment(rgb, engine=engine)  # type: ignore[arg-type]
    assert (len(found.buttons), len(found.plates)) == (5, 5)
    assert {round(s.center_px[0]) for s in found.plates} == {100}
