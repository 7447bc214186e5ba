"""How the relation head is trained: batches of pictures, and their losses."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from fronto.errors import InputError
from fronto.relations import GEOMETRY, PAIR, geometry, pairs
from fronto.train.loop import LoopOptions, train_loop
from fronto.train.relations.network import Judgement, RelationNetwork, RelationOptions
from fronto.train.relations.pool import Picture
from fronto.train.runs import module_state, read_checkpoint

__all__ = [
    "RelationBatch",
    "RelationFit",
    "RelationLosses",
    "batch_of",
    "fit_relations",
    "load_relations",
    "relation_losses",
]

KIND = "the .pt file of a relation head's run"
#: Labels have errors.
SMOOTHING = 0.02
#: What plates count against buttons: they are rare, and to press one is the worst mistake.
PLATE = 2.0
#: Weights of the classes and of the shifts beside the kinds.
CLASSES, SHIFTS = 0.3, 4.0
#: Shifts of less than this share of a side are punished by their squares.
FINE = 0.05
#: Share of the pictures that lose some of their candidates, and most that one loses: a panel is
#: not always found as a whole.
THINNED, MOST_LOST = 0.6, 0.4


@dataclass(frozen=True)
class RelationFit(LoopOptions):
    """How to train: as `fronto.train.loop.LoopOptions`, and what is left out.

    Parameters
    ----------
    features
        Share of the features' channels that are left out of a candidate in training.

    Raises
    ------
    InputError
        Naming the field that is out of range.
    """

    features: float = 0.1

    def __post_init__(self) -> None:
        super().__post_init__()
        if not 0 <= self.features < 1:
            raise InputError("features", f"expected 0 or more and below 1, got {self.features:g}")


class RelationBatch(NamedTuple):
    """Candidates of B pictures, filled up to N each.

    Parameters
    ----------
    looks
        (M, 49, C): of those that are there, one picture after another.
    geometry, pairs, there
        What `RelationNetwork` takes.
    kinds, classes
        (B, N): as `Picture` has them, -1 for no verdict.
    shifts
        (B, N, 4): NaN for no verdict.
    """

    looks: Tensor
    geometry: Tensor
    pairs: Tensor
    there: Tensor
    kinds: Tensor
    classes: Tensor
    shifts: Tensor


class RelationLosses(NamedTuple):
    """Means over a batch.

    Parameters
    ----------
    total
        What is minimised.
    kinds, classes
        Cross entropies.
    shifts
        Smooth absolute differences, in sides of the boxes.
    """

    total: Tensor
    kinds: Tensor
    classes: Tensor
    shifts: Tensor


def batch_of(pictures: Sequence[Picture]) -> RelationBatch:
    """Put pictures into one batch."""
    b, n = len(pictures), max(len(p.boxes) for p in pictures)
    batch = RelationBatch(
        torch.from_numpy(np.concatenate([p.looks for p in pictures])).float(),
        torch.zeros(b, n, GEOMETRY),
        torch.zeros(b, n, n, PAIR),
        torch.zeros(b, n, dtype=torch.bool),
        torch.full((b, n), -1),
        torch.full((b, n), -1),
        torch.full((b, n, 4), torch.nan),
    )
    for k, p in enumerate(pictures):
        m = len(p.boxes)
        told = geometry(p.boxes, p.confidence, p.plates, p.scores, p.shape)
        batch.geometry[k, :m] = torch.from_numpy(told)
        batch.pairs[k, :m, :m] = torch.from_numpy(pairs(p.boxes))
        batch.there[k, :m] = True
        batch.kinds[k, :m] = torch.from_numpy(p.kinds)
        batch.classes[k, :m] = torch.from_numpy(p.classes)
        batch.shifts[k, :m] = torch.from_numpy(p.shifts)
    return batch


def relation_losses(told: Judgement, batch: RelationBatch) -> RelationLosses:
    """The losses of a batch."""
    judged = batch.there & (batch.kinds >= 0)
    kinds = batch.kinds[judged]
    each = F.cross_entropy(told.kinds[judged], kinds, reduction="none", label_smoothing=SMOOTHING)
    each = torch.where(kinds == 2, PLATE, 1.0) * each
    kind = each.sum() / max(1, len(kinds))
    named = batch.there & (batch.classes >= 0)
    classes = F.cross_entropy(told.classes[named], batch.classes[named], reduction="sum")
    classes = classes / max(1, int(named.sum()))
    near = batch.there & batch.shifts.isfinite().all(dim=-1)
    off = F.smooth_l1_loss(told.shifts[near], batch.shifts[near], reduction="sum", beta=FINE)
    off = off / max(1, 4 * int(near.sum()))
    return RelationLosses(kind + CLASSES * classes + SHIFTS * off, kind, classes, off)


def fit_relations(
    network: RelationNetwork,
    pictures: Sequence[Picture],
    run: Path,
    options: RelationFit | None = None,
    *,
    validate: Callable[[RelationNetwork], dict[str, float]] | None = None,
    progress: bool = True,
) -> RelationNetwork:
    """Train a head, or go on where the run in this folder stopped.

    Parameters
    ----------
    network
        Trained in place, on a GPU where there is one.
    pictures
        Candidates that are known to be buttons, plates or nothing.
    run
        Folder of the run; made where missing.
    options
        How to train.
    validate
        Called with the averaged head at each checkpoint; its figures go to the metrics.
    progress
        Whether a progress bar with the time left is shown.

    Returns
    -------
    The head with averaged weights, in evaluation mode.

    Raises
    ------
    InputError
        If the folder holds a run of another head.
    """
    options = options or RelationFit()

    def losses(batch: RelationBatch, device: torch.device, _: float) -> dict[str, Tensor]:
        batch = RelationBatch(*(part.to(device) for part in batch))
        looks = _thinned_features(batch.looks, options.features)
        told = network(looks, batch.geometry, batch.pairs, batch.there)
        return relation_losses(told, batch)._asdict()

    return train_loop(
        network,
        run,
        options,
        {"relation_options": asdict(network.options)},
        lambda seed: _batches(pictures, options, seed),
        losses,
        kind=KIND,
        validate=validate,
        progress=progress,
    )


def load_relations(path: Path) -> RelationNetwork:
    """The averaged head of a checkpoint, in evaluation mode.

    Raises
    ------
    InputError
        If the file is missing or no checkpoint.
    """
    state = read_checkpoint(path, "relation_options", KIND)
    network = RelationNetwork(RelationOptions(**state["relation_options"]))
    network.load_state_dict(module_state(state["averaged"]))
    return network.eval()


def _thinned_features(looks: Tensor, left_out: float) -> Tensor:
    """Looks (M, 49, C) without some of each candidate's channels."""
    if left_out <= 0:
        return looks
    kept = torch.rand(len(looks), 1, looks.shape[2], device=looks.device) >= left_out
    return looks * kept / (1 - left_out)


class _Batches(torch.utils.data.IterableDataset[RelationBatch]):
    """Endless batches; some pictures lose some of their candidates."""

    def __init__(self, pictures: Sequence[Picture], batch: int, seed: int) -> None:
        self.pictures, self.batch, self.seed = pictures, batch, seed

    def __iter__(self) -> Iterator[RelationBatch]:
        rng = np.random.default_rng(self.seed)
        while True:
            order = rng.permutation(len(self.pictures))
            for start in range(0, len(order), self.batch):
                chosen = order[start : start + self.batch]
                yield batch_of([_thinned(self.pictures[k], rng) for k in chosen])


def _batches(
    pictures: Sequence[Picture], options: RelationFit, seed: int
) -> torch.utils.data.DataLoader[RelationBatch]:
    return torch.utils.data.DataLoader(
        _Batches(pictures, options.batch, seed), batch_size=None, num_workers=0
    )


def _thinned(picture: Picture, rng: np.random.Generator) -> Picture:
    if rng.random() >= THINNED:
        return picture
    kept = rng.random(len(picture.boxes)) >= rng.uniform(0, MOST_LOST)
    if not kept.any():
        return picture
    return Picture(
        picture.shape,
        picture.looks[kept],
        picture.boxes[kept],
        picture.confidence[kept],
        picture.plates[kept],
        picture.scores[kept],
        picture.kinds[kept],
        picture.classes[kept],
        picture.shifts[kept],
    )
