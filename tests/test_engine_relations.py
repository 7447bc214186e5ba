"""Relation heads: found beside their network, checked against it, and run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from onnx import TensorProto

from fronto.engine import Engine, RelationEngine, find_companion, find_weights
from fronto.engine.relations import FORMAT
from fronto.errors import InputError
from fronto.relations import Candidates
from onnxfiles import digits, head, network

NETWORK = network()
OTHER = network(stride=8)
NAME = f"fronto-seg-{digits(NETWORK)}"


def candidates(n: int, seed: int = 0) -> Candidates:
    rng = np.random.default_rng(seed)
    shapes = ((n, 49, 3), (n, 24), (n, n, 8))
    return Candidates(*(rng.normal(size=shape).astype(np.float32) for shape in shapes))


def softmax(values: npt.NDArray[np.float32]) -> npt.NDArray[np.float32]:
    e = np.exp(values)
    return np.asarray(e / e.sum(axis=1, keepdims=True))


def write(folder: Path, name: str, content: bytes) -> Path:
    path = folder / name
    path.write_bytes(content)
    return path


def write_head(folder: Path, content: bytes | None = None, network: str = NAME) -> Path:
    content = head(NETWORK) if content is None else content
    return write(folder, f"{network}.relations-{digits(content)}.onnx", content)


def opened(path: Path) -> RelationEngine:
    return RelationEngine(path, network=digits(NETWORK), channels=3, classes=3, threads=1)


def refusal(path: Path) -> str:
    with pytest.raises(InputError) as caught:
        opened(path)
    message = str(caught.value)
    assert "\n" not in message
    assert path.name in message
    return message


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    write(tmp_path, f"{NAME}.onnx", NETWORK)
    return tmp_path


@pytest.fixture
def images() -> npt.NDArray[np.uint8]:
    return np.random.default_rng(0).integers(0, 256, (2, 32, 48, 3), dtype=np.uint8)


class TestFindCompanion:
    def test_none(self, folder: Path) -> None:
        assert find_companion(folder / f"{NAME}.onnx") is None
        assert find_companion(folder / "gone" / f"{NAME}.onnx") is None

    def test_one(self, folder: Path) -> None:
        path = write_head(folder)
        assert find_companion(folder / f"{NAME}.onnx") == path

    def test_other_networks_heads_are_left_alone(self, folder: Path) -> None:
        for name in ("mine", "fronto-seg", f"{NAME}b", f"a{NAME}"):
            write_head(folder, network=name)
        for name in (f"{NAME}.relations.md", f"{NAME}.relations-01234567.onnx.part", f"{NAME}.txt"):
            (folder / name).touch()
        assert find_companion(folder / f"{NAME}.onnx") is None
        assert find_companion(folder / "mine.onnx") is not None

    def test_more_than_one(self, folder: Path) -> None:
        paths = [write_head(folder, head(NETWORK, metadata={"version": str(k)})) for k in range(2)]
        with pytest.raises(InputError) as caught:
            find_companion(folder / f"{NAME}.onnx")
        assert all(path.name in str(caught.value) for path in paths)

    def test_a_head_is_not_taken_for_a_network(self, folder: Path) -> None:
        write_head(folder)
        assert find_weights(folder) == folder / f"{NAME}.onnx"
        (folder / f"{NAME}.onnx").unlink()
        with pytest.raises(InputError, match="relations"):
            find_weights(folder)


class TestRelationEngine:
    @pytest.mark.parametrize("n", [1, 2, 40])
    def test_runs(self, folder: Path, n: int) -> None:
        given = candidates(n)
        found = opened(write_head(folder)).run(given)
        numbers = given.geometry[:, :4]
        np.testing.assert_allclose(found.kinds, softmax(numbers[:, :3]), atol=1e-6)
        np.testing.assert_allclose(found.classes, softmax(numbers[:, :3]), atol=1e-6)
        np.testing.assert_array_equal(found.shifts, numbers)

    def test_tells_what_is_in_the_file(self, folder: Path) -> None:
        path = write_head(folder, head(NETWORK, metadata={"license": "MIT"}))
        engine = opened(path)
        assert engine.path == path
        assert engine.metadata["license"] == "MIT"

    def test_candidates_of_another_network(self, folder: Path) -> None:
        engine = opened(write_head(folder))
        given = candidates(4)
        wide = Candidates(np.zeros((4, 49, 5), np.float32), given.geometry, given.pairs)
        with pytest.raises(InputError, match="relations"):
            engine.run(wide)

    @pytest.mark.parametrize("metadata", [None, {"network": ""}], ids=["another", "none"])
    def test_for_another_network(self, folder: Path, metadata: dict[str, str] | None) -> None:
        message = refusal(write_head(folder, head(OTHER, metadata=metadata)))
        assert digits(NETWORK) in message
        assert (digits(OTHER) in message) == (metadata is None)

    def test_another_format(self, folder: Path) -> None:
        assert FORMAT in refusal(write(folder, "mine.onnx", NETWORK))
        newer = head(NETWORK, metadata={"format": "fronto.relations/9"})
        assert "newer fronto" in refusal(write_head(folder, newer))

    @pytest.mark.parametrize(
        ("name", "options"),
        [
            ("looks", {"channels": 4}),
            ("classes", {"classes": 4}),
            ("looks", {"floats": TensorProto.DOUBLE}),
            ("pairs", {"drop": ("pairs",)}),
            ("shifts", {"drop": ("shifts",)}),
        ],
        ids=["channels", "classes", "doubles", "no pairs", "no shifts"],
    )
    def test_other_inputs_and_outputs(self, folder: Path, name: str, options: dict) -> None:
        assert name in refusal(write_head(folder, head(NETWORK, **options)))

    @pytest.mark.parametrize("content", [b"", b"GIF89a" * 9, head(NETWORK)[:-40]])
    def test_damaged_bytes(self, folder: Path, content: bytes) -> None:
        refusal(write(folder, "mine.onnx", content))

    def test_a_wrong_hash_in_its_name(self, folder: Path) -> None:
        path = write_head(folder)
        path.write_bytes(head(NETWORK, metadata={"version": "2"}))
        assert digits(path.read_bytes()) in refusal(path)

    def test_missing(self, folder: Path) -> None:
        refusal(folder / "gone.onnx")


class TestBesideItsNetwork:
    def test_without_one(self, folder: Path, images: npt.NDArray[np.uint8]) -> None:
        engine = Engine(folder / f"{NAME}.onnx", threads=1)
        assert engine.relations is None
        assert engine.run(images).features is None
        assert engine.run(images, features=False).features is None
        maps = engine.run(images, features=True)
        np.testing.assert_array_equal(maps.features, maps.classes)

    def test_with_one(self, folder: Path, images: npt.NDArray[np.uint8]) -> None:
        path = write_head(folder)
        engine = Engine(folder / f"{NAME}.onnx", threads=1)
        assert engine.digest == digits(NETWORK)
        assert engine.relations is not None
        assert engine.relations.path == path
        assert engine.relations.run(candidates(3)).kinds.shape == (3, 3)
        features = engine.run(images).features
        assert features is not None
        assert features.shape == (2, 3, 8, 12)
        assert engine.run(images, features=False).features is None

    def test_names_without_digits(self, tmp_path: Path) -> None:
        path = write(tmp_path, "mine.onnx", NETWORK)
        beside = write(tmp_path, "mine.relations-own.onnx", head(NETWORK))
        relations = Engine(path, threads=1).relations
        assert relations is not None
        assert relations.path == beside

    def test_an_unfit_head_is_no_silent_loss(self, folder: Path) -> None:
        path = write_head(folder, head(OTHER))
        with pytest.raises(InputError, match="network") as caught:
            Engine(folder / f"{NAME}.onnx", threads=1)
        assert path.name in str(caught.value)
