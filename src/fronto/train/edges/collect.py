"""From pictures to what these show across outlines whose true edges are known."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from fronto.categories import PLATE
from fronto.engine import Engine
from fronto.grouping import overlaps
from fronto.images import as_rgb
from fronto.outlines import Outlines, outline
from fronto.outlines.edgehead import asked_about
from fronto.outlines.edgeprofiles import Curves, about, profiles
from fronto.outlines.edges import edge_points
from fronto.outlines.fits import intersections
from fronto.outlines.kinds import find_shapes
from fronto.segmentation import segment
from fronto.shapes import Ellipse, FloatArray, Outline
from fronto.synth.photo import PanelPhoto, render_photo
from fronto.train.edges.pool import EdgePool
from fronto.train.shown import found_in

__all__ = ["collect"]

#: Sizes of the renders, pixels.
SIZES = ((640, 480), (640, 480), (800, 600), (960, 720), (1280, 960), (480, 640))
#: Share of them whose buttons and labels may share pills: of one half and of the other.
PILLS = (0.1, 0.2)
#: A button is what its mask's box overlaps by this much, if this much of it is seen.
IS, SEEN = 0.4, 0.98


class Shares(NamedTuple):
    """What is shown.

    Parameters
    ----------
    twins, relief
        Shares of the renders that have plates like buttons, and buttons in relief.
    photos
        Share of the pictures that are photos, where there are any.
    """

    twins: float
    relief: float
    photos: float = 0.0


class Shown(NamedTuple):
    """A picture (h, w, 3), uint8, and the true outlines of its whole buttons; None: unknown."""

    image: npt.NDArray[np.uint8]
    outlines: Sequence[Outline] | None


def collect(
    engine: Engine, shares: Shares, photos: Sequence[Path] = (), *, seed: int
) -> Iterator[EdgePool]:
    """The outlines that are found in one picture after the other, without end.

    Where the edges of photos' buttons are nobody has told exactly. What stands for it are the
    outlines that are found without an edge head, where all of their sides agree with the photo's
    edges: they tell which edges are meant by those who labelled what the network has learned from.

    Parameters
    ----------
    engine
        The network, with its heads, that finds them.
    shares
        What is rendered, and the share of photos.
    photos
        Their files.
    seed
        Of all that is random.

    Raises
    ------
    InputError
        If the network finds nothing at all in picture after picture, or a photo cannot be read.
    """
    rng = np.random.default_rng(seed)

    def pictures() -> Iterator[Shown]:
        while True:
            if photos and rng.random() < shares.photos:
                yield Shown(as_rgb(photos[int(rng.integers(len(photos)))]), None)
                continue
            width, height = SIZES[int(rng.integers(len(SIZES)))]
            photo = render_photo(
                rng,
                width,
                height,
                twins=bool(rng.random() < shares.twins),
                relief=bool(rng.random() < shares.relief),
                pills=float(rng.choice(PILLS)),
            )
            yield Shown(photo.image, _rendered_outlines(photo))

    return found_in(engine, pictures(), lambda shown: _pool(engine, shown))


def _pool(engine: Engine, shown: Shown) -> EdgePool | None:
    segments = segment(shown.image, engine=engine)
    buttons = segments.buttons
    if not buttons:
        return None
    points = edge_points(buttons, segments.width_px, segments.height_px)
    told = [button.forms for button in buttons]
    shapes = find_shapes(points, shown.image, np.array(told) if all(told) else None)
    whole = np.array([not button.truncated for button in buttons])
    asked = asked_about(shapes, points.size, whole)
    if asked is None:
        return None
    rows, curves, is_round = asked
    there = shown.outlines
    if there is None:
        there = _agreeing_outlines(outline(segments, shown.image, lines=False, edges=False))
    true = _true_outlines(there, np.array([buttons[k].box_px for k in rows]))
    with np.errstate(all="ignore"):
        corners = intersections(shapes.quads.lines[rows])
    offsets = np.full((len(rows), curves.xy.shape[1]), np.nan)
    for k, one in enumerate(true):
        if one is None or one.odd or (one.shape == "ellipse") != is_round[k]:
            continue
        own = Curves(curves.xy[k], curves.normal[k], curves.reach[k])
        if one.ellipse_px is not None:
            offsets[k] = _to_ellipse(own, one.ellipse_px)
        elif one.corners_px is not None:
            offsets[k] = _to_quad(own, corners[k], one.corners_px)
    first = np.zeros(len(rows), np.uint8)
    first[0] = 1
    return EdgePool(
        np.rint(profiles(shown.image, curves)).astype(np.uint8),
        about(points.size[rows], points.blur[rows], is_round),
        curves.reach.astype(np.float32),
        (offsets / curves.reach[:, None]).astype(np.float32),
        first,
    )


def _rendered_outlines(photo: PanelPhoto) -> list[Outline]:
    """The buttons of a render of which all is seen."""
    return [
        o.outline
        for o in photo.objects
        if o.category != PLATE and not o.outline.truncated and o.visible > SEEN
    ]


def _agreeing_outlines(found: Outlines) -> list[Outline]:
    """Those found whose sides all follow the photo's edges."""
    pairs = zip(found.buttons, found.from_image, strict=True)
    return [o for o, share in pairs if share == 1 and not o.truncated]


def _true_outlines(seen: Sequence[Outline], boxes: FloatArray) -> Sequence[Outline | None]:
    """Which of these buttons each box (n, 4) is of."""
    if not seen:
        return [None] * len(boxes)
    there = np.array([one.box_px for one in seen])
    shared = [overlaps(box, there) for box in boxes]
    return [seen[int(s.argmax())] if s.max() >= IS else None for s in shared]


def _to_quad(curves: Curves, corners: FloatArray, true: FloatArray) -> FloatArray:
    """How far out of the halves (8,) of a quad's sides the sides of the true one are."""
    turns = [np.roll(true, turn, axis=0) for turn in range(4)]
    quad = min(turns, key=lambda turned: float(((turned - corners) ** 2).sum()))
    along = np.repeat(np.roll(quad, -1, axis=0) - quad, 2, axis=0)[:, None]
    normal = np.stack([along[..., 1], -along[..., 0]], axis=2)
    start = np.repeat(quad, 2, axis=0)[:, None]
    away = ((start - curves.xy) * normal).sum(axis=2) / (curves.normal * normal).sum(axis=2)
    return np.asarray(away.mean(axis=1))


def _to_ellipse(curves: Curves, true: Ellipse) -> FloatArray:
    """How far out of the eighths (8,) of an ellipse the true one is, along their normals."""
    inverse = np.linalg.inv(true.shape_matrix)
    start: npt.NDArray[np.float64] = curves.xy - (true.cx, true.cy)
    a = ((curves.normal @ inverse) * curves.normal).sum(axis=2)
    b = ((start @ inverse) * curves.normal).sum(axis=2)
    c = ((start @ inverse) * start).sum(axis=2) - 1
    with np.errstate(invalid="ignore"):  # one that passes it by
        away = (-b + np.sqrt(b * b - a * c)) / a
    return np.asarray(away.mean(axis=1))
