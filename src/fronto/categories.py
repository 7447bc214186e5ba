"""What a segment can be: the classes of the segmentation network."""

from __future__ import annotations

__all__ = ["BUTTONS", "CATEGORIES", "PLATE"]

#: Index = class number. The paper's classes are up, down, keyhole and non-button.
CATEGORIES = (
    "background",
    "up",
    "down",
    "keyhole",
    "number",
    "open",
    "close",
    "alarm",
    "stop",
    "other",
    "plate",
)
#: A label beside a button: it is found so that nobody presses it.
PLATE = "plate"
#: What can be pressed (or turned with a key).
BUTTONS = CATEGORIES[1:-1]
