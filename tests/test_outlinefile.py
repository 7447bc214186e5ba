"""Outline files of three formats in, exact round trips, and wrong ones refused in one line."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fronto.errors import InputError
from fronto.outlinefile import read_outlines, write_outlines
from fronto.shapes import LineSegment, Outline

QUAD = [[10, 20], [40, 21], [41, 52], [9, 50]]
OTHER = [[110, 20], [140, 21], [141, 52], [109, 50]]
ELLIPSE = {"cx": 200.0, "cy": 100.5, "a": 20, "b": 15, "angle_deg": 30}


@pytest.fixture
def path(tmp_path: Path) -> Path:
    return tmp_path / "hall.json"


def write(path: Path, values: Any) -> Path:
    path.write_text(values if isinstance(values, str) else json.dumps(values), encoding="utf-8")
    return path


def fails(path: Path, values: Any, **options: Any) -> str:
    with pytest.raises(InputError) as caught:
        read_outlines(write(path, values), **options)
    message = str(caught.value)
    assert str(path) in message
    assert "\n" not in message
    assert "`" not in message
    return message


def test_own_format(path: Path) -> None:
    found = read_outlines(
        write(
            path,
            {
                "schema": "fronto.outlines/1",
                "image": "hall.jpg",
                "width_px": 640,
                "height_px": 480,
                "buttons": [
                    {"corners_px": QUAD, "category": "up", "std_px": 0.25, "odd": True},
                    {"ellipse_px": ELLIPSE, "text": "12", "confidence": 0.5, "truncated": True},
                ],
                "lines": [
                    {"axis": "horizontal", "ends_px": [[0, 1], [100, 2]], "std_px": 2},
                    {"axis": "vertical", "ends_px": [[0, 1], [3, 200]]},
                ],
            },
        )
    )
    quad, ellipse = found.outlines
    assert (quad.shape, quad.category, quad.std_px, quad.odd) == ("quad", "up", 0.25, True)
    assert quad.corners_px is not None
    assert quad.corners_px.tolist() == QUAD
    assert ellipse.ellipse_px is not None
    assert (ellipse.ellipse_px.cx, ellipse.ellipse_px.b) == (200.0, 15.0)
    assert (ellipse.text, ellipse.confidence, ellipse.std_px) == ("12", 0.5, 0.5)
    assert ellipse.truncated
    assert [(line.axis, line.std_px) for line in found.lines] == [
        ("horizontal", 2.0),
        ("vertical", 0.5),
    ]
    assert (found.image, found.width_px, found.height_px) == ("hall.jpg", 640, 480)


ANNOTATION = {
    "image": "hall.jpg",
    "width": 640,
    "height": 480,
    "buttons": [
        {"shape": "quad", "corners": QUAD, "category": "number", "text": "4"},
        {"shape": "quad", "corners": OTHER, "category": "number", "text": "5", "unsure": True},
        {"shape": "ellipse", "ellipse": ELLIPSE, "category": "open", "text": ""},
    ],
    "horizontal": [[0, 0, 100, 1]],
    "vertical": [[5, 0, 6, 100], [50, 0, 51, 100]],
    "panel_is_one_plane": True,
    "notes": "",
}


def test_annotation_format_without_its_unsure_buttons_and_ground_truth(path: Path) -> None:
    found = read_outlines(write(path, ANNOTATION))
    assert [outline.category for outline in found.outlines] == ["number", "open"]
    assert found.skipped == (1,)
    assert found.lines == ()
    assert (found.width_px, found.height_px) == (640, 480)


def test_annotation_format_with_them(path: Path) -> None:
    found = read_outlines(write(path, ANNOTATION), include_unsure=True, include_segments=True)
    assert [outline.text for outline in found.outlines] == ["4", "5", ""]
    assert found.skipped == ()
    assert [line.axis for line in found.lines] == ["horizontal", "vertical", "vertical"]
    assert found.lines[2].ends_px.tolist() == [[50, 0], [51, 100]]


def test_a_result_is_read_back(path: Path) -> None:
    button = {
        "id": 0,
        "category": "up",
        "confidence": 0.75,
        "shape": "quad",
        "corners_px": QUAD,
        "ellipse_px": None,
        "corner_std_px": 0.3,
        "label": "UP",
        "weight": 1.0,
        "position_m": None,
    }
    round_one = {**button, "id": 1, "shape": "ellipse", "corners_px": None, "ellipse_px": ELLIPSE}
    values = {
        "schema": "fronto.panel/1",
        "width_px": 640,
        "height_px": 480,
        "buttons": [button, {**round_one, "label": None}],
    }
    first, second = read_outlines(write(path, values)).outlines
    assert (first.text, first.std_px, first.confidence) == ("UP", 0.3, 0.75)
    assert (second.shape, second.text) == ("ellipse", "")
    # What only follows from the neighbours is no print that another run should start from.
    button["label_source"] = "inferred"
    assert read_outlines(write(path, values)).outlines[0].text == ""


def test_what_is_not_seen_and_the_shape_s_confidence(path: Path) -> None:
    quad = {"corners_px": QUAD, "seen": [True, False, True, True], "shape_confidence": 0.25}
    plain = {"corners_px": OTHER}
    round_one = {"ellipse_px": ELLIPSE, "seen": [True] * 4}
    found = read_outlines(write(path, {"buttons": [quad, plain, round_one]})).outlines
    assert [outline.seen for outline in found] == [(True, False, True, True), *[(True,) * 4] * 2]
    assert [outline.shape_confidence for outline in found] == [0.25, 1, 1]


def test_plates_are_read_as_buttons_are(path: Path) -> None:
    values = {
        "width_px": 640,
        "height_px": 480,
        "buttons": [{"corners_px": QUAD}],
        "plates": [
            {"corners_px": OTHER, "std_px": 0.25, "text": "12"},
            {"ellipse_px": ELLIPSE, "unsure": True},
            {"corners_px": QUAD, "category": "other"},  # one round a button is another thing
        ],
    }
    found = read_outlines(write(path, values))
    assert [plate.category for plate in found.plates] == ["plate", "other"]
    assert (found.plates[0].text, found.plates[0].std_px) == ("12", 0.25)
    assert found.skipped == ()
    assert len(read_outlines(path, include_unsure=True).plates) == 3
    larger = read_outlines(path, 1280, 960)
    corners = larger.plates[0].corners_px
    assert corners is not None
    assert corners[0].tolist() == [220.5, 40.5]
    assert larger.plates[0].std_px == 0.5


@pytest.mark.parametrize("plate", [{"corners_px": QUAD[:3]}, {"category": "plate"}, {"seen": []}])
def test_a_bad_plate_is_named(path: Path, plate: dict[str, Any]) -> None:
    assert "plates[1]" in fails(path, {"buttons": [], "plates": [{"corners_px": QUAD}, plate]})


def test_plates_that_cannot_be(path: Path) -> None:
    far = {"corners_px": [[x + 700, y] for x, y in QUAD]}
    unsure, plate = {**far, "unsure": True}, {"corners_px": QUAD}
    message = fails(path, {"buttons": [], "plates": [unsure, far]}, width_px=640, height_px=480)
    assert "plates[1]" in message
    assert "plates 1 and 2" in fails(path, {"buttons": [], "plates": [unsure, plate, plate]})


def test_no_buttons_is_no_error(path: Path) -> None:
    assert read_outlines(write(path, {"buttons": []})).outlines == ()


def test_byte_order_mark_and_other_keys_are_left_alone(path: Path) -> None:
    path.write_bytes(b"\xef\xbb\xbf" + b'{"buttons": [], "mine": {"a": [1]}}')
    assert read_outlines(path).outlines == ()


def test_outlines_are_scaled_to_the_resized_photo(path: Path) -> None:
    values = {
        "width_px": 640,
        "height_px": 480,
        "buttons": [{"corners_px": QUAD}, {"ellipse_px": ELLIPSE, "std_px": 1.0}],
        "lines": [{"axis": "vertical", "ends_px": [[0, 0], [0, 100]], "std_px": 1.0}],
    }
    found = read_outlines(write(path, values), 1280, 960)
    quad, ellipse = found.outlines
    # Pixel centres are at integers: x' = 2 (x + 0.5) - 0.5.
    assert quad.corners_px is not None
    assert quad.corners_px[0].tolist() == [20.5, 40.5]
    assert ellipse.ellipse_px is not None
    assert ellipse.ellipse_px.cx == pytest.approx(400.5)
    assert ellipse.ellipse_px.a == pytest.approx(40)
    assert ellipse.ellipse_px.b == pytest.approx(30)
    assert ellipse.ellipse_px.angle_deg == pytest.approx(30)
    assert (ellipse.std_px, found.lines[0].std_px) == (2.0, 2.0)
    assert found.lines[0].ends_px.tolist() == [[0.5, 0.5], [0.5, 200.5]]
    assert (found.width_px, found.height_px) == (1280, 960)


@pytest.mark.parametrize("size", [(480, 640), (640, 360), (1000, 480)])
def test_another_aspect_is_refused(path: Path, size: tuple[int, int]) -> None:
    values = {"width_px": 640, "height_px": 480, "buttons": [{"corners_px": QUAD}]}
    message = fails(path, values, width_px=size[0], height_px=size[1])
    assert "width_px" in message
    assert "640x480" in message
    assert f"{size[0]}x{size[1]}" in message


def test_a_button_outside_the_photo_is_refused(path: Path) -> None:
    values = {"buttons": [{"corners_px": QUAD}, {"corners_px": OTHER}]}
    assert len(read_outlines(write(path, values), 120, 100).outlines) == 2  # partly outside
    assert "buttons[1]" in fails(path, values, width_px=100, height_px=100)


def test_one_size_alone_is_refused(path: Path) -> None:
    assert "height_px" in fails(path, {"width_px": 640, "buttons": []})
    with pytest.raises(InputError):
        read_outlines(write(path, {"buttons": []}), 640)


MIRRORED = [[40, 20], [10, 21], [9, 52], [41, 50]]
BAD_BUTTONS: dict[str, tuple[dict[str, Any], str]] = {
    "mirrored": ({"corners_px": MIRRORED}, "corners_px"),
    "crossing": ({"corners_px": [QUAD[0], QUAD[2], QUAD[1], QUAD[3]]}, "corners_px"),
    "repeated": ({"corners_px": [QUAD[0], QUAD[0], QUAD[2], QUAD[3]]}, "corners_px"),
    "turned inwards": ({"corners_px": [*QUAD[:3], [38, 23]]}, "corners_px"),
    "three corners": ({"corners_px": QUAD[:3]}, "corners_px"),
    "three coordinates": ({"corners_px": [[1, 2, 3], *QUAD[1:]]}, "corners_px[0]"),
    "text": ({"corners_px": [[1, "2"], *QUAD[1:]]}, "corners_px[0][1]"),
    "null": ({"corners_px": [[None, 2], *QUAD[1:]]}, "corners_px[0][0]"),
    "far away": ({"corners_px": [[-1e200, 2], *QUAD[1:]]}, "corners_px[0][0]"),
    "annotation's mirrored": ({"corners": MIRRORED}, "corners"),
    "axes swapped": ({"ellipse_px": {"cx": 1, "cy": 1, "a": 2, "b": 3}}, "ellipse_px"),
    "no axis": ({"ellipse_px": {"cx": 1, "cy": 1, "a": 2, "b": 0}}, "ellipse_px.b"),
    "vanishing axis": ({"ellipse_px": {"cx": 1, "cy": 1, "a": 2, "b": 1e-300}}, "ellipse_px.b"),
    "vanishing deviation": ({"corners_px": QUAD, "std_px": 1e-300}, "std_px"),
    "no centre": ({"ellipse_px": {"cx": 1, "a": 2, "b": 1}}, "cy"),
    "neither": ({"category": "up"}, "corners_px"),
    "both": ({"corners_px": QUAD, "ellipse_px": ELLIPSE}, "corners_px and ellipse_px"),
    "contradiction": ({"shape": "ellipse", "corners_px": QUAD}, "shape"),
    "other shape": ({"shape": "star", "corners_px": QUAD}, "shape"),
    "deviation": ({"corners_px": QUAD, "std_px": 0}, "std_px"),
    "confidence": ({"corners_px": QUAD, "confidence": 1.5}, "confidence"),
    "flag": ({"corners_px": QUAD, "unsure": "yes"}, "unsure"),
    "shape's confidence": ({"corners_px": QUAD, "shape_confidence": -0.1}, "shape_confidence"),
    "three sides": ({"corners_px": QUAD, "seen": [True] * 3}, "seen"),
    "sides by number": ({"corners_px": QUAD, "seen": [1, 1, 1, 0]}, "seen[0]"),
    "a round one's sides": ({"ellipse_px": ELLIPSE, "seen": [True, False] * 2}, "seen"),
}


@pytest.mark.parametrize("name", list(BAD_BUTTONS))
def test_a_bad_button_is_named(path: Path, name: str) -> None:
    button, field = BAD_BUTTONS[name]
    message = fails(path, {"buttons": [{"corners_px": OTHER}, button]})
    assert "buttons[1]" in message
    assert field in message


def test_contradicting_buttons_are_named_by_their_numbers_in_the_file(path: Path) -> None:
    unsure = {"corners_px": [[x + 300, y] for x, y in QUAD], "unsure": True}
    first, second = {"corners_px": QUAD}, {"corners_px": OTHER}
    message = fails(path, {"buttons": [unsure, first, second, first]})
    assert "buttons 1 and 3" in message
    turned = {"corners_px": [*OTHER[1:], OTHER[0]]}
    third = {"corners_px": [[x, y + 200] for x, y in QUAD]}
    assert "buttons 3" in fails(path, {"buttons": [unsure, first, third, turned]})


@pytest.mark.parametrize(
    ("line", "field"),
    [
        ({"axis": "diagonal", "ends_px": [[0, 0], [9, 9]]}, "lines[0].axis"),
        ({"axis": "vertical", "ends_px": [[0, 0]]}, "lines[0].ends_px"),
        ({"axis": "vertical", "ends_px": [[5, 5], [5, 5.5]]}, "lines[0].ends_px"),
        ({"axis": "vertical", "ends_px": [[0, 0], [9, 9]], "std_px": -1}, "lines[0].std_px"),
    ],
)
def test_a_bad_line_is_named(path: Path, line: dict[str, Any], field: str) -> None:
    assert field in fails(path, {"buttons": [], "lines": [line]})


def test_a_bad_segment_is_named(path: Path) -> None:
    values = {"buttons": [], "horizontal": [[0, 0, 50, 0], [3, 3, 3, 3]]}
    assert read_outlines(write(path, values)).lines == ()
    assert "horizontal[1]" in fails(path, values, include_segments=True)


@pytest.mark.parametrize(
    ("text", "where"),
    [
        ('{"buttons": [\n  {"corners_px": NaN}]}', "line 2, column 18"),
        ('{"buttons": [\n\n  {"corners_px" 1}]}', "line 3"),
        ('{"ä": "ä", "buttons": oops}', "line 1, column 23"),
        ('{"buttons": [', "line 1, column 14"),
        ('{"buttons": []} {}', "line 1"),
        ("buttons: []", "line 1, column 1"),
        ('{"other": ' + "[" * 100_000, "nested"),
    ],
)
def test_malformed_json_is_located(path: Path, text: str, where: str) -> None:
    assert where in fails(path, text)


@pytest.mark.parametrize(
    ("values", "field"),
    [
        ([], "object"),
        ({}, "buttons"),
        ({"buttons": {}}, "buttons"),
        ({"buttons": [1]}, "buttons[0]"),
        ({"buttons": [], "schema": "fronto.panel/2"}, "schema"),
        ({"buttons": [], "width_px": -3, "height_px": 5}, "width_px"),
        ({"buttons": [{"corners_px": QUAD}] * 10_001}, "buttons"),
    ],
)
def test_other_json_is_refused(path: Path, values: Any, field: str) -> None:
    assert field in fails(path, values)


def test_numbers_beyond_floats_are_refused(path: Path) -> None:
    fails(path, '{"buttons": [{"corners_px": [[1e999,2],[3,4],[5,6],[7,8]]}]}')


def test_missing_empty_binary_and_folder_are_refused(tmp_path: Path, path: Path) -> None:
    for bad in (tmp_path / "none.json", tmp_path):
        with pytest.raises(InputError, match="outlines file") as caught:
            read_outlines(bad)
        assert str(bad) in str(caught.value)
    assert "empty" in fails(path, "  \n")
    path.write_bytes(b'{"buttons": [], "image": "\xff"}')
    with pytest.raises(InputError, match="UTF-8"):
        read_outlines(path)


def test_a_huge_file_is_refused_before_it_is_decoded(path: Path) -> None:
    with path.open("wb") as file:
        file.truncate(51_000_000)
    with pytest.raises(InputError, match="50 MB"):
        read_outlines(path)


@settings(derandomize=True, deadline=None, max_examples=50)
@given(
    x=st.floats(-1000, 1000),
    y=st.floats(-1000, 1000),
    std=st.floats(0.01, 10),
    confidence=st.floats(0, 1),
    text=st.text(st.characters(codec="utf-8"), max_size=5),
    angle=st.floats(-360, 360),
    line_found=st.booleans(),
)
def test_what_is_written_is_read_back_exactly(
    tmp_path_factory: pytest.TempPathFactory,
    x: float,
    y: float,
    std: float,
    confidence: float,
    text: str,
    angle: float,
    line_found: bool,
) -> None:
    path = tmp_path_factory.mktemp("round") / "a.json"
    corners = np.add(QUAD, [x, y])
    outlines = [
        Outline.quad(corners, std_px=std, confidence=confidence, text=text, odd=True),
        Outline.ellipse(x + 500, y, 9.5, 7.25, angle, category="up", truncated=True),
    ]
    lines = [LineSegment("vertical", np.array([[x, y], [x, y + 50]]), std, line_found)]
    write_outlines(path, outlines, lines=lines, image=text, width_px=3, height_px=4)
    # The size is the photo's; these outlines may lie anywhere.
    values = json.loads(path.read_text(encoding="utf-8"))
    assert (values.pop("width_px"), values.pop("height_px")) == (3, 4)
    found = read_outlines(write(path, values))
    quad, ellipse = found.outlines
    assert quad.corners_px is not None
    assert np.array_equal(quad.corners_px, corners)
    assert (quad.std_px, quad.confidence, quad.text, quad.odd) == (std, confidence, text, True)
    assert ellipse.ellipse_px == outlines[1].ellipse_px
    assert (ellipse.category, ellipse.truncated, ellipse.odd) == ("up", True, False)
    assert np.array_equal(found.lines[0].ends_px, lines[0].ends_px)
    assert (found.lines[0].axis, found.lines[0].std_px, found.image) == ("vertical", std, text)
    assert found.lines[0].found == line_found


@settings(derandomize=True, deadline=None, max_examples=50)
@given(
    seen=st.tuples(*[st.booleans()] * 4),
    confidences=st.lists(st.floats(0, 1), min_size=3, max_size=3),
    plates=st.integers(0, 2),
)
def test_what_is_seen_and_plates_are_read_back_exactly(
    tmp_path_factory: pytest.TempPathFactory,
    seen: tuple[bool, bool, bool, bool],
    confidences: list[float],
    plates: int,
) -> None:
    path = tmp_path_factory.mktemp("round") / "a.json"
    first, second, third = confidences
    buttons = [
        Outline.quad(
            QUAD,
            seen=seen,
            truncated=not all(seen),
            shape_confidence=first,
            form_std_px=0.2 if plates else None,
        ),
        Outline.ellipse(200, 100, 20, 15, shape_confidence=second),
    ]
    labels = [
        Outline.quad(OTHER, category="plate", seen=seen, shape_confidence=third),
        Outline.ellipse(300, 100, 20, 15, category="plate", text="5"),
    ][:plates]
    write_outlines(path, buttons, plates=labels)
    found = read_outlines(path)
    assert len(found.plates) == plates
    for wrote, read in zip([*buttons, *labels], [*found.outlines, *found.plates], strict=True):
        assert vars(read) | {"corners_px": None} == vars(wrote) | {"corners_px": None}
        assert np.array_equal(read.box_px, wrote.box_px)
    # Files of those who state none of this stay as they were.
    values = json.loads(path.read_bytes())
    quad, ellipse = values["buttons"]
    assert ("seen" in quad, "seen" in ellipse) == (not all(seen), False)
    assert ("shape_confidence" in quad) == (first != 1)
    assert ("plates" in values) == (plates > 0)
    assert ("form_std_px" in quad) == (plates > 0)


def test_writing_to_a_missing_folder_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="missing"):
        write_outlines(tmp_path / "missing" / "a.json", [])
    with pytest.raises(InputError):
        write_outlines(tmp_path / "a.json", [], width_px=5)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("literal", ["NaN", "Infinity", "-Infinity"])
def test_nan_is_said_to_be_no_number_and_where(tmp_path: Path, literal: str) -> None:
    path = tmp_path / "nan.json"
    path.write_text('{"buttons": [\n {"corners_px": [[1, ' + literal + "]]}]}")
    with pytest.raises(InputError) as refused:
        read_outlines(path)
    column = 21 + literal.startswith("-")  # ` {"corners_px": [[1, ` has 21 characters
    assert f"line 2, column {column + 1}" in refused.value.thing
    assert literal.lstrip("-") in refused.value.expected
    assert "no number" in refused.value.expected
    assert refused.value.remedy
