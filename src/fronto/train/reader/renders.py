"""Rendered crops: one button or plate close up, with a label that is known for sure."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np

from fronto.categories import PLATE
from fronto.datasets.records import Box, polygon_box
from fronto.labels.targets import ReadTarget, read_target
from fronto.shapes import FloatArray
from fronto.synth.photo import glyphs
from fronto.synth.photo.buttons import Wardrobe, draw_element
from fronto.synth.photo.canvas import Canvas
from fronto.synth.photo.draws import Color, chance, log_uniform, pick, tint, whole
from fronto.synth.photo.effects import lighting
from fronto.synth.photo.forms import Form
from fronto.synth.photo.glyphs import Bits
from fronto.synth.photo.plan import KEY_STYLE, MUSHROOM_STYLE, PLATE_STYLE, Element, Label
from fronto.synth.photo.style import DARKS, LIGHTS, METALS, WHITES, button_style, plate_style
from fronto.synth.photo.surfaces import panel_material, panel_surface
from fronto.train.reader.fonts import Typefaces
from fronto.train.reader.inks import Bytes, braille, lay_ink, marking_mask
from fronto.train.reader.jitter import Sample, surrounded
from fronto.train.reader.locks import draw_lock
from fronto.train.reader.texts import Marking, random_marking

__all__ = ["render_crop", "render_panel_crops"]

#: Side of the picture, and of the button's longer side in it, pixels: the rest is surroundings.
PICTURE_PX, FACE_PX = 88, 64
BLANK = Label()
#: Objects of rendered photos that are cut out are at least this large, pixels.
MIN_SIDE_PX = 11.0
#: Labels are at least this high, in the heights that they have room for, if they can be.
LEAST_HEIGHT = 0.3
#: Visible shares of objects that count as whole.
WHOLE = 0.97
#: How far the panel's horizontal may point up or down in a photo: a turned arrow is another.
MOST_TURNED = 0.35
#: Share of the key switches that are drawn as close up as they are seen.
LOCKS = 0.8
#: What stands small above or below a label.
NOTES = ("FLOOR", "LEVEL", "ND FLOOR", "LOBBY", "PARKING", "GROUND FLOOR", "EXIT", "LIFT", "DOOR",
         "PUSH", "PULL", "CAR PARK", "MAIN", "ROOF", "POOL", "TO RESET", "PRESS", "FOR", "HOLD",
         "ELEVATOR", "Restaurant", "Lobby", "Level 2", "Etage")  # fmt: skip
#: Categories of rendered photos whose look is certain.
CERTAIN = ("up", "down", "keyhole")


def render_crop(
    rng: np.random.Generator, faces: Typefaces, marking: Marking | None = None
) -> Sample:
    """Draw a button or a plate with its label.

    Parameters
    ----------
    rng
        Draws everything.
    faces
        Typefaces of the label.
    marking
        What it says; None: anything.

    Returns
    -------
    A picture of 88 x 88 pixels; the box around the button or plate is about 64 wide or high.
    """
    marking = marking or random_marking(rng)
    material = panel_material(rng)
    surface = panel_surface(rng, material, (PICTURE_PX, PICTURE_PX), 1.0)
    canvas = Canvas(surface, np.full((PICTURE_PX, PICTURE_PX), 255, np.uint8), 1.0, (0.0, 0.0))
    wardrobe = _wardrobe(rng, material.color)
    element = _element(rng, marking)
    drawn = draw_element(canvas, element, wardrobe, rng)
    _neighbours(canvas, drawn, wardrobe, rng)
    if element.style == KEY_STYLE:
        if chance(rng, LOCKS):
            size = FACE_PX * pick(rng, (1.0, rng.uniform(0.55, 1.0)), (2, 1))
            draw_lock(canvas.rgb, drawn.x, drawn.y, size, rng)
    else:
        _mark(canvas.rgb, marking, drawn, wardrobe, faces, rng)
    if chance(rng, 0.25):
        _scratch(canvas.rgb, rng)
    gain, glare = lighting(rng, (PICTURE_PX, PICTURE_PX))
    lit = canvas.rgb * gain[..., None] + np.float32(0.4) * glare[..., None]
    image = np.clip(lit, 0, 255).astype(np.uint8)
    form = drawn.form
    return Sample(image, _box(drawn.x, drawn.y, form.width, form.height), marking.target)


def _box(x: float, y: float, width: float, height: float) -> Box:
    return x - width / 2, y - height / 2, x + width / 2, y + height / 2


def _wardrobe(rng: np.random.Generator, panel: Color) -> Wardrobe:
    metal = tint(rng, pick(rng, METALS), 15)
    style = button_style(rng, panel)
    turn = rng.uniform(-2.6, -0.5)
    return Wardrobe(
        buttons=(style,),
        key=replace(style, collar_color=metal, collar=rng.uniform(0.05, 0.2), face_color=metal),
        mushroom=replace(style, face_color=tint(rng, (190, 30, 28), 25), dome=rng.uniform(0, 0.9)),
        plate=plate_style(rng, panel),
        lamp=(float(np.cos(turn)), float(np.sin(turn))),
        braille=(200.0, 200.0, 200.0),
    )


def _element(rng: np.random.Generator, marking: Marking) -> Element:
    """Where the label goes: a button mostly, a plate, a key switch, an emergency button."""
    kind = marking.target.kind
    wide = len(marking.text.split("\n")[0])
    aspect = log_uniform(rng, 0.75, 1.35)
    if chance(rng, 0.1):
        aspect = log_uniform(rng, 0.5, 2.2)
    if wide > 3 and chance(rng, 0.5):
        aspect *= 1.5
    aspect = float(np.clip(aspect, 0.45, 2.5))
    width, height = FACE_PX * min(1, aspect), FACE_PX * min(1, 1 / aspect)
    if chance(rng, 0.45):
        form = Form("ellipse", width, height)
    else:
        radius = pick(rng, (0.0, 0.06, 0.15, 0.3, 0.5), (3, 3, 2, 1.5, 1)) * min(width, height)
        form = Form("box", width, height, radius)
    style = 0
    if kind == "keyhole" and chance(rng, 0.8):
        style = KEY_STYLE
        if form.kind == "ellipse" or chance(rng, 0.6):
            form = Form("ellipse", FACE_PX, FACE_PX)
    elif kind in ("stop", "alarm") and chance(rng, 0.35):
        style = MUSHROOM_STYLE
    elif kind != "blank" and chance(rng, 0.25):
        style = PLATE_STYLE
    elif kind in ("up", "down") and chance(rng, 0.08):
        form = Form("up" if kind == "up" else "down", width, height)
    lit = chance(rng, 0.2) and style == 0
    at = PICTURE_PX / 2 + rng.uniform(-3, 3, 2)
    return Element(float(at[0]), float(at[1]), form, "number", "", BLANK, style, lit)


def _neighbours(
    canvas: Canvas, element: Element, wardrobe: Wardrobe, rng: np.random.Generator
) -> None:
    """Parts of the buttons beside it."""
    if element.style == KEY_STYLE or chance(rng, 0.4):
        return
    gap = log_uniform(rng, 1.02, 1.5)
    for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        if chance(rng, 0.5):
            x = element.x + dx * gap * element.form.width
            y = element.y + dy * gap * element.form.height
            draw_element(canvas, replace(element, x=x, y=y, lit=False), wardrobe, rng)


def _mark(
    picture: Bytes,
    marking: Marking,
    element: Element,
    wardrobe: Wardrobe,
    faces: Typefaces,
    rng: np.random.Generator,
) -> None:
    """Put the label on, as large as it fits or smaller, and braille below or beside it."""
    if marking.target.kind == "blank":
        if chance(rng, 0.35):
            _ornament(picture, element, rng)
        return
    form = element.form
    style = None if element.style == PLATE_STYLE else wardrobe.style(element)
    room = np.array([form.width, form.height]) * (1 - 2 * (style.collar if style else 0))
    if form.kind == "ellipse":
        room = room * (0.78 if len(marking.text) > 1 else 0.88)
    middle = np.array([element.x, element.y])
    if chance(rng, 0.12):
        _lamp(picture, element, rng)
    if chance(rng, 0.22):
        middle, room = _with_braille(picture, middle, room, rng)
    elif chance(rng, 0.1):
        middle, room = _with_note(picture, middle, room, rng)
    mask = marking_mask(marking, faces, rng)
    box = _fitted(mask, bool(marking.text), middle, room, rng)
    glow = None
    if style and element.lit and style.lit_part == "symbol":
        glow = style.light
    elif not element.lit and chance(rng, 0.06):
        glow = pick(rng, LIGHTS)
    lay_ink(picture, mask, box, _ink(picture, box, rng), rng, glow=glow)


def _with_braille(
    picture: Bytes, middle: FloatArray, room: FloatArray, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Dots in a part of the room; gives the middle and the size of what is left."""
    color: Color = tint(rng, pick(rng, (*METALS, *WHITES, *DARKS)), 20)
    pitch = rng.uniform(0.05, 0.09) * min(room)
    if chance(rng, 0.7):
        aside, left = np.array([0, 0.48]), np.array([1, 0.7])
    else:
        aside, left = np.array([pick(rng, (0.5, -0.5)), 0]), np.array([0.6, 1])
    middle = middle - 0.3 * aside * room
    x, y = middle + aside * room
    braille(picture, (float(x), float(y)), pitch, color, rng)
    return middle, room * left


def _with_note(
    picture: Bytes, middle: FloatArray, room: FloatArray, rng: np.random.Generator
) -> tuple[FloatArray, FloatArray]:
    """Small words in a part of the room; gives the middle and the size of what is left."""
    side = pick(rng, (1, -1), (2, 1))
    mask = glyphs.words(pick(rng, NOTES), whole(rng, 0, glyphs.FONTS - 1))
    share = rng.uniform(0.14, 0.26)
    size = np.array([mask.shape[1] / mask.shape[0], 1]) * share * room[1]
    size[0] = min(size[0], 0.95 * room[0])
    x, y = middle + np.array([0, side * 0.48]) * room - np.array([0, side * size[1] / 2])
    box = _box(float(x), float(y), float(size[0]), float(size[1]))
    lay_ink(picture, mask, box, _ink(picture, box, rng), rng)
    return middle - np.array([0, side * share / 2]) * room, room * np.array([1, 1 - share])


def _lamp(picture: Bytes, element: Element, rng: np.random.Generator) -> None:
    """A lit or dark bar or dot at the rim."""
    width, height = element.form.width, element.form.height
    color: Color = tint(rng, pick(rng, (*LIGHTS, *LIGHTS, *DARKS)), 25)
    x, y = element.x, element.y + pick(rng, (-0.42, 0.42), (2, 1)) * height
    if chance(rng, 0.6):
        reach, thick = rng.uniform(0.1, 0.45) * width, rng.uniform(0.02, 0.06) * height
        ends = [(round((x + s * reach) * 16), round((y + s * thick) * 16)) for s in (-1, 1)]
        cv2.rectangle(picture, ends[0], ends[1], color, -1, cv2.LINE_AA, 4)
    else:
        at = (round((x + rng.uniform(-0.35, 0.35) * width) * 16), round(y * 16))
        radius = rng.uniform(0.03, 0.08) * min(width, height)
        cv2.circle(picture, at, round(radius * 16), color, -1, cv2.LINE_AA, 4)


def _fitted(
    mask: Bits, words: bool, middle: FloatArray, room: FloatArray, rng: np.random.Generator
) -> Box:
    """Where a label goes that has this room around a point."""
    # Letters are drawn narrower or wider, signs stay as they are but for the crop's squeezing.
    stretch = log_uniform(rng, 0.7, 1.3) if words else log_uniform(rng, 0.9, 1.1)
    size = np.array([mask.shape[1] * stretch, float(mask.shape[0])])
    most = float((np.array([0.92, 0.9]) * room / size).min())
    scale = most * pick(rng, (1.0, rng.uniform(0.55, 1.0)), (2, 3))
    if size[1] * scale < LEAST_HEIGHT * room[1]:
        scale = most
    size = size * scale
    spare = np.maximum(room - size, 0) / 2
    x, y = middle + np.clip(rng.normal(0, 0.12, 2), -0.5, 0.5) * spare
    return _box(float(x), float(y), float(size[0]), float(size[1]))


def _ink(picture: Bytes, box: Box, rng: np.random.Generator) -> Color:
    """A colour that can be told from the face, sometimes barely."""
    x0, y0, x1, y1 = (round(edge) for edge in box)
    ground = picture[max(0, y0) : y1 + 1, max(0, x0) : x1 + 1].reshape(-1, 3).mean(axis=0)
    bright = float(ground.mean())
    if chance(rng, 0.15):  # the same colour, somewhat darker or brighter
        step = rng.uniform(35, 80) * (-1 if bright > 110 else 1)
        r, g, b = np.clip(ground + step, 0, 255)
        return float(r), float(g), float(b)
    if chance(rng, 0.15):
        color = pick(rng, (*LIGHTS, (170.0, 35.0, 30.0), (40.0, 70.0, 150.0), (40.0, 120.0, 70.0)))
        if abs(sum(color) / 3 - bright) > 45:
            return tint(rng, color, 15)
    dark = bright > 125 if abs(bright - 125) > 45 else chance(rng, 0.5)
    return tint(rng, (25, 25, 28), 20) if dark else tint(rng, (232, 232, 230), 22)


def _ornament(picture: Bytes, element: Element, rng: np.random.Generator) -> None:
    """What blank buttons have: a lamp in the middle, a ring, a dot at the rim."""
    side = min(element.form.width, element.form.height)
    color = tint(rng, pick(rng, (*METALS, *LIGHTS, *DARKS, *WHITES)), 20)
    x, y = element.x, element.y
    if chance(rng, 0.3):
        x, y = x + rng.uniform(-0.3, 0.3) * side, y + rng.uniform(-0.3, 0.3) * side
    radius = side * (rng.uniform(0.03, 0.12) if chance(rng, 0.6) else rng.uniform(0.12, 0.4))
    thick = -1 if radius < 0.2 * side else whole(rng, 1, 4)
    at = (round(x * 16), round(y * 16))
    cv2.circle(picture, at, round(radius * 16), color, thick, cv2.LINE_AA, 4)


def _scratch(picture: Bytes, rng: np.random.Generator) -> None:
    layer = picture.copy()
    bright = float(rng.uniform(0, 255))
    for _ in range(whole(rng, 1, 12)):
        ends = rng.integers(-20, PICTURE_PX + 20, (2, 2)) * 16
        first, last = ((int(u), int(v)) for u, v in ends)
        cv2.line(layer, first, last, (bright, bright, bright), 1, cv2.LINE_AA, 4)
    share = rng.uniform(0.1, 0.5)
    cv2.addWeighted(layer, share, picture, 1 - share, 0, dst=picture)


def render_panel_crops(rng: np.random.Generator) -> list[Sample]:
    """Crops of a whole rendered photo, as far as it is sure what they show.

    Returns
    -------
    None to dozens: floors of panels without plates, plates, arrows and key switches, whole,
    upright and large enough.
    """
    from fronto.synth.photo import render_photo

    photo = render_photo(rng)
    right, down, _ = photo.rotation[0]
    if right < 0 or abs(down) > MOST_TURNED:
        return []
    plates = any(o.category == PLATE for o in photo.objects)
    found = []
    for o in photo.objects:
        target = None
        if o.category in CERTAIN:
            target = ReadTarget(o.category)
        # A button beside a plate has the plate's text without showing it.
        elif o.category == PLATE or (o.category == "number" and not plates):
            target = read_target(o.text)
        box = polygon_box(o.polygon_px)
        side = min(box[2] - box[0], box[3] - box[1])
        certain = target is not None and target.kind in ("text", *CERTAIN)
        if target is not None and certain and o.visible > WHOLE and side >= MIN_SIDE_PX:
            found.append(surrounded(photo.image, box, target))
    return found
