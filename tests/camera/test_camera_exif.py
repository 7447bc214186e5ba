"""Focal lengths from EXIF data."""

from __future__ import annotations

import io
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image, ImageOps
from PIL.TiffImagePlugin import IFDRational

from fronto.camera import Camera
from fronto.errors import InputError

ORIENTATION, F35, FOCAL, PIXEL_X, PIXEL_Y = 0x0112, 0xA405, 0x920A, 0xA002, 0xA003
PLANE_X, PLANE_Y, PLANE_UNIT = 0xA20E, 0xA20F, 0xA210


def photo(
    path: Path, tags: dict[int, Any], size: tuple[int, int] = (640, 480), orientation: int = 0
) -> Path:
    exif = Image.Exif()
    if orientation:
        exif[ORIENTATION] = orientation
    exif.get_ifd(0x8769).update(tags)
    file = path / "photo.jpg"
    Image.new("RGB", size).save(file, exif=exif)
    return file


def test_35mm_equivalent(tmp_path: Path) -> None:
    camera = Camera.from_exif(photo(tmp_path, {F35: 26}))
    assert camera is not None
    # The diagonals: 800 px, 43.2666 mm.
    assert camera.focal_px == pytest.approx(26 / 43.2666 * 800, rel=1e-5)
    assert camera.matrix[:2, 2].tolist() == [319.5, 239.5]
    assert (camera.source, camera.focal_std) == ("exif", 0.05)
    assert "26 mm" in camera.detail


def test_orientation_turns_the_size(tmp_path: Path) -> None:
    for orientation in range(1, 9):
        camera = Camera.from_exif(photo(tmp_path, {F35: 26}, orientation=orientation))
        assert camera is not None
        upright = (480, 640) if orientation >= 5 else (640, 480)
        assert (camera.width_px, camera.height_px) == upright
        assert camera.focal_px == pytest.approx(26 / math.hypot(24, 36) * 800)


@pytest.mark.parametrize(
    ("unit", "resolution"), [(2, 5080.0), (None, 5080.0), (3, 2000.0), (4, 200.0), (5, 0.2)]
)
def test_focal_plane_units(tmp_path: Path, unit: int | None, resolution: float) -> None:
    # 200 pixels a millimetre, 4 mm.
    tags = {FOCAL: 4.0, PLANE_X: resolution, PLANE_Y: resolution}
    if unit is not None:
        tags[PLANE_UNIT] = unit
    camera = Camera.from_exif(photo(tmp_path, tags))
    assert camera is not None
    assert np.diag(camera.matrix) == pytest.approx([800, 800, 1])
    assert camera.focal_std == 0.03


def test_focal_plane_of_a_resized_and_turned_photo(tmp_path: Path) -> None:
    tags = {FOCAL: 4.0, PLANE_X: 400.0, PLANE_Y: 200.0, PLANE_UNIT: 4, PIXEL_X: 1280, PIXEL_Y: 960}
    file = photo(tmp_path, tags)
    plain = Camera.from_exif(file)
    assert plain is not None
    assert np.diag(plain.matrix) == pytest.approx([800, 400, 1])  # half of 1600 and 800
    turned = Camera.from_exif(photo(tmp_path, tags, orientation=6))
    assert turned is not None
    assert np.diag(turned.matrix) == pytest.approx([400, 800, 1])
    assert (turned.width_px, turned.height_px) == (480, 640)
    # Turning the pixels themselves must make no difference.
    with Image.open(photo(tmp_path, tags, orientation=6)) as image:
        upright = Camera.from_exif(ImageOps.exif_transpose(image))
    assert upright is not None
    assert upright.matrix.tolist() == turned.matrix.tolist()


def test_equivalent_goes_first_and_nonsense_falls_through(tmp_path: Path) -> None:
    plane = {FOCAL: 4.0, PLANE_X: 200.0, PLANE_Y: 200.0, PLANE_UNIT: 4}
    for equivalent, focal in ((26, 26 / math.hypot(24, 36) * 800), (0, 800.0), (2000, 800.0)):
        camera = Camera.from_exif(photo(tmp_path, {F35: equivalent, **plane}))
        assert camera is not None
        assert camera.focal_px == pytest.approx(focal)


@pytest.mark.parametrize(
    "tags",
    [
        {},
        {F35: 0},
        {F35: 5},  # 92 px at a longer side of 640: below 0.2
        {FOCAL: 4.0},
        {FOCAL: 4.0, PLANE_X: 200.0, PLANE_UNIT: 1},
        {FOCAL: 4.0, PLANE_X: 0.0, PLANE_Y: 0.0, PLANE_UNIT: 4},
        {FOCAL: IFDRational(4, 0), PLANE_X: 200.0, PLANE_Y: 200.0, PLANE_UNIT: 4},
        {F35: 26, PIXEL_X: 1000, PIXEL_Y: 1000},  # cropped since
    ],
)
def test_nothing_usable(tmp_path: Path, tags: dict[int, Any]) -> None:
    assert Camera.from_exif(photo(tmp_path, tags)) is None


def test_no_exif_at_all() -> None:
    assert Camera.from_exif(Image.new("L", (64, 48))) is None


@settings(derandomize=True, deadline=None, max_examples=200)
@given(st.data())
def test_broken_exif_never_raises(data: st.DataObject) -> None:
    exif = Image.Exif()
    exif.get_ifd(0x8769).update({F35: 26, FOCAL: 4.0, PLANE_X: 200.0, PLANE_UNIT: 4})
    block = bytearray(exif.tobytes())
    for _ in range(data.draw(st.integers(1, 8))):
        block[data.draw(st.integers(0, len(block) - 1))] = data.draw(st.integers(0, 255))
    cut = data.draw(st.integers(0, len(block)))
    file = io.BytesIO()
    Image.new("L", (64, 48)).save(file, "PNG")
    image = Image.open(file)
    image.info["exif"] = bytes(block[:cut])
    camera = Camera.from_exif(image)
    assert camera is None or 0.2 * 64 <= camera.focal_px <= 20 * 64


def test_unreadable_files(tmp_path: Path) -> None:
    junk = tmp_path / "junk.jpg"
    junk.write_bytes(b"\xff\xd8\xff no image at all")
    for path in (junk, tmp_path / "missing.jpg", tmp_path):
        with pytest.raises(InputError) as caught:
            Camera.from_exif(path)
        assert path.name in str(caught.value)
        assert "\n" not in str(caught.value)
