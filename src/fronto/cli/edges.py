"""``fronto edges``: the edge head of a network of one's own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from fronto.cli.heads import head_options, network_of, publish
from fronto.cli.inputs import expanded
from fronto.cli.shared import FILE, counted, say
from fronto.errors import InputError

if TYPE_CHECKING:
    from fronto.train.edges.run import EdgeTrainOptions

__all__ = ["command"]


@click.command(name="edges", short_help="Train what tells which of a photo's edges is a button's.")
@head_options(pictures=10_000, steps=12_000, batch=256, things="Outlines", rate=0.004)
@click.argument("photos", nargs=-1, type=FILE, metavar="[PHOTO]...")
def command(
    photos: Sequence[Path],
    weights: Path | None,
    run: Path,
    folder: Path | None,
    pictures: int | None,
    license_: str | None,
    stated: str | None,
    quiet: bool,
    **fit_flags: Any,
) -> None:
    """Train the edge head of a network: it tells which of the photo's edges is a button's.

    It learns from rendered panels, whose outlines are exact, and from PHOTOs (files, folders or
    patterns; no labels) which edges the network means there. The network and its mask head
    look at them, which takes about a third of the time; then the edge head is trained, and
    written beside the network's file, where it is found and used. Where RUN holds a run it goes on
    where that stopped.
    """
    engine = network_of("fronto edges", weights, folder)
    from fronto.train.edges.run import publish_edges, train_edges

    options = _options(pictures, fit_flags)
    files = expanded(photos) if photos else []
    for file in files:
        if not file.is_file():
            raise InputError(f"photo {file}", "expected a file, there is none")
    if not quiet:
        say(f"{run}: training on renders and {counted(len(files), 'photo')}")
    train_edges(engine, run, options, photos=files, progress=not quiet)
    publish(publish_edges, run, engine, folder, license_=license_, stated=stated, quiet=quiet)


def _options(pictures: int | None, flags: dict[str, Any]) -> EdgeTrainOptions:
    from fronto.train.edges.run import EdgeTrainOptions

    options = EdgeTrainOptions()
    given = {name: value for name, value in flags.items() if value is not None}
    options = replace(
        options, fit=replace(options.fit, **given), seed=given.get("seed", options.seed)
    )
    return options if pictures is None else replace(options, pictures=pictures)
