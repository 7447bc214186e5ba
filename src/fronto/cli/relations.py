"""``fronto relations``: the relation head of a network of one's own."""

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
    from fronto.train.relations.run import RelationTrainOptions

__all__ = ["command"]


@click.command(name="relations", short_help="Train what judges a network's finds together.")
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
@click.option("--val", type=FILE, metavar="DATA", help="Photos to evaluate on at checkpoints.")
@click.option("--pictures", type=click.IntRange(min=1), metavar="N", help="To look at.  [16000]")
@click.option("--renders", type=FiniteRange(0, 1), metavar="SHARE", help="Share of renders. [0.25]")
@click.option("--steps", type=click.IntRange(min=1), metavar="N", help="Batches in all.  [9000]")
@click.option("--batch", type=click.IntRange(min=1), metavar="N", help="Pictures in one.  [16]")
@click.option("--rate", type=POSITIVE, metavar="X", help="Highest learning rate.  [0.002]")
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
    val: Path | None,
    pictures: int | None,
    renders: float | None,
    license_: str | None,
    stated: str | None,
    quiet: bool,
    **fit_flags: Any,
) -> None:
    """Train the relation head of a network: it judges all that is found in a photo together.

    DATA is what `fronto train` takes; none trains on renders only. The network looks at
    pictures of it, which takes most of the time; then the head is trained, and written beside
    the network's file, where it is found and used. Where RUN holds a run it goes on where
    that stopped.
    """
    require(TRAIN_MODULES, "train", "fronto relations")
    from fronto.engine import Engine
    from fronto.train.relations.run import publish_relations, train_relations

    if weights is None and folder is None:
        raise click.UsageError("give --weights, or -d for a head of the packaged network")
    engine = Engine(weights)
    options = _options(engine.channels, pictures, renders, fit_flags, only_renders=not data)
    photos = [image for path in data for image in labeled_images(path, split, "train")]
    held_out = [] if val is None else labeled_images(val, None, "val")
    if not quiet:
        say(f"{run}: training on {counted(len(photos), 'photo')}")
    train_relations(photos, engine, run, options, held_out=held_out, progress=not quiet)
    known = {"license": license_, "training_data": stated}
    metadata = {key: value for key, value in known.items() if value}
    path = publish_relations([run], engine, folder or engine.path.parent, metadata)
    if not quiet:
        say(f"{run}: {path.stat().st_size / 1e6:.1f} MB -> {path}")


def _options(
    channels: int,
    pictures: int | None,
    renders: float | None,
    flags: dict[str, Any],
    *,
    only_renders: bool,
) -> RelationTrainOptions:
    from fronto.train.relations.run import RelationTrainOptions

    options = RelationTrainOptions()
    given = {name: value for name, value in flags.items() if value is not None}
    options = replace(
        options,
        fit=replace(options.fit, **given),
        seed=given.get("seed", options.seed),
        network=replace(options.network, features=channels),
    )
    if only_renders:
        if renders is not None and renders < 1:
            raise click.UsageError("give DATA, or --renders 1 to train on renders only")
        renders = 1.0
    if renders is not None:
        options = replace(options, renders=renders)
    return options if pictures is None else replace(options, pictures=pictures)
