"""The ellipse through points that lie on one, up to a little lens distortion."""

from __future__ import annotations

import numpy as np

from fronto.errors import InputError
from fronto.shapes import Ellipse, FloatArray

__all__ = ["fit_ellipse"]


def fit_ellipse(points: FloatArray) -> Ellipse:
    """Fit a conic by least squares of its algebraic distance.

    The smallest singular vector of the design matrix on centred and scaled points
    (Hartley and Zisserman, 2nd ed., Section 2.2.1 and Algorithm 4.2's normalisation).
    Meant for points without noise: it makes no attempt to undo the bias that noise brings.

    Parameters
    ----------
    points
        Shape (n, 2), n >= 5, pixels.

    Raises
    ------
    InputError
        If the points are too few or the conic is no ellipse.
    """
    if len(points) < 5:
        raise InputError("ellipse", f"expected at least 5 points to fit, got {len(points)}")
    middle = points.mean(axis=0)
    scale = float(np.abs(points - middle).max())
    x, y = ((points - middle) / scale).T
    design = np.stack([x * x, x * y, y * y, x, y, np.ones_like(x)], axis=1)
    a, b, c, d, e, f = np.linalg.svd(design)[2][-1]
    quadric = np.array([[a, b / 2], [b / 2, c]])
    if np.linalg.det(quadric) <= 0:
        raise InputError("ellipse", "expected points on an ellipse, they fit another conic")
    center = -np.linalg.solve(quadric, [d / 2, e / 2])
    level = float(center @ quadric @ center) - f
    shape = np.linalg.inv(quadric) * level
    return Ellipse.from_shape_matrix(middle + scale * center, scale**2 * shape)
