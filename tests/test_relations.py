"""What the relation head is told: hand-made maps and boxes with known answers."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fronto.grouping import Instance
from fronto.relations import candidates, describe, geometry, looks, pairs, shifted
from fronto.shapes import FloatArray

STRIDE = 4
AT = np.array([-6, -4, -2, 0, 2, 4, 6]) / 7
EDGES = slice(8, 12)
ANY_BOX = st.tuples(st.floats(0, 300), st.floats(0, 200), st.floats(4, 90), st.floats(4, 90)).map(
    lambda b: (b[0], b[1], b[0] + b[2], b[1] + b[3])
)
ANY_BOXES = st.lists(ANY_BOX, min_size=1, max_size=5).map(lambda boxes: np.array(boxes))


def places(height: int, width: int) -> npt.NDArray[np.float32]:
    """A map (2, h, w) that tells where its cells are, pixels."""
    x, y = np.meshgrid(np.arange(width) * STRIDE + 1.5, np.arange(height) * STRIDE + 1.5)
    return np.stack([x, y]).astype(np.float32)


def told(
    boxes: FloatArray, confidence: float | list[float] = 0.5, shape: tuple[int, int] = (200, 300)
) -> npt.NDArray[np.float32]:
    n = len(boxes)
    confidences = np.broadcast_to(np.asarray(confidence, float), (n,))
    return geometry(boxes, confidences, np.zeros(n, bool), np.full((n, 11), 1 / 11), shape)


class TestLooks:
    def test_points_of_the_enlarged_boxes_row_by_row(self) -> None:
        boxes = np.array([[40.0, 30, 80, 60], [90, 70, 104, 98]])
        found = looks(boxes, places(30, 40), STRIDE)
        assert found.shape == (2, 49, 2)
        assert found.dtype == np.float32
        x, y = (60 + 30 * AT, 45 + 22.5 * AT)
        np.testing.assert_allclose(found[0, :, 0], np.tile(x, 7), atol=1e-4)
        np.testing.assert_allclose(found[0, :, 1], np.repeat(y, 7), atol=1e-4)
        assert found[1, 24] == pytest.approx([97, 84], abs=1e-4)

    @settings(derandomize=True, deadline=None, max_examples=100)
    @given(ANY_BOXES, st.integers(1, 30), st.integers(1, 40))
    def test_what_lies_outside_is_as_the_border(
        self, boxes: FloatArray, height: int, width: int
    ) -> None:
        boxes = boxes - 60
        found = looks(boxes, places(height, width), STRIDE)
        middle, half = (boxes[:, :2] + boxes[:, 2:]) / 2, 0.75 * (boxes[:, 2:] - boxes[:, :2])
        x, y = (middle[:, k, None] + half[:, k, None] * AT for k in (0, 1))
        x, y = np.clip(x, 1.5, 4 * width - 2.5), np.clip(y, 1.5, 4 * height - 2.5)
        np.testing.assert_allclose(found[..., 0], np.tile(x, 7), atol=1e-3)
        np.testing.assert_allclose(found[..., 1], np.repeat(y, 7, axis=1), atol=1e-3)


class TestGeometry:
    def test_shape(self) -> None:
        found = told(np.array([[0.0, 0, 10, 10], [30, 40, 50, 60], [80, 80, 90, 100]]))
        assert found.shape == (3, 24)
        assert found.dtype == np.float32

    def test_any_confidence_and_class_is_finite(self) -> None:
        boxes = np.array([[0.0, 0, 10, 10], [30, 40, 50, 60], [80, 80, 90, 100]])
        found = told(boxes, [0.15, 1.0, 0.3])
        assert np.isfinite(found).all()
        assert np.abs(found).max() < 12
        scores = np.eye(11)[:3]
        sure = geometry(boxes, np.ones(3), np.ones(3, bool), scores, (200, 300))
        assert np.isfinite(sure).all()

    def test_edges_of_the_picture_are_marked(self) -> None:
        boxes = np.array(
            [
                [-0.5, 90, 20, 110],
                [140, 1, 160, 21],
                [275, 90, 299, 110],
                [140, 180, 160, 199],
                [140, 90, 160, 110],
                [279, 179, 299, 199],
            ]
        )
        expected = [*np.eye(4), np.zeros(4), [0, 0, 1, 1]]
        np.testing.assert_array_equal(told(boxes)[:, EDGES], expected)

    def test_sizes_are_told_against_those_of_likely_ones(self) -> None:
        sides = np.array([20.0, 20, 20, 80, 80, 80, 80])
        low = np.array([[30.0 * k, 40.0] for k in range(7)])
        found = told(np.hstack([low, low + sides[:, None]]), [0.9] * 3 + [0.2] * 4)
        np.testing.assert_allclose(found[:, 2], np.log(sides / 20), atol=1e-6)
        # Where none is likely, all count.
        found = told(np.hstack([low, low + sides[:, None]]), 0.2)
        np.testing.assert_allclose(found[:, 2], np.log(sides / 80), atol=1e-6)


class TestPairs:
    @settings(derandomize=True, deadline=None, max_examples=60)
    @given(ANY_BOXES, st.floats(-100, 100), st.floats(-100, 100), st.floats(0.3, 3))
    def test_place_and_scale_of_the_picture_do_not_matter(
        self, boxes: FloatArray, x: float, y: float, scale: float
    ) -> None:
        found = pairs(boxes)
        assert found.shape == (len(boxes), len(boxes), 8)
        moved = pairs(scale * boxes + np.array([x, y, x, y]))
        np.testing.assert_allclose(moved, found, atol=1e-4)

    def test_boxes_in_line_differ_from_others(self) -> None:
        boxes = np.array([[0.0, 0, 20, 20], [40, 0, 60, 20], [43, 7, 63, 27], [40, 30, 60, 50]])
        in_row = pairs(boxes)[0, :, 3]
        np.testing.assert_allclose(in_row[:2], 1)
        assert 0.9 > in_row[2] > 0.1 > in_row[3]
        turned = pairs(boxes[:, [1, 0, 3, 2]])[0, :, 2]
        np.testing.assert_allclose(turned, in_row)

    def test_of_the_second_as_the_first_sees_it(self) -> None:
        boxes = np.array([[0.0, 0, 20, 20], [40, 0, 80, 20]])
        found = pairs(boxes)
        assert found[0, 1, 0] == pytest.approx(np.log(1 + 50 / 20))
        assert found[1, 0, 0] == pytest.approx(-np.log(1 + 50 / 40))
        assert found[0, 1, 4:6] == pytest.approx([np.log(2), 0], abs=1e-6)
        np.testing.assert_allclose(found[[0, 1], [0, 1], -1], 1)  # each overlaps itself
        assert found[0, 1, -1] == 0


class TestShifted:
    def test_edges_move_by_shares_of_the_sides(self) -> None:
        boxes = np.array([[10.0, 20, 50, 100]])
        found = shifted(boxes, np.array([[0.1, -0.25, -0.1, 0.5]], np.float32))
        np.testing.assert_allclose(found, [[14, 0, 46, 140]], atol=1e-4)

    @settings(derandomize=True, deadline=None)
    @given(ANY_BOXES, st.lists(st.floats(-1e6, 1e6), min_size=20, max_size=20))
    def test_no_box_is_turned_inside_out(self, boxes: FloatArray, shifts: list[float]) -> None:
        found = shifted(boxes, np.array(shifts).reshape(5, 4)[: len(boxes)])
        assert (found[:, 2:] - found[:, :2] > 0).all()


def test_describe_agrees_with_its_parts() -> None:
    rng = np.random.default_rng(0)
    boxes = [(10.0, 20.0, 40.0, 60.0), (50.0, 20.0, 80.0, 58.0)]
    instances = [
        Instance(plate, confidence, box, rng.dirichlet(np.ones(11)))
        for box, plate, confidence in zip(boxes, (False, True), (0.8, 0.3), strict=True)
    ]
    features = rng.normal(size=(5, 20, 30)).astype(np.float32)
    found = describe(instances, features, STRIDE, (80, 120))
    plain = np.array(boxes)
    scores = np.stack([i.scores for i in instances])
    np.testing.assert_array_equal(found.looks, looks(plain, features, STRIDE))
    np.testing.assert_array_equal(found.pairs, pairs(plain))
    expected = geometry(plain, np.array([0.8, 0.3]), np.array([False, True]), scores, (80, 120))
    np.testing.assert_array_equal(found.geometry, expected)
    assert [part.dtype for part in (found.looks, found.geometry, found.pairs)] == [np.float32] * 3


class TestCandidates:
    @staticmethod
    def found(centers: npt.NDArray[np.float32]) -> list[Instance]:
        _, h, w = centers.shape
        classes = np.full((11, h, w), 1 / 11, np.float32)
        return candidates(centers, np.full((4, h, w), 1.5, np.float32), classes, STRIDE)

    def test_weaker_centres_than_those_of_buttons(self) -> None:
        centers = np.zeros((2, 10, 12), np.float32)
        centers[0, 5, [1, 5, 9]] = 0.14, 0.16, 0.8
        centers[1, 2, 5] = 0.2
        kinds = [(i.plate, round(i.confidence, 2)) for i in self.found(centers)]
        assert kinds == [(False, 0.8), (True, 0.2), (False, 0.16)]

    def test_the_surest_160_of_many(self) -> None:
        centers = np.zeros((2, 40, 40), np.float32)
        values = np.random.default_rng(0).permutation(np.linspace(0.2, 0.9, 400))
        centers[0, ::2, ::2] = values.reshape(20, 20)
        confidences = [i.confidence for i in self.found(centers)]
        np.testing.assert_allclose(confidences, np.sort(values)[:-161:-1], atol=1e-6)
