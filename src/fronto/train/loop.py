"""The training loop of the reader and of the heads beside networks: resumable, its run a folder.

``last.pt`` holds all that is needed to go on, ``metrics.csv`` the figures of each checkpoint.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar, cast

import torch
from torch import Tensor, nn

from fronto.errors import InputError
from fronto.train.runs import (
    averaged_model,
    numbered,
    parameter_groups,
    rate_share,
    read_checkpoint,
    restart_seed,
    same_network,
    write_checkpoint,
    write_figures,
)

__all__ = ["LoopOptions", "train_loop"]

N = TypeVar("N", bound=nn.Module)
B = TypeVar("B")


@dataclass(frozen=True)
class LoopOptions:
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
        if not 0 <= self.average < 1:
            raise InputError("average", f"expected 0 or more and below 1, got {self.average:g}")


def train_loop(
    network: N,
    run: Path,
    options: LoopOptions,
    stated: dict[str, Any],
    batches: Callable[[int], Iterable[B]],
    losses: Callable[[B, torch.device, float], dict[str, Tensor]],
    *,
    kind: str,
    betas: tuple[float, float] = (0.9, 0.999),
    most_gradient: float = 1.0,
    validate: Callable[[N], dict[str, float]] | None = None,
    progress: bool = True,
) -> N:
    """Train a network, or go on where the run in this folder stopped.

    Parameters
    ----------
    network
        Trained in place, on a GPU where there is one.
    run
        Folder of the run; made where missing.
    options
        How to train.
    stated
        One entry: under which name the checkpoint states the network's own options, and these.
    batches
        Makes endless batches from a seed.
    losses
        Of a batch, the device to compute on, and the share of the steps that is done, 0 to 1:
        the figures to keep, "total" among them, which is what is minimised.
    kind
        What messages call a checkpoint.
    betas
        Memory of AdamW's moments.
    most_gradient
        Norm that gradients are cut down to.
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
    run.mkdir(parents=True, exist_ok=True)
    device = torch.device("cuda" if torch.cuda.is_available() else "cpu")
    network.to(device)
    averaged = averaged_model(network, options.average)
    optimizer = torch.optim.AdamW(parameter_groups(network, options.decay), options.rate, betas)
    parts: dict[str, Any] = {"network": network, "averaged": averaged, "optimizer": optimizer}
    first = 0
    if (run / "last.pt").exists():
        first = _resume(run / "last.pt", stated, kind, parts)
    kept: list[dict[str, Tensor]] = []
    started = time.monotonic()
    network.train()
    loader = batches(restart_seed(options.seed, first))
    for step, batch in numbered(loader, first, options.steps, progress):
        rate = options.rate * rate_share(step, options.warmup, options.steps)
        for group in optimizer.param_groups:
            group["lr"] = rate
        told = losses(batch, device, step / options.steps)
        optimizer.zero_grad(set_to_none=True)
        told["total"].backward()
        nn.utils.clip_grad_norm_(network.parameters(), most_gradient)
        optimizer.step()
        averaged.update_parameters(network)
        kept.append({name: value.detach().cpu() for name, value in told.items()})
        done = step + 1
        if done % options.save_every == 0 or done == options.steps:
            figures = _means(kept) | {"rate": rate, "seconds": time.monotonic() - started}
            if validate is not None:
                figures |= validate(cast(N, averaged.module).eval())
            write_figures(run / "metrics.csv", done, figures)
            state = {name: part.state_dict() for name, part in parts.items()}
            write_checkpoint(run / "last.pt", {"step": done, **stated, **state})
            kept = []
    return cast(N, averaged.module).eval()


def _means(kept: Sequence[dict[str, Tensor]]) -> dict[str, float]:
    return {name: float(torch.stack([k[name] for k in kept]).mean()) for name in kept[0]}


def _resume(path: Path, stated: dict[str, Any], kind: str, parts: dict[str, Any]) -> int:
    (name,) = stated
    state = read_checkpoint(path, name, kind)
    same_network(path, state[name], stated[name])
    for part, content in parts.items():
        content.load_state_dict(state[part])
    return int(state["step"])
