"""A second opinion on finds: what it is shown, and what both opinions come to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from fronto.categories import CATEGORIES, PLATE
from fronto.finds import Find
from fronto.grouping import Instance
from fronto.scales import first_look
from fronto.verification import KINDS, REACH, SIDE, Opinions, describe, verified

PHOTO = np.random.default_rng(0).integers(0, 256, (120, 160, 3), dtype=np.uint8)
VIEW = first_look(PHOTO)
NUMBER = CATEGORIES.index("number")


def find(nothing: float, button: float, plate: float, category: str = "number") -> Find:
    """A find of which the network says this."""
    scores = np.zeros(len(CATEGORIES))
    scores[0], scores[-1] = nothing, plate
    scores[CATEGORIES.index(category)] = 0.9 * button
    scores[CATEGORIES.index("other")] += 0.1 * button
    is_plate, confidence = plate > button, max(button, plate)
    instance = Instance(is_plate, confidence, (10.0, 10, 30, 30), scores)
    kind = PLATE if is_plate else category
    mask = np.zeros(VIEW.image.shape[:2], np.float32)
    return Find(instance, np.array([5.0, 5, 15, 15]), VIEW, mask, confidence, kind, False)


def opinion(nothing: float, button: float, plate: float, category: str = "number") -> Opinions:
    classes = np.full((1, len(CATEGORIES)), 0.01, np.float32)
    classes[0, CATEGORIES.index(category)] = 1
    kinds = np.array([[nothing, button, plate]], np.float32)
    return Opinions(kinds, classes / classes.sum())


class TestDescribe:
    def test_a_patch_shows_what_is_around_the_box(self) -> None:
        photo = np.zeros((200, 300, 3), np.uint8)
        photo[80:120, 130:170] = 255
        (patch,) = describe(photo, np.array([[129.5, 79.5, 169.5, 119.5]]))
        assert patch.shape == (SIDE, SIDE, 3)
        bright = patch[..., 0] > 127
        rows, columns = np.flatnonzero(bright.any(axis=1)), np.flatnonzero(bright.any(axis=0))
        for places in (rows, columns):
            assert len(places) == pytest.approx(SIDE / REACH, abs=1.01)
            assert (places[0] + places[-1]) / 2 == pytest.approx((SIDE - 1) / 2, abs=0.8)

    def test_boxes_of_any_size_and_place(self) -> None:
        boxes = np.array([[-50.0, -50, -40, -40], [3, 3, 3.2, 3.2], [-1e5, -1e5, 1e5, 1e5]])
        patches = describe(PHOTO, np.concatenate([boxes, [[0.0, 0, 159, 119]]]))
        assert patches.shape == (4, SIDE, SIDE, 3)
        assert (patches[0] == PHOTO[0, 0]).all()


class TestVerified:
    def test_both_agree(self) -> None:
        (one,) = verified([find(0.1, 0.85, 0.05)], opinion(0.1, 0.85, 0.05))
        assert one.category == "number"
        assert one.confidence > 0.85

    def test_what_looks_like_nothing_is_doubted(self) -> None:
        before = find(0.3, 0.68, 0.02)
        (one,) = verified([before], opinion(0.95, 0.04, 0.01))
        assert one.confidence < 0.4
        assert not one.instance.plate

    def test_what_looks_like_a_button_is_lifted(self) -> None:
        (one,) = verified([find(0.65, 0.34, 0.01)], opinion(0.02, 0.97, 0.01))
        assert one.confidence > 0.7

    def test_a_button_becomes_a_plate(self) -> None:
        before = find(0.05, 0.55, 0.4)
        (one,) = verified([before], opinion(0.02, 0.08, 0.9))
        assert one.category == PLATE
        assert one.instance.plate
        assert one.box is before.box
        assert one.mask is before.mask

    def test_a_plate_becomes_a_button(self) -> None:
        (one,) = verified([find(0.05, 0.4, 0.55, "up")], opinion(0.02, 0.9, 0.08, "up"))
        assert one.category == "up"
        assert not one.instance.plate

    def test_the_category_is_what_both_say(self) -> None:
        (one,) = verified([find(0.1, 0.85, 0.05)], opinion(0.1, 0.85, 0.05, "other"))
        assert one.category == "other"
        scores = one.instance.scores
        assert 0 < scores[NUMBER] < scores[CATEGORIES.index("other")]

    def test_of_a_network_without_a_relation_head(self) -> None:
        """Its scores are the cells' mean classes: they do not say how sure it is of the centre."""
        before = find(0.5, 0.45, 0.05)
        before = replace(before, instance=replace(before.instance, confidence=0.9), confidence=0.9)
        (one,) = verified([before], opinion(1 / 3, 1 / 3, 1 / 3))
        assert one.category == "number"
        assert one.confidence > 0.7

    @given(
        st.lists(st.floats(0, 1), min_size=KINDS, max_size=KINDS),
        st.lists(st.floats(0, 1), min_size=KINDS, max_size=KINDS),
    )
    def test_probabilities_stay_such(self, first: list[float], second: list[float]) -> None:
        told = [np.array(values) / max(sum(values), 1e-9) for values in (first, second)]
        before = find(*told[0].tolist())
        (one,) = verified([before], opinion(*told[1].tolist()))
        assert one.instance.scores.sum() == pytest.approx(1)
        assert (one.instance.scores >= 0).all()
        assert 0 <= one.confidence <= 1
        assert one.confidence == one.instance.confidence
        assert (one.category == PLATE) == one.instance.plate
