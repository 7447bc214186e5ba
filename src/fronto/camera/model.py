"""The camera as one immutable value: intrinsics, lens distortion, image size, and its source."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal, get_args

import numpy as np
import numpy.typing as npt

from fronto.camera.checks import (
    check_aspect,
    check_center,
    check_distortion,
    checked_matrix,
    positive_int,
)
from fronto.camera.distortion import DistortionModel, distort, undistort
from fronto.camera.pixels import as_points, normalise, to_pixels
from fronto.errors import InputError
from fronto.shapes import Ellipse, FloatArray, frozen_array

if TYPE_CHECKING:
    from PIL import Image

__all__ = ["Camera", "CameraSource"]

CameraSource = Literal["given", "file", "exif", "estimated", "default"]

#: Focal length over the longer side of the photo where nothing is known, and the deviation
#: of ln f: two deviations reach from 0.52 to 1.4 times the longer side. Phones have 0.69 to 0.81
#: (24 to 28 mm in terms of 35 mm film, 4:3), older ones up to 0.95, webcams (60 to 78 degrees
#: across the diagonal) 0.7 to 1.0, depth cameras of robots 0.55 to 0.95; cuttings more.
DEFAULT_FOCAL_RATIO = 0.85
DEFAULT_FOCAL_STD = 0.25
ESTIMATED = "estimated from the panel"


@dataclass(frozen=True, eq=False)
class Camera:
    """Pinhole intrinsics with lens distortion, for images of one size.

    Camera frame: x right, y down, z forward. Pixels: centre of the top-left one = (0, 0).

    Parameters
    ----------
    matrix
        Shape (3, 3): K = [[F/s_x, skew, o_x], [0, F/s_y, o_y], [0, 0, 1]] in pixels (the
        paper's M_int, Section IV).
    width_px, height_px
        Size of the image that `matrix` belongs to.
    distortion
        Shape (k,): coefficients in OpenCV's order.
    distortion_model
        "none", "plumb_bob" (4 or 5 coefficients), "rational_polynomial" (8; 12 with thin
        prism; 14 with tilt) or "equidistant" (4, OpenCV's fisheye).
    source
        Where it came from: "given", "file", "exif", "estimated" or "default".
    focal_std
        Standard deviation of ln f: 0 where the focal length is known.
    detail
        Where it came from, in words.

    Raises
    ------
    InputError
        Naming the field that makes no camera.
    """

    matrix: FloatArray
    width_px: int
    height_px: int
    distortion: FloatArray = field(default_factory=lambda: np.zeros(0))
    distortion_model: DistortionModel = "none"
    source: CameraSource = "given"
    focal_std: float = 0.0
    detail: str = ""

    def __post_init__(self) -> None:
        for name in ("width_px", "height_px"):
            object.__setattr__(self, name, positive_int(getattr(self, name), name))
        object.__setattr__(self, "matrix", checked_matrix(self.matrix))
        object.__setattr__(self, "distortion", frozen_array(self.distortion, (-1,), "distortion"))
        check_center(self.matrix, self.width_px, self.height_px)
        check_distortion(self.distortion_model, len(self.distortion))
        if self.source not in get_args(CameraSource):
            raise InputError(
                "source",
                f"expected one of {', '.join(get_args(CameraSource))}, got {self.source!r}",
            )
        if not (np.isfinite(self.focal_std) and self.focal_std >= 0):
            raise InputError(
                "focal_std", f"expected a finite number, 0 or more, got {self.focal_std}"
            )

    @classmethod
    def from_matrix(
        cls,
        matrix: npt.ArrayLike,
        width_px: int,
        height_px: int,
        distortion: Sequence[float] | FloatArray = (),
        distortion_model: DistortionModel | None = None,
        source: CameraSource = "given",
    ) -> Camera:
        """Build it from a matrix (3, 3) and distortion coefficients (k,).

        Without a model the count decides: 4 or 5 plumb_bob, 8, 12 or 14
        rational_polynomial. Coefficients that are all zero mean "none", except for an
        equidistant lens, which bends rays even then.

        Raises
        ------
        InputError
            Naming the field that makes no camera.
        """
        coefficients = frozen_array(distortion, (-1,), "distortion")
        model = distortion_model
        if model in (None, "plumb_bob", "rational_polynomial") and not coefficients.any():
            model, coefficients = "none", np.zeros(0)
        elif model is None:
            model = "plumb_bob" if len(coefficients) <= 5 else "rational_polynomial"
        return cls(
            np.asarray(matrix, dtype=object), width_px, height_px, coefficients, model, source
        )

    @classmethod
    def from_pinhole(
        cls,
        focal_length_m: float,
        pixel_width_m: float,
        pixel_height_m: float,
        center_x_px: float,
        center_y_px: float,
        width_px: int,
        height_px: int,
    ) -> Camera:
        """Build it from the paper's F, s_x, s_y (metres), o_x, o_y (pixels), Section IV.

        Raises
        ------
        InputError
            If a length is not positive and finite, or the principal point is far outside.
        """
        lengths = {
            "focal_length_m": focal_length_m,
            "pixel_width_m": pixel_width_m,
            "pixel_height_m": pixel_height_m,
        }
        for name, value in lengths.items():
            if not (np.isfinite(value) and value > 0):
                raise InputError(name, f"expected a positive number of metres, got {value}")
        fx, fy = focal_length_m / pixel_width_m, focal_length_m / pixel_height_m
        matrix = [[fx, 0.0, center_x_px], [0.0, fy, center_y_px], [0.0, 0.0, 1.0]]
        return cls.from_matrix(matrix, width_px, height_px)

    @classmethod
    def from_fov(cls, horizontal_fov_deg: float, width_px: int, height_px: int) -> Camera:
        """Build a pinhole with square pixels from a horizontal field of view.

        f = (w/2) / tan(fov/2), principal point at the middle ((w-1)/2, (h-1)/2).

        Raises
        ------
        InputError
            If the field of view is not between 0 and 180 degrees.
        """
        if not 0 < horizontal_fov_deg < 180:
            raise InputError(
                "horizontal_fov_deg",
                f"expected an angle between 0 and 180 degrees, got {horizontal_fov_deg}",
                "a phone's main camera has about 65",
            )
        width = positive_int(width_px, "width_px")
        focal = 0.5 * width / np.tan(np.radians(horizontal_fov_deg) / 2)
        camera = cls._centered(float(focal), float(focal), width_px, height_px)
        return replace(camera, detail=f"horizontal field of view {horizontal_fov_deg:g} degrees")

    @classmethod
    def default(cls, width_px: int, height_px: int) -> Camera:
        """Guess for a photo of which nothing is known: f = 0.85 times the longer side."""
        longer = max(positive_int(width_px, "width_px"), positive_int(height_px, "height_px"))
        focal = DEFAULT_FOCAL_RATIO * longer
        return replace(
            cls._centered(focal, focal, width_px, height_px),
            source="default",
            focal_std=DEFAULT_FOCAL_STD,
            detail=f"assumed {DEFAULT_FOCAL_RATIO:g} times the longer side",
        )

    @classmethod
    def from_exif(cls, image: str | Path | Image.Image) -> Camera | None:
        """Read a photo's EXIF data; None where they state no usable focal length.

        Width and height are those of the photo as displayed upright (the EXIF
        orientation applied).

        Parameters
        ----------
        image
            The photo's file, or the opened Pillow image.

        Raises
        ------
        InputError
            If the file is no readable image.
        """
        from fronto.camera.exif import camera_from_exif

        return camera_from_exif(image)

    @classmethod
    def from_file(
        cls,
        path: str | Path,
        width_px: int | None = None,
        height_px: int | None = None,
        *,
        projection: bool = False,
        name: str | None = None,
    ) -> Camera:
        """Read a calibration file; its content tells its kind.

        ROS camera_info (YAML, or a message as printed), OpenCV FileStorage (YAML, XML,
        JSON), a Kalibr camchain, the JSON of :meth:`to_dict`, or a bare 3x3 matrix (text,
        JSON or .npy).

        Parameters
        ----------
        path
            The file, at most 10 MB.
        width_px, height_px
            The photo's size: needed where the file states none; otherwise the camera is
            scaled to it.
        projection
            Use the left 3x3 of ROS's projection matrix P and no distortion: for photos
            that are rectified already. K and D belong to raw ones.
        name
            Which camera of a Kalibr chain; default cam0.

        Raises
        ------
        InputError
            Naming the file and the field.
        """
        from fronto.camera.files import camera_from_file

        return camera_from_file(path, width_px, height_px, projection=projection, name=name)

    @classmethod
    def _centered(cls, fx: float, fy: float, width_px: int, height_px: int) -> Camera:
        cx = (positive_int(width_px, "width_px") - 1) / 2
        cy = (positive_int(height_px, "height_px") - 1) / 2
        return cls.from_matrix([[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]], width_px, height_px)

    @property
    def focal_px(self) -> float:
        """Focal length √(f_x f_y) in pixels."""
        return float(np.sqrt(self.matrix[0, 0] * self.matrix[1, 1]))

    @property
    def horizontal_fov_deg(self) -> float:
        """Angle between the rays of the image's left and right edge at o_y, degrees.

        NaN where the lens model does not reach the edges (a fisheye beyond 180 degrees).
        """
        row = self.matrix[1, 2]
        left, right = self.rays(np.array([[-0.5, row], [self.width_px - 0.5, row]]))
        across = np.linalg.norm(np.cross(left, right))
        return float(np.degrees(np.arctan2(across, left @ right)))

    @property
    def distorted(self) -> bool:
        """Whether the lens bends straight lines."""
        return self.distortion_model == "equidistant" or bool(self.distortion.any())

    def scaled_to(self, width_px: int, height_px: int) -> Camera:
        """Adapt it to its image resized to another size of the same aspect.

        Pixel centres are at integers, so o_x' = (o_x + 0.5) s - 0.5. The aspect may differ
        by 1 % or by one pixel of rounding.

        Raises
        ------
        InputError
            If the aspect differs: the image was cropped or rotated, not resized.
        """
        width, height = positive_int(width_px, "width_px"), positive_int(height_px, "height_px")
        if (width, height) == (self.width_px, self.height_px):
            return self
        check_aspect(self.width_px, self.height_px, width, height)
        sx, sy = width / self.width_px, height / self.height_px
        resize = np.array([[sx, 0, 0.5 * sx - 0.5], [0, sy, 0.5 * sy - 0.5], [0, 0, 1]])
        return replace(self, matrix=resize @ self.matrix, width_px=width, height_px=height)

    def with_focal(
        self, focal_px: float, focal_std: float, source: CameraSource = "estimated"
    ) -> Camera:
        """Copy it with another focal length (its `focal_px`), the pixels' shape kept.

        For the source "estimated", `detail` says so, and what the estimate started from.

        Raises
        ------
        InputError
            If the focal length is not positive or the deviation negative.
        """
        if not (np.isfinite(focal_px) and focal_px > 0):
            raise InputError(
                "focal_px",
                f"expected a positive number of pixels, got {focal_px}",
                "give the focal length that a calibration states, or a field of view",
            )
        matrix = np.array(self.matrix)
        matrix[:2, :2] *= focal_px / self.focal_px
        detail = self.detail
        if source == "estimated" and not detail.startswith(ESTIMATED):
            detail = f"{ESTIMATED}, start: {detail}" if detail else ESTIMATED
        return replace(self, matrix=matrix, focal_std=focal_std, source=source, detail=detail)

    def undistort_points(self, points_px: npt.ArrayLike) -> FloatArray:
        """Map the photo's pixels (n, 2) to those of a lens without distortion and the same K.

        NaN where the lens model has no answer: beyond its validity, or 90 degrees off axis.
        """
        points = as_points(points_px, 2)
        return to_pixels(self._undistort(points), self.matrix) if self.distorted else points

    def distort_points(self, points_px: npt.ArrayLike) -> FloatArray:
        """Invert `undistort_points`: undistorted pixels (n, 2) to the photo's."""
        points = as_points(points_px, 2)
        return self._pixels(normalise(points, self.matrix)) if self.distorted else points

    def rays(self, points_px: npt.ArrayLike) -> FloatArray:
        """Rays (n, 3) at depth 1, camera frame, of the photo's pixels (n, 2); NaN as above."""
        straight = self._undistort(as_points(points_px, 2))
        return np.column_stack([straight, np.ones(len(straight))])

    def project(self, points_3d: npt.ArrayLike) -> FloatArray:
        """Pixels in the photo (n, 2) of camera-frame points (n, 3) in any unit.

        NaN for points behind the camera and beyond the lens model's validity.
        """
        points = as_points(points_3d, 3)
        depth = np.where(points[:, 2] > 0, points[:, 2], np.nan)
        return self._pixels(points[:, :2] / depth[:, None])

    def undistort_ellipse(self, ellipse: Ellipse) -> Ellipse:
        """Fit the ellipse that a lens without distortion would show.

        Raises
        ------
        InputError
            If less than half of it lies within the lens model's validity.
        """
        from fronto.camera.conic import fit_ellipse

        if not self.distorted:
            return ellipse
        points = self.undistort_points(ellipse.points(64))
        points = points[np.isfinite(points).all(axis=1)]
        if len(points) < 32:
            raise InputError(
                "ellipse",
                "expected an outline within the lens model's validity, most of it lies outside",
                "check the distortion coefficients, or drop this outline",
            )
        return fit_ellipse(points)

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON; `from_file` reads them back."""
        return {
            "matrix": self.matrix.tolist(),
            "distortion": self.distortion.tolist(),
            "source": self.source,
            "distortion_model": self.distortion_model,
            "focal_std": float(self.focal_std),
            "width_px": self.width_px,
            "height_px": self.height_px,
            "detail": self.detail,
        }

    def _undistort(self, points: FloatArray) -> FloatArray:
        normalised = normalise(points, self.matrix)
        if not self.distorted:
            return normalised
        return undistort(normalised, self.distortion_model, self.distortion)

    def _pixels(self, normalised: FloatArray) -> FloatArray:
        if self.distorted:
            normalised = distort(normalised, self.distortion_model, self.distortion)
        return to_pixels(normalised, self.matrix)
