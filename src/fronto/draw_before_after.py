"""Pictures for people: the photo with what was found in it, beside its head-on view."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from fronto.draw import button_names, category_colors, draw_frame, draw_overlay
from fronto.drawing import Box, Picture, polylines, unit_of, write_names
from fronto.results import Button, Panel, RectifiedView
from fronto.shapes import FloatArray

__all__ = ["draw_before_after", "draw_view"]

CHECKER: tuple[int, int] = (150, 190)
GAP_GREY = 230


def draw_before_after(photo: npt.NDArray[Any], panel: Panel) -> Picture:
    """Draw the photo with its overlay and, to the right, the head-on view.

    Parameters
    ----------
    photo
        Shape (h, w, 3), (h, w, 1) or (h, w), uint8, RGB: the photo that `panel` is of.
    panel
        The result, of any status. Its view is scaled to fit the photo's height and width;
        without one the ground on the right is empty.

    Returns
    -------
    Shape (h, w', 3), uint8, RGB, of the photo's height.

    Raises
    ------
    InputError
        If the photo is not uint8 with 1 or 3 channels.
    """
    outlines = [button.outline for button in panel.buttons]
    before = draw_overlay(photo, panel.pose, outlines, button_names(panel.buttons))
    height, width = before.shape[:2]
    unit = unit_of(before)
    after = draw_view(panel, width, height, unit)
    gap = np.full((height, max(4, round(8 * unit)), 3), GAP_GREY, np.uint8)
    both: Picture = np.ascontiguousarray(np.concatenate([before, gap, after], axis=1))
    draw_frame(both, panel.pose, unit)
    return both


def draw_view(panel: Panel, width_px: int, height_px: int, unit: float) -> Picture:
    """Draw the head-on view, and on it each button where the homography puts it.

    A checkered ground shows where the view is transparent; without a view it is all there is.
    Outlines are thin, in their category's colour, with the button's name beside them; where
    there is no room, what is printed on it only. Those that reach the panel's horizon are left
    out.

    Parameters
    ----------
    panel
        The result, of any status.
    width_px, height_px
        What the view is scaled to fit.
    unit
        Size of strokes and letters, as of `unit_of`.

    Returns
    -------
    Shape (height_px, w, 3), uint8, RGB; w up to `width_px`, as wide as the scaled view.
    """
    view = panel.view
    if view is None:
        return _checker(height_px, width_px, unit)
    factor = min(height_px / view.height_px, width_px / view.width_px)
    size = (max(1, round(factor * view.width_px)), max(1, round(factor * view.height_px)))
    ground = _checker(height_px, size[0], unit)
    top = (height_px - size[1]) // 2
    part = ground[top : top + size[1]]
    part[:] = _blended(view, size, part)
    scale = np.array(size) / (view.width_px, view.height_px)
    shift = 0.5 * scale - 0.5 + (0, top)
    colors, boxes, shown = [], [], []
    for button, color in zip(
        panel.buttons, category_colors([b.outline for b in panel.buttons]), strict=True
    ):
        points = _rectified(button)
        if points is None:
            continue
        points = points * scale + shift
        polylines(ground, [points], True, color, max(1, round(0.7 * unit)))
        colors.append(color)
        boxes.append(_box(points))
        shown.append(button)
    names = button_names(shown)
    texts = [
        name if b.label or b.outline.text else "" for name, b in zip(names, shown, strict=True)
    ]
    write_names(ground, names, boxes, colors, unit, gap=4 * unit, first="beside", short=texts)
    return ground


def _rectified(button: Button) -> FloatArray | None:
    """Points of the outline in the rectified picture; None where it is not all there."""
    if button.rectified_ellipse_px is not None:
        return button.rectified_ellipse_px.points(96)
    corners = button.rectified_corners_px
    return corners if corners is not None and np.isfinite(corners).all() else None


def _box(points: FloatArray) -> Box:
    (x0, y0), (x1, y1) = points.min(axis=0), points.max(axis=0)
    return float(x0), float(y0), float(x1), float(y1)


def _checker(height: int, width: int, unit: float) -> Picture:
    side = max(4, round(8 * unit))
    dark = (np.arange(height)[:, None] // side % 2 == 0) ^ (np.arange(width) // side % 2 == 1)
    ground = np.empty((height, width, 3), np.uint8)
    ground[:] = CHECKER[1]
    ground[dark] = CHECKER[0]
    return ground


def _blended(view: RectifiedView, size: tuple[int, int], ground: Picture) -> Picture:
    """The view scaled to this width and height over a ground of that size."""
    import cv2

    top = 1.0 if view.image.dtype.kind == "f" else float(np.iinfo(view.image.dtype).max)
    alpha = np.ascontiguousarray(view.image[..., 3])
    # Multiplied before scaling, so that the transparent part's colour does not bleed in.
    factors = cv2.merge([alpha, alpha, alpha, np.full_like(alpha, top)])
    product = cv2.multiply(view.image, factors, scale=1 / top)
    smooth = cv2.INTER_AREA if size[0] < view.width_px else cv2.INTER_LINEAR
    scaled = cv2.convertScaleAbs(cv2.resize(product, size, interpolation=smooth), alpha=255 / top)
    color = np.ascontiguousarray(scaled[..., :3])
    rest = cv2.cvtColor(255 - np.asarray(scaled)[..., 3], cv2.COLOR_GRAY2RGB)
    return np.asarray(cv2.add(color, cv2.multiply(ground, rest, scale=1 / 255)), np.uint8)
