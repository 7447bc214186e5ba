"""What the names of labels ask the reader to say."""

from __future__ import annotations

import pytest

from fronto.labels.alphabet import ALPHABET
from fronto.labels.targets import ReadTarget, encoded, read_target, readable


@pytest.mark.parametrize(
    ("name", "kind", "text"),
    [
        ("12", "text", "12"),
        ("-1", "text", "-1"),
        ("12a", "text", "12A"),
        ("s1", "text", "*1"),
        ("s", "text", "*"),
        ("-", "text", "-"),
        ("text_Mez", "text", "MEZ"),
        ("text_HOLD", "text", "HOLD"),
        ("NS", "text", "NS"),
        ("text_30-90", "text", "30-90"),
        ("up", "up", ""),
        ("DN", "down", ""),
        ("text_OPEN DOOR", "open", ""),
        ("DO", "open", ""),
        ("D0", "open", ""),
        ("DC", "close", ""),
        ("call", "alarm", ""),
        ("text_help", "alarm", ""),
        ("text_stop", "stop", ""),
        ("bt_switch", "keyhole", ""),
        ("fan", "other", ""),
        ("CH", "other", ""),
        ("text_call cancel", "other", ""),
        ("empty", "blank", ""),
        ("blur", "unreadable", ""),
        ("unknown", "unreadable", ""),
        ("text_blur", "unreadable", ""),
    ],
)
def test_names(name: str, kind: str, text: str) -> None:
    target = read_target(name)
    assert target is not None
    assert (target.kind, target.text) == (kind, text)


@pytest.mark.parametrize(
    "name", ["led", "indicator", "speaker", "hat", "light", "text", "plate", "number", "button", ""]
)
def test_no_crops(name: str) -> None:
    assert read_target(name) is None


def test_what_a_mirror_leaves_as_it_is() -> None:
    names = ("up", "UP", "open", "text_open", "DO", "alarm", "AL", "empty", "7", "unknown")
    mirrored = {name for name in names if (target := read_target(name)) and target.mirrors}
    assert mirrored == {"up", "open", "alarm", "empty"}


def test_steps_for_repeated_characters() -> None:
    assert readable("A" * 12)  # with the blanks between them 23 steps
    assert not readable("A" * 13)
    assert readable("AB" * 12)
    assert not readable("AB" * 12 + "A")
    assert not readable("")


def test_classes_of_characters() -> None:
    assert encoded("01Z*") == [1, 2, 36, 37]
    assert max(encoded(ALPHABET)) == len(ALPHABET)


def test_a_text_belongs_to_the_kind() -> None:
    with pytest.raises(AssertionError):
        ReadTarget("text")
    with pytest.raises(AssertionError):
        ReadTarget("up", "UP")
