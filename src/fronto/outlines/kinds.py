"""What shape an outline has: a quad with rounded corners, an ellipse, or something odd."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from fronto.outlines.edges import EdgePoints
from fronto.outlines.fits import (
    Ellipses,
    Quads,
    ellipse_distance,
    ellipse_frames,
    fit_ellipses,
    fit_quads,
)
from fronto.outlines.roundness import roundness
from fronto.shapes import FloatArray

__all__ = ["Kind", "Shapes", "find_shapes"]

Kind = Literal["quad", "ellipse", "odd"]

#: Radii of a quad's corners that are tried, in half sides, up to a square with hardly a
#: straight part; pills (whose short sides are half circles) this much longer than wide.
RADII = np.arange(0.0, 0.78, 0.075)
PILL = 1.3
#: Half the length of a pill's round ends that are tried, in half its shorter sides.
CAPS = np.array([0.7, 0.85, 1.0, 1.15, 1.3])
#: The share of a side on which its line is fitted at first; its limits once the radius is
#: known.
FIRST_CENTRAL, LEAST_CENTRAL, MOST_CENTRAL = 0.6, 0.6, 0.85
#: Deviations below this do not tell shapes apart, pixels; above that, in sizes, one says as
#: much as any other.
FLOOR_PX, CAP = 0.2, 0.12
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
#: Polygons stand off from their ellipse in waves: as many a turn, and this high, in radii
#: (an octagon's are 0.031) and pixels.
WAVES, WAVE, WAVE_PX = (3, 5, 6, 7, 8), 0.018, 0.3
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
#: Edge points of a mask that shapes are compared on.
ENOUGH = 80
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
        (n, 4, 2): the rectangle in the quad's directions that bounds the points.
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
    quads = fit_quads(points, np.full(n, FIRST_CENTRAL))
    some = _thinned(points)
    radius, _ = _best_radius(some, quads.corners)
    central = np.clip(1 - radius, LEAST_CENTRAL, MOST_CENTRAL)
    quads = fit_quads(points, central, quads.corners)
    radius, misfit = _best_radius(some, quads.corners)
    inner = ~points.border
    first = np.concatenate([[0], np.cumsum(inner)])[points.first].astype(np.int64)
    ellipses = fit_ellipses(points.xy[inner], first)
    off = ellipse_distance(ellipses.shape[some.owner], some.xy)
    round_misfit = _mean_square(some, off)
    wavy = _wavy(some, ellipses.shape, off)
    pill_misfit, bounds = _pill(some, quads.corners)
    blurred = np.clip((points.blur - 1) / (FULL_BLUR - 1), 0, 1)
    errors = np.stack([misfit, round_misfit, pill_misfit], axis=1)
    errors[np.isnan(errors)] = np.inf
    seen = None
    if forms is not None:
        seen = TOLD * np.log(np.maximum(forms, LEAST_TOLD))
    elif image is not None:
        inverse = np.asarray(np.linalg.inv(_from_square(quads.corners)), np.float64)
        half, frames = _half_sides(quads.corners), ellipse_frames(ellipses.shape)
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
    return Shapes(kind, chance.max(axis=1), quads, ellipses, bounds, radius, rms)


def _thinned(points: EdgePoints) -> EdgePoints:
    """At most about `ENOUGH` points of each mask, evenly taken: shapes need no more."""
    number = np.diff(points.first)
    every = np.maximum(number // ENOUGH, 1)[points.owner]
    keep = (np.arange(len(points.xy)) - points.first[points.owner]) % every == 0
    first = np.concatenate([[0], np.cumsum(keep)])[points.first].astype(np.int64)
    return points._replace(xy=points.xy[keep], first=first, border=points.border[keep])


def _mean_square(points: EdgePoints, distance: FloatArray) -> FloatArray:
    """Mean square of the distances (N, ...) over each mask's points, capped; (n, ...)."""
    n, owner = len(points.size), points.owner
    cap = (CAP * points.size[owner]) ** 2
    inner = ~points.border
    squares = np.minimum(distance.T**2, cap).T[inner]
    number = np.bincount(owner[inner], minlength=n)
    flat = squares.reshape(len(squares), int(np.prod(distance.shape[1:])))
    sums = np.stack([np.bincount(owner[inner], c, n) for c in flat.T], axis=1)
    with np.errstate(all="ignore"):
        means = sums / number[:, None]
    return np.asarray(means.reshape(n, *distance.shape[1:]))


def _best_radius(points: EdgePoints, corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Radius (n,) in half sides that fits best, and the mean square distance with it."""
    u, v, half = _in_square(points, corners)
    u, v = np.abs(u), np.abs(v)
    radius = RADII[None]
    du, dv = u[:, None] - (1 - radius), v[:, None] - (1 - radius)
    rounded = np.hypot(np.maximum(du, 0), np.maximum(dv, 0)) - radius
    # Along a side its own half length is the unit, in a corner their mean.
    across = np.where(du > dv, (u[:, None] - 1) * half[:, :1], (v[:, None] - 1) * half[:, 1:])
    corner = (du > 0) & (dv > 0)
    distance = np.where(corner, rounded * half.mean(axis=1, keepdims=True), across)
    misfit = _mean_square(points, distance)
    misfit[np.isnan(misfit)] = np.inf
    best = misfit.argmin(axis=1)
    return RADII[best], misfit[np.arange(len(best)), best]


def _pill(points: EdgePoints, corners: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Mean square distance from a stadium, and the rectangles that bound the points.

    The distances (n,) are infinite where it is not long enough; the rectangles (n, 4, 2) lie
    in the quads' directions.
    """
    n, owner = len(points.size), points.owner
    u, v, _ = _in_square(points, corners)
    low, high = np.full((n, 2), np.inf), np.full((n, 2), -np.inf)
    for k, values in enumerate((u, v)):
        np.minimum.at(low[:, k], owner, values)
        np.maximum.at(high[:, k], owner, values)
    with np.errstate(all="ignore"):
        middle, reach = (low + high) / 2, (high - low) / 2
        half = _half_sides(corners)
        sides = half * reach
        x = np.abs(u - middle[owner, 0]) * half[owner, 0]
        y = np.abs(v - middle[owner, 1]) * half[owner, 1]
        wide = sides[:, 0] >= sides[:, 1]
        along, across = np.where(wide[owner], (x, y), (y, x))
        long, short = sides.max(axis=1), sides.min(axis=1)
        # Seen from the side, the ends' half circles are half ellipses.
        cap = CAPS * short[owner, None]
        beyond = (along[:, None] - long[owner, None] + cap) / cap
        radial = np.hypot(beyond, across[:, None] / short[owner, None]) - 1
        size = (cap + short[owner, None]) / 2
        off = np.where(beyond > 0, radial * size, (across - short[owner])[:, None])
        misfit = _mean_square(points, off)
        misfit = np.where(np.isnan(misfit), np.inf, misfit).min(axis=1)
        elongated = long >= PILL * short
        u4 = np.stack([low[:, 0], high[:, 0], high[:, 0], low[:, 0]], axis=1)
        v4 = np.stack([low[:, 1], low[:, 1], high[:, 1], high[:, 1]], axis=1)
        bounds = np.stack([u4, v4, np.ones_like(u4)], axis=2) @ _from_square(corners).swapaxes(1, 2)
        bounds = bounds[..., :2] / bounds[..., 2:]
    return np.where(elongated, misfit, np.inf), bounds


def _wavy(points: EdgePoints, shape: FloatArray, off: FloatArray) -> npt.NDArray[np.bool_]:
    """Whether the distances from the ellipse (N,) go up and down as a polygon's do, (n,)."""
    n, owner = len(points.size), points.owner
    with np.errstate(all="ignore"):
        radius = (shape[:, 2] * shape[:, 4] - shape[:, 3] ** 2) ** -0.25
        # The affine map that makes the ellipse a circle, up to a rotation: angles in there.
        x, y = (points.xy - shape[owner, :2]).T
        m11, m12, m22 = shape[owner, 2:].T
        root = np.sqrt(m11)
        angle = np.arctan2(y * np.sqrt(m22 - m12**2 / m11), x * root + y * m12 / root)
        wave = np.exp(1j * angle)
        off = np.where(points.border, 0.0, np.nan_to_num(off))
        number = np.bincount(owner, minlength=n)
        high = np.zeros(n)
        for k in WAVES:
            part = np.nan_to_num(off * wave**k)
            height = np.bincount(owner, part.real, n) + 1j * np.bincount(owner, part.imag, n)
            high = np.fmax(high, 2 * np.abs(height) / number)
        return np.asarray(high > np.maximum(WAVE * radius, WAVE_PX * points.blur))


def _pointed(corners: FloatArray) -> npt.NDArray[np.bool_]:
    """Whether a quad has a side so short that it is a triangle."""
    sides = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    with np.errstate(invalid="ignore"):
        return np.asarray((sides < POINTED * np.roll(sides, 2, axis=1)).any(axis=1))


def _half_sides(corners: FloatArray) -> FloatArray:
    """Half width and half height (n, 2) of quads, pixels."""
    along = np.linalg.norm(np.roll(corners, -1, axis=1) - corners, axis=2)
    return np.asarray((along[:, :2] + along[:, 2:]) / 4)


def _in_square(
    points: EdgePoints, corners: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """u, v of the points where the quads' corners are (±1, ±1); half sides (N, 2)."""
    owner = points.owner
    with np.errstate(all="ignore"):
        inverse = np.linalg.inv(_from_square(corners))
        x, y = points.xy.T
        a = inverse[owner]
        u, v, w = (a[:, k, 0] * x + a[:, k, 1] * y + a[:, k, 2] for k in range(3))
        return u / w, v / w, _half_sides(corners)[owner]


def _from_square(corners: FloatArray) -> FloatArray:
    """Homographies (n, 3, 3) from (-1, -1), (1, -1), (1, 1), (-1, 1) to quads (n, 4, 2).

    In closed form (Heckbert, "Fundamentals of Texture Mapping", 1989, Section 2.2.3).
    """
    p0, p1, p2, p3 = corners.swapaxes(0, 1)
    d1, d2, s = p1 - p2, p3 - p2, p0 - p1 + p2 - p3
    det = d1[:, 0] * d2[:, 1] - d1[:, 1] * d2[:, 0]
    g = (s[:, 0] * d2[:, 1] - s[:, 1] * d2[:, 0]) / det
    h = (d1[:, 0] * s[:, 1] - d1[:, 1] * s[:, 0]) / det
    unit = np.empty((len(corners), 3, 3))
    unit[:, :2, 0] = p1 - p0 + g[:, None] * p1
    unit[:, :2, 1] = p3 - p0 + h[:, None] * p3
    unit[:, :2, 2] = p0
    unit[:, 2] = np.stack([g, h, np.ones_like(g)], axis=1)
    unit[~np.isfinite(unit).all(axis=(1, 2))] = np.eye(3)
    return np.asarray(unit @ np.array([[0.5, 0, 0.5], [0, 0.5, 0.5], [0, 0, 1]]))


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
