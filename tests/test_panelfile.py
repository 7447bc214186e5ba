"""The result JSON: every key of the contract, strictly valid, consistent with the pictures."""

from __future__ import annotations

import dataclasses
import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

import fronto
from fronto.camera import Camera
from fronto.errors import InputError
from fronto.imageio import read_image
from fronto.outlinefile import read_outlines
from fronto.panelfile import panel_to_dict, panel_to_json, write_panel
from fronto.results import Panel
from fronto.shapes import Outline

CAMERA = Camera.from_matrix([[400, 0, 320], [0, 400, 240], [0, 0, 1]], 640, 480)
# A panel seen 30 degrees from the side: lines of a column are 10 % longer at the right.
QUADS = [
    np.array([[220, y], [300, y * 0.9 + 24], [300, (y + 60) * 0.9 + 24], [220, y + 60]])
    for y in (100.0, 200.0, 300.0)
]
IMAGE = np.full((480, 640, 3), 120, np.uint8)

TOP = {
    "schema",
    "image",
    "width_px",
    "height_px",
    "status",
    "reasons",
    "notes",
    "camera",
    "pose",
    "homography",
    "homography_domain",
    "rectified",
    "buttons",
    "plates",
    "timing_ms",
}
POSE = {"solver", "rotation", "angles_deg", "std_deg", "normal", "cos_norm", "final_cr"}
MORE_POSE = {
    "covariance_rad2",
    "sigma_px",
    "focal_std",
    "aspect_std",
    "plane_depth_m",
    "alternatives",
    "stopped",
}
BUTTON = {
    "id",
    "category",
    "confidence",
    "shape",
    "corners_px",
    "ellipse_px",
    "box_px",
    "center_px",
    "corner_std_px",
    "rectified_corners_px",
    "label",
    "label_confidence",
    "label_source",
    "position_m",
    "press_normal",
}


def outlines() -> list[Outline]:
    quads = [Outline.quad(quad, category="number", text="3", std_px=0.4) for quad in QUADS]
    return [*quads, Outline.ellipse(250, 420, 20, 18, 10)]


def rectified(**options: Any) -> Panel:
    return fronto.rectify_outlines(IMAGE, outlines(), CAMERA, image_name="hall.jpg", **options)


def strict(content: bytes) -> dict[str, Any]:
    def refuse(word: str) -> None:
        raise AssertionError(f"{word} is no JSON")

    values: dict[str, Any] = json.loads(content, parse_constant=refuse)
    return values


@pytest.mark.parametrize("given", [[], outlines()[3:], outlines()[:1], outlines()])
@pytest.mark.parametrize("solver", ["refine", "grid"])
def test_every_key_is_there_whatever_the_status(given: list[Outline], solver: Any) -> None:
    options: dict[str, Any] = {"step_deg": 5.0} if solver == "grid" else {}
    panel = fronto.rectify_outlines(IMAGE, given, CAMERA, solver=solver, **options)
    values = strict(panel_to_json(panel))
    assert set(values) == TOP
    assert values["pose"].keys() >= POSE | MORE_POSE
    assert values["camera"].keys() >= {"matrix", "distortion", "source", "distortion_model"}
    assert len(values["buttons"]) == len(given)
    for button in values["buttons"]:
        assert button.keys() >= BUTTON
    assert (values["homography"] is None) == (values["rectified"] is None)
    if values["status"] in ("degenerate", "no_buttons"):
        assert values["rectified"] is None
        assert values["pose"]["rotation"] is None
        assert values["pose"]["std_deg"] == [None] * 3
        assert values["reasons"]


def test_values_are_those_of_the_result() -> None:
    panel = rectified()
    assert panel.view is not None
    values = panel_to_dict(panel, "hall.rectified.png")
    assert values["schema"] == "fronto.panel/1"
    assert (values["image"], values["width_px"], values["height_px"]) == ("hall.jpg", 640, 480)
    assert values["status"] == panel.status
    assert values["camera"]["matrix"] == CAMERA.matrix.tolist()
    assert values["camera"]["source"] == "given"
    assert values["homography_domain"] == "source"
    height, width = panel.view.image.shape[:2]
    assert values["rectified"] == {
        "file": "hall.rectified.png",
        "width_px": width,
        "height_px": height,
        "crop": "panel",
        "scale": panel.view.scale,
    }
    pose = values["pose"]
    assert np.array_equal(pose["rotation"], panel.pose.rotation)
    assert pose["normal"] == pose["rotation"][2]
    assert pose["angles_deg"] == list(panel.pose.angles_deg)
    assert pose["std_deg"] == list(panel.pose.std_deg)
    assert np.array_equal(pose["covariance_rad2"], panel.pose.covariance)
    # The homography takes corners in the photo to corners in the picture.
    first = values["buttons"][0]
    mapped = np.column_stack([first["corners_px"], np.ones(4)]) @ np.transpose(values["homography"])
    assert np.allclose(mapped[:, :2] / mapped[:, 2:], first["rectified_corners_px"])
    assert first["corner_std_px"] == 0.4
    assert first["label"] == "3"
    assert first["box_px"] == [220, 100, 300, 168]
    last = values["buttons"][3]
    assert last["ellipse_px"] == {"cx": 250, "cy": 420, "a": 20, "b": 18, "angle_deg": 10}
    assert last["corners_px"] is None
    assert last["label"] is None
    assert last["rectified_ellipse_px"].keys() == last["ellipse_px"].keys()
    assert panel.to_dict()["buttons"] == values["buttons"]


def test_what_is_not_determined_is_null_and_not_nan() -> None:
    values = panel_to_dict(rectified(solver="grid", step_deg=5.0))
    assert values["pose"]["std_deg"] == [None] * 3
    assert values["pose"]["covariance_rad2"] == [[None] * 3] * 3
    assert values["pose"]["final_cr"] > 0
    assert values["buttons"][0]["residual_px"] is None


def test_alternatives_are_stated() -> None:
    panel = rectified()
    other = fronto.estimate_pose(outlines()[:2], CAMERA)
    two = dataclasses.replace(panel.pose, alternatives=(other,))
    (stated,) = panel_to_dict(dataclasses.replace(panel, pose=two))["pose"]["alternatives"]
    assert np.array_equal(stated["rotation"], other.rotation)
    assert stated["angles_deg"] == list(other.angles_deg)
    assert (stated["cost"], stated["focal_px"]) == (other.cost, 400.0)


def test_a_distorted_camera_is_stated_with_its_domain() -> None:
    bent = Camera.from_matrix(CAMERA.matrix, 640, 480, [-0.1, 0.01, 0, 0])
    panel = fronto.rectify_outlines(IMAGE, outlines(), bent)
    values = panel_to_dict(panel)
    assert values["homography_domain"] == "undistorted"
    assert values["camera"]["distortion"] == [-0.1, 0.01, 0, 0]
    assert values["camera"]["distortion_model"] == "plumb_bob"


def test_files_of_a_result(tmp_path: Path) -> None:
    panel = rectified()
    files = write_panel(panel, IMAGE, tmp_path / "new" / "out", "hall.v2")
    assert files.rectified is not None
    assert sorted(path.name for path in files.json.parent.iterdir()) == [
        "hall.v2.json",
        "hall.v2.overlay.png",
        "hall.v2.rectified.png",
    ]
    values = strict(files.json.read_bytes())
    assert values["rectified"]["file"] == "hall.v2.rectified.png"
    picture = cv2.imread(str(files.rectified), cv2.IMREAD_UNCHANGED)
    shape = (values["rectified"]["height_px"], values["rectified"]["width_px"], 4)
    assert picture.shape == shape
    assert read_image(files.overlay).shape == IMAGE.shape


def test_a_result_is_read_back_as_outlines(tmp_path: Path) -> None:
    files = write_panel(rectified(), IMAGE, tmp_path, "hall")
    found = read_outlines(files.json, 640, 480)
    again = fronto.rectify_outlines(IMAGE, found.outlines, CAMERA)
    assert np.array_equal(again.pose.rotation, rectified().pose.rotation)
    assert [outline.text for outline in found.outlines] == ["3", "3", "3", ""]


def test_no_older_picture_stays_beside_a_result_without_one(tmp_path: Path) -> None:
    write_panel(rectified(), IMAGE, tmp_path, "hall")
    (tmp_path / "other.rectified.png").write_text("another photo's")
    panel = fronto.rectify_outlines(IMAGE, [], CAMERA)
    files = write_panel(panel, IMAGE, tmp_path, "hall")
    assert files.rectified is None
    assert sorted(path.name for path in tmp_path.iterdir()) == [
        "hall.json",
        "hall.overlay.png",
        "other.rectified.png",
    ]
    assert strict(files.json.read_bytes())["status"] == "no_buttons"


def test_grey_and_16_bit_photos_are_written(tmp_path: Path) -> None:
    grey = np.full((480, 640), 40_000, np.uint16)
    panel = fronto.rectify_outlines(grey, outlines(), CAMERA)
    files = write_panel(panel, grey, tmp_path, "deep")
    assert files.rectified is not None
    picture = cv2.imread(str(files.rectified), cv2.IMREAD_UNCHANGED)
    assert picture.dtype == np.uint16
    assert picture.max() == 65535
    assert read_image(files.overlay)[470, 630].tolist() == [40_000 >> 8] * 3


def test_a_place_that_cannot_be_written_to_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(InputError, match="file"):
        write_panel(rectified(), IMAGE, tmp_path / "file", "hall")
    (tmp_path / "hall.overlay.png").mkdir()
    (tmp_path / "hall.json").write_text("an older result")
    with pytest.raises(InputError, match="overlay"):
        write_panel(rectified(), IMAGE, tmp_path, "hall")
    # It would describe pictures that are not its own.
    assert not (tmp_path / "hall.json").exists()


def test_a_name_that_is_no_unicode_is_replaced() -> None:
    panel = fronto.rectify_outlines(IMAGE, [], CAMERA, image_name="h\udcffll.jpg")
    assert strict(panel_to_json(panel))["image"] == "h?ll.jpg"
