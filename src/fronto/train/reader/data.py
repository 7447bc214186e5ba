"""Training crops: labelled boxes of photos and rendered ones, in endless batches."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple, Protocol

import cv2
import numpy as np
import numpy.typing as npt
import torch
from torch import Tensor
from torch.utils.data import DataLoader, IterableDataset

from fronto.datasets.records import LabeledImage, LabeledObject
from fronto.labels.alphabet import KINDS
from fronto.labels.targets import ReadTarget, encoded, read_target
from fronto.synth.photo.draws import pick
from fronto.train.reader.jitter import Bytes, Sample, jittered, surrounded
from fronto.train.reader.texts import Marking

__all__ = [
    "BesideCrops",
    "CropBatch",
    "CropSource",
    "PhotoCrops",
    "RenderedCrops",
    "collated",
    "crop_batches",
    "labelled_crops",
]

#: Each name comes as often as this power of its number, but names of fewer boxes than these
#: no oftener than their own: a single box would be learnt by heart.
POWER, LEAST_BOXES = 0.6, 4
#: How much oftener signs come besides: texts are of hundreds of names, which this favours.
SIGNS_SHARE = 1.8
#: Share of the rendered crops that come out of whole rendered photos.
WHOLE_PHOTOS = 0.1
#: Renders that are kept to be used again.
KEPT = 1024


class CropBatch(NamedTuple):
    """N crops and what they show.

    Parameters
    ----------
    crops
        (N, 48, 48, 3), uint8, RGB.
    kind
        (N,): numbers of `fronto.labels.alphabet.KINDS`.
    text
        (N, L): classes of the text head, from 1; 0 beyond the text's end.
    length
        (N,): characters of the text, 0 where there is none to be read.
    """

    crops: Tensor
    kind: Tensor
    text: Tensor
    length: Tensor


class CropSource(Protocol):
    """Where crops come from."""

    def draw(self, rng: np.random.Generator) -> Sample:
        """Any one, with its surroundings."""


def labelled_crops(image: LabeledImage) -> list[tuple[LabeledObject, Sample]]:
    """Cut out all of a photo's boxes whose labels say what they show.

    A plate shows its own text, and a button beside it what its own label says ("empty": a
    blank one): that the panels set's buttons beside plates show what they are labelled was
    checked by eye on all 343 of its training photos that carry a text.
    """
    from fronto.images import as_rgb

    found = [(o, read_target(o.name)) for o in image.objects if not o.ignore]
    readable = [(o, target) for o, target in found if target is not None]
    if not readable:
        return []
    photo = as_rgb(image.path)
    return [(o, surrounded(photo, o.box, target)) for o, target in readable]


class PhotoCrops:
    """Labelled boxes of photos; rare texts come oftener than their number says.

    Parameters
    ----------
    images
        The photos; they are read at the first draw.
    """

    def __init__(self, images: Sequence[LabeledImage]) -> None:
        self.images = tuple(images)
        self.samples: list[Sample] = []
        self.edges: npt.NDArray[np.float64] = np.empty(0)

    def draw(self, rng: np.random.Generator) -> Sample:
        """Draw a box."""
        if not self.samples:
            self.samples = [sample for image in self.images for _, sample in labelled_crops(image)]
            self.edges = np.cumsum(_shares([sample.target for sample in self.samples]))
        place = np.searchsorted(self.edges, rng.random() * self.edges[-1], side="right")
        return self.samples[int(place)]


def _shares(targets: Sequence[ReadTarget]) -> list[float]:
    """How often each box is to come, in proportion."""
    counts = Counter((target.kind, target.text) for target in targets)
    return [
        float(max(counts[t.kind, t.text], LEAST_BOXES)) ** (POWER - 1)
        * (1.0 if t.kind == "text" else SIGNS_SHARE)
        for t in targets
    ]


class BesideCrops:
    """Labels of other sources beside rendered knobs.

    Parameters
    ----------
    labels
        Sources of labels, and the share of each.
    knobs
        Draws the knobs.
    """

    def __init__(self, labels: Sequence[tuple[CropSource, float]], knobs: RenderedCrops) -> None:
        self.labels = tuple(labels)
        self.knobs = knobs

    def draw(self, rng: np.random.Generator) -> Sample:
        """Draw a label and put it beside a knob."""
        from fronto.train.reader.beside import beside

        source = pick(rng, [s for s, _ in self.labels], [share for _, share in self.labels])
        return beside(source.draw(rng), self.knobs.knob(rng), rng)


class RenderedCrops:
    """Rendered crops, fresh ones all the time.

    Parameters
    ----------
    fonts
        Folders of fonts besides the built-in ones.
    reuse
        How often each render is used, with other cuts and disturbances, on average.
    """

    def __init__(self, fonts: Sequence[Path] = (), reuse: int = 5) -> None:
        from fronto.train.reader.fonts import Typefaces

        self.faces = Typefaces(fonts)
        self.reuse = reuse
        self.kept: list[Sample] = []
        self.blank: list[Sample] = []

    def draw(self, rng: np.random.Generator) -> Sample:
        """Render a crop, or take one of the latest."""
        from fronto.train.reader.renders import render_crop, render_panel_crops

        if len(self.kept) >= 64 and rng.random() >= 1 / self.reuse:
            return self.kept[int(rng.integers(len(self.kept)))]
        fresh = [render_crop(rng, self.faces)]
        # A photo gives about ten crops at once.
        if rng.random() < WHOLE_PHOTOS / 10:
            fresh += render_panel_crops(rng)
        for sample in fresh:
            _keep(self.kept, sample, rng)
        return fresh[-1]

    def knob(self, rng: np.random.Generator) -> Sample:
        """Render a button without a label, or take one of the latest."""
        from fronto.train.reader.renders import render_crop

        if len(self.blank) >= 64 and rng.random() >= 1 / self.reuse:
            return self.blank[int(rng.integers(len(self.blank)))]
        fresh = render_crop(rng, self.faces, Marking(ReadTarget("blank")))
        _keep(self.blank, fresh, rng)
        return fresh


def _keep(kept: list[Sample], sample: Sample, rng: np.random.Generator) -> None:
    """Add a sample, or put it in the place of any other one."""
    if len(kept) < KEPT:
        kept.append(sample)
    else:
        kept[int(rng.integers(KEPT))] = sample


def collated(crops: Sequence[Bytes], targets: Sequence[ReadTarget]) -> CropBatch:
    """A batch of crops (48, 48, 3) and their targets."""
    texts = [encoded(target.text) for target in targets]
    text = torch.zeros(len(texts), max(1, *map(len, texts)), dtype=torch.long)
    for row, classes in zip(text, texts, strict=True):
        row[: len(classes)] = torch.tensor(classes)
    return CropBatch(
        torch.from_numpy(np.stack(crops)),
        torch.tensor([KINDS.index(target.kind) for target in targets]),
        text,
        torch.tensor([len(classes) for classes in texts]),
    )


class _Crops(IterableDataset[CropBatch]):
    """Endless batches; each worker has random numbers of its own."""

    def __init__(self, sources: Sequence[tuple[CropSource, float]], batch: int, seed: int) -> None:
        self.sources = [source for source, _ in sources]
        share = np.array([share for _, share in sources], dtype=np.float64)
        self.share = share / share.sum()
        self.batch, self.seed = batch, seed

    def __iter__(self) -> Iterator[CropBatch]:
        worker = torch.utils.data.get_worker_info()
        cv2.setNumThreads(1)
        rng = np.random.default_rng([self.seed, 0 if worker is None else worker.id])
        while True:
            chosen = rng.choice(len(self.sources), self.batch, p=self.share)
            crops = [jittered(self.sources[int(k)].draw(rng), rng) for k in chosen]
            yield collated([crop for crop, _ in crops], [target for _, target in crops])


def crop_batches(
    sources: Sequence[tuple[CropSource, float]], *, batch: int, seed: int, workers: int = 1
) -> DataLoader[CropBatch]:
    """Endless training batches.

    Parameters
    ----------
    sources
        Where crops come from, and the share of each.
    batch
        Crops in a batch, at least 2.
    seed
        Of all that is random.
    workers
        Processes that prepare batches beside the training; 0: none.
    """
    return DataLoader(
        _Crops(sources, batch, seed),
        batch_size=None,
        num_workers=workers,
        prefetch_factor=8 if workers else None,
        # Forked while OpenCV's threads run, a worker would wait for them for ever.
        multiprocessing_context="spawn" if workers else None,
    )
