"""From a trained mask head to the file that `fronto.engine` runs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

import msgspec
import torch
from torch import Tensor, nn

from fronto.engine import Engine
from fronto.engine.companion import companion_stem, replace_companion
from fronto.engine.masks import FORMAT
from fronto.maskhead import FORMS, REACH, SIDE
from fronto.train.masks.network import MaskNetwork
from fronto.train.onnxwriter import write_onnx
from fronto.units import LABEL, OTHER_END, THIN, WIDTH

__all__ = ["export_masks"]


class _Deployed(nn.Module):
    """Bytes in, probabilities out: the mean of several heads.

    Where some of them tell a button from the label beside it, these are believed.
    """

    def __init__(self, networks: Sequence[MaskNetwork]) -> None:
        super().__init__()
        self.networks = nn.ModuleList(networks)

    def forward(self, photo: Tensor, rough: Tensor) -> tuple[Tensor, Tensor]:
        photo, rough = photo.permute(0, 3, 1, 2).float() / 255, rough.float() / 255
        told = [network(photo, rough) for network in self.networks]
        forms = torch.stack([one.forms.softmax(-1) for one in told]).mean(dim=0)
        masks = torch.stack([one.masks.sigmoid() for one in told], dim=1)
        if len(told) == 1:
            return masks[:, 0], forms
        tells = _tells_label(masks).float()
        tells = tells + (tells.sum(dim=1, keepdim=True) == 0).float()
        share = tells / tells.sum(dim=1, keepdim=True)
        return (masks * share[..., None, None]).sum(dim=1), forms


def _tells_label(masks: Tensor) -> Tensor:
    """Whether masks (n, h, 48, 48) leave room for a label, as `fronto.units` has it: (n, h)."""
    inside = (masks > 0.5).float()
    free = []
    for axis in (-2, -1):  # columns, rows
        count = inside.sum(dim=axis)
        full = (count > THIN * count.amax(dim=-1, keepdim=True)).float()
        ends = (full.argmax(dim=-1), full.flip(-1).argmax(dim=-1))
        free.append([(end.float() / SIDE - 0.5) * REACH + 0.5 for end in ends])
    (left, right), (above, below) = free
    sides = torch.stack([left, above, right, below], dim=-1)
    across = torch.stack([above + below, left + right] * 2, dim=-1)
    most, end = sides.max(dim=-1, keepdim=True)
    other = sides.roll(2, dims=-1).gather(-1, end)
    label = (most >= LABEL) & (other <= OTHER_END * most) & (1 - across.gather(-1, end) >= WIDTH)
    return label[..., 0]


def export_masks(
    networks: Sequence[MaskNetwork], engine: Engine, directory: Path, metadata: Mapping[str, str]
) -> Path:
    """Write a head beside its network: ``NETWORK.masks-xxxxxxxx.onnx``.

    One that is there already is replaced: a network has one.

    Inputs ``photo`` (n, 48, 48, 3) and ``rough`` (n, 48, 48), uint8, as
    `fronto.maskhead.Patches`; outputs as `fronto.engine.DrawnMasks`.

    Parameters
    ----------
    networks
        What `fronto.train.masks.fit.fit_masks` gives; of several the mean is taken.
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
        _Deployed(networks).eval(),
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
            "options": msgspec.json.encode([asdict(one.options) for one in networks]).decode(),
            **metadata,
        },
        directory=directory,
        name=name,
    )
    replace_companion(path, name)
    return path
