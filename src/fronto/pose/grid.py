"""The paper's exhaustive search for the rotation (Section IV, Alg. 1), compiled."""

from __future__ import annotations

import ctypes
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from fronto.errors import InputError
from fronto.pose.criteria import Criteria, Criterion, back_project
from fronto.pose.presupposed import translation as first_corner_translation
from fronto.pose.rotation import rotation_from_angles
from fronto.shapes import FloatArray, frozen_array

__all__ = ["Combination", "GridResult", "Translation", "search_grid"]

Combination = Literal["sum", "minmax"]
Translation = Literal["none", "paper", "paper_rotated"]

#: Points whose third row is at or below this are behind the camera.
MIN_DEPTH = 1e-9
#: More rotations than this are refused: minutes, or hours.
MAX_ROTATIONS = 10**9

_OUT_COUNT = 10


@dataclass(frozen=True, eq=False)
class GridResult:
    """The best rotation of the grid and what the search saw on the way.

    Parameters
    ----------
    rotation
        R(θ)', shape (3, 3), takes rays D to the panel frame.
    angles_deg
        θ_x, θ_y, θ_z of it, degrees, nodes of the grid.
    translation
        T', shape (3,): P' = R(θ)' D + T'. Zero for ``translation="none"``.
    final_cr
        The least Final CR (Eq. 17), or the least plain sum.
    k_h, k_rv, cos
        ‖K_H‖₂ (Eq. 9), K_rV (Eq. 11) and ‖Cos‖₂ (Eq. 13) at the best rotation.
    evaluated
        How many rotations keep every corner in front of the camera.
    minima, maxima
        Least and largest finite value of each criterion over those rotations.
    """

    rotation: FloatArray
    angles_deg: tuple[float, float, float]
    translation: FloatArray
    final_cr: float
    k_h: float
    k_rv: float
    cos: float
    evaluated: int
    minima: Criteria
    maxima: Criteria

    @property
    def cos_norm(self) -> float:
        """‖Cos‖₂ at the best rotation under the name that ``PanelPose`` has for it."""
        return self.cos


def search_grid(
    outlines_corners: npt.ArrayLike,
    matrix: npt.ArrayLike,
    *,
    range_deg: tuple[float, float] = (-40.0, 40.0),
    step_deg: float = 0.5,
    criterion: Criterion = "inverse",
    combine: Combination = "sum",
    translation: Translation = "none",
    standard_corners: npt.ArrayLike | None = None,
) -> GridResult:
    """Try every rotation R_x R_y R_z of a grid and keep the one with the least Final CR.

    Of equal ones the first counts, θ_x being the outermost loop (Alg. 1). Rotations that
    send a corner behind the camera are left out.

    Parameters
    ----------
    outlines_corners
        C, shape (b, 4, 2): corners of each button in undistorted pixels, in the paper's
        order (top-left, top-right, bottom-right, bottom-left).
    matrix
        M_int, shape (3, 3), pixels.
    range_deg, step_deg
        α, β and γ of Alg. 1, the same for the three axes, degrees. β is included
        (161³ = 4,173,281 rotations by default) where it is a whole number of steps from α.
    criterion
        "inverse": K_rV = ‖1/k_v‖₂. "paper": K_rV = 1/‖K_V‖₂ as printed in Eq. 11.
    combine
        "sum": the plain sum of the three criteria. "minmax": the sum of their min-max
        normalised values as printed (Eqs. 14-17), in two passes, since the range is not
        known before the first one is over.
    translation
        "none": T = 0 in the search. A translation before the division by the third row
        (Eq. 7 as printed) re-photographs the image as a tilted card; it belongs in the
        similarity that places the result (`fronto.pose.presupposed.place_on`). For study:
        "paper": T = e₁ - d₁; "paper_rotated": T = e₁ - R d₁.
    standard_corners
        U, pixels, shape (b, 4, 2) or (n, 2), needed with a translation; only the first
        corner counts.

    Returns
    -------
    The best rotation, its criteria, and the range of each criterion over the grid.

    Raises
    ------
    InputError
        If an argument is unusable, the grid holds more than 1e9 rotations, or no rotation
        of it keeps all corners in front of the camera.

    Notes
    -----
    Why the plain sum and ‖1/k_v‖ are the defaults: with noise on the corners they gave the
    least median error on simulated panels; without noise min-max is a little
    better in the median and on hall panels worse in the tail, since the worst rotations of
    the grid govern it. The figures are in ``docs/paper-map.md``.
    """
    corners = _check_quads(outlines_corners)
    angles = _angles_deg(range_deg, step_deg)
    _check_choices(criterion, combine, translation)
    rays = back_project(corners.reshape(-1, 2), matrix)
    points, shift = _search_points(rays, matrix, translation, standard_corners)

    zeros, ones = (0.0, 0.0, 0.0), (1.0, 1.0, 1.0)
    best, out, evaluated = _run(angles, points, shift, criterion, zeros, ones)
    minima, maxima = Criteria(*out[0:3].tolist()), Criteria(*out[3:6].tolist())
    if best >= 0 and combine == "minmax":
        spans = [span if span > 0 else 1.0 for span in (out[3:6] - out[0:3]).tolist()]
        best, out, evaluated = _run(angles, points, shift, criterion, out[0:3], spans)
    if best < 0:
        raise InputError(
            "corners",
            f"no rotation within {angles[0]:g} to {angles[-1]:g} degrees keeps all of them in "
            "front of the camera",
            "check the corners, the camera matrix and range_deg",
        )

    ix, iy, iz = np.unravel_index(best, (len(angles),) * 3)
    angles_deg = (float(angles[ix]), float(angles[iy]), float(angles[iz]))
    rotation = rotation_from_angles(*np.radians(angles_deg))
    if translation == "paper_rotated":
        shift = shift - rotation @ rays[:, 0]
    k_h, k_rv, cos, final_cr = (float(value) for value in out[6:10])
    return GridResult(
        rotation=frozen_array(rotation, (3, 3), "rotation"),
        angles_deg=angles_deg,
        translation=frozen_array(shift, (3,), "translation"),
        final_cr=final_cr,
        k_h=k_h,
        k_rv=k_rv,
        cos=cos,
        evaluated=evaluated,
        minima=minima,
        maxima=maxima,
    )


def _check_quads(corners: npt.ArrayLike) -> FloatArray:
    quads = frozen_array(corners, (-1, 4, 2), "corners")
    if len(quads) == 0:
        raise InputError(
            "corners",
            "expected at least one quad, got none",
            "the grid search needs rectangular buttons; use refine for round ones",
        )
    sides = np.linalg.norm(quads[:, [1, 3]] - quads[:, [0]], axis=2)
    if not (sides > 0).all():
        raise InputError("corners", "expected four different points a quad, got coinciding ones")
    return quads


def _angles_deg(range_deg: tuple[float, float], step_deg: float) -> FloatArray:
    """Nodes of the grid along one axis, degrees."""
    low, high = (float(value) for value in frozen_array(range_deg, (2,), "range_deg"))
    if not low <= high:
        raise InputError("range_deg", f"expected (low, high) with low <= high, got {range_deg}")
    if not (np.isfinite(step_deg) and step_deg > 0):
        raise InputError("step_deg", f"expected a positive number of degrees, got {step_deg}")
    # A step that divides the range must include its end in spite of rounding.
    intervals = (high - low) / step_deg + 1e-9
    if (intervals + 1) ** 3 > MAX_ROTATIONS + 1:
        raise InputError(
            "step_deg",
            f"expected at most {MAX_ROTATIONS:.0e} rotations, got {(intervals + 1) ** 3:.1e}",
            "take a larger step_deg or a smaller range_deg",
        )
    return np.asarray(low + step_deg * np.arange(int(intervals) + 1), dtype=np.float64)


def _check_choices(criterion: str, combine: str, translation: str) -> None:
    for thing, value, allowed in (
        ("criterion", criterion, ("inverse", "paper")),
        ("combine", combine, ("sum", "minmax")),
        ("translation", translation, ("none", "paper", "paper_rotated")),
    ):
        if value not in allowed:
            raise InputError(thing, f"expected one of {', '.join(allowed)}, got {value!r}")


def _search_points(
    rays: FloatArray,
    matrix: npt.ArrayLike,
    translation: Translation,
    standard_corners: npt.ArrayLike | None,
) -> tuple[FloatArray, FloatArray]:
    """Points q (3, 4 b) and t (3,) with P = R q + t in each reading of Eq. 7."""
    if translation == "none":
        return rays, np.zeros(3)
    if standard_corners is None:
        raise InputError(
            "standard_corners",
            f'needed with translation="{translation}"',
            "give the presupposed corners U (fronto.pose.presupposed.presupposed_corners)",
        )
    standard = np.asarray(standard_corners, dtype=np.float64)
    if standard.size == 0 or standard.shape[-1] != 2:
        raise InputError(
            "standard_corners", f"expected shape (b, 4, 2) or (n, 2), got {standard.shape}"
        )
    first = back_project(standard.reshape(-1, 2)[:1], matrix)
    if translation == "paper":
        return rays, first_corner_translation(first, rays)
    # R d + (e1 - R d1) = R (d - d1) + e1
    return rays - rays[:, :1], first[:, 0]


def _run(
    angles_deg: FloatArray,
    points: FloatArray,
    shift: FloatArray,
    criterion: Criterion,
    offset: npt.ArrayLike,
    span: npt.ArrayLike,
) -> tuple[int, FloatArray, int]:
    """One pass over the grid: best index or -1, the kernel's numbers, rotations evaluated."""
    from fronto.native import library

    angles = np.radians(angles_deg)
    cosine, sine = np.cos(angles), np.sin(angles)
    # R_z leaves the third row as it is, and is turned once for all θ_x and θ_y.
    x = points[0][:, None] * cosine + points[1][:, None] * sine
    y = points[1][:, None] * cosine - points[0][:, None] * sine
    z, t = np.ascontiguousarray(points[2]), np.ascontiguousarray(shift)
    offsets, spans = np.array(offset, dtype=np.float64), np.array(span, dtype=np.float64)
    out = np.empty(_OUT_COUNT)
    evaluated = ctypes.c_int64()

    search = library().fronto_grid_search
    search.restype = ctypes.c_int64
    best = search(
        ctypes.c_int64(len(angles)),
        _pointer(cosine),
        _pointer(sine),
        ctypes.c_int64(points.shape[1] // 4),
        _pointer(x),
        _pointer(y),
        _pointer(z),
        _pointer(t),
        ctypes.c_double(MIN_DEPTH),
        ctypes.c_int(criterion == "paper"),
        _pointer(offsets),
        _pointer(spans),
        _pointer(out),
        ctypes.byref(evaluated),
    )
    return int(best), out, evaluated.value


def _pointer(array: FloatArray) -> ctypes.c_void_p:
    return ctypes.c_void_p(array.ctypes.data)
