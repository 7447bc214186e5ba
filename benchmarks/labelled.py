"""One labelled photo of the labels' benchmark: what is told of its buttons, and looked for."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path
from time import perf_counter
from typing import Any

import cv2
import numpy as np

from fronto import Panel, Rectifier
from fronto.datasets.annotated import read_annotated
from fronto.datasets.panels import read_panels
from fronto.datasets.records import Box, LabeledImage
from fronto.engine import Engine, ReaderEngine
from fronto.evaluate import panels_illegible, photo_id
from fronto.evaluate.labels import PhotoLabels, judge_labels, true_label
from fronto.find import find_label
from fronto.images import as_rgb
from fronto.labels.crops import crops
from fronto.labels.lit import lit_scores
from fronto.labels.reader import LabelReader
from fronto.labels.series import label_key, normal_label
from fronto.shapes import Outline
from fronto.synth.photo import render_photo
from reading import cut, inset_box

DATA = Path(__file__).resolve().parents[2] / "shared" / "data"
#: Labels that are asked for though they are not there, a photo.
ABSENT = 12
#: Share of a rendered button that has to be seen.
WHOLE = 0.95


@cache
def rectifier() -> Rectifier:
    return Rectifier(engine=Engine(threads=1))


@cache
def photos(name: str) -> tuple[LabeledImage, ...]:
    if name == "valid":
        return tuple(read_panels(DATA / "panels", "valid"))
    return tuple(read_annotated(DATA / "annotated"))


def asked(image: LabeledImage, pool: Sequence[str], seed: int) -> list[str]:
    """Labels that no button of the photo has, likelier the more photos have them."""
    there = {label_key(true_label(o)) for o in image.objects}
    there |= {label_key(normal_label(o.text)) for o in image.objects if o.text}
    rng = np.random.default_rng([7, seed])
    drawn = [pool[k] for k in rng.permutation(len(pool))]
    absent = [label for label in dict.fromkeys(drawn) if label_key(label) not in there]
    return absent[:ABSENT]


def named(name: str, k: int, pool: tuple[str, ...]) -> dict[str, Any]:
    """What became of one photo: its buttons' labels, and labels that were looked for."""
    cv2.setNumThreads(1)
    image = photos(name)[k]
    begin = perf_counter()
    panel = rectifier()(image.path)
    taken = 1e3 * (perf_counter() - begin)
    listed = panels_illegible().get(photo_id(image.path), ()) if name == "valid" else ()
    told, missed = judge_labels(image, panel, illegible=[o.box for o in listed])
    return {
        "labels": PhotoLabels(image.path, told, missed, taken),
        "absent": [find_label(panel, label).status for label in asked(image, pool, k)],
        "present": [present(panel, *one) for one in labelled_once(image).items()],
    }


def labelled_once(image: LabeledImage) -> dict[str, Box]:
    """Labels that exactly one button has, and its box."""
    things = [o for o in image.objects if o.category != "plate"]
    keys = [label_key(true_label(o)) for o in things]
    return {
        key: o.box
        for key, o in zip(keys, things, strict=True)
        if key and keys.count(key) == 1 and not o.ignore
    }


def present(panel: Panel, label: str, box: Box) -> str:
    """What comes of looking for a label that is there: "right", "wrong", or the status.

    Right is a place to press on that button, however well its outline is met.
    """
    finding = find_label(panel, label)
    if finding.status != "found":
        return finding.status
    x, y = finding.button.outline.center_px
    return "right" if box[0] < x < box[2] and box[1] < y < box[3] else "wrong"


def alone(name: str, k: int) -> list[dict[str, Any]]:
    """What the reader alone says to each labelled box, and what a public one is to read."""
    image = photos(name)[k]
    listed = {o.box for o in panels_illegible().get(photo_id(image.path), ())}
    things = [o for o in image.objects if o.category != "plate" and not o.ignore and true_label(o)]
    if not things:
        return []
    photo = as_rgb(image.path)
    corners = [np.array(o.box)[[[0, 1], [2, 1], [2, 3], [0, 3]]] for o in things]
    readings = LabelReader(ReaderEngine(threads=1)).read(
        crops(photo, [Outline.quad(quad) for quad in corners])
    )
    return [
        {
            "label": true_label(o),
            "legible": o.box not in listed,
            "text": reading.text,
            "score": reading.confidence,
            "crop": cut(photo, inset_box(quad)),
        }
        for o, quad, reading in zip(things, corners, readings, strict=True)
    ]


def shining(k: int) -> tuple[list[float], list[bool]]:
    """`lit` of the buttons of a rendered photo, and whether they are; none where most are lit."""
    photo = render_photo(np.random.default_rng(520_000 + k))
    shown = [o for o in photo.objects if o.category not in ("plate", "keyhole")]
    shown = [o for o in shown if o.visible > WHOLE]
    states = [o.lit for o in shown]
    scores = lit_scores(crops(photo.image, [o.outline for o in shown]))
    if scores is None or 2 * sum(states) >= len(states):
        return [], []
    return scores.tolist(), states
