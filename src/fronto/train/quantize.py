"""The network in 8 bits: half of its time on processors, and about as exact.

Static quantization with ONNX Runtime's own tool: weights and activations become whole numbers of
8 bits, whose ranges are measured on pictures (Jacob et al., "Quantization and Training of Neural
Networks for Efficient Integer-Arithmetic-Only Inference", CVPR 2018).
"""

from __future__ import annotations

import contextlib
import hashlib
import logging
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import numpy.typing as npt

from fronto.engine import Engine
from fronto.engine.companion import QUANTIZED_OF, companion_stem, replace_companion
from fronto.errors import InputError

__all__ = ["quantize_network"]

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
    import onnx
    from onnxruntime.quantization import (  # type: ignore[import-untyped]
        QuantFormat,
        QuantType,
        quantize_static,
    )
    from onnxruntime.quantization.shape_inference import (  # type: ignore[import-untyped]
        quant_pre_process,
    )

    engine = Engine(weights, threads=1, int8=False)  # says what is wrong with the file
    shown = [np.ascontiguousarray(picture) for picture in pictures]
    if not shown:
        raise InputError("pictures", "expected some to measure ranges on, got none")
    with TemporaryDirectory() as folder, _quiet():
        merged, quantized = Path(folder) / "merged.onnx", Path(folder) / "int8.onnx"
        quant_pre_process(str(weights), str(merged), skip_symbolic_shape=True)
        graph = onnx.load(merged).graph
        quantize_static(
            str(merged),
            str(quantized),
            _Pictures(graph.input[0].name, shown),
            quant_format=QuantFormat.QDQ,
            per_channel=True,
            reduce_range=True,
            activation_type=QuantType.QUInt8,
            weight_type=QuantType.QInt8,
            nodes_to_exclude=_kept(graph),
            # Of each picture's extremes the mean: a glint in one of them would cost all others.
            extra_options={"CalibMovingAverage": True},
        )
        model = onnx.load(quantized)
    onnx.helper.set_model_props(model, {**engine.metadata, QUANTIZED_OF: engine.digest})
    content = model.SerializeToString()
    name = companion_stem(weights, "int8")
    directory = directory or weights.parent
    directory.mkdir(parents=True, exist_ok=True)
    path = directory / f"{name}-{hashlib.sha256(content).hexdigest()[:8]}.onnx"
    path.write_bytes(content)
    replace_companion(path, name)
    return path


class _Pictures:
    """What ONNX Runtime measures ranges on: its `CalibrationDataReader`, by its methods."""

    def __init__(self, name: str, pictures: Sequence[npt.NDArray[np.uint8]]) -> None:
        self.name, self.left = name, iter(pictures)

    def get_next(self) -> dict[str, npt.NDArray[np.uint8]] | None:
        picture = next(self.left, None)
        return None if picture is None else {self.name: picture[None]}


def _kept(graph: Any) -> list[str]:
    """Names of the nodes that stay as they are."""
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
