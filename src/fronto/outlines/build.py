"""From fits to an `Outline`: the order of corners, deviations, what is seen."""

from __future__ import annotations

import math
from typing import Literal, NamedTuple

import numpy as np
import numpy.typing as npt

from fronto.errors import InputError
from fronto.outlines.edges import EdgePoints
from fronto.outlines.fits import NEXT, intersections
from fronto.outlines.kinds import TOGETHER, Shapes
from fronto.outlines.subpixel import ON_ELLIPSE, ON_SIDE, Refined
from fronto.segments import Segment
from fronto.shapes import Ellipse, FloatArray, Outline

__all__ = ["Measured", "built", "measured"]

#: Pixels, and a share of the button's size.
Constants = tuple[float, float]


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
#: The same of the form alone, place and size left open. An outline on another of the button's
#: edges is wrong in its size all around, and right in its form.
FORM_MASK_OFF = {"quad": (1.35, 0.063), "ellipse": (0.55, 0.022)}
FORM_EDGE_OFF = {"quad": (0.3, 0.002), "ellipse": (0.4, 0.011)}
DRAWN_FORM_MASK_OFF = {"quad": (0.7, 0.02), "ellipse": (0.16, 0.006)}
DRAWN_FORM_EDGE_OFF = {"quad": (0.2, 0.002), "ellipse": (0.12, 0.003)}
#: Of an odd shape's corners, in sizes.
ODD_STD = 0.06
#: Variance of a fitted line at the side's end against that of its points' mean: the central
#: part, 0.8 of the side, is extrapolated.
AT_END = 1 + 12 * (0.5 / 0.8) ** 2


class Measured(NamedTuple):
    """All that was fitted to n masks of a photo, and how sure it is.

    Parameters
    ----------
    points, shapes, refined
        Of all masks.
    corners
        (n, 4, 2) pixels: where the refined sides of each mask meet, of odd ones the rectangle
        that bounds it, as the panel reads upright; NaN or infinite where there is none.
    seen
        (n, 4): which sides of quads are seen, from the one between the first two corners on.
    quad_std, quad_form
        (n,) pixels: deviation of quads' corners, and of their form alone.
    ellipse_off, ellipse_form_off
        (n,) pixels: what an ellipse's fit does not show of its deviations.
    at_border
        (n,): whether the photo's border cuts the mask.
    """

    points: EdgePoints
    shapes: Shapes
    refined: Refined
    corners: FloatArray
    seen: npt.NDArray[np.bool_]
    quad_std: FloatArray
    quad_form: FloatArray
    ellipse_off: FloatArray
    ellipse_form_off: FloatArray
    at_border: npt.NDArray[np.bool_]


def measured(
    points: EdgePoints, shapes: Shapes, refined: Refined, drawn: npt.NDArray[np.bool_]
) -> Measured:
    """What `built` needs; `drawn` (n,) tells which masks a mask head has drawn."""
    quads, n = shapes.quads, len(points.size)
    seen = (quads.covered >= COVERED) & np.isfinite(quads.rms)
    blurred = np.clip((points.blur - 1) / (FULL_BLUR - 1), 0, 1)

    def off(constants: Constants, drawn_constants: Constants) -> FloatArray:
        """A deviation of blurred masks, and what rests on them: pixels, a share of the size."""
        px, share = np.where(drawn[:, None], drawn_constants, constants).T
        return np.asarray(blurred * np.hypot(px, share * points.size))

    def systematic(
        shape: Literal["quad", "ellipse"], share: FloatArray
    ) -> tuple[FloatArray, FloatArray]:
        """What fits' own deviations do not show: of all, and of the form.

        `share` (n,) of the outline is the photo's.
        """
        mask = off(MASK_OFF[shape], DRAWN_MASK_OFF[shape])
        edge = off(EDGE_OFF[shape], DRAWN_EDGE_OFF[shape])
        form_mask = off(FORM_MASK_OFF[shape], DRAWN_FORM_MASK_OFF[shape])
        form_edge = off(FORM_EDGE_OFF[shape], DRAWN_FORM_EDGE_OFF[shape])
        return (
            np.sqrt(SHARP_PX**2 + share * edge**2 + (1 - share) * mask**2),
            np.sqrt(SHARP_PX**2 + share * form_edge**2 + (1 - share) * form_mask**2),
        )

    # Of the sides that are seen: the deviation of a corner coordinate from their fits.
    rms = np.maximum(refined.line_rms, 0.05)
    number = np.where(refined.from_image, ON_SIDE / 2, quads.number / TOGETHER * 2)
    variance = np.where(seen, AT_END * rms**2 / np.maximum(number, 1.0), 0.0)
    fits = np.sqrt(variance.sum(axis=1) / np.maximum(seen.sum(axis=1), 1))
    odd = np.array([kind == "odd" for kind in shapes.kind], bool)
    fits = np.where(odd, ODD_STD * points.size, fits)
    # Where an edge head has told all outlines, nobody asks what else there is to know.
    quad, quad_form, ellipse_off = refined.std, refined.form_std, (refined.std, refined.form_std)
    if not np.isfinite(quad_form).all():
        quad_off = systematic("quad", refined.from_image.mean(axis=1))
        quad, quad_form = (
            np.where(np.isfinite(told), told, np.hypot(fits, one))
            for told, one in zip((quad, quad_form), quad_off, strict=True)
        )
        ellipse_off = systematic("ellipse", refined.ellipse_from_image.astype(float))
    border = np.bincount(points.owner[points.border], minlength=n) > 0
    corners = np.where(odd[:, None, None], shapes.bounds, intersections(refined.lines))
    turn = _upright(corners)
    return Measured(
        points,
        shapes,
        refined,
        np.take_along_axis(corners, turn[..., None], axis=1),
        np.take_along_axis(seen | odd[:, None], turn, axis=1),
        quad,
        quad_form,
        *ellipse_off,
        np.asarray(border),
    )


def built(segment: Segment, m: Measured, k: int) -> Outline | str:
    """The outline of the mask k, or why there is none."""
    if m.points.size[k] < LEAST_SIZE_PX:
        return "the mask is too small"
    kind = m.shapes.kind[k]
    if kind == "ellipse":
        return _ellipse(segment, m, k)
    return _quad(segment, m, k, odd=kind == "odd")


def _ellipse(segment: Segment, m: Measured, k: int) -> Outline | str:
    cx, cy, m11, m12, m22 = m.refined.shape[k].tolist()
    own = slice(m.points.first[k], m.points.first[k + 1])
    xy = m.points.xy[own]
    if m.at_border[k]:
        xy = xy[~m.points.border[own]]
    if _arc(xy, np.array([cx, cy])) < LEAST_ARC:
        return "less than half of it is seen"
    det = m11 * m22 - m12 * m12
    if not det > 0:
        return "no ellipse fits it"
    try:
        ellipse = Ellipse.from_shape_matrix(
            (cx, cy), np.array([[m22 / det, -m12 / det], [-m12 / det, m11 / det]])
        )
    except (InputError, np.linalg.LinAlgError):
        return "no ellipse fits it"
    std, form_std = _ellipse_stds(m, k)
    return Outline.ellipse(
        ellipse.cx,
        ellipse.cy,
        ellipse.a,
        ellipse.b,
        ellipse.angle_deg,
        std_px=std,
        form_std_px=form_std,
        category=segment.category,
        confidence=segment.confidence,
        truncated=bool(m.at_border[k]),
        shape_confidence=float(m.shapes.confidence[k]),
    )


def _ellipse_stds(m: Measured, k: int) -> tuple[float, float]:
    """Deviation of an ellipse's centre and axes, and of its form."""
    if math.isfinite(m.refined.std[k]):
        return float(m.refined.std[k]), float(m.refined.form_std[k])
    spread = max(float(m.refined.ellipse_rms[k]), 0.1)
    if m.refined.ellipse_from_image[k]:
        # Two parameters' variance each from half the stations, as on a full circle.
        statistical = spread * math.sqrt(2 / (ON_ELLIPSE / 2))
    else:
        inverse = m.shapes.ellipses.inverse[k]
        variance = float(inverse[0, 0] + inverse[1, 1]) / 2
        statistical = spread * math.sqrt(max(variance, 0.0) * TOGETHER)
    return (
        math.hypot(statistical, float(m.ellipse_off[k])),
        math.hypot(statistical, float(m.ellipse_form_off[k])),
    )


def _arc(xy: FloatArray, center: FloatArray, bins: int = 36) -> float:
    """Share of the directions from the centre in which there are points."""
    angle = np.arctan2(xy[:, 1] - center[1], xy[:, 0] - center[0])
    hit = np.zeros(bins, bool)
    hit[((angle / (2 * np.pi) + 0.5) * bins).astype(int) % bins] = True
    return np.count_nonzero(hit) / bins


def _upright(corners: FloatArray) -> npt.NDArray[np.intp]:
    """Which corners of quads (n, 4, 2), clockwise as seen, come in which order upright, (n, 4).

    As `fronto.shapes.upright_order`, for many.
    """
    with np.errstate(invalid="ignore"):
        along = corners[:, NEXT] - corners
        length = np.hypot(along[..., 0], along[..., 1])
        right = along[..., 0] / np.maximum(length, np.finfo(np.float64).tiny)
        first = np.nan_to_num(right - right[:, [2, 3, 0, 1]]).argmax(axis=1)
    return np.asarray((first[:, None] + np.arange(4)) % 4)


def _quad(segment: Segment, m: Measured, k: int, *, odd: bool) -> Outline | str:
    top, right, bottom, left = seen = m.seen[k].tolist()
    # A rectangle bounds all of what is odd, or that is cut.
    if odd and m.at_border[k]:
        return "too little of it is seen to tell its shape"
    if sum(seen) < 2:
        return "less than two of its sides are seen"
    whole = not odd and all(seen)
    try:
        return Outline.quad(
            m.corners[k],
            std_px=float(m.quad_std[k]),
            category=segment.category,
            confidence=segment.confidence,
            odd=odd,
            truncated=not all(seen),
            seen=(top, right, bottom, left),
            shape_confidence=float(m.shapes.confidence[k]),
            form_std_px=float(m.quad_form[k]) if whole else None,
        )
    except InputError:
        return "its sides bound no button"
