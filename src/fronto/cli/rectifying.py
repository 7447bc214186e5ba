"""One photo of `fronto rectify`, from its file to the files of its result."""

from __future__ import annotations

import hashlib
import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

import click

from fronto.cli.cameras import CameraSource
from fronto.cli.positions import LengthSource
from fronto.cli.shared import about_photo
from fronto.cli.verdicts import all_unsure, outline_notes, verdict
from fronto.errors import InputError

if TYPE_CHECKING:
    import numpy as np
    import numpy.typing as npt

    from fronto.camera import Camera
    from fronto.engine import Engine
    from fronto.engine.companion import CompanionKind
    from fronto.outlines import Outlines
    from fronto.pose import Template
    from fronto.rectifieroptions import RectifierOptions
    from fronto.results import Panel
    from fronto.segments import Segments
    from fronto.shapes import LineSegment, Outline

__all__ = ["Job", "Outcome", "Settings", "failed"]

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Job:
    """A photo, what its results are named after, its outlines where they are known."""

    photo: Path
    stem: str
    outlines: Path | None = None


class Outcome(NamedTuple):
    """What became of a photo.

    Parameters
    ----------
    line
        To be printed; of a photo that could not be used: what is wrong with it.
    status
        Of the result; None where the photo could not be used.
    record
        The result as a line of JSON.
    """

    line: str
    status: str | None
    record: bytes


@dataclass(frozen=True)
class Settings:
    """All that the results depend on beside the photos; makes what does a `Job`.

    Parameters
    ----------
    output
        Folder for the results.
    weights, threads
        As of `fronto.Engine`.
    options
        Of the stages.
    source
        Where cameras come from.
    solving
        Further arguments of `rectify_outlines`: the solver, and the grid's.
    template_file
        The panel's layout, where it is known.
    length
        What is known in metres.
    template_out
        Where the layout of the panel is written, if anywhere.
    include_unsure
        Use outlines marked unsure as well.
    steps, before_after
        Which further pictures to draw.
    resume
        Whether results that are there already are left as they are.
    """

    output: Path
    weights: Path | None
    threads: int | None
    options: RectifierOptions
    source: CameraSource
    solving: tuple[tuple[str, Any], ...] = ()
    template_file: Path | None = None
    length: LengthSource = field(default_factory=LengthSource)
    template_out: Path | None = None
    include_unsure: bool = False
    steps: bool = False
    before_after: bool = False
    resume: bool = False

    def __call__(self) -> Callable[[Job], Outcome]:
        """What does a job; loads nothing yet."""
        return _Work(self)

    def names(self, stem: str) -> tuple[str, ...]:
        """Name the files of one result."""
        from fronto.panelfile import output_names

        more = [
            f"{stem}.{name}.png"
            for name, on in (("steps", self.steps), ("before_after", self.before_after))
            if on
        ]
        return (*output_names(stem), *more)

    def run(self, outlines: Path | None, depth: Path | None = None) -> str:
        """A digest of what a result depends on beside the photo: other settings, another digest.

        Parameters
        ----------
        outlines
            The photo's; None where the network finds them.
        depth
            The photo's depth image, where there is one.
        """
        from fronto._version import __version__
        from fronto.engine import find_companion, find_weights
        from fronto.labels.name import packaged_reader

        weights = self.weights or find_weights()
        files: list[Path | None] = [outlines or weights]
        if outlines is None:
            beside: tuple[CompanionKind, ...] = ("relations", "verifier", "masks", "edges", "int8")
            files += [find_companion(weights, kind) for kind in beside]
        files += [self.template_file, self.source.file, depth]
        # Categories, and which finds are plates, depend on it, too.
        reads = self.options.read_labels or outlines is None
        reader = packaged_reader(self.threads) if reads else None
        if reader is not None:
            head = reader.engine.context if self.options.read_labels else None
            files += [reader.engine.path, find_companion(reader.engine.path, "int8")]
            files.append(None if head is None else head.path)
        stated = [__version__, self.options, self.source, self.solving, self.include_unsure]
        stated.append(self.length.fields)
        digest = hashlib.sha256(repr(stated).encode())
        for path in files:
            digest.update(b"" if path is None else hashlib.sha256(path.read_bytes()).digest())
        return digest.hexdigest()[:12]


class _Work:
    """Does one job after the other, with one network."""

    def __init__(self, settings: Settings) -> None:
        from fronto.rectifier import Rectifier
        from fronto.templatefile import read_template

        self.settings = settings
        self._network_run = ""
        template = settings.template_file
        self.template = None if template is None else read_template(template)
        self.solving = dict(settings.solving)
        #: What the first look of the latest photo has found.
        self.looked: tuple[Segments | None, Outlines | None] = (None, None)
        self._engine: Engine | None = None
        self.rectifier = Rectifier(
            settings.options,
            template=self.template,
            segment=self._segment,
            outline=self._outline,
            solve=self._solve_found,
            read=self._name,
            threads=settings.threads,
        )

    def __call__(self, job: Job) -> Outcome:
        name = click.format_filename(job.photo.name)
        try:
            resume = self.settings.resume and self.settings.template_out is None
            done = self._done(job) if resume else None
            return done or self._do(job, name)
        except InputError as error:
            return failed(name, str(error))
        except Exception as error:  # a flaw of ours must not cost the other photos
            log.exception("photo %s", job.photo)
            what = f"photo {job.photo}: {type(error).__name__}: {error}"
            return failed(name, f"{what}; a flaw of fronto, please report it with the photo")

    def _do(self, job: Job, name: str) -> Outcome:
        from fronto.imageio import read_image
        from fronto.panelfile import write_panel

        image = read_image(job.photo)
        height, width = image.shape[:2]
        camera = self.settings.source.camera(job.photo, width, height)
        self.looked = (None, None)
        with about_photo(job.photo):
            if job.outlines is None:
                from fronto.images import as_rgb

                image = as_rgb(image)
                panel = self.rectifier.rectify(image, camera)
            else:
                panel = self._given(image, camera, job.outlines, name)
            panel = self.settings.length.fill(panel, job.photo)
        panel = replace(panel, image=name)
        more = self._pictures(image, panel)
        run = self._run(job)
        files = write_panel(panel, image, self.settings.output, job.stem, run=run, pictures=more)
        if self.settings.template_out is not None:
            from fronto.templatewriter import write_template

            known = self.settings.length.known(job.photo)
            write_template(panel, self.settings.template_out, known)
        return Outcome(verdict(panel, files), panel.status, _encoded(files.values))

    def _pictures(self, image: npt.NDArray[Any], panel: Panel) -> dict[str, npt.NDArray[Any]]:
        """Further pictures by the middle of their files' names."""
        from fronto.draw_before_after import draw_before_after
        from fronto.draw_steps import draw_steps
        from fronto.images import as_rgb
        from fronto.outlines import Outlines
        from fronto.segments import Segments

        rgb = as_rgb(image)
        pictures = {}
        if self.settings.steps:
            height, width = rgb.shape[:2]
            segments = self.looked[0] or Segments(width, height, ())
            buttons = tuple(button.outline for button in panel.buttons)
            plates = tuple(plate.outline for plate in panel.plates)
            given = Outlines(width, height, buttons, plates)
            pictures["steps"] = draw_steps(rgb, segments, self.looked[1] or given, panel)
        if self.settings.before_after:
            pictures["before_after"] = draw_before_after(rgb, panel)
        return pictures

    def _run(self, job: Job) -> str:
        depth = self.settings.length.depth_file(job.photo)
        if job.outlines is not None or depth is not None:
            return self.settings.run(job.outlines, depth)
        self._network_run = self._network_run or self.settings.run(None)
        return self._network_run

    def _done(self, job: Job) -> Outcome | None:
        """What is there already, whole, of the same photo and with the same settings."""
        import msgspec

        folder = self.settings.output
        path = folder / f"{job.stem}.json"
        try:
            content = path.read_bytes()
            values = msgspec.json.decode(content)
            newer = path.stat().st_mtime_ns >= job.photo.stat().st_mtime_ns
            status, name = str(values["status"]), str(values["image"])
            same = values["run"] == self._run(job) and name == click.format_filename(job.photo.name)
            without = None if values["rectified"] else f"{job.stem}.rectified.png"
            pictures = [n for n in self.settings.names(job.stem) if n != without]
            whole = all((folder / picture).is_file() for picture in pictures)
        except (OSError, ValueError, KeyError, TypeError, RecursionError):
            return None
        if not (newer and same and whole):
            return None
        return Outcome(f"{name}: {status}, done before -> {path}", status, _encoded(values))

    def _segment(self, photo: npt.NDArray[np.uint8]) -> Segments:
        from fronto.engine import Engine
        from fronto.segmentation import segment

        s = self.settings
        self._engine = self._engine or Engine(s.weights, threads=s.threads)
        segments = segment(
            photo,
            engine=self._engine,
            min_confidence=s.options.min_confidence,
            second_look=s.options.second_look,
        )
        self.looked = (self.looked[0] or segments, self.looked[1])
        return segments

    def _outline(self, segments: Segments, photo: npt.NDArray[np.uint8]) -> Outlines:
        from fronto.outlines import outline

        edges = True if self._engine is None else self._engine.edges or False
        corners = self.settings.options.corners
        found = outline(segments, photo, corners=corners, lines=False, edges=edges)
        self.looked = (self.looked[0], self.looked[1] or found)
        return found

    def _given(self, image: npt.NDArray[Any], camera: Camera, outlines: Path, name: str) -> Panel:
        """Buttons of an outlines file."""
        from fronto.outlinefile import read_outlines
        from fronto.results import Plate
        from fronto.templateplace import with_template

        height, width = image.shape[:2]
        unsure = self.settings.include_unsure
        found = read_outlines(outlines, width, height, include_unsure=unsure)
        lines = found.lines if self.solving["solver"] == "refine" else ()
        panel = self._solved(image, found.outlines, lines, camera, self._layout(found.outlines))
        plates = tuple(Plate(plate, label=plate.text) for plate in found.plates)
        panel = replace(panel, plates=plates)
        if self.settings.options.read_labels:
            panel = self._name(image, panel)
        if self.template is not None and panel.buttons and self._layout(found.outlines) is None:
            panel = with_template(
                panel,
                self.template,
                lambda named: self._solved(image, named, lines, camera, self.template),
            )
        if found.skipped and not found.outlines:
            panel = all_unsure(panel, len(found.skipped))
        unused = len(found.lines) - len(lines)
        notes = outline_notes(found.image, name, len(found.skipped), unused)
        return replace(panel, notes=(*panel.notes, *notes))

    def _name(self, image: npt.NDArray[Any], panel: Panel) -> Panel:
        from fronto.labels.name import name_buttons, packaged_reader

        reader = packaged_reader(self.settings.threads)
        if reader is None:
            return panel
        return name_buttons(panel, image, reader, reader.engine.context)

    def _solve_found(
        self, photo: npt.NDArray[np.uint8], outlines: Outlines, camera: Camera
    ) -> Panel:
        o = self.settings.options
        more: dict[str, Any] = {}
        if self.solving["solver"] == "refine":
            more = {"find_lines": o.lines, "correlation": o.correlation}
        named = any(outline.text for outline in outlines.buttons)
        template = self.template if named else None
        return self._solved(photo, outlines.buttons, outlines.lines, camera, template, **more)

    def _layout(self, outlines: Sequence[Outline]) -> Template | None:
        """The layout, where given outlines tell by themselves which of its buttons they are."""
        if self.template is None or any(outline.text for outline in outlines):
            return self.template
        return None if all(button.label for button in self.template.buttons) else self.template

    def _solved(
        self,
        image: npt.NDArray[Any],
        outlines: Sequence[Outline],
        lines: Sequence[LineSegment],
        camera: Camera,
        template: Template | None = None,
        **more: Any,
    ) -> Panel:
        from fronto.pipeline import rectify_outlines

        o = self.settings.options
        if self.solving["solver"] == "refine":
            more |= {"square": o.square, "aligned": o.aligned, "tolerance": o.tolerance}
        if self.solving.get("translation", "none") != "none":
            more["standard_corners"] = presupposed(outlines, camera)
        return rectify_outlines(
            image,
            outlines,
            camera,
            lines=lines,
            template=template,
            crop=o.crop,
            scale=o.scale,
            margin=o.margin,
            max_pixels=o.max_pixels,
            **self.solving,
            **more,
        )


def failed(name: str, what: str) -> Outcome:
    """Of a photo that could not be used."""
    return Outcome(what, None, _encoded({"schema": "fronto.error/1", "image": name, "error": what}))


def _encoded(values: dict[str, Any]) -> bytes:
    import msgspec

    return msgspec.json.encode(values) + b"\n"


def presupposed(outlines: Sequence[Outline], camera: Camera) -> Any:
    """Find the paper's presupposed corners (Fig. 4) for this many buttons.

    Raises
    ------
    InputError
        If the paper has no panel with so many.
    """
    from fronto.pose.presupposed import presupposed_corners

    count = len(outlines)
    if count not in (2, 3):
        raise InputError(
            "--translation",
            f"expected 2 or 3 buttons as on the paper's panels (Fig. 4), got {count}",
            "leave it out",
        )
    layout: Any = {2: "up_down", 3: "up_down_keyhole"}[count]
    return presupposed_corners(layout, camera.width_px, camera.height_px)
