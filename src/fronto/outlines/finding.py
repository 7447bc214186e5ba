"""`outline`: from masks to ordered corners and ellipses."""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from fronto.errors import InputError
from fronto.outlines.agreement import agreeing_orders, at_odds, doubles
from fronto.outlines.build import built, measured
from fronto.outlines.edgehead import told_edges
from fronto.outlines.edgeprofiles import EdgeHead
from fronto.outlines.edges import edge_points
from fronto.outlines.hough import hough_corners
from fronto.outlines.kinds import find_shapes
from fronto.outlines.result import Outlines
from fronto.outlines.subpixel import refine
from fronto.segments import Segment, Segments
from fronto.shapes import FloatArray, LineSegment, Outline, order_corners

if TYPE_CHECKING:
    from pathlib import Path

    from PIL import Image

__all__ = ["outline"]

#: A Hough line's deviation: the accumulator's cells and the mask's pixels.
HOUGH_STD_PX = 1.0


def outline(
    segments: Segments,
    image: npt.NDArray[Any] | Image.Image | str | Path | None = None,
    *,
    corners: Literal["subpixel", "hough"] = "subpixel",
    lines: bool = True,
    edges: EdgeHead | bool = True,
    order: Literal["rgb", "bgr"] = "rgb",
) -> Outlines:
    """Find the corners of rectangular buttons and the ellipses of round ones.

    Corners come in the order top-left, top-right, bottom-right, bottom-left as the panel reads
    upright, for photos rolled by less than 45 degrees.

    Parameters
    ----------
    segments
        The masks: of `fronto.segment`, or your own (`Segments.from_masks`).
    image
        The photo that they are of, to refine the outlines on its edges and to find lines;
        None: the masks alone.
    corners
        "subpixel": lines and ellipses fitted to the masks' edges and, where it shows them
        clearly and agrees, to the photo's (default). "hough": closing, edges, Hough transform
        and intersections, as in the paper's Section III.B; for rectangular buttons, masks only.
    lines
        Whether to look for long lines of the panel in the photo, which help the pose
        ("subpixel" with an image only).
    edges
        What tells which of the photo's edges is a button's, for masks that a mask head has drawn
        (`Segment.forms`): True is the edge head in the package, where it has one; False is none.
    order
        Order of an array's channels.

    Returns
    -------
    Outlines of buttons and plates, each with a standard deviation. Masks that have none are
    told in `left_out`.

    Raises
    ------
    InputError
        If an argument cannot be used, or the image's size is not that of the segments.

    Examples
    --------
    >>> import fronto, numpy as np
    >>> mask = np.zeros((1, 60, 80), bool)
    >>> mask[0, 20:40, 30:50] = True
    >>> found = fronto.outline(fronto.Segments.from_masks(mask))
    >>> found.buttons[0].corners_px.round(1).tolist()
    [[29.5, 19.5], [49.5, 19.5], [49.5, 39.5], [29.5, 39.5]]
    """
    if corners not in ("subpixel", "hough"):
        raise InputError("corners", f'expected "subpixel" or "hough", got {corners!r}')
    if not isinstance(segments, Segments):
        raise InputError(
            "segments",
            f"expected fronto.Segments, got {type(segments).__name__}",
            "Segments.from_masks makes them from your own masks",
        )
    started = time.perf_counter()
    rgb = None if image is None else _photo(image, segments, order)
    if corners == "hough":
        rgb = None
    read = time.perf_counter()
    head = _head(edges, segments) if rgb is not None else None
    found = [
        _found(part, rgb, segments, corners, by)
        for part, by in ((segments.buttons, head), (segments.plates, None))
    ]
    (buttons, sources, reasons), (plates, _, _) = found
    outlined = time.perf_counter()
    context: list[LineSegment] = []
    if lines and rgb is not None:
        from fronto.outlines.context import panel_lines

        context = panel_lines(rgb, buttons)
    end = time.perf_counter()
    return Outlines(
        segments.width_px,
        segments.height_px,
        tuple(buttons),
        tuple(plates),
        tuple(context),
        tuple(reasons),
        tuple(sources),
        {
            "read": 1e3 * (read - started),
            "outline": 1e3 * (outlined - read),
            "lines": 1e3 * (end - outlined),
            "total": 1e3 * (end - started),
        },
    )


def _head(edges: EdgeHead | bool, segments: Segments) -> EdgeHead | None:
    if not isinstance(edges, bool):
        return edges
    if not edges or not any(segment.forms for segment in segments.buttons):
        return None
    from fronto.engine import packaged_edges

    return packaged_edges()


def _photo(image: Any, segments: Segments, order: Literal["rgb", "bgr"]) -> npt.NDArray[np.uint8]:
    from fronto.images import as_rgb

    rgb = as_rgb(image, order=order)
    size = (segments.width_px, segments.height_px)
    if rgb.shape[1::-1] != size:
        raise InputError(
            "image",
            f"expected the photo of the segments, {size[0]}x{size[1]} px, "
            f"got {rgb.shape[1]}x{rgb.shape[0]} px",
            "give the photo that was segmented, at the same size",
        )
    return rgb


def _found(
    segments: Sequence[Segment],
    rgb: npt.NDArray[np.uint8] | None,
    photo: Segments,
    corners: Literal["subpixel", "hough"],
    edges: EdgeHead | None,
) -> tuple[list[Outline], list[float], list[str]]:
    """Outlines, the share of each that is from the photo, and why others have none."""
    if not segments:
        return [], [], []
    points = edge_points(segments, photo.width_px, photo.height_px)
    seen = [segment.forms for segment in segments]
    forms = np.array(seen) if corners == "subpixel" and all(seen) else None
    shapes = find_shapes(points, rgb, forms)
    drawn = np.array([bool(segment.forms) for segment in segments])
    told = None
    if rgb is not None and edges is not None:
        at_border = np.bincount(points.owner[points.border], minlength=len(drawn)) > 0
        told = told_edges(rgb, shapes, points.size, points.blur, drawn & ~at_border, edges)
    refined = refine(rgb, shapes, points.size, points.blur, drawn, told)
    known = measured(points, shapes, refined, drawn)
    from_photo = refined.from_image.mean(axis=1)
    outlines, sources, reasons = [], [], []
    for k, segment in enumerate(segments):
        result = built(segment, known, k)
        share = float(from_photo[k])
        if isinstance(result, Outline) and result.shape == "ellipse":
            share = float(refined.ellipse_from_image[k])
        elif corners == "hough" and isinstance(result, Outline):
            result, share = _hough(segment, result), 0.0
        if isinstance(result, Outline):
            outlines.append(result)
            sources.append(share)
        else:
            reasons.append(_left_out(segment.category, segment.center_px, result))
    twice = doubles(outlines)
    reasons += [
        _left_out(o.category, o.center_px, "another outline is of the same button")
        for o in (outlines[k] for k in twice)
    ]
    kept = [k for k in range(len(outlines)) if k not in twice]
    outlines, sources = agreeing_orders([outlines[k] for k in kept]), [sources[k] for k in kept]
    strange = at_odds(outlines)
    reasons += [
        _left_out(o.category, o.center_px, "its sides run another way than the others'")
        for o in (outlines[k] for k in strange)
    ]
    kept = [k for k in range(len(outlines)) if k not in strange]
    return [outlines[k] for k in kept], [sources[k] for k in kept], reasons


def _left_out(category: str, center: Sequence[float] | FloatArray, reason: str) -> str:
    return f"{category} at ({center[0]:.0f}, {center[1]:.0f}): {reason}"


def _hough(segment: Segment, other: Outline) -> Outline | str:
    found = hough_corners(segment)
    if found is None:
        return "the Hough transform finds no four lines"
    try:
        ordered = order_corners(found)
    except InputError:
        return "the Hough transform's lines bound no button"
    return replace(other, corners_px=ordered, std_px=HOUGH_STD_PX)
