"""``fronto export``: a trained network to the file that fronto runs."""

from __future__ import annotations

from pathlib import Path

import click

from fronto.cli.shared import FILE, require, say
from fronto.cli.train import TRAIN_MODULES

__all__ = ["command"]


@click.command(name="export", short_help="Write a trained network as an ONNX file.")
@click.argument("run", type=FILE, metavar="RUN|CHECKPOINT")
@click.option("-o", "--output", required=True, type=FILE, metavar="DIR", help="Where it goes.")
@click.option("--name", default="fronto-seg", show_default=True, help="How its name begins.")
@click.option("--version", default="1", show_default=True, help="Of the weights.")
@click.option("--license", "license_", metavar="TEXT", help="Under which they may be used.")
@click.option("--data", metavar="TEXT", help="What they were trained on, and its licences.")
def command(
    run: Path, output: Path, name: str, version: str, license_: str | None, data: str | None
) -> None:
    """Write the network of a RUN, or of one of its checkpoints, as ONNX.

    The file's name ends in the first eight digits of its SHA-256. To use it:
    `fronto segment --weights FILE`.
    """
    require(TRAIN_MODULES, "train", "fronto export")
    from fronto.train.export import export_onnx
    from fronto.train.fit import load_checkpoint

    if not name or Path(name).name != name:
        raise click.UsageError(f"--name: expected a file's name without a folder, got {name!r}")
    network = load_checkpoint(run / "last.pt" if run.is_dir() else run)
    stated = {"version": version, "license": license_, "training_data": data}
    metadata = {key: value for key, value in stated.items() if value}
    path = export_onnx(network, output, name, metadata)
    say(f"{run}: {path.stat().st_size / 1e6:.1f} MB -> {path}")
