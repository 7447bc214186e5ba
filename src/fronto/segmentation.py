"""Photo to masks: the only room that touches the segmentation model."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from fronto.categories import CATEGORIES, PLATE
from fronto.engine import Engine, Maps
from fronto.errors import InputError
from fronto.grouping import Instance, overlaps
from fronto.images import as_rgb
from fronto.judging import instances
from fronto.scales import View, first_looks, second_scale, tiles
from fronto.segments import Segment, Segments
from fronto.shapes import FloatArray

if TYPE_CHECKING:
    from pathlib import Path

    from PIL import Image

__all__ = ["default_engine", "segment"]

#: Two finds that overlap this much (intersection over union) are the same thing.
SAME = 0.45
#: Of a find cut by a tile's edge only a piece is seen; it lies this close to it, network pixels.
EDGE_PX = 3.0
#: How far a mask may reach beyond its box, in half sides.
REACH = 1.3
#: Boxes of neighbours that overlap by more than this share of their sides are of turned ones.
TURNED = 0.06
#: The photos that the network learned from are labelled loosely, their buttons' boxes and so its
#: masks are larger than buttons outlined exactly, by a sixth in area in the median of those
#: annotated; on renders, learned exactly, by a fiftieth. This share of a mask is kept, the surest.
TIGHT = 0.9
#: ... unless that would cut into what is this sure: the mask's edge is a crisp one.
CRISP = 0.95
#: A mask must fill this share of its box: less is no button, but a flaw.
LEAST_FILL = 0.25
#: One that fills less than the first share is of a button whose pixels are unsure (an ellipse fills
#: 0.79): then the likeliest pixels, the second share of the box, are its mask, if they are no less
#: likely than this.
SPARSE, FILL, DIMMEST = 0.5, 0.6, 0.02


@cache
def default_engine() -> Engine:
    """The engine with the packaged weights and all cores; made on first use, then kept."""
    return Engine()


def segment(
    image: npt.NDArray[Any] | Image.Image | str | Path,
    *,
    engine: Engine | None = None,
    min_confidence: float = 0.5,
    second_look: bool = True,
    order: Literal["rgb", "bgr"] = "rgb",
) -> Segments:
    """Find the buttons of a panel, and the label plates beside them.

    Photos of any size are brought to about 640 x 480 pixels for the network; where the
    buttons come out small and the photo has more to show, they are looked at again in tiles.

    Parameters
    ----------
    image
        A file, a Pillow image, or an array: grey, RGB(A) or BGR(A), 8 or 16 bit.
    engine
        Weights and threads; None: `default_engine`.
    min_confidence
        What is less sure than this, 0 to 1, is left out.
    second_look
        Whether small buttons are looked at again.
    order
        Order of an array's channels.

    Returns
    -------
    Masks in the photo's pixels, surest first.

    Raises
    ------
    InputError
        If the image is none, or `min_confidence` is not from 0 to 1.
    """
    if not 0 <= min_confidence <= 1:
        raise InputError("min_confidence", f"expected 0 to 1, got {min_confidence}")
    started = time.perf_counter()
    rgb = as_rgb(image, order=order)
    engine = default_engine() if engine is None else engine
    read = time.perf_counter()
    finds, network_s = _look(engine, first_looks(rgb), rgb.shape)
    finds = [f for f in _distinct(finds) if f.confidence >= min_confidence]
    if second_look and finds:
        again, more_s = _look_again(engine, rgb, finds)
        network_s += more_s
        if again:
            finds = _distinct([*(f for f in again if f.confidence >= min_confidence), *finds])
    segments = _segments(finds, rgb.shape[1], rgb.shape[0])
    total = time.perf_counter() - started
    timing = {
        "read": 1e3 * (read - started),
        "network": 1e3 * network_s,
        "group": 1e3 * (total - (read - started) - network_s),
        "total": 1e3 * total,
    }
    return Segments(rgb.shape[1], rgb.shape[0], segments, timing_ms=timing)


@dataclass(frozen=True, eq=False)
class _Find:
    """An instance in the photo, and where to take its mask from."""

    instance: Instance
    box: FloatArray
    view: View
    mask: npt.NDArray[np.float32]
    confidence: float
    category: str
    cut: bool


def _look(
    engine: Engine, views: Sequence[View], shape: tuple[int, ...]
) -> tuple[list[_Find], float]:
    """What the network finds in each view, and the seconds that it took."""
    finds: list[_Find] = []
    seconds = 0.0
    for view in views:
        started = time.perf_counter()
        maps = engine.run(view.image[None])
        seconds += time.perf_counter() - started
        finds += _finds(engine, maps, view, shape)
    return finds, seconds


def _finds(engine: Engine, maps: Maps, view: View, shape: tuple[int, ...]) -> list[_Find]:
    finds = []
    for instance in instances(engine, maps, view.image.shape[:2]):
        box = view.to_photo(np.array(instance.box).reshape(2, 2))
        mask = maps.masks[0, int(instance.plate)]
        confidence, category = _verdict(instance)
        cut = _cut(instance, view, shape)
        finds.append(_Find(instance, box.ravel(), view, mask, confidence, category, cut))
    return finds


def _verdict(instance: Instance) -> tuple[float, str]:
    """Confidence and category: the centre's probability, the mean of the cells' classes."""
    if instance.plate:
        return instance.confidence, PLATE
    best = 1 + int(np.argmax(instance.scores[1:-1]))
    return instance.confidence, CATEGORIES[best]


def _look_again(
    engine: Engine, rgb: npt.NDArray[np.uint8], finds: Sequence[_Find]
) -> tuple[list[_Find], float]:
    """Tiles around small finds, at a scale that suits them."""
    boxes = np.stack([f.box for f in finds])
    sides = (boxes[:, 2:] - boxes[:, :2]).min(axis=1)
    scale = second_scale(finds[0].view.sx, sides)
    if scale is None:
        return [], 0.0
    views = tiles(rgb, boxes, scale)
    return _look(engine, views, rgb.shape)


def _cut(instance: Instance, view: View, shape: tuple[int, ...]) -> bool:
    """Whether a tile's edge, and not the photo's, may have cut it."""
    x0, y0, x1, y1 = instance.box
    return (
        (view.x0 > 0 and x0 < EDGE_PX)
        or (view.y0 > 0 and y0 < EDGE_PX)
        or (view.x0 + view.width < shape[1] and x1 > view.columns - 1 - EDGE_PX)
        or (view.y0 + view.height < shape[0] and y1 > view.rows - 1 - EDGE_PX)
    )


def _distinct(finds: Sequence[_Find]) -> list[_Find]:
    """Drop what was found twice: whole ones stay, of the closer look, and then the surer."""
    ranked = sorted(finds, key=lambda f: (f.cut, -round(f.view.sx, 3), -f.confidence))
    kept: list[_Find] = []
    for find in ranked:
        if not kept or _sameness(find, np.stack([k.box for k in kept])) < SAME:
            kept.append(find)
    return sorted(kept, key=lambda f: -f.confidence)


def _sameness(find: _Find, boxes: FloatArray) -> float:
    """Largest overlap with one of the boxes; of a piece of something: the share inside one."""
    if not find.cut:
        return float(overlaps(find.box, boxes).max())
    low = np.maximum(find.box[:2], boxes[:, :2])
    high = np.minimum(find.box[2:], boxes[:, 2:])
    shared = np.clip(high - low, 0, None).prod(axis=1)
    return float(shared.max() / (find.box[2:] - find.box[:2]).prod())


def _segments(finds: Sequence[_Find], width: int, height: int) -> tuple[Segment, ...]:
    if not finds:
        return ()
    boxes = np.stack([f.box for f in finds])
    segments = []
    for k, find in enumerate(finds):
        found = _segment(find, boxes, k, width, height)
        if found is not None:
            segments.append(found)
    return tuple(segments)


def _segment(find: _Find, boxes: FloatArray, index: int, width: int, height: int) -> Segment | None:
    import cv2

    box = boxes[index]
    reach = (REACH - 1) / 2 * (box[2:] - box[:2]) + 1
    low = np.clip(np.floor(box[:2] - reach), 0, (width - 1, height - 1)).astype(int)
    high = np.clip(np.ceil(box[2:] + reach), 0, (width - 1, height - 1)).astype(int)
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
    probability[~_owned(boxes, index, low, rows, columns)] = 0
    seen = np.clip(box, -0.5, np.array([width, height, width, height]) - 0.5)
    area = float((seen[2:] - seen[:2]).prod())
    if area <= 0:
        return None
    probability = _tightened(_largest_piece(_lifted(probability, area)))
    if (probability > 0.5).sum() < LEAST_FILL * area:
        return None
    edges = seen == (-0.5, -0.5, width - 0.5, height - 0.5)
    return Segment(
        find.category,
        find.confidence,
        (float(seen[0]), float(seen[1]), float(seen[2]), float(seen[3])),
        (int(low[0]), int(low[1])),
        probability,
        tuple(float(s) for s in find.instance.scores),
        truncated=bool(edges.any()),
    )


def _owned(
    boxes: FloatArray, index: int, low: npt.NDArray[np.intp], rows: int, columns: int
) -> npt.NDArray[np.bool_]:
    """Shape (rows, columns): pixels closer to this box's middle than to a neighbour's.

    Distances are in half sides, so that the border of two boxes of different size lies
    between them; masks that touch are told apart so. Boxes overlap where a panel is turned:
    there the border is halfway between the middles, however these lie to each other.
    """
    x, y = low[0] + np.arange(columns), (low[1] + np.arange(rows))[:, None]

    def distances(box: FloatArray) -> tuple[FloatArray, FloatArray]:
        middle, half = (box[:2] + box[2:]) / 2, (box[2:] - box[:2]) / 2
        across, down = np.abs(x - middle[0]) / half[0], np.abs(y - middle[1]) / half[1]
        return np.maximum(across, down), np.hypot(across, down)

    box = boxes[index]
    own, own_round = distances(box)
    owned = own <= REACH
    near = (
        (boxes[:, 0] < low[0] + columns)
        & (boxes[:, 2] > low[0])
        & (boxes[:, 1] < low[1] + rows)
        & (boxes[:, 3] > low[1])
    )
    near[index] = False
    shared = np.minimum(boxes[:, 2:], box[2:]) - np.maximum(boxes[:, :2], box[:2])
    sides = np.minimum(boxes[:, 2:] - boxes[:, :2], box[2:] - box[:2])
    turned = (shared > TURNED * sides).all(axis=1)
    for k in np.flatnonzero(near):
        other, other_round = distances(boxes[k])
        owned &= own_round <= other_round if turned[k] else own <= other
    return np.asarray(owned)


def _lifted(probability: npt.NDArray[np.float32], area: float) -> npt.NDArray[np.float32]:
    """Probabilities by which the likeliest part of a box is above a half, where too little is.

    What is a button by all else has a mask, even if its pixels say so with less certainty.
    """
    if (probability > 0.5).sum() >= SPARSE * area:
        return probability
    count = min(int(FILL * area), probability.size)
    level = float(np.partition(probability.ravel(), -count)[-count]) if count else 0.0
    return probability if level < DIMMEST else _levelled(probability, min(level, 0.5))


def _levelled(probability: npt.NDArray[np.float32], level: float) -> npt.NDArray[np.float32]:
    """Probabilities whose odds are changed so that this one becomes a half, and a little more."""
    odds = 0.995 * level / (1 - level)
    return np.asarray(probability / (probability + odds * (1 - probability)), np.float32)


def _tightened(probability: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """Probabilities by which only the surest part of a mask is above a half."""
    inside = probability[probability > 0.5]
    if TIGHT >= 1 or not len(inside):
        return probability
    level = float(np.quantile(inside, 1 - TIGHT))
    return probability if level > CRISP else _levelled(probability, level)


def _largest_piece(probability: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
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
