"""Labels beside what is pressed: one piece with a label on one part and a knob on the other."""

from __future__ import annotations

import cv2
import numpy as np

from fronto.shapes import FloatArray
from fronto.synth.photo.draws import chance, log_uniform, pick, smooth_noise
from fronto.train.reader.inks import Bytes
from fronto.train.reader.jitter import Sample

__all__ = ["beside"]

#: Height of the picture, pixels, and what is around the piece, in its heights.
TALL_PX, AROUND = 72, 0.2


def beside(label: Sample, knob: Sample, rng: np.random.Generator) -> Sample:
    """Put a label and a knob without one next to each other, as one button.

    Parameters
    ----------
    label
        What the button is to be read as.
    knob
        A blank one.
    rng
        Draws how.

    Returns
    -------
    A picture of both whose box is around both; its target is the label's.
    """
    share = rng.uniform(0.35, 0.6)  # of the length, for the label
    aspect = log_uniform(rng, 1.1, 2.2)
    upright = chance(rng, 0.12)
    long = TALL_PX if upright else round(TALL_PX * aspect)
    first, second = max(8, round(long * share)), max(8, round(long * (1 - share)))
    tall = round(TALL_PX / aspect) if upright else TALL_PX
    sizes = [(tall, first), (tall, second)] if upright else [(first, tall), (second, tall)]
    # The label's own rim mostly stays outside: both are on one face.
    inner = rng.uniform(0.8, 1.0)
    parts = [_part(label, inner, sizes[0]), _part(knob, rng.uniform(0.95, 1.2), sizes[1])]
    if chance(rng, 0.5):
        parts[1] = _toned(parts[1], parts[0], rng)
    if chance(rng, 0.3):
        parts.reverse()
    face = np.concatenate(parts, axis=0 if upright else 1)
    margin = round(AROUND * tall)
    frame = pick(rng, (cv2.BORDER_REPLICATE, cv2.BORDER_REFLECT_101, cv2.BORDER_CONSTANT))
    color = [float(c) for c in rng.integers(0, 256, 3)]
    edged = cv2.copyMakeBorder(face, margin, margin, margin, margin, frame, value=color)
    image = np.asarray(edged, np.uint8)
    if chance(rng, 0.5):  # light over both
        light = smooth_noise(rng, image.shape[:2], (long / 1.5, tall / 1.5))
        gain = np.clip(1 + np.float32(rng.uniform(0.1, 0.35)) * light, 0.2, 1.8)
        image = np.asarray(cv2.multiply(image, cv2.merge([gain] * 3), dtype=cv2.CV_8U), np.uint8)
    height, width = face.shape[:2]
    box = (margin - 0.5, margin - 0.5, margin + width - 0.5, margin + height - 0.5)
    return Sample(image, box, label.target)


def _part(sample: Sample, scale: float, size: tuple[int, int]) -> Bytes:
    """What is in a sample's box, enlarged by a factor about its middle, at this size."""
    x0, y0, x1, y1 = sample.box
    middle = np.array([x0 + x1, y0 + y1]) / 2
    half = scale / 2 * np.array([x1 - x0, y1 - y0])
    ends: FloatArray = np.array([middle - half, middle + half])
    step = (ends[1] - ends[0]) / size
    start = ends[0] + step / 2
    matrix = np.array([[step[0], 0, start[0]], [0, step[1], start[1]]])
    flags = cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP
    image = sample.image
    blur = float(step.max())
    if blur > 1.6:  # sampling would alias
        image = np.asarray(cv2.GaussianBlur(image, (0, 0), 0.4 * blur), np.uint8)
    part = cv2.warpAffine(image, matrix, size, flags=flags, borderMode=cv2.BORDER_REPLICATE)
    return np.asarray(part, np.uint8)


def _toned(part: Bytes, other: Bytes, rng: np.random.Generator) -> Bytes:
    """The part in the other's colours, more or less."""
    mean, want = part.mean(axis=(0, 1)), other.mean(axis=(0, 1))
    share = rng.uniform(0.5, 1)
    return np.asarray(np.clip(part + share * (want - mean), 0, 255), np.uint8)
