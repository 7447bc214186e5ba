"""The context head: a small transformer over the buttons and plates of a panel.

As the relation head does with what is found (`fronto.train.relations`), it lets labels attend to
each other by how they lie, and corrects what the panel's order makes of the readings.
"""

from __future__ import annotations

from dataclasses import dataclass

import torch
from torch import Tensor, nn

from fronto.errors import InputError
from fronto.labels.context import BESIDES, GEOMETRY, PAIR
from fronto.train.attention import AttentionLayer, unseen

__all__ = ["ContextNetwork", "ContextOptions"]

#: Added to probabilities before their logarithm is taken.
LEAST = 1e-4
#: Channels of the small network that tells of pairs.
PAIR_WIDTH = 48


@dataclass(frozen=True)
class ContextOptions:
    """How large the head is.

    Parameters
    ----------
    width, layers, heads
        Of the transformer.
    dropout
        Share of what goes in, and of activations, that is left out in training.

    Raises
    ------
    InputError
        Naming the field that is out of range.
    """

    width: int = 96
    layers: int = 3
    heads: int = 4
    dropout: float = 0.2

    def __post_init__(self) -> None:
        for name in ("width", "layers", "heads"):
            if getattr(self, name) < 1:
                raise InputError(name, f"expected 1 or more, got {getattr(self, name)}")
        if self.width % self.heads:
            raise InputError("width", f"expected a multiple of {self.heads}, got {self.width}")
        if not 0 <= self.dropout < 1:
            raise InputError("dropout", f"expected 0 or more and below 1, got {self.dropout:g}")


def _logarithm(probabilities: Tensor) -> Tensor:
    return torch.log(probabilities + LEAST)


class ContextNetwork(nn.Module):
    """The context head.

    Parameters
    ----------
    labels
        Those that it knows.
    options
        How large it is.
    """

    def __init__(self, labels: tuple[str, ...], options: ContextOptions | None = None) -> None:
        super().__init__()
        self.labels, self.options = labels, options or ContextOptions()
        count, width = len(labels) + BESIDES, self.options.width
        self.count = count
        self.said = nn.Linear(5 * count, width)
        self.place = nn.Linear(GEOMETRY, width)
        self.both = nn.Sequential(nn.LayerNorm(width), nn.GELU(), nn.Linear(width, width))
        self.pair = nn.Sequential(
            nn.Linear(PAIR, PAIR_WIDTH),
            nn.ReLU(),
            nn.Linear(PAIR_WIDTH, self.options.heads * self.options.layers),
        )
        self.layers = nn.ModuleList(
            AttentionLayer(width, self.options.heads, self.options.dropout)
            for _ in range(self.options.layers)
        )
        self.dropout = nn.Dropout(self.options.dropout)
        # Untrained, it says what the order says: the last layer tells what is to be added to
        # that, and how far that is to be trusted.
        last = nn.Linear(width, count + 1)
        nn.init.zeros_(last.weight)
        nn.init.zeros_(last.bias)
        self.last = nn.Sequential(nn.LayerNorm(width), last)

    def forward(
        self,
        own: Tensor,
        seen: Tensor,
        ordered: Tensor,
        geometry: Tensor,
        pairs: Tensor,
        there: Tensor,
    ) -> Tensor:
        """Weigh the things of panels.

        Parameters
        ----------
        own, seen, ordered
            (B, N, labels + 2), as `fronto.labels.context.Context`.
        geometry
            (B, N, 31).
        pairs
            (B, N, N, 19).
        there
            (B, N), bool: which things there are; the others fill up.

        Returns
        -------
        (B, N, labels + 2): logits.
        """
        b, n = there.shape
        # Logarithms from 0 (as good as impossible) to 1.
        logs = [_logarithm(part) / 9.21 + 1 for part in (own, seen, ordered)]
        x = self.said(self.dropout(torch.cat([own, seen, *logs], dim=-1)))
        x = x + self.place(geometry)
        x = x + self.both(x)
        bias = self.pair(pairs).view(b, n, n, len(self.layers), -1).permute(3, 0, 4, 1, 2)
        bias = bias + unseen(there)
        for layer, its in zip(self.layers, bias, strict=True):
            x = layer(x, its)
        more, trust = self.last(x).split([self.count, 1], dim=-1)
        told: Tensor = more + trust.exp() * _logarithm(ordered)
        return told
