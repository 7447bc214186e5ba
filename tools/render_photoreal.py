"""Render examples/: photoreal photos of a hall and a car panel, exact outlines, the camera.

Cycles, in an environment of Blender's own (its module wants Python 3.11 and an older NumPy):

    python3.11 -m venv blender && blender/bin/pip install 'bpy==4.5.*' pillow
    blender/bin/python tools/render_photoreal.py [--samples N] [--only NAME] [FOLDER]

Frames and units: metres; x right and y down on the wall, heights above it towards the viewer,
the origin amid the panel. fronto's panel frame is (x, y, -height), Blender's world (x, -y,
height). Every outline lies at the height RIM, so that all of a panel are in one plane.
"""

from __future__ import annotations

import argparse
import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy
import numpy as np
from mathutils import Matrix
from photoreal_materials import Stock, area, steel, stone, surroundings, veneer
from photoreal_parts import (
    MM,
    PLATE,
    RIM,
    Form,
    Points,
    block,
    circle,
    disc,
    display,
    draw,
    flat,
    key_switch,
    ring,
    screw,
    turn,
    write,
)
from PIL import Image

WIDTH, HEIGHT = 800, 600
FOCAL, CX, CY = 400.0, 400.125, 300.125
CAMERA = np.array([[FOCAL, 0, CX], [0, FOCAL, CY], [0, 0, 1]])
#: Angles about x, y and z of the rotation that rectifies (fronto's PanelPose.angles_deg),
#: and the origin in the camera frame.
VIEWS = {
    "hall": ((12.0, -20.0, 3.0), (0.004, 0.008, 0.212)),
    "car": ((-13.0, 27.0, -5.0), (-0.002, -0.004, 0.272)),
}
NOISE = 1.1  # standard deviation at mid-grey, of 255


@dataclass(frozen=True)
class Button:
    """Where a button's widest section is, at the height RIM."""

    form: Form
    at: tuple[float, float]
    category: str
    text: str = ""


def hall() -> list[Button]:
    """Up, lit, down and a key switch on a plate, on stone beside the door."""
    stock, rock, lining = Stock("x"), stone(), steel("lining", "y", (0.5, 0.5, 0.5), 0.32)
    for row in range(-2, 3):
        for column in range(-3, 1):
            at = (0.152 - 0.3 + 0.6 * column, 0.045 + 0.42 * (row + 0.5))
            block(Form(0.598, 0.418, 1 * MM), at, -0.02, 0, 0.8 * MM, rock)
    block(Form(2, 4, 1 * MM), (-0.846, 0), -0.05, -0.004, 0, stock.hole)
    block(Form(0.06, 4, 2 * MM), (0.185, 0), -0.2, 0.014, 2 * MM, lining)
    block(Form(1.2, 4, 2 * MM), (0.82, 0), -0.2, -0.03, 2 * MM, lining)
    block(Form(0.094, 0.236, 3 * MM), (0, 0), 0, PLATE, 0.8 * MM, stock.plate)
    for y in (-0.108, 0.108):
        screw((0, y), stock)
    buttons = []
    form = Form(36 * MM, 36 * MM, 4.5 * MM)
    for category, y, ink in (("up", -0.062, stock.amber), ("down", -0.006, stock.ink)):
        at = (0.0, y)
        block(Form(37.6 * MM, 37.6 * MM, 5 * MM), at, 0, PLATE + 0.1 * MM, 0, stock.hole)
        block(form, at, 0, RIM + 0.6 * MM, 0.6 * MM, stock.cap)
        draw(category, at, 22 * MM, RIM + 0.62 * MM, ink)
        if category == "up":
            frame = Form(30 * MM, 30 * MM, 3 * MM)
            heights = [(0.0, RIM + 0.62 * MM), (1.1 * MM, RIM + 0.62 * MM)]
            turn(frame, at, heights, stock.amber, lid=False)
        buttons.append(Button(form, at, category, category))
    key = Button(circle(28 * MM), (0.0, 0.048), "keyhole")
    key_switch(key.form.width, key.at, stock)
    for line, words in enumerate(("IN CASE OF FIRE", "USE STAIRS")):
        write(words, (0, 0.078 + 0.007 * line), 3.6 * MM, PLATE + 0.02 * MM, stock.ink)
    area((-0.5, -1.5, 1.1), (0.9, 0.5), 16, (1.0, 0.9, 0.78))
    area((0.9, -0.5, 1.3), (0.25, 1.0), 9, (0.85, 0.93, 1.0))
    surroundings((0.12, 0.1, 0.085), (0.5, 0.49, 0.47), (0.95, 0.93, 0.9))
    return [*buttons, key]


def car() -> list[Button]:
    """Ten floors in two columns, doors, alarm and a key switch, on a column of steel."""
    stock, wood = Stock("y"), veneer()
    block(Form(4, 4, 1 * MM), (0, 0), -0.05, -0.01, 0, stock.hole)
    for side in (-1, 1):
        block(Form(1.2, 4, 1 * MM), (side * 0.688, 0), -0.02, 0, 1 * MM, wood)
    block(Form(0.17, 2.4, 2 * MM), (0, 0), -0.01, PLATE, 1 * MM, stock.plate)
    display(Form(78 * MM, 46 * MM, 3 * MM), (0, -0.182), stock.red, stock)
    write("8 PERSONS   630 kg", (0, -0.147), 4.2 * MM, PLATE + 0.02 * MM, stock.ink)
    floors = [("number", name) for name in ["8", "9", "6", "7", "4", "5", "2", "3", "G", "1"]]
    others = [("open", ""), ("close", ""), ("alarm", "")]
    buttons = []
    for index, (category, text) in enumerate([*floors, *others]):
        at = ((index % 2 - 0.5) * 0.056, -0.112 + 0.041 * (index // 2))
        button = Button(circle(34 * MM), at, category, text)
        buttons.append(button)
        lit = text == "7"
        ring(button.form, at, 2.6 * MM, RIM + 0.5 * MM, stock.amber if lit else stock.dark)
        face = stock.yellow if category == "alarm" else stock.turned
        block(circle(28.4 * MM), at, 0, RIM + 1 * MM, 0.7 * MM, face)
        block(circle(29 * MM), at, 0, PLATE + 0.1 * MM, 0, stock.hole)
        if text:
            write(text, at, 11.5 * MM, RIM + 1.02 * MM, stock.ink)
        else:
            draw(category, at, 25 * MM, RIM + 1.02 * MM, stock.ink)
    key = Button(circle(26 * MM), (0.028, -0.112 + 0.041 * 6), "keyhole")
    key_switch(key.form.width, key.at, stock)
    for row in range(4):
        for column in range(9):
            at = ((column - 4) * 6 * MM, 0.168 + row * 6 * MM)
            flat(disc(1.5 * MM), at, PLATE + 0.02 * MM, stock.hole)
    area((0.2, -1.2, 0.9), (0.9, 0.7), 10, (1.0, 0.95, 0.88))
    area((-0.9, -0.2, 1.0), (0.2, 0.9), 4, (0.9, 0.95, 1.0))
    surroundings((0.1, 0.085, 0.075), (0.42, 0.4, 0.38), (0.95, 0.93, 0.9))
    return [*buttons, key]


def rotation(angles_deg: Sequence[float]) -> Points:
    """R = R_x R_y R_z in the signs of fronto.pose.rotation: camera rays to the panel frame."""
    (cx, cy, cz), (sx, sy, sz) = np.cos(np.radians(angles_deg)), np.sin(np.radians(angles_deg))
    about_x = np.array([[1, 0, 0], [0, cx, sx], [0, -sx, cx]])
    about_y = np.array([[cy, 0, -sy], [0, 1, 0], [sy, 0, cy]])
    about_z = np.array([[cz, sz, 0], [-sz, cz, 0], [0, 0, 1]])
    return np.asarray(about_x @ about_y @ about_z)


def set_camera(R: Points, center: Points) -> None:
    """The pinhole of `CAMERA`; Blender counts from pixels' edges and looks along -z, y up."""
    lens = bpy.data.cameras.new("camera")
    lens.sensor_fit, lens.sensor_width, lens.lens = "HORIZONTAL", 36.0, 36.0 * FOCAL / WIDTH
    lens.shift_x = (WIDTH / 2 - (CX + 0.5)) / WIDTH
    lens.shift_y = ((CY + 0.5) - HEIGHT / 2) / WIDTH
    lens.clip_start = 0.01
    flip = np.diag([1.0, -1.0, -1.0])
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = flip @ R @ flip, flip @ R @ -center
    placed = bpy.data.objects.new("camera", lens)
    placed.matrix_world = Matrix(pose.tolist())
    bpy.context.collection.objects.link(placed)
    bpy.context.scene.camera = placed


def outline(button: Button, R: Points, center: Points) -> dict[str, Any]:
    """The exact outline in pixels, as fronto.outlines/1 has it."""
    x, y = button.at
    to_plane = np.array([[1, 0, x], [0, 1, y], [0, 0, -RIM]]) + np.outer(R @ center, [0, 0, 1])
    H = CAMERA @ R.T @ to_plane
    record: dict[str, Any]
    if button.form == circle(button.form.width):
        dual = H @ np.diag([(button.form.width / 2) ** 2] * 2 + [-1.0]) @ H.T
        middle = dual[:2, 2] / dual[2, 2]
        values, vectors = np.linalg.eigh(np.outer(middle, middle) - dual[:2, :2] / dual[2, 2])
        angle = np.degrees(np.arctan2(vectors[1, 1], vectors[0, 1])) % 180
        names = ("cx", "cy", "a", "b", "angle_deg")
        numbers = (*middle, *np.sqrt(values[::-1]), angle)
        fields = {n: round(float(v), 3) for n, v in zip(names, numbers, strict=True)}
        record = {"shape": "ellipse", "ellipse_px": fields}
    else:
        half = np.array([button.form.width, button.form.height]) / 2
        signs = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)])
        corners = np.insert(signs * half, 2, 1, axis=1) @ H.T
        record = {
            "shape": "quad",
            "corners_px": np.round(corners[:, :2] / corners[:, 2:], 3).tolist(),
        }
    return record | {
        "category": button.category,
        "text": button.text,
        "std_px": 0.1,
        "confidence": 1.0,
    }


def write_outlines(path: Path, records: list[dict[str, Any]]) -> None:
    lines = ",\n".join("  " + json.dumps(record, separators=(",", ":")) for record in records)
    name = path.name.replace(".outlines.json", ".png")
    path.write_text(
        f'{{\n "schema": "fronto.outlines/1",\n "image": "{name}",\n "width_px": {WIDTH},\n'
        f' "height_px": {HEIGHT},\n "buttons": [\n{lines}],\n "lines": []\n}}\n',
        encoding="utf-8",
    )


def render(path: Path, samples: int) -> None:
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device, scene.cycles.samples, scene.cycles.seed = "CPU", samples, 0
    scene.cycles.use_denoising, scene.cycles.denoiser = True, "OPENIMAGEDENOISE"
    scene.cycles.max_bounces, scene.cycles.sample_clamp_indirect = 8, 4.0
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    scene.render.resolution_percentage = 100
    scene.render.image_settings.file_format = "PNG"
    view = scene.view_settings
    view.view_transform, view.look, view.exposure = "AgX", "AgX - Punchy", 0.35
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)


def add_noise(path: Path, seed: int) -> None:
    """A sensor's noise: of each pixel, the same in all channels, growing with the light."""
    rng = np.random.default_rng(seed)
    photo = np.asarray(Image.open(path).convert("RGB"), float)
    std = NOISE * np.sqrt(0.3 + 0.7 * photo.mean(axis=2, keepdims=True) / 128)
    grain = std * rng.normal(size=(*photo.shape[:2], 1))
    noisy = np.clip(np.rint(photo + grain), 0, 255).astype(np.uint8)
    Image.fromarray(noisy).save(path, optimize=True)


def write_camera(path: Path) -> None:
    """ROS camera_info, as camera_calibration writes it."""
    tables = {
        "camera_matrix": CAMERA,
        "distortion_coefficients": np.zeros((1, 5)),
        "rectification_matrix": np.eye(3),
        "projection_matrix": np.insert(CAMERA, 3, 0, axis=1),
    }
    lines = [f"image_width: {WIDTH}", f"image_height: {HEIGHT}", "camera_name: example"]
    for name, table in tables.items():
        rows, columns = table.shape
        lines += [f"{name}:", f"  rows: {rows}", f"  cols: {columns}"]
        lines.append(f"  data: {[float(v) for v in table.ravel()]}")
        if name == "camera_matrix":
            lines.append("distortion_model: plumb_bob")
    path.write_text("\n".join(lines) + "\n", encoding="utf-8")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("folder", nargs="?", default="examples", type=Path)
    parser.add_argument("--samples", type=int, default=64, help="of each pixel")
    parser.add_argument("--only", choices=VIEWS, help="the panel to render")
    options = parser.parse_args()
    options.folder.mkdir(parents=True, exist_ok=True)
    write_camera(options.folder / "camera.yaml")
    for seed, (name, build) in enumerate({"hall": hall, "car": car}.items()):
        if options.only not in (None, name):
            continue
        bpy.ops.wm.read_factory_settings(use_empty=True)
        buttons = build()
        R, center = rotation(VIEWS[name][0]), np.array(VIEWS[name][1])
        set_camera(R, center)
        records = [outline(button, R, center) for button in buttons]
        write_outlines(options.folder / f"{name}.outlines.json", records)
        render(options.folder / f"{name}.png", options.samples)
        add_noise(options.folder / f"{name}.png", seed)


if __name__ == "__main__":
    main()
