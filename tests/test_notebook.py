"""The example notebook runs from top to bottom, as Jupyter would run it, without Jupyter."""

from __future__ import annotations

import ast
import json
import sys
from pathlib import Path
from types import ModuleType
from typing import Any

import pytest
from PIL import Image

import fronto

EXAMPLES = Path(__file__).parent.parent / "examples"
NOTEBOOK = EXAMPLES / "panel.ipynb"
STATUSES = ("ok", "uncertain", "degenerate", "no_buttons")


class Markdown(str):
    """Stands for IPython's, which need not be installed."""


@pytest.fixture(scope="module")
def cells() -> list[dict[str, Any]]:
    notebook: dict[str, Any] = json.loads(NOTEBOOK.read_text(encoding="utf-8"))
    assert notebook["nbformat"] == 4
    return list(notebook["cells"])


def code_of(cells: list[dict[str, Any]]) -> list[str]:
    return ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]


def run_cell(code: str, names: dict[str, Any]) -> Any:
    """Run a cell; give the value that Jupyter would show below it."""
    body = ast.parse(code).body
    shown = body.pop() if body and isinstance(body[-1], ast.Expr) else None
    exec(compile(ast.Module(body, []), str(NOTEBOOK), "exec"), names)
    if shown is None:
        return None
    return eval(compile(ast.Expression(shown.value), str(NOTEBOOK), "eval"), names)


def test_it_is_stored_without_outputs(cells: list[dict[str, Any]]) -> None:
    assert NOTEBOOK.stat().st_size < 30_000
    kinds = {cell["cell_type"] for cell in cells}
    assert kinds == {"markdown", "code"}
    for cell in cells:
        if cell["cell_type"] == "code":
            assert cell["outputs"] == []
            assert cell["execution_count"] is None
    ids = [cell["id"] for cell in cells]
    assert len(set(ids)) == len(ids)


def test_it_runs_top_to_bottom(
    cells: list[dict[str, Any]], monkeypatch: pytest.MonkeyPatch
) -> None:
    display = ModuleType("IPython.display")
    monkeypatch.setattr(display, "Markdown", Markdown, raising=False)
    monkeypatch.setitem(sys.modules, "IPython", ModuleType("IPython"))
    monkeypatch.setitem(sys.modules, "IPython.display", display)
    monkeypatch.chdir(EXAMPLES)
    before = sorted(EXAMPLES.iterdir())
    names: dict[str, Any] = {"__name__": "__main__"}

    shown = [run_cell(code, names) for code in code_of(cells)]

    pictures = [value for value in shown if isinstance(value, Image.Image)]
    assert len(pictures) == 3
    for picture in pictures:
        assert picture.height == names["hall"].height
        assert picture.width > names["hall"].width  # photo and view, side by side
    tables = [value.splitlines() for value in shown if isinstance(value, Markdown)]
    assert len(tables) == 3
    for lines in tables:
        assert len({line.count(" | ") for line in lines}) == 1
    assert len(tables[0]) == 2 + len(names["panel"].buttons)
    assert len(tables[1]) == 2 + len(names["results"])
    for panel in (names["panel"], *names["results"].values(), *names["panels"].values()):
        assert isinstance(panel, fronto.Panel)
        assert panel.status in STATUSES
    alone, _, calibrated = names["results"].values()
    # Three buttons do not tell the focal length, as the notebook says.
    assert alone.status == "uncertain"
    assert calibrated.pose.camera.source == "file"
    # The angles that the hall panel was rendered with, as the first cell says.
    assert names["given"].status == "ok"
    assert names["given"].pose.angles_deg == pytest.approx((12, -20, 3), abs=1)
    assert not names["usable"](alone)
    assert names["usable"](names["given"])
    assert names["back"][0] == pytest.approx((400, 300), abs=1e-6)
    assert sorted(EXAMPLES.iterdir()) == before
