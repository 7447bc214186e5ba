"""Which plate names which button, and when nobody knows."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fronto.errors import InputError
from fronto.labels.layout import grid_of, straightened
from fronto.labels.plates import Pair, pairs, strays
from fronto.shapes import FloatArray

NOTHING = np.empty((0, 4))


def boxes(*centers: tuple[float, float], size: float = 30.0) -> FloatArray:
    middle = np.array(centers, dtype=float).reshape(-1, 2)
    return np.hstack([middle - size / 2, middle + size / 2])


def column(x: float, count: int, pitch: float = 50.0) -> list[tuple[float, float]]:
    return [(x, 100 + pitch * k) for k in range(count)]


def paired(buttons: FloatArray, plates: FloatArray, agreement: FloatArray | None = None) -> dict:
    found = pairs(buttons, plates, agreement)
    assert len({pair.button for pair in found}) == len(found)
    return {pair.plate: pair.button for pair in found}


@pytest.mark.parametrize("offset", [(-34, 0), (34, 0), (0, -34), (0, 34)])
def test_a_plate_on_any_side_names_the_button_beside_it(offset: tuple[int, int]) -> None:
    places = [(100.0 + 120 * i, 100.0 + 110 * j) for i in range(2) for j in range(4)]
    buttons = boxes(*places)
    plates = boxes(*((x + offset[0], y + offset[1]) for x, y in places), size=22)
    shuffled = [5, 2, 7, 0, 1, 6, 4, 3]
    assert paired(buttons, plates[shuffled]) == dict(enumerate(shuffled))


def test_plates_between_two_columns_belong_to_the_side_that_all_agree_on() -> None:
    # plate button plate button plate button, all equally far from each other
    places = [(100.0 + 40 * k, 100.0 + 60 * j) for j in range(4) for k in range(6)]
    plates, buttons = places[::2], places[1::2]
    assert paired(boxes(*buttons), boxes(*plates)) == {k: k for k in range(12)}


def test_a_plate_halfway_between_two_buttons_names_nobody() -> None:
    # button plate button: the plate may be of either
    buttons = boxes(*column(100, 5), *column(180, 5))
    plates = boxes(*column(140, 5))
    assert paired(buttons, plates) == {}


def test_a_closer_side_settles_it() -> None:
    buttons = boxes(*column(100, 5), *column(184, 5))
    plates = boxes(*column(147, 5))
    assert paired(buttons, plates) == {k: 5 + k for k in range(5)}


def test_what_readings_say_settles_it_as_well() -> None:
    buttons = boxes(*column(100, 5), *column(180, 5))
    plates = boxes(*column(140, 5))
    agreement = np.zeros((5, 10))
    agreement[:, :5] = -0.9  # the left ones carry other labels
    assert paired(buttons, plates, agreement) == {k: 5 + k for k in range(5)}


def test_a_mirrored_panel_has_plates_on_both_outer_sides() -> None:
    buttons = boxes(*column(100, 4), *column(150, 4))
    plates = boxes(*column(64, 4), *column(186, 4))
    assert paired(buttons, plates) == {k: k for k in range(8)}


def test_a_missing_button_leaves_its_plate_alone() -> None:
    buttons = boxes(*(place for k, place in enumerate(column(140, 6)) if k != 2))
    plates = boxes(*column(104, 6))
    assert paired(buttons, plates) == {0: 0, 1: 1, 3: 2, 4: 3, 5: 4}


def test_a_plate_far_from_all_buttons_names_nobody() -> None:
    assert paired(boxes(*column(140, 4)), boxes((40, 100), (140, 400))) == {}


def test_a_button_behind_another_is_not_the_plate_s() -> None:
    # plate button button: only the near one
    assert paired(boxes((135, 100), (166, 100)), boxes((100, 100))) == {0: 0}


def test_readings_that_contradict_refuse_a_lonely_pair() -> None:
    buttons, plates = boxes((135, 100)), boxes((100, 100))
    assert paired(buttons, plates, np.array([[1.0]])) == {0: 0}
    assert paired(buttons, plates, np.array([[-1.0]])) == {}


def test_nothing_and_what_has_no_place() -> None:
    assert pairs(NOTHING, NOTHING) == ()
    assert pairs(boxes((100, 100)), NOTHING) == ()
    assert pairs(NOTHING, boxes((100, 100))) == ()
    gone = np.full((1, 4), np.nan)
    assert paired(np.vstack([gone, boxes((135, 100))]), np.vstack([gone, boxes((100, 100))])) == {
        1: 1
    }


def test_wrong_shapes_are_named() -> None:
    with pytest.raises(InputError, match="buttons"):
        pairs(np.zeros((2, 2)), NOTHING)
    with pytest.raises(InputError, match="agreement"):
        pairs(boxes((1, 1)), boxes((1, 1)), np.zeros((2, 1)))


def test_plates_among_the_buttons_lie_as_the_others_do() -> None:
    real = column(140, 4)
    plates = boxes(*column(104, 3))
    buttons = boxes(*real, (104, 250), (300, 100))  # the fourth plate, and another button
    found = pairs(buttons, plates)
    assert len(found) == 3
    assert strays(buttons, plates, found) == (Pair(4, 3),)
    # One pair shows nothing, and without plates nothing lies as they do.
    assert strays(buttons, plates[:1], found[:1]) == ()
    assert strays(buttons, NOTHING, ()) == ()


@settings(derandomize=True, deadline=None, max_examples=60)
@given(
    st.integers(1, 3),
    st.integers(2, 7),
    st.sampled_from([0, 1]),
    st.floats(0.2, 50),
    st.floats(-3, 3),
    st.integers(0, 2**32 - 1),
)
def test_regular_panels_at_any_scale(
    columns: int, rows: int, side: int, scale: float, jitter: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    places = np.array([(90.0 * i, 45.0 * j) for i in range(columns) for j in range(rows)])
    moved = places + [(36, -36)[side], 0] + jitter * rng.uniform(-1, 1, places.shape)
    order = rng.permutation(len(places))
    found = paired(scale * boxes(*places), scale * boxes(*moved[order], size=26))
    assert found == dict(enumerate(order.tolist()))


def test_rows_and_columns_of_a_slanting_photo() -> None:
    places = np.array([(60.0 * i, 60.0 * j) for j in range(3) for i in range(3)])
    turn = np.radians(20)
    slanted = places @ np.array([[np.cos(turn), np.sin(turn)], [-0.1, np.cos(turn)]])
    grid = grid_of(straightened(boxes(*slanted)))
    assert grid.next_to[4].tolist() == [3, 5, 1, 7]  # left, right, above, below
    assert grid.next_to[0].tolist() == [-1, 1, -1, 3]
    assert grid.line(0, 1) == [1, 2]
    assert grid.gap(0, 1) == pytest.approx(grid.gap(1, 2))
    # Without that the rows are lost.
    assert grid_of(boxes(*slanted)).next_to[4].tolist() != [3, 5, 1, 7]


def test_staggered_columns_are_no_rows() -> None:
    grid = grid_of(boxes(*column(100, 4), *((x, y + 25) for x, y in column(160, 4))))
    assert (grid.next_to[:, :2] == -1).all()
    assert grid.next_to[1].tolist() == [-1, -1, 0, 2]
