"""A layout seen by a camera: exact outlines, and outlines as a detector would report them.

The sampling is the one that the project's accuracy targets are stated for: the paper's
camera (640x480, f = 320), R = R_x R_y R_z with each angle uniform in ±40°, the panel
0.3-0.8 m away, Gaussian noise on every corner, one outlier button in a tenth of the scenes.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from fronto.camera import Camera
from fronto.errors import InputError
from fronto.pose.rotation import rotation_from_angles
from fronto.shapes import Ellipse, FloatArray, Outline
from fronto.synth.layouts import Layout

__all__ = ["PAPER_CAMERA", "Scene", "observe", "sample_scene"]

#: The paper's camera (Section V).
PAPER_CAMERA = Camera.from_matrix([[320, 0, 320], [0, 320, 240], [0, 0, 1]], 640, 480)

#: Draws that are refused this often are never accepted.
MAX_TRIES = 10_000


@dataclass(frozen=True, eq=False)
class Scene:
    """One simulated photo with its truth.

    Parameters
    ----------
    layout
        The panel.
    camera
        The camera; its matrix is exact.
    rotation
        Shape (3, 3): takes camera rays to the panel frame (it rectifies).
    translation
        Shape (3,), metres: panel point X is at rotationᵀ (X + translation) in the
        camera frame.
    truth
        The exact outlines, one a button.
    outlines
        The outlines with noise (the same objects as `truth` before `observe`).
    outlier
        Index of the outlier button, or None.
    """

    layout: Layout
    camera: Camera
    rotation: FloatArray
    translation: FloatArray
    truth: tuple[Outline, ...]
    outlines: tuple[Outline, ...]
    outlier: int | None = None

    @property
    def plane_corners(self) -> FloatArray:
        """True corners on the plane z = 1 of the panel frame, (n, 4, 2)."""
        shifted = self.layout.corners + self.translation[:2]
        return np.asarray(shifted / self.translation[2])

    @property
    def corners_px(self) -> FloatArray:
        """True corners in the photo (of circles: of the circumscribed square), (n, 4, 2)."""
        return _project(self.layout.corners, self.rotation, self.translation, self.camera)


def _project(
    points: FloatArray, rotation: FloatArray, translation: FloatArray, camera: Camera
) -> FloatArray:
    """Panel points (..., 2) in metres to photo pixels (..., 2)."""
    flat = np.concatenate([points.reshape(-1, 2), np.zeros((points.size // 2, 1))], axis=1)
    return camera.project((flat + translation) @ rotation).reshape(points.shape)


def _outline(index: int, corners: FloatArray, scene: Scene) -> Outline:
    button = scene.layout.buttons[index]
    if button.shape == "quad":
        return Outline.quad(corners[index], category=button.category, text=button.text)
    # Image of the circle: the plane's conic through the plane-to-image homography.
    K, R, t = scene.camera.matrix, scene.rotation, scene.translation
    H = K @ R.T @ np.array([[1, 0, button.x + t[0]], [0, 1, button.y + t[1]], [0, 0, t[2]]])
    radius2 = (button.width / 2) ** 2
    dual = H @ np.diag([radius2, radius2, -1.0]) @ H.T
    center = dual[:2, 2] / dual[2, 2]
    ellipse = Ellipse.from_shape_matrix(
        center, np.outer(center, center) - dual[:2, :2] / dual[2, 2]
    )
    return Outline("ellipse", ellipse_px=ellipse, category=button.category, text=button.text)


def sample_scene(
    rng: np.random.Generator,
    layout: Callable[[np.random.Generator], Layout],
    *,
    camera: Camera = PAPER_CAMERA,
    max_angle_deg: float = 40.0,
    distance_m: tuple[float, float] = (0.3, 0.8),
    min_side_px: float = 0.0,
    spread: float = 1.0,
    max_oblique_deg: float = 70.0,
) -> Scene:
    """Draw a panel and a view of it with every button inside the photo.

    Parameters
    ----------
    layout
        Draws the panel, e.g. ``hall_layout``.
    max_angle_deg
        Each of θ_x, θ_y, θ_z is uniform in ±this.
    distance_m
        Range of the distance from the camera to the panel's centre.
    min_side_px
        Views with a button side shorter than this are drawn again (the camera comes
        closer than `distance_m` where it has to).
    spread
        The panel's centre is uniform over this share of the photo's width and height:
        1 = anywhere, 0 = always in the middle (which hides more of the perspective).
    max_oblique_deg
        Largest angle between the panel's normal and the ray to its centre: beyond it
        buttons are slivers that nobody can outline.

    Raises
    ------
    InputError
        If none of 10,000 draws meets the arguments.
    """
    for _ in range(MAX_TRIES):
        panel = layout(rng)
        rotation = rotation_from_angles(*np.radians(rng.uniform(-max_angle_deg, max_angle_deg, 3)))
        distance = rng.uniform(*distance_m)
        if min_side_px:
            side = min(min(b.width, b.height) for b in panel.buttons)
            distance = min(distance, camera.focal_px * side / min_side_px * rng.uniform(0.5, 1))
        size = np.array([camera.width_px, camera.height_px])
        ray = camera.rays((size * (0.5 + spread * rng.uniform(-0.5, 0.5, 2)) - 0.5)[None])[0]
        translation = rotation @ (distance * ray / np.linalg.norm(ray))
        if translation[2] < distance * np.cos(np.radians(max_oblique_deg)):
            continue
        corners = _project(panel.corners, rotation, translation, camera)
        if not np.isfinite(corners).all() or (corners < 0).any() or (corners > size - 1).any():
            continue
        sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2)
        if sides.min() < min_side_px:
            continue
        scene = Scene(panel, camera, rotation, translation, (), ())
        truth = tuple(_outline(k, corners, scene) for k in range(len(panel.buttons)))
        return replace(scene, truth=truth, outlines=truth)
    raise InputError(
        "sample_scene",
        f"expected views with all buttons in the photo, sides of at least {min_side_px:g} px "
        f"(min_side_px) and at most {max_oblique_deg:g} degrees oblique (max_oblique_deg), got "
        f"none in {MAX_TRIES} draws of layout, max_angle_deg={max_angle_deg:g}, "
        f"distance_m={distance_m} and spread={spread:g}",
        "lower min_side_px, raise max_oblique_deg or the distance, or draw a smaller layout",
    )


def _noisy_quad(rng: np.random.Generator, outline: Outline, sigma: float, std: float) -> Outline:
    """Noise on every corner; draws that are no convex quadrilateral are drawn again."""
    assert outline.corners_px is not None
    for _ in range(MAX_TRIES):
        corners = outline.corners_px + rng.normal(0, 1, (4, 2)) * sigma
        try:
            return replace(outline, corners_px=corners, std_px=std)
        except InputError:
            continue
    raise InputError(
        "sigma_px",
        f"expected noise that leaves convex quadrilaterals, got {sigma} px and none in "
        f"{MAX_TRIES} draws",
        "give a finite number of pixels, small against the buttons",
    )


def _noisy_ellipse(rng: np.random.Generator, outline: Outline, sigma: float) -> Outline:
    """Noise of a fit to N edge points, one a pixel of circumference, with sigma each.

    Along the unit normal at eccentric anomaly t the fitted ellipse is off by a sum of
    the five ways in which an ellipse can move; for a circle their deviations are
    σ√(2/N) for the centre, σ/√N for the radius and σ√(2/N) for the two of the shape.
    """
    assert outline.ellipse_px is not None
    ellipse = outline.ellipse_px
    values, vectors = np.linalg.eigh(ellipse.shape_matrix)
    root = (vectors * np.sqrt(values)) @ vectors.T
    points = max(12.0, 2 * np.pi * np.sqrt(ellipse.a * ellipse.b))
    mean = float(np.sqrt(ellipse.a * ellipse.b))
    std = sigma * np.sqrt(2 / points)
    grow, stretch, shear = rng.normal(0, std / mean, 3) * [np.sqrt(0.5), 1, 1]
    root = root @ np.array([[1 + grow + stretch, shear], [shear, 1 + grow - stretch]])
    center = ellipse.center + rng.normal(0, std, 2)
    noisy = Ellipse.from_shape_matrix(center, root @ root.T)
    return replace(outline, ellipse_px=noisy, std_px=float(std))


def _outlier(rng: np.random.Generator, outline: Outline) -> Outline:
    """A wrong outline as detectors make them: shifted, of the wrong size, or misshapen."""
    x0, y0, x1, y1 = outline.box_px
    side = float(np.sqrt((x1 - x0) * (y1 - y0)))
    kind = rng.integers(3)
    shift = rng.normal(0, 0.25 * side, 2) if kind == 0 else np.zeros(2)
    factor = float(rng.choice([0.75, 1.35])) if kind == 1 else 1.0
    if outline.ellipse_px is not None:
        e = outline.ellipse_px
        squeeze = float(rng.uniform(0.6, 0.85)) if kind == 2 else 1.0
        center = e.center + shift
        return replace(
            outline,
            ellipse_px=Ellipse(
                float(center[0]),
                float(center[1]),
                e.a * factor,
                e.b * factor * squeeze,
                e.angle_deg,
            ),
        )
    assert outline.corners_px is not None
    center = outline.center_px
    for _ in range(MAX_TRIES):
        corners = center + shift + factor * (outline.corners_px - center)
        if kind == 2:
            corners = corners + rng.normal(0, 0.15 * side, (4, 2))
        try:
            return replace(outline, corners_px=corners)
        except InputError:  # the draw is no convex quadrilateral; draw again
            continue
    raise InputError(
        "scene",
        f"expected a button whose outline can be misshapen, got none in {MAX_TRIES} draws",
        "draw another scene, or give outlier_share=0",
    )


def observe(
    rng: np.random.Generator, scene: Scene, sigma_px: float, *, outlier_share: float = 0.1
) -> Scene:
    """Add noise of `sigma_px` to every corner or edge point, and now and then an outlier.

    Parameters
    ----------
    sigma_px
        Standard deviation per coordinate; 0 leaves the outlines exact.
    outlier_share
        Share of scenes in which one button is wrong altogether.

    Raises
    ------
    InputError
        If `sigma_px` is not finite, or none of 10,000 draws is a convex quadrilateral.
    """
    std = max(sigma_px, 0.01)
    noisy = []
    for outline in scene.truth:
        if outline.corners_px is None:
            noisy.append(
                _noisy_ellipse(rng, outline, sigma_px) if sigma_px else replace(outline, std_px=std)
            )
        else:
            noisy.append(_noisy_quad(rng, outline, sigma_px, std))
    outlier = int(rng.integers(len(noisy))) if rng.uniform() < outlier_share else None
    if outlier is not None:
        noisy[outlier] = _outlier(rng, noisy[outlier])
    return replace(scene, outlines=tuple(noisy), outlier=outlier)
