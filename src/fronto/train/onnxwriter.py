"""From a traced network to an ONNX file that says what it is."""

from __future__ import annotations

import hashlib
import warnings
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import torch
from torch import Tensor, nn

__all__ = ["write_onnx"]

OPSET = 18


def write_onnx(
    model: nn.Module,
    examples: Sequence[Tensor],
    *,
    inputs: Sequence[str],
    outputs: Sequence[str],
    dynamic: Sequence[Mapping[int, Any]],
    metadata: Mapping[str, str],
    directory: Path,
    name: str,
) -> Path:
    """Write a model as ``NAME-xxxxxxxx.onnx``, the first eight digits of its SHA-256.

    Nothing but constants is folded: ONNX Runtime does that when it loads, and so a published
    file keeps every parameter under its name.

    Parameters
    ----------
    model
        In evaluation mode.
    examples
        Inputs of the right types.
    inputs, outputs
        Their names.
    dynamic
        Axes of each input that vary, by number (`torch.export.Dim`).
    metadata
        Put into the file.
    directory
        Folder to write to; made where missing.
    name
        Beginning of the file's name.

    Returns
    -------
    The file.
    """
    import onnx
    import onnxscript.optimizer

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # the exporter warns of its own deprecated parts
        program = torch.onnx.export(
            model,
            tuple(examples),
            input_names=list(inputs),
            output_names=list(outputs),
            dynamic_shapes=tuple(dict(axes) for axes in dynamic),
            opset_version=OPSET,
            dynamo=True,
            optimize=False,
            verbose=False,
        )
    assert program is not None
    # Constants only: the exporter's own optimisation would fold the batch norms, too.
    onnxscript.optimizer.fold_constants(program.model)
    onnxscript.optimizer.remove_unused_nodes(program.model)
    exported = program.model_proto
    _forget_origins(exported)
    for key, value in metadata.items():
        entry = exported.metadata_props.add()
        entry.key, entry.value = key, value
    onnx.checker.check_model(exported)
    content = exported.SerializeToString()
    directory.mkdir(parents=True, exist_ok=True)
    path = directory / f"{name}-{hashlib.sha256(content).hexdigest()[:8]}.onnx"
    path.write_bytes(content)
    return path


def _forget_origins(model: Any) -> None:
    """Drop stack traces: they carry this machine's paths, and a megabyte."""
    for node in model.graph.node:
        del node.metadata_props[:]
        node.doc_string = ""
    for value in (*model.graph.value_info, *model.graph.input, *model.graph.output):
        del value.metadata_props[:]
    for tensor in model.graph.initializer:
        del tensor.metadata_props[:]
