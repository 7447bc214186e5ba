"""The verifier: the first blocks of MobileNetV2 over a patch of the photo, and what it shows.

Sandler et al., "MobileNetV2" (CVPR 2018); their grid of 4 x 4 cells at the end is weighed with one
weight for each cell and channel, not averaged: what lies in the middle is another thing than what
lies around it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import torch.nn.functional as F
from torch import Tensor, nn

from fronto.categories import CATEGORIES
from fronto.errors import InputError
from fronto.train.network import BN_EPS, Backbone
from fronto.verification import KINDS, SIDE

__all__ = ["Told", "VerifierNetwork", "VerifierOptions"]

#: Pixels of a patch per cell of what the backbone tells at its end.
STRIDE = 16


@dataclass(frozen=True)
class VerifierOptions:
    """How large the verifier is.

    Parameters
    ----------
    blocks
        MobileNetV2's inverted residuals that are used, 11 to 17.
    channels
        Of what is told of each cell.
    frozen
        Blocks at the beginning (the stem, too, where not 0) that stay as they were started from.
    dropout
        Share of the channels that are left out in training.

    Raises
    ------
    InputError
        Naming the field that is out of range.
    """

    blocks: int = 13
    channels: int = 128
    frozen: int = 3
    dropout: float = 0.3

    def __post_init__(self) -> None:
        if not 11 <= self.blocks <= 17:
            raise InputError("blocks", f"expected 11 to 17, got {self.blocks}")
        if self.channels < 1:
            raise InputError("channels", f"expected 1 or more, got {self.channels}")
        if not 0 <= self.frozen <= self.blocks:
            raise InputError("frozen", f"expected 0 to {self.blocks}, got {self.frozen}")
        if not 0 <= self.dropout < 1:
            raise InputError("dropout", f"expected 0 or more and below 1, got {self.dropout:g}")


class Told(NamedTuple):
    """What it says of N patches, as logits: kinds (N, 3), classes (N, 11)."""

    kinds: Tensor
    classes: Tensor


class VerifierNetwork(nn.Module):
    """The verifier.

    Parameters
    ----------
    options
        How large it is.
    """

    def __init__(self, options: VerifierOptions | None = None) -> None:
        super().__init__()
        self.options = options = options or VerifierOptions()
        self.backbone = Backbone(STRIDE, options.blocks)
        width = options.channels
        self.mix = nn.Sequential(
            nn.Conv2d(self.backbone.channels, width, 1, bias=False),
            nn.BatchNorm2d(width, eps=BN_EPS),
            nn.ReLU6(inplace=True),
        )
        self.pool = nn.Conv2d(width, width, SIDE // STRIDE, groups=width)
        self.dropout = nn.Dropout(options.dropout)
        self.last = nn.Linear(width, KINDS + len(CATEGORIES))

    def start_from(self, backbone: Backbone, first: int = 0) -> None:
        """Take over a trained backbone: the blocks from this one on, as many as both have.

        With 0, the stem, too.
        """
        if first == 0:
            self.backbone.stem.load_state_dict(backbone.stem.state_dict())
        pairs = zip(self.backbone.blocks[first:], backbone.blocks[first:], strict=False)
        for own, other in pairs:
            own.load_state_dict(other.state_dict())

    def train(self, mode: bool = True) -> VerifierNetwork:
        """Set the mode, but for the parts that stay: these normalise as they did."""
        super().train(mode)
        for part in self._frozen():
            part.eval()
            part.requires_grad_(False)
        return self

    def _frozen(self) -> list[nn.Module]:
        count = self.options.frozen
        return [self.backbone.stem, *self.backbone.blocks[:count]] if count else []

    def forward(self, patches: Tensor) -> Told:
        """Tell what patches (N, 3, 64, 64), 0 to 1, show."""
        *_, deep = self.backbone(patches)
        told = F.relu6(self.pool(self.mix(deep)).flatten(1))
        kinds, classes = self.last(self.dropout(told)).split([KINDS, len(CATEGORIES)], dim=1)
        return Told(kinds, classes)
