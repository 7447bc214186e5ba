"""Rotation -> head-on picture: homography, canvas, resampling, and the exact way back."""

from fronto.warp.mapping import map_box, map_ellipse, map_points
from fronto.warp.panel import Crop, Resampling, warp_panel

__all__ = ["Crop", "Resampling", "map_box", "map_ellipse", "map_points", "warp_panel"]
