"""From a trained reader to the file that `fronto.engine.ReaderEngine` runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

import msgspec
import torch
from torch import Tensor, nn

from fronto.engine.reader import FORMAT
from fronto.labels.alphabet import ALPHABET, CROP_PX, KINDS
from fronto.train.onnxwriter import write_onnx
from fronto.train.reader.fit import network_input
from fronto.train.reader.network import ReaderNetwork
from fronto.train.reader.validate import Temperatures

__all__ = ["export_reader"]


class _Deployed(nn.Module):
    """Bytes in, probabilities out."""

    def __init__(self, network: ReaderNetwork, temperatures: Temperatures) -> None:
        super().__init__()
        self.network = network
        self.temperatures = temperatures

    def forward(self, crops: Tensor) -> tuple[Tensor, Tensor]:
        logits = self.network(network_input(crops))
        return (
            torch.softmax(logits.text * (1 / self.temperatures.text), dim=2),
            torch.softmax(logits.kind * (1 / self.temperatures.kind), dim=1),
        )


def export_reader(
    network: ReaderNetwork,
    directory: Path,
    name: str,
    metadata: Mapping[str, str],
    temperatures: Temperatures | None = None,
) -> Path:
    """Write a reader as ONNX, its name ending in the first eight digits of its SHA-256.

    Input ``crops``: (N, 48, 48, 3) uint8, RGB. Outputs, as probabilities: ``text`` (N, 24, 40),
    steps along x of CTC's blank and the alphabet, and ``kind`` (N, 11).

    Parameters
    ----------
    network
        What `fronto.train.reader.fit` gives.
    directory
        Folder to write to; made where missing.
    name
        Beginning of the file's name.
    metadata
        Put into the file beside what is known here: version, licence, training data, ...
    temperatures
        What the logits are divided by; part of the file.

    Returns
    -------
    The file.
    """
    temperatures = temperatures or Temperatures()
    return write_onnx(
        _Deployed(network, temperatures).eval(),
        [torch.zeros(2, CROP_PX, CROP_PX, 3, dtype=torch.uint8)],
        inputs=["crops"],
        outputs=["text", "kind"],
        dynamic=[{0: torch.export.Dim("batch", min=1)}],
        metadata={
            "format": FORMAT,
            "alphabet": ALPHABET,
            "kinds": ",".join(KINDS),
            "text_temperature": f"{temperatures.text:.4g}",
            "kind_temperature": f"{temperatures.kind:.4g}",
            "network": msgspec.json.encode(asdict(network.options)).decode(),
            **metadata,
        },
        directory=directory,
        name=name,
    )
