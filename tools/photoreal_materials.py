"""Materials, lamps and surroundings of tools/render_photoreal.py, as Blender's shader nodes."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import bpy
from mathutils import Vector

Nodes = Any


def material(name: str, color: Sequence[float], **inputs: float) -> tuple[Nodes, Nodes, Callable]:
    """A Principled material, its node, and a function that adds and wires others."""
    made = bpy.data.materials.new(name)
    made.use_nodes = True
    tree = made.node_tree
    shader = tree.nodes["Principled BSDF"]
    shader.inputs["Base Color"].default_value = (*color, 1)
    for key, value in inputs.items():
        shader.inputs[key.replace("_", " ").title()].default_value = value
    return made, shader, wirer(tree)


def wirer(tree: Nodes) -> Callable[..., Nodes]:
    """A function that adds a node: kind, values or sockets for its inputs, its settings."""

    def wire(kind: str, sources: dict[str, Any] | None = None, **settings: Any) -> Nodes:
        node = tree.nodes.new(f"ShaderNode{kind}")
        for key, value in settings.items():
            setattr(node, key, value)
        for key, value in (sources or {}).items():
            socket = node.inputs[int(key) if key.isdigit() else key]
            if isinstance(value, bpy.types.NodeSocket):
                tree.links.new(value, socket)
            else:
                socket.default_value = value
        return node

    return wire


def join(source: Nodes, target: Nodes) -> None:
    """Lead a node's output into another one's input."""
    target.id_data.links.new(source, target)


def noise(wire: Callable, scale: tuple[float, float, float], detail: float = 4.0) -> Nodes:
    """Noise in metres of the object's frame, another one for every object."""
    place = wire("TexCoord").outputs["Object"]
    scaled = wire("VectorMath", {"0": place, "1": scale}, operation="MULTIPLY").outputs[0]
    seed = wire(
        "Math", {"0": wire("ObjectInfo").outputs["Random"], "1": 90.0}, operation="MULTIPLY"
    )
    fields = {"Vector": scaled, "W": seed.outputs[0], "Scale": 1.0, "Detail": detail}
    return wire("TexNoise", fields, noise_dimensions="4D").outputs["Fac"]


def ranged(wire: Callable, value: Nodes, low: float, high: float) -> Nodes:
    fields = {"Value": value, "From Min": 0.3, "From Max": 0.7, "To Min": low, "To Max": high}
    return wire("MapRange", fields).outputs["Result"]


def steel(name: str, grain: str, color: Sequence[float], roughness: float) -> Nodes:
    """Brushed along "x" or "y", or "round" as turned on a lathe."""
    made, shader, wire = material(name, color, metallic=1.0, anisotropic=0.75)
    scale = {"x": (9.0, 2200.0, 9.0), "y": (2200.0, 9.0, 9.0), "round": (900.0, 900.0, 9.0)}[grain]
    streaks = noise(wire, scale)
    smudges = noise(wire, (14.0, 11.0, 14.0), 3.0)
    shine = ranged(wire, streaks, 0.8 * roughness, 1.25 * roughness)
    worn = ranged(wire, smudges, 0.9, 1.15)
    product = wire("Math", {"0": shine, "1": worn}, operation="MULTIPLY").outputs[0]
    join(product, shader.inputs["Roughness"])
    tone = ranged(wire, streaks, 0.86, 1.1)
    tinted = wire("VectorMath", {"0": color, "3": tone}, operation="SCALE").outputs[0]
    join(tinted, shader.inputs["Base Color"])
    bump = wire("Bump", {"Height": streaks, "Strength": 0.06, "Distance": 2e-4}).outputs[0]
    join(bump, shader.inputs["Normal"])
    if grain == "round":
        along = wire("Tangent", direction_type="RADIAL", axis="Z").outputs[0]
    else:
        along = wire("CombineXYZ", {"X": float(grain == "x"), "Y": float(grain == "y")}).outputs[0]
    join(along, shader.inputs["Tangent"])
    return made


def glow(name: str, color: Sequence[float], strength: float) -> Nodes:
    base = [0.4 * c for c in color]
    made, shader, _ = material(name, base, roughness=0.4, emission_strength=strength)
    shader.inputs["Emission Color"].default_value = (*color, 1)
    return made


def stone() -> Nodes:
    """Honed limestone: clouds and grains."""
    made, shader, wire = material("stone", (0.6, 0.55, 0.47), roughness=0.45)
    clouds, grains = noise(wire, (7.0, 16.0, 7.0), 8.0), noise(wire, (420.0, 420.0, 420.0), 2.0)
    mixed = wire("Math", {"0": grains, "1": 0.35, "2": clouds}, operation="MULTIPLY_ADD").outputs[0]
    ramp = wire("ValToRGB", {"Fac": mixed})
    ramp.color_ramp.elements[0].position, ramp.color_ramp.elements[1].position = 0.5, 0.86
    ramp.color_ramp.elements[0].color = (0.44, 0.385, 0.31, 1)
    ramp.color_ramp.elements[1].color = (0.67, 0.62, 0.54, 1)
    join(ramp.outputs[0], shader.inputs["Base Color"])
    bump = wire("Bump", {"Height": mixed, "Strength": 0.25, "Distance": 4e-4}).outputs[0]
    join(bump, shader.inputs["Normal"])
    return made


def veneer() -> Nodes:
    """Dark wood under a satin coat, the grain upright."""
    made, shader, wire = material("veneer", (0.1, 0.05, 0.03), roughness=0.35, coat_weight=0.3)
    shader.inputs["Coat Roughness"].default_value = 0.18
    ramp = wire("ValToRGB", {"Fac": noise(wire, (160.0, 4.0, 20.0), 6.0)})
    ramp.color_ramp.elements[0].position, ramp.color_ramp.elements[1].position = 0.35, 0.7
    ramp.color_ramp.elements[0].color = (0.05, 0.024, 0.013, 1)
    ramp.color_ramp.elements[1].color = (0.17, 0.085, 0.045, 1)
    join(ramp.outputs[0], shader.inputs["Base Color"])
    return made


class Stock:
    """The materials that both panels share."""

    def __init__(self, grain: str) -> None:
        self.plate = steel("plate", grain, (0.56, 0.56, 0.555), 0.3)
        self.cap = steel("cap", grain, (0.8, 0.8, 0.79), 0.26)
        self.turned = steel("turned", "round", (0.72, 0.72, 0.71), 0.22)
        self.chrome = material("chrome", (0.8, 0.8, 0.8), metallic=1.0, roughness=0.08)[0]
        self.dark = material("dark", (0.012, 0.012, 0.013), roughness=0.35)[0]
        self.hole = material("hole", (0.004, 0.004, 0.004), roughness=0.9)[0]
        self.ink = material("ink", (0.015, 0.015, 0.016), roughness=0.6)[0]
        self.glass = material("glass", (0.006, 0.006, 0.008), roughness=0.04, coat_weight=1.0)[0]
        self.yellow = material("yellow", (0.75, 0.45, 0.02), roughness=0.35)[0]
        self.amber = glow("amber", (1.0, 0.15, 0.0), 1.5)
        self.red = glow("red", (1.0, 0.015, 0.0), 2.0)


def area(
    at: Sequence[float], size: tuple[float, float], power: float, color: Sequence[float]
) -> None:
    """A rectangular lamp at (x, y, height) that shines at the panel's middle."""
    lamp = bpy.data.lights.new("lamp", "AREA")
    lamp.shape, lamp.size, lamp.size_y = "RECTANGLE", *size
    lamp.energy, lamp.color = power, color
    placed = bpy.data.objects.new("lamp", lamp)
    placed.location = (at[0], -at[1], at[2])
    placed.rotation_euler = (-Vector(placed.location)).to_track_quat("-Z", "Y").to_euler()
    bpy.context.collection.objects.link(placed)


def surroundings(floor: Sequence[float], wall: Sequence[float], ceiling: Sequence[float]) -> None:
    """What the metal mirrors: a gradient from floor to ceiling, uneven as a room is."""
    world = bpy.data.worlds.new("room")
    bpy.context.scene.world = world
    world.use_nodes = True
    wire = wirer(world.node_tree)
    way = wire("TexCoord").outputs["Generated"]
    high = wire("SeparateXYZ", {"Vector": way}).outputs["Y"]
    uneven = wire("TexNoise", {"Vector": way, "Scale": 2.2, "Detail": 2.0}).outputs["Fac"]
    mixed = wire("Math", {"0": uneven, "1": 0.5, "2": high}, operation="MULTIPLY_ADD").outputs[0]
    level = wire("MapRange", {"Value": mixed, "From Min": -0.75, "From Max": 1.25}).outputs[0]
    ramp = wire("ValToRGB", {"Fac": level})
    ramp.color_ramp.elements[0].color = (*floor, 1)
    ramp.color_ramp.elements[1].color = (*ceiling, 1)
    ramp.color_ramp.elements.new(0.5).color = (*wall, 1)
    background = world.node_tree.nodes["Background"]
    join(ramp.outputs[0], background.inputs["Color"])
