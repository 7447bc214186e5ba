"""`estimate_pose`: outlines and a camera in, the panel's rotation and its trust out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from fronto.camera import Camera
from fronto.errors import InputError
from fronto.pose.bundle import FIRST_GROUP, FOCAL, QUAD, TANGENTS, Solution, depth_one, solve
from fronto.pose.checks import boxes_px, check_outlines
from fronto.pose.criteria import cos_norm
from fronto.pose.observations import TOLERANCE, observations, undistorted
from fronto.pose.refine import Adjustment, adjust
from fronto.pose.starts import middle
from fronto.pose.template import Template, contradictions, match_template
from fronto.pose.verdict import (
    FOCAL_OBSERVABLE,
    SET_ASIDE,
    Verdict,
    covariance,
    fitted,
    judge,
    line_weights,
    weights,
)
from fronto.results import PanelPose
from fronto.shapes import FloatArray, LineSegment, Outline

if TYPE_CHECKING:
    from fronto.pose.grid import GridResult

__all__ = ["estimate_pose"]

#: Arguments of `fronto.pose.grid.search_grid`.
GRID_OPTIONS = frozenset(
    ("range_deg", "step_deg", "criterion", "combine", "translation", "standard_corners")
)
_SIGNS = np.array([[-0.5, -0.5], [0.5, -0.5], [0.5, 0.5], [-0.5, 0.5]])


def estimate_pose(
    outlines: Sequence[Outline],
    camera: Camera,
    *,
    solver: Literal["refine", "grid"] = "refine",
    lines: Sequence[LineSegment] = (),
    square: bool = False,
    aligned: bool = True,
    template: Template | None = None,
    tolerance: float = TOLERANCE,
    correlation: float = 0.0,
    **grid: Any,
) -> PanelPose:
    """Estimate the rotation between camera and panel from outlines of its buttons.

    Parameters
    ----------
    outlines
        In the photo as it is (lens distortion and all).
    camera
        Its `focal_std` decides whether the focal length is estimated along: 0 = known.
    solver
        "refine": robust bundle adjustment, with deviations (default). "grid": the
        paper's exhaustive search over rotations (Section IV), quads only.
    lines
        Segments known to be horizontal or vertical on the wall (refine only). Those that were only
        `found` are used where outlines and known segments make no pose that is "ok" and all
        together do, or where they make none at all.
    square
        The quads are known to be square; a strong help on small panels (refine only).
    aligned
        Buttons line up in rows and columns (refine only).
    template
        The panel's layout in millimetres where it is known (refine only).
    tolerance
        How far corners of the real buttons are from where equal ones in exact rows and
        columns would have them (standard deviation, in button sizes); 0 for a panel that
        is exactly so (refine only).
    correlation
        Share of the outlines' variance that is common to all of them, 0 to 1: outlines that
        a network or a person drew err alike, and many of them tell less than as many
        independent ones (refine only).
    grid
        For ``solver="grid"``: `range_deg`, `step_deg`, `criterion`, `combine`,
        `translation`, `standard_corners`; see `fronto.pose.grid.search_grid`.

    Returns
    -------
    The pose; its `status` says whether to trust it. Without outlines: "no_buttons".

    Raises
    ------
    InputError
        If outlines contradict each other (one button twice, corner orders that differ),
        the template does not match, or an argument is not one of the solver's.

    Examples
    --------
    >>> import fronto
    >>> camera = fronto.Camera.from_fov(90, 640, 480)
    >>> pose = fronto.estimate_pose([], camera)
    >>> pose.status
    'no_buttons'
    """
    outlines = list(outlines)
    _check_arguments(solver, camera, lines, template, square or not aligned, tolerance, grid)
    if not 0 <= correlation <= 1:
        raise InputError("correlation", f"expected 0 to 1, got {correlation}")
    check_outlines(outlines)
    if not outlines:
        return _without(camera, solver, "no_buttons", "no button outlines were given", 0)
    flat = undistorted(outlines, camera)
    if solver == "grid":
        return _grid_pose(flat, camera, grid)
    matched = None if template is None else match_template(template, outlines)

    def solved(lines: Sequence[LineSegment]) -> PanelPose:
        adjustment = adjust(
            observations(flat, camera, lines, tolerance),
            square=square,
            aligned=aligned,
            focal_isd=1 / camera.focal_std if camera.focal_std > 0 else -1.0,
            template=matched,
            common=1.0 + correlation * (len(outlines) - 1),
        )
        if not adjustment.solutions:
            reason = "no rotation puts all outlines in front of the camera"
            return _without(camera, solver, "degenerate", reason, len(outlines))
        return _refined_pose(flat, camera, adjustment)

    known = [line for line in lines if not line.found]
    pose = solved(known)
    if pose.status == "ok" or len(known) == len(lines):
        return pose
    # What nobody knows may help where nothing can be lost.
    helped = solved(lines)
    return helped if helped.status == "ok" or pose.status == "degenerate" else pose


def _check_arguments(
    solver: str,
    camera: Camera,
    lines: Sequence[LineSegment],
    template: Template | None,
    panel_known: bool,
    tolerance: float,
    grid: dict[str, Any],
) -> None:
    if solver not in ("refine", "grid"):
        raise InputError("solver", f'expected "refine" or "grid", got {solver!r}')
    if not (np.isfinite(tolerance) and tolerance >= 0):
        raise InputError("tolerance", f"expected button sizes, 0 or more, got {tolerance}")
    if not isinstance(camera, Camera):
        raise InputError(
            "camera",
            f"expected a fronto.Camera, got {type(camera).__name__}",
            "Camera.default(width_px, height_px) stands for an unknown one",
        )
    if not all(isinstance(line, LineSegment) for line in lines):
        raise InputError("lines", "expected fronto.LineSegment items")
    if template is not None and not isinstance(template, Template):
        raise InputError("template", f"expected a fronto.Template, got {type(template).__name__}")
    unknown = sorted(set(grid) - GRID_OPTIONS)
    if unknown:
        raise InputError("estimate_pose", f"{', '.join(unknown)} is no argument of it or the grid")
    if solver == "refine" and grid:
        names = ", ".join(sorted(grid))
        raise InputError("estimate_pose", f'{names} belong to solver="grid" only')
    if solver == "grid" and (panel_known or template is not None or lines):
        raise InputError(
            "estimate_pose",
            'square, aligned, template and lines belong to solver="refine" only',
            "leave them out, or use the default solver",
        )
    if solver == "refine" and camera.distorted and camera.focal_std > 0:
        raise InputError(
            "camera",
            "expected a known focal length with lens distortion, which was calibrated with it",
            "set focal_std to 0, or undistort the photo first",
        )


def _without(camera: Camera, solver: str, status: Any, reason: str, n: int) -> PanelPose:
    return PanelPose(
        status=status,
        reasons=(reason,),
        solver=solver,
        rotation=np.eye(3),
        covariance=np.full((3, 3), np.nan),
        camera=camera,
        plane_corners=np.zeros((0, 4, 2)),
        residual_px=np.full(n, np.nan),
        weight=np.zeros(n),
    )


def _refined_pose(flat: Sequence[Outline], camera: Camera, found: Adjustment) -> PanelPose:
    best = found.solutions[0]
    # As whitened: the stated deviations, the buttons' tolerance and what the residuals ask for.
    tangent = np.where(found.seen.kind == QUAD, 1.0, np.sqrt(TANGENTS / 2))
    std = camera.focal_px / (found.seen.inverse_sd.max(axis=1) * tangent)
    # What does not fit is the form of quads whose form is surer than their place and size.
    std *= np.maximum(1 / found.sigma_factor, 1 / found.seen.gain)
    sigma_px = float(middle(std))
    std *= np.sqrt(found.fit)
    boxes = boxes_px(flat)
    size_px = np.sqrt((boxes[:, 2] - boxes[:, 0]) * (boxes[:, 3] - boxes[:, 1]))
    cov = _covariance(best, found)
    counts = weights(found, best) >= SET_ASIDE
    missed_px = float(middle(_residuals(best, camera, found)[counts])) if counts.any() else 0.0
    verdict = judge(found, cov, size_px, min(sigma_px, missed_px), _aspect_std(found, cov))
    if verdict.status == "degenerate":
        cov = np.full(cov.shape, np.nan)
    pose = _pose(best, camera, found, verdict, std, cov)
    others = [
        _pose(other, camera, found, verdict, std, _covariance(other, found))
        for other in (found.solutions[k] for k in verdict.rivals)
    ]
    if found.other_roll is not None:
        others.append(_turned(pose, found.other_roll))
    return replace(pose, alternatives=tuple(others))


def _covariance(solution: Solution, found: Adjustment) -> FloatArray:
    return fitted(found.common * covariance(solution, found.model), found)


def _residuals(solution: Solution, camera: Camera, found: Adjustment) -> FloatArray:
    """Root mean square distance (n,) of corners or tangents from where they are seen, pixels."""
    seen = found.seen
    plain = replace(seen, gain=np.ones(len(seen.gain)))
    start = (solution.rotation[None], solution.parameters[None], solution.xy[None])
    chi2 = solve(plain, found.model, *start, max_iterations=0)[0].chi2
    # A quad has four corners, and eight tangents have both coordinates of four points.
    per_point = chi2 / np.where(seen.kind == QUAD, 4, TANGENTS)
    return np.asarray(camera.focal_px / seen.inverse_sd.max(axis=1) * np.sqrt(per_point))


def _turned(pose: PanelPose, rotation: FloatArray) -> PanelPose:
    """The same panel read with another roll: its squares of circles stay upright in it."""
    turn = rotation @ pose.rotation.T
    corners = pose.plane_corners
    centers = corners.mean(axis=1, keepdims=True)
    points = np.concatenate([centers, np.ones((*centers.shape[:2], 1))], axis=2) @ turn.T
    corners = corners - centers + points[..., :2] / points[..., 2:]
    return replace(pose, rotation=rotation, plane_corners=corners)


def _pose(
    solution: Solution,
    camera: Camera,
    found: Adjustment,
    verdict: Verdict,
    std: FloatArray,
    cov: FloatArray,
) -> PanelPose:
    model, seen = found.model, found.seen
    groups = len(model.square_isd)
    sizes = np.exp(solution.parameters[FIRST_GROUP : FIRST_GROUP + 2 * groups]).reshape(-1, 2)
    sizes = sizes[model.group]
    quads = seen.kind == QUAD
    circles = ~quads & (model.oval[model.group] == 0)
    sizes[circles, 1] = sizes[circles, 0]
    focal_scale = float(np.exp(solution.parameters[FOCAL]))
    offset, distance = depth_one(seen, solution.rotation, focal_scale)
    corners = (solution.xy[:, None] + sizes[:, None] * _SIGNS + offset) / distance
    residual = _residuals(solution, camera, found)
    focal_std, notes, aspect = 0.0, [], _aspect_std(found, cov)
    if camera.focal_std > 0:
        focal_std = float(np.sqrt(cov[FOCAL, FOCAL]))
        if not np.isfinite(focal_std):
            focal_std = camera.focal_std
        focal_px = camera.focal_px * focal_scale
        # Estimated only where the panel told more than was known before.
        told = focal_std <= min(FOCAL_OBSERVABLE, 0.5 * camera.focal_std)
        source = "estimated" if told else camera.source
        camera = camera.with_focal(focal_px, focal_std, source)
        if not focal_std <= FOCAL_OBSERVABLE:
            notes.append(
                f"focal length not observable from this panel, assumed {focal_px:.0f} px"
                + (f": the aspect may be off by {100 * aspect:.0f} %" if aspect else "")
            )
    if model.oval.any():
        notes.append(
            "round buttons were taken for ovals, since they make no flat panel as circles: they "
            "are oval, or the photo has been stretched"
        )
    if len(seen.axis):
        aside = int((line_weights(found, solution) < SET_ASIDE).sum())
        if aside:
            notes.append(
                f"{aside} of {len(seen.axis)} lines do not fit the panel and were set aside"
            )
    depth = None
    if model.scale_latent >= 0 and not contradictions(model, solution):
        scale = solution.parameters[FIRST_GROUP + 2 * groups + model.scale_latent]
        depth = 1e-3 * distance / float(scale)
    return PanelPose(
        status=verdict.status,
        reasons=verdict.reasons,
        solver="refine",
        rotation=solution.rotation,
        covariance=cov[:3, :3],
        camera=camera,
        plane_corners=corners,
        residual_px=residual,
        weight=weights(found, solution),
        sigma_px=float(middle(std)),
        cos_norm=_cos_norm(seen.observed[quads, :8], solution),
        focal_std=focal_std,
        aspect_std=aspect,
        plane_depth_m=depth,
        notes=tuple(notes),
        cost=solution.cost,
        stopped=(
            f"{'converged' if solution.converged else 'stopped'} after {solution.iterations} "
            f"steps, cost {solution.first_cost:.4g} to {solution.cost:.4g}"
        ),
    )


def _cos_norm(corners: FloatArray, solution: Solution) -> float | None:
    if not len(corners):
        return None
    scaled = corners.reshape(-1, 2) / np.exp(solution.parameters[FOCAL])
    plane = scaled @ solution.rotation[:, :2].T + solution.rotation[:, 2]
    return float(cos_norm((plane[:, :2] / plane[:, 2:]).reshape(-1, 4, 2)))


def _aspect_std(found: Adjustment, cov: FloatArray) -> float | None:
    """Deviation of ln(width/height) of the largest group of quads, None without quads."""
    groups = found.model.group[found.seen.kind == QUAD]
    if not len(groups):
        return None
    at = FIRST_GROUP + 2 * int(np.bincount(groups).argmax())
    variance = float(cov[at, at] + cov[at + 1, at + 1] - 2 * cov[at, at + 1])
    return float(np.sqrt(variance)) if variance > 0 else None


def _grid_pose(flat: Sequence[Outline], camera: Camera, options: dict[str, Any]) -> PanelPose:
    from fronto.pose.grid import search_grid

    corners = np.array([o.corners_px for o in flat if o.corners_px is not None])
    if not len(corners):
        reason = "round buttons have no slopes: the grid search needs at least one quad"
        return _without(camera, "grid", "degenerate", reason, len(flat))
    result: GridResult = search_grid(corners, camera.matrix, **options)
    plane = _grid_plane(flat, camera, result.rotation)
    residual = np.full(len(flat), np.nan)
    return PanelPose(
        status="uncertain",
        reasons=("the grid search knows no uncertainty",),
        solver="grid",
        rotation=result.rotation,
        covariance=np.full((3, 3), np.nan),
        camera=camera,
        plane_corners=plane,
        residual_px=residual,
        weight=np.array([1.0 if o.shape == "quad" else 0.0 for o in flat]),
        cos_norm=result.cos_norm,
        final_cr=result.final_cr,
        focal_std=camera.focal_std,
        stopped=f"{result.evaluated} rotations evaluated",
    )


def _grid_plane(flat: Sequence[Outline], camera: Camera, rotation: FloatArray) -> FloatArray:
    """Corners (n, 4, 2) on the plane at depth 1; of ellipses those of their boxes there."""
    to_plane = rotation @ np.linalg.inv(camera.matrix)
    result = np.empty((len(flat), 4, 2))
    for k, outline in enumerate(flat):
        points = outline.corners_px
        if points is None:
            assert outline.ellipse_px is not None
            points = outline.ellipse_px.points()
        plane = np.concatenate([points, np.ones((len(points), 1))], axis=1) @ to_plane.T
        on_plane = plane[:, :2] / plane[:, 2:]
        if outline.corners_px is None:
            low, high = on_plane.min(axis=0), on_plane.max(axis=0)
            on_plane = 0.5 * (low + high) + (high - low) * _SIGNS
        result[k] = on_plane
    return result
