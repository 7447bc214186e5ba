"""From a trained relation head to the file that `fronto.engine` runs."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

import msgspec
import torch
from torch import Tensor, nn

from fronto.engine import Engine
from fronto.engine.companion import companion_stem, replace_companion
from fronto.engine.relations import FORMAT
from fronto.relations import CELLS, GEOMETRY, PAIR
from fronto.train.onnxwriter import write_onnx
from fronto.train.relations.network import RelationNetwork

__all__ = ["export_relations"]


#: What a head finds with this probability gets the confidence 0.5, from which on it is shown by
#: default: labels that it learns from miss buttons, so that it is less sure than it should be.
SHOWN = 0.35


class _Deployed(nn.Module):
    """One picture in, probabilities out: the mean of several heads."""

    lift: Tensor

    def __init__(self, networks: Sequence[RelationNetwork], shown: float) -> None:
        super().__init__()
        self.networks = nn.ModuleList(networks)
        lift = math.log((1 - shown) / shown)
        self.register_buffer("lift", torch.tensor([0.0, lift, lift]))

    def forward(self, looks: Tensor, geometry: Tensor, pairs: Tensor) -> tuple[Tensor, ...]:
        there = torch.ones_like(geometry[None, :, 0], dtype=torch.bool)
        told = [
            network(looks[None], geometry[None], pairs[None], there) for network in self.networks
        ]
        share = 1 / len(told)
        kinds = torch.stack([(t.kinds[0] + self.lift).softmax(-1) for t in told]).sum(dim=0) * share
        classes = torch.stack([t.classes[0].softmax(-1) for t in told]).sum(dim=0) * share
        return kinds, classes, torch.stack([t.shifts[0] for t in told]).sum(dim=0) * share


def export_relations(
    networks: Sequence[RelationNetwork],
    engine: Engine,
    directory: Path,
    metadata: Mapping[str, str],
    *,
    shown: float = SHOWN,
) -> Path:
    """Write a head beside its network: ``NETWORK.relations-xxxxxxxx.onnx``.

    One that is there already is replaced: a network has one head.

    Inputs ``looks`` (n, 49, C), ``geometry`` (n, 24) and ``pairs`` (n, n, 8), float32, as
    `fronto.relations.Candidates`; outputs as `fronto.engine.Verdicts`.

    Parameters
    ----------
    networks
        What `fronto.train.relations.fit.fit_relations` gives, of one size; of several the mean
        of their answers is taken, which is a little better than each.
    engine
        The network whose candidates it was trained on.
    directory
        Folder to write to; made where missing.
    metadata
        Put into the file beside what is known here: version, licence, training data, ...
    shown
        What is found with this probability gets the confidence 0.5.

    Returns
    -------
    The file.
    """
    options = networks[0].options
    n = torch.export.Dim("candidates", min=1)
    name = companion_stem(engine.path)
    path = write_onnx(
        _Deployed(networks, shown).eval(),
        [
            torch.zeros(3, CELLS**2, options.features),
            torch.zeros(3, GEOMETRY),
            torch.zeros(3, 3, PAIR),
        ],
        inputs=["looks", "geometry", "pairs"],
        outputs=["kinds", "classes", "shifts"],
        dynamic=[{0: n}, {0: n}, {0: n, 1: n}],
        metadata={
            "format": FORMAT,
            "network": engine.digest,
            "classes": ",".join(engine.classes),
            "heads": str(len(networks)),
            "shown": f"{shown:g}",
            "options": msgspec.json.encode(asdict(options)).decode(),
            **metadata,
        },
        directory=directory,
        name=name,
    )
    replace_companion(path, name)
    return path
