"""``fronto find``: the button with a label, in one photo or in many."""

from __future__ import annotations

import csv
import io
import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from fronto.cli.cameras import CameraSource, camera_options, camera_source
from fronto.cli.inputs import STDIN, expanded, is_video, read_stdin, result_names
from fronto.cli.positions import LengthSource, length_source, position_options, template_option
from fronto.cli.shared import (
    BAD_INPUT,
    FILE,
    SOME_FAILED,
    about_photo,
    check_outputs,
    network_options,
    say,
)
from fronto.errors import InputError

if TYPE_CHECKING:
    from fronto.find import Finding
    from fronto.rectifier import Rectifier
    from fronto.rectifieroptions import RectifierOptions

__all__ = ["NOT_FOUND", "command"]

log = logging.getLogger(__name__)

#: Exit code where some photo's button is not found for sure.
NOT_FOUND = 4
#: From so many photos on several processes pay: each begins by loading the networks.
MANY = 8
TABLE = "find.csv"
COLUMNS = (
    "photo",
    "label",
    "status",
    "button",
    "confidence",
    "label_source",
    "x_px",
    "y_px",
    "x_m",
    "y_m",
    "z_m",
    "reasons",
)


class _Outcome(NamedTuple):
    """What became of a photo: the line to print, and plain values (docs/result.md).

    `status` is None where the photo could not be used.
    """

    line: str
    status: str | None
    values: dict[str, Any]


@dataclass(frozen=True)
class _Search:
    """All that findings depend on beside the photos; makes what searches one."""

    label: str
    inferred: bool
    weights: Path | None
    threads: int | None
    options: RectifierOptions
    source: CameraSource
    length: LengthSource
    template_file: Path | None = None

    def __call__(self) -> Callable[[Path], _Outcome]:
        """What searches a photo, with networks of its own."""
        from fronto.engine import Engine, find_weights
        from fronto.labels.name import packaged_reader
        from fronto.rectifier import Rectifier
        from fronto.templatefile import read_template

        template = None if self.template_file is None else read_template(self.template_file)
        engine = Engine(self.weights, threads=self.threads)
        if packaged_reader(engine.threads) is None:
            find_weights(stem="fronto-read")  # says that they are missing
        rectifier = Rectifier(self.options, engine=engine, template=template)
        return lambda photo: self._searched(photo, rectifier)

    def _searched(self, photo: Path, rectifier: Rectifier) -> _Outcome:
        name = click.format_filename(photo.name)
        try:
            return self._found(photo, name, rectifier)
        except InputError as error:
            return _failed(name, self.label, str(error))
        except Exception as error:  # a flaw of ours must not cost the other photos
            log.exception("photo %s", photo)
            what = f"photo {photo}: {type(error).__name__}: {error}"
            flaw = f"{what}; a flaw of fronto, please report it with the photo"
            return _failed(name, self.label, flaw)

    def _found(self, photo: Path, name: str, rectifier: Rectifier) -> _Outcome:
        from fronto.find import find_label, finding_to_dict
        from fronto.images import as_rgb

        image = as_rgb(photo)
        height, width = image.shape[:2]
        camera = self.source.camera(photo, width, height)
        with about_photo(photo):
            panel = replace(rectifier.rectify(image, camera), image=name)
            panel = self.length.fill(panel, photo)
        finding = find_label(panel, self.label, inferred=self.inferred)
        values = finding_to_dict(panel, finding)
        return _Outcome(_line(values, finding), finding.status, values)


@click.command(name="find", short_help="Find the button with a label.")
@click.argument("photos", nargs=-1, required=True, type=FILE, metavar="PHOTO...")
@click.option(
    "-l",
    "--label",
    required=True,
    metavar="TEXT",
    help="A floor (12, B1, PH), a function (up, down, open, close, alarm, stop, keyhole), or "
    "another text on a button.",
)
@click.option(
    "--inferred",
    is_flag=True,
    help="Take labels that were not read as well, where the neighbours' labels leave no other.",
)
@click.option("--json", "as_json", is_flag=True, help="Print JSON, one line for each photo.")
@click.option(
    "-o",
    "--output",
    type=FILE,
    metavar="DIR",
    help=f"Also write DIR/<stem>.find.json for each photo, and all in one table, DIR/{TABLE}.",
)
@network_options
@camera_options
@template_option
@position_options
@click.option(
    "--jobs",
    type=click.IntRange(min=1),
    metavar="N",
    help=f"Processes.  [default: one per core from {MANY} photos on]",
)
@click.option("-q", "--quiet", is_flag=True, help="Print errors only.")
@click.pass_context
def command(
    ctx: click.Context,
    /,
    photos: Sequence[Path],
    label: str,
    inferred: bool,
    as_json: bool,
    output: Path | None,
    weights: Path | None,
    threads: int | None,
    min_confidence: float,
    fast: bool,
    camera_file: Path | None,
    hfov: float | None,
    focal_px: float | None,
    template_file: Path | None,
    jobs: int | None,
    quiet: bool,
    **given: Any,
) -> None:
    """Find the button with a label in photos of elevator panels.

    Each PHOTO may also be a folder of photos, a pattern, or - for standard input. Prints one
    line for each: where the button is; that no button has this label; or that it is not sure,
    and why. A label that was not read, but follows from the neighbours' labels, is not sure
    without --inferred. With a camera and a length on the panel (--pitch, --button-size,
    --distance, ...) also says where the button is in metres, and the direction to press in.

    Exit codes: 0 found in every photo; 4 not there, or not sure, in some photo; 1 some photos
    could not be used, others could; 2 wrong input, or no photo could be used.
    """
    from fronto.find import wanted_label
    from fronto.rectifieroptions import RectifierOptions

    search = _Search(
        label=wanted_label(label),
        inferred=inferred,
        weights=weights,
        threads=threads,
        options=RectifierOptions(
            min_confidence=min_confidence, second_look=not fast, rectified_look=not fast
        ),
        source=camera_source(camera_file, hfov, focal_px),
        length=length_source(given, template_file),
        template_file=template_file,
    )
    _check_files(search)
    with TemporaryDirectory(prefix="fronto-") as spool:
        files = expanded(photos)
        _check_photos(files)
        files = [read_stdin(Path(spool)) if path == STDIN else path for path in files]
        stems = list(result_names(files))
        if output is not None:
            inputs = [path for path in (*files, weights, camera_file) if path is not None]
            check_outputs(files, output, _names, inputs, stems)
        statuses = _run(files, stems, search, output, jobs, as_json=as_json, quiet=quiet)
    failed = statuses.count(None)
    if failed:
        ctx.exit(SOME_FAILED if failed < len(statuses) else BAD_INPUT)
    if any(status != "found" for status in statuses):
        ctx.exit(NOT_FOUND)


def _check_files(search: _Search) -> None:
    """Say once, before any work, what is wrong with files that all photos share."""
    search.length.check()
    if search.template_file is not None:
        from fronto.templatefile import read_template

        read_template(search.template_file)
    if search.source.file is not None:
        from fronto.camera.files import check_camera_file

        check_camera_file(search.source.file)


def _check_photos(files: Sequence[Path]) -> None:
    films = [path for path in files if is_video(path)]
    if films:
        raise InputError(
            f"video {films[0]}", "expected photos, got a video", "name photos, or a folder of them"
        )


def _names(stem: str) -> tuple[str, str]:
    return f"{stem}.find.json", TABLE


def _run(
    photos: Sequence[Path],
    stems: Sequence[str],
    search: _Search,
    output: Path | None,
    jobs: int | None,
    *,
    as_json: bool,
    quiet: bool,
) -> list[str | None]:
    """Search photos, print and write what is found; the status of each."""
    from fronto.batch import Crashed, in_order
    from fronto.cli.batches import Bar, JsonLines
    from fronto.cores import usable_cores

    if jobs is None:
        jobs = usable_cores() if len(photos) >= MANY else 1
    jobs = min(jobs, len(photos))
    if jobs > 1 and search.threads is None:
        # Each process its share of the cores.
        search = replace(search, threads=max(1, usable_cores() // jobs))
    statuses = []
    table = None if output is None else output / TABLE
    with JsonLines(table, "output file") as rows, Bar(len(photos)) as bar:
        rows.write(_row(COLUMNS))
        results = in_order(photos, search, jobs)
        for stem, (photo, result) in zip(stems, results, strict=True):
            outcome = _crashed(photo, search.label) if isinstance(result, Crashed) else result
            rows.write(_row(_cells(outcome.values)))
            if output is not None:
                _write_json(output / _names(stem)[0], outcome)
            with bar.aside():
                if outcome.status is None:
                    say(f"Error: {outcome.line}", err=True)
                if as_json:
                    _print_json(outcome.values)
                elif outcome.status is not None and not quiet:
                    say(outcome.line)
            statuses.append(outcome.status)
    return statuses


def _line(values: dict[str, Any], finding: Finding) -> str:
    """One line for people."""
    words = finding.status.replace("_", " ")
    start = f"{values['photo']}: {finding.label} {words}"
    if finding.status != "found":
        return f"{start}: {'; '.join(finding.reasons)}"
    x, y = values["center_px"]
    parts = [f"button {values['button']} at ({x:.1f}, {y:.1f}) px"]
    if values["position_m"] is not None:
        place = ", ".join(f"{value:.4f}" for value in values["position_m"])
        parts.append(f"({place}) m from the camera")
    parts += [f"confidence {finding.confidence:.3f}", *finding.reasons]
    return f"{start}: {', '.join(parts)}"


def _failed(name: str, label: str, what: str) -> _Outcome:
    """Of a photo that could not be used."""
    values = {"schema": "fronto.error/1", "image": name, "label": label, "error": what}
    return _Outcome(what, None, values)


def _crashed(photo: Path, label: str) -> _Outcome:
    what = InputError(
        f"photo {photo}",
        "expected to finish, but its process was ended by the system (out of memory?)",
        "give fewer --jobs, or scale the photo down",
    )
    return _failed(click.format_filename(photo.name), label, str(what))


def _cells(values: dict[str, Any]) -> list[object]:
    """One row of the table; empty cells for what there is not."""
    if "error" in values:
        named = {"photo": values["image"], "label": values["label"], "status": "failed"}
        return [(named | {"reasons": values["error"]}).get(column, "") for column in COLUMNS]
    center, position = values["center_px"] or ("", ""), values["position_m"] or ("", "", "")
    named = values | {"reasons": "; ".join(values["reasons"])}
    named |= dict(zip(("x_px", "y_px"), center, strict=True))
    named |= dict(zip(("x_m", "y_m", "z_m"), position, strict=True))
    cells = [named[column] for column in COLUMNS]
    return ["" if cell is None else cell for cell in cells]


def _row(cells: Sequence[object]) -> bytes:
    """A line of the table: CSV as of RFC 4180, UTF-8."""
    line = io.StringIO()
    csv.writer(line).writerow(cells)
    return line.getvalue().encode("utf-8", "replace")


def _write_json(path: Path, outcome: _Outcome) -> None:
    from fronto.files import json_bytes, write_bytes

    write_bytes(path, json_bytes(outcome.values))


def _print_json(values: dict[str, Any]) -> None:
    import msgspec

    click.echo(msgspec.json.encode(values))
