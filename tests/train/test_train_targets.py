"""Targets worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("torch")

from fronto.categories import CATEGORIES
from fronto.train.targets import IGNORE, OBJECT, RARE, SOME_BUTTON, Target, draw_targets


def box(x0: float, y0: float, x1: float, y1: float) -> np.ndarray:
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])


#: Around the pixels 8..27 in both directions; its middle is that of the cell (4, 4).
SQUARE = box(7.9, 7.9, 27.1, 27.1)


def test_nothing() -> None:
    t = draw_targets([], 32, 16)
    assert t.masks.shape == (16, 32)
    assert t.classes.shape == t.weights.shape == t.inside.shape == (4, 8)
    assert t.centers.shape == (2, 4, 8)
    assert t.sides.shape == (4, 4, 8)
    for values in (t.masks, t.classes, t.centers, t.inside):
        assert not values.any()
    assert (t.weights == 1).all()


def test_an_exact_square() -> None:
    t = draw_targets([Target("number", SQUARE, exact=True)], 64, 48)
    expected = np.zeros((48, 64), np.uint8)
    expected[8:28, 8:28] = 1
    assert np.array_equal(t.masks, expected)
    # Cells 2..6: their second pixels are 9, 13, ..., 25.
    cells = np.zeros((12, 16), np.uint8)
    cells[2:7, 2:7] = CATEGORIES.index("number")
    assert np.array_equal(t.classes, cells)

    assert t.centers[0, 4, 4] == 1
    assert (t.centers[0] == 1).sum() == 1
    # 19.2 px wide: the peak's deviation is its least, 0.7 cells of 4 px.
    assert t.centers[0, 4, 5] == pytest.approx(np.exp(-0.5 * (4 / 2.8) ** 2))
    assert t.centers[0, 6, 3] == pytest.approx(np.exp(-0.5 * (4 / 2.8) ** 2 * (1 + 4)))
    assert not t.centers[1].any()

    # The cells within three quarters of 9.6 px of the middle (17.5): at 13.5, 17.5, 21.5.
    inside = np.zeros((12, 16))
    inside[3:6, 3:6] = 1 / 9
    assert np.allclose(t.inside, inside)
    assert t.sides[:, 4, 4] == pytest.approx([9.6, 9.6, 9.6, 9.6], abs=1e-4)
    assert t.sides[:, 3, 5] == pytest.approx([13.6, 5.6, 5.6, 13.6], abs=1e-4)
    assert t.weights[4, 4] == pytest.approx(OBJECT * 8 / 3)
    assert t.weights[8, 8] == 1


def test_sides_give_the_box_back_from_every_cell() -> None:
    t = draw_targets([Target("up", box(6.3, 20.1, 49.7, 41.4), exact=True)], 64, 64)
    rows, columns = np.nonzero(t.inside)
    x, y = 4 * columns + 1.5, 4 * rows + 1.5
    left, top, right, bottom = t.sides[:, rows, columns]
    assert np.allclose(x - left, 6.3, atol=1e-4)
    assert np.allclose(y - top, 20.1, atol=1e-4)
    assert np.allclose(x + right, 49.7, atol=1e-4)
    assert np.allclose(y + bottom, 41.4, atol=1e-4)
    assert t.inside.sum() == pytest.approx(1)


def test_rare_kinds_count_twice() -> None:
    common = draw_targets([Target("number", SQUARE, exact=True)], 64, 48)
    rare = draw_targets([Target("alarm", SQUARE, exact=True)], 64, 48)
    at = common.inside > 0
    assert RARE > OBJECT > 1
    assert np.allclose(rare.weights[at] / RARE, common.weights[at] / OBJECT)


def test_a_mere_box_leaves_its_corners_open() -> None:
    t = draw_targets([Target("stop", SQUARE, exact=False)], 64, 48)
    assert t.masks[8, 8] == t.masks[27, 27] == t.masks[8, 27] == IGNORE
    assert t.masks[17, 17] == 1
    # The inscribed ellipse ends at 7.9 and is scaled to 0.92: at 8.67.
    assert t.masks[17, 10] == 1
    assert t.masks[17, 5] == t.masks[5, 17] == 0
    assert not t.masks[30:].any()
    assert t.classes[2, 2] == IGNORE
    assert t.classes[4, 4] == CATEGORIES.index("stop")
    # Its box is known all the same.
    assert t.sides[:, 4, 4] == pytest.approx([9.6, 9.6, 9.6, 9.6], abs=1e-4)
    assert t.centers[0, 4, 4] == 1


def test_an_unknown_button_is_some_button() -> None:
    t = draw_targets([Target("unknown", SQUARE, exact=True)], 64, 48)
    assert t.classes[4, 4] == SOME_BUTTON
    assert t.masks[17, 17] == 1
    assert t.centers[0, 4, 4] == 1


def test_plates_have_maps_of_their_own() -> None:
    t = draw_targets([Target("plate", SQUARE, exact=True)], 64, 48)
    assert t.masks[17, 17] == 2
    assert t.classes[4, 4] == CATEGORIES.index("plate")
    assert t.centers[1, 4, 4] == 1
    assert not t.centers[0].any()
    assert t.inside.sum() == pytest.approx(1)


def test_what_is_ignored_gives_no_verdict() -> None:
    t = draw_targets([Target("up", SQUARE, exact=True, ignore=True)], 64, 48)
    assert (t.masks[8:28, 8:28] == IGNORE).all()
    assert t.masks[40, 40] == 0
    assert (t.classes[2:7, 2:7] == IGNORE).all()
    assert (t.centers[:, 2:7, 2:7] == -1).all()
    assert (t.centers[:, 8:] == 0).all()
    assert not t.inside.any()
    assert (t.weights == 1).all()


def test_a_button_inside_of_what_is_ignored_counts() -> None:
    crowd = Target("other", box(0, 0, 60, 44), exact=False, ignore=True)
    t = draw_targets([crowd, Target("up", SQUARE, exact=True)], 64, 48)
    assert t.masks[17, 17] == 1
    assert t.masks[40, 40] == IGNORE
    assert t.centers[0, 4, 4] == 1
    assert t.centers[0, 10, 10] == -1


def test_of_a_truncated_button_the_part_that_is_seen_counts() -> None:
    t = draw_targets([Target("down", box(-30, 7.9, 19.5, 27.1), exact=True)], 64, 48)
    assert (t.masks[8:28, :20] == 1).all()
    # It reaches from -0.5 to 19.5: its middle at 9.5 is that of the cell 2.
    assert t.centers[0, 4, 2] == 1
    assert t.sides[:, 4, 2] == pytest.approx([10, 9.6, 10, 9.6], abs=1e-4)
    right = draw_targets([Target("down", box(43.5, 30, 99, 99), exact=True)], 64, 48)
    i, j = np.argwhere(right.centers[0] == 1)[0]
    x, y = 4 * j + 1.5, 4 * i + 1.5
    assert x + right.sides[2, i, j] == pytest.approx(63.5)
    assert y + right.sides[3, i, j] == pytest.approx(47.5)


def test_a_sliver_at_the_border_is_no_instance() -> None:
    t = draw_targets([Target("up", box(-20, 8, 0.5, 28), exact=True)], 64, 48)
    assert not (t.centers == 1).any()
    assert not t.inside.any()


def test_neighbours_keep_their_own_centres() -> None:
    left, right = box(3.9, 7.9, 15.1, 27.1), box(16.9, 7.9, 28.1, 27.1)
    t = draw_targets([Target("number", b, exact=True) for b in (left, right)], 64, 48)
    assert (t.centers[0] == 1).sum() == 2
    assert t.inside.sum() == pytest.approx(2)
    cells = {tuple(cell) for cell in np.argwhere(t.centers[0] == 1)}
    assert cells == {(4, 2), (4, 5)}


def test_what_is_known_to_be_round_or_rectangular_leaves_less_open() -> None:
    unknown, round_one, square = (
        draw_targets([Target("number", box(8, 8, 48, 48), exact=False, form=form)], 64, 64).masks
        for form in ("", "round", "square")
    )
    corner, diagonal = (10, 10), (16, 16)  # 0.90 and 0.60 of the way from middle to corner
    assert unknown[corner] == square[corner] == IGNORE
    assert round_one[corner] == 0
    assert square[13, 13] == 1
    assert unknown[13, 13] == IGNORE
    assert unknown[diagonal] == round_one[diagonal] == square[diagonal] == 1
    share = [(m == IGNORE).mean() for m in (unknown, round_one, square)]
    assert share[1] < share[0]
    assert share[2] < share[0]
    # The inscribed circle has radius 20: 19 is button, 21.5 is not.
    assert round_one[28, 28 + 19] == 1
    assert (round_one[28, 28 + 22], unknown[28, 28 + 19]) == (0, IGNORE)
