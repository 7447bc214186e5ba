"""What is on panels and walls and nobody presses: displays, speakers, notices, screws."""

from __future__ import annotations

import numpy as np

from fronto.synth import symbols
from fronto.synth.photo import glyphs
from fronto.synth.photo.canvas import Canvas
from fronto.synth.photo.draws import Color, chance, pick, tint, whole
from fronto.synth.photo.plan import Fixture
from fronto.synth.photo.style import LIGHTS, METALS

__all__ = ["draw_fixture"]

BLACK: Color = (14.0, 14.0, 17.0)
WORDS = (
    "CAPACITY", "1000 kg", "13 PERSONS", "IN CASE OF FIRE", "USE STAIRS", "NO SMOKING", "LIFT",
    "ELEVATOR", "No. 2", "EMERGENCY", "PUSH", "HELP", "FIRE SERVICE", "CAUTION", "630 kg", "KONE",
    "MAX LOAD", "FIRE OPERATION", "PHONE", "WELCOME", "LEVEL 2", "RECEPTION", "8", "F",
)  # fmt: skip


def _text_lines(canvas: Canvas, box: Fixture, rng: np.random.Generator, ink: Color) -> None:
    """Lines of words that fill a box."""
    count = whole(rng, 1, 6)
    pitch = box.height / (count + 0.6)
    font = whole(rng, 0, glyphs.FONTS - 1)
    for row in range(count):
        mask = glyphs.words(pick(rng, WORDS), font)
        height = min(pitch * rng.uniform(0.35, 0.7), 0.4 * box.width)
        width = min(height * mask.shape[1] / mask.shape[0], 0.9 * box.width)
        y = box.y + (row - (count - 1) / 2) * pitch
        canvas.ink(mask, box.x, y, (width, height), ink, 0.9)


def _display(canvas: Canvas, at: Fixture, rng: np.random.Generator) -> None:
    """A floor display: seven segments, a dot matrix, or an LCD with a bright ground."""
    kind = pick(rng, ("segments", "matrix", "lcd"), (4, 3, 2))
    light = tint(rng, pick(rng, LIGHTS), 20)
    rim = tint(rng, pick(rng, METALS), 20, rng.uniform(0.5, 1.1))
    if chance(rng, 0.4):
        canvas.box(at.x, at.y, 1.1 * at.width, 1.0 * at.height + 0.1 * at.width, rim, 1.0)
    ground, ink = tint(rng, BLACK, 10), light
    if kind == "lcd":
        ground = tint(rng, pick(rng, ((60, 90, 200), (150, 165, 140), (210, 225, 235))), 15)
        ink = (245.0, 245.0, 250.0) if sum(ground) < 400 else BLACK
    canvas.box(at.x, at.y, at.width, at.height, ground, rng.uniform(0, 3))
    size = min(0.75 * at.height, 0.45 * at.width)
    arrow, number = chance(rng, 0.7), str(whole(rng, 1, 40))
    left = at.x - 0.25 * at.width if arrow else at.x
    if arrow:
        name = pick(rng, ("up", "down"))
        mask = glyphs.symbol(name, whole(rng, 0, glyphs.SYMBOLS[name] - 1))
        canvas.ink(mask, left, at.y, (0.8 * size, 0.8 * size), ink)
        left = at.x + 0.22 * at.width
    if kind == "segments":
        digits = [symbols.seven_segment(d, 40, 72) for d in number]
        mask = np.asarray(np.hstack(digits) * 255, np.uint8)
    else:
        mask = glyphs.words(number, whole(rng, 0, glyphs.FONTS - 1))
        if kind == "matrix":
            mask = _dots(mask)
    width = min(size * mask.shape[1] / mask.shape[0], 0.45 * at.width)
    canvas.ink(mask, left, at.y, (width, size), ink)


def _dots(mask: glyphs.Bits) -> glyphs.Bits:
    """The mask on a dot matrix of eleven rows."""
    rows = 11
    columns = max(2, round(rows * mask.shape[1] / mask.shape[0]))
    on = glyphs.resized(mask, columns, rows) > 0.45
    dot = (glyphs.resized(glyphs.symbol("dot"), 8, 8) * 255).astype(np.uint8)
    return np.kron(on.astype(np.uint8), dot)


def _speaker(canvas: Canvas, at: Fixture, rng: np.random.Generator) -> None:
    """A field of holes, round or square, or slots."""
    size = min(at.width, at.height)
    count = whole(rng, 4, 9)
    pitch = size / count
    dark = tint(rng, (25, 25, 27), 15)
    if chance(rng, 0.3):
        canvas.disc(at.x, at.y, 0.55 * size, tint(rng, pick(rng, METALS), 20))
    slots, disc = chance(rng, 0.25), chance(rng, 0.6)
    for row in range(count):
        v = (row - (count - 1) / 2) * pitch
        if slots:
            half = 0.5 * size
            canvas.line((at.x - half, at.y + v), (at.x + half, at.y + v), 0.4 * pitch, dark)
            continue
        for column in range(count):
            u = (column - (count - 1) / 2) * pitch
            if not disc or u * u + v * v < 0.26 * size * size:
                canvas.disc(at.x + u, at.y + v, 0.3 * pitch, dark)


def _notice(canvas: Canvas, at: Fixture, rng: np.random.Generator) -> None:
    """A sticker, plate or poster, or words straight on the panel."""
    paper = tint(
        rng, pick(rng, ((240, 240, 235), (20, 20, 22), (200, 40, 35), (230, 200, 60),
                        (40, 120, 70), (170, 172, 175), (50, 80, 170))), 15
    )  # fmt: skip
    ink: Color = BLACK if sum(paper) > 360 else (240.0, 240.0, 240.0)
    if chance(rng, 0.7):
        canvas.box(at.x, at.y, at.width, at.height, paper, rng.uniform(0, 3))
        if chance(rng, 0.3):
            canvas.box(at.x, at.y - 0.25 * at.height, 0.8 * at.width, 0.35 * at.height,
                       tint(rng, (128, 128, 128), 100))  # fmt: skip
    _text_lines(canvas, at, rng, ink)


def _screw(canvas: Canvas, at: Fixture, rng: np.random.Generator) -> None:
    radius = at.width / 2
    canvas.disc(at.x, at.y, 1.15 * radius, (50.0, 50.0, 52.0))
    canvas.disc(at.x, at.y, radius, tint(rng, (165, 165, 165), 40))
    turn = rng.uniform(0, np.pi)
    for k in range(whole(rng, 0, 2)):
        c, s = (0.6 * radius * f(turn + k * np.pi / 2) for f in (np.cos, np.sin))
        ends = (at.x - c, at.y - s), (at.x + c, at.y + s)
        canvas.line(*ends, 0.25 * radius, (45.0, 45.0, 48.0))


def _round(canvas: Canvas, at: Fixture, rng: np.random.Generator) -> None:
    """A lens, a lamp or a cover: discs in discs."""
    radius = min(at.width, at.height) / 2
    for share in (1.0, 0.8, 0.45)[: whole(rng, 1, 3)]:
        color = pick(rng, ((20, 20, 22), (180, 180, 182), (90, 20, 20), (60, 70, 90)))
        canvas.disc(at.x, at.y, share * radius, tint(rng, color, 20))


def _lantern(canvas: Canvas, at: Fixture, rng: np.random.Generator) -> None:
    """A direction arrow behind glass."""
    canvas.box(at.x, at.y, at.width, at.height, tint(rng, BLACK, 12), rng.uniform(0, 4))
    ink = pick(rng, LIGHTS) if chance(rng, 0.6) else (70.0, 70.0, 72.0)
    name = pick(rng, ("up", "down"))
    canvas.ink(glyphs.symbol(name, 0), at.x, at.y, (0.6 * at.width, 0.6 * at.width), ink)


def _hatch(canvas: Canvas, at: Fixture, rng: np.random.Generator) -> None:
    """A small door or the joint between two sheets."""
    dark = tint(rng, (45, 45, 47), 20)
    a, b = at.width / 2, at.height / 2
    corners = [(at.x - a, at.y - b), (at.x + a, at.y - b), (at.x + a, at.y + b),
               (at.x - a, at.y + b)]  # fmt: skip
    for first, last in zip(corners, corners[1:] + corners[:1], strict=True):
        canvas.line(first, last, 0.8, dark)


def _reader(canvas: Canvas, at: Fixture, rng: np.random.Generator) -> None:
    canvas.box(at.x, at.y, at.width, 1.2 * at.height, tint(rng, (30, 30, 34), 20), 4.0)
    light = pick(rng, LIGHTS)
    canvas.disc(at.x, at.y - 0.4 * at.height, 0.05 * at.width, light)
    name = pick(rng, ("speaker", "person"))
    size = 0.5 * at.width
    canvas.ink(glyphs.symbol(name, 0), at.x, at.y, (size, size), (200.0, 200.0, 205.0), 0.8)


def _indicator(canvas: Canvas, at: Fixture, rng: np.random.Generator) -> None:
    """A row of floor lamps, one of them lit; nobody can press them."""
    canvas.box(at.x, at.y, at.width, at.height, tint(rng, BLACK, 15), rng.uniform(0, 3))
    count, font = whole(rng, 3, 8), whole(rng, 0, glyphs.FONTS - 1)
    light, lit = pick(rng, LIGHTS), whole(rng, 0, 7)
    pitch = at.width / count
    for k in range(count):
        mask = glyphs.words(str(k + 1), font)
        height = 0.55 * min(pitch, at.height)
        width = min(height * mask.shape[1] / mask.shape[0], 0.8 * pitch)
        color: Color = light if k == lit else (95.0, 95.0, 98.0)
        canvas.ink(mask, at.x + (k - (count - 1) / 2) * pitch, at.y, (width, height), color)


def _strip(canvas: Canvas, at: Fixture, rng: np.random.Generator) -> None:
    """A sheet of another colour below a group of buttons."""
    color = tint(rng, pick(rng, (BLACK, (200, 200, 198), (120, 120, 122), *METALS)), 15)
    canvas.box(at.x, at.y, at.width, at.height, color, rng.uniform(0, 6))


def _hoop(canvas: Canvas, at: Fixture, rng: np.random.Generator) -> None:
    """A line engraved round a button and its label."""
    dark = float(rng.uniform(45, 60))  # nearly the same for all on a panel
    canvas.box(at.x, at.y, at.width, at.height, (dark, dark, dark), at.height / 2, 0.7)


def _pill(canvas: Canvas, at: Fixture, rng: np.random.Generator) -> None:
    """A dark pill below a button and its label."""
    dark = float(rng.uniform(14, 22))
    canvas.box(at.x, at.y, at.width, at.height, (dark, dark, dark), at.height / 2)


def _legend(canvas: Canvas, at: Fixture, rng: np.random.Generator) -> None:
    """Words beside a row of buttons, framed or not."""
    grey = 60.0 if at.width > 3 * at.height else 205.0  # the same for all on a panel
    ink = 235.0 - grey if grey > 128 else 215.0
    canvas.box(at.x, at.y, at.width, at.height, (grey, grey, grey), 0.05 * at.height)
    _text_lines(canvas, at, rng, (ink, ink, ink))


def draw_fixture(canvas: Canvas, at: Fixture, rng: np.random.Generator) -> None:
    """Draw a fixture of one of the kinds that layouts place."""
    if not canvas.sees(at.x, at.y, 1.3 * at.width, 1.3 * at.height):
        return
    if at.kind in ("caption", "logo"):
        _text_lines(canvas, at, rng, tint(rng, pick(rng, ((30, 30, 30), (235, 235, 235))), 20))
        return
    draw = {
        "display": _display,
        "speaker": _speaker,
        "notice": _notice,
        "screw": _screw,
        "camera": _round,
        "lantern": _lantern,
        "hatch": _hatch,
        "reader": _reader,
        "indicator": _indicator,
        "strip": _strip,
        "hoop": _hoop,
        "pill": _pill,
        "legend": _legend,
    }[at.kind]
    draw(canvas, at, rng)
