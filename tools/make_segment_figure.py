"""Draw docs/images/segmentation.png: rendered panels, and what the network finds in them.

Renders only: the photos that the network was measured on belong to others. The same run gives
the same picture. Usage: python tools/make_segment_figure.py [FILE] [WEIGHTS.onnx]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from PIL import Image

from fronto.draw_segments import draw_segments
from fronto.engine import Engine
from fronto.segmentation import segment
from fronto.synth.photo import render_photo

#: Renders with different panels; neither training nor benchmarks use these numbers.
SEEDS = ((7, 1, 15), (7, 1, 18), (7, 1, 7), (7, 1, 10))
COLUMNS, GAP, WIDTH = 2, 16, 1280
BACK = 255


def found(seed: tuple[int, ...], engine: Engine) -> np.ndarray:
    """A render, its buttons tinted, named, and outlined."""
    photo = render_photo(np.random.default_rng(seed))
    return draw_segments(photo.image, segment(photo.image, engine=engine))


def sheet(pictures: list[np.ndarray]) -> np.ndarray:
    """Pictures of one size, side by side and in rows."""
    height, width = pictures[0].shape[:2]
    rows = -(-len(pictures) // COLUMNS)
    shape = (rows * (height + GAP) - GAP, COLUMNS * (width + GAP) - GAP, 3)
    canvas = np.full(shape, BACK, np.uint8)
    for k, picture in enumerate(pictures):
        y, x = k // COLUMNS * (height + GAP), k % COLUMNS * (width + GAP)
        canvas[y : y + height, x : x + width] = picture
    return canvas


def main(path: Path, weights: Path | None) -> None:
    engine = Engine(weights)
    picture = Image.fromarray(sheet([found(seed, engine) for seed in SEEDS]))
    size = (WIDTH, round(WIDTH * picture.height / picture.width))
    path.parent.mkdir(parents=True, exist_ok=True)
    picture.resize(size, Image.Resampling.LANCZOS).save(path, optimize=True)


if __name__ == "__main__":
    main(
        Path(sys.argv[1] if len(sys.argv) > 1 else "docs/images/segmentation.png"),
        Path(sys.argv[2]) if len(sys.argv) > 2 else None,
    )
