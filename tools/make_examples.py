"""Write examples/: two simulated photos of tilted panels, their outlines and their camera.

The outlines are the exact ones plus noise of 0.2 px, as a good detector reports them. The
same run gives the same files. Usage: python tools/make_examples.py [FOLDER]
"""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import yaml
from PIL import Image

from fronto.camera.conic import fit_ellipse
from fronto.outlinefile import write_outlines
from fronto.pose.rotation import rotation_from_angles
from fronto.shapes import Ellipse, FloatArray, Outline
from fronto.synth import PAPER_CAMERA, Layout, LayoutButton, Scene, observe
from fronto.synth.render import render_panel

#: The paper's camera, for photos of another size.
CAMERA = PAPER_CAMERA.scaled_to(800, 600)
STD_PX = 0.2


def hall() -> Layout:
    """Up, down and a keyhole, one above the other."""
    side, pitch = 0.036, 0.056
    names = (("up", "up"), ("down", "down"), ("keyhole", ""))
    buttons = [
        LayoutButton(0.0, (k - 1) * pitch, side, side, category=category, text=text)
        for k, (category, text) in enumerate(names)
    ]
    return Layout("hall", tuple(buttons))


def car() -> Layout:
    """Twelve floors in three columns, and a row of round buttons below."""
    side, pitch = 0.030, 0.042
    buttons = [
        LayoutButton((k % 3 - 1) * pitch, (k // 3 - 2) * pitch, side, side, text=str(floor))
        for k, floor in enumerate([10, 11, 12, 7, 8, 9, 4, 5, 6, 1, 2, 3])
    ]
    for k, name in enumerate(("open", "alarm", "close")):
        x, y = (k - 1) * pitch, 2 * pitch + 0.004
        buttons.append(LayoutButton(x, y, side, side, "ellipse", category=name, text=name))
    return Layout("car", tuple(buttons))


def scene(layout: Layout, angles_deg: tuple[float, float, float], center: FloatArray) -> Scene:
    """The layout's origin at `center` (camera frame, metres), with the exact outlines."""
    rotation = rotation_from_angles(*np.radians(angles_deg))
    translation = rotation @ center
    truth = []
    for button, corners in zip(layout.buttons, layout.corners, strict=True):
        if button.shape == "ellipse":
            t = np.linspace(0, 2 * np.pi, 64, endpoint=False)
            corners = (button.x, button.y) + button.width / 2 * np.column_stack(
                [np.cos(t), np.sin(t)]
            )
        points = np.column_stack([corners, np.zeros(len(corners))]) + translation
        pixels = CAMERA.project(points @ rotation)
        if button.shape == "ellipse":
            outline = Outline("ellipse", ellipse_px=fit_ellipse(pixels))
        else:
            outline = Outline.quad(pixels)
        truth.append(replace(outline, category=button.category, text=button.text))
    return Scene(layout, CAMERA, rotation, translation, tuple(truth), tuple(truth))


def rounded(outline: Outline) -> Outline:
    """Coordinates to a thousandth of a pixel: the file is for people too."""
    if outline.ellipse_px is not None:
        e = outline.ellipse_px
        values = (round(value, 3) for value in (e.cx, e.cy, e.a, e.b, e.angle_deg))
        return replace(outline, ellipse_px=Ellipse(*values))
    assert outline.corners_px is not None
    return replace(outline, corners_px=np.round(outline.corners_px, 3))


def write_camera(path: Path) -> None:
    """ROS camera_info, as camera_calibration writes it."""
    matrix = CAMERA.matrix

    def table(values: FloatArray) -> dict[str, object]:
        rows, columns = values.shape
        return {"rows": rows, "cols": columns, "data": [float(v) for v in values.ravel()]}

    fields = {
        "image_width": CAMERA.width_px,
        "image_height": CAMERA.height_px,
        "camera_name": "example",
        "camera_matrix": table(matrix),
        "distortion_model": "plumb_bob",
        "distortion_coefficients": table(np.zeros((1, 5))),
        "rectification_matrix": table(np.eye(3)),
        "projection_matrix": table(np.column_stack([matrix, np.zeros(3)])),
    }
    path.write_text(yaml.safe_dump(fields, sort_keys=False, default_flow_style=None))


def main(folder: Path) -> None:
    folder.mkdir(parents=True, exist_ok=True)
    write_camera(folder / "camera.yaml")
    views = {
        "hall": scene(hall(), (18.0, -34.0, 7.0), np.array([-0.01, 0.025, 0.215])),
        "car": scene(car(), (-24.0, 33.0, -6.0), np.array([0.005, 0.015, 0.26])),
    }
    for seed, (name, view) in enumerate(views.items()):
        rng = np.random.default_rng(seed)
        photo = render_panel(view.layout, CAMERA, view.rotation, view.translation, rng=rng)
        Image.fromarray(photo).save(folder / f"{name}.png", optimize=True)
        outlines = observe(rng, view, STD_PX, outlier_share=0.0).outlines
        write_outlines(
            folder / f"{name}.outlines.json",
            [rounded(outline) for outline in outlines],
            image=f"{name}.png",
            width_px=CAMERA.width_px,
            height_px=CAMERA.height_px,
        )


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "examples"))
