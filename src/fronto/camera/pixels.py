"""Between pixels and normalised coordinates, by the camera matrix alone."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fronto.errors import InputError
from fronto.shapes import FloatArray

__all__ = ["as_points", "normalise", "to_pixels"]


def as_points(values: npt.ArrayLike, columns: int) -> FloatArray:
    """Copy points to a float64 array (n, columns).

    Raises
    ------
    InputError
        If they are no numbers or of another shape.
    """
    try:
        points = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError("points", f"expected numbers of shape (n, {columns})") from None
    if points.ndim != 2 or points.shape[1] != columns:
        raise InputError("points", f"expected shape (n, {columns}), got {points.shape}")
    return points


def normalise(points: FloatArray, matrix: FloatArray) -> FloatArray:
    """Pixels (n, 2) to normalised coordinates (n, 2), by K⁻¹ (3, 3)."""
    (fx, skew, cx), (_, fy, cy) = matrix[:2]
    y = (points[:, 1] - cy) / fy
    return np.stack([(points[:, 0] - cx - skew * y) / fx, y], axis=1)


def to_pixels(normalised: FloatArray, matrix: FloatArray) -> FloatArray:
    """Normalised coordinates (n, 2) to pixels (n, 2), by K (3, 3)."""
    (fx, skew, cx), (_, fy, cy) = matrix[:2]
    x, y = normalised.T
    return np.stack([fx * x + skew * y + cx, fy * y + cy], axis=1)
