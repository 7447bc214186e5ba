"""From a trained verifier to the file that `fronto.engine` runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

import msgspec
import torch
from torch import Tensor, nn

from fronto.engine import Engine
from fronto.engine.companion import companion_stem, replace_companion
from fronto.engine.verifier import FORMAT
from fronto.train.onnxwriter import write_onnx
from fronto.train.verifier.network import VerifierNetwork
from fronto.verification import SIDE

__all__ = ["export_verifier"]


class _Deployed(nn.Module):
    """Bytes in, probabilities out: the mean of several verifiers."""

    def __init__(self, networks: Sequence[VerifierNetwork]) -> None:
        super().__init__()
        self.networks = nn.ModuleList(networks)

    def forward(self, patches: Tensor) -> tuple[Tensor, Tensor]:
        x = patches.permute(0, 3, 1, 2).float() / 255
        told = [network(x) for network in self.networks]
        share = 1 / len(told)
        kinds = torch.stack([one.kinds.softmax(-1) for one in told]).sum(dim=0) * share
        return kinds, torch.stack([one.classes.softmax(-1) for one in told]).sum(dim=0) * share


def export_verifier(
    networks: Sequence[VerifierNetwork],
    engine: Engine,
    directory: Path,
    metadata: Mapping[str, str],
) -> Path:
    """Write a verifier beside its network: ``NETWORK.verifier-xxxxxxxx.onnx``.

    One that is there already is replaced: a network has one.

    Input ``patches`` (n, 64, 64, 3), uint8, as `fronto.verification.describe` cuts them; outputs
    as `fronto.verification.Opinions`.

    Parameters
    ----------
    networks
        What `fronto.train.verifier.fit.fit_verifier` gives; of several the mean is taken.
    engine
        The network on whose finds it was trained.
    directory
        Folder to write to; made where missing.
    metadata
        Put into the file beside what is known here: version, licence, training data, ...

    Returns
    -------
    The file.
    """
    n = torch.export.Dim("finds", min=1)
    name = companion_stem(engine.path, "verifier")
    path = write_onnx(
        _Deployed(networks).eval(),
        [torch.zeros(3, SIDE, SIDE, 3, dtype=torch.uint8)],
        inputs=["patches"],
        outputs=["kinds", "classes"],
        dynamic=[{0: n}],
        metadata={
            "format": FORMAT,
            "network": engine.digest,
            "classes": ",".join(engine.classes),
            "options": msgspec.json.encode([asdict(one.options) for one in networks]).decode(),
            **metadata,
        },
        directory=directory,
        name=name,
    )
    replace_companion(path, name)
    return path
