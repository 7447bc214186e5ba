"""Verifiers: found beside their network, checked against it, and run."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import numpy.typing as npt
import pytest
from onnx import TensorProto

from fronto.categories import CATEGORIES
from fronto.engine import Engine, VerifierEngine, find_companion, find_weights
from fronto.engine.verifier import AT_ONCE, FORMAT
from fronto.errors import InputError
from fronto.segmentation import finds_in, segment
from fronto.verification import SIDE
from onnxfiles import digits, finder, head, mask_head, network, verifier

NETWORK = network()
OTHER = network(stride=8)
NAME = f"fronto-seg-{digits(NETWORK)}"


def patches(n: int, seed: int = 0) -> npt.NDArray[np.uint8]:
    rng = np.random.default_rng(seed)
    plain = rng.integers(0, 256, (n, SIDE, SIDE, 3))
    return np.asarray(plain * rng.random((n, 1, 1, 3)), np.uint8)  # means that differ


def write(folder: Path, name: str, content: bytes) -> Path:
    path = folder / name
    path.write_bytes(content)
    return path


def write_verifier(folder: Path, content: bytes | None = None) -> Path:
    content = verifier(NETWORK) if content is None else content
    return write(folder, f"{NAME}.verifier-{digits(content)}.onnx", content)


def opened(path: Path) -> VerifierEngine:
    return VerifierEngine(path, network=digits(NETWORK), classes=3, threads=1)


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


class TestVerifierEngine:
    @pytest.mark.parametrize("n", [1, 2, AT_ONCE, AT_ONCE + 5])
    def test_runs(self, folder: Path, n: int) -> None:
        given = patches(n)
        found = opened(write_verifier(folder)).run(given)
        means = np.exp(given.mean(axis=(1, 2)) / 255)
        expected = means / means.sum(axis=1, keepdims=True)
        assert found.kinds.dtype == found.classes.dtype == np.float32
        np.testing.assert_allclose(found.kinds, expected, atol=1e-5)
        np.testing.assert_allclose(found.classes, expected, atol=1e-5)

    @pytest.mark.parametrize(
        "wrong", [patches(2)[:, :40], patches(2).astype(np.float32), patches(2)[0]]
    )
    def test_other_patches(self, folder: Path, wrong: npt.NDArray[np.generic]) -> None:
        with pytest.raises(InputError, match="patches"):
            opened(write_verifier(folder)).run(wrong)  # type: ignore[arg-type]

    def test_tells_what_is_in_the_file(self, folder: Path) -> None:
        path = write_verifier(folder, verifier(NETWORK, metadata={"license": "MIT"}))
        assert opened(path).path == path
        assert opened(path).metadata["license"] == "MIT"

    @pytest.mark.parametrize("metadata", [None, {"network": ""}], ids=["another", "none"])
    def test_for_another_network(self, folder: Path, metadata: dict[str, str] | None) -> None:
        message = refusal(write_verifier(folder, verifier(OTHER, metadata=metadata)))
        assert digits(NETWORK) in message

    def test_another_format(self, folder: Path) -> None:
        for content in (NETWORK, head(NETWORK), mask_head(NETWORK)):
            assert FORMAT in refusal(write(folder, "mine.onnx", content))

    @pytest.mark.parametrize(
        ("name", "options"),
        [
            ("patches", {"side": 48}),
            ("patches", {"side": "s"}),
            ("patches", {"inputs": TensorProto.FLOAT}),
            ("classes", {"classes": 4}),
            ("kinds", {"drop": ("kinds",)}),
            ("classes", {"drop": ("classes",)}),
        ],
    )
    def test_other_inputs_and_outputs(self, folder: Path, name: str, options: dict) -> None:
        assert name in refusal(write_verifier(folder, verifier(NETWORK, **options)))

    @pytest.mark.parametrize("content", [b"", b"GIF89a" * 9, verifier(NETWORK)[:-40]])
    def test_damaged_bytes(self, folder: Path, content: bytes) -> None:
        refusal(write(folder, "mine.onnx", content))

    def test_answers_that_are_no_numbers(self, folder: Path) -> None:
        engine = opened(write_verifier(folder, verifier(NETWORK, operator="Log")))
        given = np.maximum(patches(3), 1)
        assert np.isfinite(engine.run(given).kinds).all()
        given[1] = 0  # the logarithm of 0 is none
        with pytest.raises(InputError, match="finite"):
            engine.run(given)


class TestBesideItsNetwork:
    def test_with_and_without_one(self, folder: Path) -> None:
        assert Engine(folder / f"{NAME}.onnx", threads=1).verifier is None
        path = write_verifier(folder)
        assert find_companion(folder / f"{NAME}.onnx", "verifier") == path
        assert find_companion(folder / f"{NAME}.onnx", "masks") is None
        used = Engine(folder / f"{NAME}.onnx", threads=1).verifier
        assert used is not None
        assert used.path == path

    def test_it_is_not_taken_for_a_network(self, folder: Path) -> None:
        write_verifier(folder)
        assert find_weights(folder) == folder / f"{NAME}.onnx"

    def test_an_unfit_one_is_no_silent_loss(self, folder: Path) -> None:
        path = write_verifier(folder, verifier(OTHER))
        with pytest.raises(InputError, match="network") as caught:
            Engine(folder / f"{NAME}.onnx", threads=1)
        assert path.name in str(caught.value)


class TestInSegmentation:
    """Finds on a part of a photo that is red (nothing), green (buttons), blue (plates)."""

    @pytest.fixture
    def engine(self, tmp_path: Path) -> Engine:
        content = finder(5)
        path = write(tmp_path, "mine.onnx", content)
        alike = verifier(content, classes=len(CATEGORIES), steep=40.0)
        write(tmp_path, "mine.verifier-own.onnx", alike)
        return Engine(path, threads=1)

    @staticmethod
    def photo(color: int) -> npt.NDArray[np.uint8]:
        noise = np.random.default_rng(0).integers(0, 60, (96, 128, 3))
        noise[..., color] += 120
        return np.asarray(noise, np.uint8)

    def test_what_looks_like_nothing_is_left_out(self, engine: Engine) -> None:
        asked = engine.verifier
        engine.verifier = None
        before = segment(self.photo(0), engine=engine)
        engine.verifier = asked
        assert len(before) > 5
        assert len(segment(self.photo(0), engine=engine)) == 0

    @pytest.mark.parametrize(("color", "plate"), [(1, False), (2, True)])
    def test_buttons_and_plates_are_what_they_look_like(
        self, engine: Engine, color: int, plate: bool
    ) -> None:
        found = segment(self.photo(color), engine=engine)
        assert len(found) > 5
        assert all(s.is_button != plate for s in found)
        assert [s.confidence for s in found] == sorted((s.confidence for s in found), reverse=True)

    def test_it_is_asked_about_nearly_all_once(
        self, engine: Engine, monkeypatch: pytest.MonkeyPatch
    ) -> None:
        assert engine.verifier is not None
        asked = []
        plain = engine.verifier.run

        def noted(given: npt.NDArray[np.uint8]):
            asked.append(len(given))
            return plain(given)

        monkeypatch.setattr(engine.verifier, "run", noted)
        finds, seconds = finds_in(engine, self.photo(1), 0.0, second_look=False)
        assert asked == [len(finds)]
        assert seconds > 0

    def test_a_photo_without_finds(self, engine: Engine) -> None:
        assert len(segment(np.zeros((64, 64, 3), np.uint8), engine=engine)) == 0
