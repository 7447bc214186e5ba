"""Edges in the photo across outlines found from masks: where the brightness or colour steps.

Along each curve (a quad's side, an ellipse) stations are placed, and the photo is sampled
across the curve at each of them.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from fronto.shapes import FloatArray

__all__ = ["Edges", "Stations", "common_offset", "find_edges", "sampled", "steps"]

#: Samples across a curve, on either side of it.
ACROSS = 12
#: First look and closer look: reach across, in sizes of the button; and at least, pixels.
REACHES = ((0.13, 3.0), (0.05, 3.0))
#: Derivative of a Gaussian whose deviation is this many samples (Canny, PAMI 8, 1986).
BLURS = (1.5, 3.5)
#: OpenCV's remap takes maps of less than 32768 rows.
MOST_ROWS = 30_000
#: Weights of neighbouring stations.
ALONG = (0.0625, 0.25, 0.375, 0.25, 0.0625)
#: A station's edge is found within this share of the reach around its curve's edge.
NEAR = 0.35
#: Neighbouring stations have noise in common: this many are one.
TOGETHER = 3.5
#: It counts if it is this strong, compared with the curve's.
LEAST_STEP = 0.35
#: Edges of one photo are at the same place of each button, but for this much, in sizes.
SAME_SD, SAME_SD_PX = 0.012, 0.4


class Stations(NamedTuple):
    """Where to look: c curves, k stations on each.

    Parameters
    ----------
    xy, normal
        (c, k, 2): places in the photo, and unit normals pointing out of the button.
    size
        (c,): of the button that each curve belongs to, pixels.
    off
        (c,): how far the mask's edge may be from the photo's, a deviation, pixels.
    signed
        Whether a curve's edge steps the same way along all of it.
    """

    xy: FloatArray
    normal: FloatArray
    size: FloatArray
    off: FloatArray
    signed: bool


class Edges(NamedTuple):
    """What was found at each of the stations.

    Parameters
    ----------
    offset
        (c, k): distance of the edge from the station along its normal, pixels; NaN: none.
    step
        (c,): strength of the curve's edge, compared with what else is around; 1 is nothing.
    sure
        (c,): the edge's mean step over its deviation from station to station, as of a mean
        (Student's t): noise has edges, too, but not the same at all stations.
    """

    offset: FloatArray
    step: FloatArray
    sure: FloatArray


def steps(
    image: npt.NDArray[Any], stations: Stations, reach: FloatArray, blur: float
) -> FloatArray:
    """How fast the photo changes across the curves.

    Parameters
    ----------
    image
        (h, w, channels) uint8.
    reach
        (c,): how far to look on either side, pixels.
    blur
        Deviation of the derivative's Gaussian, samples.

    Returns
    -------
    (c, k, 2 ACROSS + 1, channels), grey levels a sample.
    """
    import cv2

    extra = int(np.ceil(2.5 * blur))
    samples = np.arange(-ACROSS - extra, ACROSS + extra + 1) / ACROSS
    offsets = samples * reach[:, None]
    places = (
        stations.xy[:, :, None] + offsets[:, None, :, None] * stations.normal[:, :, None]
    ).astype(np.float32)
    curves, count, across = places.shape[:3]
    channels = image.shape[2]
    values = sampled(image, places.reshape(curves * count, across, 2))
    values = values.reshape(curves, count, across, channels)
    # Neighbouring stations see the same edge, with other noise; not those of other curves.
    aside = len(ALONG) // 2
    at = np.arange(-aside, count + aside)
    at = np.clip(at, 0, count - 1) if stations.signed else at % count
    t = np.arange(-extra, extra + 1, dtype=np.float64)
    kernel = t * np.exp(-0.5 * (t / blur) ** 2)
    kernel = kernel / (t * kernel).sum()
    rows = values[:, at].reshape(-1, across, channels)
    change = cv2.sepFilter2D(rows, cv2.CV_32F, kernel, np.array(ALONG))
    change = change.reshape(curves, count + 2 * aside, across, channels)
    return np.asarray(change[:, aside:-aside, extra:-extra])


def sampled(image: npt.NDArray[Any], places: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    """The photo at places (n, k, 2), pixels; shape (n, k, channels).

    Between pixels it is interpolated linearly; beyond the border its edge pixels go on.
    """
    import cv2

    x, y = np.ascontiguousarray(places.transpose(2, 0, 1))
    parts = [
        cv2.remap(
            image,
            x[k : k + MOST_ROWS],
            y[k : k + MOST_ROWS],
            cv2.INTER_LINEAR,
            borderMode=cv2.BORDER_REPLICATE,
        )
        for k in range(0, len(x), MOST_ROWS)
    ]
    return np.concatenate(parts).reshape(*places.shape[:2], -1).astype(np.float32)


def common_offset(strength: FloatArray, off: FloatArray) -> float:
    """Where on the buttons of this photo the edge is that the masks mean, in reaches.

    Buttons have several edges (bezels, rings); their masks waver between them, but which of
    them is meant is the same for all.

    Parameters
    ----------
    strength
        (c, m): of the edges across each curve.
    off
        (c,): deviation of the masks' edges, in reaches.
    """
    if not len(strength):
        return 0.0
    place = np.linspace(-1, 1, strength.shape[1])
    share = strength / np.maximum(strength.max(axis=1, keepdims=True), 1e-6)
    prior = np.exp(-0.5 * (place / off[:, None]) ** 2)
    return float(place[int((share * prior).sum(axis=0).argmax())])


def _reach(sizes: FloatArray, look: int) -> FloatArray:
    share, least = REACHES[look]
    return np.asarray(np.maximum(share * sizes, least))


def find_edges(image: npt.NDArray[Any], stations: Stations, look: int) -> Edges:
    """Find each curve's edge, at all of its stations.

    Parameters
    ----------
    look
        0: the curves are from masks; 1: they were found here before.
    """
    reach = _reach(stations.size, look)
    change = steps(image, stations, reach, BLURS[look])
    strength = _strength(change, stations.signed)
    place = np.linspace(-1, 1, strength.shape[1])
    if look == 0:
        common = common_offset(strength, stations.off / reach)
        sd = np.maximum(SAME_SD * stations.size, SAME_SD_PX) / reach
    else:
        common, sd = 0.0, np.full(len(reach), 0.5)
    wanted = strength * np.exp(-0.5 * ((place - common) / sd[:, None]) ** 2)
    rows = np.arange(len(strength))
    peak = wanted.argmax(axis=1)
    # Uphill from there to the edge itself: the wish for the common place moves its flank.
    for _ in range(ACROSS // 3):
        left, right = np.maximum(peak - 1, 0), np.minimum(peak + 1, len(place) - 1)
        around = np.stack([strength[rows, left], strength[rows, peak], strength[rows, right]])
        peak = np.clip(peak + around.argmax(axis=0) - 1, 0, len(place) - 1)
    found = strength[rows, peak]
    step = found / np.maximum(np.median(strength, axis=1), 1e-3)
    height = _heights(change, peak, stations.signed)
    offset = _station_edges(height, peak, found)
    at_peak = height[rows, :, peak]
    spread = at_peak.std(axis=1) / np.sqrt(at_peak.shape[1] / TOGETHER)
    sure = at_peak.mean(axis=1) / np.maximum(spread, 1e-6)
    return Edges(offset * reach[:, None], np.where(found > 0.5, step, 0.0), sure)


def _strength(change: FloatArray, signed: bool) -> FloatArray:
    """(c, m): mean change over a curve's stations, all channels."""
    if signed:
        return np.asarray(np.linalg.norm(change.mean(axis=1), axis=2))
    return np.asarray(np.linalg.norm(change, axis=3).mean(axis=1))


def _heights(change: FloatArray, peak: npt.NDArray[np.intp], signed: bool) -> FloatArray:
    """(c, k, m): change along the curve's own step in colour; unsigned: of any colour."""
    if not signed:
        return np.asarray(np.linalg.norm(change, axis=3))
    direction = change.mean(axis=1)[np.arange(len(change)), peak]
    length = np.maximum(np.linalg.norm(direction, axis=1, keepdims=True), 1e-6)
    return np.asarray(np.einsum("ckmi,ci->ckm", change, direction / length))


def _station_edges(height: FloatArray, peak: npt.NDArray[np.intp], found: FloatArray) -> FloatArray:
    """(c, k) place of each station's edge, in reaches; NaN where it shows none."""
    curves, count, across = height.shape
    near = np.abs(np.arange(across) - peak[:, None]) <= NEAR * ACROSS
    masked = np.where(near[:, None], height, -np.inf)
    at = np.clip(masked.argmax(axis=2), 1, across - 2)
    i, j = np.arange(curves)[:, None], np.arange(count)[None]
    low, middle, high = height[i, j, at - 1], height[i, j, at], height[i, j, at + 1]
    bend = low - 2 * middle + high
    with np.errstate(all="ignore"):
        shift = 0.5 * (low - high) / bend
    # A peak at the window's end is a flank of something else.
    good = (bend < 0) & (np.abs(shift) <= 1) & (middle >= LEAST_STEP * found[:, None])
    return np.where(good, (at + shift - (across - 1) / 2) / ACROSS, np.nan)
