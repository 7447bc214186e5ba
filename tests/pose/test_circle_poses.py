from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fronto import Ellipse, Outline, estimate_pose
from fronto.pose.circle import circle_normals
from fronto.pose.rotation import angle_between
from fronto.synth import PAPER_CAMERA, LayoutButton, car_layout, observe, sample_scene

exact = settings(derandomize=True, deadline=None, max_examples=50)
tilts = st.floats(-35, 35)


def angle_deg(u, v):
    return np.degrees(np.arctan2(np.linalg.norm(np.cross(u, v)), u @ v))


@pytest.mark.parametrize(("columns", "rows"), [(2, 2), (3, 4), (4, 5)])
def test_exact_circles_give_the_exact_rotation(view, grid, columns, rows):
    # Upright within 15°: of a lattice's four readings that one is taken.
    @exact
    @given(tilts, tilts, st.floats(-15, 15), st.floats(240, 400), st.floats(180, 300))
    def run(tx, ty, tz, px, py):
        panel = view(
            grid(columns, rows, shape="ellipse"), (tx, ty, tz), at_px=(px, py), std_px=1e-3
        )
        pose = estimate_pose(panel.outlines, panel.camera, tolerance=0)
        assert panel.error_deg(pose) < 1e-3
        assert pose.residual_px.max() < 1e-4
        assert pose.weight.min() == 1.0
        assert pose.cos_norm is None
        assert pose.aspect_std is None
        # The circumscribed squares.
        half = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * 0.015
        places = np.array([[b.x, b.y] for b in panel.buttons])[:, None] + half
        expected = (places + panel.translation[:2]) / panel.translation[2]
        np.testing.assert_allclose(pose.plane_corners, expected, atol=1e-4)

    run()


def test_car_panels_of_circles():
    errors, ok = [], []
    for seed in range(60):
        rng = np.random.default_rng([13, seed])
        scene = sample_scene(rng, lambda r: car_layout(r, shape="ellipse"), max_angle_deg=30)
        scene = observe(rng, scene, 0.3)
        pose = estimate_pose(scene.outlines, scene.camera)
        errors.append(np.degrees(angle_between(pose.rotation, scene.rotation)))
        ok.append(pose.status == "ok")
    assert np.median(errors) <= 0.35
    assert np.array(errors)[ok].max() < 10.0
    assert np.mean(ok) > 0.7


@pytest.mark.parametrize("buttons", [4, 12])
def test_a_wrong_circle_is_set_aside_or_doubted(view, grid, buttons):
    columns, rows = {4: (2, 2), 12: (3, 4)}[buttons]
    for seed in range(10):
        rng = np.random.default_rng(seed)
        panel = view(grid(columns, rows, shape="ellipse"), rng.uniform(-25, 25, 3) * [1, 1, 0.5])
        panel = panel.noisy(seed, 0.1)
        wrong = int(rng.integers(buttons))
        outlines = list(panel.outlines)
        e = outlines[wrong].ellipse_px
        squeezed = Ellipse(e.cx, e.cy, 1.3 * e.a, 0.7 * e.b, e.angle_deg + 30)
        outlines[wrong] = replace(outlines[wrong], ellipse_px=squeezed)
        pose = estimate_pose(outlines, panel.camera)
        if pose.status == "ok":
            assert panel.error_deg(pose) < 5.0
        if buttons == 12:
            assert pose.weight[wrong] < 0.1
            assert panel.error_deg(pose) < 2.5


# --- what circles do not tell


def test_one_circle_has_two_normals(view):
    # GEOMETRY: r = 15 mm on the ray of (420, 240), R(0, 30, 0).
    circle = [LayoutButton(0, 0, 0.03, 0.03, "ellipse")]
    panel = view(circle, (0, 30, 0), at_px=(420, 240), std_px=0.01)
    pose = estimate_pose(panel.outlines, panel.camera, tolerance=0)
    assert pose.status == "degenerate"
    assert np.isnan(pose.covariance).all()
    found = np.array([p.normal for p in (pose, *pose.alternatives)])
    for normal in ([0.5, 0, np.sqrt(0.75)], [0.082, 0, 0.997]):
        assert min(angle_deg(normal, n) for n in found) < 0.1


@pytest.mark.parametrize("seed", range(8))
def test_one_circle_anywhere(view, seed):
    rng = np.random.default_rng(seed)
    circle = [LayoutButton(0, 0, 0.04, 0.04, "ellipse")]
    angles = rng.uniform(15, 35, 3) * rng.choice([-1, 1], 3) * [1, 1, 0]
    panel = view(circle, angles, at_px=rng.uniform([150, 120], [490, 360]), std_px=0.01)
    pose = estimate_pose(panel.outlines, panel.camera, tolerance=0)
    assert pose.status == "degenerate"
    found = [p.normal for p in (pose, *pose.alternatives)]
    for normal in circle_normals(panel.outlines[0].ellipse_px, panel.camera.matrix):
        assert min(angle_deg(normal, n) for n in found) < 0.5


def test_collinear_circles(view, grid):
    # One line of circles tells the roll but for a quarter turn, and the tilt by shape alone.
    for seed in range(30):
        angles = np.random.default_rng(seed).uniform(-35, 35, 3) * [1, 1, 0.3]
        panel = view(grid(1, 4, shape="ellipse"), angles).noisy(seed, 0.15)
        pose = estimate_pose(panel.outlines, panel.camera)
        assert pose.status in ("ok", "uncertain", "degenerate")
        if pose.status == "ok":
            assert panel.error_deg(pose) < 10.0


@pytest.mark.parametrize("angles", [(0, 0, 45), (10, -12, 43), (-15, 15, -44), (20, 5, 46)])
def test_lattices_rolled_by_half_a_quarter_have_two_readings(view, grid, angles):
    panel = view(grid(2, 2, shape="ellipse"), angles).noisy(1, 0.1)
    pose = estimate_pose(panel.outlines, panel.camera)
    assert pose.status == "uncertain"
    assert any("rows and columns" in reason for reason in pose.reasons)
    readings = [pose, *pose.alternatives]
    errors = np.array([panel.error_deg(p) for p in readings])
    assert errors.min() < 5.0
    assert (np.abs(errors - 90) < 5.0).any()
    for reading in readings:
        corners = reading.plane_corners
        assert corners.shape == (4, 4, 2)
        # Top-left first, clockwise: right, down, left along the reading's own axes.
        sides = np.diff(corners, axis=1)
        side = np.linalg.norm(sides[0, 0])
        steps = [[side, 0], [0, side], [-side, 0]]
        np.testing.assert_allclose(sides, np.broadcast_to(steps, sides.shape), atol=1e-9)
        # And where the circles are in the photo.
        rays = np.concatenate([corners.mean(axis=1), np.ones((4, 1))], axis=1) @ reading.rotation
        seen = rays @ panel.camera.matrix.T
        centers = np.array([o.ellipse_px.center for o in panel.outlines])
        np.testing.assert_allclose(seen[:, :2] / seen[:, 2:], centers, atol=1.0)


def test_upright_lattices_have_one_reading(view, grid):
    panel = view(grid(3, 4, shape="ellipse"), (20, -15, 5)).noisy(1, 0.1)
    pose = estimate_pose(panel.outlines, panel.camera)
    assert pose.status == "ok"
    assert pose.alternatives == ()


def test_frontal_circles_on_the_pixel_grid():
    # Far away and small: the images of frontal circles are circles.
    camera = replace(PAPER_CAMERA, matrix=[[9000, 0, 320], [0, 9000, 240], [0, 0, 1]])
    outlines = [
        Outline.ellipse(260 + 60 * i, 150 + 60 * j, 15, 15, std_px=0.2)
        for j in range(4)
        for i in range(3)
    ]
    pose = estimate_pose(outlines, camera)
    assert np.isfinite(pose.rotation).all()
    if pose.status == "degenerate":
        assert np.isnan(pose.std_deg).all()
    else:
        assert (np.abs(pose.angles_deg) <= 3 * np.array(pose.std_deg)).all()


def test_exactly_frontal_circles(view, grid):
    panel = view(grid(3, 4, shape="ellipse"), (0, 0, 0), std_px=0.2)
    pose = estimate_pose(panel.outlines, panel.camera)
    assert panel.error_deg(pose) < 0.05
    assert np.isfinite(pose.std_deg).all()


def test_quads_tell_the_roll_of_circles(view, grid):
    # Rolled by 40° a lattice of circles is as close to either reading; one quad decides.
    circles = grid(2, 2, shape="ellipse")
    buttons = (*circles, LayoutButton(0, 0.09, 0.06, 0.03))
    panel = view(buttons, (10, -12, 40)).noisy(1, 0.1)
    pose = estimate_pose(panel.outlines, panel.camera)
    assert panel.error_deg(pose) < 3.0
    assert not any("rows and columns" in reason for reason in pose.reasons)


# --- ovals


@pytest.mark.parametrize("height_m", [0.022, 0.026, 0.036])
@pytest.mark.parametrize("seed", range(4))
def test_ovals_are_told_from_tilted_circles(view, grid, height_m, seed):
    angles = np.random.default_rng(seed).uniform(-30, 30, 3) * [1, 1, 0.3]
    buttons = grid(3, 5, height_m=height_m, shape="ellipse")
    panel = view(buttons, angles).noisy(seed, 0.3)
    pose = estimate_pose(panel.outlines, panel.camera)
    # As circles they would be tilted by the arc cosine of their form: 43, 30 and 34 degrees.
    assert panel.error_deg(pose) < 4
    assert panel.error_deg(pose) < 3 * max(pose.std_deg)
    assert any("oval" in note for note in pose.notes)
    width, height = np.ptp(pose.plane_corners, axis=1).T
    np.testing.assert_allclose(height / width, height_m / 0.03, rtol=0.05)


@pytest.mark.parametrize("seed", range(8))
def test_circles_are_no_ovals(view, grid, seed):
    angles = np.random.default_rng(seed).uniform(-30, 30, 3) * [1, 1, 0.3]
    panel = view(grid(3, 5, shape="ellipse"), angles).noisy(seed, 0.5)
    pose = estimate_pose(panel.outlines, panel.camera)
    assert not any("oval" in note for note in pose.notes)
    np.testing.assert_allclose(*np.ptp(pose.plane_corners, axis=1).T)


@pytest.mark.parametrize("seed", range(8))
def test_two_ovals_are_no_ok_pose(view, grid, seed):
    # Nothing but their form would tell the tilt, and that is not known.
    angles = np.random.default_rng(seed).uniform(-20, 20, 3) * [1, 1, 0.3]
    panel = view(grid(1, 2, height_m=0.02, shape="ellipse"), angles).noisy(seed, 0.3)
    pose = estimate_pose(panel.outlines, panel.camera)
    assert pose.status != "ok" or panel.error_deg(pose) < 5


def test_keyholes_are_round(view, grid):
    buttons = grid(3, 4, height_m=0.022, shape="ellipse")
    panel = view(buttons, (20, 10, 0)).noisy(1, 0.2)
    keyholes = [replace(o, category="keyhole") for o in panel.outlines]
    pose = estimate_pose(keyholes, panel.camera)
    assert not any("oval" in note for note in pose.notes)
    np.testing.assert_allclose(*np.ptp(pose.plane_corners, axis=1).T)
