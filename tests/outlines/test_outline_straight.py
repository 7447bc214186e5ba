"""Straight segments of a photo are looked for once, and beside other work."""

from __future__ import annotations

import threading
from pathlib import Path

import cv2
import numpy as np
import pytest

import fronto
from fronto.outlines import straight
from fronto.outlines.straight import once_a_photo, straight_segments

CAR = Path(__file__).parents[2] / "examples" / "car.png"


@pytest.fixture
def photo() -> np.ndarray:
    drawn = np.full((240, 320, 3), 90, np.uint8)
    cv2.rectangle(drawn, (40, 30), (280, 200), (200, 180, 160), -1)
    return drawn


@pytest.fixture
def looks(monkeypatch: pytest.MonkeyPatch) -> list[threading.Thread]:
    """The threads that have looked for segments, one entry a look."""
    seen: list[threading.Thread] = []
    before = straight._segments

    def look(rgb, field):
        seen.append(threading.current_thread())
        return before(rgb, field)

    monkeypatch.setattr(straight, "_segments", look)
    return seen


@pytest.mark.parametrize("meanwhile", [False, True])
def test_once_and_the_same(photo, looks, meanwhile) -> None:
    expected, std = straight_segments(photo)
    assert len(expected) >= 4
    with once_a_photo(photo) as begin:
        if meanwhile:
            begin()
        # The same pixels in another array are the same photo.
        for array in (photo, photo.view(), photo[:]):
            found, same_std = straight_segments(array)
            np.testing.assert_array_equal(found, expected)
            assert same_std == std
    assert len(looks) == 2
    assert (looks[1] is threading.current_thread()) != meanwhile
    straight_segments(photo)
    assert len(looks) == 3


def test_other_photos_and_parts_are_looked_at_by_themselves(photo, looks) -> None:
    with once_a_photo(photo) as begin:
        begin()
        other, _ = straight_segments(photo.copy())
        assert len(other)
        # The left edge of the rectangle only.
        part, _ = straight_segments(photo, (np.array([0.0, 0.0]), np.array([100.0, 239.0])))
        assert len(part)
        assert part[..., 0].max() <= 101
        straight_segments(photo)
    assert len(looks) == 3


def test_what_goes_wrong_meanwhile_is_told_to_who_asks(photo, monkeypatch) -> None:
    def fails(rgb, field):
        raise MemoryError("no room")

    monkeypatch.setattr(straight, "_segments", fails)
    with once_a_photo(photo) as begin:
        begin()
        with pytest.raises(MemoryError):
            straight_segments(photo)


def test_threads_do_not_see_each_others_photo(photo, looks) -> None:
    with once_a_photo(photo):
        straight_segments(photo)
        thread = threading.Thread(target=straight_segments, args=(photo,))
        thread.start()
        thread.join()
    assert len(looks) == 2


@pytest.mark.parametrize("threads", [1, 2])
def test_both_looks_of_a_rectifier_share_them(looks, threads) -> None:
    rectify = fronto.Rectifier(threads=threads)
    panel = rectify(CAR)
    assert panel.buttons
    assert len(looks) == 1
    assert (looks[0] is threading.current_thread()) == (threads == 1)
    looks.clear()
    without = fronto.Rectifier(fronto.RectifierOptions(lines=False), threads=threads)
    assert without(CAR).buttons
    assert not looks
