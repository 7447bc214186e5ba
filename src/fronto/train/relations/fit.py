"""The training loop of the relation head: resumable, its run a folder.

``last.pt`` holds all that is needed to go on, ``metrics.csv`` the figures of each checkpoint.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor, nn

from fronto.errors import InputError
from fronto.relations import GEOMETRY, PAIR, geometry, pairs
from fronto.train.relations.network import Judgement, RelationNetwork, RelationOptions
from fronto.train.relations.pool import Picture
from fronto.train.runs import (
    averaged_model,
    module_state,
    numbered,
    parameter_groups,
    rate_share,
    read_checkpoint,
    restart_seed,
    same_network,
    write_checkpoint,
    write_figures,
)

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
class RelationFit:
    """How to train.

    Parameters
    ----------
    steps
        Batches in all; the learning rate falls to nothing over them, along a half cosine.
    batch
        Pictures in a batch.
    rate, decay, warmup
        Highest learning rate and weight decay of AdamW; steps until the rate is full.
    average
        Share that is kept of the averaged weights at each step; the average is what is
        evaluated and exported.
    features
        Share of the features' channels that are left out of a candidate in training.
    seed
        Of the order of pictures and of what is left out.
    save_every
        Steps between checkpoints.

    Raises
    ------
    InputError
        Naming the field that is out of range.
    """

    steps: int = 9000
    batch: int = 16
    rate: float = 2e-3
    decay: float = 0.02
    warmup: int = 300
    average: float = 0.998
    features: float = 0.1
    seed: int = 0
    save_every: int = 1000

    def __post_init__(self) -> None:
        for name, least in (("steps", 1), ("batch", 1), ("warmup", 0), ("save_every", 1)):
            if getattr(self, name) < least:
                raise InputError(name, f"expected {least} or more, got {getattr(self, name)}")
        if not (math.isfinite(self.rate) and self.rate > 0):
            raise InputError("rate", f"expected a number above 0, got {self.rate:g}")
        if not (math.isfinite(self.decay) and self.decay >= 0):
            raise InputError("decay", f"expected 0 or more, got {self.decay:g}")
        for name in ("average", "features"):
            if not 0 <= getattr(self, name) < 1:
                raise InputError(
                    name, f"expected 0 or more and below 1, got {getattr(self, name):g}"
                )


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
    run.mkdir(parents=True, exist_ok=True)
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    network.to(device)
    averaged = averaged_model(network, options.average)
    optimizer = torch.optim.AdamW(parameter_groups(network, options.decay), options.rate)
    parts: dict[str, Any] = {"network": network, "averaged": averaged, "optimizer": optimizer}
    first = _resume(run / "last.pt", network, parts) if (run / "last.pt").exists() else 0
    loader = _batches(pictures, options, restart_seed(options.seed, first))
    none = torch.zeros(len(RelationLosses._fields))
    sums, started, since = none, time.monotonic(), first
    network.train()
    for step, batch in numbered(loader, first, options.steps, progress):
        rate = options.rate * rate_share(step, options.warmup, options.steps)
        for group in optimizer.param_groups:
            group["lr"] = rate
        batch = RelationBatch(*(part.to(device) for part in batch))
        losses = _step(network, batch, optimizer, options.features)
        averaged.update_parameters(network)
        sums = sums + torch.stack(tuple(part.cpu() for part in losses))
        done = step + 1
        if done % options.save_every == 0 or done == options.steps:
            means = (sums / (done - since)).tolist()
            figures = dict(zip(RelationLosses._fields, means, strict=True))
            figures |= {"rate": rate, "seconds": time.monotonic() - started}
            if validate is not None:
                figures |= validate(cast(RelationNetwork, averaged.module).eval())
            write_figures(run / "metrics.csv", done, figures)
            state = {name: part.state_dict() for name, part in parts.items()}
            stated = {"step": done, "relation_options": asdict(network.options)}
            write_checkpoint(run / "last.pt", stated | state)
            sums, since = none, done
    return cast(RelationNetwork, averaged.module).eval()


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


def _resume(path: Path, network: RelationNetwork, parts: dict[str, Any]) -> int:
    state = read_checkpoint(path, "relation_options", KIND)
    same_network(path, state["relation_options"], asdict(network.options))
    for name, part in parts.items():
        part.load_state_dict(state[name])
    return int(state["step"])


def _step(
    network: RelationNetwork,
    batch: RelationBatch,
    optimizer: torch.optim.Optimizer,
    left_out: float,
) -> RelationLosses:
    looks = batch.looks
    if left_out > 0:
        kept = torch.rand(len(looks), 1, looks.shape[2], device=looks.device) >= left_out
        looks = looks * kept / (1 - left_out)
    told = network(looks, batch.geometry, batch.pairs, batch.there)
    losses = relation_losses(told, batch)
    optimizer.zero_grad(set_to_none=True)
    losses.total.backward()
    nn.utils.clip_grad_norm_(network.parameters(), 1.0)
    optimizer.step()
    return RelationLosses(*(part.detach() for part in losses))


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
