"""A panel in a video: its pose smoothed over the frames, and one steady head-on picture."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from fronto.camera import Camera
from fronto.errors import InputError
from fronto.panelfile import panel_to_dict
from fronto.pipeline import crossings
from fronto.pose.verdict import FOCAL_OBSERVABLE
from fronto.rectifier import Rectifier
from fronto.results import Button, Panel, PanelPose, RectifiedView
from fronto.shapes import Ellipse, FloatArray
from fronto.tracking import RotationFilter, TrackedRotation
from fronto.videocanvas import SteadyCanvas, seen_with
from fronto.videodraw import video_picture
from fronto.videoreader import Frame, frames
from fronto.videowriter import VideoWriter
from fronto.warp import map_ellipse, map_points
from fronto.warp.canvas import Canvas
from fronto.warp.resample import resample

__all__ = [
    "Frame",
    "VideoRectifier",
    "VideoResult",
    "VideoWriter",
    "frames",
    "video_record",
]

Picture = npt.NDArray[np.uint8]

SCHEMA = "fronto.video/1"
#: Frames of one panel share their errors: the focal length never counts as known better
#: (standard deviation of ln f).
FOCAL_STD_FLOOR = 0.02


@dataclass(frozen=True, eq=False)
class VideoResult:
    """One frame's result.

    Parameters
    ----------
    number, time_s
        As of the :class:`Frame`.
    panel
        `status`, `reasons` and `pose` are of this frame alone. `view`, and the buttons'
        positions in it (`rectified_corners_px` and the like), are drawn with the rotation of
        `track`, and are None while that is lost or before the first canvas.
    track
        The rotation as all frames up to now have it.
    picture
        Shape (h, w, 3), uint8, RGB: the `view` on a grey ground, or the empty ground; with a
        frame and words in the status' colour unless this frame is tracked. Of one size with
        even sides in all frames; None before the first canvas.
    """

    number: int
    time_s: float
    panel: Panel
    track: TrackedRotation
    picture: Picture | None

    def __post_init__(self) -> None:
        if self.picture is not None:
            self.picture.setflags(write=False)


class VideoRectifier:
    """Rectifies the frames of one video, in their order.

    The rotation is filtered over the frames, and the picture stays on one canvas: the one
    of the first frame whose pose is ok, as the rectifier's options plan it; later frames are
    scaled and shifted such that the buttons stay where they were.

    Where the focal length is not known, each frame's estimate starts from that of the
    earlier ones that were ok and tracked (which makes it their mean, weighted by inverse
    variance), but never counted as known better than 2 %; so zooming is not followed.
    Not to be shared by threads.

    Parameters
    ----------
    rectifier
        Finds and solves each frame; its options' `crop`, `scale`, `margin` and `max_pixels`
        hold for the canvas. None: one with its defaults.
    rotation_filter
        A new filter, where other options than its defaults are wanted.

    Examples
    --------
    >>> from fronto.video import VideoRectifier, VideoWriter, frames
    >>> def convert(source, target):
    ...     rectifier = VideoRectifier()
    ...     with VideoWriter(target) as writer:
    ...         for frame in frames(source):
    ...             writer.write(rectifier(frame).picture)
    """

    def __init__(
        self,
        rectifier: Rectifier | None = None,
        *,
        rotation_filter: RotationFilter | None = None,
    ) -> None:
        self.rectifier = rectifier or Rectifier()
        self._filter = rotation_filter or RotationFilter()
        o = self.rectifier.options
        self._canvas = SteadyCanvas(
            crop=o.crop, scale=o.scale, margin=o.margin, max_pixels=o.max_pixels
        )
        self._size: tuple[int, int] | None = None
        #: With what earlier frames told about the focal length; None: nothing yet.
        self._camera: Camera | None = None

    def __call__(self, frame: Frame) -> VideoResult:
        """Rectify the next frame.

        Raises
        ------
        InputError
            If the frame is of another size than the first, or earlier than the last; or as
            of :class:`fronto.Rectifier`. Never because nothing was found.
        """
        size = (frame.image.shape[1], frame.image.shape[0])
        if self._size not in (None, size):
            assert self._size is not None
            raise InputError(
                f"frame {frame.number}",
                f"expected {self._size[0]}x{self._size[1]} pixels as the first, "
                f"got {size[0]}x{size[1]}",
                "give each video a VideoRectifier of its own",
            )
        panel = self.rectifier(frame.image, self._camera)
        self._size = size
        begin = time.perf_counter()
        track = self._filter.update(panel.pose, frame.time_s)
        self._learn_focal(panel.pose, track)
        view, notes = self._view(frame.image, panel.pose, track)
        buttons = tuple(_in_view(button, view) for button in panel.buttons)
        picture = None
        if self._canvas.size_px is not None:
            picture = video_picture(view, track, self._canvas.size_px, notes)
        spent = 1e3 * (time.perf_counter() - begin)
        timing = panel.timing_ms | {
            "track": spent,
            "total": panel.timing_ms.get("total", 0.0) + spent,
        }
        panel = replace(
            panel, view=view, buttons=buttons, notes=(*panel.notes, *notes), timing_ms=timing
        )
        return VideoResult(frame.number, frame.time_s, panel, track, picture)

    def _learn_focal(self, pose: PanelPose, track: TrackedRotation) -> None:
        camera = pose.camera
        if not (pose.status == "ok" and track.status == "tracked" and camera.focal_std > 0):
            return
        std = max(camera.focal_std, FOCAL_STD_FLOOR)
        # No single frame may have told it, but all together do.
        told = camera.source == "default" and std <= FOCAL_OBSERVABLE
        source = "estimated" if told else camera.source
        self._camera = camera.with_focal(camera.focal_px, std, source)

    def _view(
        self, image: Picture, pose: PanelPose, track: TrackedRotation
    ) -> tuple[RectifiedView | None, tuple[str, ...]]:
        """The frame drawn with the tracked rotation, and why not where it cannot be."""
        if track.status == "lost":
            return None, ()
        camera = self._camera or pose.camera
        smooth = seen_with(pose, camera, track.rotation)
        may_start = pose.status == "ok" and track.status == "tracked"
        try:
            canvas = self._canvas.plan(camera, smooth, may_start=may_start)
        except InputError as error:
            if error.thing != "pose":  # an argument, which is the caller's mistake
                raise
            return None, (f"no head-on picture: {error.expected}",)
        if canvas is None:
            return None, ()
        return _drawn(image, camera, canvas, self.rectifier.options.crop), ()


def video_record(result: VideoResult) -> dict[str, Any]:
    """Plain values of one frame's result, a line of JSON Lines.

    Returns
    -------
    `status` and `reasons` are of this frame alone; `track` has the rotation, null while
    lost; `homography`, `rectified` and the buttons' rectified positions belong to that
    rotation. The rest is as of `Panel.to_dict`; all values are lists, dicts, strings,
    finite numbers, booleans and None.
    """
    panel = panel_to_dict(result.panel)
    track = result.track
    known = track.status != "lost"
    return {
        "schema": SCHEMA,
        "frame": result.number,
        "time_s": result.time_s,
        "width_px": panel["width_px"],
        "height_px": panel["height_px"],
        "status": panel["status"],
        "reasons": panel["reasons"],
        "notes": panel["notes"],
        "track": {
            "status": track.status,
            "reasons": list(track.reasons),
            "age_s": _number(track.age_s),
            "rotation": track.rotation.tolist() if known else None,
            "covariance_rad2": track.covariance.tolist() if known else None,
            "angles_deg": list(track.angles_deg) if known else None,
            "std_deg": [_number(std) for std in track.std_deg] if known else [None] * 3,
        },
        **_picked(panel, ("camera", "homography", "homography_domain", "rectified")),
        **_picked(panel, ("buttons", "plates", "timing_ms")),
    }


def _picked(values: Mapping[str, Any], names: tuple[str, ...]) -> dict[str, Any]:
    return {name: values[name] for name in names}


def _number(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def _drawn(image: Picture, camera: Camera, canvas: Canvas, crop: str) -> RectifiedView:
    warped, inside = resample(image, camera, canvas, "auto")
    picture = np.empty((canvas.height_px, canvas.width_px, 4), np.uint8)
    picture[..., :3] = warped
    picture[..., 3] = 255
    picture[~inside] = 0
    picture.setflags(write=False)
    matrix = canvas.homography / np.linalg.norm(canvas.homography)
    return RectifiedView(picture, matrix, camera, crop, canvas.scale)


def _in_view(button: Button, view: RectifiedView | None) -> Button:
    """The button with its positions in this view."""
    corners: FloatArray | None = None
    center: FloatArray | None = None
    ellipse: Ellipse | None = None
    outline = button.outline
    if view is not None and outline.corners_px is not None:
        corners = map_points(view, outline.corners_px)
        center = crossings(corners[None])[0]
    elif view is not None and outline.ellipse_px is not None:
        try:
            ellipse = map_ellipse(view, outline.ellipse_px)
            center = ellipse.center
        except InputError:  # it reaches the panel's horizon, or leaves the lens model
            pass
    for array in (corners, center):
        if array is not None:
            array.setflags(write=False)
    return replace(
        button,
        rectified_corners_px=corners,
        rectified_center_px=center,
        rectified_ellipse_px=ellipse,
    )
