"""Patches to learn masks from: their true masks, how they are collected, and their files."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Collection, Iterator
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from test_segmentation import Oracle

torch = pytest.importorskip("torch")

from fronto.datasets.records import LabeledImage, LabeledObject, polygon_box
from fronto.engine import Engine
from fronto.errors import InputError
from fronto.finds import Find
from fronto.grouping import Instance
from fronto.maskhead import FORMS, SIDE, Region
from fronto.scales import first_look
from fronto.shapes import FloatArray
from fronto.synth.photo.view import clipped
from fronto.train.masks.collect import (
    MOST,
    PILLS,
    SEEN,
    SHIFT,
    ZOOM,
    Shown,
    _matches,
    _off,
    collect,
    labelled,
    rendered,
    true_mask,
)
from fronto.train.masks.pool import Pool
from fronto.train.pools import joined, read_pool, write_pool
from onnxfiles import finder

PART = Region(-7, 12, 63, 31)


def area_and_centroid(polygon: FloatArray) -> tuple[float, FloatArray]:
    x, y = polygon.T
    x2, y2 = np.roll(polygon, -1, axis=0).T
    cross = x * y2 - x2 * y
    area = cross.sum() / 2
    return area, np.array([((x + x2) * cross).sum(), ((y + y2) * cross).sum()]) / (6 * area)


def in_photo(points: FloatArray, part: Region) -> FloatArray:
    """From a patch's pixels, counted from its corner, to the photo's."""
    scale = np.array([part.width, part.height]) / SIDE
    return np.asarray(points * scale + [part.x0 - 0.5, part.y0 - 0.5])


def regular(corners: int, radius: float, turn: float, at: FloatArray) -> FloatArray:
    t = turn + 2 * np.pi * np.arange(corners) / corners
    return np.asarray(at + radius * np.stack([np.cos(t), np.sin(t)], axis=1))


def agree(mask: npt.NDArray[np.uint8], polygon: FloatArray) -> None:
    """A true mask and the polygon in the patch's pixels: 1 % in area, 0.05 pixels in place."""
    assert mask.shape == (SIDE, SIDE)
    assert mask.dtype == np.uint8
    area, middle = area_and_centroid(polygon)
    rows, columns = np.indices(mask.shape) + 0.5
    shares = mask / 255
    assert shares.sum() == pytest.approx(abs(area), rel=0.01)
    found = np.array([(columns * shares).sum(), (rows * shares).sum()]) / shares.sum()
    assert np.abs(found - middle).max() < 0.05


class TestTrueMask:
    @settings(derandomize=True, deadline=None, max_examples=60)
    @given(
        st.builds(
            Region,
            st.integers(-90, 900),
            st.integers(-90, 900),
            st.integers(5, 300),
            st.integers(5, 300),
        ),
        st.sampled_from([4, 5, 8, 48]),
        st.floats(16, 21),
        st.floats(0, 7),
        st.floats(-2, 2),
    )
    def test_it_is_exact(
        self, part: Region, corners: int, radius: float, turn: float, off: float
    ) -> None:
        polygon = regular(corners, radius, turn, np.array([24 + off, 24 - off / 2]))
        for points in (polygon, polygon[::-1]):
            agree(true_mask(in_photo(points, part), part), polygon)

    @settings(derandomize=True, deadline=None, max_examples=40)
    @given(st.floats(-4, 52), st.floats(-4, 52), st.floats(0, 7), st.integers(3, 48))
    def test_of_what_the_patch_cuts(self, x: float, y: float, turn: float, corners: int) -> None:
        polygon = regular(corners, 38, turn, np.array([x, y]))
        shown = clipped(polygon, np.array([(1, 0, 0), (-1, 0, SIDE), (0, 1, 0), (0, -1, SIDE)]))
        if area_and_centroid(shown)[0] > 900:
            agree(true_mask(in_photo(polygon, PART), PART), shown)

    def test_whole_and_half_pixels(self) -> None:
        square = np.array([(10, 20), (30.5, 20), (30.5, 40), (10, 40)])
        mask = true_mask(in_photo(square, PART), PART).astype(int)
        assert (mask[20:40, 10:30] == 255).all()
        half = mask[20:40, 30]
        assert (np.abs(half - 127.5) <= 255 / 16).all()
        mask[20:40, 10:31] = 0
        assert mask.max() <= 16  # OpenCV draws a polygon's own line, too

    @pytest.mark.parametrize("away", [60, 500, 1e5, 1e9])
    @pytest.mark.parametrize("way", [(1, 0), (-1, 0), (0, 1), (0, -1), (1, -1)])
    def test_far_away_there_is_nothing(self, away: float, way: tuple[int, int]) -> None:
        polygon = regular(6, 20, 0.1, 24 + away * np.array(way))
        assert not true_mask(in_photo(polygon, PART), PART).any()

    def test_all_around_there_is_nothing_else(self) -> None:
        polygon = regular(4, 1e6, np.pi / 4, np.array([24.0, 24.0]))
        assert (true_mask(in_photo(polygon, PART), PART) == 255).all()


def pool(n: int, seed: int = 0) -> Pool:
    rng = np.random.default_rng(seed)
    shapes = ((n, SIDE, SIDE, 3), (n, SIDE, SIDE), (n, SIDE, SIDE))
    parts = [rng.integers(0, 256, shape, dtype=np.uint8) for shape in shapes]
    return Pool(*parts, np.where(rng.random(n) < 0.3, 255, rng.integers(0, 3, n)).astype(np.uint8))


def equal(first: Pool, second: Pool) -> None:
    for name in (part.name for part in fields(Pool)):
        ours, theirs = getattr(first, name), getattr(second, name)
        assert ours.dtype == theirs.dtype == np.uint8
        np.testing.assert_array_equal(ours, theirs, err_msg=name)


class TestPool:
    @pytest.mark.parametrize("n", [1, 7])
    def test_round_trip(self, tmp_path: Path, n: int) -> None:
        path = tmp_path / "patches-000-3.npz"
        write_pool(path, pool(n))
        assert [f.name for f in tmp_path.iterdir()] == [path.name]
        assert len(read_pool(path, Pool)) == n
        equal(read_pool(path, Pool), pool(n))
        write_pool(path, pool(n, 1))  # another one in its place
        equal(read_pool(path, Pool), pool(n, 1))

    def test_joined(self) -> None:
        whole = pool(6)
        parts = [
            Pool(*(getattr(whole, part.name)[rows] for part in fields(Pool)))
            for rows in (slice(0, 1), slice(1, 4), slice(4, 6))
        ]
        equal(joined(parts), whole)

    @pytest.mark.parametrize(
        ("name", "change"),
        [
            ("photo", lambda a: a[:, :40]),
            ("photo", lambda a: a.astype(np.float32)),
            ("rough", lambda a: a[:-1]),
            ("rough", lambda a: a[..., None]),
            ("masks", lambda a: a > 127),
            ("masks", lambda a: a[:, :, 1:]),
            ("forms", lambda a: a[:-1]),
            ("forms", lambda a: a.astype(np.int64)),
        ],
    )
    def test_wrong_shapes_and_types(self, name: str, change: Callable[[Any], Any]) -> None:
        given = pool(3)
        with pytest.raises(InputError, match=f"^{name}:"):
            replace(given, **{name: change(getattr(given, name))})

    @pytest.mark.parametrize(
        "damage", ["gone", "empty", "text", "array", "cut", "part", "counts", "floats", "objects"]
    )
    def test_a_damaged_file(self, tmp_path: Path, damage: str) -> None:
        path = tmp_path / "patches-000-3.npz"
        write_pool(path, pool(3))
        content = path.read_bytes()
        whole = {part.name: getattr(pool(3), part.name) for part in fields(Pool)}
        if damage == "gone":
            path.unlink()
        elif damage == "array":
            with path.open("wb") as file:
                np.save(file, np.zeros(3))
        elif damage == "part":
            np.savez(path, photo=whole["photo"])
        elif damage == "counts":
            np.savez(path, **whole | {"forms": whole["forms"][:2]})
        elif damage == "floats":
            np.savez(path, **whole | {"masks": whole["masks"] / 255})
        elif damage == "objects":
            np.savez(path, **whole | {"forms": np.array([{}, {}, {}])})
        else:
            broken = {"empty": b"", "text": b"no arrays", "cut": content[: len(content) // 2]}
            path.write_bytes(broken[damage])
        with pytest.raises(InputError, match=r"patches-000-3\.npz") as caught:
            read_pool(path, Pool)
        assert "\n" not in str(caught.value)


def quad(x: float, y: float, width: float, height: float, turn: float = 0.0) -> FloatArray:
    corners = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * [width / 2, height / 2]
    c, s = np.cos(turn), np.sin(turn)
    return np.asarray(corners @ [[c, s], [-s, c]] + [x, y])


def paint(image: npt.NDArray[np.uint8], polygon: FloatArray) -> None:
    """Fill a polygon with 220: each pixel as far as it is covered, of 30."""
    x, y = np.floor(polygon.min(axis=0)).astype(int) - 2
    fine = np.zeros((16 * 96, 16 * 96), np.uint8)
    points = np.rint(((polygon - [x, y] + 0.5) * 16 - 0.5) * 256).astype(np.int32)
    cv2.fillPoly(fine, [points], (255,), shift=8)
    cover = cv2.resize(fine, (96, 96), interpolation=cv2.INTER_AREA)[..., None] / 255
    part = image[y : y + 96, x : x + 96]
    part[:] = np.rint(part + cover * (220.0 - part))


class Keys:
    """Bright keys and discs on a dark panel, somewhere; `change` may tell lies about them."""

    def __init__(self, change: Callable[[Shown], Shown] = lambda shown: shown) -> None:
        self.change = change

    def __call__(self, rng: np.random.Generator) -> Shown:
        image = np.full((480, 640, 3), 30, np.uint8)
        outlines, forms = [], []
        for x, y in itertools.product((140, 320, 500), (120, 260, 400)):
            w, h = rng.uniform(40, 80, 2)
            at = np.array([x, y]) + rng.uniform(-10, 10, 2)
            form = int(rng.integers(2))
            polygon = regular(64, w / 2, 0, at) if form else quad(*at, w, h, rng.uniform(-0.1, 0.1))
            paint(image, polygon)
            outlines.append(polygon)
            forms.append(form)
        n = len(outlines)
        return self.change(Shown(image, outlines, [False] * n, forms, [True] * n))


def some(engine: object, sources: list, count: int, seed: int = 3) -> list[Pool]:
    found: Iterator[Pool] = collect(engine, sources, seed=seed)  # type: ignore[arg-type]
    return list(itertools.islice(found, count))


class Named(Oracle):
    """As engines have it."""

    path = Path("some") / "network.onnx"


@pytest.fixture
def often_in_vain(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("fronto.train.shown.MOST_IN_VAIN", 3)


class TestCollect:
    def test_photo_rough_and_true_mask_fit_together(self) -> None:
        found = joined(some(Oracle(), [(Keys(), 1.0)], 4))
        assert len(found) == 4 * 9
        true = found.masks > 127
        for seen in (found.photo[..., 0] > 125, found.rough > 127):
            shared = (seen & true).sum(axis=(1, 2)) / (seen | true).sum(axis=(1, 2))
            assert np.median(shared) > 0.97
            assert shared.min() > 0.93

        # A disc fills less of its box than a key does.
        def box_share(mask: npt.NDArray[np.bool_]) -> float:
            rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
            return float(mask.sum() / (np.ptp(rows) + 1) / (np.ptp(columns) + 1))

        shares = np.array([box_share(mask) for mask in true])
        assert set(found.forms.tolist()) == {FORMS.index("quad"), FORMS.index("ellipse")}
        assert shares[found.forms == FORMS.index("ellipse")].max() < 0.83
        assert shares[found.forms == FORMS.index("quad")].min() > 0.83

    def test_patches_are_not_all_alike(self) -> None:
        """Boxes err, and so do those of patches."""
        found = joined(some(Oracle(), [(Keys(), 1.0)], 4))
        rows, columns = np.indices((SIDE, SIDE))
        shares = found.masks / 255
        total = shares.sum(axis=(1, 2))
        middles = np.stack([(at * shares).sum(axis=(1, 2)) / total for at in (columns, rows)])
        assert (middles.std(axis=1) > 0.6).all()
        assert np.abs(middles - (SIDE - 1) / 2).max() < 0.2 * SIDE

    def test_a_seed_gives_the_same_again(self) -> None:
        sources = [(Keys(), 0.5), (Keys(), 0.5)]
        first, again = (joined(some(Oracle(), sources, 2)) for _ in range(2))
        equal(first, again)
        other = joined(some(Oracle(), sources, 2, seed=4))
        assert not np.array_equal(first.photo[:5], other.photo[:5])

    def test_sources_have_their_shares(self) -> None:
        def marked(form: int) -> Keys:
            return Keys(lambda shown: replace(shown, forms=[form] * 9))

        found = some(Oracle(), [(marked(0), 1.0), (marked(1), 3.0), (marked(2), 0.0)], 40)
        counts = np.bincount([p.forms[0] for p in found], minlength=3)
        assert counts[2] == 0
        assert 4 <= counts[0] <= 16

    @pytest.mark.parametrize(
        ("change", "left"),
        [
            (lambda s: replace(s, learned=[True, False] + [True] * 7), 8),
            (lambda s: replace(s, plates=[True, True] + [False] * 7), 7),
            (lambda s: replace(s, outlines=[s.outlines[0] + 40.0, *s.outlines[1:]]), 8),
            (lambda s: replace(s, outlines=[s.outlines[0] + 3.0, *s.outlines[1:]]), 9),
        ],
        ids=["not seen", "plates", "elsewhere", "nearly"],
    )
    def test_what_is_learned_from(self, change: Callable[[Shown], Shown], left: int) -> None:
        assert {len(p) for p in some(Oracle(), [(Keys(change), 1.0)], 3)} == {left}

    def test_neighbours_are_cut_out_even_if_nothing_is_learned_from_them(self) -> None:
        """All finds of a picture are told of, and then some are taken."""
        alone = Keys(lambda s: replace(s, learned=[False] * 8 + [True]))
        whole, one = (joined(some(Oracle(), [(k, 1.0)], 1)) for k in (Keys(), alone))
        assert len(one) == 1
        (same,) = np.flatnonzero((whole.photo == one.photo).all(axis=(1, 2, 3)))
        np.testing.assert_array_equal(whole.rough[same], one.rough[0])
        np.testing.assert_array_equal(whole.masks[same], one.masks[0])

    @pytest.mark.usefixtures("often_in_vain")
    @pytest.mark.parametrize(
        "change",
        [
            lambda s: replace(s, image=np.zeros_like(s.image)),
            lambda s: replace(s, learned=[False] * 9),
            lambda s: replace(s, outlines=[], plates=[], forms=[], learned=[]),
        ],
        ids=["dark", "not seen", "no outlines"],
    )
    def test_a_network_that_finds_nothing(self, change: Callable[[Shown], Shown]) -> None:
        with pytest.raises(InputError, match=r"network\.onnx.* 3 pictures"):
            some(Named(), [(Keys(change), 1.0)], 1)

    @pytest.mark.usefixtures("often_in_vain")
    def test_now_and_then_it_may_find_nothing(self) -> None:
        turns = itertools.cycle([True, True, False])
        keys = Keys(lambda s: replace(s, learned=[False] * 9) if next(turns) else s)
        assert len(some(Named(), [(keys, 1.0)], 4)) == 4

    def test_from_renders_by_a_file(self, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr("fronto.train.masks.collect.SIZES", ((160, 120), (120, 160)))
        path = tmp_path / "network.onnx"
        path.write_bytes(finder(5))
        engine = Engine(path, threads=1)
        found, again = (some(engine, [(rendered(0.5, 0.5), 1.0)], 3) for _ in range(2))
        for ours, theirs in zip(found, again, strict=True):
            equal(ours, theirs)
        assert set(joined(found).forms.tolist()) <= set(range(len(FORMS)))
        # Each find is half of what it is taken for, or more, where none is a button and its plate.
        monkeypatch.setattr("fronto.train.masks.collect.UNITS", 0.0)
        whole = joined(some(engine, [(rendered(0.5, 0.5), 1.0)], 3))
        assert set(whole.forms.tolist()) <= set(range(len(FORMS)))
        share = (whole.masks > 127).mean(axis=(1, 2))
        assert (share > 0.1).all()
        assert (share < 0.9).all()


def find(box: tuple[float, float, float, float], *, plate: bool = False) -> Find:
    view = first_look(np.zeros((120, 160, 3), np.uint8))
    u0, v0, u1, v1 = view.to_network(np.reshape(box, (2, 2))).ravel().tolist()
    instance = Instance(plate, 0.9, (u0, v0, u1, v1), np.full(11, 1 / 11))
    mask = np.ones(view.image.shape[:2], np.float32)
    return Find(instance, np.array(box, float), view, mask, 0.9, "plate" if plate else "up", False)


def matches(
    finds: list[Find], outlines: tuple[FloatArray, ...], plates: Collection[int] = ()
) -> list[int]:
    n = len(outlines)
    image = np.zeros((120, 160, 3), np.uint8)
    kinds = [k in plates for k in range(n)]
    return [int(k) for k in _matches(finds, Shown(image, outlines, kinds, [0] * n, [True] * n))]


class TestMatches:
    BUTTON = quad(50, 50, 20, 20)

    def match(
        self,
        box: tuple[float, float, float, float],
        *outlines: FloatArray,
        plate: bool = False,
        plates: Collection[int] = (),
    ) -> int:
        (found,) = matches([find(box, plate=plate)], outlines or (self.BUTTON,), plates)
        return found

    def test_what_a_box_overlaps_most(self) -> None:
        other = quad(72, 50, 20, 20)
        boxes = ((40, 40, 60, 60), (62, 40, 82, 60), (51, 40, 71, 60))
        # The third lies half on either: 11 of 29, and 9 of 31.
        assert matches([find(b) for b in boxes], (self.BUTTON, other)) == [0, 1, -1]

    def test_a_half_is_enough(self) -> None:
        # Moved by d of 20 pixels: (20 - d) / (20 + d).
        assert self.match((46, 40, 66, 60)) == 0
        assert self.match((47, 40, 67, 60)) == -1

    @pytest.mark.parametrize("kind", [False, True])
    def test_the_one_thing_that_a_large_box_is_around(self, kind: bool) -> None:
        def match(*box: float, own: bool = True) -> int:
            return self.match(box, plate=kind, plates={0} if kind == own else set())

        assert match(30, 30, 70, 70) == 0  # a quarter of it
        assert match(20, 20, 80, 80) == -1  # a ninth
        assert match(41, 30, 81, 70) == 0  # 0.95 of it inside
        assert match(43, 30, 83, 70) == -1  # 0.85
        assert match(30, 30, 70, 70, own=False) == -1  # of the other kind

    def test_unless_there_is_another_one(self) -> None:
        box = (30.0, 30.0, 70.0, 70.0)
        assert self.match(box, self.BUTTON, quad(68, 50, 10, 10)) == -1  # 0.7 of it
        assert self.match(box, self.BUTTON, quad(73, 50, 10, 10)) == 0  # 0.2
        assert self.match(box, quad(73, 50, 10, 10), self.BUTTON) == 1
        # A box that is one's own has it, whatever else is there.
        assert self.match((40, 40, 60, 60), self.BUTTON, quad(50, 50, 6, 6)) == 0

    def test_what_is_of_the_other_kind_is_not_another_one(self) -> None:
        box, label = (30.0, 30.0, 70.0, 70.0), quad(50, 66, 40, 8)
        assert self.match(box, self.BUTTON, label) == -1
        assert self.match(box, self.BUTTON, label, plates={1}) == 0
        assert self.match(box, label, self.BUTTON, plates={0}) == 1
        assert self.match(box, label, self.BUTTON, plate=True, plates={1}) == 1
        # Nor do many labels make one button two; two buttons are two beside a label.
        small = quad(35, 50, 8, 8)
        assert self.match(box, self.BUTTON, label, small, plates={1, 2}) == 0
        assert self.match(box, self.BUTTON, label, small, plates={1}) == -1

    def test_the_one_of_its_kind_beside_a_larger_one_of_the_other(self) -> None:
        box = (20.0, 40.0, 80.0, 60.0)
        button, label = quad(30, 50, 20, 20), quad(60, 50, 40, 20)  # a third, and two
        assert self.match(box, label, button) == 0
        assert self.match(box, label, button, plates={0}) == 1
        assert self.match(box, label, button, plate=True, plates={1}) == 1
        assert self.match(box, label, button, plate=True, plates={0}) == 0
        # What is no match for it stays with what it overlaps most.
        half = quad(20, 50, 20, 20)
        tiny = quad(30, 50, 11, 11)  # a tenth
        for others in ((half,), (tiny,), (button, quad(60, 50, 10, 10)), ()):
            assert self.match(box, label, *others, plates={0}) == 0


@settings(derandomize=True, deadline=None, max_examples=100)
@given(st.integers(0, 2**31), st.floats(2, 300), st.floats(2, 300))
def test_boxes_are_off_by_a_little(seed: int, width: float, height: float) -> None:
    box = np.array([10.0, 20.0, 10 + width, 20 + height])
    found = _off(box, np.random.default_rng(seed))
    sides = np.array([width, height])
    assert (np.abs(np.log((found[2:] - found[:2]) / sides)) <= ZOOM * MOST + 1e-9).all()
    moved = ((found[:2] + found[2:]) - (box[:2] + box[2:])) / 2 / sides
    assert (np.abs(moved) <= SHIFT * MOST + 1e-9).all()
    assert not np.array_equal(found, box)


class TestRendered:
    @pytest.mark.parametrize(("twins", "relief"), [(0.0, 1.0), (1.0, 0.0)])
    def test_shares(self, twins: float, relief: float, monkeypatch: pytest.MonkeyPatch) -> None:
        import fronto.synth.photo as photo

        asked = []
        plain = photo.render_photo

        def noted(rng, *size, **options):
            asked.append(options)
            return plain(rng, *size, **options)

        monkeypatch.setattr("fronto.train.masks.collect.SIZES", ((64, 48),))
        monkeypatch.setattr("fronto.synth.photo.render_photo", noted)
        draw = rendered(twins, relief)
        for seed in range(4):
            draw(np.random.default_rng(seed))
        asked_for = {"twins": twins == 1, "relief": relief == 1, "pills": PILLS}
        assert asked == [asked_for] * 4

    def test_what_is_known(self, monkeypatch: pytest.MonkeyPatch) -> None:
        import fronto.synth.photo as photo

        drawn = []
        plain = photo.render_photo

        def kept(*given, **options):
            drawn.append(plain(*given, **options))
            return drawn[-1]

        monkeypatch.setattr("fronto.train.masks.collect.SIZES", ((160, 120), (120, 160)))
        monkeypatch.setattr("fronto.synth.photo.render_photo", kept)
        draw, forms, shapes, units = rendered(0.5, 0.5), set(), set(), 0
        for seed in range(12):
            shown = draw(np.random.default_rng(seed))
            objects = drawn[-1].objects
            shapes.add(shown.image.shape)
            assert shown.image is drawn[-1].image
            assert all(a is o.polygon_px for a, o in zip(shown.outlines, objects, strict=True))
            assert shown.plates == [o.category == "plate" for o in objects]
            assert shown.learned == [o.visible >= SEEN for o in objects]
            for button, plate in shown.units:
                assert objects[button].category != "plate" == objects[plate].category
                assert objects[button].text == objects[plate].text
            units += len(shown.units)
            for form, o in zip(shown.forms, objects, strict=True):
                forms.add(form)
                assert (FORMS[form] == "odd") == o.outline.odd
                assert o.outline.odd or FORMS[form] == o.outline.shape
        assert shapes == {(120, 160, 3), (160, 120, 3)}
        assert forms == {0, 1, 2}
        assert units > 10


def test_labelled_photos(tmp_path: Path) -> None:
    images = []
    for k in range(2):
        path = tmp_path / f"{k}.png"
        Image.fromarray(np.full((40, 50, 3), 100 + k, np.uint8)).save(path)
        outlines = [quad(20, 20, 10, 10), quad(30, 20, 8, 8), quad(10, 20, 8, 8), quad(4, 4, 6, 6)]
        objects = [
            LabeledObject(category, polygon_box(p), p, "x", ignore=ignore, truncated=truncated)
            for category, p, ignore, truncated in zip(
                ("up", "plate", "unknown", "down"),
                outlines,
                (False, False, True, False),
                (False, False, False, True),
                strict=True,
            )
        ]
        boxed = LabeledObject("up", (1.0, 1.0, 5.0, 5.0), None, "x")
        images.append(LabeledImage(path, 50, 40, (boxed, *objects)))
    draw, seen = labelled(images), set()
    for seed in range(8):
        shown = draw(np.random.default_rng(seed))
        seen.add(int(shown.image[0, 0, 0]))
        assert shown.image.shape == (40, 50, 3)
        for ours, theirs in zip(shown.outlines, outlines, strict=True):
            np.testing.assert_array_equal(ours, theirs)
        assert shown.plates == [False, True, False, False]
        assert shown.forms == [Pool.UNKNOWN] * 4
        assert shown.learned == [True, True, False, False]
    assert seen == {100, 101}
