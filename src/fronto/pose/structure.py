"""What buttons of a panel share: sizes in groups, rows and columns, found on the plane."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from fronto.pose.bundle import (
    FIRST_GROUP,
    FOCAL,
    MAX_GLOBALS,
    QUAD,
    Model,
    Observations,
    Solution,
    back_project,
)
from fronto.pose.starts import middle
from fronto.shapes import FloatArray

GroupArray = npt.NDArray[np.intp]

__all__ = ["base_model", "chains", "lattice_groups", "numbered", "size_groups", "tied_model"]

#: Standard deviation of log(width/height) of buttons known to be square.
SQUARE_STD = 0.01
#: Deviation of the distance of two buttons from their common row or column, in widths.
ALIGN_STD = 0.006
#: Neighbours closer than this across a row or column are on the same one, in widths.
ALIGN_GAP = 0.35
#: Sizes that differ by less than this (logarithm), or by this many of their deviations,
#: are one.
SIZE_GAP, SIZE_DEVIATIONS = 0.1, 4.0
#: Smallest deviation of a tie, in units of the pivot's depth.
TINY = 1e-9


def base_model(seen: Observations, group: GroupArray, square: bool, focal_isd: float) -> Model:
    """The model before rows and columns are known: sizes shared within each group.

    Parameters
    ----------
    group
        (n,): each button's size group, 0, 1, ...
    square
        The quads are known to be square.
    focal_isd
        1/σ of ln(f/f0); negative where the focal length is known.
    """
    n = len(seen.kind)
    groups = int(group.max()) + 1
    square_isd = np.zeros(groups)
    if square:
        square_isd[group[seen.kind == QUAD]] = 1 / SQUARE_STD
    return Model(
        group=group.astype(np.intc),
        square_isd=square_isd,
        oval=np.zeros(groups, dtype=np.intc),
        tie_index=np.full((n, 4), -1, dtype=np.intc),
        tie_coef=np.zeros((n, 4)),
        tie_isd=np.zeros((n, 2)),
        latents=0,
        size_scale=np.zeros((groups, 2)),
        focal_isd=focal_isd,
    )


def chains(values: FloatArray, gap: float) -> GroupArray:
    """Label values (n,) so that sorted neighbours closer than `gap` share a label."""
    order = values.argsort(kind="stable")
    ordered = values[order]
    labels = np.zeros(len(values), dtype=np.intp)
    labels[order[1:]] = (ordered[1:] - ordered[:-1] > gap).cumsum()
    return labels


def typical_width(model: Model, solution: Solution) -> float:
    """Median width of the buttons, in units of the pivot's depth."""
    widths = solution.parameters[FIRST_GROUP : FIRST_GROUP + 2 * len(model.square_isd) : 2]
    return float(np.exp(middle(widths[model.group])))


def tied_model(model: Model, xy: FloatArray, width: float, axes: Sequence[int] = (0, 1)) -> Model:
    """Tie buttons of one column to a common x and of one row to a common y.

    Parameters
    ----------
    xy
        (n, 2): where the buttons are, from the pivot, in units of its depth.
    width
        Of a typical button, in the same units.
    axes
        0: tie columns, 1: tie rows.
    """
    n = len(model.group)
    tie_index = np.full((n, 4), -1, dtype=np.intc)
    tie_coef, tie_isd = np.zeros((n, 4)), np.zeros((n, 2))
    latents = 0
    room = MAX_GLOBALS - model.size
    for axis in axes:
        labels = chains(xy[:, axis], ALIGN_GAP * width)
        sizes = np.bincount(labels)
        # A row of one ties nothing.
        latent = np.cumsum(sizes > 1) - 1 + latents
        latent[(sizes < 2) | (latent >= room)] = -1
        tie_index[:, 2 * axis] = latent[labels]
        tied = tie_index[:, 2 * axis] >= 0
        tie_coef[tied, 2 * axis] = 1.0
        # A size group that has run off leaves no width to measure by.
        tie_isd[tied, axis] = np.sqrt(2) / max(ALIGN_STD * width, TINY)
        latents = int(max(latents, latent.max() + 1))
    return replace(model, tie_index=tie_index, tie_coef=tie_coef, tie_isd=tie_isd, latents=latents)


def size_groups(seen: Observations, solution: Solution, model: Model) -> GroupArray:
    """Group label of each button (n,): same family and, on the plane, about the same size.

    Wide OPEN and CLOSE buttons beside square floor buttons are two groups; one shared
    size would bend the pose.
    """
    scale = float(np.exp(solution.parameters[FOCAL]))
    _, log_size, _ = back_project(seen, solution.rotation[None], scale)
    sizes = log_size[0]
    family = seen.family
    same = (family == family[0]).all()
    if same and (sizes.max(axis=0) - sizes.min(axis=0) < SIZE_GAP).all():
        return np.zeros(len(sizes), dtype=np.intp)
    # A corner's deviation over the size is the logarithm's; tangents carry twice theirs.
    reach = np.exp(sizes.mean(axis=1))
    deviation = 1.0 / (np.maximum(seen.inverse_sd[:, :4].max(axis=1), 1e-9) * reach)
    gap = np.maximum(SIZE_GAP, SIZE_DEVIATIONS * float(middle(deviation)))
    labels = family
    for axis in range(2):
        labels = labels * len(sizes) + chains(sizes[:, axis], gap)
    return numbered(labels)


def lattice_groups(seen: Observations, model: Model) -> list[GroupArray]:
    """Groupings in which each column, or each row, has a size of its own."""
    groupings = []
    for axis in range(2):
        labels = model.tie_index[:, 2 * axis].astype(np.intp)
        alone = labels < 0
        labels[alone] = labels.max() + 1 + np.arange(np.count_nonzero(alone))
        group = numbered(labels * (seen.family.max() + 1) + seen.family)
        if 1 < group.max() + 1 < len(group):
            groupings.append(group)
    return groupings


def numbered(labels: npt.NDArray[Any]) -> GroupArray:
    """The same partition with labels 0, 1, ..."""
    if (labels == labels[0]).all():
        return np.zeros(len(labels), dtype=np.intp)
    return np.asarray(np.unique(labels, return_inverse=True)[1], dtype=np.intp)
