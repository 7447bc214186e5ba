"""From readings to named buttons: plates, order and thresholds together."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
import pytest

import fronto
from fronto.draw import button_names
from fronto.engine.reader import _packaged
from fronto.labels.context import Head
from fronto.labels.name import name_buttons, packaged_reader
from fronto.labels.reader import Reading
from fronto.outlines import Outlines
from fronto.panelfile import panel_to_json
from fronto.results import Button, Panel, Plate
from fronto.shapes import Outline

CAMERA = fronto.Camera.from_matrix([[600, 0, 320], [0, 600, 240], [0, 0, 1]], 640, 480)
SQUARE = np.array([(-15.0, -15), (15, -15), (15, 15), (-15, 15)])
#: Buttons of a column; the turned camera sees the panel from the side.
PLACES = [(300.0, 60 + 50 * k) for k in range(6)]
STRAIGHT = np.eye(3)
TURNED = np.array([[0.9, 0.12, 20], [-0.1, 0.95, 30], [-2e-4, 1e-4, 1]])

Said = Mapping[str, float] | str


def reading(said: Said) -> Reading:
    """A kind without a label, or labels with probabilities."""
    if isinstance(said, str):
        return Reading("", said, 0.97)
    alternatives = tuple(sorted(said.items(), key=lambda item: -item[1]))
    label, confidence = alternatives[0]
    return Reading(label, "text", confidence, alternatives)


@dataclass
class Painted:
    """Reads crops of a photo that shows the number of a reading as a grey."""

    said: Sequence[Said]
    seen: list[int] = field(default_factory=list)

    def read(self, crops: np.ndarray) -> tuple[Reading, ...]:
        assert crops.shape[1:] == (48, 48, 3)
        seen = [round(float(crop[12:36, 12:36].mean()) / 5) - 1 for crop in crops]
        self.seen = self.seen or seen  # what is unclear may be read again, turned
        return tuple(reading(self.said[k]) for k in seen)


def quad(place: tuple[float, float], warp: np.ndarray = STRAIGHT, **more: object) -> Outline:
    corners = np.column_stack([SQUARE + place, np.ones(4)]) @ warp.T
    return Outline.quad(corners[:, :2] / corners[:, 2:], **more)  # type: ignore[arg-type]


def named(
    said: Sequence[Said],
    plates: Sequence[Said] = (),
    warp: np.ndarray = STRAIGHT,
    outlines: Sequence[Outline] | None = None,
    head: Head | None = None,
) -> Panel:
    """A column of buttons, plates to the left of the first ones."""
    import cv2

    buttons = outlines or [quad(place, warp) for place in PLACES[: len(said)]]
    beside = [quad((x - 36, y), warp) for x, y in PLACES[: len(plates)]]
    photo = np.zeros((480, 640, 3), np.uint8)
    for k, outline in enumerate([*buttons, *beside]):
        corners = np.rint(outline.corners_px).astype(np.int32)  # type: ignore[arg-type]
        cv2.fillPoly(photo, [corners], (5 * (k + 1),) * 3)
    panel = fronto.rectify_outlines(photo, buttons, CAMERA)
    panel = replace(panel, plates=tuple(Plate(outline) for outline in beside))
    reader = Painted([*said, *plates])
    result = name_buttons(panel, photo, reader, head)
    assert reader.seen == list(range(len(said) + len(plates)))
    return result


def labels(panel: Panel) -> list[str]:
    return [button.label for button in panel.buttons]


def sources(panel: Panel) -> list[str | None]:
    return [button.label_source for button in panel.buttons]


@pytest.mark.parametrize("warp", [STRAIGHT, TURNED])
def test_buttons_say_what_they_are(warp: np.ndarray) -> None:
    panel = named([{"3": 0.99}, {"2": 0.98}, {"open": 0.97}, {"FAN": 0.95}], warp=warp)
    assert panel.status in ("ok", "uncertain")
    assert labels(panel) == ["3", "2", "open", "FAN"]
    assert sources(panel) == ["button"] * 4
    assert all(0.9 < button.label_confidence <= 1 for button in panel.buttons)  # type: ignore[operator]
    assert panel.buttons[0].label_guesses[0][0] == "3"


@pytest.mark.parametrize("warp", [STRAIGHT, TURNED])
def test_plates_name_the_buttons_beside_them(warp: np.ndarray) -> None:
    plates = [{"4": 0.99}, {"3": 0.98}, {"2": 0.97}, {"alarm": 0.99}]
    panel = named(["blank", "unreadable", {"2": 0.6, "7": 0.3}, "other"], plates, warp)
    assert labels(panel) == ["4", "3", "2", "alarm"]
    assert sources(panel) == ["plate"] * 4
    assert [(plate.label, plate.button) for plate in panel.plates] == [
        ("4", 0),
        ("3", 1),
        ("2", 2),
        ("alarm", 3),
    ]


def test_without_a_pose_plates_are_paired_in_the_photo() -> None:
    slanted = np.array([[0.94, 0.3, -20], [-0.3, 0.94, 100], [0, 0, 1.0]])
    panel = named(["blank"], [{"4": 0.99}])
    assert panel.pose.status in ("degenerate", "uncertain")
    assert labels(panel) == ["4"]
    said: list[Said] = [{"4": 0.99}, {"3": 0.98}, {"2": 0.97}]
    panel = named(["blank"] * 3, said, slanted)
    assert labels(panel) == ["4", "3", "2"]


def test_a_button_and_a_plate_that_disagree_name_nobody() -> None:
    panel = named([{"7": 0.97}, {"6": 0.97}], [{"11": 0.97}, {"10": 0.97}])
    assert labels(panel) == ["", ""]
    assert sources(panel) == [None, None]
    assert all(button.label_confidence is not None for button in panel.buttons)
    # One alone is something else that lies there.
    assert labels(named([{"7": 0.97}, {"6": 0.97}], [{"11": 0.97}])) == ["7", "6"]
    # The star of the way out is no other floor.
    assert labels(named([{"G": 0.97}], [{"*": 0.97}])) == ["G"]


@pytest.mark.parametrize("said", ["blank", {"1": 0.9}])
def test_a_plate_among_the_buttons_is_not_pressed(said: Said) -> None:
    x, y = PLACES[3]
    outlines = [*(quad(place) for place in PLACES[:4]), quad((x - 36, y))]
    readings: list[Said] = ["blank", "blank", "blank", said, {"1": 0.99}]
    panel = named(readings, [{"4": 0.99}, {"3": 0.98}, {"2": 0.97}], outlines=outlines)
    assert labels(panel) == ["4", "3", "2", "1", ""]
    assert panel.buttons[4].label_guesses[0][0] == ""
    assert any("4" in note for note in panel.notes)
    # A button beside it with a label of its own is no plate's button.
    readings[3] = {"up": 0.99}
    assert labels(named(readings, [{"4": 0.99}, {"3": 0.98}, {"2": 0.97}], outlines=outlines))[
        3:
    ] == ["up", "1"]


def test_plates_that_were_all_taken_for_buttons_name_the_blank_ones_beside_them() -> None:
    beside = [(x - 36, y) for x, y in PLACES[:4]]
    outlines = [quad(place) for place in (*PLACES[:4], *beside, (500, 400))]
    floors: list[Said] = [{"4": 0.99}, {"3": 0.98}, {"2": 0.97}, {"open": 0.99}]
    panel = named(["blank", "blank", "blank", "blank", *floors, {"stop": 0.99}], outlines=outlines)
    assert labels(panel) == ["4", "3", "2", "open", "", "", "", "", "stop"]
    assert sources(panel)[:4] == ["plate"] * 4


def test_a_blank_button_among_others_makes_no_plates() -> None:
    places = [*PLACES[:5], *((x + 45, y) for x, y in PLACES[:5])]
    outlines = [quad(place) for place in places]
    floors = [str(k) for k in range(9, 0, -1)]
    said: list[Said] = [*({floor: 0.99} for floor in floors), "blank"]
    panel = named(said, outlines=outlines)
    assert labels(panel)[:9] == floors


def test_weak_readings_are_declined_and_their_guesses_told() -> None:
    panel = named([{"open": 0.45, "close": 0.4}, "unreadable", "blank"])
    assert labels(panel) == ["", "", ""]
    first, second, _ = panel.buttons
    assert dict(first.label_guesses) == pytest.approx({"open": 0.45, "close": 0.4})
    assert first.label_confidence == pytest.approx(0.45)
    assert (second.label_confidence, second.label_guesses) == (0.0, ())


def test_what_follows_from_the_neighbours_only_is_inferred() -> None:
    said: list[Said] = [{"6": 0.99}, {"5": 0.99}, "unreadable", {"3": 0.99}, {"8": 0.5, "2": 0.4}]
    panel = named(said)
    assert labels(panel) == ["6", "5", "4", "3", "2"]
    assert sources(panel) == ["button", "button", "inferred", "button", "inferred"]
    assert button_names(panel.buttons) == ["6", "5", "(4)", "3", "(2)"]


def test_another_symbol_is_not_filled_in() -> None:
    panel = named([{"6": 0.99}, {"5": 0.99}, "other", {"3": 0.99}])
    assert labels(panel) == ["6", "5", "", "3"]
    assert panel.buttons[2].label_guesses[0][0] == ""
    assert button_names(panel.buttons)[2] == "other"  # its category


def test_a_label_is_named_where_it_is_likelier_than_not() -> None:
    assert labels(named([{"12": 0.48, "72": 0.1}, "blank"])) == ["", ""]
    assert labels(named([{"12": 0.53, "72": 0.4}, "blank"])) == ["12", ""]
    assert labels(named([{"alarm": 0.47}, "blank"])) == ["", ""]
    assert labels(named([{"alarm": 0.53}, "blank"])) == ["alarm", ""]


def test_one_floor_on_two_buttons_is_on_neither() -> None:
    panel = named([{"6": 0.98}, {"up": 0.99}, {"6": 0.98}])
    assert labels(panel) == ["", "up", ""]
    assert button_names(panel.buttons) == ["?", "up", "?"]
    (note,) = [note for note in panel.notes if "6" in note]
    assert "0" in note
    assert "2" in note
    # One far surer keeps it.
    panel = named([{"6": 0.999}, {"up": 0.99}, {"6": 0.6}])
    assert labels(panel) == ["6", "up", ""]


def test_part_of_a_label_is_no_label() -> None:
    outlines = [quad(place) for place in PLACES[:2]]
    cut = [outlines[0], replace(outlines[1], truncated=True)]
    assert labels(named([{"up": 0.99}, {"1": 0.99}], outlines=cut)) == ["up", ""]


def test_labels_that_came_with_the_outlines_stay() -> None:
    outlines = [quad(place, text=text) for place, text in zip(PLACES, ["9", "", "7"], strict=False)]
    panel = named([{"3": 0.99}, "unreadable", {"4": 0.99}], outlines=outlines)
    assert labels(panel) == ["9", "8", "7"]
    assert sources(panel) == [None, "inferred", None]
    assert panel.buttons[0].label_confidence is None


def test_naming_twice_changes_nothing() -> None:
    said: list[Said] = [{"3": 0.99}, {"2": 0.6}, "blank"]
    panel = named(said)
    photo = np.zeros((480, 640, 3), np.uint8)

    class Same:
        def read(self, crops: np.ndarray) -> tuple[Reading, ...]:
            return tuple(map(reading, said))

    again = name_buttons(panel, photo, Same())
    assert labels(again) == labels(panel)
    assert [b.label_guesses for b in again.buttons] == [b.label_guesses for b in panel.buttons]


def test_plates_that_lie_on_their_side() -> None:
    class Tilted(Painted):
        calls = 0

        def read(self, crops: np.ndarray) -> tuple[Reading, ...]:
            self.calls += 1
            found = super().read(crops)
            upright = self.calls == 4  # after as it is, to the right, upside down
            return tuple(
                r if upright or not r.text else Reading("", "unreadable", 0.7) for r in found
            )

    said: list[Said] = ["blank"] * 4
    said += [{floor: 0.95} for floor in "4321"]
    plain = named(said[:4], said[4:])
    photo = np.zeros((480, 640, 3), np.uint8)
    import cv2

    for k, thing in enumerate([*plain.buttons, *plain.plates]):
        corners = np.rint(thing.outline.corners_px).astype(np.int32)  # type: ignore[arg-type]
        cv2.fillPoly(photo, [corners], (5 * (k + 1),) * 3)
    bare = replace(plain, plates=tuple(Plate(plate.outline) for plate in plain.plates), notes=())
    tilted = name_buttons(bare, photo, Tilted(said))
    assert labels(tilted) == labels(plain) == ["4", "3", "2", "1"]
    assert tilted.notes == ("the labels on the plates are turned to the left",)


def test_no_outlines_need_no_reader() -> None:
    photo = np.zeros((480, 640, 3), np.uint8)
    panel = fronto.rectify_outlines(photo, [], CAMERA)
    assert name_buttons(panel, photo, Painted([])) is panel


def test_labels_in_json() -> None:
    panel = named([{"6": 0.99}, {"open": 0.45, "close": 0.4}], [{"6": 0.98}])
    panel = replace(
        panel,
        buttons=(
            replace(
                panel.buttons[0],
                position_m=np.array([0.1, 0.2, 0.5]),
                position_std_m=np.full(3, 0.001),
                press_normal=np.array([0.0, 0, 1]),
            ),
            panel.buttons[1],
        ),
    )
    values = json.loads(panel_to_json(panel))
    first, second = values["buttons"]
    assert (first["label"], first["label_source"]) == ("6", "button")
    assert first["position_m"] == [0.1, 0.2, 0.5]
    assert first["position_std_m"] == [0.001] * 3
    assert first["press_normal"] == [0, 0, 1]
    assert (second["label"], second["label_source"]) == (None, None)
    assert second["position_m"] is second["position_std_m"] is second["press_normal"] is None
    assert second["label_guesses"][0] == ["open", pytest.approx(0.5, abs=0.05)]
    (plate,) = values["plates"]
    assert (plate["label"], plate["button"]) == ("6", 0)
    assert plate["label_confidence"] == pytest.approx(0.98)
    assert len(plate["corners_px"]) == 4


def test_positions_are_read_only_copies() -> None:
    place = np.array([0.1, 0.2, 0.5])
    button = Button(0, quad(PLACES[0]), None, None, 0.1, 1.0, position_m=place)
    place[0] = 9
    assert button.position_m is not None
    assert button.position_m[0] == 0.1
    with pytest.raises(ValueError, match="read-only"):
        button.position_m[0] = 1


def test_the_rectifier_names_buttons_last() -> None:
    outlines = tuple(quad(place) for place in PLACES)
    calls: list[tuple[tuple[int, ...], int]] = []

    def read(photo: np.ndarray, panel: Panel) -> Panel:
        calls.append((photo.shape, len(panel.buttons)))
        buttons = tuple(replace(button, label=str(button.id)) for button in panel.buttons)
        return replace(panel, buttons=buttons, notes=("read",))

    def rectified(**options: bool) -> Panel:
        return fronto.Rectifier(
            fronto.RectifierOptions(rectified_look=False, **options),
            camera=CAMERA,
            segment=lambda photo: fronto.Segments(640, 480, ()),
            outline=lambda segments, photo: Outlines(640, 480, outlines, (quad((100, 100)),)),
            read=read,
        )(np.zeros((480, 640, 3), np.uint8))

    panel = rectified()
    assert calls == [((480, 640, 3), 6)]
    assert labels(panel) == ["0", "1", "2", "3", "4", "5"]
    assert panel.timing_ms["read_labels"] >= 0
    assert "read" in panel.notes
    assert [plate.label for plate in panel.plates] == [""]
    assert labels(rectified(read_labels=False)) == [""] * 6
    assert len(calls) == 1


def test_weights_of_the_reader_may_be_missing(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def forget() -> None:
        packaged_reader.cache_clear()
        _packaged.cache_clear()

    (tmp_path / "weights").mkdir()
    for place in ("fronto.engine.reader.files", "fronto.engine.onnxfile.files"):
        monkeypatch.setattr(place, lambda package: tmp_path)
    forget()
    try:
        assert packaged_reader() is None
        (tmp_path / "weights" / "fronto-read-01234567.onnx").write_bytes(b"no network")
        forget()
        with pytest.raises(fronto.InputError, match="fronto-read"):
            packaged_reader()
    finally:
        forget()
