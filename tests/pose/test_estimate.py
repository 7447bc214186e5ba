from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fronto import Camera, LineSegment, estimate_pose
from fronto.pose.rotation import angle_between, rotation_log
from fronto.synth import LayoutButton, car_layout, hall_layout, observe, sample_scene

fixed = settings(derandomize=True, deadline=None)
exact = settings(derandomize=True, deadline=None, max_examples=40)
tilts = st.floats(-35, 35)
#: 95 % point of χ² with three degrees of freedom.
CHI2_95 = 7.815


def layout_of(grid, name):
    rows = {"hall of 2": (1, 2), "hall of 3": (1, 3), "car": (3, 5)}
    if name in rows:
        return grid(*rows[name])
    quads = grid(2, 3)
    return quads[:3] + tuple(replace(b, shape="ellipse") for b in quads[3:])


def degrees_between(first, second):
    return np.degrees(angle_between(first.rotation, second.rotation))


# --- exact outlines


@pytest.mark.parametrize("name", ["hall of 2", "hall of 3", "car", "mixed"])
@pytest.mark.parametrize("square", [False, True])
def test_exact_outlines_give_the_exact_rotation(view, grid, name, square):
    @exact
    @given(tilts, tilts, tilts, st.floats(220, 420), st.floats(160, 320))
    def run(tx, ty, tz, px, py):
        # The tilt prior pulls by about the variance times the tilt: nothing at 0.001 px.
        panel = view(layout_of(grid, name), (tx, ty, tz), at_px=(px, py), std_px=1e-3)
        pose = estimate_pose(panel.outlines, panel.camera, square=square, tolerance=0)
        assert panel.error_deg(pose) < 1e-3
        assert pose.status == "ok"
        assert pose.solver == "refine"
        assert pose.residual_px.max() < 1e-4
        assert pose.weight.min() == 1.0
        assert pose.cos_norm == pytest.approx(0.0, abs=1e-4)
        assert pose.camera is panel.camera
        assert pose.focal_std == 0.0
        np.testing.assert_allclose(pose.angles_deg, [tx, ty, tz], atol=2e-3)
        np.testing.assert_allclose(pose.normal, panel.rotation[2], atol=2e-5)
        half = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * 0.015
        places = np.array([[b.x, b.y] for b in panel.buttons])[:, None] + half
        expected = (places + panel.translation[:2]) / panel.translation[2]
        np.testing.assert_allclose(pose.plane_corners, expected, atol=1e-4)

    run()


@pytest.mark.parametrize("aligned", [True, False])
def test_staggered_panels_need_no_alignment(view, grid, aligned):
    shifts = np.random.default_rng(3).uniform(-0.02, 0.02, (8, 2))
    buttons = [
        replace(b, x=1.6 * b.x + dx, y=1.6 * b.y + dy)
        for b, (dx, dy) in zip(grid(2, 4), shifts, strict=True)
    ]
    panel = view(buttons, (20, -15, 5), std_px=0.01)
    assert panel.error_deg(estimate_pose(panel.outlines, panel.camera, aligned=aligned)) < 0.3


def test_distorted_photos(view, grid):
    panel = view(grid(3, 5), (20, -25, 8), at_px=(430, 170), std_px=0.01)
    camera = Camera.from_matrix(panel.camera.matrix, 640, 480, [-0.15, 0.03, 0.001, -0.001])
    bent = [replace(o, corners_px=camera.distort_points(o.corners_px)) for o in panel.outlines]
    assert panel.error_deg(estimate_pose(bent, camera)) < 0.01
    assert panel.error_deg(estimate_pose(bent, panel.camera)) > 0.5


# --- what must not matter


@pytest.mark.parametrize(("columns", "rows"), [(3, 5), (1, 3)])
@pytest.mark.parametrize("seed", range(4))
class TestInvariance:
    def pose_and_view(self, view, grid, columns, rows, seed):
        rng = np.random.default_rng(seed)
        at = rng.uniform([250, 180], [390, 300])
        panel = view(grid(columns, rows), rng.uniform(-30, 30, 3), at_px=at).noisy(seed, 0.3)
        return estimate_pose(panel.outlines, panel.camera, square=True), panel

    def test_order_of_the_outlines(self, view, grid, columns, rows, seed):
        pose, panel = self.pose_and_view(view, grid, columns, rows, seed)
        order = np.random.default_rng(seed).permutation(len(panel.outlines))
        shuffled = [panel.outlines[k] for k in order]
        other = estimate_pose(shuffled, panel.camera, square=True)
        assert degrees_between(pose, other) < 1e-6
        assert other.status == pose.status
        np.testing.assert_allclose(other.plane_corners, pose.plane_corners[order], atol=1e-9)
        np.testing.assert_allclose(other.residual_px, pose.residual_px[order], atol=1e-6)
        np.testing.assert_allclose(other.weight, pose.weight[order], atol=1e-6)

    def test_size_of_the_photo(self, view, grid, columns, rows, seed):
        pose, panel = self.pose_and_view(view, grid, columns, rows, seed)
        camera = Camera.from_matrix(np.diag([2.5, 2.5, 1]) @ panel.camera.matrix, 1600, 1200)
        scaled = [
            replace(o, corners_px=2.5 * o.corners_px, std_px=2.5 * o.std_px) for o in panel.outlines
        ]
        other = estimate_pose(scaled, camera, square=True)
        assert degrees_between(pose, other) < 1e-6
        np.testing.assert_allclose(other.covariance, pose.covariance, rtol=1e-6)
        np.testing.assert_allclose(other.residual_px, 2.5 * pose.residual_px, rtol=1e-5)
        assert other.sigma_px == pytest.approx(2.5 * pose.sigma_px)

    def test_roll_of_the_camera(self, view, grid, columns, rows, seed):
        pose, panel = self.pose_and_view(view, grid, columns, rows, seed)
        c, s = np.cos(0.4), np.sin(0.4)
        turn = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
        middle = panel.camera.matrix[:2, 2]
        rolled = [
            replace(o, corners_px=(o.corners_px - middle) @ turn[:2, :2].T + middle)
            for o in panel.outlines
        ]
        other = estimate_pose(rolled, panel.camera, square=True)
        # Other starts, and each stops when a step gains less than 1e-4 of χ².
        assert np.degrees(angle_between(pose.rotation, other.rotation @ turn)) < 0.02


# --- what does not fit


@pytest.mark.parametrize("seed", range(8))
def test_one_misshapen_button_is_set_aside(view, grid, seed):
    rng = np.random.default_rng(seed)
    panel = view(grid(3, 5), rng.uniform(-30, 30, 3)).noisy(seed, 0.3)
    wrong = int(rng.integers(15))
    outlines = list(panel.outlines)
    corners = np.array(outlines[wrong].corners_px)
    corners[int(rng.integers(4))] += rng.choice([-6, 6], 2)
    outlines[wrong] = replace(outlines[wrong], corners_px=corners)
    pose = estimate_pose(outlines, panel.camera)
    assert pose.weight[wrong] < 0.1
    assert np.delete(pose.weight, wrong).min() > 0.5
    assert pose.residual_px.argmax() == wrong
    assert pose.status == "ok"
    assert panel.error_deg(pose) < 2.0
    clean = estimate_pose(outlines[:wrong] + outlines[wrong + 1 :], panel.camera)
    assert degrees_between(pose, clean) < 0.5


@pytest.mark.parametrize("seed", range(4))
def test_one_button_off_its_row_does_not_bend_the_pose(view, grid, seed):
    # Its shape is right and still counts; its row and column let it go.
    panel = view(grid(3, 5), (20, -15, 8)).noisy(seed, 0.3)
    outlines = list(panel.outlines)
    outlines[7] = replace(outlines[7], corners_px=np.add(outlines[7].corners_px, [5, -4]))
    pose = estimate_pose(outlines, panel.camera)
    assert degrees_between(pose, estimate_pose(panel.outlines, panel.camera)) < 0.5
    moved = pose.plane_corners[7].mean(axis=0) - pose.plane_corners[[6, 8]].mean(axis=(0, 1))
    assert np.linalg.norm(moved) > 0.01


@pytest.mark.parametrize("seed", range(8))
def test_wide_buttons_beside_square_ones(view, grid, seed):
    wide = (LayoutButton(-0.04, 0.11, 0.06, 0.03), LayoutButton(0.04, 0.11, 0.06, 0.03))
    angles = np.random.default_rng(seed).uniform(-30, 30, 3)
    panel = view((*grid(2, 3), *wide), angles).noisy(seed, 0.3)
    pose = estimate_pose(panel.outlines, panel.camera)
    assert panel.error_deg(pose) < 4.0
    assert panel.error_deg(pose) < 3.5 * max(pose.std_deg)
    assert pose.weight.min() > 0.5
    sides = np.diff(pose.plane_corners[:, [0, 1, 2]], axis=1)
    width, height = sides[:, 0, 0], sides[:, 1, 1]
    np.testing.assert_allclose(width[6:] / width[0], 2.0, rtol=0.06)
    np.testing.assert_allclose(height[6:] / height[0], 1.0, rtol=0.06)
    np.testing.assert_allclose(width[:6] / height[:6], 1.0, rtol=0.08)


def test_stated_deviations_that_are_too_small_are_raised(view, grid):
    panel = view(grid(3, 5), (20, -15, 8)).noisy(3, 1.0)
    proud = [replace(o, std_px=0.1) for o in panel.outlines]
    pose = estimate_pose(proud, panel.camera)
    assert 0.5 < pose.sigma_px < 1.6
    honest = estimate_pose(panel.outlines, panel.camera)
    np.testing.assert_allclose(pose.std_deg, honest.std_deg, rtol=0.5)


# --- lines


def lines_of(panel, seed, ends):
    rng = np.random.default_rng(seed)
    return [
        LineSegment(axis, panel.project(points) + rng.normal(0, 0.5, (2, 2)), std_px=0.5)
        for axis, points in ends
    ]


FRAME = (
    ("horizontal", [[-0.25, -0.2], [0.25, -0.2]]),
    ("horizontal", [[-0.25, 0.2], [0.25, 0.2]]),
    ("vertical", [[-0.25, -0.2], [-0.25, 0.2]]),
    ("vertical", [[0.25, -0.2], [0.25, 0.2]]),
)


@pytest.mark.parametrize("seed", range(6))
def test_lines_sharpen_a_single_button(view, grid, seed):
    angles = np.random.default_rng(seed).uniform(-30, 30, 3)
    panel = view(grid(1, 1, width_m=0.12), angles).noisy(seed, 0.5)
    lines = lines_of(panel, seed, FRAME)
    alone = estimate_pose(panel.outlines, panel.camera, square=True)
    helped = estimate_pose(panel.outlines, panel.camera, square=True, lines=lines)
    assert max(helped.std_deg) < 0.6 * max(alone.std_deg)
    assert panel.error_deg(helped) < 1.5

    # Half way between both axes: no axis' line at all.
    slanted = lines_of(panel, seed, [("horizontal", [[-0.15, -0.15], [0.15, 0.15]])])
    misled = estimate_pose(panel.outlines, panel.camera, square=True, lines=lines + slanted)
    assert degrees_between(helped, misled) < 0.1
    swapped = lines_of(panel, seed, [("vertical", FRAME[0][1])])
    misled = estimate_pose(panel.outlines, panel.camera, square=True, lines=lines + swapped)
    assert degrees_between(helped, misled) < 0.1


def test_lines_in_another_plane_count_as_well(view, grid):
    # A handrail 20 cm in front of the wall shares the vanishing point of the rows.
    def slope_deg(pose, ends):
        rays = np.column_stack([ends, [1, 1]]) @ np.linalg.inv(pose.camera.matrix).T
        plane = rays @ pose.rotation.T
        (dx, dy) = np.diff(plane[:, :2] / plane[:, 2:], axis=0)[0]
        return abs(np.degrees(np.arctan2(dy, dx)))

    alone, helped = [], []
    for seed in range(12):
        panel = view(grid(1, 3), (15, 20, 5)).noisy(seed, 0.3)
        rail = np.array([[-0.2, -0.1, -0.2], [0.15, -0.1, -0.2]]) + panel.translation
        ends = rail @ panel.rotation @ panel.camera.matrix.T
        ends = ends[:, :2] / ends[:, 2:]
        before = estimate_pose(panel.outlines, panel.camera)
        lines = [LineSegment("horizontal", ends, std_px=0.3)]
        after = estimate_pose(panel.outlines, panel.camera, lines=lines)
        assert np.trace(after.covariance) < np.trace(before.covariance)
        alone.append(slope_deg(before, ends))
        helped.append(slope_deg(after, ends))
    assert max(helped) < 0.1
    assert np.mean(helped) < 0.3 * np.mean(alone)


@pytest.mark.parametrize("seed", range(6))
def test_lines_that_were_only_found_leave_ok_poses_alone(view, grid, seed):
    panel = view(grid(3, 4), (20, -15, 4)).noisy(seed, 0.5)
    alone = estimate_pose(panel.outlines, panel.camera)
    assert alone.status == "ok"
    # Off by four degrees, all alike: a door that stands ajar.
    door = [
        replace(
            line, ends_px=np.add(line.ends_px, [[0, 0], [0, 0.07 * np.ptp(line.ends_px[:, 0])]])
        )
        for line in lines_of(panel, seed, FRAME)
        if line.axis == "horizontal"
    ]
    found = [replace(line, found=True) for line in door]
    kept = estimate_pose(panel.outlines, panel.camera, lines=found)
    assert degrees_between(kept, alone) == 0
    np.testing.assert_array_equal(kept.covariance, alone.covariance)

    known = lines_of(panel, seed, FRAME)
    both = estimate_pose(panel.outlines, panel.camera, lines=known + found)
    only = estimate_pose(panel.outlines, panel.camera, lines=known)
    assert degrees_between(only, alone) > 0
    assert degrees_between(both, only) == 0


def test_lines_that_were_only_found_count_where_buttons_make_no_ok_pose(view, grid):
    panel = view(grid(1, 1, width_m=0.12), (20, 10, 5)).noisy(1, 0.5)
    alone = estimate_pose(panel.outlines, panel.camera)
    assert alone.status != "ok"
    known = lines_of(panel, 1, FRAME)
    found = [replace(line, found=True) for line in known]
    helped = estimate_pose(panel.outlines, panel.camera, lines=found)
    assert helped.status == "ok"
    given = estimate_pose(panel.outlines, panel.camera, lines=known)
    np.testing.assert_array_equal(helped.rotation, given.rotation)


# --- focal length


@pytest.mark.parametrize("focal", [450.0, 700.0, 1000.0])
@pytest.mark.parametrize("angles", [(30, 25, 5), (-28, 30, -8), (25, -33, 0)])
def test_focal_length_of_strongly_tilted_panels(view, grid, focal, angles):
    true = Camera.from_matrix([[focal, 0, 319.5], [0, focal, 239.5], [0, 0, 1]], 640, 480)
    panel = view(grid(3, 5), angles, camera=true, distance_m=focal / 1000).noisy(2, 0.3)
    guess = Camera.default(640, 480)
    pose = estimate_pose(panel.outlines, guess)
    assert pose.camera.source == "estimated"
    assert pose.focal_std < 0.06
    assert abs(np.log(pose.camera.focal_px / focal)) < 3 * pose.focal_std
    assert pose.camera.focal_std == pose.focal_std
    assert panel.error_deg(pose) < 1.5
    assert pose.notes == ()
    # The camera's name for "known" is a deviation of zero.
    assert estimate_pose(panel.outlines, true).camera.focal_px == pytest.approx(focal)


@pytest.mark.parametrize("focal", [500.0, 700.0, 900.0])
def test_focal_length_of_frontal_panels_is_not_observable(view, grid, focal):
    true = Camera.from_matrix([[focal, 0, 319.5], [0, focal, 239.5], [0, 0, 1]], 640, 480)
    panel = view(grid(3, 5), (1, -1, 0), camera=true, distance_m=focal / 1000).noisy(2, 0.3)
    pose = estimate_pose(panel.outlines, Camera.default(640, 480))
    assert pose.focal_std > 0.15
    assert any("focal length not observable" in note for note in pose.notes)
    assert pose.aspect_std is not None


def test_focal_deviations_are_honest(view, grid):
    pulls = []
    for seed in range(60):
        rng = np.random.default_rng(seed)
        focal = 704.0 * np.exp(rng.normal(0, 0.2))
        true = Camera.from_matrix([[focal, 0, 319.5], [0, focal, 239.5], [0, 0, 1]], 640, 480)
        panel = view(
            grid(3, 5), rng.uniform(-35, 35, 3), camera=true, distance_m=focal / 1000
        ).noisy(seed, 0.3)
        pose = estimate_pose(panel.outlines, Camera.default(640, 480))
        pulls.append(np.log(pose.camera.focal_px / focal) / pose.focal_std)
    assert np.mean(np.abs(pulls) < 2) > 0.85
    assert np.abs(pulls).max() < 4.5


@pytest.mark.parametrize("seed", [219, 235, *range(20)])
def test_poses_of_unknown_focal_length_are_not_trusted_blindly(seed):
    # Tilted about one axis only, focal length and tilt trade off along a curve that a
    # covariance does not follow: seed 235 is 27° off with an aspect of 0.59 and a stated
    # deviation of 5°; its focal_std of 0.2 and aspect_std of 0.16 say that it is not known.
    rng = np.random.default_rng([99, seed])
    scene = observe(rng, sample_scene(rng, car_layout), 0.3)
    pose = estimate_pose(scene.outlines, scene.camera.with_focal(400.0, 0.3))
    if pose.status == "ok":
        assert np.degrees(angle_between(pose.rotation, scene.rotation)) < 10.0


# --- statistics: the scenes that the accuracy targets are stated for


def errors_of(layout, count, square):
    """Errors (deg), which are called ok, and which lie in the 95 % region of those that say."""
    errors, ok, inside = [], [], []
    for seed in range(count):
        rng = np.random.default_rng([11, seed])
        scene = observe(rng, sample_scene(rng, layout), 0.3)
        pose = estimate_pose(scene.outlines, scene.camera, square=square)
        errors.append(np.degrees(angle_between(pose.rotation, scene.rotation)))
        ok.append(pose.status == "ok")
        if np.isfinite(pose.covariance).all():
            turn = rotation_log(pose.rotation.T @ scene.rotation)
            inside.append(turn @ np.linalg.solve(pose.covariance, turn) < CHI2_95)
    return np.array(errors), np.array(ok), np.array(inside)


def test_hall_panels():
    errors, ok, inside = errors_of(lambda rng: hall_layout(rng, 3), 300, square=True)
    assert np.median(errors) <= 1.8
    assert errors[ok].max() < 10.0
    assert ok.mean() > 0.5
    assert 0.85 <= inside.mean() <= 1.0


def test_hall_panels_that_are_not_known_to_be_square():
    errors, ok, inside = errors_of(hall_layout, 300, square=False)
    assert np.median(errors) <= 5.0
    assert errors[ok].max() < 10.0
    assert 0.8 <= inside.mean() <= 1.0


@pytest.mark.parametrize("square", [False, True])
def test_car_panels(square):
    errors, ok, inside = errors_of(car_layout, 100, square)
    assert np.median(errors) <= 0.6
    assert np.quantile(errors, 0.95) <= 2.5
    assert errors[ok].max() < 10.0
    assert ok.mean() > 0.9
    assert 0.85 <= inside.mean() <= 1.0


def test_two_columns_of_which_one_is_a_little_higher_have_no_rows(view):
    # By a quarter of a button: as rows they would be bent ones, seen from another side.
    def panel_of(step, seed):
        buttons = [
            LayoutButton(x, k * 0.045 - 0.09 + offset, 0.03, 0.03, text=f"{x}{k}")
            for x, offset in ((-0.025, 0.0), (0.025, step))
            for k in range(5)
        ]
        return view(buttons, (8, -15, 3)).noisy(seed, 0.2)

    for step in (0.004, 0.0075, 0.009):
        errors = []
        for seed in range(6):
            panel = panel_of(step, seed)
            pose = estimate_pose(panel.outlines, panel.camera)
            assert pose.status == "ok"
            errors.append(panel.error_deg(pose))
        assert max(errors) < 2.5


def test_lines_of_both_axes_hold_the_rotation_whatever_two_outlines_say(view, grid):
    panel = view(grid(1, 2, width_m=0.04, pitch_m=0.08), (6, -20, 3)).noisy(1, 0.3)
    good, other = panel.outlines
    off = np.array([[3.0, 0], [-3, 2], [4, -3], [0, 3]])
    outlines = [good, replace(other, corners_px=other.corners_px + off)]
    level = [[[-0.16, y], [0.16, y]] for y in (-0.15, 0.15)]
    upright = [[[x, -0.15], [x, 0.15]] for x in (-0.16, 0.16)]
    lines = [
        LineSegment(axis, panel.project(ends), std_px=0.4)
        for axis, both in (("horizontal", level), ("vertical", upright))
        for ends in both
    ]

    pose = estimate_pose(outlines, panel.camera, lines=lines)
    assert pose.status == "ok"
    assert panel.error_deg(pose) < 0.5
    # Not by one direction, nor with another camera than the one that is known.
    assert estimate_pose(outlines, panel.camera, lines=lines[:2]).status != "ok"
    guessed = replace(panel.camera, focal_std=0.2)
    assert estimate_pose(outlines, guessed, lines=lines).status == "uncertain"
