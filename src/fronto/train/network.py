"""DeepLabV3+ on MobileNetV2, with centres and sides that keep neighbouring buttons apart.

Backbone: Sandler et al., "MobileNetV2" (CVPR 2018), output stride 16. Encoder and decoder:
Chen et al., "Encoder-Decoder with Atrous Separable Convolution" (ECCV 2018), the network of
the paper's Section III.A. Beside the classes the decoder tells, as Panoptic-DeepLab does
(Cheng et al., CVPR 2020), where the centre of each button is, and for every pixel how far the
four sides of its button are (as FCOS, Tian et al., ICCV 2019): buttons that touch come out as
separate instances.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor, nn

from fronto.categories import CATEGORIES

__all__ = ["BN_EPS", "STRIDE", "Backbone", "Maps", "Network", "NetworkOptions"]

#: Pixels of the input per cell of the heads' maps.
STRIDE = 4
#: MobileNetV2's inverted residuals: expansion, channels, repeats, stride.
BLOCKS = (
    (1, 16, 1, 1),
    (6, 24, 2, 2),
    (6, 32, 3, 2),
    (6, 64, 4, 2),
    (6, 96, 3, 1),
    (6, 160, 3, 2),
    (6, 320, 1, 1),
)
#: Probability of a centre that an untrained network gives (Lin et al., focal loss, Section 4.1).
CENTER_PRIOR = 0.01
#: As the starting weights were trained with.
BN_EPS = 1e-3


@dataclass(frozen=True)
class NetworkOptions:
    """How wide and how coarse the network is.

    Parameters
    ----------
    channels
        Channels of the atrous pyramid.
    decoder
        Channels of the decoder.
    output_stride
        Pixels per cell of the encoder's output, 16 or 8.
    separable
        Whether the pyramid's and the decoder's 3x3 convolutions are depthwise separable.
    rates
        Dilation of the pyramid's three atrous convolutions, at output stride 16.
    blocks
        MobileNetV2's inverted residuals that are used, 14 to 17.
    details
        Channels of the branch at stride 2 that sharpens the buttons' masks; 0: none.
    """

    channels: int = 128
    decoder: int = 96
    output_stride: int = 16
    separable: bool = True
    rates: tuple[int, int, int] = (6, 12, 18)
    blocks: int = 16
    details: int = 8


class Maps(NamedTuple):
    """What the network tells about a batch of N pictures of H x W pixels.

    h, w = H / 4, W / 4; the centre of cell (i, j) lies at pixel (4 j + 1.5, 4 i + 1.5).

    Parameters
    ----------
    masks
        (N, 2, H, W): logits of "button" and of "plate".
    classes
        (N, 11, h, w): logits of `fronto.categories.CATEGORIES`.
    centers
        (N, 2, h, w): logits of "here is the centre of a button", "of a plate".
    sides
        (N, 4, h, w): distance from the cell's centre to the left, top, right and bottom
        of the button's box, pixels; above 0.
    features
        (N, decoder's channels, h, w): what the decoder tells all these from; None where only
        the others matter.
    """

    masks: Tensor
    classes: Tensor
    centers: Tensor
    sides: Tensor
    features: Tensor | None = None


def _conv(
    inputs: int,
    outputs: int,
    kernel: int = 3,
    stride: int = 1,
    dilation: int = 1,
    groups: int = 1,
    *,
    relu: bool = True,
) -> nn.Sequential:
    layers: list[nn.Module] = [
        nn.Conv2d(
            inputs,
            outputs,
            kernel,
            stride,
            dilation * (kernel // 2),
            dilation,
            groups,
            bias=False,
        ),
        nn.BatchNorm2d(outputs, eps=BN_EPS),
    ]
    if relu:
        layers.append(nn.ReLU6(inplace=True))
    return nn.Sequential(*layers)


def _conv3(inputs: int, outputs: int, dilation: int = 1, *, separable: bool) -> nn.Sequential:
    if not separable:
        return _conv(inputs, outputs, dilation=dilation)
    # Nothing between the two: half the memory traffic, which is what a CPU waits for.
    depthwise = nn.Conv2d(inputs, inputs, 3, 1, dilation, dilation, inputs, bias=False)
    return nn.Sequential(depthwise, *_conv(inputs, outputs, 1))


class _InvertedResidual(nn.Module):
    """Expand, filter each channel, project; with a shortcut where the shape stays."""

    def __init__(
        self, inputs: int, outputs: int, expansion: int, stride: int, dilation: int
    ) -> None:
        super().__init__()
        inner = inputs * expansion
        self.shortcut = stride == 1 and inputs == outputs
        self.expand = _conv(inputs, inner, 1) if expansion > 1 else nn.Identity()
        self.depthwise = _conv(inner, inner, 3, stride, dilation, groups=inner)
        self.project = _conv(inner, outputs, 1, relu=False)

    def forward(self, x: Tensor) -> Tensor:
        y: Tensor = self.project(self.depthwise(self.expand(x)))
        return x + y if self.shortcut else y


class Backbone(nn.Module):
    """MobileNetV2 without its classifier; its features at strides 2, 4, 8 and at the end."""

    def __init__(self, output_stride: int, count: int) -> None:
        super().__init__()
        self.stem = _conv(3, 32, stride=2)
        blocks: list[nn.Module] = []
        inputs, stride, dilation = 32, 2, 1
        self.taps: dict[int, int] = {}
        for expansion, outputs, repeats, step in BLOCKS:
            if stride * step > output_stride:
                # Atrous instead of strided: the same field of view on a finer grid.
                next_dilation, step = dilation * step, 1
            else:
                stride, next_dilation = stride * step, dilation
            for k in range(min(repeats, count - len(blocks))):
                blocks.append(
                    _InvertedResidual(
                        inputs,
                        outputs,
                        expansion,
                        step if k == 0 else 1,
                        dilation if k == 0 else next_dilation,
                    )
                )
                inputs = outputs
            dilation = next_dilation
            self.taps[outputs] = len(blocks) - 1
        self.blocks = nn.ModuleList(blocks)
        self.channels = inputs

    def forward(self, x: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Compute the features of (N, 3, H, W) pictures."""
        x = self.stem(x)
        fine, low, middle = x, x, x
        for k, block in enumerate(self.blocks):
            x = block(x)
            if k == self.taps[16]:
                fine = x
            elif k == self.taps[24]:
                low = x
            elif k == self.taps[32]:
                middle = x
        return fine, low, middle, x


class _AtrousPyramid(nn.Module):
    """Atrous spatial pyramid pooling: several fields of view and the picture's mean."""

    def __init__(self, inputs: int, options: NetworkOptions) -> None:
        super().__init__()
        width = options.channels
        factor = 16 // options.output_stride
        self.branches = nn.ModuleList(
            [_conv(inputs, width, 1)]
            + [
                _conv3(inputs, width, rate * factor, separable=options.separable)
                for rate in options.rates
            ]
        )
        # Without normalisation: statistics over one value per picture are none.
        self.pooled = nn.Sequential(
            nn.Conv2d(inputs, width, 1),
            nn.ReLU6(inplace=True),
            nn.Conv2d(width, options.decoder, 1),
        )
        outputs = options.decoder
        self.project = nn.Conv2d(width * len(self.branches), outputs, 1, bias=False)
        self.normalize = nn.Sequential(nn.BatchNorm2d(outputs, eps=BN_EPS), nn.ReLU6(inplace=True))

    def forward(self, x: Tensor) -> Tensor:
        y = self.project(torch.cat([branch(x) for branch in self.branches], dim=1))
        # The same as to append the mean to every cell and to project that.
        mean = self.pooled(x.mean(dim=(2, 3), keepdim=True))
        normalized: Tensor = self.normalize(y + mean)
        return normalized


def _resize(x: Tensor, size: torch.Size | tuple[int, int]) -> Tensor:
    return F.interpolate(x, size=tuple(size), mode="bilinear", align_corners=False)


class _Details(nn.Module):
    """What the masks of buttons lack at stride 4: their edges and corners, from stride 2.

    Gives (N, 1, H, W) logits to be added; nothing as long as it is untrained.
    """

    def __init__(self, inputs: int, fine: int, width: int) -> None:
        super().__init__()
        self.coarse = _conv(inputs, width, 1)
        self.fine = _conv(fine, width, 1)
        self.both = _conv3(2 * width, 2 * width, separable=True)
        self.last = nn.Conv2d(2 * width, 4, 1)
        nn.init.zeros_(self.last.weight)
        assert self.last.bias is not None
        nn.init.zeros_(self.last.bias)

    def forward(self, y: Tensor, fine: Tensor) -> Tensor:
        coarse = _resize(self.coarse(y), fine.shape[2:])
        x = self.last(self.both(torch.cat([coarse, self.fine(fine)], dim=1)))
        return F.pixel_shuffle(x, 2)


class Network(nn.Module):
    """The segmentation network.

    Takes (N, 3, H, W) float32, RGB in 0 to 1, H and W multiples of 16; gives `Maps`.
    """

    def __init__(self, options: NetworkOptions | None = None) -> None:
        super().__init__()
        self.options = options = options or NetworkOptions()
        width = options.decoder
        self.backbone = Backbone(options.output_stride, options.blocks)
        self.pyramid = _AtrousPyramid(self.backbone.channels, options)
        self.low = _conv(24, 24, 1)
        self.middle = _conv(32, 24, 1)
        self.decoder = nn.Sequential(
            _conv3(width + 48, width, separable=options.separable),
            _conv3(width, width, separable=options.separable),
        )
        self.classes = nn.Conv2d(width, len(CATEGORIES), 1)
        self.details = _Details(width, 16, options.details) if options.details else None
        self.instances = nn.Sequential(
            _conv3(width, width // 2, separable=options.separable), nn.Conv2d(width // 2, 6, 1)
        )
        last = self.instances[-1]
        assert isinstance(last, nn.Conv2d)
        assert last.bias is not None
        nn.init.constant_(last.bias[:2], float(torch.logit(torch.tensor(CENTER_PRIOR))))
        nn.init.constant_(last.bias[2:], 2.3)

    def forward(self, image: Tensor) -> Maps:
        """Compute the maps of (N, 3, H, W) pictures."""
        fine, low, middle, deep = self.backbone(image)
        size = low.shape[2:]
        y = torch.cat(
            [_resize(self.pyramid(deep), size), self.low(low), _resize(self.middle(middle), size)],
            dim=1,
        )
        y = self.decoder(y)
        classes = self.classes(y)
        instances = self.instances(y)
        masks = _resize(mask_logits(classes), image.shape[2:])
        if self.details is not None:
            masks = torch.cat([masks[:, :1] + self.details(y, fine), masks[:, 1:]], dim=1)
        return Maps(
            masks=masks,
            classes=classes,
            centers=instances[:, :2],
            sides=instances[:, 2:].clamp(max=7.0).exp(),
            features=y,
        )


def mask_logits(classes: Tensor) -> Tensor:
    """Logits of "some button" and of "plate" against all else, from those of the classes."""
    nothing, buttons, plate = classes[:, :1], classes[:, 1:-1], classes[:, -1:]
    button = torch.logsumexp(buttons, dim=1, keepdim=True)
    return torch.cat(
        [button - torch.logaddexp(nothing, plate), plate - torch.logaddexp(nothing, button)], dim=1
    )
