"""Networks in 8 bits: half of their time on processors, and about as exact.

Static quantization with ONNX Runtime's own tool: weights and activations become whole numbers of
8 bits, whose ranges are measured on pictures (Jacob et al., "Quantization and Training of Neural
Networks for Efficient Integer-Arithmetic-Only Inference", CVPR 2018).
"""

from __future__ import annotations

import contextlib
import hashlib
import logging
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import numpy.typing as npt

from fronto.engine import Engine, ReaderEngine
from fronto.engine.companion import QUANTIZED_OF, companion_stem, replace_companion
from fronto.errors import InputError

__all__ = ["quantize_network", "quantize_reader"]

#: What the first convolutions tell is not shared by others that could make up for it: they stay as
#: they are (the stem, its depthwise convolution, its projection). So does what comes after the
#: features: a sixteenth of a pixel counts there.
FIRST = 3
FEATURES = "features"


def quantize_network(
    weights: Path, pictures: Iterable[npt.NDArray[np.uint8]], directory: Path | None = None
) -> Path:
    """Write a network in 8 bits beside its file: ``NETWORK.int8-xxxxxxxx.onnx``.

    One that is there already is replaced. Weights get 7 of the 8 bits: with all of them some
    processors' sums overflow, and results would differ from one to another.

    Parameters
    ----------
    weights
        The network's file, as `fronto.train.export.export_onnx` writes it.
    pictures
        Each of shape (h, w, 3), uint8, RGB; sides are multiples of what the network takes. Some
        dozens like those that it will see.
    directory
        Folder to write to; None: the network's.

    Returns
    -------
    The file.

    Raises
    ------
    InputError
        If the file is missing, damaged, or no such network, or there are no pictures.
    """
    engine = Engine(weights, threads=1, int8=False)  # says what is wrong with the file
    shown = [np.ascontiguousarray(picture)[None] for picture in pictures]
    if not shown:
        raise InputError("pictures", "expected some to measure ranges on, got none")
    stated = {**engine.metadata, QUANTIZED_OF: engine.digest}
    return _written(weights, shown, stated, _outside_trunk, {}, directory or weights.parent)


def quantize_reader(
    weights: Path, crops: Iterable[npt.NDArray[np.uint8]], directory: Path | None = None
) -> Path:
    """Write a label reader in 8 bits beside its file: ``READER.int8-xxxxxxxx.onnx``.

    As `quantize_network`, in two fifths of the reader's time.

    Parameters
    ----------
    weights
        The reader's file, as `fronto.train.reader.export.export_reader` writes it.
    crops
        Each of shape (n, 48, 48, 3), uint8, RGB: those of one photo.
    directory
        Folder to write to; None: the reader's.

    Returns
    -------
    The file.

    Raises
    ------
    InputError
        If the file is missing, damaged, or no reader, or there are no crops.
    """
    engine = ReaderEngine(weights, threads=1, int8=False)
    shown = [np.ascontiguousarray(some) for some in crops if len(some)]
    if not shown:
        raise InputError("crops", "expected some to measure ranges on, got none")
    stated = {**engine.metadata, QUANTIZED_OF: engine.digest}
    options = {"op_types_to_quantize": ["Conv", "Relu", "Add"]}
    return _written(weights, shown, stated, _first, options, directory or weights.parent)


def _written(
    weights: Path,
    batches: Sequence[npt.NDArray[np.uint8]],
    metadata: Mapping[str, str],
    kept: Callable[[Any], list[str]],
    options: Mapping[str, Any],
    directory: Path,
) -> Path:
    """Write a file in 8 bits beside that of its network; `kept` names the nodes that stay."""
    import onnx
    from onnxruntime.quantization import (  # type: ignore[import-untyped]
        QuantFormat,
        QuantType,
        quantize_static,
    )
    from onnxruntime.quantization.shape_inference import (  # type: ignore[import-untyped]
        quant_pre_process,
    )

    with TemporaryDirectory() as folder, _quiet():
        merged, quantized = Path(folder) / "merged.onnx", Path(folder) / "int8.onnx"
        quant_pre_process(str(weights), str(merged), skip_symbolic_shape=True)
        graph = onnx.load(merged).graph
        quantize_static(
            str(merged),
            str(quantized),
            _Batches(graph.input[0].name, batches),
            quant_format=QuantFormat.QDQ,
            per_channel=True,
            reduce_range=True,
            activation_type=QuantType.QUInt8,
            weight_type=QuantType.QInt8,
            nodes_to_exclude=kept(graph),
            # Of each picture's extremes the mean: a glint in one of them would cost all others.
            extra_options={"CalibMovingAverage": True},
            **options,
        )
        model = onnx.load(quantized)
    onnx.helper.set_model_props(model, dict(metadata))
    content = model.SerializeToString()
    name = companion_stem(weights, "int8")
    directory.mkdir(parents=True, exist_ok=True)
    path = directory / f"{name}-{hashlib.sha256(content).hexdigest()[:8]}.onnx"
    path.write_bytes(content)
    replace_companion(path, name)
    return path


class _Batches:
    """What ONNX Runtime measures ranges on: its `CalibrationDataReader`, by its methods."""

    def __init__(self, name: str, batches: Sequence[npt.NDArray[np.uint8]]) -> None:
        self.name, self.left = name, iter(batches)

    def get_next(self) -> dict[str, npt.NDArray[np.uint8]] | None:
        batch = next(self.left, None)
        return None if batch is None else {self.name: batch}


def _first(graph: Any) -> list[str]:
    """Name of the first convolution."""
    return [node.name for node in graph.node if node.op_type == "Conv"][:1]


def _outside_trunk(graph: Any) -> list[str]:
    """Names of the first nodes, and of all after the features."""
    made_by = {output: node for node in graph.node for output in node.output}
    trunk, waiting = set(), [FEATURES]
    while waiting:
        node = made_by.get(waiting.pop())
        if node is not None and node.name not in trunk:
            trunk.add(node.name)
            waiting += node.input
    convolutions = [n.name for n in graph.node if n.op_type == "Conv" and n.name in trunk]
    first = graph.node[: [n.name for n in graph.node].index(convolutions[FIRST - 1]) + 1]
    early = {node.name for node in first}
    return [n.name for n in graph.node if n.name not in trunk or n.name in early]


@contextlib.contextmanager
def _quiet() -> Iterator[None]:
    """ONNX Runtime's tool warns of shapes that it does not know: those of any picture."""
    before = logging.root.manager.disable
    logging.disable(logging.WARNING)
    try:
        yield
    finally:
        logging.disable(before)
