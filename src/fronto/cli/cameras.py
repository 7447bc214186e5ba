"""Where the cameras of photos come from on the command line."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from fronto.camera import Camera

__all__ = ["CameraSource"]


@dataclass(frozen=True)
class CameraSource:
    """Where the cameras of the photos come from; at most one of the three is given."""

    file: Path | None
    hfov_deg: float | None
    focal_px: float | None

    def camera(self, photo: Path, width: int, height: int) -> Camera:
        """The camera of one photo; EXIF data and a guess where nothing is given."""
        from fronto.camera import Camera

        if self.file is not None:
            return Camera.from_file(self.file, width, height)
        if self.hfov_deg is not None:
            return Camera.from_fov(self.hfov_deg, width, height)
        if self.focal_px is not None:
            wide = Camera.from_fov(90, width, height)
            return replace(wide.with_focal(self.focal_px, 0.0, "given"), detail="--focal-px")
        from fronto.rectifier import photo_camera

        return photo_camera(photo, width, height)
