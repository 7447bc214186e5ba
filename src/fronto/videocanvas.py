"""One canvas for all frames of a video, on which the panel stays where it is.

With the frame's rotation R and K the camera's matrix, R K⁻¹ p = w (x, y, 1) is a point of the
panel's plane at depth 1; the camera's own shift moves and scales the panel there. So a scale
and a translation A for each frame put its buttons where the first frame had them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from fronto.camera import Camera
from fronto.pose.presupposed import place_on
from fronto.results import PanelPose
from fronto.shapes import FloatArray
from fronto.warp.canvas import Canvas, Crop, plan_canvas

__all__ = ["SteadyCanvas", "seen_with"]

#: Buttons are the same where their centres are closer than this share of a button's side.
REACH = 0.35
#: A shift that matches this share of the buttons less than the best may be taken as well.
SLACK = 0.15
#: A shift has to match this share of the buttons.
AGREEING = 0.5
#: Buttons of a frame that shifts are tried with.
TRIED = 8


def seen_with(pose: PanelPose, camera: Camera, rotation: FloatArray) -> PanelPose:
    """The pose with another rotation and camera, and its buttons at their places in the photo.

    Their corners on the plane z = 1 change such that they project to the same undistorted
    pixels as before.
    """
    turn = (
        rotation @ np.linalg.inv(camera.matrix) @ pose.camera.matrix @ np.asarray(pose.rotation).T
    )
    flat = pose.plane_corners.reshape(-1, 2)
    points = np.column_stack([flat, np.ones(len(flat))]) @ turn.T
    with np.errstate(divide="ignore", invalid="ignore"):
        corners = np.where(points[:, 2:] > 0, points[:, :2] / points[:, 2:], np.nan)
    return replace(
        pose,
        status="ok",
        reasons=(),
        rotation=rotation,
        camera=camera,
        plane_corners=corners.reshape(-1, 4, 2),
    )


@dataclass(frozen=True)
class _Placement:
    """A: canvas pixel = scale * plane point + shift."""

    scale: float
    shift: FloatArray

    @property
    def matrix(self) -> FloatArray:
        x, y = self.shift
        return np.array([[self.scale, 0.0, x], [0.0, self.scale, y], [0.0, 0.0, 1.0]])

    def __call__(self, points: FloatArray) -> FloatArray:
        return np.asarray(self.scale * points + self.shift)


class SteadyCanvas:
    """Plans the canvas of one frame after the other, all of one size.

    The first one that may, sets the size (made even, as video codecs want it), the scale,
    and where each button belongs. In later frames the buttons are matched with those by
    their places, and the frame is put there. Where none match, the canvas is planned anew,
    within the same size, if the frame may do that; else the last scale and shift are kept.

    Parameters
    ----------
    crop, scale, margin, max_pixels
        As of :func:`fronto.warp_panel`, for the first frame.
    """

    def __init__(self, *, crop: Crop, scale: float, margin: float, max_pixels: int) -> None:
        self._crop = crop
        self._scale = scale
        self._margin = margin
        self._max_pixels = max_pixels
        self._last: _Placement | None = None
        self._reference = np.zeros((0, 4, 2))
        #: Width and height, pixels; None before the first canvas.
        self.size_px: tuple[int, int] | None = None

    def plan(self, camera: Camera, pose: PanelPose, *, may_start: bool) -> Canvas | None:
        """Plan the canvas of a frame; None as long as there is none to go on from.

        Parameters
        ----------
        camera
            At the frame's size.
        pose
            With the rotation to draw with, as of `seen_with`.
        may_start
            Whether this frame's buttons may say where the panel belongs on the canvas.

        Raises
        ------
        InputError
            If the pose allows no picture (as of `warp_panel`).
        """
        corners = pose.plane_corners
        may_start = may_start and len(corners) > 0
        if self._last is None and not may_start:
            return None
        plan = plan_canvas(
            camera,
            pose,
            crop=self._crop,
            margin=self._margin,
            scale=self._scale,
            max_pixels=self._max_pixels,
            standard_corners=None,
        )
        to_plane = pose.rotation @ np.linalg.inv(camera.matrix)
        own = plan.homography @ np.linalg.inv(to_plane)
        planned = _Placement(float(own[0, 0]), own[:2, 2])
        placed = self._registered(corners)
        if placed is None and may_start:
            if self.size_px is None:
                even = (plan.width_px + plan.width_px % 2, plan.height_px + plan.height_px % 2)
                self.size_px, placed = even, planned
            else:
                placed = _fitted(planned, (plan.width_px, plan.height_px), self.size_px)
            self._reference = placed(corners)
        placed = placed or self._last
        assert placed is not None
        assert self.size_px is not None
        self._last = placed
        return replace(
            plan,
            homography=placed.matrix @ to_plane,
            width_px=self.size_px[0],
            height_px=self.size_px[1],
            scale=plan.scale * placed.scale / planned.scale,
        )

    def _registered(self, corners: FloatArray) -> _Placement | None:
        """Scale and shift that put the buttons (n, 4, 2) on those of the reference."""
        if self._last is None or not len(corners):
            return None
        side = _side(self._reference)
        # The camera may have come closer since: then the sides tell the scale.
        scales = (self._last.scale, side / _side(corners))
        centers, homes = corners.mean(axis=1), self._reference.mean(axis=1)
        found = []
        for scale in scales:
            # About where the frame's buttons were last, whatever the scale.
            middle = centers.mean(axis=0)
            expected = self._last(middle) - scale * middle
            found.append((scale, *_shift(scale * centers, homes, expected, REACH * side)))
        scale, shift, count = max(found, key=lambda one: one[2])
        if count < max(1, AGREEING * min(len(centers), len(homes))):
            return None
        distance = _distances(scale * centers + shift, homes)
        nearest = distance.argmin(axis=1)
        same = distance.min(axis=1) <= REACH * side
        if same.sum() < 2:  # one button's size is no good measure of the scale
            scale = self._last.scale
            return _Placement(scale, homes[nearest[same]][0] - scale * centers[same][0])
        target = self._reference[nearest[same]].reshape(-1, 2)
        placed = place_on(target, corners[same].reshape(-1, 2))
        return _Placement(float(placed[0, 0]), placed[:2, 2])


def _shift(
    centers: FloatArray, homes: FloatArray, expected: FloatArray, reach: float
) -> tuple[FloatArray, int]:
    """The translation that puts centres (n, 2) on homes (m, 2), and how many.

    Every pair votes. On a regular panel several shifts do about as well: the one that is
    closest to the expected one is taken.
    """
    order = np.argsort(np.linalg.norm(centers - centers.mean(axis=0), axis=1))[:TRIED]
    shifts = (homes[None] - centers[order][:, None]).reshape(-1, 2)
    shifts = np.concatenate([expected[None], shifts])
    counts = np.array(
        [int((_distances(centers + one, homes).min(axis=1) <= reach).sum()) for one in shifts]
    )
    good = counts >= counts.max() - SLACK * min(len(centers), len(homes))
    away = np.where(good, np.linalg.norm(shifts - expected, axis=1), np.inf)
    best = int(away.argmin())
    return shifts[best], int(counts[best])


def _distances(points: FloatArray, others: FloatArray) -> FloatArray:
    return np.asarray(np.linalg.norm(points[:, None] - others[None], axis=2))


def _side(corners: FloatArray) -> float:
    sides = corners - np.roll(corners, 1, axis=1)
    return float(np.median(np.linalg.norm(sides, axis=2)))


def _fitted(planned: _Placement, size: Sequence[int], canvas: Sequence[int]) -> _Placement:
    """A planned picture of a size in the middle of a canvas of another, as large as fits."""
    have, want = np.asarray(size, dtype=np.float64), np.asarray(canvas, dtype=np.float64)
    factor = float((want / have).min())
    shift = factor * (planned.shift + 0.5) - 0.5 + 0.5 * (want - factor * have)
    return _Placement(factor * planned.scale, shift)
