"""From labelled pictures to candidates that are known to be buttons, plates or nothing."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from fronto.categories import CATEGORIES, PLATE
from fronto.engine import Engine
from fronto.evaluate.regions import box_overlaps
from fronto.relations import candidates, looks
from fronto.shapes import FloatArray
from fronto.train.data import Source
from fronto.train.relations.pool import Picture
from fronto.train.shown import found_in, shown
from fronto.train.targets import Target

__all__ = ["collect", "judge_candidates"]

#: A candidate is what it overlaps by this much (intersection over union); between the two there
#: is no verdict, but the way to the labelled box is known.
IS, NEAR = 0.5, 0.4
#: A candidate of which this share lies in what is to be ignored has no verdict; an object of
#: which less is in the picture is to be ignored.
IGNORED, SEEN = 0.5, 0.5


def collect(
    engine: Engine, sources: Sequence[tuple[Source, float]], *, size: int, seed: int
) -> Iterator[Picture]:
    """Candidates of one picture after the other, without end.

    Parameters
    ----------
    engine
        The network.
    sources
        Where pictures come from, and the share of each.
    size
        Side of a cut, a multiple of 16: large enough for a whole panel.
    seed
        Of all that is random.

    Raises
    ------
    InputError
        If the network finds nothing at all in picture after picture.
    """
    return found_in(
        engine,
        shown(sources, size=size, seed=seed),
        lambda sample: _picture(engine, sample.image, sample.objects),
    )


def _picture(
    engine: Engine, image: npt.NDArray[np.uint8], objects: Sequence[Target]
) -> Picture | None:
    maps = engine.run(image[None], features=True)
    assert maps.features is not None
    found = candidates(maps.centers[0], maps.sides[0], maps.classes[0], engine.stride)
    if not found:
        return None
    boxes = np.array([i.box for i in found])
    kinds, classes, shifts = judge_candidates(boxes, objects, image.shape)
    return Picture(
        shape=(image.shape[0], image.shape[1]),
        looks=looks(boxes, maps.features[0], engine.stride).astype(np.float16),
        boxes=boxes,
        confidence=np.array([i.confidence for i in found]),
        plates=np.array([i.plate for i in found]),
        scores=np.stack([i.scores for i in found]),
        kinds=kinds,
        classes=classes,
        shifts=shifts,
    )


def judge_candidates(
    boxes: FloatArray, objects: Sequence[Target], shape: tuple[int, ...]
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.int64], FloatArray]:
    """What candidates are, by the labels.

    Parameters
    ----------
    boxes
        Shape (n, 4), of the candidates.
    objects
        The labels.
    shape
        Of the picture: height, width, ...

    Returns
    -------
    kinds, classes, shifts
        As `fronto.train.relations.pool.Picture` has them.
    """
    kinds = np.zeros(len(boxes), np.int64)
    classes = np.full(len(boxes), -1)
    shifts = np.full((len(boxes), 4), np.nan)
    there = [(o, *_seen(o, shape)) for o in objects]
    known = [(o, box) for o, box, share in there if not o.ignore and share >= SEEN]
    left_out = [box for o, box, share in there if share > 0 and (o.ignore or share < SEEN)]
    rows = [tuple(box) for box in boxes.tolist()]
    if left_out:
        kinds[(box_overlaps(rows, left_out).share >= IGNORED).any(axis=1)] = -1
    if known:
        labelled = np.array([box for _, box in known])
        iou = box_overlaps(rows, [box for _, box in known]).iou
        best, overlap = iou.argmax(axis=1), iou.max(axis=1)
        kinds[overlap >= NEAR] = -1
        near = np.flatnonzero(overlap >= NEAR)
        sides = boxes[near, 2:] - boxes[near, :2]
        off = labelled[best[near]] - boxes[near]
        shifts[near] = off / np.concatenate([sides, sides], axis=1)
        for k in np.flatnonzero(overlap >= IS):
            category = known[best[k]][0].category
            kinds[k] = 2 if category == PLATE else 1
            classes[k] = CATEGORIES.index(category) if category in CATEGORIES else -1
    return kinds, classes, shifts


def _seen(
    target: Target, shape: tuple[int, ...]
) -> tuple[tuple[float, float, float, float], float]:
    """The box of what the picture shows of an object, and the share that this is of it."""
    if target.exact:
        low, high = target.polygon.min(axis=0), target.polygon.max(axis=0)
    else:
        # The corners of a box that was turned with the picture: the button did not grow by that.
        middle = target.polygon.mean(axis=0)
        across, down = (np.linalg.norm(target.polygon[k] - target.polygon[0]) for k in (1, 3))
        half = np.array([across, down]) / 2
        low, high = middle - half, middle + half
    edge = np.array([shape[1], shape[0]]) - 0.5
    left, right = np.clip(low, -0.5, edge), np.clip(high, -0.5, edge)
    share = float((right - left).prod() / max(float((high - low).prod()), 1e-9))
    return (float(left[0]), float(left[1]), float(right[0]), float(right[1])), share
