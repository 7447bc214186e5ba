"""The ways of the comparison: right where the input is exact, and silent where it says nothing."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

from fronto import Camera, Outline
from fronto.evaluate import rotation_error_deg
from fronto.outlines import Outlines
from fronto.segments import Segment, Segments
from fronto.shapes import FloatArray
from fronto.synth import PAPER_CAMERA, Layout
from fronto.synth.look import STEEL
from scenes import Case, car_panel, hall_panel, take, turned
from ways import WAYS, Answer, document, grid_em, judge, layout_known, vanishing
from ways.pinhole import pinhole_image
from ways.vanishing import vanishing_rotation

SIZE = PAPER_CAMERA.width_px, PAPER_CAMERA.height_px
BLANK = np.full((*SIZE[::-1], 3), 128, np.uint8)
BARREL = Camera.from_matrix(PAPER_CAMERA.matrix, *SIZE, [-0.2, 0.05, 0.001, -0.002])
#: Fewer things that are no plate, no shadow beside it: its edges are where they are.
CLEAR = replace(STEEL, wall=(225, 225, 220), plate=(60, 62, 66), shadow=0.0, relief=0.0, grain=0.0)

ANGLES = {"towards": st.floats(0, 360), "roll": st.floats(-15, 15)}
FEW = settings(derandomize=True, deadline=None, max_examples=12)


def facing(
    layout: Layout,
    rotation: FloatArray,
    camera: Camera = PAPER_CAMERA,
    image: np.ndarray = BLANK,
    distance_m: float = 0.3,
) -> Case:
    """A photo (that shows nothing) of a panel in its middle."""
    translation = rotation @ np.array([0.0, 0.0, distance_m])
    return Case(image, camera, layout, rotation, translation, camera)


def button(x: float, y: float, category: str = "number") -> Segment:
    box = (x - 9, y - 7, x + 9, y + 7)
    return Segment(category, 1.0, box, (round(x) - 9, round(y) - 7), np.ones((14, 18)))


def with_centers(case: Case, *more: Segment, without: tuple[int, ...] = ()) -> Case:
    """Found: a box about each true centre, but for some, and some that are no buttons."""
    layout = case.layout
    flat = np.concatenate([layout.centers, np.zeros((len(layout.buttons), 1))], axis=1)
    centers = case.taken_with.project((flat + case.translation) @ case.rotation)
    kept = [button(*c) for k, c in enumerate(centers.tolist()) if k not in without]
    vars(case)["segments"] = Segments(*SIZE, (*kept, *more))
    return case


def with_outlines(case: Case, corners: FloatArray | None = None) -> Case:
    """Found: the corners of all buttons, by fronto and by the paper."""
    found = case.corners_px if corners is None else corners
    outlines = Outlines(*SIZE, tuple(Outline.quad(c) for c in found))
    vars(case).update(outlines=outlines, hough=outlines)
    return case


def error_deg(case: Case, answer: Answer) -> float:
    assert answer.rotation is not None, answer.reason
    return rotation_error_deg(answer.rotation, case.rotation)


def says_no(answer: Answer) -> bool:
    return not answer.answered and bool(answer.reason)


def test_tables_show_them_in_the_order_of_the_issue() -> None:
    assert list(WAYS) == [
        "fronto",
        "fronto, buttons alone",
        "paper",
        "paper, as printed",
        "grid-EM style",
        "vanishing points",
        "panel quadrilateral",
        "layout known (bound)",
    ]


@FEW
@given(tilt=st.floats(0, 55), columns=st.integers(2, 4), rows=st.integers(2, 5), **ANGLES)
def test_a_lattice_of_exact_centres_gives_the_rotation(
    tilt: float, towards: float, roll: float, columns: int, rows: int
) -> None:
    case = facing(car_panel(columns, rows), turned(tilt, towards, roll))
    assert error_deg(case, grid_em(with_centers(case))) < 0.01


def test_pitches_may_differ_and_the_lens_may_bend() -> None:
    layout = car_panel(3, 4)
    wide = Layout("wide", tuple(replace(b, x=1.4 * b.x) for b in layout.buttons))
    case = facing(wide, turned(30, 70, -5), BARREL)
    assert error_deg(case, grid_em(with_centers(case))) < 0.01


@FEW
@given(tilt=st.floats(0, 45), seed=st.integers(0, 1000), **ANGLES)
def test_missing_buttons_and_strays_are_survived(
    tilt: float, towards: float, roll: float, seed: int
) -> None:
    rng = np.random.default_rng(seed)
    case = facing(car_panel(3, 5, pitch_m=0.04), turned(tilt, towards, roll))
    strays = [button(*xy) for xy in rng.uniform([250, 130], [390, 350], (2, 2)).tolist()]
    missing = tuple(rng.permutation(15)[:3].tolist())
    assert error_deg(case, grid_em(with_centers(case, *strays, without=missing))) < 1


def test_plates_are_no_centres_and_rotations_do_not_win_by_scale() -> None:
    case = facing(car_panel(2, 3), turned(20, 130, 4))
    plates = [button(x, 200, "plate") for x in (250, 291, 303, 371)]
    assert error_deg(case, grid_em(with_centers(case, *plates))) < 0.01
    # Half a pixel off: nothing edge-on, and nothing on a fine lattice, may fit better.
    rng = np.random.default_rng(1)
    noisy = [
        button(*(np.array(s.center_px) + rng.normal(0, 0.4, 2))) for s in case.segments.buttons
    ]
    vars(case)["segments"] = Segments(*SIZE, tuple(noisy))
    assert error_deg(case, grid_em(case)) < 10


@pytest.mark.parametrize("layout", [hall_panel(0.03, 0.045, 3), car_panel(1, 6), car_panel(6, 1)])
@pytest.mark.parametrize("strays", [0, 1])
def test_a_single_row_or_column_is_no_lattice(layout: Layout, strays: int) -> None:
    case = facing(layout, turned(25, 30, 3))
    more = [button(365, 285)] * strays
    assert says_no(grid_em(with_centers(case, *more)))


def test_nothing_found_is_no_lattice_and_no_layout() -> None:
    case = facing(car_panel(3, 3), turned(25, 30, 3))
    vars(case).update(segments=Segments(*SIZE, ()), outlines=Outlines(*SIZE, ()))
    assert says_no(grid_em(case))
    assert says_no(layout_known(case))


@FEW
@given(tilt=st.floats(5, 60), buttons=st.integers(1, 3), **ANGLES)
def test_the_known_layout_gives_the_rotation(
    tilt: float, towards: float, roll: float, buttons: int
) -> None:
    for camera in (PAPER_CAMERA, BARREL):
        case = facing(hall_panel(0.03, 0.045, buttons), turned(tilt, towards, roll), camera)
        assert error_deg(case, layout_known(with_outlines(case))) < 1e-3


def test_the_layout_knows_which_corners_are_whose() -> None:
    case = facing(car_panel(2, 2), turned(25, 200, 3))
    # A display that is taken for a button, and the first button three times, twice badly.
    first = case.corners_px[:1]
    stray, again = first + np.array([70.0, 10.0]), 1.05 * first - 0.05 * first.mean(axis=1) + 2
    found = np.concatenate([stray, again, case.corners_px[[2, 0, 3, 1]], again])
    assert error_deg(case, layout_known(with_outlines(case, found))) < 1e-3
    assert says_no(layout_known(with_outlines(replace(case), stray)))


def test_the_paper_has_its_grid_and_the_corners_that_it_is_given() -> None:
    case = with_outlines(facing(hall_panel(0.03, 0.045, 3), turned(15, 0, 0)))
    for name in ("paper", "paper, as printed"):
        assert error_deg(case, WAYS[name](case)) < 1.5, name


ANISOTROPIC = Camera.from_matrix([[320, 0, 310], [0, 260, 250], [0, 0, 1]], *SIZE)


@FEW
@given(
    tilt=st.floats(0, 70),
    order=st.permutations([0, 1, 2]),
    signs=st.tuples(*[st.sampled_from([-1.0, 1.0])] * 3),
    camera=st.sampled_from([PAPER_CAMERA, ANISOTROPIC]),
    **ANGLES,
)
def test_vanishing_directions_are_sorted_into_axes(
    tilt: float,
    towards: float,
    roll: float,
    order: list[int],
    signs: tuple[float, ...],
    camera: Camera,
) -> None:
    rotation = turned(tilt, towards, roll)
    square = np.array(camera.matrix)
    square[0, 0] = square[1, 1] = camera.focal_px
    seen = rotation @ camera.matrix.T @ np.linalg.inv(square).T
    vps = np.array(signs)[:, None] * seen[list(order)]
    found = vanishing_rotation(vps, camera, normal=order.index(2))
    assert rotation_error_deg(found, rotation) < 1e-6
    if tilt < 25:
        assert rotation_error_deg(vanishing_rotation(vps, camera), rotation) < 1e-6


def needs_detection() -> None:
    pytest.importorskip("lu_vp_detect", reason="lu-vp-detect is not installed")


@pytest.mark.parametrize("tilt", [10, 35, 58])
def test_vanishing_points_of_a_photo(tilt: float) -> None:
    needs_detection()
    rng = np.random.default_rng(5)
    case = take(rng, car_panel(3, 4), turned(tilt, 100, 4), 0.3, look=CLEAR)
    assert error_deg(case, vanishing(case)) < 2


def test_vanishing_points_need_lines_that_meet(monkeypatch: pytest.MonkeyPatch) -> None:
    needs_detection()
    case = facing(car_panel(2, 2), turned(10, 0, 0))
    assert says_no(vanishing(case))
    # All parallel: the package by itself would search forever.
    x = np.arange(8, dtype=np.float32) * 40
    parallel = np.stack([x, x * 0 + 50, x, x * 0 + 250], axis=1)
    monkeypatch.setattr(sys.modules[vanishing.__module__], "_segments", lambda *_: parallel)
    assert says_no(vanishing(case))


def test_a_missing_package_is_said_to_be_missing(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "lu_vp_detect", None)
    with pytest.raises(ModuleNotFoundError):
        vanishing(facing(car_panel(2, 2), turned(10, 0, 0)))


@pytest.mark.parametrize(("tilt", "towards"), [(0, 0), (25, 60), (45, 290)])
def test_the_plate_is_found_and_made_a_rectangle(tilt: float, towards: float) -> None:
    layout = car_panel(3, 4)
    rng = np.random.default_rng(3)
    case = take(rng, layout, turned(tilt, towards, 5), 0.35, look=CLEAR)
    answer = document(with_centers(case))
    assert error_deg(case, answer) < 0.7
    assert answer.homography is not None
    assert judge(case, answer)["edge_deg"] < 0.5


def test_a_plate_holds_the_buttons_and_is_whole() -> None:
    case = take(np.random.default_rng(3), car_panel(3, 4), turned(20, 60, 5), 0.35, look=CLEAR)
    vars(case)["segments"] = Segments(*SIZE, (button(60, 60), button(90, 60)))
    assert says_no(document(case))
    sheet, cut = BLANK.copy(), BLANK.copy()
    sheet[60:420, 100:500] = cut[60:420, :500] = 30
    on_it = Segments(*SIZE, tuple(button(x, 240) for x in (150, 320, 480)))
    for image, answered in ((sheet, True), (cut, False)):
        case = facing(car_panel(3, 1), np.eye(3), image=image)
        vars(case)["segments"] = on_it
        assert document(case).answered == answered
    blank = facing(car_panel(2, 2), turned(10, 0, 0))
    vars(blank)["segments"] = Segments(*SIZE, ())
    assert says_no(document(blank))


def test_straight_lines_are_looked_for_without_the_lens() -> None:
    rotation = turned(25, 60, 5)
    pictures = [
        take(
            np.random.default_rng(3), car_panel(3, 4), rotation, 0.35, look=CLEAR, camera=c, noise=0
        )
        for c in (PAPER_CAMERA, BARREL)
    ]
    straight, bent = pictures
    middle = np.s_[80:400, 120:520]
    off = [
        np.abs(picture[middle].astype(float) - straight.image[middle]).mean()
        for picture in (pinhole_image(bent), bent.image)
    ]
    assert pinhole_image(straight) is straight.image
    assert off[0] < 0.2 * off[1]
    assert error_deg(bent, document(with_centers(bent))) < 1


def test_fronto_answers_like_the_others() -> None:
    case = take(np.random.default_rng(2), car_panel(3, 4), turned(20, 60, 5), 0.3)
    for name in ("fronto", "fronto, buttons alone"):
        answer = WAYS[name](case)
        assert error_deg(case, answer) < 5, name
