"""A head-on view of any elevator button panel, from one photo."""

from fronto._version import __version__
from fronto.camera import Camera
from fronto.errors import FrontoError, InputError
from fronto.pose import Template, TemplateButton, estimate_pose
from fronto.results import Button, Panel, PanelPose, RectifiedView
from fronto.shapes import Ellipse, LineSegment, Outline, order_corners
from fronto.warp import map_box, map_ellipse, map_points, warp_panel

__all__ = [
    "Button",
    "Camera",
    "Ellipse",
    "FrontoError",
    "InputError",
    "LineSegment",
    "Outline",
    "Panel",
    "PanelPose",
    "RectifiedView",
    "Template",
    "TemplateButton",
    "__version__",
    "estimate_pose",
    "map_box",
    "map_ellipse",
    "map_points",
    "order_corners",
    "warp_panel",
]
