"""The plane of a circle from its image alone: two candidates, in closed form."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fronto.pose.criteria import check_matrix
from fronto.shapes import Ellipse, FloatArray

__all__ = ["circle_normals"]


def circle_normals(ellipse: Ellipse, matrix: npt.ArrayLike) -> FloatArray:
    """Two candidate normals of a circle's plane from its image.

    The rays to the ellipse form an elliptical cone dᵀ Q d = 0 with Q = Kᵀ C K and
    eigenvalues λ1 >= λ2 > 0 > λ3; two families of planes cut circles out of it, with the
    normals ±√((λ1-λ2)/(λ1-λ3)) e1 + √((λ2-λ3)/(λ1-λ3)) e3. They are each other's
    reflection about the cone's axis e3, which for a small circle is the ray to it, and
    coincide where the circle faces the camera. Roll and radius stay unknown.

    Source: Chen, Wu & Wada, "Camera calibration with two arbitrary coplanar circles",
    ECCV 2004, section 2.

    Parameters
    ----------
    ellipse
        The circle's image in pixels, free of lens distortion.
    matrix
        Shape (3, 3): the camera matrix K, pixels.

    Returns
    -------
    Shape (2, 3): unit normals in the camera frame, into the wall, the one with the larger
    z first. z is positive but for walls turned by more than 90° from the optical axis.

    Raises
    ------
    InputError
        If the matrix is no camera matrix.
    """
    inverse = np.linalg.inv(check_matrix(matrix))
    affine = inverse[:2, :2]
    center = affine @ ellipse.center + inverse[:2, 2]
    shape = affine @ ellipse.shape_matrix @ affine.T
    # (u - c)ᵀ S⁻¹ (u - c) = 1 as a symmetric form of rays (u, 1).
    part = np.linalg.inv(shape)
    cone = np.empty((3, 3))
    cone[:2, :2] = part
    cone[:2, 2] = cone[2, :2] = -part @ center
    cone[2, 2] = center @ part @ center - 1.0
    (negative, second, first), vectors = np.linalg.eigh(cone)
    axis = vectors[:, 0] * np.sign(vectors[2, 0])
    along = np.sqrt((second - negative) / (first - negative))
    across = np.sqrt((first - second) / (first - negative))
    normals = along * axis + across * np.stack([vectors[:, 2], -vectors[:, 2]])
    return np.asarray(normals[np.argsort(-normals[:, 2], kind="stable")])
