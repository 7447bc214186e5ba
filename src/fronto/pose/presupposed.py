"""The presupposed standard panel of the paper (Fig. 4), and placing corners on it.

U are the corners of an upright column of square buttons seen head-on, E their rays.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
import numpy.typing as npt

from fronto.errors import InputError
from fronto.pose.criteria import check_matrix
from fronto.shapes import FloatArray, frozen_array

__all__ = ["Layout", "place_on", "presupposed_corners", "project_to_image", "translation"]

#: The two kinds of Fig. 4, top to bottom.
Layout = Literal["up_down", "up_down_keyhole"]

_BUTTONS: dict[str, int] = {"up_down": 2, "up_down_keyhole": 3}


def presupposed_corners(
    layout: Layout = "up_down",
    width_px: int = 640,
    height_px: int = 480,
    *,
    side_px: float | None = None,
    pitch_px: float | None = None,
) -> FloatArray:
    """U: corners of a head-on column of square buttons centred in the image (Fig. 4).

    Parameters
    ----------
    layout
        "up_down" (two buttons) or "up_down_keyhole" (three).
    width_px, height_px
        Size of the image; its centre is ((width - 1)/2, (height - 1)/2).
    side_px
        Side of a button; an eighth of the image's shorter side if not given (the paper
        prints no size).
    pitch_px
        From one button's centre to the next; 1.5 sides if not given.

    Returns
    -------
    Shape (b, 4, 2), pixels, corners in the paper's order (Fig. 3).

    Raises
    ------
    InputError
        If the layout is unknown, a size is not positive, the buttons overlap, or the
        column does not fit into the image.
    """
    if layout not in _BUTTONS:
        raise InputError("layout", f'expected "up_down" or "up_down_keyhole", got {layout!r}')
    count = _BUTTONS[layout]
    side = min(width_px, height_px) / 8 if side_px is None else side_px
    pitch = 1.5 * side if pitch_px is None else pitch_px
    if not (np.isfinite([side, pitch]).all() and pitch >= side > 0):
        raise InputError(
            "presupposed panel",
            f"expected pitch_px >= side_px > 0, got pitch_px={pitch}, side_px={side}",
        )
    if side > width_px or pitch * (count - 1) + side > height_px:
        raise InputError(
            "presupposed panel",
            f"expected a column of {count} buttons within {width_px}x{height_px} pixels, "
            f"got side_px={side}, pitch_px={pitch}",
            "give a smaller side_px or pitch_px",
        )
    square = side / 2 * np.array([[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]])
    centers = np.empty((count, 1, 2))
    centers[:, 0, 0] = (width_px - 1) / 2
    centers[:, 0, 1] = (height_px - 1) / 2 + pitch * (np.arange(count) - (count - 1) / 2)
    return frozen_array(centers + square, (count, 4, 2), "presupposed corners")


def translation(standard: npt.ArrayLike, detected: npt.ArrayLike) -> FloatArray:
    """T = e₁ - d₁, shape (3,): between the first corners (paper, after Eq. 7).

    Parameters
    ----------
    standard
        E, shape (3, n): rays of the presupposed corners.
    detected
        D (or M, for the reading that rotates first), shape (3, n).
    """
    e, d = np.asarray(standard, dtype=np.float64), np.asarray(detected, dtype=np.float64)
    return np.asarray(e[:, 0] - d[:, 0])


def project_to_image(points: npt.ArrayLike, matrix: npt.ArrayLike) -> FloatArray:
    """G, shape (n, 2), pixels: the first two rows of Ĝ = M_int P, P of shape (3, n) (Eq. 18).

    Raises
    ------
    InputError
        If the matrix is no intrinsic matrix.
    """
    homogeneous = check_matrix(matrix) @ np.asarray(points, dtype=np.float64)
    return np.asarray(homogeneous[:2].T)


def place_on(
    standard: npt.ArrayLike, rectified: npt.ArrayLike, *, rotate: bool = False
) -> FloatArray:
    """Find the similarity that places rectified corners on presupposed ones, least squares.

    This is where a translation belongs: after the division by the third row it shifts and
    scales the view and leaves every slope and angle alone. (Closed form: Umeyama,
    "Least-squares estimation of transformation parameters between two point patterns",
    IEEE TPAMI 13(4), 1991.)

    Parameters
    ----------
    standard
        Shape (n, 2): where the corners should be.
    rectified
        Shape (n, 2): where they are.
    rotate
        Let it turn in the image plane too.

    Returns
    -------
    A, shape (3, 3), homogeneous: A (x, y, 1) is close to the standard corner.

    Raises
    ------
    InputError
        If the shapes differ, fewer than two points are given, the rectified corners
        coincide, or only a mirrored or vanishing copy would fit.
    """
    target = frozen_array(standard, (-1, 2), "standard corners")
    source = frozen_array(rectified, (-1, 2), "rectified corners")
    if len(target) != len(source) or len(source) < 2:
        raise InputError(
            "rectified corners",
            f"expected as many as standard corners and at least 2, "
            f"got {len(source)} and {len(target)}",
        )
    middle, target_middle = source.mean(axis=0), target.mean(axis=0)
    x, y = (source - middle).T
    u, v = (target - target_middle).T
    extent = float(x @ x + y @ y)
    if extent == 0.0:
        raise InputError("rectified corners", "expected different points, got coinciding ones")
    along = float(x @ u + y @ v) / extent
    across = float(x @ v - y @ u) / extent if rotate else 0.0
    scale = float(np.hypot(along, across))
    if not (along > 0 or rotate) or scale <= 1e-12 * np.sqrt((u @ u + v @ v) / extent):
        raise InputError(
            "rectified corners",
            "expected corners in the order of the standard ones, got ones that fit no upright copy",
            "give both in the same order, or rotate=True for a turned panel",
        )
    linear = np.array([[along, -across], [across, along]])
    matrix = np.eye(3)
    matrix[:2, :2] = linear
    matrix[:2, 2] = target_middle - linear @ middle
    return matrix
