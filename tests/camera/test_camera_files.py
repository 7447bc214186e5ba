"""Calibration files of every kind, good and bad."""

from __future__ import annotations

import json
import math
from pathlib import Path

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fronto.camera import Camera
from fronto.camera.files import check_camera_file
from fronto.errors import InputError

K = [[500.5, 0.0, 320.25], [0.0, 501.5, 239.75], [0.0, 0.0, 1.0]]
D = [-0.25, 0.08, 0.001, -0.002, 0.01]

ROS = """\
image_width: 640
image_height: 480
camera_name: hall
camera_matrix:
  rows: 3
  cols: 3
  data: [500.5, 0, 320.25, 0, 501.5, 239.75, 0, 0, 1]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.25, 0.08, 0.001, -0.002, 0.01]
rectification_matrix:
  rows: 3
  cols: 3
  data: [1, 0, 0, 0, 1, 0, 0, 0, 1]
projection_matrix:
  rows: 3
  cols: 4
  data: [450, 0, 318, 0, 0, 455, 241, 0, 0, 0, 1, 0]
"""
MESSAGE = """\
header:
  stamp: {sec: 1, nanosec: 2}
  frame_id: camera
height: 480
width: 640
distortion_model: plumb_bob
d: [-0.25, 0.08, 0.001, -0.002, 0.01]
k:
- 500.5
- 0.0
- 320.25
- 0.0
- 501.5
- 239.75
- 0.0
- 0.0
- 1.0
r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]
p: [450.0, 0.0, 318.0, 0.0, 0.0, 455.0, 241.0, 0.0, 0.0, 0.0, 1.0, 0.0]
binning_x: 0
binning_y: 0
roi:
  x_offset: 0
  y_offset: 0
  height: 0
  width: 0
  do_rectify: false
---
header: [cut
"""
KALIBR = """\
cam0:
  cam_overlaps: [1]
  camera_model: pinhole
  distortion_coeffs: [-0.25, 0.08, 0.001, -0.002]
  distortion_model: radtan
  intrinsics: [500.5, 501.5, 320.25, 239.75]
  resolution: [640, 480]
  rostopic: /cam0/image_raw
cam1:
  camera_model: pinhole
  distortion_coeffs: [0.01, 0.002, -0.003, 0.0001]
  distortion_model: equidistant
  intrinsics: [300, 301, 310, 230]
  resolution: [640, 480]
cam2:
  camera_model: omni
  distortion_coeffs: [0, 0, 0, 0]
  distortion_model: radtan
  intrinsics: [1.5, 300, 301, 310, 230]
  resolution: [640, 480]
"""


def write(path: Path, text: str | bytes, name: str = "camera.yaml") -> Path:
    file = path / name
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return file


def refusal(file: Path, *words: str, **options: object) -> None:
    with pytest.raises(InputError) as caught:
        Camera.from_file(file, **options)
    message = str(caught.value)
    assert str(file) in message
    assert "\n" not in message
    assert len(message) < 600
    for word in words:
        assert word in message


@pytest.mark.parametrize("text", [ROS, MESSAGE, MESSAGE.replace("k:", "K:").replace("d:", "D:")])
def test_ros(tmp_path: Path, text: str) -> None:
    file = write(tmp_path, text)
    camera = Camera.from_file(file)
    assert camera.matrix.tolist() == K
    assert camera.distortion.tolist() == D
    assert (camera.width_px, camera.height_px) == (640, 480)
    assert (camera.distortion_model, camera.source) == ("plumb_bob", "file")
    assert "camera.yaml" in camera.detail
    rectified = Camera.from_file(file, projection=True)
    assert rectified.matrix.tolist() == [[450, 0, 318], [0, 455, 241], [0, 0, 1]]
    assert not rectified.distorted


@pytest.mark.parametrize(
    ("model", "count", "expected"),
    [
        ("rational_polynomial", 8, "rational_polynomial"),
        ("equidistant", 4, "equidistant"),
        ("fisheye", 4, "equidistant"),
        ("plumb_bob", 4, "plumb_bob"),
        ("''", 5, "plumb_bob"),
    ],
)
def test_ros_models(tmp_path: Path, model: str, count: int, expected: str) -> None:
    d = "[" + ", ".join(["0.01"] * count) + "]"
    text = MESSAGE.replace("plumb_bob", model).replace("[-0.25, 0.08, 0.001, -0.002, 0.01]", d)
    assert Camera.from_file(write(tmp_path, text)).distortion_model == expected


def test_ros_without_distortion(tmp_path: Path) -> None:
    for d in ("[0, 0, 0, 0, 0]", "[]"):
        text = MESSAGE.replace("[-0.25, 0.08, 0.001, -0.002, 0.01]", d)
        assert Camera.from_file(write(tmp_path, text)).distortion_model == "none"


def test_ros_region_and_binning(tmp_path: Path) -> None:
    roi = "roi: {x_offset: 100, y_offset: 40, width: 400, height: 300, do_rectify: false}\n---"
    text = MESSAGE[: MESSAGE.index("roi:")] + roi
    camera = Camera.from_file(write(tmp_path, text))
    assert (camera.width_px, camera.height_px) == (400, 300)
    assert camera.matrix[:2, 2].tolist() == [220.25, 199.75]
    text = text.replace("binning_x: 0", "binning_x: 2").replace("binning_y: 0", "binning_y: 2")
    binned = Camera.from_file(write(tmp_path, text))
    assert (binned.width_px, binned.height_px) == (200, 150)
    assert binned.matrix[0].tolist() == [250.25, 0.0, 220.75 / 2 - 0.5]
    assert binned.matrix[1].tolist() == [0.0, 250.75, 200.25 / 2 - 0.5]


def test_the_photos_size_scales_the_camera(tmp_path: Path) -> None:
    file = write(tmp_path, ROS)
    camera = Camera.from_file(file, 320, 240)
    assert camera.matrix[0].tolist() == [250.25, 0.0, 320.75 / 2 - 0.5]
    assert (camera.width_px, camera.height_px, camera.source) == (320, 240, "file")
    refusal(file, "640x480", "480x480", width_px=480, height_px=480)
    refusal(file, "rotated", width_px=480, height_px=640)
    refusal(file, "height_px", width_px=640)
    refusal(file, "width_px", width_px=-640, height_px=480)


@pytest.mark.parametrize("suffix", ["yml", "xml", "json"])
@pytest.mark.parametrize(
    "names",
    [
        ("camera_matrix", "distortion_coefficients", "image_width", "image_height"),
        ("Camera_Matrix", "Distortion_Coefficients", "image_Width", "image_Height"),
        ("cameraMatrix", "distCoeffs", "imageWidth", "imageHeight"),
        ("K", "D", "width", "height"),
        ("intrinsics", "dist_coeffs", "Image_width", "Image_height"),
    ],
)
def test_opencv(tmp_path: Path, suffix: str, names: tuple[str, ...]) -> None:
    file = tmp_path / f"camera.{suffix}"
    storage = cv2.FileStorage(str(file), cv2.FILE_STORAGE_WRITE)
    storage.write("calibration_time", "Thu 01 Jan 1970")
    storage.write(names[2], 640)
    storage.write(names[3], 480)
    storage.write(names[0], np.array(K))
    storage.write(names[1], np.array(D).reshape(5, 1))
    storage.release()
    camera = Camera.from_file(file)
    assert camera.matrix.tolist() == K
    assert camera.distortion.tolist() == D
    assert (camera.width_px, camera.height_px) == (640, 480)
    assert "OpenCV" in camera.detail


@pytest.mark.parametrize("suffix", ["yml", "xml"])
def test_opencv_fisheye_and_image_size(tmp_path: Path, suffix: str) -> None:
    file = tmp_path / f"camera.{suffix}"
    storage = cv2.FileStorage(str(file), cv2.FILE_STORAGE_WRITE)
    storage.write("fisheye_model", 1)
    storage.write("cameraMatrix", np.array(K))
    storage.write("distCoeffs", np.array([0.1, 0.0, 0.0, 0.0]))
    storage.release()
    refusal(file, "width_px")
    assert Camera.from_file(file, 640, 480).distortion_model == "equidistant"
    text = file.read_text()
    if suffix == "xml":
        text = text.replace("</opencv_storage>", "<imageSize>640 480</imageSize></opencv_storage>")
    else:
        text += "imageSize: [640, 480]\n"
    assert Camera.from_file(write(tmp_path, text, file.name)).width_px == 640


def test_kalibr(tmp_path: Path) -> None:
    file = write(tmp_path, KALIBR)
    camera = Camera.from_file(file)
    assert camera.matrix.tolist() == K
    assert camera.distortion.tolist() == D[:4]
    assert (camera.distortion_model, camera.width_px, camera.height_px) == ("plumb_bob", 640, 480)
    other = Camera.from_file(file, name="cam1")
    assert other.matrix.tolist() == [[300, 0, 310], [0, 301, 230], [0, 0, 1]]
    assert other.distortion_model == "equidistant"
    assert "cam1" in other.detail
    refusal(file, "cam2 camera_model", "omni", name="cam2")
    refusal(file, "cam7", "cam0", name="cam7")
    refusal(file, "projection", projection=True)
    refusal(write(tmp_path, KALIBR.replace("radtan", "fov")), "cam0 distortion_model", "fov")
    refusal(write(tmp_path, KALIBR.replace("239.75]", "239.75, 1]")), "cam0 intrinsics", "4", "5")
    none = KALIBR.replace("[-0.25, 0.08, 0.001, -0.002]", "[]").replace("radtan", "none", 1)
    assert not Camera.from_file(write(tmp_path, none)).distorted


BARE = [
    "500.5 0 320.25\n0 501.5 239.75\n0 0 1\n",
    "500.5, 0, 320.25, 0, 501.5, 239.75, 0, 0, 1",
    "# fx 0 cx ...\n5.005e+02 0 320.25; 0 501.5 239.75; 0 0 1",
    "[[500.5, 0, 320.25], [0, 501.5, 239.75], [0, 0, 1]]",
    "[[500.5   0.   320.25]\n [  0.   501.5  239.75]\n [  0.     0.     1.  ]]",
    '{"matrix": [[500.5, 0, 320.25], [0, 501.5, 239.75], [0, 0, 1]]}',
    "\ufeff500.5 0 320.25 0 501.5 239.75 0 0 1",
]


@pytest.mark.parametrize("text", BARE)
def test_bare_matrix(tmp_path: Path, text: str) -> None:
    file = write(tmp_path, text, "camera.txt")
    camera = Camera.from_file(file, 640, 480)
    assert camera.matrix.tolist() == K
    assert (camera.source, camera.distorted) == ("file", False)
    refusal(file, "image size", "width_px")
    refusal(file, "projection", width_px=640, height_px=480, projection=True)
    refusal(file, "name", width_px=640, height_px=480, name="cam0")
    broken = write(tmp_path, "500 0 nan 0 500 240 0 0 1")
    refusal(broken, "finite", width_px=640, height_px=480)


@pytest.mark.parametrize(
    "text",
    [
        "- [500.5, 0, 320.25]\n- [0, 501.5, 239.75]\n- [0, 0, 1]\n",
        "# rows\n---\n- [5.005e+2, 0, 320.25]\n- - 0\n  - 501.5\n  - 239.75\n- [0, 0, 1]\n",
        "camera_matrix:\n- [500.5, 0, 320.25]\n- [0, 501.5, 239.75]\n- [0, 0, 1]\n",
    ],
)
def test_matrix_as_yaml_rows(tmp_path: Path, text: str) -> None:
    camera = Camera.from_file(write(tmp_path, text), 640, 480)
    np.testing.assert_array_equal(camera.matrix, K)
    short = text.replace(", 0, 1]", ", 1]")
    refusal(write(tmp_path, short), "matrix", "8", width_px=640, height_px=480)


def test_a_yaml_list_of_something_else_is_refused(tmp_path: Path) -> None:
    refusal(write(tmp_path, "- a\n- b\n- c\n"), "other text")


def test_a_file_without_a_size_names_the_options_too(tmp_path: Path) -> None:
    refusal(write(tmp_path, "500 0 320 0 500 240 0 0 1"), "width_px", "--width", "--height")


def test_a_shared_file_is_checked_without_a_photo(tmp_path: Path) -> None:
    matrix = "500 0 3000 0 500 2000 0 0 1"
    check_camera_file(write(tmp_path, matrix))  # no size: that of the photo will do
    check_camera_file(
        write(tmp_path, f"K: [{matrix.replace(' ', ', ')}]\nimage_size: [5000, 4000]")
    )
    for bad in (
        matrix.replace("500 0", "-500 0", 1),
        matrix.replace("3000", "nan"),
        f"K: [{matrix.replace(' ', ', ')}]\nimage_size: [640, 480]",
        f"K: [{matrix.replace(' ', ', ')}]\nD: [0.1]",
    ):
        path = write(tmp_path, bad)
        with pytest.raises(InputError) as refused:
            check_camera_file(path)
        assert str(path) in refused.value.thing
        assert refused.value.remedy
    with pytest.raises(InputError, match=r"none\.yaml"):
        check_camera_file(tmp_path / "none.yaml")


def test_npy(tmp_path: Path) -> None:
    file = tmp_path / "camera.npy"
    np.save(file, np.array(K))
    assert Camera.from_file(file, 640, 480).matrix.tolist() == K
    np.save(file, np.eye(4))
    refusal(file, "(4, 4)")
    np.save(file, np.array([[{}] * 3] * 3), allow_pickle=True)
    refusal(file, "object")
    good = tmp_path / "good.npy"
    np.save(good, np.array(K))
    refusal(write(tmp_path, good.read_bytes()[:150], "cut.npy"), "npy")
    refusal(write(tmp_path, good.read_bytes()[:20], "cut.npy"), "npy")
    huge = good.read_bytes().replace(b"(3, 3)", b"(99999999999, 99999999999)")
    refusal(write(tmp_path, huge, "huge.npy"))


@pytest.mark.parametrize("distortion", [(), D, [0.01] * 8, [0.01] * 14])
def test_own_dictionary_comes_back(tmp_path: Path, distortion: list[float]) -> None:
    camera = Camera.from_matrix(K, 640, 480, distortion).with_focal(500.0, 0.125)
    file = write(tmp_path, json.dumps(camera.to_dict()), "camera.json")
    again = Camera.from_file(file)
    assert again.matrix.tolist() == camera.matrix.tolist()
    assert again.distortion.tolist() == camera.distortion.tolist()
    assert again.distortion_model == camera.distortion_model
    assert (again.focal_std, again.source) == (0.125, "file")
    assert (again.width_px, again.height_px) == (640, 480)


def replaced(old: str, new: str) -> str:
    assert old in ROS
    return ROS.replace(old, new, 1)


@pytest.mark.parametrize(
    ("text", "word"),
    [
        ("", "empty"),
        ("  \n\n", "empty"),
        (b"\x89PNG\r\n\x1a\n\x00\x00", "binary"),
        (b"\xff\xfe\x00a\x00b", "binary"),
        ("hello world", "3x3 matrix"),
        ("- a\n- b\n", "3x3 matrix"),
        ("1 2 3 4", "9 numbers"),
        ("camera_matrix: [1, 2\nimage_width: {", "line"),
        ("image_width: !!python/object/apply:os.system [echo]", "malformed"),
        ('{"matrix": [[1, 2', "malformed"),
        ("<opencv_storage><camera_matrix>", "XML"),
        ('<?xml version="1.0"?><opencv_storage></opencv_storage>', "camera_matrix"),
        ("a: &a [x]\nb: {<<: *a}\n", "line"),
        (replaced("camera_matrix:", "other:"), "camera_matrix"),
        (replaced("image_height: 480\n", ""), "image_height"),
        (replaced("image_width: 640", "image_width: wide"), "image_width"),
        (replaced("image_width: 640", "image_width: 640.5"), "image_width"),
        (replaced("image_width: 640", "image_width: true"), "image_width"),
        (replaced("image_width: 640", "image_width: -640"), "width_px"),
        (replaced("500.5, 0,", "500.5,"), "camera_matrix"),
        (replaced("500.5, 0,", "500.5, .nan,"), "camera matrix"),
        (replaced("500.5, 0,", "500.5, x,"), "camera_matrix"),
        (replaced("500.5", "0"), "zero or negative focal length"),
        (replaced("501.5", "-501.5"), "zero or negative focal length"),
        (replaced("rows: 3", "rows: 2"), "camera_matrix"),
        (replaced("  data: [500.5", "  values: [500.5"), "data"),
        (replaced("[500.5, 0, 320.25, 0, 501.5, 239.75, 0, 0, 1]", "7"), "camera_matrix"),
        (replaced("320.25", "32025"), "principal point"),
        (replaced("plumb_bob", "kannala_brandt"), "distortion_model"),
        (replaced("plumb_bob", "rational_polynomial"), "distortion"),
        (replaced("plumb_bob", "[1, 2]"), "distortion_model"),
        (replaced("cols: 5", "cols: 4"), "distortion_coefficients"),
        (replaced("-0.25,", "-.inf,"), "distortion"),
        (replaced("-0.25,", ".nan,"), "distortion"),
    ],
)
def test_bad_file(tmp_path: Path, text: str | bytes, word: str) -> None:
    refusal(write(tmp_path, text), word)


def test_missing_projection(tmp_path: Path) -> None:
    text = replaced("projection_matrix", "other")
    refusal(write(tmp_path, text), "projection_matrix", projection=True)
    refusal(write(tmp_path, replaced("450, 0", "0, 0")), "focal length", projection=True)
    refusal(write(tmp_path, replaced("0, 1, 0]", "0, 1]")), "projection_matrix", projection=True)
    refusal(write(tmp_path, ROS), "name", name="cam0")


def test_no_file(tmp_path: Path) -> None:
    refusal(tmp_path / "missing.yaml", "no such file")
    refusal(tmp_path, "directory")
    refusal(write(tmp_path, ROS) / "below.yaml")
    with pytest.raises(InputError):
        Camera.from_file("with\0zero")
    device = Path("/dev/null")
    if device.is_char_device():
        refusal(device, "device")


def test_large_file(tmp_path: Path) -> None:
    refusal(write(tmp_path, "#" * 10_000_001), "10 MB")


def test_hostile_files_end_quickly(tmp_path: Path) -> None:
    entities = "".join(f'<!ENTITY e{i} "{f"&e{i - 1};" * 10 if i else "x"}">' for i in range(12))
    refusal(write(tmp_path, f"<!DOCTYPE a [{entities}]><a><K>&e11;</K></a>"), "DOCTYPE")
    nested = "".join(f"a{i}: &a{i} [{f'*a{i - 1}, ' * 9}1]\n" for i in range(1, 25))
    refusal(write(tmp_path, "a0: &a0 [1]\n" + nested + "K: *a24\n"), "camera_matrix")
    merged = "".join(f"m{i}: &m{i} {{<<: [{f'*m{i - 1}, ' * 9}]}}\n" for i in range(1, 25))
    refusal(write(tmp_path, "m0: &m0 {x: 1}\n" + merged), "line")
    for text in ("[" * 50_000, "{" * 50_000, '{"a":' * 50_000, "K: " + "[" * 50_000):
        refusal(write(tmp_path, text))
    refusal(write(tmp_path, "<a>" * 50_000), "XML")
    refusal(write(tmp_path, "a:\n" + "- [1, 2, 3]\n" * 300_000), "entries")
    closed = "<a>" * 50_000 + "</a>" * 50_000
    refusal(write(tmp_path, closed), "camera_matrix")


@settings(derandomize=True, deadline=None, max_examples=150)
@given(st.data())
def test_damaged_files_are_read_or_refused(
    tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    content = bytearray(data.draw(st.sampled_from([ROS, MESSAGE, KALIBR, BARE[5]])).encode())
    for _ in range(data.draw(st.integers(1, 6))):
        content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    file = write(tmp_path_factory.mktemp("damaged"), bytes(content))
    try:
        camera = Camera.from_file(file, 640, 480)
    except InputError:
        return
    assert math.isfinite(camera.focal_px)
    assert camera.focal_px > 0
