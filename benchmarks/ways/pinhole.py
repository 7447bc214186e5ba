"""The photo as a lens without distortion shows it, for ways that look for straight lines."""

from __future__ import annotations

import cv2
import numpy as np

from scenes import Case, Image


def pinhole_image(case: Case) -> Image:
    """Shape as the photo's; pixel (x, y) of it is an undistorted pixel of the case's camera."""
    camera = case.camera
    if not camera.distorted:
        return case.image
    size = camera.height_px, camera.width_px
    pixels = np.stack(np.meshgrid(np.arange(size[1]), np.arange(size[0])), axis=-1)
    at = camera.distort_points(pixels.reshape(-1, 2)).reshape(*size, 2).astype(np.float32)
    # Beyond the lens model there is no pixel: those are taken from outside of the photo.
    at = np.where(np.isfinite(at), at, np.float32(-10))
    straight = cv2.remap(case.image, at, None, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(straight, np.uint8)
