"""The rotation that straight segments tell by themselves, and what the buttons make of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fronto import Camera, Ellipse, Outline, estimate_pose, rectify_outlines
from fronto.pose.guided import with_frame, with_lines
from fronto.pose.vanishing import misses, rotation_of_lines

exact = settings(derandomize=True, deadline=None, max_examples=40)
tilts = st.floats(-28, 28)
STD_PX = 0.4


def frame_of(panel, noise_px=0.0, seed=0):
    """Shape (8, 2, 2): edges of a door and a plate around the panel, in the photo."""
    ends = [
        *([[-0.16, y], [0.16, y]] for y in (-0.17, -0.14, 0.13, 0.17)),
        *([[x, -0.17], [x, 0.17]] for x in (-0.16, -0.1, 0.11, 0.16)),
    ]
    seen = panel.project(ends)
    return seen + np.random.default_rng(seed).normal(0, noise_px, seen.shape)


def clutter(seed, count):
    rng = np.random.default_rng([11, seed])
    middle, angle = rng.uniform([20, 20], [620, 460], (count, 2)), rng.uniform(0, np.pi, count)
    across = np.column_stack([np.cos(angle), np.sin(angle)]) * rng.uniform(20, 60, (count, 1))
    return np.stack([middle - across, middle + across], axis=1)


def drawn_out(outlines, factor):
    """The same circles, each as a blur to one side draws it out."""
    longer = []
    for outline in outlines:
        e = outline.ellipse_px
        stretched = np.diag([1.0, factor]) @ e.shape_matrix @ np.diag([1.0, factor])
        seen = Ellipse.from_shape_matrix(e.center, stretched)
        longer.append(replace(outline, ellipse_px=seen, std_px=0.8, form_std_px=0.5))
    return longer


def solver(outlines, camera, calls=None):
    def solve(lines):
        if calls is not None:
            calls.append(len(lines))
        return estimate_pose(outlines, camera, lines=lines, correlation=0.1)

    return solve


def framed(outlines, camera, ends):
    """The pose before, and with the rotation of the segments."""
    solve = solver(outlines, camera)
    before = with_lines(solve([]), outlines, ends, STD_PX, solve)
    return before, with_frame(before, outlines, ends, STD_PX, solve)


def test_lines_make_the_rotation(view, grid):
    @exact
    @given(tilts, tilts, st.floats(-12, 12), st.integers(0, 100))
    def run(tx, ty, tz, seed):
        panel = view(grid(2, 2), (tx, ty, tz))
        ends = frame_of(panel)[np.random.default_rng(seed).permutation(8)]
        ends[::2] = ends[::2, ::-1]  # a segment has no direction
        found = rotation_of_lines(ends, panel.camera)
        assert panel.error_deg(found) < 1e-5
        assert np.linalg.det(found) == pytest.approx(1)

    run()


def test_noisy_lines_make_it_about(view, grid):
    errors = []
    for seed in range(20):
        angles = np.random.default_rng(seed).uniform([-25, -25, -10], [25, 25, 10])
        panel = view(grid(2, 2), angles)
        ends = frame_of(panel, STD_PX, seed)
        errors.append(panel.error_deg(rotation_of_lines(ends, panel.camera)))
    assert np.median(errors) < 1.5
    assert max(errors) < 4.0


def test_lines_of_one_direction_make_none(view, grid):
    panel = view(grid(2, 2), (10, 20, 5))
    ends = frame_of(panel)
    for few in (ends[:4], ends[4:], ends[:1], np.zeros((0, 2, 2))):
        assert rotation_of_lines(few, panel.camera) is None
    # The same edge twice has no vanishing point either.
    assert rotation_of_lines(ends[[0, 0, 4, 4]], panel.camera) is None


def test_nobody_looks_along_a_wall_or_lies_on_the_floor(view, grid):
    for angles in ((0, 75, 0), (0, 0, 60)):
        panel = view(grid(2, 2), angles)
        found = rotation_of_lines(frame_of(panel), panel.camera)
        assert found is None or panel.error_deg(found) > 10


def test_misses_by_hand():
    camera = Camera.from_matrix(np.array([[300.0, 0, 320], [0, 300, 240], [0, 0, 1]]), 640, 480)
    upright, level = [[100, 100], [100, 200]], [[100, 100], [200, 100]]
    slanted = [[100, 100], [200, 110]]
    missed = misses(np.eye(3)[None], np.array([upright, level, slanted], float), camera)
    assert missed.shape == (1, 2, 3)
    off = np.arctan(0.1)
    np.testing.assert_allclose(missed[0, 0], [np.pi / 2, 0, off], atol=1e-12)
    np.testing.assert_allclose(missed[0, 1], [0, np.pi / 2, np.pi / 2 - off], atol=1e-12)


def test_circles_that_are_drawn_out_alike_are_seen_through(view, grid):
    for tilt in (18.0, -25.0):
        panel = view(grid(2, 4, width_m=0.02, shape="ellipse"), (5, tilt, 0))
        outlines = drawn_out(panel.outlines, 1.12)
        solve = solver(outlines, panel.camera)
        alone = solve([])
        after = with_frame(alone, outlines, frame_of(panel, 0.2), STD_PX, solve)
        assert panel.error_deg(alone) > 4
        assert after.status == "ok"
        assert panel.error_deg(after) < 1


@pytest.mark.parametrize(("cost", "believed"), [(1e4, True), (0.0, False)])
def test_a_sure_pose_far_off_yields_where_it_costs_more(view, grid, cost, believed):
    panel = view(grid(2, 4), (5, 20, 0)).noisy(2, 0.3)
    wrong = view(grid(2, 4), (5, -20, 0)).rotation
    solve = solver(panel.outlines, panel.camera)
    pose = replace(solve([]), rotation=wrong, cost=cost)
    assert pose.status == "ok"
    after = with_frame(pose, panel.outlines, frame_of(panel, 0.2), STD_PX, solve)
    assert (after is not pose) is believed
    assert (panel.error_deg(after) < 1) is believed


def test_one_button_and_a_frame(view, grid):
    for angles in ((3, 10, 2), (-20, 15, -8), (0, -30, 4)):
        panel = view(grid(1, 1, shape="ellipse"), angles).noisy(2, 0.3)
        alone = estimate_pose(panel.outlines, panel.camera)
        assert alone.status != "ok"
        _, after = framed(panel.outlines, panel.camera, frame_of(panel, 0.2))
        assert after.status == "ok"
        assert panel.error_deg(after) < 1


def test_a_sure_pose_stays_without_solving_again(view, grid):
    panel = view(grid(3, 4), (12, -18, 4)).noisy(3, 0.2)
    ends, calls = frame_of(panel, 0.2), []
    solve = solver(panel.outlines, panel.camera, calls)
    pose = with_lines(solve([]), panel.outlines, ends, STD_PX, solve)
    assert pose.status == "ok"
    calls.clear()
    assert with_frame(pose, panel.outlines, ends, STD_PX, solve) is pose
    assert calls == []


@pytest.mark.parametrize("shape", ["quad", "ellipse"])
def test_the_frame_of_another_wall_changes_nothing(view, grid, shape):
    # The door stands at 40° to the panel.
    panel = view(grid(3, 4, shape=shape), (0, -15, 0)).noisy(4, 0.2)
    door = view(grid(1, 1), (0, 25, 0))
    before, after = framed(panel.outlines, panel.camera, frame_of(door))
    assert before.status == "ok"
    assert after is before


def test_too_few_lines_or_none_change_nothing(view, grid):
    panel = view(grid(1, 1, shape="ellipse"), (0, 20, 0)).noisy(5, 0.3)
    for ends in (np.zeros((0, 2, 2)), frame_of(panel)[[0, 1, 4]], clutter(1, 40)):
        before, after = framed(panel.outlines, panel.camera, ends)
        assert after is before


def test_not_with_an_unknown_focal_length(view, grid):
    panel = view(grid(1, 1, shape="ellipse"), (0, 20, 0)).noisy(6, 0.3)
    camera = replace(panel.camera, focal_std=0.2)
    before, after = framed(panel.outlines, camera, frame_of(panel))
    assert after is before


def test_it_is_part_of_rectifying(view, grid):
    import cv2

    panel = view(grid(2, 4, width_m=0.02, shape="ellipse"), (5, -20, 0))
    photo = np.full((480, 640, 3), 220, np.uint8)
    corners = panel.project([[-0.16, -0.17], [0.16, -0.17], [0.16, 0.17], [-0.16, 0.17]])
    cv2.fillPoly(photo, [np.round(corners * 16).astype(int)], (150, 150, 150), cv2.LINE_AA, 4)
    inner = panel.project([[-0.1, -0.13], [0.1, -0.13], [0.1, 0.13], [-0.1, 0.13]])
    cv2.fillPoly(photo, [np.round(inner * 16).astype(int)], (90, 90, 90), cv2.LINE_AA, 4)
    button = [drawn_out(panel.outlines, 1.12)[3]]
    result = rectify_outlines(photo, button, panel.camera, find_lines=True)
    assert result.status == "ok"
    assert panel.error_deg(result.pose) < 1.5
    blank = np.full((480, 640, 3), 220, np.uint8)
    assert rectify_outlines(blank, button, panel.camera, find_lines=True).status != "ok"


def test_without_outlines_there_is_no_panel_to_speak_of():
    camera = Camera.from_fov(90, 640, 480)
    ends = np.array([[[10, 10], [600, 12]], [[10, 400], [600, 402]], [[50, 10], [50, 400]]], float)
    none: list[Outline] = []
    pose = estimate_pose(none, camera)
    assert with_frame(pose, none, ends, STD_PX, solver(none, camera)) is pose
