"""From a photo, and nothing else, to a head-on view: the order of all stages."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from fronto.camera import Camera
from fronto.cores import usable_cores
from fronto.errors import InputError
from fronto.images import as_rgb
from fronto.labels.name import name_buttons, packaged_reader
from fronto.outlines import Outlines
from fronto.outlines import outline as outline_stage
from fronto.outlines.straight import once_a_photo
from fronto.pipeline import rectify_outlines
from fronto.pose.observations import undistorted
from fronto.rectifieroptions import RectifierOptions
from fronto.relook import better, contradicts, look_again
from fronto.results import Panel, Plate
from fronto.segmentation import segment as segment_stage
from fronto.segments import Segments
from fronto.shapes import Outline
from fronto.templateplace import with_template

if TYPE_CHECKING:
    from PIL import Image

    from fronto.engine import Engine
    from fronto.pose import Template

    Picture = str | Path | Image.Image | npt.NDArray[Any]

__all__ = ["Rectifier", "found_by_itself", "photo_camera", "rectify", "within_lens"]

Photo = npt.NDArray[np.uint8]
CONTRADICTED = "the head-on view, looked at again, tells another rotation"


def photo_camera(image: Picture, width_px: int, height_px: int) -> Camera:
    """The camera that a photo's EXIF data tell of, else `Camera.default`.

    Parameters
    ----------
    image
        A file, a Pillow image, or an array (which has no EXIF data).
    width_px, height_px
        The photo's size, upright.
    """
    found = None if isinstance(image, np.ndarray) else Camera.from_exif(image)
    if found is None or (found.width_px, found.height_px) != (width_px, height_px):
        return Camera.default(width_px, height_px)
    return found


class Rectifier:
    """Segments, outlines, solves and warps one photo after the other.

    Made once and used often; safe to call from several threads.

    Parameters
    ----------
    options
        What the stages are told.
    engine
        Network and threads; None: the packaged weights and all cores.
    camera
        Of all photos, at any of their sizes with the same aspect; None: each photo's own
        (EXIF, else estimated along where the panel shows it).
    template
        The layout of all photos' panel, found on them by its labels; needs `read_labels`.
    segment
        Another way from the photo, (h, w, 3) uint8 RGB, to segments.
    outline
        Another way from segments and photo to outlines.
    solve
        Another way from photo, outlines and camera to the result.
    read
        Another way to name the buttons of a result: from the photo and the result to the result
        with labels.
    threads
        That may work at a time; None: those of the engine, else all cores.

    Examples
    --------
    >>> import fronto, numpy as np
    >>> rectifier = fronto.Rectifier()
    >>> rectifier(np.zeros((480, 640, 3), np.uint8)).status
    'no_buttons'
    """

    def __init__(
        self,
        options: RectifierOptions | None = None,
        *,
        engine: Engine | None = None,
        camera: Camera | None = None,
        template: Template | None = None,
        segment: Callable[[Photo], Segments] | None = None,
        outline: Callable[[Segments, Photo], Outlines] | None = None,
        solve: Callable[[Photo, Outlines, Camera], Panel] | None = None,
        read: Callable[[Photo, Panel], Panel] | None = None,
        threads: int | None = None,
    ) -> None:
        self.options = options or RectifierOptions()
        self.engine = engine
        self.camera = camera
        self.template = template
        self._segment = segment or self._segmented
        self._outline = outline or self._outlined
        self._solve = solve or self._solved
        self._read = read or self._named
        if threads is None:
            threads = usable_cores() if engine is None else engine.threads
        self._ahead = self.options.lines and threads > 1

    def _segmented(self, photo: Photo) -> Segments:
        o = self.options
        return segment_stage(
            photo, engine=self.engine, min_confidence=o.min_confidence, second_look=o.second_look
        )

    def _outlined(self, segments: Segments, photo: Photo) -> Outlines:
        # Lines are looked for when the pose tells where they run.
        edges = True if self.engine is None else self.engine.edges or False
        return outline_stage(
            segments, photo, corners=self.options.corners, lines=False, edges=edges
        )

    def __call__(
        self,
        image: Picture,
        camera: Camera | None = None,
        *,
        image_name: str | None = None,
        order: Literal["rgb", "bgr"] = "rgb",
    ) -> Panel:
        """Rectify one photo.

        Parameters
        ----------
        image
            A file, a Pillow image, or an array as of :func:`fronto.segment`.
        camera
            Of this photo; None: the rectifier's.
        image_name
            For the result; None: the file's name, "" for others.
        order
            Order of an array's channels.

        Returns
        -------
        The result; its `status` says whether to trust it. `timing_ms` has "read", "segment",
        "outline", "pose", "warp", "second_look", "read_labels" and "total".

        Raises
        ------
        InputError
            If the image or the camera cannot be used; never because nothing was found.
        """
        begin = time.perf_counter()
        photo = as_rgb(image, order=order)
        height, width = photo.shape[:2]
        camera = self._camera(image, camera, width, height)
        read = time.perf_counter()
        panel = self.rectify(photo, camera)
        if image_name is None:
            image_name = Path(image).name if isinstance(image, (str, Path)) else ""
        timing = {"read": 1e3 * (read - begin)} | panel.timing_ms
        timing["total"] = 1e3 * (time.perf_counter() - begin)
        return replace(panel, image=image_name, timing_ms=timing)

    def rectify(self, photo: Photo, camera: Camera) -> Panel:
        """All stages, of a photo that is read already.

        Parameters
        ----------
        photo
            Shape (h, w, 3), uint8, RGB.
        camera
            At its size.
        """
        with once_a_photo(photo) as look_for_lines:
            return self._rectified(photo, camera, look_for_lines)

    def _rectified(self, photo: Photo, camera: Camera, look_for_lines: Callable[[], None]) -> Panel:
        begin = time.perf_counter()
        outlines, notes, timing = self.find(photo, look_for_lines if self._ahead else None)
        outlines = within_lens(outlines, camera)
        panel = self._solve(photo, outlines, camera)
        timing |= panel.timing_ms
        panel = found_by_itself(panel, outlines)
        looked = time.perf_counter()
        if self.options.rectified_look:
            panel = self._look_again(photo, panel, outlines, camera)
        named = time.perf_counter()
        if self.options.read_labels:
            panel = self._read(photo, panel)
        if self.template is not None and panel.buttons:
            panel = with_template(
                panel,
                self.template,
                lambda named: self._solve(
                    photo, replace(outlines, buttons=tuple(named), from_image=()), camera
                ),
            )
        end = time.perf_counter()
        timing |= {
            "second_look": 1e3 * (named - looked),
            "read_labels": 1e3 * (end - named),
            "total": 1e3 * (end - begin),
        }
        return replace(panel, notes=(*notes, *panel.notes), timing_ms=timing)

    def _look_again(self, photo: Photo, first: Panel, outlines: Outlines, camera: Camera) -> Panel:
        try:
            again = look_again(photo, first, outlines, self._segment, self._outline)
            if again is None:
                return first
            again = within_lens(again, camera)
            second = self._solve(photo, again, camera)
        except InputError:  # a wrong pose shows nothing that could be looked at
            return first
        if contradicts(second, first):
            return _doubted(first, CONTRADICTED)
        if not better(second, first):
            return first
        return found_by_itself(second, again)

    def find(
        self, photo: Photo, meanwhile: Callable[[], None] | None = None
    ) -> tuple[Outlines, tuple[str, ...], dict[str, float]]:
        """The first two stages: a photo's outlines, remarks on it, and milliseconds.

        Parameters
        ----------
        photo
            Shape (h, w, 3), uint8, RGB.
        meanwhile
            Called between both: begins what can be done beside the second.
        """
        begin = time.perf_counter()
        segments = self._segment(photo)
        if meanwhile is not None and segments.buttons:
            meanwhile()
        segmented = time.perf_counter()
        outlines = self._outline(segments, photo)
        end = time.perf_counter()
        left_out = tuple(f"left out: {reason}" for reason in outlines.left_out)
        timing = {"segment": 1e3 * (segmented - begin), "outline": 1e3 * (end - segmented)}
        return outlines, (*segments.notes, *left_out), timing

    def _solved(self, photo: Photo, outlines: Outlines, camera: Camera) -> Panel:
        o = self.options
        return rectify_outlines(
            photo,
            outlines.buttons,
            camera,
            lines=outlines.lines,
            find_lines=o.lines,
            square=o.square,
            aligned=o.aligned,
            # Found buttons have texts once the layout's are known to be theirs.
            template=self.template if any(b.text for b in outlines.buttons) else None,
            tolerance=o.tolerance,
            correlation=o.correlation,
            crop=o.crop,
            scale=o.scale,
            margin=o.margin,
            max_pixels=o.max_pixels,
        )

    def _named(self, photo: Photo, panel: Panel) -> Panel:
        if not (panel.buttons or panel.plates):
            return panel
        reader = packaged_reader(None if self.engine is None else self.engine.threads)
        if reader is None:
            return panel
        return name_buttons(panel, photo, reader, reader.engine.context)

    def _camera(self, image: Picture, given: Camera | None, width: int, height: int) -> Camera:
        camera = given or self.camera
        if camera is None:
            return photo_camera(image, width, height)
        if (camera.width_px, camera.height_px) != (width, height):
            return camera.scaled_to(width, height)
        return camera


def within_lens(outlines: Outlines, camera: Camera) -> Outlines:
    """Leave out what lies where the camera's lens model does not hold."""
    if not camera.distorted:
        return outlines

    def inside(outline: Outline) -> bool:
        try:
            undistorted([outline], camera)
        except InputError:
            return False
        return True

    out = sum(not inside(button) for button in outlines.buttons)
    note = (f"{out} outlines lie where the lens model does not hold",) if out else ()
    return replace(
        outlines,
        buttons=tuple(filter(inside, outlines.buttons)),
        lines=tuple(
            line
            for line in outlines.lines
            if np.isfinite(camera.undistort_points(line.ends_px)).all()
        ),
        left_out=(*outlines.left_out, *note),
        from_image=(),
    )


def _doubted(panel: Panel, reason: str) -> Panel:
    reasons = (*panel.reasons, reason)
    pose = replace(panel.pose, status="uncertain", reasons=reasons)
    return replace(panel, status="uncertain", reasons=reasons, pose=pose)


def found_by_itself(panel: Panel, outlines: Outlines) -> Panel:
    """A result with what was found beside the buttons, and the right words for none."""
    plates = tuple(Plate(plate, label=plate.text) for plate in outlines.plates)
    panel = replace(panel, plates=plates)
    if outlines.buttons:
        return panel
    reasons = ("no buttons were found in the photo",)
    return replace(panel, reasons=reasons, pose=replace(panel.pose, reasons=reasons))


def rectify(
    image: Picture,
    camera: Camera | None = None,
    *,
    engine: Engine | None = None,
    order: Literal["rgb", "bgr"] = "rgb",
    **options: Any,
) -> Panel:
    """Turn a photo of an elevator button panel into a head-on view.

    Parameters
    ----------
    image
        A file, a Pillow image, or an array as of :func:`fronto.segment`.
    camera
        Where it is calibrated; None: from EXIF data, else estimated along.
    engine
        Network and threads; None: the packaged weights and all cores.
    order
        Order of an array's channels.
    options
        Fields of :class:`fronto.RectifierOptions`.

    Returns
    -------
    The result; its `status` says whether to trust it.

    Raises
    ------
    InputError
        If an argument cannot be used; never because nothing was found.

    Examples
    --------
    >>> import fronto, numpy as np
    >>> fronto.rectify(np.zeros((480, 640, 3), np.uint8)).status
    'no_buttons'
    """
    return Rectifier(RectifierOptions(**options), engine=engine)(image, camera, order=order)
