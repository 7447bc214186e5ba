"""Draw docs/images/steps.png: what `fronto rectify examples/car.png --show-steps` shows.

The same run gives the same picture. Usage: python tools/make_steps_figure.py [FILE]
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

from PIL import Image

import fronto
from fronto.draw_steps import draw_steps
from fronto.images import as_rgb

PHOTO = Path(__file__).resolve().parent.parent / "examples" / "car.png"
#: Letters stay legible; with all of its colours the file would be four times as large.
WIDTH, COLORS = 1100, 80
#: Rounds that improve the palette.
ROUNDS = 2


def main(path: Path) -> None:
    photo = as_rgb(PHOTO)
    segments = fronto.segment(photo)
    outlines = fronto.outline(segments, photo, lines=False)
    panel = fronto.rectify(photo)
    # Times differ from run to run.
    sheet = Image.fromarray(draw_steps(photo, segments, outlines, replace(panel, timing_ms={})))
    size = (WIDTH, round(WIDTH * sheet.height / sheet.width))
    small = sheet.resize(size, Image.Resampling.LANCZOS)
    path.parent.mkdir(parents=True, exist_ok=True)
    plain = small.quantize(COLORS, kmeans=ROUNDS, dither=Image.Dither.NONE)
    plain.save(path, optimize=True)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "docs/images/steps.png"))
