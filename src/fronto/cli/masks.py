"""``fronto masks``: the mask head of a network of one's own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from fronto.cli.heads import head_options, head_photos, network_of, publish
from fronto.cli.shared import counted, say

if TYPE_CHECKING:
    from fronto.train.masks.run import MaskTrainOptions

__all__ = ["command"]

#: Share of the pictures that are renders, where there are photos with outlines.
WITH_PHOTOS = 0.7


@click.command(name="masks", short_help="Train what draws the exact masks of a network's finds.")
@head_options(
    pictures=9000, renders="0.7; 1 without DATA", steps=12_000, batch=96, things="Finds", rate=0.003
)
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
    engine = network_of("fronto masks", weights, folder)
    from fronto.train.masks.run import publish_masks, train_masks

    if not data and renders is not None and renders < 1:
        raise click.UsageError("give DATA, or --renders 1 to train on renders only")
    photos = head_photos(data, split)
    share = renders if renders is not None else (WITH_PHOTOS if data else 1.0)
    options = _options(pictures, share, fit_flags)
    if not quiet:
        say(f"{run}: training on renders and {counted(len(photos), 'photo')}")
    train_masks(photos, engine, run, options, progress=not quiet)
    publish(publish_masks, run, engine, folder, license_=license_, stated=stated, quiet=quiet)


def _options(pictures: int | None, renders: float, flags: dict[str, Any]) -> MaskTrainOptions:
    from fronto.train.masks.run import MaskTrainOptions

    options = MaskTrainOptions(renders=renders)
    given = {name: value for name, value in flags.items() if value is not None}
    options = replace(
        options, fit=replace(options.fit, **given), seed=given.get("seed", options.seed)
    )
    return options if pictures is None else replace(options, pictures=pictures)
