"""Labels and detections for the tests of the evaluation."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from fronto.datasets.records import Box, LabeledImage, LabeledObject
from fronto.segments import Segment, Segments

WIDTH, HEIGHT = 200, 120


def corners(box: Box) -> np.ndarray:
    x0, y0, x1, y1 = box
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])


def label(
    x: int, y: int, side: int = 20, category: str = "number", ignore: bool = False
) -> LabeledObject:
    """A square around the pixels x..x+side-1."""
    box = (x - 0.5, y - 0.5, x + side - 0.5, y + side - 0.5)
    return LabeledObject(category, box, corners(box), "", ignore=ignore)


def segment(
    x: int, y: int, side: int = 20, category: str = "number", confidence: float = 0.9
) -> Segment:
    box = (x - 0.5, y - 0.5, x + side - 0.5, y + side - 0.5)
    return Segment(category, confidence, box, (x, y), np.ones((side, side), np.float32))


def photo(*objects: LabeledObject, name: str = "a") -> LabeledImage:
    return LabeledImage(Path(f"set/images/{name}.jpg"), WIDTH, HEIGHT, objects)


def answer(*found: Sequence[Segment]) -> Callable[[LabeledImage], Segments]:
    """Predict these, photo by photo."""
    answers = iter(found)
    return lambda image: Segments(image.width, image.height, tuple(next(answers)))


def same(item: LabeledObject, confidence: float = 0.9) -> Segment:
    """The detection that is right."""
    x0, y0, x1, _ = item.box
    category = "other" if item.category == "unknown" else item.category
    return segment(round(x0 + 0.5), round(y0 + 0.5), round(x1 - x0), category, confidence)
