"""The training loop: resumable, the same on a CPU and on several GPUs.

A run is a folder: ``last.pt`` (all that is needed to go on), ``metrics.csv``, and TensorBoard's
events.
"""

from __future__ import annotations

import logging
import time
from collections.abc import Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, cast

import torch
from torch import nn

from fronto.train.data import Source, batches
from fronto.train.losses import Batch, Losses, losses
from fronto.train.network import Network, NetworkOptions
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

__all__ = ["FitOptions", "fit", "load_checkpoint"]

log = logging.getLogger(__name__)

KIND = "a run's .pt file"


@dataclass(frozen=True)
class FitOptions:
    """How to train.

    Parameters
    ----------
    steps
        Batches in all; the learning rate falls to nothing over them, along a half cosine.
    batch, size
        Pictures in a batch and their side in pixels.
    rate, decay, warmup
        Highest learning rate and weight decay of AdamW; steps until the rate is full.
    average
        Share that is kept of the averaged weights at each step; the average is what is
        evaluated and exported.
    frozen
        Blocks at the backbone's beginning (its stem, too, where not 0) that stay as they are:
        they cost the most time, and tell edges and colours everywhere alike.
    seed
        Of the order of pictures and their disturbances.
    workers
        Processes that prepare batches.
    save_every
        Steps between checkpoints.
    """

    steps: int = 20_000
    batch: int = 8
    size: int = 288
    rate: float = 1.5e-3
    decay: float = 0.01
    warmup: int = 200
    average: float = 0.998
    frozen: int = 0
    seed: int = 0
    workers: int = 1
    save_every: int = 200


def fit(
    network: Network,
    sources: Sequence[tuple[Source, float]],
    run: Path,
    options: FitOptions | None = None,
    *,
    validate: Callable[[Network], dict[str, float]] | None = None,
    progress: bool = True,
) -> Network:
    """Train a network, or go on where the run in this folder stopped.

    Parameters
    ----------
    network
        Trained in place (on all GPUs of the machine where there are any).
    sources
        Pictures, and the share of each source.
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
    options = options or FitOptions()
    run.mkdir(parents=True, exist_ok=True)
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    network.to(device, memory_format=torch.channels_last)  # type: ignore[call-overload]
    kept = _freeze(network, options.frozen)
    averaged = averaged_model(network, options.average)
    optimizer = torch.optim.AdamW(parameter_groups(network, options.decay), options.rate)
    scaler = torch.amp.GradScaler(device.type, enabled=device.type == "cuda")
    first = 0
    if (run / "last.pt").exists():
        first = _resume(run / "last.pt", network, averaged, optimizer, scaler)
        log.info("going on at step %d", first)
    model: nn.Module = network
    if torch.cuda.device_count() > 1:
        model = nn.DataParallel(network)
    loader = batches(
        sources,
        batch=options.batch,
        size=options.size,
        seed=restart_seed(options.seed, first),
        workers=options.workers,
    )
    with _Metrics(run) as metrics:
        network.train()
        for part in kept:
            part.eval()  # normalises as it did
        started = time.monotonic()
        for step, batch in numbered(loader, first, options.steps, progress):
            rate = options.rate * rate_share(step, options.warmup, options.steps)
            for group in optimizer.param_groups:
                group["lr"] = rate
            parts = _step(model, batch, optimizer, scaler, device)
            averaged.update_parameters(network)
            metrics.add(parts)
            done = step + 1
            if done % options.save_every == 0 or done == options.steps:
                figures = metrics.mean()
                figures["rate"] = rate
                figures["seconds"] = time.monotonic() - started
                if validate is not None:
                    figures |= validate(cast(Network, averaged.module).eval())
                metrics.write(done, figures)
                _save(run / "last.pt", done, network, averaged, optimizer, scaler)
    return cast(Network, averaged.module).eval()


def load_checkpoint(path: Path) -> Network:
    """The averaged network of a checkpoint, in evaluation mode.

    Raises
    ------
    InputError
        If the file is missing or no checkpoint.
    """
    state = read_checkpoint(path, "network_options", KIND)
    options = state["network_options"]
    # Networks of earlier versions have no details, and do not say so.
    stated = {"details": 0} | options | {"rates": tuple(options["rates"])}
    network = Network(NetworkOptions(**stated))
    network.load_state_dict(module_state(state["averaged"]))
    return network.eval()


def _freeze(network: Network, blocks: int) -> list[nn.Module]:
    """Give the parts at the backbone's beginning that are not trained."""
    kept = [network.backbone.stem, *network.backbone.blocks[:blocks]] if blocks else []
    for part in kept:
        part.requires_grad_(False)
    return kept


def _autocast(device: torch.device) -> AbstractContextManager[Any]:
    """Mixed precision on a GPU; on CPUs measured, bfloat16 was no faster."""
    if device.type == "cuda":
        return torch.autocast("cuda", torch.bfloat16)
    return nullcontext()


def _step(
    model: nn.Module,
    batch: Batch,
    optimizer: torch.optim.Optimizer,
    scaler: torch.amp.GradScaler,
    device: torch.device,
) -> Losses:
    batch = Batch(*(part.to(device, non_blocking=True) for part in batch))
    image = batch.image.contiguous(memory_format=torch.channels_last)
    with _autocast(device):
        maps = model(image)
    parts = losses(maps, batch)
    optimizer.zero_grad(set_to_none=True)
    scaler.scale(parts.total).backward()
    scaler.unscale_(optimizer)
    nn.utils.clip_grad_norm_(model.parameters(), 5.0)
    scaler.step(optimizer)
    scaler.update()
    return Losses(*(part.detach() for part in parts))


def _resume(
    path: Path,
    network: Network,
    averaged: torch.optim.swa_utils.AveragedModel,
    optimizer: torch.optim.Optimizer,
    scaler: torch.amp.GradScaler,
) -> int:
    state = read_checkpoint(path, "network_options", KIND)
    same_network(path, state["network_options"], _options_of(network))
    network.load_state_dict(state["network"])
    averaged.load_state_dict(state["averaged"])
    optimizer.load_state_dict(state["optimizer"])
    scaler.load_state_dict(state["scaler"])
    return int(state["step"])


def _options_of(network: Network) -> dict[str, Any]:
    return asdict(network.options) | {"rates": list(network.options.rates)}


def _save(
    path: Path,
    step: int,
    network: Network,
    averaged: torch.optim.swa_utils.AveragedModel,
    optimizer: torch.optim.Optimizer,
    scaler: torch.amp.GradScaler,
) -> None:
    state = {
        "step": step,
        "network_options": _options_of(network),
        "network": network.state_dict(),
        "averaged": averaged.state_dict(),
        "optimizer": optimizer.state_dict(),
        "scaler": scaler.state_dict(),
    }
    write_checkpoint(path, state)


class _Metrics:
    """Means of the losses between checkpoints, to ``metrics.csv`` and TensorBoard."""

    def __init__(self, run: Path) -> None:
        self.path = run / "metrics.csv"
        self.sums = torch.zeros(len(Losses._fields))
        self.count = 0
        self.writer: Any = None
        self.run = run

    def __enter__(self) -> _Metrics:
        from torch.utils.tensorboard import SummaryWriter

        self.writer = SummaryWriter(str(self.run))  # type: ignore[no-untyped-call]
        return self

    def __exit__(self, *_: object) -> None:
        self.writer.close()

    def add(self, parts: Losses) -> None:
        self.sums += torch.stack(tuple(part.cpu() for part in parts))
        self.count += 1

    def mean(self) -> dict[str, float]:
        means = (self.sums / max(1, self.count)).tolist()
        self.sums.zero_()
        self.count = 0
        return dict(zip(Losses._fields, means, strict=True))

    def write(self, step: int, figures: dict[str, float]) -> None:
        for name, value in figures.items():
            self.writer.add_scalar(name, value, step)
        write_figures(self.path, step, figures)
