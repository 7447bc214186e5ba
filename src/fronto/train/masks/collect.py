"""From pictures with known outlines to patches whose true masks are known."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import cv2
import numpy as np
import numpy.typing as npt

from fronto.categories import PLATE
from fronto.datasets.records import LabeledImage
from fronto.engine import Engine
from fronto.evaluate.regions import box_overlaps
from fronto.finds import Find
from fronto.maskhead import FORMS, SIDE, Region, describe, region
from fronto.scales import View, first_looks
from fronto.segmentation import finds_in
from fronto.shapes import FloatArray
from fronto.synth.photo.truth import PhotoObject
from fronto.train.masks.pool import Pool
from fronto.train.shown import found_in

__all__ = ["Shown", "collect", "labelled", "rendered", "true_mask"]

#: Sizes of the renders, pixels: buttons of photos with more pixels show more of their edges.
SIZES = ((640, 480), (640, 480), (800, 600), (1024, 768), (480, 640), (1280, 960))
#: What is less sure is drawn, too: its mask is learned like any other's.
LEAST_CONFIDENCE = 0.3
#: A find is what it overlaps by this much (intersection over union); of what is hidden by more
#: than the rest, nothing is learned.
IS, SEEN = 0.5, 0.85
#: Or the one thing that lies in its box by this share, if it is not smaller than that: a network
#: may take a button together with what surrounds it.
INSIDE, LEAST = 0.9, 0.12
#: Another one of its kind lies there, too, by this share.
TOO = 0.4
#: Share of the panels without twins whose buttons and labels share pills.
PILLS = 0.2
#: Networks that learned from photos labelled so take a button and the label beside it for one
#: thing: in this share of the pictures, each button is given to the head in a box around both.
UNITS = 0.5
#: How sure of such a unit the rough mask is, how far it reaches beyond both in shares of its
#: shorter side, and how blurred it is, network pixels.
SURE, BEYOND, BLUR_PX = 0.95, 0.04, 1.5
#: Patches show a little more or less than the find's box, and not quite its middle: boxes err.
#: Deviations of their logarithmic size and of their place in sides, and how many at most.
ZOOM, SHIFT, MOST = 0.1, 0.04, 2.5
#: The true mask is drawn this much finer: OpenCV fills every pixel that a polygon touches.
FINE = 16
#: Fixed-point bits of OpenCV's drawing, and its largest number.
BITS, FARTHEST = 8, 2**20


@dataclass(frozen=True, eq=False)
class Shown:
    """A picture and the outlines of what it shows.

    Parameters
    ----------
    image
        Shape (h, w, 3), uint8, RGB.
    outlines
        Polygons (n, 2), pixels.
    plates
        Whether each is a plate.
    forms
        Index into `fronto.maskhead.FORMS` of each; `Pool.UNKNOWN` where nobody knows.
    learned
        Whether each is seen well enough to learn from.
    units
        Indices of a button and of the plate beside it that says what it is for.
    """

    image: npt.NDArray[np.uint8]
    outlines: Sequence[FloatArray]
    plates: Sequence[bool]
    forms: Sequence[int]
    learned: Sequence[bool]
    units: Sequence[tuple[int, int]] = ()


def rendered(twins: float, relief: float) -> Callable[[np.random.Generator], Shown]:
    """Fresh renders.

    Parameters
    ----------
    twins
        Share of them that have plates of the buttons' own form.
    relief
        Share of them whose buttons may stand out of the panel, or lie in holes.
    """
    from fronto.synth.photo import render_photo

    def draw(rng: np.random.Generator) -> Shown:
        width, height = SIZES[int(rng.integers(len(SIZES)))]
        photo = render_photo(
            rng,
            width,
            height,
            twins=bool(rng.random() < twins),
            relief=bool(rng.random() < relief),
            pills=PILLS,
        )
        return Shown(
            photo.image,
            [o.polygon_px for o in photo.objects],
            [o.category == PLATE for o in photo.objects],
            [FORMS.index("odd" if o.outline.odd else o.outline.shape) for o in photo.objects],
            [o.visible >= SEEN for o in photo.objects],
            _units(photo.objects),
        )

    return draw


def _units(objects: Sequence[PhotoObject]) -> list[tuple[int, int]]:
    """Buttons and the plates beside them: drawn one after the other, with the same text."""
    return [
        (k, k + 1)
        for k, (first, second) in enumerate(pairwise(objects))
        if first.category != PLATE == second.category and first.text == second.text
    ]


def labelled(images: Sequence[LabeledImage]) -> Callable[[np.random.Generator], Shown]:
    """Photos with labelled outlines, one or another of them."""
    from fronto.images import as_rgb

    def draw(rng: np.random.Generator) -> Shown:
        image = images[int(rng.integers(len(images)))]
        objects = [(o, o.polygon) for o in image.objects if o.polygon is not None]
        return Shown(
            as_rgb(image.path),
            [polygon for _, polygon in objects],
            [o.category == PLATE for o, _ in objects],
            [Pool.UNKNOWN] * len(objects),
            [not (o.ignore or o.truncated) for o, _ in objects],
        )

    return draw


def true_mask(polygon: FloatArray, part: Region) -> npt.NDArray[np.uint8]:
    """The share of each of a patch's pixels that lies in a polygon (n, 2): (48, 48), of 255."""
    low = np.array([part.x0, part.y0]) - 0.5
    at = (polygon - low) / (part.width, part.height) * SIDE * FINE - 0.5
    drawn = np.zeros((SIDE * FINE, SIDE * FINE), np.uint8)
    # OpenCV's fixed-point numbers end somewhere.
    at = np.clip(at, -FARTHEST, FARTHEST)
    points = np.rint(at * 2**BITS).astype(np.int32)
    cv2.fillPoly(drawn, [points], (255,), shift=BITS)
    return np.asarray(cv2.resize(drawn, (SIDE, SIDE), interpolation=cv2.INTER_AREA), np.uint8)


def collect(
    engine: Engine,
    sources: Sequence[tuple[Callable[[np.random.Generator], Shown], float]],
    *,
    seed: int,
) -> Iterator[Pool]:
    """The finds of one picture after the other whose masks are known, without end.

    Parameters
    ----------
    engine
        The network that finds them.
    sources
        Where pictures come from, and the share of each.
    seed
        Of all that is random.

    Raises
    ------
    InputError
        If the network finds nothing at all in picture after picture.
    """
    rng = np.random.default_rng(seed)
    share = np.array([part for _, part in sources], dtype=np.float64)

    def pictures() -> Iterator[Shown]:
        while True:
            yield sources[int(rng.choice(len(sources), p=share / share.sum()))][0](rng)

    return found_in(engine, pictures(), lambda picture: _pool(engine, picture, rng))


def _pool(engine: Engine, shown: Shown, rng: np.random.Generator) -> Pool | None:
    finds, _ = finds_in(engine, shown.image, LEAST_CONFIDENCE, second_look=bool(rng.random() < 0.5))
    if not finds or not shown.outlines:
        return None
    if shown.units and rng.random() < UNITS:
        finds = _with_units(finds, shown)
    best = _matches(finds, shown)
    learned = [
        k
        for k, find in enumerate(finds)
        if best[k] >= 0 and shown.learned[best[k]] and shown.plates[best[k]] == find.instance.plate
    ]
    if not learned:
        return None
    regions = [region(_off(find.box, rng)) for find in finds]
    patches = describe(shown.image, finds, regions)
    masks = [true_mask(shown.outlines[best[k]], regions[k]) for k in learned]
    forms = np.array([shown.forms[best[k]] for k in learned], np.uint8)
    return Pool(patches.photo[learned], patches.rough[learned], np.stack(masks), forms)


def _with_units(finds: Sequence[Find], shown: Shown) -> list[Find]:
    """Boxes around buttons and their labels instead of what was found there."""
    boxes = [
        np.concatenate([both.min(axis=0), both.max(axis=0)])
        for both in (np.concatenate([shown.outlines[k] for k in pair]) for pair in shown.units)
    ]
    like = next((f for f in finds if not f.instance.plate), None)
    if like is None:
        return list(finds)
    view = first_looks(shown.image)[0]
    rough = _rough_units(view, shown)
    units = [replace(like, box=box, view=view, mask=rough, cut=False) for box in boxes]
    inside = box_overlaps(
        [tuple(f.box.tolist()) for f in finds], [tuple(b.tolist()) for b in boxes]
    )
    others = np.all(inside.share < 0.5, axis=1).tolist()
    return [*units, *(find for find, other in zip(finds, others, strict=True) if other)]


def _rough_units(view: View, shown: Shown) -> npt.NDArray[np.float32]:
    """What a network may say of each pixel of its picture that takes units for buttons."""
    rough = np.zeros((view.rows, view.columns), np.float32)
    for pair in shown.units:
        both = view.to_network(np.concatenate([shown.outlines[k] for k in pair]))
        hull = cv2.convexHull(both.astype(np.float32))[:, 0]
        wider = hull + BEYOND * np.sign(hull - hull.mean(axis=0)) * np.ptp(hull, axis=0).min()
        points = np.rint(np.clip(wider, -FARTHEST, FARTHEST) * 2**BITS).astype(np.int32)
        cv2.fillPoly(rough, [points], (SURE,), shift=BITS)
    return np.asarray(cv2.GaussianBlur(rough, (0, 0), BLUR_PX), np.float32)


def _matches(finds: Sequence[Find], shown: Shown) -> npt.NDArray[np.intp]:
    """Which outline each find is of, (n,); -1 for none."""
    boxes = [tuple(find.box.tolist()) for find in finds]
    outlined = [(*p.min(axis=0).tolist(), *p.max(axis=0).tolist()) for p in shown.outlines]
    iou = box_overlaps(boxes, outlined).iou
    inside = box_overlaps(outlined, boxes).share.T
    best = np.where(iou.max(axis=1) >= IS, iou.argmax(axis=1), -1)
    # A label in a button's box is no second button, and the other way round.
    plates = np.array([find.instance.plate for find in finds])
    inside = np.where(plates[:, None] == np.asarray(shown.plates), inside, 0.0)
    alone = ((inside >= TOO).sum(axis=1) == 1) & (inside.max(axis=1) >= INSIDE)
    within = inside.argmax(axis=1)
    large = iou[np.arange(len(boxes)), within] >= LEAST
    wrong = (best < 0) | (np.asarray(shown.plates)[best] != plates)
    return np.where(wrong & alone & large, within, best)


def _off(box: FloatArray, rng: np.random.Generator) -> FloatArray:
    """A box that is a little off."""
    size, place = np.clip(rng.normal(size=(2, 2)), -MOST, MOST) * [[ZOOM], [SHIFT]]
    sides = box[2:] - box[:2]
    middle, half = (box[:2] + box[2:]) / 2 + place * sides, sides / 2 * np.exp(size)
    return np.concatenate([middle - half, middle + half])
