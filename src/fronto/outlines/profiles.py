"""Edges in the photo across outlines found from masks: where the brightness or colour steps.

Along each curve (a quad's side, an ellipse) stations are placed, and the photo is sampled
across the curve at each of them: the ctypes side of ``native/outline_change.c``.
"""

from __future__ import annotations

import ctypes
import functools
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from fronto.native import address, library
from fronto.shapes import FloatArray

__all__ = ["Edges", "Stations", "common_offset", "find_edges", "mean_profiles", "sampled"]

#: First look and closer look: samples across a curve, on either side of it.
ACROSS = (12, 8)
#: Reach across, in sizes of the button; and at least, pixels.
REACHES = ((0.13, 3.0), (0.05, 3.0))
#: Derivative of a Gaussian whose deviation is this many samples (Canny, PAMI 8, 1986).
BLURS = (1.5, 2.33)
#: Weights of neighbouring stations: they see the same edge, with other noise.
ALONG = np.array([0.0625, 0.25, 0.375, 0.25, 0.0625], np.float32)
#: A station's edge is found within this share of the reach around its curve's edge.
NEAR = 0.375
#: Neighbouring stations have noise in common: this many are one.
TOGETHER = 3.5
#: It counts if it is this strong, compared with the curve's.
LEAST_STEP = 0.35
#: Edges of one photo are at the same place of each button, but for this much, in sizes.
SAME_SD, SAME_SD_PX = 0.012, 0.4
#: What the compiled side has room for: stations whose mean is taken, samples across.
MOST_STATIONS, MOST_ACROSS = 16, 96


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


class _Lines(NamedTuple):
    """The photo across c curves, at k stations of each.

    Parameters
    ----------
    values
        (c, k, samples, channels), float32.
    kernel
        Derivative of a Gaussian, over the samples: what the photo's changes are found with.
    signed
        As `Stations` has it.
    """

    values: npt.NDArray[np.float32]
    kernel: npt.NDArray[np.float32]
    signed: bool

    @property
    def places(self) -> int:
        """How many samples have a change: as many on either side of the curve."""
        return int(self.values.shape[2]) - len(self.kernel) + 1

    def given(self) -> tuple[int, ...]:
        """The first ten arguments of the kernels."""
        return (
            *self.values.shape,
            address(self.values, np.float32),
            len(self.kernel),
            address(self.kernel, np.float32),
            len(ALONG) // 2,
            address(ALONG, np.float32),
            int(not self.signed),
        )


def _lines(image: npt.NDArray[Any], stations: Stations, reach: FloatArray, look: int) -> _Lines:
    """Sample the photo (h, w, channels), uint8, as far as `reach` (c,), pixels, on either side."""
    blur = BLURS[look]
    curves, count = stations.xy.shape[:2]
    image = np.ascontiguousarray(image)
    extra = int(np.ceil(2.5 * blur))
    t = np.arange(-extra, extra + 1, dtype=np.float64)
    kernel = t * np.exp(-0.5 * (t / blur) ** 2)
    kernel /= (t * kernel).sum()
    across = 2 * (ACROSS[look] + extra) + 1
    values = np.empty((curves, count, across, image.shape[2]), np.float32)
    where = [np.ascontiguousarray(a, np.float64) for a in (stations.xy, stations.normal, reach)]
    _kernels().fronto_lines(
        address(image, np.uint8),
        *image.shape,
        curves,
        count,
        *(address(a, np.float64) for a in where),
        across,
        extra,
        address(values, np.float32),
    )
    return _Lines(values, kernel.astype(np.float32), stations.signed)


def mean_profiles(
    image: npt.NDArray[Any], xy: FloatArray, normal: FloatArray, reach: FloatArray, across: int
) -> npt.NDArray[np.float32]:
    """The photo (h, w, channels), uint8, across curves, each one's stations taken together.

    Parameters
    ----------
    xy, normal
        (c, k, 2): stations, and unit normals; k up to 16.
    reach
        (c,): of the outermost samples on either side, pixels.
    across
        How many samples, up to 96.

    Returns
    -------
    Shape (c, across, channels + 1), from the side that normals point away from: means over the
    stations, and their mean absolute difference from these.
    """
    curves, count = xy.shape[:2]
    assert count <= MOST_STATIONS
    assert across <= MOST_ACROSS
    image = np.ascontiguousarray(image)
    values = np.empty((curves, across, image.shape[2] + 1), np.float32)
    where = [np.ascontiguousarray(a, np.float64) for a in (xy, normal, reach)]
    _kernels().fronto_profiles(
        address(image, np.uint8),
        *image.shape,
        curves,
        count,
        *(address(a, np.float64) for a in where),
        across,
        address(values, np.float32),
    )
    return values


def sampled(image: npt.NDArray[Any], places: FloatArray) -> npt.NDArray[np.float32]:
    """The photo (h, w, channels), uint8, at places (..., 2), pixels; shape (..., channels).

    Between pixels it is interpolated linearly; beyond the border its edge pixels go on.
    """
    image = np.ascontiguousarray(image)
    places = np.ascontiguousarray(places, np.float64)
    values = np.empty((*places.shape[:-1], image.shape[2]), np.float32)
    _kernels().fronto_sample(
        address(image, np.uint8),
        *image.shape,
        places.size // 2,
        address(places, np.float64),
        address(values, np.float32),
    )
    return values


@functools.cache
def _kernels() -> Any:
    kernels = library()
    size, pointer = ctypes.c_int64, ctypes.c_void_p
    photo: list[Any] = [pointer, size, size, size]
    kernels.fronto_sample.argtypes = [*photo, size, pointer, pointer]
    kernels.fronto_sample.restype = None
    kernels.fronto_lines.argtypes = [
        *photo, size, size, pointer, pointer, pointer, size, size, pointer
    ]  # fmt: skip
    kernels.fronto_lines.restype = None
    kernels.fronto_profiles.argtypes = [
        *photo, size, size, pointer, pointer, pointer, size, pointer
    ]  # fmt: skip
    kernels.fronto_profiles.restype = None
    kernels.fronto_peaks.argtypes = [
        size, size, pointer, ctypes.c_double, pointer, size, pointer, pointer, pointer
    ]  # fmt: skip
    kernels.fronto_peaks.restype = ctypes.c_int
    lines: list[Any] = [*[size] * 4, pointer, size, pointer, size, pointer, ctypes.c_int]
    kernels.fronto_strengths.argtypes = [*lines, pointer]
    kernels.fronto_strengths.restype = ctypes.c_int
    kernels.fronto_station_edges.argtypes = [
        *lines, pointer, pointer, size, ctypes.c_double, pointer, pointer, pointer
    ]  # fmt: skip
    kernels.fronto_station_edges.restype = ctypes.c_int
    return kernels


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
    lines = _lines(image, stations, reach, look)
    strength = _strengths(lines)
    if look == 0:
        common = common_offset(strength, stations.off / reach)
        sd = np.maximum(SAME_SD * stations.size, SAME_SD_PX) / reach
    else:
        common, sd = 0.0, np.full(len(reach), 0.5)
    peak, found, median = _peaks(strength, common, sd, ACROSS[look] // 3)
    step = found / np.maximum(median, 1e-3)
    at, mean, deviation = _station_edges(lines, peak, found)
    offset = (at / ACROSS[look] - 1) * reach[:, None]
    sure = mean / np.maximum(deviation / np.sqrt(stations.xy.shape[1] / TOGETHER), 1e-6)
    return Edges(offset, np.where(found > 0.5, step, 0.0), sure)


def _strengths(lines: _Lines) -> FloatArray:
    """(c, places): how fast the photo changes along each whole curve, grey levels a sample."""
    strength = np.empty((len(lines.values), lines.places))
    if not _kernels().fronto_strengths(*lines.given(), address(strength, np.float64)):
        raise MemoryError
    return strength


def _peaks(
    strength: FloatArray, common: float, sd: FloatArray, walk: int
) -> tuple[npt.NDArray[np.int64], FloatArray, FloatArray]:
    """Place (c,) of each curve's edge, its strength, and the median strength of all places.

    The strongest near `common`, from -1 to 1, with a deviation of `sd` (c,); then at most `walk`
    places uphill to the edge itself: the wish for the common place moves its flank.
    """
    n, m = strength.shape
    peak, found, median = np.empty(n, np.int64), np.empty(n), np.empty(n)
    sd = np.ascontiguousarray(sd, np.float64)
    done = _kernels().fronto_peaks(
        n,
        m,
        address(strength, np.float64),
        common,
        address(sd, np.float64),
        walk,
        address(peak, np.int64),
        address(found, np.float64),
        address(median, np.float64),
    )
    if not done:
        raise MemoryError
    return peak, found, median


def _station_edges(
    lines: _Lines, peak: npt.NDArray[np.int64], found: FloatArray
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """(c, k) place of each station's edge among those across, NaN where it shows none.

    And (c,) mean and deviation of the stations' steps at the curve's peak: along the curve's own
    step in colour; unsigned: of any colour.
    """
    curves, count = lines.values.shape[:2]
    place, mean, deviation = np.empty((curves, count)), np.empty(curves), np.empty(curves)
    done = _kernels().fronto_station_edges(
        *lines.given(),
        address(peak, np.int64),
        address(found, np.float64),
        int(NEAR * (lines.places // 2)),
        LEAST_STEP,
        *(address(a, np.float64) for a in (place, mean, deviation)),
    )
    if not done:
        raise MemoryError
    return place, mean, deviation
