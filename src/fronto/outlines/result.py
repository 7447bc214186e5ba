"""What outlining hands on: one outline per button, and lines of the panel."""

from __future__ import annotations

from dataclasses import dataclass, field

from fronto.shapes import LineSegment, Outline

__all__ = ["Outlines"]


@dataclass(frozen=True, eq=False)
class Outlines:
    """The outlines of one photo.

    Parameters
    ----------
    width_px, height_px
        The photo's size.
    buttons
        One for each button that has one, in the order of the segments.
    plates
        Of the labels beside buttons.
    lines
        Straight segments of the panel, horizontal or vertical on the wall.
    left_out
        Why segments have no outline, in words.
    from_image
        For each of `buttons`: the share of its outline that follows the photo's own edges;
        the rest follows the mask.
    timing_ms
        Milliseconds of each step.
    """

    width_px: int
    height_px: int
    buttons: tuple[Outline, ...]
    plates: tuple[Outline, ...] = ()
    lines: tuple[LineSegment, ...] = ()
    left_out: tuple[str, ...] = ()
    from_image: tuple[float, ...] = ()
    timing_ms: dict[str, float] = field(default_factory=dict)
