"""Depth images: metres and millimetres, files of every kind, and wrong ones in one line."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from fronto.errors import InputError
from fronto.metric.depthimage import as_depth, depth_samples, read_depth
from fronto.synth import PAPER_CAMERA

METRES = np.array([[0.5, 0.0, 1.25], [np.nan, -1.0, np.inf]], np.float32)
EXPECTED = np.array([[0.5, np.nan, 1.25], [np.nan, np.nan, np.nan]])


@pytest.mark.parametrize("kind", [np.float16, np.float32, np.float64])
def test_floats_are_metres(kind: type) -> None:
    depth = as_depth(METRES.astype(kind))
    np.testing.assert_allclose(depth, EXPECTED)
    assert not depth.flags.writeable


def test_uint16_is_millimetres() -> None:
    depth = as_depth(np.array([[0, 500], [1250, 65535]], np.uint16)[..., None])
    np.testing.assert_allclose(depth, [[np.nan, 0.5], [1.25, 65.535]])


@pytest.mark.parametrize(
    "wrong",
    [
        np.ones((4, 4), np.uint8),
        np.ones((4, 4), np.int32),
        np.ones((4, 4, 3), np.float32),
        np.ones(4, np.float32),
        np.ones((0, 4), np.float32),
        np.array([["a"]]),
    ],
)
def test_other_arrays_are_refused(wrong: np.ndarray) -> None:
    with pytest.raises(InputError, match="depth") as caught:
        as_depth(wrong)
    assert "\n" not in str(caught.value)


@settings(derandomize=True, deadline=None, max_examples=50)
@given(hnp.arrays(np.float64, (3, 4), elements=st.floats(allow_nan=True, allow_infinity=True)))
def test_any_floats_become_positive_metres_or_none(values: np.ndarray) -> None:
    depth = as_depth(values)
    assert ((depth > 0) | np.isnan(depth)).all()


def test_files(tmp_path: Path) -> None:
    millimetres = np.array([[500, 0, 1250], [7, 65535, 1]], np.uint16)
    np.save(tmp_path / "metres.npy", METRES)
    np.save(tmp_path / "millimetres.npy", millimetres)
    cv2.imwrite(str(tmp_path / "millimetres.png"), millimetres)
    cv2.imwrite(str(tmp_path / "millimetres.tiff"), millimetres)
    cv2.imwrite(str(tmp_path / "metres.tiff"), METRES)
    for path in tmp_path.iterdir():
        expected = METRES if path.stem == "metres" else millimetres
        np.testing.assert_array_equal(read_depth(path), as_depth(expected))


def test_wrong_files_are_refused_in_one_line(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "colours.png"), np.zeros((4, 4, 3), np.uint8))
    (tmp_path / "text.npy").write_text("no array")
    (tmp_path / "text.png").write_text("no picture")
    np.save(tmp_path / "objects.npy", np.array([None, {}], dtype=object), allow_pickle=True)
    np.savez(tmp_path / "many.npy.npz", a=METRES)
    (tmp_path / "many.npy.npz").rename(tmp_path / "many.npy")
    np.save(tmp_path / "cut.npy", METRES)
    (tmp_path / "cut.npy").write_bytes((tmp_path / "cut.npy").read_bytes()[:-8])
    (tmp_path / "empty.npy").touch()
    paths = [*tmp_path.iterdir(), tmp_path / "missing.npy", tmp_path / "missing.png"]
    for path in paths:
        with pytest.raises(InputError) as caught:
            read_depth(path)
        assert str(path) in str(caught.value)
        assert "\n" not in str(caught.value)


def test_samples_lie_on_the_panel_and_have_a_depth() -> None:
    depth = np.full((480, 640), 0.5, np.float32)
    depth[200:240] = 0
    square = np.array([[-0.1, -0.1, 0.5], [0.1, -0.1, 0.5], [0.1, 0.1, 0.5], [-0.1, 0.1, 0.5]])
    values, rays = depth_samples(as_depth(depth), PAPER_CAMERA, square[None])
    # 128 pixels wide, less the rows without depth.
    assert len(values) == pytest.approx(128 * 128 - 40 * 128, rel=0.03)
    assert (np.abs(rays[:, :2]) < 0.2 + 1 / 320).all()
    behind, _ = depth_samples(as_depth(depth), PAPER_CAMERA, -square[None])
    assert len(behind) == 0
