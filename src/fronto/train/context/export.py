"""From a trained context head to the file that `fronto.engine` runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import msgspec
import torch
from torch import Tensor, nn

from fronto.engine import ReaderEngine
from fronto.engine.companion import companion_stem, replace_companion
from fronto.engine.context import FORMAT
from fronto.labels.context import GEOMETRY, PAIR
from fronto.train.context.fit import stated_options
from fronto.train.context.network import ContextNetwork
from fronto.train.onnxwriter import write_onnx

__all__ = ["export_context"]


class _Deployed(nn.Module):
    """One panel in, probabilities out: the mean of several heads."""

    def __init__(self, networks: Sequence[ContextNetwork]) -> None:
        super().__init__()
        self.networks = nn.ModuleList(networks)

    def forward(
        self, own: Tensor, seen: Tensor, ordered: Tensor, geometry: Tensor, pairs: Tensor
    ) -> Tensor:
        there = torch.ones_like(geometry[None, :, 0], dtype=torch.bool)
        panel = (own[None], seen[None], ordered[None], geometry[None], pairs[None], there)
        told = [network(*panel)[0].softmax(-1) for network in self.networks]
        return torch.stack(told).sum(dim=0) * (1 / len(told))


def export_context(
    networks: Sequence[ContextNetwork],
    reader: ReaderEngine,
    directory: Path,
    metadata: Mapping[str, str],
) -> Path:
    """Write a head beside its reader: ``READER.context-xxxxxxxx.onnx``.

    One that is there already is replaced: a reader has one head.

    Inputs as of `fronto.labels.context.Context`, float32; output ``labels``, probabilities
    (n, labels + 2).

    Parameters
    ----------
    networks
        What `fronto.train.context.fit.fit_context` gives, of one size; of several the mean of
        their answers is taken.
    reader
        The reader that they were trained for.
    directory
        Folder to write to; made where missing.
    metadata
        Put into the file beside what is known here: version, licence, training data, ...

    Returns
    -------
    The file.
    """
    n = torch.export.Dim("things", min=1)
    count = networks[0].count
    path = write_onnx(
        _Deployed(networks).eval(),
        [
            *(torch.zeros(3, count) for _ in range(3)),
            torch.zeros(3, GEOMETRY),
            torch.zeros(3, 3, PAIR),
        ],
        inputs=["own", "seen", "ordered", "geometry", "pairs"],
        outputs=["labels"],
        dynamic=[*({0: n} for _ in range(4)), {0: n, 1: n}],
        metadata={
            "format": FORMAT,
            "network": reader.digest,
            "labels": ",".join(networks[0].labels),
            "heads": str(len(networks)),
            "options": msgspec.json.encode(
                {k: v for k, v in stated_options(networks[0]).items() if k != "labels"}
            ).decode(),
            **metadata,
        },
        directory=directory,
        name=companion_stem(reader.path, "context"),
    )
    replace_companion(path, companion_stem(reader.path, "context"))
    return path
