"""Frames of video files and cameras, by OpenCV."""

from __future__ import annotations

import contextlib
import logging
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from fronto.errors import InputError

if TYPE_CHECKING:
    from cv2 import VideoCapture

__all__ = ["DEFAULT_RATE_HZ", "RATES_HZ", "Frame", "frames"]

log = logging.getLogger(__name__)

Picture = npt.NDArray[np.uint8]

#: Frames a second where a video states none, or nonsense.
DEFAULT_RATE_HZ = 30.0
RATES_HZ = (0.1, 1000.0)
#: What a container calls its number of frames is now and then an estimate.
COUNT_TRUSTED = 0.9


@dataclass(frozen=True, eq=False)
class Frame:
    """One frame of a video.

    Parameters
    ----------
    number
        Its place in the video, from 0; frames that `every` leaves out are counted.
    time_s
        Seconds from the start of the video, or from a camera's first frame.
    image
        Shape (h, w, 3), uint8, RGB, upright, read-only.
    rate_hz
        Frames a second of those handed out, as the source states it; 30 where it does not.
    """

    number: int
    time_s: float
    image: Picture
    rate_hz: float = DEFAULT_RATE_HZ


def frames(source: str | Path | int, *, every: int = 1) -> Iterator[Frame]:
    """Read a video's frames one after the other.

    The file or the camera is opened at the first frame, and released when the iterator is
    exhausted or closed, or fails. How a phone was held is applied, so that frames are
    upright; pixels are taken as square. Times never run backwards: where a file's do,
    they are counted on at the rate that it states. Frames that cannot be decoded are left
    out; a file that ends early gives the frames that it has, and a warning in the log.

    Parameters
    ----------
    source
        A video file, or the index of a camera (0 is the first).
    every
        Hand out every so many-th frame only; the others are not decoded to pixels.

    Raises
    ------
    InputError
        If the file is missing or no video, the camera does not open, either gives no frame,
        or an argument is out of range.
    """
    import cv2

    if every < 1:
        raise InputError("every", f"expected 1 or more, got {every}", "1 takes all frames")
    thing = f"camera {source}" if isinstance(source, int) else f"video {source}"
    with contextlib.ExitStack() as stack:
        capture = _opened(source, thing)
        stack.callback(capture.release)
        live = isinstance(source, int)
        stated = _rate(capture.get(cv2.CAP_PROP_FPS))
        number, began = 0, math.nan
        last: Frame | None = None
        while _grabbed(capture):
            here, number = number, number + 1
            if live:
                now = time.monotonic()
                began = now if here == 0 else began
                time_s = now - began
            else:
                time_s = capture.get(cv2.CAP_PROP_POS_MSEC) / 1e3
            image = None if here % every else _pixels(capture)
            if image is None:
                continue
            if last is not None and not (math.isfinite(time_s) and time_s > last.time_s):
                time_s = last.time_s + (here - last.number) / stated
            elif not math.isfinite(time_s):
                time_s = 0.0
            last = Frame(here, time_s, image, stated / every)
            yield last
        if last is None:
            raise InputError(
                thing,
                "expected frames, got none",
                "check that no other program uses it" if live else "record or convert it again",
            )
        count = capture.get(cv2.CAP_PROP_FRAME_COUNT)
        if not live and number < COUNT_TRUSTED * count:
            log.warning("%s: states %d frames, gives %d: cut short?", thing, count, number)


def _opened(source: str | Path | int, thing: str) -> VideoCapture:
    import cv2

    if isinstance(source, int):
        if isinstance(source, bool) or source < 0:
            raise InputError("camera", f"expected an index, 0 or more, got {source}")
        capture = cv2.VideoCapture(source)
        if not capture.isOpened():
            capture.release()
            raise InputError(
                thing,
                f"expected a camera at index {source}, got none that opens",
                "check that it is plugged in and no other program uses it, or try another index",
            )
        return capture
    path = Path(source)
    _check_file(path, thing)
    # An absolute path is neither taken for a device nor for a network protocol.
    capture = cv2.VideoCapture(str(path.absolute()), cv2.CAP_FFMPEG)
    if not capture.isOpened():
        capture.release()
        raise InputError(
            thing,
            "expected a video, got a damaged file or one of another kind",
            "record it again, or convert it to MP4 (H.264)",
        )
    capture.set(cv2.CAP_PROP_ORIENTATION_AUTO, 1)
    return capture


def _check_file(path: Path, thing: str) -> None:
    try:
        if not path.exists():
            raise InputError(thing, "expected a file, there is none", "check the path")
        if not path.is_file():
            raise InputError(thing, "expected a video file, got a folder or device", "name a file")
        with path.open("rb") as file:
            empty = not file.read(1)
    except (OSError, ValueError) as error:
        if isinstance(error, InputError):
            raise
        reason = getattr(error, "strerror", None) or "not a path"
        raise InputError(
            thing, f"expected a readable file, got: {reason}", "check the path and its permissions"
        ) from None
    if empty:
        raise InputError(thing, "expected a video, got an empty file", "record it again")


def _grabbed(capture: VideoCapture) -> bool:
    import cv2

    try:
        return bool(capture.grab())
    except cv2.error:  # as good as the end: what comes behind cannot be decoded
        return False


def _pixels(capture: VideoCapture) -> Picture | None:
    """The grabbed frame, (h, w, 3) RGB, read-only; None if it cannot be decoded."""
    import cv2

    try:
        found, image = capture.retrieve()
        if not found or image is None or image.size == 0:
            return None
        rgb = np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2RGB), dtype=np.uint8)
    except cv2.error:
        return None
    rgb.setflags(write=False)
    return rgb


def _rate(stated: float) -> float:
    low, high = RATES_HZ
    return stated if low <= stated <= high else DEFAULT_RATE_HZ
