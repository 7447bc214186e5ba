"""How a reader is judged, calibrated and written."""

from __future__ import annotations

import hashlib
from pathlib import Path
from typing import cast

import numpy as np
import pytest

torch = pytest.importorskip("torch")
onnx = pytest.importorskip("onnx")
pytest.importorskip("onnxscript")

from fronto.engine import ReaderEngine
from fronto.errors import InputError
from fronto.labels.alphabet import ALPHABET, KINDS, STEPS
from fronto.labels.reader import LabelReader
from fronto.labels.targets import ReadTarget, encoded
from fronto.train.reader.calibrate import fit_temperatures, halves
from fronto.train.reader.data import collated
from fronto.train.reader.export import export_reader
from fronto.train.reader.network import ReaderNetwork, ReaderOptions, Readings
from fronto.train.reader.validate import (
    HeldOut,
    Temperatures,
    TorchReaderEngine,
    network_outputs,
    reading_figures,
)

SMALL = ReaderOptions(stem=4, stages=(4, 6, 8), kinds=4)
METADATA = {"version": "7", "license": "MIT", "training_data": "renders"}
TEMPERATURES = Temperatures(text=1.5, kind=0.75)


@pytest.fixture(scope="module")
def network() -> ReaderNetwork:
    torch.manual_seed(0)
    network = ReaderNetwork(SMALL)
    with torch.no_grad():
        for _ in range(3):
            network.train()(torch.rand(4, 3, 48, 48))
    return network.eval()


@pytest.fixture(scope="module")
def exported(network: ReaderNetwork, tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("export") / "new"
    return export_reader(network, folder, "fronto-read", METADATA, TEMPERATURES)


@pytest.mark.parametrize("count", [1, 2, 7])
def test_parity_at_any_number_of_crops(network: ReaderNetwork, exported: Path, count: int) -> None:
    crops = np.random.default_rng(count).integers(0, 256, (count, 48, 48, 3), dtype=np.uint8)
    found = ReaderEngine(exported, threads=1).run(crops)
    expected = TorchReaderEngine(network, TEMPERATURES).run(crops)
    assert found.text.shape == (count, STEPS, len(ALPHABET) + 1)
    assert found.kind.shape == (count, len(KINDS))
    assert expected.kind.std() > 0
    assert np.abs(found.text - expected.text).max() <= 1e-4
    assert np.abs(found.kind - expected.kind).max() <= 1e-4


def test_temperatures_are_in_the_file(
    network: ReaderNetwork, exported: Path, tmp_path: Path
) -> None:
    crops = np.random.default_rng(0).integers(0, 256, (3, 48, 48, 3), dtype=np.uint8)
    plain = export_reader(network, tmp_path, "fronto-read", METADATA)
    before = ReaderEngine(plain, threads=1).run(crops)
    after = ReaderEngine(exported, threads=1).run(crops)
    sharpened = before.kind ** (1 / TEMPERATURES.kind)
    assert np.allclose(after.kind, sharpened / sharpened.sum(axis=1, keepdims=True), atol=1e-4)
    softened = before.text ** (1 / TEMPERATURES.text)
    assert np.allclose(after.text, softened / softened.sum(axis=2, keepdims=True), atol=1e-4)


def test_metadata_and_name(exported: Path) -> None:
    engine = ReaderEngine(exported, threads=1)
    assert engine.metadata["format"] == "fronto.labels/1"
    assert engine.alphabet == ALPHABET
    assert engine.kinds == KINDS
    assert float(engine.metadata["text_temperature"]) == 1.5
    assert float(engine.metadata["kind_temperature"]) == 0.75
    assert {name: engine.metadata[name] for name in METADATA} == METADATA
    digits = hashlib.sha256(exported.read_bytes()).hexdigest()[:8]
    assert exported.name == f"fronto-read-{digits}.onnx"


def test_no_paths_of_this_machine(exported: Path) -> None:
    model = onnx.load(exported)
    for tensor in model.graph.initializer:  # numbers that might read as anything
        tensor.ClearField("raw_data")
    content = model.SerializeToString()
    folders = [str(folder).encode() + b"/" for folder in (Path.cwd(), Path.home())]
    for trace in (b'.py"', b".py:", b"site-packages", *folders):
        assert trace not in content


class Answers(torch.nn.Module):
    """Gives the logits of its list; a crop's first byte is its number in it."""

    def __init__(self, text: torch.Tensor, kind: torch.Tensor) -> None:
        super().__init__()
        self.text, self.kind = torch.nn.Parameter(text), torch.nn.Parameter(kind)

    def forward(self, crops: torch.Tensor) -> Readings:
        rows = (crops[:, 0, 0, 0] * 255).round().long()
        return Readings(self.text[rows], self.kind[rows])


def numbered(count: int) -> list[np.ndarray]:
    return [np.full((48, 48, 3), k, np.uint8) for k in range(count)]


def saying(said: list[tuple[str, str, float]]) -> ReaderNetwork:
    """A network that says these kinds and texts, the kinds with these probabilities."""
    text = torch.full((len(said), STEPS, len(ALPHABET) + 1), -30.0)
    text[..., 0] = 0
    kind = torch.zeros(len(said), len(KINDS))
    for row, (name, characters, probability) in enumerate(said):
        for k, character in enumerate(encoded(characters)):
            text[row, 2 * k + 1, character], text[row, 2 * k + 1, 0] = 0, -30.0
        rest = (1 - probability) / (len(KINDS) - 1)
        kind[row] = float(np.log(rest))
        kind[row, KINDS.index(name)] = float(np.log(probability))
    return cast(ReaderNetwork, Answers(text, kind))


def held(targets: list[ReadTarget], photos: list[str] | None = None) -> HeldOut:
    labels = tuple(t.text or ("" if t.kind in ("blank", "unreadable") else t.kind) for t in targets)
    photos = photos or [f"{k}" for k in range(len(targets))]
    batch = collated(numbered(len(targets)), targets)
    return HeldOut(batch, labels, tuple(t.kind for t in targets), tuple(photos))


def test_figures_by_hand() -> None:
    targets = [ReadTarget("text", "12"), ReadTarget("text", "7"), ReadTarget("up"),
               ReadTarget("open"), ReadTarget("blank"), ReadTarget("unreadable")]  # fmt: skip
    said = [("text", "12", 0.95), ("text", "1", 0.9), ("up", "", 0.97), ("blank", "", 0.8),
            ("blank", "", 0.9), ("text", "3", 0.99)]  # fmt: skip
    figures = reading_figures(saying(said), held(targets))
    assert figures["right"] == pytest.approx(2 / 4)
    assert figures["right_sure"] == pytest.approx(2 / 4)  # 12 and up, surer than the wrong 1
    assert figures["sure"] == pytest.approx(0.95, abs=1e-3)
    assert figures["invented"] == pytest.approx(1 / 2)  # the 3 on what nobody can read
    assert figures["right_text"] == pytest.approx(1 / 2)
    assert figures["right_up"] == 1
    assert figures["right_open"] == 0
    assert figures["right_blank"] == 1
    assert figures["right_unreadable"] == 0
    assert np.isnan(figures["right_stop"])


def test_sureness_that_is_deserved_is_no_error() -> None:
    targets = [ReadTarget("up")] * 8 + [ReadTarget("down")] * 2
    figures = reading_figures(saying([("up", "", 0.8)] * 10), held(targets))
    assert figures["calibration"] == pytest.approx(0, abs=0.01)
    figures = reading_figures(saying([("up", "", 0.98)] * 10), held(targets))
    assert figures["calibration"] == pytest.approx(0.18, abs=0.01)


def test_the_same_reader_as_in_use(network: ReaderNetwork, exported: Path) -> None:
    crops = np.random.default_rng(0).integers(0, 256, (5, 48, 48, 3), dtype=np.uint8)
    torch_engine = cast(ReaderEngine, TorchReaderEngine(network, TEMPERATURES))
    ours = LabelReader(torch_engine).read(crops)
    theirs = LabelReader(ReaderEngine(exported, threads=1)).read(crops)
    assert [r.text for r in ours] == [r.text for r in theirs]
    assert [r.confidence for r in ours] == pytest.approx([r.confidence for r in theirs], abs=1e-3)


def test_temperatures_are_found() -> None:
    """Labels drawn from known probabilities, told by a network that is three times too sure."""
    rng = np.random.default_rng(0)
    n = 250
    kind = rng.normal(0, 1, (n, len(KINDS)))
    kind[:, 0] += 1.5
    steps = np.full((n, STEPS, len(ALPHABET) + 1), -20.0)
    steps[..., 0] = 0
    steps[:, 5, 0], steps[:, 5, 1:4] = -20, rng.normal(0, 1, (n, 3))  # 0, 1 or 2 at one step
    targets = []
    for row in range(n):
        of_kind = np.exp(kind[row]) / np.exp(kind[row]).sum()
        of_text = np.exp(steps[row, 5, 1:4]) / np.exp(steps[row, 5, 1:4]).sum()
        chosen = KINDS[rng.choice(len(KINDS), p=of_kind)]
        text = "012"[rng.choice(3, p=of_text)]
        targets.append(ReadTarget(chosen, text if chosen == "text" else ""))
    texts, kinds = (torch.from_numpy(a).float() for a in (3 * steps, 3 * kind))
    found = fit_temperatures(cast(ReaderNetwork, Answers(texts, kinds)), held(targets))
    assert found.kind == pytest.approx(3, rel=0.2)
    assert found.text == pytest.approx(3, rel=0.35)


def test_halves_share_no_photo() -> None:
    targets = [ReadTarget("text", "1")] * 8
    photos = ["a", "a", "b", "b", "c", "d", "d", "d"]
    first, second = halves(held(targets, photos))
    assert set(first.photos) == {"a", "c"}
    assert set(second.photos) == {"b", "d"}
    assert first.batch.crops[:, 0, 0, 0].tolist() == [0, 1, 4]
    assert len(second.labels) == len(second.kinds) == 5
    with pytest.raises(InputError, match="calibrate"):
        halves(held(targets, ["a"] * 8))


def test_outputs_of_many_crops(network: ReaderNetwork) -> None:
    crops = torch.randint(0, 256, (259, 48, 48, 3), dtype=torch.uint8)
    outputs = network_outputs(network, crops)
    assert outputs.kind.shape == (259, len(KINDS))
    alone = network_outputs(network, crops[257:258])
    assert torch.allclose(outputs.kind[257], alone.kind[0], atol=1e-4)


def test_what_only_training_needs_stays_behind(exported: Path) -> None:
    names = [tensor.name for tensor in onnx.load(exported).graph.initializer]
    assert any("kinds" in name for name in names)
    assert not any("spelling" in name for name in names)
