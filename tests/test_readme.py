"""What the README says to type works as written, on the examples."""

from __future__ import annotations

import re
import shlex
import shutil
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

from fronto.camera import Camera
from fronto.cli import main
from fronto.outlinefile import read_outlines

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", README, re.DOTALL | re.MULTILINE)


@pytest.fixture
def copy(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_python_runs_as_written(copy: Path, capsys: pytest.CaptureFixture[str]) -> None:
    for code in blocks("python"):
        exec(compile(code, "README.md", "exec"), {"__name__": "readme"})
    status, x, y, z = re.findall(
        r"^(\w+) \(([-.\d]+), ([-.\d]+), ([-.\d]+)\)", capsys.readouterr().out, re.MULTILINE
    )[-1]
    assert status == "ok"
    # The angles that the example was rendered with.
    assert [float(x), float(y), float(z)] == pytest.approx([12, -20, 3], abs=1)
    assert (copy / "hall.head_on.png").stat().st_size > 1000


def test_command_lines_run_as_written(copy: Path) -> None:
    lines = [line for block in blocks("sh") for line in block.splitlines()]
    commands = [shlex.split(line)[1:] for line in lines if line.startswith("fronto ")]
    assert len(commands) == 2
    for command in commands:
        result = CliRunner().invoke(main, [*command, "--strict"], catch_exceptions=False)
        assert result.exit_code == 0, result.output
    for stem in ("hall", "car"):
        for ending in ("rectified.png", "overlay.png", "json"):
            assert (copy / "out" / f"{stem}.{ending}").is_file()


@pytest.mark.parametrize("name", ["hall", "car"])
def test_examples_belong_together(name: str) -> None:
    from PIL import Image

    with Image.open(ROOT / "examples" / f"{name}.png") as photo:
        size = photo.size
    camera = Camera.from_file(ROOT / "examples" / "camera.yaml")
    assert (camera.width_px, camera.height_px) == size
    assert camera.horizontal_fov_deg == pytest.approx(90, abs=0.1)
    found = read_outlines(ROOT / "examples" / f"{name}.outlines.json")
    assert (found.width_px, found.height_px) == size
    assert found.image == f"{name}.png"
    for outline in found.outlines:
        box = np.array(outline.box_px)
        assert (box >= 0).all()
        assert (box[2:] < size).all()


@pytest.mark.parametrize("target", re.findall(r"\]\(((?!http|#)[^)]+)\)", README))
def test_links_lead_somewhere(target: str) -> None:
    assert (ROOT / target).exists()
