"""``fronto rectify``: photos and their buttons' outlines to head-on views."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from fronto.cli.shared import (
    BAD_INPUT,
    FILE,
    NOT_OK,
    POSITIVE,
    SOME_FAILED,
    FiniteRange,
    check_outputs,
    counted,
    say,
)
from fronto.errors import InputError

if TYPE_CHECKING:
    from fronto.camera import Camera
    from fronto.panelfile import PanelFiles
    from fronto.results import Panel

__all__ = ["command"]


@click.command(name="rectify", short_help="Turn photos of panels into head-on views.")
@click.argument("photos", nargs=-1, required=True, type=FILE, metavar="PHOTO...")
@click.option(
    "--outlines",
    required=True,
    type=FILE,
    metavar="FILE|DIR",
    help="Outlines of the buttons; a folder with <stem>.json or <stem>.outlines.json (as "
    "`fronto outline` writes) for each of several photos.",
)
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
    outlines: Path,
    output: Path,
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

    For each PHOTO writes DIR/<stem>.json, DIR/<stem>.overlay.png and, where the outlines
    determine a rotation, DIR/<stem>.rectified.png; prints one line with the verdict.

    Exit codes: 0 done; 1 some photos could not be used, others could; 2 wrong input, or no
    photo could be used; 3 with --strict: a result is not ok.
    """
    if sum(choice is not None for choice in (camera_file, hfov, focal_px)) > 1:
        raise click.UsageError("give one of --camera, --hfov and --focal-px")
    arguments = _solver_arguments(options, template_file)
    jobs = _jobs(photos, outlines, output, [camera_file, template_file])
    if template_file is not None:
        from fronto.templatefile import read_template

        arguments["template"] = read_template(template_file)
    if camera_file is not None:
        from fronto.camera.files import check_camera_file

        check_camera_file(camera_file)  # once for all photos
    source = _CameraSource(camera_file, hfov, focal_px)
    failed, not_ok = 0, 0
    for job in jobs:
        try:
            panel, files = job.run(source, include_unsure, arguments)
        except InputError as error:
            say(f"Error: {error}", err=True)
            failed += 1
            continue
        not_ok += panel.status != "ok"
        if not quiet:
            say(_verdict(panel, files))
    if failed:
        ctx.exit(SOME_FAILED if failed < len(jobs) else BAD_INPUT)
    if strict and not_ok:
        ctx.exit(NOT_OK)


@dataclass(frozen=True)
class _CameraSource:
    """Where the cameras of the photos come from; at most one of the three is given."""

    file: Path | None
    hfov_deg: float | None
    focal_px: float | None

    def camera(self, photo: Path, width: int, height: int) -> Camera:
        """The camera of one photo; EXIF data and a guess where nothing is given."""
        from fronto.camera import Camera

        if self.file is not None:
            return Camera.from_file(self.file, width, height)
        if self.hfov_deg is not None:
            return Camera.from_fov(self.hfov_deg, width, height)
        if self.focal_px is not None:
            wide = Camera.from_fov(90, width, height)
            return replace(wide.with_focal(self.focal_px, 0.0, "given"), detail="--focal-px")
        found: Camera | None = Camera.from_exif(photo)
        if found is None or (found.width_px, found.height_px) != (width, height):
            return Camera.default(width, height)
        return found


@dataclass(frozen=True)
class _Job:
    """One photo, its outlines, and where its results go."""

    photo: Path
    outlines: Path
    output: Path

    def run(
        self, source: _CameraSource, include_unsure: bool, arguments: dict[str, Any]
    ) -> tuple[Panel, PanelFiles]:
        from fronto.imageio import read_image
        from fronto.outlinefile import read_outlines
        from fronto.panelfile import write_panel
        from fronto.pipeline import rectify_outlines

        image = read_image(self.photo)
        height, width = image.shape[:2]
        found = read_outlines(self.outlines, width, height, include_unsure=include_unsure)
        camera = source.camera(self.photo, width, height)
        name = click.format_filename(self.photo.name)
        translation = arguments.get("translation", "none")
        try:
            if translation != "none":
                corners = _presupposed(found.outlines, width, height)
                arguments = {**arguments, "standard_corners": corners}
            lines = found.lines if arguments["solver"] == "refine" else ()
            panel = rectify_outlines(
                image, found.outlines, camera, image_name=name, lines=lines, **arguments
            )
        except InputError as error:
            thing = f"photo {self.photo}, {error.thing}"
            raise InputError(thing, error.expected, error.remedy) from None
        unused = len(found.lines) - len(lines)
        notes = _notes(found.image, name, len(found.skipped), unused)
        panel = replace(panel, notes=(*panel.notes, *notes))
        if found.skipped and not found.outlines:
            panel = _all_unsure(panel, len(found.skipped))
        return panel, write_panel(panel, image, self.output, self.photo.stem)


def _jobs(
    photos: Sequence[Path], outlines: Path, output: Path, others: Sequence[Path | None]
) -> list[_Job]:
    """Pair photos with outlines; refuse what would overwrite a result or an input."""
    from fronto.panelfile import output_names

    folder = outlines.is_dir()
    if len(photos) > 1 and not folder:
        raise InputError(
            f"--outlines {outlines}",
            f"expected a folder with <stem>.json for each of {len(photos)} photos, "
            f"got {'a file' if outlines.exists() else 'nothing there'}",
            "give a folder, or one photo",
        )
    jobs = [
        _Job(photo, _outlines_of(photo, outlines) if folder else outlines, output)
        for photo in photos
    ]
    inputs = [path for job in jobs for path in (job.photo, job.outlines)]
    inputs += [path for path in others if path is not None]
    check_outputs(photos, output, output_names, inputs)
    return jobs


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


def _all_unsure(panel: Panel, count: int) -> Panel:
    """Say why there was nothing to solve, though there are outlines."""
    subject = "the only outline is" if count == 1 else f"all {count} outlines are"
    reasons = (f"{subject} marked unsure; --include-unsure uses {'it' if count == 1 else 'them'}",)
    return replace(panel, reasons=reasons, pose=replace(panel.pose, reasons=reasons))


def _notes(stated: str, name: str, skipped: int, unused: int) -> tuple[str, ...]:
    notes = []
    if stated and Path(stated).name != name:
        notes.append(f"the outlines state another photo: {stated}")
    if skipped:
        notes.append(f"{counted(skipped, 'unsure outline')} left out")
    if unused:
        notes.append(f"{counted(unused, 'line')} left out: the grid search does not use them")
    return tuple(notes)


def _verdict(panel: Panel, files: PanelFiles) -> str:
    parts = [panel.status + (f" ({'; '.join(panel.reasons)})" if panel.reasons else "")]
    if panel.view is not None:
        angles = " ".join(f"{angle:.1f}" for angle in panel.pose.angles_deg)
        std = max(panel.pose.std_deg)
        parts.append(f"rotation {angles} deg" + (f" ±{std:.1f}" if std == std else ""))
    parts.append(counted(len(panel.buttons), "button"))
    parts.append(f"camera {panel.pose.camera.source}")
    shown = click.format_filename(files.rectified or files.overlay)
    return f"{panel.image}: {', '.join(parts)} -> {shown}"
