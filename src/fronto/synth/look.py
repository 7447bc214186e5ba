"""What a simulated panel is made of: colours, relief, fixtures."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["FLAT", "STEEL", "Look"]

Color = tuple[float, float, float]


@dataclass(frozen=True)
class Look:
    """Materials of a panel and the wall around it; colours are RGB, 0 to 255.

    Parameters
    ----------
    wall, plate, button, ink
        Colours of the wall, the plate, the buttons' faces and what is printed on them.
    lit
        Colour of the display and of a button that somebody has pressed.
    brushed
        Contrast of the brushed metal, of the plate and the buttons (0 = none).
    grain
        Contrast of the wall's plaster.
    relief
        Contrast of bevels.
    shadow
        Opacity of the shadows that the plate and the buttons cast.
    light
        How much darker it is far from the lamp.
    gap_m
        Width of the dark gap around each button, outside of its outline.
    rounding_m
        Radius of the corners of quad buttons.
    fixtures
        Whether there are screws, a display and a door frame.
    labels
        Whether the buttons are labelled.
    pressed
        Whether one button is lit.
    """

    wall: Color = (216, 209, 197)
    plate: Color = (176, 179, 184)
    button: Color = (212, 214, 217)
    ink: Color = (38, 40, 46)
    lit: Color = (255, 122, 30)
    brushed: float = 0.025
    grain: float = 0.012
    relief: float = 0.30
    shadow: float = 0.45
    light: float = 0.35
    gap_m: float = 0.0008
    rounding_m: float = 0.001
    fixtures: bool = True
    labels: bool = True
    pressed: bool = True


#: Brushed steel on a plastered wall.
STEEL = Look()
#: White buttons on black and nothing else: every edge is a button's outline.
FLAT = Look(
    wall=(0, 0, 0),
    plate=(0, 0, 0),
    button=(255, 255, 255),
    brushed=0,
    grain=0,
    relief=0,
    shadow=0,
    light=0,
    gap_m=0,
    rounding_m=0,
    fixtures=False,
    labels=False,
    pressed=False,
)
