"""A small residual network that reads a crop: characters along x, and what kind of label it is.

Text by connectionist temporal classification (Graves et al., ICML 2006) over columns of
features, as in CRNN (Shi et al., TPAMI 2017) but without recurrence: labels are short. Plain
3x3 convolutions, as processors run them two to three times as fast as depthwise ones of the
same number of multiplications.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import torch
from torch import Tensor, nn

from fronto.labels.alphabet import ALPHABET, CROP_PX, KINDS, STEPS

__all__ = ["SPELLED", "Lesson", "ReaderNetwork", "ReaderOptions", "Readings"]

#: Columns of the kind head's map: it keeps where things are, as arrows need.
KIND_COLUMNS = 6
#: Characters of a text that the spelling head tells, each at its place.
SPELLED = 4
#: What an untrained network says for nearly every step: nothing. Far fewer steps begin a
#: character, and to learn that first would spoil the features (as in Lin et al., focal loss,
#: Section 4.1).
BLANK_PRIOR = 5.0
#: Share of the features that the heads do without in training.
DROPPED = 0.15


@dataclass(frozen=True)
class ReaderOptions:
    """How wide the network is.

    Parameters
    ----------
    stem
        Channels at half the crop's resolution.
    stages
        Channels of the three residual stages, each half as high as the one before.
    kinds
        Channels of the map that the kind head looks at.
    """

    stem: int = 16
    stages: tuple[int, int, int] = (32, 48, 96)
    kinds: int = 48


class Readings(NamedTuple):
    """What the network tells about N crops.

    Parameters
    ----------
    text
        (N, 24, 40): logits of CTC's blank and of `fronto.labels.alphabet.ALPHABET`, for
        steps along x.
    kind
        (N, 11): logits of `fronto.labels.alphabet.KINDS`.
    """

    text: Tensor
    kind: Tensor


class Lesson(NamedTuple):
    """What the network tells in training.

    Parameters
    ----------
    readings
        As in use.
    spelling
        (N, 4, 40): logits of the first four characters of the text, 0 beyond its end.
    """

    readings: Readings
    spelling: Tensor


def _conv(
    inputs: int,
    outputs: int,
    kernel: tuple[int, int] = (3, 3),
    stride: tuple[int, int] = (1, 1),
    padding: tuple[int, int] = (1, 1),
    *,
    relu: bool = True,
) -> nn.Sequential:
    layers: list[nn.Module] = [
        nn.Conv2d(inputs, outputs, kernel, stride, padding, bias=False),
        nn.BatchNorm2d(outputs),
    ]
    if relu:
        layers.append(nn.ReLU(inplace=True))
    return nn.Sequential(*layers)


class _Residual(nn.Module):
    """Two 3x3 convolutions beside a shortcut (He et al., CVPR 2016)."""

    def __init__(self, channels: int) -> None:
        super().__init__()
        self.first = _conv(channels, channels)
        self.second = _conv(channels, channels, relu=False)

    def forward(self, x: Tensor) -> Tensor:
        return torch.relu(x + self.second(self.first(x)))


class ReaderNetwork(nn.Module):
    """Crops (N, 3, 48, 48), RGB, 0 to 1, to `Readings`.

    Each crop is first freed of its own brightness and contrast: lit, dark and faded labels
    look alike then.
    """

    def __init__(self, options: ReaderOptions | None = None) -> None:
        super().__init__()
        self.options = options = options or ReaderOptions()
        width = options.stem
        layers: list[nn.Module] = [_conv(3, width, stride=(2, 2))]
        for channels in options.stages:
            layers += [_conv(width, channels, stride=(2, 1)), _Residual(channels)]
            width = channels
        self.features = nn.Sequential(*layers)
        rows = CROP_PX // 16
        characters = nn.Conv2d(width, len(ALPHABET) + 1, 1)
        with torch.no_grad():
            characters.weight *= 0.1
            assert characters.bias is not None
            characters.bias[0] = BLANK_PRIOR
        self.columns = nn.Sequential(
            _conv(width, width, (rows, 1), padding=(0, 0)),
            _conv(width, width, (1, 3), padding=(0, 1)),
            nn.Dropout(DROPPED),
            characters,
        )
        self.kinds = nn.Sequential(
            nn.AvgPool2d((1, STEPS // KIND_COLUMNS)),
            _conv(width, options.kinds, (1, 1), padding=(0, 0)),
            nn.Flatten(),
            nn.Dropout(DROPPED),
            nn.Linear(options.kinds * rows * KIND_COLUMNS, len(KINDS)),
        )
        # For training only: told where each character is in the text, but not where in the
        # crop, features learn to tell characters apart long before CTC has found them.
        self.spelling = nn.Sequential(
            nn.AvgPool2d((1, STEPS // KIND_COLUMNS)),
            nn.Flatten(),
            nn.Linear(width * rows * KIND_COLUMNS, SPELLED * (len(ALPHABET) + 1)),
        )

    def forward(self, crops: Tensor) -> Readings:
        """Read crops."""
        return self._heads(self._features(crops))

    def lesson(self, crops: Tensor) -> Lesson:
        """Read crops, and spell them besides."""
        x = self._features(crops)
        return Lesson(self._heads(x), self.spelling(x).view(len(crops), SPELLED, -1))

    def _heads(self, x: Tensor) -> Readings:
        return Readings(self.columns(x).squeeze(2).transpose(1, 2), self.kinds(x))

    def _features(self, crops: Tensor) -> Tensor:
        mean = crops.mean(dim=(1, 2, 3), keepdim=True)
        spread = (crops - mean).square().mean(dim=(1, 2, 3), keepdim=True)
        # A thousandth: noise of dark and even crops is not to be blown up to a label.
        return self.features((crops - mean) * torch.rsqrt(spread + 1e-3))
