"""Many photos of `fronto rectify`: bad ones, JSON Lines, --resume, --options, pictures, Ctrl-C."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from click.testing import CliRunner, Result
from PIL import Image

import fronto
from fronto import RectifierOptions
from fronto.batch import Crashed
from fronto.cli import main
from fronto.cli.cameras import CameraSource
from fronto.cli.rectifying import Job, Settings
from fronto.pose.rotation import rotation_from_angles

EXAMPLES = Path(__file__).parent.parent / "examples"
MATRIX = np.array([[250.0, 0.0, 160.0], [0.0, 250.0, 120.0], [0.0, 0.0, 1.0]])
posix_only = pytest.mark.skipif(sys.platform == "win32", reason="signals and terminals of POSIX")


@pytest.fixture(autouse=True)
def interruptible() -> Iterator[None]:
    """Let Ctrl-C arrive also where the tests run in a shell's background, which ignores it."""
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    yield
    signal.signal(signal.SIGINT, before)


def quads() -> np.ndarray:
    """Six buttons in two columns, seen by the camera above: exact corners (6, 4, 2)."""
    centers = np.array([(x, y) for y in (0.25, 0.45, 0.65) for x in (0.27, 0.52)])
    corners = centers[:, None] + np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * [0.08, 0.06]
    rays = np.concatenate([corners, np.ones((6, 4, 1))], axis=-1)
    pixels = rays @ rotation_from_angles(*np.radians([25.0, -20.0, 4.0])) @ MATRIX.T
    return np.asarray(pixels[..., :2] / pixels[..., 2:])


QUADS = quads()


class Room:
    """A folder of photos, one of outlines, and the program to run there."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.out, self.labels = folder, folder / "out", folder / "labels"
        self.labels.mkdir()
        self.camera = folder / "camera.json"
        camera = {"matrix": MATRIX.tolist(), "width": 320, "height": 240}
        self.camera.write_text(json.dumps(camera), encoding="utf-8")

    def photo(self, name: str, buttons: int = 6, grey: int = 90) -> Path:
        image = np.full((240, 320, 3), grey, np.uint8)
        for quad in QUADS:
            cv2.fillPoly(image, [np.rint(quad).astype(np.int32)], (220, 60, 20))
        path = self.folder / name
        Image.fromarray(image).save(path, compress_level=1)
        self.label(path.stem, buttons)
        return path

    def photos(self, names: Iterable[str]) -> list[Path]:
        return [self.photo(f"{name}.png") for name in names]

    def label(self, stem: str, buttons: int) -> None:
        values = {"buttons": [{"corners_px": quad.tolist()} for quad in QUADS[:buttons]]}
        (self.labels / f"{stem}.json").write_text(json.dumps(values), encoding="utf-8")

    def arguments(self, *arguments: Any) -> list[str]:
        common = ["--outlines", self.labels, "--camera", self.camera, "-o", self.out]
        return [str(argument) for argument in ("rectify", *arguments, *common)]

    def rectify(self, *arguments: Any) -> Result:
        return CliRunner().invoke(main, self.arguments(*arguments))

    def result(self, stem: str) -> dict[str, Any]:
        values: dict[str, Any] = json.loads((self.out / f"{stem}.json").read_bytes())
        return values

    def parts(self) -> list[Path]:
        return list(self.folder.rglob("*.part"))


@pytest.fixture
def room(tmp_path: Path) -> Room:
    return Room(tmp_path)


def names(lines: str) -> list[str]:
    return [line.split(":")[0] for line in lines.splitlines()]


def refused(result: Result, *words: object) -> None:
    """Exit code 2 and one line on stderr that has all of the words."""
    assert result.exit_code == 2, result.output
    assert result.stderr.count("\n") == 1
    assert result.stdout == ""
    for word in words:
        assert str(word) in result.stderr


# --- one bad photo among good ones, JSON Lines


@pytest.mark.parametrize("jobs", [1, 2])
def test_a_bad_photo_costs_itself_only(room: Room, jobs: int) -> None:
    photos = room.photos("eacbd")
    photos[1].write_bytes(b"no picture")
    lines = room.folder / "deep" / "results.jsonl"
    result = room.rectify(*photos, "--jobs", jobs, "--jsonl", lines)
    assert result.exit_code == 1
    # As they were named.
    assert names(result.stdout) == ["e.png", "c.png", "b.png", "d.png"]
    (line,) = result.stderr.splitlines()
    assert line.startswith("Error: ")
    assert str(photos[1]) in line
    for stem in "ecbd":
        assert room.result(stem)["status"] == "ok"
        assert (room.out / f"{stem}.rectified.png").exists()
        assert (room.out / f"{stem}.overlay.png").exists()
    assert len(list(room.out.iterdir())) == 3 * 4

    text = lines.read_bytes()
    assert text.endswith(b"\n")
    records = [json.loads(record) for record in text.splitlines()]
    assert [record["image"] for record in records] == [f"{stem}.png" for stem in "eacbd"]
    assert records[1]["schema"] == "fronto.error/1"
    assert str(photos[1]) in records[1]["error"]
    for record in records[:1] + records[2:]:
        assert record == room.result(Path(record["image"]).stem)
    assert room.parts() == []


def test_results_do_not_depend_on_the_number_of_processes(room: Room) -> None:
    photos = room.photos("ab")
    assert room.rectify(*photos).exit_code == 0
    one = [room.result(stem) for stem in "ab"]
    assert room.rectify(*photos, "--jobs", 2).exit_code == 0
    two = [room.result(stem) for stem in "ab"]
    for values in (*one, *two):
        del values["timing_ms"]
    assert one == two


def test_exit_codes_of_a_batch(room: Room) -> None:
    good, unsure, bad = room.photo("a.png"), room.photo("b.png", buttons=1), room.photo("c.png")
    bad.write_bytes(b"no picture")
    assert room.rectify(good, unsure).exit_code == 0
    assert room.rectify(good, "--strict").exit_code == 0
    assert room.rectify(good, unsure, "--strict").exit_code == 3
    # A photo that could not be used counts more than one that is not ok.
    assert room.rectify(good, unsure, bad, "--strict").exit_code == 1
    assert room.rectify(bad, "--strict").exit_code == 2
    assert room.rectify(good, "--jobs", 0).exit_code == 2


def test_json_lines_are_written_anew_and_in_one_piece(room: Room) -> None:
    a, b = room.photos("ab")
    lines = room.out / "all.jsonl"  # in the folder that is to be made
    for photos in ([a, b], [b]):
        result = room.rectify(*photos, "--jsonl", lines)
        assert result.exit_code == 0, result.output
        records = [json.loads(record) for record in lines.read_bytes().splitlines()]
        assert [record["image"] for record in records] == [photo.name for photo in photos]
    assert room.parts() == []


def test_json_lines_overwrite_no_input_and_no_result(room: Room) -> None:
    photo = room.photo("a.png")
    before = {path: path.read_bytes() for path in (photo, room.camera, room.labels / "a.json")}
    for path in before:
        refused(room.rectify(photo, "--jsonl", path), "--jsonl", path)
        assert path.read_bytes() == before[path]
    refused(room.rectify(photo, "--jsonl", room.out / "a.json"), "--jsonl")
    refused(room.rectify(photo, "--jsonl", room.labels), "--jsonl", room.labels)
    refused(room.rectify(photo, "--jsonl", photo / "a.jsonl"), photo)
    assert not room.out.exists()
    assert room.parts() == []


def test_a_flaw_costs_its_photo_only(room: Room, monkeypatch: pytest.MonkeyPatch) -> None:
    from fronto import pipeline

    work, calls = pipeline.rectify_outlines, []

    def flawed(*arguments: Any, **options: Any) -> fronto.Panel:
        calls.append(1)
        if len(calls) == 2:
            raise ZeroDivisionError("what nobody\nhas thought of")
        return work(*arguments, **options)

    monkeypatch.setattr(pipeline, "rectify_outlines", flawed)
    photos = room.photos("abc")
    lines = room.folder / "all.jsonl"
    result = room.rectify(*photos, "--jsonl", lines)
    assert result.exit_code == 1
    assert names(result.stdout) == ["a.png", "c.png"]
    (line,) = result.stderr.splitlines()
    assert str(photos[1]) in line
    assert "ZeroDivisionError" in line
    schemas = [json.loads(record)["schema"] for record in lines.read_bytes().splitlines()]
    assert schemas == ["fronto.panel/1", "fronto.error/1", "fronto.panel/1"]
    assert not (room.out / "b.json").exists()


def test_a_photo_that_ends_its_process_is_told_of(
    room: Room, monkeypatch: pytest.MonkeyPatch
) -> None:
    def dying(jobs: Iterable[Job], make: Settings, processes: int) -> Iterator[tuple[Job, Any]]:
        work = make()
        for job in jobs:
            yield job, Crashed() if job.stem == "b" else work(job)

    monkeypatch.setattr("fronto.cli.batches.in_order", dying)
    photos = room.photos("abc")
    lines = room.folder / "all.jsonl"
    result = room.rectify(*photos, "--jsonl", lines, "--jobs", 2)
    assert result.exit_code == 1
    assert names(result.stdout) == ["a.png", "c.png"]
    (line,) = result.stderr.splitlines()
    assert str(photos[1]) in line
    records = [json.loads(record) for record in lines.read_bytes().splitlines()]
    assert [record["image"] for record in records] == ["a.png", "b.png", "c.png"]
    assert records[1]["schema"] == "fronto.error/1"


# --- --resume

#: Seconds: of photos, and of results that are newer.
PHOTO, RESULT = 1_000_000_000, 1_000_000_100


@pytest.fixture
def begun(room: Room) -> Room:
    """Two photos with results that are newer than they."""
    photos = room.photos("ab")
    result = room.rectify(*photos)
    assert result.exit_code == 0, result.output
    for path in photos:
        os.utime(path, (PHOTO, PHOTO))
    for path in room.out.iterdir():
        os.utime(path, (RESULT, RESULT))
    return room


def redone(room: Room, *arguments: Any, photos: str = "ab") -> str:
    """Which results --resume has written; the lines are in order and say so."""
    paths = [room.folder / f"{stem}.png" for stem in photos]
    result = room.rectify(*paths, "--resume", *arguments)
    assert result.exit_code == 0, result.output
    assert names(result.stdout) == [path.name for path in paths]
    new = [stem for stem in photos if (room.out / f"{stem}.json").stat().st_mtime != RESULT]
    before = [stem for stem in photos if f"{stem}.png: ok, done before" in result.stdout]
    assert sorted(new + before) == sorted(photos)
    for stem in photos:
        assert room.result(stem)["status"] == "ok"
    return "".join(new)


def test_resume_leaves_what_is_there(begun: Room) -> None:
    before = {path: path.read_bytes() for path in begun.out.iterdir()}
    assert redone(begun) == ""
    # What changes no result.
    assert redone(begun, "--threads", 1, "--strict") == ""
    assert redone(begun, "--jobs", 2) == ""
    assert {path: path.read_bytes() for path in begun.out.iterdir()} == before
    assert {path.stat().st_mtime for path in begun.out.iterdir()} == {RESULT}
    # Nobody else's results are left.
    assert begun.rectify(begun.folder / "a.png").exit_code == 0
    assert (begun.out / "a.json").stat().st_mtime != RESULT
    assert (begun.out / "b.json").stat().st_mtime == RESULT


def touch_photo(room: Room) -> None:
    os.utime(room.folder / "b.png", (RESULT + 1, RESULT + 1))


def remove(name: str) -> Callable[[Room], None]:
    return lambda room: (room.out / name).unlink()


def write(name: str, text: str) -> Callable[[Room], None]:
    def damage(room: Room) -> None:
        (room.out / name).write_text(text, encoding="utf-8")
        os.utime(room.out / name, (RESULT, RESULT))

    return damage


def halve(room: Room) -> None:
    text = (room.out / "b.json").read_text(encoding="utf-8")
    write("b.json", text[: len(text) // 2])(room)


def exchange(room: Room) -> None:
    # As left behind by another photo of the stem.
    text = (room.out / "b.json").read_text(encoding="utf-8")
    write("b.json", text.replace('"b.png"', '"b.jpg"'))(room)


def other_outlines(room: Room) -> None:
    room.label("b", 5)


@pytest.mark.parametrize(
    "change",
    [
        touch_photo,
        remove("b.json"),
        remove("b.overlay.png"),
        remove("b.rectified.png"),
        halve,
        exchange,
        other_outlines,
        *(write("b.json", text) for text in ("", "{}", "[]", "7", '"text"', "[" * 100_000)),
        write("b.json", '{"status": "ok", "image": "b.png"}'),
    ],
)
def test_resume_does_again_what_is_not_as_it_should_be(
    begun: Room, change: Callable[[Room], None]
) -> None:
    change(begun)
    assert redone(begun) == "b"
    assert (begun.out / "b.overlay.png").exists()
    assert (begun.out / "b.rectified.png").exists()


def test_resume_does_again_what_other_options_have_made(begun: Room) -> None:
    options = begun.folder / "options.toml"
    options.write_text("margin = 1.0\n", encoding="utf-8")
    camera = json.loads(begun.camera.read_text(encoding="utf-8"))
    for k, arguments in enumerate([("--scale", 2), ("--options", options), ("--no-align",), ()]):
        before = begun.result("a")["rectified"]
        assert redone(begun, *arguments) == "ab"
        if k < 2:
            assert begun.result("a")["rectified"] != before
        # They stay for as long as the options do.
        stamps = [path.stat().st_mtime_ns for path in begun.out.glob("*.json")]
        begun.rectify(begun.folder / "a.png", begun.folder / "b.png", "--resume", *arguments)
        assert [path.stat().st_mtime_ns for path in begun.out.glob("*.json")] == stamps
    # A calibration file of the same name with another content.
    camera["matrix"][0][0] = camera["matrix"][1][1] = 251.0
    begun.camera.write_text(json.dumps(camera), encoding="utf-8")
    assert redone(begun, photos="a") == "a"
    assert begun.result("a")["camera"]["matrix"][0][0] == 251


def test_results_depend_on_all_files_of_a_network(tmp_path: Path) -> None:
    weights = tmp_path / "fronto-seg-x.onnx"
    weights.write_bytes(b"a network")
    options, source = RectifierOptions(read_labels=False), CameraSource(None, None, None)
    settings = Settings(tmp_path, weights, 1, options, source)
    seen = [settings.run(None)]
    for kind in ("relations", "masks", "int8"):
        (tmp_path / f"fronto-seg-x.{kind}-01234567.onnx").write_text(kind)
        seen.append(settings.run(None))
    assert len(set(seen)) == len(seen)
    # Given outlines need none of them.
    outlines = tmp_path / "outlines.json"
    outlines.write_text("{}")
    given = settings.run(outlines)
    (tmp_path / "fronto-seg-x.int8-01234567.onnx").unlink()
    assert settings.run(outlines) == given


def test_resume_makes_pictures_that_are_asked_for_now(begun: Room) -> None:
    assert redone(begun, "--before-after", photos="a") == "a"
    assert (begun.out / "a.before_after.png").exists()
    # More than what is asked for is no reason to do it again.
    os.utime(begun.out / "a.json", (RESULT, RESULT))
    assert redone(begun) == ""


def test_resume_knows_results_without_a_picture(room: Room) -> None:
    photo = room.photo("a.png", buttons=0)
    assert room.rectify(photo).exit_code == 0
    assert not (room.out / "a.rectified.png").exists()
    os.utime(photo, (PHOTO, PHOTO))
    os.utime(room.out / "a.json", (RESULT, RESULT))
    # The code is that of the results, whenever they were made.
    assert room.rectify(photo, "--resume", "--strict").exit_code == 3
    assert (room.out / "a.json").stat().st_mtime == RESULT


def test_resume_does_not_take_found_outlines_for_given_ones(room: Room) -> None:
    photo = room.photo("a.png")
    alone = ["rectify", photo, "--camera", room.camera, "--fast", "-o", room.out, "--resume"]
    assert CliRunner().invoke(main, [str(a) for a in alone]).exit_code == 0
    result = room.rectify(photo, "--fast", "--resume")
    assert "done before" not in result.stdout
    assert len(room.result("a")["buttons"]) == 6


def test_resume_tries_a_bad_photo_again_and_lists_all(begun: Room) -> None:
    paths = [begun.folder / name for name in ("a.png", "b.png", "c.png")]
    paths[2].write_bytes(b"no picture")
    begun.label("c", 6)
    lines = begun.folder / "all.jsonl"
    assert begun.rectify(*paths, "--resume", "--jsonl", lines).exit_code == 1
    begun.photo("c.png")
    result = begun.rectify(*paths, "--resume", "--jsonl", lines)
    assert result.exit_code == 0
    assert ["done before" in line for line in result.stdout.splitlines()] == [True, True, False]
    records = [json.loads(record) for record in lines.read_bytes().splitlines()]
    assert records == [begun.result(stem) for stem in "abc"]


# --- --options


def test_options_of_a_file_and_of_the_command_line(room: Room) -> None:
    photo = room.photo("a.png")
    options = room.folder / "options.toml"

    def made(text: str, *arguments: Any) -> dict[str, Any]:
        options.write_text(text, encoding="utf-8")
        result = room.rectify(photo, "--options", options, *arguments)
        assert result.exit_code == 0, result.output
        return room.result("a")

    assert room.rectify(photo).exit_code == 0
    plain = room.result("a")["rectified"]
    assert made("# nothing\n")["rectified"] == plain
    large = made("scale = 2.0\n")["rectified"]
    assert large["scale"] == pytest.approx(2 * plain["scale"])
    # What is said on the command line counts more, also where it is the default there;
    # what is not said leaves the file's.
    assert made("scale = 2.0\n", "--scale", 1)["rectified"] == plain
    assert made("scale = 2.0\n", "--margin", 0.5)["rectified"] == large
    both = made('scale = 2.0\ncrop = "full"\n', "--crop", "input")["rectified"]
    assert (both["crop"], both["width_px"]) == ("input", 320)
    # They reach the solver, too.
    tied = made("# nothing\n")["pose"]["std_deg"]
    for text, flag in (("square = true\n", "--square"), ("aligned = false\n", "--no-align")):
        other = made(text)["pose"]["std_deg"]
        assert other != tied
        assert made("# nothing\n", flag)["pose"]["std_deg"] == other


def test_options_reach_the_network(room: Room) -> None:
    hall = Image.open(EXAMPLES / "hall.png").convert("RGB").resize((400, 300))
    hall.save(room.folder / "hall.png")
    options = room.folder / "options.toml"
    options.write_text("min_confidence = 1.0\nsecond_look = false\n", encoding="utf-8")
    alone = ["rectify", room.folder / "hall.png", "-o", room.out, "--options", options]
    assert CliRunner().invoke(main, [str(a) for a in alone]).exit_code == 0
    assert room.result("hall")["status"] == "no_buttons"
    less = [*alone, "--min-confidence", 0.5]
    assert CliRunner().invoke(main, [str(a) for a in less]).exit_code == 0
    assert len(room.result("hall")["buttons"]) > 0


@pytest.mark.parametrize(
    ("text", "field"),
    [
        ("zoom = 2\n", "zoom"),
        ("scale = -1.0\n", "scale"),
        ('scale = "large"\n', "scale"),
        ('crop = "some"\n', "crop"),
        ("correlation = 2.0\n", "correlation"),
        ("scale = \n", "line 1"),
    ],
)
def test_wrong_options_are_refused_before_any_work(room: Room, text: str, field: str) -> None:
    options = room.folder / "options.toml"
    options.write_text(text, encoding="utf-8")
    refused(room.rectify(*room.photos("ab"), "--options", options), options, field)
    assert not room.out.exists()


def test_files_that_are_not_there_are_refused_before_any_work(room: Room) -> None:
    photos = room.photos("ab")
    missing = room.folder / "none"
    refused(room.rectify(*photos, "--options", missing), missing)
    alone = ["rectify", *photos, "-o", room.out, "--weights", missing]
    refused(CliRunner().invoke(main, [str(a) for a in alone]), missing)
    assert not room.out.exists()
    # Where outlines are given nobody looks for the network.
    assert room.rectify(*photos, "--weights", missing).exit_code == 0


# --- pictures


def test_further_pictures(room: Room) -> None:
    photos = [room.photo("a.png"), room.photo("b.png", buttons=0)]
    assert room.rectify(*photos, "--show-steps").exit_code == 0
    assert room.rectify(*photos, "--before-after", "--jobs", 2).exit_code == 0
    for stem in "ab":
        for kind in ("steps", "before_after"):
            with Image.open(room.out / f"{stem}.{kind}.png") as picture:
                picture.load()
                assert picture.width > 320
    assert len(list(room.out.iterdir())) == 5 + 4
    assert room.parts() == []


def test_steps_are_those_of_the_first_look(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from fronto import draw_steps

    draw, drawn = draw_steps.draw_steps, []

    def noted(*arguments: Any) -> Any:
        drawn.append(arguments)
        return draw(*arguments)

    monkeypatch.setattr(draw_steps, "draw_steps", noted)
    hall = Image.open(EXAMPLES / "hall.png").convert("RGB").resize((400, 300))
    hall.save(tmp_path / "hall.png")
    Image.fromarray(np.full((64, 80, 3), 120, np.uint8)).save(tmp_path / "wall.png")
    photos = [tmp_path / "hall.png", tmp_path / "wall.png"]
    arguments = ["rectify", *photos, "-o", tmp_path / "out", "--show-steps"]
    assert CliRunner().invoke(main, [str(a) for a in arguments]).exit_code == 0
    (_, segments, outlines, panel), (_, none, nothing, _) = drawn
    # In the photo's pixels, not in those of the head-on view.
    for found in (segments, outlines):
        assert (found.width_px, found.height_px) == (400, 300)
    assert len(segments.buttons) > 0
    assert len(outlines.buttons) > 0
    assert panel.status in ("ok", "uncertain")
    # Each photo's own.
    assert (none.width_px, len(none), nothing.buttons) == (80, 0, ())


@pytest.mark.parametrize("kind", ["steps", "before_after"])
def test_further_pictures_overwrite_no_input(room: Room, kind: str) -> None:
    photo, odd = room.photo("a.png"), room.photo(f"a.{kind}.png")
    before = odd.read_bytes()
    room.out = room.folder
    flag = "--" + kind.replace("_", "-").replace("steps", "show-steps")
    refused(room.rectify(photo, odd, flag), odd.name)
    assert odd.read_bytes() == before
    assert not (room.out / "a.json").exists()
    # It is in nobody's way where the picture is not asked for.
    assert room.rectify(photo, odd).exit_code == 0
    assert odd.read_bytes() == before


# --- Ctrl-C


def test_an_interrupt_keeps_the_lines_so_far(room: Room, monkeypatch: pytest.MonkeyPatch) -> None:
    from fronto import pipeline

    work, calls = pipeline.rectify_outlines, []

    def interrupted(*arguments: Any, **options: Any) -> fronto.Panel:
        calls.append(1)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return work(*arguments, **options)

    monkeypatch.setattr(pipeline, "rectify_outlines", interrupted)
    photos, lines = room.photos("abcd"), room.folder / "all.jsonl"
    result = room.rectify(*photos, "--jsonl", lines)
    assert result.exit_code not in (0, None)
    records = [json.loads(record) for record in lines.read_bytes().splitlines()]
    assert [record["image"] for record in records] == ["a.png", "b.png"]
    assert sorted(path.name for path in room.out.glob("*.json")) == ["a.json", "b.json"]
    assert room.parts() == []


def wait_for(path: Path, process: subprocess.Popen[bytes]) -> None:
    end = time.monotonic() + 60
    while not path.exists():
        assert process.poll() is None
        assert time.monotonic() < end
        time.sleep(0.002)


@posix_only
@pytest.mark.parametrize("jobs", [1, 2])
def test_ctrl_c_leaves_whole_files_and_resume_does_the_rest(room: Room, jobs: int) -> None:
    photos = room.photos(f"{k:02d}" for k in range(16))
    # The first is done at once, the others take a while.
    room.label("00", 0)
    arguments = room.arguments(*photos, "--jobs", jobs, "--scale", 4)
    arguments += ["--jsonl", str(room.folder / "all.jsonl")]
    command = [sys.executable, "-m", "fronto", *arguments]
    # A terminal sends it to all processes of the group.
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=True
    ) as process:
        wait_for(room.out / "00.json", process)
        os.killpg(process.pid, signal.SIGINT)
        # All of its processes end: they hold the pipes.
        _, errors = process.communicate(timeout=60)
    assert process.returncode != 0
    assert b"Traceback" not in errors
    assert room.parts() == []
    done = sorted(room.out.glob("*.json"))
    assert 1 <= len(done) < len(photos)
    for path in done:
        values = json.loads(path.read_bytes())
        if values["rectified"]:
            with Image.open(room.out / values["rectified"]["file"]) as picture:
                picture.load()
    for path in room.out.glob("*.png"):
        with Image.open(path) as picture:
            picture.load()
    for line in (room.folder / "all.jsonl").read_bytes().splitlines():
        json.loads(line)

    stamps = {path: path.stat().st_mtime_ns for path in done}
    result = CliRunner().invoke(main, [*arguments, "--resume", "--jobs", "1"])
    assert result.exit_code == 0, result.output
    assert result.stdout.count("done before") == len(done)
    assert {path: path.stat().st_mtime_ns for path in done} == stamps
    assert len(list(room.out.glob("*.json"))) == len(photos)
    records = (room.folder / "all.jsonl").read_bytes().splitlines()
    assert [json.loads(record)["image"] for record in records] == [p.name for p in photos]


# --- what a terminal shows


@posix_only
def test_a_progress_bar_on_a_terminal_only(room: Room) -> None:
    import pty

    command = [sys.executable, "-m", "fronto", *room.arguments(*room.photos("ab"))]
    terminal, end = pty.openpty()
    with subprocess.Popen(command, stdout=subprocess.PIPE, stderr=end) as process:
        os.close(end)
        shown = b""
        try:
            while part := os.read(terminal, 4096):
                shown += part
        except OSError:  # how Linux ends a terminal
            pass
        output, _ = process.communicate(timeout=60)
    os.close(terminal)
    assert process.returncode == 0
    assert b"100%" in shown
    # Where the lines go nothing else goes.
    assert names(output.decode()) == ["a.png", "b.png"]
    assert b"\x1b" not in output
    assert b"\r" not in output
