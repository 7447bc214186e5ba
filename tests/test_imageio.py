"""Photos in (upright, RGB, or one line of error) and PNG out (whole or not at all)."""

from __future__ import annotations

import io
import os
import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from fronto.camera import Camera
from fronto.errors import InputError
from fronto.imageio import read_image, write_png

# 2 high, 3 wide, six different colours.
COLOURS = np.array(
    [
        [[255, 0, 0], [0, 255, 0], [0, 0, 255]],
        [[10, 20, 30], [40, 50, 60], [70, 80, 90]],
    ],
    np.uint8,
)


def save(path: Path, array: np.ndarray, **options: object) -> Path:
    Image.fromarray(array).save(path, **options)
    return path


def fails(path: Path, **options: int) -> str:
    with pytest.raises(InputError) as caught:
        read_image(path, **options)
    message = str(caught.value)
    assert str(path) in message
    assert "\n" not in message
    return message


def test_rgb_is_read_as_it_is(tmp_path: Path) -> None:
    image = read_image(save(tmp_path / "a.png", COLOURS))
    assert image.dtype == np.uint8
    assert np.array_equal(image, COLOURS)
    assert not image.flags.writeable


# What a viewer shows for each EXIF orientation, written out by hand for [[a b c] [d e f]].
UPRIGHT = {
    1: ["abc", "def"],
    2: ["cba", "fed"],
    3: ["fed", "cba"],
    4: ["def", "abc"],
    5: ["ad", "be", "cf"],
    6: ["da", "eb", "fc"],
    7: ["fc", "eb", "da"],
    8: ["cf", "be", "ad"],
}


@pytest.mark.parametrize("orientation", list(UPRIGHT))
@pytest.mark.parametrize("suffix", ["png", "tif"])
def test_exif_orientation_is_applied(tmp_path: Path, orientation: int, suffix: str) -> None:
    exif = Image.Exif()
    exif[0x0112] = orientation
    path = save(tmp_path / f"a.{suffix}", COLOURS, exif=exif)
    named = dict(zip("abcdef", COLOURS.reshape(-1, 3), strict=True))
    expected = np.array([[named[letter] for letter in row] for row in UPRIGHT[orientation]])
    assert np.array_equal(read_image(path), expected)


@pytest.mark.parametrize("orientation", [1, 3, 6, 8])
def test_size_agrees_with_the_exif_camera(tmp_path: Path, orientation: int) -> None:
    exif = Image.Exif()
    exif[0x0112] = orientation
    exif.get_ifd(0x8769)[0xA405] = 28  # FocalLengthIn35mmFilm
    path = save(tmp_path / "a.jpg", np.zeros((60, 80, 3), np.uint8), exif=exif)
    height, width = read_image(path).shape[:2]
    camera = Camera.from_exif(path)
    assert camera is not None
    assert (camera.width_px, camera.height_px) == (width, height)


def test_nonsense_orientation_and_broken_exif_are_ignored(tmp_path: Path) -> None:
    exif = Image.Exif()
    exif[0x0112] = 77
    assert np.array_equal(read_image(save(tmp_path / "a.png", COLOURS, exif=exif)), COLOURS)
    broken = save(tmp_path / "b.png", COLOURS, exif=b"Exif\0\0MM\0*\xff\xff\xff\xff")
    assert np.array_equal(read_image(broken), COLOURS)


def test_grey_becomes_three_equal_channels(tmp_path: Path) -> None:
    grey = np.array([[0, 100, 255]], np.uint8)
    image = read_image(save(tmp_path / "a.png", grey))
    assert np.array_equal(image, np.repeat(grey[..., None], 3, axis=2))


def test_16_bit_grey_keeps_its_depth(tmp_path: Path) -> None:
    grey = np.array([[0, 1, 256, 65535]], np.uint16)
    for suffix in ("png", "tif"):
        image = read_image(save(tmp_path / f"a.{suffix}", grey))
        assert image.dtype == np.uint16
        assert np.array_equal(image, np.repeat(grey[..., None], 3, axis=2))


def test_alpha_is_dropped_and_colours_stay(tmp_path: Path) -> None:
    rgba = np.dstack([COLOURS, np.array([[0, 128, 255], [0, 0, 0]], np.uint8)])
    assert np.array_equal(read_image(save(tmp_path / "a.png", rgba)), COLOURS)
    grey_alpha = np.array([[[7, 0], [200, 255]]], np.uint8)
    image = read_image(save(tmp_path / "b.png", grey_alpha))
    assert image.tolist() == [[[7] * 3, [200] * 3]]


def test_palettes_are_looked_up(tmp_path: Path) -> None:
    indexed = Image.new("P", (2, 1))
    indexed.putpalette([9, 8, 7, 200, 100, 50])
    indexed.putdata([1, 0])
    indexed.save(tmp_path / "a.png")
    indexed.save(tmp_path / "b.png", transparency=b"\x00\xff")
    for name in ("a.png", "b.png"):
        assert read_image(tmp_path / name).tolist() == [[[200, 100, 50], [9, 8, 7]]]


def test_cmyk_and_bilevel_are_converted(tmp_path: Path) -> None:
    cmyk = Image.new("CMYK", (8, 8), (0, 255, 255, 0))  # no cyan: red
    cmyk.save(tmp_path / "a.tif")
    assert read_image(tmp_path / "a.tif")[0, 0].tolist() == [255, 0, 0]
    Image.fromarray(np.array([[True, False]])).save(tmp_path / "b.png")
    assert read_image(tmp_path / "b.png").tolist() == [[[255] * 3, [0] * 3]]


def test_of_several_frames_the_first_is_taken(tmp_path: Path) -> None:
    frames = [Image.new("RGB", (4, 3), colour) for colour in ((255, 0, 0), (0, 0, 255))]
    frames[0].save(tmp_path / "a.gif", save_all=True, append_images=frames[1:])
    assert read_image(tmp_path / "a.gif")[1, 1].tolist() == [255, 0, 0]


def test_floating_point_and_32_bit_pixels_are_refused(tmp_path: Path) -> None:
    fails(save(tmp_path / "a.tif", np.zeros((2, 2), np.float32)))
    fails(save(tmp_path / "b.tif", np.full((2, 2), 70_000, np.int32)))


def test_missing_folder_empty_and_other_files_are_refused(tmp_path: Path) -> None:
    fails(tmp_path / "none.jpg")
    fails(tmp_path)
    (tmp_path / "empty.jpg").touch()
    assert "empty" in fails(tmp_path / "empty.jpg")
    (tmp_path / "text.jpg").write_text("not a picture")
    fails(tmp_path / "text.jpg")
    with pytest.raises(InputError):
        read_image("a\0b.png")


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no named pipes on this system")
def test_a_pipe_is_refused_and_not_waited_for(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.png")
    fails(tmp_path / "pipe.png")


@pytest.mark.skipif(
    not hasattr(os, "geteuid") or os.geteuid() == 0, reason="the superuser may read everything"
)
def test_an_unreadable_file_is_refused(tmp_path: Path) -> None:
    path = save(tmp_path / "a.png", COLOURS)
    path.chmod(0)
    fails(path)


@pytest.mark.parametrize("suffix", ["jpg", "png", "tif"])
def test_a_truncated_file_is_refused(tmp_path: Path, suffix: str) -> None:
    noise = np.random.default_rng(0).integers(0, 256, (64, 64, 3), np.uint8)
    path = save(tmp_path / f"a.{suffix}", noise)
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 2])
    fails(path)


def chunk(kind: bytes, content: bytes) -> bytes:
    checksum = struct.pack(">I", zlib.crc32(kind + content))
    return struct.pack(">I", len(content)) + kind + content + checksum


@pytest.mark.parametrize("side", [13_000, 60_000])  # Pillow warns of one and refuses the other
def test_a_decompression_bomb_is_refused_before_decoding(tmp_path: Path, side: int) -> None:
    header = struct.pack(">IIBBBBB", side, side, 8, 2, 0, 0, 0)
    path = tmp_path / "bomb.png"
    path.write_bytes(
        b"\x89PNG\r\n\x1a\n"
        + chunk(b"IHDR", header)
        + chunk(b"IDAT", zlib.compress(bytes(1000)))
        + chunk(b"IEND", b"")
    )
    assert "million pixels" in fails(path)


def test_the_limit_can_be_set(tmp_path: Path) -> None:
    path = save(tmp_path / "a.png", COLOURS)
    assert read_image(path, max_pixels=6).shape == (2, 3, 3)
    fails(path, max_pixels=5)


@settings(derandomize=True, deadline=None, max_examples=150)
@given(data=st.data())
def test_a_damaged_file_is_an_image_or_an_input_error(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    stream = io.BytesIO()
    kind = data.draw(st.sampled_from(["PNG", "JPEG", "GIF", "BMP", "TIFF", "WEBP"]))
    Image.fromarray(np.kron(COLOURS, np.ones((8, 8, 1), np.uint8))).save(stream, kind)
    content = bytearray(stream.getvalue())
    for _ in range(data.draw(st.integers(1, 4))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    path = tmp_path_factory.mktemp("damaged") / "a"
    path.write_bytes(content)
    try:
        image = read_image(path, max_pixels=1_000_000)
    except InputError:
        return
    assert image.ndim == 3
    assert image.shape[2] == 3


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
@pytest.mark.parametrize("shape", [(5, 7), (5, 7, 3), (5, 7, 4)])
def test_png_keeps_every_value(tmp_path: Path, dtype: type, shape: tuple[int, ...]) -> None:
    rng = np.random.default_rng(1)
    image = rng.integers(0, np.iinfo(dtype).max, shape, dtype, endpoint=True)
    image.setflags(write=False)
    write_png(tmp_path / "a.png", image)
    # OpenCV keeps 16-bit colour, in the order blue, green, red.
    back = cv2.imread(str(tmp_path / "a.png"), cv2.IMREAD_UNCHANGED)
    order = {2: ..., 3: (..., [2, 1, 0]), 4: (..., [2, 1, 0, 3])}
    assert np.array_equal(back[order[2 if image.ndim == 2 else shape[2]]], image)
    assert [path.name for path in tmp_path.iterdir()] == ["a.png"]


def test_png_replaces_an_older_file(tmp_path: Path) -> None:
    path = tmp_path / "a.png"
    path.write_text("older")
    write_png(path, COLOURS)
    assert np.array_equal(read_image(path), COLOURS)


def test_png_that_cannot_be_written_leaves_nothing_behind(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="missing"):
        write_png(tmp_path / "missing" / "a.png", COLOURS)
    (tmp_path / "folder.png").mkdir()
    with pytest.raises(InputError, match=r"folder\.png"):
        write_png(tmp_path / "folder.png", COLOURS)
    assert [path.name for path in tmp_path.iterdir()] == ["folder.png"]


@pytest.mark.parametrize("image", [np.zeros((2, 2)), np.zeros((2, 2, 2), np.uint8)])
def test_png_of_other_pixels_is_refused(tmp_path: Path, image: np.ndarray) -> None:
    with pytest.raises(InputError, match=r"a\.png"):
        write_png(tmp_path / "a.png", image)


def test_what_png_cannot_hold_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "wide.png"
    with pytest.raises(InputError, match="encoder") as caught:
        write_png(path, np.zeros((1, 1_100_000), np.uint8))  # libpng takes a million columns
    assert str(path) in str(caught.value)
    assert not path.exists()
