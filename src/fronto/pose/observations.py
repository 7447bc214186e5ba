"""From outlines in the photo to whitened observations in normalised coordinates."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from fronto.camera import Camera
from fronto.errors import InputError
from fronto.pose.bundle import ELLIPSE, QUAD, TANGENTS, Observations
from fronto.pose.checks import boxes_px
from fronto.shapes import Axis, FloatArray, LineSegment, Outline

__all__ = ["TOLERANCE", "observations", "undistorted"]

#: How far corners of real buttons are from where equal ones on a grid would have them, in
#: button sizes: a tenth of a millimetre on 30 mm. Large in the photo, it is what counts.
TOLERANCE = 0.004

#: How far a corner that is not seen may be from where the outline has it, in button sizes.
UNSEEN = 0.5
#: Share of the variance of forms that the buttons of a photo have in common: a blur draws all of
#: them out to the same side, and leaves them where they are.
FORMS_ALIKE = 0.3
#: Sides of a quad: from which corner to which, and what they are on the wall.
_SIDES: tuple[tuple[int, int, Axis], ...] = (
    (0, 1, "horizontal"),
    (1, 2, "vertical"),
    (3, 2, "horizontal"),
    (0, 3, "vertical"),
)

_ANOMALY = 2 * np.pi * np.arange(TANGENTS) / TANGENTS
_CIRCLE = np.stack([np.cos(_ANOMALY), np.sin(_ANOMALY)], axis=1)


def undistorted(outlines: Sequence[Outline], camera: Camera) -> tuple[Outline, ...]:
    """The outlines as a camera without lens distortion would have seen them.

    Raises
    ------
    InputError
        If an outline lies where the camera's lens model does not hold.
    """
    if not camera.distorted:
        return tuple(outlines)
    result = []
    for k, outline in enumerate(outlines):
        try:
            if outline.ellipse_px is not None:
                ellipse = camera.undistort_ellipse(outline.ellipse_px)
                result.append(replace(outline, ellipse_px=ellipse))
            else:
                assert outline.corners_px is not None
                corners = camera.undistort_points(outline.corners_px)
                result.append(replace(outline, corners_px=corners))
        except InputError:
            x, y = outline.center_px
            raise InputError(
                f"outlines {k}",
                f"expected a button where the lens model {camera.distortion_model} holds, got one "
                f"at ({x:.0f}, {y:.0f})",
                "check the camera's distortion coefficients, or leave this button out",
            ) from None
    return tuple(result)


def observations(
    outlines: Sequence[Outline],
    camera: Camera,
    lines: Sequence[LineSegment] = (),
    tolerance: float = TOLERANCE,
) -> Observations:
    """Normalise and whiten what was seen.

    Parameters
    ----------
    outlines
        Free of lens distortion (see `undistorted`).
    lines
        Axis-parallel segments in the photo; their lens distortion is removed here.
    tolerance
        Deviation of real corners from ideal ones, in button sizes.

    Raises
    ------
    InputError
        If a line lies where the camera's lens model does not hold.
    """
    n = len(outlines)
    inverse = np.linalg.inv(camera.matrix)
    affine, shift = inverse[:2, :2], inverse[:2, 2]
    focal = camera.focal_px
    kind = np.array([QUAD if o.shape == "quad" else ELLIPSE for o in outlines], dtype=np.intc)
    observed = np.zeros((n, 3 * TANGENTS))
    boxes = boxes_px(outlines)
    size = np.sqrt((boxes[:, 2:] - boxes[:, :2]).prod(axis=1))
    std = np.hypot([o.std_px for o in outlines], tolerance * size)
    inverse_sd, gain = np.zeros((n, TANGENTS)), np.ones(n)
    alike = math.sqrt(1 + FORMS_ALIKE * (n - 1))

    quads = np.flatnonzero(kind == QUAD)
    if len(quads):
        corners = np.array([outlines[int(i)].corners_px for i in quads])
        observed[quads, :8] = (corners @ affine.T + shift).reshape(-1, 8)
        # A corner is where two sides meet: both must be seen.
        seen = np.array([outlines[int(i)].seen for i in quads])
        whole = seen & np.roll(seen, 1, axis=1)
        sd = np.where(whole, std[quads, None], np.hypot(std, UNSEEN * size)[quads, None])
        inverse_sd[quads, :4] = focal / sd
        for i in quads[whole.all(axis=1)].tolist():
            gain[i] = _gain(outlines[i], std[i], tolerance * size[i], alike)

    ellipses = np.flatnonzero(kind == ELLIPSE)
    if len(ellipses):
        seen_as = [outlines[i].ellipse_px for i in ellipses.tolist()]
        numbers = [(e.cx, e.cy, e.a, e.b, e.angle_deg) for e in seen_as if e is not None]
        cx, cy, a, b, angle = np.array(numbers).T
        cos, sin = np.cos(np.radians(angle)), np.sin(np.radians(angle))
        axes = np.stack([np.stack([a * cos, -b * sin]), np.stack([a * sin, b * cos])])
        half = affine @ axes.transpose(2, 0, 1)
        centers = np.stack([cx, cy], axis=1) @ affine.T + shift
        observed[ellipses] = _tangents(centers, half @ half.transpose(0, 2, 1))
        # Eight tangents of σ' each fix the centre to σ'√(2/8): whitened so that the
        # centre comes out with the outline's deviation.
        inverse_sd[ellipses] = (focal / (std[ellipses] * np.sqrt(TANGENTS / 2)))[:, None]
        for i in ellipses.tolist():
            gain[i] = _gain(outlines[i], std[i], tolerance * size[i], alike)

    middle = affine @ boxes.reshape(-1, 2).mean(axis=0) + shift
    pivot = (float(middle[0]), float(middle[1]))
    sides = _sides(outlines)
    keyhole = np.array([o.category == "keyhole" for o in outlines])
    if not lines and not sides:
        return Observations(kind, observed, inverse_sd, gain, pivot, keyhole=keyhole)
    ends = np.array([line.ends_px for line in lines], np.float64).reshape(-1, 2)
    ends = camera.undistort_points(ends) if camera.distorted else ends
    if not np.isfinite(ends).all():
        k = int(np.flatnonzero(~np.isfinite(ends).all(axis=1))[0]) // 2
        raise InputError(
            f"lines {k}",
            f"expected ends where the lens model {camera.distortion_model} holds",
            "check the camera's distortion coefficients, or leave this line out",
        )
    lines = [*lines, *sides]
    ends = np.concatenate([ends, *(side.ends_px for side in sides)]) @ affine.T + shift
    axis = [0 if line.axis == "horizontal" else 1 for line in lines]
    line_isd = [focal / line.std_px for line in lines]
    return Observations(
        kind,
        observed,
        inverse_sd,
        gain,
        pivot,
        np.array(axis, dtype=np.intc),
        np.ascontiguousarray(ends.reshape(-1, 4)),
        np.array(line_isd),
        keyhole,
    )


def _gain(outline: Outline, std: float, tolerance_px: float, alike: float) -> float:
    """How many times surer than its place and size an outline's form is.

    The form's deviation counts `alike` times, as others of the photo err with it.
    """
    if outline.form_std_px is None:
        return 1.0
    return max(1.0, std / (alike * math.hypot(outline.form_std_px, tolerance_px)))


def _sides(outlines: Sequence[Outline]) -> list[LineSegment]:
    """Seen sides of quads of which a corner is not: their direction is known still."""
    found = []
    for outline in outlines:
        if outline.corners_px is None or all(outline.seen):
            continue
        whole = [outline.seen[k] and outline.seen[k - 1] for k in range(4)]
        for seen, (start, end, axis) in zip(outline.seen, _SIDES, strict=True):
            ends = outline.corners_px[[start, end]]
            if (
                seen
                and not (whole[start] and whole[end])
                and np.linalg.norm(ends[1] - ends[0]) >= 1
            ):
                found.append(LineSegment(axis, ends, outline.std_px))
    return found


def _tangents(centers: FloatArray, shapes: FloatArray) -> FloatArray:
    """Tangents (n0, n1, h) at eight eccentric anomalies of each ellipse, (k, 24)."""
    values, vectors = np.linalg.eigh(shapes)
    roots = vectors * np.sqrt(values)[:, None]  # L with L Lᵀ = S
    inverse = vectors / np.sqrt(values)[:, None]  # L⁻ᵀ
    normals = _CIRCLE @ inverse.transpose(0, 2, 1)
    normals /= np.linalg.norm(normals, axis=2, keepdims=True)
    reach = np.linalg.norm(normals @ roots, axis=2)  # √(nᵀ S n)
    h = np.einsum("kij,kj->ki", normals, centers) + reach
    return np.concatenate([normals, h[:, :, None]], axis=2).reshape(len(centers), -1)
