"""Tiles of a contact sheet: the part of a photo that they show, and what was found there."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import numpy.typing as npt

from fronto.drawing import Box, Color, Picture, write_text
from fronto.errors import InputError
from fronto.segments import Segment
from fronto.shapes import Ellipse, FloatArray, LineSegment, Outline

__all__ = ["BACK", "GAP", "INK", "TILE_WIDTH", "TITLE", "Window", "sheet", "titled"]

#: Tiles are this wide, and between these heights, pixels.
TILE_WIDTH, HEIGHTS = 480, (360, 600)
#: Height of a tile's title, and the gap between tiles.
TITLE, GAP = 22, 6
BACK: Color = (32, 32, 32)
INK: Color = (240, 240, 240)
#: Around all that was found, in its larger extent; and the least part that is shown, pixels.
MARGIN, LEAST_PART = 0.15, 64.0


@dataclass(frozen=True)
class Window:
    """A part of a photo in the middle of a tile, as large as it fits.

    Parameters
    ----------
    part
        x0, y0, x1, y1: columns and rows of the photo, ends excluded.
    width, height
        Of the tile, pixels.
    """

    part: tuple[int, int, int, int]
    width: int
    height: int

    @classmethod
    def around(cls, boxes: Sequence[Box], width_px: int, height_px: int) -> Window:
        """All boxes of a photo of this size, and some margin; without boxes the whole photo.

        The tile's height is what the part needs.
        """
        limits = np.array([width_px, height_px])
        low, high = np.zeros(2), limits.astype(np.float64)
        if boxes:
            array = np.clip(np.array(boxes, dtype=np.float64).reshape(-1, 2, 2), 0, limits)
            low, high = array[:, 0].min(axis=0), array[:, 1].max(axis=0)
        extent = high - low
        wanted = np.maximum(extent + 2 * MARGIN * extent.max(), LEAST_PART)
        # Grown, where the photo goes on there, to a shape that a tile can have.
        wanted[0] = max(wanted[0], wanted[1] * TILE_WIDTH / HEIGHTS[1])
        wanted[1] = max(wanted[1], wanted[0] * HEIGHTS[0] / TILE_WIDTH)
        size = np.minimum(np.ceil(wanted), limits)
        first = np.clip(np.floor((low + high - size) / 2), 0, limits - size)
        height = int(np.clip(np.rint(TILE_WIDTH * size[1] / size[0]), *HEIGHTS))
        x0, y0, x1, y1 = (int(value) for value in (*first, *(first + size)))
        return cls((x0, y0, x1, y1), TILE_WIDTH, height)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the part in the tile, pixels."""
        x0, y0, x1, y1 = self.part
        factor = min(self.width / (x1 - x0), self.height / (y1 - y0))
        return max(1, round(factor * (x1 - x0))), max(1, round(factor * (y1 - y0)))

    @property
    def scale(self) -> FloatArray:
        """Tile pixels per photo pixel, across and down, (2,): equal but for rounding."""
        x0, y0, x1, y1 = self.part
        return np.array(self.size) / (x1 - x0, y1 - y0)

    @property
    def corner(self) -> tuple[int, int]:
        """Column and row of the tile where the part begins."""
        wide, high = self.size
        return (self.width - wide) // 2, (self.height - high) // 2

    def picture(self, photo: Picture) -> Picture:
        """The tile with the photo's part, (height, width, 3)."""
        import cv2

        x0, y0, x1, y1 = self.part
        (wide, high), (left, top) = self.size, self.corner
        way = cv2.INTER_AREA if self.scale.min() < 1 else cv2.INTER_LINEAR
        tile = np.full((self.height, self.width, 3), BACK, np.uint8)
        part = np.ascontiguousarray(photo[y0:y1, x0:x1])
        tile[top : top + high, left : left + wide] = cv2.resize(
            part, (wide, high), interpolation=way
        )
        return tile

    def points(self, xy: npt.ArrayLike) -> FloatArray:
        """Photo pixels (n, 2) to tile pixels (n, 2)."""
        return np.asarray(xy) * self.scale + self._shift

    def outline(self, outline: Outline) -> Outline | None:
        """An outline in the tile, its deviation still in the photo's pixels.

        None where it is too small or too large to be one there.
        """
        try:
            if outline.ellipse_px is not None:
                return replace(outline, ellipse_px=self.ellipse(outline.ellipse_px))
            assert outline.corners_px is not None
            return replace(outline, corners_px=self.points(outline.corners_px))
        except InputError:
            return None

    def ellipse(self, ellipse: Ellipse) -> Ellipse:
        """An ellipse in the tile.

        Raises
        ------
        InputError
            If it is too small for one there.
        """
        shape = self.scale[:, None] * ellipse.shape_matrix * self.scale
        return Ellipse.from_shape_matrix(self.points(ellipse.center), shape)

    def line(self, line: LineSegment) -> LineSegment | None:
        """A line in the tile; None where it is shorter than a pixel."""
        try:
            return replace(line, ends_px=self.points(line.ends_px))
        except InputError:
            return None

    def sampled(
        self, values: npt.NDArray[Any], origin_px: tuple[int, int], *, smooth: bool
    ) -> tuple[npt.NDArray[Any], tuple[int, int]] | None:
        """An array (h, w) of the photo's pixels from `origin_px` on, as the tile shows it.

        Returns
        -------
        Its part of the tile, 0 where it has no values, and the part's first column and row;
        None where the tile shows nothing of it.
        """
        import cv2

        limits = np.array([self.width, self.height])
        outer = np.array(origin_px) + np.array([[0, 0], values.shape[::-1]]) - 0.5
        low, high = self.points(outer)
        low = np.clip(np.floor(low + 0.5), 0, limits).astype(int)
        high = np.clip(np.ceil(high + 0.5), 0, limits).astype(int)
        if (high <= low).any():
            return None
        # Tile = scale * (column + origin) + shift, counted from the part's first pixel.
        move = np.column_stack([np.diag(self.scale), self.scale * origin_px + self._shift - low])
        size = (int(high[0] - low[0]), int(high[1] - low[1]))
        way = cv2.INTER_LINEAR if smooth else cv2.INTER_NEAREST
        return np.asarray(cv2.warpAffine(values, move, size, flags=way)), (int(low[0]), int(low[1]))

    def segment(self, segment: Segment) -> Segment | None:
        """A segment in the tile; None where the tile shows nothing of it."""
        found = self.sampled(segment.probability, segment.origin_px, smooth=True)
        if found is None:
            return None
        probability, origin = found
        (x0, y0), (x1, y1) = self.points(np.reshape(segment.box_px, (2, 2))).tolist()
        return replace(segment, box_px=(x0, y0, x1, y1), origin_px=origin, probability=probability)

    @property
    def _shift(self) -> FloatArray:
        # Pixel centres are at whole numbers: a photo's edge is at -0.5, as is the tile's.
        return np.asarray(self.scale * (0.5 - np.array(self.part[:2])) - 0.5 + self.corner)


def titled(tile: Picture, title: str, color: Color = INK) -> Picture:
    """The tile below its title."""
    result = np.full((tile.shape[0] + TITLE, tile.shape[1], 3), BACK, np.uint8)
    result[TITLE:] = tile
    write_text(result, title, (4, TITLE - 7), 1.0, color)
    return result


def sheet(tiles: Sequence[Picture], columns: int) -> Picture:
    """Tiles of one size in rows, with gaps around them."""
    height, width = tiles[0].shape[:2]
    rows = -(-len(tiles) // columns)
    result = np.full(
        (rows * (height + GAP) + GAP, columns * (width + GAP) + GAP, 3), BACK, np.uint8
    )
    for k, tile in enumerate(tiles):
        top, left = GAP + k // columns * (height + GAP), GAP + k % columns * (width + GAP)
        result[top : top + height, left : left + width] = tile
    return result
