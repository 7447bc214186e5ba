"""How sure the reader may be: temperatures (Guo et al., ICML 2017) fitted on held-out photos."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import torch
import torch.nn.functional as F

from fronto.errors import InputError
from fronto.train.reader.fit import text_losses
from fronto.train.reader.network import ReaderNetwork
from fronto.train.reader.validate import HeldOut, Temperatures, network_outputs

__all__ = ["fit_temperatures", "halves"]

#: Temperatures tried, as logarithms; wide enough for any network that was trained at all.
TRIED = np.linspace(np.log(0.3), np.log(5.0), 121)


def halves(held_out: HeldOut) -> tuple[HeldOut, HeldOut]:
    """Every other photo by name, and the rest: no photo is in both.

    Raises
    ------
    InputError
        If a half has no text, or there are no two photos.
    """
    names = sorted(set(held_out.photos))
    first = set(names[::2])
    chosen = np.array([photo in first for photo in held_out.photos], dtype=bool)
    parts = held_out.part(chosen), held_out.part(~chosen)
    if not all((part.batch.length > 0).any() for part in parts):
        raise InputError(
            "photos to calibrate on",
            f"expected labels with texts in both halves of them, got {len(names)} photos without",
            "give more",
        )
    return parts


def fit_temperatures(network: ReaderNetwork, held_out: HeldOut) -> Temperatures:
    """Temperatures that make the held-out labels most probable.

    Parameters
    ----------
    network
        In evaluation mode.
    held_out
        Crops that it was not trained on, texts among them.
    """
    logits, batch = network_outputs(network, held_out.batch.crops), held_out.batch
    has_text = batch.length > 0

    def text_loss(temperature: float) -> float:
        text, length = batch.text[has_text], batch.length[has_text]
        return float(text_losses(logits.text[has_text] / temperature, text, length).mean())

    def kind_loss(temperature: float) -> float:
        return float(F.cross_entropy(logits.kind / temperature, batch.kind))

    return Temperatures(text=_least(text_loss), kind=_least(kind_loss))


@torch.no_grad()
def _least(loss: Callable[[float], float]) -> float:
    tried = [float(value) for value in np.exp(TRIED)]
    return min(tried, key=loss)
