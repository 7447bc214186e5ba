"""Parts of a photo around finds, all scaled to one size: what heads look at."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fronto.shapes import FloatArray

__all__ = ["Region", "photo_patch", "region"]

#: Larger parts of the photo are not looked at pixel by pixel: no button is so large.
MOST_PX = 16_000_000


@dataclass(frozen=True)
class Region:
    """The part of a photo that a patch shows, whole pixels; it may reach beyond the photo.

    Parameters
    ----------
    x0, y0
        Its top-left pixel.
    width, height
        Pixels.
    """

    x0: int
    y0: int
    width: int
    height: int

    @property
    def large(self) -> bool:
        """Whether it is too large to be looked at pixel by pixel."""
        return self.width * self.height > MOST_PX

    def places(self, side: int) -> tuple[FloatArray, FloatArray]:
        """Where in the photo columns and rows of a patch of this side are: (side,) each."""
        at = (np.arange(side) + 0.5) / side
        return self.x0 - 0.5 + at * self.width, self.y0 - 0.5 + at * self.height


def region(box: npt.ArrayLike, reach: float) -> Region:
    """What the patch of a box x0, y0, x1, y1 shows: the box, made larger by `reach`."""
    x0, y0, x1, y1 = np.asarray(box, np.float64).ravel().tolist()
    width, height = max(round(reach * (x1 - x0)), 1), max(round(reach * (y1 - y0)), 1)
    left, top = (x0 + x1) / 2 - width / 2 + 0.5, (y0 + y1) / 2 - height / 2 + 0.5
    return Region(round(left), round(top), width, height)


def photo_patch(rgb: npt.NDArray[np.uint8], r: Region, side: int) -> npt.NDArray[np.uint8]:
    """A region of a photo (h, w, 3), uint8, as (side, side, 3).

    Beyond the photo's border its edge pixels go on.
    """
    import cv2

    height, width = rgb.shape[:2]
    x0, y0, x1, y1 = r.x0, r.y0, r.x0 + r.width, r.y0 + r.height
    if r.large:
        sx, sy = r.width / side, r.height / side
        inverse = np.array([[sx, 0, x0 - 0.5 + 0.5 * sx], [0, sy, y0 - 0.5 + 0.5 * sy]])
        sampled = cv2.warpAffine(
            rgb,
            inverse,
            (side, side),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_REPLICATE,
        )
        return np.asarray(sampled, np.uint8)
    # At least one pixel of the photo, and no more than its edge pixels of what is beyond it.
    left, right = min(max(x0, 0), width - 1), min(max(x1, 1), width)
    top, bottom = min(max(y0, 0), height - 1), min(max(y1, 1), height)
    part = rgb[top:bottom, left:right]
    if r.width != right - left:
        part = part[:, np.clip(np.arange(x0, x1), left, right - 1) - left]
    if r.height != bottom - top:
        part = part[np.clip(np.arange(y0, y1), top, bottom - 1) - top]
    shrinks = r.width > side and r.height > side
    way = cv2.INTER_AREA if shrinks else cv2.INTER_LINEAR
    return np.asarray(cv2.resize(part, (side, side), interpolation=way), np.uint8)
