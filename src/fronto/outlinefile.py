"""Outline files: fronto's own, the annotation format, and results fed back (docs/files.md)."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import numpy as np

from fronto.camera.checks import same_aspect
from fronto.errors import InputError
from fronto.files import decode_json, json_bytes, read_bytes, write_bytes
from fronto.shapes import DEFAULT_STD_PX, Axis, Ellipse, LineSegment, Outline

__all__ = ["OutlineFile", "read_outlines", "write_outlines"]

SCHEMA = "fronto.outlines/1"
MAX_BYTES = 50_000_000
MAX_ITEMS = 10_000
#: Far beyond any photo, and well within the range where products are exact enough.
FAR_PX = 1e6
#: No button, and no deviation that anybody measures, is smaller.
LEAST_PX = 1e-3

_Coordinate = Annotated[float, msgspec.Meta(ge=-FAR_PX, le=FAR_PX)]
_Point = tuple[_Coordinate, _Coordinate]
_Corners = Annotated[list[_Point], msgspec.Meta(min_length=4, max_length=4)]
_Length = Annotated[float, msgspec.Meta(ge=LEAST_PX, le=FAR_PX)]
_Side = Annotated[int, msgspec.Meta(ge=1, le=1_000_000)]


class _Ellipse(msgspec.Struct):
    cx: _Coordinate
    cy: _Coordinate
    a: _Length
    b: _Length
    angle_deg: float = 0.0


class _Button(msgspec.Struct):
    """A button in any of the three formats; the pairs are two spellings of one thing."""

    shape: Literal["quad", "ellipse"] | None = None
    corners_px: _Corners | None = None
    corners: _Corners | None = None
    ellipse_px: _Ellipse | None = None
    ellipse: _Ellipse | None = None
    std_px: _Length | None = None
    corner_std_px: _Length | None = None
    text: str | None = None
    label: str | None = None
    category: str = "other"
    confidence: Annotated[float, msgspec.Meta(ge=0, le=1)] | None = None
    odd: bool = False
    truncated: bool = False
    unsure: bool = False


class _Line(msgspec.Struct):
    axis: Axis
    ends_px: Annotated[list[_Point], msgspec.Meta(min_length=2, max_length=2)]
    std_px: _Length | None = None


_Segment = tuple[_Coordinate, _Coordinate, _Coordinate, _Coordinate]
_Segments = Annotated[list[_Segment], msgspec.Meta(max_length=MAX_ITEMS)]


class _File(msgspec.Struct):
    buttons: Annotated[list[_Button], msgspec.Meta(max_length=MAX_ITEMS)]
    schema: Literal["fronto.outlines/1", "fronto.panel/1"] | None = None
    image: str | None = None
    width_px: _Side | None = None
    height_px: _Side | None = None
    width: _Side | None = None
    height: _Side | None = None
    lines: Annotated[list[_Line], msgspec.Meta(max_length=MAX_ITEMS)] = []
    horizontal: _Segments = []
    vertical: _Segments = []


@dataclass(frozen=True, eq=False)
class OutlineFile:
    """What an outlines file holds.

    Parameters
    ----------
    outlines
        The buttons' outlines, in the file's order.
    lines
        Segments that are horizontal or vertical on the wall.
    image
        The photo's name that the file states, "" if none.
    width_px, height_px
        Size of the photo whose pixels these are: the one asked for, else the one that
        the file states, else None.
    skipped
        Indices in the file of the buttons left out because they are marked unsure.
    """

    outlines: tuple[Outline, ...]
    lines: tuple[LineSegment, ...] = ()
    image: str = ""
    width_px: int | None = None
    height_px: int | None = None
    skipped: tuple[int, ...] = ()


def read_outlines(
    path: str | Path,
    width_px: int | None = None,
    height_px: int | None = None,
    *,
    include_unsure: bool = False,
    include_segments: bool = False,
) -> OutlineFile:
    """Read the outlines of one photo's buttons.

    Three formats, told apart by their keys: fronto's own (``corners_px``, ``ellipse_px``,
    ``lines``), the annotation format (``corners``, ``ellipse``, ``horizontal``,
    ``vertical``), and a result of fronto (schema ``fronto.panel/1``). Other keys are
    left alone.

    Parameters
    ----------
    path
        JSON, UTF-8, at most 50 MB and 10,000 buttons.
    width_px, height_px
        The photo's size, upright. Where the file states another one of the same aspect
        (within 1 %), outlines and lines are scaled to it.
    include_unsure
        Take buttons marked ``"unsure": true`` as well.
    include_segments
        Take an annotation's horizontal and vertical segments as lines; they are meant
        as ground truth to measure with.

    Raises
    ------
    InputError
        Naming the file and the field.
    """
    thing = f"outlines file {path}"
    content = read_bytes(Path(path), thing, MAX_BYTES)
    file = decode_json(content, _File, thing)
    photo = _photo_size(width_px, height_px)
    stated = _stated_size(file, thing)
    kept = [k for k, button in enumerate(file.buttons) if include_unsure or not button.unsure]
    outlines = [_outline(file.buttons[k], f"{thing}, buttons[{k}]") for k in kept]
    lines = [_line(line, f"{thing}, lines[{k}]") for k, line in enumerate(file.lines)]
    if include_segments:
        lines += _segments(file, thing)
    if stated is not None and photo is not None and stated != photo:
        if not same_aspect(*stated, *photo):
            raise InputError(
                f"{thing}, width_px and height_px",
                f"expected the photo's size {photo[0]}x{photo[1]} or its aspect, "
                f"got {stated[0]}x{stated[1]}",
                "give the outlines of this photo, in pixels of the upright photo",
            )
        outlines, lines = _scaled(outlines, lines, stated, photo)
    size = photo or stated
    if size is not None:
        _check_inside(outlines, kept, size, thing)
    _check_together(outlines, kept, thing)
    return OutlineFile(
        outlines=tuple(outlines),
        lines=tuple(lines),
        image=file.image or "",
        width_px=size[0] if size else None,
        height_px=size[1] if size else None,
        skipped=tuple(k for k in range(len(file.buttons)) if k not in set(kept)),
    )


def write_outlines(
    path: str | Path,
    outlines: Sequence[Outline],
    *,
    lines: Sequence[LineSegment] = (),
    image: str = "",
    width_px: int | None = None,
    height_px: int | None = None,
) -> None:
    """Write outlines that `read_outlines` reads back exactly.

    Parameters
    ----------
    path
        The file; its folder must exist.
    outlines, lines
        What to write.
    image
        The photo's file name.
    width_px, height_px
        The photo's size.

    Raises
    ------
    InputError
        If only one of the sizes is given, or the file cannot be written.
    """
    values: dict[str, Any] = {"schema": SCHEMA}
    if image:
        values["image"] = image
    size = _photo_size(width_px, height_px)
    if size is not None:
        values["width_px"], values["height_px"] = size
    values["buttons"] = [_button_fields(outline) for outline in outlines]
    values["lines"] = [
        {"axis": line.axis, "ends_px": line.ends_px.tolist(), "std_px": float(line.std_px)}
        for line in lines
    ]
    write_bytes(Path(path), json_bytes(values))


def _button_fields(outline: Outline) -> dict[str, Any]:
    fields: dict[str, Any] = {"shape": outline.shape}
    if outline.corners_px is not None:
        fields["corners_px"] = outline.corners_px.tolist()
    if outline.ellipse_px is not None:
        fields["ellipse_px"] = {
            name: float(getattr(outline.ellipse_px, name))
            for name in ("cx", "cy", "a", "b", "angle_deg")
        }
    fields |= {"category": outline.category, "text": outline.text}
    fields |= {"std_px": float(outline.std_px), "confidence": float(outline.confidence)}
    return fields | {name: True for name in ("odd", "truncated") if getattr(outline, name)}


def _photo_size(width_px: int | None, height_px: int | None) -> tuple[int, int] | None:
    if width_px is None and height_px is None:
        return None
    if width_px is None or height_px is None:
        raise InputError("photo size", "expected both width_px and height_px, got one of them")
    return width_px, height_px


def _stated_size(file: _File, thing: str) -> tuple[int, int] | None:
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


def _outline(button: _Button, thing: str) -> Outline:
    given = [
        name
        for name in ("corners_px", "corners", "ellipse_px", "ellipse")
        if getattr(button, name) is not None
    ]
    if len(given) != 1:
        raise InputError(
            thing,
            f"expected either corners_px or ellipse_px, got {' and '.join(given) or 'neither'}",
            "give four corners, or an ellipse",
        )
    spelled = given[0]
    shape: Literal["quad", "ellipse"] = "quad" if "corners" in spelled else "ellipse"
    if button.shape not in (None, shape):
        raise InputError(
            f"{thing}.shape",
            f'expected "{shape}" with {spelled}, got "{button.shape}"',
            "correct one of them",
        )
    ellipse = button.ellipse_px or button.ellipse
    corners = button.corners_px or button.corners
    std = button.std_px or button.corner_std_px or DEFAULT_STD_PX
    try:
        return Outline(
            shape,
            corners_px=None if corners is None else np.array(corners),
            ellipse_px=None
            if ellipse is None
            else Ellipse(ellipse.cx, ellipse.cy, ellipse.a, ellipse.b, ellipse.angle_deg),
            std_px=std,
            category=button.category,
            confidence=1.0 if button.confidence is None else button.confidence,
            text=button.text or button.label or "",
            odd=button.odd,
            truncated=button.truncated,
        )
    except InputError as error:
        raise InputError(f"{thing}.{spelled}", error.expected, error.remedy) from None


def _line(line: _Line, thing: str) -> LineSegment:
    try:
        return LineSegment(line.axis, np.array(line.ends_px), line.std_px or DEFAULT_STD_PX)
    except InputError as error:
        raise InputError(f"{thing}.ends_px", error.expected, error.remedy) from None


def _segments(file: _File, thing: str) -> list[LineSegment]:
    lines = []
    axes: tuple[Axis, ...] = ("horizontal", "vertical")
    for axis in axes:
        segments: list[_Segment] = getattr(file, axis)
        for k, (x0, y0, x1, y1) in enumerate(segments):
            fields = _Line(axis, [(x0, y0), (x1, y1)])
            lines.append(_line(fields, f"{thing}, {axis}[{k}]"))
    return lines


def _scaled(
    outlines: list[Outline],
    lines: list[LineSegment],
    old: tuple[int, int],
    new: tuple[int, int],
) -> tuple[list[Outline], list[LineSegment]]:
    """Scale to the resized photo: x' = (x + 0.5) s - 0.5, since pixel centres are integers."""
    factor = np.array(new) / np.array(old)
    mean = float(np.sqrt(factor.prod()))
    moved = []
    for outline in outlines:
        std = outline.std_px * mean
        if outline.corners_px is not None:
            corners = (outline.corners_px + 0.5) * factor - 0.5
            moved.append(replace(outline, corners_px=corners, std_px=std))
        else:
            assert outline.ellipse_px is not None
            matrix = factor[:, None] * outline.ellipse_px.shape_matrix * factor
            center = (outline.ellipse_px.center + 0.5) * factor - 0.5
            ellipse = Ellipse.from_shape_matrix(center, matrix)
            moved.append(replace(outline, ellipse_px=ellipse, std_px=std))
    stretched = [
        replace(line, ends_px=(line.ends_px + 0.5) * factor - 0.5, std_px=line.std_px * mean)
        for line in lines
    ]
    return moved, stretched


def _check_inside(
    outlines: list[Outline], kept: list[int], size: tuple[int, int], thing: str
) -> None:
    """Refuse a button that lies wholly outside the photo: the file belongs to another one."""
    width, height = size
    for k, outline in zip(kept, outlines, strict=True):
        x0, y0, x1, y1 = outline.box_px
        if x1 < -0.5 or y1 < -0.5 or x0 > width - 0.5 or y0 > height - 0.5:
            x, y = outline.center_px
            raise InputError(
                f"{thing}, buttons[{k}]",
                f"expected a button in the {width}x{height} photo, got one at ({x:.0f}, {y:.0f})",
                "give the outlines of this photo, in pixels of the upright photo",
            )


def _check_together(outlines: list[Outline], kept: list[int], thing: str) -> None:
    """Refuse outlines that contradict each other, by their numbers in the file."""
    from fronto.pose.checks import check_outlines

    try:
        check_outlines(outlines)
    except InputError as error:
        numbers = re.sub(r"\d+", lambda found: str(kept[int(found[0])]), error.thing)
        named = numbers.replace("outlines", "buttons")
        raise InputError(f"{thing}, {named}", error.expected, error.remedy) from None
