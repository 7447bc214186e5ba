"""Pictures for people: what was found in a photo, and the photo beside its head-on view.

Drawings show the status loudly: a result that is not "ok" has a frame and a banner in
another colour, so that nobody takes it for a good one.
"""

from __future__ import annotations

import textwrap
from collections.abc import Sequence
from typing import Any

import numpy as np
import numpy.typing as npt

from fronto.drawing import (
    HALO,
    SHIFT,
    Color,
    Picture,
    dot,
    fixed_point,
    polylines,
    rgb_canvas,
    text_size,
    unit_of,
    write_names,
    write_text,
)
from fronto.results import PanelPose, RectifiedView, Status
from fronto.shapes import Outline

__all__ = ["draw_before_after", "draw_overlay"]

X_AXIS: Color = (255, 40, 40)
Y_AXIS: Color = (40, 220, 40)
#: Told apart with deficient colour vision as well (Okabe and Ito 2008, lightened).
PALETTE: tuple[Color, ...] = (
    (86, 180, 233),
    (240, 200, 60),
    (230, 130, 190),
    (60, 200, 160),
    (255, 150, 60),
    (150, 160, 255),
)
STATUS: dict[Status, tuple[Color, str]] = {
    "ok": ((30, 120, 50), "OK"),
    "uncertain": ((190, 105, 0), "UNCERTAIN: a pose, but do not rely on it"),
    "degenerate": ((180, 20, 20), "DEGENERATE: the outlines determine no rotation"),
    "no_buttons": ((180, 20, 20), "NO BUTTONS: nothing to solve"),
}
#: Their rotation is a placeholder: neither axes nor angles may be shown.
UNDETERMINED: tuple[Status, ...] = ("degenerate", "no_buttons")
CHECKER: tuple[int, int] = (150, 190)
GAP_GREY = 230


def draw_overlay(
    image_rgb: npt.NDArray[Any], pose: PanelPose, outlines: Sequence[Outline]
) -> Picture:
    """Draw outlines, the panel's axes and the verdict on a copy of the photo.

    Each outline has its category's colour, its text (else its category) beside it, and dots at
    its corners, the first one large. At the buttons' centroid red points along the panel's
    rows (x) and green down its columns (y), unless the rotation is not determined. Texts are
    ASCII; other signs become "?".

    Parameters
    ----------
    image_rgb
        Shape (h, w, 3), uint8, RGB. Grey (h, w) or (h, w, 1) is drawn on in colour.
    pose
        The pose, of any status.
    outlines
        The outlines in the photo's pixels; may be empty.

    Returns
    -------
    Shape (h, w, 3), uint8, RGB.

    Raises
    ------
    InputError
        If the image is not uint8 with 1 or 3 channels.
    """
    canvas = rgb_canvas(image_rgb)
    unit = unit_of(canvas)
    categories = sorted({outline.category for outline in outlines})
    colors = [PALETTE[categories.index(o.category) % len(PALETTE)] for o in outlines]
    for outline, color in zip(outlines, colors, strict=True):
        _draw_outline(canvas, outline, color, unit)
    names = [outline.text or outline.category for outline in outlines]
    boxes = [outline.box_px for outline in outlines]
    write_names(canvas, names, boxes, colors, unit, gap=4 * unit, first="beside")
    _draw_axes(canvas, pose, unit)
    _draw_frame(canvas, pose, unit)
    _draw_banner(canvas, pose, unit)
    return canvas


def draw_before_after(
    photo: npt.NDArray[Any],
    view: RectifiedView | None,
    pose: PanelPose,
    outlines: Sequence[Outline],
) -> Picture:
    """Draw the photo with its overlay and, to the right, the rectified picture.

    Parameters
    ----------
    photo
        As of :func:`draw_overlay`.
    view
        The head-on view, scaled here to fit the photo's height and width; a checkered
        ground shows where it is transparent. None (where no pose was found) leaves the
        ground empty.
    pose, outlines
        As of :func:`draw_overlay`.

    Returns
    -------
    Shape (h, w', 3), uint8, RGB, of the photo's height.

    Raises
    ------
    InputError
        If the photo is not uint8 with 1 or 3 channels.
    """
    import cv2

    before = draw_overlay(photo, pose, outlines)
    height, width = before.shape[:2]
    unit = unit_of(before)
    if view is None:
        after = _checker(height, width, unit)
    else:
        factor = min(height / view.height_px, width / view.width_px)
        size = (max(1, round(factor * view.width_px)), max(1, round(factor * view.height_px)))
        smooth = cv2.INTER_AREA if factor < 1 else cv2.INTER_LINEAR
        # Premultiplied, so that the transparent part's black does not bleed in.
        scaled = cv2.resize(_premultiplied(view.image), size, interpolation=smooth)
        ground = _checker(height, size[0], unit)
        top = (height - size[1]) // 2
        part = ground[top : top + size[1]].astype(np.float32)
        blended = scaled[..., :3] * 255.0 + part * (1.0 - scaled[..., 3:])
        ground[top : top + size[1]] = np.clip(np.rint(blended), 0, 255).astype(np.uint8)
        after = ground
    gap = np.full((height, max(4, round(8 * unit)), 3), GAP_GREY, np.uint8)
    both: Picture = np.ascontiguousarray(np.concatenate([before, gap, after], axis=1))
    _draw_frame(both, pose, unit)
    return both


def _draw_outline(canvas: Picture, outline: Outline, color: Color, unit: float) -> None:
    width = max(1, round(1.5 * unit))
    if outline.ellipse_px is not None:
        polylines(canvas, [outline.ellipse_px.points(96)], True, color, width)
        dot(canvas, outline.ellipse_px.center, 1.5 * unit, color)
    else:
        assert outline.corners_px is not None
        polylines(canvas, [outline.corners_px], True, color, width)
        for i, corner in enumerate(outline.corners_px):
            dot(canvas, corner, (3.5 if i == 0 else 1.5) * unit, color)


def _draw_axes(canvas: Picture, pose: PanelPose, unit: float) -> None:
    import cv2

    if pose.status in UNDETERMINED:
        return
    quads = pose.plane_corners.reshape(-1, 4, 2)
    if not (len(quads) and np.isfinite(quads).all() and np.isfinite(pose.rotation).all()):
        return
    middle = quads.mean(axis=(0, 1))
    sides = np.roll(quads, -1, axis=1) - quads
    reach = float(np.median(np.hypot(sides[..., 0], sides[..., 1])))
    plane = middle + reach * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])
    ends = pose.camera.project(np.column_stack([plane, np.ones(3)]) @ pose.rotation)
    if not np.isfinite(ends).all():
        return
    start, width = fixed_point(ends[0]), max(1, round(2 * unit))
    for end, color in zip(fixed_point(ends[1:]), (X_AXIS, Y_AXIS), strict=True):
        for stroke, ink in ((width + 2 + width // 2, HALO), (width, color)):
            cv2.arrowedLine(
                canvas,
                (int(start[0]), int(start[1])),
                (int(end[0]), int(end[1])),
                ink,
                stroke,
                cv2.LINE_AA,
                SHIFT,
                0.25,
            )


def _draw_frame(canvas: Picture, pose: PanelPose, unit: float) -> None:
    """Frame the picture in the status' colour, unless it is ok."""
    if pose.status == "ok":
        return
    color, _ = STATUS[pose.status]
    thick = max(1, round(5 * unit))
    for edge in (canvas[:thick], canvas[-thick:], canvas[:, :thick], canvas[:, -thick:]):
        edge[:] = color


def _draw_banner(canvas: Picture, pose: PanelPose, unit: float) -> None:
    color, words = STATUS[pose.status]
    # A line of digits is wider than one of words.
    digits = text_size("0" * 20, unit)[0] / 20
    letters = max(12, int((canvas.shape[1] - 16 * unit) / max(1.0, digits)))
    lines = [words, _rotation_words(pose), *pose.reasons]
    wrapped = [part for line in lines for part in textwrap.wrap(line, letters)]
    pad, step = round(8 * unit), round(16 * unit)
    wide = max(text_size(line, unit)[0] for line in wrapped) + 2 * pad
    box = canvas[: step * len(wrapped) + 2 * pad, :wide]
    # Half-transparent, so that the photo is not lost below.
    box[:] = (0.15 * box + 0.85 * np.array(color)).astype(np.uint8)
    for i, line in enumerate(wrapped):
        write_text(canvas, line, (pad, step * (i + 1) + pad // 2), unit, (255, 255, 255))


def _rotation_words(pose: PanelPose) -> str:
    if pose.status in UNDETERMINED or not np.isfinite(pose.rotation).all():
        return "rotation not determined"
    known = np.isfinite(pose.covariance).all()
    stds = pose.std_deg if known else (np.nan,) * 3
    parts = [
        f"{axis} {angle:+.1f}" + (f" +- {std:.1f}" if np.isfinite(std) else " +- ?")
        for axis, angle, std in zip("xyz", pose.angles_deg, stds, strict=True)
    ]
    return f"rotation {', '.join(parts)} deg"


def _checker(height: int, width: int, unit: float) -> Picture:
    side = max(4, round(8 * unit))
    y, x = np.arange(height)[:, None] // side, np.arange(width)[None] // side
    grey = np.where((x + y) % 2 == 0, *CHECKER).astype(np.uint8)
    return np.repeat(grey[..., None], 3, axis=2)


def _premultiplied(image: npt.NDArray[Any]) -> npt.NDArray[np.float32]:
    """Colour times alpha, and alpha, all 0 to 1, (h, w, 4)."""
    top = 1.0 if image.dtype.kind == "f" else float(np.iinfo(image.dtype).max)
    unit = image.astype(np.float32) / np.float32(top)
    unit[..., :3] *= unit[..., 3:]
    return unit
