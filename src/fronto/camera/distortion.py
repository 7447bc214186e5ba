"""Lens distortion on normalised coordinates, both ways, NaN where a model does not reach.

Normalised coordinates are (x, y) of the ray (x, y, 1) in the camera frame. The models are
those of OpenCV's calib3d and fisheye modules: plumb_bob (Brown-Conrady, k1 k2 p1 p2 k3),
rational_polynomial (k1 k2 p1 p2 k3 k4 k5 k6, then thin prism s1..s4, then tilt τx τy) and
equidistant (Kannala and Brandt 2006, k1..k4).

Every model bends a point along its radius by t·N(t²)/D(t²) (t the radius or, equidistant,
the angle to the axis). Beyond the first turning point or pole of that profile two rays share
a pixel and the polynomial is only extrapolated: such points are answered with NaN.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.polynomial import polynomial

from fronto.shapes import FloatArray

__all__ = ["COUNTS", "DistortionModel", "distort", "undistort"]

DistortionModel = Literal["none", "plumb_bob", "rational_polynomial", "equidistant"]

#: How many coefficients each model takes.
COUNTS: dict[str, tuple[int, ...]] = {
    "none": (0,),
    "plumb_bob": (4, 5),
    "rational_polynomial": (8, 12, 14),
    "equidistant": (4,),
}

# A ray at 90 degrees meets the plane at depth 1 nowhere.
MAX_ANGLE = np.radians(89.9)
# A residual in normalised units: 1e-7 px at a focal length of 1000 px.
TOLERANCE = 1e-10
# Newton's method doubles the digits: after such a step it is at the last of them.
LAST_STEP = 1e-11


def distort(points: FloatArray, model: str, coefficients: FloatArray) -> FloatArray:
    """Where the lens images the rays (x, y, 1).

    Parameters
    ----------
    points
        Shape (n, 2), undistorted normalised coordinates.
    model
        One of `DistortionModel`.
    coefficients
        Shape (k,), in OpenCV's order.

    Returns
    -------
    Shape (n, 2), distorted normalised coordinates; NaN outside the model's validity.
    """
    if model == "none" or len(points) == 0:
        return points.copy()
    profile = Profile.of(model, coefficients)
    radius = np.hypot(points[:, 0], points[:, 1])
    if model == "equidistant":
        angle = np.arctan(radius)
        bent = _times(points, profile.value(angle), radius)
        bent[~(angle < profile.limit(MAX_ANGLE))] = np.nan
    else:
        with np.errstate(all="ignore"):  # overflow far outside, where the answer is NaN
            bent, jacobian = brown(points, profile, coefficients)
            valid = (radius < profile.limit(float(np.tan(MAX_ANGLE)))) & (
                _determinant(jacobian) > 0
            )
            bent = _map(tilt_matrix(coefficients), bent) if len(coefficients) == 14 else bent
        bent[~valid] = np.nan
    return bent


def undistort(points: FloatArray, model: str, coefficients: FloatArray) -> FloatArray:
    """Rays (x, y, 1) that the lens images at `points`: the inverse of `distort`.

    Parameters
    ----------
    points
        Shape (n, 2), distorted normalised coordinates.
    model
        One of `DistortionModel`.
    coefficients
        Shape (k,), in OpenCV's order.

    Returns
    -------
    Shape (n, 2), undistorted normalised coordinates; NaN where no ray within the model's
    validity is imaged at the point.
    """
    if model == "none" or len(points) == 0:
        return points.copy()
    profile = Profile.of(model, coefficients)
    if model == "equidistant":
        return _undistort_equidistant(points, profile)
    with np.errstate(all="ignore"):
        if len(coefficients) == 14:
            points = _map(
                np.asarray(np.linalg.inv(tilt_matrix(coefficients)), dtype=np.float64), points
            )
        return _undistort_brown(points, profile, coefficients)


@dataclass(frozen=True)
class Profile:
    """The radial profile t·N(t²)/D(t²), coefficients of N and D in rising powers of t²."""

    numerator: FloatArray
    denominator: FloatArray

    @classmethod
    def of(cls, model: str, k: FloatArray) -> Profile:
        """Build the profile of a model from its coefficients (k,)."""
        one = np.ones(1)
        if model == "equidistant":
            return cls(np.concatenate([one, k]), one)
        radial = np.concatenate([one, k[:2], k[4:5]])
        return cls(radial, np.concatenate([one, k[5:8]]))

    def gain(self, s: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Evaluate N/D and its derivative by s at s = t² (n,)."""
        n, d = polynomial.polyval(s, self.numerator), polynomial.polyval(s, self.denominator)
        by_n = polynomial.polyval(s, polynomial.polyder(self.numerator))
        by_d = polynomial.polyval(s, polynomial.polyder(self.denominator))
        return n / d, (by_n - n / d * by_d) / d

    def value(self, t: FloatArray) -> FloatArray:
        """Evaluate the profile at t (n,)."""
        return np.asarray(t * self.gain(t * t)[0])

    def limit(self, cap: float) -> float:
        """Find the first turning point or pole, at most `cap`."""
        nearest = cap
        for coefficients in (self._slope_numerator(), self.denominator):
            # The roots' reciprocals: the constant term is 1, the leading one may be tiny.
            roots = polynomial.polyroots(coefficients[::-1])
            real = roots.real[(np.abs(roots.imag) <= 1e-9 * np.abs(roots)) & (roots.real > 0)]
            nearest = min([nearest, *(1 / np.sqrt(real)).tolist()])
        return nearest

    def inverse(self, target: FloatArray, limit: float) -> FloatArray:
        """Find t in [0, limit] with value(t) = target (n,), by Newton's method in a bracket."""
        low, high = np.zeros_like(target), np.full_like(target, limit)
        t = np.minimum(target, 0.5 * limit)
        for _ in range(60):
            gain, change = self.gain(t * t)
            error = t * gain - target
            low, high = np.where(error <= 0, t, low), np.where(error > 0, t, high)
            newton = t - error / (gain + 2 * t * t * change)
            previous, middle = t, 0.5 * (low + high)
            t = np.where((newton >= low) & (newton <= high), newton, middle)
            if not (np.abs(t - previous) > LAST_STEP * (1 + t)).any():
                break
        return t

    def _slope_numerator(self) -> FloatArray:
        """N·D + 2s(N'·D − N·D'): the slope times D²."""
        n, d = self.numerator, self.denominator
        turn = polynomial.polysub(
            polynomial.polymul(polynomial.polyder(n), d),
            polynomial.polymul(n, polynomial.polyder(d)),
        )
        return np.asarray(
            polynomial.polyadd(polynomial.polymul(n, d), polynomial.polymul([0.0, 2.0], turn))
        )


def _times(points: FloatArray, length: FloatArray, radius: FloatArray) -> FloatArray:
    """`points` (n, 2) of the given `radius` (n,), stretched to the given length (n,)."""
    away = radius > 0
    factor = np.divide(length, radius, out=np.ones_like(radius), where=away)
    return points * factor[:, None]


def _undistort_equidistant(points: FloatArray, profile: Profile) -> FloatArray:
    radius = np.hypot(points[:, 0], points[:, 1])
    limit = profile.limit(MAX_ANGLE)
    with np.errstate(all="ignore"):
        angle = profile.inverse(radius, limit)
        found = np.abs(profile.value(angle) - radius) <= TOLERANCE * (1 + radius)
    straight = _times(points, np.tan(angle), radius)
    straight[~(found & (angle < limit))] = np.nan
    return straight


def _undistort_brown(points: FloatArray, profile: Profile, k: FloatArray) -> FloatArray:
    """Invert the radial part in one dimension, then Newton's method on the whole model."""
    radius = np.hypot(points[:, 0], points[:, 1])
    limit = profile.limit(float(np.tan(MAX_ANGLE)))
    # Kept off the limit: the Jacobian is singular there.
    start = np.minimum(profile.inverse(radius, limit), 0.999 * limit)
    straight = _times(points, start, radius)
    for _ in range(20):
        bent, jacobian = brown(straight, profile, k)
        step = _solve_2x2(jacobian, bent - points)
        straight = straight - step
        if not (np.abs(step) > LAST_STEP * (1 + np.abs(straight))).any():
            break
    bent, jacobian = brown(straight, profile, k)
    found = np.hypot(*(bent - points).T) <= TOLERANCE * (1 + radius)
    valid = np.hypot(*straight.T) < limit
    straight[~(found & valid & (_determinant(jacobian) > 0))] = np.nan
    return straight


def brown(
    points: FloatArray, profile: Profile, k: FloatArray
) -> tuple[FloatArray, tuple[FloatArray, FloatArray, FloatArray, FloatArray]]:
    """Bend points (n, 2) by the radial, tangential and thin prism terms, without the tilt.

    The equations of OpenCV's calib3d documentation (Brown 1971; Wang et al. 2008 for s1..s4).

    Returns
    -------
    The bent points (n, 2), and the derivatives ∂x'/∂x, ∂x'/∂y, ∂y'/∂x, ∂y'/∂y, each (n,).
    """
    x, y = points.T
    p1, p2 = k[2:4]
    s1, s2, s3, s4 = k[8:12] if len(k) >= 12 else np.zeros(4)
    s = x * x + y * y
    gain, change = profile.gain(s)
    bent = np.stack(
        [
            x * gain + 2 * p1 * x * y + p2 * (s + 2 * x * x) + (s1 + s2 * s) * s,
            y * gain + p1 * (s + 2 * y * y) + 2 * p2 * x * y + (s3 + s4 * s) * s,
        ],
        axis=1,
    )
    across = 2 * (x * y * change + p1 * x + p2 * y)
    prism_x, prism_y = 2 * (s1 + 2 * s2 * s), 2 * (s3 + 2 * s4 * s)
    return bent, (
        gain + 2 * x * x * change + 2 * p1 * y + 6 * p2 * x + prism_x * x,
        across + prism_x * y,
        across + prism_y * x,
        gain + 2 * y * y * change + 6 * p1 * y + 2 * p2 * x + prism_y * y,
    )


def tilt_matrix(k: FloatArray) -> FloatArray:
    """Homography (3, 3) onto a sensor tilted by τx, τy = k[12:14] (Louhichi et al. 2007)."""
    (cx, cy), (sx, sy) = np.cos(k[12:14]), np.sin(k[12:14])
    about_x = np.array([[1, 0, 0], [0, cx, sx], [0, -sx, cx]])
    about_y = np.array([[cy, 0, -sy], [0, 1, 0], [sy, 0, cy]])
    r = about_y @ about_x
    back = np.array([[r[2, 2], 0, -r[0, 2]], [0, r[2, 2], -r[1, 2]], [0, 0, 1]])
    return np.asarray(back @ r)


def _map(homography: FloatArray, points: FloatArray) -> FloatArray:
    mapped = points @ homography[:, :2].T + homography[:, 2]
    return np.asarray(mapped[:, :2] / mapped[:, 2:])


def _determinant(m: tuple[FloatArray, ...]) -> FloatArray:
    return m[0] * m[3] - m[1] * m[2]


def _solve_2x2(m: tuple[FloatArray, ...], v: FloatArray) -> FloatArray:
    x = m[3] * v[:, 0] - m[1] * v[:, 1]
    y = m[0] * v[:, 1] - m[2] * v[:, 0]
    return np.asarray(np.stack([x, y], axis=1) / _determinant(m)[:, None])
