"""Outlines of one photo that do not contradict each other."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from fronto.shapes import FloatArray, Outline

__all__ = ["agreeing_orders", "at_odds", "doubles"]

#: Rows of one panel do not run further apart than this; `estimate_pose` refuses 60 degrees.
APART_RAD = np.radians(50.0)
#: Outlines whose centres are closer than this share of the smaller one are of one button.
SAME = 0.25


def agreeing_orders(outlines: Sequence[Outline]) -> list[Outline]:
    """Let all quads begin at the same corner: near a roll of 45 degrees each alone may err."""
    quads = [k for k, o in enumerate(outlines) if o.corners_px is not None]
    result = list(outlines)
    if len(quads) < 2:
        return result
    across = _across(np.stack([np.asarray(outlines[k].corners_px) for k in quads]))
    # Directions but for quarter turns; their mean, and of its four the one nearest to +x.
    base = np.angle((across**4).sum()) / 4
    for k, turned in zip(quads, across, strict=True):
        quarter = round(float(np.angle(turned) - base) / (np.pi / 2)) % 4
        if quarter:
            outline = outlines[k]
            assert outline.corners_px is not None
            top, right, bottom, left = np.roll(outline.seen, quarter).tolist()
            result[k] = replace(
                outline,
                corners_px=np.roll(outline.corners_px, quarter, axis=0),
                seen=(top, right, bottom, left),
            )
    return result


def _across(corners: FloatArray) -> npt.NDArray[np.complex128]:
    """Mean direction (n,) of all sides of quads (n, 4, 2), of length 1.

    Those that run down are turned back by 90 degrees.
    """
    x, y = corners.transpose(2, 1, 0)
    c = x + 1j * y

    def unit(z: npt.NDArray[np.complex128]) -> npt.NDArray[np.complex128]:
        return np.asarray(z / np.maximum(np.abs(z), 1e-12))

    return unit(unit(c[1] - c[0] + c[2] - c[3]) + unit((c[3] - c[0] + c[2] - c[1]) / 1j))


def at_odds(outlines: Sequence[Outline]) -> list[int]:
    """Indices of quads whose rows run another way than those of most others."""
    quads = [k for k, o in enumerate(outlines) if o.corners_px is not None]
    if len(quads) < 2:
        return []
    corners = np.array([outlines[k].corners_px for k in quads])
    x, y = (corners[:, 1] - corners[:, 0] + corners[:, 2] - corners[:, 3]).T
    turn = np.arctan2(y, x)
    apart = np.abs((turn[:, None] - turn + np.pi) % (2 * np.pi) - np.pi)
    reference = int((apart < APART_RAD).sum(axis=1).argmax())
    return [k for k, off in zip(quads, apart[reference], strict=True) if off > APART_RAD]


def doubles(outlines: Sequence[Outline]) -> list[int]:
    """Indices of outlines that are of a button which a surer one is of, too."""
    if len(outlines) < 2:
        return []
    x0, y0, x1, y1 = np.array([o.box_px for o in outlines]).T
    x, y, size = (x0 + x1) / 2, (y0 + y1) / 2, np.sqrt((x1 - x0) * (y1 - y0))
    apart = np.maximum(np.abs(x[:, None] - x), np.abs(y[:, None] - y))
    same = apart < SAME * np.minimum(size[:, None], size)
    if np.count_nonzero(same) == len(outlines):  # each with itself
        return []
    kept: list[int] = []
    dropped: list[int] = []
    for k in sorted(range(len(outlines)), key=lambda k: -outlines[k].confidence):
        (dropped if same[k, kept].any() else kept).append(k)
    return dropped
