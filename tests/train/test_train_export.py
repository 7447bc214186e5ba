"""The exported file: the same figures as PyTorch's, and nothing of this machine in it."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")
onnx = pytest.importorskip("onnx")
pytest.importorskip("onnxscript")

from fronto.categories import CATEGORIES
from fronto.engine import Engine
from fronto.errors import InputError
from fronto.train.export import export_onnx, load_onnx
from fronto.train.network import Network, NetworkOptions
from fronto.train.validate import TorchEngine

OPTIONS = NetworkOptions(channels=8, decoder=12, rates=(2, 3, 4))
METADATA = {"version": "7", "license": "MIT", "training_data": "renders"}


@pytest.fixture(scope="module")
def network() -> Network:
    torch.manual_seed(0)
    network = Network(OPTIONS)
    with torch.no_grad():  # statistics of some pictures, and weights that tell them apart
        for _ in range(3):
            network.train()(torch.rand(2, 3, 64, 64))
    return network.eval()


@pytest.fixture(scope="module")
def exported(network: Network, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return export_onnx(network, tmp_path_factory.mktemp("export") / "new", "fronto-seg", METADATA)


@pytest.mark.parametrize("shape", [(1, 64, 96), (3, 32, 16), (1, 160, 80)])
def test_parity_at_any_batch_and_size(
    network: Network, exported: Path, shape: tuple[int, int, int]
) -> None:
    images = np.random.default_rng(0).integers(0, 256, (*shape, 3), dtype=np.uint8)
    found = Engine(exported, threads=1).run(images, features=True)
    expected = TorchEngine(network).run(images)
    with torch.no_grad():
        features = network(torch.from_numpy(images).permute(0, 3, 1, 2) / 255).features
    assert features.std() > 0
    assert np.abs(found.features - features.numpy()).max() <= 1e-4
    for name in ("masks", "classes", "centers", "sides"):
        ours, theirs = getattr(found, name), getattr(expected, name)
        assert ours.shape == theirs.shape
        assert theirs.std() > 0
        assert np.abs(ours - theirs).max() <= 1e-4, name


def test_probabilities(network: Network, exported: Path) -> None:
    images = np.random.default_rng(1).integers(0, 256, (1, 48, 48, 3), dtype=np.uint8)
    maps = Engine(exported, threads=1).run(images)
    for values in (maps.masks, maps.classes, maps.centers):
        assert ((values >= 0) & (values <= 1)).all()
    assert np.allclose(maps.classes.sum(axis=1), 1, atol=1e-5)
    assert (maps.sides > 0).all()


def test_metadata(exported: Path) -> None:
    metadata = Engine(exported, threads=1).metadata
    assert metadata["format"] == "fronto.segmentation/2"
    assert metadata["classes"].split(",") == list(CATEGORIES)
    assert (metadata["stride"], metadata["multiple"], metadata["channels"]) == ("4", "16", "12")
    assert json.loads(metadata["network"])["decoder"] == 12
    assert {name: metadata[name] for name in METADATA} == METADATA


def test_the_name_has_the_hash(exported: Path) -> None:
    digits = hashlib.sha256(exported.read_bytes()).hexdigest()[:8]
    assert exported.name == f"fronto-seg-{digits}.onnx"


def test_no_paths_of_this_machine(exported: Path) -> None:
    model = onnx.load(exported)
    for tensor in model.graph.initializer:  # numbers that might read as anything
        tensor.ClearField("raw_data")
    content = model.SerializeToString()
    folders = [str(folder).encode() + b"/" for folder in (Path.cwd(), Path.home())]
    for trace in (b'.py"', b".py:", b"site-packages", *folders):
        assert trace not in content
    assert len(content) < 250_000


def test_round_trip(network: Network, exported: Path) -> None:
    loaded = load_onnx(exported)
    assert loaded.options == OPTIONS
    assert not loaded.training
    wanted = network.state_dict()
    for name, values in loaded.state_dict().items():
        if not name.endswith("num_batches_tracked"):
            assert torch.equal(values, wanted[name]), name


@pytest.mark.parametrize("content", [None, b"", b"no model", b"\x08\x07"])
def test_a_file_that_is_no_network(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "weights.onnx"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=r"weights\.onnx"):
        load_onnx(path)


def test_a_file_without_all_parameters(exported: Path, tmp_path: Path) -> None:
    model = onnx.load(exported)
    names = [tensor.name for tensor in model.graph.initializer]
    del model.graph.initializer[names.index("network.classes.weight")]
    onnx.save(model, tmp_path / "part.onnx")
    with pytest.raises(InputError, match=r"classes\.weight"):
        load_onnx(tmp_path / "part.onnx")
