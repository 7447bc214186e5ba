"""The paper's criteria of a head-on view (Section IV, Eqs. 1, 2 and 7-17), in plain NumPy.

The reference that ``fronto.pose.grid``'s compiled search is tested against: small, and in
the paper's letters. Points are columns: D, M, P have shape (3, 4 b) for b buttons of four
corners each, in the paper's order (top-left, top-right, bottom-right, bottom-left).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from fronto.errors import InputError
from fronto.shapes import FloatArray, frozen_array

__all__ = [
    "Criteria",
    "Criterion",
    "back_project",
    "check_matrix",
    "cos_norm",
    "cosines",
    "dehomogenise",
    "evaluate",
    "final_cr",
    "k_rv",
    "normalise",
    "rotate",
    "slopes_horizontal",
    "slopes_vertical",
    "two_norm",
]

#: How the vertical slopes become a number that is 0 on a head-on view: "paper" is the
#: printed 1/‖K_V‖ (Eq. 11), "inverse" is ‖1/k_v‖, which Eq. 2 asks to be 0.
Criterion = Literal["inverse", "paper"]


@dataclass(frozen=True)
class Criteria:
    """‖K_H‖₂, K_rV and ‖Cos‖₂ of one rotation (or the least and largest of many).

    Parameters
    ----------
    k_h
        ‖K_H‖₂, Eq. 9.
    k_rv
        K_rV, Eq. 11, in either reading.
    cos
        ‖Cos‖₂, Eq. 13.
    """

    k_h: float
    k_rv: float
    cos: float


def check_matrix(matrix: npt.ArrayLike) -> FloatArray:
    """M_int as a read-only array (3, 3), if rays can be made with it.

    Raises
    ------
    InputError
        If it is no finite 3x3 matrix, not invertible, or its last row is not (0, 0, 1).
    """
    array = frozen_array(matrix, (3, 3), "camera matrix")
    fx, fy = array[0, 0], array[1, 1]
    if (array[2] != (0.0, 0.0, 1.0)).any() or array[1, 0] != 0.0 or not (fx > 0 and fy > 0):
        raise InputError(
            "camera matrix",
            f"expected [[fx, s, cx], [0, fy, cy], [0, 0, 1]] with fx, fy > 0, got {array.tolist()}",
            "give the intrinsic matrix in pixels",
        )
    return array


def back_project(corners_px: npt.ArrayLike, matrix: npt.ArrayLike) -> FloatArray:
    """D = M_int⁻¹ Ĉ, shape (3, n), of pixels (n, 2) (Eq. 1); Ĉ appends the row of ones.

    For presupposed corners U it gives E.

    Raises
    ------
    InputError
        If the corners are no finite (n, 2) or the matrix is no intrinsic matrix.
    """
    corners = frozen_array(corners_px, (-1, 2), "corners")
    homogeneous = np.vstack([corners.T, np.ones(len(corners))])
    return np.asarray(np.linalg.solve(check_matrix(matrix), homogeneous))


def rotate(rotation: npt.ArrayLike, rays: npt.ArrayLike) -> FloatArray:
    """M = R(θ) D, shape (3, n) (Eq. 7)."""
    return np.asarray(np.asarray(rotation, dtype=np.float64) @ np.asarray(rays, dtype=np.float64))


def dehomogenise(points: npt.ArrayLike) -> FloatArray:
    """P / P[3], shape (3, n): the points on the plane at depth 1 (Eq. 7).

    Raises
    ------
    InputError
        If a point is not in front of the camera (third row <= 0), where the division
        would mirror it.
    """
    array = np.asarray(points, dtype=np.float64)
    if not (array[2] > 0).all():
        raise InputError("points", "expected points in front of the camera (third row > 0)")
    return np.asarray(array / array[2])


def slopes_horizontal(points: npt.ArrayLike) -> FloatArray:
    """K_H, shape (b,): (y2 - y1) / (x2 - x1) of each button (Eq. 8); ±inf where x2 = x1."""
    one, two, _ = _corners_124(points)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray((two[1] - one[1]) / (two[0] - one[0]))


def slopes_vertical(points: npt.ArrayLike) -> FloatArray:
    """K_V, shape (b,): (y4 - y1) / (x4 - x1) of each button (Eq. 10); ±inf where x4 = x1."""
    one, _, four = _corners_124(points)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray((four[1] - one[1]) / (four[0] - one[0]))


def cosines(points: npt.ArrayLike) -> FloatArray:
    """Cos, shape (b,): h·v / (‖h‖ ‖v‖) of each button's sides at corner 1, in 3-D (Eq. 12)."""
    one, two, four = _corners_124(points)
    h, v = two - one, four - one
    lengths = np.sqrt((h * h).sum(axis=0) * (v * v).sum(axis=0))
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.asarray((h * v).sum(axis=0) / lengths)


def two_norm(values: npt.ArrayLike) -> float:
    """‖·‖₂ of a row of values, one a button (Eqs. 9, 11, 13)."""
    return float(np.linalg.norm(np.asarray(values, dtype=np.float64)))


def k_rv(slopes: npt.ArrayLike, criterion: Criterion = "inverse") -> float:
    """K_rV of the vertical slopes k_v (b,).

    "paper" is 1/‖K_V‖₂ as printed (Eq. 11). It is 0 as soon as one button is upright,
    whatever the others do: slopes (1e9, 2) give 1e-9 with one edge 26.6° off. "inverse"
    is ‖1/k_v‖₂, 0 only if all are upright, as Eq. 2 wants. Infinite slopes count as 0.
    """
    values = np.asarray(slopes, dtype=np.float64)
    with np.errstate(divide="ignore"):
        if criterion == "paper":
            return float(np.divide(1.0, np.linalg.norm(values)))
        return two_norm(1.0 / values)


def evaluate(points: npt.ArrayLike, criterion: Criterion = "inverse") -> Criteria:
    """Evaluate the three criteria of points P (3, 4 b) (Eqs. 8-13)."""
    return Criteria(
        k_h=two_norm(slopes_horizontal(points)),
        k_rv=k_rv(slopes_vertical(points), criterion),
        cos=two_norm(cosines(points)),
    )


def normalise(value: float, minimum: float, maximum: float) -> float:
    """Min-max normalisation of one criterion (Eqs. 14-16).

    0 for a criterion that is the same everywhere, where the printed formula is 0/0.
    """
    span = maximum - minimum
    return (value - minimum) / (span if span > 0 else 1.0)


def final_cr(criteria: Criteria, minima: Criteria, maxima: Criteria) -> float:
    """Add up the normalised criteria to the Final CR (Eq. 17)."""
    return (
        normalise(criteria.k_h, minima.k_h, maxima.k_h)
        + normalise(criteria.k_rv, minima.k_rv, maxima.k_rv)
        + normalise(criteria.cos, minima.cos, maxima.cos)
    )


def cos_norm(plane_corners: npt.ArrayLike) -> float:
    """‖Cos‖₂, the paper's accuracy figure (Eq. 13), of corners on the plane z = 1.

    Parameters
    ----------
    plane_corners
        Shape (n, 4, 2), any unit, corners in the paper's order.

    Notes
    -----
    It is small for overfitted corners too: report it, do not judge a pose by it.

    Raises
    ------
    InputError
        If the corners are no finite (n, 4, 2).
    """
    corners = frozen_array(plane_corners, (-1, 4, 2), "plane corners").reshape(-1, 2)
    return two_norm(cosines(corners.T))  # all have z = 1, so the sides have z = 0


def _corners_124(points: npt.ArrayLike) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Corners 1, 2 and 4 of each button, each of shape (3, b) (or (2, b))."""
    array = np.asarray(points, dtype=np.float64)
    return array[:, 0::4], array[:, 1::4], array[:, 3::4]
