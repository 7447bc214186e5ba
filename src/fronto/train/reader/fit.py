"""The training loop of the label reader: resumable, its run a folder.

``last.pt`` holds all that is needed to go on, ``metrics.csv`` the figures of each checkpoint.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple, cast

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from fronto.train.reader.data import CropBatch, CropSource, crop_batches
from fronto.train.reader.network import SPELLED, Lesson, ReaderNetwork, ReaderOptions
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
    "ReaderFit",
    "ReaderLosses",
    "fit_reader",
    "load_reader",
    "network_input",
    "reader_losses",
    "text_losses",
]

KIND = "the .pt file of a reader's run"
#: Kinds that annotators mix up are softened.
SMOOTHING = 0.05
#: CTC's gradients outweigh all others while it knows no character yet, and nothing is learnt
#: then: the texts' loss begins with this weight and is full after this share of the steps.
TEXT_WEIGHT, TEXT_FULL = 0.2, 0.25
#: Share of the steps over which spelling is helped with, less and less.
SPELLING_END = 0.6
#: Memory of AdamW's second moments: the loss of the first steps is tenfold, and is forgotten soon.
BETAS = (0.9, 0.99)


@dataclass(frozen=True)
class ReaderFit:
    """How to train.

    Parameters
    ----------
    steps
        Batches in all; the learning rate falls to nothing over them, along a half cosine.
    batch
        Crops in a batch.
    rate, decay, warmup
        Highest learning rate and weight decay of AdamW; steps until the rate is full.
    average
        Share that is kept of the averaged weights at each step; the average is what is
        evaluated and exported.
    seed
        Of the order of crops and their disturbances.
    workers
        Processes that prepare batches.
    save_every
        Steps between checkpoints.
    """

    steps: int = 10_000
    batch: int = 128
    rate: float = 2e-3
    decay: float = 0.02
    warmup: int = 300
    average: float = 0.999
    seed: int = 0
    workers: int = 1
    save_every: int = 500


class ReaderLosses(NamedTuple):
    """Means over a batch.

    Parameters
    ----------
    total
        What is minimised.
    text
        Of the crops that carry a text: minus the logarithm of its probability.
    kind
        Cross entropy of the kinds.
    spelling
        Cross entropy of the first characters of the texts, summed over their places.
    """

    total: Tensor
    text: Tensor
    kind: Tensor
    spelling: Tensor


def network_input(crops: Tensor) -> Tensor:
    """Crops (N, 48, 48, 3), uint8, as the network takes them: (N, 3, 48, 48), 0 to 1."""
    return crops.permute(0, 3, 1, 2).to(torch.float32) * (1 / 255)


def text_losses(logits: Tensor, text: Tensor, length: Tensor) -> Tensor:
    """Minus the logarithm of the texts' probabilities, summed over CTC's paths, shape (N,).

    Parameters
    ----------
    logits
        (N, steps, classes).
    text, length
        As in `CropBatch`; a length of 0 stands for the empty text.
    """
    if len(logits) == 0:  # which PyTorch's refuses
        return logits.sum(dim=(1, 2))
    log_probs = F.log_softmax(logits.float(), dim=2).transpose(0, 1)
    steps = torch.full_like(length, logits.shape[1])
    return F.ctc_loss(log_probs, text, steps, length, reduction="none", zero_infinity=True)


def reader_losses(lesson: Lesson, batch: CropBatch, share: float) -> ReaderLosses:
    """The losses of a batch when this share of the steps, 0 to 1, is done."""
    readings, spelling = lesson
    rows = batch.length > 0
    count = rows.sum().clamp(min=1)
    text = text_losses(readings.text[rows], batch.text[rows], batch.length[rows]).sum() / count
    kind = F.cross_entropy(readings.kind, batch.kind, label_smoothing=SMOOTHING)
    spelled = F.pad(batch.text, (0, SPELLED))[rows, :SPELLED]
    characters = F.cross_entropy(spelling[rows].flatten(0, 1), spelled.flatten(), reduction="sum")
    characters = characters / count
    weight = TEXT_WEIGHT + (1 - TEXT_WEIGHT) * min(1.0, share / TEXT_FULL)
    help_ = max(0.0, 1 - share / SPELLING_END)
    return ReaderLosses(weight * text + kind + help_ * characters, text, kind, characters)


def fit_reader(
    network: ReaderNetwork,
    sources: Sequence[tuple[CropSource, float]],
    run: Path,
    options: ReaderFit | None = None,
    *,
    validate: Callable[[ReaderNetwork], dict[str, float]] | None = None,
    progress: bool = True,
) -> ReaderNetwork:
    """Train a network, or go on where the run in this folder stopped.

    Parameters
    ----------
    network
        Trained in place, on a GPU where there is one.
    sources
        Crops, and the share of each source.
    run
        Folder of the run; made where missing.
    options
        How to train.
    validate
        Called with the averaged network at each checkpoint; its figures go to the metrics.
    progress
        Whether a progress bar with the time left is shown.

    Returns
    -------
    The network with averaged weights, in evaluation mode.

    Raises
    ------
    InputError
        If the folder holds a run of another network.
    """
    options = options or ReaderFit()
    run.mkdir(parents=True, exist_ok=True)
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    network.to(device, memory_format=torch.channels_last)  # type: ignore[call-overload]
    averaged = averaged_model(network, options.average)
    optimizer = torch.optim.AdamW(parameter_groups(network, options.decay), options.rate, BETAS)
    parts: dict[str, Any] = {"network": network, "averaged": averaged, "optimizer": optimizer}
    first = _resume(run / "last.pt", network, parts) if (run / "last.pt").exists() else 0
    seed = restart_seed(options.seed, first)
    loader = crop_batches(sources, batch=options.batch, seed=seed, workers=options.workers)
    none = torch.zeros(len(ReaderLosses._fields))
    sums, started, since = none, time.monotonic(), first
    network.train()
    for step, batch in numbered(loader, first, options.steps, progress):
        rate = options.rate * rate_share(step, options.warmup, options.steps)
        for group in optimizer.param_groups:
            group["lr"] = rate
        batch = CropBatch(*(part.to(device) for part in batch))
        losses = _step(network, batch, optimizer, step / options.steps)
        averaged.update_parameters(network)
        sums = sums + torch.stack(losses).detach().cpu()
        done = step + 1
        if done % options.save_every == 0 or done == options.steps:
            means = (sums / (done - since)).tolist()
            figures = dict(zip(ReaderLosses._fields, means, strict=True))
            figures |= {"rate": rate, "seconds": time.monotonic() - started}
            if validate is not None:
                figures |= validate(cast(ReaderNetwork, averaged.module).eval())
            write_figures(run / "metrics.csv", done, figures)
            states = {name: part.state_dict() for name, part in parts.items()}
            options_now = {"step": done, "reader_options": _options_of(network)}
            write_checkpoint(run / "last.pt", options_now | states)
            sums, since = none, done
    return cast(ReaderNetwork, averaged.module).eval()


def load_reader(path: Path) -> ReaderNetwork:
    """The averaged network of a checkpoint, in evaluation mode.

    Raises
    ------
    InputError
        If the file is missing or no checkpoint of a reader.
    """
    state = read_checkpoint(path, "reader_options", KIND)
    options = state["reader_options"]
    network = ReaderNetwork(ReaderOptions(**options | {"stages": tuple(options["stages"])}))
    network.load_state_dict(module_state(state["averaged"]))
    return network.eval()


def _step(
    network: ReaderNetwork, batch: CropBatch, optimizer: torch.optim.Optimizer, share: float
) -> ReaderLosses:
    image = network_input(batch.crops).contiguous(memory_format=torch.channels_last)
    losses = reader_losses(network.lesson(image), batch, share)
    optimizer.zero_grad(set_to_none=True)
    losses.total.backward()
    nn.utils.clip_grad_norm_(network.parameters(), 5.0)
    optimizer.step()
    return losses


def _options_of(network: ReaderNetwork) -> dict[str, Any]:
    return asdict(network.options) | {"stages": list(network.options.stages)}


def _resume(path: Path, network: ReaderNetwork, parts: dict[str, Any]) -> int:
    state = read_checkpoint(path, "reader_options", KIND)
    same_network(path, state["reader_options"], _options_of(network))
    for name, part in parts.items():
        part.load_state_dict(state[name])
    return int(state["step"])
