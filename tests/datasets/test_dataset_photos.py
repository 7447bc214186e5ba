"""Sizes of photos from their headers, as they are read; copies that overwrite nothing."""

from __future__ import annotations

from pathlib import Path

import pytest
from PIL import Image

from fronto.datasets.photos import check_size, copy_photos, find_photo, list_photos, photo_size
from fronto.datasets.records import LabeledImage
from fronto.errors import InputError
from fronto.imageio import read_image


def photo(path: Path, orientation: int = 1) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    exif = Image.Exif()
    exif[0x0112] = orientation
    Image.new("RGB", (12, 7), (90, 20, 30)).save(path, exif=exif)
    return path


@pytest.mark.parametrize("suffix", [".jpg", ".png", ".webp", ".tif"])
@pytest.mark.parametrize("orientation", range(1, 9))
def test_size_is_that_of_the_photo_as_read(tmp_path: Path, suffix: str, orientation: int) -> None:
    path = photo(tmp_path / f"a{suffix}", orientation)
    height, width, _ = read_image(path).shape
    assert photo_size(path) == (width, height) == ((7, 12) if orientation > 4 else (12, 7))


def test_orientation_after_the_pixels_of_a_png(tmp_path: Path) -> None:
    path = photo(tmp_path / "a.png", 6)
    content = path.read_bytes()
    start = content.index(b"eXIf") - 4
    end = start + 12 + int.from_bytes(content[start : start + 4], "big")
    last = content.index(b"IEND") - 4
    assert end < last
    path.write_bytes(content[:start] + content[end:last] + content[start:end] + content[last:])
    assert photo_size(path) == read_image(path).shape[1::-1] == (7, 12)


def test_only_the_header_is_read(tmp_path: Path) -> None:
    path = tmp_path / "cut.png"
    Image.effect_noise((64, 48), 50).save(path)
    path.write_bytes(path.read_bytes()[:200])
    assert photo_size(path) == (64, 48)


@pytest.mark.parametrize("content", [b"", b"no image", b"\xff\xd8\xff"])
def test_no_image(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "a.jpg"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"a\.jpg"):
        photo_size(path)
    with pytest.raises(InputError, match="none"):
        photo_size(tmp_path / "b.jpg")


def test_labels_of_a_photo_on_its_side_are_refused(tmp_path: Path) -> None:
    path = photo(tmp_path / "a.jpg", 6)
    assert check_size(path, (7, 12), "labels") == (7, 12)
    with pytest.raises(InputError, match=r"labels.*7x12.*12x7.*orientation"):
        check_size(path, (12, 7), "labels")


def test_find(tmp_path: Path) -> None:
    path = photo(tmp_path / "b" / "deep" / "a.jpg")
    folders = [tmp_path / "a", tmp_path / "b", tmp_path / "b" / "deep"]
    assert find_photo("deep/a.jpg", folders, "x") == path
    assert find_photo("deep\\a.jpg", folders, "x") == path
    assert find_photo("elsewhere/a.jpg", folders, "x") == path
    with pytest.raises(InputError, match=r"x: .*'c.jpg'"):
        find_photo("c.jpg", folders, "x")
    assert list_photos(tmp_path) == [path]


def test_copies(tmp_path: Path) -> None:
    paths = [photo(tmp_path / name, 6) for name in ("x/a.jpg", "y/A.jpg", "z/a.png", "z/b.png")]
    images = [LabeledImage(path, 7, 12, ()) for path in paths]
    names = [name for _, name in copy_photos(images, tmp_path / "out" / "images")]
    assert len({Path(name).stem.lower() for name in names}) == 4
    assert names[0] == "a.jpg"
    for path, name in zip(paths, names, strict=True):
        assert (tmp_path / "out" / "images" / name).read_bytes() == path.read_bytes()
    with pytest.raises(InputError, match="empty"):
        list(copy_photos(images, tmp_path / "out" / "images"))
    gone = LabeledImage(tmp_path / "none.jpg", 7, 12, ())
    with pytest.raises(InputError):
        list(copy_photos([gone], tmp_path / "other"))
