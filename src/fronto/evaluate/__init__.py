"""How good a result is: the metrics behind the tables of the documentation."""

from fronto.evaluate.rectification import (
    aspect_errors,
    axis_angles_deg,
    edge_angles_deg,
    rotation_error_deg,
)

__all__ = ["aspect_errors", "axis_angles_deg", "edge_angles_deg", "rotation_error_deg"]
