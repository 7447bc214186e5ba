"""``fronto quantize``: a network of one's own in 8 bits."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import click

from fronto.cli.inputs import expanded
from fronto.cli.shared import FILE, SOME_FAILED, counted, require, say
from fronto.errors import InputError

__all__ = ["command"]

#: What ONNX Runtime's tool needs.
MODULES = ("onnx", "sympy")


@click.command(name="quantize", short_help="Write a network in 8 bits: faster on processors.")
@click.argument("photos", nargs=-1, required=True, type=FILE, metavar="PHOTO...")
@click.option("--weights", required=True, type=FILE, metavar="FILE.onnx", help="The network.")
@click.option(
    "-d", "--dir", "folder", type=FILE, metavar="DIR", help="Where it goes.  [beside the network]"
)
@click.option(
    "-n",
    "--pictures",
    type=click.IntRange(min=1),
    default=60,
    show_default=True,
    metavar="N",
    help="Photos to measure ranges on.",
)
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True, metavar="N")
@click.pass_context
def command(
    ctx: click.Context,
    photos: Sequence[Path],
    weights: Path,
    folder: Path | None,
    pictures: int,
    seed: int,
) -> None:
    """Write a network with whole numbers of 8 bits beside its file, where it is found and used.

    PHOTOs (files, folders or patterns) like those that it will see tell which ranges its values
    have; some dozens are chosen of them. It takes about half of its time then. Train its
    heads afterwards: they read what it tells.
    """
    require(MODULES, "train", "fronto quantize")
    import numpy as np

    from fronto.images import as_rgb
    from fronto.scales import first_look
    from fronto.train.quantize import quantize_network

    files = expanded(photos)
    order = np.random.default_rng(seed).permutation(len(files))[:pictures]
    shown = []
    for k in sorted(order.tolist()):
        try:
            shown.append(first_look(as_rgb(files[k])).image)
        except InputError as error:  # the others will do
            say(f"Error: {error}", err=True)
    path = quantize_network(weights, shown, folder)
    measured = counted(len(shown), "photo")
    say(f"{weights}: measured on {measured}, {path.stat().st_size / 1e6:.1f} MB -> {path}")
    if len(shown) < len(order):
        ctx.exit(SOME_FAILED)
