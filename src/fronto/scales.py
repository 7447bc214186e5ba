"""How the network sees a photo: the whole at a fixed number of pixels, or larger, in tiles."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fronto.errors import InputError
from fronto.shapes import FloatArray, frozen_array

__all__ = ["View", "first_look", "first_looks", "second_scale", "tiles"]

#: The network's pixels of a first look: what it was trained on, and what takes well under 100 ms.
LOOK_PX = 640 * 480
#: More enlargement adds no detail, only work.
MAX_SCALE = 4.0
#: Longer photos than this are looked at in pieces, so that buttons keep a workable size.
MAX_ASPECT = 3.0
#: Height and width of what the network takes are multiples of this.
MULTIPLE = 16
#: Largest tile of a second look, and what neighbours share: a button is whole in one of them.
TILE_PX, OVERLAP_PX = 640, 96
#: What a tile shows around each box that it is for. With a button of `GOOD_PX` it is no more
#: than `OVERLAP_PX`, so that one tile is enough for it.
MARGIN_PX = 24
#: Buttons of which a second look makes more, and the size that it gives them.
SMALL_PX, GOOD_PX = 22.0, 44.0
#: A second look that enlarges by less than this shows what the first one did.
MIN_GAIN = 1.25
#: Step by which a scale that takes too many tiles is lowered.
SMALLER = 0.95
ANY = "fronto.images.as_rgb takes any picture"

Pixels = npt.NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class View:
    """A crop of the photo, scaled for the network.

    Parameters
    ----------
    x0, y0
        The crop's top-left pixel in the photo.
    width, height
        Size of the crop in the photo's pixels.
    columns, rows
        Size of the crop in the network's pixels.
    image
        Shape (H, W, 3), uint8, RGB, read-only: the scaled crop at its top left, padded right
        and bottom with its edge pixels to multiples of 16.
    """

    x0: int
    y0: int
    width: int
    height: int
    columns: int
    rows: int
    image: Pixels

    @property
    def sx(self) -> float:
        """The network's pixels for each pixel of the photo, horizontally."""
        return self.columns / self.width

    @property
    def sy(self) -> float:
        """The network's pixels for each pixel of the photo, vertically."""
        return self.rows / self.height

    def to_photo(self, points: npt.ArrayLike) -> FloatArray:
        """Points (..., 2) of the network's picture in the photo's pixels.

        Pixels are squares around their centres: x of the network is
        (x + 0.5) / sx - 0.5 + x0 of the photo.
        """
        points = np.asarray(points, dtype=np.float64)
        return (points + 0.5) / [self.sx, self.sy] + [self.x0 - 0.5, self.y0 - 0.5]

    def to_network(self, points: npt.ArrayLike) -> FloatArray:
        """Points (..., 2) of the photo in the pixels of the network's picture."""
        points = np.asarray(points, dtype=np.float64)
        return (points - [self.x0 - 0.5, self.y0 - 0.5]) * [self.sx, self.sy] - 0.5


def first_look(image: Pixels) -> View:
    """The whole photo at about 640 x 480 pixels in all, whatever its shape.

    Small photos are enlarged, at most 4 times.

    Parameters
    ----------
    image
        Shape (h, w, 3), uint8, RGB (`fronto.images.as_rgb`).
    """
    height, width = _size(image)
    scale = min(np.sqrt(LOOK_PX / (width * height)), MAX_SCALE)
    return _view(image, 0, 0, width, height, scale)


def first_looks(image: Pixels, *, at_most: int = 12) -> list[View]:
    """The photo as `first_look`; a panorama (longer than 3:1) in overlapping pieces of 3:1.

    The shorter side of a panorama is then 320 pixels, or 4 times the photo's; less where
    that would take more than `at_most` pieces.

    Parameters
    ----------
    image
        Shape (h, w, 3), uint8, RGB (`fronto.images.as_rgb`).
    at_most
        Pieces.

    Returns
    -------
    Views that cover the photo, equally large.
    """
    height, width = _size(image)
    short, long = sorted((width, height))
    if long <= MAX_ASPECT * short:
        return [first_look(image)]
    side = float(np.sqrt(LOOK_PX / MAX_ASPECT))
    scale = min(side / short, MAX_SCALE)
    while len(pieces := _spread(0, long, scale, MAX_ASPECT * side, OVERLAP_PX)) > at_most:
        scale *= SMALLER
    lying = width > height
    return [
        _view(image, at, 0, size, short, scale)
        if lying
        else _view(image, 0, at, short, size, scale)
        for at, size in pieces
    ]


def second_scale(first: float, sides_px: npt.ArrayLike) -> float | None:
    """The scale of a second look, or None where none is worth it.

    It is worth it where half of the buttons are small to the network (below 22 pixels) and
    the photo has more pixels than the first look used.

    Parameters
    ----------
    first
        Scale of the first look (`View.sx`).
    sides_px
        Shorter sides of the buttons found, in the photo's pixels, any shape.
    """
    sides = np.asarray(sides_px, dtype=np.float64).ravel() * first
    if sides.size == 0 or (median := float(np.median(sides))) >= SMALL_PX:
        return None
    scale = min(first * GOOD_PX / max(median, 1.0), 1.0)
    return scale if scale >= MIN_GAIN * first else None


def tiles(
    image: Pixels,
    boxes: npt.ArrayLike | None,
    scale: float,
    *,
    size: int = TILE_PX,
    overlap: int = OVERLAP_PX,
    margin: int = MARGIN_PX,
    at_most: int = 12,
) -> list[View]:
    """Overlapping tiles of the photo at a given scale, equally large.

    Parameters
    ----------
    image
        Shape (h, w, 3), uint8, RGB.
    boxes
        Shape (n, 4): x0, y0, x1, y1 in the photo's pixels of what is to be seen; None: all
        of the photo.
    scale
        The network's pixels for each of the photo's; less where it would take more than
        `at_most` tiles.
    size
        Largest width and height of a tile, the network's pixels; a multiple of 16.
    overlap
        What neighbours share at least, the network's pixels.
    margin
        What is shown around each box, the network's pixels, where the photo has it.
    at_most
        Tiles.

    Returns
    -------
    Tiles that cover every box with its margin (or every pixel). Where the two together are
    no longer than `overlap`, they are whole in one tile. None for boxes outside the photo.

    Raises
    ------
    InputError
        If the boxes are no boxes, or a number is out of range.
    """
    height, width = _size(image)
    _check_numbers(scale, size, overlap, margin, at_most)
    wanted = np.array([[0, 0, width, height]], dtype=np.float64)
    if boxes is not None:
        wanted = _edges(boxes, width, height) if np.size(boxes) else wanted[:0]
        if len(wanted) == 0:
            return []
    while True:
        pad = max(overlap, margin) / scale
        low = np.floor(np.maximum(wanted[:, :2].min(axis=0) - pad, 0)).astype(int)
        high = np.ceil(np.minimum(wanted[:, 2:].max(axis=0) + pad, (width, height))).astype(int)
        along_x = _spread(int(low[0]), int(high[0]), scale, size, overlap)
        along_y = _spread(int(low[1]), int(high[1]), scale, size, overlap)
        around = np.clip(wanted + np.array([-1, -1, 1, 1]) * margin / scale, 0, [width, height] * 2)
        chosen = sorted(
            {
                (i, j)
                for x0, y0, x1, y1 in around.tolist()
                for i in _showing(along_y, y0, y1)
                for j in _showing(along_x, x0, x1)
            }
        )
        if len(chosen) <= at_most:
            break
        scale *= SMALLER
    return [
        _view(image, along_x[j][0], along_y[i][0], along_x[j][1], along_y[i][1], scale)
        for i, j in chosen
    ]


def _spread(
    low: int, high: int, scale: float, size: float, overlap: float
) -> list[tuple[int, int]]:
    """Starts and length of equal pieces that cover low..high of the photo's pixels.

    They are at most `size` and share at least `overlap` of the network's pixels.
    """
    length, most, shared = high - low, int(size / scale), int(np.ceil(overlap / scale))
    if length <= most:
        return [(low, length)]
    n = -((shared - length) // (most - shared))
    piece = -((-length - (n - 1) * shared) // n)
    return [(low + round(i * (length - piece) / (n - 1)), piece) for i in range(n)]


def _showing(pieces: Sequence[tuple[int, int]], low: float, high: float) -> list[int]:
    """The piece that shows low..high with most around it, or all that show some of it."""
    room = [min(low - at, at + size - high) for at, size in pieces]
    best = int(np.argmax(room))
    if room[best] >= 0:
        return [best]
    return [i for i, (at, size) in enumerate(pieces) if at < high and low < at + size]


def _view(image: Pixels, x0: int, y0: int, width: int, height: int, scale: float) -> View:
    import cv2

    columns, rows = (max(round(n * scale), 1) for n in (width, height))
    scaled = image[y0 : y0 + height, x0 : x0 + width]
    if (columns, rows) != (width, height):
        way = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
        scaled = np.asarray(cv2.resize(scaled, (columns, rows), interpolation=way), np.uint8)
    right, bottom = -columns % MULTIPLE, -rows % MULTIPLE
    padded = np.asarray(
        cv2.copyMakeBorder(scaled, 0, bottom, 0, right, cv2.BORDER_REPLICATE), np.uint8
    )
    padded.setflags(write=False)
    return View(x0, y0, width, height, columns, rows, padded)


def _size(image: Pixels) -> tuple[int, int]:
    if not isinstance(image, np.ndarray) or image.dtype != np.uint8 or image.ndim != 3:
        found = getattr(image, "dtype", type(image).__name__)
        raise InputError("image", f"expected uint8 of shape (h, w, 3), got {found}", ANY)
    if image.shape[2] != 3 or image.size == 0:
        raise InputError("image", f"expected shape (h, w, 3), got {image.shape}", ANY)
    return int(image.shape[0]), int(image.shape[1])


def _edges(boxes: npt.ArrayLike, width: int, height: int) -> FloatArray:
    """Boxes (n, 4) counted from the photo's top-left corner (not centre) and cut at its edges."""
    array = frozen_array(boxes, (-1, 4), "boxes")
    if (array[:, 2:] < array[:, :2]).any():
        raise InputError("boxes", "expected x0 <= x1 and y0 <= y1", "give x0, y0, x1, y1")
    cut = np.clip(array + 0.5, 0, [width, height] * 2)
    return cut[(cut[:, 2] > cut[:, 0]) & (cut[:, 3] > cut[:, 1])]


def _check_numbers(scale: float, size: int, overlap: int, margin: int, at_most: int) -> None:
    if not 0 < scale <= MAX_SCALE:
        raise InputError("scale", f"expected more than 0 and at most {MAX_SCALE:g}, got {scale}")
    if size < 4 * MULTIPLE or size % MULTIPLE:
        raise InputError(
            "size", f"expected a multiple of {MULTIPLE} from {4 * MULTIPLE}, got {size}"
        )
    if not 0 <= overlap <= size // 2:
        raise InputError("overlap", f"expected 0 to half of the size {size}, got {overlap}")
    if not 0 <= margin <= size // 2:
        raise InputError("margin", f"expected 0 to half of the size {size}, got {margin}")
    if at_most < 1:
        raise InputError("at_most", f"expected at least 1, got {at_most}")
