"""From finds to segments: each one's mask in the photo's pixels."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from fronto.finds import REACH, Find, owned
from fronto.maskhead import REACH as REACH_OF_PATCH
from fronto.maskhead import SIDE, describe, mask_in_photo
from fronto.segments import Segment
from fronto.shapes import FloatArray
from fronto.units import already_found, label_place, label_segment, like_others

if TYPE_CHECKING:
    from fronto.engine import MaskEngine

__all__ = ["drawn"]

#: The photos that the network learned from are labelled loosely, their buttons' boxes and so its
#: masks are larger than buttons outlined exactly, by a sixth in area in the median of those
#: annotated; on renders, learned exactly, by a fiftieth. This share of a mask is kept, the surest.
TIGHT = 0.9
#: ... unless that would cut into what is this sure: the mask's edge is a crisp one.
CRISP = 0.95
#: A mask must fill this share of its box: less is no button, but a flaw. A mask head may know
#: better: a box can have been put around a button and a ring or label beside it. The box stays as
#: it was found: photos are labelled so, too.
LEAST_FILL, LEAST_DRAWN = 0.25, 0.1
#: A button has several edges, of rings, collars and flanks. Which one is meant, and so how large it
#: is, the network knows better, which has learned from photos of real panels; the mask head, which
#: has learned from renders, knows its form. A mask that it has drawn is made as large as the
#: network's, where their areas differ by no more than this: else they are of different things.
LIKE = (0.6, 1.5)
#: A mask that ends this close to the photo's border, where its box ends, is cut there.
AT_EDGE_PX = 3.0
#: One that fills less than the first share is of a button whose pixels are unsure (an ellipse fills
#: 0.79): then the likeliest pixels, the second share of the box, are its mask, if they are no less
#: likely than this.
SPARSE, FILL, DIMMEST = 0.5, 0.6, 0.02

Floats = npt.NDArray[np.float32]


def drawn(
    finds: Sequence[Find], rgb: npt.NDArray[np.uint8], head: MaskEngine | None
) -> tuple[Segment, ...]:
    """The segments of all finds of a photo, in their order; those without a mask are left out.

    Labels that were found together with the buttons beside them come as plates, after these.

    Parameters
    ----------
    finds
        What the network has found.
    rgb
        Shape (h, w, 3), uint8: the photo.
    head
        Draws the masks anew where the photo shows the buttons' edges; None: the network's
        masks, as they are told for cells of the network.
    """
    height, width = rgb.shape[:2]
    edge = np.array([width, height, width, height]) - 0.5
    there = [(f, np.clip(f.box, -0.5, edge)) for f in finds]
    there = [(f, seen) for f, seen in there if (seen[2:] > seen[:2]).all()]
    if not there:
        return ()
    kept = [f for f, _ in there]
    boxes = np.stack([f.box for f in kept])
    plates = np.array([f.instance.plate for f in kept])
    fine: list[_Mask | None] = [None] * len(kept)
    if head is not None:
        patches = describe(rgb, kept)
        told = like_others([f.box for f in kept], plates, patches, head)
        masks = _as_large(told.masks, patches.rough, plates)
        for k, part in enumerate(patches.regions):
            mask, origin = mask_in_photo(masks[k], part, width, height)
            fine[k] = (mask, origin, tuple(told.forms[k].tolist()))
    segments = []
    for k, (find, seen) in enumerate(there):
        area = float((seen[2:] - seen[:2]).prod())
        made = _usable(fine[k], LEAST_DRAWN * area)
        if made is None:
            made = _usable(_rough(boxes, k, find, area, rgb.shape), LEAST_FILL * area)
        if made is None:
            continue
        segments.append(_segment(find, seen, made, width, height))
        if made[2] and not find.instance.plate:
            label = label_place(seen, _box(made[0], made[1]))
            if label is not None and not already_found(label, boxes[plates]):
                segments.append(label_segment(label, find.confidence, width, height))
    return tuple(segments)


#: Probability (h, w), its top-left pixel in the photo, and how likely each form is, if known.
_Mask = tuple[Floats, tuple[int, int], tuple[float, ...]]


def _usable(made: _Mask | None, least: float) -> _Mask | None:
    """The largest piece of a mask, if it has this many pixels."""
    if made is None or made[0].size == 0:
        return None
    probability = _largest_piece(made[0])
    return None if (probability > 0.5).sum() < least else (probability, *made[1:])


def _segment(find: Find, seen: FloatArray, made: _Mask, width: int, height: int) -> Segment:
    probability, origin, forms = made
    edge = np.array([-0.5, -0.5, width - 0.5, height - 0.5])
    # The box may be cut where only a label is.
    edges = (seen == edge) & (np.abs(_box(probability, origin) - edge) < AT_EDGE_PX)
    return Segment(
        find.category,
        find.confidence,
        (float(seen[0]), float(seen[1]), float(seen[2]), float(seen[3])),
        origin,
        probability,
        tuple(float(s) for s in find.instance.scores),
        truncated=bool(edges.any()),
        forms=forms,
    )


def _as_large(
    drawn: Floats, rough: npt.NDArray[np.uint8], plates: npt.NDArray[np.bool_]
) -> list[Floats]:
    """What the mask head has drawn in patches, (n, 48, 48), as large as the network's masks there.

    All buttons of a photo are resized alike: which edge is meant is the same. Plates have one edge,
    and stay as they are drawn.
    """
    result = list(drawn)
    buttons = np.flatnonzero(~plates)
    ratios = np.array([_ratio(drawn[k], rough[k]) for k in buttons])
    if np.isfinite(ratios).any():
        factor = np.sqrt(float(np.nanmedian(ratios)))
        for k in buttons:
            result[k] = _resized(drawn[k], factor)
    return result


def _ratio(drawn: Floats, rough: npt.NDArray[np.uint8]) -> float:
    """Of the areas of the network's mask and of one drawn; NaN where they are of other things."""
    box_area = (SIDE / REACH_OF_PATCH) ** 2
    known = _largest_piece(_lifted(np.asarray(rough / 255, np.float32), box_area))
    wanted, found = (int((part > 0.5).sum()) for part in (_tightened(known), drawn))
    if min(wanted, found) < LEAST_FILL * box_area or not LIKE[0] < wanted / found < LIKE[1]:
        return math.nan
    return wanted / found


def _resized(mask: Floats, factor: float) -> Floats:
    """A patch's mask, larger or smaller around its middle."""
    import cv2

    rows, columns = np.nonzero(mask > 0.5)
    if not len(rows):
        return mask
    x, y, scale = columns.mean(), rows.mean(), 1 / factor
    resized = cv2.warpAffine(
        mask,
        np.array([[scale, 0, (1 - scale) * x], [0, scale, (1 - scale) * y]]),
        (SIDE, SIDE),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    )
    return np.asarray(resized, np.float32)


def _box(probability: Floats, origin: tuple[int, int]) -> FloatArray:
    """Edges (4,) of a mask in the photo."""
    rows, columns = np.nonzero(probability > 0.5)
    low, high = np.array([columns.min(), rows.min()]), np.array([columns.max(), rows.max()])
    edges = np.concatenate([low - 0.5, high + 0.5]) + np.array([*origin, *origin])
    return np.asarray(edges, np.float64)


def _rough(boxes: FloatArray, index: int, find: Find, area: float, shape: tuple[int, ...]) -> _Mask:
    """The network's own mask of a find, within and just around its box."""
    import cv2

    limits = (shape[1] - 1, shape[0] - 1)
    box = boxes[index]
    reach = (REACH - 1) / 2 * (box[2:] - box[:2]) + 1
    low = np.clip(np.floor(box[:2] - reach), 0, limits).astype(int)
    high = np.clip(np.ceil(box[2:] + reach), 0, limits).astype(int)
    columns, rows = high - low + 1
    # Of the photo's pixels (x, y) of this part: where they are in the network's picture.
    (u0, v0), (u1, v1) = find.view.to_network([low, low + 1])
    inverse = np.array([[u1 - u0, 0, u0], [0, v1 - v0, v0]])
    probability = cv2.warpAffine(
        find.mask,
        inverse,
        (int(columns), int(rows)),
        flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
        borderMode=cv2.BORDER_REPLICATE,
    )
    probability = np.asarray(probability, np.float32).reshape(rows, columns)
    x, y = low[0] + np.arange(columns, dtype=float), low[1] + np.arange(rows, dtype=float)
    probability[~owned(boxes, index, x, y)] = 0
    lifted = _largest_piece(_lifted(probability, area))
    return _tightened(lifted), (int(low[0]), int(low[1])), ()


def _lifted(probability: Floats, area: float) -> Floats:
    """Probabilities by which the likeliest part of a box is above a half, where too little is.

    What is a button by all else has a mask, even if its pixels say so with less certainty.
    """
    if (probability > 0.5).sum() >= SPARSE * area:
        return probability
    count = min(int(FILL * area), probability.size)
    level = float(np.partition(probability.ravel(), -count)[-count]) if count else 0.0
    return probability if level < DIMMEST else _levelled(probability, min(level, 0.5))


def _levelled(probability: Floats, level: float) -> Floats:
    """Probabilities whose odds are changed so that this one becomes a half, and a little more."""
    odds = 0.995 * level / (1 - level)
    return np.asarray(probability / (probability + odds * (1 - probability)), np.float32)


def _tightened(probability: Floats) -> Floats:
    """Probabilities by which only the surest part of a mask is above a half."""
    inside = probability[probability > 0.5]
    if TIGHT >= 1 or not len(inside):
        return probability
    level = float(np.quantile(inside, 1 - TIGHT))
    return probability if level > CRISP else _levelled(probability, level)


def _largest_piece(probability: Floats) -> Floats:
    """Without specks that hang together with nothing."""
    import cv2

    inside = (probability > 0.5).astype(np.uint8)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(inside, connectivity=4)
    if count <= 2:
        return probability
    largest = 1 + int(np.argmax(stats[1:, cv2.CC_STAT_AREA]))
    result = probability.copy()
    result[(labels != largest) & (labels > 0)] = 0
    return result
