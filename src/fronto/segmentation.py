"""Photo to masks: the only room that touches the segmentation model."""

from __future__ import annotations

import time
from collections.abc import Sequence
from functools import cache
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from fronto.categories import CATEGORIES, PLATE
from fronto.engine import Engine, Maps
from fronto.errors import InputError
from fronto.finds import Find
from fronto.grouping import Instance, overlaps
from fronto.images import as_rgb
from fronto.judging import instances
from fronto.masks import drawn
from fronto.prints import named, read_prints
from fronto.scales import View, first_looks, second_scale, tiles
from fronto.segments import Segments
from fronto.shapes import FloatArray
from fronto.twins import told_apart
from fronto.verification import LEAST, describe, verified

if TYPE_CHECKING:
    from pathlib import Path

    from PIL import Image

__all__ = ["default_engine", "finds_in", "segment"]

#: Two finds that overlap this much (intersection over union) are the same thing.
SAME = 0.45
#: Of a find cut by a tile's edge only a piece is seen; it lies this close to it, network pixels.
EDGE_PX = 3.0


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
    finds, network_s = finds_in(engine, rgb, min_confidence, second_look=second_look)
    segments = drawn(finds, rgb, engine.masks)
    total = time.perf_counter() - started
    timing = {
        "read": 1e3 * (read - started),
        "network": 1e3 * network_s,
        "group": 1e3 * (total - (read - started) - network_s),
        "total": 1e3 * total,
    }
    return Segments(rgb.shape[1], rgb.shape[0], segments, timing_ms=timing)


def finds_in(
    engine: Engine, rgb: npt.NDArray[np.uint8], min_confidence: float, *, second_look: bool = True
) -> tuple[list[Find], float]:
    """What `segment` draws masks of, surest first, and the seconds that the network took.

    Parameters
    ----------
    engine
        The network.
    rgb
        Shape (h, w, 3), uint8: the photo.
    min_confidence, second_look
        As `segment` has them.
    """
    finds, network_s = _look(engine, first_looks(rgb), rgb.shape)
    finds, more_s = _sure(engine, rgb, _distinct(finds), min_confidence)
    network_s += more_s
    if second_look and finds:
        again, more_s = _look_again(engine, rgb, finds)
        network_s += more_s
        if again:
            again, more_s = _sure(engine, rgb, again, min_confidence)
            network_s += more_s
            finds = _distinct([*again, *finds])
    started = time.perf_counter()
    reader = engine.reader if finds else None
    if reader is not None:
        prints = read_prints(finds, rgb, reader)
        finds = told_apart(named(finds, prints), prints)
    return finds, network_s + time.perf_counter() - started


def _sure(
    engine: Engine, rgb: npt.NDArray[np.uint8], finds: Sequence[Find], min_confidence: float
) -> tuple[list[Find], float]:
    """Those that are sure enough once the verifier has seen them, and the seconds that it took."""
    seconds = 0.0
    doubtful = [f for f in finds if f.confidence >= LEAST] if engine.verifier is not None else []
    if engine.verifier is not None and doubtful:
        patches = describe(rgb, np.stack([f.box for f in doubtful]))
        started = time.perf_counter()
        opinions = engine.verifier.run(patches)
        seconds = time.perf_counter() - started
        others = [f for f in finds if f.confidence < LEAST]
        finds = [*verified(doubtful, opinions), *others]
    kept = [f for f in finds if f.confidence >= min_confidence]
    return sorted(kept, key=lambda f: -f.confidence), seconds


def _look(
    engine: Engine, views: Sequence[View], shape: tuple[int, ...]
) -> tuple[list[Find], float]:
    """What the network finds in each view, and the seconds that it took."""
    finds: list[Find] = []
    seconds = 0.0
    for view in views:
        started = time.perf_counter()
        maps = engine.run(view.image[None])
        seconds += time.perf_counter() - started
        finds += _finds(engine, maps, view, shape)
    return finds, seconds


def _finds(engine: Engine, maps: Maps, view: View, shape: tuple[int, ...]) -> list[Find]:
    finds = []
    for instance in instances(engine, maps, view.image.shape[:2]):
        box = view.to_photo(np.array(instance.box).reshape(2, 2))
        mask = maps.masks[0, int(instance.plate)]
        confidence, category = _verdict(instance)
        cut = _cut(instance, view, shape)
        finds.append(Find(instance, box.ravel(), view, mask, confidence, category, cut))
    return finds


def _verdict(instance: Instance) -> tuple[float, str]:
    """Confidence and category: the centre's probability, the mean of the cells' classes."""
    if instance.plate:
        return instance.confidence, PLATE
    best = 1 + int(np.argmax(instance.scores[1:-1]))
    return instance.confidence, CATEGORIES[best]


def _look_again(
    engine: Engine, rgb: npt.NDArray[np.uint8], finds: Sequence[Find]
) -> tuple[list[Find], float]:
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


def _distinct(finds: Sequence[Find]) -> list[Find]:
    """Drop what was found twice: whole ones stay, of the closer look, and then the surer."""
    ranked = sorted(finds, key=lambda f: (f.cut, -round(f.view.sx, 3), -f.confidence))
    kept: list[Find] = []
    for find in ranked:
        if not kept or _sameness(find, np.stack([k.box for k in kept])) < SAME:
            kept.append(find)
    return sorted(kept, key=lambda f: -f.confidence)


def _sameness(find: Find, boxes: FloatArray) -> float:
    """Largest overlap with one of the boxes; of a piece of something: the share inside one."""
    if not find.cut:
        return float(overlaps(find.box, boxes).max())
    low = np.maximum(find.box[:2], boxes[:, :2])
    high = np.minimum(find.box[2:], boxes[:, 2:])
    shared = np.clip(high - low, 0, None).prod(axis=1)
    return float(shared.max() / (find.box[2:] - find.box[:2]).prod())
