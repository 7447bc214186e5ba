"""The contact sheet shows every step of any result, in tiles that show what they say."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fronto
from fronto import Camera, Outline, Panel, PanelPose, Segments
from fronto.draw_residuals import FITS, RED, draw_residuals, residuals
from fronto.draw_segments import COLORS
from fronto.draw_steps import ADDED, DROPPED, draw_steps
from fronto.draw_tiles import GAP, TILE_WIDTH, TITLE, Window
from fronto.errors import InputError
from fronto.outlines import Outlines
from fronto.pose import estimate_pose
from fronto.results import Button
from fronto.shapes import LineSegment
from test_warp import BARREL, PAPER_CAMERA, make_pose

WIDTH, HEIGHT = 640, 480
ALL = Window((0, 0, WIDTH, HEIGHT), WIDTH, HEIGHT)
RINGS = ((300.0, 120.0), (300.0, 220.0), (300.0, 320.0))


class Scene:
    """A panel, from its outlines: the photo, masks, and everything that follows from them."""

    def __init__(self, outlines: list[Outline], camera: Camera = PAPER_CAMERA, **pose: Any):
        size = (camera.height_px, camera.width_px)
        self.photo = np.full((*size, 3), (150, 145, 140), np.uint8)
        masks = np.zeros((len(outlines), *size), np.uint8)
        for mask, outline in zip(masks, outlines, strict=True):
            points = (
                outline.corners_px if outline.ellipse_px is None else outline.ellipse_px.points()
            )
            cv2.fillPoly(mask, [np.rint(points).astype(np.int32)], 1)  # type: ignore[arg-type]
            self.photo[mask > 0] = (220, 225, 230)
        names = [outline.category for outline in outlines]
        self.segments = Segments.from_masks(masks.astype(bool), names)
        if not outlines:
            self.segments = Segments(size[1], size[0], ())
        self.outlines = Outlines(size[1], size[0], tuple(outlines))
        self.panel = fronto.rectify_outlines(self.photo, outlines, camera, **pose)

    def sheet(self, **changes: Any) -> np.ndarray:
        given = {"panel": self.panel, "outlines": self.outlines, "segments": self.segments}
        given |= changes
        photo = given.pop("photo", self.photo)
        return draw_steps(photo, **given)


def quads(shift: float = 0.0, count: int = 6, category: str = "number") -> list[Outline]:
    """Buttons in two columns, seen at an angle; `shift` moves every other one, pixels."""
    rotation = make_pose(PAPER_CAMERA, (10, 25, 4)).rotation
    middle = rotation[:2, 2] / rotation[2, 2]  # of the photo
    result = []
    for k in range(count):
        x, y = middle + np.array([0.3 * (k % 2) - 0.25, 0.3 * (k // 2) - 0.4])
        square = np.array([[x, y], [x + 0.2, y], [x + 0.2, y + 0.2], [x, y + 0.2]])
        corners = PAPER_CAMERA.project(np.column_stack([square, np.ones(4)]) @ rotation)
        offset = np.array([[0, 0], [shift, 0], [0, -shift], [shift, shift]]) * (k % 2)
        result.append(Outline.quad(corners + offset, std_px=0.3, category=category))
    return result


def rings(count: int = 3) -> list[Outline]:
    return [Outline.ellipse(x, y, 30, 24, 20, std_px=0.3, category="up") for x, y in RINGS[:count]]


def tile(sheet: np.ndarray, number: int) -> np.ndarray:
    """The tile 1 to 9, without its title."""
    height = (sheet.shape[0] - GAP) // 3
    top = GAP + (number - 1) // 3 * height + TITLE
    left = GAP + (number - 1) % 3 * (TILE_WIDTH + GAP)
    return sheet[top : top + height - TITLE - GAP, left : left + TILE_WIDTH]


def titles(sheet: np.ndarray) -> list[np.ndarray]:
    height = (sheet.shape[0] - GAP) // 3
    return [
        sheet[GAP + k // 3 * height :, GAP + k % 3 * (TILE_WIDTH + GAP) :][:TITLE, :TILE_WIDTH]
        for k in range(9)
    ]


def window_of(scene: Scene) -> Window:
    boxes = [s.box_px for s in scene.segments]
    boxes += [o.box_px for o in scene.outlines.buttons if not o.truncated]
    return Window.around(boxes, scene.segments.width_px, scene.segments.height_px)


def is_close(pixels: np.ndarray, color: Any, reach: int = 60) -> np.ndarray:
    return np.abs(pixels.astype(int) - np.array(color)).max(axis=-1) <= reach


def near(picture: np.ndarray, point: np.ndarray, reach: int = 2) -> np.ndarray:
    x, y = np.rint(point).astype(int)
    return picture[y - reach : y + reach + 1, x - reach : x + reach + 1].reshape(-1, 3)


@pytest.fixture(scope="module")
def scene() -> Scene:
    return Scene(quads(shift=0.6))


def test_nine_titled_tiles_of_one_size(scene: Scene) -> None:
    assert scene.panel.status == "ok"
    photo = scene.photo.copy()
    sheet = scene.sheet()
    np.testing.assert_array_equal(scene.photo, photo)
    assert sheet.dtype == np.uint8
    assert sheet.shape[1] == 3 * TILE_WIDTH + 4 * GAP
    height = (sheet.shape[0] - 4 * GAP) / 3 - TITLE
    assert height == window_of(scene).height
    assert 360 <= height <= 600
    for title in titles(sheet):
        assert (title > 200).any()
        assert (title[:, -80:] == title[0, -1]).all()
    tiles = [tile(sheet, k) for k in range(1, 10)]
    for k, one in enumerate(tiles):
        assert len(np.unique(one[..., 1])) > 3
        assert not any(np.array_equal(one, other) for other in tiles[:k])


def test_the_same_input_gives_the_same_sheet(scene: Scene) -> None:
    np.testing.assert_array_equal(scene.sheet(), scene.sheet())


@pytest.mark.parametrize("status", ["ok", "uncertain", "degenerate", "no_buttons"])
def test_every_status_is_shown(scene: Scene, status: Any) -> None:
    reasons = () if status == "ok" else ("rotation known to ±3.1° only: too few buttons",)
    pose = replace(scene.panel.pose, status=status, reasons=reasons)
    panel = replace(scene.panel, status=status, reasons=reasons, pose=pose)
    if status in ("degenerate", "no_buttons"):
        panel = replace(panel, view=None)
    sheet = scene.sheet(panel=panel)
    same = np.array_equal(sheet, scene.sheet())
    assert same == (status == "ok")
    view = tile(sheet, 8).astype(int)
    if status == "uncertain":  # framed in a warning's colour
        assert (view[0] == view[0, 0]).all()
        assert view[0, 0, 0] > view[0, 0, 2] + 50
    if status in ("degenerate", "no_buttons"):
        # Neither a view nor residuals are there; what was found still is.
        assert np.ptp(view, axis=2).max() < 10
        assert not is_close(tile(sheet, 7), FITS, 30).any()
        np.testing.assert_array_equal(tile(sheet, 6), tile(scene.sheet(), 6))


def test_nothing_found_is_said() -> None:
    scene = Scene([])
    assert scene.panel.status == "no_buttons"
    sheet = scene.sheet()
    whole = Window.around([], WIDTH, HEIGHT)
    assert whole.part == (0, 0, WIDTH, HEIGHT)
    for k in range(2, 9):
        middle = tile(sheet, k)[whole.height // 2 - 20 : whole.height // 2 + 20]
        assert is_close(middle, (240, 240, 240), 10).any()  # the note's letters


@pytest.mark.parametrize(
    "outlines",
    [
        quads(count=1),
        quads(count=2),
        rings(1),
        rings(3),
        quads(count=2) + rings(1),
        [replace(outline, odd=True) for outline in quads()],
        [replace(outline, category="fan") for outline in quads(count=4)],
    ],
    ids=["one", "two", "ring", "rings", "mixed", "odd", "unknown"],
)
def test_all_kinds_of_panels(outlines: list[Outline]) -> None:
    kinds = [replace(o, category="other") if o.category == "fan" else o for o in outlines]
    scene = Scene(kinds)
    sheet = scene.sheet(outlines=Outlines(WIDTH, HEIGHT, tuple(outlines)))
    assert sheet.shape[1] == 3 * TILE_WIDTH + 4 * GAP
    window = window_of(scene)
    for outline in outlines:
        color = COLORS.get(outline.category, COLORS["other"])
        if outline.ellipse_px is not None:
            on = outline.ellipse_px.points(8)
        else:
            on = outline.corners_px + np.roll(outline.corners_px, -1, axis=0)  # type: ignore
            on = on / 2
        for point in window.points(on):
            assert is_close(near(tile(sheet, 6), point, 1), color).any()


def test_guessed_corners_far_away_do_not_shrink_the_rest() -> None:
    far = [[100.0, 100.0], [1e6, 90.0], [1e6, 170.0], [100.0, 160.0]]
    guess = Outline.quad(far, seen=(True, False, True, True), truncated=True, category="up")
    scene = Scene(quads())
    sheet = scene.sheet(outlines=Outlines(WIDTH, HEIGHT, (*scene.outlines.buttons, guess)))
    assert sheet.shape == scene.sheet().shape
    np.testing.assert_array_equal(tile(sheet, 2), tile(scene.sheet(), 2))


@pytest.mark.parametrize("shape", [(HEIGHT, WIDTH), (HEIGHT, WIDTH, 1)])
def test_grey_photos(scene: Scene, shape: tuple[int, ...]) -> None:
    grey = np.ascontiguousarray(scene.photo[..., 0])
    expected = scene.sheet(photo=np.repeat(grey[..., None], 3, axis=2))
    np.testing.assert_array_equal(scene.sheet(photo=grey.reshape(shape)), expected)


def test_read_only_photos_and_large_ones() -> None:
    camera = PAPER_CAMERA.scaled_to(4000, 3000)
    large = [
        replace(o, corners_px=6.25 * o.corners_px)  # type: ignore[operator]
        for o in quads(shift=0.6)
    ]
    scene = Scene(large, camera)
    scene.photo.setflags(write=False)
    sheet = scene.sheet()
    small = Scene(quads(shift=0.6)).sheet()
    assert abs(sheet.shape[0] - small.shape[0]) <= 9
    # The same tiles but for the resampling: a mask is where it is in the smaller photo.
    rows = min(tile(sheet, 4).shape[0], tile(small, 4).shape[0])
    tinted = [np.ptp(tile(s, 4)[:rows].astype(int), axis=2) > 40 for s in (sheet, small)]
    assert (tinted[0] != tinted[1]).mean() < 0.03
    assert tinted[0].mean() > 0.1


def test_results_of_different_photos_are_refused(scene: Scene) -> None:
    with pytest.raises(InputError, match="image"):
        scene.sheet(photo=scene.photo[:-1])
    with pytest.raises(InputError, match="image"):
        scene.sheet(photo=scene.photo.astype(float))
    with pytest.raises(InputError, match="outlines"):
        scene.sheet(outlines=Outlines(WIDTH, HEIGHT + 1, ()))
    with pytest.raises(InputError, match="panel"):
        scene.sheet(panel=replace(scene.panel, width_px=WIDTH + 1))


def test_probability_is_a_heat_map(scene: Scene) -> None:
    segment = scene.segments.segments[0]
    unsure = replace(segment, probability=np.where(segment.mask, 0.55, 0.0).astype(np.float32))
    segments = replace(scene.segments, segments=(unsure, *scene.segments.segments[1:]))
    heat, other = tile(scene.sheet(), 2), tile(scene.sheet(segments=segments), 2)
    window = window_of(scene)
    centers = [window.points([s.center_px])[0].round().astype(int) for s in scene.segments]
    for x, y in centers:  # sure: red, in turbo colours
        red, green, blue = heat[y, x].astype(int)
        assert red > max(green, blue) + 50
    x, y = centers[0]
    red, green, _ = other[y, x].astype(int)
    assert green > red
    assert np.ptp(heat[5, 5].astype(int)) < 3  # nothing there: the grey photo


def test_what_the_closing_adds_and_drops(scene: Scene) -> None:
    mask = np.zeros((HEIGHT, WIDTH), bool)
    mask[150:290, 250:390] = True
    mask[220, 250:390] = False  # a slit, closed
    mask[300:306, 300:306] = True  # another piece, dropped
    segments = Segments.from_masks(mask[None], ["stop"])
    window = Window.around([segments.segments[0].box_px], WIDTH, HEIGHT)
    sheet = scene.sheet(segments=segments, outlines=Outlines(WIDTH, HEIGHT, ()))
    closed = tile(sheet, 4)
    (slit, piece, edge, inside), window_scale = (
        window.points([[320, 220], [303, 303], [320, 150], [320, 180]]),
        window.scale[0],
    )
    assert window_scale > 1
    assert is_close(near(closed, slit, 0), ADDED, 5).all()
    assert is_close(near(closed, piece, 0), DROPPED, 5).all()
    assert is_close(near(closed, edge, 0), (255, 255, 255), 5).all()
    red, green, _ = near(closed, inside, 0)[0].astype(int)
    assert red > green + 50  # tinted in the category's colour
    # No line and no corner where nothing was outlined.
    assert np.ptp(tile(sheet, 5).astype(int), axis=2).max() < 20


def test_sides_go_on_beyond_their_corners(scene: Scene) -> None:
    window = window_of(scene)
    corners = scene.outlines.buttons[0].corners_px
    assert corners is not None
    ink = tile(scene.sheet(), 5)
    for a, b in zip(corners, np.roll(corners, -1, axis=0), strict=True):
        along = b - a
        on = window.points(np.array([a + t * along for t in (-0.15, 0.3, 0.7, 1.15)]))
        for point in on:
            assert is_close(near(ink, point), COLORS["number"]).any()
    # Sides that are not seen are another colour.
    guessed = [replace(o, seen=(True, True, False, True)) for o in scene.outlines.buttons]
    other = tile(scene.sheet(outlines=Outlines(WIDTH, HEIGHT, tuple(guessed))), 5)
    below = window.points((0.6 * corners[2] + 0.4 * corners[3])[None])[0]
    assert is_close(near(ink, below), COLORS["number"]).any()
    assert not is_close(near(other, below), COLORS["number"]).any()


def test_lines_of_the_panel_are_drawn(scene: Scene) -> None:
    x0, y0, x1, _ = window_of(scene).part
    ends = np.array([[x0 + 5.0, y0 + 9.0], [x1 - 5.0, y0 + 9.0]])
    lines = (
        LineSegment("horizontal", ends),
        LineSegment("vertical", np.array([[1.0, 1.0], [1.0, 3.0]])),  # outside the part
    )
    outlines = replace(scene.outlines, lines=lines)
    drawn = tile(scene.sheet(outlines=outlines), 6)
    bare = tile(scene.sheet(), 6)
    row = round(window_of(scene).points(ends)[0, 1])
    assert (drawn != bare).any(axis=2)[row - 1 : row + 2, 30:-30].any(axis=0).all()
    np.testing.assert_array_equal(drawn[row + 6 :], bare[row + 6 :])


def panel_with(pose: PanelPose, outlines: list[Outline], camera: Camera) -> Panel:
    buttons = tuple(
        Button(k, outline, None, None, 1.0, float(pose.weight[k]))
        for k, outline in enumerate(outlines)
    )
    return Panel("", camera.width_px, camera.height_px, pose.status, (), pose, buttons)


def exact(camera: Camera, angles: Any, *, circles: bool) -> tuple[PanelPose, list[Outline]]:
    """A pose, and the outlines that it predicts."""
    pose = make_pose(camera, angles, (0.1, 0.05))
    outlines = []
    for plane in pose.plane_corners:
        points = plane
        if circles:
            turn = 2 * np.pi * np.arange(200) / 200
            points = plane.mean(axis=0) + 0.05 * np.stack([np.cos(turn), np.sin(turn)], axis=1)
        seen = camera.project(np.column_stack([points, np.ones(len(points))]) @ pose.rotation)
        if circles:
            (cx, cy), (wide, high), angle = cv2.fitEllipseDirect(seen.astype(np.float32))
            if wide < high:
                wide, high, angle = high, wide, angle + 90
            outlines.append(Outline.ellipse(cx, cy, wide / 2, high / 2, angle))
        else:
            outlines.append(Outline.quad(seen))
    return pose, outlines


def moved(outline: Outline, by: Any) -> Outline:
    if outline.corners_px is not None:
        return replace(outline, corners_px=outline.corners_px + by)
    e = outline.ellipse_px
    assert e is not None
    return replace(outline, ellipse_px=replace(e, cx=e.cx + by[0], cy=e.cy + by[1]))


@pytest.mark.parametrize("circles", [False, True], ids=["quads", "circles"])
@pytest.mark.parametrize("camera", [PAPER_CAMERA, BARREL], ids=["pinhole", "barrel"])
def test_residuals_lead_from_the_measured_to_the_modelled(camera: Camera, circles: bool) -> None:
    pose, outlines = exact(camera, (20, -30, 8), circles=circles)
    shift = np.array([3.0, -2.0])
    panel = panel_with(pose, [outlines[0], moved(outlines[1], shift), outlines[2]], camera)
    found = residuals(panel)
    assert [r.button for r in found] == [0, 1, 2]
    exactly = 0.06 if circles else 1e-9  # cv2 fits with single precision
    for residual, expected in zip(found, (0 * shift, -shift, 0 * shift), strict=True):
        assert residual.measured.shape == (4, 2)
        np.testing.assert_allclose(
            residual.modelled - residual.measured, np.tile(expected, (4, 1)), atol=exactly
        )
    # The arrow is drawn on that side, and on no other.
    black = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    drawing, factor = draw_residuals(black, ALL, panel)
    assert not black.any()
    assert factor >= 1
    bare, _ = draw_residuals(black, ALL, panel_with(pose, outlines, camera))
    for start in found[1].measured:
        along = -factor * shift * 0.6
        assert is_close(near(drawing, start + along), FITS).any()
        assert not is_close(near(drawing, start - 1.3 * along), FITS).any()
    assert not is_close(bare, FITS, 10).all()


def test_only_measured_corners_have_residuals() -> None:
    pose, outlines = exact(PAPER_CAMERA, (10, 15, 0), circles=False)
    outlines[0] = replace(outlines[0], seen=(True, False, True, True), truncated=True)
    outlines[1] = replace(outlines[1], seen=(True, False, True, False), truncated=True)
    found = residuals(panel_with(pose, outlines, PAPER_CAMERA))
    assert [r.button for r in found] == [0, 2]
    assert outlines[0].corners_px is not None
    np.testing.assert_array_equal(found[0].measured, outlines[0].corners_px[[0, 3]])


def test_set_aside_ones_are_red_and_do_not_set_the_factor() -> None:
    pose, outlines = exact(PAPER_CAMERA, (10, 15, 0), circles=False)
    pose = replace(pose, weight=np.array([1.0, 0.05, 1.0]))
    black = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    drawings = {}
    for far in (0.5, 8.0):
        given = [moved(outlines[0], (0.2, 0)), moved(outlines[1], (0, far)), outlines[2]]
        drawings[far] = draw_residuals(black, ALL, panel_with(pose, given, PAPER_CAMERA))
        assert is_close(drawings[far][0], RED, 20).any()
        assert is_close(drawings[far][0], FITS, 20).any()
    assert drawings[0.5][1] == drawings[8.0][1]
    fitting = replace(pose, weight=np.ones(3))
    picture, factor = draw_residuals(black, ALL, panel_with(fitting, given, PAPER_CAMERA))
    assert not is_close(picture, RED, 20).any()
    assert factor < drawings[8.0][1]


def test_the_grid_search_has_no_residuals() -> None:
    scene = Scene(quads(), solver="grid")
    assert residuals(scene.panel) == []
    sheet = scene.sheet()
    assert not is_close(tile(sheet, 7), FITS, 20).any()
    assert not np.array_equal(tile(sheet, 7), tile(sheet, 5))


def test_residuals_are_those_of_the_result() -> None:
    scene = Scene(quads(shift=1.0))
    for residual in residuals(scene.panel):
        button = scene.panel.buttons[residual.button]
        off = np.linalg.norm(residual.modelled - residual.measured, axis=1)
        assert np.sqrt((off**2).mean()) < 6 * button.residual_px + 0.05
    pose = estimate_pose(quads(shift=1.0), PAPER_CAMERA)
    assert np.nanmax(pose.residual_px) > 0.1


def test_words_tell_of_camera_and_timings(scene: Scene) -> None:
    pose = scene.panel.pose
    words = [
        tile(scene.sheet(panel=panel), 9)
        for panel in (
            scene.panel,
            replace(scene.panel, timing_ms={"pose": 1.0, "warp": 77.0}),
            replace(scene.panel, notes=("the photo is small",)),
            replace(scene.panel, pose=replace(pose, sigma_px=1.75)),
            replace(scene.panel, pose=replace(pose, camera=Camera.default(WIDTH, HEIGHT))),
            replace(scene.panel, notes=tuple(f"note {k}" for k in range(60))),
        )
    ]
    for k, one in enumerate(words):
        assert not any(np.array_equal(one, other) for other in words[:k])
        assert (one[:, -5:] == one[0, -1]).all()  # wrapped, not cut


@settings(derandomize=True, deadline=None, max_examples=150)
@given(
    size=st.tuples(st.integers(1, 5000), st.integers(1, 5000)),
    boxes=st.lists(
        st.tuples(*[st.floats(-50, 5050)] * 2, *[st.floats(0, 3000)] * 2).map(
            lambda b: (b[0], b[1], b[0] + b[2], b[1] + b[3])
        ),
        max_size=4,
    ),
)
def test_windows_show_all_boxes_and_nothing_but_the_photo(size: Any, boxes: Any) -> None:
    width, height = size
    window = Window.around(boxes, width, height)
    x0, y0, x1, y1 = window.part
    assert 0 <= x0 < x1 <= width
    assert 0 <= y0 < y1 <= height
    for box in boxes:
        low, high = np.clip(np.reshape(box, (2, 2)), 0, size)
        assert (low >= np.array([x0, y0]) - 1).all()
        assert (high <= np.array([x1, y1]) + 1).all()
    assert window.width == TILE_WIDTH
    assert 360 <= window.height <= 600
    (left, top), (wide, high_px) = window.corner, window.size
    assert left >= 0
    assert top >= 0
    assert left + wide <= window.width
    assert top + high_px <= window.height
    assert wide == window.width or high_px == window.height
    edges = window.points([[x0 - 0.5, y0 - 0.5], [x1 - 0.5, y1 - 0.5]])
    expected = [[left - 0.5, top - 0.5], [left + wide - 0.5, top + high_px - 0.5]]
    np.testing.assert_allclose(edges, expected, atol=1e-6)


@settings(derandomize=True, deadline=None, max_examples=40)
@given(
    part=st.tuples(*[st.integers(0, 60)] * 2, *[st.integers(60, 300)] * 2),
    at=st.tuples(st.floats(0.25, 0.75), st.floats(0.25, 0.75)),
)
def test_pictures_masks_and_points_agree_on_where_things_are(part: Any, at: Any) -> None:
    x0, y0, wide, high = part
    window = Window((x0, y0, x0 + wide, y0 + high), 200, 160)
    x, y = round(x0 + at[0] * wide), round(y0 + at[1] * high)
    photo = np.zeros((400, 400, 3), np.uint8)
    photo[y - 4 : y + 5, x - 4 : x + 5] = 200
    mask = photo[..., 0] > 0
    segment = Segments.from_masks(mask[None]).segments[0]
    shown = window.segment(segment)
    assert shown is not None
    part_of = np.zeros((160, 200), np.float64)
    left, top = shown.origin_px
    rows, columns = shown.probability.shape
    part_of[top : top + rows, left : left + columns] = shown.probability
    nearest = window.sampled(mask[y - 9 : y + 10].astype(np.uint8), (0, y - 9), smooth=False)
    assert nearest is not None
    hard = np.zeros((160, 200), np.float64)
    (left, top), (rows, columns) = nearest[1], nearest[0].shape
    hard[top : top + rows, left : left + columns] = nearest[0]
    picture = window.picture(photo)[..., 0].astype(np.float64)
    back = picture[0, 0] if picture[0, 0] else picture[0, -1]
    picture[np.abs(picture - back) < 1] = 0
    for values in (picture, part_of, hard):
        v, u = np.indices(values.shape)
        center = np.array([(values * u).sum(), (values * v).sum()]) / values.sum()
        np.testing.assert_allclose(center, window.points([[x, y]])[0], atol=0.6)
    box = np.reshape(shown.box_px, (2, 2))
    np.testing.assert_allclose(box.mean(axis=0), window.points([[x, y]])[0], atol=1e-6)


@pytest.mark.parametrize("smooth", [False, True])
def test_a_sampled_array_is_all_there_and_cut_at_the_tile(smooth: bool) -> None:
    window = Window((100, 50, 300, 350), 400, 600)  # twice as large
    ones = np.ones((4, 6), np.float32)
    found = window.sampled(ones, (110, 60), smooth=smooth)
    assert found is not None
    assert found[1] == (20, 20)
    assert found[0].shape == (8, 12)
    assert (found[0] >= (0.5 if smooth else 1)).all()
    cut = window.sampled(ones, (297, 60), smooth=smooth)
    assert cut is not None
    assert cut[0].shape == (8, 6)
    assert window.sampled(ones, (301, 60), smooth=smooth) is None


def test_ellipses_and_quads_in_a_window() -> None:
    window = Window((100, 50, 300, 350), 480, 600)
    ellipse = Outline.ellipse(200, 150, 40, 25, 30, std_px=0.7)
    inside = window.outline(ellipse)
    assert inside is not None
    assert inside.std_px == 0.7
    assert inside.ellipse_px is not None
    assert ellipse.ellipse_px is not None
    expected = window.points(ellipse.ellipse_px.points(16))
    offset = expected - inside.ellipse_px.center
    on = np.einsum("ni,ij,nj->n", offset, np.linalg.inv(inside.ellipse_px.shape_matrix), offset)
    np.testing.assert_allclose(on, 1.0, atol=1e-9)
    tiny = Window((0, 0, 40000, 40000), 480, 480)
    assert tiny.outline(Outline.ellipse(9, 9, 0.01, 0.01)) is None
    assert tiny.line(LineSegment("vertical", np.array([[9.0, 1.0], [9.0, 30.0]]))) is None
