from dataclasses import dataclass, replace

import numpy as np
import pytest

from fronto import Camera, LineSegment
from fronto.pose.bundle import (
    ELLIPSE,
    FIRST_GROUP,
    FOCAL,
    MAX_GLOBALS,
    Model,
    Observations,
    back_project,
    depth_one,
    evaluate,
    solve,
)
from fronto.pose.observations import observations
from fronto.pose.rotation import angle_between, rotation_exp
from fronto.synth import PAPER_CAMERA, LayoutButton

MIXED = (
    LayoutButton(-0.03, -0.05, 0.03, 0.03),
    LayoutButton(0.03, -0.05, 0.03, 0.03),
    LayoutButton(-0.03, 0.0, 0.03, 0.03, "ellipse"),
    LayoutButton(0.03, 0.0, 0.03, 0.03, "ellipse"),
    LayoutButton(-0.03, 0.05, 0.03, 0.03),
)
#: Latents of MIXED: two columns, three rows.
COLUMN, ROW = [0, 1, 0, 1, 0], [2, 2, 3, 3, 4]


@dataclass(frozen=True)
class Problem:
    """Observations, a model and its true parameters."""

    seen: Observations
    model: Model
    rotation: np.ndarray
    parameters: np.ndarray
    xy: np.ndarray

    def cost(self, step):
        """At truth plus `step`: w (3), the other globals, xy (2 n)."""
        m = self.model.size
        parameters = self.parameters + np.concatenate([np.zeros(3), step[3:m]])
        return evaluate(
            self.seen,
            self.model,
            self.rotation @ rotation_exp(step[:3]),
            parameters,
            self.xy + step[m:].reshape(-1, 2),
        )

    def solve(self, **options):
        return solve(
            self.seen,
            self.model,
            self.rotation[None],
            self.parameters[None],
            self.xy[None],
            **options,
        )[0]


def problem_of(
    view,
    *,
    angles=(14.0, -22.0, 9.0),
    focal_scale=1.0,
    focal_isd=-1.0,
    lines=False,
    ties=False,
    square=False,
    template=False,
    tilt=0.0,
    noise=None,
    gain=1.0,
    oval=None,
):
    """MIXED seen by a camera whose true focal length is `focal_scale` times the assumed one."""
    camera = PAPER_CAMERA
    true = Camera.from_matrix(np.diag([focal_scale, focal_scale, 1]) @ camera.matrix, 640, 480)
    shift = true.matrix.copy()
    shift[:2, 2] = camera.matrix[:2, 2]
    true = Camera.from_matrix(shift, 640, 480)
    high = oval or 0.03
    buttons = [replace(b, height=high) if b.shape == "ellipse" else b for b in MIXED]
    panel = view(buttons, angles, at_px=(370, 210), camera=true, std_px=0.3)
    segments = []
    if lines:
        for axis, ends in [
            ("horizontal", [[-0.06, -0.08], [0.07, -0.08]]),
            ("vertical", [[0.06, -0.08], [0.06, 0.03]]),
        ]:
            segments.append(LineSegment(axis, panel.project(ends), std_px=0.4))
    if noise is not None:
        panel = panel.noisy(noise, 0.3)
    seen = observations(panel.outlines, camera, segments)
    seen = replace(seen, gain=np.full(len(seen.kind), gain))

    pivot = np.array([*(np.array(seen.pivot) / focal_scale), 1.0])
    depth = panel.translation[2] / (panel.rotation[2] @ pivot)
    origin = (depth * panel.rotation @ pivot - panel.translation)[:2]
    n, groups = len(MIXED), 2
    latents = 3 if template else 5 if ties else 0
    tie_index, tie_coef, tie_isd = np.full((n, 4), -1), np.zeros((n, 4)), np.zeros((n, 2))
    positions = []
    if template:
        tie_index[:] = [0, 1, 0, 2]
        tie_coef[:] = [[1e3 * b.x, 1.0, 1e3 * b.y, 1.0] for b in MIXED]
        positions = [1e-3 / depth, *(-origin / depth)]
    elif ties:
        tie_index[:, 0], tie_index[:, 2] = COLUMN, ROW
        tie_coef[:, ::2] = 1.0
        places = np.array([-0.03, 0.03, -0.05, 0.0, 0.05])
        positions = (places - origin[[0, 0, 1, 1, 1]]) / depth
    tie_isd[:] = 3000.0 if latents else 0.0
    model = Model(
        group=np.array([0, 0, 1, 1, 0], np.intc),
        square_isd=np.array([100.0 if square else 0.0, 0.0]),
        oval=np.array([0, oval is not None], np.intc),
        tie_index=tie_index.astype(np.intc),
        tie_coef=tie_coef,
        tie_isd=tie_isd,
        latents=latents,
        size_scale=np.array([[30.0, 30.0], [30.0, 0.0]]) if template else np.zeros((2, 2)),
        size_isd=50.0 if template else 0.0,
        scale_latent=0 if template else -1,
        focal_isd=focal_isd,
        tilt_isd=tilt,
    )
    parameters = np.zeros(model.size)
    parameters[FOCAL] = np.log(focal_scale)
    parameters[FIRST_GROUP : FIRST_GROUP + 2 * groups] = np.log(0.03 / depth)
    parameters[FIRST_GROUP + 3] = np.log(high / depth)
    parameters[FIRST_GROUP + 2 * groups :] = positions
    xy = np.array([[b.x, b.y] for b in MIXED]) - origin
    return Problem(seen, model, panel.rotation, parameters, xy / depth)


CASES = {
    "quads and circles": {},
    "lines": {"lines": True},
    "ties": {"ties": True},
    "squareness": {"square": True},
    "tilt": {"angles": (0.0, 0.0, 9.0), "tilt": 300.0},
    "focal length": {"focal_scale": 1.2, "focal_isd": 3.0},
    "template": {"template": True},
    "form": {"gain": 4.0},
    "ovals": {"oval": 0.022},
    "everything of ovals": {"oval": 0.041, "gain": 3.0, "lines": True, "ties": True},
    "everything": {
        "gain": 2.5,
        "angles": (0.0, 0.0, -5.0),
        "lines": True,
        "ties": True,
        "square": True,
        "tilt": 2.0,
        "focal_scale": 0.8,
        "focal_isd": 3.0,
    },
}


def free(problem):
    """Indices of the parameters that the solver moves, xy last."""
    m = problem.model.size
    size = m + problem.xy.size
    # log height of the circles means nothing, and a known focal length stays.
    fixed = set() if problem.model.oval[1] else {FIRST_GROUP + 3}
    fixed |= {FOCAL} if problem.model.focal_isd < 0 else set()
    return np.array([k for k in range(size) if k not in fixed])


def steps(problem):
    """Steps of about 1e-3 deviations along each parameter."""
    m = problem.model.size
    tiny = 1e-7
    unit = np.eye(m + problem.xy.size)
    base = problem.cost(np.zeros(len(unit)))
    bend = [problem.cost(tiny * e) + problem.cost(-tiny * e) - 2 * base for e in unit]
    return 1e-3 * tiny / np.sqrt(np.maximum(np.array(bend) / 2, 1e-12))


@pytest.mark.parametrize("name", CASES)
def test_hessian_against_differences_of_the_cost(view, name):
    problem = problem_of(view, **CASES[name])
    index, h, m = free(problem), steps(problem), problem.model.size
    base = problem.cost(np.zeros(m + problem.xy.size))
    focal = problem.model.focal_isd * problem.parameters[FOCAL]
    # Exact data: only the prior of the focal length, which is linear, leaves a residual.
    assert base == pytest.approx(focal**2 if problem.model.focal_isd > 0 else 0.0, abs=1e-9)
    count = len(index)
    full = np.zeros((count, count))
    unit = np.diag(h)
    for a in range(count):
        for b in range(a, count):
            da, db = unit[index[a]], unit[index[b]]
            mixed = sum(s * t * problem.cost(s * da + t * db) for s in (1, -1) for t in (1, -1))
            # Of a sum of squares JᵀJ is half the second derivative.
            full[a, b] = full[b, a] = mixed / (8 * h[index[a]] * h[index[b]])
    inner = int((index < m).sum())
    coupling = full[:inner, inner:]
    expected = full[:inner, :inner] - coupling @ np.linalg.solve(full[inner:, inner:], coupling.T)

    solution = problem.solve(max_iterations=0)
    np.testing.assert_array_equal(solution.rotation, problem.rotation)
    np.testing.assert_array_equal(solution.xy, problem.xy)
    kept = index[:inner]
    compiled = solution.hessian[np.ix_(kept, kept)]
    scale = np.sqrt(np.diag(full))[:inner]
    np.testing.assert_allclose(
        compiled / np.outer(scale, scale), expected / np.outer(scale, scale), atol=2e-5
    )
    held = sorted(set(range(m)) - set(kept))
    np.testing.assert_array_equal(solution.hessian[held], np.eye(m)[held])


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("outlier", [False, True])
def test_the_optimum_is_where_the_cost_is_flat(view, name, outlier):
    # All losses are active here: a gradient that disagreed with the cost would end elsewhere.
    case = CASES[name] | {"angles": (14.0, -22.0, 9.0), "noise": 5}
    problem = problem_of(view, **case)
    if outlier:
        observed = problem.seen.observed.copy()
        observed[0, :2] += 0.02
        problem = replace(problem, seen=replace(problem.seen, observed=observed))
    solution = problem.solve(max_iterations=400, tolerance=1e-13)
    assert solution.converged
    assert solution.cost < solution.first_cost
    assert solution.cost == pytest.approx(
        evaluate(problem.seen, problem.model, solution.rotation, solution.parameters, solution.xy),
        rel=1e-12,
    )
    there = replace(
        problem, rotation=solution.rotation, parameters=solution.parameters, xy=solution.xy
    )
    h = steps(there)
    for k in free(there):
        step = np.zeros(len(h))
        step[k] = h[k]
        slope = (there.cost(step) - there.cost(-step)) / (2 * h[k])
        # In units of cost per deviation; at the start it is above 0.1 somewhere.
        assert abs(slope) * 1e3 * h[k] < 2e-4


def test_slopes_are_not_all_zero_before(view):
    problem = problem_of(view, noise=5, ties=True, square=True)
    h = steps(problem)
    slopes = []
    for k in free(problem):
        step = np.zeros(len(h))
        step[k] = h[k]
        slopes.append(abs(problem.cost(step) - problem.cost(-step)) / 2 * 1e3)
    assert max(slopes) > 0.1


@pytest.mark.parametrize("name", [name for name in CASES if name != "focal length"])
def test_exact_data_is_a_fixed_point(view, name):
    problem = problem_of(view, **CASES[name] | {"focal_scale": 1.0})
    solution = problem.solve()
    assert solution.cost < 1e-12
    assert solution.converged
    np.testing.assert_allclose(solution.rotation, problem.rotation, atol=1e-9)
    np.testing.assert_allclose(solution.parameters, problem.parameters, atol=1e-9)
    np.testing.assert_allclose(solution.xy, problem.xy, atol=1e-9)


@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize("turn", [(0.3, 0.0, 0.0), (0.0, 0.3, 0.1), (-0.2, 0.1, -0.2)])
def test_starts_converge_to_the_truth(view, name, turn):
    case = CASES[name] | {"tilt": 0.0, "angles": (14.0, -22.0, 9.0)}
    if "focal_scale" in case:
        case["focal_isd"] = 1e-6
    problem = problem_of(view, **case)
    start = replace(problem, rotation=problem.rotation @ rotation_exp(turn))
    solution = start.solve(max_iterations=300, tolerance=1e-12)
    assert angle_between(solution.rotation, problem.rotation) < 1e-6
    np.testing.assert_allclose(solution.parameters, problem.parameters, atol=1e-6)
    np.testing.assert_allclose(solution.xy, problem.xy, atol=1e-6)
    assert solution.chi2.max() < 1e-6


def test_several_starts_are_solved_as_each_alone(view):
    problem = problem_of(view, noise=3)
    turns = [(0.2, 0, 0), (0, -0.3, 0)]
    rotations = np.array([problem.rotation @ rotation_exp(t) for t in turns])
    both = solve(
        problem.seen,
        problem.model,
        rotations,
        np.array([problem.parameters] * 2),
        np.array([problem.xy] * 2),
    )
    for k in range(2):
        alone = replace(problem, rotation=rotations[k]).solve()
        np.testing.assert_array_equal(both[k].rotation, alone.rotation)
        assert both[k].cost == alone.cost
        assert both[k].iterations == alone.iterations


def test_iterations_are_limited(view):
    problem = problem_of(view, noise=3)
    start = replace(problem, rotation=problem.rotation @ rotation_exp([0.3, 0.2, 0]))
    solution = start.solve(max_iterations=2)
    assert solution.iterations == 2
    assert not solution.converged


def test_behind_the_camera_costs_infinity(view):
    problem = problem_of(view)
    behind = replace(problem, xy=problem.xy - 100.0)
    solution = behind.solve()
    assert np.isinf(solution.cost)
    assert not solution.converged


def test_unseen_corners_do_not_count(view):
    problem = problem_of(view)
    inverse_sd = problem.seen.inverse_sd.copy()
    inverse_sd[0, 2] = 0.0
    observed = problem.seen.observed.copy()
    observed[0, 4:6] += 0.5
    seen = replace(problem.seen, inverse_sd=inverse_sd, observed=observed)
    assert evaluate(seen, problem.model, problem.rotation, problem.parameters, problem.xy) < 1e-12


def test_place_and_size_keep_their_weight_where_the_form_is_surer(view):
    problem, plain = problem_of(view, gain=5.0), problem_of(view)
    quad = problem.seen.observed[0, :8].reshape(4, 2)

    def chi2(which, moved):
        observed = which.seen.observed.copy()
        observed[0, :8] = moved.ravel()
        seen = replace(which.seen, observed=observed)
        return evaluate(seen, which.model, which.rotation, which.parameters, which.xy)

    middle = quad.mean(axis=0)
    along = (quad[1] + quad[2] - quad[0] - quad[3]) / 4
    grown = quad + 0.02 * np.outer([-1, 1, 1, -1], along)
    for moved in (quad + np.array([0.001, 0.0]), quad + np.array([0.0, 0.002]), grown):
        assert chi2(problem, moved) == pytest.approx(chi2(plain, moved), rel=0.02)
    for turn in (0.01, -0.01):
        turned = middle + (quad - middle) @ np.array([[1, turn], [-turn, 1]])
        assert chi2(problem, turned) > 15 * chi2(plain, turned)


def test_so_do_those_of_circles(view):
    problem, plain = problem_of(view, gain=5.0), problem_of(view)
    k = int(np.flatnonzero(problem.seen.kind == ELLIPSE)[0])
    n0, n1, h = problem.seen.observed[k].reshape(8, 3).T
    reach = 0.5 * (h + np.roll(h, 4))

    def chi2(which, moved):
        observed = which.seen.observed.copy()
        observed[k, 2::3] += moved
        seen = replace(which.seen, observed=observed)
        return evaluate(seen, which.model, which.rotation, which.parameters, which.xy)

    for moved in (0.001 * n0, 0.002 * n1, 0.01 * reach):
        assert chi2(problem, moved) == pytest.approx(chi2(plain, moved), rel=0.01)
    # Longer one way and shorter the other.
    anomaly = 2 * np.pi * np.arange(8) / 8
    for moved in (0.001 * np.cos(2 * anomaly), 0.001 * np.sin(2 * anomaly)):
        assert chi2(problem, moved) > 10 * chi2(plain, moved)


def test_loss_is_plain_up_to_the_knee_and_logarithmic_after(view):
    problem = problem_of(view)
    isd = problem.seen.inverse_sd[0, 0]
    for residual, expected in [
        (3.0, 9.0),
        # knee 16, Cauchy's c² 16: 16 + 16 ln(1 + (64 - 16)/16) = 16 + 16 ln 4
        (8.0, 16 + 16 * np.log(4.0)),
    ]:
        observed = problem.seen.observed.copy()
        observed[0, 0] += residual / isd
        seen = replace(problem.seen, observed=observed)
        cost = evaluate(seen, problem.model, problem.rotation, problem.parameters, problem.xy)
        assert cost == pytest.approx(expected, rel=1e-6)


def test_tilt_prior_is_on_the_normals_two_first_coordinates(view):
    plain, problem = problem_of(view), problem_of(view, tilt=100.0)
    normal = problem.rotation[2]
    assert problem.cost(np.zeros(problem.model.size + problem.xy.size)) == pytest.approx(
        1e4 * (normal[:2] @ normal[:2])
    )
    h = 1e-6
    jacobian = np.array(
        [
            ((problem.rotation @ rotation_exp(h * e)) - (problem.rotation @ rotation_exp(-h * e)))[
                2, :2
            ]
            / (2 * h)
            for e in np.eye(3)
        ]
    )
    added = problem.solve(max_iterations=0).hessian - plain.solve(max_iterations=0).hessian
    np.testing.assert_allclose(added[:3, :3], 1e4 * jacobian @ jacobian.T, atol=1e-2)


def test_line_ends_count_with_their_deviation(view):
    # Both ends off by one deviation, to either side: χ² is 2, Cauchy's c² is 9.
    problem = problem_of(view, lines=True)
    segment = problem.seen.segment.copy()
    along = segment[0, 2:] - segment[0, :2]
    across = np.array([-along[1], along[0]]) / np.hypot(*along) / problem.seen.line_isd[0]
    segment[0] += np.concatenate([across, -across])
    moved = replace(problem, seen=replace(problem.seen, segment=segment))
    cost = moved.cost(np.zeros(problem.model.size + problem.xy.size))
    assert cost == pytest.approx(9 * np.log1p(2 / 9), rel=1e-3)


def test_back_projection_of_exact_quads(view):
    problem = problem_of(view, focal_scale=1.1, focal_isd=1.0)
    xy, log_size, rotations = back_project(problem.seen, problem.rotation[None], 1.1)
    quads = np.array([0, 1, 4])
    np.testing.assert_allclose(xy[0, quads], problem.xy[quads], atol=1e-12)
    np.testing.assert_allclose(log_size[0, quads], problem.parameters[FIRST_GROUP], atol=1e-6)
    # Of circles the centre of the ellipse stands for the projected centre.
    np.testing.assert_allclose(xy[0, 2:4], problem.xy[2:4], atol=2e-3)
    np.testing.assert_allclose(log_size[0, 2:4], problem.parameters[FIRST_GROUP], atol=0.02)
    np.testing.assert_array_equal(rotations[0], problem.rotation)


def test_back_projection_turns_upright_where_asked(view):
    problem = problem_of(view)
    c, s = np.cos(0.3), np.sin(0.3)
    rolled = np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) @ problem.rotation
    xy, _, rotations = back_project(problem.seen, np.array([rolled, rolled]), keep=1)
    np.testing.assert_array_equal(rotations[0], rolled)
    np.testing.assert_allclose(rotations[1], problem.rotation, atol=1e-9)
    np.testing.assert_allclose(xy[1, [0, 1, 4]], problem.xy[[0, 1, 4]], atol=1e-9)
    np.testing.assert_allclose(
        xy[0, [0, 1, 4]], problem.xy[[0, 1, 4]] @ [[c, -s], [s, c]], atol=1e-9
    )


def test_depth_one_is_the_plane_of_the_result(view):
    problem = problem_of(view, focal_scale=1.1, focal_isd=1.0)
    offset, distance = depth_one(problem.seen, problem.rotation, 1.1)
    half = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])
    corners = problem.xy[:, None] + np.exp(problem.parameters[FIRST_GROUP]) * half
    points = (corners + offset) / distance
    rays = np.concatenate([points, np.ones((*points.shape[:2], 1))], axis=2) @ problem.rotation
    seen = (1.1 * rays[..., :2] / rays[..., 2:])[[0, 1, 4]]
    expected = problem.seen.observed[[0, 1, 4], :8].reshape(-1, 4, 2)
    np.testing.assert_allclose(seen, expected, atol=1e-9)


def test_too_many_shared_parameters_are_refused(view):
    problem = problem_of(view)
    model = replace(problem.model, latents=MAX_GLOBALS)
    with pytest.raises(ValueError, match="shared parameters"):
        solve(
            problem.seen,
            model,
            problem.rotation[None],
            np.zeros((1, model.size)),
            problem.xy[None],
        )
