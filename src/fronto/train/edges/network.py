"""The edge head: a small network over what the photo shows across outlines.

Convolutions run across each curve; between them every curve is told the mean of its outline's
curves and that of the photo's outlines, place by place, as in PointNet (Qi et al., CVPR 2017):
which of its edges is a button's shows on the others, too.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn
from torch.nn import functional

from fronto.errors import InputError
from fronto.outlines.edgeprofiles import ABOUT, BINS, CHANNELS, CURVES

__all__ = ["EdgeNetwork", "EdgeOptions"]

#: Contrast below this share of white is not stretched to the full one.
LEAST_CONTRAST = 0.02


@dataclass(frozen=True)
class EdgeOptions:
    """How large the head is.

    Parameters
    ----------
    width
        Channels.
    blocks
        How often curves are told of the others.
    cell
        Places that share a cell, a divisor of 64.

    Raises
    ------
    InputError
        Naming the field that is out of range.
    """

    width: int = 32
    blocks: int = 3
    cell: int = 4

    def __post_init__(self) -> None:
        for name, value in (("width", self.width), ("blocks", self.blocks)):
            if value < 1:
                raise InputError(name, f"expected 1 or more, got {value}")
        if self.cell < 1 or BINS % self.cell:
            raise InputError("cell", f"expected a divisor of {BINS}, got {self.cell}")


def _convolution(given: int, told: int, side: int, *, stride: int = 1, apart: int = 1) -> nn.Module:
    return nn.Sequential(
        nn.Conv2d(
            given,
            told,
            (1, side),
            (1, stride),
            padding=(0, apart * (side // 2)),
            dilation=(1, apart),
            bias=False,
        ),
        nn.BatchNorm2d(told),
        nn.ReLU(inplace=True),
    )


class _Exchange(nn.Module):
    """Curves are told of their outline's and their photo's, and look again."""

    def __init__(self, width: int) -> None:
        super().__init__()
        self.own, self.outline, self.photo = (
            nn.Conv2d(width, width, 1, bias=False) for _ in range(3)
        )
        self.norm = nn.BatchNorm2d(width)
        self.layers = nn.Sequential(
            _convolution(width, width, 3), _convolution(width, width, 3, apart=2)
        )

    def forward(self, x: Tensor, photo: Tensor | None) -> Tensor:
        mean = functional.avg_pool2d(x, (CURVES, 1))
        if photo is None:
            seen = self.photo(mean.mean(dim=2, keepdim=True))
        else:
            count = torch.bincount(photo)
            total = mean.new_zeros(1, mean.shape[1], len(count), mean.shape[3])
            total = total.index_add_(2, photo, mean) / count[:, None].clamp(min=1)
            seen = self.photo(total)[:, :, photo]
        told = self.own(x) + _to_curves(self.outline(mean) + seen)
        y: Tensor = self.layers(torch.relu(self.norm(told)))
        return x + y


def _to_curves(x: Tensor, cells: int = 1) -> Tensor:
    """What outlines (1, width, n, ...) are told, as all of their curves are: (1, width, 8 n, ...).

    And as many of their `cells` are. By a resizing: ONNX Runtime keeps its own layout of channels
    over that.
    """
    return functional.interpolate(x, scale_factor=(CURVES, cells), mode="nearest")


class EdgeNetwork(nn.Module):
    """The head.

    Parameters
    ----------
    options
        How large it is.
    """

    def __init__(self, options: EdgeOptions | None = None) -> None:
        super().__init__()
        self.options = options = options or EdgeOptions()
        width, cell = options.width, options.cell
        self.first = nn.Sequential(
            _convolution(CHANNELS, width, 2 * cell - 1, stride=cell),
            _convolution(width, width, 3),
            _convolution(width, width, 3, apart=2),
        )
        self.about = nn.Linear(ABOUT, width)
        self.exchanges = nn.ModuleList(_Exchange(width) for _ in range(options.blocks))
        self.last = nn.Conv2d(width, cell, (1, 3), padding=(0, 1))

    def forward(self, profiles: Tensor, about: Tensor, photo: Tensor | None = None) -> Tensor:
        """Logits (n, 8, 64) of the places across each curve.

        Parameters
        ----------
        profiles
            (n, 8, 64, 4), 0 to 1.
        about
            (n, 3).
        photo
            (n,): number of the photo that each outline is of; None: one photo's.
        """
        channels = profiles.permute(3, 0, 1, 2).flatten(2)
        colors = channels[:3]
        # What light there is says nothing: each outline has a mean of 0 and a contrast of 1.
        mean = colors.mean(dim=(0, 2), keepdim=True)
        contrast = (colors - mean).square().mean(dim=(0, 2), keepdim=True).sqrt()
        contrast = contrast + LEAST_CONTRAST
        x = torch.cat([(colors - mean) / contrast, channels[3:] / contrast])
        # Curves as the rows of one picture: the fastest for ONNX Runtime.
        x = self.first(x.reshape(1, CHANNELS, -1, BINS))
        of_outline = about.t()[None, :, :, None]
        weight = self.about.weight[:, :, None, None]
        told = functional.conv2d(of_outline, weight, self.about.bias)
        x = x + _to_curves(told, BINS // self.options.cell)
        for exchange in self.exchanges:
            x = exchange(x, photo)
        return self.last(x)[0].permute(1, 2, 0).reshape(-1, CURVES, BINS)
