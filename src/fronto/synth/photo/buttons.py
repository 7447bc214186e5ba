"""Buttons, key switches and plates: small cached patches with exact edges, and their labels."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

from fronto.synth.photo import glyphs
from fronto.synth.photo.canvas import Canvas, Layers, Patch
from fronto.synth.photo.draws import Color, Pixels, chance
from fronto.synth.photo.forms import Form, signed_distance
from fronto.synth.photo.plan import KEY_STYLE, MUSHROOM_STYLE, PLATE_STYLE, Element, Label
from fronto.synth.photo.style import ButtonStyle, PlateStyle

__all__ = ["Wardrobe", "draw_element", "draw_surroundings", "lifted"]

BLACK: Color = (10.0, 10.0, 12.0)
#: Of rings around key switches.
RING_WORDS = ("ON", "OFF", "RUN", "STOP", "FAN", "LIGHT", "FIRE", "HOLD", "AUTO", "LOCK")
#: Buttons that are wider than this many heights may have a lamp; it lies within this share of them
#: at one end, the label in the rest, and is at most this share of them wide.
WIDE, LAMP_END, LAMP_WIDTH = 1.25, 0.35, 0.18
#: Letters of a bare label are padded by this share of their height.
PADDING = 0.15
#: Larger patches would cost seconds; such buttons fill the photo many times over.
MAX_PATCH_PX = 2600


@dataclass(frozen=True)
class Wardrobe:
    """The styles of one panel.

    Parameters
    ----------
    buttons
        The styles that elements point to.
    key, mushroom
        Styles of key switches and emergency buttons.
    plate
        Style of the plates.
    lamp
        Unit vector towards the light in the panel's plane.
    braille
        Colour of the dots.
    eye
        Where the camera is: x, y on the panel and the distance from it, millimetres.
    """

    buttons: tuple[ButtonStyle, ...]
    key: ButtonStyle
    mushroom: ButtonStyle
    plate: PlateStyle
    lamp: tuple[float, float]
    braille: Color
    eye: tuple[float, float, float] = (0.0, 0.0, math.inf)

    def style(self, element: Element) -> ButtonStyle:
        """The style of a button (not of a plate)."""
        if element.style == KEY_STYLE:
            return self.key
        if element.style == MUSHROOM_STYLE:
            return self.mushroom
        return self.buttons[element.style % len(self.buttons)]


def _coverage(distance: Pixels) -> Pixels:
    return np.asarray(np.clip(np.float32(0.5) - distance, 0, 1), np.float32)


class _Ground:
    """Distances around a form in pixels, and the light on slopes along its edge."""

    def __init__(self, form: Form, margin: float, lamp: tuple[float, float]) -> None:
        half_w = int(np.ceil(form.width / 2 + margin)) + 1
        half_h = int(np.ceil(form.height / 2 + margin)) + 1
        self.x = np.arange(-half_w, half_w + 1, dtype=np.float32)[None]
        self.y = np.arange(-half_h, half_h + 1, dtype=np.float32)[:, None]
        self.form = form
        self.distance = signed_distance(form, self.x, self.y)
        gy, gx = np.gradient(self.distance)
        self.facing = np.asarray(gx * np.float32(lamp[0]) + gy * np.float32(lamp[1]), np.float32)

    def soft(self, offset: tuple[float, float], reach: float, blur: float) -> Pixels:
        """A soft shadow of the form: 1 inside, 0 beyond `blur` pixels."""
        x, y = self.x - np.float32(offset[0]), self.y - np.float32(offset[1])
        d = signed_distance(self.form, x, y)
        t = np.clip(np.float32(0.5) - (d - np.float32(reach)) / np.float32(2 * blur), 0, 1)
        return np.asarray(t * t * (3 - 2 * t), np.float32)


def _button_patch(form: Form, style: ButtonStyle, lit: bool, lamp: tuple[float, float]) -> Patch:
    """A button without its label; `form` is in pixels."""
    side = min(form.width, form.height)
    glow = lit and style.lit_part != "symbol"
    margin = side * (max(style.gap, 0.25 * (style.shadow > 0), 0.35 * glow)) + 2
    ground = _Ground(form, margin, lamp)
    d, layers = ground.distance, Layers(ground.distance.shape)
    if style.shadow > 0:
        away = (-0.06 * side * lamp[0], -0.06 * side * lamp[1])
        layers.over(style.shadow * ground.soft(away, 0.02 * side, 0.12 * side + 0.5), BLACK)
    if style.gap > 0:
        layers.over(0.85 * _coverage(d - np.float32(style.gap * side)), BLACK)
    if glow:
        halo = np.exp(-np.maximum(d, 0) / np.float32(0.1 * side)) * np.float32(0.7)
        rim = np.clip((np.float32(0.33 * side) - d) / np.float32(0.1 * side), 0, 1)
        layers.over(np.asarray(halo * rim, np.float32), style.light)
    ring = style.collar * side
    if ring > 0:
        layers.over(style.collar_opacity * _coverage(d), style.collar_color)
        arch = np.clip(1 - np.abs(d / np.float32(ring) + 0.5) * 2, -1, 1)
        slope = np.where(d > -ring, np.float32(0.5) - d / np.float32(-ring), 0)
        inside = _coverage(d) * (1 - _coverage(d + np.float32(ring)))
        layers.light(style.collar_relief * inside * ground.facing * slope + 0.1 * inside * arch)
    face = _coverage(d + np.float32(ring))
    _paint_face(layers, ground, style, face, ring, lit)
    if style.line > 0 or (lit and style.lit_part == "ring"):
        wide = np.float32(max(style.line * side, ring, 0.07 * side * lit))
        band = _coverage(d) * (1 - _coverage(d + wide))
        bright = lit and style.lit_part == "ring"
        layers.over(band, style.light if bright else style.line_color)
        if bright:
            layers.light(0.5 * band * _coverage(np.abs(d + wide / 2) - wide / 4))
            inner = np.exp(np.minimum(d + wide, 0) / np.float32(0.12 * side))
            layers.over(np.asarray(0.45 * inner * face, np.float32), style.light)
    return layers.patch()


def _paint_face(
    layers: Layers, ground: _Ground, style: ButtonStyle, face: Pixels, ring: float, lit: bool
) -> None:
    side = min(ground.form.width, ground.form.height)
    d = ground.distance + np.float32(ring)
    color, opacity = style.face_color, style.face_opacity
    if lit and style.lit_part == "face":
        r, g, b = (0.75 * c + 64 for c in style.light)
        color, opacity = (r, g, b), 0.95
    if opacity > 0:
        layers.over(np.float32(opacity) * face, color)
    if lit and style.lit_part == "face":
        core = np.clip(-d / np.float32(0.5 * side), 0, 1)
        layers.light(0.45 * face * core)
    if style.face_relief:
        slope = np.clip(1 + d / np.float32(max(1.0, style.bevel * side)), 0, 1)
        layers.light(np.float32(style.face_relief) * face * slope * ground.facing)
    if style.dome:
        lift = (ground.x * np.sign(style.dome) * 0.6 - ground.y * style.dome) / np.float32(side)
        layers.light(np.asarray(face * np.abs(np.float32(style.dome)) * lift, np.float32))
        x = (ground.x + 0.15 * side) / np.float32(0.22 * side)
        y = (ground.y + 0.22 * side) / np.float32(0.14 * side)
        shine = np.exp(-(x * x + y * y)) * np.float32(0.45 * max(style.dome, 0))
        layers.light(np.asarray(shine * face, np.float32))
    if style.inner_shadow:
        down = ground.y - np.float32(0.12 * side)
        open_ = signed_distance(ground.form, ground.x, down) + np.float32(ring)
        dark = np.clip(np.float32(0.5) + open_ / np.float32(0.1 * side + 1), 0, 1)
        layers.over(np.asarray(style.inner_shadow * dark * face, np.float32), BLACK)


def _plate_patch(form: Form, style: PlateStyle, lamp: tuple[float, float]) -> Patch:
    ground = _Ground(form, 2, lamp)
    layers = Layers(ground.distance.shape)
    face = _coverage(ground.distance)
    assert style.color is not None
    layers.over(face, style.color)
    side = min(form.width, form.height)
    slope = np.clip(1 + ground.distance / np.float32(max(1.0, 0.06 * side)), 0, 1)
    layers.light(np.float32(style.relief) * face * slope * ground.facing)
    return layers.patch()


def label_mask(label: Label, font: int) -> tuple[glyphs.Bits, bool]:
    """The label's mask, and whether it is words (which stretch) or a symbol."""
    if not label.text:
        return glyphs.symbol(label.symbol, label.variant), False
    lines = [glyphs.words(word, font) for word in label.text.split()]
    if len(lines) == 1:
        return lines[0], True
    width = max(line.shape[1] for line in lines)
    rows = [np.pad(line, ((6, 6), ((width - line.shape[1]) // 2,) * 2)) for line in lines]
    width = min(row.shape[1] for row in rows)
    return np.ascontiguousarray(np.vstack([row[:, :width] for row in rows])), True


def _label_size(
    mask: glyphs.Bits, words: bool, share: float, stretch: float, room: tuple[float, float]
) -> tuple[float, float]:
    """Width and height of a label within room of width and height."""
    height = share * min(room) * (1.0 if words else 1.35)
    width = height * (mask.shape[1] / mask.shape[0] * stretch if words else 1.0)
    shrink = min(1.0, 0.84 * room[0] / width, 0.84 * room[1] / height)
    return width * shrink, height * shrink


def draw_element(
    canvas: Canvas, element: Element, wardrobe: Wardrobe, rng: np.random.Generator
) -> Element:
    """Draw a button or plate; gives it back as drawn (moved to a pixel's centre, fitted)."""
    plate = element.style == PLATE_STYLE
    style = None if plate else wardrobe.style(element)
    foot = element
    if style and style.height:
        element = lifted(element, style, wardrobe.eye)
    x, y = canvas.snapped(element.x, element.y)
    element = replace(element, x=x, y=y)
    label = element.label
    drawn = bool(label.text or label.symbol)
    look = style or wardrobe.plate
    form = element.form
    size = (0.0, 0.0)
    if drawn:
        mask, words = label_mask(label, look.font)
        share = style.label_share if style else (0.62 if words else 0.6)
        inside = 1 - 2 * (style.collar if style else 0)
        beside = 1 - LAMP_END if style and _has_lamp(style, form) else 1.0
        room = (inside * beside * form.width, inside * form.height)
        size = _label_size(mask, words, share, look.stretch, room)
    if plate:
        form = _fitted(form, wardrobe.plate, size)
        bare = wardrobe.plate.color is None
        element = replace(element, form=form, braille=element.braille and not bare)
    if not canvas.sees(x, y, 2 * form.width, 2 * form.height):
        return element
    pixels = form.scaled(canvas.scale)
    if max(pixels.width, pixels.height) > MAX_PATCH_PX:
        return element
    key = (form, element.style, element.lit)
    if style and style.height > 0:
        _draw_flanks(canvas, foot, element, style, wardrobe)
    if style and style.height:
        style = replace(style, gap=0.0, shadow=0.0)
    if key not in canvas.patches and style:
        canvas.patches[key] = _button_patch(pixels, style, element.lit, wardrobe.lamp)
    elif key not in canvas.patches and wardrobe.plate.color is not None:
        canvas.patches[key] = _plate_patch(pixels, wardrobe.plate, wardrobe.lamp)
    if key in canvas.patches:
        canvas.stamp(canvas.patches[key], x, y)
    if element.style == KEY_STYLE:
        _draw_slot(canvas, element, rng)
    elif drawn:
        _draw_label(canvas, element, look, size)
    if style and _has_lamp(style, element.form):
        _draw_lamp(canvas, element, style)
    if element.braille:
        _draw_braille(canvas, element, wardrobe.braille, rng)
    return element


def lifted(element: Element, style: ButtonStyle, eye: tuple[float, float, float]) -> Element:
    """Where on the panel's plane the camera sees a face that lies before or behind that plane.

    Seen from one point, what lies in a parallel plane is a scaled picture of it: the outline
    drawn there is exactly that of the face.
    """
    height = style.height * min(element.form.width, element.form.height)
    scale = 1 / (1 - min(height / eye[2], 0.5))
    return replace(
        element,
        x=eye[0] + scale * (element.x - eye[0]),
        y=eye[1] + scale * (element.y - eye[1]),
        form=element.form.scaled(scale),
    )


def draw_surroundings(
    canvas: Canvas, element: Element, wardrobe: Wardrobe, rng: np.random.Generator
) -> None:
    """What lies in the panel around a button: its hole, the ring with what it is for.

    Drawn before all buttons: it may reach below their neighbours.
    """
    if element.style == PLATE_STYLE:
        return
    style, form = wardrobe.style(element), element.form
    wide = 1 + 2 * max(style.label_ring, 0.5)
    if not canvas.sees(element.x, element.y, wide * form.width, wide * form.height):
        return
    if max(form.width, form.height) * wide * canvas.scale > MAX_PATCH_PX:
        return
    if style.label_ring:
        _draw_label_ring(canvas, element, style, wardrobe, rng)
    if style.height < 0:
        face = lifted(element, style, wardrobe.eye)
        away = math.hypot(face.x - element.x, face.y - element.y)
        # The hole is wide enough for all of the face to be seen.
        wider = 1 + 2 * max(style.hole, away / min(form.width, form.height))
        r, g, b = (style.wall * c for c in style.collar_color)
        dark = ButtonStyle(face_color=(r, g, b), inner_shadow=0.5)
        _stamp(canvas, form.scaled(wider), dark, wardrobe, element.x, element.y)


def _draw_flanks(
    canvas: Canvas, foot: Element, face: Element, style: ButtonStyle, wardrobe: Wardrobe
) -> None:
    """What a button that stands out stands on, with its gap and shadow; then its flanks."""
    away = math.hypot(face.x - foot.x, face.y - foot.y)
    r, g, b = (style.wall * c for c in style.face_color)
    wall = ButtonStyle(face_color=(r, g, b), face_relief=0.35, bevel=0.3)
    stands = replace(wall, gap=style.gap, shadow=style.shadow)
    _stamp(canvas, foot.form, stands, wardrobe, foot.x, foot.y)
    slices = int(np.clip(np.ceil(away * canvas.scale / 1.5), 1, 16))
    for k in range(slices):
        share = k / slices
        form = foot.form if share < 0.5 else face.form
        x, y = (a + share * (b - a) for a, b in ((foot.x, face.x), (foot.y, face.y)))
        _stamp(canvas, form, wall, wardrobe, x, y)


def _draw_label_ring(
    canvas: Canvas,
    element: Element,
    style: ButtonStyle,
    wardrobe: Wardrobe,
    rng: np.random.Generator,
) -> None:
    """A ring around a key switch, with a word or two on it."""
    side = min(element.form.width, element.form.height)
    wide = style.label_ring * side
    ring = element.form.scaled(1 + 2 * style.label_ring)
    flat = ButtonStyle(face_color=style.line_color, face_relief=0.15, shadow=0.3)
    _stamp(canvas, ring, flat, wardrobe, element.x, element.y)
    ink = (235.0, 235.0, 230.0) if sum(style.line_color) < 380 else (25.0, 25.0, 28.0)
    for up in (-1, 1):
        if not chance(rng, 0.7):
            continue
        mask = glyphs.words(RING_WORDS[int(rng.integers(len(RING_WORDS)))], style.font)
        height = 0.45 * wide
        width = min(height * mask.shape[1] / mask.shape[0], 1.1 * side)
        y = element.y + up * (side / 2 + wide / 2)
        canvas.ink(mask, element.x, y, (width, height), ink, 0.9)


def _stamp(
    canvas: Canvas, form: Form, style: ButtonStyle, wardrobe: Wardrobe, x: float, y: float
) -> None:
    """A form without a label, drawn once and kept."""
    key = (form, style)
    if key not in canvas.patches:
        patch = _button_patch(form.scaled(canvas.scale), style, False, wardrobe.lamp)
        canvas.patches[key] = patch
    canvas.stamp(canvas.patches[key], x, y)


def _fitted(form: Form, style: PlateStyle, ink: tuple[float, float]) -> Form:
    """A plate's outline: its rectangle, or the padded box of bare characters."""
    if style.color is None and ink[0] > 0:
        pad = 2 * PADDING * ink[1]
        return Form("box", ink[0] + pad, ink[1] + pad)
    if style.given:
        return form
    radius = style.rounding * min(form.width, form.height)
    if style.rounding == 0.5 and form.width == form.height:
        return Form("ellipse", form.width, form.height)
    return replace(form, radius=radius)


def _draw_label(
    canvas: Canvas, element: Element, look: ButtonStyle | PlateStyle, size: tuple[float, float]
) -> None:
    mask, _ = label_mask(element.label, look.font)
    ink, x, y = look.ink, element.x, element.y
    if element.braille:
        y -= 0.06 * element.form.height
    if isinstance(look, ButtonStyle):
        if _has_lamp(look, element.form):
            x -= (1 if look.lamp_right else -1) * LAMP_END / 2 * element.form.width
        if element.lit and look.lit_part == "face":
            ink = (40.0, 30.0, 30.0) if sum(look.light) > 400 else (255.0, 250.0, 245.0)
        elif element.lit and look.lit_part == "symbol":
            ink = look.light
        if look.engraved:
            lip = 0.03 * min(element.form.width, element.form.height)
            canvas.ink(mask, x + lip / 2, y + lip, size, (255.0, 255.0, 255.0), 0.4)
    canvas.ink(mask, x, y, size, ink, 0.95)


def _has_lamp(style: ButtonStyle, form: Form) -> bool:
    return style.lamp > 0 and form.width > WIDE * form.height


def _draw_lamp(canvas: Canvas, element: Element, style: ButtonStyle) -> None:
    """A small lamp, round or not, at one end of a wide button."""
    form, inside = element.form, 1 - 2 * style.collar
    # It lies on the face, of round ends, too.
    most = LAMP_WIDTH * inside * form.width
    size = min(style.lamp * inside * form.height, most)
    side = 1 if style.lamp_right else -1
    x = element.x + side * (0.5 - LAMP_END / 2) * inside * form.width
    color = style.light if element.lit else style.collar_color
    if style.font % 2:
        canvas.disc(x, element.y, size / 2, color)
        canvas.disc(x, element.y, size / 2, BLACK, 0.15 * size)
    else:
        wide = min(1.6 * size, most)
        canvas.box(x, element.y, wide, size, BLACK)
        canvas.box(x, element.y, 0.8 * wide, 0.75 * size, color)


def _draw_slot(canvas: Canvas, element: Element, rng: np.random.Generator) -> None:
    """A key switch's cylinder with its slot, turned anyhow."""
    import cv2

    size = 0.5 * element.form.width
    if chance(rng, 0.6):
        bright = float(rng.uniform(120, 220))
        canvas.disc(element.x, element.y, 0.62 * size, (bright, bright, 0.95 * bright))
        canvas.disc(element.x, element.y, 0.62 * size, (40.0, 40.0, 42.0), 0.06 * size)
    mask = glyphs.symbol("keyhole", int(rng.integers(2)))
    if chance(rng, 0.5):
        middle = ((mask.shape[1] - 1) / 2, (mask.shape[0] - 1) / 2)
        turn = cv2.getRotationMatrix2D(middle, float(rng.uniform(-90, 90)), 1.0)
        mask = np.asarray(cv2.warpAffine(mask, turn, mask.shape[::-1]), np.uint8)
    canvas.ink(mask, element.x, element.y, (1.1 * size, 1.1 * size), BLACK)


def _draw_braille(canvas: Canvas, element: Element, color: Color, rng: np.random.Generator) -> None:
    """Two or three rows of dots below the label."""
    pitch = 0.07 * min(element.form.width, element.form.height)
    if pitch * canvas.scale < 0.8:
        return
    columns = int(rng.integers(2, 5))
    for index in np.flatnonzero(rng.random(3 * columns) < 0.55):
        row, column = divmod(int(index), columns)
        at = (
            element.x + (column - (columns - 1) / 2) * pitch * 1.2,
            element.y + 0.27 * element.form.height + (row - 1) * pitch,
        )
        canvas.disc(*at, 0.38 * pitch, color)
