"""Labelled objects: immutable, checked, boxes in pixels' edges."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest

from fronto.datasets.records import LabeledObject, polygon_box
from fronto.errors import InputError

TRIANGLE = [[1.0, 2.0], [8.0, 3.0], [4.0, 9.0]]


def test_polygon_is_a_read_only_copy() -> None:
    points = np.array(TRIANGLE)
    item = LabeledObject("up", (1, 2, 8, 9), points, "up")
    points[0] = 99
    assert item.polygon is not None
    assert item.polygon[0].tolist() == [1, 2]
    with pytest.raises(ValueError, match="read-only"):
        item.polygon[0, 0] = 5
    with pytest.raises(dataclasses.FrozenInstanceError):
        item.text = "x"  # type: ignore[misc]
    assert (item.text, item.ignore, item.truncated) == ("", False, False)
    assert all(type(edge) is float for edge in item.box)


def test_polygon_box() -> None:
    assert polygon_box(TRIANGLE) == (1.0, 2.0, 8.0, 9.0)
    with pytest.raises(InputError):
        polygon_box(np.zeros((0, 2)))


@pytest.mark.parametrize(
    "change",
    [
        {"category": "background"},
        {"category": "12"},
        {"box": (1, 2, 1, 9)},
        {"box": (1, 9, 8, 2)},
        {"box": (float("nan"), 2, 8, 9)},
        {"box": (1, 2, float("inf"), 9)},
        {"polygon": TRIANGLE[:2]},
        {"polygon": [[1, 2], [3, float("nan")], [4, 5]]},
        {"polygon": [1, 2, 3]},
    ],
)
def test_wrong_ones_are_refused(change: dict[str, Any]) -> None:
    fields: dict[str, Any] = {"category": "up", "box": (1, 2, 8, 9), "polygon": None, "name": "up"}
    LabeledObject(**fields)
    with pytest.raises(InputError) as caught:
        LabeledObject(**{**fields, **change})
    assert "\n" not in str(caught.value)
