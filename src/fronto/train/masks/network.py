"""The mask head: a small encoder and decoder over a patch of the photo and its rough mask.

As U-Net (Ronneberger et al., MICCAI 2015), of depthwise separable convolutions.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from fronto.errors import InputError
from fronto.maskhead import FORMS

__all__ = ["Drawn", "MaskNetwork", "MaskOptions"]

#: The rough mask is a fourth channel.
CHANNELS = 4
#: Grey levels, as shares of white: contrast below this is not stretched to the full one.
LEAST_CONTRAST = 0.03


@dataclass(frozen=True)
class MaskOptions:
    """How wide the head is.

    Parameters
    ----------
    widths
        Channels at a half, a quarter and an eighth of the patch's resolution.
    blocks
        Convolutions at each of them beyond the first.
    fine
        Channels at full resolution.
    """

    widths: tuple[int, int, int] = (24, 48, 80)
    blocks: tuple[int, int, int] = (1, 2, 3)
    fine: int = 8

    def __post_init__(self) -> None:
        # Checkpoints have lists.
        object.__setattr__(self, "widths", tuple(self.widths))
        object.__setattr__(self, "blocks", tuple(self.blocks))
        for name, values, least in (
            ("widths", self.widths, 1),
            ("blocks", self.blocks, 0),
            ("fine", (self.fine,), 1),
        ):
            if min(values) < least:
                raise InputError(name, f"expected {least} or more, got {min(values)}")


class Drawn(NamedTuple):
    """What the head says of N patches, as logits: masks (N, 48, 48), forms (N, 3)."""

    masks: Tensor
    forms: Tensor


def _convolution(
    given: int, told: int, side: int = 3, stride: int = 1, groups: int = 1
) -> nn.Module:
    return nn.Sequential(
        nn.Conv2d(given, told, side, stride, side // 2, groups=groups, bias=False),
        nn.BatchNorm2d(told),
        nn.ReLU(inplace=True),
    )


class _Separable(nn.Module):
    """A depthwise separable convolution; a residual one where its shape allows."""

    def __init__(self, given: int, told: int, stride: int = 1) -> None:
        super().__init__()
        self.layers = nn.Sequential(
            _convolution(given, given, 3, stride, given), _convolution(given, told, 1)
        )
        self.residual = stride == 1 and given == told

    def forward(self, x: Tensor) -> Tensor:
        y: Tensor = self.layers(x)
        return x + y if self.residual else y


class MaskNetwork(nn.Module):
    """The head.

    Parameters
    ----------
    options
        How wide it is.
    """

    def __init__(self, options: MaskOptions | None = None) -> None:
        super().__init__()
        self.options = options = options or MaskOptions()
        half, quarter, eighth = options.widths
        more = options.blocks
        self.second = nn.Sequential(
            _convolution(CHANNELS, half, 3, 2), *(_Separable(half, half) for _ in range(more[0]))
        )
        self.fourth = nn.Sequential(
            _Separable(half, quarter, 2), *(_Separable(quarter, quarter) for _ in range(more[1]))
        )
        self.eighth = nn.Sequential(
            _Separable(quarter, eighth, 2), *(_Separable(eighth, eighth) for _ in range(more[2]))
        )
        self.whole = nn.Sequential(
            nn.Linear(eighth, eighth), nn.ReLU(), nn.Linear(eighth, eighth), nn.Sigmoid()
        )
        self.forms = nn.Sequential(nn.Linear(eighth, 64), nn.ReLU(), nn.Linear(64, len(FORMS)))
        self.to_quarter = nn.Conv2d(eighth, quarter, 1)
        self.at_quarter = _Separable(quarter, quarter)
        self.to_half = nn.Conv2d(quarter, half, 1)
        self.at_half = _Separable(half, half)
        self.to_full = nn.Conv2d(half, 4 * options.fine, 1)
        self.fine = _convolution(CHANNELS, options.fine)
        both = 2 * options.fine
        self.last = nn.Sequential(
            _Separable(both, options.fine), nn.Conv2d(options.fine, 1, 3, 1, 1)
        )

    def forward(self, photo: Tensor, rough: Tensor) -> Drawn:
        """Draw masks.

        Parameters
        ----------
        photo
            (N, 3, 48, 48), 0 to 1.
        rough
            (N, 48, 48), 0 to 1.
        """
        # What light there is says nothing: each patch has a mean of 0 and a contrast of 1.
        mean = photo.mean(dim=(1, 2, 3), keepdim=True)
        contrast = (photo - mean).square().mean(dim=(1, 2, 3), keepdim=True).sqrt()
        x = torch.cat([(photo - mean) / (contrast + LEAST_CONTRAST), 2 * rough[:, None] - 1], dim=1)
        half = self.second(x)
        quarter = self.fourth(half)
        eighth = self.eighth(quarter)
        seen = eighth.mean(dim=(2, 3))
        eighth = eighth * self.whole(seen)[:, :, None, None]
        quarter = self.at_quarter(_twice(self.to_quarter(eighth)) + quarter)
        half = self.at_half(_twice(self.to_half(quarter)) + half)
        full = torch.cat([F.pixel_shuffle(self.to_full(half), 2), self.fine(x)], dim=1)
        return Drawn(self.last(full)[:, 0], self.forms(seen))


def _twice(x: Tensor) -> Tensor:
    return F.interpolate(x, scale_factor=2.0, mode="bilinear", align_corners=False)
