"""Many photos of `fronto rectify`: over processes, with a bar, into one file of JSON Lines."""

from __future__ import annotations

import contextlib
import os
import sys
from collections.abc import Iterator, Sequence
from dataclasses import replace
from errno import EISDIR
from pathlib import Path
from types import TracebackType
from typing import IO, NamedTuple

import click

from fronto.batch import Crashed, in_order
from fronto.cli.rectifying import Job, Outcome, Settings, failed
from fronto.cli.shared import say
from fronto.errors import InputError
from fronto.files import make_folder, part_of, writing

__all__ = ["Bar", "Counts", "JsonLines", "run_photos"]


class Counts(NamedTuple):
    """Of inputs: all, those that could not be used, those whose result is not ok."""

    all: int = 0
    failed: int = 0
    not_ok: int = 0

    def __add__(self, other: object) -> Counts:
        assert isinstance(other, Counts)
        return Counts(*(a + b for a, b in zip(self, other, strict=True)))


def run_photos(
    jobs: Sequence[Job], settings: Settings, processes: int, jsonl: Path | None, *, quiet: bool
) -> Counts:
    """Rectify photos, print a line for each, in their order.

    Parameters
    ----------
    jobs
        The photos.
    settings
        What all results depend on.
    processes
        How many photos are worked on at a time.
    jsonl
        File for all results, one a line; None: none.
    quiet
        Print errors only.
    """
    if not jobs:
        return Counts()
    if jsonl is not None:
        _check_jsonl(jsonl, jobs, settings)
    if processes > 1 and settings.threads is None:
        from fronto.cores import usable_cores

        # Each process its share of the cores.
        settings = replace(settings, threads=max(1, usable_cores() // processes))
    counts = Counts()
    with JsonLines(jsonl) as lines, Bar(len(jobs)) as bar:
        for job, result in in_order(jobs, settings, min(processes, len(jobs))):
            outcome = _crashed(job) if isinstance(result, Crashed) else result
            lines.write(outcome.record)
            bad = outcome.status is None
            with bar.aside():
                if bad:
                    say(f"Error: {outcome.line}", err=True)
                elif not quiet:
                    say(outcome.line)
            counts += Counts(1, bad, not bad and outcome.status != "ok")
    return counts


def _check_jsonl(jsonl: Path, jobs: Sequence[Job], settings: Settings) -> None:
    """Refuse a file that is an input, or that a result is written to.

    Raises
    ------
    InputError
        Naming it.
    """
    kept = [settings.weights, settings.template_file, settings.source.file]
    for job in jobs:
        kept += [job.photo, job.outlines]
        kept += [settings.output / name for name in settings.names(job.stem)]
    # realpath, unlike Path.resolve, takes any name: a bad photo is told of when it is read.
    if os.path.realpath(jsonl) in {os.path.realpath(path) for path in kept if path is not None}:
        raise InputError(
            f"--jsonl {jsonl}",
            "expected a file of its own, got an input or the result of one photo",
            "choose another name",
        )


def _crashed(job: Job) -> Outcome:
    name = click.format_filename(job.photo.name)
    what = InputError(
        f"photo {job.photo}",
        "expected to finish, but its process was ended by the system (out of memory?)",
        "give fewer --jobs, or scale the photo down",
    )
    return failed(name, str(what))


class JsonLines:
    """A file of lines that appears in one piece at the end, of an interrupted run as well."""

    def __init__(self, path: Path | None, thing: str = "--jsonl") -> None:
        self.path = path
        self.thing = thing
        self.part = Path()
        self.file: IO[bytes] | None = None

    def __enter__(self) -> JsonLines:
        if self.path is not None:
            make_folder(self.path.parent)
            with writing(self.path, self.thing):
                if os.path.isdir(self.path):  # noqa: PTH112, Path.is_dir raises for some names
                    raise IsADirectoryError(EISDIR, os.strerror(EISDIR))
                self.part = part_of(self.path)
                self.file = self.part.open("xb")
        return self

    def write(self, line: bytes) -> None:
        """Add a line."""
        if self.path is not None and self.file is not None:
            with writing(self.path, self.thing):
                self.file.write(line)

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self.path is None or self.file is None:
            return
        with writing(self.path, self.thing):
            try:
                self.file.close()
                self.part.replace(self.path)
            except OSError:
                with contextlib.suppress(OSError):
                    self.part.unlink(missing_ok=True)
                raise


class Bar:
    """A progress bar on standard error, where that is a terminal and there are several photos."""

    def __init__(self, length: int) -> None:
        show = length > 1 and sys.stderr.isatty()
        self.bar = click.progressbar(length=length, file=sys.stderr) if show else None

    def __enter__(self) -> Bar:
        if self.bar is not None:
            self.bar.__enter__()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self.bar is not None:
            self.bar.__exit__(kind, error, trace)

    @contextlib.contextmanager
    def aside(self) -> Iterator[None]:
        """Print lines above the bar, and go on by one."""
        if self.bar is None:
            yield
            return
        click.echo("\r\033[K", nl=False, file=sys.stderr)
        yield
        self.bar.update(1)
        self.bar.render_progress()
