"""Crops as cameras, lamps and imprecise outlines would give them: 48 x 48 pixels, disturbed."""

from __future__ import annotations

from dataclasses import dataclass, replace

import cv2
import numpy as np
import numpy.typing as npt

from fronto.datasets.records import Box
from fronto.labels.alphabet import CROP_PX, CROP_SCALE
from fronto.labels.targets import ReadTarget
from fronto.shapes import FloatArray
from fronto.synth.photo.draws import chance, log_uniform, smooth_noise, whole

__all__ = ["Bytes", "Sample", "crop_of", "jittered", "surrounded"]

Bytes = npt.NDArray[np.uint8]

#: Scale of the cut relative to the crops of a button that was found exactly (as logarithms),
#: shift and corners in crop sizes, rotation in degrees: mostly small, at most.
ZOOM, ASPECT, SHIFT, CORNERS, TURN, MAX_TURN = (-0.07, 0.18), 0.06, 0.05, 0.025, 3.0, 8.0
#: Share of the crops whose outline was found badly, and how many times worse it is.
MISSED, WORSE = 0.1, 2.2
#: Share of the crops that stay as they are but for where they are cut: most photos are good.
CLEAN = 0.35
#: Share of the others that are seen from afar; their least pixels, how many more for each
#: further character, and their most.
FAR, LEAST_PX, CHARACTER_PX, MOST_PX = 0.45, 10.0, 4.5, 40.0
#: Share of the crops that are spoilt until nobody can read them, and their pixels.
SPOILT, SPOILT_PX = 0.012, (3.0, 5.5)
#: A cut of this many times the pixels wanted is averaged first: sampling would alias.
COARSE = 1.6


@dataclass(frozen=True, eq=False)
class Sample:
    """A labelled box with its surroundings.

    Parameters
    ----------
    image
        Shape (h, w, 3), uint8, RGB.
    box
        Edges x0, y0, x1, y1 of the button or plate in it, pixels.
    target
        What it shows.
    """

    image: Bytes
    box: Box
    target: ReadTarget


def crop_of(sample: Sample) -> Bytes:
    """The crop that the reader gets of a button that was found exactly, (48, 48, 3)."""
    x0, y0, x1, y1 = sample.box
    center = np.array([x0 + x1, y0 + y1]) / 2
    half = CROP_SCALE / 2 * np.array([x1 - x0, y1 - y0])
    return _cut(sample.image, center + half * SQUARE, CROP_PX)


def surrounded(image: Bytes, box: Box, target: ReadTarget) -> Sample:
    """The box with two fifths of its size around it, cut out of a larger picture."""
    x0, y0, x1, y1 = box
    dx, dy = 0.4 * (x1 - x0) + 1, 0.4 * (y1 - y0) + 1
    left, top = max(0, int(x0 - dx)), max(0, int(y0 - dy))
    part = image[top : max(1, int(y1 + dy) + 1), left : max(1, int(x1 + dx) + 1)].copy()
    return Sample(part, (x0 - left, y0 - top, x1 - left, y1 - top), target)


def jittered(sample: Sample, rng: np.random.Generator) -> tuple[Bytes, ReadTarget]:
    """A crop (48, 48, 3) as it might come, and what it shows then."""
    target = sample.target
    corners = _corners(sample, rng)
    if target.mirrors and chance(rng, 0.3):
        corners = corners[[1, 0, 3, 2]]
    if target.kind in ("up", "down") and target.mirrors and chance(rng, 0.3):
        corners = corners[[3, 2, 1, 0]]
        target = replace(target, kind="down" if target.kind == "up" else "up")
    pixels = CROP_PX
    if target.kind not in ("blank", "unreadable") and chance(rng, SPOILT):
        pixels = round(rng.uniform(*SPOILT_PX))
        target = ReadTarget("unreadable")
    elif chance(rng, CLEAN):
        return _cut(sample.image, corners, CROP_PX), target
    elif chance(rng, FAR):
        native = float(np.sqrt(np.prod(np.ptp(corners, axis=0))))
        least = LEAST_PX + CHARACTER_PX * max(0, len(target.text) - 1)
        most = min(native, MOST_PX)
        if most > least + 1:
            pixels = round(log_uniform(rng, least, most))
    crop = _photographed(_cut(sample.image, corners, pixels), rng)
    if pixels != CROP_PX:
        way = cv2.INTER_LINEAR if chance(rng, 0.7) else cv2.INTER_CUBIC
        crop = np.asarray(cv2.resize(crop, (CROP_PX, CROP_PX), interpolation=way), np.uint8)
    return crop, target


#: Corners of a square around (0, 0): top-left, top-right, bottom-right, bottom-left.
SQUARE = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], np.float64)


def _corners(sample: Sample, rng: np.random.Generator) -> FloatArray:
    """What the crop's corners show of the sample's image, shape (4, 2)."""
    x0, y0, x1, y1 = sample.box
    size = np.array([x1 - x0, y1 - y0])
    worse = WORSE if chance(rng, MISSED) else 1.0
    zoom = worse * (rng.uniform(*ZOOM) + rng.uniform(-ASPECT, ASPECT) * np.array([1, -1]))
    half = CROP_SCALE / 2 * size * np.exp(zoom)
    angle = worse * np.radians(np.clip(rng.normal(0, TURN), -MAX_TURN, MAX_TURN))
    cos, sin = np.cos(angle), np.sin(angle)
    turned = SQUARE @ np.array([[cos, sin], [-sin, cos]])
    shift = rng.uniform(-SHIFT, SHIFT, 2) * size + rng.normal(0, CORNERS, (4, 2)) * size
    shift *= worse
    return np.asarray(np.array([x0 + x1, y0 + y1]) / 2 + turned * half + shift)


def _cut(image: Bytes, corners: FloatArray, pixels: int) -> Bytes:
    """The quadrangle of the image as a square of that many pixels, averaged where it shrinks."""
    ratio = float(np.sqrt(np.prod(np.ptp(corners, axis=0)))) / pixels
    if ratio > COARSE:
        height, width = image.shape[:2]
        size = (max(1, round(width / ratio)), max(1, round(height / ratio)))
        image = np.asarray(cv2.resize(image, size, interpolation=cv2.INTER_AREA), np.uint8)
        corners = (corners + 0.5) * np.array(size) / (width, height) - 0.5
    # The square's edges lie half a pixel outside of the centres of its outer pixels.
    ends = np.array([[0, 0], [pixels, 0], [pixels, pixels], [0, pixels]]) - 0.5
    warp = cv2.getPerspectiveTransform(ends.astype(np.float32), corners.astype(np.float32))
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    cut = cv2.warpPerspective(
        image, warp, (pixels, pixels), flags=flags, borderMode=cv2.BORDER_REPLICATE
    )
    return np.asarray(cut, np.uint8)


def _photographed(crop: Bytes, rng: np.random.Generator) -> Bytes:
    """Light, colour, blur, noise and compression."""
    crop = _toned(_lit(crop, rng), rng)
    if chance(rng, 0.25):
        crop = np.asarray(cv2.GaussianBlur(crop, (0, 0), log_uniform(rng, 0.4, 1.3)), np.uint8)
    elif chance(rng, 0.12):
        crop = np.asarray(cv2.filter2D(crop, -1, _streak(rng)), np.uint8)
    if chance(rng, 0.3):
        sigma = log_uniform(rng, 1, 10)
        noise = rng.standard_normal(crop.shape, dtype=np.float32) * np.float32(sigma)
        crop = np.asarray(cv2.add(crop, noise, dtype=cv2.CV_8U), np.uint8)
    if chance(rng, 0.3):
        _, content = cv2.imencode(".jpg", crop, [cv2.IMWRITE_JPEG_QUALITY, whole(rng, 25, 90)])
        crop = np.asarray(cv2.imdecode(content, cv2.IMREAD_COLOR), np.uint8)
    return crop


def _lit(crop: Bytes, rng: np.random.Generator) -> Bytes:
    """A lamp's reflex, a shadow, something before a corner."""
    size = len(crop)
    if chance(rng, 0.12):  # reflex
        at, wide = rng.uniform(0, size, 2), rng.uniform(0.08, 0.4) * size
        t = np.arange(size, dtype=np.float32)
        x, y = (np.exp(-(((t - np.float32(m)) / np.float32(wide)) ** 2)) for m in at)
        glare = cv2.merge([np.float32(rng.uniform(30, 150)) * y[:, None] * x[None]] * 3)
        crop = np.asarray(cv2.add(crop, glare, dtype=cv2.CV_8U), np.uint8)
    if chance(rng, 0.2):  # shadow, or light from one side
        light = smooth_noise(rng, (size, size), (size / 1.5, size / 1.5))
        gain = np.clip(1 + np.float32(rng.uniform(0.1, 0.4)) * light, 0.2, 1.8)
        crop = np.asarray(cv2.multiply(crop, cv2.merge([gain] * 3), dtype=cv2.CV_8U), np.uint8)
    if chance(rng, 0.04):
        reach = rng.uniform(0.1, 0.25, 2) * size
        x, y = (int(v) for v in reach)
        color = rng.integers(0, 256, 3)
        crop = crop.copy()
        rows = slice(0, y) if chance(rng, 0.5) else slice(size - y, size)
        crop[rows, slice(0, x) if chance(rng, 0.5) else slice(size - x, size)] = color
    return crop


def _toned(crop: Bytes, rng: np.random.Generator) -> Bytes:
    """Exposure, contrast, gamma, tint, inversion and other colours, all in one table."""
    if chance(rng, 0.12):
        grey = cv2.cvtColor(crop, cv2.COLOR_RGB2GRAY)
        crop = np.asarray(cv2.cvtColor(grey, cv2.COLOR_GRAY2RGB), np.uint8)
    elif chance(rng, 0.1):
        crop = crop[..., rng.permutation(3)]
    t = np.linspace(0, 1, 256)
    if chance(rng, 0.4):
        t = t ** log_uniform(rng, 0.55, 1.8)
    contrast = log_uniform(rng, 0.45, 1.4)
    t = 0.5 + contrast * (t - 0.5)
    # No further than to a mean at which labels still show: neither night nor blinding light.
    mean = float(t[round(sum(cv2.mean(crop)[:3]) / 3)])
    t = t + np.clip(rng.uniform(-0.22, 0.22), min(0, 0.09 - mean), max(0, 0.85 - mean))
    if chance(rng, 0.07):
        t = 1 - t
    tint = 1 + rng.normal(0, 0.08, 3) if chance(rng, 0.5) else np.ones(3)
    table = np.rint(255 * np.clip(t[:, None] * tint, 0, 1)).astype(np.uint8)
    return np.asarray(cv2.LUT(np.ascontiguousarray(crop), table[None]), np.uint8)


def _streak(rng: np.random.Generator) -> npt.NDArray[np.float32]:
    """Kernel of a shake, 3 or 5 pixels long."""
    half = whole(rng, 1, 2)
    kernel = np.zeros((2 * half + 1, 2 * half + 1), np.float32)
    turn = rng.uniform(0, np.pi)
    step = (round(half * np.cos(turn)), round(half * np.sin(turn)))
    ends = [(half + sign * step[0], half + sign * step[1]) for sign in (-1, 1)]
    cv2.line(kernel, ends[0], ends[1], (1.0,), 1, cv2.LINE_AA)
    return kernel / kernel.sum()
