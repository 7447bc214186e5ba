"""From a trained network to the file that `fronto.engine` runs.

The file keeps every parameter under its name in the network (nothing is folded: ONNX Runtime
does that when it loads), so that a published file is also a checkpoint to train on from.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import msgspec
import torch
from torch import Tensor, nn

from fronto.categories import CATEGORIES
from fronto.errors import InputError
from fronto.train.network import STRIDE, Network, NetworkOptions
from fronto.train.onnxwriter import write_onnx

__all__ = ["export_onnx", "load_onnx"]

FORMAT = "fronto.segmentation/2"
#: Height and width must be multiples of this.
MULTIPLE = 16


class _Deployed(nn.Module):
    """Bytes in, probabilities out."""

    def __init__(self, network: Network) -> None:
        super().__init__()
        self.network = network

    def forward(self, image: Tensor) -> tuple[Tensor, ...]:
        x = image.permute(0, 3, 1, 2).to(torch.float32) * (1 / 255)
        maps = self.network(x)
        assert maps.features is not None
        return (
            torch.sigmoid(maps.masks),
            torch.softmax(maps.classes, dim=1),
            torch.sigmoid(maps.centers),
            maps.sides,
            maps.features,
        )


def export_onnx(network: Network, directory: Path, name: str, metadata: Mapping[str, str]) -> Path:
    """Write a network as ONNX, its name ending in the first eight digits of its SHA-256.

    Input ``image``: (N, H, W, 3) uint8, RGB, H and W multiples of 16. Outputs as
    `fronto.train.network.Maps`, as probabilities: ``masks`` (N, 2, H, W), ``classes``
    (N, 11, h, w), ``centers`` (N, 2, h, w), ``sides`` (N, 4, h, w) in pixels, and
    ``features`` (N, C, h, w).

    Parameters
    ----------
    network
        What `fronto.train.fit` gives.
    directory
        Folder to write to; made where missing.
    name
        Beginning of the file's name.
    metadata
        Put into the file beside what is known here: version, licence, training data, ...

    Returns
    -------
    The file.
    """
    batch, rows, columns = (torch.export.Dim(n, min=1) for n in ("batch", "rows", "columns"))
    return write_onnx(
        _Deployed(network).eval(),
        [torch.zeros(2, 96, 128, 3, dtype=torch.uint8)],
        inputs=["image"],
        outputs=["masks", "classes", "centers", "sides", "features"],
        dynamic=[{0: batch, 1: MULTIPLE * rows, 2: MULTIPLE * columns}],
        metadata={
            "format": FORMAT,
            "classes": ",".join(CATEGORIES),
            "mean": "0,0,0",
            "std": "255,255,255",
            "stride": str(STRIDE),
            "multiple": str(MULTIPLE),
            "channels": str(network.options.decoder),
            "network": msgspec.json.encode(asdict(network.options)).decode(),
            **metadata,
        },
        directory=directory,
        name=name,
    )


def load_onnx(path: Path) -> Network:
    """The network in a file of `export_onnx`, to train on from.

    Raises
    ------
    InputError
        If the file is missing or no such file.
    """
    import onnx

    try:
        model = onnx.load(path)
        metadata = {entry.key: entry.value for entry in model.metadata_props}
        # Networks of earlier versions have no such branch, and do not say so.
        stated = {"details": 0} | msgspec.json.decode(metadata["network"])
        options = msgspec.convert(stated, NetworkOptions)
    except FileNotFoundError:
        raise InputError(f"weights {path}", "expected a file, there is none") from None
    except Exception as error:  # protobuf and onnx raise whatever the bytes provoke
        reason = " ".join(str(error).split())[:80]
        raise InputError(f"weights {path}", f"expected a network of fronto, got: {reason}") from (
            None
        )
    network = Network(options)
    state: dict[str, Any] = {
        tensor.name.removeprefix("network."): torch.from_numpy(
            onnx.numpy_helper.to_array(tensor).copy()
        )
        for tensor in model.graph.initializer
    }
    wanted = network.state_dict()
    missing = [k for k in wanted if k not in state and not k.endswith("num_batches_tracked")]
    if missing:
        raise InputError(f"weights {path}", f"expected all parameters, {missing[0]} is missing")
    network.load_state_dict({k: state.get(k, wanted[k]) for k in wanted})
    return network.eval()
