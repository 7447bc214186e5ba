"""The mask head's network, its losses, its batches and its training loop."""

from __future__ import annotations

import csv
import itertools
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("tqdm")

from torch import Tensor, nn

from fronto.errors import InputError
from fronto.maskhead import SIDE
from fronto.train.masks.fit import (
    EDGE,
    MaskBatch,
    MaskFit,
    _batches,
    _disturbed,
    _taken,
    _turned,
    fit_masks,
    load_masks,
    mask_losses,
)
from fronto.train.masks.network import Drawn, MaskNetwork, MaskOptions
from fronto.train.masks.pool import Pool
from fronto.train.masks.validate import AT_ONCE, mask_figures, mask_validation

SMALL = MaskOptions(widths=(8, 8, 8), blocks=(0, 1, 0), fine=4)
OPTIONS = MaskFit(steps=3, batch=4, warmup=1, save_every=2)


@pytest.fixture(autouse=True)
def one_thread() -> Iterator[None]:
    """Several only wait for each other: the batches are tiny."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


def pool(n: int, seed: int = 0) -> Pool:
    """Small discs, which are ellipses, and large squares, brighter than what is around them.

    The rough masks are larger, and not quite at their place.
    """
    rng = np.random.default_rng(seed)
    rows, columns = np.indices((SIDE, SIDE))
    photo = np.zeros((n, SIDE, SIDE, 3), np.uint8)
    rough, masks = (np.zeros((n, SIDE, SIDE), np.uint8) for _ in range(2))
    forms = rng.integers(0, 2, n).astype(np.uint8)
    for k, form in enumerate(forms):
        x, y = rng.uniform(20, 27, 2)
        dx, dy = np.abs(columns - x), np.abs(rows - y)
        away = np.hypot(dx, dy) if form else np.maximum(dx, dy)
        radius = rng.uniform(9, 12) if form else rng.uniform(14, 17)
        inside = away < radius
        dark, bright = rng.uniform(20, 100), rng.uniform(130, 250)
        light = np.where(inside, bright, dark)[..., None] + rng.normal(0, 3, (SIDE, SIDE, 3))
        photo[k] = np.clip(light, 0, 255)
        masks[k] = 255 * inside
        off = np.roll(away, rng.integers(-4, 5, 2), axis=(0, 1)) - radius
        rough[k] = 255 * (off < 3)
    return Pool(photo, rough, masks, forms)


def wild_network(options: MaskOptions = SMALL) -> MaskNetwork:
    """One whose answers differ: it has seen enough patches to know what to normalise by."""
    torch.manual_seed(0)
    network = MaskNetwork(options)
    with torch.no_grad():
        for _ in range(40):
            batch = batch_of(pool(8))
            network(batch.photo, batch.rough)
    return network.eval()


def batch_of(pool: Pool) -> MaskBatch:
    return _taken(pool, np.arange(len(pool)))


@torch.no_grad()
def answers(network: MaskNetwork, batch: MaskBatch) -> Drawn:
    return network(batch.photo, batch.rough)


class TestNetwork:
    @pytest.mark.parametrize("options", [None, SMALL], ids=["as it is", "small"])
    def test_shapes(self, options: MaskOptions | None) -> None:
        told = answers(MaskNetwork(options).eval(), batch_of(pool(3)))
        assert told.masks.shape == (3, SIDE, SIDE)
        assert told.forms.shape == (3, 3)

    def test_a_patch_alone_or_in_a_batch(self) -> None:
        network, batch = wild_network(), batch_of(pool(5))
        together = answers(network, batch)
        for k in range(5):
            one = MaskBatch(*(part[k : k + 1] for part in batch))
            for a, b in zip(answers(network, one), together, strict=True):
                assert b.std() > 0.01
                torch.testing.assert_close(a[0], b[k], atol=1e-4, rtol=1e-4)

    def test_more_or_less_light_changes_next_to_nothing(self) -> None:
        network, batch = wild_network(), batch_of(pool(8))
        before = answers(network, batch).masks
        spread = before.std(dim=0).mean()
        assert spread > 0.05
        lifted = answers(network, batch._replace(photo=batch.photo + 0.2)).masks
        assert (lifted - before).abs().max() < 1e-3 * spread
        for gain in (0.6, 1.5):
            changed = answers(network, batch._replace(photo=gain * batch.photo)).masks
            assert (changed - before).abs().mean() < 0.2 * spread
        other = answers(network, batch._replace(photo=batch.photo.flip(0))).masks
        assert (other - before).abs().mean() > 0.5 * spread

    def test_without_light_it_is_finite(self) -> None:
        network, batch = wild_network(), batch_of(pool(2))
        for level in (0.0, 1.0):
            told = answers(network, batch._replace(photo=torch.full_like(batch.photo, level)))
            assert all(part.isfinite().all() for part in told)

    @pytest.mark.parametrize("name", ["photo", "rough"])
    def test_it_looks_at_both(self, name: str) -> None:
        network, batch = wild_network(), batch_of(pool(2))
        changed = batch._replace(**{name: getattr(batch, name).roll(5, -1)})
        for a, b in zip(answers(network, batch), answers(network, changed), strict=True):
            assert (a - b).abs().max() > 1e-2

    @pytest.mark.parametrize(
        ("name", "value"),
        [("widths", (8, 0, 8)), ("blocks", (1, 1, -1)), ("fine", 0)],
    )
    def test_heads_that_are_refused(self, name: str, value: object) -> None:
        with pytest.raises(InputError, match=name):
            replace(SMALL, **{name: value})

    def test_options_of_a_checkpoint_are_the_same(self) -> None:
        assert MaskOptions(widths=[8, 8, 8], blocks=[0, 1, 0], fine=4) == SMALL  # type: ignore[arg-type]


def perfect(batch: MaskBatch) -> Drawn:
    """As sure as what is smoothed wants it."""
    forms = nn.functional.one_hot(batch.forms.clamp(min=0), 3) * 5.0
    return Drawn(20 * (batch.masks - 0.5), forms)


def with_pixels(batch: MaskBatch, wrong: Tensor) -> Drawn:
    told = perfect(batch)
    return told._replace(masks=torch.where(wrong, -told.masks, told.masks))


class TestLosses:
    def test_perfect_answers_cost_next_to_nothing(self) -> None:
        batch = batch_of(pool(6))
        found = mask_losses(perfect(batch), batch)
        assert float(found.pixels) < 1e-3
        assert float(found.overlap) < 5e-3
        assert float(found.forms) < 0.2
        assert float(found.total) < 0.03

    def test_each_wrong_answer_costs(self) -> None:
        batch = batch_of(pool(6))
        told = perfect(batch)
        right = mask_losses(told, batch)
        masks = mask_losses(told._replace(masks=-told.masks), batch)
        assert masks.pixels > right.pixels + 5
        assert masks.overlap > 0.95
        assert masks.forms == right.forms
        forms = mask_losses(told._replace(forms=-told.forms), batch)
        assert forms.forms > right.forms + 1
        assert (forms.pixels, forms.overlap) == (right.pixels, right.overlap)
        assert min(masks.total, forms.total) > right.total

    def test_the_more_is_wrong_the_more_it_costs(self) -> None:
        batch = batch_of(pool(6))
        costs = [
            mask_losses(perfect(batch._replace(masks=batch.masks.roll(by, dims=2))), batch)
            for by in (0, 1, 2, 5)
        ]
        for name in ("total", "pixels", "overlap"):
            values = [float(getattr(cost, name)) for cost in costs]
            assert values == sorted(values)
            assert values[0] < 0.5 * values[1]

    def test_pixels_at_edges_count_more(self) -> None:
        true = torch.zeros(1, SIDE, SIDE)
        true[:, 12:36, 12:36] = 1
        batch = MaskBatch(torch.zeros(1, 3, SIDE, SIDE), true, true, torch.tensor([0]))
        right = mask_losses(perfect(batch), batch).pixels

        def cost(row: int, column: int) -> float:
            wrong = torch.zeros_like(true, dtype=torch.bool)
            wrong[0, row, column] = True
            return float(mask_losses(with_pixels(batch, wrong), batch).pixels - right)

        inside, outside = cost(24, 24), cost(3, 3)
        assert inside == pytest.approx(outside, rel=1e-3)
        for place in ((12, 24), (11, 24), (10, 24), (24, 37), (13, 13)):
            assert cost(*place) == pytest.approx((1 + EDGE) * inside, rel=1e-3)
        assert cost(8, 24) == pytest.approx(inside, rel=1e-3)

    def test_forms_that_nobody_knows_do_not_count(self) -> None:
        batch = batch_of(pool(4))
        batch.forms[1] = batch.forms[3] = -1
        generator = torch.Generator().manual_seed(0)
        told = Drawn(
            torch.randn(4, SIDE, SIDE, generator=generator),
            torch.randn(4, 3, generator=generator),
        )
        known = MaskBatch(*(part[[0, 2]] for part in batch))
        alone = mask_losses(Drawn(*(part[[0, 2]] for part in told)), known)
        for part in told:
            part.requires_grad_()
        found = mask_losses(told, batch)
        found.total.backward()
        assert told.forms.grad is not None
        assert (told.forms.grad[[1, 3]] == 0).all()
        assert (told.forms.grad[[0, 2]] != 0).all()
        assert told.masks.grad is not None
        assert (told.masks.grad != 0).flatten(1).any(dim=1).all()
        assert float(found.forms.detach()) == pytest.approx(float(alone.forms), rel=1e-5)

    def test_a_batch_without_forms_is_finite(self) -> None:
        batch = batch_of(pool(3))
        batch.forms[:] = -1
        network = wild_network()
        found = mask_losses(network(batch.photo, batch.rough), batch)
        assert float(found.forms.detach()) == 0
        found.total.backward()
        assert all(p.grad is None or p.grad.isfinite().all() for p in network.parameters())

    def test_an_empty_mask_is_finite(self) -> None:
        batch = batch_of(pool(2))
        batch = batch._replace(masks=torch.zeros_like(batch.masks))
        assert mask_losses(perfect(batch), batch).total.isfinite()


class TestBatches:
    def test_bytes_become_shares(self) -> None:
        given = replace(pool(4), forms=np.array([0, 255, 2, 1], np.uint8))
        taken = _taken(given, np.array([1, 3]))
        np.testing.assert_allclose(
            taken.photo.permute(0, 2, 3, 1), given.photo[[1, 3]] / 255, atol=1e-6
        )
        np.testing.assert_allclose(taken.rough, given.rough[[1, 3]] / 255, atol=1e-6)
        np.testing.assert_allclose(taken.masks, given.masks[[1, 3]] / 255, atol=1e-6)
        assert taken.forms.tolist() == [-1, 1]

    def test_every_patch_comes_once_in_each_round(self, monkeypatch: pytest.MonkeyPatch) -> None:
        monkeypatch.setattr("fronto.train.masks.fit._disturbed", MaskBatch)
        given = pool(10)
        given.rough[:] = np.arange(10, dtype=np.uint8)[:, None, None]
        found = [batch.rough for batch in itertools.islice(_batches(given, 4, 0), 6)]
        assert [len(rough) for rough in found] == [4, 4, 2] * 2
        numbers = [
            (255 * torch.cat(part)[:, 0, 0]).round().tolist() for part in (found[:3], found[3:])
        ]
        assert [sorted(each) for each in numbers] == [list(range(10))] * 2
        assert numbers[0] != numbers[1]

    def test_turned_and_mirrored_together(self) -> None:
        torch.manual_seed(0)
        first = torch.arange(25.0).reshape(1, 1, 5, 5).expand(200, -1, -1, -1)
        found = _turned(torch.cat([first, 100 + first], dim=1))
        assert (found[:, 1] == 100 + found[:, 0]).all()
        one = first[0, 0]
        ways = [t for turn in range(4) for t in (one.rot90(turn), one.rot90(turn).T)]
        counts = [int((found[:, 0] == way).all(dim=(1, 2)).sum()) for way in ways]
        assert sum(counts) == 200
        assert min(counts) > 10

    def test_a_disturbed_patch_still_fits_its_masks(self) -> None:
        torch.manual_seed(0)
        given = batch_of(pool(300))
        given = given._replace(rough=0.5 * given.masks)
        found = _disturbed(*given)
        assert torch.equal(found.forms, given.forms)
        # The brighter pixels are those of the mask, whichever way it has been turned.
        inside = found.masks > 0.5
        grey = found.photo.mean(dim=1)
        bright, dark = (
            (grey * part).sum(dim=(1, 2)) / part.sum(dim=(1, 2)) for part in (inside, ~inside)
        )
        between = ((bright + dark) / 2)[:, None, None]
        assert ((grey > between) == inside).float().mean() > 0.99
        left_out = (found.rough == 0).all(dim=(1, 2))
        assert torch.equal(found.rough[~left_out], 0.5 * found.masks[~left_out])
        assert 3 <= left_out.sum() <= 40
        turned = (found.masks != given.masks).any(dim=(1, 2))
        assert turned.float().mean() > 0.7

    def test_light_and_colours_are_disturbed(self) -> None:
        torch.manual_seed(0)
        given = batch_of(pool(300))
        given.photo[:, 0] *= 0.5
        means = _disturbed(*given).photo.mean(dim=(2, 3))
        assert (means.mean(dim=1) / given.photo.mean(dim=(1, 2, 3))).log().std() > 0.15
        grey = (means.std(dim=1) / means.mean(dim=1)) < 0.02
        assert 0.05 < grey.float().mean() < 0.3


class Red(nn.Module):
    """A head whose masks are what is red, and whose forms are told by the green."""

    def __init__(self) -> None:
        super().__init__()
        self.unused = nn.Parameter(torch.zeros(1))
        self.sizes: list[int] = []

    def forward(self, photo: Tensor, rough: Tensor) -> Drawn:
        self.sizes.append(len(photo))
        green = (photo[:, 1].mean(dim=(1, 2)) * 255).round().long()
        return Drawn(photo[:, 0] - 0.5, nn.functional.one_hot(green, 3).float())


class TestFigures:
    def red_pool(self, n: int) -> Pool:
        given = pool(n)
        photo = np.zeros_like(given.photo)
        photo[..., 0] = given.masks
        photo[..., 1] = given.forms[:, None, None]
        return replace(given, photo=photo)

    def test_of_a_perfect_head(self) -> None:
        given, head = self.red_pool(AT_ONCE + 3), Red()
        rough, true = given.rough > 127, given.masks > 127
        shares = (rough & true).sum(axis=(1, 2)) / (rough | true).sum(axis=(1, 2))
        found = mask_figures(head, given)  # type: ignore[arg-type]
        assert found["iou_rough"] == pytest.approx(np.median(shares))
        assert 0.3 < found.pop("iou_rough") < 0.9
        assert found == {"iou": 1, "iou_tenth": 1, "forms_right": 1}
        assert head.sizes == [AT_ONCE, 3]

    def test_of_one_that_errs(self) -> None:
        given = self.red_pool(20)
        given.photo[:3, ..., 0] = 0
        given.photo[:5, ..., 1] = 2
        found = mask_validation(given)(Red())  # type: ignore[arg-type]
        assert found["iou"] == 1
        assert found["iou_tenth"] == 0
        assert found["forms_right"] == 0.75

    def test_forms_that_nobody_knows_do_not_count(self) -> None:
        given = self.red_pool(6)
        given.photo[:2, ..., 1] = 2
        given.forms[:2] = Pool.UNKNOWN
        assert mask_figures(Red(), given)["forms_right"] == 1  # type: ignore[arg-type]
        given.forms[:] = Pool.UNKNOWN
        assert np.isnan(mask_figures(Red(), given)["forms_right"])  # type: ignore[arg-type]


def rows(run: Path) -> list[dict[str, str]]:
    with (run / "metrics.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def test_it_learns_a_rule(tmp_path: Path) -> None:
    options = MaskFit(steps=80, batch=16, rate=1e-2, warmup=5, average=0.9, save_every=80)
    torch.manual_seed(0)
    network = fit_masks(MaskNetwork(SMALL), pool(128), tmp_path, options, progress=False)
    found = mask_figures(network, pool(60, seed=1))
    assert found["iou_rough"] < 0.75
    assert found["iou"] > 0.9
    assert found["forms_right"] > 0.9


def test_a_run_and_going_on(tmp_path: Path) -> None:
    given = pool(10)
    seen = []

    def validate(network: MaskNetwork) -> dict[str, float]:
        assert not network.training
        seen.append(network)
        return {"iou": 0.25}

    torch.manual_seed(0)
    first = fit_masks(
        MaskNetwork(SMALL), given, tmp_path, OPTIONS, validate=validate, progress=False
    )
    assert not first.training
    assert [row["step"] for row in rows(tmp_path)] == ["2", "3"]
    assert all(float(row["iou"]) == 0.25 for row in rows(tmp_path))
    names = ("total", "pixels", "overlap", "forms", "rate")
    assert all(float(row[name]) > 0 for row in rows(tmp_path) for name in names)
    assert len(seen) == 2

    kept = load_masks(tmp_path / "last.pt")
    assert kept.options == SMALL
    assert not kept.training
    for a, b in zip(first.state_dict().values(), kept.state_dict().values(), strict=True):
        assert torch.equal(a.cpu(), b)

    longer = replace(OPTIONS, steps=5)
    further = fit_masks(MaskNetwork(SMALL), given, tmp_path, longer, progress=False)
    assert [row["step"] for row in rows(tmp_path)] == ["2", "3", "4", "5"]
    weights = [network.state_dict()["to_full.weight"] for network in (first, further)]
    assert not torch.equal(*weights)


def test_fewer_patches_than_a_batch_has(tmp_path: Path) -> None:
    network = fit_masks(MaskNetwork(SMALL), pool(1), tmp_path, OPTIONS, progress=False)
    assert all(parameter.isfinite().all() for parameter in network.parameters())


def test_a_run_of_another_head_is_refused(tmp_path: Path) -> None:
    fit_masks(MaskNetwork(SMALL), pool(4), tmp_path, OPTIONS, progress=False)
    before = (tmp_path / "last.pt").read_bytes()
    other = MaskNetwork(replace(SMALL, fine=5))
    with pytest.raises(InputError, match="fine"):
        fit_masks(other, pool(4), tmp_path, OPTIONS, progress=False)
    assert (tmp_path / "last.pt").read_bytes() == before


@pytest.mark.parametrize("content", [None, b"", b"no checkpoint"])
def test_a_file_that_is_no_checkpoint(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "last.pt"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=r"last\.pt"):
        load_masks(path)


@pytest.mark.parametrize(("name", "value"), [("steps", 0), ("batch", 0), ("rate", -1)])
def test_training_options_that_are_refused(name: str, value: float) -> None:
    with pytest.raises(InputError, match=name):
        MaskFit(**{name: value})
