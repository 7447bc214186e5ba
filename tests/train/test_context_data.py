"""Panels to learn from: what photos say of their buttons, and the files that keep it."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest

pytest.importorskip("torch")
pytest.importorskip("kornia")

from PIL import Image

import fronto
from fronto.datasets.records import LabeledImage, LabeledObject
from fronto.errors import InputError
from fronto.images import as_rgb
from fronto.labels.context import Context
from fronto.labels.reader import Reading
from fronto.results import Panel, Plate
from fronto.shapes import Outline
from fronto.train.context.collect import MOST, examples_of, known_labels, targets
from fronto.train.context.examples import Example, read_examples, write_examples

LABELS = ("1", "2", "3", "open")
NONE, OTHER = len(LABELS), len(LABELS) + 1
Box = tuple[float, float, float, float]


def square(x: float, y: float = 50.0, side: float = 30.0) -> Box:
    return (x - side / 2, y - side / 2, x + side / 2, y + side / 2)


def labelled(box: Box, text: str = "", name: str = "number", **more: object) -> LabeledObject:
    category = {"plate": "plate", "empty": "unknown", "open": "open"}.get(name, "number")
    return LabeledObject(category, box, None, name, text, **more)  # type: ignore[arg-type]


def image(*objects: LabeledObject, path: str = "photo.png") -> LabeledImage:
    return LabeledImage(Path(path), 320, 240, objects)


def example(n: int) -> Example:
    """Anything."""
    rng = np.random.default_rng(n)
    beliefs = [rng.dirichlet(np.full(OTHER + 1, 0.3), n) for _ in range(3)]
    parts = (*beliefs, rng.normal(size=(n, 31)), rng.normal(size=(n, n, 19)))
    context = Context(*(part.astype(np.float32) for part in parts))
    return Example(context, rng.integers(-1, OTHER + 1, n), rng.random(n).astype(np.float32))


class TestKnownLabels:
    def test_floors_and_what_is_there_often(self) -> None:
        box = square(50)
        often = image(*[labelled(box, "*B1"), labelled(box, "FAN"), labelled(box, name="open")] * 2)
        seldom = image(labelled(box, "B1"), labelled(box, "open"), labelled(box, "7"))
        found = known_labels([often, seldom])
        assert len(set(found)) == len(found)
        assert {"-1", "0", "7", "99", "B1", "open"} <= set(found)
        assert not {"FAN", "*B1", "", "100"} & set(found)
        assert found[: len(known_labels([]))] == known_labels([])

    def test_plates_and_what_is_ignored_do_not_count(self) -> None:
        box = square(50)
        things = [labelled(box, "FAN", name="plate"), labelled(box, "PH", ignore=True)]
        assert known_labels([image(*things)] * 9) == known_labels([])


class TestTargets:
    @staticmethod
    def of(found: Box, *objects: LabeledObject) -> tuple[int, float]:
        target, weight = targets(objects, np.array([found]), [0.9], LABELS)
        assert target.shape == weight.shape == (1,)
        return int(target[0]), float(weight[0])

    @pytest.mark.parametrize(
        ("text", "expected"), [("2", 1), ("*2", 1), ("s3", 2), ("FAN", OTHER), ("14", OTHER)]
    )
    def test_labels(self, text: str, expected: int) -> None:
        assert self.of(square(50), labelled(square(52), text)) == (expected, 1)

    def test_functions(self) -> None:
        assert self.of(square(50), labelled(square(52), name="open")) == (3, 1)

    def test_a_blank_button_has_no_label_for_sure(self) -> None:
        assert self.of(square(50), labelled(square(52), name="empty")) == (NONE, 1)

    def test_what_nobody_labelled_has_none_as_it_seems(self) -> None:
        for objects in ([labelled(square(52))], [labelled(square(80), "2")], []):
            target, weight = self.of(square(50), *objects)
            assert target == NONE
            assert 0 < weight < 1

    def test_a_plate_is_no_button_for_sure(self) -> None:
        plate = labelled(square(52), "2", name="plate")
        assert self.of(square(50), plate) == (NONE, 1)
        assert self.of(square(50), plate, labelled(square(49), "3")) == (2, 1)

    def test_what_is_ignored_has_no_verdict(self) -> None:
        zone = labelled((0, 0, 200, 100), "2", ignore=True)
        assert self.of(square(50), zone)[0] == -1
        assert self.of(square(50), zone, labelled(square(50), "3")) == (2, 1)
        assert self.of(square(220), zone)[0] == NONE

    def test_one_label_names_one_button(self) -> None:
        found = np.array([square(47), square(52), square(100)])
        objects = [labelled(square(50), "1"), labelled(square(101), "2")]
        target, weight = targets(objects, found, [0.9, 0.5, 0.7], LABELS)
        assert target.tolist() == [0, NONE, 1]
        assert weight[0] == weight[2] == 1
        assert weight[1] < 1
        target, _ = targets(objects, found, [0.5, 0.9, 0.7], LABELS)
        assert target.tolist() == [NONE, 0, 1]


class TestFiles:
    def test_round_trip(self, tmp_path: Path) -> None:
        given = [example(n) for n in (3, 1, 7)]
        path = tmp_path / "panels-00.npz"
        write_examples(path, given)
        assert [f.name for f in tmp_path.iterdir()] == [path.name]
        for ours, theirs in zip(read_examples(path), given, strict=True):
            np.testing.assert_array_equal(ours.target, theirs.target)
            np.testing.assert_allclose(ours.weight, theirs.weight, rtol=1e-6)
            for field in fields(Context):
                kept, part = (getattr(e.context, field.name) for e in (ours, theirs))
                assert kept.shape == part.shape
                np.testing.assert_allclose(kept, part, rtol=1e-3, atol=1e-3)

    def test_none(self, tmp_path: Path) -> None:
        write_examples(tmp_path / "panels-00.npz", [])
        assert read_examples(tmp_path / "panels-00.npz") == []

    @pytest.mark.parametrize("damage", ["gone", "empty", "text", "array", "cut", "part", "counts"])
    def test_a_damaged_file(self, tmp_path: Path, damage: str) -> None:
        path = tmp_path / "panels-00.npz"
        write_examples(path, [example(3), example(2)])
        content = path.read_bytes()
        if damage == "gone":
            path.unlink()
        elif damage == "array":
            with path.open("wb") as file:
                np.save(file, np.zeros(3))
        elif damage == "part":
            np.savez(path, own=np.zeros((3, 4)))
        elif damage == "counts":
            with np.load(path) as stored:
                np.savez(path, **{**stored, "count": np.array([6])})
        else:
            broken = {"empty": b"", "text": b"no arrays", "cut": content[: len(content) // 2]}
            path.write_bytes(broken[damage])
        with pytest.raises(InputError, match=r"panels-00\.npz"):
            read_examples(path)


class Finding:
    """Finds buttons and plates at the same places of each photo, whatever its size."""

    def __init__(self, buttons: list[Box], plates: list[Box]) -> None:
        self.buttons, self.plates = buttons, plates
        self.widths: list[int] = []

    def __call__(self, photo: Path | npt.NDArray[np.uint8]) -> Panel:
        pixels = as_rgb(photo)
        height, width = pixels.shape[:2]
        self.widths.append(width)

        def outlines(boxes: list[Box]) -> list[Outline]:
            size = np.array([width / 320, height / 240])
            corners = [np.array([(a, b), (c, b), (c, d), (a, d)]) * size for a, b, c, d in boxes]
            return [Outline.quad(each, confidence=0.9) for each in corners]

        camera = fronto.Camera.default(width, height)
        panel = fronto.rectify_outlines(pixels, outlines(self.buttons), camera)
        return replace(panel, plates=tuple(map(Plate, outlines(self.plates))))


@dataclass
class Reciting:
    """Reads the same from any crops."""

    texts: tuple[str, ...]

    def read(self, crops: npt.NDArray[np.uint8]) -> list[Reading]:
        assert crops.shape[1:] == (48, 48, 3)
        return [Reading(text, "text", 0.9, ((text, 0.9),)) for text in self.texts[: len(crops)]]


class TestExamplesOf:
    BUTTONS = tuple(square(100, y) for y in (40, 90, 140, 190))
    PLATES = (square(240, 100), square(240, 190))
    TEXTS = ("3", "2", "1", "FAN", "open", "7")

    @pytest.fixture
    def photo(self, tmp_path: Path) -> LabeledImage:
        picture = np.random.default_rng(0).integers(0, 256, (240, 320, 3), dtype=np.uint8)
        Image.fromarray(picture).save(tmp_path / "photo.png")
        names = zip(self.BUTTONS, ("3", "2", "FAN"), strict=False)
        objects = [labelled(box, text) for box, text in names]
        return replace(image(*objects), path=tmp_path / "photo.png")

    def found(self, photo: LabeledImage, seed: int | None, finding: object = None) -> list[Example]:
        rectifier = finding or Finding(list(self.BUTTONS), list(self.PLATES))
        rng = None if seed is None else np.random.default_rng(seed)
        return examples_of(photo, rectifier, Reciting(self.TEXTS), LABELS, rng)  # type: ignore[arg-type]

    def test_as_it_is(self, photo: LabeledImage) -> None:
        (found,) = self.found(photo, None)
        assert found.target.tolist() == [2, 1, OTHER, NONE, -1, -1]
        assert (found.weight[:3] == 1).all()
        assert 0 < found.weight[3] < 1
        c = found.context
        assert c.own.shape == (6, len(LABELS) + 2)
        assert c.own.argmax(axis=1).tolist() == [2, 1, 0, OTHER, 3, OTHER]
        np.testing.assert_allclose(c.own.max(axis=1), 0.9, atol=1e-3)
        assert c.geometry[:, 12].tolist() == [0, 0, 0, 0, 1, 1]
        assert all(np.isfinite(getattr(c, field.name)).all() for field in fields(Context))

    def test_made_worse_and_with_hidden_labels(self, photo: LabeledImage) -> None:
        finding = Finding(list(self.BUTTONS), list(self.PLATES))
        (still,) = self.found(photo, None, finding)
        shares = []
        for seed in range(12):
            plain, hidden = self.found(photo, seed, finding)
            for ours in (plain, hidden):
                # The labels go with the buttons, however small the photo became.
                np.testing.assert_array_equal(ours.target, still.target)
                np.testing.assert_array_equal(ours.weight, still.weight)
            np.testing.assert_allclose(plain.context.own, still.context.own, atol=1e-6)
            np.testing.assert_array_equal(hidden.context.pairs, plain.context.pairs)
            left = hidden.context.own.sum(axis=1) / plain.context.own.sum(axis=1)
            assert (left <= 1 + 1e-6).all()
            shares += left.tolist()
        assert finding.widths[0] == 320
        assert len(set(finding.widths)) > 6
        assert max(finding.widths) <= 320
        # A quarter is hidden: some of those altogether, of others less than half is left.
        kept = np.array(shares) > 0.99
        assert 0.55 < kept.mean() < 0.95
        assert (np.array(shares) == 0).any()
        assert np.array(shares)[~kept].max() < 0.51

    def test_the_same_seed_gives_the_same(self, photo: LabeledImage) -> None:
        for ours, theirs in zip(self.found(photo, 3), self.found(photo, 3), strict=True):
            for field in fields(Context):
                name = field.name
                np.testing.assert_array_equal(
                    getattr(ours.context, name), getattr(theirs.context, name)
                )

    def test_photos_without_a_panel(self, photo: LabeledImage) -> None:
        assert self.found(photo, None, Finding([], [])) == []
        many = [square(8 + 16 * (k % 19), 8 + 16 * (k // 19), 9) for k in range(MOST + 1)]
        assert self.found(photo, None, Finding(many, [])) == []

        def refusing(photo: object) -> Panel:
            raise InputError("photo", "expected something else")

        assert self.found(photo, None, refusing) == []
