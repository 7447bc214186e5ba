"""What surrounds a panel: walls, doors, frames, corners, handrails; and hands before it."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fronto.shapes import FloatArray
from fronto.synth.photo.draws import Pixels, chance, pick, tint
from fronto.synth.photo.style import METALS
from fronto.synth.photo.surfaces import wall_tile
from fronto.synth.photo.view import View, to_photo, visible_part

__all__ = ["background", "occluder"]

Picture = npt.NDArray[np.uint8]
#: How far a wall reaches, metres.
FAR_M = 6.0


def _fill(photo: Picture, view: View, box: FloatArray, paint: Picture) -> None:
    """Paint a box on the wall (x0, y0, x1, y1 in metres) with a picture of the photo's size."""
    import cv2

    x0, y0, x1, y1 = box
    polygon = visible_part(np.array([(x0, y0), (x1, y0), (x1, y1), (x0, y1)]), view, 4)
    if len(polygon) < 3:
        return
    points = np.rint(to_photo(view, polygon) * 16).astype(np.int32)
    mask = np.zeros(photo.shape[:2], np.uint8)
    cv2.fillPoly(mask, [points], (255,), cv2.LINE_AA, 4)
    cv2.copyTo(paint, mask, photo)


def _gradient(rng: np.random.Generator, shape: tuple[int, int], upright: bool) -> Picture:
    """A metal door's bands of light, as a picture of the photo's size."""
    import cv2

    color = tint(rng, pick(rng, METALS), 20, rng.uniform(0.3, 1.1))
    stops = 1 + rng.normal(0, rng.uniform(0.05, 0.35), int(rng.integers(2, 9)))
    line = np.clip(stops, 0.1, 2)[None, :, None] * np.array(color)
    line = np.clip(line, 0, 255).astype(np.uint8)
    if not upright:
        line = np.ascontiguousarray(line.transpose(1, 0, 2))
    return np.asarray(cv2.resize(line, shape[::-1], interpolation=cv2.INTER_LINEAR), np.uint8)


def background(rng: np.random.Generator, view: View, box_m: FloatArray) -> Picture:
    """The photo without the panel (which will cover `box_m`: x0, y0, x1, y1), (h, w, 3)."""
    import cv2

    width, height = view.camera.width_px, view.camera.height_px
    shape = (height, width)
    tile = wall_tile(rng)
    reach = rng.uniform(0.15, 1.0) / tile.shape[0]  # metres a tile pixel
    warp = view.homography @ np.array([[reach, 0, box_m[0]], [0, reach, box_m[1]], [0, 0, 1]])
    photo = np.asarray(
        cv2.warpPerspective(tile, warp, (width, height), borderMode=cv2.BORDER_REFLECT), np.uint8
    )
    size = float(max(box_m[2] - box_m[0], box_m[3] - box_m[1]))
    for _ in range(pick(rng, (0, 1, 2, 3), (3, 4, 3, 1))):
        kind = pick(rng, ("side", "frame", "rail", "thing"), (4, 3, 1, 2))
        left = chance(rng, 0.5)
        start = rng.uniform(0.02, 0.5) * size
        wide = FAR_M if kind == "side" else rng.uniform(0.02, 0.4) * size
        if kind == "rail":
            y = box_m[3] + start
            box = np.array([-FAR_M, y, FAR_M, y + wide])
        elif kind == "thing":
            x, y = rng.uniform(-1.5, 1.5, 2) * size
            box = np.array([x, y, x + wide * 2, y + rng.uniform(0.05, 0.5) * size])
        elif left:
            box = np.array([box_m[0] - start - wide, -FAR_M, box_m[0] - start, FAR_M])
        else:
            box = np.array([box_m[2] + start, -FAR_M, box_m[2] + start + wide, FAR_M])
        if kind == "side" and chance(rng, 0.4):  # another wall round the corner
            other = cv2.resize(wall_tile(rng), shape[::-1], interpolation=cv2.INTER_LINEAR)
            paint = np.asarray(cv2.convertScaleAbs(other, alpha=rng.uniform(0.3, 1.1)), np.uint8)
        else:
            paint = _gradient(rng, shape, kind != "rail")
        _fill(photo, view, box, paint)
    if chance(rng, 0.15):
        photo = np.asarray(cv2.convertScaleAbs(photo, alpha=rng.uniform(0.05, 0.4)), np.uint8)
    return photo


def occluder(rng: np.random.Generator, shape: tuple[int, int]) -> tuple[Pixels, Pixels]:
    """A hand or an arm before the panel: its opacity (h, w) and its colours (h, w, 3)."""
    import cv2

    height, width = shape
    skin = tint(
        rng, pick(rng, ((224, 172, 140), (150, 100, 70), (90, 60, 45), (60, 60, 70))), 20
    )  # fmt: skip
    mask = np.zeros(shape, np.uint8)
    size = min(shape) * rng.uniform(0.05, 0.13)
    tip = rng.uniform(0.15, 0.85, 2) * (width, height)
    turn = rng.uniform(0.1 * np.pi, 0.9 * np.pi)  # from below
    away = np.array([np.cos(turn), np.sin(turn)])
    knuckle = tip + away * size * rng.uniform(2.5, 5)
    wrist = knuckle + away * size * 6
    cv2.line(mask, _pixel(tip), _pixel(knuckle), (255,), max(2, round(size)), cv2.LINE_AA)
    cv2.circle(mask, _pixel(knuckle + away * size), max(2, round(1.3 * size)), (255,), -1)
    cv2.line(mask, _pixel(knuckle + away * size), _pixel(wrist + away * max(shape)), (255,),
             max(3, round(2.2 * size)), cv2.LINE_AA)  # fmt: skip
    cover = cv2.GaussianBlur(mask, (0, 0), 0.8).astype(np.float32) / np.float32(255)
    depth = cv2.distanceTransform((mask > 127).astype(np.uint8), cv2.DIST_L2, 3)
    round_ = 0.55 + 0.55 * np.clip(depth / (0.5 * size), 0, 1) ** 0.6
    rgb = round_[..., None].astype(np.float32) * np.array(skin, np.float32)
    return np.asarray(cover, np.float32), rgb


def _pixel(point: FloatArray) -> tuple[int, int]:
    return round(float(point[0])), round(float(point[1]))
