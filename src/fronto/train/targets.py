"""From outlines and boxes to what each map of the network should say."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import cv2
import numpy as np
import numpy.typing as npt

from fronto.categories import CATEGORIES, PLATE
from fronto.datasets.records import Form
from fronto.shapes import FloatArray
from fronto.train.network import STRIDE

__all__ = ["IGNORE", "SOME_BUTTON", "Target", "Targets", "draw_targets"]

#: Class maps: no verdict here; some button, whichever.
IGNORE, SOME_BUTTON = 255, 254
#: Of a button known by its box only: this share of the inscribed ellipse is surely button.
SURE = 0.92
#: Of one known to be round: what lies between these shares is left open. Of a rectangular one:
#: this share of a rectangle with round corners is surely button.
ROUND, SQUARE = (0.96, 1.05), 0.92
#: Exponent of the superellipse that stands for that rectangle.
CORNERS = 6.0
#: Standard deviation of a centre's peak in box sides, and its least in cells.
PEAK, MIN_PEAK = 0.10, 0.7
#: Cells up to this far from the centre (in half box sides) learn the box's sides.
INNER = 0.75
#: Most of all objects.
FREQUENT = ("number", "unknown")
#: A cell of such an object, or of another kind, counts this much: most of all cells are
#: background, and they alone would be learnt.
OBJECT, RARE = 2.5, 5.0
#: Fixed-point bits of OpenCV's drawing.
SHIFT = 6
#: OpenCV fills every pixel that a polygon touches, half a pixel too much all around: outlines
#: are drawn this much larger, and the pixels' centres taken.
FINE = 4
#: What a mask says where the class is this.
_MASK_OF = np.zeros(256, np.uint8)
_MASK_OF[[*range(1, len(CATEGORIES)), SOME_BUTTON]] = 1
_MASK_OF[CATEGORIES.index(PLATE)] = 2
_MASK_OF[IGNORE] = IGNORE


@dataclass(frozen=True, eq=False)
class Target:
    """One object of a training picture.

    Parameters
    ----------
    category
        A category, or "unknown" for some button.
    polygon
        Shape (n, 2), pixels: its outline. Where only the box is known: the box's corners.
    exact
        Whether the polygon is the outline; else what lies between the ellipse inscribed in
        it and the box around it is left open.
    ignore
        Neither right nor wrong, whatever is found here.
    form
        Of one whose outline is not exact: whether it is round or rectangular, if known.
    """

    category: str
    polygon: FloatArray
    exact: bool
    ignore: bool = False
    form: Form = ""


@dataclass(frozen=True, eq=False)
class Targets:
    """What the maps of one picture should say; h, w = H / 4, W / 4.

    Parameters
    ----------
    masks
        (H, W) uint8: 0 nothing, 1 button, 2 plate, `IGNORE`.
    classes
        (h, w) uint8: class numbers, `SOME_BUTTON`, `IGNORE`.
    weights
        (h, w) float32: of a cell in the classes' loss; small buttons count more.
    centers
        (2, h, w) float32: peaks of buttons and plates, 1 in the centre's cell; below 0:
        no verdict here.
    sides
        (4, h, w) float32: distances to left, top, right, bottom, pixels.
    inside
        (h, w) float32: weight of a cell in the sides' loss, summing to 1 over each object.
    """

    masks: npt.NDArray[np.uint8]
    classes: npt.NDArray[np.uint8]
    weights: npt.NDArray[np.float32]
    centers: npt.NDArray[np.float32]
    sides: npt.NDArray[np.float32]
    inside: npt.NDArray[np.float32]


def _fill(fine: npt.NDArray[np.uint8], polygon: FloatArray, value: int) -> None:
    """Fill a polygon in a picture `FINE` times as large."""
    at = polygon * FINE + FINE // 2
    cv2.fillPoly(fine, [np.rint(at * 2**SHIFT).astype(np.int32)], value, shift=SHIFT)


def _inscribed(polygon: FloatArray, scale: float, power: float = 2.0) -> FloatArray:
    """The (super)ellipse that touches a parallelogram's sides in their middles, scaled."""
    center = polygon.mean(axis=0)
    u = 0.25 * (polygon[1] + polygon[2] - polygon[0] - polygon[3])
    v = 0.25 * (polygon[2] + polygon[3] - polygon[0] - polygon[1])
    t = np.linspace(0, 2 * np.pi, 48, endpoint=False)[:, None]
    cos, sin = (np.sign(w) * np.abs(w) ** (2 / power) for w in (np.cos(t), np.sin(t)))
    return np.asarray(center + scale * (cos * u + sin * v))


def _open(o: Target) -> FloatArray:
    """Within this it is left open what belongs to an object that is not exact."""
    return _inscribed(o.polygon, ROUND[1]) if o.form == "round" else o.polygon


def _sure(o: Target) -> FloatArray:
    """What surely belongs to an object."""
    if o.exact:
        return o.polygon
    if o.form == "round":
        return _inscribed(o.polygon, ROUND[0])
    return _inscribed(o.polygon, *((SQUARE, CORNERS) if o.form == "square" else (SURE,)))


def draw_targets(objects: Sequence[Target], width: int, height: int) -> Targets:
    """Draw the targets of one picture.

    Parameters
    ----------
    objects
        What is in it; what lies outside of the picture is cut off.
    width, height
        Of the picture, multiples of 4.
    """
    h, w = height // STRIDE, width // STRIDE
    fine = np.zeros((height * FINE, width * FINE), np.uint8)
    centers = np.zeros((2, h, w), np.float32)
    weights = np.ones((h, w), np.float32)
    sides = np.ones((4, h, w), np.float32)
    inside = np.zeros((h, w), np.float32)
    for o in objects:
        if o.ignore or not o.exact:
            _fill(fine, o.polygon if o.ignore else _open(o), IGNORE)
    for o in (o for o in objects if not o.ignore):
        number = CATEGORIES.index(o.category) if o.category in CATEGORIES else SOME_BUTTON
        _fill(fine, _sure(o), number)
    classes = fine[FINE // 2 :: FINE, FINE // 2 :: FINE]
    x = np.arange(w) * STRIDE + (STRIDE - 1) / 2
    y = np.arange(h) * STRIDE + (STRIDE - 1) / 2
    limits = np.array([width, height]) - 0.5
    # What is ignored comes last: peaks would cover it, wherever they are.
    for o in sorted(objects, key=lambda o: o.ignore):
        # Of an object cut by the border what counts is the part that is seen.
        outline = o.polygon if o.exact else _inscribed(o.polygon, 1.0)
        low = np.clip(outline.min(axis=0), -0.5, limits)
        high = np.clip(outline.max(axis=0), -0.5, limits)
        size = high - low
        if (size < 2).any():
            continue
        middle = (low + high) / 2
        if o.ignore:
            box = (x > low[0]) & (x < high[0]) & ((y > low[1]) & (y < high[1]))[:, None]
            centers[:, box] = np.where(centers[:, box] == 1, 1, -1)
            continue
        plane = centers[int(o.category == PLATE)]
        spread = np.maximum(PEAK * size, MIN_PEAK * STRIDE)
        peak = (
            np.exp(-0.5 * ((x - middle[0]) / spread[0]) ** 2)
            * np.exp(-0.5 * ((y - middle[1]) / spread[1]) ** 2)[:, None]
        )
        np.maximum(plane, peak, out=plane)
        j, i = np.clip(np.rint((middle - 1.5) / STRIDE).astype(int), 0, (w - 1, h - 1))
        plane[i, j] = 1
        near = (np.abs(x - middle[0]) < INNER * size[0] / 2) & (
            np.abs(y - middle[1]) < INNER * size[1] / 2
        )[:, None]
        near[i, j] = True
        yy, xx = np.nonzero(near)
        sides[:, yy, xx] = np.maximum(
            [x[xx] - low[0], y[yy] - low[1], high[0] - x[xx], high[1] - y[yy]], 0.5
        )
        inside[yy, xx] = 1 / len(yy)
        rarity = OBJECT if o.category in FREQUENT else RARE
        weights[yy, xx] = rarity * np.clip(np.sqrt(64 / len(yy)), 0.7, 4)
    coarse = np.ascontiguousarray(classes[1::STRIDE, 1::STRIDE])
    return Targets(_MASK_OF[classes], coarse, weights, centers, sides, inside)
