"""From a photo, and nothing else, to a head-on view: the order of all stages."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from fronto.camera import Camera
from fronto.errors import InputError
from fronto.images import as_rgb
from fronto.outlines import Outlines
from fronto.outlines import outline as outline_stage
from fronto.pipeline import rectify_outlines
from fronto.pose.observations import TOLERANCE
from fronto.results import Panel
from fronto.segmentation import segment as segment_stage
from fronto.segments import Segments
from fronto.tomlfile import read_toml
from fronto.warp import Crop

if TYPE_CHECKING:
    from PIL import Image

    from fronto.engine import Engine

    Picture = str | Path | Image.Image | npt.NDArray[Any]

__all__ = ["Rectifier", "RectifierOptions", "found_by_itself", "photo_camera", "rectify"]

Photo = npt.NDArray[np.uint8]


@dataclass(frozen=True)
class RectifierOptions:
    """What the stages are told; `from_file` reads them from TOML.

    Parameters
    ----------
    min_confidence, second_look
        As of :func:`fronto.segment`.
    corners, lines
        As of :func:`fronto.outline`.
    square, aligned, tolerance
        As of :func:`fronto.estimate_pose`.
    crop, scale, margin, max_pixels
        As of :func:`fronto.warp_panel`.

    Raises
    ------
    InputError
        Naming the field that is out of range.
    """

    min_confidence: float = 0.5
    second_look: bool = True
    corners: Literal["subpixel", "hough"] = "subpixel"
    lines: bool = True
    square: bool = False
    aligned: bool = True
    tolerance: float = TOLERANCE
    crop: Crop = "panel"
    scale: float = 1.0
    margin: float = 0.5
    max_pixels: int = 16_000_000

    def __post_init__(self) -> None:
        if not 0 <= self.min_confidence <= 1:
            raise InputError("min_confidence", f"expected 0 to 1, got {self.min_confidence}")
        if self.corners not in ("subpixel", "hough"):
            raise InputError("corners", f'expected "subpixel" or "hough", got {self.corners!r}')
        if self.crop not in ("panel", "full", "input"):
            raise InputError("crop", f'expected "panel", "full" or "input", got {self.crop!r}')
        for name, least in (("tolerance", 0.0), ("margin", 0.0)):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= least):
                raise InputError(name, f"expected {least:g} or more, got {value}")
        if not (np.isfinite(self.scale) and self.scale > 0):
            raise InputError("scale", f"expected a number above 0, got {self.scale}")
        if self.max_pixels < 1:
            raise InputError("max_pixels", f"expected 1 or more, got {self.max_pixels}")

    @classmethod
    def from_file(cls, path: str | Path) -> RectifierOptions:
        """Read options from a TOML file; what it leaves out has its default.

        Raises
        ------
        InputError
            Naming the file and the field.
        """
        return read_toml(Path(path), cls)


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
    segment
        Another way from the photo, (h, w, 3) uint8 RGB, to segments.
    outline
        Another way from segments and photo to outlines.

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
        segment: Callable[[Photo], Segments] | None = None,
        outline: Callable[[Segments, Photo], Outlines] | None = None,
    ) -> None:
        self.options = options or RectifierOptions()
        self.engine = engine
        self.camera = camera
        self._segment = segment or self._segmented
        self._outline = outline or self._outlined

    def _segmented(self, photo: Photo) -> Segments:
        o = self.options
        return segment_stage(
            photo, engine=self.engine, min_confidence=o.min_confidence, second_look=o.second_look
        )

    def _outlined(self, segments: Segments, photo: Photo) -> Outlines:
        return outline_stage(
            segments, photo, corners=self.options.corners, lines=self.options.lines
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
        "outline", "pose", "warp" and "total".

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
        outlines, notes, timing = self.find(photo)
        if image_name is None:
            image_name = Path(image).name if isinstance(image, (str, Path)) else ""
        panel = self.solve(photo, outlines, camera, image_name=image_name)
        end = time.perf_counter()
        timing = {"read": 1e3 * (read - begin)} | timing | panel.timing_ms
        timing["total"] = 1e3 * (end - begin)
        return replace(panel, notes=(*notes, *panel.notes), timing_ms=timing)

    def find(self, photo: Photo) -> tuple[Outlines, tuple[str, ...], dict[str, float]]:
        """The first two stages: a photo's outlines, remarks on it, and milliseconds.

        Parameters
        ----------
        photo
            Shape (h, w, 3), uint8, RGB.
        """
        begin = time.perf_counter()
        segments = self._segment(photo)
        segmented = time.perf_counter()
        outlines = self._outline(segments, photo)
        end = time.perf_counter()
        left_out = tuple(f"left out: {reason}" for reason in outlines.left_out)
        timing = {"segment": 1e3 * (segmented - begin), "outline": 1e3 * (end - segmented)}
        return outlines, (*segments.notes, *left_out), timing

    def solve(
        self, photo: Photo, outlines: Outlines, camera: Camera, *, image_name: str = ""
    ) -> Panel:
        """The last two stages: pose and head-on view from outlines."""
        o = self.options
        panel = rectify_outlines(
            photo,
            outlines.buttons,
            camera,
            image_name=image_name,
            lines=outlines.lines,
            square=o.square,
            aligned=o.aligned,
            tolerance=o.tolerance,
            crop=o.crop,
            scale=o.scale,
            margin=o.margin,
            max_pixels=o.max_pixels,
        )
        return found_by_itself(panel, outlines)

    def _camera(self, image: Picture, given: Camera | None, width: int, height: int) -> Camera:
        camera = given or self.camera
        if camera is None:
            return photo_camera(image, width, height)
        if (camera.width_px, camera.height_px) != (width, height):
            return camera.scaled_to(width, height)
        return camera


def found_by_itself(panel: Panel, outlines: Outlines) -> Panel:
    """A result with what was found beside the buttons, and the right words for none."""
    panel = replace(panel, plates=outlines.plates)
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
