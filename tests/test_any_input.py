from __future__ import annotations

import io
import pickle

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from fronto import InputError
from fronto.imageio import write_png
from fronto.images import as_rgb

H, W = 18, 25


def colours(channels=3, dtype=np.uint8, seed=0, high=256):
    return np.random.default_rng(seed).integers(0, high, (H, W, channels)).astype(dtype)


def refusal(image, **options):
    with pytest.raises(InputError) as caught:
        as_rgb(image, **options)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def check(found, expected):
    assert found.dtype == np.uint8
    assert found.flags.c_contiguous
    assert not found.flags.writeable
    np.testing.assert_array_equal(found, expected)


def test_rgb_is_itself():
    image = colours()
    found = as_rgb(image)
    check(found, image)
    assert np.shares_memory(found, image)
    assert image.flags.writeable


def test_grey_in_all_shapes():
    grey = colours(1)[..., 0]
    expected = np.stack([grey] * 3, axis=-1)
    check(as_rgb(grey), expected)
    check(as_rgb(grey[..., None]), expected)
    check(as_rgb(np.stack([grey, 255 - grey], axis=-1)), expected)


def test_alpha_is_dropped_and_colours_stay():
    image = colours(4)
    image[..., 3] = 0
    check(as_rgb(image), image[..., :3])


def test_order_of_opencv():
    image = colours(4)
    check(as_rgb(image[..., :3], order="bgr"), image[..., [2, 1, 0]])
    check(as_rgb(image, order="bgr"), image[..., [2, 1, 0]])
    check(as_rgb(image[..., 0], order="bgr"), image[..., [0, 0, 0]])
    assert refusal(image, order="BGR").startswith("order")


@pytest.mark.parametrize("channels", [1, 3, 4])
def test_layouts_and_read_only(channels):
    image = np.random.default_rng(1).integers(0, 256, (2 * H, 3 * W, channels), dtype=np.uint8)
    image.setflags(write=False)
    for part in (
        image[::-1, ::-1],
        image[::2, 1::3],
        image.swapaxes(0, 1),
        np.asfortranarray(image),
    ):
        check(as_rgb(part), np.broadcast_to(np.array(part)[..., :3], (*part.shape[:2], 3)))


class TestSixteenBits:
    @pytest.mark.parametrize(
        ("brightest", "shift"),
        [(200, 0), (255, 0), (256, 1), (1023, 2), (4095, 4), (16383, 6), (32768, 8), (65535, 8)],
    )
    def test_bits_in_use(self, brightest, shift):
        image = colours(3, np.uint16, high=brightest)
        image[3, 4, 1] = brightest
        check(as_rgb(image), image >> shift)

    def test_black(self):
        check(as_rgb(np.zeros((H, W), np.uint16)), np.zeros((H, W, 3)))

    def test_byte_order(self):
        image = colours(3, np.uint16, high=65536)
        image[0, 0] = 65535
        check(as_rgb(image.astype(">u2")), image >> 8)

    def test_alpha_counts_no_bits(self):
        image = colours(4, np.uint16, high=4096)
        image[0, 0] = 4095
        image[..., 3] = 65535
        check(as_rgb(image), image[..., :3] >> 4)

    @settings(derandomize=True, deadline=None, max_examples=30)
    @given(st.integers(0, 65535), st.integers(0, 2**32 - 1))
    def test_is_monotonic_and_bright(self, brightest, seed):
        ramp = np.random.default_rng(seed).integers(0, brightest + 1, 16 * 16)
        ramp[0] = brightest
        found = as_rgb(ramp.reshape(16, 16).astype(np.uint16))[..., 0].ravel()
        assert (np.diff(found[np.argsort(ramp, kind="stable")].astype(int)) >= 0).all()
        assert found.max() >= 128 or found.max() == brightest


class TestFloats:
    @pytest.mark.parametrize("dtype", [np.float16, np.float32, np.float64])
    def test_bytes_survive(self, dtype):
        image = colours()
        check(as_rgb((image / 255).astype(dtype)), image)

    def test_overshoot_is_cut(self):
        image = np.linspace(-0.0015, 1.0015, H * W).reshape(H, W)
        found = as_rgb(image)
        assert (found[0, 0] == 0).all()
        assert (found[-1, -1] == 255).all()

    @pytest.mark.parametrize("value", [255.0, 1.1, -0.1, np.inf, -np.inf])
    def test_out_of_range(self, value):
        image = np.zeros((H, W, 3))
        image[4, 5, 1] = value
        assert f"{value:g}" in refusal(image)

    def test_nan(self):
        image = np.zeros((H, W, 3), np.float32)
        image[4, 5, 1] = np.nan
        assert "NaN" in refusal(image)

    def test_nan_in_alpha_matters_not(self):
        image = np.ones((H, W, 4))
        image[..., 3] = np.nan
        check(as_rgb(image), np.full((H, W, 3), 255))


def test_bool_is_black_and_white():
    mask = colours(1)[..., 0] > 127
    check(as_rgb(mask), np.repeat(mask[..., None] * 255, 3, axis=2))


@pytest.mark.parametrize("dtype", [np.int8, np.int32, np.int64, np.uint32, np.complex64, object])
def test_other_types(dtype):
    assert np.dtype(dtype).name in refusal(colours().astype(dtype))


@pytest.mark.parametrize(
    "shape", [(), (50,), (H, W, 5), (H, W, 0), (0, W, 3), (3, H, W), (1, H, W, 3)], ids=str
)
def test_other_shapes(shape):
    assert str(shape) in refusal(np.zeros(shape, np.uint8))


def test_channels_first_gets_a_hint():
    assert "moveaxis" in refusal(np.zeros((3, H, W), np.uint8))


@pytest.mark.parametrize("image", [None, 3, [[0] * 20] * 20, b"GIF89a"])
def test_no_picture(image):
    assert type(image).__name__ in refusal(image)


class TestSize:
    @pytest.mark.parametrize("shape", [(15, 400, 3), (400, 15)])
    def test_too_small(self, shape):
        assert f"{shape[1]}x{shape[0]}" in refusal(np.zeros(shape, np.uint8))

    def test_smallest(self):
        assert as_rgb(np.zeros((16, 16), np.uint8)).shape == (16, 16, 3)

    def test_too_large(self):
        # Neither needs its memory: one row for all, and Pillow decodes late.
        assert "150" in refusal(np.broadcast_to(np.zeros(3, np.uint8), (10_001, 15_000, 3)))

    def test_too_large_for_pillow(self):
        image = Image.new("1", (15_000, 10_001))
        assert "150" in refusal(image)

    def test_too_small_a_file_is_named(self, tmp_path):
        write_png(tmp_path / "tiny.png", np.zeros((8, 30), np.uint8))
        assert "tiny.png" in refusal(tmp_path / "tiny.png")


class TestFiles:
    @pytest.mark.parametrize("kind", [str, lambda path: path], ids=["str", "Path"])
    def test_photo(self, tmp_path, kind):
        image = colours()
        write_png(tmp_path / "a.png", image)
        check(as_rgb(kind(tmp_path / "a.png")), image)
        check(as_rgb(kind(tmp_path / "a.png"), order="bgr"), image)

    def test_twelve_bit_grey(self, tmp_path):
        grey = colours(1, np.uint16, high=4096)[..., 0]
        grey[0, 0] = 4095
        write_png(tmp_path / "a.png", grey)
        check(as_rgb(tmp_path / "a.png"), np.repeat(grey[..., None] >> 4, 3, axis=2))

    def test_missing(self, tmp_path):
        assert "gone.jpg" in refusal(tmp_path / "gone.jpg")


class TestPillow:
    @pytest.mark.parametrize("mode", ["RGB", "RGBA", "L", "LA", "1", "P", "CMYK", "YCbCr"])
    def test_modes(self, mode):
        image = Image.fromarray(colours()).convert(mode)
        check(as_rgb(image), np.asarray(image.convert("RGB")))

    def test_sixteen_bits(self):
        grey = colours(1, np.uint16, high=4096)[..., 0]
        grey[0, 0] = 4095
        check(as_rgb(Image.fromarray(grey)), np.repeat(grey[..., None] >> 4, 3, axis=2))

    def test_transparent_colours_stay(self):
        image = colours(4)
        image[..., 3] = 0
        check(as_rgb(Image.fromarray(image)), image[..., :3])

    @pytest.mark.parametrize("orientation", range(1, 9))
    def test_is_turned_upright_like_a_file(self, orientation, tmp_path):
        exif = Image.Exif()
        exif[0x0112] = orientation
        content = io.BytesIO()
        Image.fromarray(colours()).save(content, "PNG", exif=exif)
        (tmp_path / "a.png").write_bytes(content.getvalue())
        found = as_rgb(Image.open(content))
        assert found.shape == ((W, H, 3) if orientation > 4 else (H, W, 3))
        check(found, as_rgb(tmp_path / "a.png"))

    def test_floats_have_no_known_range(self):
        refusal(Image.new("F", (W, H)))

    def test_truncated(self):
        content = io.BytesIO()
        noise = np.random.default_rng(0).integers(0, 256, (200, 200, 3), dtype=np.uint8)
        Image.fromarray(noise).save(content, "JPEG")
        with Image.open(io.BytesIO(content.getvalue()[:5000])) as image:
            refusal(image)

    def test_closed(self):
        content = io.BytesIO()
        Image.fromarray(colours()).save(content, "PNG")
        image = Image.open(content)
        image.close()
        refusal(image)


def test_errors_travel_between_processes() -> None:
    error = InputError("photo \udcff.jpg", "expected one, got none", "look again")
    again = pickle.loads(pickle.dumps(error))
    assert str(again) == str(error)
    assert (again.thing, again.expected, again.remedy) == (
        error.thing,
        error.expected,
        error.remedy,
    )
    str(error).encode()
