"""A second look: segment and outline the head-on view, and take what is found to the photo.

A network sees buttons best that are upright, of one size and large enough; once a first pose is
known, the photo can be shown to it like that.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from fronto.errors import InputError
from fronto.outlines import Outlines
from fronto.outlines.agreement import at_odds, doubles
from fronto.pose.guided import axis_direction, wrapped
from fronto.pose.rotation import angle_between
from fronto.results import Panel, RectifiedView
from fronto.segments import Segments
from fronto.shapes import FloatArray, Outline
from fronto.warp import map_ellipse, map_points, warp_panel

__all__ = ["better", "contradicts", "look_again"]

#: Pixels of the view that is looked at, as the network takes them; buttons are not drawn larger
#: than this, nor the photo enlarged more than this.
PIXELS, BUTTON_PX, MOST_SCALE = 640 * 480, 80.0, 3.0
#: Around the buttons, in button sides: others, not found yet, lie near.
MARGIN = 1.5
#: A find whose centre lies within this many half sides of another's is the same button.
SAME = 0.7
#: An outline counts as agreeing with the panel above this weight.
AGREES = 0.5
#: Residuals that are this much larger are paid for by more buttons that agree.
PAID = 1.1
#: So they are by a status that is "ok" now, where at least this share of the buttons still agrees.
CLEARED = 0.75
#: Two looks contradict each other where their rotations differ by this many of their deviations
#: together, and by this many degrees. Where the focal length is estimated along, it and the tilt
#: trade off along poses that rectify alike: rows and columns have to be seen so far apart.
APART, APART_DEG = 3.0, 3.0

Photo = npt.NDArray[np.uint8]


def look_again(
    photo: Photo,
    panel: Panel,
    outlines: Outlines,
    segment: Callable[[Photo], Segments],
    outline: Callable[[Segments, Photo], Outlines],
) -> Outlines | None:
    """Find the buttons in a head-on view of a panel.

    Parameters
    ----------
    photo
        Shape (h, w, 3), uint8, RGB.
    panel
        Of the first look.
    outlines
        What it rests on.
    segment, outline
        The stages.

    Returns
    -------
    Outlines in the photo's pixels: those found now, and those of the first look that were not
    found again. None where there is no pose to look with, or nothing is found.
    """
    if panel.status not in ("ok", "uncertain") or not outlines.buttons:
        return None
    sizes = [np.sqrt(np.prod(_sides(o))) for o in outlines.buttons]
    try:
        view = _view(photo, panel, min(MOST_SCALE, BUTTON_PX / float(np.median(sizes))))
    except InputError:  # an edge-on panel allows no picture
        return None
    shown = _filled(view)
    found = outline(segment(shown), shown)
    buttons = _in_photo(view, found.buttons, photo.shape)
    if not buttons:
        return None
    plates = _in_photo(view, found.plates, photo.shape)
    return replace(
        outlines,
        buttons=_merged(buttons, outlines.buttons),
        plates=_merged(plates, outlines.plates),
        left_out=(),
        from_image=(),
    )


def better(again: Panel, first: Panel) -> bool:
    """Whether the second look's residuals improve on the first's."""
    if again.status not in ("ok", "uncertain"):
        return False
    if again.status == "uncertain" and first.status == "ok":
        return False
    before, after = first.pose.sigma_px, again.pose.sigma_px
    if before is None or after is None:
        return False
    agreed = [sum(b.weight > AGREES for b in p.buttons) for p in (first, again)]
    cleared = again.status == "ok" and first.status != "ok" and agreed[1] >= CLEARED * agreed[0]
    if agreed[1] > agreed[0] or cleared:
        return after <= PAID * before
    return agreed[1] == agreed[0] and after < before


def contradicts(again: Panel, first: Panel) -> bool:
    """Whether another look tells another rotation than one that is sure of itself.

    It may be less sure; but where the focal length is estimated along, it has to be as sure.
    """
    estimated = first.pose.focal_std > 0
    if first.status != "ok" or again.status not in ("ok", *([] if estimated else ["uncertain"])):
        return False
    if estimated:
        return _seen_apart(again, first) > math.radians(APART_DEG)
    apart = angle_between(again.pose.rotation, first.pose.rotation)
    variance = sum(float(np.linalg.eigvalsh(p.pose.covariance)[-1]) for p in (again, first))
    return apart > max(APART * math.sqrt(variance), math.radians(APART_DEG))


def _seen_apart(again: Panel, first: Panel) -> float:
    """Angle between the rows, or columns, of two poses in the photo, at the median button."""
    places = np.array([button.outline.center_px for button in first.buttons])
    off = []
    for axis in range(2):
        here, there = (
            axis_direction(p.pose, p.pose.rotation, places, axis) for p in (again, first)
        )
        off.append(np.abs(wrapped(here - there)))
    return float(np.median(np.max(off, axis=0)))


def _sides(outline: Outline) -> FloatArray:
    x0, y0, x1, y1 = outline.box_px
    return np.array([x1 - x0, y1 - y0])


def _view(photo: Photo, panel: Panel, scale: float) -> RectifiedView:
    return warp_panel(
        photo,
        panel.pose.camera,
        panel.pose,
        margin=MARGIN,
        scale=scale,
        max_pixels=PIXELS,
        resampling="linear" if scale >= 1 else "auto",
    )


def _filled(view: RectifiedView) -> Photo:
    """The view without alpha; what the photo does not show has the view's mean colour."""
    rgb = np.array(view.image[..., :3])
    empty = view.image[..., 3] == 0
    if empty.any() and not empty.all():
        rgb[empty] = rgb[~empty].mean(axis=0).astype(np.uint8)
    return rgb


def _in_photo(
    view: RectifiedView, outlines: Sequence[Outline], shape: tuple[int, ...]
) -> list[Outline]:
    """Outlines of a view in the photo's pixels; those that have no image there are left out."""
    found = []
    for o in outlines:
        if o.truncated:  # by the view's border, not the photo's
            continue
        near = map_points(view, o.center_px + np.array([[0, 0], [1, 0], [0, 1]]), inverse=True)
        center, across, down = near
        (ax, ay), (bx, by) = across - center, down - center
        factor = float(np.sqrt(abs(ax * by - ay * bx)))
        inside = (center >= 0).all() and center[0] < shape[1] and center[1] < shape[0]
        if not (np.isfinite(near).all() and factor > 0 and inside):
            continue
        try:
            if o.ellipse_px is not None:
                moved = replace(o, ellipse_px=map_ellipse(view, o.ellipse_px, inverse=True))
            else:
                corners = map_points(view, o.corners_px, inverse=True)  # type: ignore[arg-type]
                moved = replace(o, corners_px=corners)
        except InputError:
            continue
        form = None if o.form_std_px is None else o.form_std_px * factor
        found.append(replace(moved, std_px=o.std_px * factor, form_std_px=form))
    return found


def _merged(again: Sequence[Outline], first: Sequence[Outline]) -> tuple[Outline, ...]:
    """All of the second look, in the first's order where both have a button, then the others.

    Those that contradict the others are left out.
    """
    left = list(again)
    merged = []
    for old in first:
        same = [new for new in left if _is_same(new, old)]
        if same:
            left = [new for new in left if new is not same[0]]
        merged.append(same[0] if same else old)
    merged += left
    for wrong in (doubles, at_odds):
        out = wrong(merged)
        merged = [o for k, o in enumerate(merged) if k not in out]
    return tuple(merged)


def _is_same(one: Outline, other: Outline) -> bool:
    off = np.abs(one.center_px - other.center_px)
    return bool((off < SAME * np.minimum(_sides(one), _sides(other)) / 2).all())
