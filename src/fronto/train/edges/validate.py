"""Figures of an edge head in training, on outlines that it does not learn from."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch

from fronto.outlines.edgeprofiles import BINS
from fronto.train.edges.network import EdgeNetwork
from fronto.train.edges.pool import EdgePool

__all__ = ["edge_figures", "edge_validation"]


def edge_validation(pool: EdgePool) -> Callable[[EdgeNetwork], dict[str, float]]:
    """Make what `fronto.train.edges.fit.fit_edges` calls at each checkpoint."""
    return lambda network: edge_figures(network, pool)


@torch.no_grad()
def edge_figures(network: EdgeNetwork, pool: EdgePool) -> dict[str, float]:
    """Median distances of the likeliest places and of the masks' edges from the true ones, pixels.

    And the share of the curves at which the edge is missed by more than an eighth of the reach.

    Parameters
    ----------
    network
        In evaluation mode.
    pool
        Outlines that it has not learned from.
    """
    device = next(network.parameters()).device
    told = []
    for rows in pool.photos():
        profiles = torch.from_numpy(pool.profiles[rows]).to(device).float() / 255
        places = network(profiles, torch.from_numpy(pool.about[rows]).to(device))
        told.append(places.argmax(dim=-1).cpu().numpy())
    offsets = pool.offsets
    known = np.abs(offsets) < 1
    off = np.abs((np.concatenate(told) + 0.5) / (BINS / 2) - 1 - offsets)
    reaches = np.broadcast_to(pool.reaches[:, None], offsets.shape)
    if not known.any():
        return {"off_px": float("nan"), "mask_off_px": float("nan"), "missed": float("nan")}
    return {
        "off_px": float(np.median((off * reaches)[known])),
        "mask_off_px": float(np.median((np.abs(offsets) * reaches)[known])),
        "missed": float((off[known] > 0.125).mean()),
    }
