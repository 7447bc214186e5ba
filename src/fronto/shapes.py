"""What a panel is made of in the image: button outlines (quads, ellipses) and line segments.

Pixel coordinates: x right, y down, centre of the top-left pixel = (0, 0).
"""

from __future__ import annotations

import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from fronto.errors import InputError

__all__ = ["Axis", "Ellipse", "FloatArray", "LineSegment", "Outline", "Shape", "order_corners"]

FloatArray = npt.NDArray[np.float64]
Shape = Literal["quad", "ellipse"]
Axis = Literal["horizontal", "vertical"]

#: Thinner ellipses are segments: they have no tangents on two sides.
MIN_AXIS_PX = 1e-3

#: Standard deviation of a corner or of an ellipse's centre where nobody states one.
DEFAULT_STD_PX = 0.5


def frozen_array(
    values: npt.ArrayLike,
    shape: tuple[int, ...],
    thing: str,
    remedy: str = "correct them, or leave out what has none",
) -> FloatArray:
    """Copy `values` to a read-only float64 array of the given shape (-1: any length).

    `remedy` is what the user can do about NaN and infinity.

    Raises
    ------
    InputError
        If the values are no numbers, not finite, or of another shape.
    """
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(thing, f"expected numbers of shape {shape}") from None
    if array.ndim != len(shape) or any(
        want not in (-1, have) for want, have in zip(shape, array.shape, strict=True)
    ):
        raise InputError(thing, f"expected an array of shape {shape}, got {array.shape}")
    if not np.isfinite(array).all():
        raise InputError(thing, "expected finite numbers, got NaN or infinity", remedy)
    array.setflags(write=False)
    return array


@dataclass(frozen=True)
class Ellipse:
    """An ellipse in pixels.

    Parameters
    ----------
    cx, cy
        Centre.
    a, b
        Semi-axes, a >= b > 0 (at least a thousandth of a pixel).
    angle_deg
        Direction of the a axis from +x, clockwise as seen (y is down).
    """

    cx: float
    cy: float
    a: float
    b: float
    angle_deg: float = 0.0

    def __post_init__(self) -> None:
        values = (self.cx, self.cy, self.a, self.b, self.angle_deg)
        if not all(np.isfinite(value) for value in values):
            raise InputError("ellipse", "expected finite numbers, got NaN or infinity")
        if self.b < MIN_AXIS_PX or self.a < self.b:
            raise InputError(
                "ellipse",
                f"expected semi-axes a >= b >= {MIN_AXIS_PX:g} px, got a={self.a:g}, b={self.b:g}",
                "swap the axes and add 90 to angle_deg if b is the longer one",
            )

    @property
    def center(self) -> FloatArray:
        """Centre, shape (2,)."""
        return np.array([self.cx, self.cy])

    @property
    def shape_matrix(self) -> FloatArray:
        """S, shape (2, 2): the ellipse is {c + L u : |u| = 1} for any L with L Lᵀ = S."""
        angle = np.radians(self.angle_deg)
        axes = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
        return np.asarray((axes * [self.a**2, self.b**2]) @ axes.T)

    @property
    def box(self) -> tuple[float, float, float, float]:
        """Bounding box x0, y0, x1, y1."""
        angle = math.radians(self.angle_deg)
        c, s = math.cos(angle), math.sin(angle)
        across, down = math.hypot(self.a * c, self.b * s), math.hypot(self.a * s, self.b * c)
        return self.cx - across, self.cy - down, self.cx + across, self.cy + down

    @classmethod
    def from_shape_matrix(cls, center: npt.ArrayLike, shape_matrix: npt.ArrayLike) -> Ellipse:
        """Build the ellipse from its centre (2,) and S (2, 2).

        Raises
        ------
        InputError
            If S is not positive definite.
        """
        values, vectors = np.linalg.eigh(np.asarray(shape_matrix, dtype=np.float64))
        if not values[0] > 0:
            raise InputError("ellipse", "expected a positive definite shape matrix")
        cx, cy = (float(value) for value in np.asarray(center, dtype=np.float64))
        angle = float(np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1]))) % 180.0
        b, a = (float(value) for value in np.sqrt(values))
        return cls(cx, cy, a, b, angle)

    def points(self, count: int = 64) -> FloatArray:
        """`count` points on the ellipse, evenly spaced in the eccentric anomaly, (count, 2)."""
        t = np.arange(count) * (2 * np.pi / count)
        angle = np.radians(self.angle_deg)
        u, v = self.a * np.cos(t), self.b * np.sin(t)
        return np.stack(
            [
                self.cx + u * np.cos(angle) - v * np.sin(angle),
                self.cy + u * np.sin(angle) + v * np.cos(angle),
            ],
            axis=1,
        )


@dataclass(frozen=True, eq=False)
class Outline:
    """The outline of one button in the photo: a quad of ordered corners, or an ellipse.

    Build it with :meth:`quad` or :meth:`ellipse`.

    Parameters
    ----------
    shape
        "quad" or "ellipse".
    corners_px
        Shape (4, 2): top-left, top-right, bottom-right, bottom-left as the panel
        reads upright (the paper's corners 1 to 4, Fig. 3); None for an ellipse.
    ellipse_px
        The ellipse; None for a quad.
    std_px
        Standard deviation of each corner coordinate, or of the ellipse's centre
        coordinates and semi-axes.
    category
        What kind of button it is ("up", "number", ...).
    confidence
        How sure the segmentation is that this is such a button, 0 to 1.
    text
        What is printed on it, "" where unknown.
    odd
        The pressable part is no rectangle (a pill, say); `corners_px` bound it.
    truncated
        Part of the button lies outside the photo, or is hidden.
    seen
        Which of a quad's sides are seen: top, right, bottom, left. Corners at other sides
        are guesses; the pose leans on the seen sides only.
    shape_confidence
        Probability that it has this shape and no other, 0 to 1.
    form_std_px
        Standard deviation of the form, place and size left open: of a quad's corner coordinates
        against each other, of half the difference of an ellipse's axes. An outline that follows
        another edge of the button all around is as good for the pose. None: `std_px`.
    """

    shape: Shape
    corners_px: FloatArray | None = None
    ellipse_px: Ellipse | None = None
    std_px: float = DEFAULT_STD_PX
    category: str = "other"
    confidence: float = 1.0
    text: str = ""
    odd: bool = False
    truncated: bool = False
    seen: tuple[bool, bool, bool, bool] = (True, True, True, True)
    shape_confidence: float = 1.0
    form_std_px: float | None = None

    def __post_init__(self) -> None:
        for name in ("std_px", "form_std_px"):
            std = getattr(self, name)
            if std is not None and not (math.isfinite(std) and std > 0):
                raise InputError(name, f"expected a positive number of pixels, got {std}")
        if self.shape == "quad":
            if self.corners_px is None or self.ellipse_px is not None:
                raise InputError("outline", "a quad needs corners_px and no ellipse_px")
            object.__setattr__(self, "corners_px", check_corners(self.corners_px))
        elif self.shape == "ellipse":
            if self.ellipse_px is None or self.corners_px is not None:
                raise InputError("outline", "an ellipse needs ellipse_px and no corners_px")
        else:
            raise InputError("shape", f'expected "quad" or "ellipse", got {self.shape!r}')

    @classmethod
    def quad(
        cls,
        corners_px: npt.ArrayLike,
        *,
        std_px: float = DEFAULT_STD_PX,
        category: str = "other",
        confidence: float = 1.0,
        text: str = "",
        odd: bool = False,
        truncated: bool = False,
        seen: tuple[bool, bool, bool, bool] = (True, True, True, True),
        shape_confidence: float = 1.0,
        form_std_px: float | None = None,
    ) -> Outline:
        """A quad from its corners (4, 2): top-left, top-right, bottom-right, bottom-left.

        Raises
        ------
        InputError
            If the corners are not finite, repeat, cross, turn inwards or run the wrong
            way round (a mirrored panel).
        """
        return cls(
            "quad",
            corners_px=_unchecked(corners_px),
            std_px=std_px,
            category=category,
            confidence=confidence,
            text=text,
            odd=odd,
            truncated=truncated,
            seen=seen,
            shape_confidence=shape_confidence,
            form_std_px=form_std_px,
        )

    @classmethod
    def ellipse(
        cls,
        cx: float,
        cy: float,
        a: float,
        b: float,
        angle_deg: float = 0.0,
        *,
        std_px: float = DEFAULT_STD_PX,
        category: str = "other",
        confidence: float = 1.0,
        text: str = "",
        truncated: bool = False,
        shape_confidence: float = 1.0,
        form_std_px: float | None = None,
    ) -> Outline:
        """An ellipse from its centre, semi-axes (a >= b) and the a axis' angle.

        Raises
        ------
        InputError
            If a number is not finite or the axes are not a >= b > 0.
        """
        return cls(
            "ellipse",
            ellipse_px=Ellipse(cx, cy, a, b, angle_deg),
            std_px=std_px,
            category=category,
            confidence=confidence,
            text=text,
            truncated=truncated,
            shape_confidence=shape_confidence,
            form_std_px=form_std_px,
        )

    @property
    def center_px(self) -> FloatArray:
        """Where the quad's diagonals cross, or the ellipse's centre, shape (2,)."""
        if self.ellipse_px is not None:
            return self.ellipse_px.center
        assert self.corners_px is not None
        a, b, c, d = self.corners_px
        first, second = c - a, d - b
        t = _cross(b - a, second) / _cross(first, second)
        return np.asarray(a + t * first)

    @property
    def box_px(self) -> tuple[float, float, float, float]:
        """The outline's bounding box x0, y0, x1, y1."""
        if self.ellipse_px is not None:
            return self.ellipse_px.box
        assert self.corners_px is not None
        (ax, ay), (bx, by), (cx, cy), (dx, dy) = self.corners_px.tolist()
        return min(ax, bx, cx, dx), min(ay, by, cy, dy), max(ax, bx, cx, dx), max(ay, by, cy, dy)


@dataclass(frozen=True, eq=False)
class LineSegment:
    """A straight segment in the photo, parallel to one of the panel's axes in space.

    Panel edges, door frames, handrails: anything horizontal or vertical on the wall
    shares the panel's vanishing points, whatever plane it lies in.

    Parameters
    ----------
    axis
        "horizontal" or "vertical" on the wall.
    ends_px
        Shape (2, 2): the two end points.
    std_px
        Standard deviation of an end point across the line.
    found
        It was found along the buttons' rows or columns (`fronto.outline`), and nobody knows
        what it is: it counts only where the buttons alone make no pose that is "ok" and it does.
    """

    axis: Axis
    ends_px: FloatArray
    std_px: float = DEFAULT_STD_PX
    found: bool = False

    def __post_init__(self) -> None:
        if self.axis not in ("horizontal", "vertical"):
            raise InputError("axis", f'expected "horizontal" or "vertical", got {self.axis!r}')
        if not (np.isfinite(self.std_px) and self.std_px > 0):
            raise InputError("std_px", f"expected a positive number of pixels, got {self.std_px}")
        ends = frozen_array(self.ends_px, (2, 2), "line ends_px")
        if np.linalg.norm(ends[1] - ends[0]) < 1.0:
            raise InputError(
                "line ends_px",
                "expected two points at least one pixel apart",
                "give the ends of a longer line, or leave it out",
            )
        object.__setattr__(self, "ends_px", ends)


def _unchecked(corners_px: npt.ArrayLike) -> FloatArray:
    """As an array, whatever it holds: `Outline` checks and copies it."""
    if isinstance(corners_px, np.ndarray):
        return corners_px
    return np.asarray(corners_px, dtype=object)


def _cross(u: FloatArray, v: FloatArray) -> float:
    return float(u[0] * v[1] - u[1] * v[0])


def check_corners(corners: npt.ArrayLike) -> FloatArray:
    """Corners (4, 2) as a read-only array, if they bound a convex, unmirrored button.

    Raises
    ------
    InputError
        Naming what is wrong: NaN, coinciding corners, corners on one line, crossing
        sides, a corner that turns inwards, or corners that run counter-clockwise (mirrored).
    """
    array = frozen_array(corners, (4, 2), "corners")
    # Four points are too few for NumPy: plain numbers take a tenth of the time.
    points = array.tolist()
    sides = [
        (d[0] - c[0], d[1] - c[1]) for c, d in zip(points, points[1:] + points[:1], strict=True)
    ]
    lengths = [math.hypot(*side) for side in sides]
    diagonals = [math.dist(points[k], points[k + 2]) for k in (0, 1)]
    scale = max(*lengths, *diagonals)
    if scale == 0 or min(*lengths, *diagonals) < 1e-6 * scale:
        raise InputError(
            "corners",
            "expected four different points, got coinciding ones",
            "mark all four corners, or leave the button out",
        )
    turns = [s[0] * t[1] - s[1] * t[0] for s, t in zip(sides, sides[1:] + sides[:1], strict=True)]
    least = 1e-9 * scale * scale
    if min(turns) > least:
        return array
    order = "order them top-left, top-right, bottom-right, bottom-left (fronto.order_corners does)"
    if max(map(abs, turns)) <= least:
        raise InputError(
            "corners",
            "expected a convex quadrilateral, got points on one line",
            "mark all four corners, or leave the button out",
        )
    if max(turns) <= least:
        raise InputError(
            "corners", "expected clockwise corners, got counter-clockwise (mirrored) ones", order
        )
    if sum(turn > 0 for turn in turns) == 2:
        raise InputError("corners", "expected a simple quadrilateral, got crossing sides", order)
    raise InputError(
        "corners",
        "expected a convex quadrilateral, got a corner that turns inwards",
        "mark that corner again, or leave the button out",
    )


def order_corners(points: npt.ArrayLike | Sequence[Sequence[float]]) -> FloatArray:
    """Order four corners of an upright button: top-left, top-right, bottom-right, bottom-left.

    Right for a camera rolled by less than 45 degrees against the panel (the paper's
    corner order, Fig. 3).

    Parameters
    ----------
    points
        Shape (4, 2), pixels, in any order.

    Returns
    -------
    Shape (4, 2).

    Raises
    ------
    InputError
        If the points bound no convex quadrilateral.
    """
    return check_corners(upright_order(frozen_array(points, (4, 2), "corners")))


def upright_order(array: FloatArray) -> FloatArray:
    """`order_corners` without its checks: four points (4, 2), which may bound nothing."""
    points = array.tolist()
    x, y = (sum(p[k] for p in points) / 4 for k in (0, 1))
    points.sort(key=lambda p: math.atan2(p[1] - y, p[0] - x))
    # The upper side is the one whose outward normal points up the most: its direction,
    # walked clockwise, is the one closest to +x.
    along = []
    for (x0, y0), (x1, y1) in zip(points, points[1:] + points[:1], strict=True):
        along.append((x1 - x0) / max(math.hypot(x1 - x0, y1 - y0), sys.float_info.min))
    # Opposite sides agree on the direction; using both keeps slanted quads right.
    first = max(range(4), key=lambda k: along[k] - along[k - 2])
    return np.array(points[first:] + points[:first])
