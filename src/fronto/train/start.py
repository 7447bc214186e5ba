"""MobileNetV2 weights to start from."""

from __future__ import annotations

from pathlib import Path
from zipfile import BadZipFile

import numpy as np
import torch

from fronto.errors import InputError
from fronto.train.network import Network

__all__ = ["load_backbone"]

#: A batch norm's variances that quantisation rounded to 0 would blow its channel up.
LEAST_VARIANCE = 1e-2


def load_backbone(network: Network, path: Path) -> int:
    """Put a Keras-named MobileNetV2 (``.npz``) into the network's backbone.

    Parameters
    ----------
    network
        Changed in place.
    path
        Arrays named after Keras' layers (``Conv1``, ``bn_Conv1``, ``block_1_expand``, ...), with
        convolution kernels in PyTorch's layout.

    Returns
    -------
    The number of arrays taken over.

    Raises
    ------
    InputError
        If the file is missing, no ``.npz``, or lacks an array of the right shape.
    """
    try:
        with path.open("rb") as file:
            arrays = dict(np.load(file))
    except (OSError, ValueError, TypeError, EOFError, BadZipFile) as error:
        raise InputError(f"starting weights {path}", f"expected an .npz file, got: {error}") from (
            None
        )
    taken = 0
    state = network.state_dict()
    for module, convolution, normalization in _layers(network):
        for ours, theirs in (
            (f"{module}.0.weight", f"{convolution}.weight"),
            (f"{module}.1.weight", f"{normalization}.gamma"),
            (f"{module}.1.bias", f"{normalization}.beta"),
            (f"{module}.1.running_mean", f"{normalization}.moving_mean"),
            (f"{module}.1.running_var", f"{normalization}.moving_variance"),
        ):
            found = arrays.get(theirs)
            wanted = tuple(state[ours].shape)
            if found is None or found.shape != wanted:
                got = "none" if found is None else f"shape {found.shape}"
                raise InputError(
                    f"starting weights {path}, {theirs}",
                    f"expected an array of shape {wanted}, got {got}",
                )
            values = torch.from_numpy(found.astype(np.float32))
            if ours.endswith("running_var"):
                values.clamp_(min=LEAST_VARIANCE)
            state[ours] = values
            taken += 1
    network.load_state_dict(state)
    return taken


def _layers(network: Network) -> list[tuple[str, str, str]]:
    """Our modules, and Keras' names of their convolution and batch norm."""
    layers = [("backbone.stem", "Conv1", "bn_Conv1")]
    for k in range(len(network.backbone.blocks)):
        block = "expanded_conv" if k == 0 else f"block_{k}"
        for ours, theirs in (
            ("expand", "expand"),
            ("depthwise", "depthwise"),
            ("project", "project"),
        ):
            if k == 0 and ours == "expand":
                continue
            layers.append(
                (f"backbone.blocks.{k}.{ours}", f"{block}_{theirs}", f"{block}_{theirs}_BN")
            )
    return layers
