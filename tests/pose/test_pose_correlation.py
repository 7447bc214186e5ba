"""Outlines that err alike: `correlation` of `estimate_pose`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fronto import Camera, InputError, LineSegment, estimate_pose
from fronto.pose.rotation import angle_between, rotation_log

fixed = settings(derandomize=True, deadline=None, max_examples=15)
#: 95 % point of χ² with three degrees of freedom.
CHI2_95 = 7.815


def degrees_between(first, second):
    return np.degrees(angle_between(first.rotation, second.rotation))


def lines_of(panel, noise_px=0.0, seed=0):
    rng = np.random.default_rng(seed)
    frame = (
        ("horizontal", [[-0.2, -0.15], [0.2, -0.15]]),
        ("vertical", [[-0.2, -0.15], [-0.2, 0.15]]),
        ("vertical", [[0.2, -0.15], [0.2, 0.15]]),
    )
    return [
        LineSegment(axis, panel.project(points) + rng.normal(0, noise_px, (2, 2)), std_px=0.5)
        for axis, points in frame
    ]


@pytest.mark.parametrize(("columns", "rows"), [(1, 2), (2, 3), (3, 5)])
def test_deviations_grow_by_what_is_common(view, grid, columns, rows):
    n = columns * rows

    @fixed
    @given(st.floats(0, 1), st.integers(0, 50))
    def run(correlation, seed):
        angles = np.random.default_rng(seed).uniform(-25, 25, 3)
        panel = view(grid(columns, rows), angles).noisy(seed, 0.2)
        plain = estimate_pose(panel.outlines, panel.camera)
        alike = estimate_pose(panel.outlines, panel.camera, correlation=correlation)
        # n that err alike tell as much as n / (1 + (n - 1) rho) that do not.
        factor = 1 + (n - 1) * correlation
        if alike.status == "degenerate":
            assert np.sqrt(factor) * max(plain.std_deg) > 10
            return
        np.testing.assert_allclose(alike.covariance, factor * plain.covariance, rtol=1e-6)
        assert alike.aspect_std == pytest.approx(np.sqrt(factor) * plain.aspect_std)
        # What is seen stays where it is.
        assert degrees_between(plain, alike) < 1e-9
        np.testing.assert_allclose(alike.plane_corners, plain.plane_corners)
        np.testing.assert_allclose(alike.residual_px, plain.residual_px)
        np.testing.assert_allclose(alike.weight, plain.weight)
        assert alike.sigma_px == plain.sigma_px

    run()


def test_one_button_has_nothing_in_common(view, grid):
    panel = view(grid(1, 1, width_m=0.12), (20, -15, 5)).noisy(0, 0.3)
    plain = estimate_pose(panel.outlines, panel.camera, square=True)
    alike = estimate_pose(panel.outlines, panel.camera, square=True, correlation=1)
    np.testing.assert_array_equal(alike.covariance, plain.covariance)
    assert alike.status == plain.status


def test_no_correlation_is_the_default(view, grid):
    panel = view(grid(2, 3), (20, -15, 5)).noisy(0, 0.3)
    plain = estimate_pose(panel.outlines, panel.camera)
    none = estimate_pose(panel.outlines, panel.camera, correlation=0)
    np.testing.assert_array_equal(none.covariance, plain.covariance)


def test_what_is_less_sure_is_trusted_less(view, grid):
    panel = view(grid(2, 3), (8, -10, 3)).noisy(1, 0.3)
    statuses = [
        estimate_pose(panel.outlines, panel.camera, correlation=c).status for c in (0.0, 0.3, 1.0)
    ]
    assert statuses[0] == "ok"
    assert statuses[-1] != "ok"


def test_mirrored_poses_have_their_deviations_raised_too(view, grid):
    panel = view(grid(1, 2), (12, -10, 0)).noisy(4, 1.0)
    plain = estimate_pose(panel.outlines, panel.camera)
    alike = estimate_pose(panel.outlines, panel.camera, correlation=0.5)
    assert len(alike.alternatives) >= len(plain.alternatives) > 0
    for one in plain.alternatives:
        (other,) = [p for p in alike.alternatives if degrees_between(p, one) < 1e-6]
        np.testing.assert_allclose(other.covariance, 1.5 * one.covariance, rtol=1e-6)


def test_a_second_pose_is_excluded_less_easily(view, grid):
    # What costs so much more costs less where all outlines share their errors.
    told = {0.0: 0, 0.5: 0, 1.0: 0}
    for seed in range(20):
        angles = np.random.default_rng(seed).uniform(-20, 20, 3)
        panel = view(grid(2, 2), angles).noisy(seed, 0.5)
        for correlation in told:
            pose = estimate_pose(panel.outlines, panel.camera, correlation=correlation)
            told[correlation] += bool(pose.alternatives)
    assert told[0.0] <= told[0.5] <= told[1.0]
    assert told[0.0] < told[1.0]


# --- lines and priors are independent of what the outlines share


@pytest.mark.parametrize("seed", range(4))
def test_lines_weigh_more_where_outlines_err_alike(view, grid, seed):
    angles = np.random.default_rng(seed).uniform(-25, 25, 3)
    panel = view(grid(2, 3), angles).noisy(seed, 0.5)

    # Lines of a panel that is turned a little against the buttons: who wins?
    other = replace(panel, rotation=panel.rotation @ turn(0.4))
    lines = lines_of(other)
    poses = [
        estimate_pose(panel.outlines, panel.camera, lines=lines, correlation=c)
        for c in (0.0, 0.1, 0.5, 1.0)
    ]
    alone = estimate_pose(panel.outlines, panel.camera)
    from_lines = [other.error_deg(pose) for pose in poses]
    assert from_lines == sorted(from_lines, reverse=True)
    assert from_lines[-1] < 0.7 * from_lines[0]
    moved = [degrees_between(pose, alone) for pose in poses]
    assert moved == sorted(moved)
    # Together they are surer than the outlines alone, and less sure than without correlation.
    for pose, correlation in zip(poses, (0.0, 0.1, 0.5, 1.0), strict=True):
        without = estimate_pose(panel.outlines, panel.camera, correlation=correlation)
        if np.isfinite(without.covariance).all():
            assert np.trace(pose.covariance) < np.trace(without.covariance)
        assert np.trace(pose.covariance) >= np.trace(poses[0].covariance) * (1 - 1e-9)


def turn(degrees):
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return np.array([[c, 0, s], [0, 1, 0], [-s, 0, c]])


def test_lines_keep_their_own_deviation(view, grid):
    # How far a frontal panel leans back is known from the two vertical lines only.
    panel = view(grid(2, 3), (0, 0, 0), std_px=1.0)
    lines = lines_of(panel)
    alone = estimate_pose(panel.outlines, panel.camera).std_deg[0]
    stds = [
        estimate_pose(panel.outlines, panel.camera, lines=lines, correlation=c).std_deg[0]
        for c in (0.0, 1.0)
    ]
    assert stds[0] < 0.1 * alone
    assert stds[1] < 1.02 * stds[0]


@pytest.mark.parametrize("correlation", [0.0, 0.3, 1.0])
def test_lines_are_set_aside_by_their_own_deviation(view, grid, correlation):
    # Weighing more must not make lines that fit seem such that do not.
    panel = view(grid(3, 5), (20, -15, 8), std_px=0.3)
    lines = []
    for k, at in enumerate((-0.24, -0.2, -0.16, 0.16, 0.2, 0.24)):
        for axis, points in (
            ("horizontal", [[-0.2, at], [0.2, at]]),
            ("vertical", [[at, -0.2], [at, 0.2]]),
        ):
            ends = panel.project(points)
            along = (ends[1] - ends[0]) / np.linalg.norm(ends[1] - ends[0])
            # Turned by one and a half deviations, to the left and to the right in turns.
            off = (-1) ** k * 1.5 / np.sqrt(2) * np.array([-along[1], along[0]])
            lines.append(LineSegment(axis, ends + np.array([off, -off]), std_px=1.0))
    pose = estimate_pose(panel.outlines, panel.camera, lines=lines, correlation=correlation)
    assert pose.notes == ()
    first, last = panel.outlines[0].corners_px, panel.outlines[-1].corners_px
    lines.append(LineSegment("vertical", np.array([first[0], last[2]])))
    pose = estimate_pose(panel.outlines, panel.camera, lines=lines, correlation=correlation)
    assert any("1 of 13 lines" in note for note in pose.notes)
    assert panel.error_deg(pose) < 1.0


def test_what_is_known_of_the_focal_length_stays_known(view, grid):
    focal = 500.0
    true = Camera.from_matrix([[focal, 0, 319.5], [0, focal, 239.5], [0, 0, 1]], 640, 480)
    panel = view(grid(3, 5), (25, -20, 5), camera=true).noisy(1, 0.3)
    told = true.with_focal(520.0, 0.02)
    stds, focals = [], []
    for correlation in (0.0, 0.5, 1.0):
        pose = estimate_pose(panel.outlines, told, correlation=correlation)
        stds.append(pose.focal_std)
        focals.append(pose.camera.focal_px)
    # The outlines tell less and less, what was known before as much as ever.
    assert stds == sorted(stds)
    assert stds[-1] <= 0.02 * (1 + 1e-6)
    assert abs(focals[-1] - 520) < abs(focals[0] - 520)
    vague = estimate_pose(panel.outlines, true.with_focal(520.0, 0.3), correlation=1.0)
    assert vague.focal_std > 0.02


# --- what it is for


def test_deviations_hold_where_all_outlines_err_alike(view, grid):
    """Half of the variance is one error of all corners of a kind: too large, drawn inwards."""
    plain, alike = [], []
    own = np.sqrt(0.5) * 0.5
    for seed in range(60):
        rng = np.random.default_rng(seed)
        panel = view(grid(3, 5), rng.uniform(-30, 30, 3))
        shared = rng.normal(0, own, (4, 2))
        corners = [o.corners_px + shared + rng.normal(0, own, (4, 2)) for o in panel.outlines]
        outlines = [
            replace(o, corners_px=seen, std_px=0.5)
            for o, seen in zip(panel.outlines, corners, strict=True)
        ]
        for covered, correlation in ((plain, 0.0), (alike, 0.5)):
            pose = estimate_pose(outlines, panel.camera, aligned=False, correlation=correlation)
            w = rotation_log(pose.rotation.T @ panel.rotation)
            covered.append(w @ np.linalg.solve(pose.covariance, w) < CHI2_95)
    assert np.mean(alike) > 0.9
    assert np.mean(plain) < 0.7


@pytest.mark.parametrize("wrong", [-0.01, 1.01, float("nan"), float("inf")])
def test_out_of_range(view, grid, wrong):
    panel = view(grid(2, 3), (20, -15, 5))
    for outlines in (panel.outlines, []):
        with pytest.raises(InputError, match="correlation"):
            estimate_pose(outlines, panel.camera, correlation=wrong)
