"""Candidates to learn from: what the labels say of them, and the files that keep them."""

from __future__ import annotations

import itertools
from dataclasses import fields, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from test_segmentation import Oracle

torch = pytest.importorskip("torch")

from fronto.categories import CATEGORIES
from fronto.engine import Maps
from fronto.errors import InputError
from fronto.relations import geometry, pairs, shifted
from fronto.shapes import FloatArray
from fronto.train.data import Sample
from fronto.train.relations.collect import collect, judge_candidates
from fronto.train.relations.fit import batch_of
from fronto.train.relations.pool import Picture, read_pool, write_pool
from fronto.train.targets import Target

SHAPE = (100, 120, 3)
BUTTON = (20.0, 20.0, 60.0, 60.0)
Box = tuple[float, float, float, float]


def corners(box: Box) -> FloatArray:
    x0, y0, x1, y1 = box
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])


def target(
    box: Box = BUTTON, category: str = "up", *, exact: bool = True, ignore: bool = False
) -> Target:
    return Target(category, corners(box), exact, ignore)


def verdict(box: Box, *objects: Target) -> tuple[int, int, FloatArray]:
    kinds, classes, shifts = judge_candidates(np.array([box]), objects, SHAPE)
    return int(kinds[0]), int(classes[0]), shifts[0]


def picture(n: int, seed: int = 0, channels: int = 5) -> Picture:
    rng = np.random.default_rng(seed)
    low = rng.uniform(0, 80, (n, 2))
    shifts = rng.normal(0, 0.1, (n, 4))
    shifts[::2] = np.nan
    return Picture(
        shape=(100, 120 + seed),
        looks=rng.normal(size=(n, 49, channels)).astype(np.float16),
        boxes=np.hstack([low, low + rng.uniform(5, 30, (n, 2))]),
        confidence=rng.uniform(0.15, 1, n),
        plates=rng.random(n) < 0.3,
        scores=rng.dirichlet(np.ones(11), n),
        kinds=rng.integers(-1, 3, n),
        classes=rng.integers(-1, 11, n),
        shifts=shifts,
    )


class TestJudgeCandidates:
    def test_a_button_a_plate_and_nothing(self) -> None:
        labels = [target(), target((70, 20, 90, 60), "plate")]
        boxes = np.array([(70, 21, 91, 60), (20, 70, 60, 95), BUTTON])
        kinds, classes, shifts = judge_candidates(boxes, labels, SHAPE)
        assert kinds.tolist() == [2, 0, 1]
        assert [CATEGORIES[c] for c in classes[[0, 2]]] == ["plate", "up"]
        assert classes[1] == -1
        assert np.isnan(shifts[1]).all()
        np.testing.assert_allclose(shifts[2], 0, atol=1e-12)

    def test_some_button_has_a_kind_but_no_class(self) -> None:
        assert verdict(BUTTON, target(category="unknown"))[:2] == (1, -1)

    def test_where_it_is_neither_near_nor_far_there_is_no_verdict(self) -> None:
        # Moved by d of 40 pixels: IoU (40 - d) / (40 + d).
        for moved, kind, near in ((13, 1, True), (15, -1, True), (18, 0, False)):
            found = verdict((20.0 + moved, 20, 60.0 + moved, 60), target())
            assert found[:2] == (kind, 1 if kind == 1 else -1)
            assert np.isfinite(found[2]).all() == near

    def test_what_is_ignored_has_no_verdict(self) -> None:
        zone = target((60, 10, 110, 90), ignore=True)
        assert verdict((70, 20, 90, 40), zone)[0] == -1
        assert verdict((50, 20, 80, 40), zone)[0] == -1  # two thirds of it
        assert verdict((40, 20, 70, 40), zone)[0] == 0  # a third
        known = target((70, 20, 90, 40))
        assert verdict((70, 20, 90, 40), zone, known)[0] == 1

    def test_of_what_the_picture_cuts(self) -> None:
        less, more = target((-30, 20, 10, 60)), target((-15, 20, 25, 60))
        assert verdict((-0.5, 20, 10, 60), less)[0] == -1
        kind, _, shifts = verdict((1, 20, 25, 60), more)
        assert kind == 1
        np.testing.assert_allclose(shifts, [-1.5 / 24, 0, 0, 0], atol=1e-9)
        assert verdict((0, 20, 10, 60), target((-80, 20, -30, 60)))[0] == 0

    def test_a_turned_box_is_as_large_as_before(self) -> None:
        a = np.radians(25)
        turn = np.array([[np.cos(a), np.sin(a)], [-np.sin(a), np.cos(a)]])
        polygon = (corners(BUTTON) - 40) @ turn + 40
        _, _, shifts = verdict(BUTTON, Target("up", polygon, exact=False))
        np.testing.assert_allclose(shifts, 0, atol=1e-9)
        _, _, shifts = verdict(BUTTON, Target("up", polygon, exact=True))
        assert (shifts * [-1, -1, 1, 1] > 0.1).all()

    @settings(derandomize=True, deadline=None, max_examples=60)
    @given(st.lists(st.floats(-0.12, 0.12), min_size=4, max_size=4))
    def test_the_shifts_lead_to_the_labelled_box(self, off: list[float]) -> None:
        box = np.array(BUTTON) + 40 * np.array(off)
        labels = [target((62, 20, 100, 60)), target()]
        kinds, _, shifts = judge_candidates(box[None], labels, SHAPE)
        assert kinds.tolist() == [1]
        np.testing.assert_allclose(shifted(box[None], shifts), [BUTTON], atol=1e-9)

    def test_without_labels_all_is_nothing(self) -> None:
        kinds, classes, shifts = judge_candidates(np.array([BUTTON, BUTTON]), [], SHAPE)
        assert kinds.tolist() == [0, 0]
        assert classes.tolist() == [-1, -1]
        assert np.isnan(shifts).all()


class Bright(Oracle):
    """Finds bright things."""

    def run(self, images: npt.NDArray[np.uint8], *, features: bool | None = None) -> Maps:
        assert features
        maps = super().run(images)
        return replace(maps, features=np.zeros_like(maps.classes[:, :5]))


class Keys:
    """Bright keys on a dark panel."""

    def draw(self, rng: np.random.Generator) -> Sample:
        image = np.full((480, 640, 3), 30, np.uint8)
        keys = []
        for x, y in itertools.product((140, 320, 500), (120, 260, 400)):
            w, h = rng.integers(40, 70, 2)
            image[y : y + h, x : x + w] = 220
            box = (x - 0.5, y - 0.5, x + w - 0.5, y + h - 0.5)
            keys.append(target(box, "number"))
        return Sample(image, tuple(keys))


def test_labels_follow_the_picture_wherever_it_is_cut_and_turned() -> None:
    pytest.importorskip("kornia")
    source = [(Keys(), 1.0)]
    engine = Bright()
    found = list(itertools.islice(collect(engine, source, size=256, seed=3), 25))  # type: ignore[arg-type]
    assert {p.shape for p in found} == {(256, 256), (480, 640)}
    kinds = np.concatenate([p.kinds for p in found])
    shifts = np.concatenate([p.shifts for p in found])[kinds == 1]
    assert (kinds == 1).mean() > 0.7
    assert {c for p in found for c in p.classes.tolist()} <= {-1, CATEGORIES.index("number")}
    assert np.quantile(np.abs(shifts), 0.9) < 0.06
    assert np.abs(np.median(shifts, axis=0)).max() < 0.02
    again = list(itertools.islice(collect(engine, source, size=256, seed=3), 3))  # type: ignore[arg-type]
    for ours, theirs in zip(again, found, strict=False):
        np.testing.assert_array_equal(ours.boxes, theirs.boxes)


class TestPool:
    def test_round_trip(self, tmp_path: Path) -> None:
        pictures = [picture(n, seed) for seed, n in enumerate((3, 1, 7))]
        path = tmp_path / "pictures-000.npz"
        write_pool(path, pictures)
        assert [f.name for f in tmp_path.iterdir()] == [path.name]
        found = read_pool(path)
        assert [p.shape for p in found] == [p.shape for p in pictures]
        for ours, theirs in zip(found, pictures, strict=True):
            for name in (f.name for f in fields(Picture) if f.name != "shape"):
                kept, given = getattr(ours, name), getattr(theirs, name)
                assert kept.shape == given.shape
                np.testing.assert_allclose(kept, given, rtol=1e-6, err_msg=name)

    @pytest.mark.parametrize("damage", ["gone", "empty", "text", "array", "cut", "part", "counts"])
    def test_a_damaged_file(self, tmp_path: Path, damage: str) -> None:
        path = tmp_path / "pictures-000.npz"
        write_pool(path, [picture(3), picture(2, 1)])
        content = path.read_bytes()
        if damage == "gone":
            path.unlink()
        elif damage == "array":
            with path.open("wb") as file:
                np.save(file, np.zeros(3))
        elif damage == "part":
            np.savez(path, boxes=np.zeros((3, 4)))
        elif damage == "counts":
            with np.load(path) as stored:
                np.savez(path, **{**stored, "count": np.array([5])})
        else:
            broken = {"empty": b"", "text": b"no arrays", "cut": content[: len(content) // 2]}
            path.write_bytes(broken[damage])
        with pytest.raises(InputError, match=r"pictures-000\.npz"):
            read_pool(path)


class TestBatch:
    def test_pictures_are_filled_up(self) -> None:
        pictures = [picture(2), picture(4, 1)]
        batch = batch_of(pictures)
        assert batch.looks.shape == (6, 49, 5)
        assert batch.there.tolist() == [[True, True, False, False], [True] * 4]
        assert (batch.kinds[0, 2:] == -1).all()
        assert (batch.classes[0, 2:] == -1).all()
        assert batch.shifts[0, 2:].isnan().all()
        assert all(part.isfinite().all() for part in (batch.looks, batch.geometry, batch.pairs))
        seen = np.concatenate([p.looks for p in pictures])
        np.testing.assert_array_equal(batch.looks, seen)
        for k, (p, n) in enumerate(zip(pictures, (2, 4), strict=True)):
            np.testing.assert_array_equal(batch.kinds[k, :n], p.kinds)
            np.testing.assert_allclose(batch.pairs[k, :n, :n], pairs(p.boxes))
            told = geometry(p.boxes, p.confidence, p.plates, p.scores, p.shape)
            np.testing.assert_allclose(batch.geometry[k, :n], told)
            np.testing.assert_allclose(batch.shifts[k, :n], p.shifts, atol=1e-7)
