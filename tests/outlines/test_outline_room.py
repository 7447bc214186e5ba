"""`fronto.outline` as its users call it."""

import dataclasses
import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from panelforms import circle, mapped, octagon, quad, view
from panelmaker import Panel, corner_errors, panel
from PIL import Image

import fronto
from fronto import InputError, Outline, Outlines, Segment, Segments, outline

fixed = settings(derandomize=True, deadline=None, max_examples=30)


def made_panel(make=quad, seed=0, **options):
    return panel(np.random.default_rng(seed), make, side=30, columns=3, rows=2, **options)


def same(one, other):
    """Whether two outlines are equal in every number."""
    first, second = (dataclasses.asdict(o) for o in (one, other))
    return all(np.array_equal(first[name], second[name]) for name in first)


def refusal(*arguments, **options):
    with pytest.raises(InputError) as caught:
        outline(*arguments, **options)
    assert "\n" not in str(caught.value)
    return caught.value


# --- results


def test_the_first_example():
    mask = np.zeros((1, 60, 80), bool)
    mask[0, 20:40, 30:50] = True
    found = fronto.outline(fronto.Segments.from_masks(mask))
    expected = [[29.5, 19.5], [49.5, 19.5], [49.5, 39.5], [29.5, 39.5]]
    np.testing.assert_allclose(found.buttons[0].corners_px, expected, atol=1e-6)
    assert (found.width_px, found.height_px) == (80, 60)


@pytest.mark.parametrize("way", ["subpixel", "hough"])
@pytest.mark.parametrize("photo", [False, True])
def test_what_comes_back(way, photo):
    made = made_panel()
    found = outline(made.segments("up"), made.picture() if photo else None, corners=way)
    assert isinstance(found, Outlines)
    assert (found.width_px, found.height_px) == (made.width, made.height)
    assert len(found.buttons) == len(found.from_image) == 6
    for values in (found.buttons, found.plates, found.lines, found.left_out, found.from_image):
        assert isinstance(values, tuple)
    for o, share in zip(found.buttons, found.from_image, strict=True):
        assert isinstance(o, Outline)
        assert o.category == "up"
        assert o.confidence == 0.9
        assert type(o.std_px) is type(o.shape_confidence) is type(share) is float
        assert 0.02 < o.std_px < 3
        assert 0.5 < o.shape_confidence <= 1
        assert 0 <= share <= 1
        assert all(type(value) is bool for value in (o.odd, o.truncated, *o.seen))
    assert set(found.timing_ms) == {"read", "outline", "lines", "total"}
    assert all(math.isfinite(v) and v >= 0 for v in found.timing_ms.values())


def test_results_cannot_be_changed():
    found = outline(made_panel().segments())
    with pytest.raises(dataclasses.FrozenInstanceError):
        found.buttons = ()
    with pytest.raises(dataclasses.FrozenInstanceError):
        found.buttons[0].std_px = 1.0
    with pytest.raises(ValueError, match="read-only"):
        found.buttons[0].corners_px[0, 0] = 1


@pytest.mark.parametrize("make", [quad, circle, octagon])
@pytest.mark.parametrize("way", ["subpixel", "hough"])
def test_the_same_again(way, make):
    made = made_panel(make)
    segments, picture = made.segments(), made.picture()
    before = picture.copy()
    one, other = (outline(segments, picture, corners=way) for _ in range(2))
    assert all(map(same, one.buttons, other.buttons))
    assert one.left_out == other.left_out
    for first, second in zip(one.lines, other.lines, strict=True):
        np.testing.assert_array_equal(first.ends_px, second.ends_px)
    np.testing.assert_array_equal(picture, before)


def test_plates_are_kept_apart_and_order_stays():
    made = made_panel()
    names = ["up", "plate", "number", "down", "plate", "stop"]
    made_of = made.segments().segments
    mixed = [dataclasses.replace(s, category=n) for s, n in zip(made_of, names, strict=True)]
    found = outline(Segments(made.width, made.height, tuple(mixed)), made.picture())
    assert [o.category for o in found.buttons] == ["up", "number", "down", "stop"]
    assert [o.category for o in found.plates] == ["plate", "plate"]
    assert len(found.from_image) == 4
    places = [
        f.corners_px.mean(axis=0) for f, n in zip(made.forms, names, strict=True) if n != "plate"
    ]
    for o, place in zip(found.buttons, places, strict=True):
        assert np.linalg.norm(o.center_px - place) < 2


def test_what_has_no_outline_is_told():
    made = made_panel()
    speck = Segment("alarm", 0.4, (6.5, 3.5, 7.5, 4.5), (5, 2), np.pad([[1.0]], 2))
    whole = made.segments().segments
    found = outline(Segments(made.width, made.height, (*whole[:3], speck, *whole[3:])))
    assert len(found.buttons) == len(found.from_image) == 6
    (reason,) = found.left_out
    assert reason.startswith("alarm at (7, 4): ")
    assert len(reason) > 25


@pytest.mark.parametrize("way", ["subpixel", "hough"])
def test_nothing_to_outline(way):
    found = outline(Segments(64, 48, ()), np.zeros((48, 64, 3), np.uint8), corners=way)
    assert found.buttons == found.plates == found.lines == found.left_out == ()


@fixed
@given(st.floats(-30, 30), st.floats(-25, 25), st.floats(-25, 25), st.sampled_from([20, 45]))
def test_corner_order_as_the_panel_reads_upright(roll, tilt_x, tilt_y, side):
    made = panel(
        np.random.default_rng(0),
        quad,
        side=side,
        columns=2,
        rows=1,
        to_px=view(roll, tilt_x, tilt_y),
    )
    assert np.abs(corner_errors(made, outline(made.segments()).buttons)).max() < 2
    for o in outline(made.segments(), made.picture(), lines=False).buttons:
        wall = mapped(np.linalg.inv(made.forms[0].to_px), o.corners_px)
        signs = np.sign(wall - wall.mean(axis=0))
        assert signs.tolist() == [[-1, -1], [1, -1], [1, 1], [-1, 1]]


# --- photos


def test_any_picture(tmp_path):
    made = made_panel(circle, to_px=view())
    picture = made.picture(ground=(160, 60, 60), face=(60, 60, 160))
    segments = made.segments()
    expected = outline(segments, picture).buttons
    path = tmp_path / "panel.png"
    Image.fromarray(picture).save(path)
    for image in (path, str(path), Image.fromarray(picture), picture / np.float32(255)):
        assert all(map(same, outline(segments, image).buttons, expected))
    bgr = np.ascontiguousarray(picture[..., ::-1])
    assert all(map(same, outline(segments, bgr, order="bgr").buttons, expected))


def test_grey_photos():
    made = made_panel()
    grey = made.picture()[..., 0]
    expected = outline(made.segments(), np.stack([grey] * 3, axis=2)).buttons
    for image in (grey, grey[..., None], Image.fromarray(grey)):
        found = outline(made.segments(), image)
        assert found.from_image == (1.0,) * 6
        assert all(map(same, found.buttons, expected))


# --- wrong arguments


@pytest.mark.parametrize("segments", [None, [], np.zeros((1, 9, 9), bool), "photo.jpg"], ids=str)
def test_segments_that_are_none(segments):
    assert refusal(segments).thing == "segments"


@pytest.mark.parametrize("corners", ["Hough", "", None, 1, ["hough"]], ids=str)
def test_unknown_ways(corners):
    assert refusal(made_panel().segments(), corners=corners).thing == "corners"


@pytest.mark.parametrize("shape", [(30, 30, 3), (30, 30)])
def test_photos_of_another_size(shape):
    made = made_panel()
    error = refusal(made.segments(), np.zeros(shape, np.uint8))
    assert error.thing == "image"
    assert f"{made.width}x{made.height}" in str(error)
    assert "30x30" in str(error)


def test_turned_photos():
    made = panel(np.random.default_rng(0), quad, columns=3, rows=1)
    assert refusal(made.segments(), made.picture().swapaxes(0, 1)).thing == "image"


@pytest.mark.parametrize(
    "image", [3, object(), np.zeros((2, 3, 3), np.uint8), np.zeros((1, 1), np.uint8)], ids=str
)
def test_what_is_no_photo(image):
    assert refusal(made_panel().segments(), image).thing == "image"


def test_missing_files_and_unknown_orders(tmp_path):
    segments = made_panel().segments()
    assert "no.png" in refusal(segments, tmp_path / "no.png").thing
    assert refusal(segments, made_panel().picture(), order="rgba").thing == "order"


def test_own_masks():
    made = made_panel()
    masks = made.segments().instance_map()[None] == np.arange(1, 7)[:, None, None]
    found = outline(Segments.from_masks(masks, ["number"] * 6)).buttons
    for one, other in zip(found, outline(made.segments()).buttons, strict=True):
        np.testing.assert_allclose(one.corners_px, other.corners_px, atol=1e-6)
    soft = np.where(masks, 0.9, 0.1)
    for one, other in zip(outline(Segments.from_masks(soft)).buttons, found, strict=True):
        np.testing.assert_allclose(one.corners_px, other.corners_px, atol=1e-4)


def test_shapes_of_one_photo_may_differ():
    forms = (quad(view(10, origin=(40, 40))), circle(view(10, origin=(100, 40))))
    found = outline(Panel(forms, 140, 80).segments()).buttons
    assert [o.shape for o in found] == ["quad", "ellipse"]
