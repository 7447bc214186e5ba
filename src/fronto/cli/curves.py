"""``fronto curves``: how training runs went, as a figure."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import click

from fronto.cli.shared import FILE, require, say

__all__ = ["command"]


@click.command(name="curves", short_help="Draw the learning curves of training runs.")
@click.argument("runs", nargs=-1, required=True, type=FILE, metavar="RUN...")
@click.option(
    "-o", "--output", required=True, type=FILE, metavar="FILE.png", help="The figure; or .svg."
)
def command(runs: Sequence[Path], output: Path) -> None:
    """Draw what is in the metrics.csv of each RUN over the steps, a panel for each figure."""
    require(["matplotlib"], "bench", "fronto curves")
    from fronto.train.curves import draw_curves

    draw_curves(runs, output)
    say(f"learning curves -> {output}")
