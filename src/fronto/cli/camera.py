"""``fronto camera``: a camera file as fronto reads it."""

from __future__ import annotations

from pathlib import Path

import click

from fronto.cli.shared import FILE

__all__ = ["command"]


@click.command(name="camera", short_help="Print a camera file as fronto reads it.")
@click.argument("file", type=FILE)
@click.option("--width", type=click.IntRange(min=1), metavar="PX", help="The photo's width.")
@click.option("--height", type=click.IntRange(min=1), metavar="PX", help="The photo's height.")
def command(file: Path, width: int | None, height: int | None) -> None:
    """Print the camera in FILE as JSON, to check a calibration.

    With --width and --height: as scaled to photos of that size.
    """
    from fronto.camera import Camera
    from fronto.files import json_bytes

    camera = Camera.from_file(file, width, height)
    values = {**camera.to_dict(), "horizontal_fov_deg": camera.horizontal_fov_deg}
    click.echo(json_bytes(values).decode(), nl=False)
