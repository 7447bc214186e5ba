"""``fronto rectify``: photos to head-on views."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any

import click

from fronto.cli.cameras import camera_options, camera_source
from fronto.cli.inputs import STDIN, expanded, is_video, read_stdin, result_names
from fronto.cli.positions import length_source, position_options, template_option
from fronto.cli.rectifying import Job, Settings
from fronto.cli.shared import (
    BAD_INPUT,
    FILE,
    NOT_OK,
    POSITIVE,
    SOME_FAILED,
    FiniteRange,
    check_outputs,
    network_options,
)
from fronto.errors import InputError

if TYPE_CHECKING:
    from fronto.rectifieroptions import RectifierOptions

__all__ = ["command"]

#: From so many photos on several processes pay: each begins by loading the network.
MANY = 8


@click.command(name="rectify", short_help="Turn photos of panels into head-on views.")
@click.argument("photos", nargs=-1, type=FILE, metavar="PHOTO...")
@click.option(
    "--outlines",
    type=FILE,
    metavar="FILE|DIR",
    help="Outlines of the buttons, where they are known; a folder with <stem>.json or "
    "<stem>.outlines.json (as `fronto outline` writes) for each of several photos.",
)
@network_options
@click.option("--no-lines", is_flag=True, help="Do not look for lines of the panel.")
@click.option("--no-labels", is_flag=True, help="Do not read what is printed on the buttons.")
@click.option(
    "-o",
    "--output",
    default="fronto-out",
    show_default=True,
    type=FILE,
    metavar="DIR",
    help="Where results go.",
)
@click.option(
    "--options",
    "options_file",
    type=FILE,
    metavar="FILE",
    help="Options of the stages (TOML); what is given here as well counts more.",
)
@camera_options
@template_option
@position_options
@click.option(
    "--write-template",
    "template_out",
    type=FILE,
    metavar="FILE",
    help="Write the panel's layout here, for --template with its next photo; needs a length.",
)
@click.option(
    "--solver", type=click.Choice(["refine", "grid"]), default="refine", show_default=True
)
@click.option("--square", is_flag=True, help="The quads are known to be square.")
@click.option("--no-align", is_flag=True, help="Buttons do not line up in rows and columns.")
@click.option(
    "--crop",
    type=click.Choice(["panel", "full", "input"]),
    default="panel",
    show_default=True,
    help="What the head-on picture shows.",
)
@click.option("--scale", type=POSITIVE, default=1.0, show_default=True, help="Its enlargement.")
@click.option(
    "--margin",
    type=FiniteRange(min=0),
    default=0.5,
    show_default=True,
    help="Around the buttons, in button sides (--crop panel).",
)
@click.option(
    "--range-deg",
    type=FiniteRange(),
    nargs=2,
    metavar="A B",
    help="Grid: the angles' range.  [-40 40]",
)
@click.option("--step-deg", type=POSITIVE, metavar="DEG", help="Grid: its step.  [0.5]")
@click.option("--criterion", type=click.Choice(["inverse", "paper"]), help="Grid: K_rV.  [inverse]")
@click.option("--combine", type=click.Choice(["sum", "minmax"]), help="Grid: Final CR.  [sum]")
@click.option(
    "--translation",
    type=click.Choice(["none", "paper", "paper_rotated"]),
    help="Grid: Eq. 7's T, for study.  [none]",
)
@click.option("--show-steps", is_flag=True, help="Draw every step: DIR/<stem>.steps.png.")
@click.option(
    "--before-after", is_flag=True, help="Draw photo and view: DIR/<stem>.before_after.png."
)
@click.option(
    "--jobs",
    type=click.IntRange(min=1),
    metavar="N",
    help=f"Processes.  [default: one per core from {MANY} photos on]",
)
@click.option(
    "--resume",
    is_flag=True,
    help="Leave photos' results that are there, made with the same settings.",
)
@click.option(
    "--jsonl",
    type=FILE,
    metavar="FILE",
    help="Also write the results of all photos here, one JSON a line.",
)
@click.option(
    "--device", type=click.IntRange(min=0), metavar="INDEX", help="Take the video of this camera."
)
@click.option(
    "--every",
    type=click.IntRange(min=1),
    default=1,
    show_default=True,
    metavar="N",
    help="Videos: take every Nth frame.",
)
@click.option(
    "--frames", type=click.IntRange(min=1), metavar="N", help="Videos: stop after N frames taken."
)
@click.option("--include-unsure", is_flag=True, help="Use outlines marked unsure as well.")
@click.option("--strict", is_flag=True, help="Exit with 3 when any result is not ok.")
@click.option("-q", "--quiet", is_flag=True, help="Print errors only.")
@click.pass_context
def command(
    ctx: click.Context,
    /,
    photos: Sequence[Path],
    outlines: Path | None,
    output: Path,
    options_file: Path | None,
    weights: Path | None,
    threads: int | None,
    camera_file: Path | None,
    hfov: float | None,
    focal_px: float | None,
    template_file: Path | None,
    template_out: Path | None,
    include_unsure: bool,
    show_steps: bool,
    before_after: bool,
    jobs: int | None,
    resume: bool,
    jsonl: Path | None,
    device: int | None,
    every: int,
    frames: int | None,
    strict: bool,
    quiet: bool,
    **given: Any,
) -> None:
    """Turn photos of elevator button panels into head-on views.

    Each PHOTO may also be a folder of photos, a pattern, a video, or - for standard input.
    Finds the buttons by itself; or give their --outlines. For each photo writes
    DIR/<stem>.json, DIR/<stem>.overlay.png and, where the buttons determine a rotation,
    DIR/<stem>.rectified.png; prints one line with the verdict. Of a video it writes
    DIR/<stem>.rectified.mp4 and DIR/<stem>.jsonl, a line for each frame.

    Exit codes: 0 done; 1 some photos could not be used, others could; 2 wrong input, or no
    photo could be used; 3 with --strict: a result is not ok.
    """
    from fronto.cli.batches import run_photos
    from fronto.cli.videos import VideoJob, run_videos

    if not photos and device is None:
        raise click.UsageError("give a PHOTO, a folder, a video, or --device")
    source = camera_source(camera_file, hfov, focal_px)
    solving = _solving(given, template_file)
    length = length_source(given, template_file)
    if template_out is not None and not (length or template_file):
        raise click.UsageError("--write-template needs a length, such as --pitch")
    if template_out is not None and template_out == template_file:
        raise click.UsageError("--write-template would overwrite the --template that is read")
    settings = Settings(
        output=output,
        weights=weights,
        threads=threads,
        options=_options(ctx, options_file, given),
        source=source,
        solving=tuple(solving.items()),
        template_file=template_file,
        length=length,
        template_out=template_out,
        include_unsure=include_unsure,
        steps=show_steps,
        before_after=before_after,
        resume=resume,
    )
    _check_files(settings, outlines)
    with TemporaryDirectory(prefix="fronto-") as spool:
        files = expanded(photos)
        if STDIN in files:
            files = [read_stdin(Path(spool)) if path == STDIN else path for path in files]
        films = [path for path in files if is_video(path)]
        videos = [VideoJob(p, stem) for p, stem in zip(films, result_names(films), strict=True)]
        if device is not None:
            videos.append(VideoJob(device, f"camera{device}"))
        if videos and (outlines is not None or solving["solver"] != "refine" or template_file):
            raise click.UsageError("videos know no --outlines, --solver grid and --template")
        if template_out is not None and (videos or len(files) > 1):
            raise click.UsageError("--write-template takes one photo")
        if videos and length:
            raise click.UsageError("videos know no lengths such as --pitch and --distance")
        if videos and (show_steps or before_after):
            raise click.UsageError("videos know no --show-steps and --before-after")
        others = [camera_file, template_file, weights, options_file, length.depth]
        work = _jobs([path for path in files if not is_video(path)], outlines, settings, others)
        if jobs is None:
            jobs = _processes(len(work))
        counts = run_photos(work, settings, jobs, jsonl, quiet=quiet)
        counts += run_videos(videos, settings, every=every, frames=frames, quiet=quiet)
    if counts.failed:
        ctx.exit(SOME_FAILED if counts.failed < counts.all else BAD_INPUT)
    if strict and counts.not_ok:
        ctx.exit(NOT_OK)


def _processes(photos: int) -> int:
    from fronto.cores import usable_cores

    return usable_cores() if photos >= MANY else 1


def _options(
    ctx: click.Context, options_file: Path | None, given: dict[str, Any]
) -> RectifierOptions:
    """Options of the file, with those of the command line over them."""
    from fronto.rectifieroptions import RectifierOptions

    options = RectifierOptions()
    if options_file is not None:
        options = RectifierOptions.from_file(options_file)
    source = click.core.ParameterSource.COMMANDLINE
    said = {name: v for name, v in given.items() if ctx.get_parameter_source(name) == source}
    names = ("min_confidence", "crop", "scale", "margin", "square")
    changes = {name: said[name] for name in names if name in said}
    if said.get("fast"):
        changes |= {"second_look": False, "rectified_look": False}
    if said.get("no_lines"):
        changes["lines"] = False
    if said.get("no_labels"):
        changes["read_labels"] = False
    if said.get("no_align"):
        changes["aligned"] = False
    if given["solver"] == "grid":
        # The paper's search takes what one look finds.
        changes["rectified_look"] = False
    return replace(options, **changes)


def _check_files(settings: Settings, outlines: Path | None) -> None:
    """Say once, before any work, what is wrong with files that all photos share."""
    settings.length.check()
    if settings.source.file is not None:
        from fronto.camera.files import check_camera_file

        check_camera_file(settings.source.file)
    if settings.template_file is not None:
        from fronto.templatefile import read_template

        read_template(settings.template_file)
    if outlines is None and settings.weights is not None:
        from fronto.engine import Engine

        Engine(settings.weights, threads=settings.threads)


def _jobs(
    photos: Sequence[Path],
    outlines: Path | None,
    settings: Settings,
    others: Sequence[Path | None],
) -> list[Job]:
    """Pair photos with outlines; refuse what would overwrite a result or an input."""
    folder = outlines is not None and outlines.is_dir()
    if outlines is not None and len(photos) > 1 and not folder:
        raise InputError(
            f"--outlines {outlines}",
            f"expected a folder with <stem>.json for each of {len(photos)} photos, "
            f"got {'a file' if outlines.exists() else 'nothing there'}",
            "give a folder, or one photo",
        )
    # Outlines go by the stem alone.
    stems = [p.stem for p in photos] if outlines else list(result_names(photos))
    jobs = [
        Job(photo, stem, _outlines_of(photo, outlines) if outlines and folder else outlines)
        for photo, stem in zip(photos, stems, strict=True)
    ]
    paths = [path for job in jobs for path in (job.photo, job.outlines)]
    inputs = [path for path in (*paths, *others) if path is not None]
    check_outputs(photos, settings.output, settings.names, inputs, stems)
    return jobs


def _outlines_of(photo: Path, folder: Path) -> Path:
    """<stem>.json, or what `fronto outline` has written."""
    own = folder / f"{photo.stem}.outlines.json"
    plain = folder / f"{photo.stem}.json"
    return own if own.exists() and not plain.exists() else plain


def _solving(options: dict[str, Any], template_file: Path | None) -> dict[str, Any]:
    """Arguments of `rectify_outlines`; refuse options that the solver would not look at."""
    names = ("range_deg", "step_deg", "criterion", "combine", "translation")
    grid = {name: value for name in names if (value := options[name]) is not None}
    solver = options["solver"]
    refine = {"square": options["square"], "no_align": options["no_align"]}
    idle = [*grid] if solver == "refine" else [name for name, on in refine.items() if on]
    if solver == "grid" and template_file is not None:
        idle.append("template")
    if idle:
        flags = ", ".join("--" + name.replace("_", "-") for name in idle)
        raise click.UsageError(f"--solver {solver} does not know {flags}")
    return {"solver": solver, **grid}
