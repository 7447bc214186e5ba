import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from fronto import Outline
from fronto.pose.bundle import FIRST_GROUP
from fronto.pose.observations import observations
from fronto.pose.starts import (
    initial_parameters,
    lattice_rolls,
    middle,
    reflected,
    starting_rotations,
)
from fronto.pose.structure import base_model, numbered
from fronto.synth import PAPER_CAMERA

fixed = settings(derandomize=True, deadline=None)
tilts = st.floats(-35, 35)


def seen_of(view):
    return observations(view.outlines, view.camera)


def model_of(seen):
    return base_model(seen, numbered(seen.kind), False, -1.0)


def angle_deg(u, v):
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(u, v)), u @ v))


def turned(points, angle_deg):
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    return np.asarray(points, dtype=float) @ np.array([[c, s], [-s, c]])


def test_middle_by_hand():
    assert middle(np.array([5.0, 1.0, 3.0])) == 3.0
    assert middle(np.array([4.0, 1.0, 3.0, 2.0])) == 3.0  # the upper of two
    values = np.array([[1, 9, 5], [7, 2, 4]])
    np.testing.assert_array_equal(middle(values), [7, 9, 5])
    np.testing.assert_array_equal(middle(values, axis=1), [5, 4])


@pytest.mark.parametrize("tilt", [10.0, 30.0, 40.0])
def test_starts_tilt_to_each_of_the_four_diagonals(view, grid, tilt):
    rotations = starting_rotations(seen_of(view(grid(2, 3), (5, 5, 5))), tilt)
    for rotation in rotations:
        np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(rotation) == pytest.approx(1.0)
        # Half of tilt² about x, half about y.
        part = np.cos(np.radians(tilt) / np.sqrt(2))
        assert rotation[2, 2] == pytest.approx(part**2)
    signs = {tuple(np.sign(rotation[2, :2])) for rotation in rotations}
    assert signs == {(1, 1), (1, -1), (-1, 1), (-1, -1)}


# A circle far off the axis: the feet of its tangents are not where the circle is.
@fixed
@example(0.0, 106.0, True)
@given(st.floats(0, 639), st.floats(0, 479), st.booleans())
def test_starts_have_everything_in_front_of_the_camera(px, py, round_):
    if round_:
        outline = Outline.ellipse(px, py, 20, 15)
        points = outline.ellipse_px.points(64)
    else:
        points = np.add([[-15, -15], [15, -15], [15, 15], [-15, 15]], [px, py])
        outline = Outline.quad(points)
    wide = PAPER_CAMERA.with_focal(120.0, 0.0)  # 139° wide: 30° tilts do not fit
    rays = np.column_stack([points, np.ones(len(points))]) @ np.linalg.inv(wide.matrix).T
    seen = observations([outline], wide)
    assert (rays @ starting_rotations(seen, 40.0)[:, 2].T > 0).all()


@fixed
@given(tilts, tilts, st.floats(-25, 25))
def test_starting_parameters_of_the_truth_are_the_truth(view, grid, tx, ty, tz):
    panel = view(grid(2, 3, width_m=0.03, height_m=0.02), (tx, ty, tz))
    seen = seen_of(panel)
    c, s = np.cos(0.4), np.sin(0.4)
    rolled = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) @ panel.rotation
    rotations, parameters, xy = initial_parameters(
        seen, model_of(seen), np.array([panel.rotation, rolled, rolled]), keep=2
    )
    np.testing.assert_allclose(rotations[0], panel.rotation, atol=1e-9)
    # From number 2 on they are rolled upright.
    np.testing.assert_allclose(rotations[1], rolled, atol=1e-12)
    np.testing.assert_allclose(rotations[2], panel.rotation, atol=1e-9)
    size = parameters[0, FIRST_GROUP : FIRST_GROUP + 2]
    assert size[0] - size[1] == pytest.approx(np.log(1.5), abs=1e-6)
    distances = np.linalg.norm(xy[0] - xy[0, :1], axis=1) / np.exp(size[0])
    places = np.array([[b.x, b.y] for b in panel.buttons])
    expected = np.linalg.norm(places - places[:1], axis=1) / 0.03
    np.testing.assert_allclose(distances, expected, atol=1e-6)
    np.testing.assert_allclose(xy[2], xy[0], atol=1e-9)
    np.testing.assert_allclose(xy[1], turned(xy[0], -np.degrees(0.4)), atol=1e-9)


@fixed
@given(tilts, tilts, st.floats(-25, 25), st.floats(100, 540), st.floats(100, 380))
def test_reflection_mirrors_the_normal_about_the_ray(view, grid, tx, ty, tz, px, py):
    panel = view(grid(1, 3), (tx, ty, tz), at_px=(px, py))
    seen = seen_of(panel)
    ray = np.array([*seen.pivot, 1.0])
    ray /= np.linalg.norm(ray)
    other = reflected(seen, panel.rotation)
    np.testing.assert_allclose(other @ other.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(other) == pytest.approx(1.0)
    true = panel.rotation[2]
    np.testing.assert_allclose(other[2], 2 * (true @ ray) * ray - true, atol=1e-12)
    np.testing.assert_allclose(reflected(seen, other), panel.rotation, atol=1e-12)


@fixed
@given(
    st.integers(2, 4),
    st.integers(2, 6),
    st.floats(1.3, 2.0),
    st.floats(1.3, 2.0),
    st.floats(-40, 40),
)
def test_lattices_are_turned_upright(columns, rows, pitch_x, pitch_y, roll):
    x, y = np.meshgrid(np.arange(columns) * pitch_x, np.arange(rows) * pitch_y)
    centers = np.column_stack([x.ravel(), y.ravel()])
    turns = np.degrees(lattice_rolls(turned(centers, roll), 1.0))
    off = (turns[0] - roll + 45) % 90 - 45  # R_z turns back what rolls clockwise
    assert abs(off) < 0.5
    assert (np.abs(turns) <= 46).all()


def test_two_circles_vote_for_their_line():
    # From the first to the second is 20° clockwise; R_z(20°) turns it back.
    centers = turned([[0, 0], [2, 0]], 20)
    turns = lattice_rolls(centers, 1.0)
    assert np.degrees(turns[0]) == pytest.approx(20, abs=0.1)
    assert lattice_rolls(turned(centers, 90), 1.0)[0] == pytest.approx(turns[0], abs=1e-3)


def test_staggered_lattices_offer_several_turns():
    x, y = np.meshgrid(np.arange(3.0), np.arange(5.0))
    x[1::2] += 0.5
    centers = 1.5 * np.column_stack([x.ravel(), y.ravel()])
    turns = np.degrees(lattice_rolls(centers, 1.0))
    assert len(turns) == 2
    assert min(np.abs(turns)) < 1.0
    assert len(lattice_rolls(centers, 1.0, most=1)) == 1


def test_one_circle_has_no_lattice():
    assert lattice_rolls(np.zeros((1, 2)), 1.0) == []
