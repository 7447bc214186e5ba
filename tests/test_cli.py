"""The command line: verdicts, files, exit codes, and one line for each thing that is wrong."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from click.testing import CliRunner, Result
from PIL import Image

import fronto
from fronto.cli import main
from fronto.imageio import read_image
from fronto.pose.rotation import rotation_from_angles

ANNOTATED = Path(__file__).parents[1] / "../shared/data/annotated"
MATRIX = [[500.0, 0.0, 320.0], [0.0, 500.0, 240.0], [0.0, 0.0, 1.0]]
ANGLES = (25.0, -20.0, 4.0)


def quads() -> np.ndarray:
    """Six buttons in two columns, seen by the camera above: exact corners (6, 4, 2)."""
    centers = np.array([(x, y) for y in (0.25, 0.45, 0.65) for x in (0.27, 0.52)])
    corners = centers[:, None] + np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [0.08, 0.06]
    rays = np.concatenate([corners, np.ones((6, 4, 1))], axis=-1)
    pixels = rays @ rotation_from_angles(*np.radians(ANGLES)) @ np.transpose(MATRIX)
    return np.asarray(pixels[..., :2] / pixels[..., 2:])


QUADS = quads()


def outline_values(**more: Any) -> dict[str, Any]:
    texts = ["5", "6", "3", "4", "1", "2"]
    buttons = [
        {"corners_px": quad.tolist(), "category": "number", "text": text}
        for quad, text in zip(QUADS, texts, strict=True)
    ]
    return {"width_px": 640, "height_px": 480, "buttons": buttons, **more}


class Room:
    """A folder with one photo, its outlines and its camera, and the program to run there."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.photo = self.add_photo("hall.jpg")
        self.outlines = self.write("hall.json", outline_values())
        self.camera = self.write("camera.json", {"matrix": MATRIX, "width": 640, "height": 480})
        self.out = folder / "out"

    def add_photo(self, name: str, **options: Any) -> Path:
        image = np.full((480, 640, 3), 90, np.uint8)
        for quad in QUADS:
            cv2.fillPoly(image, [np.rint(quad).astype(np.int32)], (220, 60, 20))
        path = self.folder / name
        path.parent.mkdir(exist_ok=True)
        Image.fromarray(image).save(path, **options)
        return path

    def write(self, name: str, values: Any) -> Path:
        path = self.folder / name
        path.parent.mkdir(exist_ok=True)
        text = values if isinstance(values, str) else json.dumps(values)
        path.write_text(text, encoding="utf-8")
        return path

    def rectify(self, *arguments: Any, outlines: Path | None = None) -> Result:
        given = [str(argument) for argument in arguments]
        if not any(argument.endswith((".jpg", ".png", ".tif")) for argument in given):
            given.insert(0, str(self.photo))
        common = ["--outlines", str(outlines or self.outlines), "-o", str(self.out)]
        return CliRunner().invoke(main, ["rectify", *given, *common])

    def result(self, stem: str = "hall") -> dict[str, Any]:
        values: dict[str, Any] = json.loads((self.out / f"{stem}.json").read_bytes())
        return values


@pytest.fixture
def room(tmp_path: Path) -> Room:
    return Room(tmp_path)


def refused(result: Result, *words: object) -> None:
    """Exit code 2 and one line on stderr that has all of the words."""
    assert result.exit_code == 2, result.output
    assert result.stderr.count("\n") == 1
    assert result.stdout == ""
    for word in words:
        assert str(word) in result.stderr


def test_one_photo(room: Room) -> None:
    result = room.rectify("--camera", room.camera)
    assert result.exit_code == 0, result.output
    assert result.stderr == ""
    (line,) = result.stdout.splitlines()
    assert line.startswith("hall.jpg: ok, rotation 25.0 -20.0 4.0 deg ±0.")
    assert "6 buttons, camera file" in line
    assert line.endswith(str(room.out / "hall.rectified.png"))
    values = room.result()
    assert values["status"] == "ok"
    assert values["image"] == "hall.jpg"
    assert np.allclose(values["pose"]["angles_deg"], ANGLES, atol=0.05)
    assert [button["label"] for button in values["buttons"]] == ["5", "6", "3", "4", "1", "2"]
    picture = read_image(room.out / values["rectified"]["file"])
    x, y = np.rint(values["buttons"][4]["rectified_center_px"]).astype(int)
    assert np.abs(picture[y, x].astype(int) - [220, 60, 20]).max() < 12  # JPEG
    assert (room.out / "hall.overlay.png").exists()


def test_quiet_prints_nothing(room: Room) -> None:
    result = room.rectify("--quiet")
    assert (result.exit_code, result.output) == (0, "")


def test_camera_from_fov_focal_length_exif_or_nothing(room: Room) -> None:
    # 640 px wide at f = 500: 2 atan(320 / 500).
    fov = room.rectify("--hfov", np.degrees(2 * np.arctan(0.64)))
    assert fov.exit_code == 0
    assert room.result()["camera"]["matrix"][0][0] == pytest.approx(500)
    room.rectify("--focal-px", 500)
    matrix = room.result()["camera"]["matrix"]
    assert np.allclose(matrix, [[500, 0, 319.5], [0, 500, 239.5], [0, 0, 1]])
    assert room.result()["pose"]["focal_std"] == 0

    room.rectify()
    assert "0.85 times" in room.result()["camera"]["detail"]
    exif = Image.Exif()
    exif.get_ifd(0x8769)[0xA405] = 27  # 27 mm: f = 27 / 43.27 x 800 = 499.2 px
    with_exif = room.add_photo("exif.jpg", exif=exif)
    assert room.rectify(with_exif).exit_code == 0
    camera = room.result("exif")["camera"]
    assert "EXIF" in camera["detail"]
    assert camera["matrix"][0][0] == pytest.approx(499.2, rel=0.02)


def test_camera_is_scaled_to_the_photo(room: Room) -> None:
    matrix = [[250.0, 0.0, 159.75], [0.0, 250.0, 119.75], [0.0, 0.0, 1.0]]
    half = room.write("half.json", {"matrix": matrix, "width": 320, "height": 240})
    assert room.rectify("--camera", half).exit_code == 0
    assert np.allclose(room.result()["camera"]["matrix"], MATRIX)


def test_exif_orientation_is_that_of_the_outlines(room: Room) -> None:
    upright = np.asarray(Image.open(room.photo))
    exif = Image.Exif()
    exif[0x0112] = 6  # shown turned by 90 degrees clockwise
    path = room.folder / "turned.png"
    Image.fromarray(np.ascontiguousarray(np.rot90(upright))).save(path, exif=exif)
    assert room.rectify(path, "--camera", room.camera).exit_code == 0
    assert np.allclose(room.result("turned")["pose"]["angles_deg"], ANGLES, atol=0.05)


def test_no_buttons_is_a_result(room: Room) -> None:
    room.rectify()
    assert (room.out / "hall.rectified.png").exists()
    empty = room.write("empty.json", {"buttons": []})
    result = room.rectify(outlines=empty)
    assert result.exit_code == 0
    assert result.stdout.startswith("hall.jpg: no_buttons (")
    assert "0 buttons" in result.stdout
    assert room.result()["status"] == "no_buttons"
    assert not (room.out / "hall.rectified.png").exists()
    assert room.rectify("--strict", outlines=empty).exit_code == 3


def test_a_single_button_is_not_ok(room: Room) -> None:
    single = outline_values()
    single["buttons"] = single["buttons"][:1]
    result = room.rectify("--strict", outlines=room.write("one.json", single))
    assert result.exit_code == 3
    assert room.result()["status"] in ("uncertain", "degenerate")
    # The line says why.
    assert room.result()["reasons"][0] in result.stdout
    assert "1 button," in result.stdout


def test_unsure_outlines_are_left_out_and_said_so(room: Room) -> None:
    values = outline_values(image="elsewhere/other.jpg")
    values["buttons"][2]["unsure"] = True
    unsure = room.write("unsure.json", values)
    assert "5 buttons" in room.rectify(outlines=unsure).stdout
    assert room.result()["status"] == "ok"
    notes = " ".join(room.result()["notes"])
    assert "1 unsure outline" in notes
    assert "other.jpg" in notes
    assert "6 buttons" in room.rectify("--include-unsure", outlines=unsure).stdout


@pytest.mark.parametrize("count", [1, 6])
def test_only_unsure_outlines_are_the_reason_for_no_buttons(room: Room, count: int) -> None:
    values = outline_values()
    values["buttons"] = [{**button, "unsure": True} for button in values["buttons"][:count]]
    result = room.rectify(outlines=room.write("unsure.json", values))
    assert result.exit_code == 0
    found = room.result()
    assert found["status"] == "no_buttons"
    (reason,) = found["reasons"]
    assert ("all 6 outlines" if count == 6 else "the only outline") in reason
    assert "marked unsure; --include-unsure" in reason
    assert reason in result.stdout


def test_a_picture_that_had_to_be_smaller_is_noted(room: Room) -> None:
    room.rectify("--camera", room.camera, "--scale", 100)
    assert any("scaled down to" in note for note in room.result()["notes"])
    room.rectify("--camera", room.camera)
    assert room.result()["notes"] == []


def test_options_reach_the_solver_and_the_warp(room: Room) -> None:
    room.rectify("--camera", room.camera)
    normal = room.result()
    room.rectify("--camera", room.camera, "--scale", 2, "--margin", 0)
    large = room.result()
    assert large["rectified"]["scale"] == pytest.approx(2 * normal["rectified"]["scale"])
    assert large["buttons"][0]["rectified_corners_px"][0] == pytest.approx([-0.5, -0.5], abs=0.5)
    room.rectify("--camera", room.camera, "--crop", "input")
    assert room.result()["rectified"]["width_px"] == 640
    room.rectify("--camera", room.camera, "--square")
    assert room.result()["status"] != "ok"  # they are not square
    room.rectify("--camera", room.camera, "--no-align")
    assert room.result()["pose"]["std_deg"] != normal["pose"]["std_deg"]


def test_lines_reach_the_solver(room: Room) -> None:
    room.rectify("--camera", room.camera)
    without = room.result()["pose"]["std_deg"]
    lines = [
        {"axis": "vertical", "ends_px": [QUADS[0, 0].tolist(), QUADS[4, 3].tolist()]},
        {"axis": "horizontal", "ends_px": [QUADS[4, 3].tolist(), QUADS[5, 2].tolist()]},
    ]
    room.rectify(
        "--camera", room.camera, outlines=room.write("l.json", outline_values(lines=lines))
    )
    assert max(room.result()["pose"]["std_deg"]) < max(without)


def test_template_gives_the_distance(room: Room) -> None:
    # At a plane depth of 0.5 m one unit of the plane is 500 mm: pitch 0.25 x 0.2 of it.
    template = room.write(
        "panel.yaml",
        "rows: [[5, 6], [3, 4], [1, 2]]\npitch_mm: [125, 100]\nsize_mm: [80, 60]\n",
    )
    result = room.rectify("--camera", room.camera, "--template", template)
    assert result.exit_code == 0, result.output
    assert room.result()["pose"]["plane_depth_m"] == pytest.approx(0.5, rel=1e-2)


def test_grid_solver(room: Room) -> None:
    arguments = ["--camera", room.camera, "--solver", "grid", "--range-deg", -30, 30]
    result = room.rectify(*arguments, "--step-deg", 2.5)
    assert result.exit_code == 0, result.output
    assert result.stdout.startswith("hall.jpg: uncertain (")
    assert "±" not in result.stdout
    values = room.result()
    assert values["pose"]["solver"] == "grid"
    assert values["pose"]["final_cr"] > 0
    options = ["--step-deg", 5, "--criterion", "paper", "--combine", "minmax"]
    assert room.rectify(*arguments, *options).exit_code == 0
    assert room.result()["pose"]["final_cr"] != values["pose"]["final_cr"]


def test_grid_translation_is_for_the_papers_panels(room: Room) -> None:
    arguments = ["--solver", "grid", "--step-deg", 8, "--translation", "paper_rotated"]
    refused(room.rectify(*arguments), room.photo, "--translation")
    three = outline_values()
    three["buttons"] = three["buttons"][::2]
    assert room.rectify(*arguments, outlines=room.write("3.json", three)).exit_code == 0


@pytest.mark.parametrize(
    "arguments",
    [
        ["--camera", "x", "--hfov", 60],
        ["--hfov", 60, "--focal-px", 500],
        ["--hfov", 180],
        ["--focal-px", 0],
        ["--focal-px", -500],
        ["--scale", 0],
        ["--scale", "nan"],
        ["--scale", "inf"],
        ["--focal-px", "nan"],
        ["--hfov", "nan"],
        ["--margin", "nan"],
        ["--solver", "grid", "--range-deg", "nan", 5],
        ["--step-deg", 5],
        ["--solver", "grid", "--square"],
        ["--solver", "grid", "--template", "x"],
        ["--solver", "magic"],
        ["--nonsense"],
    ],
)
def test_wrong_options_are_refused(room: Room, arguments: list[Any]) -> None:
    result = room.rectify(*arguments)
    assert result.exit_code == 2
    assert "Traceback" not in result.output
    assert not room.out.exists()


@pytest.mark.parametrize("content", [b"", b"no picture", b"\xff\xd8\xff\xe0 half a JPEG"])
def test_an_unreadable_photo_is_refused(room: Room, content: bytes) -> None:
    room.photo.write_bytes(content)
    refused(room.rectify(), room.photo)
    assert not room.out.exists()


def test_missing_files_are_refused(room: Room) -> None:
    missing = room.folder / "none.json"
    refused(room.rectify(room.folder / "none.jpg"), "none.jpg")
    refused(room.rectify(outlines=missing), missing)
    refused(room.rectify("--camera", missing), missing)
    refused(room.rectify("--template", missing), missing)


def changed(corners: Any) -> dict[str, Any]:
    values = outline_values()
    values["buttons"][1]["corners_px"] = corners
    return values


QUAD = QUADS[1].tolist()
BAD_OUTLINES: dict[str, tuple[Any, str]] = {
    "malformed": ('{"buttons": [}', "line 1, column 14"),
    "NaN": (json.dumps(changed([[float("nan"), 0], *QUAD[1:]])), "line 1"),
    "text": (changed([["a", 0], *QUAD[1:]]), "buttons[1].corners_px[0][0]"),
    "mirrored": (changed([QUAD[1], QUAD[0], QUAD[3], QUAD[2]]), "buttons[1].corners_px"),
    "crossing": (changed([QUAD[0], QUAD[2], QUAD[1], QUAD[3]]), "buttons[1].corners_px"),
    "wrong order": (changed([*QUAD[1:], QUAD[0]]), "buttons 1"),
    "repeated": (changed([QUAD[0], *QUAD[:3]]), "buttons[1].corners_px"),
    "duplicate": (changed(QUADS[0].tolist()), "buttons 0 and 1"),
    "outside": (changed([[x + 900, y] for x, y in QUAD]), "buttons[1]"),
    "size": (outline_values(width_px=480, height_px=640), "width_px"),
    "no buttons key": ({"image": "hall.jpg"}, "buttons"),
    "schema": (outline_values(schema="coco"), "schema"),
}


@pytest.mark.parametrize("name", list(BAD_OUTLINES))
def test_bad_outlines_are_refused_by_file_and_field(room: Room, name: str) -> None:
    values, field = BAD_OUTLINES[name]
    path = room.write("bad.json", values)
    refused(room.rectify(outlines=path), path, field)
    assert not room.out.exists()


@pytest.mark.parametrize(
    ("values", "field"),
    [
        ({"matrix": [[0, 0, 320], [0, 0, 240], [0, 0, 1]]}, "focal"),
        ({"matrix": [[500, 0, 320], [0, -500, 240], [0, 0, 1]]}, "focal"),
        ({"matrix": [[1, 2, 3], [2, 4, 6], [0, 0, 1]]}, "matrix"),
        ({"matrix": [[500, 0, 320], [0, 500, 240]]}, "matrix"),
        ({"matrix": MATRIX, "distortion": [0.1]}, "distortion"),
        ({"matrix": MATRIX, "width": 480, "height": 640}, "size"),
        ("matrix: [500, 0", "line"),
    ],
)
def test_a_bad_camera_is_refused_by_file_and_field(room: Room, values: Any, field: str) -> None:
    path = room.write("bad.yaml", values)
    refused(room.rectify("--camera", path), path, field)


@pytest.mark.parametrize(
    ("text", "field"),
    [
        ("buttons: [", "line"),
        ("buttons: [{x_mm: 0, y_mm: 0}, {x_mm: 1}]", "buttons[1]"),
        ("rows: [[1, 2]]\npitch_mm: [-5, 5]", "pitch_mm"),
    ],
)
def test_a_bad_template_is_refused_by_file_and_field(room: Room, text: str, field: str) -> None:
    path = room.write("bad.yaml", text)
    refused(room.rectify("--template", path), path, field)


def test_a_template_that_does_not_match_names_the_photo(room: Room) -> None:
    path = room.write("p.yaml", "buttons: [{x_mm: 0, y_mm: 0}, {x_mm: 1, y_mm: 1}]")
    refused(room.rectify("--template", path), room.photo, "template")


def test_several_photos_and_one_bad_one(room: Room) -> None:
    photos = [room.add_photo(f"photos/{name}.jpg") for name in "abc"]
    photos[1].write_bytes(b"no picture")
    for name in "abc":
        room.write(f"labels/{name}.json", outline_values())
    result = room.rectify(*photos, outlines=room.folder / "labels")
    assert result.exit_code == 1
    assert [line.split(":")[0] for line in result.stdout.splitlines()] == ["a.jpg", "c.jpg"]
    assert result.stderr.count("\n") == 1
    assert str(photos[1]) in result.stderr
    assert sorted(path.name for path in room.out.glob("*.json")) == ["a.json", "c.json"]
    assert room.rectify(photos[0], photos[2], outlines=room.folder / "labels").exit_code == 0
    (room.folder / "labels" / "c.json").unlink()
    assert "c.json" in room.rectify(photos[0], photos[2], outlines=room.folder / "labels").stderr


def test_when_every_photo_fails_the_input_is_wrong(room: Room) -> None:
    photos = [room.add_photo(f"photos/{name}.jpg") for name in "ab"]
    room.write("labels/none.json", outline_values())
    result = room.rectify(*photos, outlines=room.folder / "labels")
    assert (result.exit_code, result.stdout) == (2, "")
    assert [name in line for name, line in zip("ab", result.stderr.splitlines(), strict=True)]
    assert result.stderr.count("\n") == 2


def test_a_shared_camera_file_is_refused_once(room: Room) -> None:
    photos = [room.add_photo(f"photos/{name}.jpg") for name in "ab"]
    for name in "ab":
        room.write(f"labels/{name}.json", outline_values())
    labels = room.folder / "labels"
    bad = room.write("bad.yaml", "matrix: [500, 0")
    for path in (bad, room.folder / "none.yaml"):
        refused(room.rectify(*photos, "--camera", path, outlines=labels), path)
    assert not room.out.exists()
    # Whether it fits a photo is up to the photo.
    Image.fromarray(np.zeros((640, 480, 3), np.uint8)).save(photos[1])
    room.write("labels/b.json", {"buttons": outline_values()["buttons"][:1]})
    result = room.rectify(*photos, "--camera", room.camera, outlines=labels)
    assert result.exit_code == 1
    assert "aspect" in result.stderr
    assert result.stdout.startswith("a.jpg: ok")
    # Without a size in the file the photo's will do.
    plain = room.write("k.txt", "500 0 320 0 500 240 0 0 1")
    assert room.rectify(photos[0], "--camera", plain, outlines=labels).exit_code == 0


def test_several_photos_need_a_folder_of_outlines(room: Room) -> None:
    other = room.add_photo("other.jpg")
    refused(room.rectify(room.photo, other), "--outlines", room.outlines)
    refused(room.rectify(room.photo, other, outlines=room.folder / "none"), "none")


def test_results_overwrite_neither_each_other_nor_an_input(room: Room) -> None:
    room.write("labels/hall.json", outline_values())
    twin = room.add_photo("more/HALL.png")
    refused(room.rectify(room.photo, twin, outlines=room.folder / "labels"), room.photo, twin)
    assert not room.out.exists()
    before = room.outlines.read_bytes()
    room.out = room.folder
    refused(room.rectify(), "hall.json")
    assert room.outlines.read_bytes() == before


def test_an_output_that_is_a_file_is_refused(room: Room) -> None:
    room.out.touch()
    refused(room.rectify(), room.out)


def test_a_result_can_be_fed_back(room: Room) -> None:
    room.rectify("--camera", room.camera)
    first = room.result()
    edited = (room.out / "hall.json").rename(room.folder / "edited.json")
    assert room.rectify("--camera", room.camera, outlines=edited).exit_code == 0
    assert room.result()["pose"]["rotation"] == first["pose"]["rotation"]


def test_camera_command(room: Room) -> None:
    result = CliRunner().invoke(main, ["camera", str(room.camera)])
    assert result.exit_code == 0
    values = json.loads(result.stdout)
    assert values["matrix"] == MATRIX
    assert values["source"] == "file"
    # 2 atan(w / 2f), the principal point being half a pixel off the middle.
    assert values["horizontal_fov_deg"] == pytest.approx(65.238, abs=0.01)
    double = ["camera", str(room.camera), "--width", "1280", "--height", "960"]
    scaled = json.loads(CliRunner().invoke(main, double).stdout)
    assert (scaled["width_px"], scaled["matrix"][0][0]) == (1280, 1000.0)
    again = room.write("again.json", scaled)
    assert (
        json.loads(CliRunner().invoke(main, ["camera", str(again)]).stdout)["matrix"]
        == (scaled["matrix"])
    )


def test_camera_command_refuses_in_one_line(room: Room) -> None:
    bad = room.write("bad.json", {"matrix": [[0, 0, 1], [0, 0, 1], [0, 0, 1]], "width": 6})
    refused(CliRunner().invoke(main, ["camera", str(bad)]), bad)
    refused(CliRunner().invoke(main, ["camera", str(room.camera), "--width", "640"]), room.camera)


def test_camera_command_names_its_options(room: Room) -> None:
    plain = room.write("k.txt", "500 0 320 0 500 240 0 0 1")
    refused(CliRunner().invoke(main, ["camera", str(plain)]), plain, "--width", "--height")
    sized = ["camera", str(plain), "--width", "640", "--height", "480"]
    assert CliRunner().invoke(main, sized).exit_code == 0


def python(*arguments: str, **options: Any) -> subprocess.CompletedProcess[bytes]:
    command = [sys.executable, *arguments]
    return subprocess.run(command, capture_output=True, check=False, timeout=60, **options)


def test_as_a_program(room: Room) -> None:
    arguments = ["-m", "fronto", "rectify", str(room.photo), "--outlines", str(room.outlines)]
    done = python(*arguments, "-o", str(room.out))
    assert (done.returncode, done.stderr) == (0, b"")
    assert done.stdout.startswith(b"hall.jpg: ok")
    room.photo.unlink()
    failed = python(*arguments, "-o", str(room.out))
    assert (failed.returncode, failed.stdout) == (2, b"")
    assert failed.stderr.count(b"\n") == 1
    version = python("-m", "fronto", "--version")
    assert version.stdout.decode().split() == ["fronto", fronto.__version__]


def test_output_of_any_encoding(room: Room, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PYTHONIOENCODING", "ascii")
    monkeypatch.setenv("PYTHONUTF8", "0")
    arguments = ["-m", "fronto", "rectify", str(room.photo), "--outlines", str(room.outlines)]
    done = python(*arguments, "-o", str(room.out))
    assert (done.returncode, done.stderr) == (0, b"")
    assert b"deg ?" in done.stdout


def test_help_loads_nothing_heavy() -> None:
    code = (
        "import sys\nfrom fronto.cli import main\n"
        "try:\n    main(['rectify', '--help'])\nexcept SystemExit:\n    pass\n"
        "heavy = {'numpy', 'cv2', 'PIL', 'yaml', 'msgspec'} & set(sys.modules)\n"
        "sys.exit(', '.join(heavy) or 0)"
    )
    done = python("-c", code)
    assert done.returncode == 0, done.stderr
    assert b"--outlines" in done.stdout


def test_every_public_name_is_there() -> None:
    for name in fronto.__all__:
        assert getattr(fronto, name) is not None
        assert name in dir(fronto)
    with pytest.raises(AttributeError, match="nonsense"):
        _ = fronto.nonsense


@pytest.mark.skipif(not ANNOTATED.is_dir(), reason="the annotated photos are not here")
def test_every_annotated_photo(tmp_path: Path) -> None:
    photos = sorted((ANNOTATED / "images").glob("*.jpg"))
    assert photos
    arguments = ["rectify", *map(str, photos), "--outlines", str(ANNOTATED / "labels")]
    result = CliRunner().invoke(main, [*arguments, "-o", str(tmp_path), "--include-unsure"])
    assert result.exit_code == 0, result.output
    assert len(result.stdout.splitlines()) == len(photos)
    for photo in photos:
        values = json.loads((tmp_path / f"{photo.stem}.json").read_bytes())
        assert len(values["buttons"]) > 0
        has_picture = values["status"] in ("ok", "uncertain")
        assert (tmp_path / f"{photo.stem}.rectified.png").exists() == has_picture
