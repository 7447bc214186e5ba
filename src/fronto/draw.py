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

from fronto.errors import InputError
from fronto.results import PanelPose, RectifiedView, Status
from fronto.shapes import FloatArray, Outline

__all__ = ["draw_before_after", "draw_overlay"]

Picture = npt.NDArray[np.uint8]
Color = tuple[int, int, int]

HALO: Color = (20, 20, 20)
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
#: Letters' size for a 640 px wide photo, in cv2's measure.
FONT = 0.45
#: Sub-pixel bits of cv2's drawing functions.
SHIFT = 4
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
    canvas = _rgb(image_rgb)
    unit = _unit(canvas)
    categories = sorted({outline.category for outline in outlines})
    colors = [PALETTE[categories.index(o.category) % len(PALETTE)] for o in outlines]
    for outline, color in zip(outlines, colors, strict=True):
        _draw_outline(canvas, outline, color, unit)
    _draw_names(canvas, outlines, colors, unit)
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
    unit = _unit(before)
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


def _rgb(image: npt.NDArray[Any]) -> Picture:
    """Copy the image as (h, w, 3), contiguous."""
    if not isinstance(image, np.ndarray) or image.dtype != np.uint8:
        found = image.dtype if isinstance(image, np.ndarray) else type(image).__name__
        raise InputError("image", f"expected an array of uint8, got {found}")
    pixels = image[:, :, None] if image.ndim == 2 else image
    if pixels.ndim != 3 or pixels.shape[2] not in (1, 3) or pixels.size == 0:
        raise InputError(
            "image",
            f"expected shape (h, w, 3), (h, w, 1) or (h, w), got {image.shape}",
            "drop the alpha channel",
        )
    canvas = np.empty((*pixels.shape[:2], 3), np.uint8)
    canvas[:] = pixels
    return canvas


def _unit(canvas: Picture) -> float:
    """What a pixel of a 640 px wide photo is here."""
    return max(1.0, float(max(canvas.shape[:2])) / 640)


def _fixed(points: FloatArray) -> npt.NDArray[np.int32]:
    # Far outside points would overflow cv2's fixed-point numbers.
    return np.rint(np.clip(points, -1e5, 1e5) * (1 << SHIFT)).astype(np.int32)


def _polyline(canvas: Picture, points: FloatArray, closed: bool, color: Color, width: int) -> None:
    import cv2

    for stroke, ink in ((width + 2 + width // 2, HALO), (width, color)):
        cv2.polylines(canvas, [_fixed(points)], closed, ink, stroke, cv2.LINE_AA, SHIFT)


def _dot(canvas: Picture, point: FloatArray, radius: float, color: Color) -> None:
    import cv2

    x, y = (int(value) for value in _fixed(point))
    for size, ink in ((radius + 1.0, HALO), (radius, color)):
        cv2.circle(canvas, (x, y), round(size * (1 << SHIFT)), ink, -1, cv2.LINE_AA, SHIFT)


def _text(canvas: Picture, text: str, at: tuple[int, int], unit: float, color: Color) -> None:
    """Write text with a halo; `at` is the left end of its base line."""
    import cv2

    ascii_text = text.encode("ascii", "replace").decode()
    width, height = _text_size(ascii_text, unit)
    rim = max(1, round(unit))
    # Letters in a heavier stroke would be wider (OpenCV 5), so the halo is grown instead.
    border = height + 2 * rim
    letters = np.zeros((height + 2 * border, width + 2 * border), np.uint8)
    font, stroke = cv2.FONT_HERSHEY_SIMPLEX, max(1, round(unit))
    origin = (border, border + height)
    cv2.putText(letters, ascii_text, origin, font, FONT * unit, (255,), stroke, cv2.LINE_AA)
    halo = cv2.dilate(letters, np.ones((2 * rim + 1, 2 * rim + 1), np.uint8))
    left, top = at[0] - border, at[1] - height - border
    rows = slice(max(0, top), max(0, min(canvas.shape[0], top + letters.shape[0])))
    columns = slice(max(0, left), max(0, min(canvas.shape[1], left + letters.shape[1])))
    part = canvas[rows, columns]
    if part.size == 0:
        return
    for mask, ink in ((halo, HALO), (letters, color)):
        cut = mask[rows.start - top : rows.stop - top, columns.start - left : columns.stop - left]
        weight = cut[..., None].astype(np.float32) / 255.0
        part[:] = np.rint(part + weight * (np.array(ink) - part)).astype(np.uint8)


def _text_size(text: str, unit: float) -> tuple[int, int]:
    """Width and height above the base line."""
    import cv2

    font = cv2.FONT_HERSHEY_SIMPLEX
    (width, height), _ = cv2.getTextSize(text, font, FONT * unit, max(1, round(unit)))
    return int(width), int(height)


def _draw_outline(canvas: Picture, outline: Outline, color: Color, unit: float) -> None:
    width = max(1, round(1.5 * unit))
    if outline.ellipse_px is not None:
        _polyline(canvas, outline.ellipse_px.points(96), True, color, width)
        _dot(canvas, outline.ellipse_px.center, 1.5 * unit, color)
    else:
        assert outline.corners_px is not None
        _polyline(canvas, outline.corners_px, True, color, width)
        for i, corner in enumerate(outline.corners_px):
            _dot(canvas, corner, (3.5 if i == 0 else 1.5) * unit, color)


def _draw_names(
    canvas: Picture, outlines: Sequence[Outline], colors: Sequence[Color], unit: float
) -> None:
    """Write each outline's text, else its category, where it covers no other button or name."""
    boxes = [outline.box_px for outline in outlines]
    written: list[tuple[float, float, float, float]] = []
    gap = 4 * unit
    for k, outline in enumerate(outlines):
        name = outline.text or outline.category
        wide, high = _text_size(name, unit)
        x0, y0, x1, y1 = boxes[k]
        middle_x, middle_y = (x0 + x1 - wide) / 2, (y0 + y1 - high) / 2
        places = [
            (x1 + gap, middle_y),
            (x0 - gap - wide, middle_y),
            (middle_x, y1 + gap),
            (middle_x, y0 - gap - high),
        ]
        others = boxes[:k] + boxes[k + 1 :] + written
        free = [p for p in places if _is_free((*p, p[0] + wide, p[1] + high), others, canvas)]
        # On a dense panel there is room on the button itself only.
        x, y = free[0] if free else (middle_x, y1 - high - gap / 2)
        written.append((x, y, x + wide, y + high))
        _text(canvas, name, (round(x), round(y + high)), unit, colors[k])


def _is_free(
    box: tuple[float, float, float, float],
    others: Sequence[tuple[float, float, float, float]],
    canvas: Picture,
) -> bool:
    x0, y0, x1, y1 = box
    inside = x0 >= 0 and y0 >= 0 and x1 < canvas.shape[1] and y1 < canvas.shape[0]
    return inside and not any(x0 < b[2] and b[0] < x1 and y0 < b[3] and b[1] < y1 for b in others)


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
    start, width = _fixed(ends[0]), max(1, round(2 * unit))
    for end, color in zip(_fixed(ends[1:]), (X_AXIS, Y_AXIS), strict=True):
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
    digits = _text_size("0" * 20, unit)[0] / 20
    letters = max(12, int((canvas.shape[1] - 16 * unit) / max(1.0, digits)))
    lines = [words, _rotation_words(pose), *pose.reasons]
    wrapped = [part for line in lines for part in textwrap.wrap(line, letters)]
    pad, step = round(8 * unit), round(16 * unit)
    wide = max(_text_size(line, unit)[0] for line in wrapped) + 2 * pad
    box = canvas[: step * len(wrapped) + 2 * pad, :wide]
    # Half-transparent, so that the photo is not lost below.
    box[:] = (0.15 * box + 0.85 * np.array(color)).astype(np.uint8)
    for i, line in enumerate(wrapped):
        _text(canvas, line, (pad, step * (i + 1) + pad // 2), unit, (255, 255, 255))


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
