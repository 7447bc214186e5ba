"""From fits to an `Outline`: the order of corners, deviations, what is seen."""

from __future__ import annotations

from typing import Literal, NamedTuple

import numpy as np

from fronto.errors import InputError
from fronto.outlines.edges import EdgePoints
from fronto.outlines.kinds import TOGETHER, Shapes
from fronto.outlines.subpixel import ON_ELLIPSE, ON_SIDE, Refined
from fronto.segments import Segment
from fronto.shapes import Ellipse, FloatArray, Outline, upright_order

__all__ = ["Measured", "built"]

#: A side is seen if there are edge points along this share of its central part.
COVERED = 0.6
#: An ellipse needs edge points along this share of it.
LEAST_ARC = 0.45
#: Smaller masks have no outline, pixels.
LEAST_SIZE_PX = 2.5
#: What the fit's own deviation does not show: pixels, and a share of the button's size. Of
#: sharp masks little; of blurred ones, a network's, as measured on renders (docs/outlines.md),
#: of quads and of ellipses, where they follow the mask and where they follow the photo.
SHARP_PX, FULL_BLUR = 0.06, 3.0
MASK_OFF = {"quad": (1.35, 0.063), "ellipse": (0.55, 0.022)}
EDGE_OFF = {"quad": (0.6, 0.035), "ellipse": (0.4, 0.011)}
#: The same of masks that a mask head has drawn.
DRAWN_MASK_OFF = {"quad": (1.2, 0.047), "ellipse": (0.8, 0.023)}
DRAWN_EDGE_OFF = {"quad": (0.63, 0.036), "ellipse": (0.47, 0.012)}
#: Of corners against each other, place and size left open, where all four sides follow the photo.
FORM_OFF = (0.3, 0.002)
DRAWN_FORM_OFF = (0.2, 0.002)
#: Of an odd shape's corners, in sizes.
ODD_STD = 0.06
#: Variance of a fitted line at the side's end against that of its points' mean: the central
#: part, 0.8 of the side, is extrapolated.
AT_END = 1 + 12 * (0.5 / 0.8) ** 2


class Measured(NamedTuple):
    """All that was fitted to the mask k of a photo.

    Parameters
    ----------
    k
        Index of the mask.
    drawn
        Whether a mask head has drawn it.
    points, shapes, refined
        Of all masks of the photo.
    corners
        (4, 2) pixels: where the refined sides of mask k meet; NaN or infinite where they do not.
    """

    k: int
    drawn: bool
    points: EdgePoints
    shapes: Shapes
    refined: Refined
    corners: FloatArray


def built(segment: Segment, measured: Measured) -> Outline | str:
    """The outline of a mask, or why there is none."""
    m = measured
    if m.points.size[m.k] < LEAST_SIZE_PX:
        return "the mask is too small"
    kind = m.shapes.kind[m.k]
    if kind == "ellipse":
        return _ellipse(segment, m)
    return _quad(segment, m, odd=kind == "odd")


def _ellipse(segment: Segment, m: Measured) -> Outline | str:
    k = m.k
    cx, cy, m11, m12, m22 = m.refined.shape[k]
    own = slice(m.points.first[k], m.points.first[k + 1])
    border = m.points.border[own]
    if _arc(m.points.xy[own][~border], np.array([cx, cy])) < LEAST_ARC:
        return "less than half of it is seen"
    try:
        ellipse = Ellipse.from_shape_matrix(
            (cx, cy), np.linalg.inv(np.array([[m11, m12], [m12, m22]]))
        )
    except (InputError, np.linalg.LinAlgError):
        return "no ellipse fits it"
    spread = max(float(m.refined.ellipse_rms[k]), 0.1)
    if m.refined.ellipse_from_image[k]:
        # Two parameters' variance each from half the stations, as on a full circle.
        statistical = spread * np.sqrt(2 / (ON_ELLIPSE / 2))
    else:
        variance = m.shapes.ellipses.inverse[k][[0, 1], [0, 1]].mean()
        statistical = spread * np.sqrt(max(float(variance), 0.0) * TOGETHER)
    return Outline.ellipse(
        ellipse.cx,
        ellipse.cy,
        ellipse.a,
        ellipse.b,
        ellipse.angle_deg,
        std_px=float(
            np.hypot(statistical, _systematic(m, "ellipse", float(m.refined.ellipse_from_image[k])))
        ),
        category=segment.category,
        confidence=segment.confidence,
        truncated=bool(border.any()),
        shape_confidence=float(m.shapes.confidence[k]),
    )


def _arc(xy: FloatArray, center: FloatArray, bins: int = 36) -> float:
    """Share of the directions from the centre in which there are points."""
    angle = np.arctan2(xy[:, 1] - center[1], xy[:, 0] - center[0])
    hit = np.zeros(bins, bool)
    hit[((angle / (2 * np.pi) + 0.5) * bins).astype(int) % bins] = True
    return float(hit.mean())


def _systematic(m: Measured, shape: Literal["quad", "ellipse"], share: float) -> float:
    """What the fit's own deviation does not show; `share` of the outline is the photo's."""
    masks, edges = (DRAWN_MASK_OFF, DRAWN_EDGE_OFF) if m.drawn else (MASK_OFF, EDGE_OFF)
    mask, edge = _off(m, *masks[shape]), _off(m, *edges[shape])
    return float(np.sqrt(SHARP_PX**2 + share * edge**2 + (1 - share) * mask**2))


def _off(m: Measured, px: float, share: float) -> float:
    """A deviation of blurred masks, and what rests on them: pixels, and a share of the size."""
    blurred = min(max((float(m.points.blur[m.k]) - 1) / (FULL_BLUR - 1), 0.0), 1.0)
    return float(blurred * np.hypot(px, share * float(m.points.size[m.k])))


def _quad(segment: Segment, m: Measured, *, odd: bool) -> Outline | str:
    k = m.k
    quads = m.shapes.quads
    seen = (quads.covered[k] >= COVERED) & np.isfinite(quads.rms[k])
    corners = m.corners
    if odd:
        # Its rectangle bounds all of it, or it is cut.
        if m.points.border[m.points.first[k] : m.points.first[k + 1]].any():
            return "too little of it is seen to tell its shape"
        corners, seen = m.shapes.bounds[k], np.ones(4, bool)
    if seen.sum() < 2:
        return "less than two of its sides are seen"
    truncated = not seen.all()
    if not np.isfinite(corners).all():
        return "its sides bound no button"
    ordered = upright_order(corners)
    # Where in the ordered quad each side has come to: order_corners only turns the quad.
    turn = int(np.argmin(np.linalg.norm(corners - ordered[0], axis=1)))
    std = ODD_STD * float(m.points.size[k]) if odd else _quad_std(m, seen)
    top, right, bottom, left = (bool(s) for s in np.roll(seen, -turn))
    total = float(np.hypot(std, _systematic(m, "quad", float(m.refined.from_image[k].mean()))))
    form = None
    if not odd and seen.all() and m.refined.from_image[k].all():
        off = _off(m, *(DRAWN_FORM_OFF if m.drawn else FORM_OFF))
        form = min(total, float(np.hypot(std, off)))
    try:
        return Outline.quad(
            ordered,
            std_px=total,
            category=segment.category,
            confidence=segment.confidence,
            odd=odd,
            truncated=truncated,
            seen=(top, right, bottom, left),
            shape_confidence=float(m.shapes.confidence[k]),
            form_std_px=form,
        )
    except InputError:
        return "its sides bound no button"


def _quad_std(m: Measured, seen: FloatArray) -> float:
    """Deviation of a corner coordinate from the seen sides' fits."""
    k = m.k
    rms = np.maximum(m.refined.line_rms[k], 0.05)
    number = np.where(m.refined.from_image[k], ON_SIDE / 2, m.shapes.quads.number[k] / TOGETHER * 2)
    variance = AT_END * rms**2 / np.maximum(number, 1.0)
    return float(np.sqrt(variance[seen].mean()))
