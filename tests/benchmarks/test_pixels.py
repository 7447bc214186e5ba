"""What each kind of error costs: one thing of each kind, counted by hand."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

from fronto.datasets.records import LabeledImage, LabeledObject
from fronto.evaluate.pixels import pixel_confusion
from fronto.segments import Segment, Segments
from pixels import WAYS, confusions

WIDTH, HEIGHT = 100, 60
Box = tuple[int, int, int, int]


def thing(category: str, box: Box) -> LabeledObject:
    """Of the pixels from x0 to x1 - 1 and y0 to y1 - 1."""
    x0, y0, x1, y1 = (v - 0.5 for v in box)
    corners = np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])
    return LabeledObject(category, (x0, y0, x1, y1), corners, category)


def find(category: str, box: Box) -> Segment:
    x0, y0, x1, y1 = box
    edges = (x0 - 0.5, y0 - 0.5, x1 - 0.5, y1 - 0.5)
    return Segment(category, 0.9, edges, (x0, y0), np.ones((y1 - y0, x1 - x0), np.float32))


def counted(things: list[LabeledObject], finds: list[Segment]) -> dict[str, np.ndarray]:
    image = LabeledImage(Path("render/0"), WIDTH, HEIGHT, tuple(things))
    segments = Segments(WIDTH, HEIGHT, tuple(finds))
    counts = confusions(image, segments)
    assert (counts.sum(axis=(1, 2)) == WIDTH * HEIGHT).all()
    np.testing.assert_array_equal(counts[0], pixel_confusion(image, segments.segments))
    return dict(zip(WAYS, counts, strict=True))


def right(counts: np.ndarray) -> bool:
    return bool((counts == np.diag(np.diag(counts))).all())


def test_each_kind_of_error_is_taken_away() -> None:
    # A button found too narrow, a plate taken for a button, a button missed, one that is not there.
    things = [
        thing("number", (0, 0, 10, 10)),
        thing("plate", (20, 0, 30, 10)),
        thing("up", (40, 0, 50, 10)),
    ]
    finds = [
        find("number", (0, 0, 8, 10)),
        find("number", (20, 0, 30, 10)),
        find("number", (60, 0, 70, 10)),
    ]
    ways = counted(things, finds)
    background, button, plate = 0, 1, 2

    def lost(way: str) -> tuple[int, int, int, int]:
        c = ways[way]
        return (
            int(c[button, background]),
            int(c[background, button]),
            int(c[plate, button]),
            int(c[plate, plate]),
        )

    assert lost("as it is") == (120, 100, 100, 0)
    assert lost("masks of what is found were exact") == (100, 100, 100, 0)
    assert lost("buttons and plates were never mixed up") == (120, 100, 0, 100)
    assert lost("nothing was found that is not there") == (120, 0, 100, 0)
    assert lost("nothing was missed") == (20, 100, 100, 0)
    assert lost("all but the masks") == (20, 0, 0, 100)


@pytest.mark.parametrize("category", ["number", "plate"])
def test_what_is_right_stays_right(category: str) -> None:
    box = (5, 6, 25, 30)
    ways = counted([thing(category, box)], [find(category, box)])
    assert all(map(right, ways.values()))


def test_without_anything_all_is_background() -> None:
    ways = counted([], [])
    assert all(counts[0, 0] == WIDTH * HEIGHT for counts in ways.values())


def test_what_overlaps_too_little_is_missed_and_false() -> None:
    ways = counted([thing("up", (0, 0, 10, 10))], [find("up", (7, 0, 17, 10))])
    assert not right(ways["masks of what is found were exact"])
    assert right(ways["all but the masks"])
