"""From a trained mask head to the file that `fronto.engine` runs."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

import msgspec
import torch
from torch import Tensor, nn

from fronto.engine import Engine
from fronto.engine.companion import companion_stem, replace_companion
from fronto.engine.masks import FORMAT
from fronto.maskhead import FORMS, SIDE
from fronto.train.masks.network import MaskNetwork
from fronto.train.onnxwriter import write_onnx

__all__ = ["export_masks"]


class _Deployed(nn.Module):
    """Bytes in, probabilities out."""

    def __init__(self, network: MaskNetwork) -> None:
        super().__init__()
        self.network = network

    def forward(self, photo: Tensor, rough: Tensor) -> tuple[Tensor, Tensor]:
        told = self.network(photo.permute(0, 3, 1, 2).float() / 255, rough.float() / 255)
        return told.masks.sigmoid(), told.forms.softmax(-1)


def export_masks(
    network: MaskNetwork, engine: Engine, directory: Path, metadata: Mapping[str, str]
) -> Path:
    """Write a head beside its network: ``NETWORK.masks-xxxxxxxx.onnx``.

    One that is there already is replaced: a network has one.

    Inputs ``photo`` (n, 48, 48, 3) and ``rough`` (n, 48, 48), uint8, as
    `fronto.maskhead.Patches`; outputs as `fronto.engine.DrawnMasks`.

    Parameters
    ----------
    network
        What `fronto.train.masks.fit.fit_masks` gives.
    engine
        The network whose finds it was trained on.
    directory
        Folder to write to; made where missing.
    metadata
        Put into the file beside what is known here: version, licence, training data, ...

    Returns
    -------
    The file.
    """
    n = torch.export.Dim("finds", min=1)
    name = companion_stem(engine.path, "masks")
    path = write_onnx(
        _Deployed(network).eval(),
        [
            torch.zeros(3, SIDE, SIDE, 3, dtype=torch.uint8),
            torch.zeros(3, SIDE, SIDE, dtype=torch.uint8),
        ],
        inputs=["photo", "rough"],
        outputs=["masks", "forms"],
        dynamic=[{0: n}, {0: n}],
        metadata={
            "format": FORMAT,
            "network": engine.digest,
            "forms": ",".join(FORMS),
            "options": msgspec.json.encode(asdict(network.options)).decode(),
            **metadata,
        },
        directory=directory,
        name=name,
    )
    replace_companion(path, name)
    return path
