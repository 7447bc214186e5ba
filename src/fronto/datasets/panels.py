"""The panel photos of Roboflow's "Elevator Button Recognition": boxes, names, and plates.

The set boxes the number plate and the button beside it apart, and names the plate after the
floor and the button 'empty' (or after the floor, too). A network that took those plates for
buttons would send a robot's finger to the wrong place: `split_plates` tells them apart.
Photos that its rule misjudges are listed in ``panels.yaml``.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal

import msgspec
import numpy as np

from fronto.categories import PLATE
from fronto.datasets.names import category_of, printed_text
from fronto.datasets.records import UNKNOWN, Box, LabeledImage, LabeledObject
from fronto.errors import InputError
from fronto.shapes import FloatArray

__all__ = ["Side", "incomplete_photos", "read_panels", "split_plates"]

#: Where the plates are, seen from their buttons; "none" where the panel has none.
Side = Literal["left", "right", "above", "below", "none"]
#: From a plate to its button, x right, y down.
STEPS = {"left": (1, 0), "right": (-1, 0), "above": (0, 1), "below": (0, -1)}
#: A plate and its button: distance of their centres along and across, in mean box sizes;
#: ratio of their areas.
ALONG, ACROSS, AREAS = (0.75, 1.6), 0.45, (0.25, 4.0)
#: The same across where the plates are known: rows may slant.
ACROSS_GIVEN = 0.7
#: A panel has plates if this many pairs say so, and this share of its empty buttons and of
#: its numbers is in pairs.
MIN_PAIRS, MIN_SHARE = 2, 0.6
#: How far other pairs of the panel may be from the pairs' median offset, in mean box sizes.
SAME_OFFSET = 0.35


class _Corrections(msgspec.Struct, forbid_unknown_fields=True):
    """What ``panels.yaml`` says, photos as "split/id", boxes as lines counted from 0."""

    classes: int
    plates: dict[str, Side | list[Side | int]]
    displays: dict[str, list[int]]
    incomplete: list[str]


def _corrections() -> _Corrections:
    from importlib.resources import files

    content = (files("fronto.datasets") / "panels.yaml").read_bytes()
    return msgspec.yaml.decode(content, type=_Corrections)


def _unlabelled() -> dict[str, list[Box]]:
    """What ``panels_unlabelled.yaml`` says, photos as "split/id"."""
    from importlib.resources import files

    content = (files("fronto.datasets") / "panels_unlabelled.yaml").read_bytes()
    return msgspec.yaml.decode(content, type=dict[str, list[Box]])


def incomplete_photos(split: str) -> frozenset[str]:
    """Photos of a split on which the buttons beside some plates have no box.

    What is no button there by the labels may well be one: training should not count it as
    background.

    Parameters
    ----------
    split
        "train" or "valid".

    Returns
    -------
    The photos' file names without ".jpg".
    """
    ids = (photo.split("/") for photo in _corrections().incomplete)
    return frozenset(stem for folder, stem in ids if folder == split)


def read_panels(directory: Path, split: str) -> list[LabeledImage]:
    """Read one split of the set as Roboflow's YOLO export with a ``names.txt``.

    Parameters
    ----------
    directory
        Holds ``names.txt`` and, for each split, ``images`` and ``labels``.
    split
        "train" or "valid".

    Returns
    -------
    The photos by name, buttons and plates only; displays, lamps and speakers are left out. What may
    be a button without a label (``panels_unlabelled.yaml``) is there to be ignored.

    Raises
    ------
    InputError
        If a file is missing, or a line is no label.
    """
    from PIL import Image

    listing = directory / "names.txt"
    if not listing.is_file():
        raise InputError(f"{directory}", "expected a file names.txt in it, found none")
    names = listing.read_text(encoding="utf-8").rstrip("\n").split("\n")
    photos = sorted((directory / split / "images").glob("*.jpg"))
    if not photos:
        raise InputError(f"{directory / split / 'images'}", "expected photos (*.jpg), found none")
    corrections, unlabelled = _corrections(), _unlabelled()
    known = len(names) == corrections.classes  # else another set, whose photos happen to share ids
    images = []
    for photo in photos:
        with Image.open(photo) as opened:
            width, height = opened.size
        label = directory / split / "labels" / f"{photo.stem}.txt"
        labels = _read_labels(label, names, width, height)
        if known:
            name = f"{split}/{photo.stem}"
            objects = _corrected(labels, corrections, name, label)
            objects += [
                LabeledObject(UNKNOWN, box, None, "unlabelled", ignore=True)
                for box in unlabelled.get(name, ())
            ]
        else:
            objects = split_plates(list(labels.values()))
        images.append(LabeledImage(photo, width, height, tuple(objects)))
    return images


def _corrected(
    labels: dict[int, LabeledObject], corrections: _Corrections, photo: str, label: Path
) -> list[LabeledObject]:
    """Buttons and plates of a photo, by the rule or as its correction says."""
    displays = corrections.displays.get(photo, [])
    buttons = {line: thing for line, thing in labels.items() if line not in displays}
    correction = corrections.plates.get(photo, [])
    side: Side | None = None
    numbers = []
    for item in [correction] if isinstance(correction, str) else correction:
        if isinstance(item, int):
            numbers.append(item)
        else:
            side = item
    _positions(displays, list(labels), label)
    plates = _positions(numbers, list(buttons), label)
    return split_plates(list(buttons.values()), side, plates)


def _positions(wanted: list[int], lines: list[int], label: Path) -> list[int]:
    """Where in `lines` the wanted ones are."""
    missing = sorted(set(wanted) - set(lines))
    if missing:
        raise InputError(
            f"{label}, line {missing[0] + 1}",
            "expected a plate or display that fronto's corrections of this set name, found none",
            "use the label files as they were published",
        )
    return [lines.index(line) for line in wanted]


def _read_labels(
    label: Path, names: list[str], width: int, height: int
) -> dict[int, LabeledObject]:
    """Buttons and plates by the line that they are on, counted from 0."""
    try:
        lines = label.read_text(encoding="utf-8").splitlines()
    except OSError as error:
        raise InputError(f"{label}", f"expected a label file, got {error.strerror}") from error
    objects = {}
    for number, line in enumerate(lines):
        if not line.strip():
            continue
        try:
            index, *values = line.split()
            name = names[int(index)]
            points = np.array(values, dtype=np.float64)
            if len(points) < 4 or len(points) % 2:
                raise ValueError(line)
        except (ValueError, IndexError) as error:
            raise InputError(
                f"{label}, line {number + 1}",
                f"expected a class below {len(names)} and a box or a polygon, got {line[:60]!r}",
            ) from error
        category = category_of(name)
        if category is None:
            continue
        if len(points) == 4:
            x, y, w, h = points * (width, height, width, height) - (0.5, 0.5, 0, 0)
            box = (x - w / 2, y - h / 2, x + w / 2, y + h / 2)
        else:
            polygon = points.reshape(-1, 2) * (width, height) - 0.5
            box = (*polygon.min(axis=0), *polygon.max(axis=0))
        # Polygons of this set are loose hand-drawn boxes: only their extent is used.
        objects[number] = LabeledObject(category, box, None, name, printed_text(name))
    return objects


def split_plates(
    objects: Sequence[LabeledObject], side: Side | None = None, plates: Collection[int] = ()
) -> list[LabeledObject]:
    """Mark number plates that are labelled as buttons, and give their meaning to the buttons.

    A labelled box with an 'empty' box right beside it (or one of the same meaning) is a
    plate, provided that the panel has at least two such pairs on the same side, that most of
    its empty buttons are in pairs (a row of keys that ends in a blank one is none) and most
    of its numbers (a column of numbers beside a column of blank keys is none). On such a
    panel other boxes that lie as these pairs do are pairs, too: the plate of a button that
    carries a word, or that cannot be read. Where only meanings repeat, plates are taken to be
    on the left, as on most panels.

    Parameters
    ----------
    objects
        The boxes of one photo.
    side
        Where the plates are known to be, seen from their buttons, or "none". None leaves it
        to the rule, unless `plates` are given.
    plates
        Numbers of `objects` that are known to be plates, besides those on that side.

    Returns
    -------
    The objects in the same order; plates have the category "plate", and their buttons the
    plate's former category and text where they had none.
    """
    pairs: _Pairs = []
    if side is not None and side != "none":
        pairs = _panel_pairs(objects, side)
    elif side is None and not plates:
        sides = {side: _closest(_beside(objects, side, _names)) for side in ("left", "right")}
        likely = max(sides, key=lambda side: len(sides[side]))
        if _convincing(objects, sides[likely]):
            pairs = _panel_pairs(objects, likely)
    pairs = [(plate, button) for plate, button in pairs if button not in plates]
    pairs += _given_pairs(objects, plates, {k for pair in pairs for k in pair})
    result = list(objects)
    for plate in (*plates, *(plate for plate, _ in pairs)):
        result[plate] = replace(objects[plate], category=PLATE)
    for plate, button in pairs:
        named = objects[plate]
        if objects[button].category == UNKNOWN:
            result[button] = replace(objects[button], category=named.category, text=named.text)
    return result


_Matches = Callable[[LabeledObject, LabeledObject], bool]
_Pairs = list[tuple[int, int]]


def _convincing(objects: Sequence[LabeledObject], pairs: _Pairs) -> bool:
    """Whether (plate, button) pairs speak for a panel with plates."""
    paired = {k for pair in pairs for k in pair}
    blank = {k for k, o in enumerate(objects) if o.name == "empty"}
    numbers = {k for k, o in enumerate(objects) if o.category == "number"}
    # Where buttons repeat what their plates say, a blank one is just a floor that is not served.
    groups = (blank, numbers) if 2 * len(blank & paired) >= len(pairs) else (numbers,)
    return len(pairs) >= MIN_PAIRS and all(
        len(paired & group) >= MIN_SHARE * len(group) for group in groups
    )


def _panel_pairs(objects: Sequence[LabeledObject], side: str) -> _Pairs:
    """(plate, button) pairs of a panel known to have its plates on this side."""
    strong = _closest(_beside(objects, side, _names))
    if not strong:
        return _closest(_beside(objects, side, _may_name))
    usual = np.median([_offset(objects[i], objects[j]) for i, j in strong], axis=0)
    taken = {k for pair in strong for k in pair}
    return strong + _closest(
        (float(np.abs(offset - usual).max()), i, j)
        for i, j, offset in _offsets(objects, _may_name)
        if i not in taken and j not in taken and np.abs(offset - usual).max() <= SAME_OFFSET
    )


def _given_pairs(
    objects: Sequence[LabeledObject], plates: Collection[int], taken: set[int]
) -> _Pairs:
    """(plate, button) pairs for these plates, preferably all on the same side."""
    found: _Pairs = []

    def pairs(side: str) -> _Pairs:
        gone = taken | {k for pair in found for k in pair}
        return _closest(
            (score, i, j)
            for score, i, j in _beside(objects, side, _may_name, across=ACROSS_GIVEN)
            if i in plates and j not in plates and not gone & {i, j}
        )

    for side in sorted(STEPS, key=lambda side: -len(pairs(side))):
        # One box above another may be of the next row, its own button not boxed.
        if side in ("left", "right") or len(pairs(side)) >= MIN_PAIRS:
            found += pairs(side)
    return found


def _beside(
    objects: Sequence[LabeledObject], side: str, matches: _Matches, across: float = ACROSS
) -> Iterable[tuple[float, int, int]]:
    """(distance, plate, button) with the plate on this side of its button."""
    step = np.array(STEPS[side])
    for i, j, offset in _offsets(objects, matches):
        along = float(step @ offset)
        aside = float(np.abs(offset - along * step).max())
        if ALONG[0] <= along <= ALONG[1] and aside <= across:
            yield along + aside, i, j


def _closest(found: Iterable[tuple[float, int, int]]) -> _Pairs:
    """Pairs of (distance, plate, button), closest first, each box once."""
    taken: set[int] = set()
    pairs = []
    for _, i, j in sorted(found):
        if i not in taken and j not in taken:
            taken |= {i, j}
            pairs.append((i, j))
    return pairs


def _offsets(
    objects: Sequence[LabeledObject], matches: _Matches
) -> Iterable[tuple[int, int, FloatArray]]:
    """What may be (plate, button), of similar size, and the offset between them."""
    for i, plate in enumerate(objects):
        for j, button in enumerate(objects):
            if i == j or not matches(plate, button):
                continue
            areas = np.prod(_size(plate)) / np.prod(_size(button))
            if AREAS[0] <= areas <= AREAS[1]:
                yield i, j, _offset(plate, button)


def _size(thing: LabeledObject) -> FloatArray:
    x0, y0, x1, y1 = thing.box
    return np.array([x1 - x0, y1 - y0])


def _offset(plate: LabeledObject, button: LabeledObject) -> FloatArray:
    """From the plate's centre to the button's, in their mean widths and heights, shape (2,)."""
    centers = [np.array([o.box[0] + o.box[2], o.box[1] + o.box[3]]) / 2 for o in (plate, button)]
    return np.asarray((centers[1] - centers[0]) / ((_size(plate) + _size(button)) / 2))


def _names(plate: LabeledObject, button: LabeledObject) -> bool:
    """Whether the first says what the second is, by their labels alone."""
    if plate.category in (UNKNOWN, "keyhole"):
        return False
    return button.name == "empty" or (plate.category == button.category and _same(plate, button))


def _may_name(plate: LabeledObject, button: LabeledObject) -> bool:
    """Whether the first may name the second on a panel that has plates."""
    if plate.category in (UNKNOWN, "keyhole"):
        return False
    if plate.category == button.category:
        return plate.category != "number" or _same(plate, button)
    return button.category == UNKNOWN or (plate.category, button.category) == ("stop", "keyhole")


def _same(plate: LabeledObject, button: LabeledObject) -> bool:
    """Whether they carry the same text; the star of the exit floor is on the plate only."""
    return plate.text.lower().lstrip("*") == button.text.lower().lstrip("*")
