"""From masks to ordered corners and ellipses."""

from fronto.outlines.finding import outline
from fronto.outlines.result import Outlines

__all__ = ["Outlines", "outline"]
