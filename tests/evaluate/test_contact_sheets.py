"""Contact sheets: the right colours in the right places."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from evaluation_cases import HEIGHT, WIDTH, answer, label, photo, segment

from fronto.datasets.records import LabeledImage
from fronto.errors import InputError
from fronto.evaluate import (
    Finding,
    SegmentationReport,
    evaluate_segmentation,
    finding_sheets,
    photo_sheet,
)
from fronto.imageio import write_png
from fronto.segments import Segment

GREEN, BLUE, YELLOW = (0, 220, 0), (60, 140, 255), (255, 220, 0)
RED, VIOLET = (255, 40, 40), (220, 90, 255)
GREY = 120


def grey(path: Path) -> np.ndarray:
    return np.full((HEIGHT, WIDTH, 3), GREY, np.uint8)


def has(picture: np.ndarray, color: tuple[int, int, int]) -> bool:
    return bool((np.abs(picture.astype(int) - color).max(axis=2) < 25).any())


def evaluated(image: LabeledImage, *found: Segment, by: str = "mask") -> SegmentationReport:
    return evaluate_segmentation([image], answer(found), by=by)


def first_tile(report: SegmentationReport) -> np.ndarray:
    """The photo alone, without the legend, in which every colour is."""
    return photo_sheet(report.images, tile=400, read=grey)[4:404, 4:404]


@pytest.mark.parametrize("by", ["box", "mask"])
def test_each_kind_of_finding_has_its_colour(by: str) -> None:
    image = photo(label(10, 10), label(60, 10))
    right = [segment(13, 12), segment(60, 13)]
    seen = first_tile(evaluated(image, *right, by=by))
    assert has(seen, GREEN)
    assert has(seen, BLUE)
    assert not has(seen, RED)
    assert not has(seen, YELLOW)
    assert has(first_tile(evaluated(image, right[0], by=by)), YELLOW)
    assert has(first_tile(evaluated(image, *right, segment(120, 60), by=by)), RED)
    plate = photo(label(10, 10, category="plate"))
    seen = first_tile(evaluated(plate, segment(10, 10, category="plate"), by=by))
    assert has(seen, VIOLET)
    assert not has(seen, BLUE)


def test_outlines_lie_where_the_finding_is() -> None:
    # The photo is shown from the missed button on the left to the false one on the right.
    seen = first_tile(evaluated(photo(label(20, 40)), segment(150, 40)))
    yellow = np.argwhere(np.abs(seen.astype(int) - YELLOW).max(axis=2) < 25)
    red = np.argwhere(np.abs(seen.astype(int) - RED).max(axis=2) < 25)
    assert yellow[:, 1].max() < 200 < red[:, 1].min()
    height = np.ptp(yellow[:, 0])
    # 200 px of width fill 400: two to one, the frame's own width aside.
    assert height == pytest.approx(40, abs=4)
    assert np.ptp(yellow[:, 1]) == pytest.approx(40, abs=4)


def test_a_photo_without_findings_is_shown_whole() -> None:
    seen = first_tile(evaluated(photo()))
    shown = np.argwhere((seen == GREY).all(axis=2))
    assert np.ptp(shown, axis=0).tolist() == [239, 399]  # 200x120 doubled


def test_tiles_fill_rows() -> None:
    images = [photo(label(10, 10), name=str(k)) for k in range(5)]
    report = evaluate_segmentation(images, answer(*[[]] * 5))
    wide = photo_sheet(report.worst(5), columns=3, tile=200, read=grey)
    assert wide.shape[1] > 3 * 200
    assert 2 * 200 < wide.shape[0] < 3 * 200
    assert wide.dtype == np.uint8
    with pytest.raises(InputError):
        photo_sheet([], read=grey)


def test_crops_come_in_pages_around_the_finding() -> None:
    image = photo(label(90, 50))
    found = [segment(0, 0), segment(180, 100), segment(150, 20, 10), segment(40, 60, 60)]
    report = evaluated(image, *found)
    findings = [*report.false_positives, *report.misses]
    assert len(findings) == 5
    pages = list(finding_sheets(findings, columns=2, rows=2, tile=120, read=grey))
    assert len(pages) == 2
    for k, finding in enumerate(findings):
        row, column = divmod(k % 4, 2)
        top, left = 4 + row * (120 + 36 + 4), 4 + column * (120 + 4)
        crop = pages[k // 4][top : top + 120, left : left + 120]
        color = RED if finding.verdict == "false" else YELLOW
        where = np.argwhere(np.abs(crop.astype(int) - color).max(axis=2) < 25)
        # One box size around it: it is the middle third.
        assert where.min(axis=0) == pytest.approx([40, 40], abs=3)
        assert where.max(axis=0) == pytest.approx([80, 80], abs=3)
    # The first of them lies in the photo's corner: beyond it there is nothing to see.
    corner = pages[0][4:124, 4:124]
    assert (corner[:30, :30] != GREY).any()
    assert (corner[90:110, 90:110] == GREY).all()


def test_each_photo_of_a_page_is_read_once() -> None:
    asked = []

    def read(path: Path) -> np.ndarray:
        asked.append(path.stem)
        return grey(path)

    findings = [
        Finding(photo(name=name).path, "false", "up", (0.0, 0.0, 9.0, 9.0), 0.5) for name in "abab"
    ]
    assert len(list(finding_sheets(findings, read=read))) == 1
    assert asked == ["a", "b"]
    assert list(finding_sheets([], read=read)) == []


def test_photos_are_read_from_their_files(tmp_path: Path) -> None:
    write_png(tmp_path / "hall-ü.png", np.full((60, 80, 3), 200, np.uint8))
    image = LabeledImage(tmp_path / "hall-ü.png", 80, 60, (label(10, 10),))
    report = evaluate_segmentation([image], answer([]))
    assert has(photo_sheet(report.images), YELLOW)
    (page,) = finding_sheets(report.misses)
    assert has(page, YELLOW)


def test_photos_of_16_bits_are_shown_by_their_upper_ones() -> None:
    report = evaluate_segmentation([photo()], answer([]))
    sheet = photo_sheet(
        report.images, tile=200, read=lambda path: np.full((HEIGHT, WIDTH, 3), 120 << 8, np.uint16)
    )
    assert (sheet[4:204, 4:204] == 120).all(axis=2).sum() == WIDTH * HEIGHT
