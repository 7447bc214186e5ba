"""How well labels are told: counted right, wrong and declined, by class and size."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import fronto
from fronto import Panel
from fronto.datasets.records import LabeledImage, LabeledObject
from fronto.evaluate.labels import evaluate_labels, judge_labels, label_class, true_label
from fronto.shapes import Outline

PHOTO = np.zeros((480, 640, 3), np.uint8)


def box(k: int, side: float = 30) -> tuple[float, float, float, float]:
    return (40.0 * k, 10.0, 40.0 * k + side, 10.0 + side)


def thing(k: int, category: str, name: str, text: str = "", side: float = 30) -> LabeledObject:
    return LabeledObject(category, box(k, side), None, name, text)


def panel_of(told: dict[int, tuple[str, float]], side: float = 30) -> Panel:
    """Buttons at these places, called so."""
    outlines = []
    for k in told:
        x0, y0, x1, y1 = box(k, side)
        outlines.append(Outline.quad([(x0, y0), (x1, y0), (x1, y1), (x0, y1)]))
    panel = fronto.rectify_outlines(PHOTO, outlines)
    buttons = [
        replace(b, label=label, label_confidence=p, label_source="button" if label else None)
        for b, (label, p) in zip(panel.buttons, told.values(), strict=True)
    ]
    return replace(panel, buttons=tuple(buttons))


IMAGE = LabeledImage(
    Path("valid/images/7.jpg"),
    640,
    480,
    (
        thing(0, "number", "12", "12"),
        thing(1, "number", "s1", "*1"),
        thing(2, "open", "open"),
        thing(3, "number", "3", "3"),
        thing(4, "unknown", "empty"),
        thing(5, "plate", "plate", "5"),
        thing(6, "number", "B1", "B1"),
        replace(thing(7, "number", "8", "8"), ignore=True),
        thing(8, "alarm", "bell"),
    ),
)
TOLD = {
    0: ("12", 0.9),
    1: ("1", 0.9),  # the star may be left out
    2: ("close", 0.9),
    3: ("", 0.4),
    4: ("7", 0.9),  # nothing says what it is
    5: ("5", 0.9),  # a plate is no button
    7: ("9", 0.9),  # to be ignored
    8: ("alarm", 0.9),
    9: ("4", 0.9),  # nothing there
}


def test_what_is_right_wrong_and_declined() -> None:
    told, missed = judge_labels(IMAGE, panel_of(TOLD))
    assert [(t.truth, t.told, t.outcome) for t in told if t.truth] == [
        ("12", "12", "right"),
        ("*1", "1", "right"),
        ("open", "close", "wrong"),
        ("3", "", "declined"),
        ("alarm", "alarm", "right"),
    ]
    assert [t.told for t in told if not t.truth] == ["7"]
    assert missed == (("B1", 30.0),)


def test_a_report_counts_them() -> None:
    illegible = {"valid/7": (thing(3, "number", "3"),)}
    report = evaluate_labels([IMAGE], lambda _: panel_of(TOLD), illegible=illegible)
    score = report.all
    assert (score.labels, score.found, score.right, score.wrong, score.declined) == (6, 5, 3, 1, 1)
    assert score.share("right") == pytest.approx(0.6)
    assert (report.legible.found, report.legible.declined) == (4, 0)
    assert report.invented == 1.0
    assert {name: s.labels for name, s in report.classes.items()} == {
        "one digit": 2,
        "two digits": 1,
        "other floor": 1,
        "open": 1,
        "alarm": 1,
    }
    assert sum(s.labels for *_, s in report.sizes) == 6
    assert report.sources["button"].found == 4
    values = json.loads(report.to_json())
    assert values["all"] == {
        "labels": 6,
        "found": 5,
        "right": 0.6,
        "wrong": 0.2,
        "declined": 0.2,
    }
    assert [w["told"] for w in values["wrong"]] == ["close"]
    for words in ("legible", "one digit", "24 to 40", "said by"):
        assert words in report.to_markdown()


def test_nothing_found_and_nothing_labelled() -> None:
    nothing = fronto.rectify_outlines(PHOTO, [])
    assert evaluate_labels([IMAGE], lambda _: nothing).all.found == 0
    bare = replace(IMAGE, objects=())
    report = evaluate_labels([bare], lambda _: panel_of(TOLD))
    assert report.all.labels == 0
    assert np.isnan(report.all.share("right"))
    assert report.to_markdown()
    assert json.loads(report.to_json())["all"]["right"] is None


@pytest.mark.parametrize(
    ("item", "label", "kind"),
    [
        (thing(0, "number", "07", "07"), "07", "two digits"),
        (thing(0, "number", "LG", "LG"), "LG", "other floor"),
        (thing(0, "number", "-2", "-2"), "-2", "other floor"),
        (thing(0, "open", "text_OPEN", "OPEN"), "open", "open"),
        (thing(0, "alarm", "bell"), "alarm", "alarm"),
        (thing(0, "keyhole", "keyhole"), "keyhole", "keyhole"),
        (thing(0, "other", "text_FAN", "FAN"), "FAN", "other text"),
        (thing(0, "other", "fan"), "", ""),
        (thing(0, "unknown", "blur"), "", ""),
        (thing(0, "number", "number"), "", ""),
    ],
)
def test_labels_of_data_sets(item: LabeledObject, label: str, kind: str) -> None:
    assert true_label(item) == label
    if label:
        assert label_class(label) == kind
