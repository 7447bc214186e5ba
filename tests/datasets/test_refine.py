"""Outlines from masks, where they fill the labelled box; nothing else changes."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fronto.datasets.records import LabeledImage, LabeledObject
from fronto.datasets.refine import refine
from fronto.segments import Segment, Segments

BOX = (9.5, 19.5, 49.5, 59.5)


def disc(box: tuple[float, float, float, float], confidence: float = 0.9) -> Segment:
    """The ellipse in a box, soft at its edge."""
    x0, y0, x1, y1 = box
    left, top = int(x0) - 2, int(y0) - 2
    x, y = np.arange(left, int(x1) + 4), np.arange(top, int(y1) + 4)[:, None]
    far = np.hypot((x - (x0 + x1) / 2) / (x1 - x0), (y - (y0 + y1) / 2) / (y1 - y0)) * 2
    soft = np.clip(0.5 + (1 - far) * (x1 - x0) / 2, 0, 1).astype(np.float32)
    return Segment("number", confidence, box, (left, top), soft)


def run(found: list[Segment], objects: tuple[LabeledObject, ...]) -> tuple[LabeledObject, ...]:
    image = LabeledImage(Path("a.jpg"), 100, 100, objects)
    (refined,) = refine([image], lambda _: Segments(100, 100, tuple(found)))
    return refined.objects


def test_a_round_button_gets_a_round_outline_that_fills_its_box() -> None:
    label = LabeledObject("up", BOX, None, "up", text="U")
    shifted = (BOX[0] + 2, BOX[1] + 1, BOX[2] + 2, BOX[3] + 1)
    (refined,) = run([disc(shifted)], (label,))
    assert refined.polygon is not None
    assert (refined.category, refined.text, refined.box) == ("up", "U", BOX)
    np.testing.assert_allclose(refined.polygon.min(axis=0), BOX[:2], atol=1e-9)
    np.testing.assert_allclose(refined.polygon.max(axis=0), BOX[2:], atol=1e-9)
    radius = np.linalg.norm(refined.polygon - [29.5, 39.5], axis=1)
    np.testing.assert_allclose(radius, 20, atol=0.6)


@pytest.mark.parametrize(
    "found",
    [
        [],
        [disc((60.5, 60.5, 90.5, 90.5), 0.5)],  # elsewhere
        [disc((9.5, 19.5, 29.5, 39.5), 0.5)],  # a quarter of it
    ],
)
def test_without_a_mask_that_fits_a_box_stays_a_box(found: list[Segment]) -> None:
    label = LabeledObject("up", BOX, None, "up")
    assert run(found, (label,)) == (label,)


def test_a_mask_that_is_no_button_is_not_believed() -> None:
    whole = disc(BOX)
    torn = np.array(whole.probability)
    torn[torn.shape[0] // 2 :, : torn.shape[1] // 2] = 0
    label = LabeledObject("up", BOX, None, "up")
    assert run([Segment("up", 0.9, BOX, whole.origin_px, torn)], (label,)) == (label,)


def test_outlines_that_are_known_stay() -> None:
    triangle = np.array([[10, 20], [50, 20], [30, 60.0]])
    label = LabeledObject("up", BOX, triangle, "up")
    assert run([disc(BOX)], (label,)) == (label,)


def test_sure_finds_that_nobody_labelled_are_ignored_not_background() -> None:
    label = LabeledObject("up", BOX, None, "up")
    elsewhere = (60.5, 60.5, 90.5, 90.5)
    plate = Segment("plate", 0.9, elsewhere, (60, 60), np.ones((30, 30), np.float32))
    assert len(run([disc(elsewhere, 0.5)], (label,))) == 1
    assert len(run([plate], (label,))) == 1
    _, added = run([disc(elsewhere, 0.7)], (label,))
    assert (added.ignore, added.box, added.polygon) == (True, elsewhere, None)
