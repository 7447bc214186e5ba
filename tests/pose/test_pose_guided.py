"""Lines of the photo that agree with a pose: which are chosen, and what they bring."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fronto import Camera, LineSegment, Outline, PanelPose, estimate_pose, rectify_outlines
from fronto.pose.guided import agreeing_lines, with_lines
from fronto.shapes import FloatArray

exact = settings(derandomize=True, deadline=None, max_examples=40)
tilts = st.floats(-30, 30)
STD_PX = 0.4
#: Edges of a plate around the buttons, metres on the panel.
PLATE = (
    ("horizontal", [[-0.11, -0.13], [0.11, -0.13]]),
    ("horizontal", [[-0.11, 0.13], [0.11, 0.13]]),
    ("vertical", [[-0.11, -0.13], [-0.11, 0.13]]),
    ("vertical", [[0.11, -0.13], [0.11, 0.13]]),
)
AXES = [axis for axis, _ in PLATE]


def plate_of(panel, noise_px=0.0, seed=0):
    """Shape (4, 2, 2): the plate's edges in the photo."""
    ends = np.array([panel.project(points) for _, points in PLATE])
    return ends + np.random.default_rng(seed).normal(0, noise_px, ends.shape)


def clutter(seed, count, low_px=50, high_px=240):
    """Shape (count, 2, 2): segments anywhere, in any direction."""
    rng = np.random.default_rng([7, seed])
    middle = rng.uniform([20, 20], [620, 460], (count, 2))
    angle, half = rng.uniform(0, np.pi, count), rng.uniform(low_px, high_px, count) / 2
    across = np.column_stack([np.cos(angle), np.sin(angle)]) * half[:, None]
    return np.stack([middle - across, middle + across], axis=1)


def off_axes_deg(panel, ends):
    """Shape (2, n): angles between segments and the panel's x and y direction where they lie."""
    middle = ends.mean(axis=1)
    rays = np.column_stack([middle, np.ones(len(middle))])
    plane = rays @ np.linalg.inv(panel.camera.matrix).T @ panel.rotation.T
    here = plane[:, :2] / plane[:, 2:] * panel.translation[2] - panel.translation[:2]
    along = ends[:, 1] - ends[:, 0]
    angles = []
    for step in np.array([[1e-4, 0], [0, 1e-4]]):
        toward = panel.project(here + step) - middle
        cross = along[:, 0] * toward[:, 1] - along[:, 1] * toward[:, 0]
        angles.append(np.degrees(np.arctan2(np.abs(cross), np.abs((along * toward).sum(axis=1)))))
    return np.array(angles)


def in_any_order(lines):
    return sorted((line.axis, line.ends_px.tolist()) for line in lines)


def chosen(pose, outlines, ends, std_px=STD_PX):
    return agreeing_lines(pose, outlines, np.asarray(ends, dtype=float), std_px)


def turned(ends, degrees):
    """One segment (2, 2) about its middle."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    middle = np.mean(ends, axis=0)
    return (np.asarray(ends) - middle) @ np.array([[c, s], [-s, c]]) + middle


def unsure(pose: PanelPose, degrees: float) -> PanelPose:
    return replace(pose, covariance=np.radians(degrees) ** 2 * np.eye(3))


def rolled(pose: PanelPose, degrees: float) -> PanelPose:
    """A pose that reads the panel as turned in its plane."""
    c, s = np.cos(np.radians(degrees)), np.sin(np.radians(degrees))
    return replace(pose, rotation=np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ pose.rotation)


# --- which are chosen


def test_the_panels_own_lines_are_chosen_with_their_axes(view, grid):
    @exact
    @given(tilts, tilts, st.floats(-40, 40), st.floats(250, 390), st.integers(0, 1000))
    def run(tx, ty, tz, px, seed):
        panel = view(grid(2, 3), (tx, ty, tz), at_px=(px, 240))
        pose = estimate_pose(panel.outlines, panel.camera)
        own = plate_of(panel)
        other = clutter(seed, 30)
        other = other[(off_axes_deg(panel, other) > 3).all(axis=0)]
        order = np.random.default_rng(seed).permutation(4 + len(other))
        ends = np.concatenate([own, other])[order]
        # A segment has no direction.
        ends[::2] = ends[::2, ::-1]
        lines = chosen(pose, panel.outlines, ends)
        given_as = {
            tuple(np.sort(e, axis=0).ravel()): axis for e, axis in zip(own, AXES, strict=True)
        }
        got = {tuple(np.sort(line.ends_px, axis=0).ravel()): line.axis for line in lines}
        assert got == given_as
        # As they were given, to the last digit.
        assert {line.ends_px.tobytes() for line in lines} <= {e.tobytes() for e in ends}

    run()


def test_what_runs_along_the_axes_in_another_plane_counts(view, grid):
    # A handrail and a door frame 20 cm in front of the wall.
    panel = view(grid(2, 3), (15, 20, 5))
    pose = estimate_pose(panel.outlines, panel.camera)
    for axis, points in (
        ("horizontal", [[-0.2, 0.1, -0.2], [0.15, 0.1, -0.2]]),
        ("vertical", [[0.2, -0.1, -0.2], [0.2, 0.12, -0.2]]),
    ):
        ends = (np.array(points) + panel.translation) @ panel.rotation @ panel.camera.matrix.T
        (line,) = chosen(pose, panel.outlines, [ends[:, :2] / ends[:, 2:]])
        assert line.axis == axis
    # What runs into the wall shares no vanishing point with the panel.
    deep = np.array([[-0.2, 0.2, -0.2], [-0.2, 0.2, 0.0]]) + panel.translation
    deep = deep @ panel.rotation @ panel.camera.matrix.T
    assert chosen(pose, panel.outlines, [deep[:, :2] / deep[:, 2:]]) == []


@pytest.mark.parametrize("k", range(4))
def test_how_far_off_a_line_may_be_is_up_to_the_pose(view, grid, k):
    panel = view(grid(2, 3), (12, -20, 6))
    sure = unsure(estimate_pose(panel.outlines, panel.camera, tolerance=0), 0.01)
    line = plate_of(panel)[k]

    def taken(pose, degrees):
        lines = [chosen(pose, panel.outlines, [turned(line, s * degrees)]) for s in (-1, 1)]
        assert all(found[0].axis == AXES[k] for found in lines if found)
        return [len(found) for found in lines]

    assert taken(sure, 0.6) == [1, 1]
    assert taken(sure, 3.0) == [0, 0]
    assert taken(unsure(sure, 2.0), 3.0) == [1, 1]
    assert taken(unsure(sure, 2.0), 20.0) == [0, 0]
    # However little is known.
    assert taken(unsure(sure, 40.0), 6.0) == [1, 1]
    assert taken(unsure(sure, 40.0), 10.0) == [0, 0]


@pytest.mark.parametrize("tilt", [0, 35])
def test_the_deviation_of_the_turn_that_matters_counts(view, grid, tilt):
    # A horizontal line through the middle of the photo is turned by the camera's roll only,
    # however the panel is tilted.
    panel = view(grid(2, 3), (tilt, 0, 0), at_px=(320, 240))
    sure = estimate_pose(panel.outlines, panel.camera, tolerance=0)
    line = turned(panel.project([[-0.1, 0.0], [0.1, 0.0]]), 4.0)
    for axis, count in ((0, 0), (1, 0), (2, 1)):
        covariance = 1e-8 * np.eye(3)
        covariance[axis, axis] = np.radians(2.0) ** 2
        pose = replace(sure, covariance=covariance)
        assert len(chosen(pose, panel.outlines, [line])) == count


def test_segments_on_buttons_are_left_out(view, grid):
    panel = view(grid(2, 3, width_m=0.04, pitch_m=0.06), (10, 15, 3), distance_m=0.25)
    pose = estimate_pose(panel.outlines, panel.camera)
    sides = np.concatenate([[o.corners_px[[0, 1]], o.corners_px[[1, 2]]] for o in panel.outlines])
    assert (np.linalg.norm(sides[:, 1] - sides[:, 0], axis=1) > 40).all()
    assert chosen(pose, panel.outlines, sides) == []
    # Nor is a label's underline a line of the panel; what runs past buttons is.
    label = panel.project([[[-0.048, 0.005], [-0.012, 0.005]]])
    assert np.linalg.norm(label[0, 1] - label[0, 0]) > 40
    assert chosen(pose, panel.outlines, label) == []
    beside = panel.project([[[0.07, -0.02], [0.07, 0.02]]])
    assert len(chosen(pose, panel.outlines, beside)) == 1
    through = panel.project([[[-0.1, 0.0], [0.1, 0.0]]])
    assert len(chosen(pose, panel.outlines, through)) == 1


def test_short_segments_are_left_out(view, grid):
    panel = view(grid(2, 3), (10, 15, 3))
    pose = estimate_pose(panel.outlines, panel.camera)
    middle, along = plate_of(panel)[0].mean(axis=0), np.diff(plate_of(panel)[0], axis=0)[0]
    along /= np.linalg.norm(along)
    for length, count in ((30, 0), (60, 1)):
        ends = np.array([[middle - along * length / 2, middle + along * length / 2]])
        assert len(chosen(pose, panel.outlines, ends)) == count


def test_the_longest_come_first_and_not_too_many(view, grid):
    panel = view(grid(2, 3), (10, 15, 3))
    pose = estimate_pose(panel.outlines, panel.camera)
    rng = np.random.default_rng(0)
    x0, x1 = -0.11 - rng.uniform(0, 0.05, 90), 0.11 + rng.uniform(0, 0.05, 90)
    y = np.where(np.arange(90) % 2, 0.13, -0.2) + rng.uniform(0, 0.05, 90)
    ends = panel.project(np.stack([np.column_stack([x0, y]), np.column_stack([x1, y])], axis=1))
    lines = chosen(pose, panel.outlines, ends)
    lengths = [np.linalg.norm(line.ends_px[1] - line.ends_px[0]) for line in lines]
    every = np.sort(np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1))[::-1]
    assert 10 < len(lines) < 90
    np.testing.assert_allclose(lengths, every[: len(lines)])
    # A long line is no better known across than the panel is straight.
    stds = np.array([line.std_px for line in lines])
    assert (stds > STD_PX).all()
    assert (np.diff(stds) <= 0).all()
    loose = chosen(pose, panel.outlines, ends, 3 * STD_PX)
    assert all(a.std_px > b.std_px for a, b in zip(loose, lines, strict=True))


def test_nothing_to_choose_from(view, grid):
    panel = view(grid(2, 3), (10, 15, 3))
    pose = estimate_pose(panel.outlines, panel.camera)
    assert chosen(pose, panel.outlines, np.zeros((0, 2, 2))) == []
    assert chosen(pose, [], plate_of(panel)) == []


# --- through a lens with distortion


def bent_panel(view, grid, angles=(20, -25, 8)):
    """A panel, its outlines and its plate's edges as a wide lens bends them, and the camera."""
    panel = view(grid(2, 3), angles, at_px=(450, 150), distance_m=0.4)
    camera = Camera.from_matrix(panel.camera.matrix, 640, 480, [-0.2, 0.04, 0.001, -0.001])
    outlines = [replace(o, corners_px=camera.distort_points(o.corners_px)) for o in panel.outlines]
    ends = camera.distort_points(plate_of(panel).reshape(-1, 2)).reshape(-1, 2, 2)
    return panel, camera, outlines, ends


def test_lines_through_a_lens(view, grid):
    panel, camera, outlines, ends = bent_panel(view, grid)
    pose = estimate_pose(outlines, camera)
    lines = chosen(pose, outlines, ends)
    # In the photo's pixels as they are.
    assert in_any_order(lines) == sorted(zip(AXES, ends.tolist(), strict=True))
    # To whom the lens is not told they seem to run elsewhere.
    blind = replace(pose, camera=panel.camera)
    assert len(chosen(blind, outlines, ends)) < 4


def test_lines_outside_the_lens_model_are_left_out(view, grid):
    panel = view(grid(2, 3), (0, 0, 0), at_px=(320, 240), distance_m=0.6)
    # Its model reaches to about 1.05 times the focal length from the middle.
    camera = Camera.from_matrix(panel.camera.matrix, 640, 480, [-0.3, 0, 0, 0])
    outlines = [replace(o, corners_px=camera.distort_points(o.corners_px)) for o in panel.outlines]
    pose = estimate_pose(outlines, camera)
    outside = np.array([[[5.0, 5.0], [300.0, 5.0]], [[5.0, 5.0], [5.0, 200.0]]])
    assert not np.isfinite(camera.undistort_points(outside.reshape(-1, 2))).all()
    inside = camera.distort_points(panel.project([[-0.1, 0.12], [0.1, 0.12]]))[None]
    lines = chosen(pose, outlines, np.concatenate([outside, inside]))
    assert [line.ends_px.tolist() for line in lines] == inside.tolist()
    assert chosen(pose, outlines, outside) == []
    # Nor do they count as segments that run anyhow.
    edges = camera.distort_points(plate_of(panel).reshape(-1, 2)).reshape(-1, 2, 2)
    solved = replace(pose)
    ends = np.concatenate([edges, *[outside] * 10])
    assert with_lines(pose, outlines, ends, STD_PX, lambda lines: solved) is solved
    assert with_lines(pose, outlines, outside, STD_PX, lambda lines: solved) is pose


# --- what they bring


class Solver:
    """Solves with lines, and counts how often it is asked."""

    def __init__(self, outlines: list[Outline], camera: Camera, **options: object) -> None:
        self.outlines, self.camera, self.options = outlines, camera, options
        self.calls = 0

    def __call__(self, lines: list[LineSegment]) -> PanelPose:
        self.calls += 1
        return estimate_pose(self.outlines, self.camera, lines=lines, **self.options)

    def run(self, ends: FloatArray) -> tuple[PanelPose, PanelPose]:
        alone = self([])
        self.calls = 0
        return alone, with_lines(alone, self.outlines, np.asarray(ends), STD_PX, self)


def errors(view, solved, count=24, columns=2, rows=3, sigma=0.7, **options):
    """Errors (deg) without and with lines over many panels, and the poses with them."""
    found = []
    for seed in range(count):
        angles = np.random.default_rng(seed).uniform(-30, 30, 3)
        panel = view(columns, rows, angles).noisy(seed, sigma)
        alone, helped = Solver(panel.outlines, panel.camera, **options).run(solved(panel, seed))
        found.append((panel.error_deg(alone), panel.error_deg(helped), alone, helped))
    without, with_them, alone, helped = zip(*found, strict=True)
    return np.array(without), np.array(with_them), alone, helped


@pytest.fixture
def panels(view, grid):
    return lambda columns, rows, angles: view(grid(columns, rows), angles)


@pytest.mark.parametrize("correlation", [0.0, 0.1])
def test_lines_make_the_pose_exact(panels, correlation):
    def plate(panel, seed):
        return plate_of(panel, STD_PX, seed)

    without, with_them, alone, helped = errors(panels, plate, correlation=correlation)
    assert np.median(with_them) < 0.5 * np.median(without)
    assert (with_them < without + 0.5).all()
    assert with_them.max() < 3.0
    deviations = np.array([[max(pose.std_deg) for pose in poses] for poses in (alone, helped)])
    assert (deviations[1] < 0.5 * deviations[0]).all()
    # They are as exact as they say.
    assert (with_them < 3.5 * deviations[1]).all()


def test_lines_through_a_lens_make_the_pose_exact(view, grid):
    without, with_them = [], []
    for seed in range(8):
        rng = np.random.default_rng(seed)
        panel, camera, outlines, ends = bent_panel(view, grid, rng.uniform(-25, 25, 3))
        noisy = [
            replace(o, corners_px=o.corners_px + rng.normal(0, 0.7, (4, 2)), std_px=0.7)
            for o in outlines
        ]
        alone, helped = Solver(noisy, camera).run(ends + rng.normal(0, STD_PX, ends.shape))
        without.append(panel.error_deg(alone))
        with_them.append(panel.error_deg(helped))
    assert np.median(with_them) < 0.5 * np.median(without)
    assert max(with_them) < 2.0


def test_lines_help_a_single_button(panels):
    def plate(panel, seed):
        return plate_of(panel, STD_PX, seed)

    without, with_them, _, helped = errors(panels, plate, columns=1, rows=1, sigma=0.3)
    trusted = np.array([pose.status == "ok" for pose in helped])
    # Not of every one: its first pose may be too wrong to recognise them.
    assert trusted.mean() > 0.5
    assert np.median(without) > 10
    assert with_them[trusted].max() < 3.0


# --- what does not belong to the panel


def test_without_lines_that_agree_the_pose_stays(view, grid):
    panel = view(grid(3, 5), (20, -15, 8)).noisy(1, 0.3)
    wrong = clutter(0, 60)
    wrong = wrong[(off_axes_deg(panel, wrong) > 9).all(axis=0)]
    assert len(wrong) > 20
    for ends in (wrong, np.zeros((0, 2, 2))):
        solver = Solver(panel.outlines, panel.camera)
        alone, helped = solver.run(ends)
        assert helped is alone
        assert solver.calls == 0


@pytest.mark.parametrize("count", [1, 4, 12, 100])
@pytest.mark.parametrize(("columns", "rows", "sigma"), [(3, 5, 0.3), (2, 3, 0.5), (1, 3, 1.0)])
def test_segments_that_run_anyhow_do_not_pull_the_pose(panels, columns, rows, sigma, count):
    # Some of them always agree with an unsure pose, and would make it sure of itself.
    without, with_them, alone, helped = errors(
        panels, lambda panel, seed: clutter(seed, count), 12, columns, rows, sigma
    )
    assert (with_them > without + 0.3).sum() <= 1
    for before, after, error in zip(alone, helped, with_them, strict=True):
        assert after.status == before.status or error < 3.0


def test_clutter_beside_the_plate(panels):
    def beside(panel, seed):
        return np.concatenate([plate_of(panel, STD_PX, seed), clutter(seed, 30)])

    # Too few to be sure that it is they: no line is better than a wrong one.
    for columns, rows, sigma in ((2, 3, 0.5), (1, 3, 1.0)):
        _, with_them, _, helped = errors(panels, beside, 16, columns, rows, sigma)
        trusted = np.array([pose.status == "ok" for pose in helped])
        assert with_them[trusted].max(initial=0) < 5.0


def test_where_most_are_the_panels_the_others_do_no_harm(panels):
    def tiled(panel, seed):
        tiles = [[[-0.2, y], [0.2, y]] for y in (-0.25, -0.2, 0.2, 0.25)]
        joints = panel.project([*tiles, *([[x, -0.2], [x, 0.2]] for x in (-0.2, -0.15, 0.15, 0.2))])
        return np.concatenate([plate_of(panel, STD_PX, seed), joints, clutter(seed, 8)])

    without, with_them, alone, helped = errors(panels, tiled, 16)
    assert np.median(with_them) < 0.4 * np.median(without)
    assert with_them.max() < 1.5
    assert all(after is not before for before, after in zip(alone, helped, strict=True))


def test_a_rail_askew_is_set_aside(panels):
    # It agrees well enough to be tried; the others outvote it.
    def askew(panel, seed):
        edges = plate_of(panel, STD_PX, seed)
        rails = panel.project([[[-0.15, 0.16], [0.15, 0.16]], [[-0.15, -0.16], [0.15, -0.16]]])
        return np.concatenate([edges, [turned(rails[0], 2.0)], rails[1:]])

    _, with_them, _, _ = errors(panels, askew, 12, 3, 5, 0.3)
    assert with_them.max() < 1.5


# --- taking turns


def test_no_pose_of_another_status_is_taken(view, grid):
    panel = view(grid(2, 3), (10, 15, 3))
    pose = estimate_pose(panel.outlines, panel.camera)

    def lost(lines):
        return replace(estimate_pose(panel.outlines, panel.camera), status="degenerate")

    assert with_lines(pose, panel.outlines, plate_of(panel), STD_PX, lost) is pose


def test_solved_again_only_while_lines_change(view, grid):
    panel = view(grid(2, 3), (10, 15, 3))
    solver = Solver(panel.outlines, panel.camera)
    _, helped = solver.run(plate_of(panel))
    assert solver.calls == 1
    assert panel.error_deg(helped) < 0.1

    # Poses that always find other lines than the last did: there is an end to it.
    pose = unsure(estimate_pose(panel.outlines, panel.camera, tolerance=0), 0.01)
    edges = plate_of(panel)
    found = []

    def restless(lines):
        found.append({line.ends_px.tobytes() for line in lines})
        return rolled(pose, 2.0 * (len(found) % 2))

    askew = [turned(edge, -2.0) for edge in edges]
    with_lines(pose, panel.outlines, np.array([*edges, *askew]), STD_PX, restless)
    assert found[0] == {edge.tobytes() for edge in edges}
    assert found[1] == {edge.tobytes() for edge in askew}
    assert len(found) <= 10


def test_lines_that_only_a_better_pose_knows_are_used_as_well(view, grid):
    panel = view(grid(2, 3), (12, -20, 6))
    pose = unsure(estimate_pose(panel.outlines, panel.camera, tolerance=0), 0.01)
    found = []

    def solve(lines):
        found.append({line.ends_px.tobytes() for line in lines})
        return pose

    # Three edges are near enough to the rough pose; so are all to the one that they give.
    edges = plate_of(panel)
    ends = np.array([*edges[:3], turned(edges[3], 0.6)])
    helped = with_lines(rolled(pose, 0.8), panel.outlines, ends, STD_PX, solve)
    assert helped is pose
    assert found == [{e.tobytes() for e in ends[:3]}, {e.tobytes() for e in ends}]


# --- from the photo's pixels


@pytest.fixture
def pictured(view, grid):
    """A noisy panel, and a photo of the plate that it is on."""
    import cv2

    panel = view(grid(2, 3), (18, -24, 5)).noisy(3, 1.0)
    corners = panel.project([[-0.11, -0.13], [0.11, -0.13], [0.11, 0.13], [-0.11, 0.13]])
    photo = np.full((480, 640, 3), 70, np.uint8)
    fixed = np.rint(corners * 16).astype(np.int32)
    cv2.fillPoly(photo, [fixed], (170, 170, 170), cv2.LINE_AA, 4)
    return panel, cv2.GaussianBlur(photo, (0, 0), 0.8)


FORMS = {
    "RGB": lambda rgb: rgb,
    "RGBA": lambda rgb: np.dstack([rgb, np.full(rgb.shape[:2], 255, np.uint8)]),
    "grey": lambda rgb: np.ascontiguousarray(rgb[..., 0]),
    "grey, one channel": lambda rgb: np.ascontiguousarray(rgb[..., :1]),
    "16 bit": lambda rgb: rgb.astype(np.uint16) << 8,
    "16-bit grey": lambda rgb: rgb[..., 0].astype(np.uint16) << 8,
    "float": lambda rgb: rgb.astype(np.float32) / 255,
    "float grey": lambda rgb: rgb[..., 0].astype(np.float32) / 255,
}


@pytest.mark.parametrize("form", FORMS)
def test_lines_are_found_in_photos_of_every_kind(pictured, form):
    panel, rgb = pictured
    photo = FORMS[form](rgb)
    before = photo.copy()
    alone = rectify_outlines(photo, panel.outlines, panel.camera)
    helped = rectify_outlines(photo, panel.outlines, panel.camera, find_lines=True)
    np.testing.assert_array_equal(photo, before)
    assert panel.error_deg(alone.pose) > 1.0
    assert panel.error_deg(helped.pose) < 0.5
    assert max(helped.pose.std_deg) < 0.5 * max(alone.pose.std_deg)
    assert helped.view is not None
    assert helped.view.image.dtype == photo.dtype


def test_a_photo_without_lines_changes_nothing(pictured):
    panel, rgb = pictured
    for photo in (np.zeros_like(rgb), np.full((480, 640), 0.5, np.float32)):
        alone = rectify_outlines(photo, panel.outlines, panel.camera)
        helped = rectify_outlines(photo, panel.outlines, panel.camera, find_lines=True)
        np.testing.assert_array_equal(helped.pose.rotation, alone.pose.rotation)
        np.testing.assert_array_equal(helped.pose.covariance, alone.pose.covariance)
