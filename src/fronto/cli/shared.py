"""What the commands have in common: options, exit codes, printing, photos, output folders."""

from __future__ import annotations

import math
import os
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, TypeVar

import click

from fronto.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from fronto.engine import Engine
    from fronto.segments import Segments

__all__ = [
    "BAD_INPUT",
    "FILE",
    "NOT_OK",
    "POSITIVE",
    "SOME_FAILED",
    "Counts",
    "FiniteRange",
    "about_photo",
    "check_outputs",
    "counted",
    "each_photo",
    "leave",
    "network_options",
    "require",
    "say",
    "say_block",
    "segment_photo",
    "segmentation_options",
]

Command = TypeVar("Command", bound=Callable[..., Any])

# Exit codes.
SOME_FAILED, BAD_INPUT, NOT_OK = 1, 2, 3

FILE = click.Path(path_type=Path)


class FiniteRange(click.FloatRange):
    """A range of finite numbers: NaN lies in every range, as comparisons have it."""

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> float:
        """Parse a number."""
        number = float(super().convert(value, param, ctx))
        if not math.isfinite(number):
            self.fail(f"expected a finite number, got {value}; give one in digits.", param, ctx)
        return number


POSITIVE = FiniteRange(min=0, min_open=True)


def network_options(command: Command) -> Command:
    """Options of a command that looks for buttons: which network, and how."""
    for option in (
        click.option("--fast", is_flag=True, help="One look only, at the photo as a whole."),
        click.option(
            "--min-confidence",
            type=FiniteRange(0, 1),
            default=0.5,
            show_default=True,
            metavar="P",
            help="Leave out what is less sure.",
        ),
        click.option(
            "--threads",
            type=click.IntRange(min=1),
            metavar="N",
            help="[default: all usable cores]",
        ),
        click.option(
            "--weights",
            type=FILE,
            metavar="FILE",
            help="Another network, as `fronto export` writes it.",
        ),
    ):
        command = option(command)
    return command


def segmentation_options(command: Command) -> Command:
    """Photos, where results go, and `network_options`."""
    command = network_options(command)
    for option in (
        click.option(
            "-o",
            "--output",
            required=True,
            type=FILE,
            metavar="DIR",
            help="Where results go.",
        ),
        click.argument("photos", nargs=-1, required=True, type=FILE, metavar="PHOTO..."),
    ):
        command = option(command)
    return command


def segment_photo(
    photo: Path, engine: Engine, min_confidence: float, *, fast: bool
) -> tuple[npt.NDArray[np.uint8], Segments]:
    """Read a photo, (h, w, 3), RGB, and find its buttons.

    Raises
    ------
    InputError
        Naming the photo.
    """
    from fronto.images import as_rgb
    from fronto.segmentation import segment

    image = as_rgb(photo)
    with about_photo(photo):
        return image, segment(
            image, engine=engine, min_confidence=min_confidence, second_look=not fast
        )


@contextmanager
def about_photo(photo: Path) -> Iterator[None]:
    """Name the photo in what is wrong with arguments made from it."""
    try:
        yield
    except InputError as error:
        raise InputError(f"photo {photo}, {error.thing}", error.expected, error.remedy) from None


class Counts(NamedTuple):
    """Of photos: all, those that could not be used, those in which nothing was found."""

    photos: int
    failed: int
    empty: int


def each_photo(
    photos: Sequence[Path], work: Callable[[Path], tuple[bool, str]], *, quiet: bool
) -> Counts:
    """Work on one photo after the other; those that cannot be used are told and passed over.

    Parameters
    ----------
    photos
        Their files.
    work
        Tells whether anything was found in a photo, and the line to print.
    quiet
        Print errors only.
    """
    failed, empty = 0, 0
    for photo in photos:
        try:
            found, line = work(photo)
        except InputError as error:
            say(f"Error: {error}", err=True)
            failed += 1
            continue
        empty += not found
        if not quiet:
            say(line)
    return Counts(len(photos), failed, empty)


def leave(ctx: click.Context, counts: Counts, *, strict: bool) -> None:
    """Exit with the code that the photos call for; return if all is well."""
    if counts.failed:
        ctx.exit(SOME_FAILED if counts.failed < counts.photos else BAD_INPUT)
    if strict and counts.empty:
        ctx.exit(NOT_OK)


def check_outputs(
    photos: Sequence[Path],
    output: Path,
    names: Callable[[str], Iterable[str]],
    inputs: Iterable[Path],
    stems: Iterable[str] | None = None,
) -> None:
    """Refuse results that would overwrite each other or an input.

    Parameters
    ----------
    photos
        Each has results under its stem.
    output
        The folder for them, which may be missing.
    names
        Gives the names of the results' files for a stem.
    inputs
        Files that must stay.
    stems
        What each photo's results are named after; None: their stems.

    Raises
    ------
    InputError
        If the folder is a file, two photos have one stem, or an input lies where a result
        is to go.
    """
    if output.exists() and not output.is_dir():
        raise InputError(f"--output {output}", "expected a folder, got a file", "choose another")
    # Not Path.resolve: it raises where symbolic links go round in a circle.
    kept = {os.path.realpath(path) for path in inputs}
    seen: dict[str, Path] = {}
    for photo, stem in zip(photos, stems or [photo.stem for photo in photos], strict=True):
        # Some file systems do not tell upper from lower case.
        other = seen.setdefault(stem.casefold(), photo)
        if other is not photo:
            raise InputError(
                f"photos {other} and {photo}",
                "expected different stems, got one name for both results",
                "rename one, or use another folder for it",
            )
        for name in names(stem):
            if os.path.realpath(output / name) in kept:
                raise InputError(
                    f"--output {output}",
                    f"expected a folder where results overwrite no input, got {name} in it",
                    "choose another folder",
                )


def require(modules: Sequence[str], extra: str, purpose: str) -> None:
    """Say which extra to install where a library that a command needs is missing.

    Raises
    ------
    InputError
        Naming what is missing, and the command that installs it.
    """
    missing = [name for name in modules if find_spec(name) is None]
    if missing:
        raise InputError(
            purpose,
            f"expected the Python package {missing[0]}, it is not installed",
            f"pip install 'fronto[{extra}]'",
        )


def counted(number: int, thing: str) -> str:
    """Write a number of things: "1 button", "2 buttons"."""
    return f"{number} {thing}" + ("" if number == 1 else "s")


def say(line: str, *, err: bool = False) -> None:
    """Print one line, whatever is in it, on a terminal of whatever encoding."""
    click.echo(_printable(" ".join(line.split()), err), err=err)


def say_block(text: str) -> None:
    """Print a table or another text of several lines, on a terminal of whatever encoding."""
    click.echo(_printable(text.rstrip("\n"), err=False))


def _printable(text: str, err: bool) -> str:
    encoding = (sys.stderr if err else sys.stdout).encoding or "utf-8"
    return text.encode(encoding, "replace").decode(encoding)
