"""What the stages hand on: immutable, typed, with units in the names.

Arrays are read-only copies, float64 but for pictures. See ``docs/result.md`` for the JSON form
(schema ``fronto.panel/1``).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np
import numpy.typing as npt

from fronto.shapes import Ellipse, FloatArray, Outline

if TYPE_CHECKING:
    from fronto.camera import Camera

__all__ = ["Button", "LabelSource", "Panel", "PanelPose", "Plate", "RectifiedView", "Status"]

Status = Literal["ok", "uncertain", "degenerate", "no_buttons"]
LabelSource = Literal["button", "plate", "template", "inferred"]
SCHEMA = "fronto.panel/1"


def _read_only(values: npt.ArrayLike) -> FloatArray:
    """Copy as read-only float64; NaN stands for what is not determined."""
    array = np.array(values, dtype=np.float64)
    array.setflags(write=False)
    return array


@dataclass(frozen=True, eq=False)
class PanelPose:
    """The rotation between camera and panel, how sure it is, and what it rests on.

    The panel frame has x along the panel's rows (right), y down its columns and z into
    the wall. ``rotation`` takes camera rays d to the panel frame (it *rectifies*):
    rotation @ d is proportional to (x, y, 1), a point of the plane at depth 1.

    Parameters
    ----------
    status
        "ok": trust it. "uncertain": a pose, but its deviation is large or a second one
        fits about as well. "degenerate": the outlines do not determine a rotation.
        "no_buttons": there was nothing to solve.
    reasons
        Why it is not ok, in words.
    solver
        "refine" or "grid".
    rotation
        Shape (3, 3), R = R_x R_y R_z (paper, Section IV).
    covariance
        Shape (3, 3), rad², of w in R·exp([w]x): small turns about the camera's axes.
        NaN where the solver gives none (grid) or the rotation is not determined.
    camera
        The camera used; its focal length is the estimated one where it was unknown.
    plane_corners
        Shape (n, 4, 2): corners of each button on the plane z = 1 of the panel frame
        (of a circle: its circumscribed square), in the order of the outlines.
    residual_px
        Shape (n,): root mean square reprojection error of each outline.
    weight
        Shape (n,): 1 = fits, towards 0 = the robust loss set the outline aside.
    sigma_px
        What the corners' standard deviation came out as, from the residuals; None
        for the grid.
    cos_norm
        ‖Cos‖₂ of the outlines after rectification (paper, Eq. 13); None without quads.
    final_cr
        The paper's Final CR (Eq. 17) at its optimum, grid only.
    focal_std
        Standard deviation of ln f: 0 where the focal length is taken as known.
    aspect_std
        Standard deviation of ln(width/height) of the rectified buttons; None for the grid.
    plane_depth_m
        Distance from the camera to the panel's plane, only with a template.
    notes
        Remarks that do not touch the status.
    cost
        Cost of the solution (refine only).
    alternatives
        Other poses that fit about as well, best first.
    stopped
        Why the optimiser stopped, and its iterations, in words.
    """

    status: Status
    reasons: tuple[str, ...]
    solver: str
    rotation: FloatArray
    covariance: FloatArray
    camera: Camera
    plane_corners: FloatArray
    residual_px: FloatArray
    weight: FloatArray
    sigma_px: float | None = None
    cos_norm: float | None = None
    final_cr: float | None = None
    focal_std: float = 0.0
    aspect_std: float | None = None
    plane_depth_m: float | None = None
    notes: tuple[str, ...] = ()
    cost: float | None = None
    alternatives: tuple[PanelPose, ...] = ()
    stopped: str = ""

    def __post_init__(self) -> None:
        for name in ("rotation", "covariance", "plane_corners", "residual_px", "weight"):
            object.__setattr__(self, name, _read_only(getattr(self, name)))

    @property
    def normal(self) -> FloatArray:
        """The panel's normal into the wall, in the camera frame, shape (3,)."""
        return np.array(self.rotation[2])

    @property
    def angles_deg(self) -> tuple[float, float, float]:
        """θ_x, θ_y, θ_z of R = R_x R_y R_z in the paper's signs (Eqs. 3-5), degrees."""
        from fronto.pose.rotation import angles_deg

        return angles_deg(self.rotation)

    @property
    def std_deg(self) -> tuple[float, float, float]:
        """Standard deviations of `angles_deg`, degrees; NaN where not determined."""
        from fronto.pose.rotation import angles_std_deg

        return angles_std_deg(self.rotation, self.covariance)

    def __bool__(self) -> bool:
        """True for "ok" only."""
        return self.status == "ok"


@dataclass(frozen=True, eq=False)
class RectifiedView:
    """A head-on picture and the exact way back to the photo.

    Parameters
    ----------
    image
        Shape (height, width, 4), uint8 (or the source's dtype): the source's channels
        and alpha, 0 where the photo has nothing to show. Grey photos become 3 equal
        channels and alpha.
    homography
        Shape (3, 3): photo pixel -> rectified pixel, homogeneous. With lens distortion
        it applies to undistorted pixels (see `homography_domain`).
    camera
        The camera that the photo was taken with.
    crop
        "panel", "full" or "input".
    scale
        Rectified pixels per photo pixel at the buttons' centroid (linear).
    """

    image: npt.NDArray[Any]
    homography: FloatArray
    camera: Camera
    crop: str
    scale: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "homography", _read_only(self.homography))
        if self.image.flags.writeable:  # warp_panel hands its picture over: no copy of megabytes
            image = self.image.copy()
            image.setflags(write=False)
            object.__setattr__(self, "image", image)

    @property
    def width_px(self) -> int:
        """Width of the rectified picture."""
        return int(self.image.shape[1])

    @property
    def height_px(self) -> int:
        """Height of the rectified picture."""
        return int(self.image.shape[0])

    @property
    def homography_domain(self) -> str:
        """Either "source", or "undistorted" for a camera with lens distortion."""
        return "undistorted" if self.camera.distorted else "source"


@dataclass(frozen=True, eq=False)
class Button:
    """One button of a result: where it is in the photo and in the rectified view.

    Parameters
    ----------
    id
        Its number, counted from 0 in the order of the outlines.
    outline
        Where it is in the photo, as it was given or found.
    rectified_corners_px
        Shape (4, 2): its corners in the rectified picture; None for an ellipse or
        without a picture. NaN for a corner on or behind the panel's horizon.
    rectified_center_px
        Shape (2,): its centre there: where the rectified diagonals cross, or the rectified
        ellipse's centre. None where its outline has no image there.
    residual_px
        Root mean square reprojection error of the outline; NaN from the grid solver.
    weight
        1 = fits the others, towards 0 = set aside.
    rectified_ellipse_px
        Its ellipse in the rectified picture; None for a quad, without a picture, or where
        the outline reaches the panel's horizon.
    label
        What it means: a floor in normal form ("12", "B1", "*1"), a function ("up", "open"),
        another text in capitals ("FAN"); "" where unknown, or not surely enough read.
    label_confidence
        Probability that the label is right, 0 to 1; without a label, of the best guess. None
        where nothing read it (a label came with the outlines then).
    label_source
        What says so: the "button" itself, the "plate" beside it, the "template" that was given,
        or only the labels of its neighbours ("inferred"). None without a label, and where
        nothing read it.
    label_guesses
        Labels it may have, likeliest first, with their probabilities; what they leave to 1 is
        for others and for none. Empty where nothing read it.
    position_m
        Shape (3,): its centre in the camera frame, metres; None where not determined.
    position_std_m
        Shape (3,): standard deviations of `position_m`, metres.
    press_normal
        Shape (3,): unit vector into the wall, camera frame: the direction to press in.
    lit
        How probable it is that the button is lit, 0 to 1, by comparison with the others of
        the panel (`fronto.labels.lit`); None where it was not looked at.
    """

    id: int
    outline: Outline
    rectified_corners_px: FloatArray | None
    rectified_center_px: FloatArray | None
    residual_px: float
    weight: float
    rectified_ellipse_px: Ellipse | None = None
    label: str = ""
    label_confidence: float | None = None
    label_source: LabelSource | None = None
    label_guesses: tuple[tuple[str, float], ...] = ()
    position_m: FloatArray | None = None
    position_std_m: FloatArray | None = None
    press_normal: FloatArray | None = None
    lit: float | None = None

    def __post_init__(self) -> None:
        for name in ("position_m", "position_std_m", "press_normal"):
            value = getattr(self, name)
            if value is not None:
                object.__setattr__(self, name, _read_only(value))


@dataclass(frozen=True, eq=False)
class Plate:
    """A label beside a button, which nobody presses.

    Parameters
    ----------
    outline
        Where it is in the photo.
    label
        What it says, as of :class:`Button`; "" where unknown.
    label_confidence
        Probability that this is what it says, 0 to 1; None where nothing read it.
    button
        Id of the button that it names; None where that is not sure.
    """

    outline: Outline
    label: str = ""
    label_confidence: float | None = None
    button: int | None = None


@dataclass(frozen=True, eq=False)
class Panel:
    """Everything found out about one photo: the content of the result JSON.

    Parameters
    ----------
    image
        The photo's file name, "" for an array.
    width_px, height_px
        The photo's size, upright.
    status, reasons
        As of the pose.
    pose
        The pose, of any status.
    buttons
        One for each outline, in their order.
    view
        The rectified picture; None where there is no rotation to rectify with.
    timing_ms
        Wall time of each stage and in total, milliseconds.
    notes
        Remarks on the input that do not touch the status.
    plates
        The labels beside buttons, which nobody presses.
    """

    image: str
    width_px: int
    height_px: int
    status: Status
    reasons: tuple[str, ...]
    pose: PanelPose
    buttons: tuple[Button, ...]
    view: RectifiedView | None = None
    timing_ms: dict[str, float] = field(default_factory=dict)
    notes: tuple[str, ...] = ()
    plates: tuple[Plate, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """Plain values for JSON (schema ``fronto.panel/1``), strictly valid: null for NaN."""
        from fronto.panelfile import panel_to_dict

        return panel_to_dict(self)
