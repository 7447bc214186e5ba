"""Photos of elevator panels, drawn fast and with wide variety, to train segmentation on.

The geometry is exact; looks are sampled far more widely than in `fronto.synth.render`.
"""

from fronto.synth.photo.render import PanelPhoto, render_photo
from fronto.synth.photo.truth import PhotoObject

__all__ = ["PanelPhoto", "PhotoObject", "render_photo"]
