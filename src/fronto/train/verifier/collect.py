"""From labelled pictures to patches around finds of which it is known what they are."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from fronto.engine import Engine
from fronto.grouping import group
from fronto.patches import photo_patch, region
from fronto.train.data import Sample, Source
from fronto.train.relations.collect import judge_candidates
from fronto.train.shown import found_in, shown
from fronto.train.verifier.pool import WIDER_REACH, WIDER_SIDE, VerifierPool

__all__ = ["collect"]

#: Least probability of a centre that is looked at, and most of a picture: what a network suspects
#: of the photos that it was trained on is seldom wrong unless it is hardly suspected.
LEAST_CENTER, MOST = 0.05, 120
#: Of a picture are kept at most so many buttons, and so many other things.
BUTTONS, OTHERS = 8, 14


def collect(
    engine: Engine, sources: Sequence[tuple[Source, float]], *, size: int, seed: int
) -> Iterator[VerifierPool]:
    """What the network suspects in one picture after the other, without end.

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
    rng = np.random.default_rng([seed, 1])
    pictures = shown(sources, size=size, seed=seed)
    return found_in(engine, pictures, lambda sample: _pool(engine, sample, rng))


def _pool(engine: Engine, sample: Sample, rng: np.random.Generator) -> VerifierPool | None:
    maps = engine.run(sample.image[None], features=False)
    found = group(
        maps.centers[0], maps.sides[0], maps.classes[0], engine.stride, least=LEAST_CENTER
    )[:MOST]
    if not found:
        return None
    boxes = np.array([i.box for i in found])
    kinds, classes, _ = judge_candidates(boxes, sample.objects, sample.image.shape)
    buttons = rng.permutation(np.flatnonzero(kinds == 1))[:BUTTONS]
    others = rng.permutation(np.flatnonzero((kinds == 0) | (kinds == 2)))[:OTHERS]
    chosen = [*buttons.tolist(), *others.tolist()]
    if not chosen:
        return None
    classes[classes < 0] = VerifierPool.UNKNOWN
    return VerifierPool(
        np.stack(
            [photo_patch(sample.image, region(boxes[k], WIDER_REACH), WIDER_SIDE) for k in chosen]
        ),
        kinds[chosen].astype(np.uint8),
        classes[chosen].astype(np.uint8),
    )
