import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fronto import Ellipse, InputError, LineSegment, Outline, order_corners
from fronto.shapes import check_corners, frozen_array
from fronto.synth import LayoutButton

fixed = settings(derandomize=True, deadline=None)

SQUARE = [[0, 0], [10, 0], [10, 10], [0, 10]]
orders = st.permutations(range(4))
ellipses = st.builds(
    lambda cx, cy, a, ratio, angle: Ellipse(cx, cy, a, a * ratio, angle),
    st.floats(-500, 2000),
    st.floats(-500, 2000),
    st.floats(0.5, 300),
    st.floats(0.05, 1.0),
    st.floats(-180, 360),
)


def turned(points, angle_deg):
    """Clockwise as seen (y down)."""
    c, s = np.cos(np.radians(angle_deg)), np.sin(np.radians(angle_deg))
    return np.asarray(points, dtype=float) @ np.array([[c, s], [-s, c]])


# --- order_corners


@fixed
@given(orders, st.floats(-40, 40), st.floats(5, 200), st.floats(0.4, 2.5))
def test_rectangles_in_any_order_and_roll(order, roll, width, ratio):
    corners = np.add(turned(np.array(SQUARE) / 10 * [width, width * ratio], roll), [300, 200])
    np.testing.assert_array_equal(order_corners(corners[list(order)]), corners)


@fixed
@given(
    orders,
    st.tuples(st.floats(-35, 35), st.floats(-35, 35), st.floats(-20, 20)),
    st.floats(200, 440),
    st.floats(160, 320),
)
def test_buttons_in_perspective_in_any_order(view, order, angles, px, py):
    seen = view([LayoutButton(0, 0, 0.03, 0.03)], angles, at_px=(px, py))
    corners = seen.outlines[0].corners_px
    np.testing.assert_array_equal(order_corners(corners[list(order)]), corners)


def test_slanted_quad_by_hand():
    # A parallelogram leaning to the right: top side from (4, 0), bottom side from (0, 6).
    expected = [[4, 0], [12, 0], [8, 6], [0, 6]]
    for order in itertools.permutations(expected):
        np.testing.assert_array_equal(order_corners(order), expected)


def test_both_horizontal_sides_decide():
    # Of all sides the left one, walked clockwise, is the closest to +x (30° against the
    # upper one's 40°), but the lower side is level.
    expected = np.array([[8.66, -5.0], [16.32, 1.43], [16.32, 3.0], [0.0, 0.0]])
    for order in itertools.permutations(range(4)):
        np.testing.assert_array_equal(order_corners(expected[list(order)]), expected)


@pytest.mark.parametrize(
    "points",
    [
        [[0, 0], [10, 0], [3, 3], [0, 10]],  # (3, 3) lies inside the other three
        [[0, 0], [0, 0], [10, 10], [0, 10]],
        [[0, 0], [5, 0], [10, 0], [15, 0]],
        [[0, 0], [10, 0], [10, 10]],
        [[0, 0], [10, 0], [10, 10], [np.nan, 10]],
    ],
)
def test_no_convex_quadrilateral_to_order(points):
    with pytest.raises(InputError):
        order_corners(points)


# --- corners


def test_good_corners_become_a_read_only_copy():
    given_corners = np.array(SQUARE, dtype=np.float32)
    corners = check_corners(given_corners)
    given_corners[0] = 99
    np.testing.assert_array_equal(corners, SQUARE)
    assert corners.dtype == np.float64
    with pytest.raises(ValueError, match="read-only"):
        corners[0, 0] = 1


@pytest.mark.parametrize(
    ("corners", "says"),
    [
        ([[0, 0], [10, 0], [10, 10], [0, np.nan]], "NaN"),
        ([[0, 0], [10, 0], [10, 10], [0, -np.inf]], "infinity"),
        ([[0, 0], [0, 0], [10, 10], [0, 10]], "coinciding"),
        ([[0, 0], [10, 0], [0, 0], [0, 10]], "coinciding"),  # opposite corners
        ([[5, 5], [5, 5], [5, 5], [5, 5]], "coinciding"),
        ([[0, 0], [10, 0], [0, 10], [10, 10]], "crossing"),
        ([[0, 0], [10, 0], [3, 3], [0, 10]], "inwards"),
        ([[0, 0], [5, 0], [10, 0], [5, 10]], "inwards"),  # straight angle
        ([[0, 0], [10, 0], [20, 0], [30, 0]], "on one line"),
        ([[0, 0], [2, 1], [6, 3], [4, 2]], "on one line"),  # there and back
        ([[0, 0], [0, 10], [10, 10], [10, 0]], "mirrored"),
        ([[0, 0], [5, 10], [10, 10], [15, 0.01]], "mirrored"),
        ([[10, 0], [0, 0], [0, 10], [10, 10]], "mirrored"),
        (SQUARE[:3], "shape"),
        ([*SQUARE, [5, 5]], "shape"),
        ([["a", "b"]] * 4, "numbers"),
        (None, "shape"),
    ],
)
def test_bad_corners(corners, says):
    with pytest.raises(InputError, match=says) as error:
        Outline.quad(corners)
    assert "\n" not in str(error.value)


@fixed
@given(st.floats(1e-3, 1e4), st.floats(-180, 180), st.floats(-1e4, 1e4))
def test_corner_check_depends_on_neither_scale_nor_place(scale, roll, shift):
    check_corners(turned(SQUARE, roll) * scale + shift)
    with pytest.raises(InputError, match="mirrored"):
        check_corners(turned(SQUARE, roll)[::-1] * scale + shift)


def test_frozen_array_checks_the_shape():
    assert frozen_array([[1, 2]], (-1, 2), "thing").shape == (1, 2)
    with pytest.raises(InputError, match="thing"):
        frozen_array([1, 2], (-1, 2), "thing")
    with pytest.raises(InputError, match="thing"):
        frozen_array([[1, 2, 3]], (-1, 2), "thing")


# --- ellipses


@fixed
@given(ellipses)
def test_ellipse_comes_back_from_its_shape_matrix(ellipse):
    back = Ellipse.from_shape_matrix(ellipse.center, ellipse.shape_matrix)
    assert (back.cx, back.cy) == (ellipse.cx, ellipse.cy)
    assert back.a == pytest.approx(ellipse.a, rel=1e-9)
    assert back.b == pytest.approx(ellipse.b, rel=1e-6)
    if ellipse.b < 0.99 * ellipse.a:  # the direction of a circle's axis means nothing
        apart = (back.angle_deg - ellipse.angle_deg + 90) % 180 - 90
        assert abs(apart) < 1e-6
    assert 0 <= back.angle_deg <= 180


@fixed
@given(ellipses, st.integers(3, 40))
def test_points_are_on_the_ellipse(ellipse, count):
    offset = ellipse.points(count) - ellipse.center
    value = np.einsum("ni,ij,nj->n", offset, np.linalg.inv(ellipse.shape_matrix), offset)
    assert offset.shape == (count, 2)
    np.testing.assert_allclose(value, 1.0, rtol=1e-6)
    np.testing.assert_allclose(offset.mean(axis=0), 0, atol=1e-9 * ellipse.a)


def test_ellipse_by_hand():
    # a = 2 along 30° below +x (y is down), b = 1 across.
    ellipse = Ellipse(5.0, 7.0, 2.0, 1.0, 30.0)
    tip, side = ellipse.points(4)[:2]
    np.testing.assert_allclose(tip, [5 + np.sqrt(3), 8], atol=1e-12)
    np.testing.assert_allclose(side, [4.5, 7 + np.sqrt(0.75)], atol=1e-12)
    # S = 4 u uᵀ + v vᵀ with u = (√3/2, 1/2), v = (-1/2, √3/2).
    off = 3 * np.sqrt(3) / 4
    np.testing.assert_allclose(ellipse.shape_matrix, [[3.25, off], [off, 1.75]], atol=1e-12)


@pytest.mark.parametrize(
    "values",
    [
        (0, 0, 1, 2, 0),
        (0, 0, 1, 0, 0),
        (0, 0, -2, -3, 0),
        (0, 0, np.inf, 1, 0),
        (np.nan, 0, 2, 1, 0),
        (0, 0, 2, 1, np.nan),
    ],
)
def test_bad_ellipses(values):
    with pytest.raises(InputError, match="ellipse"):
        Outline.ellipse(*values)


def test_shape_matrix_must_be_positive_definite():
    with pytest.raises(InputError, match="positive definite"):
        Ellipse.from_shape_matrix([0, 0], [[1, 2], [2, 1]])


# --- outlines


def test_center_is_where_the_diagonals_cross():
    # (0,0)-(3,2) is y = 2x/3, (4,0)-(1,2) is y = -2(x - 4)/3: they meet at (2, 4/3).
    outline = Outline.quad([[0, 0], [4, 0], [3, 2], [1, 2]])
    np.testing.assert_allclose(outline.center_px, [2, 4 / 3])
    np.testing.assert_array_equal(Outline.ellipse(3, 4, 2, 1).center_px, [3, 4])


@fixed
@given(st.tuples(*[st.floats(-35, 35)] * 3), st.floats(100, 540), st.floats(100, 380))
def test_center_is_the_image_of_the_center(view, angles, px, py):
    seen = view([LayoutButton(0, 0, 0.04, 0.025)], angles, at_px=(px, py))
    np.testing.assert_allclose(seen.outlines[0].center_px, [px, py], atol=1e-8)


def test_boxes():
    assert Outline.quad([[1, 2], [9, 0], [8, 7], [0, 6]]).box_px == (0, 0, 9, 7)
    # a = 2, b = 1 at 45°: half extent √((4 + 1)/2) in x and y.
    half = np.sqrt(2.5)
    assert Outline.ellipse(10, 20, 2, 1, 45).box_px == pytest.approx(
        (10 - half, 20 - half, 10 + half, 20 + half)
    )


@fixed
@given(ellipses)
def test_box_touches_the_ellipse(ellipse):
    x0, y0, x1, y1 = Outline("ellipse", ellipse_px=ellipse).box_px
    points = ellipse.points(4000)
    reach = 1e-5 * ellipse.a
    np.testing.assert_allclose(points.min(axis=0), [x0, y0], atol=reach)
    np.testing.assert_allclose(points.max(axis=0), [x1, y1], atol=reach)


@pytest.mark.parametrize("std", [0, -0.5, np.nan, np.inf])
def test_deviations_must_be_positive(std):
    with pytest.raises(InputError, match="std_px"):
        Outline.quad(SQUARE, std_px=std)
    with pytest.raises(InputError, match="std_px"):
        Outline.ellipse(0, 0, 2, 1, std_px=std)
    with pytest.raises(InputError, match="std_px"):
        LineSegment("horizontal", [[0, 0], [9, 0]], std_px=std)


def test_an_outline_is_one_of_the_two():
    ellipse = Ellipse(0, 0, 2, 1)
    for shape, corners, round_ in [
        ("quad", None, None),
        ("quad", np.array(SQUARE), ellipse),
        ("ellipse", None, None),
        ("ellipse", np.array(SQUARE), ellipse),
        ("circle", None, ellipse),
    ]:
        with pytest.raises(InputError):
            Outline(shape, corners_px=corners, ellipse_px=round_)


# --- lines


@pytest.mark.parametrize(
    ("axis", "ends"),
    [
        ("diagonal", [[0, 0], [9, 0]]),
        ("horizontal", [[0, 0], [0.5, 0.5]]),
        ("horizontal", [[0, 0], [np.nan, 9]]),
        ("vertical", [[0, 0], [9, 0], [3, 3]]),
        ("vertical", [0, 0, 9, 0]),
    ],
)
def test_bad_lines(axis, ends):
    with pytest.raises(InputError):
        LineSegment(axis, ends)


def test_line_ends_are_a_read_only_copy():
    ends = np.array([[0.0, 0.0], [9.0, 1.0]])
    line = LineSegment("horizontal", ends)
    ends[0] = 5
    np.testing.assert_array_equal(line.ends_px, [[0, 0], [9, 1]])
    with pytest.raises(ValueError, match="read-only"):
        line.ends_px[0, 0] = 1


def test_every_refusal_says_what_to_do() -> None:
    square = [[0.0, 0.0], [10.0, 0.0], [10.0, 10.0], [0.0, 10.0]]
    quads = {
        "inwards": [*square[:2], [2.0, 2.0], square[3]],
        "coinciding": [square[0], *square[:3]],
        "NaN": [[np.nan, 0.0], *square[1:]],
        "crossing": [square[0], square[2], square[1], square[3]],
    }
    for word, corners in quads.items():
        with pytest.raises(InputError, match=word) as refused:
            Outline.quad(corners)
        assert refused.value.remedy
    with pytest.raises(InputError, match="pixel apart") as short:
        LineSegment("vertical", np.array([[3.0, 4.0], [3.0, 4.5]]))
    assert short.value.remedy
