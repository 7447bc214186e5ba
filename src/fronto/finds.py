"""What the network finds in the views of a photo, before it has a mask in the photo's pixels."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fronto.grouping import Instance
from fronto.scales import View
from fronto.shapes import FloatArray

__all__ = ["Find", "owned"]

#: How far a mask may reach beyond its box, in half sides.
REACH = 1.3
#: Boxes of neighbours that overlap by more than this share of their sides are of turned ones.
TURNED = 0.06


@dataclass(frozen=True, eq=False)
class Find:
    """An instance in the photo, and where to take its mask from.

    Parameters
    ----------
    instance
        As found in the view.
    box
        Shape (4,): x0, y0, x1, y1 in the photo.
    view
        Where it was found.
    mask
        Shape (H, W): probability of its kind for each pixel of the view's picture.
    confidence, category
        As a `Segment` has them.
    cut
        Whether a tile's edge, and not the photo's, may have cut it.
    """

    instance: Instance
    box: FloatArray
    view: View
    mask: npt.NDArray[np.float32]
    confidence: float
    category: str
    cut: bool


def owned(boxes: FloatArray, index: int, x: FloatArray, y: FloatArray) -> npt.NDArray[np.bool_]:
    """Which places are closer to a box's middle than to a neighbour's.

    Distances are in half sides, so that the border of two boxes of different size lies
    between them; masks that touch are told apart so. Boxes overlap where a panel is turned:
    there the border is halfway between the middles, however these lie to each other.

    Parameters
    ----------
    boxes
        Shape (n, 4): of all that was found.
    index
        Whose places.
    x, y
        Shapes (columns,) and (rows,), growing: of the places, in the photo.

    Returns
    -------
    Shape (rows, columns).
    """
    middles, halves = (boxes[:, :2] + boxes[:, 2:]) / 2, (boxes[:, 2:] - boxes[:, :2]) / 2

    def distances(k: int, norm: np.ufunc) -> FloatArray:
        across, down = np.abs(x - middles[k, 0]) / halves[k, 0], np.abs(y - middles[k, 1])
        return np.asarray(norm(across, (down / halves[k, 1])[:, None]))

    box = boxes[index]
    own = distances(index, np.maximum)
    result = own <= REACH
    near = (
        (boxes[:, 0] < x[-1] + 1)
        & (boxes[:, 2] > x[0])
        & (boxes[:, 1] < y[-1] + 1)
        & (boxes[:, 3] > y[0])
    )
    near[index] = False
    shared = np.minimum(boxes[:, 2:], box[2:]) - np.maximum(boxes[:, :2], box[:2])
    sides = np.minimum(boxes[:, 2:] - boxes[:, :2], box[2:] - box[:2])
    turned = (shared > TURNED * sides).all(axis=1)
    for k in np.flatnonzero(near & ~turned).tolist():
        result &= own <= distances(k, np.maximum)
    for k in np.flatnonzero(near & turned).tolist():
        result &= distances(index, np.hypot) <= distances(k, np.hypot)
    return np.asarray(result)
