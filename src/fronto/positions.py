"""Where buttons are in the camera frame, in metres, and the direction to press in.

A button's centre is at X = D d / (n·d): d is the ray to it, n the panel's normal, and D the
distance of the panel's plane, which a known length tells (`fronto.metric`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from fronto.errors import InputError
from fronto.metric import KnownLength, Measured, Seen, UnfitLength, measure
from fronto.metric.centers import camera_centers
from fronto.results import Panel, PanelPose
from fronto.shapes import DEFAULT_STD_PX, FloatArray, Outline
from fronto.sizes import smallest_button_m

__all__ = ["Position", "Positions", "locate", "with_positions"]

#: An outline of less weight in the pose is set aside: what it says is as wrong as it misses.
SET_ASIDE = 0.5
#: Buttons that come out smaller or larger than this are none: the length is another one's.
LEAST_SIDE_M, MOST_SIDE_M = 0.006, 0.25
#: A distance whose relative standard deviation is above this is not told.
VAGUE = 0.1


@dataclass(frozen=True, eq=False)
class Position:
    """Where one button is.

    Parameters
    ----------
    button
        Its id: the index of its outline.
    center_m
        Shape (3,): its centre on the panel's plane, camera frame (x right, y down, z
        forward), metres.
    covariance
        Shape (3, 3), m²: of `center_m`; NaN where the pose has none.
    """

    button: int
    center_m: FloatArray
    covariance: FloatArray

    def __post_init__(self) -> None:
        _freeze(self, "center_m", "covariance")

    @property
    def std_m(self) -> FloatArray:
        """Standard deviations of `center_m`, (3,)."""
        return np.sqrt(np.diag(self.covariance))


@dataclass(frozen=True, eq=False)
class Positions:
    """Where the buttons of a panel are; true where they are known.

    Parameters
    ----------
    positions
        In the order of the buttons; without those beyond the panel's horizon.
    press_normal
        Shape (3,): unit vector into the wall, camera frame: the direction to press in.
        None without a rotation.
    normal_covariance
        Shape (3, 3): of `press_normal`, NaN where the pose has none; None without a rotation.
    plane_distance_m, plane_distance_std_m
        From the camera to the panel's plane, at right angles to it, and its standard
        deviation.
    basis
        What lengths rest on, in words.
    reasons
        Why there are none, in words.
    notes
        Remarks.
    """

    positions: tuple[Position, ...] = ()
    press_normal: FloatArray | None = None
    normal_covariance: FloatArray | None = None
    plane_distance_m: float | None = None
    plane_distance_std_m: float | None = None
    basis: str = ""
    reasons: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        _freeze(self, "press_normal", "normal_covariance")

    def __bool__(self) -> bool:
        """Whether there are any."""
        return bool(self.positions)

    def of(self, button: int) -> Position | None:
        """The position of the button with this id, if it is known."""
        return next((p for p in self.positions if p.button == button), None)

    @property
    def press_normal_std(self) -> FloatArray | None:
        """Standard deviations of `press_normal`, (3,)."""
        covariance = self.normal_covariance
        return None if covariance is None else np.sqrt(np.diag(covariance))


def _freeze(item: Any, *names: str) -> None:
    for name in names:
        if (value := getattr(item, name)) is not None:
            array = np.array(value, dtype=np.float64)
            array.setflags(write=False)
            object.__setattr__(item, name, array)


def locate(
    found: Panel | PanelPose,
    known: KnownLength | None = None,
    *,
    outlines: Sequence[Outline] | None = None,
    allow_uncertain: bool = False,
    **fields: Any,
) -> Positions:
    """Tell where the buttons are in the camera frame, from one length that is known.

    Standard deviations combine those of the rotation, the focal length, the buttons'
    centres and the length. Rotation and centres are taken for independent; in simulation
    the ellipsoids of 95 % hold 95 to 98 % of the true centres of calibrated car panels
    (``benchmarks/positions.py``).

    Parameters
    ----------
    found
        A result, or a pose.
    known
        The length; or give its `fields`. Neither is needed where the pose was solved with a
        template.
    outlines
        With a pose: those that it was solved from. They tell circles from quads, and by
        their `text` which button of a template is which.
    allow_uncertain
        Give positions of an "uncertain" pose as well, and such that are known to 10 % only or
        worse. The pose may have the panel tilted the wrong way: its deviations do not speak
        for that.
    fields
        Of :class:`fronto.metric.KnownLength`: button_size_m, pitch_m, template, depth or
        distance_m; and its std_m.

    Returns
    -------
    The positions; none, and why, where the pose is not ok, or the distance known to 10 % only.

    Raises
    ------
    InputError
        If the length is wrong in itself, or (`fronto.metric.UnfitLength`) does not apply to
        this panel.

    Examples
    --------
    >>> import fronto
    >>> from fronto.positions import locate
    >>> camera = fronto.Camera.from_fov(90, 640, 480)
    >>> square = [(0, 0), (40, 0), (40, 40), (0, 40)]
    >>> places = [(x, y) for y in (100, 160, 220, 280) for x in (260, 330)]
    >>> quads = [fronto.Outline.quad([(x + a, y + b) for a, b in square]) for x, y in places]
    >>> pose = fronto.estimate_pose(quads, camera, square=True)
    >>> located = locate(pose, outlines=quads, pitch_m=(0.07, 0.06))
    >>> round(located.plane_distance_m, 2)
    0.32
    """
    labels: tuple[str, ...] = ()
    if isinstance(found, Panel):
        pose = found.pose
        labels = tuple(button.label for button in found.buttons)
        outlines = [button.outline for button in found.buttons]
    else:
        pose = found
    length = _length(known, fields)
    if not length and pose.plane_depth_m is None:
        raise InputError(
            "positions",
            "expected a length that is known, got none",
            "give button_size_m, pitch_m, template, depth or distance_m",
        )
    reasons = _distrusted(pose, allow_uncertain)
    if reasons:
        return Positions(reasons=reasons)
    seen = _seen(pose, outlines)
    located = _located(seen, measure(length, seen, labels or ("",) * len(seen.rays)))
    vague = (located.plane_distance_std_m or 0.0) / (located.plane_distance_m or 1.0)
    if vague > VAGUE and not allow_uncertain:
        reason = f"the panel's distance is known to ±{100 * vague:.0f} % only"
        if pose.focal_std > VAGUE:
            reason += ", as the focal length is not known: give the camera"
        return replace(_directions(pose), reasons=(reason,))
    return located


def with_positions(
    panel: Panel,
    known: KnownLength | None = None,
    *,
    allow_uncertain: bool = False,
    **fields: Any,
) -> Panel:
    """Fill in `position_m`, `position_std_m` and `press_normal` of a result's buttons.

    Without any length only `press_normal`, which needs none. What cannot be told, because the
    pose is not ok or the length does not apply to this panel, is None, and `notes` says why.

    Parameters
    ----------
    panel
        The result.
    known, allow_uncertain, fields
        As of `locate`.

    Raises
    ------
    InputError
        If the length is wrong in itself.
    """
    located, notes = Positions(), []
    if not _distrusted(panel.pose, allow_uncertain):
        located = _directions(panel.pose)
    length = _length(known, fields)
    if length or panel.pose.plane_depth_m is not None:
        try:
            positions = locate(panel, length, allow_uncertain=allow_uncertain)
        except UnfitLength as error:
            positions = Positions(reasons=(str(error),))
        if positions:
            located = positions
            away = f"{located.plane_distance_m:.3f} ± {located.plane_distance_std_m:.3f} m away"
            notes = [f"positions from {located.basis}: the panel's plane is {away}"]
            notes += located.notes
        else:
            notes = [f"no positions: {'; '.join(positions.reasons)}"]
    by_id = {position.button: position for position in located.positions}
    buttons = []
    for button in panel.buttons:
        position = by_id.get(button.id)
        buttons.append(
            replace(
                button,
                position_m=None if position is None else position.center_m,
                position_std_m=None if position is None else position.std_m,
                press_normal=located.press_normal,
            )
        )
    return replace(panel, buttons=tuple(buttons), notes=(*panel.notes, *notes))


def _length(known: KnownLength | None, fields: dict[str, Any]) -> KnownLength:
    if known is not None and fields:
        raise InputError("known length", "expected one, got an object and fields", "give either")
    return KnownLength(**fields) if known is None else known


def _distrusted(pose: PanelPose, allow_uncertain: bool) -> tuple[str, ...]:
    if pose.status == "ok" or (allow_uncertain and pose.status == "uncertain"):
        return ()
    return (f"the pose is not ok but {pose.status.replace('_', ' ')}", *pose.reasons)


def _directions(pose: PanelPose) -> Positions:
    """What needs no length."""
    x, y, z = normal = pose.normal
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    # R·exp([w]×) has the normal n + n × w.
    return Positions(press_normal=normal, normal_covariance=cross @ pose.covariance @ cross.T)


def _seen(pose: PanelPose, outlines: Sequence[Outline] | None) -> Seen:
    corners = pose.plane_corners
    if outlines is not None and len(outlines) != len(corners):
        raise InputError(
            "outlines",
            f"expected those of the pose, {len(corners)}, got {len(outlines)}",
            "give the ones that it was solved from",
        )
    centers = np.concatenate([corners.mean(axis=1), np.ones((len(corners), 1))], axis=1)
    rays = centers @ pose.rotation
    ahead = np.isfinite(rays).all(axis=1) & (rays[:, 2] > 0)
    rays = np.where(ahead[:, None], rays, [0.0, 0.0, np.nan])
    rays = rays / rays[:, 2:]
    std = np.full(len(corners), DEFAULT_STD_PX if pose.sigma_px is None else pose.sigma_px)
    if outlines:
        stated = np.array([outline.std_px for outline in outlines])
        # As the outlines fit together: by as much as the typical one's deviation.
        std = stated * (std / float(np.median(stated)))
        # A quad's centre is the mean of four corners; an ellipse's deviation is its centre's.
        std = std * [0.5 if outline.shape == "quad" else 1.0 for outline in outlines]
    aside = pose.weight < SET_ASIDE
    std = np.where(aside, np.fmax(std, pose.residual_px), std)
    return Seen(
        pose=pose,
        outlines=None if outlines is None else tuple(outlines),
        rays=rays,
        ray_std=std / pose.camera.focal_px,
        usable=ahead & ~aside,
    )


def _located(seen: Seen, measured: Measured) -> Positions:
    pose = seen.pose
    ahead = np.flatnonzero(np.isfinite(seen.rays).all(axis=1))
    gradient = measured.gradient(pose.rotation)
    distance = float(np.exp(measured.log_distance(pose.rotation, 0.0)))
    side = distance * float(np.median(np.sqrt(seen.sizes.prod(axis=1))[ahead]))
    if not LEAST_SIDE_M < side < MOST_SIDE_M:
        raise UnfitLength(
            "known length",
            f"expected one that makes buttons of a size to be pressed, got {1e3 * side:.2g} mm "
            f"from {measured.basis}",
            "check its unit, and that it is of this panel",
        )
    notes = list(measured.notes)
    if side < (least := smallest_button_m()):
        notes.append(
            f"buttons come out {1e3 * side:.0f} mm large, smaller than any standard allows "
            f"({1e3 * least:.0f} mm): check the known length"
        )
    centers, covariances = camera_centers(seen, measured, ahead)
    variance = float(gradient @ seen.covariance @ gradient) + measured.variance
    variance += float((seen.ray_std[ahead, None] ** 2 * measured.ray_gradient[ahead] ** 2).sum())
    return replace(
        _directions(pose),
        positions=tuple(
            Position(int(k), center, covariance)
            for k, center, covariance in zip(ahead, centers, covariances, strict=True)
        ),
        plane_distance_m=distance,
        plane_distance_std_m=distance * float(np.sqrt(variance)),
        basis=measured.basis,
        notes=tuple(notes),
    )
