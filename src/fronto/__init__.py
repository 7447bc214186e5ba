"""A head-on view of any elevator button panel, from one photo."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from fronto._version import __version__
from fronto.errors import FrontoError, InputError

if TYPE_CHECKING:
    from fronto.camera import Camera
    from fronto.engine import Engine
    from fronto.find import find_label
    from fronto.outlines import Outlines, outline
    from fronto.pipeline import rectify_outlines
    from fronto.pose import Template, TemplateButton, estimate_pose
    from fronto.positions import with_positions
    from fronto.rectifier import Rectifier, rectify
    from fronto.rectifieroptions import RectifierOptions
    from fronto.results import Button, Panel, PanelPose, Plate, RectifiedView
    from fronto.segmentation import segment
    from fronto.segments import Segment, Segments
    from fronto.shapes import Ellipse, LineSegment, Outline, order_corners
    from fronto.templatewriter import write_template
    from fronto.warp import map_box, map_ellipse, map_points, warp_panel

__all__ = [
    "Button",
    "Camera",
    "Ellipse",
    "Engine",
    "FrontoError",
    "InputError",
    "LineSegment",
    "Outline",
    "Outlines",
    "Panel",
    "PanelPose",
    "Plate",
    "RectifiedView",
    "Rectifier",
    "RectifierOptions",
    "Segment",
    "Segments",
    "Template",
    "TemplateButton",
    "__version__",
    "estimate_pose",
    "find_label",
    "map_box",
    "map_ellipse",
    "map_points",
    "order_corners",
    "outline",
    "rectify",
    "rectify_outlines",
    "segment",
    "warp_panel",
    "with_positions",
    "write_template",
]

#: Where each public name lives: loaded on first use (PEP 562), so that ``fronto --help``
#: does not wait for NumPy.
_HOMES = {
    "fronto.camera": ("Camera",),
    "fronto.engine": ("Engine",),
    "fronto.find": ("find_label",),
    "fronto.outlines": ("Outlines", "outline"),
    "fronto.pipeline": ("rectify_outlines",),
    "fronto.pose": ("Template", "TemplateButton", "estimate_pose"),
    "fronto.positions": ("with_positions",),
    "fronto.rectifier": ("Rectifier", "rectify"),
    "fronto.rectifieroptions": ("RectifierOptions",),
    "fronto.results": ("Button", "Panel", "PanelPose", "Plate", "RectifiedView"),
    "fronto.segmentation": ("segment",),
    "fronto.segments": ("Segment", "Segments"),
    "fronto.shapes": ("Ellipse", "LineSegment", "Outline", "order_corners"),
    "fronto.templatewriter": ("write_template",),
    "fronto.warp": ("map_box", "map_ellipse", "map_points", "warp_panel"),
}


def __getattr__(name: str) -> Any:
    from importlib import import_module

    for home, names in _HOMES.items():
        if name in names:
            value = getattr(import_module(home), name)
            globals()[name] = value
            return value
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
