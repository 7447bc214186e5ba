"""Mask heads: found beside their network, checked against it, and run."""

from __future__ import annotations

from dataclasses import fields
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from onnx import TensorProto

from fronto.engine import DrawnMasks, Engine, MaskEngine, find_companion, find_weights
from fronto.engine.masks import AT_ONCE, FORMAT
from fronto.errors import InputError
from fronto.maskhead import FORMS, Patches, region
from fronto.segmentation import segment
from onnxfiles import digits, finder, head, mask_head, network

NETWORK = network()
OTHER = network(stride=8)
NAME = f"fronto-seg-{digits(NETWORK)}"


def patches(n: int, seed: int = 0) -> Patches:
    rng = np.random.default_rng(seed)
    photo, rough = (rng.integers(0, 256, (n, 48, 48, *more), dtype=np.uint8) for more in ((3,), ()))
    photo = np.asarray(photo * rng.random((n, 1, 1, 3)), np.uint8)  # means that differ
    return Patches(photo, rough, (region((0, 0, 30, 30)),) * n)


def one_of(many: Patches, k: int) -> Patches:
    return Patches(many.photo[k : k + 1], many.rough[k : k + 1], many.regions[k : k + 1])


def softmax(values: npt.NDArray[np.floating]) -> npt.NDArray[np.floating]:
    e = np.exp(values)
    return np.asarray(e / e.sum(axis=1, keepdims=True))


def write(folder: Path, name: str, content: bytes) -> Path:
    path = folder / name
    path.write_bytes(content)
    return path


def write_head(folder: Path, content: bytes | None = None, network: str = NAME) -> Path:
    content = mask_head(NETWORK) if content is None else content
    return write(folder, f"{network}.masks-{digits(content)}.onnx", content)


def opened(path: Path) -> MaskEngine:
    return MaskEngine(path, network=digits(NETWORK), threads=1)


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


class TestFindCompanion:
    def test_none(self, folder: Path) -> None:
        assert find_companion(folder / f"{NAME}.onnx", "masks") is None

    def test_one(self, folder: Path) -> None:
        path = write_head(folder)
        assert find_companion(folder / f"{NAME}.onnx", "masks") == path

    def test_heads_of_other_kinds_and_networks_are_left_alone(self, folder: Path) -> None:
        relations = write(folder, f"{NAME}.relations-own.onnx", head(NETWORK))
        for name in ("mine", "fronto-seg", f"{NAME}b", f"a{NAME}"):
            write_head(folder, network=name)
        for name in (f"{NAME}.masks.md", f"{NAME}.masks-01234567.onnx.part", f"{NAME}.masks.onnx"):
            (folder / name).touch()
        assert find_companion(folder / f"{NAME}.onnx", "masks") is None
        assert find_companion(folder / f"{NAME}.onnx") == relations

    def test_more_than_one(self, folder: Path) -> None:
        heads = [mask_head(NETWORK, metadata={"version": str(k)}) for k in range(2)]
        paths = [write_head(folder, content) for content in heads]
        with pytest.raises(InputError) as caught:
            Engine(folder / f"{NAME}.onnx", threads=1)
        assert all(path.name in str(caught.value) for path in paths)

    def test_a_head_is_not_taken_for_a_network(self, folder: Path) -> None:
        write_head(folder)
        assert find_weights(folder) == folder / f"{NAME}.onnx"
        (folder / f"{NAME}.onnx").unlink()
        with pytest.raises(InputError, match="masks"):
            find_weights(folder)


class TestMaskEngine:
    @pytest.mark.parametrize("shown", ["rough", "red"])
    @pytest.mark.parametrize("n", [1, 2, 40])
    def test_runs(self, folder: Path, n: int, shown: str) -> None:
        given = patches(n)
        found = opened(write_head(folder, mask_head(NETWORK, shown=shown))).run(given)
        expected = given.rough if shown == "rough" else given.photo[..., 0]
        assert found.masks.dtype == found.forms.dtype == np.float32
        np.testing.assert_allclose(found.masks, expected / 255, atol=1e-6)
        means = given.photo.mean(axis=(1, 2)) / 255
        np.testing.assert_allclose(found.forms, softmax(means), atol=1e-6)

    @pytest.mark.parametrize("n", [AT_ONCE, AT_ONCE + 1, 2 * AT_ONCE + 5])
    def test_many_are_as_one_by_one(
        self, folder: Path, n: int, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        engine = opened(write_head(folder))
        given = patches(n)
        alone = [engine.run(one_of(given, k)) for k in range(n)]
        sizes = []
        plain = engine._file.run

        def counted(inputs, *rest, **options):
            sizes.append(len(inputs["photo"]))
            return plain(inputs, *rest, **options)

        monkeypatch.setattr(engine._file, "run", counted)
        together = engine.run(given)
        assert sum(sizes) == n
        assert max(sizes) == AT_ONCE
        for name in (part.name for part in fields(DrawnMasks)):
            one_by_one = np.concatenate([getattr(told, name) for told in alone])
            np.testing.assert_allclose(getattr(together, name), one_by_one, atol=1e-6)

    def test_tells_what_is_in_the_file(self, folder: Path) -> None:
        path = write_head(folder, mask_head(NETWORK, metadata={"license": "MIT"}))
        engine = opened(path)
        assert engine.path == path
        assert engine.metadata["license"] == "MIT"

    @pytest.mark.parametrize("metadata", [None, {"network": ""}], ids=["another", "none"])
    def test_for_another_network(self, folder: Path, metadata: dict[str, str] | None) -> None:
        message = refusal(write_head(folder, mask_head(OTHER, metadata=metadata)))
        assert digits(NETWORK) in message
        assert (digits(OTHER) in message) == (metadata is None)

    def test_another_format(self, folder: Path) -> None:
        for content in (NETWORK, head(NETWORK)):
            assert FORMAT in refusal(write(folder, "mine.onnx", content))
        newer = mask_head(NETWORK, metadata={"format": "fronto.masks/9"})
        assert "newer fronto" in refusal(write_head(folder, newer))

    @pytest.mark.parametrize(
        ("name", "options"),
        [
            ("photo", {"side": 40}),
            ("photo", {"side": "s"}),
            ("forms", {"forms": 4}),
            ("forms", {"forms": 2}),
            ("photo", {"inputs": TensorProto.FLOAT}),
            ("rough", {"shown": "red", "drop": ("rough",)}),
            ("masks", {"drop": ("masks",)}),
            ("forms", {"drop": ("forms",)}),
        ],
        ids=["small", "any size", "4 forms", "2 forms", "floats", "no rough", "no masks", "none"],
    )
    def test_other_inputs_and_outputs(self, folder: Path, name: str, options: dict) -> None:
        assert name in refusal(write_head(folder, mask_head(NETWORK, **options)))

    @pytest.mark.parametrize("content", [b"", b"GIF89a" * 9, mask_head(NETWORK)[:-40]])
    def test_damaged_bytes(self, folder: Path, content: bytes) -> None:
        refusal(write(folder, "mine.onnx", content))

    def test_a_wrong_hash_in_its_name(self, folder: Path) -> None:
        path = write_head(folder)
        path.write_bytes(mask_head(NETWORK, metadata={"version": "2"}))
        assert digits(path.read_bytes()) in refusal(path)

    def test_missing(self, folder: Path) -> None:
        refusal(folder / "gone.onnx")


class TestAnswersThatAreNoNumbers:
    @pytest.mark.parametrize(
        ("name", "operators"),
        [("masks", ("Log", "Softmax")), ("forms", ("Identity", "Log"))],
        ids=["masks", "forms"],
    )
    def test_they_are_refused(self, folder: Path, name: str, operators: tuple[str, str]) -> None:
        path = write_head(folder, mask_head(NETWORK, operators=operators))
        engine = opened(path)
        given = patches(3)
        fine = Patches(np.maximum(given.photo, 1), np.maximum(given.rough, 1), given.regions)
        assert np.isfinite(getattr(engine.run(fine), name)).all()
        # The logarithm of 0 is none: one pixel of a rough mask, or a blue that is missing.
        fine.rough[1, 7, 8] = 0
        fine.photo[1, ..., 2] = 0
        with pytest.raises(InputError, match="finite") as caught:
            engine.run(fine)
        message = str(caught.value)
        assert path.name in message
        assert f", {name}:" in message
        assert "\n" not in message

    def test_where_nobody_asks_they_pass(self, folder: Path) -> None:
        engine = opened(write_head(folder, mask_head(NETWORK, operators=("Log", "Softmax"))))
        given = patches(1)
        given.rough[:] = 0
        inputs = {"photo": given.photo, "rough": given.rough}
        (masks,) = engine._file.run(inputs, {"masks": (1, 48, 48)}, "")
        assert np.isneginf(masks).all()


class TestBesideItsNetwork:
    def test_without_one(self, folder: Path) -> None:
        assert Engine(folder / f"{NAME}.onnx", threads=1).masks is None

    def test_with_one(self, folder: Path) -> None:
        path = write_head(folder)
        engine = Engine(folder / f"{NAME}.onnx", threads=1)
        assert engine.masks is not None
        assert engine.masks.path == path
        assert engine.masks.run(patches(3)).forms.shape == (3, len(FORMS))
        assert engine.relations is None

    def test_with_a_relation_head_too(self, folder: Path) -> None:
        write_head(folder)
        write(folder, f"{NAME}.relations-own.onnx", head(NETWORK))
        engine = Engine(folder / f"{NAME}.onnx", threads=1)
        assert engine.masks is not None
        assert engine.relations is not None
        assert engine.masks.path != engine.relations.path

    def test_names_without_digits(self, tmp_path: Path) -> None:
        path = write(tmp_path, "mine.onnx", NETWORK)
        beside = write(tmp_path, "mine.masks-own.onnx", mask_head(NETWORK))
        masks = Engine(path, threads=1).masks
        assert masks is not None
        assert masks.path == beside

    def test_an_unfit_head_is_no_silent_loss(self, folder: Path) -> None:
        path = write_head(folder, mask_head(OTHER))
        with pytest.raises(InputError, match="network") as caught:
            Engine(folder / f"{NAME}.onnx", threads=1)
        assert path.name in str(caught.value)

    def test_it_draws_what_the_network_finds(self, tmp_path: Path) -> None:
        content = finder(5)
        path = write(tmp_path, "mine.onnx", content)
        photo = np.random.default_rng(0).integers(0, 256, (96, 128, 3), dtype=np.uint8)
        alone = segment(photo, engine=Engine(path, threads=1))
        assert {s.forms for s in alone} == {()}
        write(tmp_path, "mine.masks-own.onnx", mask_head(content, shown="red"))
        together = segment(photo, engine=Engine(path, threads=1))
        told = [s for s in together if s.forms]
        assert len(told) > 5
        assert all(sum(s.forms) == pytest.approx(1, abs=1e-5) for s in told)
