"""Contact sheets, so that a person can see what went wrong: whole photos, or single findings."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from fronto.datasets.records import Box
from fronto.errors import InputError
from fronto.evaluate.matching import Finding, Verdict, photo_id
from fronto.evaluate.report import ImageResult
from fronto.imageio import read_image
from fronto.shapes import FloatArray

__all__ = ["finding_sheets", "photo_sheet"]

Picture = npt.NDArray[np.uint8]
Color = tuple[int, int, int]
Read = Callable[[Path], npt.NDArray[Any]]

GREEN: Color = (0, 220, 0)
#: A finding's own colour; a truth's is green.
COLORS: dict[Verdict, Color] = {
    "found": (60, 140, 255),
    "missed": (255, 220, 0),
    "false": (255, 40, 40),
    "unlabeled": (0, 230, 230),
    "ignored": (170, 170, 170),
}
PLATE_COLOR: Color = (220, 90, 255)
LEGEND = (
    ("labelled", GREEN),
    ("found", COLORS["found"]),
    ("missed", COLORS["missed"]),
    ("false", COLORS["false"]),
    ("label missing", COLORS["unlabeled"]),
    ("ignored", COLORS["ignored"]),
    ("plate", PLATE_COLOR),
)
BACK: Color = (32, 32, 32)
TEXT: Color = (240, 240, 240)
#: Height of a line of text, and its letters' in cv2's measure.
LINE, FONT = 18, 0.42
#: Sub-pixel bits of cv2's drawing functions.
SHIFT = 4
#: Around all that was found in a photo, in its larger extent.
MARGIN = 0.2
#: A crop shows at least this many pixels of the photo.
MIN_CROP = 24


def photo_sheet(
    results: Sequence[ImageResult],
    *,
    columns: int = 4,
    tile: int = 480,
    read: Read = read_image,
) -> Picture:
    """Photos side by side, with what was found, missed and false drawn on them.

    Of each the part with all of that is shown.

    Labelled outlines are green, detections blue, missed buttons yellow, false ones red with
    their confidence; plates are violet.

    Parameters
    ----------
    results
        At least one, such as `report.worst(24)`.
    columns
        Photos in a row.
    tile
        Side of the square that a photo is fitted into, pixels.
    read
        Gives a photo, (h, w, 3) RGB.

    Returns
    -------
    Shape (h, w, 3), uint8, RGB.

    Raises
    ------
    InputError
        If there is nothing to show, or a photo cannot be read.
    """
    if not results:
        raise InputError("contact sheet", "expected at least one photo, got none")
    tiles = [_photo_tile(result, tile, _picture(read, result.path)) for result in results]
    return _sheet(tiles, columns)


def finding_sheets(
    findings: Sequence[Finding],
    *,
    columns: int = 8,
    rows: int = 6,
    tile: int = 200,
    read: Read = read_image,
) -> Iterator[Picture]:
    """Crops of single findings with as much around them as they are large, page by page.

    Each has its number in `findings`, the photo, the category and the confidence below it.

    Parameters
    ----------
    findings
        Such as `report.false_positives` or `report.misses`.
    columns, rows
        Crops on a page.
    tile
        Side of a crop on the page, pixels.
    read
        Gives a photo, (h, w, 3) RGB.

    Yields
    ------
    Shape (h, w, 3), uint8, RGB.

    Raises
    ------
    InputError
        If a photo cannot be read.
    """
    size = columns * rows
    for start in range(0, len(findings), size):
        page = findings[start : start + size]
        tiles: dict[int, Picture] = {}
        for path in dict.fromkeys(finding.path for finding in page):  # each photo read once
            photo = _picture(read, path)
            for k, finding in enumerate(page):
                if finding.path == path:
                    tiles[k] = _finding_tile(finding, start + k, tile, photo)
        yield _sheet([tiles[k] for k in range(len(page))], columns)


def _picture(read: Read, path: Path) -> Picture:
    image = np.asarray(read(path))
    return np.asarray(image >> 8 if image.dtype == np.uint16 else image, np.uint8)


def _photo_tile(result: ImageResult, tile: int, photo: Picture) -> Picture:
    import cv2

    x0, y0, x1, y1 = _shown(result.findings, photo)
    photo = photo[y0:y1, x0:x1]
    height, width = photo.shape[:2]
    scale = tile / max(height, width)
    size = (max(1, round(width * scale)), max(1, round(height * scale)))
    way = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    small = np.asarray(cv2.resize(photo, size, interpolation=way), np.uint8)
    canvas = np.full((tile + LINE, tile, 3), BACK, np.uint8)
    left, top = (tile - size[0]) // 2, (tile - size[1]) // 2
    canvas[top : top + size[1], left : left + size[0]] = small
    offset = np.array([left, top]) - 0.5

    def place(points: FloatArray) -> FloatArray:
        return np.asarray((points - (x0, y0) + 0.5) * (size[0] / width, size[1] / height) + offset)

    order: tuple[Verdict, ...] = ("ignored", "found", "unlabeled", "missed", "false")
    for finding in sorted(result.findings, key=lambda f: (not f.of_plate, order.index(f.verdict))):
        _draw(canvas, finding, place)
    score = result.buttons
    missed = score.truths - score.found
    false = sum(f.verdict == "false" and not f.of_plate for f in result.findings)
    _caption(canvas, tile, f"missed {missed}, false {false} of {score.truths}: {result.name}")
    return canvas


def _shown(findings: Sequence[Finding], photo: Picture) -> tuple[int, int, int, int]:
    """The part of the photo with findings, and some margin: x0, y0, x1, y1, ends excluded."""
    boxes = np.array([b for f in findings for b in (f.box, f.truth_box) if b is not None])
    limits = photo.shape[1::-1]
    if not len(boxes):
        return 0, 0, *limits
    low, high = boxes[:, :2].min(axis=0), boxes[:, 2:].max(axis=0)
    margin = MARGIN * float((high - low).max()) + 1
    x0, y0 = (int(v) for v in np.clip(np.floor(low - margin), 0, np.array(limits) - 1))
    x1, y1 = (int(v) for v in np.clip(np.ceil(high + margin), (x0 + 1, y0 + 1), limits))
    return x0, y0, x1, y1


def _finding_tile(finding: Finding, number: int, tile: int, photo: Picture) -> Picture:
    import cv2

    box = finding.box or finding.truth_box
    assert box is not None  # a finding has one of the two
    side = max(3 * max(box[2] - box[0], box[3] - box[1]), MIN_CROP)
    size = round(side)
    x, y = (round((low + high - side) / 2) for low, high in ((box[0], box[2]), (box[1], box[3])))
    height, width = photo.shape[:2]
    crop = np.full((size, size, 3), BACK, np.uint8)
    x0, y0, x1, y1 = max(x, 0), max(y, 0), min(x + size, width), min(y + size, height)
    if x0 < x1 and y0 < y1:
        crop[y0 - y : y1 - y, x0 - x : x1 - x] = photo[y0:y1, x0:x1]
    way = cv2.INTER_AREA if size > tile else cv2.INTER_CUBIC
    canvas = np.full((tile + 2 * LINE, tile, 3), BACK, np.uint8)
    canvas[:tile] = cv2.resize(crop, (tile, tile), interpolation=way)

    def place(points: FloatArray) -> FloatArray:
        return np.asarray((points - (x, y) + 0.5) * (tile / size) - 0.5)

    _draw(canvas[:tile], finding, place, words=False)
    sure = "" if finding.confidence is None else f" {finding.confidence:.2f}"
    on = finding.truth_category
    beside = f" on {on}" if finding.verdict == "false" and on is not None else ""
    name = finding.category or finding.truth_category
    _caption(canvas, tile, f"{number}: {name}{sure}{beside}")
    _caption(canvas, tile + LINE, photo_id(finding.path))
    return canvas


def _draw(
    canvas: Picture,
    finding: Finding,
    place: Callable[[FloatArray], FloatArray],
    words: bool = True,
) -> None:
    """Draw the truth thin, the detection, and a false one's confidence (with `words`)."""
    import cv2

    color = PLATE_COLOR if finding.of_plate else COLORS[finding.verdict]
    missed = finding.verdict == "missed"
    if finding.truth_box is not None:
        outline = _outline(finding.truth_polygon, finding.truth_box)
        _line(canvas, place(outline), color if missed else GREEN, 2 if missed else 1)
    if finding.box is None:
        return
    points = place(_outline(finding.polygon, finding.box))
    _line(canvas, points, color, 2 if finding.verdict == "false" else 1)
    if words and finding.verdict == "false" and finding.confidence is not None:
        text = f"{finding.confidence:.2f}"
        (wide, high), _ = cv2.getTextSize(text, cv2.FONT_HERSHEY_SIMPLEX, FONT, 1)
        x, y = (int(v) for v in np.rint(points.min(axis=0)))
        corner = (
            int(np.clip(x, 1, canvas.shape[1] - wide - 2)),
            int(np.clip(y - 4, high + 2, canvas.shape[0] - LINE)),
        )
        for ink, thick in ((BACK, 3), (color, 1)):
            cv2.putText(
                canvas, text, corner, cv2.FONT_HERSHEY_SIMPLEX, FONT, ink, thick, cv2.LINE_AA
            )


def _outline(polygon: FloatArray | None, box: Box) -> FloatArray:
    if polygon is not None:
        return polygon
    x0, y0, x1, y1 = box
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])


def _line(canvas: Picture, points: FloatArray, color: Color, width: int) -> None:
    import cv2

    fixed = np.rint(points * 2**SHIFT).astype(np.int32)
    cv2.polylines(canvas, [fixed], True, color, width, cv2.LINE_AA, SHIFT)


def _caption(canvas: Picture, top: int, text: str, left: int = 4, color: Color = TEXT) -> int:
    """Write a line whose upper edge is `top`, its end cut off if need be; where it ends."""
    import cv2

    plain = text.encode("ascii", "replace").decode()

    def wide(words: str) -> int:
        return int(cv2.getTextSize(words, cv2.FONT_HERSHEY_SIMPLEX, FONT, 1)[0][0])

    while len(plain) > 3 and left + wide(plain) > canvas.shape[1]:
        plain = plain[:-3] + ".."
    place = (left, top + LINE - 5)
    cv2.putText(canvas, plain, place, cv2.FONT_HERSHEY_SIMPLEX, FONT, color, 1, cv2.LINE_AA)
    return left + wide(plain)


def _sheet(tiles: Sequence[Picture], columns: int) -> Picture:
    """Tiles of one size in rows, a gap between them, and what the colours mean below."""
    height, width = tiles[0].shape[:2]
    gap = 4
    columns = min(columns, len(tiles))
    rows = -(-len(tiles) // columns)
    across = max(columns * (width + gap) + gap, 480)
    sheet = np.full((rows * (height + gap) + gap + LINE, across, 3), BACK, np.uint8)
    for k, tile in enumerate(tiles):
        top, left = gap + k // columns * (height + gap), gap + k % columns * (width + gap)
        sheet[top : top + height, left : left + width] = tile
    left = gap
    for text, color in LEGEND:
        left = _caption(sheet, sheet.shape[0] - LINE, text, left, color) + 14
    return sheet
