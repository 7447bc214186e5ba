"""``fronto segment``: photos to masks of their buttons."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from fronto.cli.formats import FORMATS, Format, check_new_folder, write_dataset
from fronto.cli.shared import (
    BAD_INPUT,
    FILE,
    NOT_OK,
    SOME_FAILED,
    FiniteRange,
    check_outputs,
    counted,
    say,
)
from fronto.errors import InputError

if TYPE_CHECKING:
    from fronto.engine import Engine
    from fronto.segments import Segments
    from fronto.segmentsfile import SegmentFiles

__all__ = ["command"]


@click.command(name="segment", short_help="Find the buttons in photos of panels.")
@click.argument("photos", nargs=-1, required=True, type=FILE, metavar="PHOTO...")
@click.option("-o", "--output", required=True, type=FILE, metavar="DIR", help="Where results go.")
@click.option(
    "--weights", type=FILE, metavar="FILE", help="Another network, as `fronto export` writes it."
)
@click.option(
    "--threads", type=click.IntRange(min=1), metavar="N", help="[default: all usable cores]"
)
@click.option(
    "--min-confidence",
    type=FiniteRange(0, 1),
    default=0.5,
    show_default=True,
    metavar="P",
    help="Leave out what is less sure.",
)
@click.option("--fast", is_flag=True, help="No second look at small buttons.")
@click.option(
    "--format",
    "formats",
    type=click.Choice(FORMATS),
    multiple=True,
    help="Also write a data set to DIR/FORMAT, to correct and to train on; can be repeated.",
)
@click.option("--strict", is_flag=True, help="Exit with 3 when no button is found in some photo.")
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
    formats: Sequence[Format],
    strict: bool,
    quiet: bool,
) -> None:
    """Find the buttons and plates in photos of elevator panels.

    For each PHOTO writes DIR/<stem>.segments.json (outlines, categories, confidences),
    DIR/<stem>.segments.png (16 bits: 0 none, k the segment with the id k) and
    DIR/<stem>.overlay.png to look at; prints one line with what was found.

    Exit codes: 0 done; 1 some photos could not be used, others could; 2 wrong input, or no
    photo could be used; 3 with --strict: a photo without a button.
    """
    from fronto.engine import Engine
    from fronto.segmentsfile import labeled_image, segment_names

    check_outputs(photos, output, segment_names, [*photos, *([weights] if weights else [])])
    for kind in formats:
        check_new_folder(output / kind)
    engine = Engine(weights, threads=threads)
    labeled, failed, empty = [], 0, 0
    for photo in photos:
        try:
            found, files = _segment(photo, output, engine, min_confidence, not fast)
        except InputError as error:
            say(f"Error: {error}", err=True)
            failed += 1
            continue
        empty += not found.buttons
        if formats:
            labeled.append(labeled_image(found, photo))
        if not quiet:
            say(_verdict(click.format_filename(photo.name), found, files))
    if labeled:
        for kind in formats:
            write_dataset(labeled, output / kind, kind)
    if failed:
        ctx.exit(SOME_FAILED if failed < len(photos) else BAD_INPUT)
    if strict and empty:
        ctx.exit(NOT_OK)


def _segment(
    photo: Path, output: Path, engine: Engine, min_confidence: float, second_look: bool
) -> tuple[Segments, SegmentFiles]:
    from fronto.images import as_rgb
    from fronto.segmentation import segment
    from fronto.segmentsfile import write_segments

    image = as_rgb(photo)
    try:
        found = segment(
            image, engine=engine, min_confidence=min_confidence, second_look=second_look
        )
    except InputError as error:
        raise InputError(f"photo {photo}, {error.thing}", error.expected, error.remedy) from None
    name = click.format_filename(photo.name)
    weights = engine.path.name
    return found, write_segments(found, image, output, photo.stem, name=name, weights=weights)


def _verdict(name: str, found: Segments, files: SegmentFiles) -> str:
    counts = Counter(segment.category for segment in found.buttons)
    kinds = ", ".join(f"{count} {kind}" for kind, count in counts.most_common())
    parts = [counted(len(found.buttons), "button") + (f" ({kinds})" if kinds else "")]
    if found.plates:
        parts.append(counted(len(found.plates), "plate"))
    total = found.timing_ms.get("total")
    if total is not None:
        parts.append(f"{total:.0f} ms")
    parts += found.notes
    return f"{name}: {', '.join(parts)} -> {click.format_filename(files.overlay)}"
