"""Where a map of probabilities crosses a level: outlines finer than pixels."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fronto.errors import InputError
from fronto.shapes import FloatArray

__all__ = ["level_contour"]

TOP, RIGHT, BOTTOM, LEFT = range(4)
#: Marching squares (Lorensen and Cline 1987, in the plane): by the bits of a cell's corners
#: inside (top-left 8, top-right 4, bottom-right 2, bottom-left 1), from which of its edges to
#: which the contour runs, the inside on its right. 16 and 17 are 5 and 10 where the cell's
#: middle is inside.
STEPS: tuple[tuple[tuple[int, int], ...], ...] = (
    (),
    ((LEFT, BOTTOM),),
    ((BOTTOM, RIGHT),),
    ((LEFT, RIGHT),),
    ((RIGHT, TOP),),
    ((RIGHT, TOP), (LEFT, BOTTOM)),
    ((BOTTOM, TOP),),
    ((LEFT, TOP),),
    ((TOP, LEFT),),
    ((TOP, BOTTOM),),
    ((TOP, LEFT), (BOTTOM, RIGHT)),
    ((TOP, RIGHT),),
    ((RIGHT, LEFT),),
    ((RIGHT, BOTTOM),),
    ((BOTTOM, LEFT),),
    (),
    ((LEFT, TOP), (RIGHT, BOTTOM)),
    ((TOP, RIGHT), (BOTTOM, LEFT)),
)


def level_contour(values: npt.ArrayLike, level: float = 0.5) -> FloatArray:
    """Outer contour of the largest piece of what lies above a level.

    Between neighbouring pixels the values are taken as linear; around the array they are 0,
    so that a piece which touches the array's border ends at it.

    Parameters
    ----------
    values
        Shape (h, w): 0 or more.
    level
        Above 0.

    Returns
    -------
    Shape (n, 2): x, y in the array's pixels, clockwise as seen, the first point not repeated.

    Raises
    ------
    InputError
        If no value is above the level.
    """
    padded = np.pad(np.asarray(values, dtype=np.float64), 1)
    inside = padded > level
    if not inside.any():
        raise InputError("mask", f"expected a pixel above {level:g}, got none")
    following, crossings = _steps(padded, inside, level)
    contours = _loops(following)
    best = max((crossings[loop] for loop in contours), key=_area)
    return np.asarray(best - 1.0)


def _steps(
    padded: FloatArray, inside: npt.NDArray[np.bool_], level: float
) -> tuple[dict[int, int], FloatArray]:
    """The edge that follows each crossed edge; and where each edge is crossed, (edges, 2).

    Edge 2 k runs from grid point k to the right, edge 2 k + 1 downwards.
    """
    height, width = padded.shape
    corners = [inside[:-1, :-1], inside[:-1, 1:], inside[1:, 1:], inside[1:, :-1]]
    case = sum(corner.astype(np.int64) << (3 - k) for k, corner in enumerate(corners))
    middle = (padded[:-1, :-1] + padded[:-1, 1:] + padded[1:, 1:] + padded[1:, :-1]) / 4
    case = np.where((middle > level) & (case == 5), 16, case)
    case = np.where((middle > level) & (case == 10), 17, case)
    point = np.arange(height * width).reshape(height, width)[:-1, :-1]
    edges = (2 * point, 2 * (point + 1) + 1, 2 * (point + width), 2 * point + 1)
    following: dict[int, int] = {}
    for number, steps in enumerate(STEPS):
        here = case == number
        for start, end in steps:
            pairs = zip(edges[start][here].tolist(), edges[end][here].tolist(), strict=True)
            following.update(pairs)
    used = np.array(list(following), dtype=np.int64)
    rows, columns = np.divmod(used // 2, width)
    down = used % 2
    first = padded[rows, columns]
    second = padded[rows + down, columns + 1 - down]
    share = (level - first) / (second - first)
    crossings = np.zeros((2 * height * width, 2))
    crossings[used] = np.stack([columns + share * (1 - down), rows + share * down], axis=1)
    return following, crossings


def _loops(following: dict[int, int]) -> list[list[int]]:
    loops = []
    while following:
        edge = next(iter(following))
        loop = []
        while edge in following:
            loop.append(edge)
            edge = following.pop(edge)
        loops.append(loop)
    return loops


def _area(polygon: FloatArray) -> float:
    """Signed: above 0 for outer contours, below for holes."""
    x, y = (polygon - polygon[0]).T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2
