"""(b) A lattice fit to the buttons' centres: grid-EM style, after Zhu et al. 2019.

"Autonomous Removal of Perspective Distortion for Robotic Elevator Button Recognition" (arXiv
1912.11774): a Gaussian mixture fits a grid to the recognised buttons, whose centres then give the
camera's motion. Only the abstract was available, so this is its idea and not its algorithm.

Centres lie on a lattice of the panel's plane, origin + (i p_x, j p_y), up to isotropic Gaussian
noise; an outlier lies anywhere. The noise is one of pixels, and each node's share of the mixture
is its cell's share of the picture. So a likelihood is a density over pixels, whatever the scale of
the plane: neither shrinking the plane nor a finer lattice is a gain in itself.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from fronto.pose.rotation import angle_between, rotation_exp
from scenes import Case, FloatArray
from ways.answer import Answer

#: Tilts to start from: degrees off the frontal view, and how many directions of each.
STARTS = ((0.0, 1), (20.0, 8), (40.0, 12), (57.0, 16))
#: How many starts are tried, for so many iterations, and how many of them are followed: those
#: that differ.
TRIED, SKETCH, FOLLOWED, ITERATIONS = 12, 2, 4, 25
SAME_DEG = 3.0
#: A neighbour to the right or below is seen within so many degrees of that direction.
CONE_DEG = 35.0
#: Standard deviation of a centre: at least so many pixels (a smaller one would reward chance fits
#: of few centres), at most so much of a cell's side.
LEAST_STD_PX, MOST_STD = 0.5, 0.15
#: A larger one asks whether one centre is the reason.
GOOD_STD_PX = 1.0
#: Share of outliers: at least, at first, at most.
FEWEST, OUTLIERS, MOST = 0.02, 0.1, 0.4
#: Depth of a ray in the panel's frame, relative to its depth in the camera's: below it, the
#: centre is about on the panel's horizon.
LEAST_DEPTH = 0.1
MOST_TILT_DEG = 75.0
AROUND = np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1]), axis=-1).reshape(1, 9, 2)


@dataclass(frozen=True, eq=False)
class _Fit:
    """The mixture's parameters, and whom each centre belongs to.

    `origin`, `pitch`: (2,), on the panel's plane at depth 1. `node`: (n, 2), mean index of each
    centre's nodes; `share`: (n,), probability that it is no outlier.
    """

    rotation: FloatArray
    origin: FloatArray
    pitch: FloatArray
    node: FloatArray
    share: FloatArray
    std_px: float
    outliers: float = OUTLIERS
    likelihood: float = -np.inf


def _plane(R: FloatArray, rays: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Points (n, 2) of rays on the plane, and the rays' depth there (n,)."""
    turned = rays @ R.T
    depth = np.maximum(turned[:, 2], LEAST_DEPTH)
    return turned[:, :2] / depth[:, None], depth


def _lattice(
    points: FloatArray, depth: FloatArray, node: FloatArray, share: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Origin and pitches, by least squares in closed form.

    A pixel is about depth^-1.5 long on the plane: hence the weights.
    """
    weight = share * depth**3
    total = weight.sum()
    mean_n, mean_q = weight @ node / total, weight @ points / total
    off = node - mean_n
    spread = np.maximum(weight @ off**2, 1e-12)
    pitch = weight @ (off * (points - mean_q)) / spread
    return mean_q - pitch * mean_n, pitch


def _off_px(R: FloatArray, rays: FloatArray, nodes: FloatArray, focal: float) -> FloatArray:
    """From the centres to the images of points of the plane: (n, ..., 2), pixels."""
    seen = nodes @ R[:2] + R[2]
    depth = np.maximum(seen[..., 2:], LEAST_DEPTH)
    at = rays[:, :2].reshape(len(rays), *[1] * (nodes.ndim - 2), 2)
    return np.asarray(focal * (seen[..., :2] / depth - at))


def _neighbours(points: FloatArray, axis: int) -> list[tuple[int, int]]:
    """Each point with the nearest to its right (axis 0) or below it (1)."""
    step = points[None] - points[:, None]
    along, across = step[..., axis], np.abs(step[..., 1 - axis])
    ahead = (along > 0) & (across < np.tan(np.radians(CONE_DEG)) * along)
    length = np.where(ahead, np.hypot(along, across), np.inf)
    return [(i, int(row.argmin())) for i, row in enumerate(length) if np.isfinite(row).any()]


def _best_cell(R: FloatArray, rays: FloatArray, focal: float) -> tuple[float, _Fit] | None:
    """Start from the cell, spanned by a centre and two neighbours, on whose lattice most lie.

    The camera is rolled by what the cell's sides are on average.
    """
    points, depth = _plane(R, rays)
    down = _neighbours(points, 1)
    cells = [
        (points[at], points[k] - points[i], points[m] - points[j])
        for i, k in _neighbours(points, 0)
        for j, m in down
        for at in {i, k} & {j, m}
    ]
    if not cells:
        return None
    origin, right, below = (np.array(part) for part in zip(*cells, strict=True))
    roll = (np.arctan2(right[:, 1], right[:, 0]) - np.arctan2(below[:, 0], below[:, 1])) / 2
    c, s = np.cos(roll), np.sin(roll)
    upright = np.stack([c, s, -s, c], axis=1).reshape(-1, 2, 2)
    pitch = np.stack([c * right[:, 0] + s * right[:, 1], c * below[:, 1] - s * below[:, 0]], axis=1)
    index = (points - origin[:, None]) @ upright.transpose(0, 2, 1) / pitch[:, None]
    off = (index - np.rint(index)) * pitch[:, None]
    area = np.prod(pitch, axis=1)
    square = (off**2).sum(axis=2) / area[:, None]
    inside = np.exp(-square / (2 * MOST_STD**2)) / (2 * np.pi * MOST_STD**2)
    scores = np.log((1 - OUTLIERS) * inside + OUTLIERS).sum(axis=1)
    best = int(scores.argmax())
    std = MOST_STD * focal * float(np.sqrt(area[best] * np.median(depth) ** 3))
    rolled = R.copy()
    rolled[:2] = upright[best] @ R[:2]
    at = upright[best] @ origin[best]
    fit = _Fit(rolled, at, pitch[best], index[best], np.ones(len(rays)), std)
    return float(scores[best]), fit


def _expect(fit: _Fit, rays: FloatArray, focal: float) -> _Fit:
    """Responsibilities of the nodes about each centre, and the likelihood."""
    points, depth = _plane(fit.rotation, rays)
    nodes = np.rint((points - fit.origin) / fit.pitch)[:, None] + AROUND
    square = (_off_px(fit.rotation, rays, fit.origin + nodes * fit.pitch, focal) ** 2).sum(axis=2)
    cell = np.abs(np.prod(fit.pitch)) * focal**2 * depth**3
    # All densities times the picture's area: an outlier's is 1.
    std = np.minimum(fit.std_px, MOST_STD * np.sqrt(cell))
    peak = (1 - fit.outliers) * cell / (2 * np.pi * std**2)
    joint = peak[:, None] * np.exp(-square / (2 * std[:, None] ** 2))
    total = joint.sum(axis=1) + fit.outliers
    each = joint / total[:, None]
    share = each.sum(axis=1)
    return replace(
        fit,
        node=(each[..., None] * nodes).sum(axis=1) / np.maximum(share, 1e-12)[:, None],
        share=share,
        std_px=max(LEAST_STD_PX, float(np.sqrt((each * square).sum() / (2 * share.sum() + 1e-9)))),
        outliers=float(np.clip(1 - share.mean(), FEWEST, MOST)),
        likelihood=float(np.log(total).sum()),
    )


def _turn(fit: _Fit, rays: FloatArray, focal: float) -> _Fit:
    """The rotation by robust least squares, the lattice following in closed form."""
    from scipy.optimize import least_squares

    used = fit.share > 1e-3
    seen, node, share = rays[used], fit.node[used], fit.share[used]
    root = np.sqrt(share)[:, None] / fit.std_px

    def residuals(turn: FloatArray) -> FloatArray:
        R = fit.rotation @ rotation_exp(turn)
        origin, pitch = _lattice(*_plane(R, seen), node, share)
        return np.asarray((root * _off_px(R, seen, origin + node * pitch, focal)).ravel())

    found = least_squares(residuals, np.zeros(3), loss="soft_l1", max_nfev=8, x_scale=0.1)
    R = fit.rotation @ rotation_exp(found.x)
    origin, pitch = _lattice(*_plane(R, rays), fit.node, fit.share)
    return replace(fit, rotation=R, origin=origin, pitch=pitch)


def _iterated(fit: _Fit, rays: FloatArray, focal: float, iterations: int) -> _Fit | None:
    """Expectation and maximisation by turns; None where nothing sensible is left."""
    for _ in range(iterations):
        before = fit.rotation
        fit = _expect(fit, rays, focal)
        if not _spans(fit):
            return None
        fit = _turn(fit, rays, focal)
        if not _sensible(fit, rays):
            return None
        if angle_between(before, fit.rotation) < 1e-6:
            break
    return _expect(fit, rays, focal)


def _spans(fit: _Fit) -> bool:
    """Whether two rows and two columns have two nodes each that centres belong to."""
    nodes = np.unique(np.rint(fit.node[fit.share > 0.5]), axis=0)
    return all(
        (np.unique(nodes[:, axis], return_counts=True)[1] >= 2).sum() >= 2 for axis in (0, 1)
    )


def _sensible(fit: _Fit, rays: FloatArray) -> bool:
    """Whether the centres are on a plane in front of the camera, that is not seen edge-on."""
    return bool(
        fit.rotation[2, 2] > np.cos(np.radians(MOST_TILT_DEG))
        and (rays @ fit.rotation[2]).min() > LEAST_DEPTH
        and fit.pitch.min() > 0
    )


def _different(fits: list[_Fit]) -> list[_Fit]:
    """The first few whose rotations differ."""
    kept: list[_Fit] = []
    for fit in fits:
        apart = (angle_between(fit.rotation, other.rotation) for other in kept)
        if all(angle > np.radians(SAME_DEG) for angle in apart):
            kept.append(fit)
    return kept[:FOLLOWED]


def _tight(fit: _Fit, rays: FloatArray, focal: float) -> _Fit | None:
    """Once more with little noise at first: strays that the noise has grown to include drop out."""
    tight = replace(fit, std_px=LEAST_STD_PX, outliers=OUTLIERS)
    return _iterated(tight, rays, focal, ITERATIONS)


def _each_out(fit: _Fit) -> list[_Fit]:
    """With one of its centres left out at first, each in turn."""
    members = np.flatnonzero(fit.share > 0.5)
    return [
        replace(fit, share=np.where(np.arange(len(fit.share)) == k, 0, fit.share)) for k in members
    ]


def fit_lattice(rays: FloatArray, focal_px: float) -> FloatArray | None:
    """The rotation (3, 3) under which the rays (n, 3) of centres fall on a lattice, or None."""
    starts = []
    for tilt, directions in STARTS:
        for k in range(directions):
            towards = 2 * np.pi * (k + 0.5) / directions
            turn = np.radians(tilt) * np.array([np.cos(towards), np.sin(towards), 0.0])
            start = _best_cell(rotation_exp(turn), rays, focal_px)
            if start is not None:
                starts.append(start)
    starts.sort(key=lambda start: -start[0])
    tried = [_iterated(fit, rays, focal_px, SKETCH) for _, fit in starts[:TRIED]]
    fits: list[_Fit] = []
    for sketch in _different(sorted((f for f in tried if f), key=lambda f: -f.likelihood)):
        fit = _iterated(sketch, rays, focal_px, ITERATIONS)
        fits += [f for f in (fit, _tight(fit or sketch, rays, focal_px)) if f]
    best = max(fits, key=lambda fit: fit.likelihood, default=None)
    while best is not None and best.std_px > GOOD_STD_PX:
        others = [_tight(_turn(one, rays, focal_px), rays, focal_px) for one in _each_out(best)]
        other = max((f for f in others if f), key=lambda f: f.likelihood, default=best)
        if other.likelihood <= best.likelihood:
            break
        best = other
    return None if best is None else best.rotation


def grid_em(case: Case) -> Answer:
    """From the boxes' centres, as a detector gives them."""
    centers = np.array([s.center_px for s in case.segments.buttons]).reshape(-1, 2)
    if len(centers) < 4:
        return Answer(case.camera, reason="fewer than four centres: no lattice")
    rays = case.camera.rays(centers)
    rotation = fit_lattice(rays[np.isfinite(rays).all(axis=1)], case.camera.focal_px)
    if rotation is None:
        return Answer(case.camera, reason="no two rows and two columns: a degenerate lattice")
    return Answer(case.camera, rotation)
