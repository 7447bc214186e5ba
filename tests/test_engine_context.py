"""Context heads: found beside their reader, checked against it, and run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from onnx import TensorProto

from fronto.engine import ContextEngine, ReaderEngine, find_companion, find_weights
from fronto.engine.context import FORMAT
from fronto.errors import InputError
from fronto.labels.context import Context
from onnxfiles import context_head, digits, head, network, reader

LABELS = ("-1", "1", "2", "open")
COUNT = len(LABELS) + 2
READER = reader()
OTHER = reader(version="0.8")
NAME = f"fronto-read-{digits(READER)}"


def context(n: int, seed: int = 0) -> Context:
    rng = np.random.default_rng(seed)
    shapes = ((n, COUNT), (n, COUNT), (n, COUNT), (n, 31), (n, n, 19))
    return Context(*(rng.random(shape).astype(np.float32) for shape in shapes))


def telling(ordered: npt.ArrayLike) -> Context:
    """What a head that repeats it is to answer."""
    rows = np.asarray(ordered, np.float32)
    given = context(len(rows))
    return Context(given.own, given.seen, rows, given.geometry, given.pairs)


def softmax(values: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    e = np.exp(values)
    return np.asarray(e / e.sum(axis=1, keepdims=True))


def write(folder: Path, name: str, content: bytes) -> Path:
    path = folder / name
    path.write_bytes(content)
    return path


def write_head(folder: Path, content: bytes | None = None, reader: str = NAME) -> Path:
    content = context_head(READER, LABELS) if content is None else content
    return write(folder, f"{reader}.context-{digits(content)}.onnx", content)


def opened(path: Path) -> ContextEngine:
    return ContextEngine(path, network=digits(READER), threads=1)


def refusal(path: Path) -> str:
    with pytest.raises(InputError) as caught:
        opened(path)
    message = str(caught.value)
    assert "\n" not in message
    assert path.name in message
    return message


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write(tmp_path, f"{NAME}.onnx", READER)
    return tmp_path


class TestContextEngine:
    @pytest.mark.parametrize("n", [1, 2, 40])
    def test_runs(self, folder: Path, n: int) -> None:
        given = context(n)
        found = opened(write_head(folder)).run(given)
        assert found.shape == (n, COUNT)
        assert found.dtype == np.float32
        np.testing.assert_allclose(found, softmax(given.ordered), atol=1e-6)

    def test_one_engine_takes_panels_of_all_sizes(self, folder: Path) -> None:
        engine = opened(write_head(folder))
        assert [len(engine.run(context(n))) for n in (3, 30, 1)] == [3, 30, 1]

    def test_tells_what_is_in_the_file(self, folder: Path) -> None:
        path = write_head(folder, context_head(READER, LABELS, metadata={"license": "MIT"}))
        engine = opened(path)
        assert (engine.path, engine.labels) == (path, LABELS)
        assert engine.metadata["license"] == "MIT"

    @pytest.mark.parametrize("metadata", [None, {"network": ""}], ids=["another", "none"])
    def test_for_another_reader(self, folder: Path, metadata: dict[str, str] | None) -> None:
        message = refusal(write_head(folder, context_head(OTHER, LABELS, metadata=metadata)))
        assert digits(READER) in message
        assert (digits(OTHER) in message) == (metadata is None)

    def test_another_format(self, folder: Path) -> None:
        seg = network()
        for content in (READER, seg, head(seg)):
            assert FORMAT in refusal(write(folder, "mine.onnx", content))
        newer = context_head(READER, LABELS, metadata={"format": "fronto.context/9"})
        assert "newer fronto" in refusal(write_head(folder, newer))

    @pytest.mark.parametrize("labels", ["", ",", "1,2,1,open"], ids=["none", "empty", "double"])
    def test_labels_that_are_missing_or_double(self, folder: Path, labels: str) -> None:
        content = context_head(READER, LABELS, metadata={"labels": labels})
        assert "labels" in refusal(write_head(folder, content))

    def test_a_head_that_knows_nothing(self, folder: Path) -> None:
        assert "labels" in refusal(write_head(folder, context_head(READER, ())))

    @pytest.mark.parametrize(
        ("name", "options"),
        [
            ("own", {"count": 5}),
            ("own", {"metadata": {"labels": "1,2,open"}}),
            ("geometry", {"geometry": 30}),
            ("pairs", {"pair": 8}),
            ("own", {"floats": TensorProto.DOUBLE}),
            ("seen", {"drop": ("seen",)}),
        ],
        ids=["columns", "a label less", "geometry", "pairs", "doubles", "no seen"],
    )
    def test_other_inputs_and_outputs(self, folder: Path, name: str, options: dict) -> None:
        assert name in refusal(write_head(folder, context_head(READER, LABELS, **options)))

    @pytest.mark.parametrize("content", [b"", b"GIF89a" * 9, context_head(READER, LABELS)[:-40]])
    def test_damaged_bytes(self, folder: Path, content: bytes) -> None:
        refusal(write(folder, "mine.onnx", content))

    def test_a_wrong_hash_in_its_name(self, folder: Path) -> None:
        path = write_head(folder)
        path.write_bytes(context_head(READER, LABELS, metadata={"version": "2"}))
        assert digits(path.read_bytes()) in refusal(path)

    def test_missing(self, folder: Path) -> None:
        refusal(folder / "gone.onnx")


class TestAnswers:
    @pytest.fixture
    def repeating(self, folder: Path) -> ContextEngine:
        return opened(write_head(folder, context_head(READER, LABELS, operator="Identity")))

    def test_probabilities_come_as_they_are(self, repeating: ContextEngine) -> None:
        rows = [[0, 0.5, 0, 0.25, 0.125, 0.125], [1, 0, 0, 0, 0, 0]]
        np.testing.assert_array_equal(repeating.run(telling(rows)), rows)

    @pytest.mark.parametrize("value", [np.nan, np.inf, -0.125, 0.9])
    def test_no_probabilities(self, repeating: ContextEngine, value: float) -> None:
        rows = np.full((3, COUNT), 1 / COUNT)
        rows[1, 2] = value
        with pytest.raises(InputError, match="probabilities") as caught:
            repeating.run(telling(rows))
        assert repeating.path.name in str(caught.value)

    def test_of_another_panel(self, repeating: ContextEngine) -> None:
        given, larger = context(2), context(3)
        mixed = Context(given.own, given.seen, larger.ordered, given.geometry, given.pairs)
        with pytest.raises(InputError, match="labels"):
            repeating.run(mixed)

    def test_what_was_described_for_other_labels(self, repeating: ContextEngine) -> None:
        given = context(2)
        narrow = Context(given.own[:, 1:], given.seen, given.ordered, given.geometry, given.pairs)
        with pytest.raises(InputError, match="own"):
            repeating.run(narrow)


class TestBesideItsReader:
    def test_without_one(self, folder: Path) -> None:
        engine = ReaderEngine(folder / f"{NAME}.onnx", threads=1)
        assert engine.context is None
        assert engine.digest == digits(READER)

    def test_with_one(self, folder: Path) -> None:
        path = write_head(folder)
        engine = ReaderEngine(folder / f"{NAME}.onnx", threads=1)
        assert engine.context is not None
        assert engine.context.path == path
        assert engine.context.labels == LABELS
        assert engine.context.run(context(3)).shape == (3, COUNT)
        # It reads as before.
        scores = engine.run(np.zeros((2, 48, 48, 3), np.uint8))
        assert len(scores.kind) == 2

    def test_names_without_digits(self, tmp_path: Path) -> None:
        path = write(tmp_path, "mine.onnx", READER)
        beside = write(tmp_path, "mine.context-own.onnx", context_head(READER, LABELS))
        found = ReaderEngine(path, threads=1).context
        assert found is not None
        assert found.path == beside

    def test_other_heads_are_left_alone(self, folder: Path) -> None:
        for name in ("mine", "fronto-read", f"{NAME}b", f"a{NAME}"):
            write_head(folder, reader=name)
        write(folder, f"{NAME}.relations-01234567.onnx", b"")
        for name in (f"{NAME}.context.md", f"{NAME}.context-01234567.onnx.part"):
            (folder / name).touch()
        assert ReaderEngine(folder / f"{NAME}.onnx", threads=1).context is None
        assert find_companion(folder / "mine.onnx", "context") is not None
        assert find_companion(folder / "mine.onnx") is None

    def test_more_than_one(self, folder: Path) -> None:
        contents = [context_head(READER, LABELS, metadata={"version": str(k)}) for k in range(2)]
        paths = [write_head(folder, content) for content in contents]
        with pytest.raises(InputError) as caught:
            ReaderEngine(folder / f"{NAME}.onnx", threads=1)
        assert all(path.name in str(caught.value) for path in paths)

    def test_an_unfit_head_is_no_silent_loss(self, folder: Path) -> None:
        path = write_head(folder, context_head(OTHER, LABELS))
        with pytest.raises(InputError, match="network") as caught:
            ReaderEngine(folder / f"{NAME}.onnx", threads=1)
        assert path.name in str(caught.value)

    def test_a_head_is_not_taken_for_a_reader(self, folder: Path) -> None:
        write_head(folder)
        assert find_weights(folder, stem="fronto-read") == folder / f"{NAME}.onnx"
        (folder / f"{NAME}.onnx").unlink()
        with pytest.raises(InputError, match="context"):
            find_weights(folder, stem="fronto-read")
