"""Typefaces that labels are rendered in: the built-in ones, and font files."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from fronto.errors import InputError
from fronto.labels.alphabet import ALPHABET
from fronto.synth.photo.draws import pick
from fronto.synth.photo.glyphs import FONTS, Bits, words

__all__ = ["Typefaces", "installed_fonts"]

#: Height of the letters in pixels: about twice that of a label on a rendered face.
EM_PX = 64
#: Packages that bring fonts under free licences, and where: those that are installed are used.
#: All but Matplotlib are Pimoroni's font-... on PyPI (OFL, Roboto and Caladea Apache 2.0).
PACKAGES = {
    "matplotlib": "mpl-data/fonts/ttf",
    "font_roboto": "files",
    "font_source_sans_pro": "files",
    "font_source_serif_pro": "files",
    "font_hanken_grotesk": "files",
    "font_manrope": "files",
    "font_caladea": "files",
}
#: Of Matplotlib's the others are for formulas.
TEXT_FONTS = ("DejaVuSans", "DejaVuSerif", "STIXGeneral")
#: Not in any font: what fonts draw instead of it tells which other characters they lack.
MISSING = "\U0010fffe"


def installed_fonts() -> tuple[Path, ...]:
    """Font folders of the packages that are installed beside this one (see `PACKAGES`)."""
    found = []
    for package, folder in PACKAGES.items():
        spec = find_spec(package)
        for place in (spec.submodule_search_locations or ()) if spec else ():
            path = Path(place) / folder
            if path.is_dir():
                found.append(path)
    return tuple(found)


class Typefaces:
    """Writes texts in many typefaces, as coverage masks.

    Parameters
    ----------
    folders
        Folders with ``.ttf`` and ``.otf`` files, besides the typefaces of
        `fronto.synth.photo.glyphs`. Fonts that lack a letter or a digit are left out.

    Raises
    ------
    InputError
        If a folder is missing or holds no such font.
    """

    def __init__(self, folders: Sequence[Path] = ()) -> None:
        groups = [_font_files(folder) for folder in folders]
        self.files = tuple(file for group in groups for file in group)
        ends = FONTS + np.cumsum([len(group) for group in groups], dtype=int)
        self._ranges = list(zip([0, FONTS, *ends], [FONTS, *ends], strict=False))

    def __len__(self) -> int:
        return FONTS + len(self.files)

    def draw(self, rng: np.random.Generator) -> int:
        """Number of a typeface: any folder as likely as another, however many are in it."""
        first, last = pick(rng, self._ranges)
        return int(rng.integers(first, last))

    def write(self, text: str, font: int) -> Bits:
        """The text, cropped to its ink, shape (h, w), 0 to 255; lines are parted by newlines."""
        masks = [self._line(line, font) for line in text.split("\n")]
        if len(masks) == 1:
            return masks[0]
        width = max(mask.shape[1] for mask in masks)
        gap = max(2, round(0.3 * masks[0].shape[0]))
        rows = []
        for mask in masks:
            left = (width - mask.shape[1]) // 2
            rows.append(np.pad(mask, ((0, gap), (left, width - mask.shape[1] - left))))
        return np.ascontiguousarray(np.vstack(rows)[:-gap])

    def sign(self, characters: str, font: int) -> Bits | None:
        """Special characters in this typeface; None where it lacks one of them."""
        if font < FONTS or any(_lacks(self.files[font - FONTS], c) for c in characters):
            return None
        return _written(self.files[font - FONTS], characters)

    def _line(self, text: str, font: int) -> Bits:
        return words(text, font) if font < FONTS else _written(self.files[font - FONTS], text)


def _font_files(folder: Path) -> list[Path]:
    files = sorted(file for file in folder.glob("*") if file.suffix.lower() in (".ttf", ".otf"))
    if folder.parts[-3:] == ("mpl-data", "fonts", "ttf"):
        files = [file for file in files if file.stem.startswith(TEXT_FONTS)]
    files = [file for file in files if not any(_lacks(file, character) for character in ALPHABET)]
    if not files:
        raise InputError(
            f"fonts {folder}",
            "expected a folder with fonts (*.ttf, *.otf) that have all letters and digits, "
            "found none",
        )
    return files


@lru_cache(maxsize=512)
def _font(file: Path) -> Any:
    from PIL import ImageFont

    try:
        return ImageFont.truetype(file, EM_PX)
    except OSError as error:
        raise InputError(f"font {file}", f"expected a font, got: {error}", "remove it") from None


@lru_cache(maxsize=512)
def _missing(file: Path) -> bytes:
    return bytes(_font(file).getmask(MISSING))


@lru_cache(maxsize=20_000)
def _lacks(file: Path, character: str) -> bool:
    """Whether the font has no such character: it draws nothing, or its sign for that."""
    drawn = _font(file).getmask(character)
    return drawn.getbbox() is None or bytes(drawn) == _missing(file)


@lru_cache(maxsize=4096)
def _written(file: Path, text: str) -> Bits:
    from PIL import Image, ImageDraw

    font = _font(file)
    x0, y0, x1, y1 = font.getbbox(text)
    image = Image.new("L", (int(x1 - x0) + 8, int(y1 - y0) + 8))
    ImageDraw.Draw(image).text((4 - x0, 4 - y0), text, fill=255, font=font)
    left, top, right, bottom = image.getbbox() or (0, 0, *image.size)
    return np.ascontiguousarray(np.asarray(image, np.uint8)[top:bottom, left:right])
