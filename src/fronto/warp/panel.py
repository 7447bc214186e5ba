"""Photo and pose -> head-on picture."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any, get_args

import numpy as np
import numpy.typing as npt

from fronto.errors import InputError
from fronto.results import PanelPose, RectifiedView
from fronto.shapes import FloatArray
from fronto.warp.canvas import Canvas, Crop, plan_canvas
from fronto.warp.resample import Resampling, resample

if TYPE_CHECKING:
    from fronto.camera import Camera

__all__ = ["Crop", "Resampling", "warp_panel"]

#: What full opacity is in each pixel type that can be warped.
OPAQUE: dict[str, int | float] = {"uint8": 255, "uint16": 65535, "float32": 1.0}
#: cv2 addresses source pixels with signed 16-bit numbers.
MAX_SOURCE_SIDE_PX = 32_766


def warp_panel(
    image: npt.NDArray[Any],
    camera: Camera,
    pose: PanelPose,
    *,
    crop: Crop = "panel",
    margin: float = 0.5,
    scale: float = 1.0,
    max_pixels: int = 16_000_000,
    standard_corners: npt.ArrayLike | None = None,
    resampling: Resampling = "auto",
) -> RectifiedView:
    """Draw the photo as a camera would see it that faces the panel head-on.

    The homography is A K_iso R K⁻¹ (paper, Eq. 18), with K_iso = K but one focal length
    sqrt(fx fy), so that the picture's pixels are square whatever the camera's are, and
    A a scale and translation. It is exact whatever the panel's distance. The photo is
    resampled once, lens distortion included.

    What lies beyond w = max(0.2, half the smallest w on the buttons), with w = (R K⁻¹ p)₃
    (1 head-on, 0 at the panel's horizon), is transparent, as is what the photo does not
    show; a panel tilted so much that its buttons come near that bound lowers it.

    Parameters
    ----------
    image
        The photo: shape (h, w), (h, w, 1), (h, w, 3) or (h, w, 4), uint8, uint16 or
        float32, channels in any order, alpha last.
    camera
        The camera, at the photo's size. Where its focal length is not known
        (`focal_std` > 0), the one that the pose was solved with is used.
    pose
        The pose, "ok" or "uncertain"; its `plane_corners` say where the panel is.
    crop
        "panel": the buttons' bounding box and the margin. "full": everything that the
        photo shows in front of the horizon; through a lens with distortion only up to 70
        degrees off its axis, since the corners of a fisheye's photo are drawn out to
        needles that would make the canvas huge and empty (what of them falls on it is
        drawn). "input": a canvas of the photo's size with
        the buttons' centroid at its place in the photo (other parts, even the photo's
        centre, may leave the canvas). Without buttons "panel" means "full", and the
        photo's centre stands in for the centroid.
    margin
        Around the buttons, in median button sides ("panel" only).
    scale
        Linear scale at the buttons' centroid, canvas pixels per photo pixel; 1
        preserves the local area. With `standard_corners`: enlarges that layout.
    max_pixels
        Cap on the canvas' area; no side exceeds 16384 either. A larger picture is
        scaled down as a whole, never cut; `RectifiedView.scale` tells.
    standard_corners
        The paper's presupposed layout U, shape (n, 4, 2), pixels of the canvas: A is the
        least-squares scale and translation onto it. The canvas begins at U's pixel
        (0, 0), and reaches as far right and down as `crop` asks.
    resampling
        "auto": cubic; where the photo is minified by more than 1.25 along a canvas
        axis, supersampled cubic and area averaging, so that nothing aliases. "area":
        the same, on bilinear samples. "lanczos", "linear", "nearest": one sample a
        pixel; Lanczos is a little sharper than cubic and takes seven times as long. OpenCV
        rounds the sampling positions of both to 1/32 px (0.03 px at most, measured on a
        ramp with OpenCV 5.0; "linear" there is exact to 1e-5 px).

    Returns
    -------
    The picture, always with alpha (0 or the source's alpha; opaque is 255, 65535 or 1.0),
    and its exact homography. Where alpha is 0 outside the photo, the colour is 0 too.

    Raises
    ------
    InputError
        If the image is of another size than the camera's, or of no supported type;
        if the pose has no usable rotation (its status is "degenerate" or "no_buttons",
        say); if an argument is out of range.
    """
    camera = _focal_of_pose(camera, pose)
    pixels = _check_image(image, camera)
    _check_arguments(crop, margin, scale, max_pixels, resampling)
    canvas = plan_canvas(
        camera,
        pose,
        crop=crop,
        margin=margin,
        scale=scale,
        max_pixels=max_pixels,
        standard_corners=standard_corners,
    )
    warped, inside = resample(pixels, camera, canvas, resampling)
    has_buttons = np.asarray(pose.plane_corners).size > 0
    return RectifiedView(
        image=_with_alpha(warped, inside),
        homography=_normalised(canvas),
        camera=camera,
        crop=crop if has_buttons or crop != "panel" else "full",
        scale=canvas.scale,
    )


def _focal_of_pose(camera: Camera, pose: PanelPose) -> Camera:
    """The camera with the focal length that the rotation belongs to.

    A rotation solved with one focal length and drawn with another gives a plausible
    skewed picture, so a contradiction is an error.
    """
    solved = pose.camera.focal_px * camera.width_px / pose.camera.width_px
    if abs(camera.focal_px / solved - 1.0) < 1e-3:
        return camera
    if camera.focal_std > 0:
        return camera.with_focal(solved, pose.camera.focal_std, source=pose.camera.source)
    raise InputError(
        "camera",
        f"expected the focal length that the pose was solved with ({solved:.1f} px at this "
        f"size), got {camera.focal_px:.1f} px",
        "pass pose.camera, or estimate the pose with this camera",
    )


def _check_image(image: npt.NDArray[Any], camera: Camera) -> npt.NDArray[Any]:
    """Return the image as (h, w, channels)."""
    if not isinstance(image, np.ndarray) or image.dtype.name not in OPAQUE:
        found = image.dtype.name if isinstance(image, np.ndarray) else type(image).__name__
        raise InputError(
            "image",
            f"expected an array of uint8, uint16 or float32, got {found}",
            "convert it with numpy.asarray(image).astype(...)",
        )
    pixels = image[:, :, None] if image.ndim == 2 else image
    if pixels.ndim != 3 or pixels.shape[2] not in (1, 3, 4):
        raise InputError(
            "image", f"expected shape (h, w) or (h, w, 1, 3 or 4 channels), got {image.shape}"
        )
    height, width = pixels.shape[:2]
    if (width, height) != (camera.width_px, camera.height_px):
        raise InputError(
            "image",
            f"expected the camera's size {camera.width_px}x{camera.height_px}, "
            f"got {width}x{height}",
            f"use camera.scaled_to({width}, {height}) if the photo was only resized",
        )
    if max(width, height) > MAX_SOURCE_SIDE_PX:
        raise InputError(
            "image",
            f"expected sides of at most {MAX_SOURCE_SIDE_PX} px, got {width}x{height}",
            "scale the photo down and use camera.scaled_to",
        )
    return pixels


def _check_arguments(
    crop: str, margin: float, scale: float, max_pixels: int, resampling: str
) -> None:
    for name, value, allowed in (
        ("crop", crop, get_args(Crop)),
        ("resampling", resampling, get_args(Resampling)),
    ):
        if value not in allowed:
            raise InputError(name, f"expected one of {', '.join(allowed)}, got {value!r}")
    if not (math.isfinite(margin) and margin >= 0):
        raise InputError(
            "margin", f"expected button sides, 0 or more, got {margin}", "0.5 is half a button"
        )
    if not (math.isfinite(scale) and scale > 0):
        raise InputError(
            "scale", f"expected a positive finite number, got {scale}", "1 is the photo's own scale"
        )
    if not max_pixels >= 1:
        raise InputError("max_pixels", f"expected at least 1 pixel, got {max_pixels}")


def _with_alpha(warped: npt.NDArray[Any], inside: npt.NDArray[np.bool_]) -> npt.NDArray[Any]:
    """Colour and alpha (h, w, 4) of the warped channels (h, w, 1, 3 or 4), read-only."""
    height, width, channels = warped.shape
    picture = np.empty((height, width, 4), warped.dtype)
    picture[..., :3] = warped[..., :3]  # one grey channel spreads over three
    opaque = OPAQUE[warped.dtype.name]
    # Lanczos overshoots; integers saturate by themselves, a float alpha does not.
    picture[..., 3] = np.clip(warped[..., 3], 0, opaque) if channels == 4 else opaque
    picture[~inside] = 0
    picture.setflags(write=False)
    return picture


def _normalised(canvas: Canvas) -> FloatArray:
    """Scale the homography to H[2, 2] = 1, or norm 1 where that is unsafe; w > 0 on the buttons.

    H[2, 2] is w at the photo's pixel (0, 0): the horizon may pass there, or in between.
    """
    matrix = canvas.homography
    safe = matrix[2, 2] > 1e-3 * canvas.anchor_w
    result = matrix / (matrix[2, 2] if safe else np.linalg.norm(matrix))
    result.setflags(write=False)
    return np.asarray(result)
