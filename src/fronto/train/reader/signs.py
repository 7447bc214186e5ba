"""Signs in endless variety: arrows, doors, bells, telephones, crosses and keys, each drawn anew.

A handful of fixed drawings would be learnt as such, and every maker has another bell.
"""

from __future__ import annotations

from collections.abc import Callable

import cv2
import numpy as np

from fronto.synth.photo.draws import chance, pick, whole
from fronto.synth.photo.glyphs import SIZE, Bits, Pen

__all__ = ["SIGNED", "random_sign"]

Point = tuple[float, float]


def random_sign(kind: str, rng: np.random.Generator) -> Bits:
    """Draw a sign of a kind, one of `SIGNED`.

    Returns
    -------
    Coverage, shape (96, 96), 0 to 255.
    """
    pen = Pen(thick=rng.uniform(0.06, 0.2))
    SIGNED[kind](pen, rng)
    image = cv2.resize(pen.image, (SIZE, SIZE), interpolation=cv2.INTER_AREA)
    return np.asarray(image, np.uint8)


def _shape(pen: Pen, points: list[Point], filled: bool) -> None:
    if filled:
        pen.fill(points)
    else:
        pen.line(points, closed=True)


def _turned(points: list[Point], angle: float) -> list[Point]:
    c, s = float(np.cos(angle)), float(np.sin(angle))
    return [(u * c - v * s, u * s + v * c) for u, v in points]


def _head(rng: np.random.Generator, wide: float, tip: float, base: float) -> list[Point]:
    """An arrow's head upwards, its base straight or drawn in."""
    notch = pick(rng, (0.0, rng.uniform(0.05, 0.35)), (3, 1)) * (base - tip)
    return [(0, tip), (wide, base), (0, base - notch), (-wide, base)]


def _up(pen: Pen, rng: np.random.Generator) -> None:
    wide, tip, base = rng.uniform(0.3, 0.85), -rng.uniform(0.35, 0.9), rng.uniform(0.2, 0.85)
    filled = chance(rng, 0.7)
    form = pick(rng, ("triangle", "arrow", "chevron", "line", "tree"), (4, 3, 2, 1, 0.5))
    if form == "triangle":
        _shape(pen, _head(rng, wide, tip, base), filled)
    elif form == "arrow":
        neck, stem = tip + rng.uniform(0.4, 0.65) * (base - tip), rng.uniform(0.25, 0.6) * wide
        head: list[Point] = [(0, tip), (wide, neck), (stem, neck), (stem, base)]
        _shape(pen, [*head, *((-u, v) for u, v in reversed(head[1:]))], filled)
    elif form == "chevron":
        for step in range(1 + chance(rng, 0.25)):
            low, high = base - 0.4 * step, tip + 0.4 * (1 - step) * chance(rng, 0.5)
            pen.line([(-wide, low), (0, high), (wide, low)])
    elif form == "line":
        neck = tip + rng.uniform(0.25, 0.5) * (base - tip)
        pen.line([(0, base), (0, tip)])
        pen.line([(-0.6 * wide, neck), (0, tip), (0.6 * wide, neck)])
    else:  # a triangle on another one
        middle = (tip + base) / 2
        pen.fill([(0, tip), (0.7 * wide, middle), (-0.7 * wide, middle)])
        pen.fill([(0, middle - 0.25), (wide, base), (-wide, base)])
        pen.fill([(-0.2 * wide, base), (0.2 * wide, base), (0.2 * wide, 0.9), (-0.2 * wide, 0.9)])


def _down(pen: Pen, rng: np.random.Generator) -> None:
    _up(pen, rng)
    pen.image = np.ascontiguousarray(pen.image[::-1])


def _door(pen: Pen, rng: np.random.Generator, *, inward: bool) -> None:
    far, near = rng.uniform(0.6, 0.92), rng.uniform(0.05, 0.3)
    tall = rng.uniform(0.25, 0.8)
    form = pick(rng, ("heads", "chevrons", "arrows"), (6, 1.5, 1))
    filled = chance(rng, 0.75)
    tip, base = (near, far) if inward else (far, near)
    for side in (-1.0, 1.0):
        head: list[Point] = [(side * tip, 0), (side * base, -tall), (side * base, tall)]
        if form == "chevrons":
            pen.line([head[1], head[0], head[2]])
        elif form == "arrows":
            middle = (tip + base) / 2
            pen.fill([head[0], (side * middle, -0.6 * tall), (side * middle, 0.6 * tall)])
            pen.line([(side * middle, 0), (side * base, 0)])
        else:
            _shape(pen, head, filled)
    bars = pick(rng, (0, 1, 2, 3), (2, 4, 2.5, 0.5))
    high, thick = rng.uniform(0.4, 0.9), rng.uniform(0.05, 0.14)
    gap = rng.uniform(0.8, 1.6) * thick
    for bar in range(bars):
        u = (bar - (bars - 1) / 2) * (gap + thick / 2) if bars < 3 or bar != 1 else 0.0
        pen.line([(u, -high), (u, high)], thick=thick)


def _open(pen: Pen, rng: np.random.Generator) -> None:
    _door(pen, rng, inward=False)


def _close(pen: Pen, rng: np.random.Generator) -> None:
    _door(pen, rng, inward=True)


def _bell(pen: Pen, rng: np.random.Generator) -> None:
    top, dome = -rng.uniform(0.35, 0.6), rng.uniform(0.22, 0.42)
    shoulder, waist = top + dome, rng.uniform(-0.05, 0.3)
    hem, rim = rng.uniform(0.35, 0.55), rng.uniform(0.45, 0.75)
    flare = rng.uniform(0.0, 0.18)
    t = np.linspace(np.pi, 2 * np.pi, 24)
    right: list[Point] = [(dome + flare / 2, waist), (rim - flare, hem - 0.12), (rim, hem)]
    body = [(float(dome * np.cos(a)), float(shoulder + dome * np.sin(a))) for a in t]
    body += [*right, *((-u, v) for u, v in reversed(right))]
    turn = rng.normal(0, 0.3) if chance(rng, 0.3) else 0.0
    _shape(pen, _turned(body, turn), chance(rng, 0.65))
    if chance(rng, 0.85):
        (u, v), radius = _turned([(0, hem + 0.06)], turn)[0], rng.uniform(0.08, 0.22)
        pen.disc(u, v, radius)
    if chance(rng, 0.7):
        u, v = _turned([(0, top - 0.03)], turn)[0]
        pen.disc(u, v, rng.uniform(0.05, 0.13))
    if chance(rng, 0.15):  # it rings
        for radius in (0.75, 0.95):
            pen.arc(0, 0, radius, -35, 15)
            pen.arc(0, 0, radius, 165, 215)


def _phone(pen: Pen, rng: np.random.Generator) -> None:
    """A handset, in any position, over a set in some."""
    long, bend = rng.uniform(0.6, 0.85), rng.uniform(0.1, 0.5)
    thick, ends = rng.uniform(0.18, 0.4), rng.uniform(0.16, 0.3)
    base = chance(rng, 0.2)
    turn = 0.0 if base or chance(rng, 0.3) else rng.uniform(-1.8, 1.8)
    t = np.linspace(-1, 1, 17)
    grip = [(float(long * s), float(bend * s * s - bend / 2)) for s in t]
    rise = -0.45 if base else 0.0
    pen.line([(u, v + rise) for u, v in _turned(grip, turn)], thick=thick)
    for s in (-1.0, 1.0):
        form = [(s * (long + 0.1), bend / 2 - 0.12), (s * (long + 0.1), bend / 2 + ends)]
        form += [(s * (long - 1.4 * ends), bend / 2 + ends), (s * (long - 1.4 * ends), bend / 2)]
        pen.fill([(u, v + rise) for u, v in _turned(form, turn)])
    if base:
        wide = rng.uniform(0.5, 0.8)
        pen.fill([(-0.35, -0.15), (0.35, -0.15), (wide, 0.75), (-wide, 0.75)])
        pen.disc(0, 0.3, 0.24, 0)
    elif chance(rng, 0.15):
        for radius in (0.3, 0.5):
            pen.arc(0.3, -0.3, radius, -70, 10)


def _alarm(pen: Pen, rng: np.random.Generator) -> None:
    pick(rng, (_bell, _phone), (3, 2))(pen, rng)


def _cross(pen: Pen, rng: np.random.Generator) -> None:
    reach, thick = rng.uniform(0.4, 0.75), rng.uniform(0.1, 0.32)
    for side in (-1, 1):
        pen.line([(-side * reach, -reach), (side * reach, reach)], thick=thick)


def _key(pen: Pen, rng: np.random.Generator) -> None:
    """A key's picture, or the hole for it."""
    if chance(rng, 0.5):
        wide, long = rng.uniform(0.08, 0.2), rng.uniform(0.4, 0.8)
        pen.disc(0, -0.25, rng.uniform(0.2, 0.4))
        pen.fill([(-wide, -0.2), (wide, -0.2), (1.5 * wide, long), (-1.5 * wide, long)])
        return
    bow, turn = rng.uniform(0.22, 0.36), rng.uniform(-np.pi, np.pi)
    at = _turned([(-0.5, 0)], turn)[0]
    pen.disc(*at, bow)
    pen.disc(*at, 0.5 * bow, 0)
    pen.line(_turned([(-0.5 + bow, 0), (0.85, 0)], turn))
    for u in rng.uniform(0.3, 0.8, whole(rng, 2, 4)).tolist():
        pen.line(_turned([(u, 0), (u, rng.uniform(0.15, 0.35))], turn))


#: Kinds of labels that have signs of their own.
SIGNED: dict[str, Callable[[Pen, np.random.Generator], None]] = {
    "up": _up,
    "down": _down,
    "open": _open,
    "close": _close,
    "alarm": _alarm,
    "stop": _cross,
    "keyhole": _key,
}
