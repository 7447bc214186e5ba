"""Video files out, each in one piece, by OpenCV."""

from __future__ import annotations

import contextlib
import secrets
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from fronto.errors import InputError
from fronto.videoreader import DEFAULT_RATE_HZ, RATES_HZ

if TYPE_CHECKING:
    from cv2 import VideoWriter as Cv2Writer

__all__ = ["VideoWriter"]

#: Codec by suffix, of those that OpenCV's packages write on every system.
CODECS = {".mp4": "mp4v", ".avi": "MJPG"}
EMPTY_GREY = 128


class VideoWriter:
    """Writes a video file in one piece: a reader sees the whole video or none.

    A context manager. Frames go to another name in the same folder, which is renamed when
    the block ends well, and removed when it does not. Without any picture no file appears,
    and an older one stays.

    Parameters
    ----------
    path
        Ends in .mp4 (MPEG-4 part 2) or .avi (Motion JPEG).
    rate_hz
        Frames a second, as of `Frame.rate_hz`.

    Raises
    ------
    InputError
        If the suffix or the rate is another, or the file cannot be written.
    """

    def __init__(self, path: str | Path, rate_hz: float = DEFAULT_RATE_HZ) -> None:
        self.path = Path(path)
        self.rate_hz = rate_hz
        self._thing = f"output video {path}"
        if self.path.suffix.lower() not in CODECS:
            raise InputError(
                self._thing,
                f"expected a name that ends in {' or '.join(CODECS)}, got {self.path.name!r}",
                "call it .mp4",
            )
        low, high = RATES_HZ
        if not low <= rate_hz <= high:
            raise InputError("rate_hz", f"expected {low:g} to {high:g} Hz, got {rate_hz}")
        #: Frames written so far, empty ones included.
        self.count = 0
        self._waiting = 0
        self._size = (0, 0)
        self._part = self.path.with_name(f".{secrets.token_hex(8)}.part{self.path.suffix}")
        self._writer: Cv2Writer | None = None

    def __enter__(self) -> VideoWriter:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        if self._writer is None:
            return
        try:
            self._writer.release()
            if kind is None:
                self._check_part()
                self._rename()
        finally:
            self._discard()

    def write(self, picture: npt.NDArray[Any] | None) -> None:
        """Append a frame.

        Parameters
        ----------
        picture
            Shape (h, w, 3), uint8, RGB, of the first one's size; an odd side is continued
            by a pixel, since codecs want even ones. None: an empty grey frame (before the
            first picture too, so that the video keeps step with the one that it is made of).

        Raises
        ------
        InputError
            If the picture is another one, or the file cannot be written.
        """
        import cv2

        if picture is None and self._writer is None:
            self._waiting += 1
            return
        if picture is None:
            picture = np.full((self._size[1], self._size[0], 3), EMPTY_GREY, np.uint8)
        if picture.dtype != np.uint8 or picture.ndim != 3 or picture.shape[2] != 3:
            raise InputError(
                "picture",
                f"expected uint8 of shape (h, w, 3), got {picture.dtype} of {picture.shape}",
            )
        size = (picture.shape[1], picture.shape[0])
        if self._writer is None:
            self._open(size)
        if size != self._size:
            raise InputError(
                "picture",
                f"expected {self._size[0]}x{self._size[1]} as the first, got {size[0]}x{size[1]}",
                "give all frames one size",
            )
        self._put(cv2.cvtColor(picture, cv2.COLOR_RGB2BGR))

    def _put(self, bgr: npt.NDArray[Any]) -> None:
        import cv2

        assert self._writer is not None
        odd_y, odd_x = bgr.shape[0] % 2, bgr.shape[1] % 2
        if odd_y or odd_x:
            bgr = cv2.copyMakeBorder(bgr, 0, odd_y, 0, odd_x, cv2.BORDER_REPLICATE)
        self._writer.write(bgr)
        self.count += 1

    def _open(self, size: tuple[int, int]) -> None:
        import cv2

        try:
            # OpenCV tells of no reason why it cannot write.
            self._part.open("xb").close()
        except (OSError, ValueError) as error:
            raise self._no_place(getattr(error, "strerror", None) or "not a path") from None
        codec = cv2.VideoWriter.fourcc(*CODECS[self.path.suffix.lower()])
        even = (size[0] + size[0] % 2, size[1] + size[1] % 2)
        self._writer = cv2.VideoWriter(str(self._part.absolute()), codec, self.rate_hz, even)
        self._size = size
        if not self._writer.isOpened():
            self._discard()
            raise InputError(
                self._thing,
                f"expected an encoder for {size[0]}x{size[1]} pixels at {self.rate_hz:g} Hz, "
                "OpenCV has none",
                "make the picture smaller, or call the file .avi",
            )
        for _ in range(self._waiting):
            self._put(np.full((size[1], size[0], 3), EMPTY_GREY, np.uint8))

    def _discard(self) -> None:
        self._writer = None
        with contextlib.suppress(OSError):
            self._part.unlink(missing_ok=True)

    def _check_part(self) -> None:
        """Read back what was written: OpenCV's writer is silent about a full disk."""
        import cv2

        capture = cv2.VideoCapture(str(self._part.absolute()))
        count = capture.get(cv2.CAP_PROP_FRAME_COUNT) if capture.isOpened() else 0
        capture.release()
        if count != self.count:
            raise self._no_place(f"{count:.0f} of {self.count} frames, is the disk full?")

    def _rename(self) -> None:
        try:
            self._part.replace(self.path)
        except OSError as error:
            raise self._no_place(error.strerror or "an error") from None

    def _no_place(self, found: str) -> InputError:
        return InputError(
            self._thing, f"expected a place to write to, got: {found}", "choose another folder"
        )
