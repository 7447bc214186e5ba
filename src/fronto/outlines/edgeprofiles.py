"""What the edge head is shown of outlines: the photo across them, and how the head is asked.

Masks tell roughly where a button ends, and the photo shows several edges there: of the face, its
bevel, a ring, a gap. Across each side of an outline the photo is averaged along the side, which
leaves little noise, and a small network tells from all of a photo's outlines together which of
these edges is the button's (`fronto.train.edges`).
"""

from __future__ import annotations

from typing import Any, NamedTuple, Protocol

import numpy as np
import numpy.typing as npt

from fronto.outlines.fits import NEXT, Quads, ellipse_frames, intersections
from fronto.outlines.profiles import mean_profiles
from fronto.shapes import FloatArray

__all__ = [
    "ABOUT",
    "BINS",
    "CHANNELS",
    "CURVES",
    "Curves",
    "EdgeHead",
    "about",
    "ellipse_curves",
    "profiles",
    "quad_curves",
    "told_places",
]

#: Curves around an outline (halves of a quad's sides, eighths of an ellipse); stations along each;
#: places across it; channels at each place: the mean colour, and how far stations differ from it.
CURVES, STATIONS, BINS, CHANNELS = 8, 10, 64, 4
#: Numbers told about each outline: its size, whether it is an ellipse, how blurred its mask is.
ABOUT = 3
#: Share of a quad's side that is looked at, less its rounding.
SHARE = 0.8
#: Reach across, in sizes of the button; and at least, pixels.
REACH, LEAST_PX = 0.16, 3.0
#: Stations differ by less than colours do: how many times that is told.
DIFFERENCES = 2.0
#: Logarithm of a usual size in pixels.
USUAL_SIZE = 3.5
#: Places on either side of the likeliest one of which the mean is taken.
PEAK = 4

Floats = npt.NDArray[np.float32]


class EdgeHead(Protocol):
    """What tells edges, such as `fronto.engine.EdgeEngine`."""

    def run(self, profiles: Floats, about: Floats) -> Floats:
        """Probabilities (n, 8, 64) of the places across each curve of one photo's outlines."""


class Curves(NamedTuple):
    """Where to look, around n outlines.

    Parameters
    ----------
    xy, normal
        (n, 8, 10, 2): stations in the photo, and unit normals pointing out of the button.
    reach
        (n,): how far across to look on either side, pixels.
    """

    xy: FloatArray
    normal: FloatArray
    reach: FloatArray

    def places(self) -> FloatArray:
        """How far out of the outline each of the places across is, (n, 64), pixels."""
        return self.reach[:, None] * ((np.arange(BINS) + 0.5) / (BINS / 2) - 1)


def quad_curves(quads: Quads, radius: FloatArray, size: FloatArray) -> Curves:
    """Halves of quads' sides.

    Parameters
    ----------
    quads
        n of them, whose sides meet.
    radius
        (n,): of their corners, in half sides.
    size
        (n,): root of each one's area, pixels.
    """
    corners = intersections(quads.lines)
    along = corners[:, NEXT] - corners
    length = np.maximum(np.linalg.norm(along, axis=2), 1e-9)
    tangent = along / length[..., None]
    normal = np.stack([tangent[..., 1], -tangent[..., 0]], axis=2)
    share = np.minimum(SHARE, 1 - radius)
    t = side_places(share)
    xy = (corners + along / 2)[:, :, None] + t[:, None, :, None] * along[:, :, None]
    n = len(corners)
    normals = np.broadcast_to(normal[:, :, None], xy.shape)
    shape = (n, CURVES, STATIONS, 2)
    return Curves(xy.reshape(shape), normals.reshape(shape), _reach(size))


def side_places(share: FloatArray) -> FloatArray:
    """Where a side's stations are, from -1/2 at a corner to 1/2 at the next, (n, 20)."""
    count = 2 * STATIONS
    return np.asarray(((np.arange(count) + 0.5) / count - 0.5) * share[:, None])


def ellipse_curves(shape: FloatArray, size: FloatArray) -> Curves:
    """Eighths of ellipses (n, 5), as `fronto.outlines.fits.Ellipses` has them."""
    count = CURVES * STATIONS
    t = 2 * np.pi * (np.arange(count) + 0.5) / count
    unit = np.stack([np.cos(t), np.sin(t)], axis=1)
    frame = ellipse_frames(shape)
    xy = shape[:, None, :2] + unit @ frame.swapaxes(1, 2)
    normal = unit @ np.linalg.inv(frame)  # M (p - c) up to scale
    normal /= np.linalg.norm(normal, axis=2, keepdims=True)
    into = (len(shape), CURVES, STATIONS, 2)
    return Curves(xy.reshape(into), normal.reshape(into), _reach(size))


def _reach(size: FloatArray) -> FloatArray:
    return np.asarray(np.maximum(REACH * size, LEAST_PX))


def profiles(image: npt.NDArray[Any], curves: Curves) -> Floats:
    """The photo (h, w, 3), uint8, across curves: shape (n, 8, 64, 4), 0 to 255."""
    n = len(curves.reach)
    into = (n * CURVES, STATIONS, 2)
    outermost = np.repeat(curves.reach * (1 - 1 / BINS), CURVES)
    xy, normal = curves.xy.reshape(into), curves.normal.reshape(into)
    values = mean_profiles(image, xy, normal, outermost, BINS)
    values[..., 3] = np.minimum(DIFFERENCES * values[..., 3], 255)
    return values.reshape(n, CURVES, BINS, CHANNELS)


def about(size: FloatArray, blur: FloatArray, is_round: npt.NDArray[np.bool_]) -> Floats:
    """What else the head is told of n outlines, (n, 3).

    Parameters
    ----------
    size, blur
        (n,): of each mask, pixels, as `fronto.outlines.edges.EdgePoints` has them.
    is_round
        (n,): whether it is an ellipse.
    """
    blurred = np.minimum(blur / size, 1.0) * 4 - 1
    told = np.stack([np.log(size) - USUAL_SIZE, is_round, blurred], axis=1)
    return np.asarray(told, np.float32)


def told_places(probability: Floats, curves: Curves) -> tuple[FloatArray, FloatArray]:
    """How far out of n outlines the button's edge is at each curve, and its deviation, pixels.

    Parameters
    ----------
    probability
        (n, 8, 64): of the places.
    curves
        Which curves.

    Returns
    -------
    Both (n, 8): the mean of the places around the likeliest, and the deviation of all of them
    from it.
    """
    places = curves.places()[:, None]
    best = probability.argmax(axis=2)[..., None]
    near = probability * (np.abs(np.arange(BINS) - best) <= PEAK)
    offset = (near * places).sum(axis=2) / near.sum(axis=2)
    variance = (probability * (places - offset[..., None]) ** 2).sum(axis=2)
    return offset, np.sqrt(variance)
