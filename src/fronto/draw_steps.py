"""A contact sheet for people who want to look inside: every step from the photo to the result."""

from __future__ import annotations

import textwrap
from typing import Any

import numpy as np
import numpy.typing as npt

from fronto.categories import PLATE
from fronto.draw import STATUS, UNDETERMINED, draw_frame, pose_words, printable
from fronto.draw_before_after import draw_view
from fronto.draw_outlines import draw_outlines
from fronto.draw_residuals import draw_residuals
from fronto.draw_segments import COLORS, draw_segments
from fronto.draw_tiles import BACK, INK, Window, sheet, titled
from fronto.drawing import Color, Picture, dot, polylines, rgb_canvas, text_size, write_text
from fronto.errors import InputError
from fronto.outlines.edges import closed_mask
from fronto.outlines.result import Outlines
from fronto.pose.verdict import SET_ASIDE
from fronto.results import Panel
from fronto.segments import Segments
from fronto.shapes import Outline

__all__ = ["draw_steps"]

COLUMNS = 3
#: Of a pixel that belongs to a button for sure, and of a closed mask's.
HEAT, TINT = 0.8, 0.45
#: How bright the photo is below edges, lines and arrows.
DIM = 0.45
EDGE: Color = (255, 255, 255)
ADDED: Color = (255, 235, 60)
DROPPED: Color = (255, 40, 40)
#: Sides that are not seen, and those of odd shapes, which no line was fitted to.
GUESSED: Color = (150, 150, 150)
#: How far a side's line goes on beyond its corners, in sides; an ellipse's axes, in axes.
BEYOND = 0.3
#: Height of a line of text, pixels.
LINE = 17


def draw_steps(
    photo_rgb: npt.NDArray[Any], segments: Segments, outlines: Outlines, panel: Panel
) -> Picture:
    """Draw one contact sheet of all steps, three tiles in a row, each with a title.

    In reading order: the photo, and the part of it that the next tiles show; the probability
    of a button; the masks; the masks closed, and their edges (paper, Section III.B); the lines
    along the buttons' sides, and where they meet; outlines with their deviations, and
    lines of the panel where there are any; arrows, drawn longer than they are, from the measured
    corners to the pose's (of an ellipse: from its four outermost points), red where the outline
    was set aside; the head-on view; status, camera, rotation and timings in words. Tiles that
    have nothing to show say so.

    Parameters
    ----------
    photo_rgb
        Shape (h, w, 3), (h, w, 1) or (h, w), uint8, RGB.
    segments, outlines
        What was found in the photo.
    panel
        The result, of any status.

    Returns
    -------
    Shape (h', w', 3), uint8, RGB: 1464 px wide; its height depends on the shape of the part
    that is shown.

    Raises
    ------
    InputError
        If the photo is not uint8 with 1 or 3 channels, or of another size than what was found.
    """
    size = (segments.width_px, segments.height_px)
    photo = rgb_canvas(photo_rgb, size)
    for thing, other in (("outlines", outlines), ("panel", panel)):
        if (other.width_px, other.height_px) != size:
            raise InputError(
                thing,
                f"expected those of a photo of {size[0]}x{size[1]} px, as the segments are, "
                f"got {other.width_px}x{other.height_px}",
                "give the results of one and the same photo",
            )
    boxes = [segment.box_px for segment in segments]
    # A guessed corner may be far away.
    boxes += [o.box_px for o in (*outlines.buttons, *outlines.plates) if not o.truncated]
    window = Window.around(boxes, *size)
    part = window.picture(photo)
    for array in (photo, part):
        array.setflags(write=False)
    shown = tuple(s for s in map(window.segment, segments) if s is not None)
    in_tile = Segments(window.width, window.height, shown)
    masks, edges = _draw_masks(part, window, segments)
    found = (
        f"{_counted(len(segments.buttons), 'button')}, {_counted(len(segments.plates), 'plate')}"
    )
    residuals, factor = draw_residuals(_dimmed(part), window, panel)
    residuals = _or_none(residuals, factor, "no pose that has residuals")
    long = f", {factor:g} x as long" if factor else ""
    view = panel.view
    view_size = "" if view is None else f", {view.width_px} x {view.height_px} px"
    tiles = [
        (f"1 photo, {size[0]} x {size[1]} px", _draw_photo(photo, window)),
        ("2 probability of a button", _draw_heat(part, in_tile)),
        (f"3 masks: {found}", _or_none(draw_segments(part, in_tile), len(shown), "nothing found")),
        ("4 closed masks (yellow added, red dropped), edges", masks),
        (
            "5 lines along the sides, and where they meet",
            _draw_sides(part, edges, window, outlines),
        ),
        (
            "6 outlines, deviations in px" + (", lines" if outlines.lines else ""),
            _draw_outlined(part, window, outlines),
        ),
        (f"7 measured to model{long}, RMS in px; red: set aside", residuals),
        (f"8 head-on view{view_size}", _draw_rectified(panel, window)),
        ("9 result", _draw_words(panel, window)),
    ]
    return sheet([titled(tile, title) for title, tile in tiles], COLUMNS)


def _draw_photo(photo: Picture, window: Window) -> Picture:
    """The whole photo, and which part of it the other tiles show."""
    height, width = photo.shape[:2]
    all_of_it = Window((0, 0, width, height), window.width, window.height)
    tile = all_of_it.picture(photo)
    x0, y0, x1, y1 = window.part
    if (x0, y0, x1, y1) != all_of_it.part:
        frame = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]]) - 0.5
        polylines(tile, [all_of_it.points(frame)], True, INK, 1)
    return tile


def _draw_heat(part: Picture, segments: Segments) -> Picture:
    """The largest probability of any button at each pixel, as a colour over the grey photo."""
    import cv2

    heat = np.zeros(part.shape[:2], np.float32)
    for segment in segments.buttons:
        x, y = segment.origin_px
        rows, columns = segment.probability.shape
        over = heat[y : y + rows, x : x + columns]
        np.maximum(over, segment.probability, out=over)
    grey = cv2.cvtColor(part, cv2.COLOR_RGB2GRAY)[..., None]
    share = HEAT * np.clip(heat, 0, 1)[..., None]
    tile: Picture = np.rint((1 - share) * grey + share * _colormap(heat)).astype(np.uint8)
    if not segments.buttons:
        return _noted(tile, "no buttons found")
    high, wide = tile.shape[0] - 12, 100
    write_text(tile, "0", (8, high), 1.0, INK)
    tile[high - 10 : high, 22 : 22 + wide] = _colormap(np.linspace(0, 1, wide)[None])
    write_text(tile, "1", (28 + wide, high), 1.0, INK)
    return tile


def _colormap(values: npt.NDArray[Any]) -> Picture:
    import cv2

    levels = np.rint(255 * np.clip(values, 0, 1)).astype(np.uint8)
    return np.asarray(cv2.applyColorMap(levels, cv2.COLORMAP_TURBO))[..., ::-1]


def _draw_masks(
    part: Picture, window: Window, segments: Segments
) -> tuple[Picture, npt.NDArray[np.bool_]]:
    """Masks after the closing, what it has changed, and their edges; the edges alone too."""
    tile = _dimmed(part)
    edges = np.zeros(part.shape[:2], bool)
    for segment in reversed(segments.segments):
        # A large photo's masks are looked at as small as they are shown.
        small = bool(window.scale.min() < 1)
        worked = window.segment(segment) if small else segment
        if worked is None:
            continue
        mask = worked.mask
        closed = closed_mask(mask)
        edge = _edge(closed)
        color = COLORS[segment.category]
        layers = (
            (closed & mask, color, TINT),
            (closed & ~mask, ADDED, 1.0),
            (mask & (closed == 0), DROPPED, 1.0),
            (edge, EDGE, 1.0),
        )
        for layer, ink, tint in layers:
            shown: Any = (layer.astype(np.uint8), worked.origin_px)
            if not small:
                shown = window.sampled(*shown, smooth=False)
            if shown is None:
                continue
            inside, (x, y) = shown[0] > 0, shown[1]
            over = np.s_[y : y + inside.shape[0], x : x + inside.shape[1]]
            tile[over][inside] = np.rint((1 - tint) * tile[over][inside] + tint * np.array(ink))
            if layer is edge:
                edges[over] |= inside
    return _or_none(tile, len(segments), "nothing found"), edges


def _edge(mask: npt.NDArray[np.uint8]) -> npt.NDArray[np.uint8]:
    """The mask's outermost pixels, which the Hough transform sees."""
    import cv2

    framed = cv2.copyMakeBorder(mask, 1, 1, 1, 1, cv2.BORDER_CONSTANT, value=(0,))
    return np.asarray(framed - cv2.erode(framed, np.ones((3, 3), np.uint8)))[1:-1, 1:-1]


def _draw_sides(
    part: Picture, edges: npt.NDArray[np.bool_], window: Window, outlines: Outlines
) -> Picture:
    """The lines along each quad's sides and an ellipse's axes, over the masks' edges."""
    tile = _dimmed(part)
    tile[edges] = np.rint(0.5 * tile[edges] + 0.5 * np.array(EDGE))
    drawn = [(plate, COLORS[PLATE]) for plate in outlines.plates]
    drawn += [(b, COLORS.get(b.category, COLORS["other"])) for b in outlines.buttons]
    for outline, color in drawn:
        if outline.ellipse_px is not None:
            _draw_axes(tile, window, outline, color)
        else:
            _draw_lines(tile, window, outline, color)
    return _or_none(tile, len(drawn), "no outlines")


def _draw_lines(tile: Picture, window: Window, outline: Outline, color: Color) -> None:
    assert outline.corners_px is not None
    corners = window.points(outline.corners_px)
    sides = np.roll(corners, -1, axis=0) - corners
    for k, seen in enumerate(outline.seen):
        ends = corners[k] + np.array([[-BEYOND], [1 + BEYOND]]) * sides[k]
        polylines(tile, [ends], False, color if seen and not outline.odd else GUESSED, 1)
    for corner in corners:
        dot(tile, corner, 2.5, color)


def _draw_axes(tile: Picture, window: Window, outline: Outline, color: Color) -> None:
    assert outline.ellipse_px is not None
    ellipse = outline.ellipse_px
    polylines(tile, [window.points(ellipse.points(96))], True, color, 1)
    turned = np.radians(ellipse.angle_deg) + np.array([0, np.pi / 2])
    directions = np.stack([np.cos(turned), np.sin(turned)], axis=1)
    for direction, length in zip(directions, (ellipse.a, ellipse.b), strict=True):
        reach = (1 + BEYOND) * length * direction
        ends = window.points(ellipse.center + np.array([-reach, reach]))
        polylines(tile, [ends], False, color, 1)
    dot(tile, window.points(ellipse.center[None])[0], 2.5, color)


def _draw_outlined(part: Picture, window: Window, outlines: Outlines) -> Picture:
    def kept(items: Any) -> Any:
        return tuple(item for item in items if item is not None)

    in_tile = Outlines(
        window.width,
        window.height,
        kept(map(window.outline, outlines.buttons)),
        kept(map(window.outline, outlines.plates)),
        kept(map(window.line, outlines.lines)),
    )
    tile = draw_outlines(part, in_tile)
    return _or_none(tile, len(outlines.buttons) + len(outlines.plates), "no outlines")


def _draw_rectified(panel: Panel, window: Window) -> Picture:
    tile = np.full((window.height, window.width, 3), BACK, np.uint8)
    if panel.view is None:
        return _noted(tile, "no head-on view: no rotation to trust")
    view = draw_view(panel, window.width, window.height, 1.0)
    left = (window.width - view.shape[1]) // 2
    tile[:, left : left + view.shape[1]] = view
    draw_frame(tile, panel.pose, 1.0)
    return tile


def _draw_words(panel: Panel, window: Window) -> Picture:
    """Status, camera, rotation, deviations and timings, as far as there is room."""
    tile = np.full((window.height, window.width, 3), BACK, np.uint8)
    letters = int((window.width - 16) / (text_size("0" * 20, 1.0)[0] / 20))
    lines = [
        (line, color)
        for text, color in _words(panel)
        for line in textwrap.wrap(printable(text), letters, subsequent_indent="  ") or [""]
    ]
    room = (window.height - LINE) // LINE
    if len(lines) > room:
        lines[room - 1 :] = [("...", INK)]
    for k, (line, color) in enumerate(lines):
        write_text(tile, line, (8, LINE * (k + 1)), 1.0, color)
    return tile


def _words(panel: Panel) -> list[tuple[str, Color]]:
    pose, camera = panel.pose, panel.pose.camera
    background, status = STATUS[panel.status]
    # The status' colours are made for white letters on them.
    loud: Color = tuple(min(255, 70 + round(0.9 * c)) for c in background)  # type: ignore[assignment]
    words = [(status, loud), *((f"- {reason}", loud) for reason in panel.reasons), ("", INK)]
    focal = f"camera: {camera.source}, f = {camera.focal_px:.0f} px"
    focal += f" +- {100 * camera.focal_std:.1f} %" if camera.focal_std > 0 else ", taken as known"
    fov = camera.horizontal_fov_deg
    words.append((focal + (f", {fov:.0f} deg wide" if np.isfinite(fov) else ""), INK))
    if camera.detail:
        words.append((f"  {camera.detail}", INK))
    words += [(line, INK) for line in pose_words(pose)]
    if pose.status not in UNDETERMINED and pose.aspect_std is not None:
        words.append((f"width to height known to {100 * pose.aspect_std:.1f} %", INK))
    aside = sum(button.weight < SET_ASIDE for button in panel.buttons)
    counts = f"{_counted(len(panel.buttons), 'button')}, {_counted(len(panel.plates), 'plate')}"
    words += [(counts + (f", {aside} set aside" if aside else ""), INK), ("", INK)]
    stages = [f"{stage} {value:.1f}" for stage, value in panel.timing_ms.items()]
    if stages:
        words += [(f"milliseconds: {', '.join(stages)}", INK), ("", INK)]
    return words + [(f"note: {note}", INK) for note in (*panel.notes, *pose.notes)]


def _dimmed(part: Picture) -> Picture:
    return np.asarray(np.rint(DIM * part), np.uint8)


def _or_none(tile: Picture, number: int, note: str) -> Picture:
    """The tile, with the note on it if there are none."""
    return tile if number else _noted(tile, note)


def _noted(tile: Picture, note: str) -> Picture:
    wide, high = text_size(note, 1.2)
    at = ((tile.shape[1] - wide) // 2, (tile.shape[0] + high) // 2)
    write_text(tile, note, at, 1.2, INK)
    return tile


def _counted(number: int, thing: str) -> str:
    return f"{number} {thing}{'' if number == 1 else 's'}"
