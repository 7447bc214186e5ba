"""The order of the stages: outlines -> pose -> head-on picture -> buttons in both pictures."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from fronto.camera import Camera
from fronto.errors import InputError
from fronto.images import as_rgb
from fronto.outlines.straight import straight_segments
from fronto.pose import Template, estimate_pose
from fronto.pose.guided import with_frame, with_lines
from fronto.pose.observations import TOLERANCE
from fronto.results import Button, Panel, PanelPose, RectifiedView
from fronto.shapes import Ellipse, FloatArray, LineSegment, Outline
from fronto.warp import Crop, map_ellipse, map_points, warp_panel

__all__ = ["crossings", "rectify_outlines"]

#: A change of the asked scale that needs no note.
SCALE_KEPT = 0.01


def rectify_outlines(
    image: npt.NDArray[Any],
    outlines: Sequence[Outline],
    camera: Camera | None = None,
    *,
    image_name: str = "",
    solver: Literal["refine", "grid"] = "refine",
    crop: Crop = "panel",
    lines: Sequence[LineSegment] = (),
    find_lines: bool = False,
    square: bool = False,
    aligned: bool = True,
    template: Template | None = None,
    tolerance: float = TOLERANCE,
    correlation: float = 0.0,
    scale: float = 1.0,
    margin: float = 0.5,
    max_pixels: int = 16_000_000,
    **grid: Any,
) -> Panel:
    """Turn a photo of a panel into a head-on view, from the outlines of its buttons.

    Parameters
    ----------
    image
        The photo: shape (h, w), (h, w, 1), (h, w, 3) RGB or (h, w, 4) RGBA; uint8, uint16
        or float32.
    outlines
        Of the buttons, in the photo's pixels as it is (lens distortion and all).
    camera
        At the photo's size; None: ``Camera.default``, whose focal length is estimated
        along where the panel shows it.
    image_name
        The photo's file name, for the result.
    solver, lines, square, aligned, template, tolerance, correlation, grid
        As of :func:`fronto.estimate_pose`.
    find_lines
        Look in the photo for more lines that agree with the buttons, and solve with them
        ("refine" only).
    crop, scale, margin, max_pixels
        As of :func:`fronto.warp_panel`.

    Returns
    -------
    The result. Its `view` is there for the status "ok" and "uncertain" only: without a
    rotation a head-on picture would be invented. `timing_ms` has "pose", "warp" and
    "total". `notes` say where the picture had to be smaller than `scale` asks.

    Raises
    ------
    InputError
        If image, outlines, camera or an argument cannot be used; never because the
        outlines determine no rotation, which is a status.

    Examples
    --------
    >>> import fronto, numpy as np
    >>> photo = np.zeros((480, 640, 3), np.uint8)
    >>> panel = fronto.rectify_outlines(photo, [])
    >>> panel.status, panel.view
    ('no_buttons', None)
    """
    begin = time.perf_counter()
    width, height = _size(image)
    if camera is None:
        camera = Camera.default(width, height)
    elif (camera.width_px, camera.height_px) != (width, height):
        raise InputError(
            "camera",
            f"expected one for the photo's size {width}x{height}, "
            f"got {camera.width_px}x{camera.height_px}",
            f"use camera.scaled_to({width}, {height}) if the photo was only resized",
        )

    def solve(more: Sequence[LineSegment]) -> PanelPose:
        return estimate_pose(
            outlines,
            camera,
            solver=solver,
            lines=[*lines, *more],
            square=square,
            aligned=aligned,
            template=template,
            tolerance=tolerance,
            correlation=correlation,
            **grid,
        )

    pose = solve(())
    if find_lines and solver == "refine" and pose.status != "no_buttons":
        ends, std_px = straight_segments(as_rgb(image))
        pose = with_lines(pose, outlines, ends, std_px, solve)
        pose = with_frame(pose, outlines, ends, std_px, solve)
    posed = time.perf_counter()
    view = None
    if pose.status in ("ok", "uncertain"):
        options = {"crop": crop, "scale": scale, "margin": margin, "max_pixels": max_pixels}
        pose, view = _view(image, pose, options)
    warped = time.perf_counter()
    buttons = _buttons(outlines, pose, view)
    notes = () if view is None else _scale_notes(view, scale)
    end = time.perf_counter()
    return Panel(
        image=image_name,
        width_px=width,
        height_px=height,
        status=pose.status,
        reasons=pose.reasons,
        pose=pose,
        buttons=buttons,
        view=view,
        timing_ms={
            "pose": 1e3 * (posed - begin),
            "warp": 1e3 * (warped - posed),
            "total": 1e3 * (end - begin),
        },
        notes=notes,
    )


def _size(image: npt.NDArray[Any]) -> tuple[int, int]:
    if not isinstance(image, np.ndarray) or image.ndim not in (2, 3) or image.size == 0:
        found = image.shape if isinstance(image, np.ndarray) else type(image).__name__
        raise InputError(
            "image", f"expected an array of shape (h, w) or (h, w, channels), got {found}"
        )
    return int(image.shape[1]), int(image.shape[0])


def _view(
    image: npt.NDArray[Any], pose: PanelPose, options: dict[str, Any]
) -> tuple[PanelPose, RectifiedView | None]:
    """Warp with the pose's camera; a pose that allows no picture is not ok any more."""
    try:
        return pose, warp_panel(image, pose.camera, pose, **options)
    except InputError as error:
        # Only an argument is the caller's mistake; an edge-on panel is an outcome.
        if error.thing != "pose":
            raise
        reason = f"no head-on picture: {error.expected}"
        return replace(pose, status="uncertain", reasons=(*pose.reasons, reason)), None


def _scale_notes(view: RectifiedView, scale: float) -> tuple[str, ...]:
    if abs(view.scale / scale - 1) <= SCALE_KEPT:
        return ()
    size = f"{view.width_px}x{view.height_px} px"
    factors = f"{view.scale:.3g} times the photo's scale instead of {scale:g}"
    return (f"the picture was scaled down to {size}, {factors}",)


def _buttons(
    outlines: Sequence[Outline], pose: PanelPose, view: RectifiedView | None
) -> tuple[Button, ...]:
    quads = [k for k, outline in enumerate(outlines) if outline.corners_px is not None]
    corners: dict[int, FloatArray] = {}
    centers: dict[int, FloatArray] = {}
    ellipses: dict[int, Ellipse] = {}
    if view is not None:
        if quads:
            given = np.concatenate([outlines[k].corners_px for k in quads])
            rectified = map_points(view, given).reshape(-1, 4, 2)
            corners = dict(zip(quads, rectified, strict=True))
            centers = dict(zip(quads, crossings(rectified), strict=True))
        for k, outline in enumerate(outlines):
            ellipse = None if outline.ellipse_px is None else _mapped(view, outline.ellipse_px)
            if ellipse is not None:
                ellipses[k], centers[k] = ellipse, ellipse.center
    for array in (*corners.values(), *centers.values()):
        array.setflags(write=False)
    return tuple(
        Button(
            id=k,
            outline=outline,
            rectified_corners_px=corners.get(k),
            rectified_center_px=centers.get(k),
            residual_px=float(pose.residual_px[k]),
            weight=float(pose.weight[k]),
            rectified_ellipse_px=ellipses.get(k),
            label=outline.text,
        )
        for k, outline in enumerate(outlines)
    )


def crossings(quads: FloatArray) -> FloatArray:
    """Where the diagonals of quads (n, 4, 2) cross, (n, 2)."""
    first, second = quads[:, 2] - quads[:, 0], quads[:, 3] - quads[:, 1]
    side = quads[:, 1] - quads[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        along = (side[:, 0] * second[:, 1] - side[:, 1] * second[:, 0]) / (
            first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]
        )
        return np.asarray(quads[:, 0] + along[:, None] * first)


def _mapped(view: RectifiedView, ellipse: Ellipse) -> Ellipse | None:
    try:
        return map_ellipse(view, ellipse)
    except InputError:  # it reaches the panel's horizon, or leaves the lens model
        return None
