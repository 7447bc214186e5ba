"""Panels of exact outlines: masks of pixel centres, pictures of pixel areas, errors."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import cv2
import numpy as np
from panelforms import Form, random_view

from fronto import Outline, Segment, Segments
from fronto.shapes import FloatArray

#: Samples of a pixel's area, along each axis.
SUBPIXELS = 8
MARGIN_PX = 14


@dataclass(frozen=True, eq=False)
class Panel:
    """Buttons of one photo."""

    forms: tuple[Form, ...]
    width: int
    height: int

    def segments(self, category="number", off: FloatArray | None = None) -> Segments:
        """Exact masks: pixels whose centre lies inside; moved by `off` (n, 2) or not."""
        moved = self.forms
        if off is not None:
            moved = tuple(f.shifted(*d) for f, d in zip(self.forms, off, strict=True))
        return Segments(self.width, self.height, tuple(self._segment(f, category) for f in moved))

    def _box(self, form: Form) -> tuple[int, int, int, int]:
        edge = form.edge(8, 8)
        low, high = np.floor(edge.min(axis=0)) - 3, np.ceil(edge.max(axis=0)) + 4
        x0, y0 = np.clip(low, 0, (self.width, self.height)).astype(int)
        x1, y1 = np.clip(high, 0, (self.width, self.height)).astype(int)
        return int(x0), int(y0), int(x1), int(y1)

    def _segment(self, form: Form, category: str) -> Segment:
        x0, y0, x1, y1 = self._box(form)
        mask = form.inside(pixels(x0, y0, x1, y1))
        return Segment(
            category,
            0.9,
            (x0 - 0.5, y0 - 0.5, x1 - 0.5, y1 - 0.5),
            (x0, y0),
            mask.astype(np.float32),
        )

    def _paint(self, image: FloatArray, form: Form, level: object) -> None:
        """Lay a form over the image, each pixel by the share of its area that it covers."""
        x0, y0, x1, y1 = self._box(form)
        places = pixels(x0, y0, x1, y1)
        mask = form.inside(places)
        cell = np.ones((3, 3), np.uint8)
        mixed = cv2.dilate(mask.astype(np.uint8), cell) != cv2.erode(mask.astype(np.uint8), cell)
        part = (np.arange(SUBPIXELS) + 0.5) / SUBPIXELS - 0.5
        grid = np.stack(np.meshgrid(part, part), axis=2).reshape(-1, 2)
        share = mask.astype(float)
        share[mixed] = form.inside(places[mixed][:, None] + grid).mean(axis=1)
        under = image[y0:y1, x0:x1]
        under += share[..., None] * (np.asarray(level, float) - under)

    def picture(
        self,
        layers: Sequence[tuple[Sequence[Form], object]] | None = None,
        *,
        ground=90.0,
        face=165.0,
        blur=0.7,
        noise=2.0,
        light=0.0,
        seed=0,
    ) -> np.ndarray:
        """The photo, (height, width, 3) uint8.

        `layers` are painted one over the other, each with its grey level or (r, g, b); None:
        the buttons, in `face`. `blur` is a Gaussian's deviation in pixels, `noise` one in grey
        levels, `light` how much brighter the photo's right end is than its left one.
        """
        image = np.full((self.height, self.width, 3), np.asarray(ground, float))
        for forms, level in layers or [(self.forms, face)]:
            for form in forms:
                self._paint(image, form, level)
        image *= (1 + light * np.linspace(-0.5, 0.5, self.width))[None, :, None]
        if blur:
            image = cv2.GaussianBlur(image, (0, 0), blur)
        image += np.random.default_rng(seed).normal(0, noise, image.shape)
        return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def pixels(x0: int, y0: int, x1: int, y1: int) -> FloatArray:
    """Centres (h, w, 2) of the pixels of a box."""
    return np.stack(np.meshgrid(np.arange(x0, x1), np.arange(y0, y1)), axis=2).astype(float)


def panel(
    rng: np.random.Generator,
    make: Callable[..., Form],
    *,
    columns=4,
    rows=3,
    side=30.0,
    to_px: FloatArray | None = None,
    pitch=1.7,
    **options,
) -> Panel:
    """Buttons on a grid, anywhere between the pixels, in a photo just large enough."""
    to_px = random_view(rng) if to_px is None else to_px
    reach = max(options.get("ratio", 1.0), 1.0)
    places = [
        (
            (c - (columns - 1) / 2) * pitch * side * reach,
            (r - (rows - 1) / 2) * pitch * side * reach,
        )
        for r in range(rows)
        for c in range(columns)
    ]
    made = [make(to_px, at, side, **options) for at in places]
    edges = np.concatenate([f.edge(8, 8) for f in made])
    low = np.floor(edges.min(axis=0)) - MARGIN_PX - rng.uniform(0, 1, 2)
    width, height = np.ceil(edges.max(axis=0) - low).astype(int) + MARGIN_PX
    return Panel(tuple(f.shifted(*-low) for f in made), int(width), int(height))


def corner_errors(made: Panel, found: Sequence[Outline]) -> FloatArray:
    """(n, 4, 2) pixels; all of the panel's buttons must have been found, as quads."""
    assert [o.shape for o in found] == ["quad"] * len(made.forms)
    return np.stack([o.corners_px - f.corners_px for o, f in zip(found, made.forms, strict=True)])


def ellipse_errors(made: Panel, found: Sequence[Outline]) -> FloatArray:
    """(n, 4): of the centres and semi-axes, pixels; all must have been found, as ellipses."""
    assert [o.shape for o in found] == ["ellipse"] * len(made.forms)
    numbers = [
        [(e.cx, e.cy, e.a, e.b) for e in (o.ellipse_px, f.ellipse_px)]
        for o, f in zip(found, made.forms, strict=True)
    ]
    return np.array([np.subtract(*pair) for pair in numbers])


def rms(errors: FloatArray) -> float:
    return float(np.sqrt(np.mean(np.square(errors))))
