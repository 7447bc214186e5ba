"""Videos and cameras of `fronto rectify`: a steady head-on video, and a line of JSON a frame."""

from __future__ import annotations

import contextlib
import logging
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING

import click

from fronto.cli.batches import Counts, JsonLines
from fronto.cli.rectifying import Settings
from fronto.cli.shared import check_outputs, counted, say
from fronto.errors import InputError

if TYPE_CHECKING:
    from fronto.camera import Camera
    from fronto.engine import Engine
    from fronto.video import Frame

__all__ = ["VideoJob", "run_videos"]

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class VideoJob:
    """A video file or the index of a camera, and what its results are named after."""

    source: Path | int
    stem: str

    @property
    def name(self) -> str:
        """For messages."""
        if isinstance(self.source, int):
            return f"camera {self.source}"
        return click.format_filename(self.source.name)


def run_videos(
    jobs: Sequence[VideoJob], settings: Settings, *, every: int, frames: int | None, quiet: bool
) -> Counts:
    """Rectify videos one after the other, print a line for each.

    Ctrl-C ends the video that is being read; what has come of it so far is kept.

    Parameters
    ----------
    jobs
        The videos.
    settings
        What the results depend on.
    every
        Take every Nth frame.
    frames
        Stop after so many; None: at the end.
    quiet
        Print errors only.

    Raises
    ------
    InputError
        If results would overwrite each other or a video; of one video that cannot be used it
        is told, and the others are taken.
    """
    if not jobs:
        return Counts()
    from fronto.engine import Engine
    from fronto.files import make_folder

    sources = [Path(job.name if isinstance(job.source, int) else job.source) for job in jobs]
    check_outputs(sources, settings.output, _names, sources, [job.stem for job in jobs])
    engine = Engine(settings.weights, threads=settings.threads)
    make_folder(settings.output)
    counts = Counts()
    for job in jobs:
        try:
            line, ok = _run(job, settings, engine, every, frames)
        except InputError as error:
            say(f"Error: {error}", err=True)
            counts += Counts(1, 1, 0)
            continue
        except Exception as error:  # a flaw of ours must not cost the other videos
            log.exception("video %s", job.source)
            what = f"video {job.source}: {type(error).__name__}: {error}"
            say(f"Error: {what}; a flaw of fronto, please report it with the video", err=True)
            counts += Counts(1, 1, 0)
            continue
        counts += Counts(1, 0, not ok)
        if not quiet:
            say(line)
    return counts


def _names(stem: str) -> tuple[str, str]:
    return f"{stem}.rectified.mp4", f"{stem}.jsonl"


def _run(
    job: VideoJob, settings: Settings, engine: Engine, every: int, most: int | None
) -> tuple[str, bool]:
    """The line to print, and whether all frames were tracked."""
    import msgspec

    from fronto.rectifier import Rectifier
    from fronto.video import VideoRectifier, VideoWriter, frames, video_record
    from fronto.videoreader import RATES_HZ

    output, records = (settings.output / name for name in _names(job.stem))
    stream = frames(job.source, every=every)
    first = next(stream)
    # A video's frames confirm each other: one look at each is enough.
    options = replace(settings.options, rectified_look=False)
    rectifier = Rectifier(options, engine=engine, camera=_camera(settings, first))
    smooth = VideoRectifier(rectifier)
    seen: Counter[str] = Counter()
    with (
        JsonLines(records) as lines,
        VideoWriter(output, max(first.rate_hz, RATES_HZ[0])) as writer,
        contextlib.suppress(KeyboardInterrupt),
    ):
        for frame in islice(_with_first(first, stream), most):
            result = smooth(frame)
            lines.write(msgspec.json.encode(video_record(result)) + b"\n")
            writer.write(result.picture)
            seen[result.track.status] += 1
    states = ", ".join(f"{count} {status}" for status, count in seen.most_common())
    what = f"{job.name}: {counted(sum(seen.values()), 'frame')} ({states})"
    if not output.exists() or not seen["tracked"]:
        why = f"no frame with status ok to begin with: see the reasons in {records}"
        return f"{what}, {why}; --camera or --hfov helps most", False
    return f"{what} -> {click.format_filename(output)}", seen["tracked"] == sum(seen.values())


def _with_first(first: Frame, others: Iterator[Frame]) -> Iterator[Frame]:
    yield first
    yield from others


def _camera(settings: Settings, frame: Frame) -> Camera | None:
    """The camera that was given, at the video's size."""
    source = settings.source
    if source.file is None and source.hfov_deg is None and source.focal_px is None:
        return None
    height, width = frame.image.shape[:2]
    return source.camera(Path(), width, height)
