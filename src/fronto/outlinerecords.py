"""What outline files may hold, field by field (docs/files.md), and what becomes of it."""

from __future__ import annotations

from typing import Annotated, Literal

import msgspec
import numpy as np

from fronto.categories import PLATE
from fronto.errors import InputError
from fronto.shapes import DEFAULT_STD_PX, Axis, Ellipse, LineSegment, Outline

__all__ = ["OutlineRecord", "OutlinesRecord", "outline_of", "panel_lines", "stated_size"]

MAX_ITEMS = 10_000
#: Far beyond any photo, and well within the range where products are exact enough.
FAR_PX = 1e6
#: No button, and no deviation that anybody measures, is smaller.
LEAST_PX = 1e-3

_Coordinate = Annotated[float, msgspec.Meta(ge=-FAR_PX, le=FAR_PX)]
_Point = tuple[_Coordinate, _Coordinate]
_Corners = Annotated[list[_Point], msgspec.Meta(min_length=4, max_length=4)]
_Length = Annotated[float, msgspec.Meta(ge=LEAST_PX, le=FAR_PX)]
_Share = Annotated[float, msgspec.Meta(ge=0, le=1)]
_Side = Annotated[int, msgspec.Meta(ge=1, le=1_000_000)]


class _Ellipse(msgspec.Struct):
    cx: _Coordinate
    cy: _Coordinate
    a: _Length
    b: _Length
    angle_deg: float = 0.0


class OutlineRecord(msgspec.Struct):
    """A button or plate in any of the three formats; the pairs are two spellings of one thing."""

    shape: Literal["quad", "ellipse"] | None = None
    corners_px: _Corners | None = None
    corners: _Corners | None = None
    ellipse_px: _Ellipse | None = None
    ellipse: _Ellipse | None = None
    std_px: _Length | None = None
    corner_std_px: _Length | None = None
    form_std_px: _Length | None = None
    text: str | None = None
    label: str | None = None
    label_source: str | None = None
    category: str = "other"
    confidence: _Share | None = None
    shape_confidence: _Share = 1.0
    seen: tuple[bool, bool, bool, bool] = (True, True, True, True)
    odd: bool = False
    truncated: bool = False
    unsure: bool = False


class _Plate(OutlineRecord):
    category: str = PLATE


class _Line(msgspec.Struct):
    axis: Axis
    ends_px: Annotated[list[_Point], msgspec.Meta(min_length=2, max_length=2)]
    std_px: _Length | None = None
    found: bool = False


_Segment = tuple[_Coordinate, _Coordinate, _Coordinate, _Coordinate]
_Segments = Annotated[list[_Segment], msgspec.Meta(max_length=MAX_ITEMS)]


class OutlinesRecord(msgspec.Struct):
    """A file in any of the three formats."""

    buttons: Annotated[list[OutlineRecord], msgspec.Meta(max_length=MAX_ITEMS)]
    schema: Literal["fronto.outlines/1", "fronto.panel/1"] | None = None
    image: str | None = None
    width_px: _Side | None = None
    height_px: _Side | None = None
    width: _Side | None = None
    height: _Side | None = None
    plates: Annotated[list[_Plate], msgspec.Meta(max_length=MAX_ITEMS)] = []
    lines: Annotated[list[_Line], msgspec.Meta(max_length=MAX_ITEMS)] = []
    horizontal: _Segments = []
    vertical: _Segments = []


def stated_size(file: OutlinesRecord, thing: str) -> tuple[int, int] | None:
    """Width and height that the file states, if any.

    Raises
    ------
    InputError
        If it states one of them only.
    """
    width = file.width if file.width_px is None else file.width_px
    height = file.height if file.height_px is None else file.height_px
    if width is None and height is None:
        return None
    if width is None or height is None:
        raise InputError(
            f"{thing}, {'width_px' if width is None else 'height_px'}",
            "expected both width_px and height_px, got one of them",
            "add the other one, or leave both out",
        )
    return width, height


def outline_of(record: OutlineRecord, thing: str) -> Outline:
    """The outline that a record describes.

    Raises
    ------
    InputError
        Naming `thing` and the field.
    """
    given = [
        name
        for name in ("corners_px", "corners", "ellipse_px", "ellipse")
        if getattr(record, name) is not None
    ]
    if len(given) != 1:
        raise InputError(
            thing,
            f"expected either corners_px or ellipse_px, got {' and '.join(given) or 'neither'}",
            "give four corners, or an ellipse",
        )
    spelled = given[0]
    shape: Literal["quad", "ellipse"] = "quad" if "corners" in spelled else "ellipse"
    if record.shape not in (None, shape):
        raise InputError(
            f"{thing}.shape",
            f'expected "{shape}" with {spelled}, got "{record.shape}"',
            "correct one of them",
        )
    if shape == "ellipse" and not all(record.seen):
        raise InputError(
            f"{thing}.seen",
            f"expected seen sides with corners_px only, got them with {spelled}",
            "leave it out: an ellipse has no sides",
        )
    ellipse = record.ellipse_px or record.ellipse
    corners = record.corners_px or record.corners
    try:
        return Outline(
            shape,
            corners_px=None if corners is None else np.array(corners),
            ellipse_px=None
            if ellipse is None
            else Ellipse(ellipse.cx, ellipse.cy, ellipse.a, ellipse.b, ellipse.angle_deg),
            std_px=record.std_px or record.corner_std_px or DEFAULT_STD_PX,
            category=record.category,
            confidence=1.0 if record.confidence is None else record.confidence,
            text=record.text or ("" if record.label_source == "inferred" else record.label or ""),
            odd=record.odd,
            truncated=record.truncated,
            seen=record.seen,
            shape_confidence=record.shape_confidence,
            form_std_px=record.form_std_px,
        )
    except InputError as error:
        raise InputError(f"{thing}.{spelled}", error.expected, error.remedy) from None


def panel_lines(file: OutlinesRecord, thing: str, *, segments: bool) -> list[LineSegment]:
    """The file's lines; with `segments` also an annotation's horizontal and vertical ones.

    Raises
    ------
    InputError
        Naming `thing` and the field.
    """
    lines = [_line(line, f"{thing}, lines[{k}]") for k, line in enumerate(file.lines)]
    axes: tuple[Axis, ...] = ("horizontal", "vertical") if segments else ()
    for axis in axes:
        own: list[_Segment] = getattr(file, axis)
        for k, (x0, y0, x1, y1) in enumerate(own):
            lines.append(_line(_Line(axis, [(x0, y0), (x1, y1)]), f"{thing}, {axis}[{k}]"))
    return lines


def _line(line: _Line, thing: str) -> LineSegment:
    try:
        std_px = line.std_px or DEFAULT_STD_PX
        return LineSegment(line.axis, np.array(line.ends_px), std_px, found=line.found)
    except InputError as error:
        raise InputError(f"{thing}.ends_px", error.expected, error.remedy) from None
