"""What a pose tells of a panel, and a distance that follows from it: shared by all lengths."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fronto.errors import InputError
from fronto.pose.bundle import FOCAL
from fronto.pose.rotation import rotation_exp
from fronto.results import PanelPose
from fronto.shapes import FloatArray, Outline

__all__ = [
    "Measured",
    "Seen",
    "UnfitLength",
    "linear",
    "no_rays",
    "on_plane",
    "plane_jacobian",
    "ray_variance",
    "refocused",
    "turned",
]

#: Step of numerical derivatives, radians.
STEP = 1e-5


class UnfitLength(InputError):
    """A known length that does not apply to this panel; it may well to others."""


@dataclass(frozen=True, eq=False)
class Seen:
    """What a pose says, as the rays from the camera to the buttons.

    Parameters
    ----------
    pose
        The pose.
    outlines
        One for each button, where they are known.
    rays
        Shape (n, 3): from the camera to the buttons' centres, at depth 1.
    ray_std
        Shape (n,): standard deviation of the first two coordinates.
    usable
        Shape (n,): which buttons fit the others.
    """

    pose: PanelPose
    outlines: tuple[Outline, ...] | None
    rays: FloatArray
    ray_std: FloatArray
    usable: npt.NDArray[np.bool_]

    @property
    def centers(self) -> FloatArray:
        """The buttons' centres on the plane z = 1 of the panel frame, (n, 2)."""
        return np.asarray(self.pose.plane_corners.mean(axis=1))

    @property
    def sizes(self) -> FloatArray:
        """Width and height there, (n, 2)."""
        c = self.pose.plane_corners
        across = 0.5 * (c[:, 1] - c[:, 0] + c[:, 2] - c[:, 3])
        down = 0.5 * (c[:, 3] - c[:, 0] + c[:, 2] - c[:, 1])
        return np.stack([np.hypot(*across.T), np.hypot(*down.T)], axis=1)

    @property
    def covariance(self) -> FloatArray:
        """Of w (R·exp([w]x)) and ln f, (4, 4)."""
        result = np.zeros((4, 4))
        result[:3, :3] = self.pose.covariance
        result[FOCAL, FOCAL] = self.pose.focal_std**2
        return result


#: Logarithm of the plane's distance in metres by rotation (3, 3) and ln(f/f0).
LogDistance = Callable[[FloatArray, float], float]


@dataclass(frozen=True, eq=False)
class Measured:
    """The distance from the camera to the panel's plane.

    Parameters
    ----------
    log_distance
        Its logarithm as it follows from the rotation and ln(f/f0).
    ray_gradient
        Shape (n, 2): derivative of that by the first two coordinates of the buttons' rays.
    variance
        Of that logarithm, apart from what rotation, focal length and rays contribute.
    basis
        What it rests on, in words.
    notes
        Remarks.
    """

    log_distance: LogDistance
    ray_gradient: FloatArray
    variance: float
    basis: str
    notes: tuple[str, ...] = ()

    def gradient(self, rotation: FloatArray) -> FloatArray:
        """Derivative of the logarithm by w and ln f, (4,)."""
        ahead, behind = (
            np.array([self.log_distance(*turned(rotation, k, step)) for k in range(4)])
            for step in (STEP, -STEP)
        )
        return np.asarray((ahead - behind) / (2 * STEP))


def turned(rotation: FloatArray, k: int, step: float) -> tuple[FloatArray, float]:
    """The rotation turned about the camera's axis k, or for k = 3 the focal length changed."""
    if k == FOCAL:
        return rotation, step
    return rotation @ rotation_exp(step * np.eye(3)[k]), 0.0


def plane_jacobian(rays: FloatArray, rotation: FloatArray) -> FloatArray:
    """Derivative of points on the plane z = 1 by their rays' first two coordinates, (n, 2, 2)."""
    u = rays @ rotation.T
    xy = u[:, :2] / u[:, 2:]
    derivative = rotation[:2, :2] - xy[:, :, None] * rotation[2, :2]
    return np.asarray(derivative / u[:, 2, None, None])


def refocused(rays: FloatArray, log_focal: float) -> FloatArray:
    """Rays (..., 3) at depth 1 as a camera with another focal length, by ln(f/f0), has them."""
    scale = np.exp(-log_focal)
    return np.asarray(rays * np.array([scale, scale, 1.0]))


def on_plane(rays: FloatArray, rotation: FloatArray, log_focal: float) -> FloatArray:
    """Where rays (..., 3) meet the plane z = 1 of the panel frame, (..., 2)."""
    u = refocused(rays, log_focal) @ rotation.T
    return np.asarray(u[..., :2] / u[..., 2:])


def no_rays(seen: Seen) -> FloatArray:
    """Of a distance that does not hang on where the buttons' centres are: zeros (n, 2)."""
    return np.zeros((len(seen.rays), 2))


def linear(seen: Seen, coefficients: FloatArray, length_m: float) -> Measured:
    """The distance by a length that is a linear function of the buttons' centres.

    Parameters
    ----------
    seen
        The pose and its rays.
    coefficients
        Shape (n, 2): the length is the sum of their products with the centres.
    length_m
        What it is in metres.
    """
    used = np.flatnonzero(coefficients.any(axis=1))
    some, rays = coefficients[used], seen.rays[used]

    def log_distance(rotation: FloatArray, log_focal: float) -> float:
        length = float((some * on_plane(rays, rotation, log_focal)).sum())
        return float(np.log(length_m / length))

    seen_length = length_m / np.exp(log_distance(seen.pose.rotation, 0.0))
    gradient = no_rays(seen)
    slopes = plane_jacobian(rays, seen.pose.rotation)
    gradient[used] = -np.einsum("na,nab->nb", some, slopes) / seen_length
    return Measured(log_distance, gradient, 0.0, "")


def ray_variance(part: Measured, seen: Seen) -> float:
    """What the rays contribute to the variance of the distance's logarithm."""
    return float((seen.ray_std[:, None] ** 2 * part.ray_gradient**2).sum())
