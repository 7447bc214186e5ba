"""What a labelled photo is, whatever format it came in.

Pixel coordinates: x right, y down, centre of the top-left pixel = (0, 0); a box around the
pixels 3..7 is 2.5..7.5. All of them refer to the photo upright, its EXIF orientation applied:
as annotation tools show it and as :func:`fronto.imageio.read_image` reads it.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

import numpy.typing as npt

from fronto.categories import CATEGORIES
from fronto.errors import InputError
from fronto.shapes import FloatArray, frozen_array

__all__ = ["UNKNOWN", "Box", "Form", "LabeledImage", "LabeledObject", "polygon_box"]

#: Edges x0, y0, x1, y1 in pixels.
Box = tuple[float, float, float, float]

#: What an object looks like whose outline is not known.
Form = Literal["round", "square", ""]

#: Category of what is some button, but nobody said which.
UNKNOWN = "unknown"
LABELS = (*CATEGORIES[1:], UNKNOWN)


@dataclass(frozen=True, eq=False)
class LabeledObject:
    """A button or a plate as somebody labelled it.

    Parameters
    ----------
    category
        A name of `fronto.categories.CATEGORIES` except "background", or "unknown": some
        button whose category is not known.
    box
        Edges x0 < x1, y0 < y1 in pixels; it may reach beyond the photo.
    polygon
        Shape (n, 2), n >= 3, pixels, read-only: its outline; None where only the box is
        known.
    name
        The label as the data set has it.
    text
        What is printed on it, "" where unknown.
    ignore
        Unsure or a crowd: finding it is neither right nor wrong.
    truncated
        Part of it lies outside the photo.
    form
        Of one whose outline is not known: whether it is round or rectangular, "" where that
        is not known either.

    Raises
    ------
    InputError
        If the category is none, or the box or the polygon bounds nothing.
    """

    category: str
    box: Box
    polygon: FloatArray | None
    name: str
    text: str = ""
    ignore: bool = False
    truncated: bool = False
    form: Form = ""

    def __post_init__(self) -> None:
        if self.category not in LABELS:
            raise InputError(
                "category", f"expected one of {', '.join(LABELS)}, got {self.category!r}"
            )
        x0, y0, x1, y1 = box = tuple(float(edge) for edge in self.box)
        if not (all(map(math.isfinite, box)) and x0 < x1 and y0 < y1):
            raise InputError(
                "box",
                f"expected finite edges x0 < x1 and y0 < y1, got {x0:g}, {y0:g}, {x1:g}, {y1:g}",
                "correct it, or leave the object out",
            )
        object.__setattr__(self, "box", (x0, y0, x1, y1))
        if self.polygon is not None:
            polygon = frozen_array(self.polygon, (-1, 2), "polygon")
            if len(polygon) < 3:
                raise InputError(
                    "polygon",
                    f"expected at least three points, got {len(polygon)}",
                    "mark its whole outline, or leave the object out",
                )
            object.__setattr__(self, "polygon", polygon)


@dataclass(frozen=True, eq=False)
class LabeledImage:
    """A photo and what is labelled in it; an empty tuple means that there is nothing.

    Parameters
    ----------
    path
        The photo's file.
    width, height
        Its size upright (EXIF orientation applied), pixels.
    objects
        In the order of the labels.
    """

    path: Path
    width: int
    height: int
    objects: tuple[LabeledObject, ...]


def polygon_box(polygon: npt.ArrayLike) -> Box:
    """Smallest box around a polygon.

    Parameters
    ----------
    polygon
        Shape (n, 2), n >= 1, pixels.

    Returns
    -------
    Edges x0, y0, x1, y1 in pixels.

    Raises
    ------
    InputError
        If there are no points, or they are no finite numbers.
    """
    points = frozen_array(polygon, (-1, 2), "polygon")
    if len(points) == 0:
        raise InputError("polygon", "expected points, got none")
    (x0, y0), (x1, y1) = points.min(axis=0), points.max(axis=0)
    return float(x0), float(y0), float(x1), float(y1)
