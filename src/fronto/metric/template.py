"""The distance of a panel from its layout."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from fronto.errors import InputError
from fronto.metric.known import KnownLength
from fronto.metric.seen import Measured, Seen, UnfitLength, linear, ray_variance
from fronto.pose.template import MISPLACED, match_template
from fronto.shapes import Outline

__all__ = ["by_solved", "by_template"]


def by_template(known: KnownLength, seen: Seen, labels: tuple[str, ...]) -> Measured:
    """By the places of a known layout, as of `measure`."""
    assert known.template is not None
    named = _named(seen, labels)
    try:
        matched = match_template(known.template, named)
    except InputError as error:
        raise UnfitLength(error.thing, error.expected, error.remedy) from None
    members = [k for k, b in enumerate(matched) if b is not None and seen.usable[k]]
    mm = np.array([(b.x_mm, b.y_mm) for k in members if (b := matched[k]) is not None])
    spread = mm.reshape(-1, 2) - mm.reshape(-1, 2).mean(axis=0) if members else np.zeros((0, 2))
    if len(members) < 2 or not spread.any():
        raise UnfitLength(
            "template",
            "expected two of its buttons at different places that fit the others, found fewer",
            "give the outlines' texts, or another template",
        )
    coefficients = np.zeros((len(seen.rays), 2))
    coefficients[members] = spread / (spread**2).sum()
    centers = seen.centers[members]
    scale = float((coefficients[members] * centers).sum())
    off = centers - centers.mean(axis=0) - scale * spread
    width = float(np.median(seen.sizes[members, 0]))
    if scale <= 0 or np.abs(off).max() > MISPLACED * width:
        worst = members[int(np.abs(off).max(axis=1).argmax())]
        raise UnfitLength(
            "template",
            f"expected the photo's panel, got one in which button {worst} is elsewhere",
            "check that it is this panel's, and the labels",
        )
    part = linear(seen, coefficients, 1e-3)
    freedom = off.size - 3
    spread_variance = float((off**2).sum()) / freedom / float((spread**2).sum()) / scale**2
    variance = max(spread_variance - ray_variance(part, seen), 0.0)
    if known.std_m is not None:
        variance += (1e3 * known.std_m) ** 2 / float((spread**2).sum())
    return replace(part, variance=variance, basis=f"a template ({len(members)} buttons)")


def _named(seen: Seen, labels: tuple[str, ...]) -> list[Outline]:
    """Outlines with the labels as their texts; without outlines, stand-ins for their number."""
    if seen.outlines is None:
        return [Outline.ellipse(0, 0, 1, 1) for _ in seen.rays]
    return [
        replace(outline, text=label or outline.text)
        for outline, label in zip(seen.outlines, labels, strict=True)
    ]


def by_solved(seen: Seen) -> Measured:
    """By the template that the pose was solved with, which tells the plane's distance."""
    depth = seen.pose.plane_depth_m
    assert depth is not None
    spread = seen.centers - seen.centers.mean(axis=0)
    # The extent of all centres, in its own units 1, is what the rotation changes.
    part = linear(seen, spread / (spread**2).sum(), depth)
    return replace(part, basis="the template that the pose was solved with")
