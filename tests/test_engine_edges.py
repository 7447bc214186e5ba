"""Edge heads: found beside their network, checked against it, and run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from onnx import TensorProto

from fronto.engine import EdgeEngine, Engine, find_companion, find_weights, packaged_edges
from fronto.engine.edges import FORMAT
from fronto.errors import InputError
from fronto.outlines.edgeprofiles import ABOUT, BINS, CHANNELS, CURVES
from onnxfiles import digits, edge_head, head, mask_head, network

NETWORK = network()
OTHER = network(stride=8)
NAME = f"fronto-seg-{digits(NETWORK)}"


def shown(n: int) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
    rng = np.random.default_rng(n)
    profiles = rng.random((n, CURVES, BINS, CHANNELS), np.float32) * 255
    return profiles, rng.random((n, ABOUT), np.float32)


def write(folder: Path, name: str, content: bytes) -> Path:
    path = folder / name
    path.write_bytes(content)
    return path


def write_edges(folder: Path, content: bytes | None = None) -> Path:
    content = edge_head(NETWORK) if content is None else content
    return write(folder, f"{NAME}.edges-{digits(content)}.onnx", content)


def opened(path: Path) -> EdgeEngine:
    return EdgeEngine(path, network=digits(NETWORK), threads=1)


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


class TestEdgeEngine:
    @pytest.mark.parametrize("n", [0, 1, 7])
    def test_runs(self, folder: Path, n: int) -> None:
        profiles, about = shown(n)
        told = opened(write_edges(folder)).run(profiles, about)
        assert told.shape == (n, CURVES, BINS)
        assert told.dtype == np.float32
        np.testing.assert_array_equal(told.argmax(axis=2), profiles[..., 0].argmax(axis=2))
        np.testing.assert_allclose(told.sum(axis=2), 1, atol=1e-5)

    @pytest.mark.parametrize("part", ["profiles", "about"])
    def test_other_inputs(self, folder: Path, part: str) -> None:
        engine = opened(write_edges(folder))
        for change in (lambda a: a[:, :1], lambda a: a.astype(np.float64), lambda a: a[:1]):
            given = dict(zip(("profiles", "about"), shown(4), strict=True))
            given[part] = change(given[part])
            with pytest.raises(InputError, match=r"profiles|about"):
                engine.run(**given)

    @pytest.mark.parametrize("metadata", [None, {"network": ""}], ids=["another", "none"])
    def test_for_another_network(self, folder: Path, metadata: dict[str, str] | None) -> None:
        path = write_edges(folder, edge_head(OTHER, metadata=metadata))
        assert digits(NETWORK) in refusal(path)
        assert EdgeEngine(path, threads=1).path == path  # nobody asked which

    def test_another_format(self, folder: Path) -> None:
        for content in (NETWORK, head(NETWORK), mask_head(NETWORK)):
            assert FORMAT in refusal(write(folder, "mine.onnx", content))

    @pytest.mark.parametrize(
        ("name", "options"),
        [
            ("profiles", {"bins": 32}),
            ("profiles", {"inputs": TensorProto.UINT8}),
            ("about", {"about": 2}),
            ("about", {"drop": ("about",)}),
        ],
    )
    def test_other_inputs_and_outputs(self, folder: Path, name: str, options: dict) -> None:
        assert name in refusal(write_edges(folder, edge_head(NETWORK, **options)))

    @pytest.mark.parametrize("content", [b"", b"GIF89a" * 9, edge_head(NETWORK)[:-40]])
    def test_damaged_bytes(self, folder: Path, content: bytes) -> None:
        refusal(write(folder, "mine.onnx", content))

    def test_answers_that_are_no_numbers(self, folder: Path) -> None:
        engine = opened(write_edges(folder, edge_head(NETWORK, operator="Log")))
        profiles, about = shown(3)
        profiles[1] = -1  # it has no logarithm
        with pytest.raises(InputError, match="finite"):
            engine.run(profiles, about)


class TestBesideItsNetwork:
    def test_with_and_without_one(self, folder: Path) -> None:
        assert Engine(folder / f"{NAME}.onnx", threads=1).edges is None
        path = write_edges(folder, edge_head(NETWORK, metadata={"license": "MIT"}))
        assert find_companion(folder / f"{NAME}.onnx", "edges") == path
        assert find_weights(folder) == folder / f"{NAME}.onnx"
        used = Engine(folder / f"{NAME}.onnx", threads=1).edges
        assert used is not None
        assert used.path == path
        assert used.metadata["license"] == "MIT"

    def test_an_unfit_one_is_no_silent_loss(self, folder: Path) -> None:
        path = write_edges(folder, edge_head(OTHER))
        with pytest.raises(InputError, match="network") as caught:
            Engine(folder / f"{NAME}.onnx", threads=1)
        assert path.name in str(caught.value)

    def test_the_packages_is_its_networks(self) -> None:
        packaged = packaged_edges()
        assert packaged is not None
        assert packaged is packaged_edges()
        assert packaged.metadata["network"] == Engine(threads=1).digest
        assert packaged.metadata["license"]
        assert packaged.metadata["training_data"]
