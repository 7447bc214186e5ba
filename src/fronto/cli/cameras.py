"""Where the cameras of photos come from on the command line."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

import click

from fronto.cli.shared import FILE, POSITIVE, FiniteRange

if TYPE_CHECKING:
    from fronto.camera import Camera

__all__ = ["CameraSource", "camera_options", "camera_source"]

Command = TypeVar("Command", bound=Callable[..., Any])


def camera_options(command: Command) -> Command:
    """Options that tell the camera; `camera_source` takes what they give."""
    for option in (
        click.option(
            "--focal-px", type=POSITIVE, metavar="F", help="Its focal length instead, in pixels."
        ),
        click.option(
            "--hfov",
            type=FiniteRange(0, 180, min_open=True, max_open=True),
            metavar="DEG",
            help="The camera's horizontal field of view instead.",
        ),
        click.option(
            "--camera",
            "camera_file",
            type=FILE,
            metavar="FILE",
            help="Calibration: ROS camera_info, OpenCV, Kalibr, or a 3x3 matrix.  [default: the "
            "photo's EXIF data, else a guess]",
        ),
    ):
        command = option(command)
    return command


def camera_source(
    camera_file: Path | None, hfov: float | None, focal_px: float | None
) -> CameraSource:
    """What `camera_options` say.

    Raises
    ------
    click.UsageError
        If several of them are given.
    """
    if sum(choice is not None for choice in (camera_file, hfov, focal_px)) > 1:
        raise click.UsageError("give one of --camera, --hfov and --focal-px")
    return CameraSource(camera_file, hfov, focal_px)


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
