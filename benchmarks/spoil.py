"""What happens to a picture on its way: one function an effect, each with one strength."""

from __future__ import annotations

import cv2
import numpy as np

from scenes import Image, Spoil


def blur(sigma_px: float) -> Spoil:
    """Gaussian blur of so many pixels."""
    return lambda image, rng: (
        image if sigma_px == 0 else cv2.GaussianBlur(image, (0, 0), sigma_px).astype(np.uint8)
    )


def jpeg(quality: int) -> Spoil:
    """JPEG at a quality, 1 to 100."""

    def spoil(image: Image, rng: np.random.Generator) -> Image:
        done, content = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, int(quality)])
        if not done:
            raise RuntimeError(f"JPEG at quality {quality}: expected OpenCV to write it")
        return np.asarray(cv2.imdecode(content, cv2.IMREAD_COLOR), np.uint8)

    return spoil


def brightness(factor: float) -> Spoil:
    """So many times the light; what is too bright clips."""
    return lambda image, rng: np.clip(np.rint(image * factor), 0, 255).astype(np.uint8)


def occlusion(share: float) -> Spoil:
    """Dark blobs over so much of the photo's middle, where the panel is."""

    def spoil(image: Image, rng: np.random.Generator) -> Image:
        covered = np.zeros(image.shape[:2], np.uint8)
        height, width = covered.shape
        middle = covered[height // 4 : -height // 4, width // 3 : -width // 3]
        tone = rng.uniform(20, 70, 3)
        while middle.mean() < share:
            center = (int(rng.uniform(width / 3, 2 * width / 3)),
                      int(rng.uniform(height / 4, 3 * height / 4)))  # fmt: skip
            axes = tuple(int(a) for a in rng.uniform(8, 40, 2))
            cv2.ellipse(covered, center, axes, float(rng.uniform(0, 180)), 0, 360, 1, -1)
        soft = cv2.GaussianBlur(covered.astype(np.float32), (0, 0), 1.0)[..., None]
        return np.clip(image * (1 - soft) + tone * soft, 0, 255).astype(np.uint8)

    return spoil
