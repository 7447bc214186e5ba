"""`fronto rectify` of videos and cameras: a head-on video, and a line of JSON for each frame."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from click.testing import CliRunner, Result
from PIL import Image

from fronto.cli import main
from fronto.video import Frame, VideoRectifier, VideoResult, VideoWriter, frames

EXAMPLES = Path(__file__).parent.parent / "examples"
CAMERA = EXAMPLES / "camera.yaml"
COUNT, RATE_HZ = 6, 10.0


@pytest.fixture(scope="module")
def film(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The hall panel, drifting by two pixels a frame."""
    hall = np.asarray(Image.open(EXAMPLES / "hall.png").convert("RGB").resize((400, 300)))
    path = tmp_path_factory.mktemp("films") / "film.mp4"
    with VideoWriter(path, RATE_HZ) as writer:
        for k in range(COUNT):
            writer.write(np.roll(hall, 2 * k, axis=1))
    return path


def run(*arguments: object) -> Result:
    return CliRunner().invoke(main, ["rectify", *map(str, arguments), "--fast"])


def lines_of(path: Path) -> list[dict[str, Any]]:
    text = path.read_bytes()
    assert text.endswith(b"\n")
    return [json.loads(line) for line in text.splitlines()]


def size_and_rate(path: Path) -> tuple[int, float]:
    """Frames that can be decoded, and how many are shown a second."""
    capture = cv2.VideoCapture(str(path))
    try:
        rate = capture.get(cv2.CAP_PROP_FPS)
        count = 0
        while capture.read()[0]:
            count += 1
        return count, rate
    finally:
        capture.release()


def refused(result: Result, *words: object) -> None:
    assert result.exit_code == 2, result.output
    assert result.stdout == ""
    assert "Traceback" not in result.stderr
    for word in words:
        assert str(word) in result.stderr


def test_a_film(film: Path, tmp_path: Path) -> None:
    result = run(film, "--camera", CAMERA, "-o", tmp_path)
    assert result.exit_code == 0, result.output
    assert sorted(path.name for path in tmp_path.iterdir()) == ["film.jsonl", "film.rectified.mp4"]
    records = lines_of(tmp_path / "film.jsonl")
    assert [record["schema"] for record in records] == ["fronto.video/1"] * COUNT
    assert [record["frame"] for record in records] == list(range(COUNT))
    assert [record["time_s"] for record in records] == pytest.approx(
        [k / RATE_HZ for k in range(COUNT)], abs=1e-3
    )
    # The calibration is at the frames' size.
    assert {record["camera"]["source"] for record in records} == {"file"}
    assert {record["width_px"] for record in records} == {400}
    assert all(record["buttons"] for record in records)
    count, rate = size_and_rate(tmp_path / "film.rectified.mp4")
    assert (count, rate) == (COUNT, pytest.approx(RATE_HZ))
    (line,) = result.stdout.splitlines()
    assert line.startswith(f"film.mp4: {COUNT} frames")
    assert line.endswith("film.rectified.mp4")
    # The panel stands still in the picture though it drifts in the film.
    first, last = (
        np.array(record["buttons"][0]["rectified_center_px"])
        for record in (records[0], records[-1])
    )
    assert np.linalg.norm(last - first) < 3.0


def test_every_second_frame(film: Path, tmp_path: Path) -> None:
    result = run(film, "--camera", CAMERA, "-o", tmp_path, "--every", 2)
    assert result.exit_code == 0, result.output
    assert [record["frame"] for record in lines_of(tmp_path / "film.jsonl")] == [0, 2, 4]
    # As long as the film.
    assert size_and_rate(tmp_path / "film.rectified.mp4") == (3, pytest.approx(RATE_HZ / 2))


def test_the_first_frames(film: Path, tmp_path: Path) -> None:
    result = run(film, "--camera", CAMERA, "-o", tmp_path, "--frames", 3, "--quiet")
    assert (result.exit_code, result.output) == (0, "")
    assert [record["frame"] for record in lines_of(tmp_path / "film.jsonl")] == [0, 1, 2]
    assert size_and_rate(tmp_path / "film.rectified.mp4") == (3, pytest.approx(RATE_HZ))


def test_fewer_frames_than_a_video_can_have_a_second(film: Path, tmp_path: Path) -> None:
    # One frame in 100 s: a video plays no slower than 0.1 Hz.
    result = run(film, "--camera", CAMERA, "-o", tmp_path, "--every", 1000)
    assert result.exit_code == 0, result.output
    assert size_and_rate(tmp_path / "film.rectified.mp4")[0] == 1


def test_damaged_videos_among_photos_and_others(film: Path, tmp_path: Path) -> None:
    photo, damaged, empty = (tmp_path / name for name in ("a.png", "b.mp4", "c.avi"))
    Image.fromarray(np.full((64, 80, 3), 120, np.uint8)).save(photo)
    damaged.write_bytes(film.read_bytes()[:300])
    empty.touch()
    missing, out = tmp_path / "d.mov", tmp_path / "out"
    result = run(damaged, photo, empty, film, missing, "-o", out, "--frames", 1)
    assert result.exit_code == 1
    names = [line.split(":")[0] for line in result.stdout.splitlines()]
    assert names == ["a.png", "film.mp4"]
    errors = result.stderr.splitlines()
    assert len(errors) == 3
    for path, error in zip((damaged, empty, missing), errors, strict=True):
        assert error.startswith("Error: ")
        assert str(path) in error
    assert (out / "a.json").exists()
    assert len(lines_of(out / "film.jsonl")) == 1
    # Nothing of what could not be read, nothing half.
    assert {path.name.split(".")[0] for path in out.iterdir()} == {"a", "film"}
    # On their own they are wrong input.
    assert run(damaged, "-o", out).exit_code == 2


def test_a_flaw_costs_its_video_only(
    film: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    calls = []
    work = VideoRectifier.__call__

    def flawed(self: VideoRectifier, frame: Frame) -> VideoResult:
        calls.append(1)
        if len(calls) == 1:
            raise ZeroDivisionError("what nobody\nhas thought of")
        return work(self, frame)

    monkeypatch.setattr(VideoRectifier, "__call__", flawed)
    (tmp_path / "other.mp4").write_bytes(film.read_bytes())
    out = tmp_path / "out"
    result = run(tmp_path / "other.mp4", film, "-o", out, "--frames", 1)
    assert result.exit_code == 1
    assert result.stdout.startswith("film.mp4: 1 frame")
    (line,) = result.stderr.splitlines()
    assert "other.mp4" in line
    assert "ZeroDivisionError" in line
    assert not (out / "other.rectified.mp4").exists()


def test_ctrl_c_keeps_what_has_come_so_far(
    film: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    work = VideoRectifier.__call__

    def interrupted(self: VideoRectifier, frame: Frame) -> VideoResult:
        if frame.number == 2:
            raise KeyboardInterrupt
        return work(self, frame)

    monkeypatch.setattr(VideoRectifier, "__call__", interrupted)
    result = run(film, "--camera", CAMERA, "-o", tmp_path)
    assert result.stdout.startswith("film.mp4: 2 frames")
    assert len(lines_of(tmp_path / "film.jsonl")) == 2
    assert sorted(path.name for path in tmp_path.iterdir()) == ["film.jsonl", "film.rectified.mp4"]
    assert size_and_rate(tmp_path / "film.rectified.mp4")[0] == 2


def test_a_film_without_buttons_is_no_success(tmp_path: Path) -> None:
    wall = tmp_path / "wall.avi"
    with VideoWriter(wall, RATE_HZ) as writer:
        for _ in range(2):
            writer.write(np.full((64, 80, 3), 120, np.uint8))
    out = tmp_path / "out"
    result = run(wall, "-o", out)
    assert result.exit_code == 0
    (line,) = result.stdout.splitlines()
    assert line.startswith("wall.avi: 2 frames")
    # What is there to look at is the records; no video was made, none is claimed.
    assert "wall.jsonl" in line
    assert [record["status"] for record in lines_of(out / "wall.jsonl")] == ["no_buttons"] * 2
    assert [path.name for path in out.iterdir()] == ["wall.jsonl"]
    assert run(wall, "-o", out, "--strict").exit_code == 3


def test_results_overwrite_neither_each_other_nor_an_input(film: Path, tmp_path: Path) -> None:
    own, older = tmp_path / "film.mp4", tmp_path / "film.rectified.mp4"
    for path in (own, older):
        path.write_bytes(film.read_bytes())
    refused(run(own, older, "-o", tmp_path), older.name)
    refused(run(own, film, "-o", tmp_path / "out"), own, film)
    assert {path.name for path in tmp_path.iterdir()} == {own.name, older.name}
    assert older.read_bytes() == film.read_bytes()
    # The older result is no film of the folder, and made anew.
    result = run(tmp_path, "-o", tmp_path, "--camera", CAMERA, "--frames", 1)
    assert (result.exit_code, result.stdout.count("\n")) == (0, 1)
    assert own.read_bytes() == film.read_bytes()
    assert sum(1 for _ in frames(older)) == 1


def test_a_camera_that_is_not_there(tmp_path: Path) -> None:
    refused(run("--device", 63, "-o", tmp_path / "out"), "camera", "63")
    assert list(tmp_path.rglob("*.*")) == []
    refused(run("--device", -1, "-o", tmp_path / "out"), "--device")


@pytest.mark.parametrize(
    "arguments",
    [
        ("--outlines", EXAMPLES / "hall.outlines.json"),
        ("--solver", "grid"),
        ("--template", "panel.yaml"),
        ("--show-steps",),
        ("--before-after",),
        ("--every", 0),
        ("--frames", 0),
    ],
)
def test_what_videos_do_not_know_is_refused(
    film: Path, tmp_path: Path, arguments: tuple[Any, ...]
) -> None:
    (tmp_path / "panel.yaml").write_text("rows: [[1, 2]]\npitch_mm: [5, 5]\n", encoding="utf-8")
    given = [tmp_path / "panel.yaml" if a == "panel.yaml" else a for a in arguments]
    refused(run(film, "-o", tmp_path / "out", *given), arguments[0])
    assert not (tmp_path / "out").exists()
