"""How the verifier is trained: batches of patches, and their losses."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
import torch.nn.functional as F
from torch import Tensor

from fronto.train.loop import LoopOptions, train_loop
from fronto.train.runs import module_state, read_checkpoint
from fronto.train.verifier.network import Told, VerifierNetwork, VerifierOptions
from fronto.train.verifier.pool import WIDER_SIDE, VerifierPool
from fronto.verification import SIDE

__all__ = [
    "VerifierBatch",
    "VerifierFit",
    "VerifierLosses",
    "fit_verifier",
    "load_verifier",
    "verifier_losses",
]

KIND = "the .pt file of a verifier's run"
#: Labels have errors.
SMOOTHING = 0.03
#: What plates count against buttons: they are rare, and to press one is the worst mistake.
PLATE = 2.0
#: Weight of the categories beside the kinds.
CLASSES = 0.3
#: How patches are cut out anew: their size (as a logarithm, from the first to the second), how far
#: they are moved (deviation, in half sides), and turned (deviation, radians).
ZOOM, SHIFT, TURN = (-0.12, 0.1), 0.03, 0.06
#: Contrast from the first to the second, brightness to either side, the balance of the colours;
#: shares of patches that are grey, noisy, and of which a piece is hidden.
CONTRAST, LIGHT, BALANCE = (0.65, 1.35), 0.15, 0.15
GREY, NOISY, NOISE, HIDDEN = 0.15, 0.3, 0.03, 0.3
#: Sides of a hidden piece, pixels.
PIECE = (8, 28)


@dataclass(frozen=True)
class VerifierFit(LoopOptions):
    """How to train: `fronto.train.loop.LoopOptions` with defaults for patches."""

    steps: int = 5000
    batch: int = 128
    decay: float = 0.03
    warmup: int = 200
    average: float = 0.997
    save_every: int = 500


class VerifierBatch(NamedTuple):
    """B patches.

    Parameters
    ----------
    patches
        (B, 3, 64, 64), 0 to 1.
    kinds
        (B,): 0 nothing, 1 a button, 2 a plate.
    classes
        (B,): number of the category, -1 for unknown.
    """

    patches: Tensor
    kinds: Tensor
    classes: Tensor


class VerifierLosses(NamedTuple):
    """Means over a batch.

    Parameters
    ----------
    total
        What is minimised.
    kinds, classes
        Cross entropies.
    """

    total: Tensor
    kinds: Tensor
    classes: Tensor


def verifier_losses(told: Told, batch: VerifierBatch) -> VerifierLosses:
    """The losses of a batch."""
    weights = told.kinds.new_tensor([1.0, 1.0, PLATE])
    kinds = F.cross_entropy(told.kinds, batch.kinds, weights, label_smoothing=SMOOTHING)
    known = batch.classes >= 0
    classes = F.cross_entropy(
        told.classes[known], batch.classes[known], reduction="sum", label_smoothing=SMOOTHING
    ) / max(1, int(known.sum()))
    return VerifierLosses(kinds + CLASSES * classes, kinds, classes)


def fit_verifier(
    network: VerifierNetwork,
    pool: VerifierPool,
    run: Path,
    options: VerifierFit | None = None,
    *,
    validate: Callable[[VerifierNetwork], dict[str, float]] | None = None,
    progress: bool = True,
) -> VerifierNetwork:
    """Train a verifier, or go on where the run in this folder stopped.

    Parameters
    ----------
    network
        Trained in place, on a GPU where there is one.
    pool
        Patches of which it is known what they show.
    run
        Folder of the run; made where missing.
    options
        How to train.
    validate
        Called with the averaged verifier at each checkpoint; its figures go to the metrics.
    progress
        Whether a progress bar with the time left is shown.

    Returns
    -------
    The verifier with averaged weights, in evaluation mode.

    Raises
    ------
    InputError
        If the folder holds a run of another one.
    """
    options = options or VerifierFit()
    network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]

    def losses(batch: VerifierBatch, device: torch.device, _: float) -> dict[str, Tensor]:
        batch = VerifierBatch(*(part.to(device) for part in batch))
        patches = batch.patches.contiguous(memory_format=torch.channels_last)
        return verifier_losses(network(patches), batch)._asdict()

    return train_loop(
        network.train(),
        run,
        options,
        {"verifier_options": asdict(network.options)},
        lambda seed: _batches(pool, options.batch, seed),
        losses,
        kind=KIND,
        most_gradient=2.0,
        validate=validate,
        progress=progress,
    )


def load_verifier(path: Path) -> VerifierNetwork:
    """The averaged verifier of a checkpoint, in evaluation mode.

    Raises
    ------
    InputError
        If the file is missing or no checkpoint.
    """
    state = read_checkpoint(path, "verifier_options", KIND)
    network = VerifierNetwork(VerifierOptions(**state["verifier_options"]))
    network.load_state_dict(module_state(state["averaged"]))
    return network.eval()


def _batches(pool: VerifierPool, size: int, seed: int) -> Iterator[VerifierBatch]:
    """Endless batches, disturbed."""
    rng = np.random.default_rng(seed)
    while True:
        order = rng.permutation(len(pool))
        for start in range(0, len(order), size):
            chosen = np.sort(order[start : start + size])
            classes = pool.classes[chosen].astype(np.int64)
            classes[classes == VerifierPool.UNKNOWN] = -1
            yield VerifierBatch(
                _disturbed(torch.from_numpy(pool.patches[chosen])),
                torch.from_numpy(pool.kinds[chosen].astype(np.int64)),
                torch.from_numpy(classes),
            )


def _disturbed(wider: Tensor) -> Tensor:
    """Patches (n, 72, 72, 3), uint8, cut out anew, in other light: (n, 3, 64, 64), 0 to 1."""
    n = len(wider)
    x = F.grid_sample(
        wider.permute(0, 3, 1, 2).float() / 255,
        F.affine_grid(_cuts(n), [n, 3, SIDE, SIDE], align_corners=False),
        padding_mode="border",
        align_corners=False,
    )
    mean = x.mean(dim=(1, 2, 3), keepdim=True)
    contrast = torch.empty(n, 1, 1, 1).uniform_(*CONTRAST)
    light = torch.empty(n, 1, 1, 1).uniform_(-LIGHT, LIGHT)
    balance = torch.empty(n, 3, 1, 1).uniform_(1 - BALANCE, 1 + BALANCE)
    x = ((x - mean) * contrast + mean + light) * balance
    x = torch.where(torch.rand(n, 1, 1, 1) < GREY, x.mean(dim=1, keepdim=True), x)
    x = x + NOISE * (torch.rand(n, 1, 1, 1) < NOISY) * torch.randn_like(x)
    for k in torch.nonzero(torch.rand(n) < HIDDEN)[:, 0].tolist():
        height, width = torch.randint(*PIECE, (2,)).tolist()
        y, x0 = torch.randint(SIDE - PIECE[0], (2,)).tolist()
        x[k, :, y : y + height, x0 : x0 + width] = torch.rand(3, 1, 1)
    return x.clamp(0, 1)


def _cuts(n: int) -> Tensor:
    """Where patches are cut out of wider ones, mirrored or not: (n, 2, 3), as for affine_grid."""
    size = torch.exp(torch.empty(n, 2).uniform_(*ZOOM)) * SIDE / WIDER_SIDE
    mirrored = torch.where(torch.rand(n) < 0.5, -1.0, 1.0)
    angle = TURN * torch.randn(n)
    across = torch.stack([size[:, 0] * mirrored * angle.cos(), -size[:, 1] * angle.sin()], dim=1)
    down = torch.stack([size[:, 0] * mirrored * angle.sin(), size[:, 1] * angle.cos()], dim=1)
    shift = SHIFT * torch.randn(n, 2, 1)
    return torch.cat([torch.stack([across, down], dim=1), shift], dim=2)
