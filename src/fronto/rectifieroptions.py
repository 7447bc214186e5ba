"""What the stages are told, in one validated configuration."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy as np

from fronto.errors import InputError
from fronto.pose.observations import TOLERANCE
from fronto.tomlfile import read_toml
from fronto.warp import Crop

__all__ = ["RectifierOptions"]

#: Share of the network's errors that all outlines of a photo have in common, from renders.
CORRELATION = 0.1


@dataclass(frozen=True)
class RectifierOptions:
    """What the stages are told; `from_file` reads them from TOML.

    Parameters
    ----------
    min_confidence, second_look
        As of :func:`fronto.segment`.
    rectified_look
        Whether the head-on view is looked at, too, once a first pose is known; what is found
        there is kept where it fits better.
    corners
        As of :func:`fronto.outline`.
    lines
        Whether lines of the panel and around it help the pose.
    square, aligned, tolerance, correlation
        As of :func:`fronto.estimate_pose`.
    crop, scale, margin, max_pixels
        As of :func:`fronto.warp_panel`.
    read_labels
        Whether buttons are named by what is printed on and beside them.

    Raises
    ------
    InputError
        Naming the field that is out of range.
    """

    min_confidence: float = 0.5
    second_look: bool = True
    rectified_look: bool = True
    corners: Literal["subpixel", "hough"] = "subpixel"
    lines: bool = True
    square: bool = False
    aligned: bool = True
    tolerance: float = TOLERANCE
    correlation: float = CORRELATION
    crop: Crop = "panel"
    scale: float = 1.0
    margin: float = 0.5
    max_pixels: int = 16_000_000
    read_labels: bool = True

    def __post_init__(self) -> None:
        for name in ("min_confidence", "correlation"):
            if not 0 <= getattr(self, name) <= 1:
                raise InputError(name, f"expected 0 to 1, got {getattr(self, name)}")
        if self.corners not in ("subpixel", "hough"):
            raise InputError("corners", f'expected "subpixel" or "hough", got {self.corners!r}')
        if self.crop not in ("panel", "full", "input"):
            raise InputError("crop", f'expected "panel", "full" or "input", got {self.crop!r}')
        for name, least in (("tolerance", 0.0), ("margin", 0.0)):
            value = getattr(self, name)
            if not (np.isfinite(value) and value >= least):
                raise InputError(name, f"expected {least:g} or more, got {value}")
        if not (np.isfinite(self.scale) and self.scale > 0):
            raise InputError("scale", f"expected a number above 0, got {self.scale}")
        if self.max_pixels < 1:
            raise InputError("max_pixels", f"expected 1 or more, got {self.max_pixels}")

    @classmethod
    def from_file(cls, path: str | Path) -> RectifierOptions:
        """Read options from a TOML file; what it leaves out has its default.

        Raises
        ------
        InputError
            Naming the file and the field.
        """
        return read_toml(Path(path), cls)
