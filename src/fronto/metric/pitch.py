"""The distance of a panel from the pitch of its buttons."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np

from fronto.metric.known import KnownLength
from fronto.metric.lattice import Pitch, find_pitch
from fronto.metric.seen import Measured, Seen, UnfitLength, linear, ray_variance
from fronto.shapes import FloatArray

__all__ = ["by_pitch"]

#: One pitch is given, but rows and columns have two: logarithms that differ by less than the
#: first are one (or by less than three deviations of theirs), by more than the second are not.
ONE_PITCH, TWO_PITCHES = 0.02, 0.06
#: Two given pitches contradict the panel: the distances' logarithms differ by more than this,
#: and by this many deviations.
CONTRADICTION, DEVIATIONS = 0.05, 4.0
#: In a photo that is rolled by more than this rows may be read as columns.
ROLLED_DEG = 35.0
EXCHANGED = "the pitches fit with rows and columns exchanged: the photo is rolled by much"


@dataclass(frozen=True, eq=False)
class _Axis:
    """A known pitch along one axis, and the one that is seen."""

    axis: int
    length_m: float
    pitch: Pitch

    @property
    def words(self) -> str:
        return f"{1e3 * self.length_m:g} mm {('to the right', 'down')[self.axis]}"

    @property
    def information(self) -> float:
        """How exactly one line through all runs tells the pitch's logarithm, relative."""
        c = self.pitch.coefficients
        return self.pitch.value**2 / float(c @ c)

    def measured(self, seen: Seen) -> Measured:
        coefficients = np.zeros((len(seen.rays), 2))
        coefficients[:, self.axis] = self.pitch.coefficients
        part = linear(seen, coefficients, self.length_m)
        # Where the distances are spread by more than their own noise, they do differ.
        spread = (self.pitch.std / self.pitch.value) ** 2
        return replace(part, variance=max(spread - ray_variance(part, seen), 0.0))


def by_pitch(known: KnownLength, seen: Seen) -> Measured:
    """By how far apart neighbours in rows and columns are, as of `measure`."""
    given = known.pitch_m
    assert given is not None
    found = [_pitch(seen, axis) for axis in range(2)]
    if isinstance(given, float):
        return _measured((given, given), found, seen, known.std_m, one=True)
    roll = np.degrees(np.arctan2(seen.pose.rotation[0, 1], seen.pose.rotation[0, 0]))
    rolled = abs(roll) > ROLLED_DEG
    if rolled and None in given and None not in found:
        raise UnfitLength(
            "pitch_m",
            f"expected (right, down), as the photo is rolled by {abs(roll):.0f}°, which may "
            "exchange rows and columns, got one of them",
            "give both, or turn the photo",
        )
    try:
        return _measured(given, found, seen, known.std_m)
    except UnfitLength as error:
        if rolled and None not in given:
            with suppress(UnfitLength):
                exchanged = _measured(given[::-1], found, seen, known.std_m)
                return replace(exchanged, notes=(EXCHANGED,))
        raise error


def _measured(
    lengths: tuple[float | None, ...],
    found: Sequence[Pitch | None],
    seen: Seen,
    std_m: float | None,
    *,
    one: bool = False,
) -> Measured:
    """By the lengths along the rows and the columns; `one` where they are one number."""
    axes = [
        _Axis(k, length, pitch)
        for k, (length, pitch) in enumerate(zip(lengths, found, strict=True))
        if length is not None and pitch is not None
    ]
    if not axes:
        raise UnfitLength(
            "pitch_m",
            "expected neighbouring buttons of which most are one distance apart, found none",
            "give the size of a button or a distance instead",
        )
    pairs = sum(axis.pitch.pairs for axis in axes)
    basis = f"a pitch of {' and '.join(axis.words for axis in axes)} ({pairs} pair"
    basis += "s)" if pairs > 1 else ")"
    parts = [axis.measured(seen) for axis in axes]
    share = np.array([axis.information for axis in axes])
    share = share / share.sum()
    stated = np.array([(std_m or 0.0) / axis.length_m for axis in axes])
    # One number that is wrong is wrong both ways.
    extra = float((share @ stated) ** 2 if one else share**2 @ stated**2)
    if len(parts) == 2:
        extra += _compared(parts[0], parts[1], seen, one, float(stated @ stated))
    return _weighed(parts, share, extra, basis)


def _weighed(parts: list[Measured], share: FloatArray, extra: float, basis: str) -> Measured:
    """The mean of distances' logarithms, by their shares."""

    def log_distance(rotation: FloatArray, log_focal: float) -> float:
        return float(share @ [part.log_distance(rotation, log_focal) for part in parts])

    gradient = sum(s * part.ray_gradient for s, part in zip(share, parts, strict=True))
    variance = sum(s**2 * part.variance for s, part in zip(share, parts, strict=True)) + extra
    return Measured(log_distance, np.asarray(gradient), float(variance), basis)


def _pitch(seen: Seen, axis: int) -> Pitch | None:
    if not seen.usable.any():
        return None
    width = float(np.median(seen.sizes[seen.usable, 0]))
    # On the plane at depth 1 a ray's deviation is about the point's.
    std = float(np.median(seen.ray_std[seen.usable]))
    return find_pitch(seen.centers, width, axis, seen.usable, std)


def _compared(across: Measured, down: Measured, seen: Seen, one: bool, stated: float) -> float:
    """Variance that two pitches' disagreement adds; refuse where they contradict each other."""
    rotation = seen.pose.rotation
    off = across.log_distance(rotation, 0.0) - down.log_distance(rotation, 0.0)
    gradient = across.gradient(rotation) - down.gradient(rotation)
    variance = float(gradient @ seen.covariance @ gradient) + across.variance + down.variance
    variance += ray_variance(across, seen) + ray_variance(down, seen)
    variance += 0.0 if one else stated
    std = float(np.sqrt(variance)) if np.isfinite(variance) else 0.0
    ratio = float(np.exp(-off))
    if one:
        if abs(off) > min(max(ONE_PITCH, 3 * std), TWO_PITCHES):
            raise UnfitLength(
                "pitch_m",
                f"expected (right, down), as neighbours are {ratio:.3g} times as far apart to the "
                "right as down, got one number",
                "give both, or None for the one that is not known",
            )
        return max(off**2 - std**2, 0.0) / 4
    if abs(off) > max(CONTRADICTION, DEVIATIONS * std):
        raise UnfitLength(
            "pitch_m",
            f"expected (right, down) of the photo's panel, got {1 / ratio:.3g} times the ratio "
            "that is seen",
            "check the order of the two, and that they are of this panel",
        )
    return 0.0
