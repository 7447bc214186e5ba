"""Rendered buttons that stand out of the panel, or lie in it: their faces are where they say."""

from __future__ import annotations

import math
from dataclasses import replace

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from fronto.camera import Camera
from fronto.pose.rotation import rotation_from_angles
from fronto.shapes import FloatArray
from fronto.synth.photo import PanelPhoto, render_photo
from fronto.synth.photo.buttons import LAMP_END, WIDE, Wardrobe, lifted
from fronto.synth.photo.forms import Form, contour
from fronto.synth.photo.plan import Element, Label, Plan
from fronto.synth.photo.render import _with_depth, _with_lamp, composed, draw_plans
from fronto.synth.photo.style import PLAIN, ButtonStyle, PlateStyle, in_relief
from fronto.synth.photo.surfaces import Material
from fronto.synth.photo.truth import found
from fronto.synth.photo.view import View, to_photo

CAMERA = Camera.from_matrix([[500, 0, 319.5], [0, 500, 239.5], [0, 0, 1]], 640, 480)
BLACK = Material("painted", (0, 0, 0), 0.0)
PLATE = PlateStyle((255, 255, 255), (0, 0, 0), 0.1, 0, 1, 0)
FORMS = (
    Form("box", 30, 30),
    Form("box", 40, 24, 5),
    Form("ellipse", 30, 30),
    Form("ellipse", 40, 26),
    Form("octagon", 30, 30),
    Form("up", 34, 30),
)


def view_of(angles: tuple[float, float, float], distance: float = 0.35) -> View:
    rotation = rotation_from_angles(*np.radians(angles))
    return View(CAMERA, rotation, rotation @ [0.01, -0.02, distance])


def eye_of(view: View) -> tuple[float, float, float]:
    """The camera is at -translation: x and y on the panel, and how far before it, millimetres."""
    x, y, z = 1000 * view.translation
    return -float(x), -float(y), float(z)


def seen(view: View, points: FloatArray) -> FloatArray:
    """Points (n, 3) in metres, whose z grows away from the camera, to photo pixels."""
    rays = (points + view.translation) @ view.rotation @ view.camera.matrix.T
    assert (rays[:, 2] > 0).all()
    return np.asarray(rays[:, :2] / rays[:, 2:])


def element(x: float, y: float, form: Form) -> Element:
    return Element(x, y, form, "number", "", Label())


class TestLifted:
    @settings(derandomize=True, deadline=None, max_examples=150)
    @given(
        st.tuples(st.floats(-45, 45), st.floats(-45, 45), st.floats(-180, 180)),
        st.floats(0.15, 2),
        st.floats(-80, 80),
        st.floats(-80, 80),
        st.sampled_from(FORMS),
        st.floats(-0.9, 1.5),
    )
    def test_a_face_is_seen_where_its_points_are(
        self,
        angles: tuple[float, float, float],
        distance: float,
        x: float,
        y: float,
        form: Form,
        height: float,
    ) -> None:
        view = view_of(angles, distance)
        eye = eye_of(view)
        tall = height * min(form.width, form.height)
        assume(tall < 0.45 * eye[2])
        flat = contour(form) + np.array([x, y])
        face = np.column_stack([flat, np.full(len(flat), -tall)]) / 1000
        # Neither on the plane nor at the face's height a point is behind the camera.
        foot = np.column_stack([flat, np.zeros(len(flat))]) / 1000
        depths = [((p + view.translation) @ view.rotation)[:, 2].min() for p in (face, foot)]
        assume(min(depths) > 0.05)
        up = lifted(element(x, y, form), replace(PLAIN, height=height), eye)
        drawn = to_photo(view, (contour(up.form) + np.array([up.x, up.y])) / 1000)
        expected = seen(view, face)
        scale = max(1.0, np.abs(expected).max() / 1000)
        assert np.abs(drawn - expected).max() < 1e-6 * scale

    def test_by_hand(self) -> None:
        # From 400 mm, what is 100 mm nearer is seen 4/3 as large and as far from the camera's foot.
        up = lifted(element(60, -30, Form("box", 50, 80, 6)), replace(PLAIN, height=2), (0, 0, 400))
        assert (up.x, up.y) == pytest.approx((80, -40))
        assert up.form == Form("box", *(pytest.approx(v * 4 / 3) for v in (50, 80, 6)))
        # And what lies 100 mm deeper: 4/5.
        down = replace(PLAIN, height=-2)
        deep = lifted(element(60, -30, Form("box", 50, 80, 6)), down, (10, 20, 400))
        assert (deep.x, deep.y) == pytest.approx((50, -20))
        assert deep.form.width == pytest.approx(40)

    def test_what_it_is_stays(self) -> None:
        flush = element(3, 4, FORMS[1])
        up = lifted(flush, replace(PLAIN, height=0.3), (0.0, 0.0, 300.0))
        assert replace(up, x=3, y=4, form=FORMS[1]) == flush
        assert lifted(flush, PLAIN, (0.0, 0.0, 300.0)) == flush
        far = lifted(flush, replace(PLAIN, height=0.3), (0.0, 0.0, math.inf))
        assert (far.x, far.y, far.form.width) == (3, 4, 40)

    def test_never_up_to_the_camera(self) -> None:
        up = lifted(element(10, 0, FORMS[0]), replace(PLAIN, height=30), (0.0, 0.0, 300.0))
        assert up.x == pytest.approx(20)


def wardrobe(style: ButtonStyle, eye: tuple[float, float, float]) -> Wardrobe:
    """White faces without any light on what is beside them."""
    return Wardrobe((style,), PLAIN, PLAIN, PLATE, (0, 0), (0, 0, 0), eye)


def drawn(
    style: ButtonStyle, view: View, elements: tuple[Element, ...], seed: int = 0
) -> tuple[npt.NDArray[np.uint8], list[Element]]:
    plan = Plan((-120, -90, 120, 90), elements, (), 30)
    canvas, given = draw_plans(
        np.random.default_rng(seed), (plan,), view, BLACK, wardrobe(style, eye_of(view))
    )
    return composed(canvas, np.zeros((480, 640, 3), np.uint8), view), given


def area_and_centroid(polygon: FloatArray) -> tuple[float, FloatArray]:
    x, y = polygon.T
    x2, y2 = np.roll(polygon, -1, axis=0).T
    cross = x * y2 - x2 * y
    area = cross.sum() / 2
    return area, np.array([((x + x2) * cross).sum(), ((y + y2) * cross).sum()]) / (6 * area)


def perimeter(polygon: FloatArray) -> float:
    return float(np.hypot(*(np.roll(polygon, -1, axis=0) - polygon).T).sum())


@pytest.mark.parametrize("form", FORMS, ids=lambda form: f"{form.kind}-{form.radius:g}")
@pytest.mark.parametrize("height", [0.35, -0.1])
@pytest.mark.parametrize("angles", [(0, 0, 0), (25, -20, 10), (-30, 30, -15)])
def test_faces_are_drawn_on_their_outlines(
    form: Form, height: float, angles: tuple[float, float, float]
) -> None:
    """Only faces are bright here: neither their sides nor their holes."""
    view = view_of(angles)
    spots = [(-60.3, -40.7), (41.1, -33.9), (-50.9, 37.7), (55.5, 44.4)]
    elements = tuple(element(*at, form) for at in spots)
    style = replace(PLAIN, height=height, wall=0.0)
    photo, given = drawn(style, view, elements)
    image = photo[..., 0] / 255.0
    objects = found(given, view, None)
    assert len(objects) == len(spots)
    rows, columns = np.indices(image.shape)
    moved = []
    for item, face, flush in zip(objects, given, elements, strict=True):
        near = np.zeros(image.shape, np.uint8)
        cv2.fillPoly(near, [np.rint(item.polygon_px).astype(np.int32)], (1,))
        # A thin grey line remains along a foot's edge: hardly any of it is this near.
        white = image * cv2.dilate(near, np.ones((5, 5), np.uint8))
        area, centroid = area_and_centroid(item.polygon_px)
        middle = np.array([(columns * white).sum(), (rows * white).sum()]) / white.sum()
        assert abs(white.sum() - area) / perimeter(item.polygon_px) < 0.2
        assert np.abs(middle - centroid).max() < 0.2
        inner = np.where(cv2.erode(near, np.ones((5, 5), np.uint8)) > 0, image, 1)
        assert inner.min() > 0.9
        # What is drawn on has whole pixels: the face is where it is to be seen, to half of one.
        tall = height * min(form.width, form.height)
        at = seen(view, np.array([[flush.x, flush.y, -tall], [flush.x, flush.y, 0]]) / 1000)
        own = to_photo(view, np.array([[face.x, face.y]]) / 1000)[0]
        assert np.hypot(*(own - at[0])) < 0.7
        moved.append(np.hypot(*(own - at[1])))
    assert np.median(moved) > (2 if height > 0 else 0.5)


def brightness(photo: npt.NDArray[np.uint8], view: View, point: FloatArray) -> float:
    u, v = np.rint(seen(view, point[None] / 1000)[0]).astype(int)
    return float(photo[v - 1 : v + 2, u - 1 : u + 2, 0].mean())


def test_from_the_side_one_sees_sides() -> None:
    form = Form("box", 40, 40)
    view = view_of((0, 35, 0), 0.3)
    style = replace(PLAIN, height=0.5, wall=0.4)
    photo, _ = drawn(style, view, (element(0, 0, form),))
    eye = eye_of(view)
    assert abs(eye[0]) > 100
    side = math.copysign(1, eye[0])
    face, far = np.array([0, 0, -20.0]), np.array([-22 * side, 0, 0.0])
    flank = np.array([20 * side, 0, -10.0])  # half way up what is turned to the camera
    assert brightness(photo, view, face) > 250
    assert 70 < brightness(photo, view, flank) < 140
    assert brightness(photo, view, flank + np.array([6 * side, 0, 10])) < 10
    # On the other side the face hides it all, and some of the panel.
    assert brightness(photo, view, far) > 250


def test_all_of_a_face_in_a_hole_is_seen() -> None:
    form = Form("box", 40, 40)
    view = view_of((0, 35, 0), 0.3)
    style = replace(PLAIN, height=-0.12, wall=1.0, collar_color=(120.0, 120.0, 120.0))
    photo, (given,) = drawn(style, view, (element(0, 0, form),))
    polygon = to_photo(view, (contour(given.form) + np.array([given.x, given.y])) / 1000)
    near = np.zeros(photo.shape[:2], np.uint8)
    cv2.fillPoly(near, [np.rint(polygon).astype(np.int32)], (1,))
    inside = cv2.erode(near, np.ones((5, 5), np.uint8)) > 0
    assert photo[inside].min() > 250
    # Around it is the hole, which is neither face nor panel, and then the panel.
    hole = (photo[..., 0] > 20) & (photo[..., 0] < 150)
    assert hole.sum() > 100
    # It reaches as far beyond the button as the face has moved, so that no edge hides any of it.
    edge = 20 + math.hypot(given.x, given.y)
    (left, right), middle = (
        to_photo(view, np.array(points) / 1000)
        for points in ([(-edge, 0.0), (edge, 0.0)], [(0.0, 0.0)])
    )
    columns = np.flatnonzero(photo[round(middle[0, 1]), :, 0] > 20)
    assert (columns[0], columns[-1]) == (
        pytest.approx(left[0], abs=1.5),
        pytest.approx(right[0], abs=1.5),
    )
    # The farther wall is seen: the face has moved to the side where the camera is.
    around = np.nonzero(hole)[1].mean() - np.nonzero(inside)[1].mean()
    assert np.sign(around) == np.sign(middle[0, 0] - polygon[:, 0].mean())


@pytest.mark.parametrize("ring", [False, True])
def test_what_is_around_a_button_covers_no_other(ring: bool) -> None:
    """Holes and rings lie in the panel: they reach below what is beside them."""
    form = Form("box", 40, 40)
    view = view_of((0, 0, 0), 0.4)
    around = {"label_ring": 0.4} if ring else {"hole": 0.4, "height": -0.01}
    style = replace(PLAIN, collar_color=(90.0, 90.0, 90.0), line_color=(90.0, 90.0, 90.0))
    photo, both = drawn(
        replace(style, wall=1.0, **around), view, (element(-24, 0, form), element(24, 0, form))
    )
    for face in both:
        polygon = to_photo(view, (contour(face.form) + np.array([face.x, face.y])) / 1000)
        near = np.zeros(photo.shape[:2], np.uint8)
        cv2.fillPoly(near, [np.rint(polygon).astype(np.int32)], (1,))
        assert photo[cv2.erode(near, np.ones((5, 5), np.uint8)) > 0].min() > 250
    # It is there on all sides: 16 mm wide.
    for x in (-54, 0, 54):
        assert 20 < brightness(photo, view, np.array([x, 0.0, 0.0])) < 130
    for x in (-66, 66):
        assert brightness(photo, view, np.array([x, 0.0, 0.0])) < 10


@pytest.mark.parametrize("height", [0.0, 0.3])
def test_a_ring_with_words_is_no_part_of_a_button(height: float) -> None:
    form = Form("ellipse", 40, 40)
    view = view_of((0, 0, 0), 0.4)
    style = replace(PLAIN, height=height, wall=0.0, line_color=(120.0, 120.0, 120.0))
    bare, (plain,) = drawn(style, view, (element(0, 0, form),))
    photo, (given,) = drawn(replace(style, label_ring=0.3), view, (element(0, 0, form),))
    assert given == plain
    across = [np.array([x, 0.0, 0.0]) for x in (0, 26, 38)]
    assert [round(brightness(bare, view, point)) for point in across] == [255, 0, 0]
    levels = [brightness(photo, view, point) for point in across]
    assert levels[0] == 255
    assert 90 < levels[1] < 150
    assert levels[2] < 10


class TestLamp:
    """The same button with and without a lamp."""

    VIEW = view_of((0, 0, 0), 0.3)
    GREY = replace(PLAIN, collar_color=(120.0, 120.0, 120.0), label_share=0.5)
    LONG = Form("box", 60, 30)

    def changed(
        self, first: tuple[ButtonStyle, Element], second: tuple[ButtonStyle, Element]
    ) -> tuple[npt.NDArray[np.bool_], Element]:
        """Where one button is seen to differ from another one with the same outline."""
        (photo, (given,)), (other, (same,)) = (
            drawn(style, self.VIEW, (button,)) for style, button in (first, second)
        )
        assert (given.x, given.y, given.form) == (same.x, same.y, same.form)
        return np.asarray((photo != other).any(axis=2)), given

    def extent(self, spots: npt.NDArray[np.bool_], given: Element) -> FloatArray:
        """Least and greatest x and y of spots, from the button's middle, in shares of its sides."""
        at = np.array([given.x, given.y]) / 1000
        sides = np.array([given.form.width, given.form.height]) / 1000
        middle, corner = to_photo(self.VIEW, np.stack([at, at + sides]))
        places = (np.argwhere(spots)[:, ::-1] - middle) / (corner - middle)
        return np.asarray([places.min(axis=0), places.max(axis=0)])

    @pytest.mark.parametrize("height", [0.0, 0.3])
    @pytest.mark.parametrize("font", [0, 1])
    @pytest.mark.parametrize("right", [False, True])
    def test_it_is_at_one_end(self, right: bool, font: int, height: float) -> None:
        flush = replace(self.GREY, font=font, height=height)
        style = replace(flush, lamp=0.4, lamp_right=right)
        button = element(2, 3, self.LONG)
        low, high = self.extent(*self.changed((style, button), (flush, button)))
        near, far = low[0], high[0]
        if not right:
            near, far = -far, -near
        assert 0.5 - LAMP_END - 0.02 < near < far < 0.52
        # As high as stated, or a ring's own width and two pixels more, in the middle.
        assert 0.36 < high[1] - low[1] < 0.52
        assert abs(high[1] + low[1]) < 0.06

    @pytest.mark.parametrize("lit", [False, True])
    def test_it_is_lit_as_the_button_is(self, lit: bool) -> None:
        style = replace(self.GREY, lamp=0.4, lit_part="symbol")
        photo, (given,) = drawn(style, self.VIEW, (replace(element(0, 0, self.LONG), lit=lit),))
        at = np.array([[given.x + (0.5 - LAMP_END / 2) * given.form.width, given.y]]) / 1000
        u, v = np.rint(to_photo(self.VIEW, at)[0]).astype(int)
        assert photo[v, u].tolist() == list(style.light if lit else style.collar_color)

    @pytest.mark.parametrize("right", [False, True])
    def test_the_label_is_beside_it(self, right: bool) -> None:
        style = replace(self.GREY, lamp=0.4, lamp_right=right)
        bare = element(0, 0, self.LONG)
        label = replace(bare, label=Label("OPEN"))
        low, high = self.extent(*self.changed((style, label), (style, bare)))
        near, far = (-high[0], -low[0]) if right else (low[0], high[0])
        assert -0.5 + LAMP_END - 0.02 < near < far < 0.5
        assert near + far == pytest.approx(LAMP_END, abs=0.05)
        # Without a lamp it is in the middle, and has room to be wider.
        dark = replace(style, lamp=0.0)
        low, high = self.extent(*self.changed((dark, label), (dark, bare)))
        assert abs(low[0] + high[0]) < 0.05
        assert high[0] - low[0] > 1.2 * (far - near)

    @pytest.mark.parametrize(
        "form",
        [FORMS[0], FORMS[2], FORMS[4], Form("box", 30 * WIDE, 30), Form("box", 30, 60)],
        ids=["square", "disc", "octagon", "hardly wide", "tall"],
    )
    def test_only_wide_buttons_have_one(self, form: Form) -> None:
        style = replace(self.GREY, lamp=0.4)
        button = replace(element(0, 0, form), label=Label("OPEN"))
        assert not self.changed((style, button), (self.GREY, button))[0].any()

    def test_some_styles_have_one(self) -> None:
        rng = np.random.default_rng(0)
        plain = replace(PLAIN, label_share=0.6)
        styles = [_with_lamp(rng, plain) for _ in range(300)]
        with_it = [s for s in styles if s.lamp]
        assert 60 < len(with_it) < 120
        assert all(0.15 <= s.lamp <= 0.45 and s.label_share <= 0.5 for s in with_it)
        assert 0.5 < np.mean([s.lamp_right for s in with_it]) < 0.9
        assert {s for s in styles if not s.lamp} == {plain}


class TestStyles:
    def test_out_in_and_flush(self) -> None:
        rng = np.random.default_rng(0)
        styles = [in_relief(rng, PLAIN, 0.1) for _ in range(300)]
        heights = np.array([s.height for s in styles])
        for some in (heights > 0, heights < 0, heights == 0):
            assert some.sum() > 15
        assert (heights > 0).sum() > 130
        assert heights.max() < 1
        assert heights[heights != 0].min() >= -0.1
        assert all(s == PLAIN for s in styles if s.height == 0)
        assert all((s.hole > 0) == (s.height < 0) for s in styles)
        same = [replace(s, height=0.0, hole=0.0, wall=PLAIN.wall) for s in styles]
        assert set(same) == {PLAIN}

    def test_what_has_no_hole(self) -> None:
        rng = np.random.default_rng(1)
        assert min(in_relief(rng, PLAIN, 0.0).height for _ in range(100)) == 0

    def test_of_a_panel(self) -> None:
        view = view_of((10, 20, 30))
        flush = wardrobe(PLAIN, (0.0, 0.0, math.inf))
        mixed = [_with_depth(np.random.default_rng(k), flush, view) for k in range(40)]
        for w in mixed:
            assert w.eye == pytest.approx(eye_of(view))
            assert 0.1 <= w.mushroom.height <= 0.7
            assert w.key.height >= 0
            assert w.key.label_ring == 0 or 0.2 <= w.key.label_ring <= 0.6
            assert w.plate == flush.plate
        assert 10 < sum(w.key.label_ring > 0 for w in mixed) < 30
        assert {s.label_ring for w in mixed for s in (*w.buttons, w.mushroom)} == {0}
        assert {s.lamp for w in mixed for s in (w.key, w.mushroom)} == {0}
        assert 4 < sum(w.buttons[0].lamp > 0 for w in mixed) < 20
        assert min(w.buttons[0].height for w in mixed) < 0 < max(w.key.height for w in mixed)


def equal(first: PanelPhoto, second: PanelPhoto) -> bool:
    return (
        np.array_equal(first.image, second.image)
        and len(first.objects) == len(second.objects)
        and all(
            np.array_equal(a.polygon_px, b.polygon_px)
            and (a.text, a.visible) == (b.text, b.visible)
            for a, b in zip(first.objects, second.objects, strict=True)
        )
    )


SEEDS = range(12)


@pytest.fixture(scope="module")
def pairs() -> list[tuple[PanelPhoto, PanelPhoto]]:
    """The same seeds without relief and with it."""
    return [
        (
            render_photo(np.random.default_rng(seed), 200, 150),
            render_photo(np.random.default_rng(seed), 200, 150, relief=True),
        )
        for seed in SEEDS
    ]


def test_without_relief_all_is_as_before(
    pairs: list[tuple[PanelPhoto, PanelPhoto]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Nothing more is drawn from the generator, and nothing is lifted."""

    def never(*_: object) -> None:
        raise AssertionError

    names = ("_with_depth", "in_relief", "_with_lamp", "lifted", "_stamp", "_draw_lamp")
    for k, name in enumerate(names):
        monkeypatch.setattr(f"fronto.synth.photo.{'render' if k < 3 else 'buttons'}.{name}", never)
    # Nor is room left for a lamp on any button.
    monkeypatch.setattr("fronto.synth.photo.buttons._has_lamp", lambda *_: False)
    for seed, (plain, _) in zip(SEEDS, pairs, strict=True):
        rng = np.random.default_rng(seed)
        assert equal(render_photo(rng, 200, 150, relief=False), plain)


def test_flush_styles_draw_the_same_wherever_the_camera_is() -> None:
    view = view_of((20, -10, 5))
    elements = tuple(element(x, 0, FORMS[1]) for x in (-60, 0, 60))
    plan = Plan((-120, -90, 120, 90), elements, (), 30)
    canvases = [
        draw_plans(np.random.default_rng(0), (plan,), view, BLACK, wardrobe(PLAIN, eye))
        for eye in ((0.0, 0.0, math.inf), eye_of(view))
    ]
    assert np.array_equal(canvases[0][0].rgb, canvases[1][0].rgb)
    assert canvases[0][1] == canvases[1][1]


def test_with_relief_a_seed_gives_the_same_again(
    pairs: list[tuple[PanelPhoto, PanelPhoto]],
) -> None:
    for seed, (_, raised) in zip(SEEDS, pairs, strict=True):
        again = render_photo(np.random.default_rng(seed), 200, 150, relief=True)
        assert equal(again, raised)


def test_with_relief_the_panel_is_the_same_but_faces_are_elsewhere(
    pairs: list[tuple[PanelPhoto, PanelPhoto]],
) -> None:
    changed = 0
    for plain, raised in pairs:
        assert np.array_equal(plain.rotation, raised.rotation)
        assert np.array_equal(plain.translation, raised.translation)
        assert np.array_equal(plain.camera.matrix, raised.camera.matrix)
        changed += not equal(plain, raised)
        texts = [{o.text for o in photo.objects} for photo in (plain, raised)]
        assert not texts[0] or texts[0] & texts[1]
    assert changed > 0.7 * len(pairs)


def test_most_buttons_stand_out_and_are_seen_a_little_larger(
    pairs: list[tuple[PanelPhoto, PanelPhoto]],
) -> None:
    ratios = []
    for plain, raised in pairs:
        flush = {(o.category, o.text): area_and_centroid(o.polygon_px)[0] for o in plain.objects}
        if len(flush) < len(plain.objects):
            continue  # which is which, is not sure
        for item in raised.objects:
            before = flush.get((item.category, item.text))
            if before is not None:
                ratios.append(area_and_centroid(item.polygon_px)[0] / before)
    scales = np.sqrt(ratios)
    assert len(scales) > 50
    assert 1 < np.median(scales) < 1.05
    assert scales.max() > 1.03
    assert 0.9 < scales.min() < 1


@pytest.mark.parametrize("size", [(96, 128), (333, 217), (32, 32)])
def test_any_seed_runs(size: tuple[int, int]) -> None:
    for seed in range(20):
        photo = render_photo(np.random.default_rng(500 + seed), *size, relief=True)
        assert photo.image.shape == (size[1], size[0], 3)
        for item in photo.objects:
            assert np.isfinite(item.polygon_px).all()
            assert item.visible >= 0.25
