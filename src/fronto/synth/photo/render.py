"""A photo of an elevator panel with the exact outlines of everything that can be pressed."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from fronto.camera import Camera
from fronto.errors import InputError
from fronto.shapes import FloatArray
from fronto.synth.photo.buttons import Wardrobe, draw_element, draw_surroundings
from fronto.synth.photo.canvas import Canvas
from fronto.synth.photo.draws import chance, pick, tint
from fronto.synth.photo.effects import develop
from fronto.synth.photo.fixtures import draw_fixture
from fronto.synth.photo.forms import project
from fronto.synth.photo.layout import random_plan
from fronto.synth.photo.plan import Element, Fixture, Plan, moved
from fronto.synth.photo.scenery import background, occluder
from fronto.synth.photo.style import METALS, ButtonStyle, button_style, in_relief, plate_style
from fronto.synth.photo.surfaces import Material, panel_material, panel_surface
from fronto.synth.photo.truth import PhotoObject, found
from fronto.synth.photo.view import View, sample_camera, sample_view, visible_part

__all__ = ["PanelPhoto", "render_photo"]

#: Canvas pixels a photo pixel, and the most that a canvas may have.
OVERSAMPLING, MAX_CANVAS_PX = 1.35, 1.3e6
#: About the colour of pills.
DARK = (18.0, 18.0, 18.0)
#: Least width and height of a photo, pixels.
MIN_PHOTO_PX = 32


@dataclass(frozen=True, eq=False)
class PanelPhoto:
    """A rendered photo and its truth.

    Parameters
    ----------
    image
        Shape (h, w, 3), uint8, RGB.
    camera
        The camera, without lens distortion.
    rotation, translation
        Shapes (3, 3) and (3,), metres: panel point X is at rotationᵀ (X + translation).
    objects
        Everything that is at least a quarter visible.
    """

    image: npt.NDArray[np.uint8]
    camera: Camera
    rotation: FloatArray
    translation: FloatArray
    objects: tuple[PhotoObject, ...]


def render_photo(
    rng: np.random.Generator,
    width: int = 640,
    height: int = 480,
    *,
    camera: Camera | None = None,
    twins: bool = False,
    relief: bool = False,
    pills: float = 0.1,
) -> PanelPhoto:
    """Draw a random panel, its surroundings and a view of it.

    Parameters
    ----------
    rng
        Draws everything; the same state gives the same photo.
    width, height
        Size of the photo in pixels, at least 32 each.
    camera
        The camera; None draws one.
    twins
        Whether the labels are on plates of the buttons' own form beside them, which are easily
        taken for buttons.
    relief
        Whether buttons may stand out of the panel, or lie in holes: from the side one sees their
        flanks, too. Outlines are those of the faces. Wide ones may have a lamp.
    pills
        Share of the panels whose buttons and labels may share dark pills, 0 to 1; in relief those
        buttons may be as dark.

    Raises
    ------
    InputError
        If the photo is too small, the share is none, or the camera is for another size or has
        distortion.
    """
    if min(width, height) < MIN_PHOTO_PX:
        raise InputError(
            "render_photo",
            f"expected a width and height of at least {MIN_PHOTO_PX} px, got {width}x{height}",
            "ask for a larger photo",
        )
    if not 0 <= pills <= 1:
        raise InputError("pills", f"expected a share from 0 to 1, got {pills:g}")
    if camera is None:
        camera = sample_camera(rng, width, height)
    elif (camera.width_px, camera.height_px) != (width, height):
        raise InputError(
            "camera",
            f"expected one for {width}x{height} px, got {camera.width_px}x{camera.height_px}",
            "give the photo's size as width and height",
        )
    elif camera.distortion_model != "none":
        raise InputError(
            "camera",
            f"expected a lens without distortion, got {camera.distortion_model}",
            "leave the distortion out",
        )
    plan = random_plan(rng, twins=twins, pills=pills)
    view = sample_view(rng, plan, camera)
    material = panel_material(rng)
    plans = (plan, *_company(rng, plan))
    wardrobe = _wardrobe(rng, material, plans, twins, relief)
    if relief:
        wardrobe = _with_depth(rng, wardrobe, view)
    canvas, elements = draw_plans(rng, plans, view, material, wardrobe)
    box = np.array(plan.box) / 1000
    photo = composed(canvas, background(rng, view, box), view)
    cover = None
    if chance(rng, 0.08):
        cover, color = occluder(rng, (height, width))
        photo = (photo + cover[..., None] * (color - photo)).astype(np.uint8)
    objects = found(elements, view, cover)
    image = develop(rng, photo, _brightness(photo, objects))
    for array in (image, view.rotation, view.translation):
        array.setflags(write=False)
    return PanelPhoto(image, camera, view.rotation, view.translation, objects)


def _brightness(photo: npt.NDArray[np.uint8], objects: tuple[PhotoObject, ...]) -> float:
    """Mean around the buttons: what the camera's exposure goes by, as a person taps there."""
    part = photo[::6, ::6]
    if objects:
        points = np.concatenate([o.polygon_px for o in objects])
        x0, y0 = np.maximum(np.floor(points.min(axis=0) - 12), 0).astype(int)
        x1, y1 = np.ceil(points.max(axis=0) + 12).astype(int)
        part = photo[y0:y1:3, x0:x1:3]
    return float(part.mean())


def _company(rng: np.random.Generator, plan: Plan) -> list[Plan]:
    """What else is on the wall: a second panel, a poster."""
    x0, y0, x1, y1 = plan.box
    others = []
    side = 1 if chance(rng, 0.5) else -1
    if chance(rng, 0.12):
        other = random_plan(rng)
        gap = plan.unit * rng.uniform(1, 10)
        dx = x1 + gap - other.box[0] if side > 0 else x0 - gap - other.box[2]
        others.append(moved(other, dx, rng.uniform(-0.5, 0.5) * (y1 - y0)))
        side = -side
    if chance(rng, 0.2):
        size = plan.unit * rng.uniform(2, 10)
        wide, tall = size * rng.uniform(0.5, 1), size * rng.uniform(0.5, 1.4)
        x = (x1 if side > 0 else x0) + side * (wide / 2 + plan.unit * rng.uniform(0.3, 4))
        y = rng.uniform(y0, y1)
        notice = Fixture(pick(rng, ("notice", "display", "speaker"), (6, 1, 1)), x, y, wide, tall)
        box = (x - wide / 2, y - tall / 2, x + wide / 2, y + tall / 2)
        others.append(Plan(box, (), (notice,), plan.unit))
    return others


def _wardrobe(
    rng: np.random.Generator,
    material: Material,
    plans: tuple[Plan, ...],
    twins: bool,
    relief: bool,
) -> Wardrobe:
    """Draw the styles of the buttons and plates on panels of a material."""
    turn = rng.uniform(0, 2 * np.pi) if chance(rng, 0.3) else rng.uniform(-2.6, -0.5)
    metal = tint(rng, pick(rng, METALS), 15)
    key = ButtonStyle(
        gap=0.02, collar=rng.uniform(0.05, 0.2), collar_color=metal,
        collar_relief=rng.uniform(-0.5, 0.8), face_color=tint(rng, metal, 10, rng.uniform(0.3, 1)),
        shadow=0.3, face_relief=rng.uniform(-0.5, 0.3),
    )  # fmt: skip
    mushroom = ButtonStyle(
        face_color=tint(rng, (190, 30, 28), 25), dome=rng.uniform(0.3, 0.9), shadow=0.6,
        collar=rng.uniform(0, 0.12) if chance(rng, 0.5) else 0.0,
        collar_color=pick(rng, ((225.0, 190.0, 40.0), (180.0, 180.0, 182.0))),
        ink=(240.0, 240.0, 240.0), label_share=0.25, face_relief=0.3,
    )  # fmt: skip
    plate = plate_style(rng, material.color, twins=twins)
    ground = material.color
    if any(fixture.kind == "pill" for plan in plans for fixture in plan.fixtures):
        # Those buttons lie on the pills, and may be as dark.
        ground = DARK if relief else ground
        plate = replace(plate, color=None, ink=tint(rng, (235, 235, 232), 15))
    return Wardrobe(
        buttons=(button_style(rng, ground), button_style(rng, ground)),
        key=key,
        mushroom=mushroom,
        plate=plate,
        lamp=(float(np.cos(turn)), float(np.sin(turn))),
        braille=tint(rng, pick(rng, ((225, 225, 225), (60, 60, 62), (150, 150, 150))), 20),
    )


def _with_depth(rng: np.random.Generator, wardrobe: Wardrobe, view: View) -> Wardrobe:
    """Buttons that stand out of the panel or lie in it, as seen from where the camera is."""
    x, y, distance = 1000 * view.translation
    return replace(
        wardrobe,
        buttons=tuple(_with_lamp(rng, in_relief(rng, style)) for style in wardrobe.buttons),
        key=_with_ring(rng, in_relief(rng, wardrobe.key, 0.0)),
        mushroom=replace(wardrobe.mushroom, height=rng.uniform(0.1, 0.7), wall=0.6),
        eye=(-float(x), -float(y), float(distance)),
    )


def _with_lamp(rng: np.random.Generator, style: ButtonStyle) -> ButtonStyle:
    """Some wide buttons have a lamp beside the label."""
    if not chance(rng, 0.3):
        return style
    return replace(
        style,
        lamp=rng.uniform(0.15, 0.45),
        lamp_right=chance(rng, 0.7),
        label_share=min(style.label_share, 0.5),
    )


def _with_ring(rng: np.random.Generator, key: ButtonStyle) -> ButtonStyle:
    """Some key switches have a ring around them that says what they are for."""
    wide = rng.uniform(0.2, 0.6) if chance(rng, 0.5) else 0.0
    color = tint(rng, pick(rng, ((25, 25, 28), (40, 40, 44), (200, 200, 200), (170, 30, 28))), 12)
    return replace(key, label_ring=wide, line_color=color)


def _blank_canvas(view: View, plans: tuple[Plan, ...]) -> tuple[tuple[int, int], float, FloatArray]:
    """Height and width, pixels a millimetre and origin of a canvas for what is visible."""
    parts = []
    for plan in plans:
        x0, y0, x1, y1 = np.array(plan.box) / 1000
        rim = 0.3 * plan.unit / 1000
        corners = np.array([(x0 - rim, y0 - rim), (x1 + rim, y0 - rim), (x1 + rim, y1 + rim),
                            (x0 - rim, y1 + rim)])  # fmt: skip
        parts.append(visible_part(corners, view, 2))
    points = np.concatenate(parts)
    if len(points) < 3:
        return (2, 2), 1.0, np.array(plans[0].box[:2])
    middle = points.mean(axis=0)
    probes = np.vstack([middle, (points + middle) / 2])
    low, high = points.min(axis=0) * 1000, points.max(axis=0) * 1000
    scale = OVERSAMPLING * max(_density(view, probe) for probe in probes) / 1000
    size = np.maximum(high - low, 0.1)
    scale = min(scale, float(np.sqrt(MAX_CANVAS_PX / size.prod())))
    shape = np.maximum(np.ceil(size * scale), 2).astype(int)
    return (int(shape[1]), int(shape[0])), scale, low


def _density(view: View, point: FloatArray) -> float:
    """Photo pixels a metre around a point of the panel: the mean over directions."""
    h = view.homography
    u, v, w = project(h, point[None])[0]
    jacobian = (h[:2, :2] - np.outer([u / w, v / w], h[2, :2])) / w
    return float(np.sqrt((jacobian**2).sum() / 2))


def draw_plans(
    rng: np.random.Generator,
    plans: tuple[Plan, ...],
    view: View,
    material: Material,
    wardrobe: Wardrobe,
) -> tuple[Canvas, list[Element]]:
    """Draw what is visible of panels head-on; gives the elements back as drawn."""
    import cv2

    shape, scale, origin = _blank_canvas(view, plans)
    surface = panel_surface(rng, material, shape, scale)
    canvas = Canvas(surface, np.zeros(shape, np.uint8), scale, (float(origin[0]), float(origin[1])))
    rounding = rng.uniform(0, 8) if chance(rng, 0.4) else 0.0
    alpha = np.zeros((*shape, 1), np.uint8)
    cut = Canvas(alpha, canvas.alpha, scale, canvas.origin)
    for plan in plans:
        x0, y0, x1, y1 = plan.box
        cut.box((x0 + x1) / 2, (y0 + y1) / 2, x1 - x0, y1 - y0, (255.0, 255.0, 255.0), rounding)
    canvas.alpha[:] = alpha[..., 0]
    if chance(rng, 0.5):  # the sheet's bevel
        inner = cv2.erode(canvas.alpha, np.ones((3, 3), np.uint8), iterations=max(1, round(scale)))
        rim = (canvas.alpha > 127) & (inner < 128)
        bright = float(rng.uniform(0.5, 1.5))
        canvas.rgb[rim] = np.clip(canvas.rgb[rim] * bright, 0, 255).astype(np.uint8)
    drawn: list[Element] = []
    for plan in plans:
        for fixture in plan.fixtures:
            draw_fixture(canvas, fixture, rng)
        for element in plan.elements:
            draw_surroundings(canvas, element, wardrobe, rng)
        done = {
            k: draw_element(canvas, plan.elements[k], wardrobe, rng)
            for k in _nearest_last(plan, wardrobe)
        }
        drawn += [done[k] for k in range(len(plan.elements))]
    return canvas, drawn


def _nearest_last(plan: Plan, wardrobe: Wardrobe) -> Sequence[int]:
    """A plan's elements in such an order that what stands out hides what is behind it only."""
    order = range(len(plan.elements))
    if not any(style.height > 0 for style in (*wardrobe.buttons, wardrobe.key, wardrobe.mushroom)):
        return order
    x, y, _ = wardrobe.eye
    away = [math.hypot(e.x - x, e.y - y) for e in plan.elements]
    return sorted(order, key=lambda k: -away[k])


def composed(canvas: Canvas, ground: npt.NDArray[np.uint8], view: View) -> npt.NDArray[np.uint8]:
    """The canvas warped into the photo, over a ground (h, w, 3)."""
    import cv2

    to_panel = np.diag([1 / (1000 * canvas.scale), 1 / (1000 * canvas.scale), 1.0])
    to_panel[:2, 2] = np.array(canvas.origin) / 1000
    warp = view.homography @ to_panel
    size = (ground.shape[1], ground.shape[0])
    # The picture is carried on beyond its border: only alpha cuts.
    panel = cv2.warpPerspective(canvas.rgb, warp, size, borderMode=cv2.BORDER_REPLICATE)
    alpha = cv2.warpPerspective(canvas.alpha, warp, size)
    shadow = cv2.GaussianBlur(cv2.resize(alpha, None, fx=0.25, fy=0.25), (0, 0), 1.5)
    light = cv2.resize(255 - shadow // 2, size, interpolation=cv2.INTER_LINEAR)
    photo = np.asarray(cv2.multiply(ground, cv2.merge([light] * 3), scale=1 / 255), np.uint8)
    edge = (alpha > 0) & (alpha < 255)
    cover = alpha[edge, None] / np.float32(255)
    rim = photo[edge] * (1 - cover) + panel[edge] * cover
    cv2.copyTo(panel, alpha, photo)
    photo[edge] = np.rint(rim).astype(np.uint8)
    return photo
