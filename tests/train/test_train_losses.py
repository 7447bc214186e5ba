"""What costs nothing, what costs something, and what must not be learnt from."""

from __future__ import annotations

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from fronto.categories import BUTTONS, CATEGORIES
from fronto.train.losses import Batch, losses
from fronto.train.network import Maps
from fronto.train.targets import IGNORE, SOME_BUTTON, Target, Targets, draw_targets

SURE = 30.0


def box(x0: float, y0: float, x1: float, y1: float) -> np.ndarray:
    return np.array([[x0, y0], [x1, y0], [x1, y1], [x0, y1]])


def batch_of(targets: Targets) -> Batch:
    image = torch.zeros(1, 3, *targets.masks.shape)
    parts = (torch.from_numpy(getattr(targets, name))[None] for name in Batch._fields[1:])
    return Batch(image, *parts)


def perfect(batch: Batch) -> Maps:
    """What the targets say, without a doubt; the opposite where they say nothing."""
    masks = torch.stack([batch.masks == 1, batch.masks == 2], dim=1).float()
    classes = torch.where(batch.classes < len(CATEGORIES), batch.classes, 3).long()
    onehot = torch.nn.functional.one_hot(classes, len(CATEGORIES)).permute(0, 3, 1, 2)
    return Maps(
        (2 * masks - 1) * SURE,
        onehot.float() * SURE,
        torch.where(batch.centers == 1, SURE, -SURE),
        batch.sides.clone(),
    )


@pytest.fixture
def batch() -> Batch:
    objects = [
        Target("up", box(4, 4, 22, 24), exact=True),
        Target("number", box(30, 4, 50, 20), exact=False),
        Target("plate", box(4, 30, 20, 40), exact=True),
        Target("unknown", box(30, 28, 46, 44), exact=True),
        Target("other", box(50, 30, 63, 47), exact=True, ignore=True),
    ]
    return batch_of(draw_targets(objects, 64, 48))


def test_perfect_maps_cost_nothing(batch: Batch) -> None:
    parts = losses(perfect(batch), batch)
    for name, part in parts._asdict().items():
        assert float(part) == pytest.approx(0, abs=1e-3), name
    assert float(parts.total) == pytest.approx(0, abs=5e-3)


@pytest.mark.parametrize("name", ["classes", "masks", "centers", "sides"])
def test_each_wrong_map_costs(batch: Batch, name: str) -> None:
    maps = perfect(batch)
    wrong = maps.sides * 3 if name == "sides" else -getattr(maps, name)
    parts = losses(maps._replace(**{name: wrong}), batch)
    assert float(getattr(parts, name)) > 0.5
    others = [float(part) for key, part in parts._asdict().items() if key != name]
    assert max(others) < 1e-3


def test_the_cost_of_sides_is_that_of_the_paper() -> None:
    # Half a box of 8 x 8 in a box of 8 x 8: IoU 1/2, no gap in the hull.
    sides = torch.tensor([4.0, 4, 4, 4]).reshape(1, 4, 1, 1)
    half = torch.tensor([4.0, 4, 0, 4]).reshape(1, 4, 1, 1)
    one = torch.ones(1, 1, 1)
    maps = Maps(torch.zeros(1, 2, 4, 4), torch.zeros(1, 11, 1, 1), torch.zeros(1, 2, 1, 1), half)
    empty = torch.zeros(1, 1, 1, dtype=torch.uint8)
    masks = torch.zeros(1, 4, 4, dtype=torch.uint8)
    batch = Batch(torch.zeros(1, 3, 4, 4), masks, empty, one, torch.zeros(1, 2, 1, 1), sides, one)
    assert float(losses(maps, batch).sides) == pytest.approx(0.5)


def test_nothing_is_learnt_from_what_is_ignored(batch: Batch) -> None:
    maps = Maps(*(torch.randn_like(m).requires_grad_() for m in perfect(batch)[:3]), batch.sides)
    losses(maps, batch).total.backward()
    open_pixels = (batch.masks == IGNORE)[:, None].expand_as(maps.masks)
    open_cells = (batch.classes == IGNORE)[:, None].expand_as(maps.classes)
    for values, ignored in (
        (maps.masks, open_pixels),
        (maps.classes, open_cells),
        (maps.centers, batch.centers < 0),
    ):
        assert ignored.any()
        assert (values.grad[ignored] == 0).all()
        assert (values.grad[~ignored] != 0).all()


def test_any_button_will_do_where_the_kind_is_unknown() -> None:
    batch = batch_of(draw_targets([Target("unknown", box(0, 0, 63, 63), exact=True)], 64, 64))
    assert (batch.classes == SOME_BUTTON).all()
    maps = perfect(batch)

    def cost(category: str) -> float:
        logits = torch.zeros_like(maps.classes)
        logits[:, CATEGORIES.index(category)] = SURE
        return float(losses(maps._replace(classes=logits), batch).classes)

    assert [cost(name) for name in BUTTONS] == pytest.approx([0] * len(BUTTONS), abs=1e-6)
    assert cost("plate") > 10
    assert cost("background") > 10


def test_a_batch_with_nothing_in_it_is_finite() -> None:
    batch = batch_of(draw_targets([], 32, 32))
    maps = Maps(*(torch.randn_like(m) for m in perfect(batch)[:3]), batch.sides)
    assert torch.isfinite(losses(maps, batch).total)


def test_half_precision_maps_are_compared_in_full(batch: Batch) -> None:
    maps = perfect(batch)
    parts = losses(Maps(*(m.bfloat16() for m in maps if m is not None)), batch)
    assert all(part.dtype == torch.float32 for part in parts)
    assert float(parts.masks) < 1e-3
