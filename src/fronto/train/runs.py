"""What every training run shares: rate, averaged weights, checkpoints, the file of figures."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import torch
from torch import Tensor, nn
from torch.optim.swa_utils import AveragedModel, get_ema_multi_avg_fn

from fronto.errors import InputError

__all__ = [
    "averaged_model",
    "check_run",
    "module_state",
    "numbered",
    "parameter_groups",
    "rate_share",
    "read_checkpoint",
    "restart_seed",
    "same_network",
    "write_checkpoint",
    "write_figures",
]

B = TypeVar("B")


def averaged_model(network: nn.Module, kept: float) -> AveragedModel:
    """The running average of a network's weights; this share of it is kept at each step."""
    return AveragedModel(network, multi_avg_fn=get_ema_multi_avg_fn(kept), use_buffers=True)


def parameter_groups(network: nn.Module, decay: float) -> list[dict[str, Any]]:
    """What is trained, for an optimizer: no weight decay for biases and normalisation."""
    trained = [p for p in network.parameters() if p.requires_grad]
    matrices = [p for p in trained if p.ndim > 1]
    others = [p for p in trained if p.ndim <= 1]
    return [{"params": matrices, "weight_decay": decay}, {"params": others, "weight_decay": 0.0}]


def rate_share(step: int, warmup: int, steps: int) -> float:
    """Share of the highest learning rate at a step: a rise, then half a cosine."""
    if step < warmup:
        return (step + 1) / warmup
    share = (step - warmup) / max(1, steps - warmup)
    return 0.5 * (1 + math.cos(math.pi * share)) + 1e-3


def restart_seed(seed: int, first: int) -> int:
    """Another seed after each restart: the same pictures would come again otherwise."""
    return seed + 7919 * first


def numbered(loader: Iterable[B], first: int, last: int, progress: bool) -> Iterator[tuple[int, B]]:
    """Batches with the numbers of their steps, under a progress bar with the time left."""
    from tqdm import tqdm

    steps = tqdm(range(first, last), initial=first, total=last, unit="step", disable=not progress)
    return zip(steps, loader, strict=False)


def read_checkpoint(path: Path, options: str, kind: str) -> dict[str, Any]:
    """A checkpoint with averaged weights and the network's `options`.

    Raises
    ------
    InputError
        If the file is missing or no such checkpoint, in words that name its `kind`.
    """
    try:
        state: dict[str, Any] = torch.load(path, map_location="cpu", weights_only=True)
        _ = state["averaged"], state[options]
    except FileNotFoundError:
        raise InputError(f"checkpoint {path}", "expected a file, there is none") from None
    except Exception as error:  # whatever the unpickler makes of other files
        reason = " ".join(str(error).split())[:80]
        raise InputError(f"checkpoint {path}", f"expected {kind}, got: {reason}") from None
    return state


def same_network(path: Path, found: dict[str, Any], wanted: dict[str, Any]) -> None:
    """Check that a run's checkpoint is of the network that is to be trained.

    Raises
    ------
    InputError
        If it is of another.
    """
    if found != wanted:
        first, second = (
            ", ".join(f"{name}={value}" for name, value in options.items())
            for options in (wanted, found)
        )
        raise InputError(
            f"run {path.parent}",
            f"expected a run of this network ({first}), got one of {second}",
            "name another folder, or give the run's own options",
        )


def check_run(run: Path, wanted: Mapping[str, object], fields: Sequence[str]) -> None:
    """Check what a run's ``options.json`` states, where there is one.

    Raises
    ------
    InputError
        If one of the fields is another than wanted: the run is for another network, or of what
        was collected in another way.
    """
    import msgspec

    try:
        stated = msgspec.json.decode((run / "options.json").read_bytes(), type=dict[str, object])
    except FileNotFoundError:
        return
    except (OSError, msgspec.DecodeError) as error:
        raise InputError(f"run {run}", f"expected its options.json, got: {error}") from None
    for name in fields:
        if stated.get(name) != wanted[name]:
            raise InputError(
                f"run {run}, {name}",
                f"expected {stated.get(name)} as before, got {wanted[name]}",
                "name another folder, or give what the run was begun with",
            )


def write_checkpoint(path: Path, state: dict[str, Any]) -> None:
    """Write a checkpoint in one piece: a run that is killed meanwhile keeps the old one."""
    partial = path.with_suffix(".part")
    torch.save(state, partial)
    partial.replace(path)


def module_state(averaged: dict[str, Tensor]) -> dict[str, Tensor]:
    """The state of the network inside an `averaged_model`'s."""
    return {k.removeprefix("module."): v for k, v in averaged.items() if k.startswith("module.")}


def write_figures(path: Path, step: int, figures: dict[str, float]) -> None:
    """Add a line to a run's CSV; one that was begun with other figures keeps its columns."""
    columns = ["step", *figures]
    new = not path.exists()
    if not new:
        with path.open(newline="", encoding="utf-8") as file:
            columns = next(csv.reader(file), columns)
    with path.open("a", newline="", encoding="utf-8") as file:
        rows = csv.DictWriter(file, columns, restval="nan", extrasaction="ignore")
        if new:
            rows.writeheader()
        rows.writerow({"step": step, **{k: f"{v:.6g}" for k, v in figures.items()}})
