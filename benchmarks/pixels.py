"""What each kind of error costs in mIoU: the same finds, with one kind of error taken away."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import numpy as np

from fronto.categories import PLATE
from fronto.datasets.records import LabeledImage
from fronto.evaluate.pixels import PIXEL_CLASSES, class_iou
from fronto.evaluate.regions import Region, polygon_region
from fronto.segments import Segments
from report import markdown_table

#: A find is of what it overlaps by this much (intersection over union), whatever it is called.
SAME = 0.4
NOTHING = -1
WAYS = (
    "as it is",
    "masks of what is found were exact",
    "buttons and plates were never mixed up",
    "nothing was found that is not there",
    "nothing was missed",
    "all but the masks",
)


def whose(regions: Iterable[Region], width: int, height: int) -> np.ndarray:
    """Number of the last region at each pixel, (h, w); -1 where there is none."""
    result = np.full((height, width), NOTHING)
    for k, region in enumerate(regions):
        x0, y0, x1, y1 = region.bounds()
        x0, y0, x1, y1 = max(x0, 0), max(y0, 0), min(x1, width), min(y1, height)
        if x0 < x1 and y0 < y1:
            result[y0:y1, x0:x1][region.cut(x0, y0, x1, y1)] = k
    return result


def kind(category: str) -> int:
    return 1 + (category == PLATE)


def matches(truth: np.ndarray, found: np.ndarray) -> dict[int, int]:
    """Which find is of which thing, from whose the pixels are: thing to find."""
    common = np.stack([truth, found])[:, (truth >= 0) & (found >= 0)]
    result = {}
    pairs, shared = np.unique(common, axis=1, return_counts=True)
    for (thing, find), count in zip(pairs.T.tolist(), shared.tolist(), strict=True):
        union = np.count_nonzero(truth == thing) + np.count_nonzero(found == find) - count
        if count > SAME * union:
            result[thing] = find
    return result


def confusions(image: LabeledImage, segments: Segments) -> np.ndarray:
    """Pixels by what they are and are taken for, (6, 3, 3): one of each of `WAYS`."""
    width, height = image.width, image.height
    things = sorted(image.objects, key=lambda o: o.category != PLATE)
    finds = sorted(segments.segments, key=lambda s: (s.confidence, s.box_px, s.category))
    polygons = [thing.polygon for thing in things if thing.polygon is not None]
    truth = whose((polygon_region(p, width, height) for p in polygons), width, height)
    found = whose((Region(s.origin_px, s.mask) for s in finds), width, height)
    of = matches(truth, found)
    things_are = np.array([*(kind(t.category) for t in things), 0])  # the last: where nothing is
    finds_are = np.array([*(kind(s.category) for s in finds), 0])
    false = np.array([k not in of.values() for k in range(len(finds))] + [False])
    missed = np.array([k not in of for k in range(len(things))] + [False])

    plain = finds_are[found]
    exact = np.where(false[found], plain, 0)
    for thing, find in of.items():
        exact[truth == thing] = finds_are[find]
    called = finds_are.copy()
    for thing, find in of.items():
        called[find] = things_are[thing]
    filled = np.where(missed[truth], things_are[truth], plain)
    masks = np.where(missed[truth], things_are[truth], np.where(false[found], 0, called[found]))
    ways = (plain, exact, called[found], np.where(false[found], 0, plain), filled, masks)
    n = len(PIXEL_CLASSES)
    counts = [np.bincount((n * things_are[truth] + way).ravel(), minlength=n * n) for way in ways]
    return np.array(counts).reshape(len(ways), n, n)


def costs_table(images: Iterable[LabeledImage], predict: Callable[[LabeledImage], Segments]) -> str:
    total = sum(confusions(image, predict(image)) for image in images)
    rows = []
    for name, counts in zip(WAYS, total, strict=True):
        iou = class_iou(counts)
        row = {"if": name, "mIoU": f"{iou.mean():.3f}"}
        rows.append(row | dict(zip(PIXEL_CLASSES, (f"{v:.3f}" for v in iou), strict=True)))
    return markdown_table(rows)
