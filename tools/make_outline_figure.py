"""Draw docs/images/outlines.png: the example photos, and the outlines found in them.

The same run gives the same picture. Usage: python tools/make_outline_figure.py [FILE]
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from PIL import Image

from fronto import outline, segment
from fronto.draw_outlines import draw_outlines
from fronto.images import as_rgb

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"
GAP, WIDTH = 16, 1280


def found(name: str) -> np.ndarray:
    """An example with its outlines drawn."""
    photo = as_rgb(EXAMPLES / f"{name}.png")
    return draw_outlines(photo, outline(segment(photo), photo))


def main(path: Path) -> None:
    pictures = [found(name) for name in ("hall", "car")]
    gap = np.full((pictures[0].shape[0], GAP, 3), 255, np.uint8)
    picture = Image.fromarray(np.hstack([pictures[0], gap, pictures[1]]))
    size = (WIDTH, round(WIDTH * picture.height / picture.width))
    path.parent.mkdir(parents=True, exist_ok=True)
    picture.resize(size, Image.Resampling.LANCZOS).save(path, optimize=True)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/images/outlines.png"))
