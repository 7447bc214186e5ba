import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fronto.errors import InputError
from fronto.pose.criteria import (
    Criteria,
    back_project,
    cos_norm,
    dehomogenise,
    evaluate,
    final_cr,
    rotate,
)
from fronto.pose.grid import search_grid
from fronto.pose.presupposed import presupposed_corners, translation
from fronto.pose.rotation import angle_between, rotation_from_angles, rotation_y

K = np.array([[320.0, 0.0, 320.0], [0.0, 320.0, 240.0], [0.0, 0.0, 1.0]])  # Eq. 19
SQUARE = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])

# Noise-free corners of three buttons on which the printed formulas fail.
FAILING = np.array(
    [
        [[212.736, 250.853], [229.926, 240.683], [243.891, 257.039], [226.926, 266.657]],
        [[232.931, 273.345], [249.796, 263.956], [262.707, 279.077], [246.068, 287.976]],
        [[251.635, 294.176], [268.175, 285.482], [280.147, 299.504], [263.832, 307.760]],
    ]
)
FAILING_TRUTH = rotation_from_angles(*np.radians([24.512, 14.670, -28.486]))


def photograph(rotation, buttons=3, side=0.03, pitch=0.05, at=(320.0, 240.0), depth=0.5):
    """Corners (b, 4, 2) of a column of square buttons, the panel turned by `rotation`."""
    rows = pitch * (np.arange(buttons) - (buttons - 1) / 2)
    panel = np.zeros((buttons, 4, 3))
    panel[..., :2] = side * SQUARE
    panel[..., 1] += rows[:, None]
    ray = np.linalg.solve(K, [*at, 1.0])
    points = (panel @ rotation + depth * ray) @ K.T
    return points[..., :2] / points[..., 2:]


def reference(corners, *, range_deg, step_deg, criterion, combine, shift, standard):
    """Alg. 1 in plain NumPy: best angles and Final CR, ranges, number of rotations."""
    nodes = np.arange(range_deg[0], range_deg[1] + step_deg / 2, step_deg)
    rays = back_project(corners.reshape(-1, 2), K)
    first = back_project(standard.reshape(-1, 2), K)
    tried = []
    for angles in itertools.product(nodes, repeat=3):
        m = rotate(rotation_from_angles(*np.radians(angles)), rays)
        t = np.zeros(3)
        if shift != "none":
            t = translation(first, rays if shift == "paper" else m)
        p = m + t[:, None]
        if (p[2] > 1e-9).all():
            tried.append((angles, evaluate(dehomogenise(p), criterion)))
    table = np.array([(c.k_h, c.k_rv, c.cos) for _, c in tried])
    finite = np.where(np.isfinite(table), table, np.nan)
    low, high = np.nanmin(finite, axis=0), np.nanmax(finite, axis=0)
    if combine == "minmax":
        scores = [final_cr(c, Criteria(*low), Criteria(*high)) for _, c in tried]
    else:
        scores = table.sum(axis=1)
    best = int(np.argmin(scores))
    return tried[best][0], tried[best][1], scores[best], low, high, len(tried)


@pytest.mark.parametrize("shift", ["none", "paper", "paper_rotated"])
@pytest.mark.parametrize("combine", ["sum", "minmax"])
@pytest.mark.parametrize("criterion", ["inverse", "paper"])
@settings(derandomize=True, deadline=None, max_examples=6)
@given(seed=st.integers(0, 10**6))
def test_kernel_equals_the_numpy_reference(criterion, combine, shift, seed):
    rng = np.random.default_rng(seed)
    turn = rotation_from_angles(*np.radians(rng.uniform(-35, 35, 3)))
    at, count = rng.uniform(150, 350, 2), int(rng.integers(1, 5))
    corners = photograph(turn, count, at=at) + rng.normal(0, 0.5, (count, 4, 2))
    standard = presupposed_corners("up_down_keyhole")
    grid = {"range_deg": (-37.0, 43.0), "step_deg": 13.0}
    angles, criteria, score, low, high, count = reference(
        corners, **grid, criterion=criterion, combine=combine, shift=shift, standard=standard
    )
    result = search_grid(
        corners,
        K,
        **grid,
        criterion=criterion,
        combine=combine,
        translation=shift,
        standard_corners=standard,
    )
    assert result.angles_deg == angles
    assert result.evaluated == count
    assert result.final_cr == pytest.approx(score, rel=1e-9, abs=1e-12)
    found = [(c.k_h, c.k_rv, c.cos) for c in (result, result.minima, result.maxima)]
    expected = [(criteria.k_h, criteria.k_rv, criteria.cos), low, high]
    np.testing.assert_allclose(found, expected, rtol=1e-9)


@pytest.mark.parametrize("shift", ["none", "paper", "paper_rotated"])
def test_result_is_consistent_with_itself(shift):
    corners = photograph(rotation_from_angles(0.2, -0.3, 0.1), at=(250, 200))
    result = search_grid(
        corners, K, step_deg=5.0, translation=shift, standard_corners=presupposed_corners()
    )
    rays = back_project(corners.reshape(-1, 2), K)
    plane = dehomogenise(result.rotation @ rays + result.translation[:, None])
    criteria = evaluate(plane)
    assert (result.k_h, result.k_rv, result.cos) == pytest.approx(
        (criteria.k_h, criteria.k_rv, criteria.cos), rel=1e-9
    )
    assert result.cos_norm == pytest.approx(cos_norm(plane[:2].T.reshape(-1, 4, 2)), rel=1e-9)
    np.testing.assert_allclose(
        result.rotation, rotation_from_angles(*np.radians(result.angles_deg))
    )
    assert not result.rotation.flags.writeable


def test_translations_follow_their_definition():
    corners = photograph(np.eye(3), at=(250, 200))
    standard = presupposed_corners()
    first = (standard[0, 0] - [320, 240]) / 320
    ray = np.append((corners[0, 0] - [320, 240]) / 320, 1.0)
    options = {"step_deg": 10.0, "standard_corners": standard}
    assert (search_grid(corners, K, **options).translation == 0).all()
    printed = search_grid(corners, K, translation="paper", **options)
    np.testing.assert_allclose(printed.translation, [*(first - ray[:2]), 0.0], atol=1e-12)
    rotated = search_grid(corners, K, translation="paper_rotated", **options)
    np.testing.assert_allclose(
        rotated.translation, np.append(first, 1.0) - rotated.rotation @ ray, atol=1e-12
    )


def test_failing_example_is_solved_by_default():
    result = search_grid(FAILING, K)
    assert result.angles_deg == (24.5, 14.5, -28.5)
    assert np.degrees(angle_between(result.rotation, FAILING_TRUTH)) < 0.2
    assert result.evaluated == 161**3


def test_failing_example_fails_as_printed():
    result = search_grid(FAILING, K, criterion="paper", combine="minmax")
    assert result.angles_deg == (28.0, -4.5, 9.0)
    error = np.degrees(angle_between(result.rotation, FAILING_TRUTH))
    assert error == pytest.approx(41.8, abs=0.05)
    # The paper's accuracy figure calls it nearly perfect all the same, and the largest
    # ‖K_H‖ leaves no weight to K_H in the normalised sum.
    assert result.cos_norm < 1e-4
    assert result.maxima.k_h > 1e5


def test_tilt_is_answered_with_asin_tan_when_the_first_corner_is_pinned():
    # e1 and d1 both lie on the optical axis: the printed T = e1 - d1 is then 0 and the
    # answer right; T = e1 - R d1 answers asin(tan 30°) with sides cos 35.26° cos 30° : 1.
    turn = rotation_y(np.radians(30.0))
    first = np.array([[0.0, 0.0], [2.0, 0.0], [0.0, 2.0], [2.0, 2.0]])  # two rows and columns
    panel = np.zeros((4, 4, 3))
    panel[..., :2] = 0.03 * (first[:, None] + SQUARE + 0.5)
    points = (panel @ turn + [0.0, 0.0, 0.5]) @ K.T
    corners = points[..., :2] / points[..., 2:]
    standard = 60.0 * (SQUARE + 0.5) + [320.0, 240.0]
    answers = {
        name: search_grid(corners, K, translation=name, standard_corners=standard)
        for name in ("none", "paper", "paper_rotated")
    }
    assert answers["none"].angles_deg == answers["paper"].angles_deg == (0.0, 30.0, 0.0)
    pinned = answers["paper_rotated"]
    assert pinned.angles_deg[0] == pinned.angles_deg[2] == 0.0
    expected = np.degrees(np.arcsin(np.tan(np.radians(30.0))))
    assert expected == pytest.approx(35.26, abs=0.01)
    assert pinned.angles_deg[1] == pytest.approx(expected, abs=0.5)

    def aspect(result):
        rays = back_project(corners[0], K)
        x, y, _ = dehomogenise(result.rotation @ rays + result.translation[:, None])
        return (x[1] - x[0]) / (y[3] - y[0])

    assert aspect(answers["none"]) == pytest.approx(1.0, abs=1e-9)
    assert aspect(pinned) == pytest.approx(0.707, abs=0.01)


def test_one_button_is_a_tie_and_the_first_of_the_loops_wins():
    # Eqs. 8-12 see its upper and left side only. With both along the image axes through the
    # principal point, any tilt about x or y scores exactly 0 like the truth, and the one
    # that the loops meet first is the answer.
    corners = np.array([[[320.0, 240.0], [380.0, 240.0], [380.0, 300.0], [320.0, 300.0]]])
    result = search_grid(corners, K, step_deg=1.0)
    assert result.angles_deg == (-40.0, 0.0, 0.0)
    assert result.final_cr == 0.0


def test_printed_translation_turns_the_answer():
    # Noise-free, but the column is not where the presupposed one is.
    turn = rotation_from_angles(*np.radians([20.0, -15.0, 5.0]))
    corners = photograph(turn, side=0.1, pitch=0.15, at=(220, 180))
    standard = presupposed_corners("up_down_keyhole")
    sound = search_grid(corners, K)
    printed = search_grid(corners, K, translation="paper", standard_corners=standard)
    assert np.degrees(angle_between(sound.rotation, turn)) < 1e-6
    assert np.degrees(angle_between(printed.rotation, turn)) > 3.0


@pytest.mark.parametrize("criterion", ["inverse", "paper"])
@pytest.mark.parametrize("combine", ["sum", "minmax"])
def test_frontal_input_answers_zero(criterion, combine):
    corners = np.array([[315, 215], [315, 265]])[:, None] + 30 * SQUARE
    result = search_grid(corners, K, step_deg=1.0, criterion=criterion, combine=combine)
    assert result.angles_deg == (0.0, 0.0, 0.0)
    assert (result.k_h, result.k_rv, result.cos) == (0.0, 0.0, 0.0)
    np.testing.assert_array_equal(result.rotation, np.eye(3))


def test_infinite_slopes_stay_out_of_the_ranges():
    # At θ_z = ±90° the printed K_rV of a frontal square is 1/0.
    corners = np.array([[[300, 220], [340, 220], [340, 260], [300, 260]]])
    result = search_grid(
        corners, K, range_deg=(-90.0, 90.0), step_deg=45.0, criterion="paper", combine="minmax"
    )
    assert np.isfinite([result.maxima.k_h, result.maxima.k_rv, result.final_cr]).all()
    assert result.angles_deg == (0.0, 0.0, 0.0)


FAR = {  # quads with one corner far from the others
    "first": [[-400, -300], [400, 200], [400, 400], [200, 400]],
    "second": [[250, 200], [1100, -300], [400, 400], [250, 400]],
    "third": [[250, 200], [400, 200], [1100, 900], [250, 400]],
    "fourth": [[250, 200], [400, 200], [400, 400], [-400, 900]],
}


@pytest.mark.parametrize("corner", FAR)
def test_rotations_that_put_any_corner_behind_are_left_out(corner):
    corners = np.array([FAR[corner]], dtype=float)
    result = search_grid(corners, K, range_deg=(-60.0, 60.0), step_deg=20.0)
    rays = back_project(corners.reshape(-1, 2), K)
    depths = np.array(
        [
            rotate(rotation_from_angles(*np.radians(angles)), rays)[2]
            for angles in itertools.product(np.arange(-60.0, 61.0, 20.0), repeat=3)
        ]
    )
    assert result.evaluated == (depths > 0).all(axis=1).sum()
    others = np.delete(depths, list(FAR).index(corner), axis=1)
    assert result.evaluated < (others > 0).all(axis=1).sum()


def test_grid_without_a_rotation_that_sees_all_is_refused():
    # R(90°, 90°, 90°) makes depth out of x, and the buttons lie on both sides of x = 0.
    with pytest.raises(InputError):
        search_grid(photograph(np.eye(3)), K, range_deg=(90.0, 90.0))


def test_nodes_of_the_grid_are_a_quarter_degree_away():
    rng = np.random.default_rng(0)
    errors = []
    for angles in rng.uniform(-40.0, 40.0, (400, 3)):
        true = rotation_from_angles(*np.radians(angles))
        low = np.floor(2 * angles) / 2
        errors.append(
            min(
                np.degrees(angle_between(true, rotation_from_angles(*np.radians(low + corner))))
                for corner in itertools.product((0.0, 0.5), repeat=3)
            )
        )
    assert np.median(errors) == pytest.approx(0.25, abs=0.02)
    assert np.quantile(errors, 0.95) == pytest.approx(0.35, abs=0.03)


def test_large_noise_free_panels_are_answered_within_a_few_steps():
    rng = np.random.default_rng(1)
    errors = []
    for angles in rng.uniform(-25.0, 25.0, (8, 3)):
        true = rotation_from_angles(*np.radians(angles))
        corners = photograph(true, 3, side=0.12, pitch=0.15, depth=0.4)
        errors.append(np.degrees(angle_between(search_grid(corners, K).rotation, true)))
    assert np.median(errors) < 1.0
    assert max(errors) < 3.0


def test_both_ends_are_tried():
    corners = photograph(
        rotation_from_angles(*np.radians([40.0, -40.0, 40.0])), side=0.06, pitch=0.1
    )
    assert search_grid(corners, K).angles_deg == (40.0, -40.0, 40.0)
    one = search_grid(FAILING, K, range_deg=(24.5, 24.5))
    assert (one.angles_deg, one.evaluated) == ((24.5, 24.5, 24.5), 1)
    assert search_grid(FAILING, K, range_deg=(-0.3, 0.3), step_deg=0.1).evaluated == 7**3


@pytest.mark.parametrize(
    "arguments",
    [
        {"range_deg": (10.0, -10.0)},
        {"range_deg": (-np.inf, 10.0)},
        {"step_deg": 0.0},
        {"step_deg": -1.0},
        {"step_deg": float("nan")},
        {"step_deg": 0.05},
        {"criterion": "cosine"},
        {"combine": "product"},
        {"translation": "yes"},
        {"translation": "paper"},
        {"translation": "paper", "standard_corners": np.zeros((0, 4, 2))},
        {"translation": "paper", "standard_corners": np.zeros((4, 3))},
        {"outlines_corners": np.zeros((0, 4, 2))},
        {"outlines_corners": np.zeros((1, 4, 2))},
        {"outlines_corners": np.zeros((4, 2))},
        {"matrix": np.zeros((3, 3))},
    ],
)
def test_bad_arguments_are_refused_in_one_line(arguments):
    arguments = {"outlines_corners": FAILING, "matrix": K} | arguments
    with pytest.raises(InputError) as caught:
        search_grid(arguments.pop("outlines_corners"), arguments.pop("matrix"), **arguments)
    assert "\n" not in str(caught.value)
