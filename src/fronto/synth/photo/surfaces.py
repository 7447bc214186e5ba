"""Materials of panels and walls."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fronto.synth.photo.draws import Color, Pixels, chance, log_uniform, pick, smooth_noise, tint
from fronto.synth.photo.style import METALS

__all__ = ["Material", "panel_material", "panel_surface", "wall_tile"]

#: Side of the wall's repeating tile, pixels.
TILE = 256


@dataclass(frozen=True)
class Material:
    """A surface: its kind, its colour and how strongly it mirrors its surroundings."""

    kind: str
    color: Color
    mirror: float


def panel_material(rng: np.random.Generator) -> Material:
    """Draw what a panel is made of."""
    kinds = ("brushed", "upright", "glass", "painted", "wood", "stone", "plastic", "mirror", "cast")
    kind = pick(rng, kinds, (5, 3, 1.6, 1.5, 0.7, 0.5, 1.3, 1.3, 0.5))
    if kind in ("brushed", "upright", "mirror", "cast"):
        color = tint(rng, pick(rng, METALS, (5, 4, 3, 3, 1.5, 1.2, 1)), 12)
        mirror = rng.uniform(0.3, 0.7) if kind == "mirror" else rng.uniform(0.03, 0.35)
        return Material(kind, color, mirror)
    banks: dict[str, tuple[Color, ...]] = {
        "glass": ((12, 12, 15), (25, 26, 30), (18, 22, 40)),
        "painted": ((200, 195, 180), (120, 125, 130), (60, 70, 90), (90, 110, 90), (45, 45, 48)),
        "wood": ((150, 100, 60), (110, 70, 40), (190, 150, 100), (95, 45, 30)),
        "stone": ((150, 148, 145), (100, 98, 96), (205, 200, 192)),
        "plastic": ((238, 238, 234), (215, 212, 204), (170, 172, 176)),
    }
    return Material(kind, tint(rng, pick(rng, banks[kind]), 10), rng.uniform(0.02, 0.15))


def _grain(rng: np.random.Generator, kind: str, shape: tuple[int, int], scale: float) -> Pixels:
    """Relative brightness of a material, mean about 0; `scale` in pixels a millimetre."""
    fine = max(1.0, 0.5 * scale)
    if kind in ("brushed", "upright"):
        cells = (fine, 60 * scale + 8) if kind == "brushed" else (60 * scale + 8, fine)
        grain = smooth_noise(rng, shape, cells)
        return grain * np.float32(log_uniform(rng, 0.01, 0.06))
    if kind == "wood":
        rings = smooth_noise(rng, shape, (90 * scale + 8, 12 * scale + 2))
        fibres = smooth_noise(rng, shape, (40 * scale + 8, 1.2 * fine))
        return np.asarray(0.12 * np.sin(4 * rings) + 0.06 * fibres, np.float32)
    if kind in ("stone", "cast"):
        speckle = smooth_noise(rng, shape, (2 * fine, 2 * fine))
        clouds = smooth_noise(rng, shape, (20 * scale + 4, 20 * scale + 4))
        return 0.07 * speckle + 0.06 * clouds
    if kind == "plaster":
        return np.float32(log_uniform(rng, 0.005, 0.05)) * smooth_noise(rng, shape, (fine, fine))
    return np.zeros(shape, np.float32)


def _reflections(rng: np.random.Generator, shape: tuple[int, int]) -> Pixels:
    """What a shiny surface shows of the room: soft blobs and upright bands, about -2 to 2."""
    small = (48, 48)
    room = smooth_noise(rng, small, (48 / rng.uniform(1.5, 4), 48 / rng.uniform(1.5, 5)))
    if chance(rng, 0.5):
        bands = smooth_noise(rng, small, (200.0, 48 / rng.uniform(3, 10)))
        room = room + bands * np.float32(rng.uniform(0.3, 1.2))
    if chance(rng, 0.3):  # something with an edge
        edge = np.tanh(np.float32(rng.uniform(1, 6)) * smooth_noise(rng, small, (48.0, 16.0)))
        room = room + np.float32(rng.uniform(0.3, 1.2)) * edge
    return _enlarged(np.asarray(room, np.float32), shape)


def _enlarged(small: Pixels, shape: tuple[int, int]) -> Pixels:
    import cv2

    return np.asarray(cv2.resize(small, shape[::-1], interpolation=cv2.INTER_CUBIC), np.float32)


def colored(gain: Pixels, color: Color) -> npt.NDArray[np.uint8]:
    """Brightness (h, w) times a colour, as a picture (h, w, 3)."""
    import cv2

    channels = [cv2.convertScaleAbs(gain, alpha=float(c)) for c in color]
    return np.asarray(cv2.merge(channels), np.uint8)


def panel_surface(
    rng: np.random.Generator, material: Material, shape: tuple[int, int], scale: float
) -> npt.NDArray[np.uint8]:
    """A sheet of the material, shape (h, w, 3).

    Parameters
    ----------
    shape
        Height and width in pixels.
    scale
        Pixels a millimetre.
    """
    gain = 1 + _grain(rng, material.kind, shape, scale)
    gain += np.float32(material.mirror) * _reflections(rng, shape)
    return colored(np.maximum(gain, 0.02), material.color)


def wall_tile(rng: np.random.Generator) -> npt.NDArray[np.uint8]:
    """A square of wall that repeats (mirrored), shape (256, 256, 3)."""
    kinds = ("plaster", "tiles", "wood", "stone", "ribs", "paper", "metal", "plain")
    kind = pick(rng, kinds, (5, 3, 3, 3, 1, 1, 4, 3))
    palette: tuple[Color, ...] = (
        (216, 209, 197), (190, 190, 188), (150, 145, 140), (228, 222, 210), (170, 165, 158),
        (120, 80, 50), (200, 170, 130), (90, 95, 105), (60, 55, 52), (170, 60, 45),
        (110, 140, 120), (235, 232, 226), (35, 33, 34),
    )  # fmt: skip
    color = tint(rng, pick(rng, palette), 15)
    shape = (TILE, TILE)
    if kind in ("wood", "stone"):
        grain = _grain(rng, kind, shape, rng.uniform(0.3, 1.5))
        if kind == "stone" and chance(rng, 0.6):  # veins
            vein = np.exp(-12 * np.abs(smooth_noise(rng, shape, (60.0, 40.0))))
            grain += np.float32(rng.uniform(-0.3, 0.3)) * vein
    elif kind == "metal":
        grain = _grain(rng, pick(rng, ("brushed", "upright")), shape, 0.8)
    else:
        grain = _grain(rng, "plaster", shape, 1.0)
    along = np.arange(TILE, dtype=np.float32)
    if kind == "tiles":
        pitch = TILE / int(rng.integers(1, 5))
        line = np.float32(rng.uniform(-0.4, 0.3))
        near = (along % pitch) < rng.uniform(2, 6)
        grain += line * np.maximum(near[None], near[:, None])
    elif kind == "ribs":
        count = int(rng.integers(4, 24))
        ribs = np.sin(along * np.float32(2 * np.pi * count / TILE))
        grain += np.float32(rng.uniform(0.05, 0.35)) * ribs[None]
    elif kind == "paper":
        blobs = np.sin(4 * smooth_noise(rng, shape, (30.0, 30.0)))
        grain += np.float32(rng.uniform(0.02, 0.12)) * np.sign(blobs)
    return colored(np.maximum(1 + grain, 0.02), color)
