"""Starting weights: taken over array by array, or refused by file and array."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

torch = pytest.importorskip("torch")

from fronto.errors import InputError
from fronto.train.network import Network, NetworkOptions
from fronto.train.start import LEAST_VARIANCE, load_backbone

SMALL = NetworkOptions(channels=4, decoder=4)
SHARED = Path(__file__).parents[2] / "../shared/data/init/mobilenet_v2.npz"
PARTS = {
    "0.weight": "weight",
    "1.weight": "gamma",
    "1.bias": "beta",
    "1.running_mean": "moving_mean",
    "1.running_var": "moving_variance",
}


def keras_name(name: str) -> str | None:
    """What Keras calls one of our arrays."""
    if not name.startswith("backbone.") or name.endswith("num_batches_tracked"):
        return None
    words = name.split(".")
    part = PARTS[".".join(words[-2:])]
    norm = part != "weight"
    if words[1] == "stem":
        return f"{'bn_Conv1' if norm else 'Conv1'}.{part}"
    block = "expanded_conv" if words[2] == "0" else f"block_{words[2]}"
    return f"{block}_{words[3]}{'_BN' if norm else ''}.{part}"


@pytest.fixture(scope="module")
def arrays() -> dict[str, np.ndarray]:
    rng = np.random.default_rng(0)
    state = Network(SMALL).state_dict()
    names = {keras_name(name): values.shape for name, values in state.items()}
    return {
        name: rng.uniform(0.1, 1, tuple(shape)).astype(np.float16)
        for name, shape in names.items()
        if name
    }


def test_every_array_of_the_backbone_is_taken_over(
    arrays: dict[str, np.ndarray], tmp_path: Path
) -> None:
    path = tmp_path / "start.npz"
    np.savez(path, **arrays)
    network = Network(SMALL)
    before = {k: v.clone() for k, v in network.state_dict().items()}
    assert load_backbone(network, path) == len(arrays)
    for name, values in network.state_dict().items():
        theirs = keras_name(name)
        if theirs is None:
            assert torch.equal(values, before[name])
        else:
            assert np.allclose(values.numpy(), arrays[theirs].astype(np.float32)), name


def test_variances_that_were_rounded_to_nothing(
    arrays: dict[str, np.ndarray], tmp_path: Path
) -> None:
    path = tmp_path / "start.npz"
    flat = {**arrays, "bn_Conv1.moving_variance": np.zeros(32, np.float16)}
    np.savez(path, **flat)
    network = Network(SMALL)
    load_backbone(network, path)
    assert (network.state_dict()["backbone.stem.1.running_var"] == LEAST_VARIANCE).all()


def test_a_missing_array_and_one_of_another_shape(
    arrays: dict[str, np.ndarray], tmp_path: Path
) -> None:
    path = tmp_path / "start.npz"
    name = "block_3_expand_BN.gamma"
    np.savez(path, **{k: v for k, v in arrays.items() if k != name})
    with pytest.raises(InputError, match=name):
        load_backbone(Network(SMALL), path)
    np.savez(path, **{**arrays, name: np.zeros(3)})
    with pytest.raises(InputError, match=name):
        load_backbone(Network(SMALL), path)


@pytest.mark.parametrize("content", [None, b"", b"no arrays", b"PK\x03\x04 half a file"])
def test_a_file_that_has_no_arrays(tmp_path: Path, content: bytes | None) -> None:
    path = tmp_path / "start.npz"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(InputError, match=r"start\.npz"):
        load_backbone(Network(SMALL), path)


def test_a_single_array(tmp_path: Path) -> None:
    with (tmp_path / "start.npz").open("wb") as file:
        np.save(file, np.zeros((3, 4)))
    with pytest.raises(InputError, match=r"start\.npz"):
        load_backbone(Network(SMALL), tmp_path / "start.npz")


@pytest.mark.skipif(not SHARED.is_file(), reason="the shared starting weights are not here")
def test_the_shared_weights() -> None:
    # Five arrays a convolution: of the stem, two in the first block, three in each other one.
    assert load_backbone(Network(SMALL), SHARED) == 5 * (1 + 2 + 3 * 15)
    assert load_backbone(Network(replace(SMALL, blocks=17)), SHARED) == 5 * (1 + 2 + 3 * 16)
