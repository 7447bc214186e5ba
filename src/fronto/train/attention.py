"""Attention among the things of one picture, as the heads beside the networks use it.

The layers are those of Vaswani et al., "Attention Is All You Need" (NeurIPS 2017), normalised
first, with what is known of each pair of things added to the attention's logits.
"""

from __future__ import annotations

import math

import torch
from torch import Tensor, nn

__all__ = ["NOWHERE", "AttentionLayer", "unseen"]

#: Added to the attention paid to what is not there.
NOWHERE = -1e4


def unseen(there: Tensor) -> Tensor:
    """What is added to the logits, (B, 1, 1, N), for things (B, N) of which some are not there."""
    return torch.where(there, 0.0, NOWHERE)[:, None, None, :]


class AttentionLayer(nn.Module):
    """Attention to the other things, then a small network for each.

    Parameters
    ----------
    width, heads
        Channels of each thing, and how many parts of them attend by themselves.
    dropout
        Share of activations left out in training.
    """

    def __init__(self, width: int, heads: int, dropout: float) -> None:
        super().__init__()
        self.heads = heads
        self.normalize = nn.LayerNorm(width)
        self.attention = nn.Linear(width, 3 * width)
        self.joined = nn.Linear(width, width)
        self.each = nn.Sequential(
            nn.LayerNorm(width),
            nn.Linear(width, 2 * width),
            nn.GELU(),
            nn.Linear(2 * width, width),
        )
        self.dropout = nn.Dropout(dropout)

    def forward(self, x: Tensor, bias: Tensor) -> Tensor:
        """Takes and gives (B, N, width); the bias is (B, heads, N, N)."""
        b, n, width = x.shape
        parts = self.attention(self.normalize(x)).view(b, n, 3, self.heads, width // self.heads)
        query, key, value = parts.permute(2, 0, 3, 1, 4)
        logits = query @ key.transpose(-1, -2) / math.sqrt(width // self.heads) + bias
        y = (logits.softmax(-1) @ value).transpose(1, 2).reshape(b, n, width)
        x = x + self.dropout(self.joined(y))
        told: Tensor = x + self.dropout(self.each(x))
        return told
