import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fronto.errors import InputError
from fronto.pose.criteria import Criteria, back_project, evaluate
from fronto.pose.presupposed import (
    place_on,
    presupposed_corners,
    project_to_image,
    translation,
)

K = np.array([[320.0, 0.0, 320.0], [0.0, 320.0, 240.0], [0.0, 0.0, 1.0]])
fixed = settings(derandomize=True, deadline=None)


def apply(matrix, points):
    mapped = np.column_stack([points, np.ones(len(points))]) @ matrix.T
    return mapped[:, :2] / mapped[:, 2:]


def test_up_down_panel_by_hand():
    corners = presupposed_corners("up_down", 101, 201, side_px=20, pitch_px=40)
    # Centre of the image (50, 100), button centres at y = 80 and 120.
    np.testing.assert_allclose(
        corners,
        [
            [[40, 70], [60, 70], [60, 90], [40, 90]],
            [[40, 110], [60, 110], [60, 130], [40, 130]],
        ],
    )


@pytest.mark.parametrize(("layout", "count"), [("up_down", 2), ("up_down_keyhole", 3)])
def test_both_kinds_are_head_on_and_centred(layout, count):
    corners = presupposed_corners(layout, 640, 480)
    assert corners.shape == (count, 4, 2)
    np.testing.assert_allclose(corners.mean(axis=(0, 1)), [319.5, 239.5])
    rays = back_project(corners.reshape(-1, 2), K)
    score = evaluate(rays)
    assert score == Criteria(
        pytest.approx(0, abs=1e-14), pytest.approx(0, abs=1e-14), pytest.approx(0, abs=1e-14)
    )


@pytest.mark.parametrize(
    "arguments",
    [
        {"layout": "car"},
        {"side_px": 0.0},
        {"side_px": 30.0, "pitch_px": 20.0},
        {"side_px": float("nan")},
        {"side_px": 300.0},
        {"width_px": 0, "height_px": 0},
    ],
)
def test_impossible_panels_are_refused(arguments):
    with pytest.raises(InputError):
        presupposed_corners(**arguments)


def test_translation_is_between_the_first_corners():
    standard = np.array([[1.0, 5.0], [2.0, 5.0], [1.0, 1.0]])
    detected = np.array([[0.5, 9.0], [3.0, 9.0], [1.0, 1.0]])
    np.testing.assert_allclose(translation(standard, detected), [0.5, -1.0, 0.0])


def test_projection_eq_18():
    pixels = project_to_image([[0.0, 1.0], [0.0, -0.5], [1.0, 1.0]], K)
    np.testing.assert_allclose(pixels, [[320, 240], [640, 80]])


@fixed
@given(
    st.lists(st.tuples(st.floats(0, 640), st.floats(0, 480)), min_size=2, max_size=12, unique=True)
)
def test_projection_undoes_back_projection(points):
    np.testing.assert_allclose(project_to_image(back_project(points, K), K), points, atol=1e-9)


def test_place_on_by_hand():
    # Twice as large and moved by (10, 20).
    source = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    np.testing.assert_allclose(
        place_on(2 * source + [10, 20], source), [[2, 0, 10], [0, 2, 20], [0, 0, 1]], atol=1e-12
    )


def test_place_on_turns_only_where_asked():
    source = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [0.0, 1.0]])
    turn = np.array([[0.6, -0.8], [0.8, 0.6]])
    target = 3 * source @ turn.T + [5, -7]
    np.testing.assert_allclose(apply(place_on(target, source, rotate=True), source), target)
    # Without a turn the best scale is 3 cos = 1.8, about the centroids.
    upright = place_on(target, source)
    np.testing.assert_allclose(upright[:2, :2], 1.8 * np.eye(2), atol=1e-12)
    np.testing.assert_allclose(apply(upright, source).mean(axis=0), target.mean(axis=0))


@fixed
@given(st.integers(0, 10**6), st.booleans())
def test_no_nearby_similarity_is_better(seed, rotate):
    rng = np.random.default_rng(seed)
    source = rng.normal(size=(6, 2))
    target = 2 * source + rng.normal(scale=0.2, size=(6, 2))
    best = place_on(target, source, rotate=rotate)
    least = np.sum((apply(best, source) - target) ** 2)
    turns = (0.0, 1e-3, -1e-3) if rotate else (0.0,)
    for turn in turns:
        for scale in (0.999, 1.0, 1.001):
            for shift in (0.0, 1e-3, -1e-3):
                c, s = np.cos(turn), np.sin(turn)
                other = best.copy()
                other[:2] = scale * np.array([[c, -s], [s, c]]) @ best[:2]
                other[0, 2] += shift
                assert np.sum((apply(other, source) - target) ** 2) >= least - 1e-12


def test_place_on_leaves_slopes_and_angles_alone():
    # The paper's T after the division: it moves the view and changes no criterion.
    points = np.array([[1.0, 5.0, 6.0, 2.0], [1.0, 3.0, 5.0, 3.0], [1.0, 1.0, 1.0, 1.0]])
    standard = presupposed_corners().reshape(-1, 2)[:4]
    placed = place_on(standard, points[:2].T) @ points
    before, after = evaluate(points), evaluate(placed)
    assert (after.k_h, after.k_rv, after.cos) == pytest.approx(
        (before.k_h, before.k_rv, before.cos)
    )


@pytest.mark.parametrize(
    ("standard", "rectified"),
    [
        ([[0, 0]], [[0, 0]]),
        ([[0, 0], [1, 0]], [[0, 0], [1, 0], [1, 1]]),
        ([[0, 0], [1, 0]], [[2, 2], [2, 2]]),
        ([[0, 0], [1, 0]], [[1, 0], [0, 0]]),
        ([[3, 3], [3, 3]], [[0, 0], [1, 0]]),
        ([[0, 0], [np.inf, 0]], [[0, 0], [1, 0]]),
    ],
)
def test_place_on_refuses_what_fits_no_upright_copy(standard, rectified):
    with pytest.raises(InputError):
        place_on(standard, rectified)


def test_place_on_refuses_a_mirrored_copy():
    square = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    with pytest.raises(InputError):
        place_on(square * [-1, 1], square, rotate=True)
