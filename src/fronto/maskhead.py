"""What the mask head is told of each find, and from its answer to a mask in the photo's pixels.

The network tells of cells of 4 x 4 pixels of a picture of about 640 x 480 where buttons are:
their masks are blobs with ragged edges. So a second, small network looks at each find by itself,
in the photo's own pixels, scaled so that all finds are equally large, and draws its mask anew:
what Mask R-CNN does (He et al., ICCV 2017), but on the photo, beside the rough mask, instead of
on the network's features, which know no edges.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fronto.finds import Find, owned
from fronto.patches import Region, photo_patch
from fronto.patches import region as patch_region

__all__ = ["FORMS", "SIDE", "Patches", "Region", "describe", "mask_in_photo", "region"]

#: A patch has this many by this many pixels ...
SIDE = 48
#: ... and shows the find's box, made larger by this.
REACH = 1.6
#: Shapes that the head tells apart.
FORMS = ("quad", "ellipse", "odd")

Floats = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Patches:
    """N finds as the mask head takes them.

    Parameters
    ----------
    photo
        Shape (N, 48, 48, 3), uint8, RGB: the photo around each.
    rough
        Shape (N, 48, 48), uint8: the network's mask of each, 0 to 255, without what belongs to
        others.
    regions
        What the patches show.
    """

    photo: npt.NDArray[np.uint8]
    rough: npt.NDArray[np.uint8]
    regions: tuple[Region, ...]


def region(box: npt.ArrayLike) -> Region:
    """What the patch of a box x0, y0, x1, y1 shows."""
    return patch_region(box, REACH)


def describe(
    rgb: npt.NDArray[np.uint8], finds: Sequence[Find], regions: Sequence[Region] | None = None
) -> Patches:
    """Cut the finds of one photo out of it.

    Parameters
    ----------
    rgb
        Shape (h, w, 3), uint8: the photo.
    finds
        All of it: each one's rough mask ends where a neighbour's begins.
    regions
        What the patches show; None: `region` of each find's box.
    """
    boxes = np.stack([find.box for find in finds])
    regions = tuple(region(box) for box in boxes) if regions is None else tuple(regions)
    photo = np.stack([photo_patch(rgb, r, SIDE) for r in regions])
    rough = np.stack([_rough_patch(find, r) for find, r in zip(finds, regions, strict=True)])
    for k, r in enumerate(regions):
        rough[k] *= owned(boxes, k, *r.places(SIDE))
    return Patches(photo, rough, regions)


def mask_in_photo(
    probability: Floats, region: Region, width: int, height: int
) -> tuple[Floats, tuple[int, int]]:
    """A patch's mask (48, 48) in the pixels of a photo.

    Returns
    -------
    Its part in the photo, (h, w), and the column and row of its top-left pixel there.
    """
    import cv2

    left, top = max(0, -region.x0), max(0, -region.y0)
    right, bottom = min(region.width, width - region.x0), min(region.height, height - region.y0)
    if right <= left or bottom <= top:
        return np.zeros((0, 0), np.float32), (0, 0)
    if not region.large:
        size = (region.width, region.height)
        whole = cv2.resize(probability, size, interpolation=cv2.INTER_LINEAR)
        part = whole[top:bottom, left:right]
    else:
        # The photo's part only, less exactly: OpenCV rounds to a 32nd of the patch's pixels.
        sx, sy = SIDE / region.width, SIDE / region.height
        inverse = np.array([[sx, 0, (left + 0.5) * sx - 0.5], [0, sy, (top + 0.5) * sy - 0.5]])
        part = cv2.warpAffine(
            probability,
            inverse,
            (right - left, bottom - top),
            flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
            borderMode=cv2.BORDER_REPLICATE,
        )
    return np.asarray(part, np.float32), (region.x0 + left, region.y0 + top)


def _rough_patch(find: Find, r: Region) -> npt.NDArray[np.uint8]:
    import cv2

    x, y = r.places(SIDE)
    ends = find.view.to_network([[x[0], y[0]], [x[1], y[1]]])
    (u0, v0), (u1, v1) = ends
    inverse = np.array([[u1 - u0, 0, u0], [0, v1 - v0, v0]])
    rough = cv2.warpAffine(
        find.mask,
        inverse,
        (SIDE, SIDE),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return np.asarray(np.rint(255 * rough), np.uint8)
