"""Training pictures: outlines stay on what they outline, and a seed gives the same again."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from PIL import Image

torch = pytest.importorskip("torch")
pytest.importorskip("kornia")

from fronto.datasets.records import LabeledImage, LabeledObject
from fronto.train.data import Photos, Renders, Sample, batches, cut_out
from fronto.train.targets import Target

PENTAGON = np.array([[300, 180], [352, 191], [360.5, 240], [318, 262], [290, 221.0]])


def drawn(polygon: np.ndarray, width: int, height: int) -> np.ndarray:
    """A white convex polygon on black; edge pixels by the share of 8 x 8 points inside."""
    grey = np.zeros((height, width))
    (x0, y0), (x1, y1) = polygon.min(axis=0).astype(int), polygon.max(axis=0).astype(int) + 2
    steps = (np.arange(8) - 3.5) / 8
    x = (np.arange(x0, x1)[:, None] + steps).ravel()
    y = (np.arange(y0, y1)[:, None] + steps).ravel()[:, None]
    inside = np.ones((len(y), len(x)), bool)
    for (ax, ay), (bx, by) in zip(polygon, np.roll(polygon, -1, axis=0), strict=True):
        inside &= (bx - ax) * (y - ay) - (by - ay) * (x - ax) > 0
    grey[y0:y1, x0:x1] = inside.reshape(y1 - y0, 8, x1 - x0, 8).mean(axis=(1, 3))
    return np.repeat(np.rint(255 * grey).astype(np.uint8)[..., None], 3, axis=2)


def moments(polygon: np.ndarray) -> tuple[float, np.ndarray]:
    """Area, below 0 where mirrored, and centroid (Green's theorem)."""
    x, y = polygon.T
    cross = x * np.roll(y, -1) - np.roll(x, -1) * y
    area = cross.sum() / 2
    cx = ((x + np.roll(x, -1)) * cross).sum() / (6 * area)
    cy = ((y + np.roll(y, -1)) * cross).sum() / (6 * area)
    return float(area), np.array([cx, cy])


@pytest.mark.parametrize("scale", [1.0, 0.3])
def test_outlines_stay_where_the_picture_goes(scale: float) -> None:
    sample = Sample(drawn(PENTAGON, 640, 480), (Target("up", PENTAGON, True),), scale)
    offsets = []
    turned = set()
    for seed in range(120):
        cut = cut_out(sample, 160, np.random.default_rng(seed))
        assert cut.image.shape == (160, 160, 3)
        if not cut.objects:
            continue
        polygon = cut.objects[0].polygon
        low, high = polygon.min(axis=0) - 3, polygon.max(axis=0) + 4
        if (low < 0).any() or (high > 160).any():
            continue
        (x0, y0), (x1, y1) = low.astype(int), high.astype(int)
        part = cut.image[y0:y1, x0:x1, 0] / 255.0
        area, centroid = moments(polygon)
        assert part.sum() == pytest.approx(abs(area), rel=0.01)
        rows, columns = np.mgrid[y0:y1, x0:x1]
        seen = np.array([(part * columns).sum(), (part * rows).sum()]) / part.sum()
        offsets.append(seen - centroid)
        turned.add(float(np.sign(area)))
    assert len(offsets) > 15
    assert np.abs(offsets).max() < 0.05
    assert turned == {-1.0, 1.0}  # mirrored or not


def test_some_cuts_show_buttons_as_from_nearby() -> None:
    sample = Sample(drawn(PENTAGON, 640, 480), (Target("up", PENTAGON, True),), 1.0)
    area = abs(moments(PENTAGON)[0])
    cuts = [cut_out(sample, 160, np.random.default_rng(seed)) for seed in range(400)]
    zooms = [np.sqrt(abs(moments(c.objects[0].polygon)[0]) / area) for c in cuts if c.objects]
    assert 0.03 < np.mean(np.array(zooms) > 2) < 0.25
    assert max(zooms) < 3.5


def test_cuts_of_a_large_picture_show_little_else() -> None:
    image = np.full((1200, 1600, 3), 200, np.uint8)
    shares = []
    for seed in range(30):
        cut = cut_out(Sample(image, (), 1.0), 64, np.random.default_rng(seed))
        assert cut.objects == ()
        shares.append((cut.image == 200).mean())
    # Only where it is turned does a corner of the cut reach beyond a corner of the picture.
    assert np.median(shares) == 1
    assert np.mean(shares) > 0.9


def test_what_lies_outside_of_the_cut_is_dropped() -> None:
    image = np.zeros((1000, 1000, 3), np.uint8)
    square = np.array([[0, 0], [20, 0], [20, 20], [0, 20.0]])
    objects = tuple(
        Target("up", np.add(square, [x, y]), True) for x in (10, 960) for y in (10, 960)
    )
    for seed in range(20):
        cut = cut_out(Sample(image, objects), 128, np.random.default_rng(seed))
        assert len(cut.objects) <= 1
        for o in cut.objects:
            assert (o.polygon.max(axis=0) > 0).all()
            assert (o.polygon.min(axis=0) < 127).all()


def test_photos(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    Image.fromarray(np.full((60, 80, 3), 7, np.uint8)).save(path)
    triangle = np.array([[5, 5], [20, 5], [5, 20.0]])
    objects = (
        LabeledObject("up", (10, 20, 30, 40), None, "up"),
        LabeledObject("down", (5, 5, 20, 20), triangle, "down", ignore=True),
    )
    source = Photos([LabeledImage(path, 80, 60, objects)], pixels=4800 * 4)
    sample = source.draw(np.random.default_rng(0))
    assert sample.scale == pytest.approx(2)
    assert sample.image.shape == (60, 80, 3)
    first, second = sample.objects
    assert (first.category, first.exact, first.ignore) == ("up", False, False)
    assert np.array_equal(first.polygon, [[10, 20], [30, 20], [30, 40], [10, 40]])
    assert (second.exact, second.ignore) == (True, True)
    assert np.array_equal(second.polygon, triangle)


def test_photos_with_plates_are_drawn_more_often(tmp_path: Path) -> None:
    labeled = []
    for k in range(10):
        path = tmp_path / f"{k}.png"
        Image.fromarray(np.full((40, 40, 3), k, np.uint8)).save(path)
        category = "plate" if k == 7 else "number"
        box = LabeledObject(category, (5, 5, 20, 20), None, "1")
        labeled.append(LabeledImage(path, 40, 40, (box,)))
    rng = np.random.default_rng(0)
    drawn_7 = [
        np.mean([source.draw(rng).image[0, 0, 0] == 7 for _ in range(200)])
        for source in (Photos(labeled, plates=0.0), Photos(labeled, plates=0.5))
    ]
    assert drawn_7[0] == pytest.approx(0.1, abs=0.06)
    assert drawn_7[1] == pytest.approx(0.55, abs=0.1)


def test_sixteen_bit_photos_keep_their_looks(tmp_path: Path) -> None:
    path = tmp_path / "deep.png"
    Image.fromarray(np.full((60, 80), 40_000, np.uint16)).save(path)
    source = Photos([LabeledImage(path, 80, 60, ())])
    image = source.draw(np.random.default_rng(0)).image
    assert image.dtype == np.uint8
    assert (image == 40_000 >> 8).all()


def test_renders_are_used_again_but_not_only() -> None:
    source = Renders(reuse=4)
    rng = np.random.default_rng(0)
    taken = [source.draw(rng) for _ in range(14)]
    different = len({id(sample) for sample in taken})
    assert 8 <= different < 14
    assert all(o.exact for sample in taken for o in sample.objects)
    assert sum(len(sample.objects) for sample in taken) > 20


class Squares:
    """A source that costs nothing."""

    def draw(self, rng: np.random.Generator) -> Sample:
        image = rng.integers(0, 256, (96, 96, 3), dtype=np.uint8)
        square = np.array([[20, 20], [60, 20], [60, 60], [20, 60.0]]) + rng.uniform(-9, 9, 2)
        return Sample(image, (Target("number", square, True),))


def first_batches(seed: int, count: int = 2) -> list[torch.Tensor]:
    loader = iter(batches([(Squares(), 1.0)], batch=3, size=64, seed=seed, workers=0))
    return [part for _ in range(count) for part in next(loader)]


def test_batches_are_those_of_the_seed() -> None:
    first, again, other = first_batches(3), first_batches(3), first_batches(4)
    assert all(torch.equal(a, b) for a, b in zip(first, again, strict=True))
    assert not torch.equal(first[0], other[0])
    assert not torch.equal(first[0], first[7])


def test_a_batch_is_what_the_losses_take() -> None:
    image, masks, classes, weights, centers, sides, inside = first_batches(0, 1)
    assert image.shape == (3, 3, 64, 64)
    assert image.dtype == torch.float32
    assert 0 <= float(image.min()) < float(image.max()) <= 1
    assert masks.shape == (3, 64, 64)
    assert classes.shape == weights.shape == inside.shape == (3, 16, 16)
    assert centers.shape == (3, 2, 16, 16)
    assert sides.shape == (3, 4, 16, 16)


def test_sources_are_drawn_by_their_shares() -> None:
    class Grey(Squares):
        def __init__(self) -> None:
            self.count = 0

        def draw(self, rng: np.random.Generator) -> Sample:
            self.count += 1
            return super().draw(rng)

    often, never = Grey(), Grey()
    next(iter(batches([(often, 2.0), (never, 0.0)], batch=6, size=64, seed=0, workers=0)))
    assert (often.count, never.count) == (6, 0)


def test_a_worker_after_opencv_has_run_in_threads() -> None:
    """A forked worker would inherit OpenCV's pool of threads without the threads, and wait."""
    large = np.zeros((600, 800, 3), np.uint8)
    cv2.GaussianBlur(cv2.resize(large, None, fx=2, fy=2), (0, 0), 3)
    loader = iter(batches([(Renders(), 1.0)], batch=1, size=64, seed=3, workers=1))
    assert next(loader).image.shape == (1, 3, 64, 64)
