"""Pictures for people: what was found in a photo, and how far to trust it.

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
from fronto.results import Button, PanelPose, Status
from fronto.shapes import FloatArray, Outline
from fronto.warp.polygon import photo_outline

__all__ = [
    "STATUS",
    "UNDETERMINED",
    "X_AXIS",
    "Y_AXIS",
    "button_names",
    "category_colors",
    "draw_frame",
    "draw_overlay",
    "pose_words",
    "printable",
]

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
#: Around the banner's words, and from line to line, pixels of a 640 px wide photo.
PAD, STEP = 8, 16
HORIZON: Color = (250, 250, 250)
#: Points along a horizon, which the lens may bend.
ALONG = 97


def draw_overlay(
    image_rgb: npt.NDArray[Any],
    pose: PanelPose,
    outlines: Sequence[Outline],
    names: Sequence[str] | None = None,
) -> Picture:
    """Draw outlines, the panel's axes, its horizon and the verdict on a copy of the photo.

    Each outline has its category's colour, its name beside it, and dots at its corners, the
    first one large. At the buttons' centroid red points along the panel's
    rows (x) and green down its columns (y), and where the photo reaches it, a white line is
    the panel's horizon (the vanishing line of its plane), unless the rotation is not
    determined. Texts are ASCII; other signs become "?".

    Parameters
    ----------
    image_rgb
        Shape (h, w, 3), uint8, RGB. Grey (h, w) or (h, w, 1) is drawn on in colour.
    pose
        The pose, of any status.
    outlines
        The outlines in the photo's pixels; may be empty.
    names
        One for each outline, such as `button_names` gives; None: its text, else its category.

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
    colors = category_colors(outlines)
    for outline, color in zip(outlines, colors, strict=True):
        _draw_outline(canvas, outline, color, unit)
    if names is None:
        names = [outline.text or outline.category for outline in outlines]
    boxes = [outline.box_px for outline in outlines]
    write_names(canvas, names, boxes, colors, unit, gap=4 * unit, first="beside")
    _draw_axes(canvas, pose, unit)
    draw_frame(canvas, pose, unit)
    lines = _banner_lines(canvas, pose, unit)
    _draw_horizon(canvas, pose, unit, _banner_size(lines, unit))
    _draw_banner(canvas, pose, unit, lines)
    return canvas


def button_names(buttons: Sequence[Button]) -> list[str]:
    """What to write beside buttons: the label, in brackets where it is inferred only.

    "?" where a button was read and no label is sure; the category where nothing read it, or it
    carries no label.
    """
    return [_name(button) for button in buttons]


def _name(button: Button) -> str:
    if button.label:
        return f"({button.label})" if button.label_source == "inferred" else button.label
    if button.label_confidence is None:
        return button.outline.text or button.outline.category
    without_label = bool(button.label_guesses) and not button.label_guesses[0][0]
    return button.outline.category if without_label else "?"


def category_colors(outlines: Sequence[Outline]) -> list[Color]:
    """A colour for each outline, the same for those of one category."""
    categories = sorted({outline.category for outline in outlines})
    return [PALETTE[categories.index(o.category) % len(PALETTE)] for o in outlines]


def draw_frame(canvas: Picture, pose: PanelPose, unit: float) -> None:
    """Frame the picture in the status' colour, unless it is ok."""
    if pose.status == "ok":
        return
    color, _ = STATUS[pose.status]
    thick = max(1, round(5 * unit))
    for edge in (canvas[:thick], canvas[-thick:], canvas[:, :thick], canvas[:, -thick:]):
        edge[:] = color


def pose_words(pose: PanelPose) -> list[str]:
    """The rotation with its deviations, and σ: of its least sure angle, and of a corner."""
    if pose.status in UNDETERMINED or not np.isfinite(pose.rotation).all():
        return ["rotation not determined"]
    known = np.isfinite(pose.covariance).all()
    stds = pose.std_deg if known else (np.nan,) * 3
    parts = [
        f"{axis} {angle:+.1f}" + (f" +- {std:.1f}" if np.isfinite(std) else " +- ?")
        for axis, angle, std in zip("xyz", pose.angles_deg, stds, strict=True)
    ]
    sigma = [f"{max(stds):.2g} deg"] if known else []
    if pose.sigma_px is not None and np.isfinite(pose.sigma_px):
        sigma.append(f"{pose.sigma_px:.2g} px at the corners")
    words = [f"rotation {', '.join(parts)} deg"]
    return [*words, f"sigma {', '.join(sigma)}"] if sigma else words


def printable(text: str) -> str:
    """The text with the signs that reasons and notes have beyond ASCII spelt out."""
    return text.replace("±", "+- ").replace("°", " deg").replace("σ", "sigma")


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


def _draw_horizon(canvas: Picture, pose: PanelPose, unit: float, banner: tuple[int, int]) -> None:
    """Draw the vanishing line of the panel's plane, where the photo shows it."""
    line = _horizon(pose)
    if line is None:
        return
    # Named where the banner, this wide and high, does not cover it.
    free = line[(line >= banner).any(axis=1)]
    if not len(free):
        return
    polylines(canvas, [line], False, HORIZON, max(1, round(unit)))
    x, y = (float(value) for value in free[len(free) // 2])
    across, down = np.abs(line[-1] - line[0])
    write_names(
        canvas,
        ["", "horizon"],
        [(0.0, 0.0, float(banner[0]), float(banner[1])), (x, y, x, y)],
        [HORIZON, HORIZON],
        unit,
        gap=6 * unit,
        first="above" if across > down else "beside",
    )


def _horizon(pose: PanelPose) -> FloatArray | None:
    """Points (n, 2) of the photo along the panel's horizon, None where it shows none of it.

    The third row of any rectifying homography, R[2] K⁻¹, is that line in undistorted pixels.
    """
    if pose.status in UNDETERMINED or not np.isfinite(pose.rotation).all():
        return None
    line = pose.rotation[2] @ np.linalg.inv(pose.camera.matrix)
    polygon = photo_outline(pose.camera)
    height = polygon @ line[:2] + line[2]
    cuts = [
        polygon[i - 1] + height[i - 1] / (height[i - 1] - height[i]) * (polygon[i] - polygon[i - 1])
        for i in range(len(polygon))
        if (height[i] >= 0) != (height[i - 1] >= 0)
    ]
    if len(cuts) != 2:
        return None
    straight = cuts[0] + np.linspace(0, 1, ALONG)[:, None] * (cuts[1] - cuts[0])
    bent = pose.camera.distort_points(straight)
    bent = bent[np.isfinite(bent).all(axis=1)]
    return bent if len(bent) > 1 else None


def _banner_lines(canvas: Picture, pose: PanelPose, unit: float) -> list[str]:
    _, words = STATUS[pose.status]
    # A line of digits is wider than one of words.
    digits = text_size("0" * 20, unit)[0] / 20
    letters = max(12, int((canvas.shape[1] - 16 * unit) / max(1.0, digits)))
    lines = [words, *pose_words(pose), *map(printable, pose.reasons)]
    return [part for line in lines for part in textwrap.wrap(line, letters)]


def _banner_size(lines: Sequence[str], unit: float) -> tuple[int, int]:
    """Width and height."""
    wide = max(text_size(line, unit)[0] for line in lines)
    return wide + 2 * round(PAD * unit), round(STEP * unit) * len(lines) + 2 * round(PAD * unit)


def _draw_banner(canvas: Picture, pose: PanelPose, unit: float, lines: Sequence[str]) -> None:
    color, _ = STATUS[pose.status]
    pad, step = round(PAD * unit), round(STEP * unit)
    wide, high = _banner_size(lines, unit)
    box = canvas[:high, :wide]
    # Half-transparent, so that the photo is not lost below.
    box[:] = (0.15 * box + 0.85 * np.array(color)).astype(np.uint8)
    for i, line in enumerate(lines):
        write_text(canvas, line, (pad, step * (i + 1) + pad // 2), unit, (255, 255, 255))
