"""Networks in 8 bits: which file is written, and that it tells about the same."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest
from click.testing import CliRunner

torch = pytest.importorskip("torch")
onnx = pytest.importorskip("onnx")
pytest.importorskip("onnxscript")

from fronto.cli import main
from fronto.engine import Engine, ReaderEngine
from fronto.errors import InputError
from fronto.imageio import write_png
from fronto.train.export import export_onnx
from fronto.train.network import Network, NetworkOptions
from fronto.train.quantize import quantize_network, quantize_reader
from fronto.train.reader.export import export_reader
from fronto.train.reader.network import ReaderNetwork

METADATA = {"version": "7", "license": "MIT", "training_data": "renders"}


def pictures(count: int, seed: int = 0) -> list[np.ndarray]:
    rng = np.random.default_rng(seed)
    return [rng.integers(0, 256, (64, 96, 3), dtype=np.uint8) for _ in range(count)]


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> Path:
    torch.manual_seed(0)
    network = Network(NetworkOptions(channels=8, decoder=12, rates=(2, 3, 4)))
    with torch.no_grad():  # statistics of some pictures
        for _ in range(3):
            network.train()(torch.rand(2, 3, 64, 64))
    folder = tmp_path_factory.mktemp("export")
    return export_onnx(network.eval(), folder, "fronto-seg", METADATA)


@pytest.fixture(scope="module")
def quantized(exported: Path) -> Path:
    return quantize_network(exported, pictures(8))


def test_the_file_says_what_it_is(exported: Path, quantized: Path) -> None:
    content = quantized.read_bytes()
    digits = hashlib.sha256(content).hexdigest()[:8]
    assert quantized.name == f"{exported.stem}.int8-{digits}.onnx"
    assert quantized.parent == exported.parent
    assert len(content) < 0.6 * exported.stat().st_size
    stated = {entry.key: entry.value for entry in onnx.load_from_string(content).metadata_props}
    of = Engine(exported, threads=1, int8=False)
    assert stated == {**of.metadata, "quantized_of": of.digest}
    assert b"/tmp" not in content


def test_it_tells_about_the_same(exported: Path, quantized: Path) -> None:
    engine, floats = Engine(exported, threads=1), Engine(exported, threads=1, int8=False)
    assert engine.int8
    assert not floats.int8
    for shown in pictures(2, seed=1):
        one, other = (e.run(shown[None], features=True) for e in (engine, floats))
        for name in ("masks", "classes", "centers", "sides", "features"):
            ours, theirs = getattr(one, name), getattr(other, name)
            assert ours.shape == theirs.shape
            off = np.sqrt(((ours - theirs) ** 2).mean())
            assert off < 0.35 * theirs.std()
    # Of any size, and several at once.
    assert engine.run(np.zeros((3, 32, 160, 3), np.uint8)).masks.shape == (3, 2, 32, 160)


def test_most_of_it_is_in_whole_numbers(quantized: Path) -> None:
    graph = onnx.load(quantized).graph
    kinds = {tensor.name: tensor.data_type for tensor in graph.initializer}
    from_numbers = {n.output[0]: n.input[0] for n in graph.node if n.op_type == "DequantizeLinear"}
    weights = [n.input[1] for n in graph.node if n.op_type == "Conv"]
    whole = [kinds.get(from_numbers.get(name, "")) == onnx.TensorProto.INT8 for name in weights]
    assert np.mean(whole) > 0.75
    # Not the first ones, nor those that tell the answer.
    assert not any(whole[:3])


def test_a_new_one_replaces_the_old(exported: Path, tmp_path: Path) -> None:
    first = quantize_network(exported, pictures(2, seed=2), tmp_path / "new")
    second = quantize_network(exported, pictures(2, seed=3), tmp_path / "new")
    assert first != second
    assert list((tmp_path / "new").iterdir()) == [second]
    assert quantize_network(exported, pictures(2, seed=3), tmp_path / "new") == second


def test_what_cannot_be_quantized(exported: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="pictures"):
        quantize_network(exported, [], tmp_path)
    with pytest.raises(InputError, match=r"gone\.onnx"):
        quantize_network(tmp_path / "gone.onnx", pictures(1), tmp_path)
    (tmp_path / "text.onnx").write_text("no network")
    with pytest.raises(InputError, match=r"text\.onnx"):
        quantize_network(tmp_path / "text.onnx", pictures(1), tmp_path)
    assert not list(tmp_path.glob("*int8*"))


def test_from_the_command_line(exported: Path, tmp_path: Path) -> None:
    (tmp_path / "photos").mkdir()
    for k, picture in enumerate(pictures(3)):
        write_png(tmp_path / "photos" / f"{k}.png", picture)
    arguments = ["quantize", tmp_path / "photos", "--weights", exported, "-d", tmp_path / "out"]
    done = CliRunner().invoke(main, list(map(str, [*arguments, "-n", "2"])))
    assert done.exit_code == 0, done.output
    (written,) = (tmp_path / "out").iterdir()
    assert str(written) in done.output
    # A photo that cannot be used is named, and the others are taken.
    (tmp_path / "photos" / "9.png").write_text("no picture")
    some = CliRunner().invoke(main, list(map(str, arguments)))
    assert some.exit_code == 1
    assert "9.png" in some.output
    assert "3 photos" in some.output
    assert len(list((tmp_path / "out").iterdir())) == 1
    nothing = CliRunner().invoke(main, ["quantize", str(tmp_path / "no*.jpg"), "--weights", "x"])
    assert nothing.exit_code == 2


def test_a_reader(tmp_path: Path) -> None:
    torch.manual_seed(0)
    network = ReaderNetwork()
    with torch.no_grad():
        for _ in range(3):
            network.train()(torch.rand(4, 3, 48, 48))
    exported = export_reader(network.eval(), tmp_path, "fronto-read", METADATA)
    rng = np.random.default_rng(0)
    crops = [rng.integers(0, 256, (n, 48, 48, 3), dtype=np.uint8) for n in (3, 0, 5)]
    path = quantize_reader(exported, crops)
    assert path.stat().st_size < 0.5 * exported.stat().st_size
    engine, floats = ReaderEngine(exported, threads=1), ReaderEngine(exported, int8=False)
    assert engine.int8
    assert engine.metadata["quantized_of"] == floats.digest
    one, other = engine.run(crops[2]), floats.run(crops[2])
    for ours, theirs in ((one.kind, other.kind), (one.text, other.text)):
        assert np.sqrt(((ours - theirs) ** 2).mean()) < 0.35 * theirs.std()
    with pytest.raises(InputError, match="crops"):
        quantize_reader(exported, crops[1:2])
    with pytest.raises(InputError, match=r"gone\.onnx"):
        quantize_reader(tmp_path / "gone.onnx", crops)
