"""Where the head-on picture lies: the homography, the canvas and its size.

With d = K⁻¹ p the ray of the undistorted pixel p, R d = w (x, y, 1) is the point (x, y)
of the panel's plane, and w = R[2]·d shrinks to 0 towards the panel's horizon. The local
area scale of K R K⁻¹ is w⁻³.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
import numpy.typing as npt

from fronto.errors import InputError
from fronto.results import PanelPose
from fronto.shapes import FloatArray, frozen_array
from fronto.warp.polygon import apply_homography, clip_half_plane, photo_outline

if TYPE_CHECKING:
    from fronto.camera import Camera

__all__ = ["Canvas", "Crop", "plan_canvas"]

Crop = Literal["panel", "full", "input"]

#: Longest side of the canvas. cv2.remap addresses pixels with signed 16-bit numbers.
MAX_SIDE_PX = 16_384
#: What lies at a smaller w than this is not drawn: it is stretched more than 11 times
#: as long (w⁻¹·⁵) as it would be at w = 1 ...
MIN_W = 0.2
#: ... but a button is never cut off, however tilted the panel.
BELOW_BUTTONS = 0.8


@dataclass(frozen=True, eq=False)
class Canvas:
    """The plan of a head-on picture.

    Parameters
    ----------
    homography
        Shape (3, 3): undistorted pixel -> canvas pixel, scaled such that its third row
        yields w = R[2]·K⁻¹ p.
    anchor_w
        w at the buttons' centroid (at the photo's centre if there are no buttons).
    min_w
        Nothing with a smaller w is drawn.
    width_px, height_px
        Size of the canvas.
    scale
        Canvas pixels per photo pixel at the centroid (linear).
    """

    homography: FloatArray
    anchor_w: float
    min_w: float
    width_px: int
    height_px: int
    scale: float


def plan_canvas(
    camera: Camera,
    pose: PanelPose,
    *,
    crop: Crop,
    margin: float,
    scale: float,
    max_pixels: int,
    standard_corners: npt.ArrayLike | None,
) -> Canvas:
    """Choose homography and canvas; parameters as of :func:`fronto.warp.warp_panel`.

    Raises
    ------
    InputError
        If the pose has no rotation or a status without one, puts a button behind the
        camera, or sees the panel edge-on; if the standard corners do not match the buttons.
    """
    corners = _check_pose(pose)
    rotation = np.asarray(pose.rotation, dtype=np.float64)
    inverse_k = np.linalg.inv(camera.matrix)
    plane_to_base = _square_intrinsics(camera)
    plane_from_pixel = rotation @ inverse_k
    pixel_from_plane = camera.matrix @ rotation.T

    if len(corners):
        # R d = w (x, y, 1) with d_z = 1: w is one over the depth of (x, y, 1).
        smallest_w = float(1.0 / (corners @ rotation[:, 2]).max())
        anchor = corners.mean(axis=0)
        anchor_w = float(1.0 / (anchor @ rotation[:, 2]))
    else:
        crop = "full" if crop == "panel" else crop
        middle = [[(camera.width_px - 1) / 2, (camera.height_px - 1) / 2]]
        plane, w = apply_homography(plane_from_pixel, camera.undistort_points(np.array(middle)))
        anchor_w = smallest_w = float(w[0])
        if not anchor_w > 0:
            raise _unusable(pose, "puts the photo's centre behind the panel's horizon")
        anchor = np.array([*plane[0], 1.0])
    min_w = min(max(MIN_W, 0.5 * smallest_w), BELOW_BUTTONS * smallest_w)

    outline = clip_half_plane(photo_outline(camera), plane_from_pixel[2] - [0, 0, min_w])
    if len(outline) < 3:
        raise _unusable(pose, "leaves nothing of the photo in front of the panel's horizon")

    anchor_undistorted, _ = apply_homography(pixel_from_plane, anchor[None, :2])
    anchor_photo = camera.distort_points(anchor_undistorted)
    # Linear size on the base picture K R K⁻¹ p per size in the photo, at the anchor.
    base_scale = anchor_w**-1.5 / math.sqrt(_distortion_area(camera, anchor_undistorted[0]))

    low, high = _base_bounds(crop, corners, plane_to_base, plane_from_pixel, outline, margin)
    photo_size = np.array([camera.width_px, camera.height_px], dtype=np.float64)
    if standard_corners is not None:
        placed = _place_on_standard(standard_corners, corners, plane_to_base)
        similarity = _about_corner(scale) @ placed
        size = similarity[0, 0] * high + similarity[:2, 2] + 0.5
    else:
        s = scale / base_scale
        if crop == "input":
            anchor_base = (plane_to_base @ anchor)[:2]
            shift = anchor_photo[0] - s * anchor_base
        else:
            shift = -0.5 - s * low
        similarity = np.array([[s, 0.0, shift[0]], [0.0, s, shift[1]], [0.0, 0.0, 1.0]])
        size = s * (high - low)
    if crop == "input":
        size = photo_size
    if not (np.isfinite(size).all() and np.isfinite(similarity).all()):
        raise _unusable(pose, "yields a picture of no finite size")

    shrink, width, height = _fit_size(float(size[0]), float(size[1]), max_pixels)
    similarity = _about_corner(shrink) @ similarity
    return Canvas(
        homography=similarity @ plane_to_base @ plane_from_pixel,
        anchor_w=anchor_w,
        min_w=min_w,
        width_px=width,
        height_px=height,
        scale=float(similarity[0, 0] * base_scale),
    )


def _unusable(pose: PanelPose, what: str) -> InputError:
    because = f" ({'; '.join(pose.reasons)})" if pose.reasons else ""
    return InputError(
        "pose",
        f"expected a rotation to rectify with, got status {pose.status!r}{because}, which {what}",
        "check the outlines and the camera, or pass a pose whose status is 'ok'",
    )


def _check_pose(pose: PanelPose) -> FloatArray:
    """All button corners as plane points (4n, 3) with z = 1, in front of the camera."""
    if pose.status not in ("ok", "uncertain"):
        raise _unusable(pose, "stands for no rotation at all")
    rotation = np.asarray(pose.rotation, dtype=np.float64)
    if rotation.shape != (3, 3) or not np.isfinite(rotation).all():
        raise _unusable(pose, "has no finite 3x3 rotation")
    flat = np.asarray(pose.plane_corners, dtype=np.float64).reshape(-1, 2)
    if not np.isfinite(flat).all():
        raise _unusable(pose, "has button corners that are not finite")
    corners = np.column_stack([flat, np.ones(len(flat))])
    if len(corners) and not (corners @ rotation[:, 2]).min() > 1e-9:
        raise _unusable(pose, "puts a button behind the camera")
    return corners


def _square_intrinsics(camera: Camera) -> FloatArray:
    """K with one focal length sqrt(fx fy) for both axes: the output's pixels are square."""
    cx, cy = camera.matrix[0, 2], camera.matrix[1, 2]
    f = camera.focal_px
    return np.array([[f, 0.0, cx], [0.0, f, cy], [0.0, 0.0, 1.0]])


def _distortion_area(camera: Camera, pixel: FloatArray) -> float:
    """Photo area per undistorted area at an undistorted pixel."""
    if not camera.distorted:
        return 1.0
    h = 0.01  # short enough for a derivative, long enough for float64
    step = h * np.array([[1.0, 0.0], [-1.0, 0.0], [0.0, 1.0], [0.0, -1.0]])
    right, left, below, above = camera.distort_points(pixel + step)
    area = float(np.linalg.det(np.array([right - left, below - above])) / (4.0 * h * h))
    return area if area > 0 else 1.0


def _base_bounds(
    crop: Crop,
    corners: FloatArray,
    plane_to_base: FloatArray,
    plane_from_pixel: FloatArray,
    outline: FloatArray,
    margin: float,
) -> tuple[FloatArray, FloatArray]:
    """Axis-aligned bounds, (2,) and (2,), in pixels of the base picture K R K⁻¹ p."""
    if crop == "panel":
        quads = corners[:, :2].reshape(-1, 4, 2)
        sides = np.roll(quads, -1, axis=1) - quads
        border = margin * float(np.median(np.hypot(sides[..., 0], sides[..., 1])))
        low, high = corners[:, :2].min(axis=0) - border, corners[:, :2].max(axis=0) + border
    else:
        plane, _ = apply_homography(plane_from_pixel, outline)
        low, high = plane.min(axis=0), plane.max(axis=0)
    f, shift = plane_to_base[0, 0], plane_to_base[:2, 2]
    return f * low + shift, f * high + shift


def _place_on_standard(
    standard_corners: npt.ArrayLike, corners: FloatArray, plane_to_base: FloatArray
) -> FloatArray:
    """Scale and translation (3, 3) that put the rectified corners on the standard ones."""
    from fronto.pose.presupposed import place_on

    count = len(corners) // 4
    standard = frozen_array(standard_corners, (-1, 4, 2), "standard_corners")
    if len(standard) != count or not count:
        raise InputError(
            "standard_corners",
            f"expected the corners of {count} buttons, got those of {len(standard)}",
            "pass one standard quad for each button of the pose, in the same order",
        )
    return place_on(standard.reshape(-1, 2), (corners @ plane_to_base.T)[:, :2])


def _about_corner(factor: float) -> FloatArray:
    """Scaling about the canvas' outer top-left corner (-0.5, -0.5), shape (3, 3)."""
    shift = 0.5 * (factor - 1.0)
    return np.array([[factor, 0.0, shift], [0.0, factor, shift], [0.0, 0.0, 1.0]])


def _fit_size(width: float, height: float, max_pixels: int) -> tuple[float, int, int]:
    """Shrink factor (at most 1) and whole-numbered size that respect both caps."""

    def whole(length: float) -> int:
        # The tolerance keeps rounding noise from adding an empty column.
        return max(1, math.ceil(length - 1e-6))

    factor = min(1.0, MAX_SIDE_PX / max(width, height, 1.0))
    columns, rows = whole(factor * width), whole(factor * height)
    while columns * rows > max_pixels:
        factor *= 0.999 * math.sqrt(max_pixels / (columns * rows))
        columns, rows = whole(factor * width), whole(factor * height)
    return factor, columns, rows
