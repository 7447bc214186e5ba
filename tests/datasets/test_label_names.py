"""Label names to categories: every name of the photos' list was looked at, the odd ones here."""

from __future__ import annotations

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fronto.categories import CATEGORIES
from fronto.datasets.names import category_of, check_names, printed_text
from fronto.datasets.records import LABELS
from fronto.errors import InputError

MEANING = {
    "number": "0 -1 -1M 12 12A 13A 1R 340m 3N 5P A AA B1 BC CP D0 EX G LG1 LGA M MZ P P25 P1A PH"
    " PH1 S SPA REF UG UT V s s1 sE sG sGR sPS *1 * - *G text_1-5 text_30-90 text_345m text_LL1R"
    " text_GROUND text_lobby text_plaza text_street text_bridge text_MEZZ text_Mez Lobby button_12",
    "up": "up UP Up button_up",
    "down": "down DN text_DOWN",
    "open": "open text_OPEN text_oepn text_door_open text_OPEN_DOOR text_open_hold DO DOR",
    "close": "close text_CLOSE text_close_door text_DOOR_CLOSE DC",
    "alarm": "alarm call AL phone bell text_alarm_bell text_CALL text_call_bell text_emege_call"
    " text_emerg text_emergency text_help text_intercom",
    "stop": "stop text_STOP emergency_stop",
    "keyhole": "keyhole key bt_keyhole switch bt_switch",
    "other": "other fan fire updown CH DH DHB NS text_FAN text_hold text_nostop text_light text_fan"
    " text_CALL_CANCEL text_call_lift text_doordelay text_start text_overload text_attendant",
    "plate": "plate Plate",
    "unknown": "unknown empty blur text_blur button Elevator_button push-button",
}


@pytest.mark.parametrize(("category", "names"), MEANING.items())
def test_meaning(category: str, names: str) -> None:
    for name in names.split():
        spelled = name if name.startswith(("text_", "bt_")) else name.replace("_", " ")
        assert category_of(name) == category, name
        assert category_of(spelled.replace("_", " ")) == category, spelled


@pytest.mark.parametrize(
    "name",
    ["led", "indicator", "speaker", "light", "hat", "text", "LED", "background", "display",
     "person", "cat", "door", "1234", "lampshade"],
)  # fmt: skip
def test_no_button(name: str) -> None:
    assert category_of(name) is None


@pytest.mark.parametrize("name", CATEGORIES[1:])
def test_categories_are_themselves(name: str) -> None:
    assert category_of(name) == category_of(name.upper()) == category_of(f" {name} ") == name


def test_all_names_of_the_photos() -> None:
    path = Path(__file__).parents[3] / "shared/data/panels/names.txt"
    if not path.is_file():
        pytest.skip("the labelled photos are not here")
    names = path.read_text(encoding="utf-8").splitlines()
    nothing = {name for name in names if category_of(name) is None}
    assert nothing == {"led", "indicator", "speaker", "light", "hat", "text"}
    by_category = {c: sum(category_of(name) == c for name in names) for c in LABELS}
    assert by_category == {
        "up": 2, "down": 3, "keyhole": 5, "number": 271, "open": 11, "close": 8, "alarm": 16,
        "stop": 3, "other": 39, "plate": 0, "unknown": 4,
    }  # fmt: skip


@settings(derandomize=True, deadline=None)
@given(st.text(max_size=20))
def test_any_name(name: str) -> None:
    assert category_of(name) in (*LABELS, None)
    assert isinstance(printed_text(name), str)


@pytest.mark.parametrize(
    ("name", "text"),
    [("12", "12"), ("B1", "B1"), ("s1", "*1"), ("sGR", "*GR"), ("s", "*"), ("S1", "S1"),
     ("text_OPEN", "OPEN"), ("text_lobby", "lobby"), ("text_blur", ""), ("up", ""), ("number", ""),
     ("led", ""), ("empty", ""), ("-", "-")],
)  # fmt: skip
def test_printed_text(name: str, text: str) -> None:
    assert printed_text(name) == text


def test_a_set_of_other_things_is_refused() -> None:
    with pytest.raises(InputError, match=r"here\.json.*'bicycle'"):
        check_names(["person", "bicycle"], "here.json")
    check_names(["person", "button"], "here.json")
    check_names(["led"], "here.json")
    check_names([], "here.json")
