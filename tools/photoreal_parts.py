"""Meshes of tools/render_photoreal.py: button caps, rings, symbols, screws, key switches.

Metres; x right and y down on the wall, heights above it towards the viewer.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import bpy
import numpy as np
from photoreal_materials import Nodes, Stock

#: Heights of the plate's surface, and of the widest section of all buttons and rings.
PLATE, RIM = 0.0025, 0.0032
MM = 1e-3

Points = np.ndarray


@dataclass(frozen=True)
class Form:
    """A rounded rectangle; a circle where the radius is half of both sides."""

    width: float
    height: float
    radius: float

    def contour(self, inset: float) -> Points:
        """Its outline moved inwards, clockwise as seen, (n, 2)."""
        radius = max(self.radius - inset, 1e-5)
        half = np.array([self.width, self.height]) / 2 - inset - radius
        quarter = np.linspace(0, np.pi / 2, 17)
        arcs = []
        for k, sign in enumerate(((1, 1), (-1, 1), (-1, -1), (1, -1))):
            t = quarter + k * np.pi / 2
            arcs.append(half * sign + radius * np.column_stack([np.cos(t), np.sin(t)]))
        return np.concatenate(arcs)


def circle(diameter: float) -> Form:
    return Form(diameter, diameter, diameter / 2)


def add(vertices: Points, faces: list[list[int]], at: tuple[float, float], material: Nodes) -> None:
    """A mesh from (x, y, height) around `at`; its origin is there."""
    mesh = bpy.data.meshes.new("part")
    mesh.from_pydata((vertices * (1, -1, 1)).tolist(), [], faces)
    mesh.validate()
    mesh.polygons.foreach_set("use_smooth", np.ones(len(mesh.polygons), bool))
    mesh.set_sharp_from_angle(angle=np.radians(50))
    mesh.materials.append(material)
    part = bpy.data.objects.new("part", mesh)
    part.location = (at[0], -at[1], 0)
    bpy.context.collection.objects.link(part)


def turn(
    form: Form,
    at: tuple[float, float],
    profile: Sequence[tuple[float, float]],
    material: Nodes,
    *,
    lid: bool = True,
) -> None:
    """Lead the (inset, height) profile along the form's outline; the lid closes the top."""
    rings = [np.insert(form.contour(inset), 2, height, axis=1) for inset, height in profile]
    n = len(rings[0])
    faces = [
        [k * n + i, k * n + (i + 1) % n, (k + 1) * n + (i + 1) % n, (k + 1) * n + i]
        for k in range(len(rings) - 1)
        for i in range(n)
    ]
    if lid:
        faces.append([(len(rings) - 1) * n + i for i in range(n)])
    add(np.concatenate(rings), faces, at, material)


def block(
    form: Form, at: tuple[float, float], base: float, top: float, bevel: float, material: Nodes
) -> None:
    t = np.linspace(0, np.pi / 2, 6)
    edge = np.column_stack([bevel * (1 - np.cos(t)), top - bevel * (1 - np.sin(t))])
    turn(form, at, [(0.0, base), *edge], material)


def ring(form: Form, at: tuple[float, float], width: float, top: float, material: Nodes) -> None:
    """A collar with a round top, `width` wide inwards of the form; it stands on the plate."""
    t = np.linspace(0, np.pi, 13)
    rise = top - RIM
    arch = np.column_stack([width / 2 * (1 - np.cos(t)), RIM + rise * np.sin(t)])
    turn(form, at, [(0.0, 0.0), *arch, (width, 0.0)], material, lid=False)


def flat(outline: Points, at: tuple[float, float], height: float, material: Nodes) -> None:
    """A polygon (n, 2) at a height, as an engraving filled with paint."""
    vertices = np.insert(np.asarray(outline, float), 2, height, axis=1)
    add(vertices, [list(range(len(vertices)))], at, material)


def write(words: str, at: tuple[float, float], size: float, height: float, ink: Nodes) -> None:
    """Words in Blender's own font, in the middle of `at`; `size` is that of capitals."""
    curve = bpy.data.curves.new("words", "FONT")
    curve.body, curve.size = words, size / 0.69
    curve.align_x, curve.align_y = "CENTER", "TOP_BASELINE"
    curve.offset = 0.012 * size
    curve.materials.append(ink)
    label = bpy.data.objects.new("words", curve)
    label.location = (at[0], -at[1] - size / 2, height)
    bpy.context.collection.objects.link(label)


ARROW = np.array([(0, -0.6), (0.62, 0.45), (-0.62, 0.45)])
SIDE = np.array([(0.14, -0.42), (0.72, 0.0), (0.14, 0.42)])
BAR = np.array([(-0.05, -0.55), (0.05, -0.55), (0.05, 0.55), (-0.05, 0.55)])


def arc(radius: float, start: float, end: float, at: tuple[float, float], n: int = 32) -> Points:
    t = np.radians(np.linspace(start, end, n))
    return np.column_stack([at[0] + radius * np.cos(t), at[1] + radius * np.sin(t)])


def disc(radius: float) -> Points:
    return arc(radius, 0, 360, (0, 0))


def symbol(name: str) -> list[Points]:
    """Polygons in a square from -1 to 1, y down."""
    if name == "alarm":
        dome = arc(0.38, 180, 360, (0, -0.14))
        skirt = np.array([(0.40, 0.15), (0.62, 0.40), (-0.62, 0.40), (-0.40, 0.15)])
        clapper = arc(0.14, 0, 180, (0, 0.47))
        return [np.concatenate([dome, skirt]), clapper, arc(0.1, 0, 360, (0, -0.56), 16)]
    if name in ("open", "close"):
        # Arrows that point away from the bar, or at it.
        right = SIDE if name == "open" else (0.86, 0) - SIDE * (1, -1)
        return [right, right * (-1, 1), BAR]
    return [ARROW if name == "up" else ARROW * (1, -1)]


def draw(name: str, at: tuple[float, float], size: float, height: float, ink: Nodes) -> None:
    for polygon in symbol(name):
        flat(polygon * size / 2, at, height, ink)


def screw(at: tuple[float, float], stock: Stock) -> None:
    """A countersunk hex screw."""
    block(circle(7.5 * MM), at, 0, PLATE + 0.7 * MM, 0.5 * MM, stock.chrome)
    flat(arc(1.9 * MM, 10, 310, (0, 0), 6), at, PLATE + 0.71 * MM, stock.hole)


def key_switch(diameter: float, at: tuple[float, float], stock: Stock) -> None:
    ring(circle(diameter), at, 0.11 * diameter, RIM + 0.6 * MM, stock.chrome)
    block(circle(0.8 * diameter), at, 0, RIM - 0.6 * MM, 0.1 * MM, stock.dark)
    block(circle(0.7 * diameter), at, 0, RIM + 0.2 * MM, 0.4 * MM, stock.turned)
    slot = Form(0.1 * diameter, 0.46 * diameter, 0.03 * diameter)
    flat(slot.contour(0), at, RIM + 0.22 * MM, stock.hole)
    flat(disc(0.1 * diameter), at, RIM + 0.23 * MM, stock.hole)


def display(form: Form, at: tuple[float, float], lamp: Nodes, stock: Stock) -> None:
    """Black glass in a chrome frame; on it an arrow up, and a 3 in dots."""
    dots = "01110 10001 00001 00110 00001 10001 01110"
    ring(form, at, 1.6 * MM, RIM + 0.4 * MM, stock.chrome)
    block(
        Form(form.width - 2 * MM, form.height - 2 * MM, form.radius), at, 0, PLATE, 0, stock.glass
    )
    pitch = form.height * 0.085
    for row, line in enumerate(dots.split()):
        for column, on in enumerate(line):
            if on == "1":
                x, y = at[0] + (column + 0.6) * pitch, at[1] + (row - 3) * pitch
                flat(disc(0.4 * pitch), (x, y), PLATE + 0.05 * MM, lamp)
    left = (at[0] - 3.6 * pitch, at[1])
    draw("up", left, 6.2 * pitch, PLATE + 0.05 * MM, lamp)
