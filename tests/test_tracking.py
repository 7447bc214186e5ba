"""The rotation over the frames of a video: `fronto.tracking`."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fronto import Camera, InputError, PanelPose
from fronto.pose.rotation import angle_between, rotation_exp, rotation_from_angles, rotation_log
from fronto.results import Status
from fronto.tracking import RotationFilter

CAMERA = Camera.from_fov(60, 640, 480)
DT = 1 / 30
vectors = st.lists(st.floats(-3, 3), min_size=3, max_size=3).map(np.array)
seeds = st.integers(0, 2**32 - 1)
quick = settings(derandomize=True, deadline=None, max_examples=15)


def pose(
    rotation: np.ndarray, std_deg: float | np.ndarray = 0.5, status: Status = "ok"
) -> PanelPose:
    """A measurement; `std_deg` is a number, or a whole covariance in rad²."""
    covariance = np.radians(std_deg) ** 2 * np.eye(3) if np.ndim(std_deg) == 0 else std_deg
    return PanelPose(
        status=status,
        reasons=(),
        solver="refine",
        rotation=rotation,
        covariance=covariance,
        camera=CAMERA,
        plane_corners=np.zeros((0, 4, 2)),
        residual_px=np.zeros(0),
        weight=np.zeros(0),
    )


def noisy(rng: np.random.Generator, truth: np.ndarray, covariance: np.ndarray) -> PanelPose:
    """A measurement Z with truth = Z exp([v]x), v of the covariance that it states."""
    v = np.linalg.cholesky(covariance) @ rng.normal(size=3)
    return pose(truth @ rotation_exp(-v), covariance)


def off_deg(first: np.ndarray, second: np.ndarray) -> float:
    return float(np.degrees(angle_between(first, second)))


def slanted(rng: np.random.Generator) -> np.ndarray:
    """A covariance with deviations of 0.2 to 2 degrees about slanted axes."""
    axes = rotation_exp(rng.normal(size=3))
    return axes @ np.diag(np.radians(rng.uniform(0.2, 2.0, 3)) ** 2) @ axes.T


@quick
@given(vectors, seeds)
def test_a_constant_rotation_gets_surer(vector: np.ndarray, seed: int) -> None:
    rng = np.random.default_rng(seed)
    truth, covariance = rotation_exp(vector), slanted(rng)
    track = RotationFilter(rate_deg=0, gate=1e3)
    results = [track.update(noisy(rng, truth, covariance), k * DT) for k in range(16)]
    spread = [result.largest_std_deg for result in results]
    assert np.all(np.diff(spread) < 0)
    # Sixteen measurements of one thing: a quarter of the deviation, about slanted axes too.
    assert np.allclose(results[-1].covariance, covariance / 16, atol=0.1 * np.radians(0.5) ** 2)
    assert all(result.status == "tracked" and result.age_s == 0 for result in results)


def test_the_stated_covariance_is_that_of_the_errors() -> None:
    """Mean normalised squared errors of three degrees of freedom, over many tracks."""
    rng = np.random.default_rng(5)
    rate = 3.0
    squares = []
    for _ in range(80):
        truth, covariance = rotation_exp(rng.normal(size=3) * 2), slanted(rng)
        track = RotationFilter(rate_deg=rate)
        for k in range(8):
            result = track.update(noisy(rng, truth, covariance), k * DT)
            step = np.radians(rate) * np.sqrt(DT)
            last, truth = truth, truth @ rotation_exp(rng.normal(size=3) * step)
        w = rotation_log(result.rotation.T @ last)
        squares.append(float(w @ np.linalg.solve(result.covariance, w)))
    # Their mean has the deviation sqrt(6 / 80) = 0.27.
    assert 2.2 < np.mean(squares) < 3.8


def test_smoothing_brings_the_rotation_nearer_to_the_truth() -> None:
    rng = np.random.default_rng(1)
    covariance = np.radians(1.0) ** 2 * np.eye(3)
    track, single, smooth = RotationFilter(), [], []
    for k in range(60):
        truth = rotation_from_angles(0.1, np.radians(20 * np.sin(k / 30)), 0)
        measured = noisy(rng, truth, covariance)
        single.append(off_deg(measured.rotation, truth))
        smooth.append(off_deg(track.update(measured, k * DT).rotation, truth))
    assert np.mean(smooth[5:]) < 0.75 * np.mean(single[5:])


@quick
@given(vectors, seeds)
def test_a_wrong_measurement_does_not_move_the_track(vector: np.ndarray, seed: int) -> None:
    rng = np.random.default_rng(seed)
    truth = rotation_exp(vector)
    axis = rng.normal(size=3)
    wrong = truth @ rotation_exp(np.radians(30) * axis / np.linalg.norm(axis))
    track = RotationFilter()
    for k in range(5):
        track.update(pose(truth), k * DT)
    result = track.update(pose(wrong), 5 * DT)
    assert result.status == "predicted"
    assert result.reasons
    assert result.age_s == pytest.approx(DT)
    assert off_deg(result.rotation, truth) < 1e-6
    again = track.update(pose(truth), 6 * DT)
    assert (again.status, again.reasons) == ("tracked", ())
    assert off_deg(again.rotation, truth) < 1e-6


@quick
@given(vectors, vectors, seeds)
def test_a_jump_is_followed_when_three_agree(
    vector: np.ndarray, turn: np.ndarray, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    before = rotation_exp(vector)
    jump = turn / max(np.linalg.norm(turn), 1e-3) * np.radians(rng.uniform(15, 170))
    after = before @ rotation_exp(jump if np.any(turn) else np.radians([20.0, 0, 0]))
    if off_deg(before, after) < 15:
        after = before @ rotation_exp(np.radians([0.0, 40, 0]))
    track = RotationFilter()
    covariance = np.radians(0.5) ** 2 * np.eye(3)
    for k in range(5):
        track.update(noisy(rng, before, covariance / 9), k * DT)
    statuses = []
    for k in range(5, 8):
        result = track.update(noisy(rng, after, covariance / 9), k * DT)
        statuses.append(result.status)
    assert statuses == ["predicted", "predicted", "tracked"]
    assert result.reasons
    assert off_deg(result.rotation, after) < 2
    # From three measurements, not from the old track's many.
    assert result.largest_std_deg < 0.5


def test_measurements_that_contradict_each_other_do_not_restart() -> None:
    truth = np.eye(3)
    track = RotationFilter()
    for k in range(5):
        track.update(pose(truth), k * DT)
    for k in range(5, 11):
        wrong = rotation_from_angles(0, np.radians(30 if k % 2 else -30), 0)
        result = track.update(pose(wrong), k * DT)
        assert result.status == "predicted"
    assert off_deg(result.rotation, truth) < 1e-6


def test_a_good_one_in_between_clears_those_against_it() -> None:
    truth, wrong = np.eye(3), rotation_from_angles(0, np.radians(30), 0)
    track = RotationFilter()
    for k, shown in enumerate([truth, wrong, wrong, truth, wrong, wrong]):
        result = track.update(pose(shown), k * DT)
    assert off_deg(result.rotation, truth) < 1e-6


@pytest.mark.parametrize(
    "truth",
    [
        rotation_from_angles(0.3, np.pi / 2, 0.2),
        rotation_from_angles(np.pi, 0.1, 0.0),
        rotation_from_angles(0.0, -np.pi / 2, np.pi),
    ],
)
def test_nothing_is_singular_at_right_angles(truth: np.ndarray) -> None:
    rng = np.random.default_rng(2)
    covariance = np.radians(1.0) ** 2 * np.eye(3)
    track = RotationFilter(rate_deg=0)
    for k in range(40):
        result = track.update(noisy(rng, truth, covariance), k * DT)
    assert off_deg(result.rotation, truth) < 0.7
    assert result.largest_std_deg == pytest.approx(1 / np.sqrt(40), rel=0.05)
    assert np.allclose(result.rotation @ result.rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(result.rotation) == pytest.approx(1)


def test_uncertain_poses_count_within_the_gate_and_start_nothing() -> None:
    truth = np.eye(3)
    track = RotationFilter()
    first = track.update(pose(truth, status="uncertain"), 0)
    assert first.status == "lost"
    assert first.reasons
    assert np.isnan(first.covariance).all()
    assert first.age_s == np.inf
    track.update(pose(truth), DT)
    near = rotation_from_angles(0, np.radians(1), 0)
    result = track.update(pose(near, status="uncertain"), 2 * DT)
    assert result.status == "tracked"
    assert 0.1 < off_deg(result.rotation, truth) < 1
    far = rotation_from_angles(0, np.radians(30), 0)
    for k in range(3, 9):
        result = track.update(pose(far, status="uncertain"), k * DT)
        assert result.status != "tracked"
    assert off_deg(result.rotation, truth) < 1


@pytest.mark.parametrize(
    "unusable",
    [
        pose(np.eye(3), status="degenerate"),
        pose(np.eye(3), status="no_buttons"),
        pose(np.eye(3), np.full((3, 3), np.nan)),
    ],
)
def test_without_a_measurement_the_track_gets_lost_and_comes_back(unusable: PanelPose) -> None:
    truth = rotation_from_angles(0.2, 0.3, 0.4)
    track = RotationFilter(rate_deg=3, lost_deg=2.5)
    track.update(pose(truth), 0)
    statuses, spreads = [], []
    for k in range(1, 61):
        result = track.update(unusable, k * DT)
        statuses.append(result.status)
        spreads.append(result.largest_std_deg)
        assert result.reasons
    lost = statuses.index("lost")
    assert set(statuses[:lost]) == {"predicted"}
    assert set(statuses[lost:]) == {"lost"}
    # 0.5² + 3² t = 2.5² at t = 2/3 s.
    assert lost == pytest.approx(20, abs=1)
    assert np.all(np.diff(spreads) > 0)
    assert result.age_s == pytest.approx(2)
    assert track.update(pose(truth, status="uncertain"), 61 * DT).status == "lost"
    elsewhere = truth @ rotation_exp([0, 1.0, 0])
    back = track.update(pose(elsewhere), 62 * DT)
    assert back.status == "tracked"
    assert off_deg(back.rotation, elsewhere) < 0.1


def test_a_camera_that_turns_is_followed() -> None:
    track = RotationFilter()
    for k in range(60):
        truth = rotation_from_angles(0, np.radians(0.3 * k), 0)
        result = track.update(pose(truth, 0.3), k * DT)
        assert result.status == "tracked"
    assert off_deg(result.rotation, truth) < 0.5


@quick
@given(vectors, seeds)
def test_after_a_long_time_only_the_new_measurement_counts(turn: np.ndarray, seed: int) -> None:
    rng = np.random.default_rng(seed)
    covariance = slanted(rng)
    track = RotationFilter(rate_deg=60, lost_deg=1e4)
    track.update(pose(np.eye(3)), 0)
    far = rotation_exp(0.8 * turn / max(np.linalg.norm(turn), 1))
    result = track.update(pose(far, covariance), 400)
    assert off_deg(result.rotation, far) < 0.05
    # About the axes of the camera as it is now, not as it was.
    assert np.allclose(result.covariance, covariance, atol=0.01 * covariance.max())


def test_time_stands_still_or_goes_on() -> None:
    track = RotationFilter()
    track.update(pose(np.eye(3)), 1.0)
    same = track.update(pose(np.eye(3)), 1.0)
    assert same.status == "tracked"
    assert same.largest_std_deg == pytest.approx(0.5 / np.sqrt(2), rel=1e-3)
    for wrong in (0.99, float("nan"), float("inf")):
        with pytest.raises(InputError, match="time_s"):
            track.update(pose(np.eye(3)), wrong)
    assert track.update(pose(np.eye(3)), 1.1).status == "tracked"


def test_exact_measurements_are_no_singularity() -> None:
    track = RotationFilter(rate_deg=0)
    for k in range(5):
        result = track.update(pose(np.eye(3), 0.0), k * DT)
    assert result.status == "tracked"
    assert np.isfinite(result.covariance).all()


def test_deviations_of_the_angles_are_as_a_pose_has_them() -> None:
    truth = rotation_from_angles(0.2, 0.7, -0.4)
    covariance = slanted(np.random.default_rng(3))
    measured = pose(truth, covariance)
    result = RotationFilter().update(measured, 0)
    assert result.angles_deg == pytest.approx(measured.angles_deg)
    assert result.std_deg == pytest.approx(measured.std_deg, rel=1e-3)
    assert result
    with pytest.raises(ValueError, match="read-only"):
        result.rotation[0, 0] = 2


@pytest.mark.parametrize(
    ("argument", "value"),
    [
        ("rate_deg", -1.0),
        ("rate_deg", float("nan")),
        ("gate", 0.0),
        ("lost_deg", -1.0),
        ("restart_after", 0),
    ],
)
def test_wrong_arguments_are_named(argument: str, value: float) -> None:
    with pytest.raises(InputError, match=argument):
        RotationFilter(**{argument: value})  # type: ignore[arg-type]


def test_a_pose_without_a_rotation_is_no_measurement() -> None:
    track = RotationFilter()
    broken = replace(pose(np.eye(3)), rotation=np.full((3, 3), np.nan))
    assert track.update(broken, 0).status == "lost"
