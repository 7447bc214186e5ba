"""Patches of finds, and back: what is drawn in a patch is at its place in the photo."""

from __future__ import annotations

import tracemalloc

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fronto.finds import Find
from fronto.grouping import Instance
from fronto.maskhead import REACH, SIDE, Region, describe, mask_in_photo, region
from fronto.scales import View, first_look
from fronto.shapes import FloatArray

WIDTH, HEIGHT = 110, 90
Box = tuple[float, float, float, float]


def blank(width: int = WIDTH, height: int = HEIGHT) -> npt.NDArray[np.uint8]:
    return np.zeros((height, width, 3), np.uint8)


def find(box: Box, view: View, mask: npt.NDArray[np.float32] | None = None) -> Find:
    """A button; its mask is all of the picture, if none is given."""
    u0, v0, u1, v1 = view.to_network(np.reshape(box, (2, 2))).ravel().tolist()
    instance = Instance(False, 0.9, (u0, v0, u1, v1), np.full(11, 1 / 11))
    if mask is None:
        mask = np.ones(view.image.shape[:2], np.float32)
    return Find(instance, np.array(box, float), view, mask, 0.9, "up", False)


def around(x: float, y: float, width: float, height: float) -> Box:
    return (x - width / 2, y - height / 2, x + width / 2, y + height / 2)


def centroid(weights: npt.NDArray[np.floating]) -> FloatArray:
    rows, columns = np.indices(weights.shape)
    return np.array([(columns * weights).sum(), (rows * weights).sum()]) / weights.sum()


BOXES = st.builds(
    around,
    st.floats(-400, 500),
    st.floats(-400, 500),
    st.floats(0.5, 300),
    st.floats(0.5, 300),
)


class TestRegion:
    @settings(derandomize=True, deadline=None, max_examples=300)
    @given(BOXES)
    def test_it_is_around_the_box(self, box: Box) -> None:
        found = region(box)
        size = REACH * np.array([box[2] - box[0], box[3] - box[1]])
        got = np.array([found.width, found.height])
        assert (np.abs(got - np.maximum(size, 1)) <= 0.5 + 1e-9).all()
        low = np.array([found.x0, found.y0]) - 0.5
        middle = np.array([box[0] + box[2], box[1] + box[3]]) / 2
        assert (np.abs(low + got / 2 - middle) <= 0.5 + 1e-9).all()

    def test_by_hand(self) -> None:
        # 20 x 10 pixels around (100, 50): 32 x 16 around it, from the edge 83.5 of pixel 84 on.
        assert region((90, 45, 110, 55)) == Region(84, 42, 32, 16)
        assert region((89.5, 44.5, 109.5, 54.5)) == Region(84, 42, 32, 16)

    def test_places_are_the_middles_of_the_patchs_pixels(self) -> None:
        x, y = Region(10, -4, 96, 48).places(SIDE)
        np.testing.assert_allclose(x, 10.5 + 2 * np.arange(SIDE))
        np.testing.assert_allclose(y, -4 + np.arange(SIDE))


class TestDescribe:
    @settings(derandomize=True, deadline=None, max_examples=80)
    @given(st.lists(BOXES, min_size=1, max_size=3))
    def test_finds_anywhere_show_the_photo_carried_on(self, boxes: list[Box]) -> None:
        photo = blank()
        photo[..., 0] = 2 * np.arange(WIDTH)
        photo[..., 1] = 2 * np.arange(HEIGHT)[:, None]
        view = first_look(photo)
        patches = describe(photo, [find(box, view) for box in boxes])
        n = len(boxes)
        assert patches.photo.shape == (n, SIDE, SIDE, 3)
        assert patches.rough.shape == (n, SIDE, SIDE)
        assert patches.photo.dtype == patches.rough.dtype == np.uint8
        assert patches.regions == tuple(region(box) for box in boxes)
        for shown, part in zip(patches.photo.astype(int), patches.regions, strict=True):
            x, y = part.places(SIDE)
            # Within half a pixel of whichever is larger, the patch's or the photo's; 2 levels each.
            for got, at, size, wide in (
                (shown[..., 0], x, WIDTH, part.width),
                (shown[..., 1].T, y, HEIGHT, part.height),
            ):
                expected = 2 * np.clip(at, 0, size - 1)
                assert np.abs(got - expected).max() <= max(1, wide / SIDE) + 0.6
            assert not shown[..., 2].any()

    @pytest.mark.parametrize("size", [8, 21, 29, 30, 31, 37.5, 60])
    @pytest.mark.parametrize("off", [0.0, 0.3, 0.5])
    def test_no_size_shifts_the_photo(self, size: float, off: float) -> None:
        """Enlarged, as it is, or made smaller: half a pixel would be a level here."""
        photo = blank()
        photo[..., 0] = 2 * np.arange(WIDTH)
        photo[..., 1] = 2 * np.arange(HEIGHT)[:, None]
        box = around(52 + off, 47 - off, size, 0.9 * size)
        patches = describe(photo, [find(box, first_look(photo))])
        x, y = patches.regions[0].places(SIDE)
        inner = slice(6, -6)  # enlarged, the outermost pixels are carried on
        for got, at in ((patches.photo[0, ..., 0], x), (patches.photo[0, ..., 1].T, y)):
            error = (got - 2 * at)[:, inner]
            assert np.abs(error).max() < 0.9  # OpenCV rounds its weights, and then the levels
            assert abs(error.mean()) < 0.25

    @pytest.mark.parametrize("size", [(160, 120), (333, 517), (1201, 900), (97, 60)])
    def test_no_size_shifts_the_rough_mask(self, size: tuple[int, int]) -> None:
        width, height = size
        photo = blank(width, height)
        view = first_look(photo)
        rows, columns = np.indices(view.image.shape[:2]).astype(np.float32)
        most = 1.05 * max(view.columns, view.rows)
        box = around(0.45 * width, 0.55 * height, 0.3 * width, 0.2 * height)
        x, y = region(box).places(SIDE)
        u, v = view.to_network(np.stack([x, y], axis=1)).T
        (across,) = describe(photo, [find(box, view, columns / np.float32(most))]).rough
        (down,) = describe(photo, [find(box, view, rows / np.float32(most))]).rough
        # A byte for each level, and OpenCV's 32nds of a pixel.
        tolerance = 0.51 + 255 / most / 32
        inside = (np.abs(x - 0.45 * width) < 0.19 * width) & (
            np.abs(y - 0.55 * height) < 0.12 * height
        )
        assert inside.sum() > 30
        np.testing.assert_allclose(
            across[inside][:, inside],
            np.broadcast_to(255 * u / most, (SIDE, SIDE))[inside][:, inside],
            atol=tolerance,
        )
        np.testing.assert_allclose(
            down.T[inside][:, inside],
            np.broadcast_to(255 * v / most, (SIDE, SIDE))[inside][:, inside],
            atol=tolerance,
        )

    def test_the_rough_mask_ends_where_a_neighbours_begins(self) -> None:
        photo = blank()
        view = first_look(photo)
        # Half sides of 10 and of 15, their middles 30 apart: the border is 12 from the first's.
        boxes = [around(30, 40, 20, 20), around(60, 40, 30, 30)]
        patches = describe(photo, [find(box, view) for box in boxes])
        for rough, part, low, high in zip(
            patches.rough, patches.regions, (-np.inf, 42), (42, np.inf), strict=True
        ):
            x, y = part.places(SIDE)
            row = rough[np.argmin(np.abs(y - 40))]
            sure = np.abs(x - 42) > 0.6
            reached = np.abs(x - (30 if low < 0 else 60)) <= (13 if low < 0 else 19.5)
            np.testing.assert_array_equal(row[sure], 255 * ((x > low) & (x < high) & reached)[sure])

    def test_alone_nothing_is_cut_from_the_rough_mask_of_a_box(self) -> None:
        photo = blank()
        (rough,) = describe(photo, [find(around(50, 40, 30, 20), first_look(photo))]).rough
        reached = 1.3 / REACH * SIDE / 2
        at = np.abs(np.arange(SIDE) - (SIDE - 1) / 2)
        inside, outside = at < reached - 0.6, at > reached + 0.6
        assert (rough[np.ix_(inside, inside)] == 255).all()
        assert not rough[outside].any()
        assert not rough[:, outside].any()

    def test_other_regions_may_be_shown(self) -> None:
        photo = blank()
        photo[40:50, 50:60] = 255
        view = first_look(photo)
        finds = [find(around(55, 45, 10, 10), view), find(around(20, 20, 10, 10), view)]
        regions = [Region(48, 40, 12, 10), Region(2, 2, 48, 48)]
        patches = describe(photo, finds, regions)
        assert patches.regions == tuple(regions)
        # The square is pixels 50 to 59, of 48 to 59.
        bright = patches.photo[0, ..., 0].mean(axis=0)
        assert bright[:6].max() < 20
        assert bright[12:].min() > 235
        assert not patches.photo[1].any()


def spot(x: float, y: float, sigma: float) -> npt.NDArray[np.float32]:
    """A round spot in a patch."""
    rows, columns = np.indices((SIDE, SIDE))
    away = ((columns - x) ** 2 + (rows - y) ** 2) / sigma**2
    return np.asarray(np.exp(-away / 2), np.float32)


class TestMaskInPhoto:
    @settings(derandomize=True, deadline=None, max_examples=150)
    @given(
        st.integers(10, 200),
        st.integers(10, 200),
        st.integers(0, 100),
        st.integers(0, 100),
        st.floats(19, 28),
        st.floats(19, 28),
    )
    def test_a_mask_is_at_its_place(
        self, width: int, height: int, x0: int, y0: int, x: float, y: float
    ) -> None:
        part = Region(x0, y0, width, height)
        found, origin = mask_in_photo(spot(x, y, 5), part, 400, 400)
        assert found.dtype == np.float32
        assert (origin, found.shape) == ((x0, y0), (height, width))
        scale = np.array([width, height]) / SIDE
        expected = [x0 - 0.5, y0 - 0.5] + scale * (np.array([x, y]) + 0.5)
        assert np.abs(centroid(found) + origin - expected).max() < 0.03 * max(1, scale.max())
        area = scale.prod() * 2 * np.pi * 5**2
        assert found.sum() == pytest.approx(area, rel=0.02)

    @settings(derandomize=True, deadline=None, max_examples=150)
    @given(st.integers(-60, 130), st.integers(-60, 110), st.integers(1, 150), st.integers(1, 150))
    def test_only_its_part_in_the_photo_is_kept(
        self, x0: int, y0: int, width: int, height: int
    ) -> None:
        mask = np.random.default_rng(0).random((SIDE, SIDE), np.float32)
        shifted = Region(x0 + 200, y0 + 200, width, height)
        whole, _ = mask_in_photo(mask, shifted, 1000, 1000)
        found, (x, y) = mask_in_photo(mask, Region(x0, y0, width, height), WIDTH, HEIGHT)
        canvas = np.full((600, 600), np.nan, np.float32)
        canvas[y0 + 200 : y0 + 200 + height, x0 + 200 : x0 + 200 + width] = whole
        seen = canvas[200 : 200 + HEIGHT, 200 : 200 + WIDTH]
        assert found.size == np.isfinite(seen).sum()
        if found.size:
            assert min(x, y) >= 0
            np.testing.assert_array_equal(
                seen[y : y + found.shape[0], x : x + found.shape[1]], found
            )

    @settings(derandomize=True, deadline=None, max_examples=100)
    @given(st.floats(40, 70), st.floats(35, 55), st.floats(8, 40), st.floats(8, 40))
    def test_there_and_back(self, x: float, y: float, width: float, height: float) -> None:
        """What is bright in the photo is at the same place in a mask of what is bright."""
        rows, columns = np.indices((HEIGHT, WIDTH))
        away = ((columns - x) / width) ** 2 + ((rows - y) / height) ** 2
        photo = blank()
        photo[..., 0] = np.rint(255 * np.exp(-away / 0.08))
        box = around(x + 0.4, y - 0.3, 1.25 * width, 1.25 * height)
        patches = describe(photo, [find(box, first_look(photo))])
        (part,) = patches.regions
        bright = patches.photo[0, ..., 0] / np.float32(255)
        found, origin = mask_in_photo(bright, part, WIDTH, HEIGHT)
        there = photo[
            origin[1] : origin[1] + found.shape[0], origin[0] : origin[0] + found.shape[1], 0
        ]
        assert np.abs(centroid(found) - centroid(there / 255)).max() < 0.1


def test_a_box_far_larger_than_the_photo_costs_no_more_than_the_photo() -> None:
    tracemalloc.start()
    rgb = np.full((300, 400, 3), 90, np.uint8)
    box = (-60_000.0, -60_000.0, 60_000.0, 60_000.0)
    patches = describe(rgb, [find(box, first_look(rgb))])
    assert patches.photo.shape == (1, SIDE, SIDE, 3)
    assert (patches.photo == 90).all()
    part, origin = mask_in_photo(np.ones((SIDE, SIDE), np.float32), patches.regions[0], 400, 300)
    assert (part.shape, origin) == ((300, 400), (0, 0))
    assert (part > 0.99).all()
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 50e6
