import numpy as np
import pytest

from fronto.errors import InputError
from fronto.pose.criteria import (
    Criteria,
    back_project,
    check_matrix,
    cos_norm,
    cosines,
    dehomogenise,
    evaluate,
    final_cr,
    k_rv,
    normalise,
    rotate,
    slopes_horizontal,
    slopes_vertical,
    two_norm,
)
from fronto.pose.rotation import rotation_from_angles, rotation_y

K = np.array([[320.0, 0.0, 320.0], [0.0, 320.0, 240.0], [0.0, 0.0, 1.0]])  # Eq. 19

# Two buttons on the plane z = 1. First: h = (4, 2), v = (1, 2), so k_h = 1/2, k_v = 2,
# cos = (4 + 4) / (√20 √5) = 0.8. Second: h = (2, 0), v = (0, 3): head-on.
P = np.array(
    [
        [1.0, 5.0, 6.0, 2.0, 0.0, 2.0, 2.0, 0.0],
        [1.0, 3.0, 5.0, 3.0, 4.0, 4.0, 7.0, 7.0],
        [1.0] * 8,
    ]
)


def frontal(columns=1, side=0.1):
    square = np.array([[0, 0], [side, 0], [side, side], [0, side]])
    corners = np.concatenate([square + np.array([0.0, 2 * side * i]) for i in range(columns)])
    return np.vstack([corners.T, np.ones(len(corners))])


def test_back_projection_eq_1():
    rays = back_project([[320, 240], [640, 240], [0, 80]], K)
    np.testing.assert_allclose(rays.T, [[0, 0, 1], [1, 0, 1], [-1, -0.5, 1]], atol=1e-15)


def test_presupposed_corners_score_zero_eq_2():
    for criterion in ("inverse", "paper"):
        assert evaluate(frontal(3), criterion) == Criteria(0.0, 0.0, 0.0)


def test_rotation_and_division_eq_7():
    # R_y(45°) sends (0, 0, 1) to (-s, 0, s), a point at x = -1 of the plane z = 1.
    m = rotate(rotation_y(np.pi / 4), [[0.0, 1.0], [0.0, 2.0], [1.0, 1.0]])
    s = np.sqrt(0.5)
    np.testing.assert_allclose(m, [[-s, 0], [0, 2], [s, 2 * s]], atol=1e-15)
    np.testing.assert_allclose(dehomogenise(m), [[-1, 0], [0, 1 / s], [1, 1]], atol=1e-15)


def test_points_behind_the_camera_are_refused():
    with pytest.raises(InputError):
        dehomogenise([[0.0, 1.0], [0.0, 1.0], [1.0, -1.0]])


def test_slopes_eq_8_and_10():
    np.testing.assert_allclose(slopes_horizontal(P), [0.5, 0.0])
    np.testing.assert_array_equal(slopes_vertical(P), [2.0, np.inf])


def test_norms_eq_9_11_13():
    assert two_norm([3.0, -4.0]) == pytest.approx(5.0)
    assert k_rv([3.0, 4.0], "paper") == pytest.approx(0.2)
    assert k_rv([0.5, 2.0], "inverse") == pytest.approx(np.hypot(2.0, 0.5))
    values = evaluate(P, "inverse")
    assert (values.k_h, values.k_rv, values.cos) == pytest.approx((0.5, 0.5, 0.8))


def test_cosines_eq_12():
    np.testing.assert_allclose(cosines(P), [0.8, 0.0], atol=1e-15)


def test_cosines_use_the_third_coordinate():
    # h = (1, 0, 1), v = (0, 1, 1): cos = 1/2, though they are perpendicular seen along z.
    points = np.array([[0.0, 1.0, 1.0, 0.0], [0.0, 0.0, 1.0, 1.0], [1.0, 2.0, 3.0, 2.0]])
    np.testing.assert_allclose(cosines(points), [0.5])


def test_min_max_normalisation_eq_14_to_16():
    assert normalise(3.0, 1.0, 5.0) == pytest.approx(0.5)
    assert normalise(1.0, 1.0, 5.0) == 0.0
    assert normalise(5.0, 1.0, 5.0) == 1.0
    assert normalise(2.0, 2.0, 2.0) == 0.0


def test_final_criterion_eq_17():
    value = final_cr(Criteria(1.0, 2.0, 3.0), Criteria(0.0, 1.0, 1.0), Criteria(2.0, 5.0, 9.0))
    assert value == pytest.approx(0.5 + 0.25 + 0.25)


def test_printed_k_rv_calls_one_upright_edge_perfect():
    slopes = [1e9, 2.0]
    assert k_rv(slopes, "paper") == pytest.approx(1e-9)
    assert k_rv(slopes, "inverse") == pytest.approx(0.5)
    assert 90.0 - np.degrees(np.arctan(slopes[1])) == pytest.approx(26.565, abs=1e-3)


@pytest.mark.parametrize("criterion", ["inverse", "paper"])
def test_infinite_slopes_count_as_upright(criterion):
    assert k_rv([np.inf, -np.inf], criterion) == 0.0


def test_flat_vertical_edges_score_infinity():
    assert k_rv([0.0, 0.0], "paper") == np.inf
    assert k_rv([0.0, 1.0], "inverse") == np.inf


def test_before_the_division_cos_is_the_same_for_every_rotation():
    rays = back_project([[300, 200], [340, 210], [335, 250], [297, 244]], K)
    before, after = [], []
    for angles in np.radians([(0, 0, 0), (30, 0, 0), (-20, 35, 10), (5, -15, 25)]):
        m = rotate(rotation_from_angles(*angles), rays)
        before.append(evaluate(m).cos)
        after.append(evaluate(dehomogenise(m)).cos)
    assert np.ptp(before) < 1e-14
    assert np.ptp(after) > 0.05


def test_before_the_division_slopes_carry_no_perspective():
    # A square (side 0.1) seen from a camera turned by 30° about y: its lower edge converges
    # with the upper one in the image, and undoing the rotation makes the upper edge level
    # only after the division.
    panel = np.array([[0.0, 0.1, 0.1, 0.0], [-0.1, -0.1, 0.0, 0.0], [0.5, 0.5, 0.5, 0.5]])
    turn = rotation_y(np.radians(30.0))
    rays = dehomogenise(turn.T @ panel)
    m = rotate(turn, rays)
    assert abs(slopes_horizontal(m)[0]) > 0.05
    assert slopes_horizontal(dehomogenise(m))[0] == pytest.approx(0.0, abs=1e-15)


def test_cos_norm_of_plane_corners():
    corners = P[:2].T.reshape(2, 4, 2)
    assert cos_norm(corners) == pytest.approx(0.8)
    assert cos_norm(np.concatenate([corners, corners])) == pytest.approx(0.8 * np.sqrt(2))
    assert cos_norm(np.empty((0, 4, 2))) == 0.0


@pytest.mark.parametrize("bad", [np.zeros((4, 2)), np.full((1, 4, 2), np.nan)])
def test_cos_norm_refuses_other_shapes(bad):
    with pytest.raises(InputError):
        cos_norm(bad)


@pytest.mark.parametrize(
    "bad",
    [
        np.zeros((3, 3)),
        np.eye(2),
        np.diag([320.0, -320.0, 1.0]),
        np.diag([320.0, 320.0, 2.0]),
        np.diag([np.nan, 320.0, 1.0]),
    ],
)
def test_matrices_that_make_no_rays_are_refused(bad):
    with pytest.raises(InputError):
        check_matrix(bad)
