"""What outlines of one panel must agree on before any pose is estimated."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from fronto.errors import InputError
from fronto.shapes import FloatArray, Outline

__all__ = ["boxes_px", "check_outlines"]

#: A corner order that starts at another corner shows as a quarter turn; perspective and
#: roll together stay well below this between buttons of one panel.
_ORDER_RAD = np.radians(60.0)
#: Two outlines whose boxes' centres are closer than this share of the smaller one are one button.
_SAME = 0.2


def boxes_px(outlines: Sequence[Outline]) -> FloatArray:
    """Bounding boxes x0, y0, x1, y1 of the outlines, (n, 4)."""
    if all(outline.corners_px is not None for outline in outlines):
        corners = np.array([outline.corners_px for outline in outlines])
        return np.concatenate([corners.min(axis=1), corners.max(axis=1)], axis=1)
    return np.array([outline.box_px for outline in outlines])


def check_outlines(outlines: Sequence[Outline]) -> None:
    """Refuse outlines that contradict each other.

    Raises
    ------
    InputError
        If an item is no outline, one button appears twice, or a quad's corners start at
        another corner than the others'.
    """
    for k, outline in enumerate(outlines):
        if not isinstance(outline, Outline):
            raise InputError(
                f"outlines[{k}]",
                f"expected a fronto.Outline, got {type(outline).__name__}",
                "build it with Outline.quad or Outline.ellipse",
            )
    if len(outlines) < 2:
        return
    quads = [(k, o.corners_px) for k, o in enumerate(outlines) if o.corners_px is not None]
    boxes = boxes_px(outlines)
    center = 0.5 * (boxes[:, :2] + boxes[:, 2:])
    size = np.sqrt((boxes[:, 2:] - boxes[:, :2]).prod(axis=1))
    offset = np.abs(center[:, None] - center).max(axis=2)
    same = offset < _SAME * np.minimum(size[:, None], size)
    np.fill_diagonal(same, False)
    if same.any():
        first, second = np.argwhere(same)[0]
        raise InputError(
            f"outlines {first} and {second}",
            "expected different buttons, got two outlines of one",
            "remove one of them",
        )
    if len(quads) < 2:
        return
    corners = np.array([c for _, c in quads])
    across = corners[:, 1] - corners[:, 0] + corners[:, 2] - corners[:, 3]
    turn = across[:, 0] + 1j * across[:, 1]
    turn /= np.abs(turn)
    if np.abs(np.angle(turn * turn.sum().conjugate())).max() < 0.5 * _ORDER_RAD:
        return
    # The direction that most agree with, also where a minority is a quarter turn off.
    agreement = np.abs(np.angle(turn[:, None] / turn)) < _ORDER_RAD
    reference = turn[int(agreement.sum(axis=1).argmax())]
    off = np.abs(np.angle(turn / reference))
    if off.max() > _ORDER_RAD:
        raise InputError(
            f"outlines {quads[int(off.argmax())][0]}",
            "expected corners from the same top-left corner as the other buttons, got an order "
            f"turned by {np.degrees(off.max()):.0f}°",
            "order them top-left, top-right, bottom-right, bottom-left (fronto.order_corners does)",
        )
