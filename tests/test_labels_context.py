"""What the context head is told of a panel, and what is made of its answers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import fields

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fronto.categories import CATEGORIES
from fronto.labels.context import GEOMETRY, PAIR, Context, beliefs, describe, probabilities
from fronto.labels.evidence import Evidence, Said
from fronto.labels.layout import DIRECTIONS
from fronto.results import Button, Plate
from fronto.shapes import Ellipse, FloatArray, Outline

LABELS = ("1", "2", "3", "open")
PLACE = {label: k for k, label in enumerate(LABELS)}
OTHERS, NONE = -1, -2
#: Columns of the geometry,
TRUNCATED, ODD, ELLIPSE, PLATE, POSED, THERE, CATEGORY, SHOWN = 9, 10, 11, 12, 15, 16, 17, 28
#: and of pairs, from the first thing to the second.
LEFT, RIGHT, ABOVE, BELOW = (8 + k for k in range(4))
SECOND, ITSELF, TO_PLATE = 4, 17, 18

#: Labels in different forms, no two of which are one floor.
WORDS = st.sampled_from(["1", "*2", "3", "open", "72", "*7", "FAN", ""])


@st.composite
def any_belief(draw: st.DrawFn) -> dict[str, float]:
    labels = draw(st.lists(WORDS, unique=True, max_size=6))
    weights = [draw(st.integers(1, 100)) for _ in labels]
    total = sum(weights) * draw(st.sampled_from([1.0, 1.25, 4.0]))
    return {label: weight / total for label, weight in zip(labels, weights, strict=True)}


def quad(x: float, y: float, side: float = 30.0, **more: object) -> Outline:
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * side / 2 + (x, y)
    return Outline.quad(corners, **more)  # type: ignore[arg-type]


def thing(outline: Outline, *, plate: bool = False) -> Button | Plate:
    return Plate(outline) if plate else Button(0, outline, None, None, 0.1, 1.0)


def square(x: float, y: float, side: float = 30.0) -> list[float]:
    return [x - side / 2, y - side / 2, x + side / 2, y + side / 2]


def told(
    boxes: Sequence[Sequence[float]] | FloatArray,
    plates: int = 0,
    said: Sequence[Said] | None = None,
    outlines: Sequence[Outline] | None = None,
    *,
    posed: bool = True,
) -> Context:
    """Of boxes, the last of which are plates'; what they say need not come of readings."""
    placed = np.asarray(boxes, float)
    count = len(placed) - plates
    outlines = outlines or [quad(50 + 40 * k, 100) for k in range(len(placed))]
    said = said or [Said({}, "unreadable")] * len(placed)
    own = tuple(one.labels for one in said[:count])
    return describe(
        [thing(outline, plate=k >= count) for k, outline in enumerate(outlines)],
        said,
        Evidence(own, tuple({} for _ in own), (), ()),
        own,
        own,
        placed,
        LABELS,
        posed=posed,
    )


def scattered(seed: int, n: int) -> FloatArray:
    rng = np.random.default_rng(seed)
    low = rng.uniform(0, 300, (n, 2))
    return np.hstack([low, low + rng.uniform(10, 60, (n, 2))])


class TestProbabilities:
    def test_labels_have_their_places(self) -> None:
        found = probabilities([{"2": 0.5, "open": 0.25}, {}], PLACE)
        assert found.dtype == np.float32
        np.testing.assert_array_equal(found, [[0, 0.5, 0, 0.25, 0, 0], [0] * 6])

    def test_a_star_counts_for_the_label_behind_it(self) -> None:
        (row,) = probabilities([{"*1": 0.5, "1": 0.25}], PLACE)
        np.testing.assert_array_equal(row, [0.75, 0, 0, 0, 0, 0])

    def test_unknown_labels_are_together_and_none_is_by_itself(self) -> None:
        (row,) = probabilities([{"72": 0.25, "*FAN": 0.125, "": 0.5}], PLACE)
        assert (row[OTHERS], row[NONE]) == (0.375, 0.5)
        assert not row[:NONE].any()

    def test_no_things(self) -> None:
        assert probabilities([], PLACE).shape == (0, 6)


class TestBeliefs:
    def test_probabilities_of_known_labels(self) -> None:
        rows = np.array([[0.1, 0.6, 0, 0.05, 0.25, 0], [0, 0, 1.0, 0, 0, 0]])
        first, second = beliefs(rows, [{"3": 0.9}, {}], LABELS)
        assert first == pytest.approx({"1": 0.1, "2": 0.6, "open": 0.05, "": 0.25})
        assert second == {"3": 1.0}

    def test_the_star_stays_where_it_was_read(self) -> None:
        row = np.array([[0.75, 0.25, 0, 0, 0, 0]])
        assert beliefs(row, [{"*1": 0.5, "2": 0.2}], LABELS) == [{"*1": 0.75, "2": 0.25}]
        assert beliefs(row, [{"*1": 0.1, "1": 0.2}], LABELS) == [{"1": 0.75, "2": 0.25}]
        assert beliefs(row, [{"1": 0.1, "*1": 0.2}], LABELS) == [{"*1": 0.75, "2": 0.25}]

    def test_unknown_labels_share_what_is_left_for_them(self) -> None:
        row = np.array([[0.2, 0, 0, 0, 0, 0.8]])
        (found,) = beliefs(row, [{"FAN": 0.3, "72": 0.1, "1": 0.6}], LABELS)
        assert found == pytest.approx({"1": 0.2, "FAN": 0.6, "72": 0.2})
        # Where none was read, it is not said which.
        assert beliefs(row, [{"1": 0.6, "": 0.4}], LABELS) == [{"1": 0.2}]

    def test_tiny_ones_are_dropped(self) -> None:
        row = np.array([[5e-4, 0.9965, 2e-3, 0, 5e-4, 5e-4]])
        (found,) = beliefs(row, [{"72": 1.0}], LABELS)
        assert set(found) == {"2", "3"}

    @settings(derandomize=True, deadline=None, max_examples=200)
    @given(any_belief())
    def test_what_is_only_repeated_stays(self, belief: dict[str, float]) -> None:
        (found,) = beliefs(probabilities([belief], PLACE), [belief], LABELS)
        assert found == pytest.approx(belief, abs=1e-6)

    @settings(derandomize=True, deadline=None, max_examples=200)
    @given(any_belief(), st.integers(0, 2**32 - 1))
    def test_sums_stay_at_most_one(self, belief: dict[str, float], seed: int) -> None:
        row = np.random.default_rng(seed).dirichlet(np.full(6, 0.3)).astype(np.float32)
        (found,) = beliefs(row[None], [belief], LABELS)
        assert sum(found.values()) <= 1 + 1e-6
        assert all(p >= 1e-3 for p in found.values())
        assert set(found) <= {*LABELS, *belief, ""}
        # Only what no label takes, and tiny ones, are lost.
        unread = 0.0 if set(belief) & {"72", "*7", "FAN"} else float(row[OTHERS])
        assert sum(found.values()) >= 1 - unread - 10 * 1e-3


class TestDescribe:
    @pytest.mark.parametrize(("buttons", "plates"), [(1, 0), (1, 1), (7, 3), (0, 2)])
    @pytest.mark.parametrize("posed", [True, False])
    def test_shapes(self, buttons: int, plates: int, posed: bool) -> None:
        n = buttons + plates
        found = told(scattered(n, n), plates, posed=posed)
        for name in ("own", "seen", "ordered"):
            assert getattr(found, name).shape == (n, len(LABELS) + 2)
        assert found.geometry.shape == (n, GEOMETRY)
        assert found.pairs.shape == (n, n, PAIR)
        for field in fields(Context):
            part = getattr(found, field.name)
            assert part.dtype == np.float32
            assert np.isfinite(part).all()
        assert (found.geometry[:, POSED] == posed).all()

    def test_boxes_that_are_nowhere(self) -> None:
        boxes = scattered(0, 5)
        boxes[[1, 4]] = np.nan
        for nowhere in (boxes, np.full((5, 4), np.nan)):
            found = told(nowhere, plates=2)
            assert np.isfinite(found.geometry).all()
            assert np.isfinite(found.pairs).all()
            missing = np.isnan(nowhere[:, 0])
            np.testing.assert_array_equal(found.geometry[:, THERE], ~missing)
            assert not found.pairs[missing][:, :, LEFT : BELOW + SECOND + 1].any()
            assert not found.pairs[:, missing][:, :, LEFT : BELOW + SECOND + 1].any()
        # The others are told as if they were alone.
        there = np.isfinite(boxes[:, 0])
        alone = told(boxes[there], plates=1)
        np.testing.assert_allclose(
            told(boxes, plates=2).pairs[np.ix_(there, there)], alone.pairs, atol=1e-5
        )

    def test_boxes_without_a_size(self) -> None:
        found = told([square(0, 0, 0), square(10, 0, 0), square(10, 0, 1e9)])
        assert np.isfinite(found.geometry).all()
        assert np.isfinite(found.pairs).all()

    @settings(derandomize=True, deadline=None, max_examples=100)
    @given(
        st.integers(0, 2**32 - 1),
        st.integers(1, 6),
        st.integers(0, 3),
        st.tuples(st.floats(-500, 500), st.floats(-500, 500)),
        st.floats(1e-3, 1e3),
        st.booleans(),
    )
    def test_place_and_scale_of_the_panel_do_not_matter(
        self,
        seed: int,
        buttons: int,
        plates: int,
        by: tuple[float, float],
        scale: float,
        nowhere: bool,
    ) -> None:
        boxes = scattered(seed, buttons + plates)
        if nowhere:
            boxes[-1] = np.nan
        outlines = [quad(50 + 40 * k, 100) for k in range(len(boxes))]
        found = told(boxes, plates, outlines=outlines)
        moved = told(scale * (boxes + np.array([*by, *by])), plates, outlines=outlines)
        np.testing.assert_allclose(moved.geometry, found.geometry, atol=1e-4)
        np.testing.assert_allclose(moved.pairs, found.pairs, atol=1e-4)

    @settings(derandomize=True, deadline=None, max_examples=100)
    @given(st.integers(0, 2**32 - 1), st.integers(1, 7), st.integers(0, 3))
    def test_in_another_order(self, seed: int, buttons: int, plates: int) -> None:
        n = buttons + plates
        rng = np.random.default_rng(seed)
        boxes = scattered(seed, n)
        outlines = [quad(*box[:2], rng.uniform(8, 60), confidence=rng.random()) for box in boxes]
        kinds = rng.choice(["text", "blank", "other"], n)
        said = [
            Said({str(k): float(rng.random())}, kind, rng.random()) for k, kind in enumerate(kinds)
        ]
        order = np.concatenate([rng.permutation(buttons), buttons + rng.permutation(plates)])
        order = order.astype(int)
        found = told(boxes, plates, said, outlines)
        mixed = told(boxes[order], plates, [said[k] for k in order], [outlines[k] for k in order])
        for name in ("own", "seen", "ordered", "geometry"):
            expected = getattr(found, name)[order]
            np.testing.assert_allclose(getattr(mixed, name), expected, atol=1e-5, err_msg=name)
        np.testing.assert_allclose(mixed.pairs, found.pairs[np.ix_(order, order)], atol=1e-5)

    def test_what_things_are(self) -> None:
        ellipse = Ellipse(40, 50, 20, 15, 0)
        outlines = [
            quad(0, 0, category="up", confidence=0.5, truncated=True),
            quad(40, 0, category="plate", odd=True),
            Outline("ellipse", ellipse_px=ellipse, category="number"),
        ]
        boxes = [square(0, 0), square(40, 0), square(80, 0)]
        found = told(boxes, outlines=outlines).geometry
        np.testing.assert_array_equal(found[:, [8]].T, [[0.5, 1, 1]])
        marks = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
        np.testing.assert_array_equal(found[:, [TRUNCATED, ODD, ELLIPSE]], marks)
        classes = found[:, CATEGORY : CATEGORY + len(CATEGORIES)]
        assert (classes.sum(axis=1) == 1).all()
        named = [CATEGORIES[k] for k in classes.argmax(axis=1)]
        assert named == ["up", "plate", "number"]

    def test_what_is_shown_instead_of_a_label(self) -> None:
        said = [
            Said({}, "other", 0.75),
            Said({}, "blank", 0.5),
            Said({"1": 0.1}, "unreadable", 0.25),
            Said({"1": 0.9}, "text", 0.9),
        ]
        found = told(scattered(0, 4), said=said).geometry[:, SHOWN:]
        np.testing.assert_array_equal(found, np.diag([0.75, 0.5, 0.25, 0])[:, :3])

    def test_buttons_and_plates_are_told_apart(self) -> None:
        said = [Said({"1": 0.5}, "text"), Said({}, "blank"), Said({"2": 0.75}, "text")]
        found = told([square(0, 0), square(0, 40), square(-36, 40)], 1, said)
        np.testing.assert_array_equal(found.geometry[:, PLATE], [0, 0, 1])
        for row in found.pairs[..., TO_PLATE]:
            np.testing.assert_array_equal(row, [0, 0, 1])
        np.testing.assert_array_equal(found.pairs[..., ITSELF], np.eye(3))
        for rows in (found.own, found.seen, found.ordered):
            np.testing.assert_array_equal(rows[2], [0, 0.75, 0, 0, 0, 0])

    def test_what_is_said_of_each_button_comes_from_the_right_source(self) -> None:
        boxes = np.array([square(0, 0), square(0, 40)])
        found = describe(
            [thing(quad(0, 0)), thing(quad(0, 40))],
            [Said({"1": 0.9}, "text")] * 2,
            Evidence(({"1": 0.5}, {}), ({}, {}), (), ()),
            [{"2": 0.5}, {}],
            [{"3": 0.5}, {}],
            boxes,
            LABELS,
            posed=True,
        )
        for k, rows in enumerate((found.own, found.seen, found.ordered)):
            assert rows[0].tolist() == (0.5 * np.eye(6)[k]).tolist()
            assert not rows[1].any()

    def test_neighbours_in_rows_and_columns(self) -> None:
        columns = [square(x, y) for y in (0, 50, 100) for x in (0, 45)]
        found = told(columns).pairs
        steps = dict(zip(DIRECTIONS, (LEFT, RIGHT, ABOVE, BELOW), strict=True))

        def flagged(first: int, direction: str, rank: int = 0) -> list[int]:
            column = steps[direction] + rank * SECOND
            return np.flatnonzero(found[first, :, column]).tolist()

        assert flagged(0, "right") == [1]
        assert flagged(1, "left") == [0]
        assert flagged(0, "left") == flagged(0, "above") == []
        assert flagged(2, "above") == [0]
        assert flagged(2, "below") == [4]
        assert flagged(0, "below") == [2]
        assert flagged(0, "below", rank=1) == [4]
        assert flagged(5, "above", rank=1) == [1]
        assert flagged(2, "below", rank=1) == flagged(0, "right", rank=1) == []

    def test_plates_are_no_neighbours_of_buttons(self) -> None:
        found = told([square(0, 0), square(0, 80), square(0, 40), square(0, 120)], 2).pairs
        near = found[..., LEFT : BELOW + SECOND + 1].any(axis=2)
        below = found[..., BELOW]
        assert (below[0, 1], below[2, 3]) == (1, 1)
        assert not near[:2, 2:].any()
        assert not near[2:, :2].any()

    def test_offsets_are_in_sides_of_the_typical_button(self) -> None:
        boxes = [square(0, 0, 20), square(50, 10, 20), square(-30, 0, 80), square(0, 30, 20)]
        found = told(boxes).pairs
        np.testing.assert_allclose(found[0, :, 2:4], [[0, 0], [2.5, 0.5], [-1.5, 0], [0, 1.5]])
        np.testing.assert_allclose(found[1, 2, 2:4], [-2.5, -0.5])  # no further than that
        np.testing.assert_allclose(found[..., :2], -found[..., :2].transpose(1, 0, 2), atol=1e-6)
        # Plates' sizes do not tell what is typical.
        plates = [square(90 * k, 200, 60) for k in range(5)]
        np.testing.assert_allclose(told([*boxes, *plates], 5).pairs[:4, :4], found, atol=1e-6)
