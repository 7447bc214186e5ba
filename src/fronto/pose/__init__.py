"""From outlines to the camera's rotation against the panel."""

from fronto.pose.circle import circle_normals
from fronto.pose.estimate import estimate_pose
from fronto.pose.template import Template, TemplateButton

__all__ = ["Template", "TemplateButton", "circle_normals", "estimate_pose"]
