"""``solver="refine"``: one robust bundle adjustment of the panel, from several starts.

Each stage needs what the one before has found: sizes shared, from four tilts; for round
buttons the roll, from the lattice of centres; rows, columns and size groups, on the
plane; the full problem, from every distinct optimum and its mirror image.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from fronto.pose.bundle import (
    FIRST_GROUP,
    FOCAL,
    QUAD,
    Model,
    Observations,
    Solution,
    solve,
)
from fronto.pose.rotation import angle_between, rotation_z
from fronto.pose.starts import (
    initial_parameters,
    lattice_rolls,
    middle,
    reflected,
    starting_rotations,
)
from fronto.pose.structure import (
    GroupArray,
    base_model,
    lattice_groups,
    numbered,
    size_groups,
    tied_model,
    typical_width,
)
from fronto.pose.template import TemplateButton, template_groups, templated_model
from fronto.shapes import FloatArray

__all__ = ["Adjustment", "adjust"]

#: Optima closer than a degree are one: trace of R1ᵀ R2, 1 + 2 cos.
SAME_TRACE = 1 + 2 * np.cos(np.radians(1.0))
#: Typical χ² this much above its expectation: the stated deviations are too small.
MISFIT = 2.0
#: Residuals smaller or larger than the stated deviations show that errors are, too. The variance is
#: as much of the stated one as theirs is, taken together with so many residuals that are as stated;
#: where they are smaller, what cannot be excluded of that (the quantile of χ² as one of a normal
#: distribution); and this share of it stays, for errors that the buttons have in common.
KNOWN, QUANTILE, COMMON = 1.0, -1.2816, 0.1
#: What a button on no row (or column) costs when readings of the lattice are compared, in
#: χ²: about as much as one that is on the wrong one.
UNTIED = 30.0
#: What each button counts for, in χ², that lies on a row or column which others have settled: so
#: unlikely is it by chance. Where more than that is lost by tying them, there are no rows.
TIED = 9.0
#: What else may be tied than rows and columns (1 and 0): one of them, or nothing.
FEWER: tuple[tuple[int, ...], ...] = ((0,), (1,), ())
#: What one more size group has to gain, in χ².
GROUP_GAIN = 10.0
#: What it has to gain that round buttons are ovals, in χ²: few panels have such. Where fewer of
#: them are seen, nothing tells.
OVAL_GAIN, OVALS = 20.0, 2
#: Deviations of χ² above its expectation that show a contradiction.
CONTRADICTION = 3.5
#: How upright cameras are held: deviation of the roll, where only circles are seen.
UPRIGHT_RAD = np.radians(12.0)
#: An explanation whose cost is within this of the best one cannot be excluded.
RIVAL = 10.0
SAME_NORMAL = np.cos(np.radians(1.0))
#: Before rows and columns count, an optimum this much worse is out of the race.
OTHER_MODE = 200.0
#: Readings of the lattice closer than this are one.
OTHER_ROLL_RAD = np.radians(10.0)
#: Tilt of the starts in degrees, with the focal length known and unknown.
TILT_KNOWN, TILT_UNKNOWN = 30.0, 40.0
#: Optima at one rotation whose ln f differ by less than this are one.
SAME_FOCAL = 0.1
#: Coarse convergence (in χ²) is enough to tell optima apart.
COARSE, FINE = 1e-2, 1e-4
#: What starts near an optimum converges in ten steps; what needs more is no rival.
STEPS = 30


@dataclass(frozen=True)
class _Shared:
    """What the caller says about the panel."""

    square: bool
    aligned: bool
    focal_isd: float
    template: Sequence[TemplateButton | None] | None
    line_c2: float


_Scored = tuple[float, Model, list[Solution]]


@dataclass(frozen=True)
class Adjustment:
    """What the optimiser found.

    Parameters
    ----------
    solutions
        Optima, best first; empty where nothing could be solved.
    model, seen
        What they are optima of.
    sigma_factor
        Residuals over the stated deviations where they are larger; `seen` is whitened
        with the larger ones already.
    other_roll
        For panels of circles only: a rotation with another roll whose rows and columns
        fit about as well; None where the roll is clear.
    common
        Variance of what the buttons tell together, over what it were if they erred
        independently; costs and covariances are without it, lines and priors weigh more by it.
    fit
        Variance of the result over what the stated deviations (those in `seen`) make it, as the
        residuals show. Covariances are without it.
    """

    solutions: tuple[Solution, ...]
    model: Model
    seen: Observations
    sigma_factor: float = 1.0
    other_roll: FloatArray | None = None
    common: float = 1.0
    fit: float = 1.0


def adjust(
    seen: Observations,
    *,
    square: bool = False,
    aligned: bool = True,
    focal_isd: float = -1.0,
    template: Sequence[TemplateButton | None] | None = None,
    common: float = 1.0,
) -> Adjustment:
    """Find the rotation, sizes and positions that explain the observations.

    Parameters
    ----------
    square
        The quads are known to be square.
    aligned
        Rows and columns line up.
    focal_isd
        1/σ of ln(f/f0); negative where the focal length is known.
    template
        The known button of each outline, or None.
    common
        As of `Adjustment`.
    """
    if focal_isd > 0:
        focal_isd *= np.sqrt(common)
    seen = replace(seen, line_isd=seen.line_isd * np.sqrt(common))
    model = base_model(seen, numbered(seen.family), square, focal_isd)
    model = replace(model, line_c2=common * model.line_c2)
    rotations = starting_rotations(seen, TILT_KNOWN if focal_isd < 0 else TILT_UNKNOWN)
    start = initial_parameters(seen, model, rotations)
    found = _distinct(solve(seen, model, *start, tolerance=COARSE))
    if not found:
        return Adjustment((), model, seen, common=common)
    only_circles = not bool((seen.kind == QUAD).any())
    shared = _Shared(square, aligned, focal_isd, template, model.line_c2)
    # A few quads among circles may be badly cut ones: the lattice has its say as well.
    beginnings = [] if only_circles else [found]
    if only_circles or _mostly_circles(seen):
        beginnings += _upright_lattices(found, model)
    tried = [_with_structure(seen, model, start, shared) for start in beginnings]
    tried.sort(key=lambda item: item[0])
    _, model, found = tried[0]

    factor = np.sqrt(_misfit(found[0], model, seen))
    if factor**2 > MISFIT:
        # Weigh residuals against the priors by the deviation that they really have.
        # What the buttons miss says nothing about the lines.
        seen = replace(seen, inverse_sd=seen.inverse_sd / factor)
        _, model, found = _with_structure(seen, model, found, shared)
    else:
        factor = 1.0
    fit = _fit(found[0], model, seen)
    # A template tells the roll even of circles.
    rolls = only_circles and template is None
    other = _other_roll(found[0].rotation, tried) if rolls else None
    return Adjustment(tuple(found), model, seen, float(factor), other, common, fit)


def _with_structure(
    seen: Observations,
    model: Model,
    found: list[Solution],
    shared: _Shared,
) -> _Scored:
    """Solve with size groups and ties; what explains the most, its score first."""
    kinds = numbered(seen.family)
    if shared.template is not None:
        candidates = [template_groups(seen, shared.template)]
    else:
        candidates = [kinds]
        groups = size_groups(seen, found[0], model)
        if groups.max() > kinds.max():
            candidates.append(groups)
    best: _Scored = (np.inf, model, found)
    for group in candidates:
        best = min(best, _settled(seen, group, found, shared), key=lambda item: item[0])
    if shared.template is None and excess(seen, best[1], best[2][0].cost) > CONTRADICTION:
        # A column of slightly larger buttons looks closer, and bends the pose: what was
        # measured on the bent plane does not show it, but it does not fit either.
        for group in lattice_groups(seen, best[1]):
            best = min(best, _settled(seen, group, best[2], shared), key=lambda item: item[0])
    _, model, solutions = best
    if shared.template is None and solutions[0].cost > _expected(seen, model):
        # Two columns of which one is a little higher have no rows, and bend the pose if tied.
        for axes in FEWER if _ties(model) else ():
            other = _settled(seen, model.group.astype(np.intp), found, shared, axes, model)
            best = min(best, other, key=lambda item: item[0])
        if np.count_nonzero(_maybe_oval(seen)) >= OVALS:
            group = best[1].group.astype(np.intp)
            other = _settled(seen, group, best[2], shared, oval=True)
            best = min(best, other, key=lambda item: item[0])
    return best


def _maybe_oval(seen: Observations) -> npt.NDArray[np.bool_]:
    """Which buttons (n,) may be ovals: keyholes are round."""
    ellipses: npt.NDArray[np.bool_] = seen.kind != QUAD
    return ellipses & ~seen.keyhole if len(seen.keyhole) else ellipses


def _settled(
    seen: Observations,
    group: GroupArray,
    found: list[Solution],
    shared: _Shared,
    axes: Sequence[int] = (0, 1),
    instead: Model | None = None,
    *,
    oval: bool = False,
) -> _Scored:
    """Find rows and columns again until they stay, with the buttons' sizes in these groups.

    With `axes` only those are tied, `instead` of what another model ties. `oval`: ellipses are
    taken for ovals.
    """
    base = base_model(seen, group, shared.square, shared.focal_isd)
    base = replace(base, line_c2=shared.line_c2)
    penalty = GROUP_GAIN * (len(base.square_isd) - 1)
    if oval:
        base.oval[group[_maybe_oval(seen)]] = 1
        penalty += OVAL_GAIN
    best: _Scored = (np.inf, base, found)
    starts, tried = found, []
    for _ in range(3):
        tied, extra = _tied(base, starts[0], shared, axes)
        if tied.tie_index.tobytes() in tried:
            break
        tried.append(tied.tie_index.tobytes())
        solutions = _distinct(_solve_tied(seen, tied, starts, extra))
        if not solutions:
            break
        score = solutions[0].cost + penalty
        full = instead or tied
        score += UNTIED * np.count_nonzero(full.tie_index[:, ::2] < 0)
        score += TIED * (_ties(full) - _ties(tied))
        if _mostly_circles(seen):
            score += (_roll(solutions[0].rotation) / UPRIGHT_RAD) ** 2
        best = min(best, (score, tied, solutions), key=lambda item: item[0])
        moved = (solutions[0].rotation * starts[0].rotation).sum() < SAME_TRACE
        starts = solutions
        if not moved:  # rows and columns would be found again as they are
            break
    return best


def _ties(model: Model) -> int:
    """How many buttons lie on rows and columns, but for the one that settles each of them."""
    return int(np.count_nonzero(model.tie_index[:, ::2] >= 0)) - model.latents


def _expected(seen: Observations, model: Model) -> float:
    """About what a solution costs whose rows and columns are some."""
    return float(freedom(seen).sum()) + _ties(model)


def _tied(
    base: Model,
    solution: Solution,
    shared: _Shared,
    axes: Sequence[int],
) -> tuple[Model, FloatArray | None]:
    # The base model may have other groups than the one that was solved: the first will do.
    width = float(np.exp(solution.parameters[FIRST_GROUP : FIRST_GROUP + 2].mean()))
    if shared.template is not None:
        return templated_model(base, solution.xy, width, shared.template)
    return (tied_model(base, solution.xy, width, axes) if shared.aligned else base), None


def _solve_tied(
    seen: Observations,
    model: Model,
    starts: Sequence[Solution],
    latents: FloatArray | None,
) -> list[Solution]:
    """Solve from the optima so far and from the best one's mirror image."""
    best = starts[0]
    scale = float(np.exp(best.parameters[FOCAL]))
    rotations = np.array([s.rotation for s in starts] + [reflected(seen, best.rotation)])
    rotations, parameters, xy = initial_parameters(seen, model, rotations, len(starts), scale)
    for k, start in enumerate(starts):
        xy[k] = start.xy
        parameters[k, FOCAL] = start.parameters[FOCAL]
    first = FIRST_GROUP + 2 * len(model.square_isd)
    if latents is not None:
        parameters[:, first:] = latents
    else:
        member = model.tie_index[:, ::2, None] == np.arange(model.latents)
        count = member.sum(axis=(0, 1))
        parameters[:, first:] = np.einsum("kia,ial->kl", xy, member) / count
    return solve(seen, model, rotations, parameters, xy, tolerance=FINE, max_iterations=STEPS)


def _distinct(solutions: list[Solution]) -> list[Solution]:
    """The finite optima, best first, without repetitions."""
    kept: list[Solution] = []
    for solution in sorted(solutions, key=lambda item: item.cost):
        if solution.cost < np.inf and not any(_same(solution, other) for other in kept):
            kept.append(solution)
    return kept


def _same(one: Solution, other: Solution) -> bool:
    if (one.rotation * other.rotation).sum() < SAME_TRACE:
        return False
    return bool(abs(one.parameters[FOCAL] - other.parameters[FOCAL]) < SAME_FOCAL)


def freedom(seen: Observations) -> FloatArray:
    """Independent residuals (n,) of each button less its two coordinates.

    A quad has eight residuals; an ellipse's eight tangents say five things.
    """
    return np.where(seen.kind == QUAD, 6.0, 3.0)


def excess(seen: Observations, model: Model, cost: float) -> float:
    """How many deviations of χ² a cost is above its expectation."""
    # Besides the rotation each group of quads has two sizes, of circles one.
    round_groups = set(model.group[seen.kind != QUAD].tolist())
    shared = 3 + 2 * len(model.square_isd) - sum(not model.oval[g] for g in round_groups)
    expected = max(float(freedom(seen).sum()) - shared, 1.0)
    return float((cost - expected) / np.sqrt(2 * expected))


def _misfit(solution: Solution, model: Model, seen: Observations) -> float:
    """χ² of the typical button over its expectation."""
    shared = (model.size - 3) / len(solution.chi2)
    return float(middle(solution.chi2 / np.maximum(freedom(seen) - shared, 2.0)))


def _fit(solution: Solution, model: Model, seen: Observations) -> float:
    """As `Adjustment.fit`: the variance of residuals, of which an inverse gamma prior says 1."""
    known_focal = model.focal_isd < 0
    number = KNOWN + max(float(freedom(seen).sum()) - (model.size - known_focal), 0.0)
    total = KNOWN + (number - KNOWN) * _misfit(solution, model, seen)
    found = total / number
    if found < 1:
        found = min(total / _chi2_quantile(number), 1.0)
    return float(min(COMMON + (1 - COMMON) * found, MISFIT))


def _chi2_quantile(freedom: float) -> float:
    """That of `QUANTILE` (Wilson and Hilferty, PNAS 17, 1931)."""
    spread = 2 / (9 * freedom)
    return float(freedom * max(1 - spread + QUANTILE * np.sqrt(spread), 0.0) ** 3)


def _mostly_circles(seen: Observations) -> bool:
    quads = int((seen.kind == QUAD).sum())
    return 2 * quads < len(seen.kind)


def _roll(rotation: FloatArray) -> float:
    """How far the panel's rows are from horizontal in the photo: θ_z of R_x R_y R_z."""
    return float(np.arctan2(rotation[0, 1], rotation[0, 0]))


def _upright_lattices(found: list[Solution], model: Model) -> list[list[Solution]]:
    """Circles do not tell the roll: starts with each that the lattice of centres offers.

    Of a lattice's four rolls the most upright one is taken.
    """
    beginnings = []
    tilts: list[Solution] = []
    for solution in found:
        # Their rolls are arbitrary: only the normals tell optima apart.
        same = any(solution.rotation[2] @ other.rotation[2] > SAME_NORMAL for other in tilts)
        if not same and solution.cost - found[0].cost < OTHER_MODE:
            tilts.append(solution)
    for solution in tilts[:2]:
        turns = lattice_rolls(solution.xy, typical_width(model, solution))
        if not turns:  # one circle: nothing but "upright" is known
            row0, row1 = solution.rotation[:2]
            turns = [float(np.arctan2(-row0[1], row1[1]))]
        for turn in turns:
            quarters = [rotation_z(turn + k * np.pi / 2) for k in range(4)]
            best = min(quarters, key=lambda q: abs(_roll(q @ solution.rotation)))
            upright = replace(
                solution, rotation=best @ solution.rotation, xy=solution.xy @ best[:2, :2].T
            )
            beginnings.append([upright])
    return beginnings


def _other_roll(rotation: FloatArray, tried: list[_Scored]) -> FloatArray | None:
    """Another reading of the lattice that explains about as much, else None.

    A square lattice turned by 90° fits exactly as well; only how upright it is decides.
    """
    for score, _, solutions in tried[1:]:
        apart = angle_between(solutions[0].rotation, rotation)
        if score - tried[0][0] < RIVAL and apart > OTHER_ROLL_RAD:
            return solutions[0].rotation
    turned = [rotation_z(sign * np.pi / 2) @ rotation for sign in (-1.0, 1.0)]
    other = min(turned, key=lambda item: abs(_roll(item)))
    gain = (_roll(other) ** 2 - _roll(rotation) ** 2) / UPRIGHT_RAD**2
    return other if gain < RIVAL else None
