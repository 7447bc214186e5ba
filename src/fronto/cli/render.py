"""``fronto render``: drawn panels with exact labels, as a data set."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import click

from fronto.cli.formats import FORMATS, Format, check_new_folder, write_dataset
from fronto.cli.shared import FILE, counted, say

if TYPE_CHECKING:
    from fronto.datasets.records import LabeledImage

__all__ = ["command"]


def _size(ctx: click.Context, param: click.Parameter, value: str) -> tuple[int, int]:
    found = re.fullmatch(r"(\d{1,5})[x×](\d{1,5})", value)
    if found is None:
        raise click.BadParameter(f"expected a size as 640x480, got {value}.", ctx, param)
    return int(found[1]), int(found[2])


@click.command(name="render", short_help="Draw panels with exact labels as a data set.")
@click.option(
    "-n", "--number", required=True, type=click.IntRange(min=1), metavar="N", help="Of photos."
)
@click.option("-o", "--output", required=True, type=FILE, metavar="DIR", help="A new folder.")
@click.option("--seed", type=click.IntRange(min=0), default=0, show_default=True)
@click.option("--size", callback=_size, default="640x480", show_default=True, metavar="WxH")
@click.option("--format", "kind", type=click.Choice(FORMATS), default="coco", show_default=True)
@click.option("-q", "--quiet", is_flag=True, help="Print errors only.")
def command(
    number: int, output: Path, seed: int, size: tuple[int, int], kind: Format, quiet: bool
) -> None:
    """Draw N photos of elevator panels with the exact outlines of all buttons and plates.

    The k-th photo of a seed is the same whatever N is.
    """
    from tempfile import TemporaryDirectory

    check_new_folder(output)
    counts = [0, 0]
    with TemporaryDirectory() as folder:
        write_dataset(_rendered(Path(folder), number, seed, size, counts), output, kind)
    if not quiet:
        objects = f"{counted(counts[0], 'button')} and {counted(counts[1], 'plate')}"
        say(f"{counted(number, 'photo')} with {objects} -> {output}")


def _rendered(
    folder: Path, number: int, seed: int, size: tuple[int, int], counts: list[int]
) -> Iterator[LabeledImage]:
    """One photo at a time: each file is removed once it has been copied."""
    import numpy as np

    from fronto.categories import PLATE
    from fronto.datasets.renders import labeled_render
    from fronto.imageio import write_png
    from fronto.synth.photo import render_photo

    for k in range(number):
        photo = render_photo(np.random.default_rng([seed, k]), *size)
        path = folder / f"render-{seed}-{k:0{len(str(number - 1))}d}.png"
        write_png(path, photo.image)
        plates = sum(o.category == PLATE for o in photo.objects)
        counts[0] += len(photo.objects) - plates
        counts[1] += plates
        yield labeled_render(photo, path)
        path.unlink()
