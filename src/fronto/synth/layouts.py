"""Where the buttons of a panel are: hall and car panels, squares and circles, in metres.

Panel frame: x right along the rows, y down the columns, z into the wall; origin at the
panel's centre.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fronto.shapes import FloatArray, Shape

__all__ = ["Layout", "LayoutButton", "car_layout", "circle_layout", "hall_layout", "imprecise"]


@dataclass(frozen=True)
class LayoutButton:
    """One button on the panel.

    Parameters
    ----------
    x, y
        Centre, metres.
    width, height
        Size, metres; of a circle both are the diameter.
    shape
        "quad" or "ellipse" (a circle seen from anywhere).
    category, text
        What it is and what is printed on it.
    """

    x: float
    y: float
    width: float
    height: float
    shape: Shape = "quad"
    category: str = "number"
    text: str = ""


@dataclass(frozen=True)
class Layout:
    """A panel: its buttons and a name."""

    name: str
    buttons: tuple[LayoutButton, ...]

    @property
    def centers(self) -> FloatArray:
        """Centres, shape (n, 2), metres."""
        return np.array([(b.x, b.y) for b in self.buttons]).reshape(-1, 2)

    @property
    def corners(self) -> FloatArray:
        """Corners of every button (of a circle: its circumscribed square), (n, 4, 2), metres."""
        half = np.array([(b.width / 2, b.height / 2) for b in self.buttons]).reshape(-1, 1, 2)
        signs = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]])
        return np.asarray(self.centers[:, None] + half * signs)


def imprecise(rng: np.random.Generator, layout: Layout, tolerance_m: float) -> Layout:
    """The panel as it was made: positions and sizes off by Gaussian `tolerance_m` each."""
    buttons = []
    for button in layout.buttons:
        dx, dy, dw, dh = rng.normal(0.0, tolerance_m, 4)
        height = button.width + dw if button.shape == "ellipse" else button.height + dh
        buttons.append(
            replace(
                button,
                x=button.x + dx,
                y=button.y + dy,
                width=button.width + dw,
                height=height,
            )
        )
    return replace(layout, buttons=tuple(buttons))


def hall_layout(
    rng: np.random.Generator, buttons: int | None = None, side_m: float | None = None
) -> Layout:
    """A hall panel: 2-3 square buttons of 25-35 mm in a column, 45-60 mm apart.

    Parameters
    ----------
    buttons
        How many; random where None.
    side_m
        Side of a button; random where None.
    """
    count = int(rng.integers(2, 4)) if buttons is None else buttons
    side = float(rng.uniform(0.025, 0.035)) if side_m is None else side_m
    pitch = float(max(rng.uniform(0.045, 0.060), 1.25 * side))
    names = [("up", "up"), ("down", "down"), ("keyhole", "")]
    return Layout(
        "hall",
        tuple(
            LayoutButton(
                0.0,
                (k - (count - 1) / 2) * pitch,
                side,
                side,
                category=names[k % 3][0],
                text=names[k % 3][1],
            )
            for k in range(count)
        ),
    )


def _grid(
    rng: np.random.Generator, columns: int, rows: int, count: int, side: float, shape: Shape
) -> tuple[LayoutButton, ...]:
    pitch_x, pitch_y = side * rng.uniform(1.25, 1.8, size=2)
    return tuple(
        LayoutButton(
            float((k % columns - (columns - 1) / 2) * pitch_x),
            float((k // columns - (rows - 1) / 2) * pitch_y),
            side,
            side,
            shape,
            text=str(count - k),
        )
        for k in range(count)
    )


def car_layout(
    rng: np.random.Generator, buttons: int | None = None, shape: Shape = "quad"
) -> Layout:
    """A car panel: 12-20 buttons of 25-35 mm in 2-4 columns.

    Parameters
    ----------
    buttons
        How many; random where None.
    shape
        "quad" for squares, "ellipse" for circles.
    """
    count = int(rng.integers(12, 21)) if buttons is None else buttons
    columns = int(rng.integers(2, 5))
    side = float(rng.uniform(0.025, 0.035))
    rows = -(-count // columns)
    return Layout("car", _grid(rng, columns, rows, count, side, shape))


def circle_layout(rng: np.random.Generator, buttons: int = 4) -> Layout:
    """`buttons` circles of 25-35 mm on a grid: two columns up to four, else 2-4 columns."""
    columns = 2 if buttons <= 4 else int(rng.integers(2, 5))
    side = float(rng.uniform(0.025, 0.035))
    rows = -(-buttons // columns)
    return Layout("circles", _grid(rng, columns, rows, buttons, side, "ellipse"))
