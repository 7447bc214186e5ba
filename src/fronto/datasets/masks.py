"""Masks to outlines: the pixels' own edges, and run lengths as the formats store them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from fronto.errors import InputError
from fronto.shapes import FloatArray

__all__ = ["coco_mask", "join_pieces", "mask_polygon", "row_mask"]

Mask = npt.NDArray[np.bool_]

#: Smaller pieces of a mask, against its largest one, are specks.
SPECK = 0.05
MAX_PIXELS = 150_000_000


def mask_polygon(mask: Mask) -> FloatArray:
    """Outline of a mask along the edges of its pixels.

    Holes are filled, specks left out, and of several pieces (something hides the middle of
    a button) the convex hull is taken.

    Parameters
    ----------
    mask
        Shape (h, w).

    Returns
    -------
    Shape (n, 2), pixels: the pixels 3..7 reach from 2.5 to 7.5.

    Raises
    ------
    InputError
        If the mask is empty.
    """
    import cv2

    if not mask.any():
        raise InputError("mask", "expected some pixels, got none", "leave the object out")
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    origin = np.array([columns[0], rows[0]])
    part = mask[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1]
    # On a lattice of half pixels each pixel covers 3x3 points, its corners included, so that
    # contours, which run through points, run along the pixels' edges.
    lattice = np.zeros((2 * part.shape[0] + 1, 2 * part.shape[1] + 1), np.uint8)
    for dy in range(3):
        for dx in range(3):
            lattice[dy : dy + 2 * part.shape[0] : 2, dx : dx + 2 * part.shape[1] : 2] |= part
    contours, _ = cv2.findContours(lattice, cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_SIMPLE)
    areas = [cv2.contourArea(contour) for contour in contours]
    pieces = [
        contour.reshape(-1, 2) / 2 - 0.5 + origin
        for contour, area in zip(contours, areas, strict=True)
        if area >= SPECK * max(areas)
    ]
    return join_pieces(pieces)


def join_pieces(pieces: Sequence[npt.ArrayLike]) -> FloatArray:
    """One outline of an object in pieces: their convex hull, or the only piece as it is.

    Parameters
    ----------
    pieces
        Shapes (n, 2), pixels; at least one.

    Returns
    -------
    Shape (m, 2), pixels.
    """
    import cv2

    if len(pieces) == 1:
        return np.asarray(pieces[0], dtype=np.float64)
    points = np.concatenate([np.asarray(piece, dtype=np.float64) for piece in pieces])
    # OpenCV's hull is of float32, so only its choice of points is taken.
    hull = cv2.convexHull(points.astype(np.float32), returnPoints=False)
    return np.asarray(points[np.asarray(hull).ravel()])


def row_mask(counts: Sequence[int], height: int, width: int) -> Mask:
    """Mask from lengths of alternating runs of 0 and 1, 0 first, row by row.

    Parameters
    ----------
    counts
        Lengths of the runs, pixels.
    height, width
        Shape of the mask.

    Returns
    -------
    Shape (height, width).

    Raises
    ------
    InputError
        If the runs do not fill the mask exactly.
    """
    if min(height, width) <= 0 or height * width > MAX_PIXELS:
        raise InputError("mask", f"expected a mask with pixels, got {width}x{height}")
    if any(count < 0 for count in counts) or sum(counts) != height * width:
        raise InputError(
            "mask",
            f"expected runs that add up to {width}x{height} pixels, got {sum(counts)}",
            "export the labels again",
        )
    return np.repeat(np.arange(len(counts)) % 2 == 1, counts).reshape(height, width)


def coco_mask(counts: Sequence[int] | str, height: int, width: int) -> Mask:
    """Mask from COCO's run lengths (column by column), plain or compressed to a string.

    Parameters
    ----------
    counts
        Lengths of the runs in pixels, or COCO's compressed form of them.
    height, width
        Shape of the mask.

    Returns
    -------
    Shape (height, width).

    Raises
    ------
    InputError
        If the runs do not fill the mask exactly.
    """
    runs = _run_lengths(counts) if isinstance(counts, str) else counts
    return row_mask(runs, width, height).T  # columns of the mask are rows of its transpose


def _run_lengths(text: str) -> list[int]:
    """Lengths of the runs from COCO's compressed form.

    Each length is a little-endian number of 5 bits a character, from "0" on; the sixth bit
    says that more follows, the fifth of the last is the sign. From the fourth on it is the
    difference to the length before the last. Read here, since pycocotools 2.0.11 fills what
    a cut string lacks with whatever is in memory.
    """
    runs: list[int] = []
    value = shift = 0
    for character in text:
        bits = ord(character) - ord("0")
        if not 0 <= bits < 64 or shift > 30:
            raise InputError("mask", "expected COCO's compressed run lengths, got other text")
        value |= (bits & 31) << shift
        shift += 5
        if bits & 32:
            continue
        if bits & 16:
            value -= 1 << shift
        runs.append(value + runs[-2] if len(runs) > 2 else value)
        value = shift = 0
    if shift:
        raise InputError("mask", "expected whole run lengths, got a cut text", "export it again")
    return runs
