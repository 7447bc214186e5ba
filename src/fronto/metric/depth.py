"""The distance of a panel from depth images, and from single readings."""

from __future__ import annotations

from typing import Any

import numpy as np

from fronto.errors import InputError
from fronto.metric.depthimage import depth_samples
from fronto.metric.known import KnownLength
from fronto.metric.seen import Measured, Seen, UnfitLength, no_rays, refocused
from fronto.shapes import FloatArray

__all__ = ["by_depths", "by_distance"]

#: Of a depth or distance, relative, where nothing is stated.
DEPTH_STD = 0.01
#: Cosine between a ray and the panel's normal below which it does not meet the panel.
GRAZING = 0.05
#: Depth pixels on the panel: at least so many; these many beside each other err together.
MIN_DEPTHS, TOGETHER = 20, 100
#: Depths that are spread more than this, relative, are not of the panel's plane.
ROUGH = 0.1
#: From the median absolute deviation to a standard deviation.
MAD_STD = 1.4826


def by_depths(known: KnownLength, seen: Seen) -> Measured:
    """By the median over the buttons of what a depth image says, as of `measure`."""
    assert known.depth_image is not None
    pose = seen.pose
    corners = np.concatenate([pose.plane_corners, np.ones((*pose.plane_corners.shape[:2], 1))], 2)
    depths, rays = depth_samples(known.depth_image, pose.camera, corners @ pose.rotation)
    if len(depths) < MIN_DEPTHS:
        raise UnfitLength(
            "depth",
            f"expected depths on the panel, got {len(depths)} pixels with any",
            "give the distance or a pitch instead",
        )

    def log_distance(rotation: FloatArray, log_focal: float) -> float:
        return float(np.log(np.median(depths * (refocused(rays, log_focal) @ rotation[2]))))

    distances = depths * (rays @ pose.rotation[2])
    middle = float(np.median(distances))
    rough = MAD_STD * float(np.median(np.abs(distances - middle))) / middle
    if rough > ROUGH:
        raise UnfitLength(
            "depth",
            f"expected depths of one plane, got some that are spread by {100 * rough:.0f} %",
            "check that the depth image belongs to this photo",
        )
    # The median's deviation is √(π/2) of the mean's.
    sampled = np.pi / 2 * rough**2 / max(len(depths) / TOGETHER, 1.0)
    stated = DEPTH_STD if known.std_m is None else known.std_m / float(np.median(depths))
    basis = f"a depth image ({len(depths)} pixels on the panel)"
    return Measured(log_distance, no_rays(seen), stated**2 + sampled, basis)


def by_distance(known: KnownLength, seen: Seen) -> Measured:
    """A depth or distance at one pixel, or the distance of the plane itself."""
    if isinstance(known.distance_m, float):
        length = known.distance_m

        def given(rotation: FloatArray, log_focal: float) -> float:
            return float(np.log(length))

        stated = DEPTH_STD if known.std_m is None else known.std_m / length
        return Measured(given, no_rays(seen), stated**2, f"a distance of {length:g} m")
    reading: Any = known.depth_at if known.distance_m is None else known.distance_m
    x, y, length = reading
    camera, word = seen.pose.camera, "depth" if known.distance_m is None else "distance"
    if not (-0.5 <= x <= camera.width_px - 0.5 and -0.5 <= y <= camera.height_px - 0.5):
        raise InputError(
            word,
            f"expected a pixel in the photo of {camera.width_px}x{camera.height_px}, "
            f"got ({x:g}, {y:g})",
            "count from the middle of the top-left pixel",
        )
    ray = camera.rays(np.array([[x, y]]))[0]
    along = ray if known.distance_m is None else ray / np.linalg.norm(ray)
    if not float(seen.pose.rotation[2] @ ray) > GRAZING * float(np.linalg.norm(ray)):
        raise UnfitLength(
            word,
            f"expected a pixel on the panel's plane, got ({x:g}, {y:g}) beyond its horizon",
            "give one on the panel",
        )

    def log_distance(rotation: FloatArray, log_focal: float) -> float:
        return float(np.log(length * float(refocused(along, log_focal) @ rotation[2])))

    stated = DEPTH_STD if known.std_m is None else known.std_m / length
    basis = f"a {word} of {length:g} m at ({x:g}, {y:g})"
    return Measured(log_distance, no_rays(seen), stated**2, basis)
