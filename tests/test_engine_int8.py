"""The network in 8 bits beside its file: found, checked against it, and run in its place."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from fronto.engine import Engine, ReaderEngine
from fronto.engine.companion import QUANTIZED_OF
from fronto.engine.onnxfile import on_processor
from fronto.errors import InputError
from fronto.patches import photo_patch, region
from fronto.synth.photo import render_photo
from onnxfiles import METADATA, context_head, digits, mask_head, network, reader

NETWORK = network()
NAME = f"fronto-seg-{digits(NETWORK)}"
#: Stands for its quantized one: other bytes, and cells that tell it apart.
INT8 = network(stride=8, metadata=METADATA | {"stride": "8", QUANTIZED_OF: digits(NETWORK)})


def written(folder: Path, int8: bytes | None = INT8) -> Path:
    path = folder / f"{NAME}.onnx"
    path.write_bytes(NETWORK)
    if int8 is not None:
        (folder / f"{NAME}.int8-{digits(int8)}.onnx").write_bytes(int8)
    return path


def picture() -> np.ndarray:
    return np.random.default_rng(0).integers(0, 256, (1, 32, 48, 3), dtype=np.uint8)


def test_it_runs_in_place_of_the_network(tmp_path: Path) -> None:
    path = written(tmp_path)
    engine = Engine(path, threads=1)
    assert engine.int8
    assert engine.stride == 8
    assert engine.run(picture()).classes.shape == (1, 3, 4, 6)
    # It is that network still: the heads beside it are for both.
    assert engine.path == path
    assert engine.digest == digits(NETWORK)


def test_heads_of_the_network_go_with_it(tmp_path: Path) -> None:
    path = written(tmp_path)
    content = mask_head(NETWORK)
    (tmp_path / f"{NAME}.masks-{digits(content)}.onnx").write_bytes(content)
    assert Engine(path, threads=1).masks is not None


@pytest.mark.parametrize("providers", [None, "CPUExecutionProvider", ["CPUExecutionProvider"]])
def test_on_the_processor(tmp_path: Path, providers: list[str] | str | None) -> None:
    assert Engine(written(tmp_path), threads=1, providers=providers).int8


def test_not_where_something_else_computes() -> None:
    assert on_processor(None)
    assert on_processor(["CPUExecutionProvider"])
    assert not on_processor(["CUDAExecutionProvider", "CPUExecutionProvider"])
    assert not on_processor("CUDAExecutionProvider")


def test_where_it_is_not_wanted_or_not_there(tmp_path: Path) -> None:
    (tmp_path / "with").mkdir()
    (tmp_path / "without").mkdir()
    engine = Engine(written(tmp_path / "with"), threads=1, int8=False)
    assert not engine.int8
    assert engine.stride == 4
    for int8 in (None, True):
        assert not Engine(written(tmp_path / "without", None), threads=1, int8=int8).int8


def refusal(path: Path) -> str:
    with pytest.raises(InputError) as caught:
        Engine(path, threads=1)
    return str(caught.value)


def test_one_for_another_network_is_refused(tmp_path: Path) -> None:
    other = network(stride=8, metadata=METADATA | {"stride": "8", QUANTIZED_OF: "01234567"})
    message = refusal(written(tmp_path, other))
    assert digits(other) in message
    assert "01234567" in message
    assert digits(NETWORK) in message
    unmarked = network(stride=8, metadata=METADATA | {"stride": "8"})
    (tmp_path / "more").mkdir()
    assert digits(unmarked) in refusal(written(tmp_path / "more", unmarked))


def test_a_damaged_file_is_refused(tmp_path: Path) -> None:
    path = written(tmp_path)
    (beside,) = tmp_path.glob("*.int8-*")
    beside.write_bytes(INT8[:-100])
    assert beside.name in refusal(path)
    beside.write_bytes(INT8)
    path.write_bytes(NETWORK[:-100])  # not run, but what the others are for
    assert path.name in refusal(path)
    path.unlink()
    assert path.name in refusal(path)


def test_two_of_them_are_refused(tmp_path: Path) -> None:
    path = written(tmp_path)
    (tmp_path / f"{NAME}.int8-01234567.onnx").touch()
    assert "int8-01234567" in refusal(path)


def test_the_packages_own_is_there_and_about_as_exact() -> None:
    quantized, floats = Engine(threads=1), Engine(threads=1, int8=False)
    assert quantized.int8
    assert not floats.int8
    assert quantized.digest == floats.digest
    assert quantized.classes == floats.classes
    shown = render_photo(np.random.default_rng(7)).image[None]
    one, other = (engine.run(shown, features=True) for engine in (quantized, floats))
    for name in ("masks", "classes", "centers"):
        ours, theirs = getattr(one, name), getattr(other, name)
        assert ours.shape == theirs.shape
        assert np.abs(ours - theirs).mean() < 0.01
    assert one.features is not None
    assert other.features is not None
    assert np.abs(one.features - other.features).mean() < 0.2 * other.features.std()


def test_a_reader_has_one_too(tmp_path: Path) -> None:
    floats = reader()
    path = tmp_path / f"fronto-read-{digits(floats)}.onnx"
    path.write_bytes(floats)
    assert not ReaderEngine(path, threads=1).int8
    quantized = reader(version="1", metadata={QUANTIZED_OF: digits(floats)})
    beside = tmp_path / f"{path.stem}.int8-{digits(quantized)}.onnx"
    beside.write_bytes(quantized)
    head = context_head(floats, ("1", "2"))
    (tmp_path / f"{path.stem}.context-{digits(head)}.onnx").write_bytes(head)
    engine = ReaderEngine(path, threads=1)
    assert engine.int8
    assert (engine.path, engine.digest) == (path, digits(floats))
    assert engine.metadata["version"] == "1"
    assert engine.context is not None  # the same one goes with both
    assert not ReaderEngine(path, threads=1, int8=False).int8

    other = reader(metadata={QUANTIZED_OF: "01234567"})
    beside.unlink()
    (tmp_path / f"{path.stem}.int8-{digits(other)}.onnx").write_bytes(other)
    with pytest.raises(InputError, match="01234567"):
        ReaderEngine(path, threads=1)


def test_the_packaged_reader_is_about_as_exact() -> None:
    quantized, floats = ReaderEngine(threads=1), ReaderEngine(threads=1, int8=False)
    assert quantized.int8
    assert not floats.int8
    photo = render_photo(np.random.default_rng(5))
    boxes = [o.polygon_px for o in photo.objects]
    crops = np.stack([photo_patch(photo.image, region(_box(b), 1.06), 48) for b in boxes])
    one, other = quantized.run(crops), floats.run(crops)
    assert (one.kind.argmax(axis=1) == other.kind.argmax(axis=1)).mean() > 0.8
    assert np.abs(one.kind - other.kind).mean() < 0.03


def _box(polygon: np.ndarray) -> np.ndarray:
    return np.concatenate([polygon.min(axis=0), polygon.max(axis=0)])
