"""From a trained edge head to the file that `fronto.engine` runs."""

from __future__ import annotations

import copy
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any, cast

import msgspec
import torch
from torch import Tensor, nn

from fronto.engine import Engine
from fronto.engine.companion import companion_stem, replace_companion
from fronto.engine.edges import FORMAT
from fronto.outlines.edgeprofiles import ABOUT, BINS, CHANNELS, CURVES
from fronto.train.edges.network import EdgeNetwork
from fronto.train.onnxwriter import write_onnx

__all__ = ["export_edges"]


class _Deployed(nn.Module):
    """Grey levels in, probabilities out: the mean of several heads."""

    def __init__(self, networks: Sequence[EdgeNetwork]) -> None:
        super().__init__()
        self.networks = nn.ModuleList(_folded(network) for network in networks)

    def forward(self, profiles: Tensor, about: Tensor) -> Tensor:
        told = [network(profiles / 255, about).softmax(dim=-1) for network in self.networks]
        return told[0] if len(told) == 1 else torch.stack(told).mean(dim=0)


def _folded(network: EdgeNetwork) -> EdgeNetwork:
    """The same with the normalisations between curves in the convolutions before: fewer steps."""
    network = copy.deepcopy(network).eval()
    for exchange in cast(Any, network.exchanges):
        norm = exchange.norm
        scale = norm.weight / (norm.running_var + norm.eps).sqrt()
        for part in (exchange.own, exchange.outline, exchange.photo):
            part.weight = nn.Parameter(part.weight * scale[:, None, None, None])
        exchange.own.bias = nn.Parameter(norm.bias - norm.running_mean * scale)
        exchange.norm = nn.Identity()
    return network


def export_edges(
    networks: Sequence[EdgeNetwork], engine: Engine, directory: Path, metadata: Mapping[str, str]
) -> Path:
    """Write a head beside its network: ``NETWORK.edges-xxxxxxxx.onnx``.

    One that is there already is replaced: a network has one.

    Inputs ``profiles`` (n, 8, 64, 4) and ``about`` (n, 3), as `fronto.outlines.edgeprofiles` makes
    them; output ``places`` (n, 8, 64), probabilities.

    Parameters
    ----------
    networks
        What `fronto.train.edges.fit.fit_edges` gives; of several the mean is taken.
    engine
        The network on whose masks it was trained.
    directory
        Folder to write to; made where missing.
    metadata
        Put into the file beside what is known here: version, licence, training data, ...

    Returns
    -------
    The file.
    """
    n = torch.export.Dim("outlines", min=1)
    name = companion_stem(engine.path, "edges")
    path = write_onnx(
        _Deployed(networks).eval(),
        [torch.zeros(3, CURVES, BINS, CHANNELS), torch.zeros(3, ABOUT)],
        inputs=["profiles", "about"],
        outputs=["places"],
        dynamic=[{0: n}, {0: n}],
        metadata={
            "format": FORMAT,
            "network": engine.digest,
            "options": msgspec.json.encode([asdict(one.options) for one in networks]).decode(),
            **metadata,
        },
        directory=directory,
        name=name,
    )
    replace_companion(path, name)
    return path
