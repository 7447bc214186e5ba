"""Buttons' centres in the camera frame, and how sure they are."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fronto.metric.seen import STEP, Measured, Seen, plane_jacobian, refocused, turned
from fronto.pose.structure import ALIGN_GAP, ALIGN_STD, chains
from fronto.shapes import FloatArray

__all__ = ["camera_centers"]

#: Where a camera is not calibrated its principal point is taken for the photo's middle: an
#: assumed standard deviation of that, in longer sides of the photo.
PRINCIPAL_STD = 0.01
#: How far buttons of a row are from where it is, in widths: 0.1 mm of 30.
OFF_ROW = 0.003
CALIBRATED = ("given", "file")


def camera_centers(
    seen: Seen, measured: Measured, members: npt.NDArray[np.intp]
) -> tuple[FloatArray, FloatArray]:
    """Centres of buttons, and their covariances.

    The centre X = D d / (n·d) moves with the rotation and the focal length, which are
    differentiated numerically; with the distance D; and with its own ray d.

    Parameters
    ----------
    seen
        The pose and its rays.
    measured
        The plane's distance D.
    members
        Shape (k,): indices of the buttons.

    Returns
    -------
    Centres (k, 3), metres, camera frame, and covariances (k, 3, 3), m².
    """
    rotation = seen.pose.rotation
    rays = seen.rays[members]

    def centers(turn: FloatArray, log_focal: float) -> FloatArray:
        directions = refocused(rays, log_focal)
        distance = np.exp(measured.log_distance(turn, log_focal))
        return np.asarray(distance * directions / (directions @ turn[2])[:, None])

    here = centers(rotation, 0.0)
    ahead, behind = (
        np.stack([centers(*turned(rotation, k, step)) for k in range(4)], axis=2)
        for step in (STEP, -STEP)
    )
    common = (ahead - behind) / (2 * STEP)
    covariance = common @ seen.covariance @ common.transpose(0, 2, 1)

    distance = float(np.exp(measured.log_distance(rotation, 0.0)))
    on_plane = _plane_deviations(seen)[members]
    across = distance * rotation[:2].T @ on_plane
    # A ray moves its own button in the plane, and the plane with all of them.
    moved = seen.ray_std[:, None] * measured.ray_gradient
    total = float((moved**2).sum())
    own = across + here[:, :, None] * moved[members, None]
    covariance += own @ own.transpose(0, 2, 1)
    plane = measured.variance + total - (moved[members] ** 2).sum(axis=1)
    covariance += plane[:, None, None] * here[:, :, None] * here[:, None, :]

    camera = seen.pose.camera
    if camera.source not in CALIBRATED:
        offset = PRINCIPAL_STD * max(camera.width_px, camera.height_px) / camera.focal_px
        sideways = np.diag([1.0, 1.0, 0.0])
        covariance += (here[:, 2, None, None] * offset) ** 2 * sideways
    return here, covariance


def _plane_deviations(seen: Seen) -> FloatArray:
    """By how much a deviation of each ray's coordinates moves the centre on the plane, (n, 2, 2).

    Centres in a row or column that lines up have been fitted together, which leaves less of
    their noise: the posterior of a normal prior about a common line, and how far real buttons
    are off it. Rows that do not line up, or were not fitted so, give themselves away by their
    scatter.
    """
    plane = plane_jacobian(np.nan_to_num(seen.rays), seen.pose.rotation)
    plane = seen.ray_std[:, None, None] * plane
    std = np.linalg.norm(plane, axis=2)
    usable = np.flatnonzero(seen.usable)
    if not len(usable):
        return plane
    width = float(np.median(seen.sizes[usable, 0]))
    tie = (ALIGN_STD * width) ** 2 / 2
    share = np.ones_like(std)
    for axis in range(2):
        across = seen.centers[usable, axis]
        lines = chains(across, ALIGN_GAP * width)
        mates = np.bincount(lines)
        mean = np.bincount(lines, across) / mates
        freedom = len(usable) - len(mates)
        if freedom == 0:
            continue
        noise = std[usable, axis] ** 2
        scatter = float(((across - mean[lines]) ** 2).sum()) / freedom
        kept = noise / (noise + tie)
        fitted = noise * (1 - kept) + kept**2 * (noise + tie) / mates[lines]
        fitted += kept**2 * (OFF_ROW * width) ** 2
        seen_left = np.minimum(noise, scatter + noise / mates[lines])
        left = np.where(mates[lines] > 1, np.maximum(fitted, seen_left), noise)
        share[usable, axis] = np.sqrt(np.minimum(left / noise, 1.0))
    return np.asarray(share[:, :, None] * plane)
