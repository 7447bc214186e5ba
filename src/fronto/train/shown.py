"""Pictures as a network may come to see them: whole or cut out, in other light, compressed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from fronto.datasets.records import LabeledImage
from fronto.engine import Engine
from fronto.errors import InputError
from fronto.scales import first_look

if TYPE_CHECKING:
    from fronto.train.data import Sample, Source

__all__ = ["COLLECTED", "ShownOptions", "found_in", "shown"]

S = TypeVar("S")
P = TypeVar("P")

#: Options that decide what is found.
COLLECTED = ("photos", "renders", "twins", "relief", "plates", "pixels", "size", "seed")
#: Share of the pictures that are shown as they are when the network is used: whole, not turned.
WHOLE = 0.4
#: Share of the pictures whose light, colour and sharpness are changed, and that are compressed.
DISTURBED, COMPRESSED = 0.65, 0.3
#: Pictures in a row in which a network finds nothing before it is taken for an untrained one.
MOST_IN_VAIN = 300


@dataclass(frozen=True)
class ShownOptions:
    """Which pictures a network is shown, so that a head learns from what it finds.

    Parameters
    ----------
    pictures
        How many before training begins.
    renders
        Share of rendered panels among them, 0 to 1.
    twins
        Share of the renders whose plates look like the buttons beside them, 0 to 1.
    relief
        Share of the renders whose buttons may stand out of the panel, or lie in holes, 0 to 1.
    plates
        Share of the photos drawn that have plates, where there are any, 0 to 1.
    pixels
        Photos are scaled to this many pixels, as for inference.
    size
        Side of the pictures that are cut out, pixels; a multiple of 16.
    seed
        Of the pictures.

    Raises
    ------
    InputError
        Naming the field that is out of range.
    """

    pictures: int = 16_000
    renders: float = 0.25
    twins: float = 0.3
    relief: float = 0.3
    plates: float = 0.2
    pixels: int = 640 * 480
    size: int = 560
    seed: int = 0

    def __post_init__(self) -> None:
        for name in ("renders", "twins", "relief", "plates"):
            share = getattr(self, name)
            if not 0 <= share <= 1:
                raise InputError(name, f"expected a share from 0 to 1, got {share:g}")
        least = (("pictures", self.pictures, 1), ("pixels", self.pixels, 4096))
        for name, value, lowest in (*least, ("size", self.size, 64)):
            if value < lowest:
                raise InputError(name, f"expected {lowest} or more, got {value}")
        if self.size % 16:
            raise InputError("size", f"expected a multiple of 16, got {self.size}")

    def sources(self, photos: Sequence[LabeledImage]) -> list[tuple[Source, float]]:
        """Labelled photos and renders, and the share of each.

        Raises
        ------
        InputError
            If there are no photos for their share.
        """
        from fronto.train.data import Photos, Renders

        sources: list[tuple[Source, float]] = []
        if self.renders > 0:
            drawn = Renders(reuse=1, twins=self.twins, relief=self.relief)
            sources.append((drawn, self.renders))
        if self.renders < 1:
            if not photos:
                raise InputError(
                    "photos", "expected labelled photos, got none", "or train on renders = 1 only"
                )
            sources.append((Photos(photos, self.pixels, self.plates), 1 - self.renders))
        return sources


def shown(sources: Sequence[tuple[Source, float]], *, size: int, seed: int) -> Iterator[Sample]:
    """Pictures without end, their objects in their own pixels.

    Parameters
    ----------
    sources
        Where pictures come from, and the share of each.
    size
        Side of a cut, a multiple of 16: large enough for a whole panel.
    seed
        Of all that is random.
    """
    import torch

    from fronto.train.data import Sample, compressed, cut_out, disturb, disturbed

    rng = np.random.default_rng(seed)
    torch.manual_seed(seed)
    disturbing = disturb()
    share = np.array([part for _, part in sources], dtype=np.float64)
    while True:
        source = sources[int(rng.choice(len(sources), p=share / share.sum()))][0]
        sample = source.draw(rng)
        seen = _whole(sample) if rng.random() < WHOLE else cut_out(sample, size, rng)
        image = seen.image
        if rng.random() < DISTURBED:
            image = disturbed(image, disturbing)
        if rng.random() < COMPRESSED:
            image = compressed(image, rng)
        yield Sample(image, seen.objects)


def found_in(engine: Engine, samples: Iterator[S], look: Callable[[S], P | None]) -> Iterator[P]:
    """What is found in one picture after the other, without those in which nothing is.

    Parameters
    ----------
    engine
        The network that looks at them.
    samples
        The pictures.
    look
        From a picture to what is found there; None for nothing.

    Raises
    ------
    InputError
        If the network finds nothing at all in picture after picture.
    """
    in_vain = 0
    for sample in samples:
        found = look(sample)
        in_vain = 0 if found is not None else in_vain + 1
        if found is not None:
            yield found
        if in_vain >= MOST_IN_VAIN:
            break
    raise InputError(
        f"weights {engine.path}",
        f"expected a network that finds buttons, it found none in {in_vain} pictures in a row",
        "train it first",
    )


def _whole(sample: Sample) -> Sample:
    """The picture as the network sees it when it is used."""
    from fronto.train.data import Sample
    from fronto.train.targets import Target

    view = first_look(sample.image)
    objects = [
        Target(o.category, view.to_network(o.polygon), o.exact, o.ignore, o.form)
        for o in sample.objects
    ]
    return Sample(view.image, tuple(objects))
