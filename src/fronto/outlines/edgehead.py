"""The edge head asked about a photo's outlines: where the edges lie that they are to follow.

What the head tells of each curve is weighed against what the masks tell of all eight together: of
a mask's errors, that of its size is the largest, those of its sides' places are smaller, and those
of their directions, or of an ellipse's form, the smallest. So one curve at which the head sees the
wrong edge, or hardly any, follows the others. This is the posterior mean of a Gaussian process of
eight places (Rasmussen and Williams, Gaussian Processes for Machine Learning, equation 2.25); its
covariance gives the deviations.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from fronto.outlines.edgeprofiles import (
    CURVES,
    SHARE,
    Curves,
    EdgeHead,
    about,
    ellipse_curves,
    profiles,
    quad_curves,
    told_places,
)
from fronto.outlines.fits import Quads, fit_ellipses, intersections
from fronto.outlines.kinds import Shapes
from fronto.shapes import FloatArray

__all__ = ["Told", "asked_about", "told_edges"]

#: Smaller outlines have too few pixels across.
LEAST_SIZE_PX = 6.0
#: Deviations of masks' edges from the buttons', pixels and a share of the size, as measured on
#: renders: all around; of a quad's sides, and of their halves; of an ellipse's place and form, and
#: of its eighths.
AROUND = (0.5, 0.05)
SIDES, HALVES = (0.4, 0.02), (0.08, 0.015)
HARMONICS, EIGHTHS = (0.25, 0.015), (0.03, 0.001)
#: What is left open comes out so much larger than errors on renders are: of outlines, of forms.
STD, FORM = 0.6, 0.7
#: A quad whose corners are moved further than that, in sizes, stays as the masks have it.
FARTHEST = 0.4
#: One button by itself does not tell which of its edges is meant.
LEAST_OUTLINES = 2
#: Which edge is meant the head may get wrong all around: a deviation, as above.
WRONG = (0.1, 0.02)
#: What the head's own deviation does not show, pixels.
LEAST_STD_PX = 0.05

_ONE, _SAME_SIDE = np.eye(CURVES), np.kron(np.eye(4), np.ones((2, 2)))
#: An ellipse's edge moves by size, place and form as these do over its eighths.
_ANGLES = 2 * np.pi * (np.arange(CURVES) + 0.5) / CURVES
_WAVES = np.stack(
    [np.ones(CURVES), *(f(k * _ANGLES) for k in (1, 2) for f in (np.cos, np.sin))], axis=1
)
_SAME_WAVES = _WAVES[:, 1:] @ _WAVES[:, 1:].T
#: Moving a quad to the right, down, and making it larger, as moves of its sides' two ends outwards.
_MOVES = np.repeat([[0, 1, 0, -1], [-1, 0, 1, 0], [1, 1, 1, 1]], 2, axis=1)
#: From places to what a quad's form is of them, and to an ellipse's size, place and form.
_FORM = np.eye(CURVES) - _MOVES.T @ np.linalg.pinv(_MOVES.T)
_WAVES_OF = np.linalg.pinv(_WAVES)


class Told(NamedTuple):
    """Outlines moved to the edges that the head has told.

    Parameters
    ----------
    rows
        (m,): which of the photo's outlines.
    lines
        (m, 4, 3): the sides of quads; of ellipses those of the masks.
    shape
        (m, 5): ellipses, as `fronto.outlines.fits.Ellipses` has them; of quads those of the masks.
    std
        (m,) pixels: deviation of corners' coordinates, or of centre and axes.
    form_std
        (m,) pixels: the same with place and size left open.
    """

    rows: npt.NDArray[np.intp]
    lines: FloatArray
    shape: FloatArray
    std: FloatArray
    form_std: FloatArray


def told_edges(
    image: npt.NDArray[Any],
    shapes: Shapes,
    size: FloatArray,
    blur: FloatArray,
    whole: npt.NDArray[np.bool_],
    head: EdgeHead,
) -> Told | None:
    """Ask the head about all quads and ellipses of a photo at once.

    Parameters
    ----------
    image
        (h, w, 3) uint8.
    shapes
        From the masks.
    size, blur
        (n,): of the masks, as `fronto.outlines.edges.EdgePoints` has them.
    whole
        (n,): those that it is to be asked about.
    head
        The edge head.

    Returns
    -------
    What it has told; None where there is nothing to ask about.
    """
    asked = asked_about(shapes, size, whole)
    if asked is None:
        return None
    rows, curves, is_round = asked
    if len(rows) < LEAST_OUTLINES:
        return None
    probability = head.run(profiles(image, curves), about(size[rows], blur[rows], is_round))
    places = told_places(probability, curves)
    offset, covariance = _weighed(*places, size[rows], is_round)
    moved = curves.xy + offset[..., None, None] * curves.normal
    lines, shape = shapes.quads.lines[rows], shapes.ellipses.shape[rows]
    good, stds = np.empty(len(rows), bool), np.empty((2, len(rows)))
    if not is_round.all():
        of = ~is_round
        before = intersections(lines[of])
        lines[of] = _through(moved[of].mean(axis=2).reshape(-1, 4, 2, 2))
        with np.errstate(invalid="ignore"):
            away = np.abs(intersections(lines[of]) - before).max(axis=(1, 2))
        good[of] = away <= FARTHEST * size[rows[of]]
        share = np.minimum(SHARE, 1 - shapes.radius[rows[of]])
        stds[:, of] = _quad_stds(covariance[of], share)
    if is_round.any():
        points = moved[is_round].reshape(np.count_nonzero(is_round), -1, 2)
        first = np.arange(len(points) + 1, dtype=np.int64) * points.shape[1]
        shape[is_round] = fit_ellipses(points.reshape(-1, 2), first, shape[is_round]).shape
        good[is_round] = np.isfinite(shape[is_round]).all(axis=1)
        stds[:, is_round] = _ellipse_stds(covariance[is_round])
    std, form_std = STD * stds[0][good], FORM * stds[1][good]
    return Told(rows[good], lines[good], shape[good], std, form_std)


def asked_about(
    shapes: Shapes, size: FloatArray, whole: npt.NDArray[np.bool_]
) -> tuple[npt.NDArray[np.intp], Curves, npt.NDArray[np.bool_]] | None:
    """Which outlines have curves to look across, these curves, and which are round."""
    kinds = np.array(shapes.kind)
    sides = np.isfinite(intersections(shapes.quads.lines)).all(axis=(1, 2))
    sides &= np.isfinite(shapes.quads.rms).all(axis=1)
    fitted = np.isfinite(shapes.ellipses.shape).all(axis=1)
    usable = ((kinds == "quad") & sides) | ((kinds == "ellipse") & fitted)
    rows = np.flatnonzero(usable & whole & (size >= LEAST_SIZE_PX))
    if not len(rows):
        return None
    is_round = kinds[rows] == "ellipse"
    of, other = rows[~is_round], rows[is_round]
    parts = []
    if len(of):
        quads = Quads(*(a[of] for a in shapes.quads))
        parts.append(quad_curves(quads, shapes.radius[of], size[of]))
    if len(other):
        parts.append(ellipse_curves(shapes.ellipses.shape[other], size[other]))
    if len(parts) == 1:
        return rows, parts[0], is_round
    order = np.argsort(np.argsort(is_round, kind="stable"))
    curves = Curves(*(np.concatenate(part)[order] for part in zip(*parts, strict=True)))
    return rows, curves, is_round


def _weighed(
    offset: FloatArray, std: FloatArray, size: FloatArray, is_round: npt.NDArray[np.bool_]
) -> tuple[FloatArray, FloatArray]:
    """Places (n, 8) with what masks' errors are like, and their covariance (n, 8, 8)."""
    pixels, share = np.array([AROUND, WRONG, SIDES, HALVES, HARMONICS, EIGHTHS]).T
    variances = (pixels[:, None] + share[:, None] * size) ** 2
    around, wrong, sides, halves, harmonics, eighths = variances[..., None, None]
    prior = np.where(
        is_round[:, None, None],
        around + harmonics * _SAME_WAVES + eighths * _ONE,
        around + sides * _SAME_SIDE + halves * _ONE,
    )
    noise = (std**2 + LEAST_STD_PX**2)[..., None] * _ONE + wrong
    gain = np.linalg.solve(prior + noise, prior).swapaxes(1, 2)
    return (gain @ offset[..., None])[..., 0], prior - gain @ prior


def _quad_stds(covariance: FloatArray, share: FloatArray) -> FloatArray:
    """Deviation of corners' coordinates, all of it and that of the form: (2, n)."""
    # From a side's halves to its ends, which lie further out.
    out = 0.5 + 1 / share
    ends = np.zeros((len(share), CURVES, CURVES))
    for k in range(0, CURVES, 2):
        ends[:, k, k] = ends[:, k + 1, k + 1] = out
        ends[:, k, k + 1] = ends[:, k + 1, k] = 1 - out
    at_ends = ends @ covariance @ ends.swapaxes(1, 2)
    parts = (at_ends, _FORM @ at_ends @ _FORM.T)
    variances = [np.trace(part, axis1=1, axis2=2) / CURVES for part in parts]
    return np.asarray(np.sqrt(np.stack(variances)))


def _ellipse_stds(covariance: FloatArray) -> FloatArray:
    """Deviation of centre and axes, and of half the axes' difference: (2, n)."""
    waves = _WAVES_OF @ covariance @ _WAVES_OF.T
    around, *others = np.moveaxis(np.diagonal(waves, axis1=1, axis2=2), 1, 0)
    place, form = (others[0] + others[1]) / 2, (others[2] + others[3]) / 2
    return np.asarray(np.sqrt(np.stack([(place + around + form) / 2, form])))


def _through(points: FloatArray) -> FloatArray:
    """Lines (n, 4, 3) through two points each, (n, 4, 2, 2), normals to the left of the way."""
    along = points[:, :, 1] - points[:, :, 0]
    along /= np.maximum(np.linalg.norm(along, axis=2, keepdims=True), 1e-9)
    normal = np.stack([along[..., 1], -along[..., 0]], axis=2)
    return np.concatenate([normal, (normal * points[:, :, 0]).sum(axis=2, keepdims=True)], axis=2)
