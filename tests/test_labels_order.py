"""Floors that count on, and none of them twice."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from fronto.labels.belief import Belief, best, combined, ranked, rest
from fronto.labels.layout import Grid, grid_of
from fronto.labels.order import in_order
from fronto.labels.series import Floor, floor_of, is_floor, label_key, normal_label


def grid(columns: int, rows: int) -> Grid:
    """Row by row."""
    centers = np.array([(50.0 * i, 50.0 * j) for j in range(rows) for i in range(columns)])
    return grid_of(np.hstack([centers - 15, centers + 15]))


def column(*beliefs: Belief) -> list[tuple[str, float]]:
    """The best of each button of one column, all things considered."""
    return [best(belief) for belief in in_order(beliefs, grid(1, len(beliefs)))]


def sure(*labels: str) -> list[dict[str, float]]:
    return [{label: 0.99} for label in labels]


def test_what_is_read_surely_stays() -> None:
    labels = ["12", "11", "10", "G", "B1", "B2", "open"]
    found = column(*sure(*labels))
    assert [label for label, _ in found] == labels
    assert all(p > 0.95 for _, p in found)


def test_neighbours_raise_a_weak_reading_that_fits_and_lower_one_that_does_not() -> None:
    weak = {"8": 0.6, "6": 0.3}
    first, second, third = (
        dict(in_order([*sure("10", "9"), belief, *sure("7", "6")], grid(1, 5))[2])
        for belief in (weak, {"3": 0.6, "8": 0.3}, {"3": 0.95})
    )
    assert first["8"] > 0.95
    assert best(second) == ("8", pytest.approx(second["8"]))
    assert second["8"] > 0.8
    assert third["3"] < 0.94  # less sure than the reading, but not overruled
    assert best(third)[0] == "3"


def test_a_sure_reading_is_not_overruled() -> None:
    # 13 is skipped: 12, 14, 15 count on by steps that the neighbours do not foresee.
    found = column(*sure("15", "14", "12", "11", "10"))
    assert [label for label, _ in found] == ["15", "14", "12", "11", "10"]
    assert min(p for _, p in found) > 0.9


def test_two_equally_sure_claims_are_both_undecided() -> None:
    found = column(*sure("5", "8", "up", "8", "1"))
    assert max(found[1][1], found[3][1]) < 0.6
    assert all(found[k][1] > 0.9 for k in (0, 2, 4))


def test_the_far_surer_claim_wins_and_the_other_takes_what_is_left() -> None:
    beliefs = [{"8": 0.999}, {"up": 0.99}, {"8": 0.6, "3": 0.35}]
    found = column(*beliefs)
    assert found[0][0] == "8"
    assert found[0][1] > 0.99
    assert found[2] == ("3", pytest.approx(0.875, abs=0.02))


def test_a_starred_floor_is_the_same_floor() -> None:
    found = column({"*1": 0.97}, {"open": 0.99}, {"1": 0.97})
    assert max(found[0][1], found[2][1]) < 0.6
    fits = in_order([*sure("4", "3", "2"), {"*1": 0.6, "*7": 0.3}], grid(1, 4))[3]
    assert best(fits)[0] == "*1"
    assert best(fits)[1] > 0.8


def test_functions_may_be_there_twice() -> None:
    assert column(*sure("open", "open", "alarm", "alarm")) == [
        (label, pytest.approx(0.99)) for label in ("open", "open", "alarm", "alarm")
    ]


@pytest.mark.parametrize(("low", "step"), [(3, 1), (3, 2), (-6, 1)])
def test_a_button_that_nobody_could_read_between_two_is_filled_in(low: int, step: int) -> None:
    floors = [str(low + step * k) for k in range(6)]
    beliefs = [*sure(*floors[:3]), {"8": 0.05}, *sure(*floors[4:])]
    found = column(*beliefs)
    assert found[3][0] == floors[3]
    assert 0.8 < found[3][1] < 1


def test_basements_count_on_too() -> None:
    assert column(*sure("B1", "B2"), {}, *sure("B4"))[2][0] == "B3"


def test_a_row_fills_in_its_middle() -> None:
    found = in_order([*sure("1"), {}, *sure("3", "4", "5", "6")], grid(3, 2))
    assert best(found[1])[0] == "2"


@pytest.mark.parametrize(
    "beliefs",
    [
        [*sure("5", "6"), {"keyhole": 0.7}, *sure("8", "9")],  # the reading says another thing
        [*sure("5", "6"), {"": 0.9}, *sure("8", "9")],  # a symbol that is no label
        [*sure("7", "5", "6"), {}, *sure("8", "9")],  # the floor is taken
        [*sure("5", "6"), {}, *sure("9", "10")],  # the neighbours leave no floor
        [*sure("5", "6"), {}, *sure("7", "8")],
        [{"6": 0.6}, {}, {"8": 0.6}],  # they are not sure
        [*sure("6"), {}, *sure("P8")],  # not of one series
        [{}, *sure("6", "7")],  # at the end of a column there may be anything
        [*sure("up"), {}, *sure("down")],
    ],
)
def test_nothing_is_filled_in_elsewhere(beliefs: list[dict[str, float]]) -> None:
    found = in_order(beliefs, grid(1, len(beliefs)))
    for before, after in zip(beliefs, found, strict=True):
        label, p = best(after)
        assert p < 0.8 or label == best(before)[0]


def test_a_gap_in_the_column_is_no_neighbour() -> None:
    centers = np.array([(0, 0), (0, 50), (0, 150.0)])
    found = in_order([*sure("6"), {}, *sure("8")], grid_of(np.hstack([centers - 15, centers + 15])))
    assert best(found[1])[1] < 0.8


def test_the_two_columns_of_a_panel_help_each_other() -> None:
    floors = [str(k) for k in range(1, 13)]
    beliefs = [{floor: 0.95} for floor in floors]
    beliefs[5] = {"5": 0.5, "6": 0.4}  # "5" is its neighbour
    beliefs[8] = {"3": 0.5, "9": 0.3}
    found = in_order(beliefs, grid(2, 6))
    assert [best(belief)[0] for belief in found] == floors
    assert all(best(belief)[1] > 0.8 for belief in found)


def test_nothing_to_order() -> None:
    assert in_order([], grid_of(np.empty((0, 4)))) == ()
    assert in_order([{}], grid(1, 1)) == ({},)
    assert in_order([{"7": 0.7}], grid(1, 1)) == ({"7": 0.7},)


labels = st.sampled_from(["1", "2", "3", "*3", "4", "B1", "G", "open", ""])
beliefs = st.dictionaries(labels, st.floats(0.001, 1), max_size=4).map(
    lambda raw: {label: p / max(1.0, sum(raw.values())) for label, p in raw.items()}
)


@settings(derandomize=True, deadline=None, max_examples=150)
@given(st.lists(beliefs, min_size=6, max_size=6))
@example([{}, {"1": 1.0, "2": 0.0}, {"1": 1.0}, {"1": 0.5, "2": 0.5}, {"1": 0.5, "2": 0.5}, {}])
def test_probabilities_stay_probabilities_and_floors_stay_unique(given: list[Belief]) -> None:
    before = [dict(belief) for belief in given]
    found = in_order(given, grid(2, 3))
    assert given == before
    for belief in found:
        assert all(0 <= p <= 1 + 1e-9 for p in belief.values())
        assert sum(belief.values()) <= 1 + 1e-6
    named = [label_key(label) for label, p in map(best, found) if p > 0.8 and is_floor(label)]
    assert len(set(named)) == len(named)
    # Mirrored left to right, a panel is the same panel.
    mirrored = [1, 0, 3, 2, 5, 4]
    again = in_order([given[k] for k in mirrored], grid(2, 3))
    for k, other in enumerate(mirrored):
        for label, p in found[other].items():
            assert again[k].get(label, 0.0) == pytest.approx(p, abs=1e-6)


def test_independent_sources_multiply() -> None:
    assert combined({"8": 0.7}, {}) == {"8": 0.7}
    assert combined({}, {"8": 0.7}) == {"8": 0.7}
    both = combined({"8": 0.7, "3": 0.2}, {"8": 0.8})
    assert both["8"] > 0.98
    assert combined({"8": 0.9}, {"3": 0.9})["8"] == pytest.approx(0.5, abs=0.1)
    assert combined({"8": 1.0}, {"3": 1.0}) == {"8": 0.5, "3": 0.5}
    assert rest(both) >= 0
    assert ranked({"a": 0.1, "c": 0.4, "b": 0.4}) == (("b", 0.4), ("c", 0.4), ("a", 0.1))


@pytest.mark.parametrize(
    ("label", "floor"),
    [
        ("12", ("", 12, "")),
        ("-2", ("", -2, "")),
        ("*1", ("", 1, "")),
        ("B3", ("B", 3, "")),
        ("12A", ("", 12, "A")),
        ("P1B", ("P", 1, "B")),
        ("G", None),
        ("B-1", None),
        ("01", None),
        ("open", None),
        ("", None),
    ],
)
def test_floors_as_numbers(label: str, floor: tuple[str, int, str] | None) -> None:
    assert floor_of(label) == (None if floor is None else Floor(*floor))
    if floor is not None:
        assert Floor(*floor).label == label_key(label)


@pytest.mark.parametrize(
    ("text", "label"),
    [
        (" b1 ", "B1"),
        ("OPEN", "open"),
        ("door open", "open"),
        ("Bell", "alarm"),
        ("ph", "PH"),
        ("★1", "*1"),
        ("−2", "-2"),
        ("fan", "FAN"),
        ("?!", ""),
    ],
)
def test_labels_in_normal_form(text: str, label: str) -> None:
    assert normal_label(text) == label
    assert normal_label(label) == label


def test_what_names_a_floor() -> None:
    assert all(map(is_floor, ["12", "-1", "*1", "B1", "G", "*G", "PH", "12A"]))
    assert not any(map(is_floor, ["open", "up", "FAN", "", "HOLD"]))
