"""How a family of buttons is built and coloured; every panel draws its own."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fronto.synth.photo.draws import Color, chance, log_uniform, pick, tint

__all__ = [
    "LIGHTS",
    "METALS",
    "PLAIN",
    "ButtonStyle",
    "PlateStyle",
    "button_style",
    "in_relief",
    "plate_style",
]

METALS: tuple[Color, ...] = (
    (188, 190, 194),
    (165, 166, 168),
    (140, 140, 142),
    (205, 203, 198),
    (190, 165, 110),
    (168, 130, 70),
    (150, 110, 80),
)
DARKS: tuple[Color, ...] = ((22, 22, 24), (38, 38, 42), (55, 55, 58), (28, 30, 45))
WHITES: tuple[Color, ...] = ((238, 238, 235), (222, 218, 205), (205, 210, 212))
HUES: tuple[Color, ...] = ((170, 35, 30), (40, 70, 150), (40, 120, 70), (215, 180, 50))
LIGHTS: tuple[Color, ...] = (
    (255, 120, 30),
    (255, 50, 40),
    (80, 160, 255),
    (255, 250, 240),
    (70, 255, 110),
    (255, 200, 70),
)


@dataclass(frozen=True)
class ButtonStyle:
    """What a family of buttons looks like; lengths as shares of the shorter side.

    Parameters
    ----------
    gap
        Width of the dark gap around the outline.
    shadow
        Opacity of the shadow that the button casts (0 = flush).
    collar
        Width of a ring or frame just inside the outline (0 = none).
    collar_color, face_color
        Colours.
    collar_opacity, face_opacity
        Below 1 the panel's own material shows through.
    collar_relief, face_relief
        Light on the bevels, -1 to 1; negative ones are sunk.
    bevel
        Width of the face's bevel.
    dome
        Light on a face that bulges (or, negative, is hollow).
    line
        Width of a thin line just inside the outline (0 = none), in `line_color`.
    inner_shadow
        Darkness below the upper rim of a recess.
    ink
        Colour of the label.
    label_share
        Height of the label.
    engraved
        Whether the label has a bright lower lip.
    light
        Colour when lit.
    lit_part
        What lights up: "face", "ring" or "symbol".
    font, stretch
        Typeface (see ``glyphs.words``) and width of the letters.
    height
        How far the face stands out of the panel, or (negative) lies in a hole in it.
    wall
        Brightness of what is seen of its sides, as a share of the face's (of the panel's, in a
        hole).
    hole
        Width of what is seen of the hole that it lies in, all around, when seen from the front.
    label_ring
        Width of a ring around it that words are printed on (0 = none), in `line_color`: it is
        no part of the button.
    lamp
        Height of a small lamp on buttons that are wider than high, beside the label (0 = none);
        it is in `collar_color`.
    lamp_right
        Whether it is at the right end.
    """

    gap: float = 0.0
    shadow: float = 0.0
    collar: float = 0.0
    collar_color: Color = (190, 190, 190)
    collar_opacity: float = 1.0
    collar_relief: float = 0.0
    face_color: Color = (255, 255, 255)
    face_opacity: float = 1.0
    face_relief: float = 0.0
    bevel: float = 0.08
    dome: float = 0.0
    line: float = 0.0
    line_color: Color = (255, 255, 255)
    inner_shadow: float = 0.0
    ink: Color = (0, 0, 0)
    label_share: float = 0.5
    engraved: bool = False
    light: Color = (255, 120, 30)
    lit_part: str = "face"
    font: int = 0
    stretch: float = 1.0
    height: float = 0.0
    wall: float = 0.6
    hole: float = 0.0
    label_ring: float = 0.0
    lamp: float = 0.0
    lamp_right: bool = True


#: White and flat: every edge is an outline.
PLAIN = ButtonStyle()


@dataclass(frozen=True)
class PlateStyle:
    """What the labels beside the buttons look like.

    Parameters
    ----------
    color
        Of the plate; None for bare characters on the panel.
    ink
        Colour of the characters.
    rounding
        Corner radius as a share of the shorter side.
    font, stretch
        Typeface and width of the letters.
    relief
        Light on the plate's edge.
    given
        Whether a plate keeps the corners of the form that it is given.
    """

    color: Color | None
    ink: Color
    rounding: float
    font: int
    stretch: float
    relief: float
    given: bool = False


def contrasting(rng: np.random.Generator, ground: Color) -> Color:
    """An ink that can be read on a ground, mostly black or white."""
    bright = sum(ground) / 3
    if chance(rng, 0.12):
        return pick(rng, HUES if bright > 110 else LIGHTS)
    if 90 < bright < 165 and chance(rng, 0.4):
        return tint(rng, (245, 245, 245))
    return tint(rng, (25, 25, 28), 15) if bright > 110 else tint(rng, (235, 235, 232), 20)


def _face(rng: np.random.Generator) -> Color:
    bank = pick(rng, (METALS, DARKS, WHITES, HUES), (5, 4, 3, 0.5))
    return tint(rng, pick(rng, bank), 12)


def button_style(rng: np.random.Generator, panel: Color) -> ButtonStyle:
    """Draw a family of buttons for a panel of that colour."""
    kinds = ("raised", "flush", "recessed", "collar", "halo", "outline", "glass", "frame", "dome")
    kind = pick(rng, kinds, (5, 3, 3, 5, 4, 1.3, 2, 2, 2))
    face = _face(rng)
    opacity = 1.0
    if chance(rng, 0.3):  # of the panel's own metal
        face, opacity = tint(rng, panel, 15, rng.uniform(0.85, 1.2)), rng.uniform(0.4, 1.0)
    strength = rng.uniform(0.15, 0.75)
    values: dict[str, object] = {
        "gap": rng.uniform(0, 0.05) if chance(rng, 0.7) else 0.0,
        "shadow": rng.uniform(0.1, 0.7) if chance(rng, 0.6) else 0.0,
        "bevel": log_uniform(rng, 0.03, 0.2),
        "dome": rng.uniform(-0.5, 0.6) if chance(rng, 0.3) else 0.0,
        "face_relief": strength,
    }
    if kind == "flush":
        values |= {"shadow": 0.0, "gap": rng.uniform(0.015, 0.05), "face_relief": 0.2 * strength}
    elif kind == "recessed":
        values |= {"shadow": 0.0, "inner_shadow": rng.uniform(0.3, 0.8), "face_relief": -strength}
    elif kind in ("collar", "frame"):
        wide = rng.uniform(0.14, 0.24) if kind == "frame" else rng.uniform(0.05, 0.16)
        values |= {
            "collar": wide,
            "collar_color": tint(rng, pick(rng, METALS if chance(rng, 0.7) else DARKS), 12),
            "collar_relief": rng.uniform(-0.8, 0.9),
        }
    elif kind == "halo":
        values |= {
            "collar": rng.uniform(0.05, 0.13),
            "collar_color": tint(rng, pick(rng, DARKS + WHITES), 15),
            "collar_opacity": rng.uniform(0.5, 1.0),
            "collar_relief": rng.uniform(-0.2, 0.2),
        }
    elif kind == "outline":
        ground = tint(rng, panel, 3, rng.uniform(0.9, 1.15))
        face, opacity = ground, rng.uniform(0.0, 0.6)
        line = contrasting(rng, panel)
        values |= {"shadow": 0.0, "gap": 0.0, "face_relief": 0.0, "dome": 0.0}
        values |= {"line": rng.uniform(0.03, 0.07), "line_color": line}
    elif kind == "glass":
        face, opacity = tint(rng, pick(rng, DARKS + WHITES), 15), rng.uniform(0.6, 0.95)
        values |= {"dome": rng.uniform(0.3, 0.8), "collar": rng.uniform(0.03, 0.1)}
        values |= {"collar_color": tint(rng, pick(rng, METALS), 10), "collar_relief": 0.5}
    elif kind == "dome":
        values |= {"dome": rng.uniform(0.5, 1.1)}
    seen = face if opacity > 0.5 else panel
    alike = opacity * max(abs(a - b) for a, b in zip(face, panel, strict=True)) < 40
    if alike and not (values["gap"] or values["shadow"] or "line" in values):
        values["gap"] = 0.03  # else nobody could see where the button ends
    return ButtonStyle(
        face_color=face,
        face_opacity=opacity,
        ink=contrasting(rng, seen),
        label_share=rng.uniform(0.3, 0.62),
        engraved=chance(rng, 0.3),
        light=pick(rng, LIGHTS),
        lit_part="ring" if kind in ("halo", "outline") else pick(rng, ("face", "ring", "symbol")),
        font=int(rng.integers(9)),
        stretch=rng.uniform(0.75, 1.2),
        **values,  # type: ignore[arg-type]
    )


def in_relief(rng: np.random.Generator, style: ButtonStyle, deepest: float = 0.2) -> ButtonStyle:
    """The same family standing out of the panel, or in holes, or flush."""
    kind = pick(rng, ("out", "in", "flush"), (6, 3 if deepest else 0, 1))
    if kind == "flush":
        return style
    if kind == "out":
        return replace(style, height=log_uniform(rng, 0.08, 0.6), wall=rng.uniform(0.2, 1.1))
    black = chance(rng, 0.7)
    return replace(
        style,
        height=-rng.uniform(0.02, deepest),
        wall=rng.uniform(0.05, 0.2) if black else rng.uniform(0.2, 0.6),
        hole=rng.uniform(0.02, 0.14),
    )


def plate_style(rng: np.random.Generator, panel: Color, *, twins: bool = False) -> PlateStyle:
    """Draw the look of the labels beside the buttons of a panel of that colour.

    Twins of the buttons are never bare characters, and keep the buttons' form.
    """
    color: Color | None = None
    if twins or chance(rng, 0.7):
        bank = pick(rng, (DARKS, WHITES, METALS, HUES), (5, 2, 1.5, 0.7))
        color = tint(rng, pick(rng, bank), 12)
    return PlateStyle(
        color=color,
        ink=contrasting(rng, color or panel),
        rounding=pick(rng, (0.0, 0.1, 0.2, 0.5), (4, 2, 2, 1.5)),
        font=int(rng.integers(9)),
        stretch=rng.uniform(0.75, 1.2),
        relief=rng.uniform(-0.5, 0.6) if chance(rng, 0.5) else 0.0,
        given=twins,
    )
