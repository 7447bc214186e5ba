"""From a photo alone to a result: `fronto.rectify` and `fronto.Rectifier`."""

from __future__ import annotations

import threading
from dataclasses import FrozenInstanceError, replace
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

import fronto
from fronto.evaluate import rotation_error_deg
from fronto.outlines import Outlines
from fronto.pose.rotation import rotation_from_angles

EXAMPLES = Path(__file__).parent.parent / "examples"
HALL = EXAMPLES / "hall.png"
#: As the examples are made (tools/render_photoreal.py).
TURNED = rotation_from_angles(*np.radians([12.0, -20.0, 3.0]))


@pytest.fixture(scope="module")
def camera() -> fronto.Camera:
    return fronto.Camera.from_file(EXAMPLES / "camera.yaml", 800, 600)


@pytest.fixture(scope="module")
def panel(camera: fronto.Camera) -> fronto.Panel:
    return fronto.rectify(HALL, camera)


def test_a_photo_alone(panel: fronto.Panel) -> None:
    assert panel.status in ("ok", "uncertain")
    assert panel.image == "hall.png"
    assert len(panel.buttons) == 3
    assert panel.view is not None
    assert rotation_error_deg(panel.pose.rotation, TURNED) < 3
    assert {"read", "segment", "outline", "pose", "warp", "total"} <= set(panel.timing_ms)
    assert panel.timing_ms["total"] >= panel.timing_ms["segment"]


def test_files_pillow_images_and_arrays_in_either_order(
    panel: fronto.Panel, camera: fronto.Camera
) -> None:
    rgb = np.asarray(Image.open(HALL).convert("RGB"))
    rectifier = fronto.Rectifier(camera=camera)
    for found in (
        rectifier(str(HALL)),
        rectifier(Image.open(HALL)),
        rectifier(rgb),
        rectifier(np.ascontiguousarray(rgb[..., ::-1]), order="bgr"),
    ):
        assert np.allclose(found.pose.rotation, panel.pose.rotation)
        assert len(found.buttons) == 3


def test_nothing_to_find(camera: fronto.Camera) -> None:
    panel = fronto.rectify(np.full((600, 800, 3), 128, np.uint8), camera)
    assert (panel.status, panel.view, panel.buttons) == ("no_buttons", None, ())
    assert panel.reasons


def test_the_camera_of_a_resized_photo(camera: fronto.Camera) -> None:
    half = Image.open(HALL).convert("RGB").resize((400, 300))
    panel = fronto.Rectifier(camera=camera)(half)
    assert panel.pose.camera.width_px == 400
    assert panel.pose.camera.source == camera.source
    with pytest.raises(fronto.InputError, match="camera"):
        fronto.Rectifier(camera=camera)(np.zeros((480, 480, 3), np.uint8))


def test_an_unknown_camera_is_said_to_be_so() -> None:
    panel = fronto.rectify(HALL)
    assert panel.pose.camera.source in ("default", "estimated")
    assert panel.pose.focal_std > 0


def test_stages_can_be_replaced(camera: fronto.Camera) -> None:
    seen: list[tuple[int, ...]] = []

    def segment(photo: np.ndarray) -> fronto.Segments:
        seen.append(photo.shape)
        return fronto.Segments(800, 600, (), notes=("by hand",))

    def outline(segments: fronto.Segments, photo: np.ndarray) -> Outlines:
        square = np.array([(100.0, 100), (150, 100), (150, 150), (100, 150)])
        places = [np.array([90 * i, 90 * j]) for i in range(3) for j in range(3)]
        quads = tuple(fronto.Outline.quad(square + place) for place in places)
        plate = fronto.Outline.quad(square + np.array([300, 0]), category="plate")
        return Outlines(800, 600, quads, (plate,), left_out=("one",))

    options = fronto.RectifierOptions(rectified_look=False)
    panel = fronto.Rectifier(options, camera=camera, segment=segment, outline=outline)(HALL)
    assert seen == [(600, 800, 3)]
    assert len(panel.buttons) == 9
    assert np.degrees(np.arccos(panel.pose.normal[2])) < 2
    assert "by hand" in panel.notes
    assert any("one" in note for note in panel.notes)
    assert len(panel.plates) == 1
    assert len(panel.to_dict()["plates"]) == 1


def test_options_from_a_file(tmp_path: Path) -> None:
    path = tmp_path / "options.toml"
    path.write_text('crop = "full"\nscale = 0.5\nlines = false\n', encoding="utf-8")
    options = fronto.RectifierOptions.from_file(path)
    assert options == fronto.RectifierOptions(crop="full", scale=0.5, lines=False)
    path.write_text("zoom = 2\n", encoding="utf-8")
    with pytest.raises(fronto.InputError, match="zoom"):
        fronto.RectifierOptions.from_file(path)
    with pytest.raises(FrozenInstanceError):
        options.scale = 2.0  # type: ignore[misc]


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("min_confidence", 1.5),
        ("corners", "harris"),
        ("crop", "some"),
        ("scale", 0.0),
        ("scale", float("nan")),
        ("margin", -1.0),
        ("tolerance", float("inf")),
        ("max_pixels", 0),
    ],
)
def test_wrong_options_are_named(field: str, value: object) -> None:
    with pytest.raises(fronto.InputError, match=field):
        replace(fronto.RectifierOptions(), **{field: value})


def test_several_threads_share_one(camera: fronto.Camera, panel: fronto.Panel) -> None:
    rectifier = fronto.Rectifier(camera=camera)
    found: list[fronto.Panel] = []
    threads = [threading.Thread(target=lambda: found.append(rectifier(HALL))) for _ in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 3
    assert all(np.allclose(f.pose.rotation, panel.pose.rotation) for f in found)
