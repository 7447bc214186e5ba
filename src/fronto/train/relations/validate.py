"""Figures of a relation head in training, by the same way that photos take when it is used."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import cast

import torch

from fronto.datasets.records import LabeledImage
from fronto.engine import Engine, RelationEngine, Verdicts
from fronto.relations import Candidates
from fronto.train.relations.network import RelationNetwork
from fronto.train.validate import validation_of

__all__ = ["TorchRelations", "relation_validation"]


class TorchRelations:
    """What `fronto.judging` needs of a `fronto.engine.RelationEngine`, run by PyTorch.

    Parameters
    ----------
    network
        In evaluation mode.
    """

    def __init__(self, network: RelationNetwork) -> None:
        self.network = network

    @torch.no_grad()
    def run(self, candidates: Candidates) -> Verdicts:
        """Judge the candidates of one picture."""
        device = next(self.network.parameters()).device
        looks, geometry, pairs = (
            torch.from_numpy(part).to(device)[None]
            for part in (candidates.looks, candidates.geometry, candidates.pairs)
        )
        there = torch.ones(looks.shape[:2], dtype=torch.bool, device=device)
        told = self.network(looks, geometry, pairs, there)
        parts = (told.kinds.softmax(-1), told.classes.softmax(-1), told.shifts)
        return Verdicts(*(part[0].cpu().numpy() for part in parts))


def relation_validation(
    engine: Engine, images: Sequence[LabeledImage], at_most: int = 100
) -> Callable[[RelationNetwork], dict[str, float]]:
    """Make what `fronto.train.relations.fit.fit_relations` calls at each checkpoint.

    Parameters
    ----------
    engine
        The network that the head is for.
    images
        Labelled photos that are not trained on.
    at_most
        Of more, this many are taken, evenly spread over them.

    Returns
    -------
    A function that gives precision, recall and F1 of the buttons at IoU 0.5 of the boxes.
    """

    def figures(network: RelationNetwork) -> dict[str, float]:
        before = engine.relations
        engine.relations = cast(RelationEngine, TorchRelations(network))
        try:
            return validation_of(engine, images, at_most)
        finally:
            engine.relations = before

    return figures
