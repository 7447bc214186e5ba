from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fronto import InputError
from fronto.scales import View, first_look, first_looks, second_scale, tiles

exact = settings(derandomize=True, deadline=None, max_examples=40)
sides = st.integers(16, 1500)


def photo(width, height):
    return np.zeros((height, width, 3), np.uint8)


def boxes_in(width, height, n, seed, largest):
    rng = np.random.default_rng(seed)
    size = rng.uniform(1, largest, (n, 2))
    corner = rng.uniform(0, 1, (n, 2)) * [width, height] - size / 3
    boxes = np.concatenate([corner, corner + size], axis=1)
    edges = np.array([width, height, width, height]) - 0.5
    return np.clip(boxes, -0.5, edges)


def covered(views, width, height):
    seen = np.zeros((height, width), bool)
    for view in views:
        seen[view.y0 : view.y0 + view.height, view.x0 : view.x0 + view.width] = True
    return seen


def check_shape(view, width, height):
    assert 0 <= view.x0 < view.x0 + view.width <= width
    assert 0 <= view.y0 < view.y0 + view.height <= height
    rows, columns, channels = view.image.shape
    assert (rows % 16, columns % 16, channels) == (0, 0, 3)
    assert 0 <= rows - view.rows < 16
    assert 0 <= columns - view.columns < 16
    assert view.image.dtype == np.uint8
    assert not view.image.flags.writeable


class TestView:
    @exact
    @given(
        st.integers(0, 5000), st.integers(0, 5000), sides, sides, sides, sides, st.integers(0, 99)
    )
    def test_round_trip(self, x0, y0, width, height, columns, rows, seed):
        view = View(x0, y0, width, height, columns, rows, photo(16, 16))
        points = np.random.default_rng(seed).uniform(-50, 1500, (20, 2))
        np.testing.assert_allclose(view.to_network(view.to_photo(points)), points, atol=1e-9)
        np.testing.assert_allclose(view.to_photo(view.to_network(points)), points, atol=1e-9)

    def test_corners_fall_on_corners(self):
        view = View(30, 40, 100, 50, 250, 75, photo(256, 80))
        corners = [[-0.5, -0.5], [249.5, 74.5]]
        np.testing.assert_allclose(view.to_photo(corners), [[29.5, 39.5], [129.5, 89.5]])
        assert (view.sx, view.sy) == (2.5, 1.5)

    def test_takes_boxes_as_pairs_of_points(self):
        view = View(3, 4, 10, 10, 20, 20, photo(32, 32))
        boxes = np.arange(12.0).reshape(3, 2, 2)
        np.testing.assert_allclose(view.to_photo(boxes)[1, 0], view.to_photo(boxes[1, 0]))


class TestFirstLook:
    @exact
    @given(sides, sides)
    def test_keeps_aspect_and_area(self, width, height):
        view = first_look(photo(width, height))
        check_shape(view, width, height)
        assert (view.x0, view.y0, view.width, view.height) == (0, 0, width, height)
        scale = min((640 * 480 / (width * height)) ** 0.5, 4)
        assert abs(view.columns - scale * width) <= 0.5 + 1e-9
        assert abs(view.rows - scale * height) <= 0.5 + 1e-9

    @pytest.mark.parametrize(
        ("size", "expected"),
        [
            ((640, 480), (640, 480)),
            ((480, 640), (480, 640)),
            ((4000, 3000), (640, 480)),
            ((416, 416), (554, 554)),
            ((100, 100), (400, 400)),
            ((16, 16), (64, 64)),
        ],
    )
    def test_sizes(self, size, expected):
        view = first_look(photo(*size))
        assert (view.columns, view.rows) == expected

    def test_needs_no_copy_of_its_own_size(self):
        image = np.random.default_rng(0).integers(0, 256, (480, 640, 3), dtype=np.uint8)
        np.testing.assert_array_equal(first_look(image).image, image)

    def test_pads_with_the_edge(self):
        image = np.random.default_rng(0).integers(0, 256, (611, 487, 3), dtype=np.uint8)
        view = first_look(image)
        assert view.rows % 16
        assert view.columns % 16
        content = view.image[: view.rows, : view.columns]
        pad = [(0, view.image.shape[0] - view.rows), (0, view.image.shape[1] - view.columns)]
        np.testing.assert_array_equal(view.image, np.pad(content, [*pad, (0, 0)], mode="edge"))


class TestFirstLooks:
    @pytest.mark.parametrize("size", [(640, 480), (100, 300), (3000, 1000)])
    def test_one_will_do(self, size):
        (view,) = first_looks(photo(*size))
        assert (view.width, view.height) == size

    @exact
    @given(st.integers(16, 400), st.floats(3.01, 40), st.booleans(), st.integers(1, 12))
    def test_panorama(self, short, aspect, lying, at_most):
        long = int(short * aspect) + 1
        width, height = (long, short) if lying else (short, long)
        views = first_looks(photo(width, height), at_most=at_most)
        assert len(views) <= at_most
        assert covered(views, width, height).all()
        for view in views:
            check_shape(view, width, height)
            assert max(view.columns, view.rows) <= 960
        if at_most == 12 and aspect < 30:
            shorter = [min(view.columns, view.rows) for view in views]
            assert shorter == [min(320, 4 * short)] * len(views)

    def test_neighbours_overlap(self):
        first, *others = first_looks(photo(6000, 400))
        assert len(others) > 2
        for second in others:
            shared = first.x0 + first.width - second.x0
            assert shared * second.sx > 95
            first = second


class TestSecondScale:
    def test_small_buttons_of_a_large_photo(self):
        scale = second_scale(0.2, [50, 60, 70])
        assert scale == pytest.approx(0.2 * 44 / 12)

    def test_no_more_than_the_photo_has(self):
        assert second_scale(0.5, [20, 20, 300]) == 1.0

    @pytest.mark.parametrize(
        ("first", "buttons"),
        [(0.2, []), (0.2, [110, 120]), (1.33, [8, 9]), (0.9, [8, 9]), (0.5, [10, 100, 100])],
        ids=["none found", "large ones", "enlarged", "hardly more", "most are large"],
    )
    def test_not_worth_it(self, first, buttons):
        assert second_scale(first, buttons) is None

    @exact
    @given(st.floats(0.01, 4), st.lists(st.floats(0, 1e4), max_size=8))
    def test_always_larger(self, first, buttons):
        scale = second_scale(first, buttons)
        assert scale is None or first < scale <= 1


tile_options = {"size": 128, "overlap": 40, "margin": 8}


class TestTiles:
    @exact
    @given(sides, sides, st.floats(0.05, 4), st.integers(1, 12))
    def test_cover_the_photo(self, width, height, scale, at_most):
        views = tiles(photo(width, height), None, scale, at_most=at_most, **tile_options)
        assert 1 <= len(views) <= at_most
        assert covered(views, width, height).all()
        for view in views:
            check_shape(view, width, height)
            assert max(view.image.shape) <= 128
        assert len({view.image.shape for view in views}) == 1

    @exact
    @given(sides, sides, st.floats(0.3, 2), st.integers(1, 8), st.integers(0, 999))
    def test_cover_boxes_and_margin(self, width, height, scale, n, seed):
        boxes = boxes_in(width, height, n, seed, 300)
        views = tiles(photo(width, height), boxes, scale, at_most=10_000, **tile_options)
        seen = covered(views, width, height)
        margin = 8 / scale
        for x0, y0, x1, y1 in boxes + 0.5:
            rows = slice(max(int(y0 - margin), 0), int(np.ceil(y1 + margin - 1e-6)))
            columns = slice(max(int(x0 - margin), 0), int(np.ceil(x1 + margin - 1e-6)))
            assert seen[rows, columns].all()
        for view in views:
            check_shape(view, width, height)
            assert max(view.image.shape) <= 128
            assert view.sx == pytest.approx(scale, abs=0.5 / view.width)

    @exact
    @given(sides, sides, st.floats(0.3, 2), st.integers(1, 8), st.integers(0, 999))
    def test_small_boxes_are_whole(self, width, height, scale, n, seed):
        boxes = boxes_in(width, height, n, seed, 24 / scale)
        views = tiles(photo(width, height), boxes, scale, at_most=10_000, **tile_options)
        assert len(views) <= n
        margin = 8 / scale - 1e-6
        for box in boxes + 0.5:
            low = np.maximum(box[:2] - margin, 0)
            high = np.minimum(box[2:] + margin, [width, height])
            assert any(
                (low >= [v.x0, v.y0]).all() and (high <= [v.x0 + v.width, v.y0 + v.height]).all()
                for v in views
            )

    def test_look_only_where_the_boxes_are(self):
        boxes = [[100, 100, 140, 140], [3800, 2800, 3840, 2840]]
        views = tiles(photo(4000, 3000), boxes, 1.0)
        assert len(views) == 2
        assert sum(view.image[..., 0].size for view in views) <= 2 * 640 * 640

    def test_one_panel_takes_one_tile(self):
        boxes = [[999.5 + 50 * i, 999.5, 1039.5 + 50 * i, 1039.5] for i in range(8)]
        (view,) = tiles(photo(4000, 3000), boxes, 1.0)
        assert view.width == 390 + 2 * 96

    def test_too_many_are_taken_at_a_smaller_scale(self):
        few, many = (tiles(photo(4000, 3000), None, 1.0, at_most=n) for n in (12, 100))
        assert len(few) <= 12 < len(many)
        assert many[0].sx == pytest.approx(1.0)
        assert 0.4 < few[0].sx < 0.6
        assert covered(few, 4000, 3000).all()

    def test_no_boxes(self):
        image = photo(300, 200)
        assert tiles(image, [], 1.0) == []
        assert tiles(image, np.zeros((0, 4)), 1.0) == []
        assert tiles(image, [[400, 10, 420, 30]], 1.0) == []

    def test_boxes_are_cut_at_the_photo(self):
        (view,) = tiles(photo(300, 200), [[-1e9, -40, 1e9, 1e9]], 1.0)
        assert (view.x0, view.y0, view.width, view.height) == (0, 0, 300, 200)

    @pytest.mark.parametrize(
        "wrong",
        [
            {"scale": 0.0},
            {"scale": 5.0},
            {"scale": float("nan")},
            {"size": 100},
            {"size": 32},
            {"overlap": 400},
            {"overlap": -1},
            {"margin": -1},
            {"at_most": 0},
            {"boxes": [[1, 2, 3]]},
            {"boxes": [[1, 2, float("nan"), 3]]},
            {"boxes": [[10, 10, 5, 20]]},
        ],
        ids=str,
    )
    def test_wrong_arguments(self, wrong):
        options = {"boxes": None, "scale": 1.0} | wrong
        with pytest.raises(InputError) as caught:
            tiles(photo(300, 200), **options)
        assert next(iter(wrong)) in str(caught.value)


@pytest.mark.parametrize(
    "image",
    [
        np.zeros((50, 50), np.uint8),
        np.zeros((50, 50, 4), np.uint8),
        np.zeros((50, 50, 3)),
        np.zeros((0, 50, 3), np.uint8),
        None,
    ],
    ids=["grey", "alpha", "floats", "empty", "None"],
)
@pytest.mark.parametrize("look", [first_look, first_looks, lambda image: tiles(image, None, 1)])
def test_wrong_images(look, image):
    with pytest.raises(InputError, match="as_rgb"):
        look(image)


def stripes(length, coarse, seed):
    """Black and white stripes along a line, and where they change (pixel coordinates)."""
    widths = np.random.default_rng(seed).integers(coarse, 2 * coarse, length // coarse + 1)
    ends = np.cumsum(widths)
    ends = ends[ends < length - coarse]
    changes = np.zeros(length, int)
    changes[ends] = 1
    return (np.cumsum(changes) % 2 * 255).astype(np.uint8), ends - 0.5


def edges_found(line, around):
    """Positions of edges of a line of grey values, from the share of white between them."""
    middles = np.round((around[1:] + around[:-1]) / 2).astype(int)
    values = line.astype(float) / 255
    found = []
    for low, high in pairwise(middles):
        part = values[low : high + 1]
        first, last = part[0].round(), part[-1].round()
        assert first != last
        found.append(low - 0.5 + np.sum((part - last) / (first - last)))
    return np.array(found)


class TestNoShift:
    """What the photo shows at x, the network sees at to_network(x): to a tenth of a pixel."""

    def check(self, view, edges, axis, line):
        points = np.zeros((len(edges), 2))
        points[:, axis] = edges
        expected = view.to_network(points)[:, axis]
        inside = (expected > 8) & (expected < (view.columns, view.rows)[axis] - 8)
        expected = expected[inside]
        assert len(expected) >= 4
        found = edges_found(line(view), expected)
        np.testing.assert_allclose(found, expected[1:-1], atol=0.1)
        assert abs(np.mean(found - expected[1:-1])) < 0.05

    def checker(self, width, height, coarse, seed):
        across, x_edges = stripes(width, coarse, seed)
        down, y_edges = stripes(height, coarse, seed + 1)
        image = np.repeat((across[None, :] ^ down[:, None])[..., None], 3, axis=2)
        return image, x_edges, y_edges

    def check_both(self, view, x_edges, y_edges):
        # Along lines as far as possible from the checker's edges across them.
        def middle(edges, axis):
            points = np.zeros((len(edges), 2))
            points[:, axis] = edges
            places = view.to_network(points)[:, axis]
            places = places[(places > 0) & (places < (view.columns, view.rows)[axis] - 1)]
            return int(np.mean(places[:2]))

        row, column = middle(y_edges, 1), middle(x_edges, 0)
        self.check(view, x_edges, 0, lambda v: v.image[row, : v.columns, 0])
        self.check(view, y_edges, 1, lambda v: v.image[: v.rows, column, 0])

    @exact
    @given(st.integers(250, 1400), st.integers(250, 1400), st.integers(0, 99))
    def test_first_look(self, width, height, seed):
        scale = (640 * 480 / (width * height)) ** 0.5
        image, x_edges, y_edges = self.checker(width, height, int(np.ceil(10 / scale)), seed)
        self.check_both(first_look(image), x_edges, y_edges)

    @exact
    @given(
        st.integers(1000, 1500), st.integers(1000, 1500), st.floats(0.4, 1.9), st.integers(0, 99)
    )
    def test_tiles(self, width, height, scale, seed):
        image, x_edges, y_edges = self.checker(width, height, int(np.ceil(10 / scale)), seed)
        views = tiles(image, None, scale, size=256, overlap=32, at_most=1000)
        assert len(views) > 3
        for view in views[:: len(views) // 3]:
            self.check_both(view, x_edges, y_edges)

    def test_panorama(self):
        image, x_edges, y_edges = self.checker(4003, 409, 24, 5)
        for view in first_looks(image):
            self.check_both(view, x_edges, y_edges)

    def test_shrinking_averages(self):
        """No pixel of the photo is skipped: single bright ones still count."""
        image = np.zeros((1440, 1920, 3), np.uint8)
        image[::3, ::3] = 255
        assert (np.abs(first_look(image).image.astype(int) - 255 / 9) <= 1).all()
