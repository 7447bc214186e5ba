"""What a way answers, and how right that is."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fronto import Camera
from fronto.evaluate import rotation_error_deg
from fronto.pose.criteria import cos_norm
from fronto.results import PanelPose
from scenes import Case, FloatArray


@dataclass(frozen=True, eq=False)
class Answer:
    """A rotation, or at least a homography, or neither.

    `rotation`: (3, 3), takes camera rays to the panel frame. `homography`: (3, 3), undistorted
    pixels of `camera` to the panel's plane, whatever its scale; None: that of the rotation.
    `ok`: whether the way itself calls the answer good (ways without a verdict always do).
    """

    camera: Camera
    rotation: FloatArray | None = None
    homography: FloatArray | None = None
    ok: bool = True
    reason: str = ""

    @classmethod
    def of(cls, pose: PanelPose, *, ok: bool | None = None) -> Answer:
        """A pose of fronto; `ok`: instead of its own verdict, where it has none."""
        reason = "; ".join(pose.reasons)
        if pose.status not in ("ok", "uncertain"):
            return cls(pose.camera, ok=False, reason=reason)
        return cls(pose.camera, pose.rotation, ok=bool(pose) if ok is None else ok, reason=reason)

    @property
    def answered(self) -> bool:
        return self.rotation is not None or self.homography is not None

    def rectified(self, points_px: FloatArray) -> FloatArray:
        """Pixels (..., 2) on the panel's plane."""
        H = self.homography
        if H is None:
            R = np.eye(3) if self.rotation is None else self.rotation
            H = R @ np.linalg.inv(self.camera.matrix)
        flat = self.camera.undistort_points(points_px.reshape(-1, 2))
        plane = np.concatenate([flat, np.ones((len(flat), 1))], axis=1) @ H.T
        return np.asarray((plane[:, :2] / plane[:, 2:]).reshape(points_px.shape))


def rotation_of(homography: FloatArray, camera: Camera) -> FloatArray:
    """The rotation whose axes point where a homography sends the panel's axes.

    The vanishing points of x and y are the homography's inverse of their directions; the
    nearest rotation to the two is taken (SVD).
    """
    axes = np.linalg.inv(camera.matrix) @ np.linalg.inv(homography)[:, :2]
    x, y = (axis / np.linalg.norm(axis) for axis in axes.T)
    # The panel is in front: x points right and y down.
    x, y = x * np.sign(x[0]), y * np.sign(y[1])
    U, _, Vt = np.linalg.svd(np.stack([x, y, np.cross(x, y)]))
    return np.asarray(U @ np.diag([1, 1, np.linalg.det(U @ Vt)]) @ Vt)


def judge(case: Case, answer: Answer) -> dict[str, float]:
    """Errors of an answer; a photo without one stays as it is, and is judged as that.

    rotation_deg: angle to the true rotation. edge_deg: mean angle by which the sides of the true
    buttons miss the axes. aspect: mean |ln| of the true squares' width over height. cos_true:
    ‖Cos‖₂ (the paper's Eq. 13) of the true corners.
    """
    R = np.eye(3) if answer.rotation is None else answer.rotation
    corners = answer.rectified(case.corners_px)
    across = np.stack([corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 3]])
    down = np.stack([corners[:, 3] - corners[:, 0], corners[:, 2] - corners[:, 1]])
    off = [np.arctan2(across[..., 1], across[..., 0]), np.arctan2(-down[..., 0], down[..., 1])]
    size = [np.hypot(*side.sum(axis=0).T) for side in (across, down)]
    wanted = np.array([b.width / b.height for b in case.layout.buttons])
    return {
        "rotation_deg": rotation_error_deg(R, case.rotation),
        "edge_deg": float(np.degrees(np.abs(off)).mean()),
        "aspect": float(np.abs(np.log(size[0] / size[1] / wanted)).mean()),
        "cos_true": float(cos_norm(corners)),
        "answered": float(answer.answered),
        "ok": float(answer.answered and answer.ok),
    }
