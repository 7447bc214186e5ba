"""The focal length that a photo's EXIF data state, in pixels of the upright photo."""

from __future__ import annotations

import math
import warnings
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from fronto.camera.checks import same_aspect
from fronto.camera.model import Camera
from fronto.imageio import open_image

if TYPE_CHECKING:
    from PIL import Image

__all__ = ["camera_from_exif"]

ORIENTATION = 0x0112
EXIF_IFD = 0x8769
FOCAL_LENGTH = 0x920A
PIXEL_X_DIMENSION, PIXEL_Y_DIMENSION = 0xA002, 0xA003
FOCAL_PLANE_X_RESOLUTION, FOCAL_PLANE_Y_RESOLUTION = 0xA20E, 0xA20F
FOCAL_PLANE_RESOLUTION_UNIT = 0xA210
FOCAL_LENGTH_IN_35MM_FILM = 0xA405

#: A chunk's type, or the keyword of a text that holds the data.
PNG_MARKERS = (b"eXIf", b"Raw profile type exif")

#: Diagonal of the 24 x 36 mm frame: CIPA DCG-001 defines the equivalent by the diagonal.
DIAGONAL_35MM = math.hypot(24.0, 36.0)
#: Standard deviations of ln f. The equivalent is a whole number of mm and crop modes (video,
#: zoom, stabilisation) differ; the focal length itself is the nominal one, for infinity.
STD_35MM = 0.05
STD_FOCAL_PLANE = 0.03
#: Millimetres per FocalPlaneResolutionUnit: inch, cm, mm, µm.
UNIT_MM = {2: 25.4, 3: 10.0, 4: 1.0, 5: 0.001}
#: Outside these multiples of the longer side a focal length is an error of the writer.
PLAUSIBLE = (0.2, 20.0)


def camera_from_exif(image: str | Path | Image.Image) -> Camera | None:
    """Build a camera from FocalLengthIn35mmFilm, else FocalLength and FocalPlaneResolution.

    Size and focal lengths are those of the photo as displayed upright (orientation
    applied). The principal point is taken as the middle. None if the data state no usable
    focal length, are broken, or describe a photo that was cropped since.

    Parameters
    ----------
    image
        The photo's file, or the opened Pillow image.

    Raises
    ------
    InputError
        If the file is no readable image.
    """
    from PIL import Image

    if isinstance(image, Image.Image):
        return _camera(image)
    with open_image(image) as opened:
        if opened.format == "PNG" and not _mentions_exif(Path(image)):
            return None
        return _camera(opened)


def _mentions_exif(path: Path) -> bool:
    """Whether a PNG has EXIF data anywhere; Pillow would decode all pixels to find out."""
    content = path.read_bytes()
    return any(marker in content for marker in PNG_MARKERS)


def _camera(image: Image.Image) -> Camera | None:
    width, height = image.size
    tags = _tags(image)
    turned = tags.get(ORIENTATION) in (5, 6, 7, 8)
    resize = _resize(tags, width, height)
    if resize is None:
        return None
    for found in (_from_35mm(tags, width, height), _from_focal_plane(tags, resize)):
        if found is None:
            continue
        fx, fy, std, detail = found
        low, high = (factor * max(width, height) for factor in PLAUSIBLE)
        if not (low <= min(fx, fy) and max(fx, fy) <= high):
            continue
        if turned:
            width, height, fx, fy = height, width, fy, fx
        matrix = [[fx, 0.0, (width - 1) / 2], [0.0, fy, (height - 1) / 2], [0.0, 0.0, 1.0]]
        camera = Camera.from_matrix(matrix, width, height, source="exif")
        return replace(camera, focal_std=std, detail=f"EXIF, {detail}")
    return None


def _from_35mm(
    tags: Mapping[int, Any], width: int, height: int
) -> tuple[float, float, float, str] | None:
    equivalent = _positive(tags.get(FOCAL_LENGTH_IN_35MM_FILM))
    if equivalent is None:
        return None
    focal = equivalent / DIAGONAL_35MM * math.hypot(width, height)
    return focal, focal, STD_35MM, f"35 mm-equivalent {equivalent:g} mm"


def _from_focal_plane(
    tags: Mapping[int, Any], resize: tuple[float, float, bool]
) -> tuple[float, float, float, str] | None:
    """Take the paper's F/s_x and F/s_y, with 1/s the focal plane's resolution."""
    length = _positive(tags.get(FOCAL_LENGTH))
    across = _positive(tags.get(FOCAL_PLANE_X_RESOLUTION))
    down = _positive(tags.get(FOCAL_PLANE_Y_RESOLUTION)) or across
    unit = UNIT_MM.get(int(_positive(tags.get(FOCAL_PLANE_RESOLUTION_UNIT)) or 2))
    if length is None or across is None or down is None or unit is None:
        return None
    sx, sy, swapped = resize
    if swapped:
        across, down = down, across
    fx, fy = length * across / unit * sx, length * down / unit * sy
    return fx, fy, STD_FOCAL_PLANE, f"focal length {length:g} mm"


def _resize(tags: Mapping[int, Any], width: int, height: int) -> tuple[float, float, bool] | None:
    """How much smaller the photo is than when its EXIF data were written, along x and y.

    True where its pixels were turned since, so that the tags' x is its y. None where the
    aspect changed: a crop, after which no tag is to be trusted.
    """
    across, down = _positive(tags.get(PIXEL_X_DIMENSION)), _positive(tags.get(PIXEL_Y_DIMENSION))
    if across is None or down is None:
        return 1.0, 1.0, False
    if same_aspect(across, down, width, height):
        return width / across, height / down, False
    if same_aspect(down, across, width, height):
        return width / down, height / across, True
    return None


def _tags(image: Image.Image) -> dict[int, Any]:
    """Orientation and the Exif IFD's tags; empty if they are broken."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            exif = image.getexif()
            return {**exif.get_ifd(EXIF_IFD), ORIENTATION: exif.get(ORIENTATION)}
    except Exception:  # Pillow's parsers raise whatever the bytes provoke
        return {}


def _positive(value: object) -> float | None:
    try:
        number = float(value)  # type: ignore[arg-type]
    except (TypeError, ValueError, ZeroDivisionError, OverflowError):
        return None
    return number if math.isfinite(number) and number > 0 else None
