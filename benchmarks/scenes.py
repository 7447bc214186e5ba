"""Photos of simulated panels for the comparisons: exact truth, one thing varied at a time.

They are drawn by `fronto.synth.render_panel`, not by the renderer that the network learns from.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import cv2
import numpy as np
import numpy.typing as npt

from fronto import Camera, Outline, outline, segment
from fronto.outlines import Outlines
from fronto.pose.rotation import rotation_from_angles
from fronto.segments import Segments
from fronto.synth import PAPER_CAMERA, Layout, LayoutButton
from fronto.synth.look import STEEL, Look
from fronto.synth.render import render_panel

Image = npt.NDArray[np.uint8]
FloatArray = npt.NDArray[np.float64]

DARK = replace(STEEL, wall=(120, 100, 80), plate=(60, 62, 66), button=(190, 190, 186))
BRASS = replace(STEEL, wall=(225, 225, 220), plate=(205, 190, 150), button=(230, 228, 224))
LOOKS = (STEEL, DARK, BRASS)


@dataclass(frozen=True, eq=False)
class Case:
    """One photo, what a way may know of it, and the truth.

    `camera` is what a way is told, `taken_with` what the photo was taken with: they differ
    where a wrong camera is what is tested.
    """

    image: Image
    camera: Camera
    layout: Layout
    rotation: FloatArray
    translation: FloatArray
    taken_with: Camera
    seconds: dict[str, float] = field(default_factory=dict)

    @cached_property
    def corners_px(self) -> FloatArray:
        """True corners in the photo, (n, 4, 2)."""
        points = self.layout.corners.reshape(-1, 2)
        flat = np.concatenate([points, np.zeros((len(points), 1))], axis=1)
        projected = self.taken_with.project((flat + self.translation) @ self.rotation)
        return np.asarray(projected.reshape(self.layout.corners.shape))

    @cached_property
    def segments(self) -> Segments:
        """What the network finds: all ways start from the same."""
        return segment(self.image)

    @cached_property
    def outlines(self) -> Outlines:
        """Corners and ellipses of fronto."""
        return outline(self.segments, self.image)

    @cached_property
    def hough(self) -> Outlines:
        """Corners of the paper."""
        return outline(self.segments, self.image, corners="hough")

    @property
    def quads(self) -> tuple[Outline, ...]:
        return tuple(o for o in self.outlines.buttons if o.corners_px is not None)


Spoil = Callable[[Image, np.random.Generator], Image]


def hall_panel(side_m: float, pitch_m: float, buttons: int) -> Layout:
    """A column of square buttons: up, down and, of three, a keyhole (the paper's Fig. 4)."""
    names = [("up", "up"), ("down", "down"), ("keyhole", "")][:buttons]
    middle = (buttons - 1) / 2
    return Layout(
        "hall",
        tuple(
            LayoutButton(0.0, (k - middle) * pitch_m, side_m, side_m, category=name, text=text)
            for k, (name, text) in enumerate(names)
        ),
    )


def car_panel(columns: int, rows: int, side_m: float = 0.03, pitch_m: float = 0.045) -> Layout:
    """Rows and columns of square buttons, floors from the bottom left upwards."""
    return Layout(
        "car",
        tuple(
            LayoutButton(
                (i - (columns - 1) / 2) * pitch_m,
                (j - (rows - 1) / 2) * pitch_m,
                side_m,
                side_m,
                text=str((rows - 1 - j) * columns + i + 1),
            )
            for j in range(rows)
            for i in range(columns)
        ),
    )


def turned(tilt_deg: float, towards_deg: float, roll_deg: float) -> FloatArray:
    """A rotation that takes rays to the panel: so much off its normal, so much about it."""
    towards = np.radians(towards_deg)
    axis = np.radians(tilt_deg) * np.array([np.cos(towards), np.sin(towards), 0.0])
    tilt = cv2.Rodrigues(axis)[0]
    return np.asarray(rotation_from_angles(0.0, 0.0, np.radians(roll_deg)) @ tilt)


def take(
    rng: np.random.Generator,
    layout: Layout,
    rotation: FloatArray,
    distance_m: float,
    *,
    look: Look = STEEL,
    camera: Camera = PAPER_CAMERA,
    told: Camera | None = None,
    spread_px: float = 50.0,
    noise: float = 2.0,
    spoil: Spoil | None = None,
) -> Case:
    """Photograph a panel whose centre is about the photo's middle.

    `spread_px`: how far off the middle at most, each way. `noise`: of the sensor, grey levels.
    `spoil`: what happens to the picture afterwards.
    """
    middle = np.array([camera.width_px - 1, camera.height_px - 1]) / 2
    ray = camera.rays((middle + rng.uniform(-spread_px, spread_px, 2))[None])[0]
    translation = rotation @ (distance_m * ray / np.linalg.norm(ray))
    image = render_panel(layout, camera, rotation, translation, rng=rng, look=look, noise_std=noise)
    if spoil is not None:
        image = spoil(image, rng)
    return Case(image, camera if told is None else told, layout, rotation, translation, camera)
