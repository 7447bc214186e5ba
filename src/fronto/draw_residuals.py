"""Pictures of residuals: where the outlines were measured, and where the pose has them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from fronto.camera.conic import fit_ellipse
from fronto.draw import UNDETERMINED
from fronto.draw_tiles import Window
from fronto.drawing import HALO, SHIFT, Color, Picture, fixed_point, polylines, write_names
from fronto.errors import InputError
from fronto.pose.verdict import SET_ASIDE
from fronto.results import Panel, PanelPose
from fronto.shapes import Ellipse, FloatArray, Outline

__all__ = ["FITS", "HALF", "RED", "Residual", "draw_residuals", "residuals"]

#: Of outlines that count in full, that nearly do not count, and that were set aside.
FITS: Color = (60, 200, 160)
HALF: Color = (250, 190, 40)
RED: Color = (255, 50, 50)
THIN: Color = (190, 190, 190)
#: How much longer arrows may be drawn; nine of ten that count stay within this share of a
#: button's size.
FACTORS = (1000, 500, 200, 100, 50, 20, 10, 5, 2, 1)
REACH = 0.4
#: On smaller buttons arrows are thin, tile pixels.
SMALL = 40.0
#: Where an ellipse's outermost points are looked for: right, down, left, up.
OUTWARDS = np.array([[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]])
#: Points of a circle that are projected.
CIRCLE = 2 * np.pi * np.arange(64) / 64


class Residual(NamedTuple):
    """Points of one outline, as measured and as the pose has them.

    Parameters
    ----------
    button
        Index of the button.
    measured, modelled
        (k, 2): photo pixels.
    """

    button: int
    measured: FloatArray
    modelled: FloatArray


def draw_residuals(picture: Picture, window: Window, panel: Panel) -> tuple[Picture, int]:
    """Draw an arrow from each measured point to where the pose has it, longer than it is.

    An outline that counts in full is green, one that counts less is yellow, and one that was
    set aside red; its root mean square residual is written beside it, in the photo's pixels.

    Parameters
    ----------
    picture
        The photo's part in the tile, shape (h, w, 3); it is not changed.
    window
        Where that part is.
    panel
        The result, of any status.

    Returns
    -------
    The drawing, and how many times as long the arrows are as the residuals; 0 where there
    are none.
    """
    import cv2

    canvas = picture.copy()
    found = residuals(panel)
    if not found:
        return canvas, 0
    weight = np.array([panel.buttons[r.button].weight for r in found])
    boxes = [_box(window.points(_around(panel.buttons[r.button].outline))) for r in found]
    starts = [window.points(r.measured) for r in found]
    steps = [window.points(r.modelled) - start for r, start in zip(found, starts, strict=True)]
    lengths = [np.hypot(*step.T) for step in steps]
    counting = [length for length, w in zip(lengths, weight, strict=True) if w >= SET_ASIDE]
    sizes = [np.sqrt((x1 - x0) * (y1 - y0)) for x0, y0, x1, y1 in boxes]
    factor = _factor(np.concatenate(counting or lengths), float(np.median(sizes)))
    colors = [_color(float(w)) for w in weight]
    width = 1 if np.median(sizes) < SMALL else 2
    for residual in found:
        around = window.points(_around(panel.buttons[residual.button].outline))
        polylines(canvas, [around], True, THIN, 1)
    # Those set aside first: their arrows are long, and may cross others.
    for k in np.argsort(weight, kind="stable"):
        for start, step in zip(starts[k], steps[k], strict=True):
            a, b = fixed_point(np.array([start, start + factor * step])).tolist()
            for stroke, ink in ((width + 2, HALO), (width, colors[k])):
                cv2.arrowedLine(canvas, a, b, ink, stroke, cv2.LINE_AA, SHIFT, 0.25)
    words = [f"{panel.buttons[r.button].residual_px:.2f}" for r in found]
    write_names(canvas, words, boxes, colors, 0.8, gap=6.0, first="beside")
    return canvas, factor


def residuals(panel: Panel) -> list[Residual]:
    """What the pose makes of each outline; nothing where it does not say (the grid search).

    Of quads the corners whose two sides are seen, of ellipses the outermost points to the
    right, below, to the left and above.
    """
    pose = panel.pose
    if pose.status in UNDETERMINED or len(pose.plane_corners) != len(panel.buttons):
        return []
    found = []
    for k, button in enumerate(panel.buttons):
        if not np.isfinite(button.residual_px):
            continue
        pair = _pair(button.outline, pose, pose.plane_corners[k])
        if pair is not None:
            found.append(Residual(k, *pair))
    return found


def _pair(
    outline: Outline, pose: PanelPose, corners: FloatArray
) -> tuple[FloatArray, FloatArray] | None:
    """Measured and modelled points of one outline, photo pixels; None where there are none."""
    if outline.ellipse_px is not None:
        across, down = (corners[1] - corners[0]) / 2, (corners[3] - corners[0]) / 2
        circle = np.outer(np.cos(CIRCLE), across) + np.outer(np.sin(CIRCLE), down)
        circle += corners.mean(axis=0)
        try:
            modelled = _outermost(fit_ellipse(_projected(pose, circle)))
        except (InputError, np.linalg.LinAlgError):  # it reaches behind the camera
            return None
        return _outermost(outline.ellipse_px), modelled
    assert outline.corners_px is not None
    seen = np.array(outline.seen)
    whole = seen & np.roll(seen, 1)
    modelled = _projected(pose, corners)
    whole &= np.isfinite(modelled).all(axis=1)
    return (outline.corners_px[whole], modelled[whole]) if whole.any() else None


def _projected(pose: PanelPose, plane: FloatArray) -> FloatArray:
    """Photo pixels (n, 2) of points (n, 2) on the panel's plane at depth 1."""
    return pose.camera.project(np.column_stack([plane, np.ones(len(plane))]) @ pose.rotation)


def _outermost(ellipse: Ellipse) -> FloatArray:
    reach = OUTWARDS @ ellipse.shape_matrix
    lengths = np.sqrt((reach * OUTWARDS).sum(axis=1))
    return np.asarray(ellipse.center + reach / lengths[:, None])


def _around(outline: Outline) -> FloatArray:
    if outline.ellipse_px is not None:
        return outline.ellipse_px.points(96)
    assert outline.corners_px is not None
    return outline.corners_px


def _box(points: FloatArray) -> tuple[float, float, float, float]:
    (x0, y0), (x1, y1) = points.min(axis=0), points.max(axis=0)
    return float(x0), float(y0), float(x1), float(y1)


def _factor(lengths: FloatArray, size: float) -> int:
    """How many times as long arrows are drawn: the most that keeps them near their button."""
    usual = float(np.percentile(lengths, 90))
    return next((factor for factor in FACTORS if factor * usual <= REACH * size), 1)


def _color(weight: float) -> Color:
    if weight < SET_ASIDE:
        return RED
    full = min((weight - SET_ASIDE) / (1 - SET_ASIDE), 1.0)
    red, green, blue = (round(full * a + (1 - full) * b) for a, b in zip(FITS, HALF, strict=True))
    return red, green, blue
