"""What becomes of candidates once a relation head, made by hand here, has judged them."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
import pytest

from fronto.engine import Maps, Verdicts
from fronto.grouping import Instance, group
from fronto.judging import instances, judged
from fronto.relations import Candidates

BOXES = ((10.0, 10.0, 30.0, 30.0), (50.0, 10.0, 70.0, 30.0), (90.0, 10.0, 110.0, 30.0))
NUMBER, ALARM = 4, 7


def found(boxes: tuple[tuple[float, float, float, float], ...] = BOXES) -> list[Instance]:
    return [Instance(False, 0.5, box, np.full(11, 1 / 11)) for box in boxes]


def verdicts(
    kinds: list[list[float]],
    classes: list[int] | None = None,
    shifts: list[list[float]] | None = None,
) -> Verdicts:
    n = len(kinds)
    named = np.full((n, 11), 0.01, np.float32)
    named[np.arange(n), classes or [NUMBER] * n] = 0.9
    moved = np.array(shifts or np.zeros((n, 4)), np.float32)
    return Verdicts(np.array(kinds, np.float32), named, moved)


@dataclass
class Head:
    """Says of all candidates the same."""

    kinds: tuple[float, float, float] = (0.1, 0.8, 0.1)
    seen: list[Candidates] = field(default_factory=list)

    def run(self, candidates: Candidates) -> Verdicts:
        self.seen.append(candidates)
        return verdicts([list(self.kinds)] * len(candidates.looks))


@dataclass
class FakeEngine:
    relations: Head | None = None
    stride: int = 4


def maps(cells: list[tuple[int, int, float]], channels: int | None = 3) -> Maps:
    """Buttons of 20 x 20 pixels with their middles in these cells, this sure."""
    centers: npt.NDArray[np.float32] = np.zeros((1, 2, 20, 30), np.float32)
    for i, j, confidence in cells:
        centers[0, 0, i, j] = confidence
    classes = np.full((1, 11, 20, 30), 1 / 11, np.float32)
    masks = np.zeros((1, 2, 80, 120), np.float32)
    sides = np.full((1, 4, 20, 30), 10, np.float32)
    features = None if channels is None else np.zeros((1, channels, 20, 30), np.float32)
    return Maps(masks, classes, centers, sides, features)


class TestJudged:
    def test_nothing_is_dropped(self) -> None:
        result = judged(found(), verdicts([[0.97, 0.02, 0.01], [0.2, 0.7, 0.1], [0.99, 0, 0.01]]))
        assert [i.box for i in result] == [BOXES[1]]
        assert judged(found()[:1], verdicts([[0.97, 0.02, 0.01]])) == []

    def test_kinds_decide_what_it_is(self) -> None:
        before = [
            Instance(plate, 0.5, box, np.zeros(11))
            for plate, box in zip((True, False, True), BOXES, strict=True)
        ]
        kinds = [[0.1, 0.7, 0.2], [0.05, 0.35, 0.6], [0.1, 0.4, 0.5]]
        result = judged(before, verdicts(kinds))
        assert [i.plate for i in result] == [False, True, True]
        assert [i.confidence for i in result] == pytest.approx([0.7, 0.6, 0.5])

    def test_surest_comes_first(self) -> None:
        kinds = [[0.5, 0.4, 0.1], [0.05, 0.9, 0.05], [0.3, 0.1, 0.6]]
        result = judged(found(), verdicts(kinds))
        assert [i.box for i in result] == [BOXES[1], BOXES[2], BOXES[0]]

    def test_boxes_move_by_the_shifts(self) -> None:
        moved = [[0.1, 0, -0.05, 0.2], [0, 0, 0, 0], [-0.5, -0.5, 0.5, 0.5]]
        kinds = [[0.1, 0.8, 0.1], [0.2, 0.7, 0.1], [0.3, 0.6, 0.1]]
        result = judged(found(), verdicts(kinds, shifts=moved))
        expected = [(12, 10, 29, 34), BOXES[1], (80, 0, 120, 40)]
        np.testing.assert_allclose([i.box for i in result], expected, atol=1e-4)

    def test_the_surer_of_two_on_one_thing_stays(self) -> None:
        boxes = (BOXES[0], (12.0, 11.0, 32.0, 31.0), BOXES[2])
        kinds = [[0.3, 0.6, 0.1], [0.1, 0.1, 0.8], [0.5, 0.4, 0.1]]
        result = judged(found(boxes), verdicts(kinds))
        assert [(i.box, i.plate) for i in result] == [(boxes[1], True), (boxes[2], False)]

    def test_two_that_are_moved_to_one_place_are_one(self) -> None:
        moved = [[1.9, 0, 1.9, 0], [0, 0, 0, 0], [0, 0, 0, 0]]
        kinds = [[0.3, 0.6, 0.1], [0.1, 0.8, 0.1], [0.2, 0.7, 0.1]]
        # The left edge stops at a quarter of the side from the middle.
        wide = judged(found(), verdicts(kinds, shifts=moved))
        assert len(wide) == 3
        near = (BOXES[0], (18.0, 10.0, 38.0, 30.0), BOXES[2])  # IoU 0.43 before
        assert len(judged(found(near), verdicts(kinds))) == 3
        moved[0] = [0.2, 0, 0.2, 0]
        assert len(judged(found(near), verdicts(kinds, shifts=moved))) == 2

    def test_scores_are_probabilities(self) -> None:
        kinds = [[0.1, 0.8, 0.1], [0.05, 0.15, 0.8], [0.4, 0.5, 0.1]]
        result = judged(found(), verdicts(kinds, classes=[NUMBER, NUMBER, ALARM]))
        scores = np.stack([i.scores for i in result])
        assert scores.shape == (3, 11)
        np.testing.assert_allclose(scores.sum(axis=1), 1, atol=1e-6)
        np.testing.assert_allclose(scores[:, 0], [0.1, 0.05, 0.4], atol=1e-6)
        np.testing.assert_allclose(scores[:, -1], [0.1, 0.8, 0.1], atol=1e-6)
        assert [1 + int(np.argmax(s[1:-1])) for s in scores] == [NUMBER, NUMBER, ALARM]


class TestInstances:
    def test_without_a_head_each_centre_counts_by_itself(self) -> None:
        told = maps([(5, 5, 0.2), (5, 12, 0.6), (5, 20, 0.9)])
        expected = group(told.centers[0], told.sides[0], told.classes[0], 4)
        result = instances(FakeEngine(), told, (80, 120))  # type: ignore[arg-type]
        assert [i.confidence for i in result] == pytest.approx([0.9, 0.6])
        assert [(i.box, i.confidence, i.plate) for i in result] == [
            (i.box, i.confidence, i.plate) for i in expected
        ]

    def test_a_head_sees_weak_centres_and_has_the_last_word(self) -> None:
        head = Head()
        told = maps([(5, 5, 0.2), (5, 12, 0.6), (5, 20, 0.9)])
        result = instances(FakeEngine(head), told, (80, 120))  # type: ignore[arg-type]
        assert [i.confidence for i in result] == pytest.approx([0.8] * 3)
        (seen,) = head.seen
        assert seen.looks.shape == (3, 49, 3)
        assert seen.geometry.shape == (3, 24)
        assert seen.pairs.shape == (3, 3, 8)

    def test_a_head_that_finds_nothing(self) -> None:
        engine = FakeEngine(Head((0.98, 0.01, 0.01)))
        assert instances(engine, maps([(5, 5, 0.9)]), (80, 120)) == []  # type: ignore[arg-type]

    @pytest.mark.parametrize("cells", [[], [(5, 5, 0.1)]])
    def test_an_empty_picture_never_calls_the_head(
        self, cells: list[tuple[int, int, float]]
    ) -> None:
        head = Head()
        assert instances(FakeEngine(head), maps(cells), (80, 120)) == []  # type: ignore[arg-type]
        assert head.seen == []
