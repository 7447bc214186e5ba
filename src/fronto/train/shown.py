"""Pictures as a network may come to see them: whole or cut out, in other light, compressed."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import TypeVar

import numpy as np
import torch

from fronto.datasets.records import LabeledImage
from fronto.engine import Engine
from fronto.errors import InputError
from fronto.scales import first_look
from fronto.train.data import (
    Photos,
    Renders,
    Sample,
    Source,
    compressed,
    cut_out,
    disturb,
    disturbed,
)
from fronto.train.targets import Target

__all__ = ["found_in", "panel_sources", "shown"]

S = TypeVar("S")
P = TypeVar("P")

#: Share of the pictures that are shown as they are when the network is used: whole, not turned.
WHOLE = 0.4
#: Share of the pictures whose light, colour and sharpness are changed, and that are compressed.
DISTURBED, COMPRESSED = 0.65, 0.3
#: Pictures in a row in which a network finds nothing before it is taken for an untrained one.
MOST_IN_VAIN = 300


def panel_sources(
    photos: Sequence[LabeledImage],
    *,
    renders: float,
    twins: float,
    relief: float,
    plates: float,
    pixels: int,
) -> list[tuple[Source, float]]:
    """Photos and renders, and the share of each.

    Parameters
    ----------
    photos
        Labelled ones.
    renders
        Share of rendered panels, 0 to 1.
    twins, relief
        As `Renders` takes them.
    plates, pixels
        As `Photos` takes them.

    Raises
    ------
    InputError
        If there are no photos for their share.
    """
    sources: list[tuple[Source, float]] = []
    if renders > 0:
        sources.append((Renders(reuse=1, twins=twins, relief=relief), renders))
    if renders < 1:
        if not photos:
            raise InputError(
                "photos", "expected labelled photos, got none", "or train on renders = 1 only"
            )
        sources.append((Photos(photos, pixels, plates), 1 - renders))
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
    view = first_look(sample.image)
    objects = [
        Target(o.category, view.to_network(o.polygon), o.exact, o.ignore, o.form)
        for o in sample.objects
    ]
    return Sample(view.image, tuple(objects))
