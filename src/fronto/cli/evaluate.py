"""``fronto evaluate``: how well the buttons of labelled photos are found, and named."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Literal

import click

from fronto.cli.data import is_panels, labeled_images
from fronto.cli.shared import FILE, FiniteRange, network_options, say, say_block

if TYPE_CHECKING:
    from collections.abc import Callable

    from fronto.datasets.records import LabeledImage
    from fronto.engine import Engine
    from fronto.evaluate import Missing
    from fronto.segments import Segments

__all__ = ["command"]


class _Evaluate(click.Group):
    """``fronto evaluate DATA`` is ``fronto evaluate buttons DATA``."""

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        if args and args[0] not in (*self.commands, *ctx.help_option_names):
            args = ["buttons", *args]
        return super().parse_args(ctx, args)


@click.group(name="evaluate", cls=_Evaluate, short_help="Compare with labelled photos.")
def command() -> None:
    """Compare what is found in labelled photos with their labels; prints Markdown tables.

    DATA is COCO, LabelMe, CVAT for images or YOLO, this project's annotations, or the
    panels set. `fronto evaluate DATA` is `fronto evaluate buttons DATA`.
    """


@command.command(name="buttons", short_help="Which buttons are found.")
@click.argument("data", type=FILE)
@click.option(
    "--split", metavar="NAME", help="Of DATA.  [default: valid where there is one, else all]"
)
@click.option(
    "--weights", type=FILE, metavar="FILE", help="Another network, as `fronto export` writes it."
)
@click.option(
    "--threads", type=click.IntRange(min=1), metavar="N", help="[default: all usable cores]"
)
@click.option(
    "--by",
    type=click.Choice(["box", "mask"]),
    help="What has to overlap.  [default: mask where every label has an outline]",
)
@click.option(
    "--iou",
    type=FiniteRange(0, 1, min_open=True),
    default=0.5,
    show_default=True,
    help="How much, as intersection over union.",
)
@click.option(
    "--min-confidence", type=FiniteRange(0, 1), default=0.5, show_default=True, metavar="P"
)
@click.option(
    "--missing",
    "missing_file",
    type=FILE,
    metavar="FILE",
    help="Buttons that the labels miss (YAML).  [default: the packaged list for the panels set]",
)
@click.option("--json", "json_file", type=FILE, metavar="FILE", help="Write all figures there.")
@click.option(
    "--worst",
    type=click.IntRange(min=1),
    default=24,
    show_default=True,
    metavar="N",
    help="Photos on the sheet.",
)
@click.option("--sheet", type=FILE, metavar="FILE.png", help="Draw the worst photos there.")
@click.option("-q", "--quiet", is_flag=True, help="No progress bar.")
def buttons(
    data: Path,
    split: str | None,
    weights: Path | None,
    threads: int | None,
    by: Literal["box", "mask"] | None,
    iou: float,
    min_confidence: float,
    missing_file: Path | None,
    json_file: Path | None,
    worst: int,
    sheet: Path | None,
    quiet: bool,
) -> None:
    """Find the buttons of labelled photos and compare; prints Markdown tables.

    DATA is COCO, LabelMe, CVAT for images or YOLO, this project's annotations, or the
    panels set.
    """
    from fronto.engine import Engine
    from fronto.evaluate import evaluate_segmentation
    from fronto.files import write_bytes

    images = labeled_images(data, split, "valid")
    missing = _missing(missing_file, data)
    predict = _predictor(Engine(weights, threads=threads), min_confidence)
    with click.progressbar(images, label="photos", file=sys.stderr, hidden=quiet) as bar:
        report = evaluate_segmentation(
            bar, predict, by=by or _best(images), iou=iou, missing=missing
        )
    say_block(report.to_markdown())
    if json_file is not None:
        write_bytes(json_file, report.to_json())
        say(f"all figures -> {json_file}")
    if sheet is not None:
        from fronto.evaluate import photo_sheet
        from fronto.imageio import write_png

        shown = report.worst(worst)
        if not shown:
            say("no photo with an error: no sheet")
            return
        write_png(sheet, photo_sheet(shown))
        say(f"the worst photos -> {sheet}")


@command.command(name="labels", short_help="What they are called.")
@click.argument("data", type=FILE)
@click.option(
    "--split", metavar="NAME", help="Of DATA.  [default: valid where there is one, else all]"
)
@network_options
@click.option(
    "--iou",
    type=FiniteRange(0, 1, min_open=True),
    default=0.5,
    show_default=True,
    help="How much a button that is found has to overlap the labelled one.",
)
@click.option(
    "--illegible",
    "illegible_file",
    type=FILE,
    metavar="FILE",
    help="Buttons whose labels cannot be read by themselves (YAML, as of --missing).  "
    "[default: the packaged list for the panels set]",
)
@click.option("--json", "json_file", type=FILE, metavar="FILE", help="Write all figures there.")
@click.option("-q", "--quiet", is_flag=True, help="No progress bar.")
def labels(
    data: Path,
    split: str | None,
    weights: Path | None,
    threads: int | None,
    min_confidence: float,
    fast: bool,
    iou: float,
    illegible_file: Path | None,
    json_file: Path | None,
    quiet: bool,
) -> None:
    """Find and read the buttons of labelled photos: right, wrong and declined labels by class.

    Of the buttons that are found. The camera is the photo's own (EXIF), or estimated along.
    """
    from fronto.engine import Engine, find_weights
    from fronto.evaluate import panels_illegible, read_missing
    from fronto.evaluate.labels import evaluate_labels
    from fronto.files import write_bytes
    from fronto.labels.name import packaged_reader
    from fronto.rectifier import Rectifier
    from fronto.rectifieroptions import RectifierOptions

    images = labeled_images(data, split, "valid")
    illegible = panels_illegible() if is_panels(data) else None
    if illegible_file is not None:
        illegible = read_missing(illegible_file)
    engine = Engine(weights, threads=threads)
    if packaged_reader(engine.threads) is None:
        find_weights(stem="fronto-read")  # says that they are missing
    options = RectifierOptions(
        min_confidence=min_confidence, second_look=not fast, rectified_look=not fast
    )
    rectifier = Rectifier(options, engine=engine)
    with click.progressbar(images, label="photos", file=sys.stderr, hidden=quiet) as bar:
        report = evaluate_labels(
            bar, lambda image: rectifier(image.path), iou=iou, illegible=illegible
        )
    say_block(report.to_markdown())
    if json_file is not None:
        write_bytes(json_file, report.to_json())
        say(f"all figures -> {json_file}")


def _missing(file: Path | None, data: Path) -> Missing | None:
    from fronto.evaluate import panels_missing, read_missing

    if file is not None:
        return read_missing(file)
    return panels_missing() if is_panels(data) else None


def _best(images: list[LabeledImage]) -> Literal["box", "mask"]:
    """Masks, where nothing is labelled by its box only."""
    exact = all(o.polygon is not None or o.ignore for image in images for o in image.objects)
    return "mask" if exact else "box"


def _predictor(engine: Engine, min_confidence: float) -> Callable[[LabeledImage], Segments]:
    from fronto.segmentation import segment

    def predict(image: LabeledImage) -> Segments:
        return segment(image.path, engine=engine, min_confidence=min_confidence)

    return predict
