"""``fronto segment``: photos to masks of their buttons."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import click

from fronto.cli.formats import FORMATS, Format, check_new_folder, write_dataset
from fronto.cli.shared import (
    check_outputs,
    counted,
    each_photo,
    leave,
    segment_photo,
    segmentation_options,
)

if TYPE_CHECKING:
    from fronto.segments import Segments
    from fronto.segmentsfile import SegmentFiles

__all__ = ["command"]


@click.command(name="segment", short_help="Find the buttons in photos of panels.")
@segmentation_options
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
    from fronto.segmentsfile import labeled_image, segment_names, write_segments

    check_outputs(photos, output, segment_names, [*photos, *([weights] if weights else [])])
    for kind in formats:
        check_new_folder(output / kind)
    engine = Engine(weights, threads=threads)
    labeled = []

    def work(photo: Path) -> tuple[bool, str]:
        image, found = segment_photo(photo, engine, min_confidence, fast=fast)
        name = click.format_filename(photo.name)
        files = write_segments(
            found, image, output, photo.stem, name=name, weights=engine.path.name
        )
        if formats:
            labeled.append(labeled_image(found, photo))
        return bool(found.buttons), _verdict(name, found, files)

    counts = each_photo(photos, work, quiet=quiet)
    if labeled:
        for kind in formats:
            write_dataset(labeled, output / kind, kind)
    leave(ctx, counts, strict=strict)


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
