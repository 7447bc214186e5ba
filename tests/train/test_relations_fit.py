"""The relation head's network, its losses and its training loop."""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("tqdm")

from fronto.errors import InputError
from fronto.train.relations.fit import (
    RelationBatch,
    RelationFit,
    batch_of,
    fit_relations,
    load_relations,
    relation_losses,
)
from fronto.train.relations.network import Judgement, RelationNetwork, RelationOptions
from fronto.train.relations.pool import Picture

SMALL = RelationOptions(features=5, reduced=4, width=16, layers=2, heads=2)
OPTIONS = RelationFit(steps=3, batch=2, warmup=1, save_every=2)


def picture(n: int, seed: int, rule: Callable[[Picture], np.ndarray] | None = None) -> Picture:
    """Candidates anywhere; a rule says which are buttons."""
    rng = np.random.default_rng(seed)
    low = rng.uniform(0, 200, (n, 2))
    drawn = Picture(
        shape=(240, 240),
        looks=(rng.normal(size=(n, 1, 5)) + 0.3 * rng.normal(size=(n, 49, 5))).astype(np.float16),
        boxes=np.hstack([low, low + rng.choice([12.0, 30.0], n)[:, None]]),
        confidence=rng.uniform(0.15, 0.95, n),
        plates=np.zeros(n, bool),
        scores=rng.dirichlet(np.ones(11), n),
        kinds=rng.integers(0, 3, n),
        classes=rng.integers(0, 11, n),
        shifts=rng.normal(0, 0.1, (n, 4)),
    )
    return drawn if rule is None else replace(drawn, kinds=rule(drawn).astype(np.int64))


def wild_network(options: RelationOptions = SMALL) -> RelationNetwork:
    """One whose answers differ: as it begins, it has no opinion."""
    torch.manual_seed(0)
    network = RelationNetwork(options).eval()
    for parameter in network.parameters():
        torch.nn.init.normal_(parameter, std=0.3)
    return network


@torch.no_grad()
def answers(network: RelationNetwork, batch: RelationBatch) -> Judgement:
    return network(batch.looks, batch.geometry, batch.pairs, batch.there)


class TestNetwork:
    def test_untrained_it_has_no_opinion_and_leaves_boxes_as_they_are(self) -> None:
        told = answers(RelationNetwork(SMALL).eval(), batch_of([picture(4, 0)]))
        assert [tuple(part.shape) for part in told] == [(1, 4, 3), (1, 4, 11), (1, 4, 4)]
        assert all((part == 0).all() for part in told)

    def test_a_picture_alone_or_filled_up_in_a_batch(self) -> None:
        network, pictures = wild_network(), [picture(n, n) for n in (3, 12, 1)]
        together = answers(network, batch_of(pictures))
        for k, p in enumerate(pictures):
            alone = answers(network, batch_of([p]))
            assert alone.kinds.std() > 0.01
            for a, b in zip(alone, together, strict=True):
                torch.testing.assert_close(a[0], b[k, : len(p.boxes)], atol=1e-4, rtol=1e-4)

    def test_looks_may_be_packed_or_filled_up(self) -> None:
        network, batch = wild_network(), batch_of([picture(n, n) for n in (3, 7)])
        full = torch.zeros(*batch.there.shape, *batch.looks.shape[1:])
        full[batch.there] = batch.looks
        for a, b in zip(
            answers(network, batch), answers(network, batch._replace(looks=full)), strict=True
        ):
            torch.testing.assert_close(a[batch.there], b[batch.there], atol=1e-4, rtol=1e-4)

    def test_the_order_of_the_candidates_does_not_matter(self) -> None:
        network, batch = wild_network(), batch_of([picture(9, 1)])
        order = torch.randperm(9, generator=torch.Generator().manual_seed(0))
        mixed = batch._replace(
            looks=batch.looks[order],
            geometry=batch.geometry[:, order],
            pairs=batch.pairs[:, order][:, :, order],
        )
        for a, b in zip(answers(network, batch), answers(network, mixed), strict=True):
            assert not torch.allclose(a, b, atol=1e-2)
            torch.testing.assert_close(a[:, order], b, atol=1e-4, rtol=1e-4)

    def test_every_candidate_sees_the_others(self) -> None:
        network, batch = wild_network(), batch_of([picture(5, 2)])
        before = answers(network, batch).kinds
        batch.looks[4] += 3
        changed = (answers(network, batch).kinds - before).abs().amax(dim=-1)[0]
        assert (changed > 1e-4).all()


def perfect(batch: RelationBatch) -> Judgement:
    """As sure as what is smoothed wants it."""
    kinds = torch.nn.functional.one_hot(batch.kinds.clamp(min=0), 3) * 5.0
    classes = torch.nn.functional.one_hot(batch.classes.clamp(min=0), 11) * 30.0
    return Judgement(kinds, classes, batch.shifts.nan_to_num())


class TestLosses:
    def test_perfect_answers_cost_next_to_nothing(self) -> None:
        batch = batch_of([picture(5, 0), picture(3, 1)])
        found = relation_losses(perfect(batch), batch)
        assert float(found.kinds) < 0.2
        assert float(found.classes) < 1e-6
        assert float(found.shifts) == 0
        assert float(found.total) == pytest.approx(float(found.kinds), abs=1e-6)

    @pytest.mark.parametrize("name", ["kinds", "classes", "shifts"])
    def test_each_wrong_answer_costs(self, name: str) -> None:
        batch = batch_of([picture(5, 0), picture(3, 1)])
        told = perfect(batch)
        right = relation_losses(told, batch)
        wrong = relation_losses(told._replace(**{name: -getattr(told, name)}), batch)
        for part in ("kinds", "classes", "shifts"):
            more = float(getattr(wrong, part) - getattr(right, part))
            assert more > 0.05 if part == name else more == 0
        assert wrong.total > right.total

    def test_a_plate_taken_for_a_button_is_the_worst(self) -> None:
        batch = batch_of([picture(2, 0)])

        def cost(kind: int, told: int) -> float:
            given = batch._replace(kinds=torch.full((1, 2), kind))
            answer = perfect(given._replace(kinds=torch.full((1, 2), told)))
            return float(relation_losses(answer, given).kinds)

        assert cost(2, 1) > 1.5 * cost(1, 2)
        assert cost(2, 1) > 1.5 * cost(0, 1)

    def test_nothing_is_learnt_from_what_has_no_verdict(self) -> None:
        batch = batch_of([picture(5, 0), picture(3, 1)])
        batch.kinds[0, 1] = batch.classes[0, 2] = -1
        batch.shifts[0, 3] = torch.nan
        told = Judgement(
            *(torch.randn(2, 5, k, generator=torch.Generator().manual_seed(0)) for k in (3, 11, 4))
        )
        for part in told:
            part.requires_grad_()
        relation_losses(told, batch).total.backward()
        silent = [~batch.there for _ in told]
        silent[0][0, 1] = silent[1][0, 2] = silent[2][0, 3] = True
        for part, none in zip(told, silent, strict=True):
            assert part.grad is not None
            assert (part.grad[none] == 0).all()
            assert (part.grad[~none] != 0).any(dim=-1).all()

    def test_a_batch_without_verdicts_is_finite(self) -> None:
        batch = batch_of([picture(3, 0)])
        empty = batch._replace(
            kinds=torch.full((1, 3), -1),
            classes=torch.full((1, 3), -1),
            shifts=torch.full((1, 3, 4), torch.nan),
        )
        network = wild_network()
        told = network(batch.looks, batch.geometry, batch.pairs, batch.there)
        found = relation_losses(told, empty)
        assert [float(part.detach()) for part in found] == [0] * 4
        found.total.backward()
        assert all(p.grad is None or p.grad.isfinite().all() for p in network.parameters())


def rows(run: Path) -> list[dict[str, str]]:
    with (run / "metrics.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def large_first_feature(p: Picture) -> np.ndarray:
    return p.looks[:, :, 0].mean(axis=1) > 0


def test_it_learns_a_rule(tmp_path: Path) -> None:
    options = RelationFit(steps=150, batch=8, rate=1e-2, warmup=10, average=0.9, save_every=150)
    torch.manual_seed(0)
    pictures = [picture(6, seed, large_first_feature) for seed in range(80)]
    network = fit_relations(RelationNetwork(SMALL), pictures, tmp_path, options, progress=False)
    batch = batch_of([picture(6, 1000 + seed, large_first_feature) for seed in range(30)])
    right = answers(network.cpu(), batch).kinds.argmax(dim=-1) == batch.kinds
    assert float(right.float().mean()) > 0.93


def test_a_run_and_going_on(tmp_path: Path) -> None:
    pictures = [picture(n, n) for n in (2, 5, 3)]
    seen = []

    def validate(network: RelationNetwork) -> dict[str, float]:
        assert not network.training
        seen.append(network)
        return {"val_f1": 0.25}

    torch.manual_seed(0)
    first = fit_relations(
        RelationNetwork(SMALL), pictures, tmp_path, OPTIONS, validate=validate, progress=False
    )
    assert not first.training
    assert [row["step"] for row in rows(tmp_path)] == ["2", "3"]
    assert all(float(row["val_f1"]) == 0.25 for row in rows(tmp_path))
    assert all(float(row[k]) > 0 for row in rows(tmp_path) for k in ("total", "kinds", "rate"))
    assert len(seen) == 2

    kept = load_relations(tmp_path / "last.pt")
    assert kept.options == SMALL
    assert not kept.training
    for a, b in zip(first.state_dict().values(), kept.state_dict().values(), strict=True):
        assert torch.equal(a.cpu(), b)

    longer = replace(OPTIONS, steps=5)
    further = fit_relations(RelationNetwork(SMALL), pictures, tmp_path, longer, progress=False)
    assert [row["step"] for row in rows(tmp_path)] == ["2", "3", "4", "5"]
    weights = [network.state_dict()["look.weight"] for network in (first, further)]
    assert not torch.equal(*weights)


def test_a_run_of_another_head_is_refused(tmp_path: Path) -> None:
    pictures = [picture(3, 0)]
    fit_relations(RelationNetwork(SMALL), pictures, tmp_path, OPTIONS, progress=False)
    before = (tmp_path / "last.pt").read_bytes()
    with pytest.raises(InputError, match="width"):
        fit_relations(
            RelationNetwork(replace(SMALL, width=8)), pictures, tmp_path, OPTIONS, progress=False
        )
    assert (tmp_path / "last.pt").read_bytes() == before


@pytest.mark.parametrize("content", [None, b"", b"no checkpoint"])
def test_a_file_that_is_no_checkpoint(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "last.pt"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=r"last\.pt"):
        load_relations(path)


@pytest.mark.parametrize(
    ("name", "value"),
    [("steps", 0), ("batch", 0), ("save_every", 0), ("rate", -1), ("average", 2), ("features", 1)],
)
def test_training_options_that_are_refused(name: str, value: float) -> None:
    with pytest.raises(InputError, match=name):
        RelationFit(**{name: value})


@pytest.mark.parametrize(("name", "value"), [("width", 130), ("layers", 0), ("dropout", 1.0)])
def test_heads_that_are_refused(name: str, value: float) -> None:
    with pytest.raises(InputError, match=name):
        RelationOptions(**{name: value})
