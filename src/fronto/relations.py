"""What the relation head is told of each candidate: its looks, its geometry, its neighbours.

The network's centres say of each place by itself how much it looks like a button's. A panel
says more: buttons are alike and stand in rows, a plate has a button beside it, a lamp is the
only one of its size. So a second, small network judges all candidates of a picture together,
as in Hu et al., "Relation Networks for Object Detection" (CVPR 2018): from the decoder's
features within and around each box (RoIAlign: He et al., "Mask R-CNN", ICCV 2017), from the
box, and from how any two boxes lie to each other.
"""

from __future__ import annotations

import ctypes
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from fronto.grouping import Instance, all_overlaps, group
from fronto.native import address, library
from fronto.shapes import FloatArray

__all__ = [
    "CELLS",
    "GEOMETRY",
    "PAIR",
    "Candidates",
    "candidates",
    "describe",
    "geometry",
    "looks",
    "pairs",
    "shifted",
]

#: The features around a candidate are taken at this many by this many points ...
CELLS = 7
#: ... spread over its box, made larger by this.
MARGIN = 1.5
#: Numbers that tell of one candidate beside its looks (the classes among them), and of two.
GEOMETRY, PAIR = 24, 8
#: Centres above this probability are candidates: the head finds the buttons among them.
LEAST_CENTER = 0.15
#: Most candidates of one picture.
MOST = 160
#: Sides are told against this, pixels of the network.
USUAL_PX = 40.0
#: Candidates from this confidence on say how large the panel's buttons are.
LIKELY = 0.3
#: A side this close to the picture's edge, in sides of the box, may be cut.
CUT = 0.3
#: An edge stays this far from the middle of the box that it is moved of, in its sides.
LEAST_HALF = 0.05
#: How fast two candidates stop standing in line, or being equally large.
STEEP = 4.0

Floats = npt.NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Candidates:
    """N candidates of one picture, as the relation head takes them.

    Parameters
    ----------
    looks
        Shape (N, 49, C): the decoder's C features at 7 x 7 points, row by row.
    geometry
        Shape (N, 24): sides, place, confidence, mean classes.
    pairs
        Shape (N, N, 8): of the second as the first sees it: offset, sizes, overlap.
    """

    looks: Floats
    geometry: Floats
    pairs: Floats


def candidates(centers: Floats, sides: Floats, classes: Floats, stride: int) -> list[Instance]:
    """What may be a button or a plate in one picture; maps as `fronto.grouping.group` takes."""
    return group(centers, sides, classes, stride, least=LEAST_CENTER)[:MOST]


def describe(
    instances: Sequence[Instance], features: Floats, stride: int, shape: tuple[int, int]
) -> Candidates:
    """Tell of the candidates of one picture.

    Parameters
    ----------
    instances
        One or more, as `fronto.grouping.group` finds them.
    features
        Shape (C, h, w), of the decoder.
    stride
        Pixels of a cell.
    shape
        Height and width of the picture.
    """
    boxes = np.array([i.box for i in instances], dtype=np.float64)
    confidence = np.array([i.confidence for i in instances])
    plates = np.array([i.plate for i in instances])
    scores = np.stack([i.scores for i in instances])
    return Candidates(
        looks(boxes, features, stride),
        geometry(boxes, confidence, plates, scores, shape),
        pairs(boxes),
    )


def shifted(boxes: FloatArray, shifts: npt.NDArray[np.floating]) -> FloatArray:
    """Boxes (n, 4) with their edges moved by shares (n, 4) of their sides."""
    sides = boxes[:, 2:] - boxes[:, :2]
    moved = boxes + shifts * np.concatenate([sides, sides], axis=1)
    # No shift, however wrong, turns a box inside out.
    middle = (boxes[:, :2] + boxes[:, 2:]) / 2
    low = np.minimum(moved[:, :2], middle - LEAST_HALF * sides)
    return np.concatenate([low, np.maximum(moved[:, 2:], middle + LEAST_HALF * sides)], axis=1)


@cache
def _roi_align() -> Any:
    kernel = library().fronto_roi_align
    i, p = ctypes.c_int, ctypes.c_void_p
    kernel.argtypes = [i, i, i, p, i, i, p, p, p]
    kernel.restype = None
    return kernel


def looks(boxes: FloatArray, features: Floats, stride: int) -> Floats:
    """`Candidates.looks` of boxes (n, 4)."""
    channels, h, w = features.shape
    middle, half = (boxes[:, :2] + boxes[:, 2:]) / 2, MARGIN * (boxes[:, 2:] - boxes[:, :2]) / 2
    at = (np.arange(CELLS) + 0.5) / CELLS * 2 - 1
    points = (middle[:, None] + half[:, None] * at[:, None] - (stride - 1) / 2) / stride
    inside = np.clip(points, 0, [w - 1, h - 1]).astype(np.float32)
    x, y = np.ascontiguousarray(inside.transpose(2, 0, 1))
    found = np.empty((len(boxes), CELLS**2, channels), np.float32)
    features = np.ascontiguousarray(features, dtype=np.float32)
    _roi_align()(
        channels,
        h,
        w,
        address(features, np.float32),
        len(boxes),
        CELLS,
        address(x, np.float32),
        address(y, np.float32),
        address(found, np.float32),
    )
    return found


def geometry(
    boxes: FloatArray,
    confidence: FloatArray,
    plates: npt.NDArray[np.bool_],
    scores: FloatArray,
    shape: tuple[int, int],
) -> Floats:
    """`Candidates.geometry` of boxes (n, 4) in a picture of this height and width.

    Parameters
    ----------
    boxes
        Shape (n, 4).
    confidence, plates, scores
        As `fronto.grouping.Instance` has them; shapes (n,), (n,), (n, classes).
    shape
        Height and width of the picture.
    """
    height, width = shape
    sides = boxes[:, 2:] - boxes[:, :2]
    size = np.sqrt(sides.prod(axis=1))
    likely = confidence > LIKELY
    usual = np.median(size[likely] if likely.any() else size)
    x, y = (boxes[:, :2] + boxes[:, 2:]).T / 2
    numbers = [
        *np.log(sides / USUAL_PX).T,
        np.log(size / usual),
        np.log(sides[:, 0] / sides[:, 1]),
        np.log(confidence / (1 - confidence + 1e-4) + 1e-6),
        plates.astype(np.float64),
        2 * x / width - 1,
        2 * y / height - 1,
        boxes[:, 0] < CUT * size,
        boxes[:, 1] < CUT * size,
        width - boxes[:, 2] < CUT * size,
        height - boxes[:, 3] < CUT * size,
        np.full(len(boxes), len(boxes) / 20),
    ]
    return np.column_stack([*numbers, np.log(scores + 1e-3) / 3]).astype(np.float32)


def pairs(boxes: FloatArray) -> Floats:
    """`Candidates.pairs` of boxes (n, 4)."""
    sides = boxes[:, 2:] - boxes[:, :2]
    middle = (boxes[:, :2] + boxes[:, 2:]) / 2
    offset = (middle[None] - middle[:, None]) / sides[:, None]
    ratio = np.log(sides[None] / sides[:, None])
    numbers = [
        *np.moveaxis(np.sign(offset) * np.log1p(np.abs(offset)), -1, 0),
        *np.moveaxis(np.exp(-STEEP * np.abs(offset)), -1, 0),
        *np.moveaxis(ratio, -1, 0),
        np.exp(-STEEP * np.abs(ratio).sum(axis=-1)),
        all_overlaps(boxes),
    ]
    return np.stack(numbers, axis=-1).astype(np.float32)
