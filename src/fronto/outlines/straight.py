"""Straight segments of a photo, wherever they run (OpenCV's line segment detector).

Grompone von Gioi, Jakubowicz, Morel and Randall, "LSD", IPOL 2012.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Future
from contextlib import contextmanager
from contextvars import ContextVar
from threading import Thread

import numpy as np
import numpy.typing as npt

from fronto.shapes import FloatArray

__all__ = ["END_STD", "once_a_photo", "straight_segments"]

#: Ends (n, 2, 2) of segments, and their deviation.
_Found = tuple[FloatArray, float]

#: Photos are looked at with this many pixels.
PIXELS = 500_000
#: Deviation of a segment's ends across it, pixels looked at.
END_STD = 0.6


class _Once:
    """The segments of one photo: looked for when first asked for, or meanwhile."""

    def __init__(self, rgb: npt.NDArray[np.uint8]) -> None:
        self.rgb = rgb
        self._found: Future[_Found] | None = None

    def begin(self) -> None:
        """Look for them beside what is done next; OpenCV leaves the interpreter alone meanwhile."""
        self._found = Future()
        Thread(target=self._look, args=(self._found,), daemon=True).start()

    def get(self) -> _Found:
        if self._found is None:
            self._found = Future()
            self._look(self._found)
        return self._found.result()

    def _look(self, found: Future[_Found]) -> None:
        try:
            found.set_result(_segments(self.rgb, None))
        except BaseException as error:
            found.set_exception(error)

    def knows(self, rgb: npt.NDArray[np.uint8]) -> bool:
        """Whether these are the same pixels, whatever array has them."""
        ours, theirs = (a.__array_interface__ for a in (self.rgb, rgb))
        return all(ours[key] == theirs[key] for key in ("data", "shape", "strides"))


_ONCE: ContextVar[_Once | None] = ContextVar("once", default=None)


@contextmanager
def once_a_photo(rgb: npt.NDArray[np.uint8]) -> Iterator[Callable[[], None]]:
    """Within this `straight_segments` of the photo as a whole are looked for once only.

    Parameters
    ----------
    rgb
        As of `straight_segments`; nobody may change it meanwhile.

    Yields
    ------
    What may be called to look for them from then on, in a thread.
    """
    once = _Once(rgb)
    token = _ONCE.set(once)
    try:
        yield once.begin
    finally:
        _ONCE.reset(token)


def straight_segments(
    rgb: npt.NDArray[np.uint8], field: tuple[FloatArray, FloatArray] | None = None
) -> tuple[FloatArray, float]:
    """Find straight segments.

    Parameters
    ----------
    rgb
        Shape (h, w, 3) or (h, w), uint8.
    field
        Left-top and right-bottom, (2,) each, of the part to look at; None: everything.

    Returns
    -------
    Their ends (n, 2, 2), photo pixels, and the deviation of an end across its segment.
    """
    once = _ONCE.get()
    if field is None and once is not None and once.knows(rgb):
        return once.get()
    return _segments(rgb, field)


def _segments(rgb: npt.NDArray[np.uint8], field: tuple[FloatArray, FloatArray] | None) -> _Found:
    import cv2

    height, width = rgb.shape[:2]
    low, high = field or (np.zeros(2), np.array([width, height], np.float64))
    x0, y0 = (int(v) for v in np.clip(np.floor(low), 0, (width - 1, height - 1)))
    x1, y1 = (int(v) for v in np.clip(np.ceil(high), 0, (width - 1, height - 1)))
    part = np.ascontiguousarray(rgb[y0 : y1 + 1, x0 : x1 + 1])
    if part.ndim == 3:
        part = np.asarray(cv2.cvtColor(part, cv2.COLOR_RGB2GRAY), np.uint8)
    scale = min(1.0, float(np.sqrt(PIXELS / part.size)))
    if scale < 1:
        part = np.asarray(
            cv2.resize(part, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), np.uint8
        )
    if min(part.shape) < 8:
        return np.zeros((0, 2, 2)), END_STD / scale
    found = cv2.createLineSegmentDetector(cv2.LSD_REFINE_STD).detect(part)[0]
    # None where there are none, whatever its type says.
    ends = np.array([] if found is None else found, np.float64).reshape(-1, 2, 2)
    ratio = np.array([(x1 + 1 - x0) / part.shape[1], (y1 + 1 - y0) / part.shape[0]])
    return (ends + 0.5) * ratio - 0.5 + (x0, y0), END_STD / scale
