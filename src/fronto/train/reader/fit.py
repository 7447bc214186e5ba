"""How the label reader is trained: its losses."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any, NamedTuple

import torch
import torch.nn.functional as F
from torch import Tensor

from fronto.errors import InputError
from fronto.train.loop import LoopOptions, train_loop
from fronto.train.reader.data import CropBatch, CropSource, crop_batches
from fronto.train.reader.network import SPELLED, Lesson, ReaderNetwork, ReaderOptions
from fronto.train.runs import module_state, read_checkpoint

__all__ = [
    "ReaderFit",
    "ReaderLosses",
    "fit_reader",
    "load_reader",
    "network_input",
    "reader_losses",
    "text_losses",
]

KIND = "the .pt file of a reader's run"
#: Kinds that annotators mix up are softened.
SMOOTHING = 0.05
#: CTC's gradients outweigh all others while it knows no character yet, and nothing is learnt
#: then: the texts' loss begins with this weight and is full after this share of the steps.
TEXT_WEIGHT, TEXT_FULL = 0.2, 0.25
#: Share of the steps over which spelling is helped with, less and less.
SPELLING_END = 0.6
#: Memory of AdamW's second moments: the loss of the first steps is tenfold, and is forgotten soon.
BETAS = (0.9, 0.99)
#: Norm that gradients are cut down to.
MOST_GRADIENT = 5.0


@dataclass(frozen=True)
class ReaderFit(LoopOptions):
    """How to train: as `fronto.train.loop.LoopOptions`, with values that suit.

    Parameters
    ----------
    workers
        Processes that prepare batches.

    Raises
    ------
    InputError
        Naming the field that is out of range.
    """

    steps: int = 10_000
    batch: int = 128
    average: float = 0.999
    save_every: int = 500
    workers: int = 1

    def __post_init__(self) -> None:
        super().__post_init__()
        # Batches of one have no spread to normalise by.
        for name, least in (("batch", 2), ("workers", 0), ("seed", 0)):
            if getattr(self, name) < least:
                raise InputError(name, f"expected {least} or more, got {getattr(self, name)}")


class ReaderLosses(NamedTuple):
    """Means over a batch.

    Parameters
    ----------
    total
        What is minimised.
    text
        Of the crops that carry a text: minus the logarithm of its probability.
    kind
        Cross entropy of the kinds.
    spelling
        Cross entropy of the first characters of the texts, summed over their places.
    """

    total: Tensor
    text: Tensor
    kind: Tensor
    spelling: Tensor


def network_input(crops: Tensor) -> Tensor:
    """Crops (N, 48, 48, 3), uint8, as the network takes them: (N, 3, 48, 48), 0 to 1."""
    return crops.permute(0, 3, 1, 2).to(torch.float32) * (1 / 255)


def text_losses(logits: Tensor, text: Tensor, length: Tensor) -> Tensor:
    """Minus the logarithm of the texts' probabilities, summed over CTC's paths, shape (N,).

    Parameters
    ----------
    logits
        (N, steps, classes).
    text, length
        As in `CropBatch`; a length of 0 stands for the empty text.
    """
    if len(logits) == 0:  # which PyTorch's refuses
        return logits.sum(dim=(1, 2))
    log_probs = F.log_softmax(logits.float(), dim=2).transpose(0, 1)
    steps = torch.full_like(length, logits.shape[1])
    return F.ctc_loss(log_probs, text, steps, length, reduction="none", zero_infinity=True)


def reader_losses(lesson: Lesson, batch: CropBatch, share: float) -> ReaderLosses:
    """The losses of a batch when this share of the steps, 0 to 1, is done."""
    readings, spelling = lesson
    rows = batch.length > 0
    count = rows.sum().clamp(min=1)
    text = text_losses(readings.text[rows], batch.text[rows], batch.length[rows]).sum() / count
    kind = F.cross_entropy(readings.kind, batch.kind, label_smoothing=SMOOTHING)
    spelled = F.pad(batch.text, (0, SPELLED))[rows, :SPELLED]
    characters = F.cross_entropy(spelling[rows].flatten(0, 1), spelled.flatten(), reduction="sum")
    characters = characters / count
    weight = TEXT_WEIGHT + (1 - TEXT_WEIGHT) * min(1.0, share / TEXT_FULL)
    help_ = max(0.0, 1 - share / SPELLING_END)
    return ReaderLosses(weight * text + kind + help_ * characters, text, kind, characters)


def fit_reader(
    network: ReaderNetwork,
    sources: Sequence[tuple[CropSource, float]],
    run: Path,
    options: ReaderFit | None = None,
    *,
    validate: Callable[[ReaderNetwork], dict[str, float]] | None = None,
    progress: bool = True,
) -> ReaderNetwork:
    """Train a network, or go on where the run in this folder stopped.

    Parameters
    ----------
    network
        Trained in place, on a GPU where there is one.
    sources
        Crops, and the share of each source.
    run
        Folder of the run; made where missing.
    options
        How to train.
    validate
        Called with the averaged network at each checkpoint; its figures go to the metrics.
    progress
        Whether a progress bar with the time left is shown.

    Returns
    -------
    The network with averaged weights, in evaluation mode.

    Raises
    ------
    InputError
        If the folder holds a run of another network.
    """
    options = options or ReaderFit()
    network.to(memory_format=torch.channels_last)  # type: ignore[call-overload]

    def losses(batch: CropBatch, device: torch.device, share: float) -> dict[str, Tensor]:
        batch = CropBatch(*(part.to(device) for part in batch))
        image = network_input(batch.crops).contiguous(memory_format=torch.channels_last)
        return reader_losses(network.lesson(image), batch, share)._asdict()

    return train_loop(
        network,
        run,
        options,
        {"reader_options": _options_of(network)},
        lambda seed: crop_batches(sources, batch=options.batch, seed=seed, workers=options.workers),
        losses,
        kind=KIND,
        betas=BETAS,
        most_gradient=MOST_GRADIENT,
        validate=validate,
        progress=progress,
    )


def load_reader(path: Path) -> ReaderNetwork:
    """The averaged network of a checkpoint, in evaluation mode.

    Raises
    ------
    InputError
        If the file is missing or no checkpoint of a reader.
    """
    state = read_checkpoint(path, "reader_options", KIND)
    options = state["reader_options"]
    network = ReaderNetwork(ReaderOptions(**options | {"stages": tuple(options["stages"])}))
    network.load_state_dict(module_state(state["averaged"]))
    return network.eval()


def _options_of(network: ReaderNetwork) -> dict[str, Any]:
    return asdict(network.options) | {"stages": list(network.options.stages)}
