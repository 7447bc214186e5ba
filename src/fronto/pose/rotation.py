"""Rotations: the paper's three axes and signs, and SO(3) with its exponential map.

All angles are radians; degrees are converted at the public surface (paper, Eq. 6).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fronto.errors import InputError
from fronto.shapes import FloatArray, frozen_array

__all__ = [
    "angle_between",
    "angle_jacobian",
    "angles_deg",
    "angles_from_rotation",
    "angles_std_deg",
    "nearest_rotation",
    "rotation_exp",
    "rotation_from_angles",
    "rotation_log",
    "rotation_x",
    "rotation_y",
    "rotation_z",
]

#: Below this cos θ_y only θ_x ± θ_z is determined (gimbal lock).
GIMBAL_LOCK = 1e-9


def rotation_x(theta: float) -> FloatArray:
    """R_x(θ), shape (3, 3), θ in radians (paper, Eq. 3)."""
    c, s = np.cos(theta), np.sin(theta)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, s], [0.0, -s, c]])


def rotation_y(theta: float) -> FloatArray:
    """R_y(θ), shape (3, 3), θ in radians (paper, Eq. 4)."""
    c, s = np.cos(theta), np.sin(theta)
    return np.array([[c, 0.0, -s], [0.0, 1.0, 0.0], [s, 0.0, c]])


def rotation_z(theta: float) -> FloatArray:
    """R_z(θ), shape (3, 3), θ in radians (paper, Eq. 5)."""
    c, s = np.cos(theta), np.sin(theta)
    return np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]])


def rotation_from_angles(tx: float, ty: float, tz: float) -> FloatArray:
    """R(θ) = R_x R_y R_z, shape (3, 3), angles in radians (paper, after Eq. 6)."""
    return np.asarray(rotation_x(tx) @ rotation_y(ty) @ rotation_z(tz))


def angles_from_rotation(rotation: npt.ArrayLike) -> FloatArray:
    """θ_x, θ_y, θ_z of R = R_x R_y R_z, shape (3,), radians.

    θ_y lies in [-π/2, π/2], the others in [-π, π]. At θ_y = ±π/2 only θ_x ± θ_z is
    determined; θ_z is then 0, and the angles still reproduce the rotation.
    """
    r = np.asarray(rotation, dtype=np.float64)
    cos_y = np.hypot(r[0, 0], r[0, 1])
    tz = np.arctan2(r[0, 1], r[0, 0]) if cos_y > GIMBAL_LOCK else 0.0
    ty = np.arctan2(-r[0, 2], cos_y)
    # Taking θ_x from R R_zᵀ = R_x R_y instead of from r12 / r22 absorbs whatever error
    # θ_z has near the gimbal lock, so that the product of the three stays R.
    c, s = np.cos(tz), np.sin(tz)
    tx = np.arctan2(s * r[2, 0] - c * r[2, 1], c * r[1, 1] - s * r[1, 0])
    return np.array([tx, ty, tz])


def angle_jacobian(rotation: npt.ArrayLike) -> FloatArray:
    """d(θ_x, θ_y, θ_z)/dw for R ← R exp([w]×), shape (3, 3), radians per radian.

    Since R_x(θ) = exp(-θ [e_x]×) in the paper's signs, and so on, dw is
    -(Rᵀ e_x dθ_x + R_zᵀ e_y dθ_y + e_z dθ_z); this is its inverse. All NaN at gimbal
    lock (θ_y = ±π/2), where the angles are not differentiable.
    """
    _, ty, tz = angles_from_rotation(rotation)
    cos_y, tan_y = np.cos(ty), np.tan(ty)
    if cos_y <= GIMBAL_LOCK:
        return np.full((3, 3), np.nan)
    c, s = np.cos(tz), np.sin(tz)
    return np.array([[-c / cos_y, -s / cos_y, 0.0], [s, -c, 0.0], [-c * tan_y, -s * tan_y, -1.0]])


def angles_deg(rotation: npt.ArrayLike) -> tuple[float, float, float]:
    """`angles_from_rotation` in degrees, as results state them."""
    tx, ty, tz = np.degrees(angles_from_rotation(rotation))
    return float(tx), float(ty), float(tz)


def angles_std_deg(
    rotation: npt.ArrayLike, covariance: npt.ArrayLike
) -> tuple[float, float, float]:
    """Standard deviations of `angles_deg` from the covariance (3, 3) of w, rad²."""
    jacobian = angle_jacobian(rotation)
    variance = np.einsum("ij,jk,ik->i", jacobian, np.asarray(covariance), jacobian)
    sx, sy, sz = np.degrees(np.sqrt(np.maximum(variance, 0.0)))
    return float(sx), float(sy), float(sz)


def rotation_exp(vector: npt.ArrayLike) -> FloatArray:
    """exp([w]×) for a rotation vector w (3,), radians; shape (3, 3) (Rodrigues' formula)."""
    x, y, z = (float(value) for value in np.asarray(vector, dtype=np.float64))
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    angle = np.sqrt(x * x + y * y + z * z)
    # sin(θ)/θ and (1 - cos θ)/θ² without cancellation; NumPy's sinc has the π inside.
    first = np.sinc(angle / np.pi)
    second = 0.5 * np.sinc(angle / (2 * np.pi)) ** 2
    return np.asarray(np.eye(3) + first * cross + second * (cross @ cross))


def rotation_log(rotation: npt.ArrayLike) -> FloatArray:
    """Find the rotation vector w (3,) with exp([w]×) = R and ‖w‖ <= π, radians.

    Through the quaternion, taken from its largest component (Shepperd, "Quaternion from
    rotation matrix", J. Guidance and Control 1(3), 1978): accurate near 0 and near π.
    """
    r = np.asarray(rotation, dtype=np.float64)
    # 4 q qᵀ for q = (w, x, y, z): any row is q up to scale, the one of the largest
    # diagonal element without cancellation.
    d0, d1, d2 = r[0, 0], r[1, 1], r[2, 2]
    outer = np.array(
        [
            [1 + d0 + d1 + d2, r[2, 1] - r[1, 2], r[0, 2] - r[2, 0], r[1, 0] - r[0, 1]],
            [r[2, 1] - r[1, 2], 1 + d0 - d1 - d2, r[1, 0] + r[0, 1], r[0, 2] + r[2, 0]],
            [r[0, 2] - r[2, 0], r[1, 0] + r[0, 1], 1 - d0 + d1 - d2, r[2, 1] + r[1, 2]],
            [r[1, 0] - r[0, 1], r[0, 2] + r[2, 0], r[2, 1] + r[1, 2], 1 - d0 - d1 + d2],
        ]
    )
    q = outer[int(np.argmax(np.diag(outer)))]
    q = q / np.linalg.norm(q) * (1.0 if q[0] >= 0 else -1.0)
    sine = np.linalg.norm(q[1:])
    if sine == 0:
        return np.zeros(3)
    return np.asarray(2 * np.arctan2(sine, q[0]) * (q[1:] / sine))


def angle_between(first: npt.ArrayLike, second: npt.ArrayLike) -> float:
    """Angle of the rotation R₁ᵀ R₂, radians in [0, π], accurate near both ends."""
    r = np.asarray(first, dtype=np.float64).T @ np.asarray(second, dtype=np.float64)
    sine = np.sqrt((r[2, 1] - r[1, 2]) ** 2 + (r[0, 2] - r[2, 0]) ** 2 + (r[1, 0] - r[0, 1]) ** 2)
    return float(np.arctan2(sine, np.trace(r) - 1.0))


def nearest_rotation(matrix: npt.ArrayLike) -> FloatArray:
    """Find the rotation closest to a matrix (3, 3) in the Frobenius norm, shape (3, 3).

    U diag(1, 1, det U Vᵀ) Vᵀ of the singular value decomposition (Kabsch, "A solution for
    the best rotation to relate two sets of vectors", Acta Cryst. A32, 1976).

    Raises
    ------
    InputError
        If it is no finite 3x3 matrix, or has rank 0 or 1, where no rotation is closest.
    """
    array = frozen_array(matrix, (3, 3), "rotation")
    u, values, vt = np.linalg.svd(array)
    if values[1] <= 1e-12 * values[0]:
        raise InputError(
            "rotation", "expected a matrix near a rotation, got one of rank 0 or 1", "give R"
        )
    sign = np.sign(np.linalg.det(u) * np.linalg.det(vt))
    return np.asarray((u * [1.0, 1.0, sign]) @ vt)
