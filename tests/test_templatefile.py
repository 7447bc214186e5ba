"""Template files: YAML and JSON, lists and grids, and wrong ones refused in one line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from fronto.errors import InputError
from fronto.pose import TemplateButton
from fronto.templatefile import read_template

LIST = """
schema: fronto.template/1
name: a hall panel
buttons:
  - {label: up, x_mm: 0, y_mm: 0, width_mm: 40, height_mm: 41.5}
  - {label: down, x_mm: 0, y_mm: 60}
"""
GRID = """
rows: [[01, no], [3, ""], [+5, B1]]
pitch_mm: [50, 62.5]
size_mm: [30, 40]
"""


def read(tmp_path: Path, text: str, name: str = "panel.yaml") -> tuple[TemplateButton, ...]:
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    return read_template(path).buttons


def fails(tmp_path: Path, text: str, name: str = "panel.yaml") -> str:
    with pytest.raises(InputError) as caught:
        read(tmp_path, text, name)
    message = str(caught.value)
    assert f"template file {tmp_path / name}" in message
    assert "\n" not in message
    return message


def test_list_of_buttons(tmp_path: Path) -> None:
    assert read(tmp_path, LIST) == (
        TemplateButton(0.0, 0.0, 40.0, 41.5, "up"),
        TemplateButton(0.0, 60.0, None, None, "down"),
    )


def test_grid_with_a_gap_and_labels_as_they_are_written(tmp_path: Path) -> None:
    assert read(tmp_path, GRID) == (
        TemplateButton(0.0, 0.0, 30.0, 40.0, "01"),
        TemplateButton(50.0, 0.0, 30.0, 40.0, "no"),
        TemplateButton(0.0, 62.5, 30.0, 40.0, "3"),
        TemplateButton(0.0, 125.0, 30.0, 40.0, "+5"),
        TemplateButton(50.0, 125.0, 30.0, 40.0, "B1"),
    )


@pytest.mark.parametrize("name", ["panel.json", "panel.yaml"])
def test_json(tmp_path: Path, name: str) -> None:
    values = {"rows": [[1, None], ["2", "3"]], "pitch_mm": [10, 20]}
    assert read(tmp_path, json.dumps(values), name) == (
        TemplateButton(0.0, 0.0, label="1"),
        TemplateButton(0.0, 20.0, label="2"),
        TemplateButton(10.0, 20.0, label="3"),
    )


@pytest.mark.parametrize(
    ("text", "field"),
    [
        ("buttons: [{x_mm: 0, y_mm: 0}, {x_mm: 1}]", "buttons[1]"),
        ("buttons: [{x_mm: 0, y_mm: 0}, {x_mm: wide, y_mm: 1}]", "buttons[1].x_mm"),
        ("buttons: [{x_mm: 0, y_mm: 0}, {x_mm: nan, y_mm: 1}]", "buttons[1]"),
        ("buttons: [{x_mm: 0, y_mm: 0, width_mm: -4}, {x_mm: 9, y_mm: 1}]", "buttons[0]"),
        ("buttons: [{x_mm: 0, y_mm: 0}]", "two buttons"),
        ("buttons: []", "two buttons"),
        ("buttons: 5", "buttons"),
        ("rows: [[1, 2]]", "pitch_mm"),
        ("rows: [[1, 2]]\npitch_mm: [0, 5]", "pitch_mm[0]"),
        ("rows: [[1, 2]]\npitch_mm: [5]", "pitch_mm"),
        ("rows: [[1, 2]]\npitch_mm: [5, 5]\nsize_mm: [5, nan]", "size_mm[1]"),
        ("rows: [[1, 2]]\npitch_mm: [5, 5]\nbuttons: []", "rows"),
        ("rows: [1, 2]\npitch_mm: [5, 5]", "rows[0]"),
        ("name: nothing", "buttons"),
        ("schema: fronto.template/9\nbuttons: []", "schema"),
        ("just words", "object"),
        ("buttons: [\n  {x_mm: 0, y_mm: 0 y}]: 3", "line 2"),
        ("a: &a [1, 2]\nrows: [*a, *a]\npitch_mm: [1, 1]", "alias"),
        ("rows: " + "[" * 5000 + "]" * 5000, "nested"),
    ],
)
def test_wrong_yaml_is_refused_with_its_place(tmp_path: Path, text: str, field: str) -> None:
    assert field in fails(tmp_path, text)


def test_wrong_json_is_refused_with_its_place(tmp_path: Path) -> None:
    assert "line 2, column 5" in fails(tmp_path, '{"name":\n [1,}', "panel.json")
    message = fails(tmp_path, '{"buttons": [{"x_mm": "0", "y_mm": 0}]}', "panel.json")
    assert "buttons[0].x_mm" in message


def test_missing_empty_and_binary_files_are_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.yaml"):
        read_template(tmp_path / "none.yaml")
    assert "empty" in fails(tmp_path, "")
    (tmp_path / "b.yaml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match=r"b\.yaml"):
        read_template(tmp_path / "b.yaml")
    (tmp_path / "c.yaml").write_bytes(b"a: \x07")
    with pytest.raises(InputError, match=r"c\.yaml"):
        read_template(tmp_path / "c.yaml")
