"""Where the camera is: draws of intrinsics and poses, and clipping to what it sees."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fronto.camera import Camera
from fronto.pose.rotation import rotation_from_angles
from fronto.shapes import FloatArray
from fronto.synth.photo.draws import chance, log_uniform, pick
from fronto.synth.photo.forms import project
from fronto.synth.photo.plan import Plan

__all__ = ["View", "clipped", "sample_camera", "sample_view", "visible_part"]

#: What is nearer than this to the camera's plane is cut off, metres.
NEAR_M = 0.02
#: Beyond this angle between the panel's normal and a ray, buttons are slivers.
MAX_OBLIQUE_DEG = 68.0
TRIES = 50


@dataclass(frozen=True, eq=False)
class View:
    """A camera before a panel; conventions as in ``fronto.synth.scene.Scene``.

    Parameters
    ----------
    camera
        Without lens distortion.
    rotation
        Shape (3, 3): takes camera rays to the panel frame.
    translation
        Shape (3,), metres: panel point X is at rotationᵀ (X + translation).
    """

    camera: Camera
    rotation: FloatArray
    translation: FloatArray

    @property
    def homography(self) -> FloatArray:
        """Panel metres to homogeneous photo pixels with the depth last, shape (3, 3)."""
        t = self.translation
        plane = np.array([[1, 0, t[0]], [0, 1, t[1]], [0, 0, t[2]]])
        return np.asarray(self.camera.matrix @ self.rotation.T @ plane)


def sample_camera(rng: np.random.Generator, width: int, height: int) -> Camera:
    """A pinhole camera of 40 to 90 degrees across the longer side."""
    focal = max(width, height) / 2 / np.tan(np.radians(rng.uniform(40, 90)) / 2)
    off = rng.normal(0, 0.01, 2) * (width, height) if chance(rng, 0.5) else np.zeros(2)
    x, y = (width - 1) / 2 + float(off[0]), (height - 1) / 2 + float(off[1])
    return Camera.from_matrix([[focal, 0, x], [0, focal, y], [0, 0, 1]], width, height)


def _angles(rng: np.random.Generator) -> FloatArray:
    """The three angles, radians: most views are mild, all of ±40 degrees occurs."""
    reach = pick(rng, (4.0, 14.0, 25.0, 40.0), (1, 3, 2, 2))
    angles = rng.uniform(-reach, reach, 3)
    if chance(rng, 0.6):  # people hold cameras upright
        angles[2] *= 0.25
    return np.asarray(np.radians(angles))


def sample_view(rng: np.random.Generator, plan: Plan, camera: Camera) -> View:
    """A view in which the panel covers a quarter to three times the photo's size."""
    size = np.array([camera.width_px, camera.height_px], np.float64)
    focal = camera.focal_px
    spots = np.array([(e.x, e.y) for e in plan.elements]) / 1000
    low, high = spots.min(axis=0), spots.max(axis=0)
    field = high - low + 2 * plan.unit / 1000
    view = None
    for _ in range(TRIES):
        rotation = rotation_from_angles(*_angles(rng))
        # The share of the photo that the field of buttons takes, bounded by their size.
        cover = log_uniform(rng, 0.25, 3.0) if chance(rng, 0.4) else log_uniform(rng, 0.45, 1.3)
        scale = cover * float((size / field).min())
        smallest = rng.uniform(9, 14) / (plan.unit / 1000)
        largest = rng.uniform(0.25, 0.65) * float(size.min()) / (plan.unit / 1000)
        distance = focal / float(np.clip(scale, min(smallest, largest), largest))
        focus = (low + high) / 2
        if (field * focal / distance > size).any():
            focus = spots[int(rng.integers(len(spots)))]
        reach = pick(rng, (0.15, 0.4, 0.8), (3, 3, 1))
        ray = camera.rays((size * (0.5 + reach * rng.uniform(-0.5, 0.5, 2)) - 0.5)[None])[0]
        toward = rotation @ (ray / np.linalg.norm(ray))
        translation = distance * toward - np.append(focus, 0.0)
        view = View(camera, rotation, np.asarray(translation))
        if toward[2] > np.cos(np.radians(MAX_OBLIQUE_DEG)):
            return view
    frontal = np.array([*-(low + high) / 2, focal * float((field / size).max())])
    return View(camera, np.eye(3), frontal)


def clipped(polygon: FloatArray, bounds: FloatArray) -> FloatArray:
    """The part of a convex polygon (n, 2) where all of `bounds` (k, 3) · (x, y, 1) >= 0."""
    for bound in bounds:
        if len(polygon) == 0:
            break
        side = polygon @ bound[:2] + bound[2]
        if (side >= 0).all():
            continue
        following, next_side = np.roll(polygon, -1, axis=0), np.roll(side, -1)
        kept = []
        for a, b, s, t in zip(polygon, following, side, next_side, strict=True):
            if s >= 0:
                kept.append(a)
            if (s >= 0) != (t >= 0):
                kept.append(a + (b - a) * (s / (s - t)))
        polygon = np.array(kept).reshape(-1, 2)
    return polygon


def visible_part(polygon: FloatArray, view: View, margin_px: float = 0.0) -> FloatArray:
    """The part of a convex polygon on the panel (n, 2), metres, that the photo shows."""
    h = view.homography
    width, height = view.camera.width_px, view.camera.height_px
    near = h[2] - [0, 0, NEAR_M]
    edge = 0.5 + margin_px
    bounds = [near, h[0] + edge * h[2], (width - 1 + edge) * h[2] - h[0]]
    bounds += [h[1] + edge * h[2], (height - 1 + edge) * h[2] - h[1]]
    return clipped(polygon, np.array(bounds))


def to_photo(view: View, points: FloatArray) -> FloatArray:
    """Panel metres (n, 2) to photo pixels (n, 2); the points lie before the camera."""
    image = project(view.homography, points)
    return np.asarray(image[:, :2] / image[:, 2:])
