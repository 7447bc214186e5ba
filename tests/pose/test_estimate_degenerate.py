from dataclasses import replace

import numpy as np
import pytest

from fronto import Camera, InputError, Outline, estimate_pose
from fronto.synth import PAPER_CAMERA, LayoutButton

SQUARE = np.array([[-10, -10], [10, -10], [10, 10], [-10, 10]], dtype=float)


def quads_at(*centers, std_px=0.5):
    return [Outline.quad(SQUARE + center, std_px=std_px) for center in centers]


# --- too little to tell


def test_nothing():
    pose = estimate_pose([], PAPER_CAMERA)
    assert pose.status == "no_buttons"
    assert not pose
    assert pose.reasons
    np.testing.assert_array_equal(pose.rotation, np.eye(3))
    assert pose.plane_corners.shape == (0, 4, 2)
    assert np.isnan(pose.covariance).all()


@pytest.mark.parametrize("square", [False, True])
@pytest.mark.parametrize("known", [True, False])
def test_one_button_is_never_ok(view, grid, square, known):
    camera = PAPER_CAMERA if known else replace(PAPER_CAMERA, focal_std=0.3)
    for seed in range(40):
        rng = np.random.default_rng(seed)
        panel = view(
            grid(1, 1), rng.uniform(-35, 35, 3), at_px=rng.uniform(80, 400, 2), distance_m=0.35
        ).noisy(seed, 0.3)
        pose = estimate_pose(panel.outlines, camera, square=square)
        assert pose.status in ("uncertain", "degenerate")
        assert not pose
        assert pose.reasons
        if pose.status == "degenerate":
            assert np.isnan(pose.covariance).all()
            assert np.isnan(pose.std_deg).all()


def test_one_square_button_has_two_folds(view, grid):
    both = 0
    for seed in range(30):
        rng = np.random.default_rng(seed)
        angles = rng.uniform(15, 35, 3) * rng.choice([-1, 1], 3)
        panel = view(grid(1, 1), angles, distance_m=0.5).noisy(seed, 0.3)
        pose = estimate_pose(panel.outlines, panel.camera, square=True)
        both += len(pose.alternatives) > 0
        found = [pose, *pose.alternatives]
        assert min(panel.error_deg(p) for p in found) < 15.0
        costs = [p.cost for p in found]
        assert costs == sorted(costs)
        assert all(p.plane_corners.shape == (1, 4, 2) for p in found)
    assert both > 20


def test_two_folds_of_two_small_buttons(view, grid):
    # Tilted towards the camera's axis, far away: nearly an affine view, both tilts fit.
    both = 0
    for seed in range(30):
        panel = view(grid(1, 2), (25, 20, 5), distance_m=1.2).noisy(seed, 0.3)
        pose = estimate_pose(panel.outlines, panel.camera, square=True)
        if pose.status == "ok":
            assert panel.error_deg(pose) < 10
        if pose.alternatives:
            both += 1
            assert pose.status != "ok"
            assert any("two poses" in reason for reason in pose.reasons)
            assert min(panel.error_deg(p) for p in (pose, *pose.alternatives)) < 15
    assert both >= 10


@pytest.mark.parametrize("square", [False, True])
def test_where_the_closed_form_from_vanishing_points_collapses(view, square):
    # GEOMETRY: this column at σ = 0.5; two vanishing points by SVD are 32.6° wrong.
    column = [LayoutButton(0, y, 0.03, 0.03) for y in (-0.05, 0.0, 0.05)]
    errors = []
    for seed in range(50):
        panel = view(column, (15, 20, 5), at_px=(340, 230)).noisy(seed, 0.5)
        pose = estimate_pose(panel.outlines, panel.camera, square=square)
        errors.append(panel.error_deg(pose))
        assert pose.status != "ok" or errors[-1] < 6.0
        best = min(panel.error_deg(p) for p in (pose, *pose.alternatives))
        assert best < 25.0
    assert np.median(errors) < 6.0


# --- exactly frontal


@pytest.mark.parametrize("square", [False, True])
def test_frontal_on_the_pixel_grid(square):
    centers = [(320, 180), (320, 240), (320, 300)]
    pose = estimate_pose(quads_at(*centers), PAPER_CAMERA, square=square)
    np.testing.assert_allclose(pose.rotation, np.eye(3), atol=1e-6)
    np.testing.assert_allclose(pose.angles_deg, 0, atol=1e-4)
    assert pose.cos_norm == pytest.approx(0.0, abs=1e-6)
    assert np.isfinite(pose.std_deg).all()
    expected = (SQUARE + np.array(centers)[:, None] - [320, 240]) / 320
    np.testing.assert_allclose(pose.plane_corners, expected, atol=1e-6)


def test_frontal_away_from_the_middle():
    centers = [(100 + 60 * i, 90 + 60 * j) for j in range(4) for i in range(3)]
    pose = estimate_pose(quads_at(*centers), PAPER_CAMERA)
    assert pose.status == "ok"
    assert np.linalg.norm(pose.angles_deg) < 2 * np.linalg.norm(pose.std_deg)
    assert np.linalg.norm(pose.angles_deg) < 0.2


@pytest.mark.parametrize("known", [True, False])
def test_frontal_with_noise_is_within_its_deviation(known):
    camera = PAPER_CAMERA if known else replace(PAPER_CAMERA, focal_std=0.3)
    for seed in range(10):
        rng = np.random.default_rng(seed)
        outlines = [
            Outline.quad(SQUARE + rng.normal([260 + 60 * i, 150 + 60 * j], 0.3, (4, 2)))
            for j in range(4)
            for i in range(3)
        ]
        pose = estimate_pose(outlines, camera)
        assert (np.abs(pose.angles_deg) < 3.5 * np.array(pose.std_deg)).all()


# --- no panel


def test_a_quad_that_fills_the_photo(view):
    panel = view([LayoutButton(0, 0, 0.8, 0.6)], (20, 10, 5)).outlines
    pose = estimate_pose(panel, PAPER_CAMERA)
    assert pose.status in ("uncertain", "degenerate")
    assert np.isfinite(pose.rotation).all()


def test_outlines_of_no_plane_are_not_ok():
    # Sizes and shapes at random: nothing that one panel could look like.
    for seed in range(20):
        rng = np.random.default_rng(seed)
        outlines = [
            Outline.quad(SQUARE * rng.uniform(0.4, 1.3, (4, 2)) + [220 + 70 * i, 140 + 70 * j])
            for j in range(3)
            for i in range(2)
        ]
        assert estimate_pose(outlines, PAPER_CAMERA).status != "ok"


def test_panels_rolled_by_a_quarter_are_not_ok(view, grid):
    panel = view(grid(2, 3), (10, 15, 80))
    pose = estimate_pose(panel.outlines, panel.camera)
    assert panel.error_deg(pose) < 0.1
    assert pose.status == "uncertain"
    assert any("rolled" in reason for reason in pose.reasons)


def test_two_that_contradict_each_other(view):
    pair = [LayoutButton(0, -0.03, 0.03, 0.03), LayoutButton(0, 0.03, 0.03, 0.03)]
    panel = view(pair, (10, 15, 0)).noisy(1, 0.3)
    wrong = 1.6 * (panel.outlines[1].corners_px - panel.outlines[1].center_px)
    bent = wrong @ np.array([[1.0, 0.4], [0.0, 1.0]]) + panel.outlines[1].center_px
    outlines = [panel.outlines[0], replace(panel.outlines[1], corners_px=bent)]
    assert estimate_pose(outlines, panel.camera, square=True).status != "ok"


# --- grid


def test_the_grid_needs_quads():
    pose = estimate_pose([Outline.ellipse(320, 240, 20, 18)], PAPER_CAMERA, solver="grid")
    assert pose.status == "degenerate"
    assert pose.reasons


def test_the_grid_knows_no_uncertainty(view, grid):
    panel = view(grid(1, 3), (10, -12, 6))
    pose = estimate_pose(panel.outlines, panel.camera, solver="grid", step_deg=2.0)
    assert pose.status == "uncertain"
    assert pose.solver == "grid"
    assert panel.error_deg(pose) < 2.5
    assert np.isnan(pose.covariance).all()
    assert pose.sigma_px is None
    assert pose.final_cr is not None
    assert pose.plane_corners.shape == (3, 4, 2)


# --- input that cannot be meant


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_corners_that_are_no_numbers_never_reach_the_solver(bad):
    corners = SQUARE + 240.0
    corners[2, 1] = bad
    with pytest.raises(InputError, match="corners"):
        Outline.quad(corners)


def test_outlines_cannot_be_changed_afterwards():
    outline = Outline.quad(SQUARE + 240.0)
    with pytest.raises(AttributeError):
        outline.std_px = -1.0
    with pytest.raises(ValueError, match="read-only"):
        outline.corners_px[0] = np.nan


def test_negative_deviations():
    with pytest.raises(InputError, match="std_px"):
        Outline.quad(SQUARE + 240.0, std_px=-0.5)


def test_the_same_button_twice():
    with pytest.raises(InputError, match="outlines 0 and 1"):
        estimate_pose(quads_at((320, 240), (320, 240)), PAPER_CAMERA)


def test_buttons_beyond_the_photo_are_solved_all_the_same(view, grid):
    panel = view(grid(2, 3), (10, -12, 6), at_px=(700, 500), std_px=0.01)
    assert panel.error_deg(estimate_pose(panel.outlines, panel.camera)) < 0.01


def test_long_and_short_focal_lengths(view, grid):
    for focal, distance in [(150.0, 0.2), (6000.0, 6.0)]:
        camera = Camera.from_matrix([[focal, 0, 320], [0, focal, 240], [0, 0, 1]], 640, 480)
        panel = view(grid(3, 5), (20, -25, 5), camera=camera, distance_m=distance, std_px=0.01)
        assert panel.error_deg(estimate_pose(panel.outlines, camera)) < 0.1


# --- sizes and shapes that differ


def test_keyholes_have_a_size_of_their_own(view):
    # Slightly smaller below, as if the panel leaned away there: only that they are keyholes
    # tells that they may be.
    buttons = [
        *(LayoutButton(0.0, y, 0.036, 0.036, "ellipse") for y in (-0.06, -0.02)),
        *(LayoutButton(x, 0.04, 0.034, 0.034, "ellipse") for x in (-0.05, 0.0, 0.05)),
    ]
    names = ["up", "down", "keyhole", "keyhole", "keyhole"]
    for seed in range(5):
        panel = view(buttons, (0, 3, 3), distance_m=0.35, std_px=0.1).noisy(seed, 0.1)
        pairs = zip(panel.outlines, names, strict=True)
        named = estimate_pose([replace(o, category=name) for o, name in pairs], panel.camera)
        assert panel.error_deg(named) < 3.0
        nameless = estimate_pose(panel.outlines, panel.camera)
        assert panel.error_deg(nameless) > panel.error_deg(named)


def test_round_beside_square_needs_a_surer_rotation(view, grid):
    # Outlines of both shapes in one column of like buttons: some are probably wrong.
    column = grid(1, 6)
    mixed = [replace(b, shape="ellipse") if k < 2 else b for k, b in enumerate(column)]

    def pose_of(buttons, noise):
        panel = view(buttons, (20, 5, 0), distance_m=0.6, std_px=noise).noisy(3, noise)
        return estimate_pose(panel.outlines, panel.camera)

    alike = pose_of(column, 0.3)
    assert alike.status == "ok"
    assert max(alike.std_deg) > 1.5
    assert pose_of(mixed, 0.1).status == "ok"
    doubted = pose_of(mixed, 0.2)
    assert 1.5 < max(doubted.std_deg) < 2.3
    assert doubted.status == "uncertain"
    assert any("square" in reason for reason in doubted.reasons)
