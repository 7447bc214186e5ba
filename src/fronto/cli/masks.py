"""``fronto masks``: the mask head of a network of one's own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from fronto.cli.data import labeled_images
from fronto.cli.shared import FILE, POSITIVE, FiniteRange, counted, require, say
from fronto.cli.train import TRAIN_MODULES

if TYPE_CHECKING:
    from fronto.train.masks.run import MaskTrainOptions

__all__ = ["command"]

#: Share of the pictures that are renders, where there are photos with outlines.
WITH_PHOTOS = 0.7


@click.command(name="masks", short_help="Train what draws the exact masks of a network's finds.")
@click.argument("data", nargs=-1, type=FILE, metavar="[DATA]...")
@click.option(
    "--weights",
    type=FILE,
    metavar="FILE.onnx",
    help="The network.  [default: the packaged one; give -d then]",
)
@click.option(
    "-o", "--output", "run", required=True, type=FILE, metavar="RUN", help="Folder of the run."
)
@click.option(
    "-d", "--dir", "folder", type=FILE, metavar="DIR", help="Where it goes.  [beside the network]"
)
@click.option(
    "--split", metavar="NAME", help="Of DATA.  [default: train where there is one, else all]"
)
@click.option("--pictures", type=click.IntRange(min=1), metavar="N", help="To look at.  [9000]")
@click.option(
    "--renders",
    type=FiniteRange(0, 1),
    metavar="SHARE",
    help="Share of renders.  [0.7; 1 without DATA]",
)
@click.option("--steps", type=click.IntRange(min=1), metavar="N", help="Batches in all.  [12000]")
@click.option("--batch", type=click.IntRange(min=1), metavar="N", help="Finds in one.  [96]")
@click.option("--rate", type=POSITIVE, metavar="X", help="Highest learning rate.  [0.003]")
@click.option("--seed", type=click.IntRange(min=0), metavar="N", help="[0]")
@click.option("--license", "license_", metavar="TEXT", help="Under which it may be used.")
@click.option("--data", "stated", metavar="TEXT", help="What it was trained on, and its licences.")
@click.option("-q", "--quiet", is_flag=True, help="No progress bar; print errors only.")
def command(
    data: Sequence[Path],
    weights: Path | None,
    run: Path,
    folder: Path | None,
    split: str | None,
    pictures: int | None,
    renders: float | None,
    license_: str | None,
    stated: str | None,
    quiet: bool,
    **fit_flags: Any,
) -> None:
    """Train the mask head of a network: it draws the exact mask of each button that is found.

    It learns from rendered panels, whose outlines are exact; DATA adds photos with labelled
    outlines (photos with boxes only do not help). The network looks at pictures, which takes
    about half of the time; then the head is trained, and written beside the network's file,
    where it is found and used. Where RUN holds a run it goes on where that stopped.
    """
    require(TRAIN_MODULES, "train", "fronto masks")
    from fronto.engine import Engine
    from fronto.train.masks.run import publish_masks, train_masks

    if weights is None and folder is None:
        raise click.UsageError("give --weights, or -d for a head of the packaged network")
    if not data and renders is not None and renders < 1:
        raise click.UsageError("give DATA, or --renders 1 to train on renders only")
    engine = Engine(weights)
    photos = [image for path in data for image in labeled_images(path, split, "train")]
    share = renders if renders is not None else (WITH_PHOTOS if data else 1.0)
    options = _options(pictures, share, fit_flags)
    if not quiet:
        say(f"{run}: training on renders and {counted(len(photos), 'photo')}")
    train_masks(photos, engine, run, options, progress=not quiet)
    known = {"license": license_, "training_data": stated}
    metadata = {key: value for key, value in known.items() if value}
    path = publish_masks([run], engine, folder or engine.path.parent, metadata)
    if not quiet:
        say(f"{run}: {path.stat().st_size / 1e6:.1f} MB -> {path}")


def _options(pictures: int | None, renders: float, flags: dict[str, Any]) -> MaskTrainOptions:
    from fronto.train.masks.run import MaskTrainOptions

    options = MaskTrainOptions(renders=renders)
    given = {name: value for name, value in flags.items() if value is not None}
    options = replace(
        options, fit=replace(options.fit, **given), seed=given.get("seed", options.seed)
    )
    return options if pictures is None else replace(options, pictures=pictures)
