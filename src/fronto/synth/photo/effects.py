"""Light, lens and sensor: what happens to the whole photo."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from fronto.synth.photo.draws import Pixels, chance, log_uniform, pick, smooth_noise, whole

__all__ = ["develop", "lighting"]

Picture = npt.NDArray[np.uint8]


def _grid(shape: tuple[int, int]) -> tuple[Pixels, Pixels]:
    """Coordinates from -1 to 1 on an eighth of the photo."""
    h, w = max(8, shape[0] // 8), max(8, shape[1] // 8)
    x = np.linspace(-1, 1, w, dtype=np.float32)[None]
    y = np.linspace(-1, 1, h, dtype=np.float32)[:, None]
    return x, y


def _spot(rng: np.random.Generator, x: Pixels, y: Pixels, size: float) -> Pixels:
    """A soft blob somewhere, 0 to 1."""
    u, v = (float(value) for value in rng.uniform(-0.9, 0.9, 2))
    a, b = (size * float(value) for value in rng.uniform(0.5, 1.6, 2))
    return np.asarray(np.exp(-(((x - u) / a) ** 2 + ((y - v) / b) ** 2)), np.float32)


def lighting(rng: np.random.Generator, shape: tuple[int, int]) -> tuple[Pixels, Pixels]:
    """Light that multiplies the picture, and glare that adds to it, (h, w) each.

    Gradients, soft and hard shadows, vignetting; flash and lamps mirrored in the panel.
    """
    import cv2

    x, y = _grid(shape)
    gain = np.ones((y.shape[0], x.shape[1]), np.float32)
    turn = rng.uniform(0, 2 * np.pi)
    slope = rng.uniform(0, 0.5) if chance(rng, 0.7) else 0.0
    gain += np.float32(slope) * (x * np.float32(np.cos(turn)) + y * np.float32(np.sin(turn)))
    if chance(rng, 0.3):
        gain *= 1 + np.float32(0.35) * smooth_noise(rng, gain.shape, (30.0, 30.0))
    for _ in range(pick(rng, (0, 1, 2), (6, 3, 1))):  # shadows with an edge
        turn, soft = rng.uniform(0, 2 * np.pi), log_uniform(rng, 0.02, 0.4)
        far = x * np.float32(np.cos(turn)) + y * np.float32(np.sin(turn))
        step = np.clip((far - np.float32(rng.uniform(-0.7, 0.7))) / np.float32(soft), 0, 1)
        gain *= 1 - np.float32(rng.uniform(0.15, 0.6)) * step
    if chance(rng, 0.4):
        gain *= 1 - np.float32(rng.uniform(0.1, 0.5)) * (x * x + y * y) / 2
    glare = np.zeros_like(gain)
    for _ in range(pick(rng, (0, 1, 2), (5, 4, 1))):
        size = log_uniform(rng, 0.04, 0.6)
        # Large patches of glare stay thin: what nobody can see must not be in the truth.
        glare += np.float32(rng.uniform(15, 90 if size > 0.12 else 230)) * _spot(rng, x, y, size)
    if chance(rng, 0.12):  # haze
        glare += np.float32(rng.uniform(5, 60))
    full = (shape[1], shape[0])
    large = [
        cv2.resize(part, full, interpolation=cv2.INTER_LINEAR)
        for part in (np.maximum(gain, 0.05), glare)
    ]
    return np.asarray(large[0], np.float32), np.asarray(large[1], np.float32)


def _tone(rng: np.random.Generator, mean: float) -> tuple[npt.NDArray[np.float32], float]:
    """Gains of the channels for a picture of that mean, and the exponent of the tone curve."""
    aims = (rng.uniform(75, 165), rng.uniform(25, 70), rng.uniform(165, 205))
    aim = pick(rng, aims, (8, 1.5, 1))
    exposure = float(np.clip(aim / max(mean, 5.0), 0.25, 3.0)) ** rng.uniform(0.5, 1.0)
    cast = np.ones(3)
    if chance(rng, 0.7):
        warm = rng.normal(0.02, 0.09)
        cast = np.array([1 + warm, 1 + rng.normal(0, 0.04), 1 - warm])
    if chance(rng, 0.05):
        cast *= rng.uniform(0.5, 1.3, 3)
    gamma = log_uniform(rng, 0.7, 1.4) if chance(rng, 0.5) else 1.0
    return np.asarray(np.clip(cast, 0.3, 2) * exposure, np.float32), gamma


def _blurred(rng: np.random.Generator, photo: Picture, unit: float) -> Picture:
    """Defocus or motion; `unit` is 1 for a photo 640 pixels wide."""
    import cv2

    kind = pick(rng, ("none", "focus", "motion"), (3, 5, 1.5))
    if kind == "focus":
        sigma = log_uniform(rng, 0.4, 2.2) * unit
        return np.asarray(cv2.GaussianBlur(photo, (0, 0), max(sigma, 0.3)), np.uint8)
    if kind == "motion":
        half = max(1, round(rng.uniform(1, 5) * unit))
        kernel = np.zeros((2 * half + 1, 2 * half + 1), np.float32)
        turn = rng.uniform(0, np.pi)
        c, s = half * np.cos(turn), half * np.sin(turn)
        ends = [(round(half + sign * c), round(half + sign * s)) for sign in (-1, 1)]
        cv2.line(kernel, ends[0], ends[1], (1.0,), 1, cv2.LINE_AA)
        return np.asarray(cv2.filter2D(photo, -1, kernel / kernel.sum()), np.uint8)
    return photo


def _noisy(rng: np.random.Generator, photo: Picture) -> Picture:
    """Sensor noise: of brightness, and coarser of colour."""
    import cv2

    if chance(rng, 0.25):
        return photo
    sigma = np.float32(log_uniform(rng, 0.6, 12))
    shape = (photo.shape[0], photo.shape[1])
    grain = sigma * rng.standard_normal(shape, dtype=np.float32)
    planes = [grain] * 3
    if chance(rng, 0.4):
        red, blue = (grain + sigma * smooth_noise(rng, shape, (2.0, 2.0)) for _ in range(2))
        planes = [red, grain, blue]
    noise = cv2.merge([plane.astype(np.int16) for plane in planes])
    return np.asarray(cv2.add(photo, noise, dtype=cv2.CV_8U), np.uint8)


def _bloom(photo: Picture, strength: float, unit: float) -> Picture:
    """Light that spills from what is over-exposed."""
    import cv2

    small = cv2.resize(photo, None, fx=0.25, fy=0.25, interpolation=cv2.INTER_AREA)
    bright = np.where(small.max(axis=2, keepdims=True) > 215, small, 0).astype(np.uint8)
    glow = cv2.GaussianBlur(bright, (0, 0), max(0.6, 3 * unit))
    glow = cv2.resize(glow, photo.shape[1::-1], interpolation=cv2.INTER_LINEAR)
    return np.asarray(cv2.addWeighted(photo, 1.0, glow, strength, 0), np.uint8)


def develop(rng: np.random.Generator, photo: Picture, mean: float) -> Picture:
    """The picture as a phone would have taken it, uint8 (h, w, 3).

    Parameters
    ----------
    photo
        Without effects.
    mean
        Its brightness where the exposure is measured, 0 to 255.
    """
    import cv2

    height, width = photo.shape[:2]
    unit = max(width, height) / 640
    gain, glare = lighting(rng, (height, width))
    channels, gamma = _tone(rng, mean)
    planes = [
        (plane * gain + glare) * c for plane, c in zip(cv2.split(photo), channels, strict=True)
    ]
    if chance(rng, 0.2):  # washed out, or grey altogether
        grey = (planes[0] + planes[1] + planes[2]) * np.float32(1 / 3)
        fade = np.float32(rng.uniform(0.1, 0.7) if chance(rng, 0.75) else 1.0)
        planes = [plane + fade * (grey - plane) for plane in planes]
    out = np.asarray(cv2.merge([cv2.convertScaleAbs(np.maximum(p, 0)) for p in planes]), np.uint8)
    if gamma != 1.0:
        curve = 255 * (np.arange(256) / 255) ** gamma
        out = np.asarray(cv2.LUT(out, np.rint(curve).astype(np.uint8)), np.uint8)
    if chance(rng, 0.4):
        out = _bloom(out, rng.uniform(0.1, 0.5), unit)
    out = _blurred(rng, out, unit)
    small = 1.0
    if chance(rng, 0.25):  # a smaller photo made larger
        small = rng.uniform(0.45, 0.95)
        size = (max(16, round(width * small)), max(16, round(height * small)))
        out = np.asarray(cv2.resize(out, size, interpolation=cv2.INTER_AREA), np.uint8)
    out = _noisy(rng, out)
    if chance(rng, 0.25):
        sharp = rng.uniform(0.2, 1.0)
        soft = cv2.GaussianBlur(out, (0, 0), 1.2)
        out = np.asarray(cv2.addWeighted(out, 1 + sharp, soft, -sharp, 0), np.uint8)
    if small < 1:
        out = np.asarray(cv2.resize(out, (width, height), interpolation=cv2.INTER_LINEAR), np.uint8)
    if chance(rng, 0.7):
        quality = [cv2.IMWRITE_JPEG_QUALITY, whole(rng, 25, 95)]
        _, data = cv2.imencode(".jpg", cv2.cvtColor(out, cv2.COLOR_RGB2BGR), quality)
        decoded = cv2.imdecode(data, cv2.IMREAD_COLOR)
        assert decoded is not None
        out = np.asarray(cv2.cvtColor(decoded, cv2.COLOR_BGR2RGB), np.uint8)
    return np.ascontiguousarray(out)
