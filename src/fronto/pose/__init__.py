"""From outlines to the camera's rotation against the panel."""

from fronto.pose.estimate import estimate_pose
from fronto.pose.template import Template, TemplateButton

__all__ = ["Template", "TemplateButton", "estimate_pose"]
