"""How far away a panel's plane is, from a length that is known: a size, a pitch, a depth."""

from __future__ import annotations

from fronto.metric.depth import by_depths, by_distance
from fronto.metric.known import KnownLength
from fronto.metric.pitch import by_pitch
from fronto.metric.seen import Measured, Seen, UnfitLength
from fronto.metric.size import by_size
from fronto.metric.template import by_solved, by_template

__all__ = ["KnownLength", "Measured", "Seen", "UnfitLength", "measure"]


def measure(known: KnownLength, seen: Seen, labels: tuple[str, ...]) -> Measured:
    """The plane's distance from whichever length is known, else from the pose's own template.

    Parameters
    ----------
    known
        The length.
    seen
        The pose and its rays.
    labels
        Of the buttons, "" where unknown; to match a template by.

    Raises
    ------
    InputError
        If a depth reading or image is not of this photo.
    UnfitLength
        If the length does not apply to this panel.
    """
    if not known:
        return by_solved(seen)
    if known.button_size_m is not None:
        return by_size(known, seen)
    if known.pitch_m is not None:
        return by_pitch(known, seen)
    if known.template is not None:
        return by_template(known, seen, labels)
    if known.depth_image is not None:
        return by_depths(known, seen)
    return by_distance(known, seen)
