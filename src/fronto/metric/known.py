"""A length on or to a panel that is known, and so tells how large everything is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from fronto.errors import InputError
from fronto.metric.depthimage import DepthArray, as_depth
from fronto.pose.template import Template

__all__ = ["KnownLength"]

#: Larger ones are no metres: a button, a distance between buttons, a distance to the panel.
MAX_SIZE_M, MAX_PITCH_M, MAX_DISTANCE_M = 0.5, 1.0, 100.0

Reading = tuple[float, float, float]


@dataclass(frozen=True, eq=False)
class KnownLength:
    """One length that is known, in metres: at most one of the first five.

    Parameters
    ----------
    button_size_m
        Width and height of the buttons of the size that most buttons have, as far as their
        outlines go; one number where they are square or round.
    pitch_m
        From one button's centre to its neighbour's: (right, down), None for what is not
        known; one number where it is the same along rows and columns.
    template
        The panel's layout.
    depth
        Depth along the optical axis: (x_px, y_px, metres) at one pixel of the photo, on the
        panel; or a depth image registered to the photo, as of
        :func:`fronto.metric.depthimage.as_depth`.
    distance_m
        From the camera to the panel's plane, at right angles to it; or (x_px, y_px, metres)
        along the ray of one pixel.
    std_m
        Standard deviation of the length (of a template: of each button's place). None: 5 % of
        a size, 1 % of a depth or distance, none of a pitch or template.

    Raises
    ------
    InputError
        If several are given, or one is no such length.
    """

    button_size_m: float | tuple[float, float] | None = None
    pitch_m: float | tuple[float | None, float | None] | None = None
    template: Template | None = None
    depth: Reading | npt.NDArray[Any] | None = None
    distance_m: float | Reading | None = None
    std_m: float | None = None

    def __post_init__(self) -> None:
        names = ("button_size_m", "pitch_m", "template", "depth", "distance_m")
        given = [name for name in names if getattr(self, name) is not None]
        if len(given) > 1:
            raise InputError(
                "known length", f"expected one, got {' and '.join(given)}", "leave the others out"
            )
        if self.std_m is not None:
            std = _number(self.std_m, "std_m")
            if not (np.isfinite(std) and std >= 0):
                raise InputError("std_m", f"expected metres, 0 or more, got {self.std_m}")
            object.__setattr__(self, "std_m", std)
        if self.button_size_m is not None:
            size = _one_or_two(self.button_size_m, "button_size_m", MAX_SIZE_M, gaps=False)
            object.__setattr__(self, "button_size_m", size)
        if self.pitch_m is not None:
            pitch = _one_or_two(self.pitch_m, "pitch_m", MAX_PITCH_M, gaps=True)
            object.__setattr__(self, "pitch_m", pitch)
        if self.template is not None and not isinstance(self.template, Template):
            raise InputError(
                "template", f"expected a fronto.Template, got {type(self.template).__name__}"
            )
        if self.depth is not None:
            # A picture has rows; a reading is three numbers.
            image = isinstance(self.depth, np.ndarray) and self.depth.ndim > 1
            depth = as_depth(self.depth) if image else _reading(self.depth, "depth")
            object.__setattr__(self, "depth", depth)
        if self.distance_m is not None:
            if np.ndim(self.distance_m):
                distance: float | Reading = _reading(self.distance_m, "distance_m")
            else:
                distance = _length(self.distance_m, "distance_m", MAX_DISTANCE_M)
            object.__setattr__(self, "distance_m", distance)

    def __bool__(self) -> bool:
        """Whether any is given."""
        lengths = (self.button_size_m, self.pitch_m, self.template, self.depth, self.distance_m)
        return any(length is not None for length in lengths)

    @property
    def depth_image(self) -> DepthArray | None:
        """The depth image (h, w) in metres, None where none is given."""
        return self.depth if isinstance(self.depth, np.ndarray) else None

    @property
    def depth_at(self) -> Reading | None:
        """The depth reading (x_px, y_px, metres), None where none is given."""
        return None if isinstance(self.depth, np.ndarray) else self.depth


def _number(value: Any, thing: str) -> float:
    try:
        return float(value)
    except (TypeError, ValueError):
        raise InputError(thing, f"expected a number, got {type(value).__name__}") from None


def _length(value: Any, thing: str, most: float) -> float:
    number = _number(value, thing)
    if not 0 < number <= most:
        raise InputError(
            thing,
            f"expected metres, above 0 and at most {most:g}, got {number:g}",
            "40 mm are 0.04",
        )
    return number


def _one_or_two(value: Any, thing: str, most: float, *, gaps: bool) -> Any:
    if np.ndim(value) == 0:
        return _length(value, thing, most)
    numbers: Sequence[Any] = list(value)
    if len(numbers) != 2 or all(number is None for number in numbers):
        raise InputError(thing, f"expected one length or two, got {len(numbers)} or none")
    return tuple(
        None if gaps and number is None else _length(number, thing, most) for number in numbers
    )


def _reading(value: Any, thing: str) -> Reading:
    numbers = [_number(v, thing) for v in np.ravel(np.asarray(value, dtype=object))]
    if len(numbers) != 3 or not np.isfinite(numbers[:2]).all():
        raise InputError(
            thing,
            f"expected x_px, y_px and metres, got {len(numbers)} numbers",
            "give a pixel on the panel and how far it is",
        )
    return numbers[0], numbers[1], _length(numbers[2], thing, MAX_DISTANCE_M)
