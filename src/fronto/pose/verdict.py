"""Whether a refined pose can be trusted, and if not, why, in words.

The thresholds are chosen so that in the project's simulation no pose called ok is
grossly wrong (``benchmarks/pose.py`` measures it): a wrong button is worse than none.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from fronto.pose.bundle import FOCAL, QUAD, Model, Observations, Solution
from fronto.pose.refine import CONTRADICTION, RIVAL, Adjustment, excess
from fronto.pose.rotation import rotation_log
from fronto.pose.starts import middle
from fronto.pose.template import contradictions
from fronto.results import Status
from fronto.shapes import FloatArray

__all__ = ["Verdict", "covariance", "fitted", "judge", "line_weights", "weights"]

#: Largest standard deviation of the rotation about any axis that is still trusted.
OK_STD_RAD = np.radians(2.5)
#: Where lines agree: they check the buttons, and their deviations allow for trims that slant.
OK_STD_LINED_RAD, FEW_LINES = np.radians(4.0), 2
#: The same with the focal length unknown: the angles are less sure than the picture is.
OK_STD_UNKNOWN_FOCAL_RAD = np.radians(6.0)
#: Beyond this the outlines do not determine the rotation.
DETERMINED_STD_RAD = np.radians(15.0)
#: With outlines set aside on a small panel, setting aside others may explain as much: a
#: second optimum is excluded only if it costs this much more.
RIVAL_WITH_OUTLIERS = 40.0
SMALL_PANEL = 4
#: So many lines that agree with the buttons make up for there being few of them.
ENOUGH_LINES = 4
#: They make up for an unknown focal length, too, where they hold the rotation to this.
LINED_STD_RAD = np.radians(3.0)
#: A round button by itself may be an oval one: so many lines of either axis, which make a vanishing
#: point, show that it is none.
CIRCLE_LINES = 2
#: Two buttons leave so little to spare that noise alone now and then prefers a wrong pose.
RIVAL_OF_TWO = 15.0
#: Squared deviations (three degrees of freedom) that the covariance speaks for.
COVERED = 14.0
#: Weight below which an outline counts as set aside.
SET_ASIDE = 0.5
#: Where outlines may have the wrong shape (a blurred square looks round, a round button in a
#: square bezel square), others have to hold the rotation better than this ...
MIXED_STD_RAD = np.radians(1.5)
#: ... which is so where both shapes have this share of the buttons, and more than one.
MIXED_SHARE = 0.25
#: Residuals larger than this share of the button's size: no flat panel fits.
BAD_FIT = 0.07
#: The same where lines hold the rotation: what the outlines miss may be anything.
BAD_FIT_HELD = 0.2
#: So do residuals this many times the stated deviations.
BAD_FACTOR = 5.0
#: Rolls beyond this are more likely a wrong corner order or a photo to be turned.
ROLLED_RAD = np.radians(45.0)
#: A focal length less sure than this (standard deviation of ln f) has not been observed ...
FOCAL_OBSERVABLE = 0.15
#: ... which is harmless as long as squares would still come out square.
OK_ASPECT_STD = 0.05


@dataclass(frozen=True)
class Verdict:
    """Status, why, and which optima rival the best one (indices of solutions)."""

    status: Status
    reasons: tuple[str, ...]
    rivals: tuple[int, ...]


def weights(adjustment: Adjustment, solution: Solution) -> FloatArray:
    """Weight (n,) of each outline in the robust loss: 1 = counts in full."""
    model = adjustment.model
    excess = np.maximum(solution.chi2 - model.button_knee, 0.0)
    return np.asarray(1.0 / (1.0 + excess / model.button_c2))


def line_weights(adjustment: Adjustment, solution: Solution) -> FloatArray:
    """Weight (l,) of each line in the robust loss: 1 = fits, towards 0 = set aside."""
    seen = adjustment.seen
    toward = solution.rotation[seen.axis]
    p, q = seen.segment[:, :2], seen.segment[:, 2:]
    # From the segment's middle to its vanishing point, as in native/bundle_model.c.
    u = np.exp(solution.parameters[FOCAL]) * toward[:, :2] - 0.5 * (p + q) * toward[:, 2:]
    d = 0.5 * (p - q)
    across = (d[:, 0] * u[:, 1] - d[:, 1] * u[:, 0]) / np.maximum(np.hypot(*u.T), 1e-12)
    r = np.sqrt(2) * seen.line_isd * across
    return np.asarray(1.0 / (1.0 + r**2 / adjustment.model.line_c2))


def covariance(solution: Solution, model: Model) -> FloatArray:
    """Covariance (m, m) of the global parameters: w of R·exp([w]x) in radians, ln f, ...

    Inverse of the robustly weighted JᵀJ with everything else eliminated (Triggs et al.
    2000, section 6). ln f has zero variance where the focal length is known; all is NaN
    where the rotation is not determined.
    """
    scale = 1.0 / np.sqrt(solution.hessian.diagonal())
    whiten = scale * scale[:, None]
    try:
        inverse = np.linalg.inv(solution.hessian * whiten) * whiten
    except np.linalg.LinAlgError:
        return np.full(solution.hessian.shape, np.nan)
    if model.focal_isd < 0:
        inverse[FOCAL] = inverse[:, FOCAL] = 0.0
    positive = FOCAL if model.focal_isd < 0 else FOCAL + 1
    if not (np.isfinite(inverse).all() and (inverse.diagonal()[:positive] > 0).all()):
        return np.full(solution.hessian.shape, np.nan)
    return np.asarray(0.5 * (inverse + inverse.T))


def fitted(cov: FloatArray, adjustment: Adjustment) -> FloatArray:
    """A covariance (m, m), ln f and what errs with it as they are, the rest as residuals show.

    Errors that buttons make alike show in no residuals, and no residual says how well ln f was
    known before.
    """
    if cov[FOCAL, FOCAL] > 0:
        by_focal = np.outer(cov[:, FOCAL], cov[FOCAL]) / cov[FOCAL, FOCAL]
        return np.asarray(adjustment.fit * (cov - by_focal) + by_focal)
    return np.asarray(adjustment.fit * cov)


def rotation_std(solution: Solution, cov: FloatArray) -> tuple[float, float]:
    """Largest deviation of the rotation about any axis, radians: as it is, and at a given f.

    An unknown focal length and the tilt trade off along poses that rectify alike.
    """
    if not np.isfinite(cov).all():
        return np.inf, np.inf
    std = float(np.sqrt(max(np.linalg.eigvalsh(cov[:3, :3])[-1], 0.0)))
    if cov[FOCAL, FOCAL] == 0:
        return std, std
    # Conditioning a Gaussian on its last variable.
    given = cov[:3, :3] - np.outer(cov[:3, FOCAL], cov[:3, FOCAL]) / cov[FOCAL, FOCAL]
    return std, float(np.sqrt(max(np.linalg.eigvalsh(given)[-1], 0.0)))


def judge(
    adjustment: Adjustment,
    cov: FloatArray,
    size_px: FloatArray,
    missed_px: float,
    aspect_std: float | None,
) -> Verdict:
    """Weigh the best solution.

    Parameters
    ----------
    cov
        (m, m): its covariance, see `covariance`.
    size_px
        (n,): size of each button in the photo.
    missed_px
        By how much the middle one of the buttons misses the model.
    aspect_std
        Deviation of ln(width/height) of the rectified quads, None without quads.
    """
    best = adjustment.solutions[0]
    n = len(best.chi2)
    weight = weights(adjustment, best)
    aside = int((weight < SET_ASIDE).sum())
    small = n - aside <= SMALL_PANEL
    conflict = small and (aside > 0 or _contradictory(adjustment))
    kinds = set(adjustment.seen.kind.tolist())
    split = small and len(adjustment.model.square_isd) > len(kinds)
    limit = RIVAL_WITH_OUTLIERS if conflict or split else RIVAL_OF_TWO if n <= 2 else RIVAL
    limit *= adjustment.common
    std, std_given_focal = rotation_std(best, cov)
    held = std_given_focal <= OK_STD_RAD and _held(adjustment, best)
    # Of one button the mirrored pose is always told, unless lines tell it apart.
    rivals = tuple(
        k
        for k, other in enumerate(adjustment.solutions[1:], 1)
        if (n == 1 and not held)
        or (
            other.cost - best.cost < limit
            and not _covered(other.rotation, best.rotation, cov / adjustment.fit)
        )
    )
    if not std < DETERMINED_STD_RAD:
        return Verdict("degenerate", (_undetermined(n),), rivals)

    lone_circle = n == 1 and QUAD not in kinds and adjustment.model.scale_latent < 0
    reasons = []
    if n == 1 and not len(adjustment.seen.axis):
        reasons.append("one button only: its tilt to one side and to the other look alike")
    elif lone_circle and _fewer_lines(adjustment, best) < CIRCLE_LINES:
        reasons.append("one round button only: an oval one may look like it from elsewhere")
    elif rivals:
        reasons.append("two poses fit about as well: tilted to one side or to the other")
    if adjustment.model.scale_latent >= 0:
        reasons += contradictions(adjustment.model, best)
    if adjustment.other_roll is not None and not held:
        reasons.append("round buttons whose rows and columns cannot be told apart")
    agreeing = _agreeing_lines(adjustment, best)
    enough = OK_STD_LINED_RAD if agreeing >= FEW_LINES else OK_STD_RAD
    if std_given_focal > enough or std > OK_STD_UNKNOWN_FOCAL_RAD:
        reasons.append(
            f"rotation known to ±{np.degrees(std):.1f}° only: the buttons are too small in the "
            "photo, too few or too near to frontal"
        )
    elif std_given_focal > MIXED_STD_RAD and _mixed(adjustment.seen):
        reasons.append(
            f"buttons seen as round beside buttons seen as square, and the rotation known to "
            f"±{np.degrees(std_given_focal):.1f}° only: some may have been taken for the other"
        )
    shows = cov[FOCAL, FOCAL] <= FOCAL_OBSERVABLE**2
    if not shows and aspect_std is not None and aspect_std > OK_ASPECT_STD:
        off = 100 * aspect_std
        reasons.append(f"the focal length does not show: the aspect may be off by {off:.0f} %")
    focal_isd = adjustment.model.focal_isd  # weighed up by the common errors, as lines are
    focal_std = np.sqrt(adjustment.common) / focal_isd if focal_isd > 0 else 0.0
    lined = std_given_focal <= OK_STD_RAD and agreeing >= ENOUGH_LINES
    if n <= SMALL_PANEL and focal_std > FOCAL_OBSERVABLE and not (lined and std <= LINED_STD_RAD):
        reasons.append("the focal length is not known, and too few buttons to tell it")
    few = n == 2 or split or QUAD not in kinds
    if n > 1 and not held and (n - aside < 2 or (conflict and few)):
        reasons.append("the outlines contradict each other and are too few to tell which is wrong")
    elif aside > n / 3 and n > 2:
        reasons.append(f"{aside} of {n} outlines do not lie on one plane with the others")
    elif (
        not (small or lined) and adjustment.sigma_factor > 1 and _above(adjustment) > CONTRADICTION
    ):
        reasons.append("the outlines do not fit one flat panel of such buttons in rows and columns")
    missed = missed_px / float(middle(size_px))
    bad_fit = missed > BAD_FIT or adjustment.sigma_factor > BAD_FACTOR
    if bad_fit and not (held and missed < BAD_FIT_HELD):
        reasons.append(
            f"the outlines miss a flat panel by {missed_px:.1f} px: wrong outlines"
            + (", a wrong template" if adjustment.model.scale_latent >= 0 else "")
            + " or no plane"
        )
    if abs(np.arctan2(best.rotation[0, 1], best.rotation[0, 0])) > ROLLED_RAD:
        reasons.append(
            "the panel appears rolled by more than 45°: wrong corner order, or a photo to be turned"
        )
    return Verdict("uncertain" if reasons else "ok", tuple(reasons), rivals)


def _agreeing_lines(adjustment: Adjustment, solution: Solution) -> int:
    if not len(adjustment.seen.axis):
        return 0
    return int((line_weights(adjustment, solution) > SET_ASIDE).sum())


def _fewer_lines(adjustment: Adjustment, solution: Solution) -> int:
    """How many lines agree along the rows or along the columns, whichever are fewer."""
    if not len(adjustment.seen.axis):
        return 0
    agree = adjustment.seen.axis[line_weights(adjustment, solution) > SET_ASIDE]
    down = int(agree.sum())
    return min(down, len(agree) - down)


def _held(adjustment: Adjustment, solution: Solution) -> bool:
    """Whether lines alone hold the rotation: enough that agree, and some of either axis.

    Two vanishing points do so where the focal length is known.
    """
    if not len(adjustment.seen.axis) or adjustment.model.focal_isd > 0:
        return False
    enough = _agreeing_lines(adjustment, solution) >= ENOUGH_LINES
    return enough and _fewer_lines(adjustment, solution) > 0


def _mixed(seen: Observations) -> bool:
    """Whether there are both round and square ones among the buttons; keyholes are round."""
    kind = seen.kind[~seen.keyhole] if len(seen.keyhole) else seen.kind
    fewer = min(int((kind == QUAD).sum()), int((kind != QUAD).sum()))
    return fewer > 1 and fewer >= MIXED_SHARE * len(kind)


def _covered(rotation: FloatArray, best: FloatArray, cov: FloatArray) -> bool:
    """Whether the stated deviations allow for this rotation anyway."""
    block = cov[:FOCAL, :FOCAL]
    if not np.isfinite(block).all() or np.linalg.eigvalsh(block)[-1] > DETERMINED_STD_RAD**2:
        return False
    w = rotation_log(best.T @ rotation)
    return bool(w @ np.linalg.solve(block, w) < COVERED)


def _contradictory(adjustment: Adjustment) -> bool:
    """Whether something does not fit, be it an outline or a row."""
    return _above(adjustment) > CONTRADICTION or adjustment.sigma_factor > 1


def _above(adjustment: Adjustment) -> float:
    return excess(adjustment.seen, adjustment.model, adjustment.solutions[0].cost)


def _undetermined(n: int) -> str:
    if n == 1:
        return "one button does not determine the rotation"
    return "the outlines do not determine the rotation"
