"""Key switches close up: a cylinder that stands out, rings, brushed metal, a slot, words around."""

from __future__ import annotations

from typing import NamedTuple

import cv2
import numpy as np
import numpy.typing as npt

from fronto.synth.photo import glyphs
from fronto.synth.photo.draws import Color, chance, log_uniform, pick, tint, whole
from fronto.synth.photo.style import DARKS, LIGHTS, METALS

__all__ = ["draw_lock"]

Bytes = npt.NDArray[np.uint8]
Image = npt.NDArray[np.float32]

#: What stands around key switches.
WORDS = ("ON", "OFF", "ON OFF", "RUN", "STOP", "LIGHT", "FAN", "FIRE", "IND SER", "VIP", "SERVICE",
         "RESET", "0 1", "AUTO", "SECURITY", "PARK", "ATT", "EMERG", "LOBBY")  # fmt: skip
#: The colour of the hole.
SLOT: Color = (12.0, 12.0, 14.0)


class _Disc(NamedTuple):
    """A round part: its middle and radius, pixels."""

    x: float
    y: float
    radius: float


def draw_lock(picture: Bytes, x: float, y: float, size: float, rng: np.random.Generator) -> None:
    """Draw a key switch on a picture, in place.

    Parameters
    ----------
    picture
        Shape (h, w, 3), uint8.
    x, y, size
        Its middle and the diameter of what is round about it, pixels.
    """
    image = picture.astype(np.float32)
    metal = tint(rng, pick(rng, METALS), 20)
    outer = _Disc(x, y, size / 2)
    if chance(rng, 0.75):  # the collar, of metal or painted
        painted = pick(rng, (*DARKS, *LIGHTS)) if chance(rng, 0.3) else metal
        _part(image, outer, tint(rng, painted, 12), rng)
    if chance(rng, 0.35):
        _words(image, outer, rng)
    # A cylinder stands out of the panel: what is nearer seems moved aside.
    lean = rng.normal(0, 0.1, 2) * size * (1.0 if chance(rng, 0.4) else 0.2)
    steps = whole(rng, 1, 3)
    radius = size / 2 * rng.uniform(0.5, 0.8)
    part = outer
    for step in range(steps):
        share = (step + 1) / steps
        part = _Disc(x + share * lean[0], y + share * lean[1], radius)
        _part(image, part, tint(rng, metal, 18), rng)
        radius *= rng.uniform(0.6, 0.9)
    _slot(image, part, rng)
    picture[:] = np.clip(image, 0, 255).astype(np.uint8)


def _cover(image: Image, disc: _Disc) -> tuple[Image, Image, Image]:
    """How far each pixel is in the disc, 0 to 1, and where it is from the disc's middle."""
    height, width = image.shape[:2]
    dx = np.arange(width, dtype=np.float32)[None] - np.float32(disc.x)
    dy = np.arange(height, dtype=np.float32)[:, None] - np.float32(disc.y)
    far = np.hypot(dx, dy)
    return np.clip(np.float32(disc.radius + 0.5) - far, 0, 1), dx + 0 * dy, dy + 0 * dx


def _part(image: Image, disc: _Disc, color: Color, rng: np.random.Generator) -> None:
    """A turned piece of metal: bright sectors, a rim in light and shadow, rings."""
    cover, dx, dy = _cover(image, disc)
    angle, far = np.arctan2(dy, dx), np.hypot(dx, dy) / np.float32(disc.radius)
    light = np.zeros_like(far)
    if chance(rng, 0.6):  # brushed in circles, it shines in two or four sectors
        sectors, first = pick(rng, (2, 2, 4)), rng.uniform(0, 2 * np.pi)
        light += rng.uniform(15, 70) * np.cos(sectors * (angle - first)).astype(np.float32)
    turn = rng.uniform(-2.6, -0.5)
    facing = np.cos(angle - turn)
    width = rng.uniform(0.06, 0.3)
    rim = np.clip((far - 1 + width) / width, 0, 1)
    light += rng.uniform(-90, 110) * rim * facing
    for _ in range(whole(rng, 0, 2)):
        at, thin = rng.uniform(0.3, 0.95), rng.uniform(0.02, 0.07)
        light += rng.uniform(-90, 60) * np.exp(-(((far - at) / thin) ** 2))
    surface = np.array(color, np.float32) + light[..., None]
    if chance(rng, 0.6):  # the gap, or the shadow, around it
        gap, _, _ = _cover(image, disc._replace(radius=disc.radius * rng.uniform(1.02, 1.12)))
        image *= 1 - np.float32(rng.uniform(0.4, 0.95)) * gap[..., None]
    image += cover[..., None] * (np.clip(surface, 0, 255) - image)


def _slot(image: Image, disc: _Disc, rng: np.random.Generator) -> None:
    """The hole for the key: a slit, a keyhole, a zigzag, or a wedge of shadow."""
    size = glyphs.SIZE
    mask = np.zeros((size, size), np.uint8)
    middle, turn = size / 2, rng.uniform(0, 180) if chance(rng, 0.5) else 90 * whole(rng, 0, 1)
    form = pick(rng, ("slit", "hole", "zigzag", "wedge"), (5, 2, 2, 2))
    if form == "hole":
        mask = glyphs.symbol("keyhole")
    else:
        long, wide = rng.uniform(0.2, 0.42) * size, rng.uniform(0.03, 0.1) * size
        t = np.linspace(-1, 1, 7)
        bend = rng.normal(0, 0.6, 7) * wide if form == "zigzag" else np.zeros(7)
        grow = (1 + t) if form == "wedge" else np.ones(7)
        left = np.column_stack([middle + bend - wide * grow, middle + long * t])
        right = np.column_stack([middle + bend + wide * grow, middle + long * t])
        outline = np.rint(np.vstack([left, right[::-1]]) * 16).astype(np.int32)
        cv2.fillPoly(mask, [outline], (255,), cv2.LINE_AA, 4)
    matrix = cv2.getRotationMatrix2D((middle, middle), float(turn), 1.0)
    scale = 2 * disc.radius / size * rng.uniform(0.85, 1.25)
    place = np.array([[scale, 0, disc.x - scale * middle], [0, scale, disc.y - scale * middle]])
    total = place @ np.vstack([matrix, [0, 0, 1]])
    shape = (image.shape[1], image.shape[0])
    cover = cv2.warpAffine(mask, total, shape, flags=cv2.INTER_AREA).astype(np.float32) / 255
    if chance(rng, 0.4):  # its lit edge
        edge = cv2.warpAffine(cover, np.array([[1, 0, 0.9], [0, 1, 0.9]]), shape)
        image += np.float32(rng.uniform(30, 110)) * np.clip(edge - cover, 0, 1)[..., None]
    dark = np.array(SLOT if chance(rng, 0.85) else tint(rng, (190, 180, 150), 30), np.float32)
    image += np.float32(rng.uniform(0.6, 1)) * cover[..., None] * (dark - image)


def _words(image: Image, disc: _Disc, rng: np.random.Generator) -> None:
    """Positions of the key, printed around it."""
    bright = image.mean() < 120
    color = tint(rng, (230, 230, 228) if bright else (30, 30, 32), 20)
    for _ in range(whole(rng, 1, 3)):
        mask = glyphs.words(pick(rng, WORDS), whole(rng, 0, glyphs.FONTS - 1))
        tall = disc.radius * log_uniform(rng, 0.14, 0.28)
        wide = min(tall * mask.shape[1] / mask.shape[0], 1.6 * disc.radius)
        angle = rng.uniform(0, 2 * np.pi) if chance(rng, 0.4) else np.pi / 2 * whole(rng, 0, 3)
        at = rng.uniform(0.8, 1.0) * disc.radius
        x, y = disc.x + at * np.cos(angle) - wide / 2, disc.y + at * np.sin(angle) - tall / 2
        small = cv2.resize(mask, (max(1, round(wide)), max(1, round(tall))),
                           interpolation=cv2.INTER_AREA)  # fmt: skip
        shift = np.array([[1, 0, x], [0, 1, y]])
        shape = (image.shape[1], image.shape[0])
        cover = cv2.warpAffine(small, shift, shape).astype(np.float32) / 255
        image += cover[..., None] * (np.array(color, np.float32) - image)
