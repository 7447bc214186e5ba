"""The relation head: a small transformer over the candidates of a picture.

Hu et al., "Relation Networks for Object Detection" (CVPR 2018) let detections attend to each
other by their looks and by how they lie; the layers here are those of Vaswani et al.,
"Attention Is All You Need" (NeurIPS 2017), normalised first, with the geometry of each pair
added to the attention's logits.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import torch.nn.functional as F
from torch import Tensor, nn

from fronto.categories import CATEGORIES
from fronto.errors import InputError
from fronto.relations import CELLS, GEOMETRY, PAIR
from fronto.train.attention import AttentionLayer, unseen

__all__ = ["Judgement", "RelationNetwork", "RelationOptions"]

#: Channels of the small network that tells of pairs.
PAIR_WIDTH = 32


@dataclass(frozen=True)
class RelationOptions:
    """How large the head is.

    Parameters
    ----------
    features
        Channels of the network's features.
    reduced
        Channels that they are brought down to at each of the 7 x 7 points.
    width, layers, heads
        Of the transformer.
    dropout
        Share of activations left out in training.

    Raises
    ------
    InputError
        Naming the field that is out of range.
    """

    features: int = 96
    reduced: int = 32
    width: int = 128
    layers: int = 3
    heads: int = 4
    dropout: float = 0.1

    def __post_init__(self) -> None:
        for name in ("features", "reduced", "width", "layers", "heads"):
            if getattr(self, name) < 1:
                raise InputError(name, f"expected 1 or more, got {getattr(self, name)}")
        if self.width % self.heads:
            raise InputError("width", f"expected a multiple of {self.heads}, got {self.width}")
        if not 0 <= self.dropout < 1:
            raise InputError("dropout", f"expected 0 or more and below 1, got {self.dropout:g}")


class Judgement(NamedTuple):
    """What the head tells of N candidates of each of B pictures.

    Parameters
    ----------
    kinds
        (B, N, 3): logits of nothing, a button, a plate.
    classes
        (B, N, 11): logits of `fronto.categories.CATEGORIES`.
    shifts
        (B, N, 4): of the box's edges, in its sides.
    """

    kinds: Tensor
    classes: Tensor
    shifts: Tensor


class RelationNetwork(nn.Module):
    """The relation head."""

    def __init__(self, options: RelationOptions | None = None) -> None:
        super().__init__()
        self.options = options = options or RelationOptions()
        width = options.width
        self.reduce = nn.Linear(options.features, options.reduced)
        self.dropout = nn.Dropout(options.dropout)
        self.look = nn.Linear(options.reduced * CELLS**2, width)
        self.place = nn.Linear(GEOMETRY, width)
        self.both = nn.Sequential(nn.LayerNorm(width), nn.GELU(), nn.Linear(width, width))
        self.pair = nn.Sequential(
            nn.Linear(PAIR, PAIR_WIDTH),
            nn.ReLU(),
            nn.Linear(PAIR_WIDTH, options.heads * options.layers),
        )
        self.layers = nn.ModuleList(
            AttentionLayer(width, options.heads, options.dropout) for _ in range(options.layers)
        )
        last = nn.Linear(width, 3 + len(CATEGORIES) + 4)
        # Untrained, it finds nothing likelier than anything else, and boxes as they are.
        nn.init.zeros_(last.weight)
        nn.init.zeros_(last.bias)
        self.last = nn.Sequential(nn.LayerNorm(width), last)

    def forward(self, looks: Tensor, geometry: Tensor, pairs: Tensor, there: Tensor) -> Judgement:
        """Judge candidates.

        Parameters
        ----------
        looks
            (B, N, 49, C); or (M, 49, C), only those that are there, one picture after another:
            to fill up a batch with nothing would cost most of the time.
        geometry
            (B, N, 24).
        pairs
            (B, N, N, 8).
        there
            (B, N), bool: which candidates there are; the others fill up.
        """
        b, n = there.shape
        x = self.look(self.dropout(F.relu(self.reduce(looks)).flatten(-2)))
        if x.ndim == 2:
            packed, x = x, x.new_zeros(b, n, x.shape[-1])
            x[there] = packed
        x = x + self.place(geometry)
        x = x + self.both(x)
        bias = self.pair(pairs).view(b, n, n, len(self.layers), -1).permute(3, 0, 4, 1, 2)
        bias = bias + unseen(there)
        for layer, its in zip(self.layers, bias, strict=True):
            x = layer(x, its)
        return Judgement(*self.last(x).split([3, len(CATEGORIES), 4], dim=-1))
