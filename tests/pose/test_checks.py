import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fronto import InputError, Outline, estimate_pose
from fronto.pose.checks import boxes_px, check_outlines
from fronto.synth import PAPER_CAMERA

fixed = settings(derandomize=True, deadline=None)

SQUARE = np.array([[0, 0], [20, 0], [20, 20], [0, 20]], dtype=float)


def column(count, pitch=30.0):
    return [Outline.quad(np.add(SQUARE, [100, 50 + pitch * k])) for k in range(count)]


def test_good_outlines_pass():
    check_outlines([])
    check_outlines(column(1))
    check_outlines(column(5))
    check_outlines([*column(3), Outline.ellipse(200, 100, 10, 9)])


@fixed
@given(st.tuples(*[st.floats(-35, 35)] * 3), st.floats(120, 520), st.floats(100, 380))
def test_strong_perspective_passes(view, grid, angles, px, py):
    check_outlines(view(grid(3, 5), angles, at_px=(px, py), distance_m=0.35).outlines)


def test_boxes():
    quad, round_ = column(1)[0], Outline.ellipse(10, 20, 3, 3)
    assert boxes_px([quad]).tolist() == [[100, 50, 120, 70]]
    np.testing.assert_allclose(boxes_px([quad, round_])[1], [7, 17, 13, 23])


@pytest.mark.parametrize("item", [SQUARE, None, {"corners": SQUARE}, "quad"])
def test_no_outline(item):
    with pytest.raises(InputError, match=r"outlines\[1\]"):
        estimate_pose([column(1)[0], item], PAPER_CAMERA)


@pytest.mark.parametrize("shift", [0.0, 2.0])
def test_one_button_twice(shift):
    outlines = [*column(3), Outline.quad(np.add(SQUARE, [100 + shift, 80]))]
    with pytest.raises(InputError, match="1 and 3"):
        estimate_pose(outlines, PAPER_CAMERA)
    with pytest.raises(InputError):
        estimate_pose([*column(3), Outline.ellipse(110 + shift, 90, 10, 10)], PAPER_CAMERA)


def test_a_button_inside_a_large_one_elsewhere_is_another():
    large = Outline.quad(10 * SQUARE + [50, 30])
    check_outlines([large, Outline.quad(np.add(SQUARE, [60, 40]))])


@pytest.mark.parametrize("turn", [1, 2, 3])
@pytest.mark.parametrize("wrong", [0, 2])
def test_one_that_starts_at_another_corner_is_named(turn, wrong):
    outlines = column(4)
    outlines[wrong] = Outline.quad(np.roll(outlines[wrong].corners_px, turn, axis=0))
    with pytest.raises(InputError, match=f"outlines {wrong}:") as error:
        estimate_pose(outlines, PAPER_CAMERA)
    assert "order" in str(error.value)
    assert "\n" not in str(error.value)


def test_all_rolled_alike_pass():
    check_outlines([Outline.quad(np.roll(o.corners_px, 1, axis=0)) for o in column(3)])


def test_solver_and_its_options():
    for solver in ("least_squares", "", None, "GRID"):
        with pytest.raises(InputError, match="solver"):
            estimate_pose(column(3), PAPER_CAMERA, solver=solver)
    with pytest.raises(InputError, match="step_deg"):
        estimate_pose(column(3), PAPER_CAMERA, step_deg=1.0)
    with pytest.raises(InputError, match="grid"):
        estimate_pose(column(3), PAPER_CAMERA, solver="grid", steps=1.0)
