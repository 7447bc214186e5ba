"""Figures of a verifier in training, on patches that it does not learn from."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch

from fronto.train.verifier.network import VerifierNetwork
from fronto.train.verifier.pool import WIDER_SIDE, VerifierPool
from fronto.verification import SIDE

__all__ = ["verifier_figures", "verifier_validation"]

#: Patches in one call.
AT_ONCE = 256


def verifier_validation(pool: VerifierPool) -> Callable[[VerifierNetwork], dict[str, float]]:
    """Make what `fronto.train.verifier.fit.fit_verifier` calls at each checkpoint."""
    return lambda network: verifier_figures(network, pool)


@torch.no_grad()
def verifier_figures(network: VerifierNetwork, pool: VerifierPool) -> dict[str, float]:
    """Shares that are right: of all kinds, of plates, of buttons' categories.

    Parameters
    ----------
    network
        In evaluation mode.
    pool
        Patches that it has not learned from.
    """
    device = next(network.parameters()).device
    edge = (WIDER_SIDE - SIDE) // 2
    middle = pool.patches[:, edge : edge + SIDE, edge : edge + SIDE]
    kinds, classes = [], []
    for start in range(0, len(pool), AT_ONCE):
        part = torch.from_numpy(middle[start : start + AT_ONCE].copy()).to(device)
        told = network(part.permute(0, 3, 1, 2).float() / 255)
        kinds.append(told.kinds.argmax(1).cpu().numpy())
        classes.append(told.classes.argmax(1).cpu().numpy())
    right = np.concatenate(kinds) == pool.kinds
    plates = pool.kinds == 2
    known = (pool.kinds == 1) & (pool.classes != VerifierPool.UNKNOWN)
    named = np.concatenate(classes) == pool.classes
    return {
        "kinds_right": float(right.mean()),
        "plates_right": float(right[plates].mean()) if plates.any() else float("nan"),
        "named_right": float(named[known].mean()) if known.any() else float("nan"),
    }
