"""The labels of a panel as a whole: floors count on along rows and columns, and none is twice."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

from fronto.labels.belief import Belief, best, combined, rest
from fronto.labels.layout import Grid
from fronto.labels.series import Floor, floor_of, is_floor, label_key

__all__ = ["in_order", "once_only"]

#: Distances to two neighbours that differ by less than this share are one pitch.
EVEN = 0.25
#: What a vote for a floor is worth (logarithm of odds), by the step from floor to floor; measured
#: on the labels of 1,388 photos of panels. Of both neighbours in a column, in a row;
BETWEEN_COLUMN = {1: 5.0, 2: 3.3, 3: 2.7, 4: 1.7}
BETWEEN_ROW = {1: 5.0}
#: of two one behind the other;
BEYOND_COLUMN = {1: 1.6, 2: 1.1, 3: 0.8}
BEYOND_ROW = {1: 2.2}
#: of three that are the corners of a rectangle with this button.
CORNER = 2.0
#: Against this, that a button beside floors is none that they speak for.
NONE_OF_THEM = 0.3
#: Of what neighbours say, so much counts: at most it changes the odds of a label 30-fold. Floors
#: are skipped, and readings are seen.
PULL = 0.37
ROUNDS = 2
#: Nobody is surer than this of a floor: two that are equally sure of one are to be undecided.
SUREST = 0.9995
#: A floor is filled in where both neighbours of a row or column are surer of theirs than this,
#: their vote is worth this at least, and the reading gives all other labels less than this.
SURE, WORTH, AGAINST = 0.9, 2.5, 0.5


def in_order(beliefs: Sequence[Belief], grid: Grid) -> tuple[dict[str, float], ...]:
    """Weigh the readings of a panel's buttons by what their neighbours have.

    Floors in rows and columns mostly count on by equal steps: a floor that the neighbours
    speak for gains, at the cost of others. No floor is there twice: where several buttons
    claim one, each is as likely to have it as its odds among theirs; two equally sure ones end
    below one half. A button whose reading says little, between two that are sure and leave one
    floor only, gets that. What is no floor is left alone.

    Parameters
    ----------
    beliefs
        What each button's label may be, by itself.
    grid
        Their neighbours.

    Returns
    -------
    What each button's label may be, all things considered.
    """
    around = [_Around.of(grid, k) for k in range(len(beliefs))]
    now = once_only(beliefs)
    for _ in range(ROUNDS):
        floors = _floors(now)
        pulled = [_pulled(b, a.expect(floors)) for b, a in zip(beliefs, around, strict=True)]
        now = once_only(pulled)
    return tuple(_filled(now, beliefs, around))


#: Each button's likeliest label with its probability, where that counts on; else None.
_Floors = Sequence[tuple[Floor, float] | None]


def _floors(beliefs: Sequence[Belief], least: float = 0.0) -> _Floors:
    """The floors of the buttons that are at least so sure of theirs."""
    return [
        (floor, p) if p >= least and (floor := floor_of(label)) is not None else None
        for label, p in map(best, beliefs)
    ]


class _Around(NamedTuple):
    """Where a button is among others, and what their floors say of it.

    Parameters
    ----------
    between
        Neighbours on both sides, at one distance; what their vote is worth by the step.
    beyond
        The nearest and the next on one side, likewise.
    corners
        Beside it, above or below it, and the fourth corner of the rectangle.
    """

    between: list[tuple[int, int, Mapping[int, float]]]
    beyond: list[tuple[int, int, Mapping[int, float]]]
    corners: list[tuple[int, int, int]]

    @classmethod
    def of(cls, grid: Grid, button: int) -> _Around:
        """Look around a button."""
        lines = [grid.line(button, d, 2) for d in range(4)]
        left, right, above, below = (line[:1] for line in lines)
        both = ((left + right, BETWEEN_ROW), (above + below, BETWEEN_COLUMN))
        worths = (BEYOND_ROW, BEYOND_ROW, BEYOND_COLUMN, BEYOND_COLUMN)
        corners = []
        for across in (line[0] for line in lines[:2] if line):
            for d, along in ((d, line[0]) for d, line in enumerate(lines) if d > 1 and line):
                corner = int(grid.next_to[across, d])
                if corner >= 0 and corner in grid.next_to[along, :2]:
                    corners.append((across, along, corner))
        return cls(
            between=[
                (pair[0], pair[1], worth)
                for pair, worth in both
                if len(pair) == 2 and _even(grid, pair[0], button, pair[1])
            ],
            beyond=[
                (line[0], line[1], worth)
                for line, worth in zip(lines, worths, strict=True)
                if len(line) == 2 and _even(grid, button, *line)
            ],
            corners=corners,
        )

    def expect(self, floors: _Floors) -> dict[str, float]:
        """Floors that the neighbours speak for, with probabilities."""
        votes: dict[Floor, float] = {}
        for floor, worth in (*self.halfway(floors), *self.counted_on(floors)):
            votes[floor] = votes.get(floor, 0.0) + worth
        odds = {floor.label: math.exp(worth) - 1 for floor, worth in votes.items()}
        total = sum(odds.values()) + math.exp(NONE_OF_THEM)
        return {label: value / total for label, value in odds.items()}

    def halfway(self, floors: _Floors) -> Iterator[tuple[Floor, float]]:
        """The floor halfway between both neighbours, in the row and in the column; its worth."""
        for one, other, worth in self.between:
            found, sure = _series(floors, one, other)
            if found:
                step, odd = divmod(abs(found[0].number - found[1].number), 2)
                if not odd and step in worth:
                    middle = (found[0].number + found[1].number) // 2
                    yield found[0].at(middle), worth[step] * sure

    def counted_on(self, floors: _Floors) -> Iterator[tuple[Floor, float]]:
        """Floors that two in a line count on to, or three corners complete; their worth."""
        for near, far, worth in self.beyond:
            found, sure = _series(floors, near, far)
            if found:
                step = found[0].number - found[1].number
                if abs(step) in worth:
                    yield found[0].at(found[0].number + step), worth[abs(step)] * sure
        for corner in self.corners:
            found, sure = _series(floors, *corner)
            if found:
                f, g, h = found
                yield f.at(f.number + g.number - h.number), CORNER * sure


def _even(grid: Grid, one: int, other: int, third: int) -> bool:
    """Whether three in a line are equally far from each other."""
    gaps = grid.gap(one, other), grid.gap(other, third)
    return abs(gaps[0] - gaps[1]) <= EVEN * max(gaps)


def _series(floors: _Floors, *buttons: int) -> tuple[list[Floor], float]:
    """The floors of buttons, if these are different ones that count on; how sure all are."""
    known = [one for k in buttons if (one := floors[k]) is not None]
    found = [floor for floor, _ in known]
    if len(set(found)) < len(buttons) or not all(f.counts_with(found[0]) for f in found):
        return [], 0.0
    return found, math.prod(p for _, p in known)


def _pulled(belief: Belief, expected: Belief) -> dict[str, float]:
    """A reading, and what its neighbours let expect."""
    pull: dict[str, float] = {}
    for label, probability in expected.items():
        # The star of the way out does not make another floor.
        for own in [own for own in belief if label_key(own) == label] or [label]:
            pull[own] = PULL * probability
    return combined(belief, pull)


def once_only(beliefs: Sequence[Belief]) -> list[dict[str, float]]:
    """Let each floor be on one button: as likely on each as its odds among those of all.

    Of independent claims with probabilities p, of which one at most is true, each is with
    o / (1 + Σ o), o = p / (1 - p).
    """
    result = [dict(belief) for belief in beliefs]
    claims: dict[str, list[tuple[int, str]]] = {}
    for k, belief in enumerate(beliefs):
        for label in belief:
            if is_floor(label):
                claims.setdefault(label_key(label), []).append((k, label))
    contested = [claim for claim in claims.values() if len({k for k, _ in claim}) > 1]
    settled: set[str] = set()
    # The most claimed floor first: who does not get it claims the next with what is left.
    for claim in sorted(contested, key=lambda claim: -sum(beliefs[k][own] for k, own in claim)):
        odds = [p / (1 - p) for p in (min(result[k][own], SUREST) for k, own in claim)]
        settled |= {own for _, own in claim}
        for (k, own), odd in zip(claim, odds, strict=True):
            _lower(result[k], own, odd / (1 + sum(odds)), settled)
    return result


def _lower(belief: dict[str, float], label: str, probability: float, settled: set[str]) -> None:
    """Take from a label; what it leaves goes to those not settled and to what is not named."""
    others = [other for other in belief if other not in settled]
    free = rest(belief) + sum(belief[other] for other in others)
    taken = max(0.0, belief[label] - probability)
    for other in others:
        belief[other] *= 1 + taken / free if free > 0 else 1.0
    belief[label] -= taken


def _filled(
    beliefs: Sequence[dict[str, float]], readings: Sequence[Belief], around: Sequence[_Around]
) -> Iterator[dict[str, float]]:
    """Give floors to buttons whose reading says little, between two that leave one only."""
    holders = {label_key(label): k for k, (label, p) in enumerate(map(best, beliefs)) if p > 0.5}
    sure = _floors(beliefs, SURE)
    for k, (belief, reading) in enumerate(zip(beliefs, readings, strict=True)):
        if best(belief)[1] < SURE:
            votes = [*around[k].halfway(sure)]
            named = {floor for floor, _ in (*votes, *around[k].counted_on(sure))}
            worth = max((worth for _, worth in votes), default=0.0)
            if worth >= WORTH and len(named) == 1:
                label = named.pop().label
                against = sum(p for own, p in reading.items() if label_key(own) != label)
                if against < AGAINST and holders.get(label, k) == k:
                    belief = combined({label: around[k].expect(sure)[label]}, reading)
                    holders[label] = k
        yield belief
