"""(d) The panel's plate as document scanners find a sheet of paper, by OpenCV alone.

Edges, contours, `approxPolyDP`, the largest quadrilateral, four points to a rectangle: the recipe
of A. Rosebrock, "How to Build a Kick-Ass Mobile Document Scanner" (pyimagesearch.com, 2014), with
several thresholds and colours as in OpenCV's sample squares.cpp. Besides, a plate must hold the
buttons, its weakest side counts, and its sides are fitted to the photo's gradient: without them
it is several times as far off.
"""

from __future__ import annotations

from collections.abc import Iterator

import cv2
import numpy as np

from fronto.errors import InputError
from fronto.shapes import order_corners
from scenes import Case, FloatArray, Image
from ways.answer import Answer, rotation_of
from ways.pinhole import pinhole_image

#: Upper thresholds of Canny; the lower ones are a third.
THRESHOLDS = (20, 30, 45, 70, 105, 160)
#: Tolerance of `approxPolyDP`, of the contour's length.
TOLERANCE = 0.02
#: Of the picture's area, at least and at most.
AREA = (0.003, 0.9)
#: How much a contour's area may differ from its quadrilateral's.
AREA_OFF = 0.08
#: From the picture's border: what lies closer is cut off.
BORDER_PX = 2.0
#: The largest quadrilateral, that is by area to this power times the gradient of its weakest side.
POWER = 2.0
#: Opposite sides differ by no more than this factor.
MOST_RATIO = 2.0
#: Sides are fitted within so many pixels of where they are, then of where they are found.
WITHIN_PX = (3.0, 1.5)
STEP_PX = 0.25
#: The middle part of a side, which is fitted: corners are rounded.
PART = (0.1, 0.9)


def _contours(image: Image) -> Iterator[FloatArray]:
    """Of closed edges, (n, 1, 2): as they are and their convex hulls."""
    grey = cv2.cvtColor(image, cv2.COLOR_RGB2GRAY)
    for channel in (grey, *cv2.split(image)):
        smooth = cv2.GaussianBlur(channel, (5, 5), 0)
        for high in THRESHOLDS:
            edges = cv2.Canny(smooth, high / 3, high)
            edges = cv2.morphologyEx(edges, cv2.MORPH_CLOSE, np.ones((3, 3), np.uint8))
            for contour in cv2.findContours(edges, cv2.RETR_LIST, cv2.CHAIN_APPROX_NONE)[0]:
                yield contour
                yield cv2.convexHull(contour)


def _quads(image: Image, centers: FloatArray) -> Iterator[FloatArray]:
    """Convex quadrilaterals (4, 2) that hold most of the buttons' centres (n, 2)."""
    height, width = image.shape[:2]
    least, most = (share * height * width for share in AREA)
    inner = np.array([width - 1, height - 1]) - BORDER_PX
    for contour in _contours(image):
        area = cv2.contourArea(contour)
        if not least <= area <= most:
            continue
        quad = cv2.approxPolyDP(contour, TOLERANCE * cv2.arcLength(contour, True), True)[:, 0]
        if len(quad) != 4 or not cv2.isContourConvex(quad):
            continue
        held = [cv2.pointPolygonTest(quad.astype(np.float32), c, False) > 0 for c in centers]
        sides = np.linalg.norm(np.roll(quad, -1, axis=0) - quad, axis=1)
        ratios = sides / np.roll(sides, 2)
        if (
            abs(area / cv2.contourArea(quad) - 1) < AREA_OFF
            and ((quad >= BORDER_PX) & (quad <= inner)).all()
            and (not held or np.mean(held) > 0.5)
            and ratios.max() < MOST_RATIO
        ):
            yield quad.astype(np.float64)


def _gradient(image: Image) -> FloatArray:
    """Its length, of the colour where it is the largest, (height, width)."""
    parts = cv2.split(cv2.GaussianBlur(image, (3, 3), 0))
    lengths = [
        np.hypot(cv2.Sobel(p, cv2.CV_32F, 1, 0), cv2.Sobel(p, cv2.CV_32F, 0, 1)) for p in parts
    ]
    return np.asarray(np.max(lengths, axis=0))


def _profiles(
    gradient: FloatArray, quad: FloatArray, side: int, within_px: float
) -> tuple[FloatArray, FloatArray]:
    """Gradients across a side and where they are: (points, offsets) and (points, offsets, 2)."""
    first, last = quad[side], quad[(side + 1) % 4]
    length = float(np.linalg.norm(last - first))
    normal = np.array([first[1] - last[1], last[0] - first[0]]) / length
    along = np.linspace(*PART, max(20, int(length)))[:, None]
    off = np.arange(-within_px, within_px + STEP_PX / 2, STEP_PX)
    at = (first + along * (last - first))[:, None] + off[:, None] * normal
    values = cv2.remap(gradient, at.astype(np.float32), None, cv2.INTER_LINEAR)
    return np.asarray(values, np.float64), at


def _weakest(gradient: FloatArray, quad: FloatArray) -> float:
    """Median gradient along the side where it is least."""
    return min(
        float(np.median(_profiles(gradient, quad, side, WITHIN_PX[1])[0].max(axis=1)))
        for side in range(4)
    )


def _fitted(gradient: FloatArray, quad: FloatArray, within_px: float) -> FloatArray:
    """Corners (4, 2) where lines through the steepest places across the sides meet."""
    lines = []
    for side in range(4):
        values, at = _profiles(gradient, quad, side, within_px)
        steepest = at[np.arange(len(at)), values.argmax(axis=1)]
        dx, dy, x, y = cv2.fitLine(
            steepest.astype(np.float32), cv2.DIST_HUBER, 0, 0.01, 0.01
        ).ravel()
        lines.append(np.cross([x, y, 1.0], [x + dx, y + dy, 1.0]))
    corners = np.cross(np.roll(lines, 1, axis=0), lines)
    return np.asarray(corners[:, :2] / corners[:, 2:])


def _to_rectangle(corners: FloatArray) -> FloatArray:
    """The homography to a rectangle whose sides are the longer ones of opposite sides."""
    sides = np.linalg.norm(np.roll(corners, -1, axis=0) - corners, axis=1)
    width, height = max(sides[0], sides[2]), max(sides[1], sides[3])
    rectangle = np.array([[0, 0], [width, 0], [width, height], [0, height]], np.float32)
    return np.asarray(cv2.getPerspectiveTransform(corners.astype(np.float32), rectangle))


def document(case: Case) -> Answer:
    """The rotation is that of the homography, by the camera's matrix."""
    image = pinhole_image(case)
    centers = np.array([s.center_px for s in case.segments.buttons]).reshape(-1, 2)
    centers = case.camera.undistort_points(centers)
    gradient = _gradient(image)
    quads = list(_quads(image, centers))
    if not quads:
        return Answer(case.camera, reason="no quadrilateral that holds the buttons")
    areas = [cv2.contourArea(quad.astype(np.float32)) for quad in quads]
    weighed = [
        area**POWER * _weakest(gradient, quad) for area, quad in zip(areas, quads, strict=True)
    ]
    corners = quads[int(np.argmax(weighed))]
    with np.errstate(all="ignore"):
        for within_px in WITHIN_PX:
            corners = _fitted(gradient, corners, within_px)
    try:
        corners = order_corners(corners)
    except InputError:
        return Answer(case.camera, reason="the sides of the quadrilateral do not meet")
    H = _to_rectangle(corners)
    return Answer(case.camera, rotation_of(H, case.camera), homography=H)
