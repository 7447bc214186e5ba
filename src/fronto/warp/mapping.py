"""Positions between photo and rectified view, both ways, lens distortion included."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from fronto.errors import InputError
from fronto.results import RectifiedView
from fronto.shapes import Ellipse, FloatArray, frozen_array
from fronto.warp.polygon import apply_homography

if TYPE_CHECKING:
    from fronto.camera import Camera

__all__ = ["map_box", "map_ellipse", "map_points"]

#: Points that stand for an ellipse where the lens makes its image something else.
ELLIPSE_POINTS = 64


def map_points(
    view: RectifiedView | FloatArray, points_px: npt.ArrayLike, *, inverse: bool = False
) -> FloatArray:
    """Photo pixels to rectified pixels, or back.

    Parameters
    ----------
    view
        The rectified view; or a bare homography (3, 3), photo to rectified and w > 0 in
        front of the horizon, of a camera without distortion.
    points_px
        Shape (n, 2).
    inverse
        From rectified pixels to photo pixels.

    Returns
    -------
    Shape (n, 2). NaN for points on or behind the panel's horizon, and for those that the
    lens model does not reach. Points outside the pictures are mapped as well.

    Raises
    ------
    InputError
        If the points are not (n, 2) numbers, or the homography is not (3, 3).
    """
    matrix, camera = _matrix_and_camera(view)
    points = _points(points_px)
    if inverse:
        mapped, _ = apply_homography(_inverse(matrix), points)
        return mapped if camera is None else camera.distort_points(mapped)
    straight = points if camera is None else camera.undistort_points(points)
    return apply_homography(matrix, straight)[0]


def map_box(
    view: RectifiedView | FloatArray,
    box_px: Sequence[float] | FloatArray,
    *,
    inverse: bool = False,
) -> FloatArray:
    """Map the four corners of a box x0, y0, x1, y1 like points.

    Returns
    -------
    Shape (4, 2): top-left, top-right, bottom-right, bottom-left of the box.

    Raises
    ------
    InputError
        If the box is not four finite numbers.
    """
    x0, y0, x1, y1 = frozen_array(box_px, (4,), "box")
    return map_points(view, [[x0, y0], [x1, y0], [x1, y1], [x0, y1]], inverse=inverse)


def map_ellipse(
    view: RectifiedView | FloatArray, ellipse: Ellipse, *, inverse: bool = False
) -> Ellipse:
    """Map an ellipse exactly: C' = H⁻ᵀ C H⁻¹ (Hartley and Zisserman, 2nd ed., Result 2.13).

    With lens distortion its image is no exact ellipse: one is fitted to its points in
    the domain that the lens bends.

    Raises
    ------
    InputError
        If the ellipse reaches the panel's horizon (its image is a parabola or hyperbola),
        or the lens model does not reach it.
    """
    matrix, camera = _matrix_and_camera(view)
    if inverse:
        straight = _transform(_inverse(matrix), ellipse)
        return straight if camera is None else _distort(camera, straight)
    return _transform(matrix, ellipse if camera is None else camera.undistort_ellipse(ellipse))


def _matrix_and_camera(view: RectifiedView | FloatArray) -> tuple[FloatArray, Camera | None]:
    if isinstance(view, RectifiedView):
        return view.homography, view.camera if view.camera.distorted else None
    return frozen_array(view, (3, 3), "homography"), None


def _inverse(matrix: FloatArray) -> FloatArray:
    try:
        return np.asarray(np.linalg.inv(matrix), dtype=np.float64)
    except np.linalg.LinAlgError:
        raise InputError("homography", "expected an invertible matrix, got a singular one") from (
            None
        )


def _points(points_px: npt.ArrayLike) -> FloatArray:
    try:
        points = np.asarray(points_px, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError("points", "expected numbers of shape (n, 2)") from None
    if points.ndim != 2 or points.shape[1] != 2:
        raise InputError("points", f"expected shape (n, 2), got {points.shape}")
    return points


def _transform(matrix: FloatArray, ellipse: Ellipse) -> Ellipse:
    """Map an ellipse by a homography, as a dual conic: Q' = H Q Hᵀ.

    Q = [[c cᵀ - S, c], [cᵀ, 1]] needs no inverse; and Q'[2, 2] is w_c² minus the squared
    range of w over the ellipse, positive exactly if the horizon misses it.
    """
    center, w = apply_homography(matrix, ellipse.center[None])
    # About both centres, so that no large coordinates cancel.
    there, back = np.eye(3), np.eye(3)
    there[:2, 2] = ellipse.center
    back[:2, 2] = -center[0]
    dual = np.zeros((3, 3))
    dual[:2, :2] = -ellipse.shape_matrix
    dual[2, 2] = 1.0
    reach = float(matrix[2, :2] @ ellipse.shape_matrix @ matrix[2, :2])
    if not (w[0] > 0 and w[0] ** 2 > reach):
        raise InputError(
            "ellipse",
            f"expected one in front of the panel's horizon, got one at ({ellipse.cx:g}, "
            f"{ellipse.cy:g}) that reaches it, so that its image is no ellipse",
            "leave it out, or check the pose",
        )
    moved = back @ matrix @ there
    image = moved @ dual @ moved.T
    image /= image[2, 2]
    offset = image[:2, 2]
    return Ellipse.from_shape_matrix(center[0] + offset, np.outer(offset, offset) - image[:2, :2])


def _distort(camera: Camera, ellipse: Ellipse) -> Ellipse:
    from fronto.camera.conic import fit_ellipse

    points = camera.distort_points(ellipse.points(ELLIPSE_POINTS))
    points = points[np.isfinite(points).all(axis=1)]
    if len(points) < ELLIPSE_POINTS // 2:
        raise InputError(
            "ellipse",
            "expected an outline within the lens model's validity, most of it lies outside",
            "leave it out, or check the distortion coefficients",
        )
    return fit_ellipse(points)
