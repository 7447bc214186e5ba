"""Round or rectangular? What the photo says about objects of which only the box is labelled.

On the way from a box's middle to its corner, the edge of a round button lies at 1/√2 of the
way, that of a rectangular one near the end, however the photo was stretched.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from fronto.categories import PLATE
from fronto.datasets.records import Box, Form, LabeledImage, LabeledObject

__all__ = ["with_forms"]

#: Where to look on the way from the middle (0) to the corner (1); where a round button's
#: edge is, and a rectangular one's with round corners.
WAY = np.linspace(0.5, 1.15, 53)
ROUND, SQUARE = (0.655, 0.76), (0.80, 1.02)
#: Directions looked along, degrees off the diagonals.
BESIDE = (-8.0, 0.0, 8.0)
#: Smaller ones show too little, pixels; much longer ones are no circles.
LEAST_PX, LONGEST = 9.0, 1.5
#: Logarithm (base 2) of the round edge's strength against the rectangular one's: a photo
#: above is one of round buttons, below of rectangular ones (judged by looking at photos of
#: either side); and what each button of such a photo must show itself.
ROUND_PHOTO, SQUARE_PHOTO, ROUND_ITSELF, SQUARE_ITSELF = 1.25, 0.0, 0.4, 0.4
#: Weakest evidence of one button that counts.
WEAKEST = 0.05


def with_forms(images: Iterable[LabeledImage]) -> list[LabeledImage]:
    """Say of buttons known by their box whether they are round or rectangular.

    The buttons of a photo decide together, since most panels have one kind; those that
    look otherwise, and photos that are not clear, are left as they are.

    Raises
    ------
    InputError
        If a photo cannot be read.
    """
    return [_formed(image) for image in images]


def _formed(image: LabeledImage) -> LabeledImage:
    from fronto.images import as_rgb

    asked = [k for k, o in enumerate(image.objects) if _askable(o, image)]
    if not asked:
        return image
    rgb = as_rgb(image.path)
    evidence = np.array([_evidence(rgb, image.objects[k].box) for k in asked])
    together = float(evidence.mean())
    form: Form
    if together > ROUND_PHOTO:
        form, agree = "round", evidence > ROUND_ITSELF
    elif together < SQUARE_PHOTO:
        form, agree = "square", evidence < SQUARE_ITSELF
    else:
        return image
    objects = list(image.objects)
    for k, same in zip(asked, agree, strict=True):
        if same:
            objects[k] = replace(objects[k], form=form)
    return replace(image, objects=tuple(objects))


def _askable(o: LabeledObject, image: LabeledImage) -> bool:
    x0, y0, x1, y1 = o.box
    sides = x1 - x0, y1 - y0
    inside = x0 >= 2 and y0 >= 2 and x1 <= image.width - 3 and y1 <= image.height - 3
    return (
        o.polygon is None
        and not o.ignore
        and o.category != PLATE
        and inside
        and min(sides) >= LEAST_PX
        and max(sides) <= LONGEST * min(sides)
    )


def _evidence(rgb: npt.NDArray[Any], box: Box) -> float:
    """Logarithm of how much more the photo changes where a round button would end."""
    import cv2

    x0, y0, x1, y1 = box
    center, half = np.array([x0 + x1, y0 + y1]) / 2, np.array([x1 - x0, y1 - y0]) / 2
    signs = np.array([(1, 1), (1, -1), (-1, 1), (-1, -1)])
    angle = np.radians(45 + np.array(BESIDE))
    unit = np.sqrt(2) * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    ways = (signs[:, None] * unit * half)[:, :, None] * WAY[:, None]
    places = (center + ways).reshape(-1, len(WAY), 2).astype(np.float32)
    x, y = np.ascontiguousarray(places.transpose(2, 0, 1))
    values = cv2.remap(
        rgb.astype(np.float32),
        x,
        y,
        cv2.INTER_LINEAR,
        borderMode=cv2.BORDER_REPLICATE,
    )
    change = np.linalg.norm(values[:, 2:] - values[:, :-2], axis=2)
    # Median over the corners: a shadow or a neighbour is at one or two of them.
    profile = np.median(change.reshape(4, len(BESIDE), -1).mean(axis=1), axis=0)
    at = WAY[1:-1]
    first, second = (profile[(at > low) & (at < high)].max() for low, high in (ROUND, SQUARE))
    return float(np.log2(max(first / (second + 1.0), WEAKEST)))
