"""From the network's maps to instances: candidates, and what the relation head makes of them."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from fronto.grouping import Instance, distinct, group
from fronto.relations import candidates, describe, shifted

if TYPE_CHECKING:
    from collections.abc import Sequence

    from fronto.engine import Engine, Maps, Verdicts

__all__ = ["instances", "judged"]

#: Two judged boxes that overlap this much (intersection over union) are one thing.
SAME = 0.5
#: What is nothing with this probability or more is not worth a mask.
NOTHING = 0.95


def instances(engine: Engine, maps: Maps, shape: tuple[int, int]) -> list[Instance]:
    """The buttons and plates of one picture, surest first.

    Parameters
    ----------
    engine
        Whose maps they are. Without a relation head, each centre is judged by itself.
    maps
        Of one picture.
    shape
        Its height and width.
    """
    centers, sides, classes = maps.centers[0], maps.sides[0], maps.classes[0]
    if engine.relations is None or maps.features is None:
        return group(centers, sides, classes, engine.stride)
    found = candidates(centers, sides, classes, engine.stride)
    if not found:
        return []
    told = describe(found, maps.features[0], engine.stride, shape)
    return judged(found, engine.relations.run(told))


def judged(found: Sequence[Instance], verdicts: Verdicts) -> list[Instance]:
    """Candidates as the relation head sees them: kind, confidence, box and classes.

    Parameters
    ----------
    found
        The candidates.
    verdicts
        Of the head, in the same order.

    Returns
    -------
    Those that are something, surest first; of several on the same thing the surest.
    """
    kinds = verdicts.kinds.astype(np.float64)
    boxes = shifted(np.array([i.box for i in found], dtype=np.float64), verdicts.shifts)
    plate = kinds[:, 2] > kinds[:, 1]
    confidence = kinds[:, 1:].max(axis=1)
    order = np.argsort(-confidence, kind="stable")
    order = order[kinds[order, 0] < NOTHING]
    kept = order[distinct(boxes[order], SAME)]
    result = []
    for k in kept:
        buttons = verdicts.classes[k, 1:-1].astype(np.float64)
        named = kinds[k, 1] * buttons / max(float(buttons.sum()), 1e-9)
        x0, y0, x1, y1 = boxes[k].tolist()
        scores = np.array([kinds[k, 0], *named, kinds[k, 2]])
        result.append(Instance(bool(plate[k]), float(confidence[k]), (x0, y0, x1, y1), scores))
    return result
