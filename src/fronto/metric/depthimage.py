"""Depth images: reading them, and how far away a panel's plane is by one."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from fronto.camera import Camera
from fronto.errors import InputError
from fronto.shapes import FloatArray

__all__ = ["DepthArray", "as_depth", "depth_samples", "read_depth"]

#: Depths in metres: finite and positive, else there is none.
DepthArray = npt.NDArray[np.float32]

MAX_BYTES = 1_000_000_000
MILLIMETRE = np.float32(1e-3)
#: Looked at, spread evenly over the panel.
MAX_SAMPLES = 20_000


def as_depth(depth: npt.ArrayLike, thing: str = "depth") -> DepthArray:
    """A depth image in metres, NaN where there is no depth.

    Parameters
    ----------
    depth
        Shape (h, w) or (h, w, 1): depth along the optical axis; floats in metres, or uint16
        in millimetres (as ROS REP 118 has it). 0, NaN, infinity and negative values stand
        for no depth.
    thing
        What messages call it.

    Returns
    -------
    Shape (h, w), read-only.

    Raises
    ------
    InputError
        If it is of another shape or type.
    """
    array = np.asarray(depth)
    if array.ndim == 3 and array.shape[2] == 1:
        array = array[..., 0]
    if array.ndim != 2 or array.size == 0:
        raise InputError(
            thing,
            f"expected one depth a pixel, shape (h, w), got {array.shape}",
            "give the depth image itself, not a picture of it",
        )
    if array.dtype == np.uint16:
        metres = array.astype(np.float32) * MILLIMETRE
    elif array.dtype.kind == "f":
        with np.errstate(over="ignore"):
            metres = array.astype(np.float32)
    else:
        raise InputError(
            thing,
            f"expected floats in metres or uint16 in millimetres, got {array.dtype}",
            "convert it to one of them",
        )
    with np.errstate(invalid="ignore"):
        metres[~((metres > 0) & np.isfinite(metres))] = np.nan
    metres.setflags(write=False)
    return metres


def read_depth(path: str | Path) -> DepthArray:
    """Read a depth image: .npy, or a picture of one channel (PNG, TIFF).

    Parameters
    ----------
    path
        The file; 16-bit pixels are millimetres, floating-point ones metres.

    Returns
    -------
    Shape (h, w), metres, NaN where there is no depth; read-only.

    Raises
    ------
    InputError
        If it is missing, damaged, or no depth image.
    """
    thing = f"depth image {path}"
    read = _array if Path(path).suffix.lower() == ".npy" else _picture
    return as_depth(read(Path(path), thing), thing)


def _array(path: Path, thing: str) -> npt.NDArray[Any]:
    import io

    from fronto.files import read_bytes

    content = read_bytes(path, thing, MAX_BYTES)
    try:
        return np.asarray(np.load(io.BytesIO(content), allow_pickle=False))
    except (ValueError, EOFError, OSError):
        raise InputError(
            thing, "expected a NumPy array (.npy), got other data", "save it with numpy.save"
        ) from None


def _picture(path: Path, thing: str) -> npt.NDArray[Any]:
    from fronto.imageio import GREY_16, MAX_PIXELS, open_image

    with open_image(path) as image:
        if image.width * image.height > MAX_PIXELS:
            raise InputError(
                thing, f"expected at most {MAX_PIXELS / 1e6:g} million pixels, got more"
            )
        image.load()
        mode, pixels = image.mode, np.asarray(image)
    if mode in GREY_16:
        return pixels.astype(np.uint16)
    if mode == "F":
        return pixels
    if mode == "I" and pixels.min() >= 0 and pixels.max() <= 65535:  # Pillow's older way with PNG
        return pixels.astype(np.uint16)
    raise InputError(
        thing,
        f"expected one channel of 16 bits (millimetres) or floats (metres), got mode {mode}",
        "give the depth image itself, not a picture of it",
    )


def depth_samples(
    depth: DepthArray, camera: Camera, corners: Sequence[FloatArray] | FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Depths on the panel, and the rays along which they were seen.

    Parameters
    ----------
    depth
        Shape (h, w), metres; registered to the photo, at its size or another of its aspect.
    camera
        At the photo's size.
    corners
        Shape (n, 4, 3): corners of the buttons, camera frame, in any unit.

    Returns
    -------
    Depths (k,) within the hull of the buttons, and their rays (k, 3) at depth 1; k is 0
    where there are none.

    Raises
    ------
    InputError
        If the depth image has another aspect than the photo.
    """
    import cv2

    height, width = depth.shape
    try:
        camera = camera.scaled_to(width, height)
    except InputError:
        raise InputError(
            "depth",
            f"expected a depth image of the photo's size {camera.width_px}x{camera.height_px} or "
            f"of its aspect, got {width}x{height}",
            "register it to the photo (depth aligned to colour)",
        ) from None
    points = camera.project(np.asarray(corners).reshape(-1, 3))
    points = points[np.isfinite(points).all(axis=1)]
    mask = np.zeros((height, width), np.uint8)
    if len(points) >= 3:
        limit = 4.0 * max(width, height)  # what OpenCV clips safely
        hull = cv2.convexHull(np.rint(points.clip(-limit, limit)).astype(np.int32))
        cv2.fillConvexPoly(mask, hull, (1,))
    rows, columns = np.nonzero(mask)
    step = max(len(rows) // MAX_SAMPLES, 1)
    rows, columns = rows[::step], columns[::step]
    values = depth[rows, columns].astype(np.float64)
    rays = camera.rays(np.stack([columns, rows], axis=1).astype(np.float64).reshape(-1, 2))
    valid = np.isfinite(values) & np.isfinite(rays).all(axis=1)
    return values[valid], rays[valid]
