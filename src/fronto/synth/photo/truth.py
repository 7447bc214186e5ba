"""The truth of a rendered photo: the outlines of the buttons and plates that it shows."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fronto.shapes import FloatArray, Outline
from fronto.synth.photo.draws import Pixels
from fronto.synth.photo.forms import contour, outline, project
from fronto.synth.photo.plan import Element
from fronto.synth.photo.view import NEAR_M, View, clipped, to_photo

__all__ = ["PhotoObject", "found"]

#: Objects of which less is to be seen are not listed.
MIN_VISIBLE = 0.25
#: Nor are objects that are smaller, in pixels: nobody can tell what they are.
MIN_SIDE_PX = 4.0


@dataclass(frozen=True, eq=False)
class PhotoObject:
    """A button or a plate in the photo.

    Parameters
    ----------
    category
        One of ``fronto.categories.CATEGORIES`` but "background".
    text
        What is printed on it, or on the plate that belongs to it.
    outline
        Its exact corners (where straight sides meet) or ellipse, pixels.
    polygon_px
        Shape (n, 2): its exact contour with rounded corners, pixels, clockwise.
    visible
        Share of the contour's area that lies in the photo and is not covered.
    lit
        Whether it is lit.
    """

    category: str
    text: str
    outline: Outline
    polygon_px: FloatArray
    visible: float
    lit: bool = False


def found(elements: list[Element], view: View, cover: Pixels | None) -> tuple[PhotoObject, ...]:
    """Outlines of the elements that the photo shows.

    Parameters
    ----------
    elements
        As drawn.
    view
        The camera.
    cover
        Shape (h, w), 0 to 1: what is hidden by something before the panel; or None.
    """
    objects = []
    for element in elements:
        at = (element.x / 1000, element.y / 1000)
        half = np.array([element.form.width, element.form.height]) / 2000
        square = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * half + at
        if (project(view.homography, square)[:, 2] < NEAR_M).any():
            continue
        polygon = to_photo(view, contour(element.form) / 1000 + at)
        if (np.ptp(polygon, axis=0) < MIN_SIDE_PX).any():
            continue
        inside = _inside(polygon, view)
        visible = 1.0 if inside and cover is None else _visible(polygon, view, cover)
        if visible < MIN_VISIBLE:
            continue
        shape = outline(
            view.homography, element.form, at, category=element.category, text=element.text
        )
        shape = replace(shape, truncated=not inside)
        polygon.setflags(write=False)
        objects.append(
            PhotoObject(element.category, element.text, shape, polygon, visible, element.lit)
        )
    return tuple(objects)


def _inside(polygon: FloatArray, view: View) -> bool:
    size = np.array([view.camera.width_px, view.camera.height_px])
    return bool((polygon >= -0.5).all() and (polygon <= size - 0.5).all())


def _area(polygon: FloatArray) -> float:
    x, y = polygon.T
    return float(abs((x * np.roll(y, -1) - np.roll(x, -1) * y).sum()) / 2)


def _visible(polygon: FloatArray, view: View, cover: Pixels | None) -> float:
    """Share of the area that lies in the photo and is not covered."""
    import cv2

    width, height = view.camera.width_px, view.camera.height_px
    bounds = np.array([(1, 0, 0.5), (-1, 0, width - 0.5), (0, 1, 0.5), (0, -1, height - 0.5)])
    part = clipped(polygon, bounds)
    if len(part) < 3:
        return 0.0
    share = _area(part) / _area(polygon)
    if cover is not None:
        x, y = np.maximum(np.floor(part.min(axis=0)), 0).astype(int)
        window = cover[y : y + 1 + int(np.ptp(part[:, 1])), x : x + 1 + int(np.ptp(part[:, 0]))]
        mask = np.zeros(window.shape, np.uint8)
        cv2.fillPoly(mask, [np.rint(part - [x, y]).astype(np.int32)], (1,))
        if mask.any():
            share *= 1 - float(window[mask > 0].mean())
    return min(share, 1.0)
