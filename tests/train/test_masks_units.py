"""Buttons that a network takes for one thing with the plate beside them: what the head learns."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from test_masks_data import find, paint, quad, some

from fronto.scales import first_look
from fronto.shapes import FloatArray, Outline
from fronto.synth.photo.truth import PhotoObject
from fronto.train.masks.collect import Shown, _rough_units, _units, _with_units
from fronto.train.pools import joined
from test_segmentation import Oracle

#: A plate beside a button, another above one, and a button alone.
OUTLINES = [
    quad(60, 50, 20, 20),
    quad(35, 50, 16, 12),
    quad(140, 50, 20, 20),
    quad(140, 28, 16, 12),
    quad(100, 110, 24, 24),
]
BOXES = [(27, 40, 70, 60), (130, 22, 150, 60)]
SHOWN = Shown(
    np.zeros((150, 200, 3), np.uint8),
    OUTLINES,
    [False, True, False, True, False],
    [0] * 5,
    [True] * 5,
    [(0, 1), (2, 3)],
)


def box_of(polygon: FloatArray) -> tuple[float, ...]:
    return (*polygon.min(axis=0).tolist(), *polygon.max(axis=0).tolist())


class TestUnits:
    @pytest.mark.parametrize(
        ("shown", "units"),
        [
            ("up:A plate:A", [(0, 1)]),
            ("number:1 plate:1 number:2 plate:2 number:3", [(0, 1), (2, 3)]),
            ("up:A number:B plate:B plate:B", [(1, 2)]),
            ("up: plate:", [(0, 1)]),
            ("plate:A up:A", []),
            ("up:A plate:B", []),
            ("up:A number:A", []),
            ("plate:A plate:A", []),
            ("up:A number:B plate:A", []),
            ("up:A", []),
            ("", []),
        ],
    )
    def test_a_button_and_the_plate_after_it(
        self, shown: str, units: list[tuple[int, int]]
    ) -> None:
        corners = quad(10, 10, 8, 8)
        things = [thing.split(":") for thing in shown.split()]
        objects = [
            PhotoObject(category, text, Outline.quad(corners), corners, 1.0)
            for category, text in things
        ]
        assert list(_units(objects)) == units


class TestWithUnits:
    def test_boxes_are_around_both(self) -> None:
        finds = [find(box_of(p)) for p in OUTLINES]
        *units, alone = _with_units(finds, SHOWN)
        assert [tuple(f.box) for f in units] == BOXES
        assert not any(f.instance.plate or f.cut for f in units)
        assert alone is finds[4]

    def test_their_rough_masks_are_at_their_places(self) -> None:
        for unit in _with_units([find(box_of(OUTLINES[4]))], SHOWN)[:2]:
            for polygon, value in zip(OUTLINES, (0.95,) * 4 + (0,), strict=True):
                u, v = np.rint(unit.view.to_network(polygon.mean(axis=0))).astype(int)
                assert unit.mask[v, u] == pytest.approx(value, abs=1e-6)

    def test_what_is_mostly_inside_is_dropped(self) -> None:
        button, x0 = find(box_of(OUTLINES[4])), BOXES[0][0]
        inside = [find(BOXES[0]), find((30, 45, 40, 55)), find((60, 45, 70, 55), plate=True)]
        half_out = [
            find((x0 - out, 40, x0 + 20 - out, 60), plate=plate)
            for out in (9, 11)
            for plate in (False, True)
        ]
        around = find((0, 0, 100, 100))
        plate = find((170, 100, 190, 110), plate=True)
        given = [plate, *inside, *half_out, button, around]
        left = _with_units(given, SHOWN)
        assert [tuple(f.box) for f in left[:2]] == BOXES
        assert [given.index(f) for f in left[2:]] == [0, 6, 7, 8, 9]

    def test_units_that_were_not_found_are_given(self) -> None:
        assert len(_with_units([find((90, 100, 110, 120))], SHOWN)) == 3

    def test_where_no_button_is_found_nothing_changes(self) -> None:
        plates = [find(box_of(p), plate=True) for p in OUTLINES]
        left = _with_units(plates, SHOWN)
        assert len(left) == len(plates)
        assert all(a is b for a, b in zip(left, plates, strict=True))


@pytest.mark.parametrize("scale", [0.6, 1, 7])
def test_rough_masks_of_units(scale: float) -> None:
    """They hold button and plate and what is between them, and little else."""
    image = np.zeros((round(150 * scale), round(200 * scale), 3), np.uint8)
    view = first_look(image)
    outlines = [scale * p for p in OUTLINES]
    rough = _rough_units(view, replace(SHOWN, image=image, outlines=outlines))
    assert rough.shape == (view.rows, view.columns)

    def at(*points: tuple[float, float]) -> FloatArray:
        u, v = np.rint(view.to_network(scale * np.array(points))).astype(int).T
        return np.asarray(rough[v, u])

    middles = [tuple(p.mean(axis=0)) for p in OUTLINES]
    np.testing.assert_allclose(at(*middles[:4], (46, 50), (140, 37)), 0.95, atol=1e-6)
    # A little within their corners, and some way from them: 5 pixels, 16 of the network's.
    within = [(m + 0.85 * (p - m)).tolist() for p, m in zip(OUTLINES[:4], middles, strict=False)]
    assert (at(*(c for corners in within for c in corners)) > 0.8).all()
    beside = [(22, 50), (75, 50), (48, 35), (48, 65), (140, 17), (125, 40), (155, 40), (140, 65)]
    assert not at(*beside, middles[4], (5, 5), (195, 145)).any()
    # Their hulls by hand: two quads and what is between them, as high as the one, then the other.
    areas = [20 * 20 + 16 * 12 + 7 * 16, 20 * 20 + 16 * 12 + 6 * 18]
    area = sum(areas) * scale**2 * view.sx * view.sy
    assert 1 < rough.sum() / 0.95 / area < 1.25


def pairs(rng: np.random.Generator) -> Shown:
    """Bright keys on a dark panel, at the left of each a plate as large as it."""
    image = np.full((480, 640, 3), 30, np.uint8)
    outlines = []
    for x, y in itertools.product((220, 500), (120, 260, 400)):
        w, h = rng.uniform(40, 70, 2)
        outlines += [quad(x, y, w, h), quad(x - w - 10, y, w, h)]
    for polygon in outlines:
        paint(image, polygon)
    units = [(k, k + 1) for k in range(0, 12, 2)]
    return Shown(image, outlines, [False, True] * 6, [0, 1] * 6, [True] * 12, units)


class TestCollectUnits:
    def ratios(self, share: float, count: int, monkeypatch: pytest.MonkeyPatch) -> list[FloatArray]:
        """Of each picture, areas of the rough masks over those of the true ones."""
        monkeypatch.setattr("fronto.train.masks.collect.UNITS", share)
        found = some(Oracle(), [(pairs, 1.0)], count)
        # All keys are learned, and they only: the network takes plates for buttons, too.
        assert {len(p) for p in found} == {6}
        assert not joined(found).forms.any()
        return [(p.rough > 127).sum(axis=(1, 2)) / (p.masks > 127).sum(axis=(1, 2)) for p in found]

    def test_a_rough_mask_is_of_both_and_the_true_one_of_the_button(
        self, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        ratios = np.concatenate(self.ratios(1.0, 3, monkeypatch))
        assert (ratios > 2.1).all()
        assert (ratios < 3).all()
        whole = joined(some(Oracle(), [(pairs, 1.0)], 3))
        true, rough = whole.masks > 127, whole.rough > 127
        assert (rough & true).sum() > 0.98 * true.sum()
        # The photo shows both; the true mask is its right half.
        columns = np.arange(true.shape[2])
        seen = whole.photo[..., 0] > 125
        for k in range(len(whole)):
            right, both, bright = (
                np.average(columns, weights=m[k].sum(axis=0)) for m in (true, rough, seen)
            )
            assert right > both + 5
            assert abs(both - bright) < 1.5

    def test_of_none(self, monkeypatch: pytest.MonkeyPatch) -> None:
        ratios = np.concatenate(self.ratios(0.0, 3, monkeypatch))
        assert np.abs(ratios - 1).max() < 0.1

    def test_of_some_pictures(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """All of a picture, or none of it."""
        ratios = self.ratios(0.25, 24, monkeypatch)
        assert all((r > 2).all() or (r < 1.5).all() for r in ratios)
        assert 2 <= sum((r > 2).all() for r in ratios) <= 11
