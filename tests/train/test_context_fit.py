"""The context head's network, what is done to its examples, and its training loop."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")
pytest.importorskip("tqdm")

from fronto.errors import InputError
from fronto.labels.context import GEOMETRY, PAIR, Context, describe
from fronto.labels.evidence import Evidence, Said
from fronto.results import Button
from fronto.shapes import Outline
from fronto.train.context.examples import Example
from fronto.train.context.fit import (
    ContextFit,
    batch_of,
    fit_context,
    load_context,
    renumbered,
)
from fronto.train.context.network import ContextNetwork, ContextOptions

LABELS = tuple(str(k) for k in range(10))
COUNT = len(LABELS) + 2
#: No label that the head knows, or none at all.
NONE, OTHER = len(LABELS), len(LABELS) + 1
SMALL = ContextOptions(width=16, layers=2, heads=2)
OPTIONS = ContextFit(steps=3, batch=2, warmup=1, save_every=2)


def example(n: int, seed: int) -> Example:
    """Anything."""
    rng = np.random.default_rng(seed)
    own, seen, ordered = (rng.dirichlet(np.full(COUNT, 0.2), n) for _ in range(3))
    geometry, pairs = rng.normal(size=(n, GEOMETRY)), rng.normal(size=(n, n, PAIR))
    parts = (own, seen, ordered, geometry, pairs)
    return Example(
        Context(*(part.astype(np.float32) for part in parts)),
        rng.integers(-1, COUNT, n),
        rng.random(n).astype(np.float32),
    )


def column(n: int, seed: int, floors: range = range(1, 10)) -> Example:
    """Buttons above each other, of these floors, that count on from below; one is not read.

    Another one than the lowest. What the order would make of it is left out.
    """
    rng = np.random.default_rng(seed)
    lowest = int(rng.integers(floors[0], floors[-1] + 2 - n))
    numbers = np.arange(lowest + n - 1, lowest - 1, -1)
    own = [{str(number): 0.97} for number in numbers.tolist()]
    own[int(rng.integers(0, n - 1))] = {}
    low = np.array([[0.0, 50.0 * k] for k in range(n)])
    boxes = np.hstack([low, low + 30])
    buttons = [
        Button(k, Outline.quad(box[[[0, 1], [2, 1], [2, 3], [0, 3]]]), None, None, 0.1, 1.0)
        for k, box in enumerate(boxes)
    ]
    said = [Said(labels, "text" if labels else "unreadable") for labels in own]
    evidence = Evidence(tuple(own), tuple({} for _ in own), (), ())
    context = describe(buttons, said, evidence, own, own, boxes, LABELS, posed=True)
    return Example(context, numbers.astype(np.int64), np.ones(n, np.float32))


def wild_network(options: ContextOptions = SMALL) -> ContextNetwork:
    """One whose answers differ from what it is told."""
    torch.manual_seed(0)
    network = ContextNetwork(LABELS, options).eval()
    for parameter in network.parameters():
        torch.nn.init.normal_(parameter, std=0.3)
    return network


@torch.no_grad()
def answers(network: ContextNetwork, examples: Sequence[Example]) -> torch.Tensor:
    return network.cpu()(*batch_of(examples, COUNT)[:6])


class TestNetwork:
    def test_untrained_it_says_what_the_order_says(self) -> None:
        given = [example(4, 0), example(7, 1)]
        told = answers(ContextNetwork(LABELS, SMALL).eval(), given)
        assert told.shape == (2, 7, COUNT)
        for row, e in zip(told.softmax(-1).numpy(), given, strict=True):
            n = len(e.target)
            np.testing.assert_allclose(row[:n], e.context.ordered, atol=2e-3)
            np.testing.assert_array_equal(row[:n].argmax(axis=1), e.context.ordered.argmax(axis=1))

    def test_a_panel_alone_or_filled_up_in_a_batch(self) -> None:
        network, given = wild_network(), [example(n, n) for n in (3, 12, 1)]
        together = answers(network, given)
        for k, e in enumerate(given):
            alone = answers(network, [e])[0]
            assert alone.std() > 0.1
            torch.testing.assert_close(alone, together[k, : len(alone)], atol=1e-4, rtol=1e-4)

    def test_the_order_of_the_things_does_not_matter(self) -> None:
        network, given = wild_network(), example(9, 1)
        order = np.random.default_rng(0).permutation(9)
        c = given.context
        mixed = Context(
            c.own[order],
            c.seen[order],
            c.ordered[order],
            c.geometry[order],
            c.pairs[np.ix_(order, order)],
        )
        before, after = (
            answers(network, [given])[0],
            answers(network, [replace(given, context=mixed)])[0],
        )
        assert not torch.allclose(before, after, atol=1e-2)
        torch.testing.assert_close(before[order], after, atol=1e-4, rtol=1e-4)

    @pytest.mark.parametrize("part", ["own", "seen", "ordered", "geometry"])
    def test_every_thing_sees_the_others(self, part: str) -> None:
        network, given = wild_network(), example(5, 2)
        before = answers(network, [given])[0]
        getattr(given.context, part)[4] += 0.5
        changed = (answers(network, [given])[0] - before).abs().amax(dim=-1)
        assert (changed > 1e-4).all()

    def test_how_things_lie_to_each_other_matters(self) -> None:
        network, given = wild_network(), example(5, 2)
        before = answers(network, [given])[0]
        given.context.pairs[1, 3] += 1
        changed = (answers(network, [given])[0] - before).abs().amax(dim=-1)
        assert changed[1] > 1e-4


class TestExamples:
    def test_a_batch_is_filled_up(self) -> None:
        given = [example(2, 0), example(4, 1)]
        batch = batch_of(given, COUNT)
        assert batch.there.tolist() == [[True, True, False, False], [True] * 4]
        assert (batch.target[0, 2:] == -1).all()
        assert (batch.weight[0, 2:] == 0).all()
        for k, e in enumerate(given):
            n = len(e.target)
            for name in ("own", "seen", "ordered", "geometry"):
                np.testing.assert_array_equal(getattr(batch, name)[k, :n], getattr(e.context, name))
            np.testing.assert_array_equal(batch.pairs[k, :n, :n], e.context.pairs)
            np.testing.assert_array_equal(batch.target[k, :n], e.target)
            np.testing.assert_array_equal(batch.weight[k, :n], e.weight)
        assert all(part.isfinite().all() for part in batch)

    def test_part_of_a_panel(self) -> None:
        given = example(5, 0)
        kept = np.array([True, False, True, True, False])
        found = given.part(kept)
        at = [0, 2, 3]
        np.testing.assert_array_equal(found.target, given.target[at])
        np.testing.assert_array_equal(found.weight, given.weight[at])
        np.testing.assert_array_equal(found.context.seen, given.context.seen[at])
        for k, i in enumerate(at):
            for m, j in enumerate(at):
                np.testing.assert_array_equal(found.context.pairs[k, m], given.context.pairs[i, j])


class TestRenumbered:
    #: Floors 0 to 9 among other labels, not in their order.
    FLOORS = np.array([3, 1, 2, 0, 4, 6, 5, 9, 8, 7], dtype=np.intp)

    @staticmethod
    def told(target: list[int]) -> Example:
        """Floors that are sure in all parts, by different numbers."""
        e = example(len(target), 0)
        for share, name in zip((0.5, 0.75, 1.0), ("own", "seen", "ordered"), strict=True):
            rows = getattr(e.context, name)
            rows[:] = 0
            rows[np.arange(len(target)), target] = share
        return replace(e, target=np.array(target))

    @pytest.mark.parametrize("by", [0, 1, 4, -2])
    def test_all_parts_move_together(self, by: int) -> None:
        numbers = [2, 5, 3]
        given = self.told(self.FLOORS[numbers].tolist())
        found = renumbered(given, by, self.FLOORS)
        expected = self.FLOORS[[k + by for k in numbers]]
        np.testing.assert_array_equal(found.target, expected)
        for share, name in zip((0.5, 0.75, 1.0), ("own", "seen", "ordered"), strict=True):
            rows = getattr(found.context, name)
            np.testing.assert_array_equal(rows.argmax(axis=1), expected)
            np.testing.assert_array_equal(rows.max(axis=1), np.float32(share))
            np.testing.assert_array_equal(rows.sum(axis=1), np.float32(share))
        np.testing.assert_array_equal(found.context.pairs, given.context.pairs)
        np.testing.assert_array_equal(found.context.geometry, given.context.geometry)
        np.testing.assert_array_equal(found.weight, given.weight)

    def test_there_and_back(self) -> None:
        given = self.told(self.FLOORS[[2, 5, 3]].tolist())
        found = renumbered(renumbered(given, 4, self.FLOORS), -4, self.FLOORS)
        np.testing.assert_array_equal(found.target, given.target)
        np.testing.assert_array_equal(found.context.own, given.context.own)

    @pytest.mark.parametrize(("by", "lost"), [(3, 8), (-3, 1)])
    def test_what_leaves_the_range_is_lost(self, by: int, lost: int) -> None:
        found = renumbered(self.told(self.FLOORS[[5, lost]].tolist()), by, self.FLOORS)
        np.testing.assert_array_equal(found.target, [self.FLOORS[5 + by], -1])
        assert not found.context.own[1].any()
        assert not found.context.ordered[1].any()
        assert found.context.seen[0].any()

    def test_what_is_no_floor_stays(self) -> None:
        given = self.told([NONE, OTHER, self.FLOORS[2]])
        given.target[0] = -1
        found = renumbered(given, 3, self.FLOORS)
        assert found.target.tolist() == [-1, OTHER, self.FLOORS[5]]
        np.testing.assert_array_equal(found.context.own[:2], given.context.own[:2])
        # Labels without a number, too.
        found = renumbered(self.told([7, 2]), 1, np.array([0, 1, 2, 3]))
        assert found.target.tolist() == [7, 3]
        assert found.context.seen[0].argmax() == 7

    def test_the_example_itself_is_left_alone(self) -> None:
        given = self.told(self.FLOORS[[2, 5]].tolist())
        own, target = given.context.own.copy(), given.target.copy()
        renumbered(given, 2, self.FLOORS)
        np.testing.assert_array_equal(given.context.own, own)
        np.testing.assert_array_equal(given.target, target)


def rows(run: Path) -> list[dict[str, str]]:
    with (run / "metrics.csv").open(encoding="utf-8", newline="") as file:
        return list(csv.DictReader(file))


def right(network: ContextNetwork, examples: Sequence[Example]) -> float:
    """Share of the panels whose button that was not read is named as it should be."""
    told = answers(network, examples).argmax(dim=-1).numpy()
    unread = [int(np.flatnonzero(~e.context.own.any(axis=1))[0]) for e in examples]
    found = [t[k] == e.target[k] for t, k, e in zip(told, unread, examples, strict=True)]
    return float(np.mean(found))


def test_it_learns_to_count(tmp_path: Path) -> None:
    options = ContextFit(steps=300, batch=16, rate=5e-3, warmup=20, average=0.95, save_every=300)
    shape = ContextOptions(width=48, layers=1, heads=2, dropout=0.0)
    # Of low floors only: the numbers themselves are not to be learnt by heart.
    examples = [column(2 + seed % 3, seed, range(1, 6)) for seed in range(200)]
    fresh = [column(2 + seed % 3, 1000 + seed) for seed in range(60)]
    torch.manual_seed(0)
    network = ContextNetwork(LABELS, shape)
    assert right(network.eval(), fresh) < 0.3
    network = fit_context(network, examples, tmp_path, options, progress=False)
    assert right(network, fresh) > 0.9


def test_nothing_is_learnt_from_what_has_no_verdict_or_counts_nothing(tmp_path: Path) -> None:
    silent = [
        replace(e, target=np.full(4, -1)) if k % 2 else replace(e, weight=np.zeros(4, np.float32))
        for k, e in enumerate(example(4, seed) for seed in range(4))
    ]
    torch.manual_seed(0)
    network = ContextNetwork(LABELS, SMALL)
    before = {name: value.clone() for name, value in network.state_dict().items()}
    still = replace(OPTIONS, decay=0.0)
    network = fit_context(network, silent, tmp_path / "silent", still, progress=False)
    assert all(torch.equal(value.cpu(), before[k]) for k, value in network.state_dict().items())
    assert [float(row["total"]) for row in rows(tmp_path / "silent")] == [0, 0]
    spoken = [example(4, seed) for seed in range(4)]
    network = fit_context(network, spoken, tmp_path / "spoken", still, progress=False)
    assert any(not torch.equal(v.cpu(), before[k]) for k, v in network.state_dict().items())


def test_a_run_and_going_on(tmp_path: Path) -> None:
    examples = [example(n, n) for n in (2, 5, 3)]
    seen = []

    def validate(network: ContextNetwork) -> dict[str, float]:
        assert not network.training
        seen.append(network)
        return {"val_right": 0.25}

    torch.manual_seed(0)
    first = fit_context(
        ContextNetwork(LABELS, SMALL),
        examples,
        tmp_path,
        OPTIONS,
        validate=validate,
        progress=False,
    )
    assert not first.training
    assert [row["step"] for row in rows(tmp_path)] == ["2", "3"]
    assert all(float(row["val_right"]) == 0.25 for row in rows(tmp_path))
    assert all(float(row[k]) > 0 for row in rows(tmp_path) for k in ("total", "rate"))
    assert len(seen) == 2

    kept = load_context(tmp_path / "last.pt")
    assert (kept.labels, kept.options) == (LABELS, SMALL)
    assert not kept.training
    for a, b in zip(first.state_dict().values(), kept.state_dict().values(), strict=True):
        assert torch.equal(a.cpu(), b)

    longer = replace(OPTIONS, steps=5)
    further = fit_context(ContextNetwork(LABELS, SMALL), examples, tmp_path, longer, progress=False)
    assert [row["step"] for row in rows(tmp_path)] == ["2", "3", "4", "5"]
    assert not torch.equal(first.said.weight, further.said.weight)
    # What is done already is not done again.
    again = fit_context(ContextNetwork(LABELS, SMALL), examples, tmp_path, longer, progress=False)
    assert len(rows(tmp_path)) == 4
    assert torch.equal(again.said.weight, further.said.weight)


@pytest.mark.parametrize(
    ("labels", "options", "word"),
    [
        (LABELS, replace(SMALL, width=8), "width"),
        ((*LABELS[:-1], "B1"), SMALL, "B1"),
        (LABELS[::-1], SMALL, "labels"),
    ],
    ids=["size", "labels", "order of labels"],
)
def test_a_run_of_another_head_is_refused(
    tmp_path: Path, labels: tuple[str, ...], options: ContextOptions, word: str
) -> None:
    examples = [example(3, 0)]
    fit_context(ContextNetwork(LABELS, SMALL), examples, tmp_path, OPTIONS, progress=False)
    before = (tmp_path / "last.pt").read_bytes()
    with pytest.raises(InputError, match=word):
        fit_context(ContextNetwork(labels, options), examples, tmp_path, OPTIONS, progress=False)
    assert (tmp_path / "last.pt").read_bytes() == before


def test_no_examples(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="examples"):
        fit_context(ContextNetwork(LABELS, SMALL), [], tmp_path, OPTIONS, progress=False)


@pytest.mark.parametrize("content", [None, b"", b"no checkpoint", {"averaged": {}, "step": 1}])
def test_a_file_that_is_no_checkpoint(tmp_path: Path, content: object) -> None:
    path = tmp_path / "last.pt"
    if isinstance(content, bytes):
        path.write_bytes(content)
    elif content is not None:
        torch.save(content, path)
    with pytest.raises(InputError, match=r"last\.pt"):
        load_context(path)


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("steps", 0),
        ("batch", 0),
        ("warmup", -1),
        ("save_every", 0),
        ("rate", -1),
        ("rate", float("nan")),
        ("decay", -0.1),
        ("average", 1),
    ],
)
def test_training_options_that_are_refused(name: str, value: float) -> None:
    with pytest.raises(InputError, match=name):
        ContextFit(**{name: value})


@pytest.mark.parametrize(
    ("name", "value"), [("width", 130), ("layers", 0), ("heads", 0), ("dropout", 1.0)]
)
def test_heads_that_are_refused(name: str, value: float) -> None:
    with pytest.raises(InputError, match=name):
        ContextOptions(**{name: value})
