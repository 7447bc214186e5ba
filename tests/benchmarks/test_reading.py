"""Of the reading benchmark: crops, scoring, and the way to the recogniser's own Python."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

import reading
from fronto import map_points
from fronto.synth import PAPER_CAMERA
from scenes import Case, turned

SQUARE = np.array([[10.0, 20], [30, 20], [30, 60], [10, 60]])


def ramp(width: int, height: int) -> np.ndarray:
    """Red tells the column, green the row."""
    y, x = np.mgrid[:height, :width]
    return np.stack([x, y, np.zeros_like(x)], axis=-1).astype(np.uint8)


def test_a_box_of_48_pixels_is_cut_out_as_it_is() -> None:
    image = np.random.default_rng(1).integers(0, 256, (90, 80, 3), np.uint8)
    crop = reading.cut(image, np.array([4.5, 9.5, 52.5, 57.5]))
    np.testing.assert_array_equal(crop, image[10:58, 5:53])


@settings(derandomize=True, deadline=None, max_examples=40)
@given(x=st.floats(10, 60), y=st.floats(10, 60), width=st.floats(10, 90), height=st.floats(10, 90))
def test_a_crop_shows_its_box_at_the_height_asked_for(
    x: float, y: float, width: float, height: float
) -> None:
    crop = reading.cut(ramp(200, 200), np.array([x, y, x + width, y + height])).astype(float)
    rows, columns = crop.shape[:2]
    assert rows == reading.HEIGHT_PX
    assert abs(columns - rows * width / height) <= 0.5 + 1e-9
    # Rounding to whole grey levels and to 1/32 px.
    np.testing.assert_allclose(crop[..., 0].mean(), x + width / 2, atol=0.6)
    np.testing.assert_allclose(crop[..., 1].mean(), y + height / 2, atol=0.6)
    ends = x + np.array([0.5, columns - 0.5]) * width / columns
    np.testing.assert_allclose(crop[24, [0, -1], 0], ends, atol=1.1)


def test_what_lies_nowhere_is_black_and_what_is_endless_has_an_end() -> None:
    assert not reading.cut(ramp(50, 50) + 1, np.full(4, np.nan)).any()
    wide = reading.cut(ramp(50, 50), np.array([0, 0, 40_000, 4.0]))
    assert wide.shape[1] == reading.MAX_WIDTH_PX
    assert reading.cut(ramp(50, 50), np.array([0, 0, 1e-3, 40])).shape[1] == 1


def test_a_box_is_inset_by_a_share_of_its_own_sides() -> None:
    np.testing.assert_allclose(reading.inset_box(SQUARE, 0.1), [12, 24, 28, 56])
    np.testing.assert_allclose(reading.inset_box(SQUARE[[2, 0, 3, 1]], 0.0), [10, 20, 30, 60])


def test_in_the_true_view_all_buttons_are_upright_squares() -> None:
    noise = np.random.default_rng(2).integers(0, 256, (480, 640, 3), np.uint8)
    rotation = turned(50.0, 30.0, 8.0)
    case = Case(noise, PAPER_CAMERA, reading.PANEL, rotation, rotation @ [0, 0, 0.3], PAPER_CAMERA)
    view = reading.true_view(case)
    corners = map_points(view, case.corners_px.reshape(-1, 2)).reshape(-1, 4, 2)
    for button in corners:
        box = reading.inset_box(button, 0.0)
        np.testing.assert_allclose(button, box[[[0, 1], [2, 1], [2, 3], [0, 3]]], atol=1e-6)
    before = [reading.cut(case.image, reading.inset_box(b)) for b in case.corners_px]
    after = reading.in_view(view, case, before)
    assert {crop.shape for crop in after} == {(48, 48, 3)}
    assert len({crop.shape for crop in before}) > 1
    assert reading.in_view(None, case, before) is before


@pytest.mark.parametrize(
    ("text", "score", "expected"),
    [
        ("12", 0.9, "right"),
        ("12", 0.5, "right"),
        ("12", 0.49, "declined"),
        ("l2", 0.9, "wrong"),
        ("1", 0.9, "wrong"),
        ("1", 0.1, "declined"),
        ("", 1.0, "declined"),
    ],
)
def test_a_reading_is_right_wrong_or_declined(text: str, score: float, expected: str) -> None:
    assert reading.outcome("12", text, score) == expected


def rows_of(view: str, photo: int, texts: list[str], score: float = 0.9) -> list[dict]:
    kind = {"tilt_deg": 10, "photo": photo, "view": view, "status": "ok"}
    return [kind | {"label": "7", "text": text, "score": score} for text in texts]


def test_labels_are_counted_by_photo_and_view() -> None:
    rows = [
        *rows_of("photo", 0, ["7", "1", "", "7"]),
        *rows_of("photo", 1, ["7", "7"], score=0.2),
        *rows_of("head-on view", 0, ["7", "7", "7", "7"]),
    ]
    first, second, third = reading.counted(rows)
    assert (first["labels"], first["exact"], first["right"]) == (4, 2, 2)
    assert (first["wrong"], first["declined"]) == (1, 1)
    # Exactly right, but nobody would trust it.
    assert (second["exact"], second["right"], second["declined"]) == (2, 0, 2)
    assert third["view"] == "head-on view"
    assert third["exact"] == 4


@settings(derandomize=True, deadline=None, max_examples=40)
@given(
    st.lists(st.tuples(st.sampled_from(["7", "1", ""]), st.floats(0, 1)), min_size=1, max_size=30)
)
def test_every_label_is_right_wrong_or_declined(readings: list[tuple[str, float]]) -> None:
    rows = [row for text, score in readings for row in rows_of("photo", 0, [text], score)]
    (line,) = reading.counted(rows)
    assert line["right"] + line["wrong"] + line["declined"] == line["labels"] == len(readings)
    assert line["right"] <= line["exact"]


def test_the_share_is_the_mean_over_photos_with_its_standard_error() -> None:
    rows = [*rows_of("photo", 0, ["7", "7"]), *rows_of("photo", 1, ["7", "1", "1", "1"])]
    mean, error = reading.share(reading.counted(rows), 10, "photo", "exact")
    assert mean == pytest.approx((1 + 0.25) / 2)
    assert error == pytest.approx(0.75 / np.sqrt(2) / np.sqrt(2))
    one, unknown = reading.share(reading.counted(rows[:2]), 10, "photo", "exact")
    assert one == 1
    assert np.isnan(unknown)


def test_tables_have_a_line_for_each_view_and_a_column_for_each_tilt() -> None:
    rows = [row for view in reading.VIEWS for row in rows_of(view, 0, ["7", "1", "1", ""])]
    text = reading.tables(reading.counted(rows), (10,))
    assert text.count("10°") == 2
    for view in reading.VIEWS:
        assert f"| {view} | 25 % |" in text
        assert f"| {view} | 50 / 25 % |" in text


def test_the_figure_names_readings_that_its_font_cannot_draw() -> None:
    assert [reading.as_drawn(text) for text in ("12", "", "日")] == ["“12”", "nothing", "Chinese"]


def test_pictures_reach_the_worker_and_readings_come_back_in_order(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    worker = tmp_path / "worker.py"
    # Answers with the colour it sees, in another order.
    worker.write_text(
        "import json, sys, cv2\n"
        "from pathlib import Path\n"
        "paths = sorted(Path(sys.argv[1]).glob('*.png'), reverse=True)\n"
        "read = {p.name: [f' {cv2.imread(str(p))[0, 0, ::-1].tolist()}\\n', 0.5] for p in paths}\n"
        "Path(sys.argv[2]).write_text(json.dumps(read))\n",
        encoding="utf-8",
    )
    monkeypatch.setattr(reading, "WORKER", worker)
    pictures = [np.full((4, 5, 3), color, np.uint8) for color in ((9, 8, 7), (1, 2, 3))]
    assert reading.read(pictures, Path(sys.executable)) == [
        ("[9, 8, 7]", 0.5),
        ("[1, 2, 3]", 0.5),
    ]


def test_without_the_recogniser_it_says_so_and_writes_nothing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def fail(*_: object) -> None:
        raise AssertionError("wrote something")

    for name in ("write_between", "write_csv", "write_json", "draw"):
        monkeypatch.setattr(reading, name, fail)
    absent = tmp_path / "bin" / "python"
    monkeypatch.setattr(sys, "argv", ["reading.py", "--peers-python", str(absent)])
    assert reading.main() == reading.SKIPPED
    said = capsys.readouterr().out
    assert str(absent) in said
    assert "nothing written" in said


def test_the_worker_needs_nothing_of_fronto() -> None:
    worker = reading.WORKER.read_text(encoding="utf-8")
    assert "import fronto" not in worker
    assert "from fronto" not in worker


def test_what_is_written_can_be_read_again(tmp_path: Path) -> None:
    rows = [row for view in reading.VIEWS for row in rows_of(view, 0, ["7", "1"])]
    lines = reading.counted(rows)
    reading.write_csv(tmp_path / "reading.csv", lines)
    reading.write_json(tmp_path / "reading.json", {"shares": reading.curves(lines, (10,))})
    assert (tmp_path / "reading.csv").read_text(encoding="utf-8").count("\n") == 1 + len(lines)
    record = json.loads((tmp_path / "reading.json").read_text(encoding="utf-8"))
    assert record["shares"]["photo"]["exact"] == [0.5]
