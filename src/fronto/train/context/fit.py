"""How the context head is trained: batches of panels, and their loss."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import torch
import torch.nn.functional as F
from torch import Tensor

from fronto.errors import InputError
from fronto.labels.context import BESIDES, GEOMETRY, PAIR, Context
from fronto.train.context.examples import Example
from fronto.train.context.network import ContextNetwork, ContextOptions
from fronto.train.loop import LoopOptions, train_loop
from fronto.train.runs import module_state, read_checkpoint

__all__ = [
    "ContextBatch",
    "ContextFit",
    "batch_of",
    "fit_context",
    "load_context",
    "renumbered",
    "stated_options",
]

KIND = "the .pt file of a context head's run"
#: Share of the panels whose floors are counted on by some number, and most that it is: how floors
#: count on is then learnt from all of them, and no floor by heart.
RENUMBERED, FURTHEST = 0.5, 20
#: Share of the panels whose readings are made surer or less sure, and how much (standard
#: deviation of the logarithm of the exponent).
SHARPENED, SHARPNESS = 0.3, 0.15
#: Share of its things that a panel loses, and how often: a panel is not always found as a whole.
LOST, LOSING = (0.0, 0.05, 0.2), (0.5, 0.3, 0.2)


@dataclass(frozen=True)
class ContextFit(LoopOptions):
    """How to train: `fronto.train.loop.LoopOptions` with values that suit."""

    steps: int = 3000
    batch: int = 32
    rate: float = 1.5e-3
    decay: float = 0.05
    warmup: int = 200
    save_every: int = 500


class ContextBatch(NamedTuple):
    """B panels, filled up to N things each.

    Parameters
    ----------
    own, seen, ordered, geometry, pairs, there
        What `ContextNetwork` takes.
    target, weight
        (B, N): as `Example` has them.
    """

    own: Tensor
    seen: Tensor
    ordered: Tensor
    geometry: Tensor
    pairs: Tensor
    there: Tensor
    target: Tensor
    weight: Tensor


def batch_of(examples: Sequence[Example], count: int) -> ContextBatch:
    """Put panels into one batch; `count` is of the labels and what there is besides."""
    b, n = len(examples), max(len(e.target) for e in examples)
    batch = ContextBatch(
        torch.zeros(b, n, count),
        torch.zeros(b, n, count),
        torch.zeros(b, n, count),
        torch.zeros(b, n, GEOMETRY),
        torch.zeros(b, n, n, PAIR),
        torch.zeros(b, n, dtype=torch.bool),
        torch.full((b, n), -1),
        torch.zeros(b, n),
    )
    for k, example in enumerate(examples):
        m = len(example.target)
        for name in ("own", "seen", "ordered", "geometry"):
            getattr(batch, name)[k, :m] = torch.from_numpy(getattr(example.context, name))
        batch.pairs[k, :m, :m] = torch.from_numpy(example.context.pairs)
        batch.there[k, :m] = True
        batch.target[k, :m] = torch.from_numpy(example.target)
        batch.weight[k, :m] = torch.from_numpy(example.weight)
    return batch


def renumbered(example: Example, by: int, floors: npt.NDArray[np.intp]) -> Example:
    """A panel whose floors are all so many higher.

    Parameters
    ----------
    example
        The panel.
    by
        How many, negative for lower ones. Floors that would leave the numbers are not known
        any more.
    floors
        Places of the numbered floors among the labels, in their order, each one higher than
        the one before.
    """
    c = example.context
    count = len(floors)
    numbers = np.arange(count)
    kept = (numbers + by >= 0) & (numbers + by < count)

    def moved(rows: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        result = rows.copy()
        result[:, floors] = 0
        result[:, floors[numbers[kept] + by]] = rows[:, floors[kept]]
        return result

    to = np.arange(c.own.shape[1])
    to[floors] = -1
    to[floors[kept]] = floors[numbers[kept] + by]
    target = np.where(example.target >= 0, to[example.target], -1)
    context = Context(moved(c.own), moved(c.seen), moved(c.ordered), c.geometry, c.pairs)
    return Example(context, target, example.weight)


def fit_context(
    network: ContextNetwork,
    examples: Sequence[Example],
    run: Path,
    options: ContextFit | None = None,
    *,
    validate: Callable[[ContextNetwork], dict[str, float]] | None = None,
    progress: bool = True,
) -> ContextNetwork:
    """Train a head, or go on where the run in this folder stopped.

    Parameters
    ----------
    network
        Trained in place, on a GPU where there is one.
    examples
        Panels whose labels are known.
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
    options = options or ContextFit()

    def losses(batch: ContextBatch, device: torch.device, _: float) -> dict[str, Tensor]:
        batch = ContextBatch(*(part.to(device) for part in batch))
        told = network(*batch[:6])
        known = batch.there & (batch.target >= 0)
        each = F.cross_entropy(told[known], batch.target[known], reduction="none")
        weight = batch.weight[known]
        return {"total": (each * weight).sum() / weight.sum().clamp(min=1e-6)}

    return train_loop(
        network,
        run,
        options,
        {"context_options": stated_options(network)},
        lambda seed: _batches(examples, network.labels, options, seed),
        losses,
        kind=KIND,
        validate=validate,
        progress=progress,
    )


def stated_options(network: ContextNetwork) -> dict[str, Any]:
    """What a checkpoint states of its head: its size and its labels."""
    return asdict(network.options) | {"labels": list(network.labels)}


def load_context(path: Path) -> ContextNetwork:
    """The averaged head of a checkpoint, in evaluation mode.

    Raises
    ------
    InputError
        If the file is missing or no checkpoint.
    """
    state = read_checkpoint(path, "context_options", KIND)
    options = dict(state["context_options"])
    labels = tuple(options.pop("labels"))
    network = ContextNetwork(labels, ContextOptions(**options))
    network.load_state_dict(module_state(state["averaged"]))
    return network.eval()


def _batches(
    examples: Sequence[Example], labels: Sequence[str], options: ContextFit, seed: int
) -> Iterator[ContextBatch]:
    """Endless batches of panels that are renumbered, sharpened and thinned out."""
    if not examples:
        raise InputError("examples", "expected panels, got none")
    places = {int(label): k for k, label in enumerate(labels) if label.lstrip("-").isdigit()}
    numbers = np.array(sorted(places))
    floors = np.array([places[number] for number in numbers.tolist()], dtype=np.intp)
    count = len(labels) + BESIDES
    rng = np.random.default_rng(seed)
    while True:
        order = rng.permutation(len(examples))
        for start in range(0, len(order), options.batch):
            chosen = [examples[k] for k in order[start : start + options.batch]]
            yield batch_of([_disturbed(e, numbers, floors, rng) for e in chosen], count)


def _disturbed(
    example: Example,
    numbers: npt.NDArray[np.intp],
    floors: npt.NDArray[np.intp],
    rng: np.random.Generator,
) -> Example:
    there = numbers[np.isin(floors, example.target)]
    # Panels with floors below the ground are told from others: they stay as they are.
    if len(there) and there[0] >= 0 and rng.random() < RENUMBERED:
        down = min(FURTHEST, max(0, int(there[0]) - 1))
        up = min(FURTHEST, int(numbers[-1] - there[-1]))
        example = renumbered(example, int(rng.integers(-down, up + 1)), floors)
    if rng.random() < SHARPENED:
        example = _sharpened(example, float(np.exp(rng.normal(0, SHARPNESS))))
    kept = rng.random(len(example.target)) >= rng.choice(LOST, p=LOSING)
    return example.part(kept) if kept.any() else example


def _sharpened(example: Example, exponent: float) -> Example:
    """A panel whose readings are as sure as their probabilities to this power."""

    def powers(rows: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
        raised = rows.astype(np.float32) ** exponent
        return np.asarray(raised / np.maximum(1, raised.sum(axis=1, keepdims=True)), np.float32)

    c = example.context
    context = Context(powers(c.own), powers(c.seen), powers(c.ordered), c.geometry, c.pairs)
    return Example(context, example.target, example.weight)
