"""``fronto relations``: the relation head of a network of one's own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from fronto.cli.data import labeled_images
from fronto.cli.heads import head_options, head_photos, network_of, publish
from fronto.cli.shared import FILE, counted, say

if TYPE_CHECKING:
    from fronto.train.relations.run import RelationTrainOptions

__all__ = ["command"]


@click.command(name="relations", short_help="Train what judges a network's finds together.")
@head_options(pictures=16_000, renders="0.25", steps=9000, batch=16, things="Pictures", rate=0.002)
@click.option("--val", type=FILE, metavar="DATA", help="Photos to evaluate on at checkpoints.")
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
    engine = network_of("fronto relations", weights, folder)
    from fronto.train.relations.run import publish_relations, train_relations

    options = _options(engine.channels, pictures, renders, fit_flags, only_renders=not data)
    photos = head_photos(data, split)
    held_out = [] if val is None else labeled_images(val, None, "val")
    if not quiet:
        say(f"{run}: training on {counted(len(photos), 'photo')}")
    train_relations(photos, engine, run, options, held_out=held_out, progress=not quiet)
    publish(publish_relations, run, engine, folder, license_=license_, stated=stated, quiet=quiet)


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
