"""A photo of a simulated panel on its wall, with outlines known exactly.

The panel is drawn head-on (`fronto.synth.texture`) and seen through the camera by the exact
projection, lens distortion included. Each pixel is the mean over a grid of samples on its
area, so edges are anti-aliased and lie where `Scene.truth` says.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from fronto.camera import Camera
from fronto.errors import InputError
from fronto.shapes import FloatArray, frozen_array
from fronto.synth.layouts import Layout
from fronto.synth.look import STEEL, Look
from fronto.synth.texture import Plate, draw_plate, plate_box

__all__ = ["render_panel"]

#: What a ray shows that meets no wall: the wall's far end, in the dark.
FAR_GREY = 0.45
#: Metres that the plaster's tile covers, and its pixels.
TILE_M, TILE_PX = 0.32, 512
#: The door frame: distance from the plate and width, metres; its colour.
DOOR_GAP_M, DOOR_WIDTH_M = 0.10, 0.055
DOOR_FRAME, DOOR = (150.0, 153.0, 158.0), (104.0, 108.0, 115.0)
#: Radius of the lamp's pool of light, metres.
POOL_M = 0.45
#: Sample points rendered at once.
BLOCK = 1_000_000
TEXTURE_PX_PER_MM = (2.0, 16.0)
MAX_TEXTURE_PIXELS = 40_000_000


def render_panel(
    layout: Layout,
    camera: Camera,
    rotation: npt.ArrayLike,
    translation: npt.ArrayLike,
    *,
    rng: np.random.Generator,
    look: Look = STEEL,
    texture_px_per_mm: float | None = None,
    supersampling: int = 4,
    noise_std: float = 0.0,
) -> npt.NDArray[np.uint8]:
    """Photograph a panel.

    Parameters
    ----------
    layout
        The panel.
    camera
        The camera; its lens distortion is in the picture.
    rotation
        Shape (3, 3), takes camera rays to the panel frame, as in `fronto.synth.Scene`.
    translation
        Shape (3,), metres: panel point X is at rotationᵀ (X + translation).
    rng
        Draws what varies: brushing, plaster, display, the lit button, sensor noise. The
        same state gives the same picture.
    look
        Materials; `fronto.synth.look.FLAT` for edges and nothing else.
    texture_px_per_mm
        Resolution of the panel before it is photographed. None: one sample of the photo
        is about one texture pixel where the camera is closest.
    supersampling
        Samples along each side of a pixel, 1 to 16.
    noise_std
        Standard deviation of the sensor's noise, grey levels.

    Returns
    -------
    Shape (camera.height_px, camera.width_px, 3), uint8, RGB.

    Raises
    ------
    InputError
        If the rotation is none, the panel lies behind the camera, or a number is out of
        its range.
    """
    R, t = _check_view(rotation, translation)
    if not 1 <= supersampling <= 16:
        raise InputError("supersampling", f"expected 1 to 16, got {supersampling}")
    if not (np.isfinite(noise_std) and noise_std >= 0):
        raise InputError("noise_std", f"expected a number, 0 or more, got {noise_std}")
    if not layout.buttons:
        raise InputError("layout", "expected at least one button, got none")
    density = _density(layout, look, camera, R, t, texture_px_per_mm, supersampling)
    plate = draw_plate(layout, look, rng, density)
    wall = _wall(layout, look, rng)
    image = np.empty((camera.height_px, camera.width_px, 3), np.float32)
    rows = max(1, BLOCK // (camera.width_px * supersampling**2))
    for top in range(0, camera.height_px, rows):
        part = slice(top, min(camera.height_px, top + rows))
        points = _on_panel(camera, R, t, part, supersampling)
        samples = _look_at(points, plate, wall, look)
        shape = (part.stop - part.start, supersampling, camera.width_px, supersampling, 3)
        image[part] = samples.reshape(shape).mean(axis=(1, 3))
    if noise_std > 0:
        image += rng.normal(0, noise_std, image.shape).astype(np.float32)
    return np.clip(np.rint(image), 0, 255).astype(np.uint8)


def _check_view(
    rotation: npt.ArrayLike, translation: npt.ArrayLike
) -> tuple[FloatArray, FloatArray]:
    R = frozen_array(rotation, (3, 3), "rotation")
    t = frozen_array(translation, (3,), "translation")
    if not (np.allclose(R @ R.T, np.eye(3), atol=1e-6) and np.linalg.det(R) > 0):
        raise InputError("rotation", "expected a rotation matrix, got another one")
    if t[2] <= 0:
        raise InputError(
            "translation", f"expected the panel in front of the camera (z > 0), got z = {t[2]:g}"
        )
    return R, t


def _density(
    layout: Layout,
    look: Look,
    camera: Camera,
    R: FloatArray,
    t: FloatArray,
    wanted: float | None,
    supersampling: int,
) -> float:
    """Texture pixels per millimetre."""
    x0, y0, x1, y1 = plate_box(layout, look)
    largest = float(np.sqrt(MAX_TEXTURE_PIXELS / ((x1 - x0) * (y1 - y0)))) / 1000
    if wanted is None:
        corners = np.array([[x0, y0, 0], [x1, y0, 0], [x1, y1, 0], [x0, y1, 0]])
        depth = ((corners + t) @ R)[:, 2]
        nearest = max(float(depth.min()), 0.2 * float(np.linalg.norm(t)))
        finest = supersampling * camera.focal_px / nearest / 1000
        return min(largest, float(np.clip(finest, *TEXTURE_PX_PER_MM)))
    if not 0 < wanted <= largest:
        raise InputError(
            "texture_px_per_mm",
            f"expected a number above 0, up to {largest:.1f} for this panel, got {wanted}",
        )
    return wanted


def _on_panel(
    camera: Camera, R: FloatArray, t: FloatArray, rows: slice, supersampling: int
) -> FloatArray:
    """Where the samples of some rows meet the panel's plane, (n, 2), metres; NaN: nowhere.

    In the order of a picture `supersampling` times as large. Rays are linear within a
    pixel: exact without lens distortion, and to 0.001 px with it.
    """
    width, height = camera.width_px, rows.stop - rows.start
    edges = np.meshgrid(np.arange(width + 1) - 0.5, np.arange(rows.start, rows.stop + 1) - 0.5)
    rays = camera.rays(np.stack(edges, axis=-1).reshape(-1, 2)) @ R.T
    rays = rays.reshape(height + 1, width + 1, 3)
    inner = ((np.arange(supersampling) + 0.5) / supersampling)[:, None]
    across = rays[:, :-1, None] * (1 - inner) + rays[:, 1:, None] * inner
    across = across.reshape(height + 1, 1, -1, 3)
    inner = inner[:, :, None]
    grid = (across[:-1] * (1 - inner) + across[1:] * inner).reshape(-1, 3)
    ahead = np.where(grid[:, 2] > 1e-3, grid[:, 2], np.nan)
    return np.asarray(grid[:, :2] * (t[2] / ahead)[:, None] - t[:2])


@dataclass(frozen=True, eq=False)
class _Wall:
    """The wall: a repeating tile of plaster, where the door frame begins, where the lamp is."""

    plaster: npt.NDArray[np.float32]
    door_x: float
    lamp: FloatArray


def _wall(layout: Layout, look: Look, rng: np.random.Generator) -> _Wall:
    # Noise with a spectrum that falls with the frequency; periodic, so the tile has no seams.
    waves = np.fft.fftfreq(TILE_PX) * TILE_PX
    frequency = np.hypot(waves[None], waves[:, None])
    spectrum = np.fft.fft2(rng.normal(0, 1, (TILE_PX, TILE_PX))) / (6 + frequency) ** 1.8
    spectrum *= frequency > 0
    plaster = np.fft.ifft2(spectrum).real
    plaster = (plaster / plaster.std()).astype(np.float32)
    x0, y0, x1, _ = plate_box(layout, look)
    return _Wall(plaster, x1 + DOOR_GAP_M, np.array([x0, y0]))


def _look_at(points: FloatArray, plate: Plate, wall: _Wall, look: Look) -> npt.NDArray[np.float32]:
    """Colours (n, 3) of points on the panel's plane (n, 2)."""
    seen = np.isfinite(points[:, 0])
    xy = np.where(seen[:, None], points, 0.0)
    colors = _wall_colors(xy, wall, look)
    texture = _sample(plate.rgba, plate.pixels(xy), wrap=False)
    colors *= 1 - texture[:, 3:] / np.float32(255)
    colors += texture[:, :3]
    pool = np.exp(-0.5 * ((xy - wall.lamp) ** 2).sum(axis=1) / POOL_M**2).astype(np.float32)
    colors *= (1 - np.float32(look.light) * (1 - pool))[:, None]
    colors[~seen] = np.float32(FAR_GREY) * np.array(look.wall, np.float32)
    return colors


def _wall_colors(xy: FloatArray, wall: _Wall, look: Look) -> npt.NDArray[np.float32]:
    grain = _sample(wall.plaster, xy * (TILE_PX / TILE_M), wrap=True)
    colors = (1 + np.float32(look.grain) * grain[:, None]) * np.array(look.wall, np.float32)
    if look.fixtures:
        x = xy[:, 0] - wall.door_x
        shade = np.clip(0.75 + 0.35 * np.cos(70 * (x - 0.4 * DOOR_WIDTH_M)), 0, 1.1)
        frame = (x > 0) & (x < DOOR_WIDTH_M)
        colors[frame] = shade[frame, None] * np.array(DOOR_FRAME, np.float32)
        colors[x >= DOOR_WIDTH_M] = np.array(DOOR, np.float32)
        colors[np.abs(x) < 0.001] *= np.float32(0.35)
        # The door lies deeper than its frame, in the frame's shadow.
        depth = np.clip((x - DOOR_WIDTH_M) / 0.03, 0, 1)
        colors *= np.where(x >= DOOR_WIDTH_M, 0.45 + 0.55 * depth, 1.0)[:, None].astype(np.float32)
    return colors


def _sample(
    picture: npt.NDArray[np.uint8] | npt.NDArray[np.float32], at: FloatArray, *, wrap: bool
) -> npt.NDArray[np.float32]:
    """Bilinear samples of a picture (h, w, channels) at pixels (n, 2): (n, channels)."""
    import cv2

    # cv2 addresses pixels with 16 bits: an even fold of the sample list, far points clipped.
    width = 1024
    count = len(at)
    if wrap:
        at = at % np.array(picture.shape[1::-1])
    else:
        at = np.clip(at, -2, np.array(picture.shape[1::-1]) + 1)
    padded = np.zeros((2, -(-count // width) * width), np.float32)
    padded[:, :count] = at.T
    x, y = padded.reshape(2, -1, width)
    border = cv2.BORDER_WRAP if wrap else cv2.BORDER_CONSTANT
    samples = cv2.remap(picture, x, y, cv2.INTER_LINEAR, borderMode=border)
    return np.asarray(samples, np.float32).reshape(x.size, *picture.shape[2:])[:count]
