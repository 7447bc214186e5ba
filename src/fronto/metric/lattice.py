"""The pitch of a panel: how far apart neighbouring buttons' centres are along rows and columns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fronto.pose.structure import ALIGN_GAP, chains
from fronto.shapes import FloatArray

__all__ = ["Pitch", "find_pitch"]

#: Distances whose logarithms differ by less than this are one pitch.
SAME = 0.04
#: Noise makes it more, but not so that other pitches are taken for the same.
MOST = 0.12
#: This share of all neighbours has to have it.
MIN_SHARE = 0.5


@dataclass(frozen=True, eq=False)
class Pitch:
    """A distance that neighbours in rows, or in columns, have in common.

    Parameters
    ----------
    value
        The distance, in units of the centres.
    std
        Its standard deviation as the distances' spread tells it; 0 where nothing is to spare.
    pairs
        How many neighbours it was taken from.
    coefficients
        Shape (n,): `value` is their product with the centres' coordinates along the axis.
    """

    value: float
    std: float
    pairs: int
    coefficients: FloatArray


def find_pitch(
    centers: FloatArray,
    width: float,
    axis: int,
    usable: npt.NDArray[np.bool_],
    center_std: float = 0.0,
) -> Pitch | None:
    """Find the distance that most neighbours along one axis have.

    Each row (column) is cut into runs of neighbours that far apart; one line is fitted to
    all runs, which uses their whole length and not only single distances.

    Parameters
    ----------
    centers
        Shape (n, 2), on the panel's plane, x along the rows and y along the columns.
    width
        Of a typical button: what is nearer than a third of it across is in one row.
    axis
        0: along the rows; 1: along the columns.
    usable
        Shape (n,): which buttons count.
    center_std
        Standard deviation of a centre's coordinates: what distances differ by is no other
        pitch where it is noise.

    Returns
    -------
    The pitch; None without neighbours, or where their distances have little in common.
    """
    rows = _rows(centers, width, axis, usable)
    along = centers[:, axis]
    gaps = np.concatenate([np.zeros(0), *(np.diff(along[row]) for row in rows)])
    if not len(gaps):
        return None
    noise = 3 * np.sqrt(2) * center_std / max(float(np.median(gaps)), np.finfo(float).tiny)
    same = min(max(SAME, noise), MOST)
    pitch = _commonest(gaps, same)
    runs = [run for row in rows for run in _runs(row, along, pitch, same)]
    pairs = sum(len(run) - 1 for run in runs)
    if pairs < MIN_SHARE * len(gaps):
        return None
    steps = np.zeros(len(centers))
    for run in runs:
        steps[run] = np.arange(len(run)) - (len(run) - 1) / 2
    coefficients = steps / (steps @ steps)
    value = float(coefficients @ along)
    left = np.concatenate([along[run] - along[run].mean() - value * steps[run] for run in runs])
    freedom = pairs - 1
    variance = float(left @ left) / freedom / float(steps @ steps) if freedom else 0.0
    coefficients.setflags(write=False)
    return Pitch(value, float(np.sqrt(variance)), pairs, coefficients)


def _rows(
    centers: FloatArray, width: float, axis: int, usable: npt.NDArray[np.bool_]
) -> list[npt.NDArray[np.intp]]:
    """Indices of the buttons of each row (column), in order along it."""
    members = np.flatnonzero(usable)
    labels = chains(centers[members, 1 - axis], ALIGN_GAP * width)
    rows = [members[labels == label] for label in range(int(labels.max(initial=-1)) + 1)]
    return [row[centers[row, axis].argsort(kind="stable")] for row in rows]


def _commonest(gaps: FloatArray, same: float) -> float:
    """The distance that most have about; of several the shortest, as longer ones skip buttons."""
    logs = np.sort(np.log(np.maximum(gaps, np.finfo(float).tiny)))
    alike = np.abs(logs[:, None] - logs) < same
    return float(np.exp(np.median(logs[alike[int(alike.sum(axis=1).argmax())]])))


def _runs(
    row: npt.NDArray[np.intp], along: FloatArray, pitch: float, same: float
) -> list[npt.NDArray[np.intp]]:
    """Parts of a row in which neighbours are one pitch apart."""
    ratio = np.maximum(np.diff(along[row]), np.finfo(float).tiny) / pitch
    cuts = np.flatnonzero(np.abs(np.log(ratio)) >= same) + 1
    return [run for run in np.split(row, cuts) if len(run) > 1]
