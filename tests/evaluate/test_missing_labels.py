"""The list of buttons that labels miss."""

from __future__ import annotations

from pathlib import Path

import pytest
from evaluation_cases import label
from hypothesis import given, settings
from hypothesis import strategies as st

from fronto.categories import BUTTONS
from fronto.datasets.records import LabeledObject
from fronto.errors import InputError
from fronto.evaluate import panels_missing, read_missing, write_missing


def plain(missing: dict[str, tuple[LabeledObject, ...]]) -> dict[str, list[tuple]]:
    return {photo: [(o.box, o.category) for o in items] for photo, items in missing.items()}


def test_a_list_is_read(tmp_path: Path) -> None:
    file = tmp_path / "missing.yaml"
    file.write_text(
        "# looked at\n"
        "valid/1000:\n- [10.5, 20, 40.5, 50.25, number]\n- [1, 2, 3, 4, open]\n"
        "valid/7: [[0, 0, 5, 5, unknown]]\nvalid/8: []\n",
        encoding="utf-8",
    )
    assert plain(read_missing(file)) == {
        "valid/1000": [((10.5, 20, 40.5, 50.25), "number"), ((1, 2, 3, 4), "open")],
        "valid/7": [((0, 0, 5, 5), "unknown")],
        "valid/8": [],
    }


def test_the_list_of_the_panels_comes_with_the_package() -> None:
    for photo, items in panels_missing().items():
        assert photo.startswith("valid/")
        assert items
        assert all(min(item.box) >= -0.5 and max(item.box) <= 415.5 for item in items)


names = st.text(st.characters(codec="utf-8", exclude_categories=["Cs", "Cc"]), min_size=1)
quarters = st.integers(-40, 4000).map(lambda value: value / 4)


@settings(derandomize=True, deadline=None, max_examples=60)
@given(
    st.dictionaries(
        names | st.sampled_from(["null", "1", "- a", "a: b", "#c", "~", "valid/12", "é" * 200]),
        st.lists(st.tuples(quarters, quarters, st.sampled_from(BUTTONS)), min_size=1, max_size=3),
        max_size=3,
    )
)
def test_what_is_written_is_read_again(
    tmp_path_factory: pytest.TempPathFactory, places: dict[str, list[tuple[float, float, str]]]
) -> None:
    missing = {
        photo: tuple(LabeledObject(c, (x, y, x + 7.25, y + 3), None, "") for x, y, c in items)
        for photo, items in places.items()
    }
    file = tmp_path_factory.mktemp("list") / "missing.yaml"
    write_missing(file, missing)
    assert plain(read_missing(file)) == plain(missing)


def test_photos_without_a_missing_label_are_not_written(tmp_path: Path) -> None:
    file = tmp_path / "missing.yaml"
    write_missing(file, {"valid/2": [], "valid/10": [label(10, 10)], "valid/1": [label(3, 3)]})
    assert list(read_missing(file)) == ["valid/1", "valid/10"]


@pytest.mark.parametrize(
    ("text", "place"),
    [
        ("a/1:\n- [1, 2, 3, 4, lamp]\n", "a/1[0]"),
        ("a/1:\n- [1, 2, 3, 4, up]\n- [5, 2, 3, 4, up]\n", "a/1[1]"),
        ("a/1:\n- [1, 2, 3, .nan, up]\n", "a/1"),
        ("a/1:\n- [1, 2, 3, nan, up]\n", "a/1"),
        ("a/1:\n- [1, 2, 3, 4, plate]\n", "a/1[0]"),
        ("a/1:\n- [1, 2, 3, up]\n", "a/1"),
        ("a/1:\n- {x: 1}\n", "a/1"),
        ("a/1:\n- [1, 2, 3, 4, up]\nb: []\na/1:\n- [9, 9, 19, 19, up]\n", "line 4"),
        ("- [1, 2, 3, 4, up]\n", "missing.yaml"),
        ("a/1: [\n", "missing.yaml"),
        ("[" * 1000, "missing.yaml"),
        ("? [a, b]\n: []\n", "line 1"),
        ("a: &x []\nb: *y\n", "missing.yaml"),
        ("# nothing\n", "missing.yaml"),
        ("", "missing.yaml"),
    ],
)
def test_a_wrong_list_is_refused_naming_the_place(tmp_path: Path, text: str, place: str) -> None:
    file = tmp_path / "missing.yaml"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(InputError) as caught:
        read_missing(file)
    assert place in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_that_is_no_text_or_not_there_is_refused(tmp_path: Path) -> None:
    file = tmp_path / "missing.yaml"
    file.write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(InputError):
        read_missing(file)
    with pytest.raises(InputError):
        read_missing(tmp_path / "none.yaml")
