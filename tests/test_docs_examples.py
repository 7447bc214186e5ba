"""What the documentation says to type works, and what it lists is all that there is."""

from __future__ import annotations

import json
import re
import shlex
import shutil
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path

import click
import numpy as np
import pytest
from click.testing import CliRunner

from fronto import Rectifier, RectifierOptions, Segments
from fronto.cli import COMMANDS, main
from fronto.cli.inputs import PHOTOS, VIDEOS
from fronto.images import as_rgb
from fronto.video import Frame, VideoRectifier, VideoWriter, video_record

ROOT = Path(__file__).parent.parent
DOCS = ROOT / "docs"
PAGES = sorted(DOCS.glob("*.md"))
#: Of these every option that is named is one of ours.
ABOUT_OPTIONS = ("rectify", "faq", "result", "statuses", "files")


def text_of(name: str) -> str:
    return (DOCS / f"{name}.md").read_text(encoding="utf-8")


def blocks(text: str, language: str) -> list[str]:
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.DOTALL | re.MULTILINE)


def section(text: str, heading: str) -> str:
    """The part under a heading, up to the next of any level."""
    found = re.search(rf"^#+ {re.escape(heading)}\n(.*?)(?=^#|\Z)", text, re.DOTALL | re.MULTILINE)
    assert found is not None, heading
    return found[1]


def keys_of_table(text: str) -> set[str]:
    """What stands as code in the first column."""
    firsts = re.findall(r"^\|([^|]*)\|", text, re.MULTILINE)
    return {key for first in firsts for key in re.findall(r"`(\w+)`", first)}


def command(name: str) -> click.Command:
    found = main.get_command(click.Context(main), name)
    assert found is not None
    return found


def test_options_file_has_every_option_with_its_default(tmp_path: Path) -> None:
    (example,) = blocks(text_of("rectify"), "toml")
    names = re.findall(r"^(\w+) *=", example, re.MULTILINE)
    assert sorted(names) == sorted(field.name for field in fields(RectifierOptions))
    path = tmp_path / "options.toml"
    path.write_text(example, encoding="utf-8")
    assert RectifierOptions.from_file(path) == RectifierOptions()


@pytest.mark.parametrize("page", ["rectify", "faq"])
def test_python_runs_as_written(
    page: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    shutil.copytree(ROOT / "examples", tmp_path / "examples")
    monkeypatch.chdir(tmp_path)
    photo = as_rgb("examples/car.png")
    with VideoWriter("walk.mp4", 10) as writer:
        for _ in range(2):
            writer.write(photo)
    names: dict[str, object] = {"__name__": page}
    for code in blocks(text_of(page), "python"):
        exec(compile(code, f"{page}.md", "exec"), names)
    if page == "rectify":
        for made in ("car.head_on.png", "out/car.json", "out/car.overlay.png", "head_on.mp4"):
            assert Path(made).stat().st_size > 1000, made
    else:
        # Where the example's second button was rendered, metres.
        position = re.findall(r"-?\d+\.\d+", capsys.readouterr().out)
        assert [float(x) for x in position] == pytest.approx([0.006, 0.003, 0.208], abs=0.005)


def typed() -> Iterator[tuple[str, str]]:
    for page in (*PAGES, ROOT / "README.md"):
        text = page.read_text(encoding="utf-8")
        for block in (*blocks(text, "sh"), *blocks(text, "console")):
            for line in block.splitlines():
                words = line.removeprefix("$ ")
                if words.startswith("fronto "):
                    yield page.name, words


@pytest.mark.parametrize(("page", "line"), list(typed()))
def test_command_lines_are_understood(page: str, line: str) -> None:
    words = shlex.split(line.split(" < ")[0], comments=True)[1:]
    # Parses all arguments, and runs nothing.
    command(words[0]).make_context(words[0], words[1:])


@pytest.mark.parametrize("page", ABOUT_OPTIONS)
def test_options_named_exist(page: str) -> None:
    known = {
        option
        for name in COMMANDS
        for parameter in command(name).params
        for option in parameter.opts
    }
    named = set(re.findall(r"(?<![\w-])--[a-z][a-z-]*", text_of(page))) - {"--help"}
    assert named
    assert named <= known


def slug(heading: str) -> str:
    """The anchor of a heading, as Python-Markdown's toc makes it."""
    plain = re.sub(r"[^\w\s-]", "", heading.replace("`", "")).strip().lower()
    return re.sub(r"[-\s]+", "-", plain)


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.stem)
def test_links_lead_somewhere(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    prose = re.sub(r"^```.*?^```", "", text, flags=re.DOTALL | re.MULTILINE)
    for link in re.findall(r"\]\(([^)\s]+)\)", prose):
        if link.startswith("http"):
            continue
        name, _, anchor = link.partition("#")
        target = DOCS / name if name else page
        assert target.is_file(), link
        if anchor:
            headings = re.findall(r"^#+ (.+)$", target.read_text(encoding="utf-8"), re.MULTILINE)
            assert anchor in map(slug, headings), link


def test_every_page_is_in_the_navigation() -> None:
    nav = (ROOT / "mkdocs.yml").read_text(encoding="utf-8").split("\nnav:\n")[1]
    pages = re.findall(r": (\S+\.md)$", nav, re.MULTILINE)
    assert sorted(pages) == [page.name for page in PAGES]


def test_endings_are_those_that_are_taken() -> None:
    photos = section(text_of("files"), "Photos")
    listed = re.search(r"pattern are taken: ([\w, \n]+)\.", photos)
    assert listed is not None
    assert {f".{end}" for end in re.findall(r"\w+", listed[1])} == PHOTOS
    for text in (section(text_of("files"), "Videos"), section(text_of("rectify"), "What it takes")):
        listed = re.search(r"by its suffix: (\w+(?:, \w+)+)", text)
        assert listed is not None
        assert {f".{end}" for end in listed[1].split(", ")} == VIDEOS


def test_every_key_of_a_result_is_described(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(ROOT)
    arguments = ["examples/car.png", "--outlines", "examples/car.outlines.json", "--hfov", "90"]
    lines = tmp_path / "lines.jsonl"
    missing = CliRunner().invoke(
        main, ["rectify", *arguments, "-o", str(tmp_path), "--jsonl", str(lines), "-q"]
    )
    assert missing.exit_code == 0, missing.output
    result = json.loads(lines.read_text(encoding="utf-8"))
    page = text_of("result")
    assert keys_of_table(section(page, "Top level")) == set(result)
    for part in ("camera", "pose"):
        assert keys_of_table(section(page, part)) == set(result[part])
    assert keys_of_table(section(page, "buttons")) == set(result["buttons"][0])


def test_every_key_of_a_failure_is_described(tmp_path: Path) -> None:
    lines = tmp_path / "lines.jsonl"
    photo = str(tmp_path / "none.png")
    failed = CliRunner().invoke(
        main, ["rectify", photo, "-o", str(tmp_path / "out"), "--jsonl", str(lines)]
    )
    assert failed.exit_code == 2
    text = section(text_of("result"), "JSON Lines")
    values = json.loads(lines.read_text(encoding="utf-8"))
    assert keys_of_table(text) == set(values)
    (example,) = blocks(text, "json")
    assert list(json.loads(example)) == list(values)
    assert json.loads(example)["schema"] == values["schema"]


def test_every_key_of_a_video_is_described() -> None:
    nothing = Rectifier(segment=lambda photo: Segments(photo.shape[1], photo.shape[0], ()))
    frame = Frame(0, 0.0, np.zeros((48, 64, 3), np.uint8))
    record = video_record(VideoRectifier(nothing)(frame))
    text = section(text_of("result"), "Videos")
    frames, track = text.split("| key of `track`")
    assert keys_of_table(frames) == set(record)
    assert keys_of_table(track) == set(record["track"])
    assert f'"{record["schema"]}"' in frames


def test_the_figure_of_the_steps_is_light() -> None:
    assert (DOCS / "images" / "steps.png").stat().st_size < 400_000
