"""The picture of one video frame: the head-on view, loudly marked unless it is tracked."""

from __future__ import annotations

import textwrap

import numpy as np

from fronto.drawing import Color, Picture, text_size, unit_of, write_text
from fronto.results import RectifiedView
from fronto.tracking import TrackedRotation, TrackStatus

__all__ = ["video_picture"]

GROUND = 170
#: Colours as of the statuses in fronto.draw: amber for "do not rely on it", red for "nothing".
MARKS: dict[TrackStatus, tuple[Color, str]] = {
    "tracked": ((180, 20, 20), "NO PICTURE"),
    "predicted": ((190, 105, 0), "PREDICTED: not from this frame"),
    "lost": ((180, 20, 20), "LOST: no rotation"),
}


def video_picture(
    view: RectifiedView | None,
    track: TrackedRotation,
    size_px: tuple[int, int],
    notes: tuple[str, ...] = (),
) -> Picture:
    """Draw a head-on view on a grey ground.

    Parameters
    ----------
    view
        The view, of `size_px`; None leaves the ground empty, and is marked as such.
    track
        Marked with a frame and a banner with its reasons unless it is "tracked".
    size_px
        Width and height.
    notes
        Why there is no view, in words.

    Returns
    -------
    Shape (h, w, 3), uint8, RGB.
    """
    canvas: Picture = np.full((size_px[1], size_px[0], 3), GROUND, np.uint8)
    if view is not None:
        shown = view.image[..., 3] > 0
        canvas[shown] = view.image[shown, :3]
        if track.status == "tracked":
            return canvas
    color, words = MARKS[track.status]
    unit = unit_of(canvas)
    _write_banner(canvas, color, (words, *track.reasons, *notes), unit)
    thick = max(2, round(5 * unit))
    for edge in (canvas[:thick], canvas[-thick:], canvas[:, :thick], canvas[:, -thick:]):
        edge[:] = color
    return canvas


def _write_banner(canvas: Picture, color: Color, lines: tuple[str, ...], unit: float) -> None:
    pad, step = round(8 * unit), round(16 * unit)
    # A line of digits is wider than one of words.
    digit = text_size("0" * 20, unit)[0] / 20
    letters = max(12, int((canvas.shape[1] - 2 * pad) / max(1.0, digit)))
    # OpenCV's font has ASCII only.
    plain = [line.replace("±", "+-").replace("°", " deg") for line in lines]
    wrapped = [part for line in plain for part in textwrap.wrap(line, letters)]
    box = canvas[: step * len(wrapped) + 2 * pad]
    box[:] = (0.15 * box + 0.85 * np.array(color)).astype(np.uint8)
    for i, line in enumerate(wrapped):
        write_text(canvas, line, (pad, step * (i + 1) + pad // 2), unit, (255, 255, 255))
