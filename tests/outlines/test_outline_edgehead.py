"""What an edge head tells of a photo's outlines, and what becomes of it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from panelforms import circle, quad
from panelmaker import corner_errors, ellipse_errors, panel, rms

from fronto import Segments, outline, segment
from fronto.outlines import edgehead
from fronto.outlines.edgeprofiles import BINS, CURVES, REACH, about, told_places
from fronto.synth.photo import render_photo

fixed = settings(derandomize=True, deadline=None, max_examples=40)


class Teller:
    """An edge head that knows how far out of each outline the edge is, in shares of the reach."""

    def __init__(self, offset, sure=1.0, wrong=None):
        self.offset, self.sure, self.wrong, self.asked = offset, sure, wrong, []

    def run(self, profiles, about):
        self.asked.append(len(profiles))
        assert profiles.shape[1:] == (CURVES, BINS, 4)
        assert about.shape == (len(profiles), 3)
        offset = np.full((len(profiles), CURVES), float(self.offset))
        sure = np.full((CURVES, 1), self.sure)
        if self.wrong is not None:
            offset[:, self.wrong] += 0.5
            sure[self.wrong] = 8.0
        places = (np.arange(BINS) + 0.5) / (BINS / 2) - 1
        told = np.exp(-0.5 * ((places - offset[..., None]) * BINS / 2 / sure) ** 2)
        return (told / told.sum(axis=2, keepdims=True)).astype(np.float32)


def drawn(segments, form):
    """The same masks as a mask head gives them: it has seen their form."""
    forms = {"quad": (0.98, 0.01, 0.01), "ellipse": (0.01, 0.98, 0.01)}[form]
    return replace(segments, segments=tuple(replace(s, forms=forms) for s in segments.segments))


def made(make, seed=0, **options):
    one = panel(np.random.default_rng(seed), make, **options)
    form = "quad" if make is quad else "ellipse"
    return one, drawn(one.segments(), form), one.picture(seed=seed)


@pytest.mark.parametrize(
    ("make", "errors"), [(quad, corner_errors), (circle, ellipse_errors)], ids=["quad", "circle"]
)
@pytest.mark.parametrize("share", [-0.1, 0.0, 0.15])
def test_outlines_go_where_the_head_tells(make, errors, share):
    one, segments, picture = made(make, side=34)
    teller = Teller(share, sure=0.5)
    found = outline(segments, picture, lines=False, edges=teller)
    assert teller.asked == [len(segments.buttons)]
    plain = outline(segments, None, lines=False)
    reach = REACH * 34
    for after, before in zip(found.buttons, plain.buttons, strict=True):
        assert after.shape == before.shape
        grown = np.array(after.box_px) - np.array(before.box_px)
        out = grown * [-1, -1, 1, 1]
        assert out == pytest.approx(share * reach, abs=0.25 + 0.3 * abs(share) * reach)
    if share == 0:
        assert rms([errors(one, found.buttons)]) < 0.5


def test_one_wrong_curve_of_which_it_is_less_sure_follows_the_others():
    _, segments, picture = made(quad, side=34)
    right = outline(segments, picture, lines=False, edges=Teller(0.05))
    misled = outline(segments, picture, lines=False, edges=Teller(0.05, wrong=3))
    corner = 0.5 * REACH * 34 * (0.5 + 1 / 0.8)  # where that line would run
    for a, b in zip(right.buttons, misled.buttons, strict=True):
        assert np.abs(a.corners_px - b.corners_px).max() < 0.4 * corner


@pytest.mark.parametrize("make", [quad, circle], ids=["quad", "circle"])
def test_an_unsure_head_moves_little_and_says_so(make):
    _, segments, picture = made(make, side=34)
    sure, unsure = (
        outline(segments, picture, lines=False, edges=Teller(0.2, sure=s)).buttons
        for s in (0.5, 20.0)
    )
    masks = outline(segments, None, lines=False).buttons
    for a, b, m in zip(sure, unsure, masks, strict=True):
        moved = [np.abs(np.array(o.box_px) - m.box_px).mean() for o in (a, b)]
        assert moved[1] < 0.95 * moved[0]
        assert b.std_px > 1.5 * a.std_px
        assert b.form_std_px > a.form_std_px
        assert b.form_std_px < b.std_px


def test_only_masks_that_a_head_has_drawn_are_asked_about():
    one, segments, picture = made(quad, side=34)
    teller = Teller(0.2)
    plain = outline(one.segments(), picture, lines=False, edges=teller)
    same = outline(one.segments(), picture, lines=False)
    assert not teller.asked
    for a, b in zip(plain.buttons, same.buttons, strict=True):
        np.testing.assert_array_equal(a.corners_px, b.corners_px)
    assert outline(segments, picture, lines=False, edges=False).buttons
    outline(segments, picture, corners="hough", edges=teller)
    outline(segments, None, edges=teller)
    assert not teller.asked


def test_what_the_border_cuts_and_what_is_tiny_is_not_asked_about():
    mask = np.zeros((4, 90, 160), bool)
    mask[0, 30:60, 40:80] = True
    mask[1, 0:20, 40:70] = True
    mask[2, 80:85, 80:85] = True
    mask[3, 30:60, 100:140] = True
    picture = np.repeat((60 + 150 * mask.any(axis=0)).astype(np.uint8)[..., None], 3, axis=2)
    teller = Teller(0.0)
    segments = drawn(Segments.from_masks(mask), "quad")
    found = outline(segments, picture, lines=False, edges=teller)
    assert teller.asked == [2]
    assert any(o.truncated for o in found.buttons)
    alone = drawn(Segments.from_masks(mask[:1]), "quad")
    outline(alone, picture, lines=False, edges=teller)
    assert teller.asked == [2]  # one by itself does not tell


def test_round_and_rectangular_ones_together_keep_their_order():
    mask = np.zeros((4, 160, 200), bool)
    y, x = np.mgrid[:160, :200]
    boxes = [(40, 40), (110, 40), (40, 110), (110, 110)]
    forms = []
    for k, (cx, cy) in enumerate(boxes):
        if k % 2:
            mask[k] = (x - cx) ** 2 + (y - cy) ** 2 <= 20**2
            forms.append((0.01, 0.98, 0.01))
        else:
            mask[k] = (abs(x - cx) <= 20) & (abs(y - cy) <= 20)
            forms.append((0.98, 0.01, 0.01))
    plain = Segments.from_masks(mask)
    parts = tuple(replace(s, forms=f) for s, f in zip(plain.segments, forms, strict=True))
    segments = replace(plain, segments=parts)
    picture = np.repeat((60 + 150 * mask.any(axis=0)).astype(np.uint8)[..., None], 3, axis=2)
    found = outline(segments, picture, lines=False, edges=Teller(0.0, sure=0.5))
    assert [o.shape for o in found.buttons] == ["quad", "ellipse"] * 2
    for o, (cx, cy) in zip(found.buttons, boxes, strict=True):
        assert o.center_px == pytest.approx((cx, cy), abs=0.3)
        assert np.array(o.box_px) == pytest.approx([cx - 20, cy - 20, cx + 20, cy + 20], abs=0.8)


@fixed
@given(
    st.lists(st.floats(-3, 3), min_size=8, max_size=8),
    st.floats(0.05, 4),
    st.floats(8, 200),
    st.booleans(),
)
def test_weighing_is_between_the_mask_and_the_head(offsets, std, size, is_round):
    offset = np.array([offsets])
    stds, sizes, rounds = np.full((1, 8), std), np.array([size]), np.array([is_round])
    place, covariance = edgehead._weighed(offset, stds, sizes, rounds)
    assert np.linalg.norm(place) <= np.linalg.norm(offset) + 1e-9
    np.testing.assert_allclose(covariance[0], covariance[0].T, atol=1e-9)
    values = np.linalg.eigvalsh(covariance[0])
    assert values.min() > -1e-9
    # What the head tells makes nothing less sure.
    worse, wider = edgehead._weighed(offset, stds * 2, sizes, rounds)
    assert np.trace(wider[0]) >= np.trace(covariance[0]) - 1e-9
    assert np.linalg.norm(worse) <= np.linalg.norm(place) + 1e-6
    share = np.array([0.8])
    for whole, form in (edgehead._quad_stds(covariance, share), edgehead._ellipse_stds(covariance)):
        assert form[0] >= 0
        assert whole[0] > 0


def test_places_around_the_likeliest():
    curves = edgehead.Curves(np.zeros((1, 8, 10, 2)), np.zeros((1, 8, 10, 2)), np.array([6.4]))
    told = np.zeros((1, CURVES, BINS), np.float32)
    told[..., 40] = 1
    offset, std = told_places(told, curves)
    np.testing.assert_allclose(offset, 6.4 * (40.5 / 32 - 1), rtol=1e-6)
    np.testing.assert_allclose(std, 0, atol=1e-6)
    told[..., 40], told[..., 10] = 0.6, 0.4  # another edge may be meant
    offset, std = told_places(told, curves)
    np.testing.assert_allclose(offset, 6.4 * (40.5 / 32 - 1), rtol=1e-6)
    assert std == pytest.approx(np.sqrt(0.4) * 6.4 * 30 / 32, rel=1e-5)


def test_what_is_told_about_outlines():
    told = about(np.array([10.0, 100.0]), np.array([1.0, 400.0]), np.array([True, False]))
    assert told.dtype == np.float32
    assert told[1, 0] > told[0, 0]
    assert told[:, 1].tolist() == [1, 0]
    assert np.isfinite(told).all()
    assert told[1, 2] == 3


def test_the_packaged_head_finds_corners_better_than_masks():
    """Renders that it has not learned from; their masks are the packaged network's."""
    without, with_head = [], []
    for seed in range(77_000, 77_012):
        photo = render_photo(np.random.default_rng(seed))
        segments = segment(photo.image)
        true = [
            o.outline
            for o in photo.objects
            if o.category != "plate" and o.visible > 0.98 and not o.outline.truncated
        ]
        for errors, edges in ((without, False), (with_head, True)):
            found = outline(segments, photo.image, lines=False, edges=edges)
            for t in true:
                if t.corners_px is None or t.odd:
                    continue
                middle = np.array(t.center_px)
                near = [
                    f.corners_px
                    for f in found.buttons
                    if f.corners_px is not None and np.abs(np.array(f.center_px) - middle).max() < 5
                ]
                if len(near) == 1:
                    off = near[0] - t.corners_px
                    errors.append(np.sqrt((off**2).mean()))
    assert len(with_head) > 40
    assert np.median(with_head) < 0.9 * np.median(without)


def test_sides_that_would_meet_far_away_stay_where_the_mask_has_them(monkeypatch):
    monkeypatch.setattr(edgehead, "FARTHEST", 0.001)
    _, segments, picture = made(quad, side=34)
    moved = outline(segments, picture, lines=False, edges=Teller(0.2)).buttons
    plain = outline(segments, picture, lines=False, edges=False).buttons
    assert len(moved) == len(plain) > 0
    for a, b in zip(moved, plain, strict=True):
        np.testing.assert_array_equal(a.corners_px, b.corners_px)
