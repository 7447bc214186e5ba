"""Outline files: fronto's own, the annotation format, and results fed back (docs/files.md)."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from fronto.camera.checks import same_aspect
from fronto.errors import InputError
from fronto.files import decode_json, json_bytes, read_bytes, write_bytes
from fronto.outlinerecords import OutlinesRecord, outline_of, panel_lines, stated_size
from fronto.shapes import Ellipse, FloatArray, LineSegment, Outline

__all__ = ["OutlineFile", "read_outlines", "write_outlines"]

SCHEMA = "fronto.outlines/1"
MAX_BYTES = 50_000_000


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
    plates
        Outlines of the labels beside buttons, which nobody presses.
    """

    outlines: tuple[Outline, ...]
    lines: tuple[LineSegment, ...] = ()
    image: str = ""
    width_px: int | None = None
    height_px: int | None = None
    skipped: tuple[int, ...] = ()
    plates: tuple[Outline, ...] = ()


def read_outlines(
    path: str | Path,
    width_px: int | None = None,
    height_px: int | None = None,
    *,
    include_unsure: bool = False,
    include_segments: bool = False,
) -> OutlineFile:
    """Read the outlines of one photo's buttons and plates.

    Three formats, told apart by their keys: fronto's own (``corners_px``, ``ellipse_px``,
    ``plates``, ``lines``), the annotation format (``corners``, ``ellipse``, ``horizontal``,
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
        Take buttons and plates marked ``"unsure": true`` as well.
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
    file = decode_json(content, OutlinesRecord, thing)
    photo = _photo_size(width_px, height_px)
    stated = stated_size(file, thing)
    if stated is not None and photo is not None and not same_aspect(*stated, *photo):
        raise InputError(
            f"{thing}, width_px and height_px",
            f"expected the photo's size {photo[0]}x{photo[1]} or its aspect, "
            f"got {stated[0]}x{stated[1]}",
            "give the outlines of this photo, in pixels of the upright photo",
        )
    size = photo or stated
    kept = [k for k, button in enumerate(file.buttons) if include_unsure or not button.unsure]
    sure = [k for k, plate in enumerate(file.plates) if include_unsure or not plate.unsure]
    outlines = [outline_of(file.buttons[k], f"{thing}, buttons[{k}]") for k in kept]
    plates = [outline_of(file.plates[k], f"{thing}, plates[{k}]") for k in sure]
    lines = panel_lines(file, thing, segments=include_segments)
    if stated is not None and photo is not None and stated != photo:
        factor = np.array(photo) / np.array(stated)
        outlines = [_scaled(outline, factor) for outline in outlines]
        plates = [_scaled(plate, factor) for plate in plates]
        lines = [_scaled_line(line, factor) for line in lines]
    for found, numbers, key in ((outlines, kept, "buttons"), (plates, sure, "plates")):
        if size is not None:
            _check_inside(found, numbers, size, thing, key)
        _check_together(found, numbers, thing, key)
    return OutlineFile(
        outlines=tuple(outlines),
        lines=tuple(lines),
        image=file.image or "",
        width_px=size[0] if size else None,
        height_px=size[1] if size else None,
        skipped=tuple(k for k in range(len(file.buttons)) if k not in set(kept)),
        plates=tuple(plates),
    )


def write_outlines(
    path: str | Path,
    outlines: Sequence[Outline],
    *,
    plates: Sequence[Outline] = (),
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
    outlines, plates, lines
        What to write: of buttons, of the labels beside them, and of the panel.
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
    values["buttons"] = [_fields(outline) for outline in outlines]
    if plates:
        values["plates"] = [_fields(plate) for plate in plates]
    values["lines"] = [_line_fields(line) for line in lines]
    write_bytes(Path(path), json_bytes(values))


def _fields(outline: Outline) -> dict[str, Any]:
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
    if outline.form_std_px is not None:
        fields["form_std_px"] = float(outline.form_std_px)
    if outline.shape_confidence != 1:
        fields["shape_confidence"] = float(outline.shape_confidence)
    if outline.shape == "quad" and not all(outline.seen):  # an ellipse has no sides
        fields["seen"] = [bool(side) for side in outline.seen]
    return fields | {name: True for name in ("odd", "truncated") if getattr(outline, name)}


def _line_fields(line: LineSegment) -> dict[str, Any]:
    fields = {"axis": line.axis, "ends_px": line.ends_px.tolist(), "std_px": float(line.std_px)}
    return fields | ({"found": True} if line.found else {})


def _photo_size(width_px: int | None, height_px: int | None) -> tuple[int, int] | None:
    if width_px is None and height_px is None:
        return None
    if width_px is None or height_px is None:
        raise InputError("photo size", "expected both width_px and height_px, got one of them")
    return width_px, height_px


def _scaled(outline: Outline, factor: FloatArray) -> Outline:
    """Scale to the resized photo: x' = (x + 0.5) s - 0.5, since pixel centres are integers."""
    mean = float(np.sqrt(factor.prod()))
    std = outline.std_px * mean
    form = None if outline.form_std_px is None else outline.form_std_px * mean
    if outline.corners_px is not None:
        corners = (outline.corners_px + 0.5) * factor - 0.5
        return replace(outline, corners_px=corners, std_px=std, form_std_px=form)
    assert outline.ellipse_px is not None
    matrix = factor[:, None] * outline.ellipse_px.shape_matrix * factor
    center = (outline.ellipse_px.center + 0.5) * factor - 0.5
    ellipse = Ellipse.from_shape_matrix(center, matrix)
    return replace(outline, ellipse_px=ellipse, std_px=std, form_std_px=form)


def _scaled_line(line: LineSegment, factor: FloatArray) -> LineSegment:
    ends = (line.ends_px + 0.5) * factor - 0.5
    return replace(line, ends_px=ends, std_px=line.std_px * float(np.sqrt(factor.prod())))


def _check_inside(
    outlines: list[Outline], kept: list[int], size: tuple[int, int], thing: str, key: str
) -> None:
    """Refuse what lies wholly outside the photo: the file belongs to another one."""
    width, height = size
    for k, outline in zip(kept, outlines, strict=True):
        x0, y0, x1, y1 = outline.box_px
        if x1 < -0.5 or y1 < -0.5 or x0 > width - 0.5 or y0 > height - 0.5:
            x, y = outline.center_px
            raise InputError(
                f"{thing}, {key}[{k}]",
                f"expected {key} in the {width}x{height} photo, got one at ({x:.0f}, {y:.0f})",
                "give the outlines of this photo, in pixels of the upright photo",
            )


def _check_together(outlines: list[Outline], kept: list[int], thing: str, key: str) -> None:
    """Refuse outlines that contradict each other, by their numbers in the file."""
    from fronto.pose.checks import check_outlines

    try:
        check_outlines(outlines)
    except InputError as error:
        numbers = re.sub(r"\d+", lambda found: str(kept[int(found[0])]), error.thing)
        named = numbers.replace("outlines", key)
        raise InputError(f"{thing}, {named}", error.expected, error.remedy) from None
