"""What the commands that train small networks beside the large one have in common."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import reduce
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from fronto.cli.data import labeled_images
from fronto.cli.shared import FILE, POSITIVE, FiniteRange, require, say
from fronto.cli.train import TRAIN_MODULES

if TYPE_CHECKING:
    from fronto.datasets.records import LabeledImage
    from fronto.engine import Engine

__all__ = ["head_options", "head_photos", "network_of", "publish"]

C = TypeVar("C", bound=Callable[..., Any])


def head_options(
    *,
    pictures: int,
    renders: str | None = None,
    steps: int,
    batch: int,
    things: str,
    rate: float,
) -> Callable[[C], C]:
    """Options of such a command, with these defaults in their help.

    Parameters
    ----------
    pictures
        To look at.
    renders
        Share of renders; None: the command takes no labelled photos, and no share of them.
    steps, batch, rate
        Of training; `things` are what a batch is of.
    """
    count = click.IntRange(min=1)
    options = [
        click.option(
            "--weights",
            type=FILE,
            metavar="FILE.onnx",
            help="The network.  [default: the packaged one; give -d then]",
        ),
        click.option(
            "-o",
            "--output",
            "run",
            required=True,
            type=FILE,
            metavar="RUN",
            help="Folder of the run.",
        ),
        click.option(
            "-d",
            "--dir",
            "folder",
            type=FILE,
            metavar="DIR",
            help="Where it goes.  [beside the network]",
        ),
        click.option("--pictures", type=count, metavar="N", help=f"To look at.  [{pictures}]"),
        click.option("--steps", type=count, metavar="N", help=f"Batches in all.  [{steps}]"),
        click.option("--batch", type=count, metavar="N", help=f"{things} in one.  [{batch}]"),
        click.option(
            "--rate", type=POSITIVE, metavar="X", help=f"Highest learning rate.  [{rate:g}]"
        ),
        click.option("--seed", type=click.IntRange(min=0), metavar="N", help="[0]"),
        click.option("--license", "license_", metavar="TEXT", help="Under which it may be used."),
        click.option(
            "--data", "stated", metavar="TEXT", help="What it was trained on, and its licences."
        ),
        click.option("-q", "--quiet", is_flag=True, help="No progress bar; print errors only."),
    ]

    if renders is not None:
        options[3:3] = [
            click.argument("data", nargs=-1, type=FILE, metavar="[DATA]..."),
            click.option(
                "--split",
                metavar="NAME",
                help="Of DATA.  [default: train where there is one, else all]",
            ),
            click.option(
                "--renders",
                type=FiniteRange(0, 1),
                metavar="SHARE",
                help=f"Share of renders.  [{renders}]",
            ),
        ]

    def with_options(function: C) -> C:
        return reduce(lambda wrapped, option: option(wrapped), reversed(options), function)

    return with_options


def network_of(command: str, weights: Path | None, folder: Path | None) -> Engine:
    """The network that a command is for, once what it needs is there."""
    require(TRAIN_MODULES, "train", command)
    if weights is None and folder is None:
        raise click.UsageError("give --weights, or -d for a head of the packaged network")
    from fronto.engine import Engine

    return Engine(weights)


def head_photos(data: Sequence[Path], split: str | None) -> list[LabeledImage]:
    """The labelled photos of all DATA."""
    return [image for path in data for image in labeled_images(path, split, "train")]


def publish(
    function: Callable[[Sequence[Path], Engine, Path, dict[str, str]], Path],
    run: Path,
    engine: Engine,
    folder: Path | None,
    *,
    license_: str | None,
    stated: str | None,
    quiet: bool,
) -> None:
    """Write what a run has trained beside its network, and say where."""
    known = {"license": license_, "training_data": stated}
    metadata = {key: value for key, value in known.items() if value}
    path = function([run], engine, folder or engine.path.parent, metadata)
    if not quiet:
        say(f"{run}: {path.stat().st_size / 1e6:.1f} MB -> {path}")
