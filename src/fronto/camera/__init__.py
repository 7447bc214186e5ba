"""The camera: pinhole intrinsics, lens distortion, and the files that they come from."""

from fronto.camera.model import Camera

__all__ = ["Camera"]
