"""Figures of a mask head in training, on patches that it does not learn from."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch

from fronto.train.masks.network import MaskNetwork
from fronto.train.masks.pool import Pool

__all__ = ["mask_figures", "mask_validation"]

#: Patches in one call.
AT_ONCE = 256


def mask_validation(pool: Pool) -> Callable[[MaskNetwork], dict[str, float]]:
    """Make what `fronto.train.masks.fit.fit_masks` calls at each checkpoint."""
    return lambda network: mask_figures(network, pool)


@torch.no_grad()
def mask_figures(network: MaskNetwork, pool: Pool) -> dict[str, float]:
    """How well masks and forms agree with the true ones.

    The median and the tenth percentile of the masks' intersection over union, the median of the
    rough masks', and the share of the forms that are right.

    Parameters
    ----------
    network
        In evaluation mode.
    pool
        Patches that it has not learned from.
    """
    device = next(network.parameters()).device
    overlaps, rough_overlaps, right = [], [], []
    for start in range(0, len(pool), AT_ONCE):
        part = slice(start, start + AT_ONCE)
        photo = torch.from_numpy(pool.photo[part]).to(device).permute(0, 3, 1, 2).float() / 255
        rough = torch.from_numpy(pool.rough[part]).to(device).float() / 255
        told = network(photo, rough)
        true = pool.masks[part] > 127
        overlaps.append(_overlap((told.masks > 0).cpu().numpy(), true))
        rough_overlaps.append(_overlap(pool.rough[part] > 127, true))
        known = pool.forms[part] != Pool.UNKNOWN
        right.append((told.forms.argmax(1).cpu().numpy() == pool.forms[part])[known])
    iou, before, forms = (np.concatenate(x) for x in (overlaps, rough_overlaps, right))
    return {
        "iou": float(np.median(iou)),
        "iou_tenth": float(np.quantile(iou, 0.1)),
        "iou_rough": float(np.median(before)),
        "forms_right": float(forms.mean()) if len(forms) else float("nan"),
    }


def _overlap(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    shared = (first & second).sum(axis=(1, 2))
    return np.asarray(shared / np.maximum((first | second).sum(axis=(1, 2)), 1))
