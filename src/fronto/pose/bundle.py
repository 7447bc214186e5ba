"""The panel's bundle adjustment: the ctypes side of ``native/bundle_*.c``.

The compiled code does the numbers; this module only packs arrays, so that everything
that decides (starts, rows and columns, verdicts) stays in Python.
"""

from __future__ import annotations

import ctypes
import functools
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from fronto.native import address, library
from fronto.shapes import FloatArray

__all__ = ["Model", "Observations", "Solution", "back_project", "depth_one", "evaluate", "solve"]

IntArray = npt.NDArray[np.intc]

QUAD, ELLIPSE = 0, 1
#: Globals before the size groups: three of the rotation's update, and log focal.
FOCAL, FIRST_GROUP = 3, 4
TANGENTS = 8
#: Most global parameters that the compiled side takes.
MAX_GLOBALS = 256


@dataclass(frozen=True)
class Observations:
    """What was seen, in normalised coordinates u = K⁻¹ p, whitened by inverse deviations.

    Parameters
    ----------
    kind
        (n,): QUAD or ELLIPSE.
    observed
        (n, 24). Quads: 4 corners (u0, u1), then zeros. Ellipses: 8 tangents (n0, n1, h),
        the tangent being {u : n·u = h} with unit outward normal n.
    inverse_sd
        (n, 8): 1/σ of each corner (first four; 0 = not seen) or tangent.
    gain
        (n,): how many times surer a quad's form is than its place and its size, at least 1.
    pivot
        The panel's middle: (x, y) of the plane are distances from where its ray meets
        the panel, in units of that point's depth.
    axis, segment, line_isd
        (l,), (l, 4), (l,): axis-parallel segments; axis 0 horizontal, 1 vertical.
    keyhole
        (n,): not pressed but turned, of a make and size of its own; none where empty.
    """

    kind: IntArray
    observed: FloatArray
    inverse_sd: FloatArray
    gain: FloatArray
    pivot: tuple[float, float]
    axis: IntArray = field(default_factory=lambda: np.zeros(0, np.intc))
    segment: FloatArray = field(default_factory=lambda: np.zeros((0, 4)))
    line_isd: FloatArray = field(default_factory=lambda: np.zeros(0))
    keyhole: npt.NDArray[np.bool_] = field(default_factory=lambda: np.zeros(0, bool))

    @property
    def family(self) -> npt.NDArray[np.intp]:
        """(n,): buttons of different families never share a size."""
        family = self.kind.astype(np.intp)
        return 2 * family + self.keyhole if len(self.keyhole) else family

    @functools.cached_property
    def addresses(self) -> tuple[int, ...]:
        """Where the arrays are: kind, observed, inverse_sd, gain, axis, segment, line_isd."""
        d, i = np.float64, np.intc
        return (
            address(self.kind, i),
            address(self.observed, d),
            address(self.inverse_sd, d),
            address(self.gain, d),
            address(self.axis, i),
            address(self.segment, d),
            address(self.line_isd, d),
        )


@dataclass(frozen=True)
class Model:
    """What the buttons share: sizes, rows, columns, and the priors.

    Parameters
    ----------
    group
        (n,): size group of each button; a group holds quads or circles, not both.
    square_isd
        (g,): 1/σ of log(width/height) of each group, 0 where unknown.
    oval
        (g,): 1 where a group's ellipses are ovals, whose axes are the panel's, 0 where circles.
    tie_index, tie_coef
        (n, 4): x is tied to the sum of two latents times their coefficients, y likewise;
        index -1 = none.
    tie_isd
        (n, 2): 1/σ of those ties, in units of the pivot's depth.
    latents
        Number of latent positions.
    size_scale
        (g, 2): known width and height in units of the latent `scale_latent`; 0 = unknown.
    size_isd
        1/σ of the logarithm of those.
    scale_latent
        Index of the latent that is the template's scale, -1 = none.
    focal_isd
        1/σ of ln(f/f0); negative where the focal length is known.
    tilt_isd
        1/σ of R[2, 0] and R[2, 1]: panels are looked at rather than glanced along.
    button_knee, button_c2, tie_c2, line_c2
        Squared scales of the Cauchy losses; a button's χ² (eight residuals) counts in
        full up to the knee.
    """

    group: IntArray
    square_isd: FloatArray
    oval: IntArray
    tie_index: IntArray
    tie_coef: FloatArray
    tie_isd: FloatArray
    latents: int
    size_scale: FloatArray
    size_isd: float = 0.0
    scale_latent: int = -1
    focal_isd: float = -1.0
    tilt_isd: float = 1 / 0.5
    button_knee: float = 16.0
    button_c2: float = 16.0
    tie_c2: float = 9.0
    line_c2: float = 9.0

    @property
    def size(self) -> int:
        """Number of global parameters."""
        return FIRST_GROUP + 2 * len(self.square_isd) + self.latents


@dataclass(frozen=True)
class Solution:
    """One local optimum.

    Parameters
    ----------
    rotation
        (3, 3), rectifying.
    parameters
        (m,): zeros (3), ln(f/f0), log sizes, latents.
    xy
        (n, 2): button centres on the panel, from the pivot, in units of its depth.
    chi2
        (n,): squared whitened residuals.
    hessian
        (m, m): robust JᵀJ reduced to the global parameters.
    """

    rotation: FloatArray
    parameters: FloatArray
    xy: FloatArray
    chi2: FloatArray
    hessian: FloatArray
    cost: float
    first_cost: float
    iterations: int
    converged: bool


def depth_one(
    seen: Observations, rotation: FloatArray, focal_scale: float = 1.0
) -> tuple[FloatArray, float]:
    """Offset (2,) and distance h of the panel as the plane z = 1 of the panel frame has it.

    A panel point (x, y) is at ((x, y) + offset) / h there, a length l is l / h.
    """
    pivot = np.array([seen.pivot[0] / focal_scale, seen.pivot[1] / focal_scale, 1.0])
    shift = rotation @ pivot
    return shift[:2], float(shift[2])


_POINTER = ctypes.c_void_p
_DOUBLE = ctypes.c_double
_INT = ctypes.c_int


class _Problem(ctypes.Structure):
    _fields_ = (
        *[(name, _INT) for name in ("buttons", "groups", "latents", "lines")],
        ("pivot", _DOUBLE * 2),
        *[
            (name, _POINTER)
            for name in (
                "kind",
                "observed",
                "inverse_sd",
                "gain",
                "group",
                "oval",
                "tie_index",
                "tie_coef",
                "tie_isd",
                "axis",
                "segment",
                "line_isd",
                "square_isd",
                "size_scale",
            )
        ],
        ("size_isd", _DOUBLE),
        ("scale_latent", _INT),
        *[
            (name, _DOUBLE)
            for name in ("focal_isd", "tilt_isd", "button_knee", "button_c2", "tie_c2", "line_c2")
        ],
        ("max_iterations", _INT),
        ("tolerance", _DOUBLE),
    )


class _Solution(ctypes.Structure):
    _fields_ = (
        *[(name, _POINTER) for name in ("rotation", "globals", "xy", "chi2", "hessian")],
        ("cost", _DOUBLE),
        ("first_cost", _DOUBLE),
        ("iterations", _INT),
        ("converged", _INT),
    )


@functools.cache
def _kernels() -> tuple[Any, Any, Any]:
    kernels = library()
    run, cost = kernels.fronto_bundle, kernels.fronto_bundle_cost
    project = kernels.fronto_back_project
    project.argtypes = [_INT, _POINTER, _POINTER, _POINTER, _INT, _INT, _POINTER, _DOUBLE]
    project.argtypes += [_POINTER] * 2
    project.restype = None
    run.argtypes = [ctypes.POINTER(_Problem), ctypes.POINTER(_Solution), _INT]
    run.restype = _INT
    cost.argtypes = [ctypes.POINTER(_Problem), _POINTER, _POINTER, _POINTER]
    cost.restype = _DOUBLE
    return run, cost, project


def _pack(seen: Observations, model: Model, iterations: int, tolerance: float) -> _Problem:
    d, i = np.float64, np.intc
    kind, observed, inverse_sd, gain, axis, segment, line_isd = seen.addresses
    return _Problem(
        len(seen.kind),
        len(model.square_isd),
        model.latents,
        len(seen.axis),
        (_DOUBLE * 2)(*seen.pivot),
        kind,
        observed,
        inverse_sd,
        gain,
        address(model.group, i),
        address(model.oval, i),
        address(model.tie_index, i),
        address(model.tie_coef, d),
        address(model.tie_isd, d),
        axis,
        segment,
        line_isd,
        address(model.square_isd, d),
        address(model.size_scale, d),
        model.size_isd,
        model.scale_latent,
        model.focal_isd,
        model.tilt_isd,
        model.button_knee,
        model.button_c2,
        model.tie_c2,
        model.line_c2,
        iterations,
        tolerance,
    )


def solve(
    seen: Observations,
    model: Model,
    rotations: FloatArray,
    parameters: FloatArray,
    xy: FloatArray,
    *,
    max_iterations: int = 60,
    tolerance: float = 1e-6,
) -> list[Solution]:
    """Refine every start by Levenberg-Marquardt; see ``native/bundle_solve.c``.

    Parameters
    ----------
    rotations, parameters, xy
        (k, 3, 3), (k, m), (k, n, 2): the starts.
    max_iterations
        Trial steps per start.
    tolerance
        A start has converged when a step lowers its cost by no more than this.

    Returns
    -------
    One solution per start, in the same order; one that never had everything in front of
    the camera has infinite cost.
    """
    count, m, n = len(rotations), model.size, len(seen.kind)
    rotations = np.array(rotations, dtype=np.float64, order="C")
    parameters = np.array(parameters, dtype=np.float64, order="C")
    xy = np.array(xy, dtype=np.float64, order="C")
    assert rotations.shape == (count, 3, 3)
    assert parameters.shape == (count, m)
    assert xy.shape == (count, n, 2)
    chi2, hessian = np.zeros((count, n)), np.zeros((count, m, m))
    bases = [array.ctypes.data for array in (rotations, parameters, xy, chi2, hessian)]
    sizes = [9 * 8, m * 8, 2 * n * 8, n * 8, m * m * 8]
    solutions = (_Solution * count)()
    for k in range(count):
        item = solutions[k]
        item.rotation, item.globals, item.xy, item.chi2, item.hessian = [
            base + k * size for base, size in zip(bases, sizes, strict=True)
        ]
    problem = _pack(seen, model, max_iterations, tolerance)
    failed = _kernels()[0](ctypes.byref(problem), solutions, count)
    if failed == 1:
        raise MemoryError("bundle adjustment: not enough memory")
    if failed:
        raise ValueError(f"bundle adjustment: {m} shared parameters are more than it takes")
    return [
        Solution(
            rotations[k],
            parameters[k],
            xy[k],
            chi2[k],
            hessian[k],
            item.cost,
            item.first_cost,
            item.iterations,
            bool(item.converged),
        )
        for k, item in enumerate(solutions)
    ]


def back_project(
    seen: Observations, rotations: FloatArray, focal_scale: float = 1.0, keep: int | None = None
) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Back-project each outline by itself with each rotation; ``native/back_project.c``.

    Parameters
    ----------
    rotations
        (k, 3, 3).
    focal_scale
        True focal length over the one that the observations were normalised with.
    keep
        Rotations from this one on are first turned within the plane so that the quads'
        sides are upright; None leaves all as they are.

    Returns
    -------
    Centres (k, n, 2) on the panel, from the pivot, and logarithms of width and height
    (k, n, 2; of a circle both are the diameter), in units of the pivot's depth; and the
    rotations (k, 3, 3).
    """
    rotations = np.array(rotations, dtype=np.float64, order="C")
    count, n = len(rotations), len(seen.kind)
    xy, log_size = np.empty((count, n, 2)), np.empty((count, n, 2))
    _kernels()[2](
        n,
        *seen.addresses[:2],
        (_DOUBLE * 2)(*seen.pivot),
        count,
        count if keep is None else keep,
        rotations.ctypes.data,
        focal_scale,
        xy.ctypes.data,
        log_size.ctypes.data,
    )
    return xy, log_size, rotations


def evaluate(
    seen: Observations,
    model: Model,
    rotation: FloatArray,
    parameters: FloatArray,
    xy: FloatArray,
) -> float:
    """Cost of the given parameters (the function that `solve` makes small)."""
    rotation, parameters, xy = (
        np.ascontiguousarray(array, dtype=np.float64) for array in (rotation, parameters, xy)
    )
    problem = _pack(seen, model, 0, 0.0)
    return float(
        _kernels()[1](
            ctypes.byref(problem), rotation.ctypes.data, parameters.ctypes.data, xy.ctypes.data
        )
    )
