"""How the mask head is trained: batches of patches, and their losses."""

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
from fronto.train.masks.network import Drawn, MaskNetwork, MaskOptions
from fronto.train.masks.pool import Pool
from fronto.train.runs import module_state, read_checkpoint

__all__ = ["MaskBatch", "MaskFit", "MaskLosses", "fit_masks", "load_masks", "mask_losses"]

KIND = "the .pt file of a mask head's run"
#: Pixels this near to a true edge count this much more: the others are easy.
NEAR, EDGE = 2, 4.0
#: Weight of the forms beside the masks; they are not always told apart for certain.
FORMS, SMOOTHING = 0.1, 0.02
#: Changes of the light, of the colours' balance, and of the noise: deviations; and the shares of
#: patches that are grey, whose colours change places, and that have no rough mask.
LIGHT, BALANCE, NOISE = 0.25, 0.08, 0.03
GREY, OTHER_COLORS, NO_ROUGH = 0.15, 0.3, 0.05


@dataclass(frozen=True)
class MaskFit(LoopOptions):
    """How to train: `fronto.train.loop.LoopOptions` with defaults for patches."""

    steps: int = 12_000
    batch: int = 96
    rate: float = 3e-3


class MaskBatch(NamedTuple):
    """B patches.

    Parameters
    ----------
    photo
        (B, 3, 48, 48), 0 to 1.
    rough, masks
        (B, 48, 48), 0 to 1.
    forms
        (B,): index, -1 for unknown.
    """

    photo: Tensor
    rough: Tensor
    masks: Tensor
    forms: Tensor


class MaskLosses(NamedTuple):
    """Means over a batch.

    Parameters
    ----------
    total
        What is minimised.
    pixels
        Cross entropy of the pixels, those at edges above all.
    overlap
        1 less the intersection over union of the masks.
    forms
        Cross entropy.
    """

    total: Tensor
    pixels: Tensor
    overlap: Tensor
    forms: Tensor


def mask_losses(told: Drawn, batch: MaskBatch) -> MaskLosses:
    """The losses of a batch."""
    true, side = batch.masks, 2 * NEAR + 1
    high = F.max_pool2d(true[:, None], side, 1, NEAR)[:, 0]
    low = -F.max_pool2d(-true[:, None], side, 1, NEAR)[:, 0]
    each = F.binary_cross_entropy_with_logits(told.masks, true, reduction="none")
    pixels = 2 * (each * (1 + EDGE * (high - low))).mean()
    drawn = told.masks.sigmoid()
    shared = (drawn * true).sum(dim=(1, 2))
    either = (drawn + true).sum(dim=(1, 2)) - shared
    overlap = (1 - shared / (either + 1)).mean()
    known = batch.forms >= 0
    forms = F.cross_entropy(
        told.forms[known], batch.forms[known], reduction="sum", label_smoothing=SMOOTHING
    ) / max(1, int(known.sum()))
    return MaskLosses(pixels + overlap + FORMS * forms, pixels, overlap, forms)


def fit_masks(
    network: MaskNetwork,
    pool: Pool,
    run: Path,
    options: MaskFit | None = None,
    *,
    validate: Callable[[MaskNetwork], dict[str, float]] | None = None,
    progress: bool = True,
) -> MaskNetwork:
    """Train a head, or go on where the run in this folder stopped.

    Parameters
    ----------
    network
        Trained in place, on a GPU where there is one.
    pool
        Patches whose masks are known.
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
    options = options or MaskFit()
    network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]

    def losses(batch: MaskBatch, device: torch.device, _: float) -> dict[str, Tensor]:
        batch = MaskBatch(*(part.to(device) for part in batch))
        photo = batch.photo.contiguous(memory_format=torch.channels_last)
        return mask_losses(network(photo, batch.rough), batch)._asdict()

    return train_loop(
        network,
        run,
        options,
        {"mask_options": asdict(network.options)},
        lambda seed: _batches(pool, options.batch, seed),
        losses,
        kind=KIND,
        validate=validate,
        progress=progress,
    )


def load_masks(path: Path) -> MaskNetwork:
    """The averaged head of a checkpoint, in evaluation mode.

    Raises
    ------
    InputError
        If the file is missing or no checkpoint.
    """
    state = read_checkpoint(path, "mask_options", KIND)
    network = MaskNetwork(MaskOptions(**state["mask_options"]))
    network.load_state_dict(module_state(state["averaged"]))
    return network.eval()


def _batches(pool: Pool, size: int, seed: int) -> Iterator[MaskBatch]:
    """Endless batches, disturbed."""
    rng = np.random.default_rng(seed)
    while True:
        order = rng.permutation(len(pool))
        for start in range(0, len(order), size):
            yield _disturbed(*_taken(pool, np.sort(order[start : start + size])))


def _taken(pool: Pool, chosen: np.ndarray) -> MaskBatch:
    forms = pool.forms[chosen].astype(np.int64)
    forms[forms == Pool.UNKNOWN] = -1
    return MaskBatch(
        torch.from_numpy(pool.photo[chosen]).permute(0, 3, 1, 2).float() / 255,
        torch.from_numpy(pool.rough[chosen]).float() / 255,
        torch.from_numpy(pool.masks[chosen]).float() / 255,
        torch.from_numpy(forms),
    )


def _disturbed(photo: Tensor, rough: Tensor, masks: Tensor, forms: Tensor) -> MaskBatch:
    """Turned and mirrored, in other light, with other colours and noise."""
    n = len(photo)
    together = _turned(torch.cat([photo, rough[:, None], masks[:, None]], dim=1))
    photo, rough, masks = together[:, :3], together[:, 3], together[:, 4]
    light = torch.exp(LIGHT * torch.randn(n, 1, 1, 1) + BALANCE * torch.randn(n, 3, 1, 1))
    photo = photo * light
    grey = torch.rand(n, 1, 1, 1) < GREY
    photo = torch.where(grey, photo.mean(dim=1, keepdim=True), photo)
    if torch.rand(()) < OTHER_COLORS:
        photo = photo[:, torch.randperm(3)]
    photo = photo + NOISE * torch.rand(n, 1, 1, 1) ** 2 * torch.randn_like(photo)
    return MaskBatch(photo, rough * (torch.rand(n, 1, 1) >= NO_ROUGH), masks, forms)


def _turned(x: Tensor) -> Tensor:
    """Patches (n, c, s, s), each one mirrored or turned by quarters, or not."""
    for axes in ((2,), (3,)):
        chosen = torch.rand(len(x), 1, 1, 1) < 0.5
        x = torch.where(chosen, x.flip(axes), x)
    return torch.where(torch.rand(len(x), 1, 1, 1) < 0.5, x.transpose(2, 3), x)
