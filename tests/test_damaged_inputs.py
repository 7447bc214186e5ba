"""Two thousand damaged files: each is read or refused in one line, soon, in little memory."""

from __future__ import annotations

import io
import json
import re
import subprocess
import sys
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from click.testing import CliRunner
from PIL import Image, PngImagePlugin

import damaged
from fronto import Camera, InputError, imageio
from fronto.cli import main
from fronto.images import as_rgb

EXAMPLES = Path(__file__).parent.parent / "examples"
GB = 1e9
#: For all files, on a machine that has other things to do: a bound on hangs, no benchmark.
PATIENCE_S = 240


@dataclass(frozen=True)
class Reading:
    """What a process of its own made of files: a record each, and the memory that it took."""

    records: dict[str, dict[str, Any]]
    before_bytes: int
    peak_bytes: int
    stderr: str


def read_all(folder: Path, files: Mapping[str, bytes | None]) -> Reading:
    """Read files (written first, where their content is given) in another process."""
    pytest.importorskip("resource", reason="memory is measured as POSIX systems do")
    for name, content in files.items():
        if content is not None:
            (folder / name).write_bytes(content)
    try:
        done = subprocess.run(
            [sys.executable, damaged.__file__, str(folder)],
            input=json.dumps(list(files)).encode(),
            capture_output=True,
            timeout=PATIENCE_S,
            check=False,
        )
    except subprocess.TimeoutExpired as late:
        pytest.fail(f"hangs after {(late.stdout or b'').splitlines()[-1:]}")
    lines = [json.loads(line) for line in done.stdout.splitlines()]
    stderr = done.stderr.decode(errors="replace")
    assert done.returncode == 0, (lines[-1:], stderr)
    memory = lines.pop()
    records = {line["name"]: line for line in lines}
    return Reading(records, memory["before"], memory["peak"], stderr)


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("damaged")


@pytest.fixture(scope="module")
def inputs(folder: Path) -> dict[str, bool | None]:
    return damaged.write_inputs(folder)


@pytest.fixture(scope="module")
def reading(folder: Path, inputs: dict[str, bool | None]) -> Reading:
    return read_all(folder, dict.fromkeys(inputs))


def names(line: str, file: Path) -> bool:
    """Whether a line has all of a file's name that can be printed."""
    shown = "".join(c if c.isprintable() else "\0" for c in str(file))
    return all(part in line for part in shown.split("\0"))


def test_each_is_a_picture_or_is_refused_in_one_line(
    folder: Path, inputs: dict[str, bool | None], reading: Reading
) -> None:
    assert len(inputs) >= 2000
    assert reading.records.keys() == inputs.keys()
    wrong = {name: r["wrong"] for name, r in reading.records.items() if "wrong" in r}
    assert not wrong, next(iter(wrong.items()))
    for name, record in reading.records.items():
        if "refusal" not in record:
            assert min(record["shape"][:2]) >= 16
            continue
        assert record["refusal"].isprintable()
        assert names(record["refusal"], folder / name)


def test_pictures_are_read_and_others_are_not(
    inputs: dict[str, bool | None], reading: Reading
) -> None:
    known = {name: readable for name, readable in inputs.items() if readable is not None}
    assert {name: "shape" in reading.records[name] for name in known} == known
    # Damage is damage: neither does everything survive it, nor nothing.
    rest = ["shape" in record for name, record in reading.records.items() if name not in known]
    assert 0.2 < np.mean(rest) < 0.8


def test_a_truncated_picture_is_whole_or_refused(folder: Path, reading: Reading) -> None:
    read = [name for name, r in reading.records.items() if "_cut." in name and "shape" in r]
    assert read  # of several frames the first may be whole
    for name in read:
        stem, own = name.partition("_cut.")[0][:-3].rsplit("_", 1)
        assert np.array_equal(as_rgb(folder / name), as_rgb(folder / f"{stem}.{own}"))


def test_time_memory_and_noise(reading: Reading) -> None:
    slowest = max(reading.records.values(), key=lambda record: record["seconds"])
    assert slowest["seconds"] < 5, slowest
    assert reading.peak_bytes < 2 * GB
    # libtiff has its own say; Python has none.
    assert "Warning" not in reading.stderr
    assert "Traceback" not in reading.stderr
    assert "samples per pixel" not in reading.stderr


@pytest.mark.parametrize(
    ("stated", "found"),
    [("other_phone.heic", "HEIC"), ("other_paper.pdf", "PDF"), ("other_page.jpg", "web page")],
)
def test_it_is_said_what_other_files_are(reading: Reading, stated: str, found: str) -> None:
    assert found in reading.records[stated]["refusal"]


def test_the_largest_pictures_fit_into_2_gb(tmp_path: Path) -> None:
    # Each has 9 million pixels; those accepted have at most 150, and take as much more.
    size, deep = (3000, 3000), [16] * 4
    flat = damaged.saved(Image.new("CMYK", (64, 48)), "JPEG", progressive=True)
    files = {
        "cmyk.tif": damaged.tiff(*size, [8] * 4, strip(1, 2, 3, 4), rows=300, photometric=5),
        "palette.png": damaged.saved(Image.new("P", size), "PNG", compress_level=1),
        "grey_16.tif": damaged.tiff(*size, [16], strip(1, 2), rows=300, photometric=1),
        "grey_32.tif": damaged.tiff(*size, [32], strip(1, 2, 0, 0), rows=300, photometric=1),
        "deep_tiles.tif": damaged.tiff(*size, deep, strip(*range(8)), rows=300, tile_width=3000),
        "progressive.jpg": damaged.resized(flat, ">HH", (48, 64), size),
    }
    found = read_all(tmp_path, files)
    shapes = {name: record.get("shape") for name, record in found.records.items()}
    assert shapes == {name: [3000, 3000, 3] for name in files}
    assert (found.peak_bytes - found.before_bytes) * 150 / 9 < 2 * GB


def test_the_largest_webp_fits_into_2_gb(tmp_path: Path) -> None:
    found = read_all(tmp_path, {"large.webp": damaged.lossless_webp(3000, 3000)})
    assert found.records["large.webp"]["shape"] == [3000, 3000, 3]
    assert (found.peak_bytes - found.before_bytes) * 64 / 9 < 2 * GB


def strip(*values: int) -> bytes:
    """300 rows of a picture 3000 pixels wide."""
    return bytes(values) * 900_000


def test_the_command_line_passes_over_them(tmp_path: Path, folder: Path, reading: Reading) -> None:
    refused = [name for name, record in reading.records.items() if "refusal" in record]
    # One damaged copy of each will do; folders and videos are inputs of other kinds.
    chosen = [name for name in refused if not re.search(r"_(?!35)\d\d_", name)]
    others = ("folder.jpg", "linked_folder.png", "other_film.mp4", "other_film.mpg")
    files = [folder / name for name in chosen if name not in others]
    assert len(files) >= 60
    photos = [*files[:30], EXAMPLES / "hall.png", *files[30:]]
    arguments = ["rectify", *map(str, photos), "-o", str(tmp_path), "--jobs", "1"]
    result = CliRunner().invoke(main, arguments)
    assert result.exit_code == 1, result.output
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "hall.json",
        "hall.overlay.png",
        "hall.rectified.png",
    ]
    assert len(result.stdout.splitlines()) == 1
    lines = result.stderr.splitlines()
    assert len(lines) == len(files)
    assert all(map(names, lines, files))


def test_strips_make_no_difference(
    folder: Path, inputs: dict[str, bool | None], monkeypatch: pytest.MonkeyPatch
) -> None:
    for turn in range(1, 9):
        exif = Image.Exif()
        exif[0x0112] = turn
        content = damaged.saved(damaged.picture(), "PNG", exif=exif)
        (folder / f"turned_{turn}.png").write_bytes(content)
    files = [f"turned_{turn}.png" for turn in range(1, 9)]
    files += [name for name in damaged.originals() if inputs[name]]
    whole = [as_rgb(folder / name) for name in files]
    monkeypatch.setattr(imageio, "STRIP_PIXELS", 64 * 5)
    for name, expected in zip(files, whole, strict=True):
        assert np.array_equal(as_rgb(folder / name), expected), name


@pytest.mark.parametrize("name", ["baseline.jpg", "rgb.png", "lzw.tif", "lossy.webp"])
def test_what_takes_too_long_is_given_up(
    folder: Path, inputs: dict[str, bool | None], monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setattr(imageio, "MAX_SECONDS", -1.0)
    for read in (as_rgb, Camera.from_exif):
        with pytest.raises(InputError, match=name):
            read(folder / name)


@pytest.mark.parametrize("name", ["text.ppm", "runs.bmp", "rgb.qoi"])
def test_what_python_decodes_has_to_be_smaller(
    folder: Path, inputs: dict[str, bool | None], monkeypatch: pytest.MonkeyPatch, name: str
) -> None:
    monkeypatch.setattr(imageio, "PIXELS_OF_OTHERS", 1000)
    assert as_rgb(folder / "rgb.png").shape == as_rgb(folder / "rgb.ppm").shape
    with pytest.raises(InputError, match=name):
        as_rgb(folder / name)


class TestExifOfPng:
    def test_behind_the_pixels(self, tmp_path: Path) -> None:
        exif = Image.Exif()
        exif.get_ifd(0x8769)[0xA405] = 26
        content = damaged.saved(damaged.picture(), "PNG")
        end = damaged.chunk(b"IEND", b"")
        behind = damaged.chunk(b"eXIf", exif.tobytes()[6:])
        (tmp_path / "a.png").write_bytes(content.removesuffix(end) + behind + end)
        camera = Camera.from_exif(tmp_path / "a.png")
        assert camera is not None
        assert "26 mm" in camera.detail

    def test_without_any_pixels_are_not_decoded(
        self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        damaged.picture().save(tmp_path / "a.png")
        decoded = []
        monkeypatch.setattr(PngImagePlugin.PngImageFile, "load_prepare", decoded.append)
        assert Camera.from_exif(tmp_path / "a.png") is None
        assert not decoded


def test_a_pillow_image_with_a_damaged_file_is_refused_like_it(folder: Path) -> None:
    content = damaged.saved(damaged.picture(), "JPEG")
    with Image.open(io.BytesIO(content[: len(content) // 2])) as image, pytest.raises(InputError):
        as_rgb(image)
