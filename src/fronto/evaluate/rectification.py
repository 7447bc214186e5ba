"""How well the perspective was removed, judged by what is known to be true.

‖Cos‖₂ of the detected corners (the paper's figure) rewards overfitting them; these do not
look at the detected corners at all.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fronto.pose.rotation import angle_between
from fronto.results import PanelPose
from fronto.shapes import FloatArray

__all__ = ["aspect_errors", "axis_angles_deg", "edge_angles_deg", "rotation_error_deg"]


def rotation_error_deg(rotation: npt.ArrayLike, truth: npt.ArrayLike) -> float:
    """Angle between two rotations (3, 3), degrees."""
    first, second = (np.asarray(item, dtype=np.float64) for item in (rotation, truth))
    return float(np.degrees(angle_between(first, second)))


def rectified_points(pose: PanelPose, points_px: npt.ArrayLike) -> FloatArray:
    """Photo pixels (..., 2) on the panel's plane at depth 1, (..., 2)."""
    points = np.asarray(points_px, dtype=np.float64)
    flat = pose.camera.undistort_points(points.reshape(-1, 2))
    rays = np.concatenate([flat, np.ones((len(flat), 1))], axis=1)
    plane = rays @ np.linalg.inv(pose.camera.matrix).T @ pose.rotation.T
    return np.asarray((plane[:, :2] / plane[:, 2:]).reshape(points.shape))


def axis_angles_deg(
    pose: PanelPose, horizontal: npt.ArrayLike, vertical: npt.ArrayLike
) -> FloatArray:
    """Signed angles by which known segments miss the panel's axes after rectification.

    Parameters
    ----------
    horizontal, vertical
        (h, 4) and (v, 4): x1 y1 x2 y2 in the photo, truly horizontal or vertical on the
        wall.

    Returns
    -------
    (h + v,) in degrees, within ±90.
    """
    result = []
    for segments, right_angle in ((horizontal, 0.0), (vertical, 90.0)):
        ends = np.asarray(segments, dtype=np.float64).reshape(-1, 2, 2)
        if not len(ends):
            continue
        plane = rectified_points(pose, ends)
        x, y = (plane[:, 1] - plane[:, 0]).T
        result.append((np.degrees(np.arctan2(y, x)) - right_angle + 90.0) % 180.0 - 90.0)
    return np.concatenate(result) if result else np.zeros(0)


def edge_angles_deg(pose: PanelPose, corners_px: npt.ArrayLike) -> FloatArray:
    """Angles by which the sides of true quads (n, 4, 2) miss the axes, (4 n,), degrees."""
    corners = np.asarray(corners_px, dtype=np.float64)
    a, b, c, d = (corners[:, k] for k in range(4))
    horizontal = np.concatenate([np.hstack([a, b]), np.hstack([d, c])])
    vertical = np.concatenate([np.hstack([a, d]), np.hstack([b, c])])
    return axis_angles_deg(pose, horizontal, vertical)


def aspect_errors(pose: PanelPose, corners_px: npt.ArrayLike, aspect: npt.ArrayLike) -> FloatArray:
    """Ln of the rectified width/height of true quads (n, 4, 2) over the true one, (n,)."""
    plane = rectified_points(pose, corners_px)
    across = plane[:, 1] - plane[:, 0] + plane[:, 2] - plane[:, 3]
    down = plane[:, 3] - plane[:, 0] + plane[:, 2] - plane[:, 1]
    ratio = np.hypot(*across.T) / np.hypot(*down.T)
    return np.asarray(np.log(ratio / np.asarray(aspect, dtype=np.float64)))
