"""Labels laid on faces: printed, engraved, raised, outlined, framed, lit, worn; with braille."""

from __future__ import annotations

import cv2
import numpy as np
import numpy.typing as npt

from fronto.synth.photo import glyphs
from fronto.synth.photo.draws import Color, Pixels, chance, log_uniform, pick, smooth_noise, whole
from fronto.synth.photo.glyphs import Bits
from fronto.train.reader.fonts import Typefaces
from fronto.train.reader.signs import SIGNED, random_sign
from fronto.train.reader.texts import Marking

__all__ = ["braille", "lay_ink", "marking_mask"]

Bytes = npt.NDArray[np.uint8]
#: Signs in a ring or on a disc, as stop and alarm are on many panels.
FRAMED = {"stop": 0.6, "alarm": 0.25, "other": 0.2, "open": 0.08, "close": 0.08, "up": 0.15,
          "down": 0.15, "text": 0.05}  # fmt: skip
#: Share of the signs that are drawn anew.
ANEW = 0.75


def marking_mask(marking: Marking, faces: Typefaces, rng: np.random.Generator) -> Bits:
    """Coverage of what is marked, cropped to its ink, shape (h, w), 0 to 255."""
    font = faces.draw(rng)
    mask = None
    if marking.text:
        mask = _text_mask(marking.text, faces, font, rng)
    elif marking.characters:
        # Few fonts have signs: a handful of draws finds one.
        fonts = [font, *(faces.draw(rng) for _ in range(5))]
        mask = next(
            (m for f in fonts if (m := faces.sign(marking.characters, f)) is not None), None
        )
    if mask is None and marking.target.kind in SIGNED and chance(rng, ANEW):
        mask = _cropped(random_sign(marking.target.kind, rng))
    elif mask is None:
        mask = _cropped(glyphs.symbol(marking.symbol, marking.variant))
    mask = _weighted(mask, rng)
    if chance(rng, FRAMED.get(marking.target.kind, 0)) and mask.shape[1] < 2.2 * mask.shape[0]:
        mask = _framed(mask, rng)
    return mask


def _text_mask(text: str, faces: Typefaces, font: int, rng: np.random.Generator) -> Bits:
    if "-" in text and chance(rng, 0.5) and faces.sign("\N{MINUS SIGN}", font) is not None:
        text = text.replace("-", "\N{MINUS SIGN}")
    if "?" not in text:
        return faces.write(text, font)
    rest = text.removeprefix("?")
    star = _star(faces, font, rng)
    if not rest:
        return star
    mask = faces.write(rest, font)
    tall = mask.shape[0]
    size = round(tall * rng.uniform(0.55, 1.15))
    star = np.asarray(cv2.resize(star, (size, size), interpolation=cv2.INTER_AREA), np.uint8)
    rows = max(tall, size)
    gap = np.zeros((rows, round(tall * rng.uniform(0.05, 0.35))), np.uint8)
    return np.ascontiguousarray(np.hstack([_centered(star, rows), gap, _centered(mask, rows)]))


def _star(faces: Typefaces, font: int, rng: np.random.Generator) -> Bits:
    if chance(rng, 0.15):
        return faces.write("*", font)
    star = _cropped(glyphs.symbol("star"))
    return _hollow(star, 0.12) if chance(rng, 0.3) else star


def _centered(mask: Bits, rows: int) -> Bits:
    above = (rows - mask.shape[0]) // 2
    return np.pad(mask, ((above, rows - mask.shape[0] - above), (0, 0)))


def _cropped(mask: Bits) -> Bits:
    x, y, width, height = cv2.boundingRect(mask)
    return np.ascontiguousarray(mask[y : y + height, x : x + width])


def _disc(size: int) -> Bits:
    return np.asarray(cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size)), np.uint8)


def _weighted(mask: Bits, rng: np.random.Generator) -> Bits:
    """Bolder, or only the contour of bold strokes."""
    if chance(rng, 0.3):
        size = max(2, round(mask.shape[0] * rng.uniform(0.02, 0.08)))
        return np.asarray(cv2.dilate(np.pad(mask, size), _disc(size)), np.uint8)
    if chance(rng, 0.08):
        return _hollow(mask, 0.05)
    return mask


def _hollow(mask: Bits, share: float) -> Bits:
    size = max(3, round(share * mask.shape[0]))
    return np.asarray(mask - cv2.erode(np.pad(mask, 1), _disc(size))[1:-1, 1:-1], np.uint8)


def _framed(mask: Bits, rng: np.random.Generator) -> Bits:
    """In a ring or a square frame, or cut out of a disc or a square."""
    height, width = mask.shape
    round_ = chance(rng, 0.7)
    side = np.hypot(height, width) if round_ else max(height, width)
    side = round(side * rng.uniform(1.1, 1.5)) + 4
    out = np.zeros((side, side), np.uint8)
    top, left = (side - height) // 2, (side - width) // 2
    out[top : top + height, left : left + width] = mask
    frame = np.zeros_like(out)
    solid = chance(rng, 0.35)
    thick = -1 if solid else max(2, round(side * rng.uniform(0.03, 0.09)))
    rim = 0 if solid else thick // 2 + 1
    if round_:
        middle = (side // 2, side // 2)
        cv2.circle(frame, middle, (side - 1) // 2 - rim, (255,), thick, cv2.LINE_AA)
    else:
        corner = side - 1 - rim
        cv2.rectangle(frame, (rim, rim), (corner, corner), (255,), thick, cv2.LINE_AA)
    return np.asarray(frame - np.minimum(frame, out) if solid else np.maximum(frame, out), np.uint8)


def lay_ink(
    face: Bytes,
    mask: Bits,
    box: tuple[float, float, float, float],
    color: Color,
    rng: np.random.Generator,
    *,
    glow: Color | None = None,
) -> None:
    """Put a label on a picture of a face, in place.

    Parameters
    ----------
    face
        Shape (h, w, 3), uint8.
    mask
        The label's coverage.
    box
        Edges x0, y0, x1, y1 of the label in the picture, pixels.
    color
        Of a printed label.
    glow
        Its light, where it is lit from behind.
    """
    cover = _placed(mask, box, face.shape[:2])
    if chance(rng, 0.15):
        cover = cover * _wear(rng, cover.shape)
    way = "lit" if glow else pick(rng, ("printed", "engraved", "raised", "filled"), (6, 2, 1.2, 2))
    if glow:
        halo = cv2.GaussianBlur(cover, (0, 0), log_uniform(rng, 1.5, 5))
        _paint(face, np.minimum(1, np.float32(rng.uniform(0.3, 1.1)) * halo), glow)
        white = rng.uniform(0, 0.8)
        r, g, b = (c + white * (255 - c) for c in glow)
        _paint(face, cover, (r, g, b))
        return
    if way in ("engraved", "raised"):
        _emboss(face, cover, rng, sunk=way == "engraved")
        return
    opacity = 1.0 if chance(rng, 0.7) else rng.uniform(0.25, 0.9)
    _paint(face, cover * np.float32(opacity), color)
    if way == "filled":
        _emboss(face, cover, rng, sunk=True)


def _placed(mask: Bits, box: tuple[float, float, float, float], shape: tuple[int, int]) -> Pixels:
    """The mask in a picture of that shape, as coverage 0 to 1."""
    x0, y0, x1, y1 = box
    size = (max(1, round(x1 - x0)), max(1, round(y1 - y0)))
    small = cv2.resize(mask, size, interpolation=cv2.INTER_AREA)
    # Sub-pixel places, else strokes would always begin at a pixel's edge.
    shift = np.array([[1, 0, x0], [0, 1, y0]], np.float32)
    placed = cv2.warpAffine(small, shift, shape[::-1])
    return np.asarray(placed, np.float32) * np.float32(1 / 255)


def _paint(face: Bytes, cover: Pixels, color: Color) -> None:
    ink = np.array(color, np.float32)
    face[:] = (face + cover[..., None] * (ink - face) + np.float32(0.5)).astype(np.uint8)


def _emboss(face: Bytes, cover: Pixels, rng: np.random.Generator, *, sunk: bool) -> None:
    """Light on the edges of a relief, and its floor a little darker or brighter."""
    depth = log_uniform(rng, 0.6, 1.8)
    turn = rng.uniform(0.6, 2.5)  # light from above, mostly
    dx, dy = depth * np.cos(turn), depth * np.sin(turn)
    soft = cv2.GaussianBlur(cover, (0, 0), depth / 2)
    size = (cover.shape[1], cover.shape[0])
    lower, upper = (
        cv2.warpAffine(soft, np.array([[1, 0, s * dx], [0, 1, s * dy]], np.float32), size)
        for s in (1, -1)
    )
    slope = (lower - upper) if sunk else (upper - lower)
    strength = np.float32(log_uniform(rng, 40, 140))
    floor = np.float32(rng.normal(0, 25)) * cover
    light = strength * slope + floor
    face[:] = np.clip(face + light[..., None], 0, 255).astype(np.uint8)


def _wear(rng: np.random.Generator, shape: tuple[int, ...]) -> Pixels:
    """Where the print is left, 0 to 1."""
    cells = (log_uniform(rng, 2, 14), log_uniform(rng, 2, 14))
    noise = smooth_noise(rng, (shape[0], shape[1]), cells)
    return np.asarray(np.clip(1.6 + 2 * noise, rng.uniform(0, 0.5), 1), np.float32)


def braille(
    face: Bytes, middle: tuple[float, float], pitch: float, color: Color, rng: np.random.Generator
) -> None:
    """Two to four cells of dots around a point; `pitch` is between dots, pixels."""
    columns = 2 * whole(rng, 1, 3)
    relief = chance(rng, 0.5)
    for index in np.flatnonzero(rng.random(3 * columns) < 0.5):
        row, column = divmod(int(index), columns)
        x = middle[0] + (column - (columns - 1) / 2 + 0.25 * (column // 2)) * pitch
        y = middle[1] + (row - 1) * pitch
        radius = round(0.32 * pitch * 16)
        at = (round(x * 16), round(y * 16))
        if relief:
            below = (at[0] + radius // 2, at[1] + radius // 2)
            cv2.circle(face, below, radius, (30.0, 30.0, 30.0), -1, cv2.LINE_AA, 4)
        cv2.circle(face, at, radius, color, -1, cv2.LINE_AA, 4)
