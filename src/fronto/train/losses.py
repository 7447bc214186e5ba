"""How wrong the maps are.

Classes: cross entropy, for buttons of unknown kind that of "any button". Masks: binary cross
entropy at full resolution. Centres: focal loss for peaks (Law and Deng, "CornerNet", ECCV 2018,
Eq. 1). Sides: generalised intersection over union (Rezatofighi et al., CVPR 2019).
"""

from __future__ import annotations

from typing import NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor

from fronto.train.network import Maps
from fronto.train.targets import IGNORE, SOME_BUTTON

__all__ = ["Batch", "Losses", "losses"]


class Batch(NamedTuple):
    """Pictures (N, 3, H, W) in 0 to 1, and their `fronto.train.targets.Targets`, stacked."""

    image: Tensor
    masks: Tensor
    classes: Tensor
    weights: Tensor
    centers: Tensor
    sides: Tensor
    inside: Tensor


class Losses(NamedTuple):
    """The parts of the loss; `total` is what is minimised."""

    classes: Tensor
    masks: Tensor
    centers: Tensor
    sides: Tensor

    @property
    def total(self) -> Tensor:
        """Weighted sum."""
        return self.classes + 2.0 * self.masks + 0.5 * self.centers + self.sides


def losses(maps: Maps, batch: Batch) -> Losses:
    """Compare the network's maps with the targets of a batch."""
    return Losses(
        _classes(maps.classes.float(), batch),
        _masks(maps.masks.float(), batch.masks),
        _centers(maps.centers.float(), batch.centers),
        _sides(maps.sides.float(), batch.sides, batch.inside),
    )


def _classes(logits: Tensor, batch: Batch) -> Tensor:
    logs = F.log_softmax(logits, dim=1)
    target = batch.classes.long()
    known = target < logits.shape[1]
    chosen = logs.gather(1, torch.where(known, target, 0)[:, None])[:, 0]
    anything = torch.logsumexp(logs[:, 1:-1], dim=1)
    cost = -torch.where(target == SOME_BUTTON, anything, chosen)
    valid = (target != IGNORE).float() * batch.weights
    return (cost * valid).sum() / valid.sum().clamp(min=1)


def _masks(logits: Tensor, target: Tensor) -> Tensor:
    wanted = torch.stack([target == 1, target == 2], dim=1).float()
    valid = (target != IGNORE).float()[:, None]
    cost = F.binary_cross_entropy_with_logits(logits, wanted, reduction="none")
    return (cost * valid).sum() / valid.sum().clamp(min=1)


def _centers(logits: Tensor, target: Tensor) -> Tensor:
    p = torch.sigmoid(logits).clamp(1e-4, 1 - 1e-4)
    peak = (target == 1).float()
    valid = (target >= 0).float()
    hit = peak * (1 - p) ** 2 * torch.log(p)
    miss = valid * (1 - peak) * (1 - target.clamp(min=0)) ** 4 * p**2 * torch.log(1 - p)
    return -(hit + miss).sum() / peak.sum().clamp(min=1)


def _sides(sides: Tensor, target: Tensor, weight: Tensor) -> Tensor:
    left, top, right, bottom = sides.unbind(1)
    l0, t0, r0, b0 = target.unbind(1)
    area = (left + right) * (top + bottom)
    true = (l0 + r0) * (t0 + b0)
    width = torch.minimum(left, l0) + torch.minimum(right, r0)
    height = torch.minimum(top, t0) + torch.minimum(bottom, b0)
    shared = width * height
    union = area + true - shared
    hull = (torch.maximum(left, l0) + torch.maximum(right, r0)) * (
        torch.maximum(top, t0) + torch.maximum(bottom, b0)
    )
    cost = 1 - shared / union + (hull - union) / hull
    return (cost * weight).sum() / weight.sum().clamp(min=1)
