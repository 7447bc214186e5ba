"""What shape an outline has: a quad with rounded corners, an ellipse, or something odd."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from fronto.outlines.edges import EdgePoints
from fronto.outlines.fits import (
    NEXT,
    Ellipses,
    Quads,
    ellipse_frames,
    fit_ellipses,
    fit_quads,
)
from fronto.outlines.misfits import (
    best_radius,
    ellipse_misfit,
    from_square,
    half_sides,
    pill_misfits,
    rectangles,
    thinned,
)
from fronto.outlines.roundness import roundness
from fronto.shapes import FloatArray

__all__ = ["Kind", "Shapes", "find_shapes"]

Kind = Literal["quad", "ellipse", "odd"]

#: The share of a side on which its line is fitted at first; its limits once the radius is
#: known.
FIRST_CENTRAL, LEAST_CENTRAL, MOST_CENTRAL = 0.6, 0.6, 0.85
#: How exact the first lines have to be, which are fitted to some of the points only.
FIRST_STILL_PX = 0.02
#: The same of ellipses, before it is known what is one: pixels, and as a share of its shape.
FIRST_STILL = 0.01
#: Deviations below this do not tell shapes apart, pixels.
FLOOR_PX = 0.2
#: Neighbouring edge points err together: this many of them are one observation.
TOGETHER = 12.0
#: Blurred masks have rounder squares and squarer circles: there an ellipse may fit worse by
#: this power of e (measured, see docs/outlines.md); blurs from 1 (none) to where that is full.
SQUARISH, FULL_BLUR = 0.5, 3.0
#: Where the photo is there, too: what blurred masks say counts this much, and the logarithm of
#: the photo's edges, down to a limit, this much (a logistic regression on 1,008 buttons of
#: renders).
MASKS_SHARE, SEEN, MOST_SEEN = 0.3, 14.0, 0.4
#: What a mask head has told of the form counts this much; it is never surer than this.
TOLD, LEAST_TOLD = 1.0, 0.01
#: What fits nothing better than this, in sizes (and pixels), is odd.
ODD, ODD_PX = 0.035, 0.6
#: Polygons stand off from their ellipse in waves this high, in radii (an octagon's are 0.031) and
#: pixels.
WAVE, WAVE_PX = 0.018, 0.3
#: A side shorter than this share of the opposite one is a triangle's tip.
POINTED = 0.35
#: How much the other buttons of the photo say about one: as many observations, half of
#: that where they are this few.
COMPANY, SMALL = 3.0, 4.0
#: Masks say little about others whose ellipses are of another form (1.4 times as long as wide is
#: this far from a circle).
ALIKE = 0.48
#: As far as forms are told apart.
FAR = 100.0
#: What circles of another form say against one, in powers.
ONE_FORM = 2.5
#: Smaller masks tell no shape, pixels.
TINY_PX = 5.0


@dataclass(frozen=True, eq=False)
class Shapes:
    """Shapes of n masks' outlines.

    Parameters
    ----------
    kind
        "quad", "ellipse" or "odd" for each.
    confidence
        (n,) probability of that kind.
    quads, ellipses
        Both fits, whatever was decided.
    bounds
        (n, 4, 2): of odd ones, the rectangle in the quad's directions that bounds the points.
    radius
        (n,) of the quad's corners in half sides.
    rms
        (n,) of the edge points' distances from the shape decided on, pixels.
    """

    kind: tuple[Kind, ...]
    confidence: FloatArray
    quads: Quads
    ellipses: Ellipses
    bounds: FloatArray
    radius: FloatArray
    rms: FloatArray


def find_shapes(
    points: EdgePoints,
    image: npt.NDArray[Any] | None = None,
    forms: FloatArray | None = None,
) -> Shapes:
    """Fit quads and ellipses to the edge points of n masks, and decide between them.

    Parameters
    ----------
    points
        The masks' edges.
    image
        Shape (h, w, 3), uint8: the photo, whose edges help to decide; None: the masks alone.
    forms
        Shape (n, 3): probabilities of quad, ellipse and other shapes that a mask head has told,
        in place of the photo's edges; None: nobody has.
    """
    n = len(points.size)
    some = thinned(points)
    central = np.full(n, FIRST_CENTRAL)
    quads = fit_quads(points, central, every=some.every, still_px=FIRST_STILL_PX)
    radius, _ = best_radius(some, quads.corners)
    central = np.clip(1 - radius, LEAST_CENTRAL, MOST_CENTRAL)
    quads = fit_quads(points, central, quads.corners)
    radius, misfit = best_radius(some, quads.corners)
    ellipses = fit_ellipses(
        points.xy, points.first, border=points.border, every=some.every, still=FIRST_STILL
    )
    round_misfit, wave = ellipse_misfit(some, ellipses.shape)
    wavy = _wavy(ellipses.shape, wave, points.blur)
    pill_misfit, extent = pill_misfits(some, quads.corners)
    blurred = np.clip((points.blur - 1) / (FULL_BLUR - 1), 0, 1)
    errors = np.stack([misfit, round_misfit, pill_misfit], axis=1)
    errors[np.isnan(errors)] = np.inf
    seen = None
    if forms is not None:
        seen = TOLD * np.log(np.maximum(forms, LEAST_TOLD))
    elif image is not None and blurred.any():
        inverse = np.asarray(np.linalg.inv(from_square(quads.corners)), np.float64)
        half, frames = half_sides(quads.corners), ellipse_frames(ellipses.shape)
        centers = ellipses.shape[:, :2]
        clear = roundness(image, inverse, half, centers, frames, points.size.astype(np.float64))
        seen = SEEN * blurred[:, None] * np.maximum(clear, -MOST_SEEN)
    chance = _chances(points, errors, blurred, _alike(ellipses.shape), seen)
    best = chance.argmax(axis=1)
    rms = np.sqrt(errors[np.arange(n), best])
    poor = ~(rms <= np.maximum(ODD * points.size, ODD_PX * points.blur)) | (best == 2)
    poor |= (best == 1) & wavy
    poor |= (best == 0) & _pointed(quads.corners)
    kind: tuple[Kind, ...] = tuple(
        "odd" if odd else ("quad", "ellipse")[b] for odd, b in zip(poor, best, strict=True)
    )
    ellipses = _exact(points, ellipses, np.array([one == "ellipse" for one in kind], bool))
    bounds = np.full((n, 4, 2), np.nan)
    if poor.any():
        bounds[poor] = rectangles(quads.corners[poor], extent[poor])
    return Shapes(kind, chance.max(axis=1), quads, ellipses, bounds, radius, rms)


def _exact(points: EdgePoints, ellipses: Ellipses, rows: npt.NDArray[np.bool_]) -> Ellipses:
    """The ellipses of some masks (n,), fitted to all of their points."""
    if not rows.any():
        return ellipses
    # Of the others no point is looked at beyond the first.
    every = np.where(rows, 1, np.maximum(np.diff(points.first), 1))
    exact = fit_ellipses(points.xy, points.first, ellipses.shape, border=points.border, every=every)
    rows = rows & np.isfinite(exact.rms)
    return Ellipses(
        np.where(rows[:, None], exact.shape, ellipses.shape),
        np.where(rows, exact.rms, ellipses.rms),
        np.where(rows[:, None, None], exact.inverse, ellipses.inverse),
    )


def _wavy(shape: FloatArray, wave: FloatArray, blur: FloatArray) -> npt.NDArray[np.bool_]:
    """Whether the distances from the ellipses go up and down as a polygon's do, (n,)."""
    with np.errstate(all="ignore"):
        radius = (shape[:, 2] * shape[:, 4] - shape[:, 3] ** 2) ** -0.25
        return np.asarray(wave > np.maximum(WAVE * radius, WAVE_PX * blur))


def _pointed(corners: FloatArray) -> npt.NDArray[np.bool_]:
    """Whether a quad has a side so short that it is a triangle."""
    along = corners[:, NEXT] - corners
    sides = np.hypot(along[..., 0], along[..., 1])
    with np.errstate(invalid="ignore"):
        return np.asarray((sides < POINTED * sides[:, [2, 3, 0, 1]]).any(axis=1))


def _alike(shape: FloatArray) -> FloatArray:
    """How much masks say about each other, (n, n), by the ellipses (n, 5) that fit them."""
    with np.errstate(all="ignore"):
        size = np.sqrt(shape[:, 2] * shape[:, 4] - shape[:, 3] ** 2)
        form = np.clip(shape[:, [2, 3, 3, 4]] / size[:, None], -FAR, FAR)
    known = np.isfinite(form).all(axis=1)
    form[~known] = 0
    square = (form**2).sum(axis=1)
    apart = np.sqrt(np.maximum(square[:, None] + square - 2 * form @ form.T, 0))
    apart[~known] = apart[:, ~known] = 0
    alike = np.exp(-((apart / ALIKE) ** 4))
    np.fill_diagonal(alike, 0)
    return np.asarray(alike)


def _chances(
    points: EdgePoints,
    errors: FloatArray,
    blurred: FloatArray,
    alike: FloatArray,
    seen: FloatArray | None,
) -> FloatArray:
    """Probability (n, 3) of each shape from its mean square distance, and what else is `seen`.

    Gaussian errors of unknown size have the likelihood (mean square)^(-observations / 2).
    Buttons of one panel mostly have one shape: what most of them are, a doubtful one
    probably is, too.
    """
    number = np.diff(points.first) / TOGETHER
    number[points.size < TINY_PX] = 0
    errors = np.minimum(errors, 1e6)  # no fit at all
    log = np.log(errors + FLOOR_PX**2)
    log[:, 1] -= SQUARISH * blurred
    log *= -0.5 * number[:, None]
    if seen is not None:
        log *= 1 - (1 - MASKS_SHARE) * blurred[:, None]
        log += seen
    first = _softmax(log)
    votes = alike @ first  # of all others
    others = votes.sum(axis=1, keepdims=True)
    # Circles on one panel look alike: what is longer than they are is none.
    circles = first[:, 1].sum() - first[:, 1]
    log[:, 1] += ONE_FORM * np.log((votes[:, 1] + 0.5) / (circles + 0.5))
    common = np.log((votes + 0.5) / (others + 1.5))
    return _softmax(log + COMPANY * others / (others + SMALL) * common)


def _softmax(log: FloatArray) -> FloatArray:
    power = np.exp(log - log.max(axis=1, keepdims=True, initial=-1e12))
    return np.asarray(power / power.sum(axis=1, keepdims=True))
