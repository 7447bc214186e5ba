"""Lit buttons: those that shine beside the others."""

import numpy as np
import pytest

from fronto.labels.lit import lit_scores
from fronto.synth.photo import render_photo


def panel(count: int, seed: int = 0) -> np.ndarray:
    """Crops of grey buttons that are nearly alike."""
    rng = np.random.default_rng(seed)
    plain = np.full((count, 48, 48, 3), 90) + rng.normal(0, 3, (count, 48, 48, 3))
    plain += rng.normal(0, 2, (count, 1, 1, 1))
    plain[:, 18:30, 20:28] = 200  # a label
    return np.clip(plain, 0, 255).astype(np.uint8)


@pytest.mark.parametrize("part", ["face", "ring"])
def test_one_that_shines_stands_out(part):
    crops = panel(9)
    color = (250, 150, 40)
    if part == "face":
        crops[4, 4:44, 4:44] = color
    else:
        ring = np.ones((48, 48), bool)
        ring[7:41, 7:41] = False
        crops[4, ring] = color
    scores = lit_scores(crops)
    assert scores.argmax() == 4
    assert scores[4] > 0.5
    assert np.delete(scores, 4).max() < 0.2


def test_buttons_alike_are_none():
    assert lit_scores(panel(9)).max() < 0.3
    bright = np.full((9, 48, 48, 3), 240, np.uint8)
    assert lit_scores(bright).max() < 0.1


@pytest.mark.parametrize("count", [0, 1, 2])
def test_too_few_to_compare(count):
    assert lit_scores(panel(count)) is None


def test_lit_buttons_of_renders_score_higher():
    from fronto.labels.crops import crops

    lit, dark = [], []
    for seed in range(560_000, 560_060):
        photo = render_photo(np.random.default_rng(seed))
        shown = [o for o in photo.objects if o.category not in ("plate", "keyhole")]
        shown = [o for o in shown if o.visible > 0.95]
        state = np.array([o.lit for o in shown])
        if len(shown) < 3 or state.mean() >= 0.5:
            continue
        scores = lit_scores(crops(photo.image, [o.outline for o in shown]))
        lit += scores[state].tolist()
        dark += scores[~state].tolist()
    assert len(lit) >= 10
    # Of two buttons, one lit: how often that one has the higher score.
    assert np.mean(np.array(lit)[:, None] > np.array(dark)) > 0.75
