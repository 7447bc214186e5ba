"""Sizes of elevator buttons that standards and others state (``sizes.yaml``)."""

from __future__ import annotations

import functools
from typing import Annotated, Literal

import msgspec

from fronto.errors import InputError

__all__ = ["ButtonSize", "button_sizes", "known_size", "smallest_button_m"]

_Positive = Annotated[float, msgspec.Meta(gt=0)]


class ButtonSize(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A stated size of buttons.

    Parameters
    ----------
    name
        To ask for it by.
    what
        Which buttons it is stated for.
    kind
        "minimum": they are at least so large. "nominal": they are so large, within `std_mm`.
    size_mm
        Diameter of a round button, side of a square one; of others the smallest dimension.
    source, url
        Who states it, and where that can be read.
    shape
        "round" where it is stated for round buttons only.
    std_mm
        Standard deviation of a nominal size.
    gap_mm
        Least distance from one button's edge to the next one's, where it is stated.
    area_mm2
        Least area, where it is stated.
    """

    name: str
    what: str
    kind: Literal["minimum", "nominal"]
    size_mm: _Positive
    source: str
    url: str
    shape: Literal["round"] | None = None
    std_mm: _Positive | None = None
    gap_mm: _Positive | None = None
    area_mm2: _Positive | None = None

    @property
    def size_m(self) -> float:
        """The size in metres."""
        return 1e-3 * self.size_mm

    @property
    def std_m(self) -> float | None:
        """Its standard deviation in metres; None for a minimum."""
        return None if self.std_mm is None else 1e-3 * self.std_mm


class _Sizes(msgspec.Struct, forbid_unknown_fields=True):
    sizes: tuple[ButtonSize, ...]


@functools.cache
def button_sizes() -> tuple[ButtonSize, ...]:
    """All sizes, in the order of ``sizes.yaml``."""
    from importlib.resources import files

    content = (files("fronto") / "sizes.yaml").read_bytes()
    return msgspec.yaml.decode(content, type=_Sizes).sizes


def known_size(name: str) -> ButtonSize:
    """A size that distances can be told by.

    Parameters
    ----------
    name
        Of a nominal size.

    Raises
    ------
    InputError
        If there is none of this name, or it is only a standard's minimum.
    """
    nominal = [size for size in button_sizes() if size.kind == "nominal"]
    found = next((size for size in button_sizes() if size.name == name), None)
    if found is None or found not in nominal:
        what = "no known name" if found is None else f"a minimum (at least {found.size_mm:g} mm)"
        raise InputError(
            f"button size {name!r}",
            f"expected millimetres or one of {', '.join(size.name for size in nominal)}, "
            f"got {what}",
            "measure a button",
        )
    return found


def smallest_button_m() -> float:
    """The smallest button that a standard allows, metres."""
    return min(size.size_m for size in button_sizes() if size.kind == "minimum")
