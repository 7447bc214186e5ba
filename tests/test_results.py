"""Results cannot be changed: neither through themselves nor through the arrays they came from."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from fronto.results import RectifiedView
from test_warp import PAPER_CAMERA, make_pose

ARRAYS = {
    "rotation": np.eye(3),
    "covariance": np.full((3, 3), np.nan),
    "plane_corners": np.ones((1, 4, 2)),
    "residual_px": np.array([np.nan]),
    "weight": np.array([1.0]),
}


@pytest.mark.parametrize("name", ARRAYS)
def test_arrays_of_a_pose_are_read_only_copies(name: str) -> None:
    given = ARRAYS[name].copy()
    pose = make_pose(PAPER_CAMERA, (0, 0, 0), buttons=1, **{name: given})
    given[...] = 7
    for held in (getattr(pose, name), getattr(replace(pose, status="uncertain"), name)):
        np.testing.assert_array_equal(held, ARRAYS[name])
        assert held.dtype == np.float64
        assert not held.flags.writeable


def test_arrays_of_a_view_are_read_only_copies() -> None:
    image, homography = np.zeros((2, 3, 4), np.uint8), np.eye(3)
    view = RectifiedView(image, homography, PAPER_CAMERA, "panel", 1.0)
    image[:], homography[:] = 9, 9
    np.testing.assert_array_equal(view.image, np.zeros((2, 3, 4)))
    np.testing.assert_array_equal(view.homography, np.eye(3))
    assert view.image.dtype == np.uint8
    assert not view.image.flags.writeable
    assert not view.homography.flags.writeable
    assert replace(view, scale=2.0).image is view.image  # megabytes are not copied twice
