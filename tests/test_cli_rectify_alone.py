"""`fronto rectify` with nothing but photos: the network finds the buttons."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
from click.testing import CliRunner, Result
from PIL import Image

from fronto.cli import main

EXAMPLES = Path(__file__).parent.parent / "examples"


def run(*arguments: object) -> Result:
    return CliRunner().invoke(main, [str(a) for a in arguments])


def test_a_photo_and_one_without_buttons(tmp_path: Path) -> None:
    wall = tmp_path / "wall.png"
    Image.fromarray(np.full((240, 320, 3), 120, np.uint8)).save(wall)
    camera = EXAMPLES / "camera.yaml"
    out = tmp_path / "out"
    result = run("rectify", EXAMPLES / "hall.png", "--camera", camera, "-o", out)
    assert result.exit_code == 0, result.output
    values = json.loads((out / "hall.json").read_text(encoding="utf-8"))
    assert len(values["buttons"]) == 3
    assert values["camera"]["source"] == "file"
    assert {"segment", "outline", "pose", "warp", "total"} <= set(values["timing_ms"])
    assert (out / "hall.rectified.png").exists()
    assert (out / "hall.overlay.png").exists()

    result = run("rectify", wall, "-o", out, "--strict")
    assert result.exit_code == 3
    values = json.loads((out / "wall.json").read_text(encoding="utf-8"))
    assert values["status"] == "no_buttons"
    assert values["reasons"]
    assert not (out / "wall.rectified.png").exists()


def test_outlines_that_were_found_give_the_same(tmp_path: Path) -> None:
    hall = EXAMPLES / "hall.png"
    # A second look at the head-on view and lines that agree with a pose are not in the file.
    alone = ("--fast", "--no-lines")
    camera = ("--camera", EXAMPLES / "camera.yaml")
    assert run("outline", hall, *alone, "-o", tmp_path / "found").exit_code == 0
    assert run("rectify", hall, *camera, *alone, "-o", tmp_path / "a").exit_code == 0
    found = ("--outlines", tmp_path / "found")
    given = run("rectify", hall, *camera, *found, "-o", tmp_path / "b")
    assert given.exit_code == 0, given.output
    first, second = (
        json.loads((tmp_path / name / "hall.json").read_text(encoding="utf-8")) for name in "ab"
    )
    assert np.allclose(first["pose"]["rotation"], second["pose"]["rotation"], atol=1e-6)
    assert first["plates"] == second["plates"]


def test_the_papers_solver_on_what_was_found(tmp_path: Path) -> None:
    result = run(
        "rectify", EXAMPLES / "hall.png", "--solver", "grid", "--step-deg", 4, "-o", tmp_path
    )
    assert result.exit_code == 0, result.output
    values = json.loads((tmp_path / "hall.json").read_text(encoding="utf-8"))
    assert values["pose"]["solver"] == "grid"
    assert values["pose"]["final_cr"] is not None
