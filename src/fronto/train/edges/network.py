"""The edge head: a small network over what the photo shows across outlines.

Convolutions run across each curve; between them every curve is told the mean of its outline's
curves and that of the photo's outlines, place by place, as in PointNet (Qi et al., CVPR 2017):
which of its edges is a button's shows on the others, too.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from fronto.errors import InputError
from fronto.outlines.edgeprofiles import ABOUT, BINS, CHANNELS, CURVES

__all__ = ["EdgeNetwork", "EdgeOptions"]

#: Places that share a cell.
CELL = 4
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

    Raises
    ------
    InputError
        Naming the field that is out of range.
    """

    width: int = 32
    blocks: int = 3

    def __post_init__(self) -> None:
        for name, value in (("width", self.width), ("blocks", self.blocks)):
            if value < 1:
                raise InputError(name, f"expected 1 or more, got {value}")


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
        mean = _of_outlines(x).mean(dim=3)
        if photo is None:
            seen = self.photo(mean.mean(dim=2, keepdim=True))
        else:
            count = torch.bincount(photo)
            total = mean.new_zeros(1, mean.shape[1], len(count), mean.shape[3])
            total = total.index_add_(2, photo, mean) / count[:, None].clamp(min=1)
            seen = self.photo(total)[:, :, photo]
        others = (self.outline(mean) + seen)[:, :, :, None]
        told = (_of_outlines(self.own(x)) + others).flatten(2, 3)
        y: Tensor = self.layers(torch.relu(self.norm(told)))
        return x + y


def _of_outlines(x: Tensor) -> Tensor:
    """Curves (1, width, 8 n, cells) as (1, width, n, 8, cells)."""
    return x.reshape(1, x.shape[1], -1, CURVES, x.shape[3])


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
        width = options.width
        self.first = nn.Sequential(
            _convolution(CHANNELS, width, 7, stride=CELL),
            _convolution(width, width, 3),
            _convolution(width, width, 3, apart=2),
        )
        self.about = nn.Linear(ABOUT, width)
        self.exchanges = nn.ModuleList(_Exchange(width) for _ in range(options.blocks))
        self.last = nn.Conv2d(width, CELL, (1, 3), padding=(0, 1))

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
        colors = profiles[..., :3]
        # What light there is says nothing: each outline has a mean of 0 and a contrast of 1.
        mean = colors.mean(dim=(1, 2, 3), keepdim=True)
        contrast = (colors - mean).square().mean(dim=(1, 2, 3), keepdim=True).sqrt()
        contrast = contrast + LEAST_CONTRAST
        x = torch.cat([(colors - mean) / contrast, profiles[..., 3:] / contrast], dim=3)
        # Curves as the rows of one picture: the fastest for ONNX Runtime.
        x = self.first(x.flatten(0, 1).permute(2, 0, 1)[None])
        told = self.about(about).t()[None, :, :, None, None]
        x = (_of_outlines(x) + told).flatten(2, 3)
        for exchange in self.exchanges:
            x = exchange(x, photo)
        return self.last(x)[0].permute(1, 2, 0).reshape(-1, CURVES, BINS)
