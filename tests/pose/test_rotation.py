import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fronto.errors import InputError
from fronto.pose.rotation import (
    angle_between,
    angle_jacobian,
    angles_from_rotation,
    nearest_rotation,
    rotation_exp,
    rotation_from_angles,
    rotation_log,
    rotation_x,
    rotation_y,
    rotation_z,
)

fixed = settings(derandomize=True, deadline=None)
angle = st.floats(-3.1, 3.1)
vectors = st.tuples(*[st.floats(-1.8, 1.8)] * 3)

S, C = 0.5, np.sqrt(3) / 2  # sine and cosine of 30°


def cross_matrix(w):
    return np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


def test_axes_have_the_papers_signs():
    t = np.pi / 6
    np.testing.assert_allclose(rotation_x(t), [[1, 0, 0], [0, C, S], [0, -S, C]], atol=1e-15)
    np.testing.assert_allclose(rotation_y(t), [[C, 0, -S], [0, 1, 0], [S, 0, C]], atol=1e-15)
    np.testing.assert_allclose(rotation_z(t), [[C, S, 0], [-S, C, 0], [0, 0, 1]], atol=1e-15)


def test_product_is_x_then_y_then_z():
    # R_x(90°) R_z(90°): e_x goes to -e_y by R_z, and that to e_z by R_x.
    rotation = rotation_from_angles(np.pi / 2, 0.0, np.pi / 2)
    np.testing.assert_allclose(rotation, [[0, 1, 0], [0, 0, 1], [1, 0, 0]], atol=1e-15)


@fixed
@given(angle, st.floats(-1.5, 1.5), angle)
def test_angles_come_back(tx, ty, tz):
    angles = angles_from_rotation(rotation_from_angles(tx, ty, tz))
    np.testing.assert_allclose(angles, [tx, ty, tz], atol=1e-9)


@pytest.mark.parametrize("sign", [1.0, -1.0])
@pytest.mark.parametrize("short", [0.0, 1e-12, 1e-10, 1e-8, 1e-6, 1e-3])
def test_angles_reproduce_the_rotation_at_and_near_gimbal_lock(sign, short):
    rotation = rotation_from_angles(0.4, sign * (np.pi / 2 - short), -0.9)
    angles = angles_from_rotation(rotation)
    np.testing.assert_allclose(rotation_from_angles(*angles), rotation, atol=1e-8)
    assert abs(angles[1]) == pytest.approx(np.pi / 2 - short, abs=1e-8)


@fixed
@given(st.floats(-3, 3), st.floats(-1.4, 1.4), st.floats(-3, 3))
def test_angle_jacobian_is_the_derivative(tx, ty, tz):
    rotation = rotation_from_angles(tx, ty, tz)
    step = 1e-5
    numeric = np.empty((3, 3))
    for i, w in enumerate(step * np.eye(3)):
        plus = angles_from_rotation(rotation @ rotation_exp(w))
        minus = angles_from_rotation(rotation @ rotation_exp(-w))
        numeric[:, i] = (plus - minus) / (2 * step)
    np.testing.assert_allclose(angle_jacobian(rotation), numeric, rtol=1e-5, atol=1e-5)


def test_angle_jacobian_without_rotation_is_minus_identity():
    np.testing.assert_allclose(angle_jacobian(np.eye(3)), -np.eye(3), atol=1e-15)


def test_angle_jacobian_is_nan_at_gimbal_lock():
    assert np.isnan(angle_jacobian(rotation_from_angles(0.2, np.pi / 2, 0.1))).all()


def test_exp_turns_right_handed():
    np.testing.assert_allclose(
        rotation_exp([0, 0, np.pi / 6]), [[C, -S, 0], [S, C, 0], [0, 0, 1]], atol=1e-15
    )
    np.testing.assert_allclose(rotation_exp([0.3, 0, 0]), rotation_x(-0.3), atol=1e-15)


@fixed
@given(vectors)
def test_exp_is_a_rotation_and_log_its_inverse(w):
    rotation = rotation_exp(w)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(rotation) == pytest.approx(1.0)
    if np.linalg.norm(w) < 3.1:
        np.testing.assert_allclose(rotation_log(rotation), w, atol=1e-12)


def test_exp_derivative_at_zero_is_the_cross_matrix():
    w = np.array([3e-7, -2e-7, 1e-7])
    np.testing.assert_allclose(rotation_exp(w) - np.eye(3), cross_matrix(w), atol=1e-13)


@pytest.mark.parametrize("length", [0.0, 1e-12, 1e-7, 1e-3, np.pi - 1e-7, np.pi - 1e-12, np.pi])
@pytest.mark.parametrize("axis", [(1, 0, 0), (0, -1, 0), (0, 0, 1), (0.36, 0.48, -0.8)])
def test_log_and_angle_near_zero_and_pi(length, axis):
    rotation = rotation_exp(length * np.array(axis))
    w = rotation_log(rotation)
    assert np.linalg.norm(w) == pytest.approx(length, abs=1e-15, rel=1e-9)
    np.testing.assert_allclose(rotation_exp(w), rotation, atol=1e-14)
    assert angle_between(np.eye(3), rotation) == pytest.approx(length, abs=1e-15, rel=1e-9)


@fixed
@given(vectors, vectors)
def test_angle_between_is_the_length_of_the_relative_rotation(v, w):
    first, second = rotation_exp(v), rotation_exp(w)
    expected = np.linalg.norm(rotation_log(first.T @ second))
    assert angle_between(first, second) == pytest.approx(expected, abs=1e-12)
    assert angle_between(second, first) == pytest.approx(expected, abs=1e-12)


@fixed
@given(vectors, st.floats(0.1, 10.0))
def test_nearest_rotation_undoes_scale_and_stretch(w, scale):
    rotation = rotation_exp(w)
    stretch = np.diag([1.0, 2.0, 0.5])
    np.testing.assert_allclose(nearest_rotation(scale * rotation @ stretch), rotation, atol=1e-12)


def test_nearest_rotation_of_a_mirrored_matrix_is_no_mirror():
    # The least singular value is the one to be turned over.
    np.testing.assert_allclose(nearest_rotation(np.diag([3.0, 2.0, -1.0])), np.eye(3), atol=1e-15)


@pytest.mark.parametrize("bad", [np.zeros((3, 3)), np.ones((3, 3)), np.eye(2), [[np.nan] * 3] * 3])
def test_nearest_rotation_refuses_what_has_none(bad):
    with pytest.raises(InputError):
        nearest_rotation(bad)
