"""``fronto rectify``: photos and their buttons' outlines to head-on views."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from fronto.cli.cameras import CameraSource
from fronto.cli.shared import (
    BAD_INPUT,
    FILE,
    NOT_OK,
    POSITIVE,
    SOME_FAILED,
    FiniteRange,
    about_photo,
    check_outputs,
    network_options,
    say,
)
from fronto.cli.verdicts import all_unsure, outline_notes, verdict
from fronto.errors import InputError

if TYPE_CHECKING:
    from fronto.camera import Camera
    from fronto.outlinefile import OutlineFile
    from fronto.panelfile import PanelFiles
    from fronto.rectifier import Rectifier
    from fronto.results import Panel

__all__ = ["command"]


@click.command(name="rectify", short_help="Turn photos of panels into head-on views.")
@click.argument("photos", nargs=-1, required=True, type=FILE, metavar="PHOTO...")
@click.option(
    "--outlines",
    type=FILE,
    metavar="FILE|DIR",
    help="Outlines of the buttons, where they are known; a folder with <stem>.json or "
    "<stem>.outlines.json (as `fronto outline` writes) for each of several photos.",
)
@network_options
@click.option("--no-lines", is_flag=True, help="Do not look for lines of the panel.")
@click.option("-o", "--output", required=True, type=FILE, metavar="DIR", help="Where results go.")
@click.option(
    "--camera",
    "camera_file",
    type=FILE,
    metavar="FILE",
    help="Calibration: ROS camera_info, OpenCV, Kalibr, or a 3x3 matrix.  [default: the photo's "
    "EXIF data, else a guess]",
)
@click.option(
    "--hfov",
    type=FiniteRange(0, 180, min_open=True, max_open=True),
    metavar="DEG",
    help="The camera's horizontal field of view instead.",
)
@click.option("--focal-px", type=POSITIVE, metavar="F", help="Its focal length instead, in pixels.")
@click.option(
    "--template",
    "template_file",
    type=FILE,
    metavar="FILE",
    help="The panel's layout in millimetres, where it is known.",
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
    weights: Path | None,
    threads: int | None,
    min_confidence: float,
    fast: bool,
    no_lines: bool,
    camera_file: Path | None,
    hfov: float | None,
    focal_px: float | None,
    template_file: Path | None,
    include_unsure: bool,
    strict: bool,
    quiet: bool,
    **options: Any,
) -> None:
    """Turn photos of elevator button panels into head-on views.

    Finds the buttons by itself; or give their --outlines. For each PHOTO writes
    DIR/<stem>.json, DIR/<stem>.overlay.png and, where the buttons determine a rotation,
    DIR/<stem>.rectified.png; prints one line with the verdict.

    Exit codes: 0 done; 1 some photos could not be used, others could; 2 wrong input, or no
    photo could be used; 3 with --strict: a result is not ok.
    """
    if sum(choice is not None for choice in (camera_file, hfov, focal_px)) > 1:
        raise click.UsageError("give one of --camera, --hfov and --focal-px")
    arguments = _solver_arguments(options, template_file)
    jobs = _jobs(photos, outlines, output, [camera_file, template_file, weights])
    if template_file is not None:
        from fronto.templatefile import read_template

        arguments["template"] = read_template(template_file)
    if camera_file is not None:
        from fronto.camera.files import check_camera_file

        check_camera_file(camera_file)  # once for all photos
    source = CameraSource(camera_file, hfov, focal_px)
    finder = None
    if outlines is None:
        finder = _finder(weights, threads, min_confidence, fast=fast, lines=not no_lines)
    failed, not_ok = 0, 0
    for job in jobs:
        try:
            panel, files = job.run(source, finder, include_unsure, arguments)
        except InputError as error:
            say(f"Error: {error}", err=True)
            failed += 1
            continue
        not_ok += panel.status != "ok"
        if not quiet:
            say(verdict(panel, files))
    if failed:
        ctx.exit(SOME_FAILED if failed < len(jobs) else BAD_INPUT)
    if strict and not_ok:
        ctx.exit(NOT_OK)


@dataclass(frozen=True)
class _Job:
    """One photo, its outlines, and where its results go."""

    photo: Path
    outlines: Path | None
    output: Path

    def run(
        self,
        source: CameraSource,
        finder: Rectifier | None,
        include_unsure: bool,
        arguments: dict[str, Any],
    ) -> tuple[Panel, PanelFiles]:
        from fronto.imageio import read_image
        from fronto.panelfile import write_panel

        image = read_image(self.photo)
        height, width = image.shape[:2]
        camera = source.camera(self.photo, width, height)
        if finder is not None:
            panel = self._found(image, finder, camera, arguments)
        else:
            panel = self._given(image, camera, include_unsure, arguments)
        return panel, write_panel(panel, image, self.output, self.photo.stem)

    def _found(
        self, image: Any, finder: Rectifier, camera: Camera, arguments: dict[str, Any]
    ) -> Panel:
        """Buttons that the network finds."""
        from fronto.images import as_rgb
        from fronto.outlinefile import OutlineFile
        from fronto.rectifier import found_by_itself

        with about_photo(self.photo):
            outlines, notes, timing = finder.find(as_rgb(image))
        given = OutlineFile(outlines.buttons, outlines.lines)
        panel = found_by_itself(self._solved(image, given, camera, arguments), outlines)
        timing = timing | panel.timing_ms
        timing["total"] += timing["segment"] + timing["outline"]
        return replace(panel, notes=(*notes, *panel.notes), timing_ms=timing)

    def _given(
        self, image: Any, camera: Camera, include_unsure: bool, arguments: dict[str, Any]
    ) -> Panel:
        """Buttons of an outlines file."""
        from fronto.outlinefile import read_outlines

        assert self.outlines is not None
        height, width = image.shape[:2]
        found = read_outlines(self.outlines, width, height, include_unsure=include_unsure)
        panel = self._solved(image, found, camera, arguments)
        panel = replace(panel, plates=found.plates)
        if found.skipped and not found.outlines:
            panel = all_unsure(panel, len(found.skipped))
        return panel

    def _solved(
        self, image: Any, found: OutlineFile, camera: Camera, arguments: dict[str, Any]
    ) -> Panel:
        from fronto.pipeline import rectify_outlines

        height, width = image.shape[:2]
        name = click.format_filename(self.photo.name)
        translation = arguments.get("translation", "none")
        with about_photo(self.photo):
            if translation != "none":
                corners = _presupposed(found.outlines, width, height)
                arguments = {**arguments, "standard_corners": corners}
            lines = found.lines if arguments["solver"] == "refine" else ()
            panel = rectify_outlines(
                image, found.outlines, camera, image_name=name, lines=lines, **arguments
            )
        unused = len(found.lines) - len(lines)
        notes = outline_notes(found.image, name, len(found.skipped), unused)
        return replace(panel, notes=(*panel.notes, *notes))


def _jobs(
    photos: Sequence[Path], outlines: Path | None, output: Path, others: Sequence[Path | None]
) -> list[_Job]:
    """Pair photos with outlines; refuse what would overwrite a result or an input."""
    from fronto.panelfile import output_names

    folder = outlines is not None and outlines.is_dir()
    if outlines is not None and len(photos) > 1 and not folder:
        raise InputError(
            f"--outlines {outlines}",
            f"expected a folder with <stem>.json for each of {len(photos)} photos, "
            f"got {'a file' if outlines.exists() else 'nothing there'}",
            "give a folder, or one photo",
        )
    jobs = [
        _Job(photo, _outlines_of(photo, outlines) if outlines and folder else outlines, output)
        for photo in photos
    ]
    paths = [path for job in jobs for path in (job.photo, job.outlines)]
    inputs = [path for path in (*paths, *others) if path is not None]
    check_outputs(photos, output, output_names, inputs)
    return jobs


def _finder(
    weights: Path | None, threads: int | None, min_confidence: float, *, fast: bool, lines: bool
) -> Rectifier:
    from fronto.engine import Engine
    from fronto.rectifier import Rectifier, RectifierOptions

    options = RectifierOptions(min_confidence=min_confidence, second_look=not fast, lines=lines)
    return Rectifier(options, engine=Engine(weights, threads=threads))


def _outlines_of(photo: Path, folder: Path) -> Path:
    """<stem>.json, or what `fronto outline` has written."""
    own = folder / f"{photo.stem}.outlines.json"
    plain = folder / f"{photo.stem}.json"
    return own if own.exists() and not plain.exists() else plain


def _solver_arguments(options: dict[str, Any], template_file: Path | None) -> dict[str, Any]:
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
    return {
        "solver": solver,
        "square": options["square"],
        "aligned": not options["no_align"],
        **{name: options[name] for name in ("crop", "scale", "margin")},
        **grid,
    }


def _presupposed(outlines: Sequence[Any], width: int, height: int) -> Any:
    """Find the paper's presupposed corners (Fig. 4) for this many buttons."""
    from fronto.pose.presupposed import presupposed_corners

    count = len(outlines)
    if count not in (2, 3):
        raise InputError(
            "--translation",
            f"expected 2 or 3 buttons as on the paper's panels (Fig. 4), got {count}",
            "leave it out",
        )
    layout: Any = {2: "up_down", 3: "up_down_keyhole"}[count]
    return presupposed_corners(layout, width, height)
