"""``fronto verifier``: the second opinion on what a network of one's own finds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from fronto.cli.heads import head_options, head_photos, network_of, publish
from fronto.cli.shared import FILE, counted, say

if TYPE_CHECKING:
    from fronto.train.verifier.run import VerifierTrainOptions

__all__ = ["command"]


@click.command(name="verifier", short_help="Train a second opinion on a network's finds.")
@head_options(
    pictures=16_000,
    renders="0.2; 1 without DATA",
    steps=5000,
    batch=128,
    things="Finds",
    rate=0.002,
)
@click.option(
    "--start", type=FILE, metavar="FILE.npz", help="MobileNetV2 to start from.  [the network's]"
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
    start: Path | None,
    quiet: bool,
    **fit_flags: Any,
) -> None:
    """Train the verifier of a network: it looks at each find again, by itself and from nearby.

    DATA is what `fronto train` takes; none trains on renders only. The network looks at
    pictures of it, which takes about half of the time; then the verifier is trained, and written
    beside the network's file, where it is found and used. Where RUN holds a run it goes on where
    that stopped.
    """
    engine = network_of("fronto verifier", weights, folder)
    from fronto.train.verifier.run import publish_verifier, train_verifier

    if not data and renders is not None and renders < 1:
        raise click.UsageError("give DATA, or --renders 1 to train on renders only")
    options = _options(pictures, renders if data else 1.0, fit_flags)
    photos = head_photos(data, split)
    if not quiet:
        say(f"{run}: training on {counted(len(photos), 'photo')}")
    train_verifier(photos, engine, run, options, start=start, progress=not quiet)
    publish(publish_verifier, run, engine, folder, license_=license_, stated=stated, quiet=quiet)


def _options(
    pictures: int | None, renders: float | None, flags: dict[str, Any]
) -> VerifierTrainOptions:
    from fronto.train.verifier.run import VerifierTrainOptions

    options = VerifierTrainOptions()
    given = {name: value for name, value in flags.items() if value is not None}
    options = replace(
        options, fit=replace(options.fit, **given), seed=given.get("seed", options.seed)
    )
    if renders is not None:
        options = replace(options, renders=renders)
    return options if pictures is None else replace(options, pictures=pictures)
