"""Which button has a label: found, not there, or not sure."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import msgspec
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import fronto
from fronto.find import Found, NotSure, NotThere, find_label, finding_to_dict
from fronto.results import Panel, Plate
from fronto.shapes import Outline

PHOTO = np.zeros((480, 640, 3), np.uint8)
SQUARE = np.array([(0.0, 0), (30, 0), (30, 30), (0, 30)])


def panel_of(*buttons: dict[str, Any], plates: tuple[Plate, ...] = ()) -> Panel:
    """A column of buttons with these fields."""
    outlines = [Outline.quad(np.add(SQUARE, [300, 20 + 50 * k])) for k in range(len(buttons))]
    panel = fronto.rectify_outlines(PHOTO, outlines, image_name="hall.jpg")
    named = tuple(replace(b, **more) for b, more in zip(panel.buttons, buttons, strict=True))
    return replace(panel, buttons=named, plates=plates)


def read(label: str, p: float = 0.99, source: str = "button", **others: float) -> dict[str, Any]:
    """A button that was named so."""
    guesses = ((label, p), *others.items())
    return {
        "label": label,
        "label_confidence": p,
        "label_source": source,
        "label_guesses": guesses,
    }


def declined(**guesses: float) -> dict[str, Any]:
    confidence = max(guesses.values(), default=0.0)
    return {"label_confidence": confidence, "label_guesses": tuple(guesses.items())}


@pytest.mark.parametrize(
    ("wanted", "button"),
    [
        ("12", 0),
        ("b1", 1),
        (" B1 ", 1),
        ("1", 2),
        ("*1", 2),
        ("open", 3),
        ("OPEN", 3),
        ("door open", 3),
        ("bell", 4),
        ("Fan", 5),
    ],
)
def test_labels_are_compared_in_normal_form(wanted: str, button: int) -> None:
    panel = panel_of(*map(read, ["12", "B1", "*1", "open", "alarm", "FAN"]))
    found = find_label(panel, wanted)
    assert isinstance(found, Found)
    assert (found.button.id, found.confidence) == (button, 0.99)
    assert found.status == "found"


def test_the_star_of_the_way_out_does_not_make_another_floor() -> None:
    found = find_label(panel_of(read("1"), read("2")), "*1")
    assert isinstance(found, Found)
    assert isinstance(find_label(panel_of(read("1"), read("*1")), "1"), NotSure)


def test_not_there_only_if_all_others_are_known() -> None:
    known = [read("2"), read("open"), read("G")]
    missing = find_label(panel_of(*known), "12")
    assert isinstance(missing, NotThere)
    assert missing.reasons
    # "" is a symbol that is no label.
    symbol = declined(**{"": 0.95})
    assert isinstance(find_label(panel_of(*known, symbol), "12"), NotThere)
    for other in (
        declined(),
        declined(**{"8": 0.6}),
        declined(**{"12": 0.6, "13": 0.3}),
        read("12", 0.97, "inferred"),
        read("7", 0.85, "inferred"),
        read("7", 0.81, **{"12": 0.15}),
    ):
        finding = find_label(panel_of(*known, other), "12")
        assert isinstance(finding, NotSure)
        assert "3" in " ".join(finding.reasons)
    # What it may say is enough to know that it is none of these.
    other = declined(**{"8": 0.5, "3": 0.48})
    assert isinstance(find_label(panel_of(*known, other), "12"), NotThere)


@pytest.mark.parametrize(
    "buttons",
    [
        [read("12"), read("12")],
        [read("12", 0.85)],
        [read("12", 0.99, "inferred")],
        [read("12"), declined(**{"12": 0.3})],
    ],
)
def test_what_is_not_sure_is_not_found(buttons: list[dict[str, Any]]) -> None:
    finding = find_label(panel_of(read("2"), *buttons), "12")
    assert isinstance(finding, NotSure)
    assert finding.reasons
    assert finding.candidates[0][0].id == 1
    assert [button.id for button, _ in finding.candidates] == list(range(1, 1 + len(buttons)))


def test_inferred_labels_only_for_who_asks() -> None:
    panel = panel_of(read("11"), read("12", 0.97, "inferred"), read("13"))
    assert isinstance(find_label(panel, "12"), NotSure)
    found = find_label(panel, "12", inferred=True)
    assert isinstance(found, Found)
    assert found.button.label_source == "inferred"


def test_labels_that_came_with_the_outlines_are_known() -> None:
    panel = panel_of({"label": "12"}, {"label": "open"})
    found = find_label(panel, "12")
    assert isinstance(found, Found)
    assert found.confidence == 1
    assert isinstance(find_label(panel, "13"), NotThere)


def test_what_was_not_read_may_be_anything() -> None:
    finding = find_label(panel_of({}, {}), "12")
    assert isinstance(finding, NotSure)
    assert finding.candidates == ()
    assert isinstance(find_label(panel_of(), "12"), NotSure)


def test_a_floor_between_two_that_are_there_may_be_hidden() -> None:
    one_by_one = panel_of(*map(read, ["14", "13", "11", "10"]))
    finding = find_label(one_by_one, "12")
    assert isinstance(finding, NotSure)
    assert "11" in finding.reasons[0]
    assert isinstance(find_label(one_by_one, "16"), NotThere)
    odd = panel_of(*map(read, ["15", "13", "11", "9"]))
    assert isinstance(find_label(odd, "12"), NotThere)


def test_a_plate_without_its_button() -> None:
    outline = Outline.quad(np.add(SQUARE, [100, 100]))
    loose, paired = Plate(outline, "12", 0.9), Plate(outline, "12", 0.9, button=0)
    assert isinstance(find_label(panel_of(read("2"), plates=(loose,)), "12"), NotSure)
    assert isinstance(find_label(panel_of(read("2"), plates=(paired,)), "12"), NotThere)


@pytest.mark.parametrize("label", ["", "  ", "?!", "..."])
def test_a_label_of_nothing_is_refused(label: str) -> None:
    with pytest.raises(fronto.InputError, match="label"):
        find_label(panel_of(read("2")), label)


def test_findings_as_json() -> None:
    position, normal = np.array([0.1, -0.2, 0.5]), np.array([0.0, 0.6, 0.8])
    twelve = read("12", 0.97, "plate") | {"position_m": position, "press_normal": normal}
    panel = panel_of(read("2"), twelve, declined(**{"3": 0.4}))
    content = msgspec.json.encode(finding_to_dict(panel, find_label(panel, "12")))
    values = msgspec.json.decode(content)
    assert values["schema"] == "fronto.find/1"
    assert (values["photo"], values["label"], values["status"]) == ("hall.jpg", "12", "found")
    assert (values["button"], values["confidence"]) == (1, 0.97)
    assert values["label_source"] == "plate"
    assert values["corners_px"] == panel.to_dict()["buttons"][1]["corners_px"]
    assert values["center_px"] == [315, 85]
    assert values["position_m"] == [0.1, -0.2, 0.5]
    assert values["press_normal"] == [0, 0.6, 0.8]
    assert values["panel_status"] == panel.status
    unsure = finding_to_dict(panel, find_label(panel, "3"))
    assert unsure["status"] == "not_sure"
    assert unsure["button"] is unsure["center_px"] is unsure["position_m"] is None
    assert unsure["candidates"] == [{"button": 2, "confidence": 0.4}]
    assert unsure["reasons"]
    assert unsure.keys() == values.keys()


labels = st.sampled_from(["1", "2", "3", "*1", "open"])
buttons = st.one_of(
    st.builds(read, labels, st.floats(0.8, 1), st.sampled_from(["button", "plate", "inferred"])),
    st.builds(lambda label, p: declined(**{label: p}), labels, st.floats(0, 0.79)),
)


@settings(derandomize=True, deadline=None, max_examples=80)
@given(st.lists(buttons, max_size=5), labels)
def test_a_found_button_is_the_only_one_that_may_be_it(
    given: list[dict[str, Any]], wanted: str
) -> None:
    finding = find_label(panel_of(*given), wanted)
    if isinstance(finding, Found):
        assert finding.confidence >= 0.9
        guesses = [dict(button["label_guesses"]) for button in given]
        claims = [{g.lstrip("*") for g, p in guess.items() if p > 0.1} for guess in guesses]
        assert sum(wanted.lstrip("*") in claim for claim in claims) == 1
        assert finding.button.label_source != "inferred"
    elif isinstance(finding, NotThere):
        assert not any(b.get("label", "").lstrip("*") == wanted.lstrip("*") for b in given)
