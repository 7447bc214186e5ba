"""``fronto outline``: photos to corners and ellipses of their buttons."""

from __future__ import annotations

import contextlib
from collections.abc import Sequence
from pathlib import Path
from statistics import median
from typing import TYPE_CHECKING, Literal

import click

from fronto.cli.shared import (
    about_photo,
    check_outputs,
    counted,
    each_photo,
    leave,
    segment_photo,
    segmentation_options,
)
from fronto.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from fronto.outlines import Outlines

__all__ = ["command"]


@click.command(name="outline", short_help="Find the buttons' corners and ellipses in photos.")
@segmentation_options
@click.option(
    "--corners",
    type=click.Choice(["subpixel", "hough"]),
    default="subpixel",
    show_default=True,
    help="Fits refined on the photo's edges; or the paper's way, on masks alone.",
)
@click.option("--no-lines", is_flag=True, help="Do not look for long lines of the panel.")
@click.option(
    "--strict", is_flag=True, help="Exit with 3 when no button is outlined in some photo."
)
@click.option("-q", "--quiet", is_flag=True, help="Print errors only.")
@click.pass_context
def command(
    ctx: click.Context,
    /,
    photos: Sequence[Path],
    output: Path,
    weights: Path | None,
    threads: int | None,
    min_confidence: float,
    fast: bool,
    corners: Literal["subpixel", "hough"],
    no_lines: bool,
    strict: bool,
    quiet: bool,
) -> None:
    """Find the corners and ellipses of the buttons in photos of elevator panels.

    For each PHOTO writes DIR/<stem>.outlines.json (what `fronto rectify --outlines` reads)
    and DIR/<stem>.outlines.png to look at; prints one line with what was found.

    Exit codes: 0 done; 1 some photos could not be used, others could; 2 wrong input, or no
    photo could be used; 3 with --strict: a photo without a button.
    """
    from fronto.engine import Engine

    check_outputs(photos, output, _names, [*photos, *([weights] if weights else [])])
    engine = Engine(weights, threads=threads)

    def work(photo: Path) -> tuple[bool, str]:
        from fronto.outlines import outline

        image, segments = segment_photo(photo, engine, min_confidence, fast=fast)
        with about_photo(photo):
            found = outline(
                segments, image, corners=corners, lines=not no_lines, edges=engine.edges or False
            )
        drawing = _write(found, image, output, photo)
        ms = sum(timing.get("total", 0.0) for timing in (segments.timing_ms, found.timing_ms))
        name, shown = click.format_filename(photo.name), click.format_filename(drawing)
        return bool(found.buttons), f"{name}: {_summary(found)}, {ms:.0f} ms -> {shown}"

    leave(ctx, each_photo(photos, work, quiet=quiet), strict=strict)


def _names(stem: str) -> tuple[str, str]:
    """Name the files of one photo: the JSON, the drawing."""
    return f"{stem}.outlines.json", f"{stem}.outlines.png"


def _write(found: Outlines, image: npt.NDArray[np.uint8], output: Path, photo: Path) -> Path:
    """Write a photo's files, each in one piece, the JSON last; give the drawing's."""
    from fronto.draw_outlines import draw_outlines
    from fronto.files import make_folder
    from fronto.imageio import write_png
    from fronto.outlinefile import write_outlines

    json_file, drawing = (output / name for name in _names(photo.stem))
    picture = draw_outlines(image, found)
    make_folder(output)
    try:
        write_png(drawing, picture)
        write_outlines(
            json_file,
            found.buttons,
            plates=found.plates,
            lines=found.lines,
            image=click.format_filename(photo.name),
            width_px=found.width_px,
            height_px=found.height_px,
        )
    except InputError:
        # An older JSON must not describe the newer picture.
        with contextlib.suppress(OSError):
            json_file.unlink(missing_ok=True)
        raise
    return drawing


def _summary(found: Outlines) -> str:
    """What was found, in a line; an odd one is none of the quads."""
    buttons = found.buttons
    odd = sum(b.odd for b in buttons)
    ellipses = sum(b.shape == "ellipse" for b in buttons)
    parts = [counted(len(buttons) - ellipses - odd, "quad"), counted(ellipses, "ellipse")]
    for number, what in ((odd, "odd"), (sum(b.truncated for b in buttons), "truncated")):
        if number:
            parts.append(f"{number} {what}")
    if buttons:
        parts.append(f"median std {median(b.std_px for b in buttons):.2f} px")
    if found.plates:
        parts.append(counted(len(found.plates), "plate"))
    parts.append(counted(len(found.lines), "line"))
    if found.left_out:
        parts.append(f"{len(found.left_out)} left out")
    return ", ".join(parts)
