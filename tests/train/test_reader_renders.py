"""Rendered crops: what they say, what they are written in, and that it shows."""

from __future__ import annotations

from collections import Counter
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("torch")

from fronto.errors import InputError
from fronto.labels.alphabet import ALPHABET, KINDS
from fronto.labels.targets import ReadTarget, readable
from fronto.synth.photo.glyphs import FONTS
from fronto.train.reader.fonts import Typefaces, installed_fonts
from fronto.train.reader.inks import marking_mask
from fronto.train.reader.renders import render_crop, render_panel_crops
from fronto.train.reader.texts import Marking, random_marking

BUILT_IN = Typefaces()


@pytest.fixture(scope="module")
def markings() -> list[Marking]:
    rng = np.random.default_rng(0)
    return [random_marking(rng) for _ in range(6000)]


def test_every_kind_is_drawn(markings: list[Marking]) -> None:
    kinds = Counter(marking.target.kind for marking in markings)
    assert set(kinds) == set(KINDS) - {"unreadable"}  # that comes from spoilt crops
    assert kinds["text"] > 3000


def test_every_character_and_every_digit_at_every_place(markings: list[Marking]) -> None:
    texts = [marking.target.text for marking in markings if marking.target.text]
    assert set("".join(texts)) == set(ALPHABET)
    assert all(map(readable, texts))
    numbers = {text for text in texts if text.isdigit()}
    assert {str(k) for k in range(100)} <= numbers
    assert any(text.startswith("-") for text in texts)
    assert any(text.startswith("*") and len(text) > 1 for text in texts)


def test_the_printed_text_is_the_target(markings: list[Marking]) -> None:
    plain = [m for m in markings if m.target.text and "?" not in m.text]
    assert all(m.text.upper() == m.target.text for m in plain)
    starred = [m for m in markings if "?" in m.text]
    assert all(m.text.replace("?", "*").upper() == m.target.text for m in starred)
    assert starred


def test_the_same_draws_give_the_same_crop() -> None:
    first, second = (render_crop(np.random.default_rng(5), BUILT_IN) for _ in range(2))
    assert (first.image == second.image).all()
    assert (first.box, first.target) == (second.box, second.target)


def test_boxes_lie_in_the_picture_and_the_label_shows() -> None:
    rng = np.random.default_rng(1)
    contrasts: dict[bool, list[float]] = {True: [], False: []}
    for _ in range(150):
        sample = render_crop(rng, BUILT_IN)
        height, width, channels = sample.image.shape
        x0, y0, x1, y1 = sample.box
        assert channels == 3
        assert sample.image.dtype == np.uint8
        assert -1 <= x0 < x1 <= width
        assert -1 <= y0 < y1 <= height
        if sample.target.kind == "keyhole":
            continue
        x, y = round((x0 + x1) / 2), round((y0 + y1) / 2)
        middle = sample.image[y - 10 : y + 10, x - 10 : x + 10].mean(axis=2)
        contrasts[sample.target.kind == "blank"].append(float(np.ptp(middle)))
    assert np.median(contrasts[False]) > 70
    assert np.median(contrasts[False]) > 2 * np.median(contrasts[True])


def test_crops_of_whole_photos() -> None:
    rng = np.random.default_rng(2)
    found = [sample for _ in range(8) for sample in render_panel_crops(rng)]
    assert len(found) > 10
    assert {sample.target.kind for sample in found} <= {"text", "up", "down", "keyhole"}
    for sample in found:
        x0, y0, x1, y1 = sample.box
        assert min(x1 - x0, y1 - y0) >= 11
        assert x0 > -1
        assert y0 > -1


def test_built_in_typefaces() -> None:
    assert len(BUILT_IN) == FONTS
    masks = [BUILT_IN.write("12", font) for font in range(FONTS)]
    assert all(mask.max() == 255 and mask.ndim == 2 for mask in masks)
    assert len({mask.tobytes() for mask in masks}) > 4
    assert all(BUILT_IN.sign("▲", font) is None for font in range(FONTS))
    assert {BUILT_IN.draw(np.random.default_rng(k)) for k in range(200)} == set(range(FONTS))


def test_lines_stand_below_each_other() -> None:
    one, two = BUILT_IN.write("OPEN", 0), BUILT_IN.write("DOOR\nOPEN", 0)
    assert two.shape[0] > 2 * one.shape[0]
    ink = two.max(axis=1) > 0
    gaps = np.flatnonzero(np.diff(ink.astype(int)) == -1)
    assert len(gaps) == 1  # ink, a gap, ink to the end
    assert ink[0]
    assert ink[-1]


def test_installed_fonts_can_write_every_label() -> None:
    folders = installed_fonts()
    if not folders:
        pytest.skip("no package with fonts is installed")
    faces = Typefaces(folders[:1])
    assert len(faces) > FONTS
    for font in range(FONTS, len(faces)):
        digits = {faces.write(character, font).tobytes() for character in "0123456789"}
        assert len(digits) == 10
    drawn = [faces.draw(np.random.default_rng(k)) >= FONTS for k in range(400)]
    assert 0.35 < np.mean(drawn) < 0.65  # the folder as often as what is built in
    assert faces.sign("\ue000", FONTS) is None  # for private use: no font has it


@pytest.mark.parametrize("content", [None, b"", b"no font"])
def test_folders_without_fonts(tmp_path: Path, content: bytes | None) -> None:
    if content is not None:
        (tmp_path / "face.ttf").write_bytes(content)
    with pytest.raises(InputError, match="font"):
        Typefaces([tmp_path])


def test_a_star_stands_before_the_text() -> None:
    rng = np.random.default_rng(0)
    marking = Marking(ReadTarget("text", "*1"), "?1")
    alone = Marking(ReadTarget("text", "*"), "?")
    ratios = [(m := marking_mask(marking, BUILT_IN, rng)).shape[1] / m.shape[0] for _ in range(20)]
    stars = [(m := marking_mask(alone, BUILT_IN, rng)).shape[1] / m.shape[0] for _ in range(20)]
    assert np.median(ratios) > 1.15 * np.median(stars)
