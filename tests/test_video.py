"""Video files in and out, and a panel rectified over a video's frames: `fronto.video`."""

from __future__ import annotations

import json
import struct
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from fronto import (
    Camera,
    InputError,
    Outline,
    Rectifier,
    RectifierOptions,
    Segments,
    map_points,
)
from fronto.outlines import Outlines
from fronto.pose.rotation import angle_between, rotation_from_angles
from fronto.synth import Scene
from fronto.synth.layouts import Layout, LayoutButton
from fronto.synth.look import FLAT
from fronto.synth.render import render_panel
from fronto.video import (
    Frame,
    VideoRectifier,
    VideoResult,
    VideoWriter,
    frames,
    video_record,
)
from fronto.videocanvas import seen_with

WIDTH, HEIGHT, COUNT, RATE_HZ = 320, 240, 12, 10.0
CAMERA = Camera.from_fov(60, WIDTH, HEIGHT)
LAYOUT = Layout(
    "car",
    tuple(
        LayoutButton(0.045 * (k % 3 - 1), 0.045 * (k // 3 - 1.5), 0.03, 0.03, text=str(k))
        for k in range(12)
    ),
)


def scene(k: float) -> Scene:
    """The panel seen by a camera that slowly turns, drifts and comes closer."""
    rotation = rotation_from_angles(*np.radians([12 - 0.4 * k, -20 + 0.5 * k, 3]))
    ray = np.array([0.05 - 0.004 * k, 0.02 + 0.002 * k, 1.0])
    return Scene(LAYOUT, CAMERA, rotation, (0.33 - 0.003 * k) * (rotation @ ray), (), ())


def render(k: float) -> np.ndarray:
    seen = scene(k)
    return render_panel(
        LAYOUT,
        CAMERA,
        seen.rotation,
        seen.translation,
        rng=np.random.default_rng(0),
        look=FLAT,
        supersampling=1,
        texture_px_per_mm=2.0,
    )


@pytest.fixture(scope="module")
def pictures() -> list[np.ndarray]:
    return [render(k) for k in range(COUNT)]


@pytest.fixture(scope="module")
def film(pictures: list[np.ndarray], tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("film") / "panel.mp4"
    with VideoWriter(path, RATE_HZ) as writer:
        for picture in pictures:
            writer.write(picture)
    return path


class Shown:
    """Stands for a segmentation that finds the outlines of frame `now`, whatever it is asked."""

    def __init__(self, outlines: list[Outlines]) -> None:
        self.outlines, self.now = outlines, 0

    def rectifier(self, **options: object) -> Rectifier:
        # What lines and second looks bring depends on the picture; here outlines are all.
        plain = RectifierOptions(lines=False, second_look=False, rectified_look=False)
        return Rectifier(
            segment=lambda photo: Segments(photo.shape[1], photo.shape[0], ()),
            outline=lambda segments, photo: self.outlines[self.now],
            **{"camera": CAMERA, "options": plain, **options},  # type: ignore[arg-type]
        )


def found(k: float, rng: np.random.Generator, sigma_px: float = 1.0) -> Outlines:
    """The buttons of frame k, with noise."""
    corners = scene(k).corners_px + rng.normal(0, sigma_px, (12, 4, 2))
    quads = [
        Outline.quad(quad, std_px=sigma_px, category="number", text=str(i))
        for i, quad in enumerate(corners)
    ]
    return Outlines(WIDTH, HEIGHT, tuple(quads))


def nothing() -> Outlines:
    return Outlines(WIDTH, HEIGHT, ())


def run(
    shown: list[Outlines], pictures: list[np.ndarray] | None = None, **options: object
) -> list[VideoResult]:
    source = Shown(shown)
    rectifier = VideoRectifier(source.rectifier(**options))
    blank = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    results = []
    for k in range(len(shown)):
        source.now = k
        image = blank if pictures is None else pictures[k]
        results.append(rectifier(Frame(k, k / RATE_HZ, image)))
    return results


def off_deg(result: VideoResult, rotation: np.ndarray, k: float) -> float:
    return float(np.degrees(angle_between(rotation, scene(k).rotation)))


@pytest.fixture(scope="module")
def results(pictures: list[np.ndarray]) -> list[VideoResult]:
    rng = np.random.default_rng(4)
    return run([found(k, rng) for k in range(COUNT)], pictures)


def home(result: VideoResult) -> np.ndarray:
    """Where the true corners lie on the canvas."""
    assert result.panel.view is not None
    points = scene(result.number).corners_px.reshape(-1, 2)
    mapped = np.column_stack([points, np.ones(len(points))]) @ result.panel.view.homography.T
    return mapped[:, :2] / mapped[:, 2:]


# ---- rectifying ------------------------------------------------------------------------------


def test_the_smoothed_rotation_is_nearer_to_the_truth(results: list[VideoResult]) -> None:
    assert all(result.track.status == "tracked" for result in results)
    single = [off_deg(r, r.panel.pose.rotation, r.number) for r in results]
    smooth = [off_deg(r, r.track.rotation, r.number) for r in results]
    assert np.mean(smooth) < np.mean(single)
    assert max(smooth) < 3


def test_the_canvas_stays_and_so_does_the_panel_on_it(results: list[VideoResult]) -> None:
    shapes = {result.picture.shape for result in results if result.picture is not None}
    assert len(shapes) == 1
    assert len(results) == COUNT
    height, width, channels = shapes.pop()
    assert (height % 2, width % 2, channels) == (0, 0, 3)
    first = home(results[0])
    assert (first > 0).all()
    assert (first < [width, height]).all()
    for result in results:
        assert result.panel.view is not None
        assert result.panel.view.image.shape == (height, width, 4)
        # The camera moved by a tenth of its distance, the panel by less than its noise.
        assert np.abs(home(result) - first).max() < 3
        assert np.abs((home(result) - first).mean(axis=0)).max() < 0.7


def test_the_picture_shows_what_the_homography_says(results: list[VideoResult]) -> None:
    for result in results:
        picture = result.picture
        assert picture is not None
        assert not picture.flags.writeable
        centers = home(result).reshape(-1, 4, 2).mean(axis=1)
        between = 0.5 * (centers[0] + centers[1])
        for x, y in centers:
            assert picture[round(y), round(x)].min() > 200
        assert picture[round(between[1]), round(between[0])].max() < 60


def test_buttons_are_told_in_the_view_that_is_shown(results: list[VideoResult]) -> None:
    for result in results:
        corners = np.array([button.rectified_corners_px for button in result.panel.buttons])
        assert np.abs(corners.reshape(-1, 2) - home(result)).max() < 6
        assert result.panel.view is not None
        for button in result.panel.buttons:
            center = map_points(result.panel.view, button.outline.center_px[None])[0]
            assert button.rectified_center_px == pytest.approx(center)


def test_frames_without_buttons_are_marked_and_then_lost(pictures: list[np.ndarray]) -> None:
    rng = np.random.default_rng(4)
    shown = [nothing(), *(found(k, rng) for k in range(1, 5)), *([nothing()] * 7)]
    results = run(shown, pictures)
    statuses = [result.track.status for result in results]
    assert statuses[:5] == ["lost", *["tracked"] * 4]
    assert statuses[5] == "predicted"
    assert statuses[-1] == "lost"
    assert results[0].picture is None
    assert results[4].panel.view is not None
    assert results[5].panel.view is not None
    assert results[-1].panel.view is None
    tracked, predicted, lost = (results[k].picture for k in (4, 5, -1))
    assert tracked is not None
    assert predicted is not None
    assert lost is not None
    assert tracked.shape == predicted.shape == lost.shape
    # A frame and a banner around what is not tracked, in two colours.
    edges = [p[[0, -1]].reshape(-1, 3) for p in (tracked, predicted, lost)]
    marks = [{tuple(color) for color in edge.tolist()} for edge in edges]
    assert len(marks[1]) == len(marks[2]) == 1
    assert not marks[0] & (marks[1] | marks[2])
    assert not marks[1] & marks[2]


def test_a_wrong_frame_does_not_show(pictures: list[np.ndarray]) -> None:
    rng = np.random.default_rng(4)
    shown = [found(k, rng) for k in range(COUNT)]
    turned = replace(scene(6), rotation=rotation_from_angles(0.3, 0.5, 0.2) @ scene(6).rotation)
    quads = [Outline.quad(quad, std_px=1.0) for quad in turned.corners_px]
    shown[6] = Outlines(WIDTH, HEIGHT, tuple(quads))
    results = run(shown, pictures)
    assert results[6].panel.status == "ok"
    assert results[6].track.status == "predicted"
    assert off_deg(results[6], results[6].panel.pose.rotation, 6) > 10
    assert off_deg(results[6], results[6].track.rotation, 6) < 3
    assert [result.track.status for result in results].count("tracked") == COUNT - 1


def test_buttons_that_come_and_go_move_nothing(pictures: list[np.ndarray]) -> None:
    rng = np.random.default_rng(4)
    shown = []
    for k in range(COUNT):
        full = found(k, rng)
        kept = full.buttons if k == 0 else rng.permutation(np.array(full.buttons, object))[:8]
        shown.append(Outlines(WIDTH, HEIGHT, tuple(kept)))
    results = run(shown, pictures)
    first = home(results[0])
    for result in results:
        assert result.track.status == "tracked"
        assert np.abs(home(result) - first).max() < 4


def test_a_camera_that_leaps_by_a_row_shows_the_same_place() -> None:
    rng = np.random.default_rng(4)
    leapt = replace(scene(1), translation=scene(1).translation + np.array([0.0, 0.05, 0.0]))
    corners = leapt.corners_px + rng.normal(0, 0.3, (12, 4, 2))
    quads = tuple(Outline.quad(quad, std_px=0.3) for quad in corners)
    first, second = run([found(0, rng, 0.3), Outlines(WIDTH, HEIGHT, quads)])
    assert second.track.status == "tracked"
    assert second.panel.view is not None
    there = map_points(second.panel.view, leapt.corners_px.reshape(-1, 2))
    assert np.abs(there - home(first)).max() < 2


def test_another_rotation_and_focal_length_move_no_button_in_the_photo() -> None:
    pose = run([found(0, np.random.default_rng(4))])[0].panel.pose
    camera = CAMERA.with_focal(1.2 * CAMERA.focal_px, 0.1)
    other = seen_with(pose, camera, rotation_from_angles(0.1, -0.2, 0.0))
    for one in (pose, other):
        flat = one.plane_corners.reshape(-1, 2)
        rays = np.column_stack([flat, np.ones(len(flat))]) @ one.rotation
        assert np.abs(one.camera.project(rays) - scene(0).corners_px.reshape(-1, 2)).max() < 4
    assert other.camera is camera
    assert np.abs(other.plane_corners - pose.plane_corners).max() > 0.05


def test_a_cut_to_another_place_is_fitted_into_the_same_canvas() -> None:
    rng = np.random.default_rng(4)

    # Three buttons only, and much larger.
    tops = (20.0, 90.0, 160.0)
    quads = [[(60, top), (240, top), (240, top + 60), (60, top + 60)] for top in tops]
    elsewhere = Outlines(WIDTH, HEIGHT, tuple(Outline.quad(quad) for quad in quads))
    shown = [*(found(k, rng) for k in range(3)), *([elsewhere] * 5)]
    results = run(shown)
    last = results[-1]
    assert last.track.status == "tracked"
    assert last.picture is not None
    assert results[0].picture is not None
    assert last.picture.shape == results[0].picture.shape
    corners = np.array([button.rectified_corners_px for button in last.panel.buttons])
    height, width = last.picture.shape[:2]
    assert (corners > 0).all()
    assert (corners < [width, height]).all()


def test_the_photos_own_size_for_a_canvas(pictures: list[np.ndarray]) -> None:
    rng = np.random.default_rng(4)
    options = RectifierOptions(crop="input", lines=False, second_look=False, rectified_look=False)
    results = run([found(k, rng) for k in range(3)], pictures[:3], options=options)
    for result in results:
        assert result.picture is not None
        assert result.picture.shape == (HEIGHT, WIDTH, 3)


def test_an_unknown_focal_length_settles() -> None:
    rng = np.random.default_rng(4)
    results = run([found(k, rng, 0.5) for k in range(COUNT)], camera=None)
    views = [result.panel.view for result in results]
    focals = np.log([view.camera.focal_px / CAMERA.focal_px for view in views if view is not None])
    single = run([found(0, rng, 0.5)], camera=None)[0].panel.pose.camera
    assert len(focals) == COUNT
    assert np.abs(np.diff(focals))[6:].max() < 0.5 * single.focal_std
    assert abs(focals[-1]) < 2 * single.focal_std
    last = results[-1].panel.pose.camera
    assert last.focal_std < single.focal_std
    assert last.source == "estimated"


def test_records_are_plain_and_complete(results: list[VideoResult]) -> None:
    record = json.loads(json.dumps(video_record(results[3]), allow_nan=False))
    assert record["frame"] == 3
    assert record["time_s"] == pytest.approx(0.3)
    assert record["status"] == "ok"
    assert record["track"]["status"] == "tracked"
    assert record["track"]["angles_deg"] == pytest.approx(results[3].track.angles_deg)
    assert record["track"]["std_deg"] == pytest.approx(results[3].track.std_deg)
    assert np.allclose(record["track"]["rotation"], results[3].track.rotation)
    assert len(record["buttons"]) == 12
    assert record["buttons"] == results[3].panel.to_dict()["buttons"]
    lost = json.loads(json.dumps(video_record(run([nothing()])[0]), allow_nan=False))
    assert lost["status"] == "no_buttons"
    assert lost["track"]["status"] == "lost"
    assert lost["track"]["reasons"]
    assert lost["track"]["rotation"] is None
    assert lost["track"]["age_s"] is None


def test_a_frame_of_another_size_is_an_error() -> None:
    rng = np.random.default_rng(4)
    rectifier = VideoRectifier(Shown([found(0, rng)]).rectifier())
    rectifier(Frame(0, 0.0, np.zeros((HEIGHT, WIDTH, 3), np.uint8)))
    with pytest.raises(InputError, match="frame 1"):
        rectifier(Frame(1, 0.1, np.zeros((HEIGHT, HEIGHT, 3), np.uint8)))


# ---- reading ---------------------------------------------------------------------------------


def test_frames_of_a_file(film: Path, pictures: list[np.ndarray]) -> None:
    read = list(frames(film))
    assert [frame.number for frame in read] == list(range(COUNT))
    assert [frame.time_s for frame in read] == pytest.approx([k / RATE_HZ for k in range(COUNT)])
    for frame, picture in zip(read, pictures, strict=True):
        assert frame.image.shape == (HEIGHT, WIDTH, 3)
        assert frame.image.dtype == np.uint8
        assert not frame.image.flags.writeable
        assert frame.rate_hz == pytest.approx(RATE_HZ)
        assert np.abs(frame.image.astype(int) - picture).mean() < 10


def test_every_third_frame(film: Path) -> None:
    read = list(frames(str(film), every=3))
    assert [frame.number for frame in read] == [0, 3, 6, 9]
    assert [frame.time_s for frame in read] == pytest.approx([0, 0.3, 0.6, 0.9])
    assert read[0].rate_hz == pytest.approx(RATE_HZ / 3)


def test_colours_are_in_rgb_order(tmp_path: Path) -> None:
    path = tmp_path / "red.avi"
    with VideoWriter(path) as writer:
        for _ in range(3):
            writer.write(np.full((48, 64, 3), (250, 10, 20), np.uint8))
    for frame in frames(path):
        assert np.abs(frame.image.mean(axis=(0, 1)) - [250, 10, 20]).max() < 12


def test_how_the_phone_was_held_is_applied(tmp_path: Path) -> None:
    path = tmp_path / "portrait.mp4"
    marked = np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    marked[:60, :80] = 255  # top left as the sensor has it
    with VideoWriter(path) as writer:
        for _ in range(4):
            writer.write(marked)
    content = bytearray(path.read_bytes())
    at = content.index(b"tkhd") + 4 + 40  # the track header's matrix (ISO 14496-12, 8.3.2)
    quarter = (0, 1 << 16, 0, -1 << 16, 0, 0, HEIGHT << 16, 0, 1 << 30)
    content[at : at + 36] = struct.pack(">9i", *quarter)
    path.write_bytes(content)
    image = next(frames(path)).image
    assert image.shape == (WIDTH, HEIGHT, 3)
    assert image[:70, -50:].min() > 200  # top right after a quarter turn clockwise
    assert image[-70:].max() < 50


def released(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Notes every capture that is made and released."""
    seen: list[str] = []
    make = cv2.VideoCapture

    class Spy:
        def __init__(self, *arguments: object) -> None:
            self._capture = make(*arguments)
            seen.append("opened")

        def __getattr__(self, name: str) -> object:
            return getattr(self._capture, name)

        def release(self) -> None:
            seen.append("released")
            self._capture.release()

    monkeypatch.setattr(cv2, "VideoCapture", Spy)
    return seen


def test_a_closed_iterator_releases_the_file(film: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    seen = released(monkeypatch)
    iterator = frames(film)
    assert seen == []
    next(iterator)
    assert seen == ["opened"]
    iterator.close()  # type: ignore[attr-defined]
    assert seen == ["opened", "released"]
    list(frames(film))
    assert seen == ["opened", "released"] * 2


def test_files_that_are_no_videos(
    film: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    content = film.read_bytes()
    (tmp_path / "cut.mp4").write_bytes(content[: len(content) // 2])
    (tmp_path / "noise.mp4").write_bytes(np.random.default_rng(0).bytes(5000))
    (tmp_path / "text.mp4").write_text("no video\n" * 100, encoding="utf-8")
    (tmp_path / "empty.mp4").touch()
    (tmp_path / "folder.mp4").mkdir()
    seen = released(monkeypatch)
    for name in ("cut", "noise", "text", "empty", "folder", "missing"):
        with pytest.raises(InputError, match=f"{name}.mp4"):
            list(frames(tmp_path / f"{name}.mp4"))
    assert seen.count("opened") == seen.count("released")


def test_a_video_that_ends_early_gives_what_it_has(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "whole.avi"
    rng = np.random.default_rng(0)
    with VideoWriter(path) as writer:
        for _ in range(20):
            writer.write(rng.integers(0, 255, (48, 64, 3), np.uint8))
    assert len(list(frames(path))) == 20
    assert not caplog.records
    content = path.read_bytes()
    (tmp_path / "cut.avi").write_bytes(content[: len(content) // 2])
    assert 1 <= len(list(frames(tmp_path / "cut.avi"))) < 20
    assert "cut.avi" in caplog.text


def test_a_camera_that_is_not_there() -> None:
    with pytest.raises(InputError, match="camera 97"):
        next(frames(97))
    with pytest.raises(InputError, match="camera"):
        next(frames(-1))


class FakeCamera:
    """A camera that gives three frames, or none."""

    shown = 3

    def __init__(self, index: int) -> None:
        self.left = self.shown

    def isOpened(self) -> bool:
        return True

    def get(self, prop: int) -> float:
        return 0.0

    def grab(self) -> bool:
        self.left -= 1
        return self.left >= 0

    def retrieve(self) -> tuple[bool, np.ndarray]:
        return True, np.full((48, 64, 3), (1, 2, 3), np.uint8)

    def release(self) -> None:
        self.left = 0


def test_a_camera(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(cv2, "VideoCapture", FakeCamera)
    read = list(frames(0))
    assert [frame.number for frame in read] == [0, 1, 2]
    assert read[0].time_s == 0
    assert np.all(np.diff([frame.time_s for frame in read]) >= 0)
    assert tuple(read[0].image[0, 0]) == (3, 2, 1)
    monkeypatch.setattr(FakeCamera, "shown", 0)
    with pytest.raises(InputError, match="camera 0"):
        list(frames(0))


def test_every_has_to_be_positive(film: Path) -> None:
    with pytest.raises(InputError, match="every"):
        next(frames(film, every=0))


# ---- writing ---------------------------------------------------------------------------------


def read_by_opencv(path: Path) -> list[np.ndarray]:
    capture = cv2.VideoCapture(str(path))
    read = []
    while (frame := capture.read())[0]:
        read.append(frame[1])
    capture.release()
    return read


@pytest.mark.parametrize("suffix", [".mp4", ".avi"])
def test_a_rectified_video(results: list[VideoResult], tmp_path: Path, suffix: str) -> None:
    path = tmp_path / f"out{suffix}"
    with VideoWriter(path, RATE_HZ) as writer:
        for result in results:
            writer.write(result.picture)
    read = read_by_opencv(path)
    assert len(read) == COUNT
    assert results[0].picture is not None
    assert read[0].shape == results[0].picture.shape
    assert np.abs(read[5][..., ::-1].astype(int) - results[5].picture).mean() < 12
    assert list(tmp_path.iterdir()) == [path]


def test_empty_frames_keep_step_and_odd_sizes_are_continued(tmp_path: Path) -> None:
    path = tmp_path / "out.mp4"
    white = np.full((61, 81, 3), 255, np.uint8)
    with VideoWriter(path) as writer:
        for picture in (None, None, white, None, white):
            writer.write(picture)
    read = read_by_opencv(path)
    assert [round(frame.mean(), -2) for frame in read] == [100, 100, 300, 100, 300]
    assert read[0].shape == (62, 82, 3)


def test_an_interrupted_write_leaves_no_file(tmp_path: Path) -> None:
    path = tmp_path / "out.mp4"
    with pytest.raises(KeyboardInterrupt), VideoWriter(path) as writer:  # noqa: PT012
        writer.write(np.zeros((48, 64, 3), np.uint8))
        assert len(list(tmp_path.iterdir())) == 1
        assert not path.exists()
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []


def test_an_older_file_stays_until_the_new_one_is_whole(tmp_path: Path) -> None:
    path = tmp_path / "out.mp4"
    path.write_text("older", encoding="utf-8")
    with VideoWriter(path) as writer:
        writer.write(None)
    assert path.read_text(encoding="utf-8") == "older"
    with pytest.raises(InputError, match="picture"), VideoWriter(path) as writer:  # noqa: PT012
        writer.write(np.zeros((48, 64, 3), np.uint8))
        writer.write(np.zeros((48, 48, 3), np.uint8))
    assert path.read_text(encoding="utf-8") == "older"
    assert list(tmp_path.iterdir()) == [path]
    with VideoWriter(path) as writer:
        writer.write(np.zeros((48, 64, 3), np.uint8))
    assert len(read_by_opencv(path)) == 1


def test_where_nothing_can_be_written(tmp_path: Path) -> None:
    picture = np.zeros((48, 64, 3), np.uint8)
    with pytest.raises(InputError, match="out"), VideoWriter(tmp_path / "no/out.mp4") as writer:
        writer.write(picture)
    with pytest.raises(InputError, match=r"\.mp4"):
        VideoWriter(tmp_path / "out.gif")
    with pytest.raises(InputError, match="rate_hz"):
        VideoWriter(tmp_path / "out.mp4", float("nan"))
    with pytest.raises(InputError, match="uint8"), VideoWriter(tmp_path / "out.mp4") as writer:
        writer.write(np.zeros((48, 64), np.uint8))
    assert list(tmp_path.iterdir()) == []


def test_a_disk_that_is_full_is_noticed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    make = cv2.VideoWriter

    class Full:
        """Takes frames, and keeps the first ones only."""

        fourcc = staticmethod(make.fourcc)

        def __init__(self, *arguments: object) -> None:
            self._writer, self._taken = make(*arguments), 0

        def isOpened(self) -> bool:
            return bool(self._writer.isOpened())

        def release(self) -> None:
            self._writer.release()

        def write(self, picture: np.ndarray) -> None:
            self._taken += 1
            if self._taken <= 2:
                self._writer.write(picture)

    monkeypatch.setattr(cv2, "VideoWriter", Full)
    writer = VideoWriter(tmp_path / "out.mp4")
    for _ in range(5):
        writer.write(np.zeros((48, 64, 3), np.uint8))
    with pytest.raises(InputError, match="2 of 5"), writer:
        pass
    assert list(tmp_path.iterdir()) == []
