"""Plates beside buttons: told apart from the labels alone, and as the photos' corrections say."""

from collections import Counter
from collections.abc import Iterable
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from fronto.datasets.names import category_of, printed_text
from fronto.datasets.panels import Side, incomplete_photos, read_panels, split_plates
from fronto.datasets.records import LabeledObject
from fronto.errors import InputError

DATA = Path(__file__).parents[3] / "shared/data/panels"
needs_photos = pytest.mark.skipif(not DATA.is_dir(), reason="../shared/data/panels is not here")


def thing(name: str, x: float, y: float, width: float = 30, height: float = 30) -> LabeledObject:
    """A box around (x, y)."""
    box = (x - width / 2, y - height / 2, x + width / 2, y + height / 2)
    return LabeledObject(category_of(name) or "unknown", box, None, name, printed_text(name))


def rows(*names: Iterable[str], step: float = 40) -> list[LabeledObject]:
    """Boxes in rows 50 px apart; '' is a gap."""
    return [
        thing(name, step * column, 50 * row)
        for row, line in enumerate(names)
        for column, name in enumerate(line)
        if name
    ]


def meanings(objects: list[LabeledObject]) -> list[tuple[str, str]]:
    return [(o.category, o.text) for o in objects]


def plates_in(objects: list[LabeledObject]) -> list[int]:
    return [k for k, o in enumerate(objects) if o.category == "plate"]


def test_plates_on_the_left_name_the_blank_buttons_beside_them() -> None:
    objects = rows(["12", "empty"], ["11", "empty"], ["open", "empty"])
    assert meanings(split_plates(objects)) == [
        ("plate", "12"),
        ("number", "12"),
        ("plate", "11"),
        ("number", "11"),
        ("plate", ""),
        ("open", ""),
    ]


def test_plates_on_the_right() -> None:
    found = split_plates(rows(["empty", "2"], ["empty", "1"], ["empty", "alarm"]))
    assert plates_in(found) == [1, 3, 5]
    assert [o.category for o in found[::2]] == ["number", "number", "alarm"]


def test_a_plate_may_stand_between_two_buttons_but_names_one() -> None:
    found = split_plates(rows(["2", "empty", "3", "empty"], ["B", "empty", "1", "empty"]))
    assert plates_in(found) == [0, 2, 4, 6]
    assert [o.text for o in found] == ["2", "2", "3", "3", "B", "B", "1", "1"]


def test_of_two_boxes_of_the_same_meaning_the_left_one_is_the_plate_unless_told() -> None:
    objects = rows(["s1", "1"], ["2", "2"], ["3", "3"])  # s1 is *1: the star is on the plate only
    assert plates_in(split_plates(objects)) == [0, 2, 4]
    assert plates_in(split_plates(objects, "right")) == [1, 3, 5]
    assert meanings(split_plates(objects, "none")) == meanings(objects)


def test_a_blank_button_among_buttons_that_repeat_their_plates_changes_nothing() -> None:
    objects = [*rows(["3", "3"], ["2", "2"]), thing("empty", 40, 100)]
    found = split_plates(objects)
    assert plates_in(found) == [0, 2]
    assert found[4].category == "unknown"


def test_buttons_with_words_or_unreadable_ones_go_with_the_panel() -> None:
    objects = rows(
        ["2", "empty"], ["1", "empty"], ["G", "blur"], ["open", "text_DOOR OPEN"], ["stop", "key"]
    )
    found = split_plates(objects)
    assert plates_in(found) == [0, 2, 4, 6, 8]
    assert meanings(found)[5] == ("number", "G")
    assert meanings(found)[7] == ("open", "DOOR OPEN")
    assert found[9].category == "keyhole"


def test_another_button_nearby_does_not_go_with_the_panel() -> None:
    objects = [*rows(["2", "empty"], ["1", "empty"]), thing("open", 0, 100), thing("blur", 90, 100)]
    found = split_plates(objects)
    assert plates_in(found) == [0, 2]
    assert found[5].category == "unknown"


@pytest.mark.parametrize(
    "objects",
    [
        rows(["1", "2", "3"], ["4", "5", "6"], ["7", "8", "9"], ["empty", "0", "empty"]),
        rows(["1", "2", "empty"], ["4", "5", "empty"]),
        rows(["empty", "18"], ["empty", "17"], ["11", "16"], ["9", "15"], ["7", "14"], ["5", "13"]),
        rows(["1", "empty"], ["2", ""]),
        rows(["1", "empty"], ["2", "empty"], step=80),
        rows(["open", "open"], ["1", "2"], ["3", "4"]),
        rows(["empty", "empty"], ["empty", "empty"]),
        [],
    ],
    ids=[
        "keypad",
        "rows of keys ending in blank ones",
        "column of blank keys beside one of numbers",
        "one pair only",
        "far apart",
        "one pair of the same meaning",
        "blank keys only",
        "nothing",
    ],
)
def test_panels_without_plates_stay_as_they_are(objects: list[LabeledObject]) -> None:
    assert meanings(split_plates(objects)) == meanings(objects)


def test_plates_above_their_buttons_only_if_told() -> None:
    objects = [thing(name, 50 * k, 0) for k, name in enumerate(["call", "2", "3"])]
    objects += [thing("empty", 50 * k, 40) for k in range(3)]
    assert plates_in(split_plates(objects)) == []
    found = split_plates(objects, "above")
    assert plates_in(found) == [0, 1, 2]
    assert meanings(found)[3:] == [("alarm", ""), ("number", "2"), ("number", "3")]


def test_given_plates_are_the_only_ones_and_name_their_buttons() -> None:
    objects = rows(["2", "empty"], ["1", "empty"], ["G", "empty"])
    found = split_plates(objects, plates=[0, 2])
    assert plates_in(found) == [0, 2]
    assert [o.text for o in found] == ["2", "2", "1", "1", "G", ""]
    assert found[5].category == "unknown"


def test_given_plates_of_slanting_rows_find_their_buttons() -> None:
    objects = [thing("2", 0, 0), thing("empty", 32, -18), thing("1", 0, 50), thing("empty", 32, 32)]
    assert plates_in(split_plates(objects)) == []
    assert [o.text for o in split_plates(objects, plates=[0, 2])] == ["2", "2", "1", "1"]


def test_given_plates_besides_those_on_a_side() -> None:
    objects = [*rows(["2", "empty"], ["1", "empty"]), thing("alarm", 200, 0), thing("blur", 0, 100)]
    found = split_plates(objects, "left", [4, 5])
    assert plates_in(found) == [0, 2, 4, 5]
    assert [o.text for o in found[:4]] == ["2", "2", "1", "1"]


def test_a_plate_whose_button_has_no_box_does_not_name_the_next_row() -> None:
    objects = [thing("unknown", 0, 0), thing("2", 0, 40), thing("1", 0, 80)]
    found = split_plates(objects, plates=[1, 2])
    assert plates_in(found) == [1, 2]
    assert found[0].category == "unknown"


names = st.sampled_from(["1", "2", "s1", "open", "empty", "blur", "key", "stop", "text_stop"])
boxes = st.lists(
    st.builds(
        thing, names, st.integers(0, 160), st.integers(0, 160), st.just(30), st.integers(20, 40)
    ),
    max_size=12,
)
sides = st.sampled_from([None, "left", "right", "above", "below", "none"])


@settings(derandomize=True, deadline=None)
@given(boxes, sides, st.data())
def test_boxes_keep_their_place_and_only_nameless_ones_get_a_meaning(
    objects: list[LabeledObject], side: Side | None, data: st.DataObject
) -> None:
    numbers = st.integers(0, len(objects) - 1) if objects else st.nothing()
    plates = data.draw(st.lists(numbers, unique=True, max_size=3)) if objects else []
    found = split_plates(objects, side, plates)
    assert [(o.box, o.name) for o in found] == [(o.box, o.name) for o in objects]
    assert set(plates) <= set(plates_in(found))
    for before, after in zip(objects, found, strict=True):
        assert after.category in (before.category, "plate") or before.category == "unknown"
    named = sum(
        a.category not in ("plate", b.category) for b, a in zip(objects, found, strict=True)
    )
    assert named <= len(plates_in(found))


def write_set(folder: Path, names: list[str], lines: list[str], stem: str = "7") -> None:
    (folder / "names.txt").write_text("\n".join(names) + "\n", encoding="utf-8")
    for sub in ("images", "labels"):
        (folder / "train" / sub).mkdir(parents=True, exist_ok=True)
    Image.new("RGB", (100, 50)).save(folder / "train/images" / f"{stem}.jpg")
    (folder / "train/labels" / f"{stem}.txt").write_text("\n".join(lines), encoding="utf-8")


def test_boxes_and_polygons_are_read_in_pixels_and_displays_left_out(tmp_path: Path) -> None:
    lines = ["0 0.5 0.5 0.2 0.4", "", "1 0.1 0.1 0.2 0.2", "2 0.1 0.2 0.3 0.2 0.3 0.6 0.1 0.6"]
    write_set(tmp_path, ["12", "led", "open"], lines)
    (image,) = read_panels(tmp_path, "train")
    assert (image.width, image.height) == (100, 50)
    assert [o.name for o in image.objects] == ["12", "open"]
    assert image.objects[0].box == pytest.approx((39.5, 14.5, 59.5, 34.5))
    assert image.objects[1].box == pytest.approx((9.5, 9.5, 29.5, 29.5))


def test_corrections_do_not_touch_another_set_with_the_same_photo_names(tmp_path: Path) -> None:
    write_set(tmp_path, ["12"], ["0 0.5 0.5 0.2 0.4"], stem="004")
    (image,) = read_panels(tmp_path, "train")
    assert image.objects[0].category == "number"


@pytest.mark.parametrize("line", ["1 0.5 0.5 0.1 0.1", "0 0.5 0.5 0.1", "0 a b c d", "x 0 0 1 1"])
def test_a_line_that_is_no_label_is_named(tmp_path: Path, line: str) -> None:
    write_set(tmp_path, ["12"], ["0 0.5 0.5 0.2 0.4", line])
    with pytest.raises(InputError, match=r"7\.txt, line 2"):
        read_panels(tmp_path, "train")


def test_a_label_file_that_lost_a_corrected_line_is_refused(tmp_path: Path) -> None:
    names = [str(k) for k in range(368)]
    write_set(tmp_path, names, ["0 0.5 0.5 0.2 0.4"], stem="004")
    with pytest.raises(InputError, match=r"004\.txt, line 2"):
        read_panels(tmp_path, "train")


def test_missing_files_are_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"names\.txt"):
        read_panels(tmp_path, "train")
    write_set(tmp_path, ["12"], [])
    with pytest.raises(InputError, match="valid"):
        read_panels(tmp_path, "valid")
    (tmp_path / "train/labels/7.txt").unlink()
    with pytest.raises(InputError, match=r"7\.txt"):
        read_panels(tmp_path, "train")


def test_incomplete_photos_are_those_of_the_split() -> None:
    train, valid = incomplete_photos("train"), incomplete_photos("valid")
    assert "004" in train
    assert "1065" in valid
    assert not train & valid
    assert incomplete_photos("test") == frozenset()


@pytest.fixture(scope="module")
def photos() -> dict[str, list[LabeledObject]]:
    return {
        f"{split}/{image.path.stem}": list(image.objects)
        for split in ("train", "valid")
        for image in read_panels(DATA, split)
    }


@needs_photos
@pytest.mark.parametrize(
    ("photo", "plates"),
    [
        ("valid/194", 3),  # three blank buttons, plates on the left
        ("valid/1832", 13),
        ("valid/1000", 0),  # keys for the same floors beside the buttons
        ("valid/1542", 0),  # a column of blank keys
        ("valid/1881", 6),  # above
        ("train/004", 7),  # only the plates have boxes
        ("train/351", 11),  # on the right
        ("train/916", 6),  # on the left, and on the right
        ("train/66", 0),
    ],
)
def test_plates_of_known_photos(
    photos: dict[str, list[LabeledObject]], photo: str, plates: int
) -> None:
    assert len(plates_in(photos[photo])) == plates


@needs_photos
def test_known_buttons_get_their_meaning(photos: dict[str, list[LabeledObject]]) -> None:
    assert Counter(meanings(photos["valid/194"])) == Counter(
        (category, text) for text in ("13", "10", "7") for category in ("plate", "number")
    )
    buttons = [o for o in photos["valid/1881"] if o.category != "plate"]
    assert Counter(o.category for o in buttons) == {"alarm": 2, "stop": 1, "open": 1, "number": 2}


@needs_photos
def test_position_indicators_are_no_buttons(photos: dict[str, list[LabeledObject]]) -> None:
    assert photos["train/540"] == []
    assert Counter(o.category for o in photos["train/1318"]) == {"up": 1, "down": 1}


@needs_photos
def test_every_corrected_photo_exists(photos: dict[str, list[LabeledObject]]) -> None:
    for split in ("train", "valid"):
        assert {f"{split}/{stem}" for stem in incomplete_photos(split)} <= set(photos)
