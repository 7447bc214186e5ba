"""Training pictures: photos and renders, cut out, turned, and disturbed.

Turning and cutting is done here with the outlines, which stay exact; light, colour, blur,
noise and compression come from kornia.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import cv2
import numpy as np
import numpy.typing as npt
import torch
from torch import nn
from torch.utils.data import DataLoader, IterableDataset

from fronto.categories import PLATE
from fronto.datasets.records import LabeledImage
from fronto.shapes import FloatArray
from fronto.train.losses import Batch
from fronto.train.targets import Target, draw_targets

__all__ = [
    "Photos",
    "Renders",
    "Sample",
    "Source",
    "batches",
    "compressed",
    "cut_out",
    "disturb",
    "disturbed",
]


@dataclass(frozen=True, eq=False)
class Sample:
    """A labelled picture: (h, w, 3) uint8 RGB, its objects, and the scale to use it at."""

    image: npt.NDArray[np.uint8]
    objects: tuple[Target, ...]
    scale: float = 1.0


class Source(Protocol):
    """Where pictures come from."""

    def draw(self, rng: np.random.Generator) -> Sample:
        """Any one of the pictures."""


class Photos:
    """Labelled photos; objects of which only the box is known have inexact outlines.

    Parameters
    ----------
    images
        The photos.
    pixels
        Photos are scaled to this many pixels, as they are for inference.
    plates
        Share of the draws that are from photos with plates, where there are any: they are
        rare, and to take one for a button is the worst mistake.
    """

    def __init__(
        self, images: Sequence[LabeledImage], pixels: int = 640 * 480, plates: float = 0.2
    ) -> None:
        self.images = tuple(images)
        self.pixels = pixels
        self.plates = plates
        self.plated = tuple(i for i in images if any(o.category == PLATE for o in i.objects))

    def draw(self, rng: np.random.Generator) -> Sample:
        """Read one of the photos."""
        from fronto.images import as_rgb

        plated = self.plated and rng.random() < self.plates
        images = self.plated if plated else self.images
        labeled = images[int(rng.integers(len(images)))]
        objects = tuple(
            Target(
                o.category,
                _corners(o.box) if o.polygon is None else o.polygon,
                o.polygon is not None,
                o.ignore,
                o.form,
            )
            for o in labeled.objects
        )
        image = as_rgb(labeled.path)
        scale = float(np.sqrt(self.pixels / (labeled.width * labeled.height)))
        return Sample(image, objects, scale)


class Renders:
    """Rendered panels (`fronto.synth.photo`), fresh ones all the time.

    Parameters
    ----------
    reuse
        How often each render is used, with other cuts and disturbances, on average.
    twins
        Share of the renders whose plates look like the buttons beside them.
    relief
        Share of the renders whose buttons may stand out of the panel, or lie in holes.
    """

    def __init__(self, reuse: int = 4, twins: float = 0.0, relief: float = 0.0) -> None:
        self.reuse, self.twins, self.relief = reuse, twins, relief
        self.latest: list[Sample] = []

    def draw(self, rng: np.random.Generator) -> Sample:
        """Render a panel, or take one of the latest."""
        if len(self.latest) < 8 or rng.random() < 1 / self.reuse:
            self.latest.append(self._render(rng))
            if len(self.latest) > 64:
                self.latest.pop(int(rng.integers(len(self.latest) - 1)))
            return self.latest[-1]
        return self.latest[int(rng.integers(len(self.latest)))]

    def _render(self, rng: np.random.Generator) -> Sample:
        from fronto.synth.photo import render_photo

        twins, relief = (p > 0 and bool(rng.random() < p) for p in (self.twins, self.relief))
        photo = render_photo(rng, twins=twins, relief=relief)
        objects = tuple(Target(o.category, o.polygon_px, exact=True) for o in photo.objects)
        return Sample(photo.image, objects)


def _corners(box: tuple[float, float, float, float]) -> FloatArray:
    x0, y0, x1, y1 = box
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])


#: Zoom of a few cuts: buttons as large as in photos from nearby, which the others rarely show.
NEAR, NEAR_SHARE = (0.4, 1.2), 0.15
#: Zoom, change of the aspect ratio (both as logarithms), rotation in degrees of exact and
#: inexact outlines: a turned box fits its button less and less.
ZOOM, ASPECT, TURN_EXACT, TURN_BOX = (-0.45, 0.5), 0.22, 10.0, 3.0
#: Share of the cuts around some object; the others are anywhere.
AROUND = 0.85
#: Share of the pictures that are compressed once more.
COMPRESSED = 0.2


def cut_out(sample: Sample, size: int, rng: np.random.Generator) -> Sample:
    """Cut a square of `size` pixels out of a picture, zoomed, turned, stretched, mirrored.

    Objects outside of the cut are dropped.
    """
    image, objects, scale = sample.image, sample.objects, sample.scale
    exact = all(o.exact for o in objects)
    zooms = NEAR if rng.random() < NEAR_SHARE else ZOOM
    zoom = scale * float(np.exp(rng.uniform(*zooms)))
    while zoom < 0.6:
        # Linear interpolation would alias.
        half = (max(1, image.shape[1] // 2), max(1, image.shape[0] // 2))
        ratio = np.array(half) / image.shape[1::-1]
        image = np.asarray(cv2.resize(image, half, interpolation=cv2.INTER_AREA), np.uint8)
        objects = tuple(replace(o, polygon=(o.polygon + 0.5) * ratio - 0.5) for o in objects)
        zoom *= 2
    stretch = np.exp(rng.uniform(-ASPECT, ASPECT) * np.array([1, -1]))
    angle = np.radians(np.clip(rng.normal(0, TURN_EXACT if exact else TURN_BOX), -30, 30))
    cos, sin = np.cos(angle), np.sin(angle)
    A = np.array([[cos, -sin], [sin, cos]]) @ np.diag(zoom * stretch)
    if rng.random() < 0.5:
        A = A @ np.diag([-1.0, 1.0])
    if objects and rng.random() < AROUND:
        anchor = objects[int(rng.integers(len(objects)))].polygon.mean(axis=0)
        place = rng.uniform(0.1, 0.9, 2) * size
    else:
        anchor = rng.uniform(0, 1, 2) * image.shape[1::-1]
        place = np.array([size / 2, size / 2])
    shift = _within(place - A @ anchor, A, image.shape[1::-1], size)
    color = [int(c) for c in rng.integers(0, 256, 3)]
    cut = cv2.warpAffine(
        image,
        np.column_stack([A, shift]),
        (size, size),
        flags=cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_CONSTANT,
        borderValue=color,
    )
    seen = []
    for o in objects:
        polygon = o.polygon @ A.T + shift
        if (polygon.max(axis=0) > 0).all() and (polygon.min(axis=0) < size - 1).all():
            seen.append(replace(o, polygon=polygon))
    return Sample(np.asarray(cut, np.uint8), tuple(seen))


def _within(shift: FloatArray, A: FloatArray, shape: tuple[int, ...], size: int) -> FloatArray:
    """Move the picture so that it covers the cut, or lies in its middle where it is smaller."""
    width, height = shape[:2]
    corners = np.array([[0, 0], [width, 0], [width, height], [0, height]]) @ A.T + shift
    low, high = corners.min(axis=0), corners.max(axis=0)
    covers = high - low >= size
    inside = shift - np.maximum(low, 0) + np.maximum(size - high, 0)
    return np.asarray(np.where(covers, inside, shift + (size - low - high) / 2))


def disturb() -> nn.Module:
    """Light, colour, blur and noise: takes and gives (N, 3, H, W) in 0 to 1."""
    import kornia.augmentation as K

    return K.ImageSequential(
        K.RandomBrightness((0.6, 1.4), p=0.4),
        K.RandomContrast((0.6, 1.4), p=0.4),
        K.RandomSaturation((0.5, 1.6), p=0.4),
        K.RandomGamma((0.5, 1.9), p=0.4),
        K.RandomPlanckianJitter(mode="CIED", p=0.3),
        K.RandomGrayscale(p=0.08),
        K.RandomGaussianBlur((5, 5), (0.3, 1.4), p=0.15),
        K.RandomMotionBlur((3, 7), (-180.0, 180.0), (-1.0, 1.0), p=0.1),
        K.RandomGaussianNoise(0.0, 0.03, p=0.3),
    )


@torch.no_grad()
def disturbed(image: npt.NDArray[np.uint8], disturbing: nn.Module) -> npt.NDArray[np.uint8]:
    """One picture (H, W, 3), uint8, as `disturb` leaves it."""
    pixels = torch.from_numpy(np.array(image)).permute(2, 0, 1)[None].float().div_(255)
    changed = disturbing(pixels).clamp_(0, 1).mul_(255).round_().to(torch.uint8)
    return np.ascontiguousarray(changed[0].permute(1, 2, 0).numpy())


def compressed(image: npt.NDArray[np.uint8], rng: np.random.Generator) -> npt.NDArray[np.uint8]:
    """As JPEG leaves it; kornia's takes fifty times as long on a CPU."""
    quality = int(rng.integers(25, 91))
    _, content = cv2.imencode(".jpg", image, [cv2.IMWRITE_JPEG_QUALITY, quality])
    return np.asarray(cv2.imdecode(content, cv2.IMREAD_UNCHANGED), np.uint8)


class _Samples(IterableDataset[Batch]):
    """Endless batches; each worker has random numbers of its own."""

    def __init__(
        self, sources: Sequence[tuple[Source, float]], batch: int, size: int, seed: int
    ) -> None:
        self.sources = [source for source, _ in sources]
        share = np.array([share for _, share in sources], dtype=np.float64)
        self.share = share / share.sum()
        self.batch, self.size, self.seed = batch, size, seed

    def __iter__(self) -> Iterator[Batch]:
        worker = torch.utils.data.get_worker_info()
        number = 0 if worker is None else worker.id
        cv2.setNumThreads(1)
        torch.manual_seed(self.seed * 1000 + number)
        rng = np.random.default_rng([self.seed, number])
        disturbing = disturb()
        while True:
            yield self._batch(rng, disturbing)

    @torch.no_grad()
    def _batch(self, rng: np.random.Generator, disturbing: nn.Module) -> Batch:
        images, targets = [], []
        for _ in range(self.batch):
            source = self.sources[int(rng.choice(len(self.sources), p=self.share))]
            cut = cut_out(source.draw(rng), self.size, rng)
            compress = rng.random() < COMPRESSED
            images.append(compressed(cut.image, rng) if compress else cut.image)
            targets.append(draw_targets(cut.objects, self.size, self.size))
        image = torch.from_numpy(np.stack(images)).permute(0, 3, 1, 2).float().div_(255)
        parts = {
            name: torch.from_numpy(np.stack([getattr(t, name) for t in targets]))
            for name in Batch._fields[1:]
        }
        return Batch(disturbing(image).clamp_(0, 1), **parts)


def batches(
    sources: Sequence[tuple[Source, float]],
    *,
    batch: int,
    size: int,
    seed: int,
    workers: int = 1,
) -> DataLoader[Batch]:
    """Endless training batches.

    Parameters
    ----------
    sources
        Where pictures come from, and the share of each.
    batch, size
        Pictures in a batch, and their side in pixels (a multiple of 16).
    seed
        Of all that is random.
    workers
        Processes that prepare batches beside the training; 0: none.
    """
    return DataLoader(
        _Samples(sources, batch, size, seed),
        batch_size=None,
        num_workers=workers,
        prefetch_factor=4 if workers else None,
        # Forked while OpenCV's threads run, a worker would wait for them for ever.
        multiprocessing_context="spawn" if workers else None,
    )
