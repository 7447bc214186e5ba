"""Draw docs/images/before_after.png from examples/: each photo beside its head-on view.

Usage: python tools/make_readme_figure.py [FILE]
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

import fronto
from fronto.draw_before_after import draw_before_after
from fronto.outlinefile import read_outlines

EXAMPLES = Path(__file__).parent.parent / "examples"
GAP, WIDTH = 24, 1280


def before_after(name: str) -> np.ndarray:
    photo = np.asarray(Image.open(EXAMPLES / f"{name}.png"))
    height, width = photo.shape[:2]
    camera = fronto.Camera.from_file(EXAMPLES / "camera.yaml", width, height)
    outlines = read_outlines(EXAMPLES / f"{name}.outlines.json").outlines
    # The buttons say themselves what they are; names beside them would cover others.
    outlines = [replace(outline, category="", text="") for outline in outlines]
    panel = fronto.rectify_outlines(photo, outlines, camera, margin=0.62, scale=1.5)
    return draw_before_after(photo, panel)


def main(path: Path) -> None:
    pictures = [before_after(name) for name in ("hall", "car")]
    height = pictures[0].shape[0]
    gap = np.full((height, GAP, 3), 255, np.uint8)
    row = np.concatenate([pictures[0], gap, pictures[1]], axis=1)
    picture = Image.fromarray(row)
    size = (WIDTH, round(WIDTH * picture.height / picture.width))
    path.parent.mkdir(parents=True, exist_ok=True)
    picture.resize(size, Image.Resampling.LANCZOS).save(path, optimize=True)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/images/before_after.png"))
