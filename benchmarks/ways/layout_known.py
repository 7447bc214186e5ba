"""(e) The layout known: `cv2.solvePnP` (IPPE) with the true corners in metres, an upper bound.

Collins and Bartoli, "Infinitesimal Plane-Based Pose Estimation", IJCV 109, 2014, in OpenCV's
implementation. The corners in the photo are fronto's, and so is whatever they are off: the bound
is one of what the corners can tell.
"""

from __future__ import annotations

import cv2
import numpy as np

from scenes import Case, FloatArray
from ways.answer import Answer


def _matched(case: Case) -> dict[int, FloatArray]:
    """Corners (4, 2) of the quad about each true button's centre: at most half a button off."""
    centers = case.corners_px.mean(axis=1)
    half = np.linalg.norm(np.diff(case.corners_px, axis=1), axis=2).mean(axis=1) / 2
    best: dict[int, tuple[float, FloatArray]] = {}
    for quad in case.quads:
        assert quad.corners_px is not None
        off = np.linalg.norm(centers - quad.corners_px.mean(axis=0), axis=1)
        k = int(off.argmin())
        if off[k] < half[k] and off[k] < best.get(k, (np.inf,))[0]:
            best[k] = float(off[k]), quad.corners_px
    return {k: corners for k, (_, corners) in best.items()}


def layout_known(case: Case) -> Answer:
    """All matched corners at once, from one button on."""
    found = _matched(case)
    if not found:
        return Answer(case.camera, reason="no corners of a known button")
    corners = case.layout.corners[list(found)].reshape(-1, 2)
    points = np.concatenate([corners, np.zeros((len(corners), 1))], axis=1)
    seen = case.camera.undistort_points(np.concatenate(list(found.values())))
    matrix = np.array(case.camera.matrix)
    poses = []
    # A plane has two poses that look alike: both are refined, the better one is taken.
    _, turns, shifts, _ = cv2.solvePnPGeneric(points, seen, matrix, None, flags=cv2.SOLVEPNP_IPPE)
    for pose in zip(turns, shifts, strict=True):
        turn, shift = cv2.solvePnPRefineLM(points, seen, matrix, None, *pose)
        off = cv2.projectPoints(points, turn, shift, matrix, None)[0].reshape(-1, 2) - seen
        poses.append((float((off**2).sum()), turn))
    turn = min(poses, key=lambda pose: pose[0])[1]
    # OpenCV's rotation takes the panel's frame to the camera's.
    return Answer(case.camera, np.asarray(cv2.Rodrigues(turn)[0].T))
