"""From labelled photos to panels that are read and whose buttons' labels are known."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np
import numpy.typing as npt
import torch

from fronto.categories import PLATE
from fronto.datasets.records import Box, LabeledImage, LabeledObject
from fronto.errors import InputError
from fronto.evaluate.labels import true_label
from fronto.evaluate.matching import match_greedy
from fronto.evaluate.regions import box_overlaps
from fronto.labels.evidence import Said
from fronto.labels.panelreading import PanelReading, Reader, put_together, read_panel
from fronto.labels.series import label_key
from fronto.pose.checks import boxes_px
from fronto.rectifier import Rectifier
from fronto.train.context.examples import Example
from fronto.train.data import compressed, disturb, disturbed

__all__ = ["examples_of", "known_labels", "targets"]

#: Floors that a head knows whether or not it has seen them, and how often it must have seen
#: another label.
FLOORS, OFTEN = range(-9, 100), 3
#: Photos are made smaller by up to this: a reader knows by heart what it was trained on, and is as
#: unsure of the smaller ones as of photos that are new to it.
SMALLEST = 0.4
#: Share of the photos whose light, colour and sharpness are changed, and that are compressed.
DISTURBED, COMPRESSED = 0.65, 0.6
#: Share of the labels that are hidden in a second copy of each panel, in part or (half of them)
#: altogether: the others are to tell them.
HIDDEN = 0.25
#: What it counts that something found is no labelled button, and that a button has no label: data
#: sets leave out buttons, and labels. What is labelled as blank, or as a plate, counts in full.
NO_BUTTON, NO_LABEL = 0.4, 0.3
#: Panels with more things than this are left out.
MOST = 90

Photo = npt.NDArray[np.uint8]


def known_labels(photos: Sequence[LabeledImage]) -> tuple[str, ...]:
    """Labels that a head trained on these photos is to know."""
    counts = Counter(
        label_key(label) for image in photos for o in image.objects if (label := _label(o))
    )
    floors = [str(number) for number in FLOORS]
    more = [label for label, count in counts.most_common() if count >= OFTEN]
    return (*floors, *(label for label in more if label not in floors))


def examples_of(
    image: LabeledImage,
    rectifier: Rectifier,
    reader: Reader,
    labels: Sequence[str],
    rng: np.random.Generator | None,
) -> list[Example]:
    """A photo's panel as it is read; and once more, with some of its labels hidden.

    Parameters
    ----------
    image
        A labelled photo.
    rectifier
        Finds the buttons; it need not read labels.
    reader
        Reads them.
    labels
        Those that the head is to know.
    rng
        Says how the photo is spoilt first; None: it is not, and nothing is hidden.

    Returns
    -------
    None, one or two.
    """
    from fronto.images import as_rgb

    photo = as_rgb(image.path)
    height, width = photo.shape[:2]
    spoilt = photo if rng is None else _spoilt(photo, rng)
    scale = np.array([spoilt.shape[1] / width, spoilt.shape[0] / height] * 2)
    try:
        panel = rectifier(image.path if rng is None else spoilt)
    except InputError:  # nothing there that could be a panel
        return []
    if not panel.buttons or len(panel.buttons) + len(panel.plates) > MOST:
        return []
    told, _, _ = read_panel(panel, spoilt, reader)
    found = boxes_px([button.outline for button in panel.buttons])
    confidence = [button.outline.confidence for button in panel.buttons]
    target, weight = targets(image.objects, found / scale, confidence, labels)
    plates = len(panel.plates)
    target = np.pad(target, (0, plates), constant_values=-1)
    weight = np.pad(weight, (0, plates))
    versions = [told] if rng is None else [told, _hidden(told, rng)]
    return [Example(version.context(labels), target, weight) for version in versions]


def targets(
    objects: Sequence[LabeledObject],
    found: npt.NDArray[np.float64],
    confidence: Sequence[float],
    labels: Sequence[str],
) -> tuple[npt.NDArray[np.int64], npt.NDArray[np.float32]]:
    """What found buttons are called, by the labels of a photo.

    Parameters
    ----------
    objects
        The photo's labels.
    found
        Shape (n, 4): boxes of the found buttons.
    confidence
        How sure each is.
    labels
        Those that the head is to know.

    Returns
    -------
    target, weight
        As `Example` has them.
    """
    things = [o for o in objects if o.category != PLATE and not o.ignore]
    ignored = [o.box for o in objects if o.ignore]
    plates = [o.box for o in objects if o.category == PLATE and not o.ignore]
    place = {label: k for k, label in enumerate(labels)}
    rows: list[Box] = [tuple(box) for box in found.tolist()]
    target = np.full(len(rows), len(labels))
    weight = np.full(len(rows), NO_BUTTON, np.float32)
    if ignored:
        target[(box_overlaps(rows, ignored).share >= 0.5).any(axis=1)] = -1
    if plates:
        weight[(box_overlaps(rows, plates).iou >= 0.5).any(axis=1)] = 1
    if things:
        overlaps = box_overlaps(rows, [o.box for o in things]).iou
        for k, j in match_greedy(overlaps, confidence, 0.5).items():
            label = _label(things[j])
            target[k] = place.get(label_key(label), len(labels) + 1) if label else len(labels)
            blank = things[j].name.lower() == "empty"
            weight[k] = 1.0 if label or blank else NO_LABEL
    return target, weight


def _label(thing: LabeledObject) -> str:
    return "" if thing.category == PLATE or thing.ignore else true_label(thing)


def _spoilt(photo: Photo, rng: np.random.Generator) -> Photo:
    """A photo as a worse camera, or one that is further away, would have taken it."""
    factor = float(np.exp(rng.uniform(np.log(SMALLEST), 0)))
    height, width = photo.shape[:2]
    size = (max(32, round(width * factor)), max(32, round(height * factor)))
    spoilt = np.asarray(cv2.resize(photo, size, interpolation=cv2.INTER_AREA), np.uint8)
    if rng.random() < DISTURBED:
        torch.manual_seed(int(rng.integers(2**31)))
        spoilt = disturbed(spoilt, disturb())
    return compressed(spoilt, rng) if rng.random() < COMPRESSED else spoilt


def _hidden(told: PanelReading, rng: np.random.Generator) -> PanelReading:
    """The panel with some labels read badly, or not at all."""

    def faded(said: Said) -> Said:
        if rng.random() >= HIDDEN:
            return said
        left = 0.0 if rng.random() < 0.5 else float(rng.uniform(0, 0.5))
        labels = {label: left * p for label, p in said.labels.items() if left > 0}
        return replace(said, labels=labels, kind="unreadable", kind_confidence=1 - left)

    said = [faded(one) for one in told.said]
    count = len(told.evidence.own)
    return put_together(told.things, said, told.boxes, count, posed=told.posed)
