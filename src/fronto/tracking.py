"""The panel's rotation over the frames of a video, with its covariance.

An error-state (multiplicative) extended Kalman filter on SO(3): the state is a rotation R and
the covariance P of w in R·exp([w]x), the camera's axes (Markley, "Attitude error
representations for Kalman filtering", J. Guidance, Control and Dynamics 26(2), 2003; in the
notation of Solà, Deray and Atchuthan, "A micro Lie theory for state estimation in robotics",
2018). No angles are involved, so none can be singular.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from fronto.errors import InputError
from fronto.pose.rotation import (
    angles_deg,
    angles_std_deg,
    nearest_rotation,
    rotation_exp,
    rotation_log,
)
from fronto.results import PanelPose
from fronto.shapes import FloatArray

__all__ = ["RotationFilter", "TrackStatus", "TrackedRotation"]

TrackStatus = Literal["tracked", "predicted", "lost"]

#: A camera in a calm hand or on a driving robot: half a degree between frames at 30 Hz.
RATE_DEG = 3.0
#: 99.9 % quantile of chi-square with three degrees of freedom.
GATE = 16.27
#: As a pose that is known no better is not called ok (fronto.pose.verdict).
LOST_DEG = 2.5
RESTART_AFTER = 3
#: Exact outlines in tests and simulations state no deviation at all.
MIN_STD_RAD = 1e-6


@dataclass(frozen=True, eq=False)
class TrackedRotation:
    """The rotation between camera and panel as all frames up to now have it.

    Parameters
    ----------
    status
        "tracked": this frame's pose was accepted. "predicted": it was not; the rotation is
        that of earlier frames, and the camera may have turned since. "lost": nothing was
        accepted for so long, or ever, that the rotation is not to be used.
    rotation
        Shape (3, 3): takes camera rays to the panel frame, as of :class:`fronto.PanelPose`.
        While lost: the last known one, the identity before the first.
    covariance
        Shape (3, 3), rad², of w in R·exp([w]x); NaN before the first accepted pose. It takes
        the errors of the frames as independent, which those of one panel are not altogether.
    age_s
        Seconds since the last accepted pose; infinite before the first.
    reasons
        Why it is not "tracked", or what happened to the track, in words.
    """

    status: TrackStatus
    rotation: FloatArray
    covariance: FloatArray
    age_s: float
    reasons: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name in ("rotation", "covariance"):
            array = np.array(getattr(self, name), dtype=np.float64)
            array.setflags(write=False)
            object.__setattr__(self, name, array)

    @property
    def angles_deg(self) -> tuple[float, float, float]:
        """θ_x, θ_y, θ_z as of :class:`fronto.PanelPose`, degrees."""
        return angles_deg(self.rotation)

    @property
    def std_deg(self) -> tuple[float, float, float]:
        """Standard deviations of `angles_deg`, degrees; NaN at θ_y = ±90 and before a track."""
        return angles_std_deg(self.rotation, self.covariance)

    @property
    def largest_std_deg(self) -> float:
        """Largest standard deviation about any axis, degrees; infinite before a track."""
        return math.degrees(_spread(self.covariance))

    def __bool__(self) -> bool:
        """True for "tracked" only."""
        return self.status == "tracked"


@dataclass(frozen=True, eq=False)
class _State:
    """R and P at a time; when a pose was last accepted, and how many were."""

    rotation: FloatArray
    covariance: FloatArray
    time_s: float
    accepted_s: float
    count: int = 1

    @property
    def spread(self) -> float:
        return _spread(self.covariance)


class RotationFilter:
    """Follows the panel's rotation over the frames of one video.

    The rotation makes a random walk. An "ok" pose that lies within the gate of what is
    predicted counts with its covariance; an "uncertain" one too, as long as the track is
    not lost, but it never starts a track. A pose outside the gate is skipped, unless as many
    "ok" ones as `restart_after`, without one in between that fits the track, agree with each
    other: then the camera has moved, or the video was cut, and the track starts again from
    them. A lost track starts again from the first "ok" pose. Not to be shared by threads.

    Parameters
    ----------
    rate_deg
        How fast the camera turns: standard deviation about each axis after one second,
        growing with the square root of time (degrees per square root of a second); 0: never.
    gate
        Largest squared Mahalanobis distance (three degrees of freedom) that is accepted.
    lost_deg
        A track that is known no better than this about some axis is lost.
    restart_after
        How many poses have to agree against the track.

    Raises
    ------
    InputError
        Naming the argument that is out of range.
    """

    def __init__(
        self,
        *,
        rate_deg: float = RATE_DEG,
        gate: float = GATE,
        lost_deg: float = LOST_DEG,
        restart_after: int = RESTART_AFTER,
    ) -> None:
        if not (math.isfinite(rate_deg) and rate_deg >= 0):
            raise InputError("rate_deg", f"expected degrees, 0 or more, got {rate_deg}")
        for name, value in (("gate", gate), ("lost_deg", lost_deg)):
            if not (math.isfinite(value) and value > 0):
                raise InputError(name, f"expected a number above 0, got {value}")
        if restart_after < 1:
            raise InputError("restart_after", f"expected 1 or more, got {restart_after}")
        self._rate = math.radians(rate_deg)
        self._gate = gate
        self._lost = math.radians(lost_deg)
        self._restart_after = restart_after
        self._time_s = -math.inf
        self._track: _State | None = None
        #: Where the poses that the track refuses agree to be.
        self._rival: _State | None = None

    def update(self, pose: PanelPose, time_s: float) -> TrackedRotation:
        """Take in one frame's pose.

        Parameters
        ----------
        pose
            Of any status.
        time_s
            When the frame was taken, seconds; not before the last one.

        Raises
        ------
        InputError
            If the time is not finite, or runs backwards.
        """
        if not math.isfinite(time_s) or time_s < self._time_s:
            raise InputError(
                "time_s",
                f"expected seconds, not before the last frame's {self._time_s:g}, got {time_s:g}",
                "give the frames in order, and each video a filter of its own",
            )
        self._time_s = time_s
        self._track = self._predicted(self._track)
        self._rival = self._predicted(self._rival)
        accepted, reasons = self._take(pose)
        track = self._track
        if track is None:
            unknown = np.full((3, 3), np.nan)
            return TrackedRotation("lost", np.eye(3), unknown, math.inf, reasons)
        age = time_s - track.accepted_s
        status: TrackStatus = "tracked" if accepted else "predicted"
        if not accepted and track.spread > self._lost:
            status = "lost"
            known = f"the rotation is known to ±{math.degrees(track.spread):.1f}° only"
            reasons = (f"no pose was accepted for {age:.2g} s: {known}", *reasons)
        return TrackedRotation(status, track.rotation, track.covariance, age, reasons)

    def _take(self, pose: PanelPose) -> tuple[bool, tuple[str, ...]]:
        """Whether the pose counts for the track, and remarks."""
        reason = _unusable(pose)
        if reason:
            return False, (reason,)
        ok = pose.status == "ok"
        track = self._track
        if track is None and not ok:
            return False, ("an uncertain pose starts no track",)
        if track is None:
            self._start(self._fresh(pose))
            return True, ()
        lost = track.spread > self._lost
        if lost and not ok:
            return False, ("an uncertain pose brings no lost track back",)
        fused = _fused(track, pose, self._gate)
        if fused is not None:
            self._start(fused)
            return True, ()
        off = math.degrees(float(np.linalg.norm(rotation_log(track.rotation.T @ pose.rotation))))
        if ok and lost:
            self._start(self._fresh(pose))
            return True, (f"the lost track starts again, {off:.1f}° off",)
        if ok and self._against(pose):
            return True, (
                f"the track starts again, {off:.1f}° off: {self._restart_after} poses agree",
            )
        return False, (f"the frame's pose is skipped: {off:.1f}° off the track",)

    def _against(self, pose: PanelPose) -> bool:
        """Whether this pose is the last of enough that agree against the track."""
        rival = None if self._rival is None else _fused(self._rival, pose, self._gate)
        self._rival = rival = rival or self._fresh(pose)
        if rival.count < self._restart_after:
            return False
        self._start(rival)
        return True

    def _start(self, track: _State) -> None:
        self._track, self._rival = track, None

    def _fresh(self, pose: PanelPose) -> _State:
        rotation = nearest_rotation(pose.rotation)
        return _State(rotation, _measured(pose), self._time_s, self._time_s)

    def _predicted(self, state: _State | None) -> _State | None:
        """The state now: the same rotation, less sure (the walk is the same about all axes)."""
        if state is None:
            return None
        grown = self._rate**2 * (self._time_s - state.time_s) * np.eye(3)
        return _State(
            state.rotation, state.covariance + grown, self._time_s, state.accepted_s, state.count
        )


def _unusable(pose: PanelPose) -> str:
    """Why a pose is no measurement, "" if it is one."""
    if pose.status not in ("ok", "uncertain"):
        return f"the frame shows no rotation ({pose.status.replace('_', ' ')})"
    known = np.isfinite(pose.covariance).all() and np.isfinite(pose.rotation).all()
    if not known or np.linalg.eigvalsh(pose.covariance)[0] < -(MIN_STD_RAD**2):
        return "the frame's pose states no deviations"
    return ""


def _measured(pose: PanelPose) -> FloatArray:
    symmetric = 0.5 * (pose.covariance + pose.covariance.T)
    return np.asarray(symmetric + 2 * MIN_STD_RAD**2 * np.eye(3))


def _fused(state: _State, pose: PanelPose, gate: float) -> _State | None:
    """The state with a pose Z taken in; None if that is outside of the gate.

    The truth is Z exp([v]x) = R exp([w]x), so y = log(Rᵀ Z) is w - J⁻¹ v to first order in
    v, with the right Jacobian J at y (Solà et al. 2018).
    """
    y = rotation_log(state.rotation.T @ pose.rotation)
    inverse = np.linalg.inv(_right_jacobian(y))
    noise = inverse @ _measured(pose) @ inverse.T
    p = state.covariance
    total_inverse = np.linalg.inv(p + noise)
    if not y @ total_inverse @ y <= gate:
        return None
    gain = p @ total_inverse
    w = gain @ y
    rest = np.eye(3) - gain
    # Joseph's form stays positive; then from the tangent space at R to that at R exp([w]x).
    posterior = rest @ p @ rest.T + gain @ noise @ gain.T
    turn = _right_jacobian(w)
    posterior = turn @ posterior @ turn.T
    return _State(
        np.asarray(state.rotation @ rotation_exp(w)),
        np.asarray(0.5 * (posterior + posterior.T)),
        state.time_s,
        state.time_s,
        state.count + 1,
    )


def _right_jacobian(w: FloatArray) -> FloatArray:
    """J with exp([w + d]x) = exp([w]x) exp([J d]x), d small (Solà et al. 2018)."""
    angle = float(np.linalg.norm(w))
    x, y, z = w
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    first = 0.5 * np.sinc(angle / (2 * np.pi)) ** 2
    # (θ - sin θ)/θ³ cancels near 0, where its series is exact.
    small = angle < 1e-2
    second = 1 / 6 - angle**2 / 120 if small else (angle - math.sin(angle)) / angle**3
    return np.asarray(np.eye(3) - first * cross + second * (cross @ cross))


def _spread(covariance: FloatArray) -> float:
    """Largest deviation about any axis, radians; infinite where it is not known."""
    if not np.isfinite(covariance).all():
        return math.inf
    return math.sqrt(max(float(np.linalg.eigvalsh(covariance)[-1]), 0.0))
