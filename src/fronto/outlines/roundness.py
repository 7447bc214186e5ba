"""Whether the photo's own edges run round a button or along a square: blurred masks do not tell.

A network's mask of a small button is a blob. The ellipse, the quad and the pill that fit it agree
at the middles of the sides, and not towards the corners: there the photo shows an edge along one
of them.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt

from fronto.outlines.profiles import sampled
from fronto.shapes import FloatArray

__all__ = ["roundness"]

#: Rays from the button's middle; those of one sector see one step in brightness and colour.
RAYS, SECTORS = 32, 8
#: Radii of a quad's corners that are compared with the ellipse, in half sides.
RADII = np.array([0.0, 0.35])
#: Sizes that are compared, in those of the masks' outlines.
SCALES = np.linspace(0.84, 1.2, 10)
#: Half the distance across an outline over which the photo is compared: in sizes, at least.
ACROSS, ACROSS_PX = 0.04, 1.0
#: Steps below this are none, grey levels.
FAINT = 1.0
#: Halvings that find where a ray leaves a quad: to 0.004 of the ellipse.
HALVINGS = 9


def roundness(
    image: npt.NDArray[Any],
    inverse: FloatArray,
    half: FloatArray,
    center: FloatArray,
    frame: FloatArray,
    size: FloatArray,
) -> FloatArray:
    """How clearly the photo shows each button as a quad, as an ellipse, and as a pill.

    Parameters
    ----------
    image
        Shape (h, w, 3), uint8.
    inverse
        Shape (n, 3, 3): homographies from the photo to where the quads' corners are (±1, ±1).
    half
        Shape (n, 2): half width and height of the quads, pixels.
    center, frame
        Shapes (n, 2) and (n, 2, 2): c and L of the ellipses {c + L u : |u| = 1}.
    size
        Shape (n,): of the buttons, pixels.

    Returns
    -------
    Shape (n, 3): logarithms of the edges' strengths, 0 for the clearest; all 0 where there is
    nothing to compare.
    """
    turn = 2 * np.pi * (np.arange(RAYS) + 0.5) / RAYS
    unit = np.stack([np.cos(turn), np.sin(turn)], axis=1)
    ray = unit @ frame.swapaxes(1, 2)  # (n, k, 2)
    with np.errstate(all="ignore"):
        reach = _reaches(inverse, half, center, ray)
        outline = center[:, None, None] + reach[..., None] * ray[:, None]  # (n, m, k, 2)
        along = np.roll(outline, -1, axis=2) - np.roll(outline, 1, axis=2)
        normal = np.stack([along[..., 1], -along[..., 0]], axis=-1)
        normal /= np.linalg.norm(normal, axis=-1, keepdims=True)
        from_center = outline - center[:, None, None]
        places = center[:, None, None, None] + SCALES[:, None, None] * from_center[:, :, None]
        across = np.maximum(ACROSS * size, ACROSS_PX)[:, None, None, None]
        shift = (across * normal)[:, :, None]
        usable = np.isfinite(places).all(axis=(1, 2, 3, 4)) & np.isfinite(shift).all((1, 2, 3, 4))
    result = np.zeros((len(size), 3))
    if not usable.any():
        return result
    places, shift = places[usable], shift[usable]
    outside, inside = sampled(image, np.stack([places + shift, places - shift]))
    step = outside - inside
    sectors = step.reshape(*step.shape[:3], SECTORS, RAYS // SECTORS, -1).mean(axis=4)
    strength = np.linalg.norm(sectors, axis=-1).mean(axis=-1).max(axis=2) + FAINT
    best = np.stack([strength[:, 2:].max(axis=1), strength[:, 0], strength[:, 1]], axis=1)
    result[usable] = np.log(best / best.max(axis=1, keepdims=True))
    return result


def _reaches(
    inverse: FloatArray, half: FloatArray, center: FloatArray, ray: FloatArray
) -> FloatArray:
    """How far ellipse, pill and rounded quads are along the rays, in rays: (n, m, k)."""
    n, k = ray.shape[:2]
    low = np.full((n, 1 + len(RADII), k), 0.3)
    high = np.full((n, 1 + len(RADII), k), 2.5)
    # A pill's corners are round to half its shorter side.
    short = half.min(axis=1, keepdims=True)
    radii = np.broadcast_to(RADII[:, None], (n, len(RADII), 1))
    radius_u = np.concatenate([(short / half)[:, None, :1], radii], axis=1)
    radius_v = np.concatenate([(short / half)[:, None, 1:], radii], axis=1)
    rows = inverse[:, :, :, None, None]
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        x, y = np.moveaxis(center[:, None, None] + middle[..., None] * ray[:, None], -1, 0)
        u, v, w = (rows[:, i, 0] * x + rows[:, i, 1] * y + rows[:, i, 2] for i in range(3))
        u, v = np.abs(u / w), np.abs(v / w)
        du, dv = u - (1 - radius_u), v - (1 - radius_v)
        in_corner = (du > 0) & (dv > 0)
        with np.errstate(invalid="ignore"):
            rounded = np.hypot(du / radius_u, dv / radius_v) > 1
        outside = np.where(in_corner & (radius_u > 0), rounded, np.maximum(u, v) > 1)
        low, high = np.where(outside, low, middle), np.where(outside, middle, high)
    return np.concatenate([np.ones((n, 1, k)), (low + high) / 2], axis=1)
