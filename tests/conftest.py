"""Exact views of panels, projected here without the package's own geometry."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest

from fronto import Camera, Ellipse, Outline, PanelPose
from fronto.shapes import FloatArray
from fronto.synth import PAPER_CAMERA, LayoutButton


def paper_rotation(tx_deg, ty_deg, tz_deg):
    """R_x R_y R_z in the paper's signs (Eqs. 3-5)."""
    (a, b, c), (x, y, z) = np.cos(t := np.radians([tx_deg, ty_deg, tz_deg])), np.sin(t)
    return np.asarray(
        np.array([[1, 0, 0], [0, a, x], [0, -x, a]])
        @ np.array([[b, 0, -y], [0, 1, 0], [y, 0, b]])
        @ np.array([[c, z, 0], [-z, c, 0], [0, 0, 1]])
    )


@dataclass(frozen=True)
class View:
    """A panel seen by a camera; `rotation` takes camera rays to the panel frame."""

    buttons: tuple[LayoutButton, ...]
    camera: Camera
    rotation: FloatArray
    translation: FloatArray
    outlines: tuple[Outline, ...]

    def error_deg(self, pose: PanelPose | FloatArray) -> float:
        """Angle between a pose and the truth."""
        rotation = pose.rotation if isinstance(pose, PanelPose) else pose
        turn = rotation @ self.rotation.T
        sine = np.linalg.norm(turn - turn.T) / np.sqrt(8)
        return float(np.degrees(np.arctan2(sine, (np.trace(turn) - 1) / 2)))

    def project(self, points: object) -> FloatArray:
        """Panel points (..., 2) in metres to pixels (..., 2)."""
        return project(points, self.rotation, self.translation, self.camera.matrix)

    def noisy(self, seed: int, sigma_px: float) -> View:
        """Gaussian noise on every corner, and on the centre and axes of every ellipse."""
        rng = np.random.default_rng(seed)
        outlines = []
        for outline in self.outlines:
            if outline.corners_px is not None:
                seen = outline.corners_px + rng.normal(0, sigma_px, (4, 2))
                outlines.append(replace(outline, corners_px=seen, std_px=sigma_px))
            else:
                e = outline.ellipse_px
                values = np.array([e.cx, e.cy, e.a, e.b]) + rng.normal(0, sigma_px, 4)
                values[2:] = np.sort(values[2:])[::-1]
                seen = Ellipse(*values.tolist(), e.angle_deg)
                outlines.append(replace(outline, ellipse_px=seen, std_px=sigma_px))
        return replace(self, outlines=tuple(outlines))


def project(points, rotation, translation, matrix):
    points = np.asarray(points, dtype=float)
    plane = np.concatenate([points, np.zeros((*points.shape[:-1], 1))], axis=-1)
    rays = (plane + translation) @ rotation @ np.asarray(matrix).T
    return rays[..., :2] / rays[..., 2:]


def circle_image(x, y, radius, rotation, translation, matrix, high=None):
    """The ellipse of a circle, or of an oval half as `high` and `radius` wide.

    From its point conic H⁻ᵀ C H⁻¹ (the package uses the dual).
    """
    base = rotation.T @ np.array([[1, 0, x], [0, 1, y], [0, 0, 0.0]])
    H = np.asarray(matrix) @ (base + np.outer(rotation.T @ translation, [0, 0, 1]))
    inverse = np.linalg.inv(H)
    conic = inverse.T @ np.diag([1, (radius / (high or radius)) ** 2, -(radius**2)]) @ inverse
    center = -np.linalg.solve(conic[:2, :2], conic[:2, 2])
    level = -(conic[2, 2] + conic[2, :2] @ center)
    (low, high), vectors = np.linalg.eigh(conic[:2, :2] / level)
    angle = np.degrees(np.arctan2(vectors[1, 0], vectors[0, 0]))
    return Ellipse(*center.tolist(), 1 / np.sqrt(low), 1 / np.sqrt(high), float(angle))


def view_of(
    buttons,
    angles_deg,
    *,
    at_px=(320.0, 240.0),
    distance_m=0.5,
    camera=PAPER_CAMERA,
    std_px=0.01,
):
    """The panel's origin on the ray of `at_px`, `distance_m` from the camera, exact outlines."""
    rotation = paper_rotation(*angles_deg)
    ray = np.linalg.solve(camera.matrix, [*at_px, 1.0])
    translation = rotation @ (distance_m * ray / np.linalg.norm(ray))
    outlines = []
    for b in buttons:
        if b.shape == "quad":
            half = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [b.width / 2, b.height / 2]
            corners = project(np.add(half, [b.x, b.y]), rotation, translation, camera.matrix)
            outlines.append(Outline.quad(corners, std_px=std_px, text=b.text))
        else:
            half = (b.width / 2, b.height / 2)
            ellipse = circle_image(b.x, b.y, half[0], rotation, translation, camera.matrix, half[1])
            outlines.append(Outline("ellipse", ellipse_px=ellipse, std_px=std_px, text=b.text))
    return View(tuple(buttons), camera, rotation, translation, tuple(outlines))


def grid_of(columns, rows, *, pitch_m=0.045, width_m=0.03, height_m=None, shape="quad"):
    """Buttons on a grid around the origin, row by row, texts "0", "1", ..."""
    return tuple(
        LayoutButton(
            (c - (columns - 1) / 2) * pitch_m,
            (r - (rows - 1) / 2) * pitch_m,
            width_m,
            height_m or width_m,
            shape,
            text=str(r * columns + c),
        )
        for r in range(rows)
        for c in range(columns)
    )


@pytest.fixture(scope="session")
def view():
    return view_of


@pytest.fixture(scope="session")
def grid():
    return grid_of


@pytest.fixture(scope="session")
def rotation_of():
    return paper_rotation
