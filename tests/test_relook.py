"""The second look: what is found in the head-on view, back in the photo, beside the first."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fronto
from fronto import (
    Camera,
    Ellipse,
    LineSegment,
    Outline,
    Panel,
    Rectifier,
    RectifierOptions,
    Segments,
    rectify_outlines,
)
from fronto import relook as module
from fronto.outlines import Outlines
from fronto.pose.rotation import rotation_from_angles
from fronto.relook import better, contradicts, look_again
from fronto.results import RectifiedView
from fronto.shapes import FloatArray

COLOUR = (10, 200, 30)
GREY = np.full((480, 640, 3), 100, np.uint8)

Finder = Callable[[RectifiedView], tuple[Sequence[Outline], Sequence[Outline]]]


class Look:
    """Fake stages that find in the view what they are told to, and note what they were shown."""

    def __init__(
        self, patch: pytest.MonkeyPatch, find: Finder, photo: npt.NDArray[np.uint8] = GREY
    ) -> None:
        self.photo, self.find = photo, find
        self.views: list[RectifiedView] = []
        self.shown: list[npt.NDArray[np.uint8]] = []
        warp = fronto.warp_panel

        def warped(*arguments: object, **options: object) -> RectifiedView:
            self.views.append(warp(*arguments, **options))  # type: ignore[arg-type]
            return self.views[-1]

        patch.setattr(module, "warp_panel", warped)

    def segment(self, image: npt.NDArray[np.uint8]) -> Segments:
        self.shown.append(image)
        return Segments(image.shape[1], image.shape[0], ())

    def outline(self, segments: Segments, image: npt.NDArray[np.uint8]) -> Outlines:
        buttons, plates = self.find(self.views[-1])
        return Outlines(segments.width_px, segments.height_px, tuple(buttons), tuple(plates))

    def again(self, panel: Panel, first: Outlines) -> Outlines | None:
        return look_again(self.photo, panel, first, self.segment, self.outline)


@pytest.fixture
def seen(view, grid):
    """Six buttons, tilted, and their panel as of the first look."""
    panel = view(grid(2, 3), (18, -24, 5))
    outlines = tuple(replace(o, std_px=0.5, confidence=0.8) for o in panel.outlines)
    first = Outlines(640, 480, outlines, left_out=("one",), from_image=(1.0,) * 6)
    return panel, rectify_outlines(GREY, outlines, panel.camera), first


def through(matrix: FloatArray, points: npt.ArrayLike) -> FloatArray:
    """Points (..., 2) by a homography."""
    points = np.asarray(points, dtype=float)
    mapped = np.concatenate([points, np.ones((*points.shape[:-1], 1))], axis=-1) @ matrix.T
    return np.asarray(mapped[..., :2] / mapped[..., 2:])


def square(x: float, y: float, side: float = 60.0, **more: object) -> Outline:
    half = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * side / 2
    return Outline.quad(np.add(half, [x, y]), **more)  # type: ignore[arg-type]


def in_view(view: RectifiedView, outline: Outline, **more: object) -> Outline:
    """A quad of a photo without distortion, as it is in the view."""
    corners = through(view.homography, outline.corners_px)
    return replace(outline, corners_px=corners, std_px=0.3, **more)


def scale_at(view: RectifiedView, place: npt.ArrayLike) -> float:
    """Photo pixels per pixel of the view there: by the area of a small square."""
    step = 1e-3 * np.array([[0.0, 0], [1, 0], [1, 1], [0, 1]])
    x, y = through(np.linalg.inv(view.homography), np.asarray(place) + step).T
    area = 0.5 * abs(np.dot(x, np.roll(y, -1)) - np.dot(y, np.roll(x, -1)))
    return float(np.sqrt(area) / 1e-3)


# --- back in the photo


def test_what_is_found_is_mapped_back_exactly(view, grid):
    @settings(derandomize=True, deadline=None, max_examples=12)
    @given(*[st.floats(-35, 35)] * 3, st.floats(250, 390))
    def run(tx, ty, tz, px):
        panel = view(grid(2, 3), (tx, ty, tz), at_px=(px, 240))
        first = Outlines(640, 480, panel.outlines)
        quad = square(150, 130, 50, std_px=0.7, category="up", confidence=0.9, text="A")
        disc = Outline.ellipse(90, 250, 30, 22, 25, std_px=1.3, category="alarm", confidence=0.6)
        plate = square(210, 220, 30, std_px=0.4, category="plate")
        with pytest.MonkeyPatch.context() as patch:
            look = Look(patch, lambda view: ([quad, disc], [plate]))
            found = look.again(rectify_outlines(GREY, panel.outlines, panel.camera), first)
        assert found is not None
        (shown,) = look.views
        back = np.linalg.inv(shown.homography)
        (new,) = [o for o in found.buttons if o.text == "A"]
        np.testing.assert_allclose(new.corners_px, through(back, quad.corners_px), atol=1e-6)
        assert new.std_px == pytest.approx(0.7 * scale_at(shown, (150, 130)), rel=1e-3)
        assert (new.category, new.confidence) == ("up", 0.9)
        (round_one,) = [o for o in found.buttons if o.category == "alarm"]
        # Its points lie on the ellipse of the view again.
        ellipse = round_one.ellipse_px
        on_view = through(shown.homography, ellipse.points(12)) - [90, 250]
        inverse = np.linalg.inv(disc.ellipse_px.shape_matrix)
        level = np.einsum("ki,ij,kj->k", on_view, inverse, on_view)
        np.testing.assert_allclose(level, 1.0, atol=1e-6)
        assert round_one.std_px == pytest.approx(1.3 * scale_at(shown, (90, 250)), rel=1e-3)
        (other,) = found.plates
        np.testing.assert_allclose(other.corners_px, through(back, plate.corners_px), atol=1e-6)
        assert (found.width_px, found.height_px) == (640, 480)

    run()


def test_through_a_lens_with_distortion(view, grid, monkeypatch):
    panel = view(grid(2, 3), (12, -18, 4), at_px=(400, 200), distance_m=0.4)
    camera = Camera.from_matrix(panel.camera.matrix, 640, 480, [-0.2, 0.04, 0.001, -0.001])
    outlines = [replace(o, corners_px=camera.distort_points(o.corners_px)) for o in panel.outlines]
    quad, disc = square(150, 130, 50), Outline.ellipse(90, 250, 30, 22, 25)
    look = Look(monkeypatch, lambda view: ([quad, disc], []))
    found = look.again(
        rectify_outlines(GREY, outlines, camera), Outlines(640, 480, tuple(outlines))
    )
    assert found is not None
    new = [o for o in found.buttons if not any(o is old for old in outlines)]
    (moved,) = [o for o in new if o.corners_px is not None]
    (bent,) = [o for o in new if o.ellipse_px is not None]
    homography = look.views[0].homography
    straight = camera.undistort_points(moved.corners_px)
    np.testing.assert_allclose(through(homography, straight), quad.corners_px, atol=1e-3)
    # Bent by the lens, an ellipse is one but nearly.
    points = through(homography, camera.undistort_points(bent.ellipse_px.points(12))) - [90, 250]
    inverse = np.linalg.inv(disc.ellipse_px.shape_matrix)
    level = np.einsum("ki,ij,kj->k", points, inverse, points)
    np.testing.assert_allclose(level, 1.0, atol=0.02)


# --- what is shown to the stages


def test_buttons_are_shown_upright_and_of_a_good_size(view, grid, monkeypatch):
    for distance, zoomed in ((1.2, True), (0.5, True), (0.12, False)):
        panel = view(grid(1, 3), (18, -24, 25), distance_m=distance)
        photo = np.full((480, 640, 3), COLOUR, np.uint8)
        first = Outlines(640, 480, panel.outlines)
        look = Look(monkeypatch, lambda view: ([], []), photo)
        assert look.again(rectify_outlines(photo, panel.outlines, panel.camera), first) is None
        (shown,), (image,) = look.views, look.shown
        assert image.dtype == np.uint8
        assert image.shape == (shown.height_px, shown.width_px, 3)
        assert image.shape[0] * image.shape[1] <= 640 * 480
        assert (shown.scale > 1) == zoomed
        assert shown.scale <= 3.0 + 1e-9
        corners = through(shown.homography, [o.corners_px for o in panel.outlines])
        width = corners[:, 1] - corners[:, 0]
        assert np.abs(width[:, 1]).max() < 1.0
        assert 20 < width[:, 0].mean() < 90
        # All buttons, and where others may be.
        low, high = corners.min(axis=(0, 1)), corners.max(axis=(0, 1))
        side = width[:, 0].mean()
        assert (low > side).all()
        assert (np.array([shown.width_px, shown.height_px]) - high > side).all()


def test_a_wide_panel_of_small_buttons_is_shown_in_as_many_pixels(view, grid, monkeypatch):
    panel = view(grid(3, 3, pitch_m=0.25), (8, -10, 3), distance_m=0.7)
    first = Outlines(640, 480, panel.outlines)
    look = Look(monkeypatch, lambda view: ([], []))
    look.again(rectify_outlines(GREY, panel.outlines, panel.camera), first)
    (image,) = look.shown
    assert 0.8 < image.shape[0] * image.shape[1] / (640 * 480) <= 1


def test_what_the_photo_does_not_show_looks_like_the_rest(view, grid, monkeypatch):
    # Black corners have edges that a network may take for a button's.
    panel = view(grid(1, 3), (20, -35, 0), at_px=(70, 80))
    photo = np.full((480, 640, 3), COLOUR, np.uint8)
    first = Outlines(640, 480, panel.outlines)
    look = Look(monkeypatch, lambda view: ([], []), photo)
    look.again(rectify_outlines(photo, panel.outlines, panel.camera), first)
    (shown,), (image,) = look.views, look.shown
    empty = shown.image[..., 3] == 0
    assert empty.mean() > 0.02
    assert np.abs(image.astype(int) - COLOUR).max() <= 1


# --- beside what the first look has found


def test_each_find_stands_for_one_button_in_the_first_order(seen, monkeypatch):
    _, result, first = seen
    lost, new_place = 2, (40.0, 40.0)

    def find(view):
        again = [in_view(view, o, confidence=0.95) for o in first.buttons]
        del again[lost]
        return [square(*new_place, 30, text="new"), *again[::-1]], []

    look = Look(monkeypatch, find)
    found = look.again(result, first)
    assert found is not None
    assert len(found.buttons) == 7
    for k, old in enumerate(first.buttons):
        assert found.buttons[k].text == old.text
        # The first look's where it was not found again.
        assert (found.buttons[k] is old) == (k == lost)
    assert found.buttons[6].text == "new"
    # What was left out of the first look is no remark on the second.
    assert (found.left_out, found.from_image) == ((), ())
    # The first look's stay as they were.
    assert len(first.buttons) == 6


def test_a_find_between_two_buttons_stands_for_none_of_them(seen, monkeypatch):
    _, result, first = seen

    def find(view):
        a, b = (in_view(view, first.buttons[k]) for k in (0, 1))
        between = (a.corners_px + b.corners_px) / 2
        return [replace(a, corners_px=between, text="between")], []

    found = Look(monkeypatch, find).again(result, first)
    assert found is not None
    assert [o.text for o in found.buttons] == ["0", "1", "2", "3", "4", "5", "between"]


@pytest.mark.parametrize("surer", [0, 1])
def test_a_button_found_twice_is_taken_once(seen, monkeypatch, surer):
    _, result, first = seen

    def find(view):
        once = in_view(view, first.buttons[0])
        twice = [
            replace(once, text=name, corners_px=once.corners_px + off, confidence=confidence)
            for name, off, confidence in (("a", 1.0, 0.9 - 0.2 * surer), ("b", 2.0, 0.8))
        ]
        return twice, []  # fmt: skip

    found = Look(monkeypatch, find).again(result, first)
    assert found is not None
    assert len(found.buttons) == 6
    (name,) = {o.text for o in found.buttons} & {"a", "b"}
    assert name == "ab"[surer]


def test_no_find_stands_for_two_buttons(view, grid, monkeypatch):
    # Two outlines of one large button in the first look: the second look tells.
    panel = view(grid(2, 3, width_m=0.04), (5, -8, 2))
    near = replace(
        panel.outlines[0], corners_px=np.add(panel.outlines[0].corners_px, [9.0, 0.0]), text="near"
    )
    first = Outlines(640, 480, (*panel.outlines, near))
    result = rectify_outlines(GREY, panel.outlines, panel.camera)

    def find(view):
        return [in_view(view, panel.outlines[0], text="found")], []

    found = Look(monkeypatch, find).again(result, first)
    assert found is not None
    assert [o.text for o in found.buttons] == ["found", "1", "2", "3", "4", "5", "near"]


def test_a_find_that_is_turned_against_the_others_is_dropped(seen, monkeypatch):
    panel, result, first = seen

    def find(view):
        again = [in_view(view, o) for o in first.buttons]
        again[3] = replace(again[3], corners_px=np.roll(again[3].corners_px, 1, axis=0))
        return again, []

    found = Look(monkeypatch, find).again(result, first)
    assert found is not None
    assert [o.text for o in found.buttons] == ["0", "1", "2", "4", "5"]
    # So that they can be solved.
    assert rectify_outlines(GREY, found.buttons, panel.camera).status in ("ok", "uncertain")


def test_plates_are_merged_as_well(seen, monkeypatch):
    _, result, first = seen
    plates = [
        replace(o, corners_px=np.add(o.corners_px, [25.0, 3.0]), category="plate")
        for o in first.buttons
    ]
    first = replace(first, plates=tuple(plates[:2]))

    def find(view):
        button = in_view(view, first.buttons[0], text="again")
        return [button], [in_view(view, plates[k], text=f"plate {k}") for k in (1, 5)]

    found = Look(monkeypatch, find).again(result, first)
    assert found is not None
    assert found.plates[0] is plates[0]
    assert [p.text for p in found.plates[1:]] == ["plate 1", "plate 5"]


def test_lines_of_the_first_look_stay(seen, monkeypatch):
    _, result, first = seen
    line = LineSegment("horizontal", np.array([[10.0, 10.0], [200.0, 20.0]]))
    first = replace(first, lines=(line,))
    look = Look(monkeypatch, lambda view: ([in_view(view, first.buttons[0])], []))
    found = look.again(result, first)
    assert found is not None
    assert found.lines == (line,)


def test_what_lies_outside_the_photo_is_no_find(view, grid, monkeypatch):
    panel = view(grid(1, 3), (20, -35, 0), at_px=(70, 80))
    first = Outlines(640, 480, panel.outlines)

    def outside(shown):
        empty = np.argwhere(shown.image[..., 3] == 0)
        y, x = empty[len(empty) // 2]
        return [square(x, y, 4)], []

    look = Look(monkeypatch, outside)
    assert look.again(rectify_outlines(GREY, panel.outlines, panel.camera), first) is None


def test_nothing_to_look_at(seen, monkeypatch):
    _, result, first = seen
    look = Look(monkeypatch, lambda view: ([in_view(view, first.buttons[0])], []))
    for status in ("degenerate", "no_buttons"):
        assert look.again(replace(result, status=status), first) is None
    assert look.again(result, replace(first, buttons=())) is None
    assert look.shown == []
    # An uncertain pose is worth a look.
    assert look.again(replace(result, status="uncertain"), first) is not None
    # A pose that allows no picture is not.
    edge_on = np.array([[1.0, 0, 0], [0, 0, 1], [0, -1, 0]])
    pose = replace(result.pose, rotation=edge_on)
    assert look.again(replace(result, pose=pose), first) is None


# --- which look is kept


def judged(panel: Panel, status: str, weights: Sequence[float], sigma_px: float | None) -> Panel:
    button = panel.buttons[0]
    return replace(
        panel,
        status=status,
        pose=replace(panel.pose, status=status, sigma_px=sigma_px),
        buttons=tuple(replace(button, id=k, weight=w) for k, w in enumerate(weights)),
    )


SIX, FIVE = [1.0] * 6, [1.0] * 5 + [0.1]
#: First look, second look (status, weights, residuals in pixels), whether it is kept.
CASES = {
    "lower residuals": (("ok", SIX, 0.5), ("ok", SIX, 0.4), True),
    "higher residuals": (("ok", SIX, 0.5), ("ok", SIX, 0.6), False),
    "the same": (("ok", SIX, 0.5), ("ok", SIX, 0.5), False),
    "more that agree": (("ok", FIVE, 0.5), ("ok", SIX, 0.5), True),
    "more that agree, a little looser": (("ok", FIVE, 0.5), ("ok", SIX, 0.53), True),
    "more that agree, but much looser": (("ok", FIVE, 0.5), ("ok", SIX, 0.8), False),
    "fewer that agree": (("ok", SIX, 0.5), ("ok", FIVE, 0.3), False),
    "more buttons, none of which agree": (("ok", SIX, 0.5), ("ok", [*SIX, 0.0, 0.3], 0.5), False),
    "ok at last": (("uncertain", SIX, 0.5), ("ok", SIX, 0.4), True),
    "ok at last, without one": (("uncertain", SIX, 0.5), ("ok", FIVE, 0.5), True),
    "ok at last, without most": (("uncertain", SIX, 0.5), ("ok", [1.0] * 3, 0.3), False),
    "ok at last, but much looser": (("uncertain", SIX, 0.5), ("ok", SIX, 0.8), False),
    "never uncertain for ok": (("ok", FIVE, 0.5), ("uncertain", SIX, 0.1), False),
    "both uncertain": (("uncertain", SIX, 0.5), ("uncertain", SIX, 0.4), True),
    "never without a pose": (("uncertain", FIVE, 0.5), ("degenerate", SIX, 0.1), False),
    "never without buttons": (("uncertain", FIVE, 0.5), ("no_buttons", SIX, 0.1), False),
    "no residuals to compare": (("uncertain", FIVE, None), ("uncertain", SIX, 0.1), False),
    "none of the second": (("uncertain", FIVE, 0.5), ("uncertain", SIX, None), False),
}


@pytest.mark.parametrize("name", CASES)
def test_which_look_is_kept(seen, name):
    _, result, _ = seen
    first, second, kept = CASES[name]
    assert better(judged(result, *second), judged(result, *first)) is kept


# --- in the whole


class Stages:
    """Outlines with noise in the photo; in the head-on view, told by its size, others."""

    def __init__(self, patch: pytest.MonkeyPatch, first: Outlines, find: Finder) -> None:
        self.first = first
        self.look = Look(patch, find)
        self.photos = 0

    def outline(self, segments: Segments, image: npt.NDArray[np.uint8]) -> Outlines:
        if image.shape == GREY.shape:
            self.photos += 1
            return self.first
        return self.look.outline(segments, image)

    def rectifier(self, camera: Camera, **options: object) -> Rectifier:
        return Rectifier(
            RectifierOptions(lines=False, **options),  # type: ignore[arg-type]
            camera=camera,
            segment=self.look.segment,
            outline=self.outline,
        )


@pytest.mark.parametrize("kept", [True, False])
def test_the_better_look_is_the_result(view, grid, monkeypatch, kept):
    exact = view(grid(2, 3), (18, -24, 5))
    noisy = exact.noisy(1, 0.7 if kept else 0.2)
    rng = np.random.default_rng(2)

    def find(shown):
        noise = 0.05 if kept else 2.0
        quads = [in_view(shown, o) for o in exact.outlines]
        return [
            replace(q, corners_px=q.corners_px + rng.normal(0, noise, (4, 2)), text="second")
            for q in quads
        ], []

    first = Outlines(640, 480, noisy.outlines)
    stages = Stages(monkeypatch, first, find)
    panel = stages.rectifier(exact.camera)(GREY)
    assert len(stages.look.shown) == 2
    assert {b.outline.text == "second" for b in panel.buttons} == {kept}
    assert panel.timing_ms["second_look"] > 0
    alone = rectify_outlines(GREY, noisy.outlines, exact.camera, correlation=0.1)
    if kept:
        assert exact.error_deg(panel.pose) < 0.5 * exact.error_deg(alone.pose)
    else:
        np.testing.assert_allclose(panel.pose.rotation, alone.pose.rotation)
    # It can be left out.
    stages.look.shown.clear()
    quick = stages.rectifier(exact.camera, rectified_look=False)(GREY)
    assert len(stages.look.shown) == 1
    np.testing.assert_allclose(quick.pose.rotation, alone.pose.rotation)


def test_a_second_look_that_fails_costs_nothing(view, grid, monkeypatch):
    panel = view(grid(2, 3), (18, -24, 5)).noisy(1, 0.3)
    first = Outlines(640, 480, panel.outlines)

    def refused(shown):
        raise fronto.InputError("view", "expected anything else")

    rectifier = Stages(monkeypatch, first, refused).rectifier(panel.camera)
    found = rectifier(GREY)
    assert found.status in ("ok", "uncertain")
    assert len(found.buttons) == 6


def test_ellipses_and_quads_are_told_apart_when_merged(view, grid, monkeypatch):
    # A round button that the first look took for a square one is round after the second.
    layout = [replace(b, shape="ellipse") if k == 4 else b for k, b in enumerate(grid(2, 3))]
    panel = view(layout, (10, -14, 4))
    squared = list(view(grid(2, 3), (10, -14, 4)).outlines)
    first = Outlines(640, 480, tuple(squared))
    result = rectify_outlines(GREY, squared, panel.camera)

    def find(shown):
        ring = through(shown.homography, panel.outlines[4].ellipse_px.points(64))
        low, high = ring.min(axis=0), ring.max(axis=0)
        (cx, cy), (a, b) = (low + high) / 2, (high - low) / 2
        ellipse = Ellipse(cx, cy, max(a, b), min(a, b), 0.0 if a >= b else 90.0)
        return [Outline("ellipse", ellipse_px=ellipse)], []

    found = Look(monkeypatch, find).again(result, first)
    assert found is not None
    assert [o.shape for o in found.buttons] == ["quad"] * 4 + ["ellipse", "quad"]
    center = found.buttons[4].center_px
    np.testing.assert_allclose(center, panel.outlines[4].center_px, atol=0.1)


# --- two looks that contradict each other


def posed(panel: Panel, degrees: float, std_deg: float, status: str = "ok") -> Panel:
    """The same panel turned by so much, with that deviation about every axis."""
    turn = rotation_from_angles(0.0, np.radians(degrees), 0.0)
    covariance = np.eye(3) * np.radians(std_deg) ** 2
    pose = replace(panel.pose, rotation=turn @ panel.pose.rotation, covariance=covariance)
    pose = replace(pose, status=status, reasons=())
    return replace(panel, status=status, reasons=(), pose=pose)


@pytest.mark.parametrize(
    ("degrees", "std_deg", "expected"),
    [(2.9, 0.1, False), (3.1, 0.1, True), (8.0, 2.0, False), (9.0, 2.0, True), (-9.0, 2.0, True)],
)
def test_looks_contradict_beyond_their_deviations(seen, degrees, std_deg, expected):
    panel = seen[1]
    first = posed(panel, 0.0, std_deg)
    assert contradicts(posed(panel, degrees, std_deg), first) is expected
    # So does one that is not sure of itself, but not one without a rotation.
    assert contradicts(posed(panel, degrees, std_deg, "uncertain"), first) is expected
    assert not contradicts(posed(panel, degrees, std_deg, "degenerate"), first)
    # The focal length and the tilt trade off.
    guessed = replace(first, pose=replace(first.pose, focal_std=0.1))
    assert not contradicts(posed(panel, 30.0, std_deg, "uncertain"), guessed)
    # What is not trusted anyway need not be contradicted.
    assert not contradicts(posed(panel, degrees, std_deg), posed(panel, 0.0, std_deg, "uncertain"))


def test_with_an_estimated_focal_length_what_is_seen_counts(seen):
    panel = seen[1]

    def turned(about: int, degrees: float) -> Panel:
        angles = [0.0, 0.0, 0.0]
        angles[about] = np.radians(degrees)
        other = posed(panel, 0.0, 0.1)
        camera = panel.pose.camera.with_focal(panel.pose.camera.focal_px, 0.1, "estimated")
        rotation = rotation_from_angles(*angles) @ other.pose.rotation
        return replace(
            other, pose=replace(other.pose, rotation=rotation, camera=camera, focal_std=0.1)
        )

    first = turned(2, 0.0)
    # Rows that run elsewhere; a tilt that shows little in them is the focal length's as well.
    assert contradicts(turned(2, 4.0), first)
    assert not contradicts(turned(2, 2.0), first)
    assert contradicts(turned(1, 4.0), replace(first, pose=replace(first.pose, focal_std=0.0)))
    assert not contradicts(turned(1, 4.0), first)


@pytest.mark.parametrize("better_one", [True, False])
def test_a_contradicted_result_is_not_trusted(seen, monkeypatch, better_one):
    _, panel, first = seen
    answers = iter([posed(panel, 0.0, 0.3), posed(panel, 20.0, 0.3)])
    monkeypatch.setattr("fronto.rectifier.look_again", lambda *_: first)
    monkeypatch.setattr("fronto.rectifier.better", lambda again, first: better_one)
    rectifier = Rectifier(
        RectifierOptions(read_labels=False),
        segment=lambda photo: Segments(640, 480, ()),
        outline=lambda segments, photo: first,
        solve=lambda photo, outlines, camera: next(answers),
    )
    found = rectifier(GREY)
    # Whichever of them fits better.
    assert found.status == found.pose.status == "uncertain"
    assert len(found.reasons) == 1
    np.testing.assert_array_equal(found.pose.rotation, panel.pose.rotation)
