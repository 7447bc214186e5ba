"""The distance of a panel from the size of its buttons."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fronto.metric.known import KnownLength
from fronto.metric.seen import Measured, Seen, UnfitLength, no_rays, on_plane
from fronto.pose.structure import chains
from fronto.shapes import FloatArray

__all__ = ["by_size"]

#: Of a size, relative, where nothing is stated: outlines follow the cap or the rim around it.
SIZE_STD = 0.05
#: Sizes whose logarithms differ by less than this are one; so far a size may be from square
#: where one number is given for both.
SAME_SIZE = 0.1
#: ... and as many deviations of the ratio, where that is more.
DEVIATIONS = 3.0


def by_size(known: KnownLength, seen: Seen) -> Measured:
    """By the size that most buttons have, as of `measure`."""
    assert known.button_size_m is not None
    members = _commonest_size(seen)
    logs = np.log(seen.sizes[members])
    given = known.button_size_m
    shape = float((logs[:, 0] - logs[:, 1]).mean())
    limit = max(SAME_SIZE, DEVIATIONS * (seen.pose.aspect_std or 0.0))
    if isinstance(given, float):
        if abs(shape) > limit:
            raise UnfitLength(
                "button_size_m",
                f"expected (width, height), as buttons are {np.exp(shape):.2g} times as wide as "
                "high, got one number",
                "give both",
            )
        size, text = np.array([given, given]), f"{1e3 * given:g} mm"
    else:
        size, text = np.array(given), f"{1e3 * given[0]:g} x {1e3 * given[1]:g} mm"
        off = float(np.log(size[0] / size[1])) - shape
        # In a photo turned by 40° or more widths may be read as heights.
        if min(abs(off), abs(off + 2 * shape)) > limit:
            raise UnfitLength(
                "button_size_m",
                f"expected (width, height) of the photo's buttons, got {np.exp(off):.2g} times "
                "their ratio",
                "check that it is of this panel",
            )
    corners = np.concatenate(
        [seen.pose.plane_corners[members], np.ones((len(members), 4, 1))], axis=2
    )
    rays = corners @ seen.pose.rotation

    def log_distance(rotation: FloatArray, log_focal: float) -> float:
        c = on_plane(rays, rotation, log_focal)
        across = np.linalg.norm(c[:, [1, 2]] - c[:, [0, 3]], axis=2)
        down = np.linalg.norm(c[:, [3, 2]] - c[:, [0, 1]], axis=2)
        return float(np.log(size).mean() - 0.5 * (np.log(across).mean() + np.log(down).mean()))

    stated = SIZE_STD if known.std_m is None else known.std_m / float(np.exp(np.log(size).mean()))
    # A mask that is too large is so at every button: nothing of it averages out.
    extent = np.sqrt(_area(rays / rays[..., 2:]))
    sigma = np.array([2.0 if _quad(seen, int(k)) else 1.0 for k in members]) * seen.ray_std[members]
    outlined = float(np.median(np.sqrt(2) * sigma / extent))
    count = f"{len(members)} button" + ("s" if len(members) > 1 else "")
    basis = f"a button size of {text} ({count})"
    return Measured(log_distance, no_rays(seen), stated**2 + outlined**2, basis)


def _area(corners: FloatArray) -> FloatArray:
    """Of quads (n, 4, ...) by their first two coordinates."""
    first, second = corners[:, 2] - corners[:, 0], corners[:, 3] - corners[:, 1]
    return np.asarray(0.5 * np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]))


def _quad(seen: Seen, k: int) -> bool:
    return seen.outlines is None or seen.outlines[k].shape == "quad"


def _commonest_size(seen: Seen) -> npt.NDArray[np.intp]:
    """Indices of the buttons of the size that most have."""
    whole = seen.usable.copy()
    labels = np.zeros(len(whole), dtype=np.intp)
    if seen.outlines is not None:
        whole &= [not (o.truncated or o.odd) and all(o.seen) for o in seen.outlines]
        labels += [o.shape == "ellipse" for o in seen.outlines]
    if not whole.any():
        raise UnfitLength(
            "button_size_m",
            "expected at least one whole button that fits the others, found none",
            "give the pitch or a distance instead",
        )
    members = np.flatnonzero(whole)
    labels = labels[members]
    for logs in np.log(seen.sizes[members]).T:
        labels = labels * len(members) + chains(logs, SAME_SIZE)
    names, counts = np.unique(labels, return_counts=True)
    largest = np.flatnonzero(counts == counts.max())
    if len(largest) > 1:
        raise UnfitLength(
            "button_size_m",
            f"expected buttons of which most have one size, found {len(largest)} sizes equally "
            "often",
            "give the pitch or a distance instead",
        )
    return np.asarray(members[labels == names[largest[0]]])
