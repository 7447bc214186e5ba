"""Figures of a reader in training, by the same way that crops take when it is used."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np
import numpy.typing as npt
import torch

from fronto.datasets.records import LabeledImage
from fronto.labels.alphabet import ALPHABET, KINDS
from fronto.labels.targets import ReadTarget
from fronto.train.reader.data import CropBatch, collated, labelled_crops
from fronto.train.reader.fit import network_input
from fronto.train.reader.jitter import crop_of
from fronto.train.reader.network import ReaderNetwork, Readings

if TYPE_CHECKING:
    from fronto.engine import LabelScores, ReaderEngine
    from fronto.labels.reader import Reading

__all__ = [
    "HeldOut",
    "Temperatures",
    "TorchReaderEngine",
    "held_out_crops",
    "network_outputs",
    "reading_figures",
    "reading_validation",
]

#: Crops at a time.
CHUNK = 256
#: Share of the legible labels that may be read wrong where "right" is asked for at a threshold.
WRONG_ALLOWED = 0.03
#: Bins of the expected calibration error (Guo et al., ICML 2017).
BINS = 15
#: Kinds that name no label.
SILENT = ("other", "blank", "unreadable")


@dataclass(frozen=True)
class Temperatures:
    """What the logits of each head are divided by before the softmax."""

    text: float = 1.0
    kind: float = 1.0


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Crops that are not trained on.

    Parameters
    ----------
    batch
        The crops and their targets.
    labels
        What each is to be read as: a text, a function, or "" for none.
    kinds
        The kind of each.
    photos
        The name of the photo that each is from.
    """

    batch: CropBatch
    labels: tuple[str, ...]
    kinds: tuple[str, ...]
    photos: tuple[str, ...]

    def part(self, chosen: npt.NDArray[np.bool_]) -> HeldOut:
        """Those crops, shape (n,), that are chosen."""
        rows = np.flatnonzero(chosen)
        return HeldOut(
            CropBatch(*(values[torch.from_numpy(rows)] for values in self.batch)),
            *(tuple(values[k] for k in rows) for values in (self.labels, self.kinds, self.photos)),
        )


def held_out_crops(images: Sequence[LabeledImage]) -> HeldOut:
    """All labelled boxes of photos as the reader would get them."""
    crops, targets, photos = [], [], []
    for image in images:
        for _, sample in labelled_crops(image):
            crops.append(crop_of(sample))
            targets.append(sample.target)
            photos.append(image.path.stem)
    labels = tuple(_label(target) for target in targets)
    kinds = tuple(target.kind for target in targets)
    return HeldOut(collated(crops, targets), labels, kinds, tuple(photos))


def _label(target: ReadTarget) -> str:
    if target.kind == "text":
        return target.text
    return "" if target.kind in SILENT else target.kind


@torch.no_grad()
def network_outputs(network: ReaderNetwork, crops: torch.Tensor) -> Readings:
    """Logits for crops (N, 48, 48, 3), uint8, on the processor's side."""
    device = next(network.parameters()).device
    parts = [network(network_input(chunk.to(device))) for chunk in crops.split(CHUNK)]
    return Readings(*(torch.cat(part).float().cpu() for part in zip(*parts, strict=True)))


class TorchReaderEngine:
    """What `fronto.labels.reader.LabelReader` needs of a `ReaderEngine`, run by PyTorch.

    Parameters
    ----------
    network
        In evaluation mode.
    temperatures
        Of its heads.
    """

    alphabet = ALPHABET
    kinds = KINDS

    def __init__(self, network: ReaderNetwork, temperatures: Temperatures | None = None) -> None:
        self.network = network
        self.temperatures = temperatures or Temperatures()

    def run(self, crops: npt.NDArray[np.uint8]) -> LabelScores:
        """Probabilities for crops (N, 48, 48, 3), uint8, RGB."""
        from fronto.engine import LabelScores

        logits = network_outputs(self.network, torch.from_numpy(np.array(crops)))
        text = torch.softmax(logits.text / self.temperatures.text, dim=2)
        kind = torch.softmax(logits.kind / self.temperatures.kind, dim=1)
        return LabelScores(text.numpy(), kind.numpy())


def readings_of(
    network: ReaderNetwork, held_out: HeldOut, temperatures: Temperatures | None = None
) -> tuple[Reading, ...]:
    """What the network reads in crops."""
    from fronto.labels.reader import LabelReader

    engine = cast("ReaderEngine", TorchReaderEngine(network, temperatures))
    return LabelReader(engine).read(held_out.batch.crops.numpy())


def reading_figures(
    network: ReaderNetwork, held_out: HeldOut, temperatures: Temperatures | None = None
) -> dict[str, float]:
    """How well a network reads.

    Returns
    -------
    ``right``: share of the legible labels (floors and functions) that are read exactly, whatever
    the confidence; ``right_sure``: the same above the confidence at which at most 3 % of them
    are read wrong; ``sure``: that confidence; ``invented``: share of the others for which some
    label is told more surely than that; ``calibration``: expected calibration error of the
    labels told, in 15 bins; ``right_text``, ``right_up``, ...: by kind, of kinds without a
    label: share that is said to have none.
    """
    found = readings_of(network, held_out, temperatures)
    told = np.array([reading.text for reading in found], dtype=object)
    sure = np.array([reading.confidence for reading in found])
    labels = np.array(held_out.labels, dtype=object)
    right, legible, speaks = told == labels, labels != "", told != ""
    figures = {"right": _mean(right[legible])}
    order = np.argsort(-sure, kind="stable")
    order = order[(legible & speaks)[order]]
    wrong = np.cumsum(~right[order]) <= WRONG_ALLOWED * legible.sum()
    kept = order[: int(wrong.sum())]
    threshold = float(sure[kept].min(initial=1.0))
    figures["right_sure"] = float(right[kept].sum() / max(1, legible.sum()))
    figures["sure"] = threshold
    figures["invented"] = _mean((speaks & (sure > threshold))[~legible])
    figures["calibration"] = _calibration_error(sure[speaks], right[speaks])
    kinds = np.array(held_out.kinds)
    figures |= {f"right_{kind}": _mean(right[kinds == kind]) for kind in KINDS}
    return figures


def _mean(values: npt.NDArray[np.bool_]) -> float:
    return float(values.mean()) if len(values) else float("nan")


def _calibration_error(sure: npt.NDArray[np.float64], right: npt.NDArray[np.bool_]) -> float:
    bins = np.minimum((sure * BINS).astype(int), BINS - 1)
    off = [abs(float((right - sure)[bins == k].sum())) for k in range(BINS)]
    return sum(off) / max(1, len(sure))


def reading_validation(
    images: Sequence[LabeledImage],
) -> Callable[[ReaderNetwork], dict[str, float]]:
    """Make what `fronto.train.reader.fit.fit_reader` calls at each checkpoint.

    Parameters
    ----------
    images
        Labelled photos that are not trained on.

    Returns
    -------
    A function that gives `reading_figures`, named ``val_...``.
    """
    held_out = held_out_crops(images)

    def figures(network: ReaderNetwork) -> dict[str, float]:
        return {f"val_{k}": v for k, v in reading_figures(network, held_out).items()}

    return figures
