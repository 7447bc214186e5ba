"""What a camera's fields must be; each check names the field that is wrong."""

from __future__ import annotations

import operator

import numpy as np
import numpy.typing as npt

from fronto.camera.distortion import COUNTS
from fronto.errors import InputError
from fronto.shapes import FloatArray, frozen_array

__all__ = [
    "check_aspect",
    "check_center",
    "check_distortion",
    "checked_matrix",
    "positive_int",
    "same_aspect",
]


def positive_int(value: object, thing: str) -> int:
    """Return `value` as an int, if it is a positive whole number.

    Raises
    ------
    InputError
        If it is not.
    """
    try:
        number = 0 if isinstance(value, bool) else operator.index(value)  # type: ignore[arg-type]
    except TypeError:
        number = 0
    if number <= 0:
        raise InputError(thing, f"expected a positive whole number of pixels, got {value!r:.40}")
    return number


def checked_matrix(values: npt.ArrayLike) -> FloatArray:
    """Return K (3, 3) read-only, if it is upper triangular with positive focal lengths.

    Such a matrix is never singular.

    Raises
    ------
    InputError
        Naming what is wrong.
    """
    matrix = frozen_array(values, (3, 3), "camera matrix", "calibrate the camera again")
    if min(matrix[0, 0], matrix[1, 1]) <= 0:
        raise InputError(
            "camera matrix",
            "expected positive focal lengths, got a zero or negative focal length: "
            f"fx = {matrix[0, 0]:g}, fy = {matrix[1, 1]:g}",
            "calibrate the camera (uncalibrated drivers state zeros)",
        )
    if matrix[1, 0] != 0 or (matrix[2] != [0, 0, 1]).any():
        raise InputError(
            "camera matrix",
            "expected [[fx, skew, cx], [0, fy, cy], [0, 0, 1]], got other numbers where "
            "zeros and the one belong",
            "check that it is not transposed",
        )
    return matrix


def check_center(matrix: FloatArray, width_px: int, height_px: int) -> None:
    """Refuse a principal point further outside the image than the image is large.

    Raises
    ------
    InputError
        Naming the coordinate.
    """
    for name, center, size in (("x", matrix[0, 2], width_px), ("y", matrix[1, 2], height_px)):
        if not -size <= center <= 2 * size:
            raise InputError(
                "camera matrix",
                f"expected the principal point near the {width_px}x{height_px} image, "
                f"got {name} = {center:g}",
                "check that the matrix is in pixels and belongs to this image size",
            )


def check_distortion(model: str, count: int) -> None:
    """Refuse an unknown distortion model, or a count of coefficients that it does not take.

    Raises
    ------
    InputError
        Naming the model or the count.
    """
    counts = COUNTS.get(model) if isinstance(model, str) else None
    if counts is None:
        raise InputError(
            "distortion_model",
            f"expected one of {', '.join(COUNTS)}, got {model!r:.40}",
            "undistort the photo first and give the camera without distortion",
        )
    if count not in counts:
        raise InputError(
            "distortion",
            f"expected {' or '.join(map(str, counts))} coefficients for {model}, got {count}",
            "give all of them in OpenCV's order (4, 5: plumb_bob; 8, 12, 14: "
            "rational_polynomial), or name the model that they belong to",
        )


def check_aspect(width: int, height: int, other_width: int, other_height: int) -> None:
    """Refuse another image size whose aspect differs by more than 1 % and a pixel of rounding.

    Raises
    ------
    InputError
        Naming both sizes, and whether the photo looks rotated.
    """
    if same_aspect(width, height, other_width, other_height):
        return
    remedy = "calibrate for this size, or resize the photo without cropping it"
    if same_aspect(height, width, other_width, other_height):
        remedy = "the photo looks rotated by 90 degrees: turn it as it was calibrated"
    raise InputError(
        "image size",
        f"expected the aspect of the camera's {width}x{height}, got {other_width}x{other_height}",
        remedy,
    )


def same_aspect(width: float, height: float, other_width: float, other_height: float) -> bool:
    """Whether two sizes have one aspect, but for 1 % or one pixel of rounding."""
    across = other_height * width / height
    down = other_width * height / width
    if min(abs(across - other_width), abs(down - other_height)) <= 1:
        return True
    return bool(np.isclose(across, other_width, rtol=0.01, atol=0))
