"""Figures of a network in training, by the same way that photos take when it is used."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TYPE_CHECKING, cast

import numpy as np
import numpy.typing as npt
import torch

from fronto.datasets.records import LabeledImage
from fronto.train.network import STRIDE, Network

if TYPE_CHECKING:
    from fronto.engine import Engine, Maps
    from fronto.segments import Segments

__all__ = ["TorchEngine", "spread", "validation", "validation_of"]


class TorchEngine:
    """What `fronto.segmentation.segment` needs of a `fronto.engine.Engine`, run by PyTorch.

    Parameters
    ----------
    network
        In evaluation mode.
    """

    stride = STRIDE
    relations = None
    verifier = None
    masks = None
    reader = None

    def __init__(self, network: Network) -> None:
        self.network = network

    @torch.no_grad()
    def run(self, images: npt.NDArray[np.uint8]) -> Maps:
        """Probabilities for pictures (N, H, W, 3), uint8, RGB; H and W multiples of 16."""
        from fronto.engine import Maps

        device = next(self.network.parameters()).device
        pixels = torch.from_numpy(np.array(images)).permute(0, 3, 1, 2).to(device)
        maps = self.network(pixels.to(torch.float32) / 255)
        outputs = (
            maps.masks.sigmoid(),
            maps.classes.softmax(1),
            maps.centers.sigmoid(),
            maps.sides,
        )
        return Maps(*(output.float().cpu().numpy() for output in outputs))


def spread(images: Sequence[LabeledImage], at_most: int) -> list[LabeledImage]:
    """So many of the images, evenly spread over them; all where there are no more."""
    if len(images) <= at_most:
        return list(images)
    return [images[k * len(images) // at_most] for k in range(at_most)]


def validation(
    images: Sequence[LabeledImage], at_most: int = 100
) -> Callable[[Network], dict[str, float]]:
    """Make what `fronto.train.fit.fit` calls at each checkpoint.

    Parameters
    ----------
    images
        Labelled photos that are not trained on.
    at_most
        Of more, this many are taken, evenly spread over them.

    Returns
    -------
    A function that gives precision, recall and F1 of the buttons at IoU 0.5 of the boxes.
    """

    def figures(network: Network) -> dict[str, float]:
        return validation_of(cast("Engine", TorchEngine(network)), images, at_most)

    return figures


def validation_of(
    engine: Engine, images: Sequence[LabeledImage], at_most: int = 100
) -> dict[str, float]:
    """Precision, recall and F1 of the buttons at IoU 0.5 of the boxes.

    Parameters
    ----------
    engine
        What finds them.
    images
        Labelled photos that are not trained on.
    at_most
        Of more, this many are taken, evenly spread over them.
    """
    from fronto.evaluate import evaluate_segmentation
    from fronto.segmentation import segment

    chosen = spread(images, at_most)

    def predict(image: LabeledImage) -> Segments:
        return segment(image.path, engine=engine, second_look=False)

    found = evaluate_segmentation(chosen, predict, by="box").buttons
    return {
        "val_precision": found.precision,
        "val_recall": found.recall,
        "val_f1": found.f1,
    }
