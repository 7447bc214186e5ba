"""What the commands have in common: option types, exit codes, printing, and output folders."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterable, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import click

from fronto.errors import InputError

__all__ = [
    "BAD_INPUT",
    "FILE",
    "NOT_OK",
    "POSITIVE",
    "SOME_FAILED",
    "FiniteRange",
    "check_outputs",
    "counted",
    "require",
    "say",
    "say_block",
]

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


def check_outputs(
    photos: Sequence[Path],
    output: Path,
    names: Callable[[str], Iterable[str]],
    inputs: Iterable[Path],
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

    Raises
    ------
    InputError
        If the folder is a file, two photos have one stem, or an input lies where a result
        is to go.
    """
    if output.exists() and not output.is_dir():
        raise InputError(f"--output {output}", "expected a folder, got a file", "choose another")
    kept = {path.resolve() for path in inputs}
    seen: dict[str, Path] = {}
    for photo in photos:
        # Some file systems do not tell upper from lower case.
        other = seen.setdefault(photo.stem.casefold(), photo)
        if other is not photo:
            raise InputError(
                f"photos {other} and {photo}",
                "expected different stems, got one name for both results",
                "rename one, or use another folder for it",
            )
        for name in names(photo.stem):
            if (output / name).resolve() in kept:
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
