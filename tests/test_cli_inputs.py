"""What people name on the command line: folders, patterns, the same twice, standard input."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner, Result
from PIL import Image

from fronto import InputError
from fronto.cli import main
from fronto.cli.inputs import expanded, is_video, result_names

EXAMPLES = Path(__file__).parent.parent / "examples"
OWN = (
    "overlay.png",
    "rectified.png",
    "segments.png",
    "outlines.png",
    "steps.png",
    "before_after.png",
    "rectified.mp4",
    "json",
    "outlines.json",
    "jsonl",
)


def run(*arguments: object, piped: bytes | None = None) -> Result:
    return CliRunner().invoke(main, ["rectify", *map(str, arguments)], input=piped)


def refused(result: Result, *words: object) -> None:
    """Exit code 2 and one line on stderr that has all of the words."""
    assert result.exit_code == 2, result.output
    assert result.stderr.count("\n") == 1
    assert result.stdout == ""
    for word in words:
        assert str(word) in result.stderr


def files(folder: Path, *names: str) -> list[Path]:
    """Files that have a photo's name at least."""
    paths = [folder / name for name in names]
    for path in paths:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(b"x")
    return paths


def small_photo(path: Path) -> Path:
    Image.fromarray(np.full((64, 80, 3), 120, np.uint8)).save(path)
    return path


# --- folders


def test_a_folder_is_its_photos_and_videos_in_natural_order(tmp_path: Path) -> None:
    in_order = ["a.JPG", "hall 1.png", "hall 2.webp", "Hall 10.jpeg", "hall 10b.tiff", "z.MP4"]
    expected = files(tmp_path, *in_order)
    files(tmp_path, "notes.txt", "labels.json", ".hidden.jpg", "._a.JPG", "no_suffix", "deep/b.jpg")
    (tmp_path / "folder.jpg").mkdir()
    assert expanded([tmp_path]) == expected
    assert [is_video(path) for path in expected] == [False] * 5 + [True]


def test_what_fronto_has_written_is_no_photo(tmp_path: Path) -> None:
    photos = files(tmp_path, "hall.jpg", "overlay.png", "the rectified.png")
    for stem in ("hall", "hall.jpg"):
        files(tmp_path, *(f"{stem}.{end}" for end in OWN))
    assert expanded([tmp_path]) == photos
    assert expanded([tmp_path / "*"]) == photos
    # Named on its own it may be one.
    assert expanded([tmp_path / "hall.overlay.png"]) == [tmp_path / "hall.overlay.png"]


def test_results_beside_the_photos_are_left_alone_the_next_time(tmp_path: Path) -> None:
    Image.open(EXAMPLES / "hall.png").resize((400, 300)).save(tmp_path / "hall.png")
    arguments = (tmp_path, "-o", tmp_path, "--fast", "--show-steps", "--before-after")
    for _ in range(2):
        result = run(*arguments)
        assert result.exit_code == 0, result.output
        (line,) = result.stdout.splitlines()
        assert line.startswith("hall.png: ")
    assert len(list(tmp_path.iterdir())) == 1 + len({"json", *OWN[:2], "steps", "before_after"})


@pytest.mark.parametrize("content", [[], ["notes.txt", "hall.overlay.png", "deep/hall.jpg"]])
def test_a_folder_without_photos_is_refused(tmp_path: Path, content: list[str]) -> None:
    folder = tmp_path / "empty"
    folder.mkdir()
    files(folder, *content)
    out = tmp_path / "out"
    refused(run(folder, "-o", out), folder)
    # Whatever else is named.
    refused(run(small_photo(tmp_path / "a.png"), folder, "-o", out), folder)
    assert not out.exists()


def test_the_order_of_arguments_is_kept(tmp_path: Path) -> None:
    one = files(tmp_path / "one", "b.jpg", "c.jpg")
    two = files(tmp_path / "two", "d.jpg", "e.jpg")
    (first,) = files(tmp_path, "z.jpg")
    (last,) = files(tmp_path, "a.jpg")
    assert expanded([first, tmp_path / "two", tmp_path / "one", last]) == [first, *two, *one, last]


def test_a_file_that_is_missing_is_told_of_when_it_is_read(tmp_path: Path) -> None:
    names = ["none.jpg", "n" * 300 + ".jpg", "none"]
    paths = [tmp_path / name for name in names]
    assert expanded(paths) == paths
    for path in paths:
        refused(run(path, "-o", tmp_path / "out"), path)


# --- patterns


def test_patterns(tmp_path: Path) -> None:
    top = files(tmp_path, "hall2.jpg", "hall10.jpg")
    other = files(tmp_path, "hall2.png")
    deep = files(tmp_path, "a/hall3.jpg", "a/b/hall4.jpg", "z/hall5.jpg")
    files(tmp_path, "hall.txt", "a/b/hall4.json", "hall2.overlay.png")
    assert expanded([tmp_path / "hall*.jpg"]) == top
    assert expanded([tmp_path / "hall2.*"]) == [top[0], *other]
    assert expanded([tmp_path / "hall[0-9].???"]) == [top[0], *other]
    assert expanded([tmp_path / "*" / "*.jpg"]) == [deep[0], deep[2]]
    found = expanded([tmp_path / "**" / "*.jpg"])
    assert sorted(found) == sorted(top + deep)
    assert found.index(deep[0]) < found.index(deep[2])
    assert found.index(top[0]) < found.index(top[1])


def test_a_pattern_is_taken_by_the_command(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for name in ("b.png", "a.png"):
        small_photo(tmp_path / name)
    monkeypatch.chdir(tmp_path)
    result = run("*.png", "-o", "out", "--fast")
    assert result.exit_code == 0, result.output
    assert [line.split(":")[0] for line in result.stdout.splitlines()] == ["a.png", "b.png"]
    # Nobody asked for the folder that the results are in.
    assert run("**/*.png", "-o", "out", "--fast").stdout.count("\n") == 2


def test_patterns_without_a_match_are_refused(tmp_path: Path) -> None:
    files(tmp_path, "hall.txt", "hall.overlay.png")
    for pattern in ("*.jpg", "hall*", "none/**", "[ab].png"):
        with pytest.raises(InputError, match="pattern"):
            expanded([tmp_path / pattern])
    refused(run(tmp_path / "*.jpg", "-o", tmp_path / "out"), tmp_path / "*.jpg")
    assert not (tmp_path / "out").exists()


def test_a_name_that_looks_like_a_pattern_is_a_name_first(tmp_path: Path) -> None:
    odd, other = files(tmp_path, "hall[1].jpg", "hall1.jpg")
    assert expanded([odd]) == [odd]
    odd.unlink()
    assert expanded([odd]) == [other]


# --- the same file, the same stem


def test_a_file_named_twice_is_taken_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    one, two, three = files(tmp_path, "photos/1.jpg", "photos/2.jpg", "photos/3.jpg")
    folder = one.parent
    # Where it was named first.
    assert expanded([two, folder, three, folder / "*.jpg"]) == [two, one, three]
    monkeypatch.chdir(tmp_path)
    twice = [Path("photos/2.jpg"), two, Path("photos/../photos/2.jpg"), Path("photos")]
    assert expanded(twice) == [twice[0], Path("photos/1.jpg"), Path("photos/3.jpg")]


def test_two_links_to_a_photo_are_two_photos(tmp_path: Path) -> None:
    (photo,) = files(tmp_path, "a.jpg")
    link = tmp_path / "b.jpg"
    try:
        link.symlink_to(photo)
    except OSError:
        pytest.skip("no symbolic links here")
    assert expanded([tmp_path]) == [photo, link]


def names(*photos: str) -> list[str]:
    return list(result_names([Path(photo) for photo in photos]))


def test_results_are_named_by_the_stem_or_where_that_clashes_by_the_name() -> None:
    assert names("hall.jpg", "b/car.png", "no_suffix") == ["hall", "car", "no_suffix"]
    assert names("hall.jpg", "car.jpg", "hall.png") == ["hall.jpg", "car", "hall.png"]
    # Some file systems do not tell them apart.
    assert names("Hall.jpg", "hall.png") == ["Hall.jpg", "hall.png"]
    assert names() == []


def test_photos_of_one_stem_have_results_of_their_own(tmp_path: Path) -> None:
    hall = Image.open(EXAMPLES / "hall.png").convert("RGB").resize((400, 300))
    hall.save(tmp_path / "hall.jpg")
    small_photo(tmp_path / "hall.png")
    small_photo(tmp_path / "other.png")
    out = tmp_path / "out"
    result = run(tmp_path, "-o", out, "--fast", "--hfov", 102)
    assert result.exit_code == 0, result.output
    jsons = ["hall.jpg.json", "hall.png.json", "other.json"]
    assert sorted(path.name for path in out.glob("*.json")) == jsons
    values = [json.loads((out / name).read_bytes()) for name in jsons]
    assert [v["image"] for v in values] == ["hall.jpg", "hall.png", "other.png"]
    assert [len(v["buttons"]) > 0 for v in values] == [True, False, False]
    assert values[0]["rectified"]["file"] == "hall.jpg.rectified.png"
    assert (out / "hall.jpg.rectified.png").exists()
    assert (out / "hall.png.overlay.png").exists()


def test_photos_of_one_name_are_refused(tmp_path: Path) -> None:
    photos = []
    for folder in ("a", "b"):
        (tmp_path / folder).mkdir()
        photos.append(small_photo(tmp_path / folder / "hall.png"))
    refused(run(*photos, "-o", tmp_path / "out"), *photos)
    # hall.jpg is what hall.jpg.jpg would be named after, too.
    odd = [small_photo(tmp_path / name) for name in ("x.jpg", "x.png", "x.jpg.jpg")]
    refused(run(*odd, "-o", tmp_path / "out"), odd[0], odd[2])
    assert not (tmp_path / "out").exists()


# --- standard input


def test_a_photo_from_standard_input(tmp_path: Path) -> None:
    content = (EXAMPLES / "hall.png").read_bytes()
    camera = ("--camera", EXAMPLES / "camera.yaml")
    for name, arguments in (("pipe", ["-"]), ("twice", ["-", "-"])):
        out = tmp_path / name
        result = run(*arguments, "-o", out, "--fast", *camera, piped=content)
        assert result.exit_code == 0, result.output
        assert result.stdout.count("\n") == 1
        assert sorted(path.name for path in out.iterdir()) == [
            "stdin.json",
            "stdin.overlay.png",
            "stdin.rectified.png",
        ]
    piped = json.loads((tmp_path / "pipe/stdin.json").read_bytes())
    run(EXAMPLES / "hall.png", "-o", tmp_path / "file", "--fast", *camera)
    read = json.loads((tmp_path / "file/hall.json").read_bytes())
    assert piped["pose"]["rotation"] == read["pose"]["rotation"]
    assert len(piped["buttons"]) > 0


def test_standard_input_among_files(tmp_path: Path) -> None:
    first, last = small_photo(tmp_path / "a.png"), small_photo(tmp_path / "b.png")
    out = tmp_path / "out"
    result = run(first, "-", last, "-o", out, "--fast", piped=first.read_bytes())
    assert result.exit_code == 0, result.output
    lines = [line.split(":")[0] for line in result.stdout.splitlines()]
    assert lines == ["a.png", "stdin", "b.png"]


@pytest.mark.parametrize("content", [b"", b"no photo"])
def test_nothing_or_no_photo_piped(tmp_path: Path, content: bytes) -> None:
    refused(run("-", "-o", tmp_path / "out", piped=content), "stdin" if content else "input")
    assert not (tmp_path / "out").exists()
    # Where nothing comes there is an error before any work, whatever else is named.
    photo = small_photo(tmp_path / "a.png")
    result = run(photo, "-", "-o", tmp_path / "out", "--fast", piped=content)
    assert result.exit_code == (1 if content else 2)
    assert (tmp_path / "out" / "a.json").exists() == bool(content)


def test_no_photo_at_all_is_refused(tmp_path: Path) -> None:
    result = run("-o", tmp_path / "out")
    assert result.exit_code == 2
    assert "PHOTO" in result.stderr
