"""Figures of a context head in training, by the same way that photos take when it is used."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np
import numpy.typing as npt
import torch

from fronto.datasets.records import LabeledImage
from fronto.engine import Engine, ReaderEngine
from fronto.errors import InputError
from fronto.evaluate.labels import evaluate_labels
from fronto.images import as_rgb
from fronto.labels.context import Context
from fronto.labels.name import name_buttons
from fronto.labels.reader import LabelReader
from fronto.rectifier import Rectifier
from fronto.rectifieroptions import RectifierOptions
from fronto.results import Panel
from fronto.train.context.network import ContextNetwork
from fronto.train.validate import spread

__all__ = ["TorchContext", "context_validation"]


class TorchContext:
    """What `fronto.labels.context.Head` asks for, run by PyTorch.

    Parameters
    ----------
    network
        In evaluation mode.
    """

    def __init__(self, network: ContextNetwork) -> None:
        self.network, self.labels = network, network.labels

    @torch.no_grad()
    def run(self, context: Context) -> npt.NDArray[np.float32]:
        """Weigh the things of one panel."""
        device = next(self.network.parameters()).device
        parts = [
            torch.from_numpy(part).to(device)[None]
            for part in (
                context.own,
                context.seen,
                context.ordered,
                context.geometry,
                context.pairs,
            )
        ]
        there = torch.ones(parts[0].shape[:2], dtype=torch.bool, device=device)
        told: npt.NDArray[np.float32] = self.network(*parts, there)[0].softmax(-1).cpu().numpy()
        return told


def context_validation(
    images: Sequence[LabeledImage], reader: Path, engine: Path, at_most: int = 100
) -> Callable[[ContextNetwork], dict[str, float]]:
    """Make what `fronto.train.context.fit.fit_context` calls at each checkpoint.

    Parameters
    ----------
    images
        Labelled photos that are not trained on.
    reader, engine
        Files of what reads labels, and of what finds buttons.
    at_most
        Of more, this many are taken, evenly spread over them.

    Returns
    -------
    A function that gives the shares of the labels of found buttons that are told right and
    wrong.
    """
    chosen = spread(images, at_most)
    rectifier = Rectifier(RectifierOptions(read_labels=False), engine=Engine(engine))
    reading = LabelReader(ReaderEngine(reader))
    panels: dict[Path, Panel] = {}

    def figures(network: ContextNetwork) -> dict[str, float]:
        head = TorchContext(network)
        if not panels:
            for image in chosen:
                with suppress(InputError):  # a photo that cannot be used must not end a run
                    panels[image.path] = rectifier(image.path)

        def named(image: LabeledImage) -> Panel:
            return name_buttons(panels[image.path], as_rgb(image.path), reading, head)

        report = evaluate_labels([image for image in chosen if image.path in panels], named)
        return {"val_right": report.all.share("right"), "val_wrong": report.all.share("wrong")}

    return figures
