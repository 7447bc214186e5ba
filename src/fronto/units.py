"""Buttons that were found together with the labels beside them.

Many photos that networks learn from are labelled so: one box around both. The mask head knows what
one presses.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from fronto.categories import PLATE
from fronto.engine.masks import DrawnMasks
from fronto.maskhead import REACH, SIDE, Patches
from fronto.segments import Segment
from fronto.shapes import FloatArray

if TYPE_CHECKING:
    from fronto.engine import MaskEngine

__all__ = [
    "LABEL",
    "OTHER_END",
    "THIN",
    "WIDTH",
    "already_found",
    "label_place",
    "label_segment",
    "like_others",
]

#: A label takes the rest of such a box: this share of its length lies at one end, at the other no
#: more than this share of that, and the mask has this share of its width.
LABEL, OTHER_END, WIDTH = 0.3, 0.4, 0.55
#: A label that has been found by itself covers this share of that place, or is covered by it so.
FOUND = 0.3
#: How sure one is that pixels of that place are the label's.
LABEL_PIXELS = 0.9
#: Rows and columns with less of a mask than this share of the fullest are at its frayed edge.
THIN = 0.3
#: So many boxes of a photo tell what is pressed in others, whose forms differ by less than this,
#: in powers of e.
MANY, ALIKE = 2, 0.3

Floats = npt.NDArray[np.float32]


def label_place(box: FloatArray, tight: FloatArray) -> FloatArray | None:
    """Where the label is that a network took for a part of the button beside it.

    Parameters
    ----------
    box, tight
        Shape (4,): edges x0, y0, x1, y1 of what was found and of the button's mask.

    Returns
    -------
    Edges (4,), or None: the button takes all of the box, or its middle.
    """
    sides = np.tile(box[2:] - box[:2], 2)
    end = _free_end((tight - np.tile(box[:2], 2)) / sides)
    if end is None:
        return None
    place = box.copy()
    place[(end + 2) % 4] = tight[end]
    return place


def _free_end(tight: FloatArray) -> int | None:
    """At which edge of a box from 0 to 1 a label lies, of a button's edges (4,) in it.

    0 left, 1 above, 2 right, 3 below; None: the button takes all of the box, or its middle.
    """
    free = np.concatenate([tight[:2], 1 - tight[2:]])
    end = int(free.argmax())
    if free[end] < LABEL or free[(end + 2) % 4] > OTHER_END * free[end]:
        return None
    return end if 1 - free[[1 - end % 2, 3 - end % 2]].sum() >= WIDTH else None


def like_others(
    boxes: Sequence[FloatArray],
    plates: npt.NDArray[np.bool_],
    patches: Patches,
    head: MaskEngine,
) -> DrawnMasks:
    """Draw the masks of a photo's finds; those that are doubtful like others of the photo.

    Where the head tells the button from its label in some boxes and not in others of the same
    form, it is asked again about these, with the former's mean mask in place of the rough one.

    Parameters
    ----------
    boxes
        Of the n finds, shape (4,) each.
    plates
        Shape (n,): which of them are plates.
    patches
        As the head takes them.
    head
        What draws the masks.
    """
    told = head.run(patches)
    ends = [
        None if plate else _free_end(_edges(m)) for m, plate in zip(told.masks, plates, strict=True)
    ]
    units = [k for k, end in enumerate(ends) if end is not None]
    if len(units) < MANY:
        return told
    usual = max(set(ends) - {None}, key=ends.count)
    units = [k for k in units if ends[k] == usual]
    form = np.log([(b[2] - b[0]) / (b[3] - b[1]) for b in boxes])
    alike = np.abs(form - np.median(form[units])) < ALIKE
    doubtful = [k for k, end in enumerate(ends) if end is None and alike[k] and not plates[k]]
    if len(units) < MANY or not doubtful:
        return told
    mean = np.asarray(np.rint(255 * told.masks[units].mean(axis=0)), np.uint8)
    rough = np.broadcast_to(mean, (len(doubtful), *mean.shape))
    regions = tuple(patches.regions[k] for k in doubtful)
    again = head.run(Patches(patches.photo[doubtful], np.ascontiguousarray(rough), regions))
    masks, forms = told.masks.copy(), told.forms.copy()
    for k, mask, form_told in zip(doubtful, again.masks, again.forms, strict=True):
        if _free_end(_edges(mask)) == usual:
            masks[k], forms[k] = mask, form_told
    return DrawnMasks(masks, forms)


def _edges(mask: Floats) -> FloatArray:
    """Edges (4,) of a patch's mask, where the find's box is from 0 to 1; all 0 without any."""
    counts = [np.count_nonzero(mask > 0.5, axis=axis) for axis in (1, 0)]
    if not counts[0].any():
        return np.zeros(4)
    # A few pixels more are none of it.
    rows, columns = (np.flatnonzero(count > THIN * count.max()) for count in counts)
    low, high = (columns[0], rows[0]), (columns[-1] + 1, rows[-1] + 1)
    return np.asarray((np.array([*low, *high]) / SIDE - 0.5) * REACH + 0.5)


def already_found(place: FloatArray, plates: FloatArray) -> bool:
    """Whether one of the plates' boxes (n, 4) is about there."""
    low, high = np.maximum(place[:2], plates[:, :2]), np.minimum(place[2:], plates[:, 2:])
    shared = np.clip(high - low, 0, None).prod(axis=1)
    own, theirs = (place[2:] - place[:2]).prod(), (plates[:, 2:] - plates[:, :2]).prod(axis=1)
    return bool((shared > FOUND * np.minimum(own, theirs)).any())


def label_segment(place: FloatArray, confidence: float, width: int, height: int) -> Segment:
    """The label beside a button that was found together with it."""
    low = np.clip(np.floor(place[:2]).astype(int), 0, (width - 1, height - 1))
    high = np.clip(np.ceil(place[2:]).astype(int), 0, (width - 1, height - 1))
    columns, rows = high - low + 1
    x, y = low[0] + np.arange(columns), low[1] + np.arange(rows)
    # How far each pixel lies within it: edges between pixels.
    across = np.clip(np.minimum(x - place[0], place[2] - x) + 0.5, 0, 1)
    down = np.clip(np.minimum(y - place[1], place[3] - y) + 0.5, 0, 1)
    probability = np.asarray(LABEL_PIXELS * down[:, None] * across, np.float32)
    edges = place == (-0.5, -0.5, width - 0.5, height - 0.5)
    return Segment(
        PLATE,
        confidence,
        (float(place[0]), float(place[1]), float(place[2]), float(place[3])),
        (int(low[0]), int(low[1])),
        probability,
        truncated=bool(edges.any()),
    )
