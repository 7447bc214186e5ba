"""``fronto train``: a network for one's own panels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from fronto._version import __version__
from fronto.cli.data import labeled_images
from fronto.cli.shared import FILE, POSITIVE, FiniteRange, counted, require, say
from fronto.errors import InputError

if TYPE_CHECKING:
    from fronto.datasets.records import LabeledImage
    from fronto.train.data import Source
    from fronto.train.network import Network
    from fronto.train.options import TrainOptions

__all__ = ["TRAIN_MODULES", "command"]

#: What the extra "train" brings.
TRAIN_MODULES = ("torch", "onnx", "onnxscript", "kornia", "tqdm", "tensorboard")


@click.command(name="train", short_help="Train the network, on your own panels too.")
@click.argument("data", nargs=-1, type=FILE, metavar="[DATA]...")
@click.option(
    "-o",
    "--output",
    "run",
    required=True,
    type=FILE,
    metavar="RUN",
    help="Folder of the run: checkpoints, metrics.csv, TensorBoard's events.",
)
@click.option(
    "--split", metavar="NAME", help="Of DATA.  [default: train where there is one, else all]"
)
@click.option("--val", type=FILE, metavar="DATA", help="Photos to evaluate on at checkpoints.")
@click.option(
    "--options", "file", type=FILE, metavar="FILE.toml", help="All options; those here go before."
)
@click.option(
    "--start",
    metavar="FILE",
    help="Weights to go on from: .onnx, a checkpoint .pt, a MobileNetV2 .npz, or `none`.  "
    "[default: the packaged weights]",
)
@click.option("--renders", type=FiniteRange(0, 1), metavar="SHARE", help="Share of renders.  [0.4]")
@click.option("--steps", type=click.IntRange(min=1), metavar="N", help="Batches in all.  [20000]")
@click.option("--batch", type=click.IntRange(min=1), metavar="N", help="Pictures in one.  [8]")
@click.option("--size", type=click.IntRange(min=64), metavar="PX", help="Their side.  [288]")
@click.option("--rate", type=POSITIVE, metavar="X", help="Highest learning rate.  [0.0015]")
@click.option("--seed", type=click.IntRange(min=0), metavar="N", help="[0]")
@click.option("--workers", type=click.IntRange(min=0), metavar="N", help="Processes.  [1]")
@click.option("-q", "--quiet", is_flag=True, help="No progress bar; print errors only.")
def command(
    data: Sequence[Path],
    run: Path,
    split: str | None,
    val: Path | None,
    file: Path | None,
    start: str | None,
    renders: float | None,
    quiet: bool,
    **fit_flags: Any,
) -> None:
    """Train the segmentation network on photos and on renders.

    DATA is COCO, LabelMe, CVAT for images or YOLO (boxes or outlines), or the panels set;
    none trains on renders only. Starts from the packaged weights. Where RUN holds a run it
    goes on where that stopped.
    """
    require(TRAIN_MODULES, "train", "fronto train")
    from fronto.datasets.forms import with_forms
    from fronto.train.fit import fit
    from fronto.train.validate import validation

    options = _options(file, renders, fit_flags, only_renders=not data)
    photos = with_forms(image for path in data for image in labeled_images(path, split, "train"))
    held_out = [] if val is None else labeled_images(val, None, "val")
    network = _network(run, start, options)
    if not quiet:
        fewer = f" and {counted(len(held_out), 'photo')} to evaluate on" if held_out else ""
        say(f"{run}: training on {counted(len(photos), 'photo')}{fewer}")
    _note_run(run, data, start, options)
    fit(
        network,
        _sources(photos, options),
        run,
        options.fit,
        validate=validation(held_out) if held_out else None,
        progress=not quiet,
    )
    if not quiet:
        say(f"{run}: {options.fit.steps} steps done -> fronto export {run} -o DIR")


def _options(
    file: Path | None, renders: float | None, flags: Mapping[str, Any], *, only_renders: bool
) -> TrainOptions:
    """The file's options, with the command line's in their place."""
    from fronto.train.options import TrainOptions, read_options

    options = TrainOptions() if file is None else read_options(file)
    given = {name: value for name, value in flags.items() if value is not None}
    options = replace(options, fit=replace(options.fit, **given))
    if renders is not None:
        options = replace(options, renders=renders)
    if not only_renders:
        return options
    if renders is not None and renders < 1:
        raise click.UsageError("give DATA, or --renders 1 to train on renders only")
    return replace(options, renders=1.0)


def _sources(photos: Sequence[LabeledImage], options: TrainOptions) -> list[tuple[Source, float]]:
    from fronto.train.data import Photos, Renders

    sources: list[tuple[Source, float]] = []
    if options.renders > 0:
        sources.append((Renders(options.reuse), options.renders))
    if options.renders < 1:
        sources.append((Photos(photos, options.pixels, options.plates), 1 - options.renders))
    return sources


def _network(run: Path, start: str | None, options: TrainOptions) -> Network:
    """What to train: the run's own network where there is one."""
    from fronto.train.fit import load_checkpoint
    from fronto.train.network import Network
    from fronto.train.start import load_backbone

    if (run / "last.pt").exists():
        return Network(options.network or load_checkpoint(run / "last.pt").options)
    suffix = "" if start is None else Path(start).suffix.lower()
    if start == "none" or suffix == ".npz":
        network = Network(options.network)
        if suffix == ".npz":
            load_backbone(network, Path(str(start)))
        return network
    if suffix == ".pt":
        network = load_checkpoint(Path(str(start)))
    elif start is None or suffix == ".onnx":
        from fronto.engine import find_weights
        from fronto.train.export import load_onnx

        network = load_onnx(find_weights() if start is None else Path(start))
    else:
        raise click.UsageError(f"--start: expected .onnx, .pt, .npz or none, got {start}")
    if options.network not in (None, network.options):
        raise InputError(
            f"--start {start or '(packaged weights)'}",
            f"expected a network of the given options, got {network.options}",
            "leave out [network], or start from none or a .npz file",
        )
    return network


def _note_run(run: Path, data: Sequence[Path], start: str | None, options: TrainOptions) -> None:
    """Write down what the run was started with, for the day when somebody asks."""
    from dataclasses import asdict

    from fronto.files import json_bytes, write_bytes

    values = {
        "fronto": __version__,
        "data": [path.name for path in data],
        "start": start and Path(start).name,
        **asdict(options),
    }
    run.mkdir(parents=True, exist_ok=True)
    write_bytes(run / "options.json", json_bytes(values))
