"""Contours finer than pixels, and segments as JSON, pictures and labels."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fronto.categories import CATEGORIES
from fronto.contours import level_contour
from fronto.draw_segments import COLORS, draw_segments
from fronto.errors import InputError
from fronto.imageio import read_image
from fronto.segments import Segment, Segments
from fronto.segmentsfile import (
    labeled_image,
    segment_polygon,
    segments_to_dict,
    write_segments,
)


def area(polygon: np.ndarray) -> float:
    x, y = polygon.T
    return float(x @ np.roll(y, -1) - y @ np.roll(x, -1)) / 2


def two_segments() -> Segments:
    """A square over the pixels 10..19 x 20..29, and a plate of one pixel in the corner."""
    square = np.zeros((14, 14))
    square[2:12, 2:12] = 1
    return Segments(
        64,
        48,
        (
            Segment("up", 0.987, (9.5, 19.5, 19.5, 29.5), (8, 18), square, (0.1,) * 11),
            Segment("plate", 0.6, (-0.5, -0.5, 0.5, 0.5), (0, 0), [[0.9]], truncated=True),
        ),
        notes=("small",),
        timing_ms={"total": 12.3456},
    )


def test_a_single_pixel() -> None:
    # Between 1 and 0 one half is half-way: a diamond.
    contour = level_contour([[1.0]])
    assert sorted(map(tuple, contour)) == [(-0.5, 0), (0, -0.5), (0, 0.5), (0.5, 0)]
    assert area(contour) == pytest.approx(0.5)


def test_the_level_is_met_between_pixels() -> None:
    values = np.zeros((5, 6))
    values[:, 2:4] = 0.8
    contour = level_contour(values)
    middle = contour[np.isclose(contour[:, 1], 2)]
    assert sorted(middle[:, 0]) == pytest.approx([2 - 0.375, 3 + 0.375])


@pytest.mark.parametrize("radius", [3.3, 12.0, 40.5])
def test_a_circle(radius: float) -> None:
    y, x = np.mgrid[:100, :100]
    distance = np.hypot(x - 50.3, y - 49.1)
    contour = level_contour(np.clip((radius - distance) / 4 + 0.5, 0, 1))
    assert np.hypot(*(contour - [50.3, 49.1]).T) == pytest.approx(radius, abs=0.06)
    assert area(contour) > 0  # clockwise as seen, y being down


def test_of_several_pieces_the_largest_without_its_hole() -> None:
    values = np.zeros((30, 30))
    values[2:4, 2:4] = 1
    values[10:25, 10:25] = 1
    values[15:18, 15:18] = 0
    contour = level_contour(values)
    assert contour.min() == pytest.approx(9.5)
    assert contour.max() == pytest.approx(24.5)
    assert area(contour) == pytest.approx(15 * 15 - 0.5)  # its corners are cut


def test_nothing_above_the_level() -> None:
    with pytest.raises(InputError):
        level_contour(np.full((3, 3), 0.5))


@settings(derandomize=True, deadline=None, max_examples=60)
@given(st.integers(1, 9), st.integers(1, 9), st.integers(0, 2**32 - 1))
def test_any_map_has_one_closed_contour(height: int, width: int, seed: int) -> None:
    values = np.random.default_rng(seed).uniform(0, 1, (height, width))
    values[height // 2, width // 2] = 0.9
    contour = level_contour(values)
    assert np.isfinite(contour).all()
    assert area(contour) > 0
    steps = np.abs(np.roll(contour, -1, axis=0) - contour)
    assert steps.max() <= 1  # from cell to cell
    assert (contour >= -0.5 - 1e-12).all()
    assert (contour <= np.array([width, height]) - 0.5 + 1e-12).all()


def test_polygons_are_in_the_photo() -> None:
    polygon = segment_polygon(two_segments().segments[0])
    assert polygon.min(axis=0) == pytest.approx([9.5, 19.5])
    assert polygon.max(axis=0) == pytest.approx([19.5, 29.5])


def test_values() -> None:
    values = segments_to_dict(two_segments(), "hall.jpg", "net.onnx")
    assert values["schema"] == "fronto.segments/1"
    assert (values["image"], values["weights"]) == ("hall.jpg", "net.onnx")
    assert (values["width_px"], values["height_px"]) == (64, 48)
    assert values["categories"] == list(CATEGORIES[1:])
    assert values["timing_ms"] == {"total": 12.346}
    first, second = values["segments"]
    assert (first["id"], first["category"], first["confidence"]) == (1, "up", 0.987)
    assert first["box_px"] == [9.5, 19.5, 19.5, 29.5]
    assert first["area_px"] == 100
    assert first["scores"]["plate"] == 0.1
    assert not first["truncated"]
    assert (second["category"], second["area_px"], second["scores"]) == ("plate", 1, {})
    assert second["truncated"]
    assert json.loads(json.dumps(values)) == values


def test_an_empty_mask_has_no_polygon() -> None:
    empty = Segments(9, 9, (Segment("up", 0.5, (1.0, 1.0, 4.0, 4.0), (1, 1), np.zeros((3, 3))),))
    (values,) = segments_to_dict(empty)["segments"]
    assert (values["area_px"], values["polygon_px"]) == (0, None)
    (item,) = labeled_image(empty, Path("a.jpg")).objects
    assert item.polygon is None
    assert item.box == (1, 1, 4, 4)


def test_files(tmp_path: Path) -> None:
    photo = np.full((48, 64, 3), 100, np.uint8)
    files = write_segments(two_segments(), photo, tmp_path / "out", "hall", name="hall.jpg")
    assert json.loads(files.json.read_bytes())["image"] == "hall.jpg"
    instances = read_image(files.map)
    assert instances.dtype == np.uint16
    assert (instances[20:30, 10:20] == 1).all()
    assert (instances[0, 0] == 2).all()
    assert np.count_nonzero(instances[..., 0]) == 101
    assert read_image(files.overlay).shape == (48, 64, 3)


def test_a_folder_that_cannot_be(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    photo = np.zeros((48, 64, 3), np.uint8)
    with pytest.raises(InputError, match="file"):
        write_segments(two_segments(), photo, tmp_path / "file" / "out", "hall")


def test_labels() -> None:
    image = labeled_image(two_segments(), Path("hall.jpg"))
    assert (image.width, image.height) == (64, 48)
    first, second = image.objects
    assert (first.category, second.category, second.truncated) == ("up", "plate", True)
    assert first.polygon is not None
    assert area(first.polygon) == pytest.approx(100 - 0.5)


def test_drawing_tints_what_was_found() -> None:
    photo = np.full((240, 320, 3), 100, np.uint8)
    mask = np.ones((60, 60), np.float32)
    found = Segments(
        320, 240, (Segment("stop", 0.9, (99.5, 99.5, 159.5, 159.5), (100, 100), mask),)
    )
    before = photo.copy()
    drawing = draw_segments(photo, found)
    assert np.array_equal(photo, before)
    tinted = drawing[130, 130].astype(int) - 100
    assert np.sign(tinted).tolist() == [1, -1, -1]  # red
    assert np.array_equal(drawing[200:, 200:], photo[200:, 200:])
    assert not np.array_equal(drawing[75:99, 95:170], photo[75:99, 95:170])  # its name
    assert set(COLORS) == set(CATEGORIES[1:])


def test_drawing_on_another_photo_is_refused() -> None:
    with pytest.raises(InputError, match="64x48"):
        draw_segments(np.zeros((64, 48, 3), np.uint8), two_segments())
