"""How the edge head is trained: batches of photos' outlines, and their loss."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from fronto.outlines.edgeprofiles import BINS
from fronto.train.edges.network import EdgeNetwork, EdgeOptions
from fronto.train.edges.pool import EdgePool
from fronto.train.loop import LoopOptions, train_loop
from fronto.train.runs import module_state, read_checkpoint

__all__ = ["EdgeBatch", "EdgeFit", "edge_loss", "fit_edges", "load_edges"]

KIND = "the .pt file of an edge head's run"
#: The truth is no place, but those around it: a deviation in pixels, and at least in reaches.
NEAR_PX, NEAR = 0.2, 0.025
#: Edges further out than this, in reaches, are not learned.
FARTHEST = 0.98
#: Share of the photos of which some outlines only are shown.
SOME = 0.5
#: Photos are looked at a little closer or less, and from a place a little further in or out: range
#: of the first's logarithm, and deviation of the second in reaches; and how many of them at most.
ZOOM, SHIFT, MOST = 0.15, 0.03, 2.5
#: Changes of the light, of the colours' balance, of the noise, and of the greys' logarithm (gamma):
#: deviations; and the shares of batches that are grey, or whose colours change places.
LIGHT, BALANCE, NOISE, GAMMA = 0.2, 0.08, 0.01, 0.2
GREY, OTHER_COLORS = 0.15, 0.3


@dataclass(frozen=True)
class EdgeFit(LoopOptions):
    """How to train: `fronto.train.loop.LoopOptions` with defaults for outlines."""

    steps: int = 12_000
    batch: int = 256
    rate: float = 4e-3
    decay: float = 0.02
    warmup: int = 200


class EdgeBatch(NamedTuple):
    """B outlines.

    Parameters
    ----------
    profiles
        (B, 8, 64, 4), 0 to 1.
    about
        (B, 3).
    photo
        (B,): number of the photo that each is of.
    reaches
        (B,): of the profiles, pixels.
    offsets
        (B, 8): true places, in reaches; NaN: unknown.
    """

    profiles: Tensor
    about: Tensor
    photo: Tensor
    reaches: Tensor
    offsets: Tensor


def edge_loss(told: Tensor, batch: EdgeBatch) -> Tensor:
    """Cross entropy of the places told (B, 8, 64), of the curves whose edge is known."""
    known = batch.offsets.abs() < FARTHEST  # NaN is not
    places = (torch.arange(BINS, device=told.device) + 0.5) / (BINS / 2) - 1
    near = (NEAR_PX / batch.reaches).clamp(min=NEAR)[:, None, None]
    away = (places - torch.nan_to_num(batch.offsets)[..., None]) / near
    wanted = (-0.5 * away.square()).softmax(dim=-1)
    each = -(wanted * told.log_softmax(dim=-1)).sum(dim=-1)
    return (each * known).sum() / known.sum().clamp(min=1)


def fit_edges(
    network: EdgeNetwork,
    pool: EdgePool,
    run: Path,
    options: EdgeFit | None = None,
    *,
    validate: Callable[[EdgeNetwork], dict[str, float]] | None = None,
    progress: bool = True,
) -> EdgeNetwork:
    """Train a head, or go on where the run in this folder stopped.

    Parameters
    ----------
    network
        Trained in place, on a GPU where there is one.
    pool
        Outlines whose edges are known.
    run
        Folder of the run; made where missing.
    options
        How to train.
    validate
        Called with the averaged head at each checkpoint; its figures go to the metrics.
    progress
        Whether a progress bar with the time left is shown.

    Returns
    -------
    The head with averaged weights, in evaluation mode.

    Raises
    ------
    InputError
        If the folder holds a run of another head.
    """
    options = options or EdgeFit()

    def losses(batch: EdgeBatch, device: torch.device, _: float) -> dict[str, Tensor]:
        batch = EdgeBatch(*(part.to(device) for part in batch))
        return {"total": edge_loss(network(batch.profiles, batch.about, batch.photo), batch)}

    return train_loop(
        network.train(),
        run,
        options,
        {"edge_options": asdict(network.options)},
        lambda seed: _batches(pool, options.batch, seed),
        losses,
        kind=KIND,
        validate=validate,
        progress=progress,
    )


def load_edges(path: Path) -> EdgeNetwork:
    """The averaged head of a checkpoint, in evaluation mode.

    Raises
    ------
    InputError
        If the file is missing or no checkpoint.
    """
    state = read_checkpoint(path, "edge_options", KIND)
    network = EdgeNetwork(EdgeOptions(**state["edge_options"]))
    network.load_state_dict(module_state(state["averaged"]))
    return network.eval()


def _batches(pool: EdgePool, size: int, seed: int) -> Iterator[EdgeBatch]:
    """Endless batches of whole photos, or some of their outlines, disturbed."""
    rng = np.random.default_rng(seed)
    photos = pool.photos()
    chosen: list[np.ndarray] = []
    while True:
        for k in rng.permutation(len(photos)):
            rows = photos[k]
            if len(rows) > 1 and rng.random() < SOME:
                rows = rng.choice(rows, max(1, int(len(rows) * rng.random())), replace=False)
            chosen.append(rows)
            if sum(map(len, chosen)) >= size:
                yield _taken(pool, chosen)
                chosen = []


def _taken(pool: EdgePool, chosen: list[np.ndarray]) -> EdgeBatch:
    rows = np.concatenate(chosen)
    photo = torch.from_numpy(np.repeat(np.arange(len(chosen)), [len(part) for part in chosen]))
    zoom = torch.exp(ZOOM * (2 * torch.rand(len(chosen)) - 1))[photo]
    shift = SHIFT * torch.randn(len(chosen)).clamp(-MOST, MOST)[photo]
    profiles = torch.from_numpy(pool.profiles[rows]).float() / 255
    offsets = torch.from_numpy(pool.offsets[rows])
    return EdgeBatch(
        _disturbed(_moved(profiles, zoom, shift)),
        torch.from_numpy(pool.about[rows]),
        photo,
        torch.from_numpy(pool.reaches[rows]) / zoom,
        (offsets - shift[:, None]) * zoom[:, None],
    )


def _moved(profiles: Tensor, zoom: Tensor, shift: Tensor) -> Tensor:
    """Profiles (n, 8, 64, 4) as seen from `shift` (n,) further out, and `zoom` (n,) times as large.

    Beyond the ends the last values go on.
    """
    places = (torch.arange(BINS) + 0.5) / (BINS / 2) - 1
    at = places / zoom[:, None] + shift[:, None]
    at = (((at + 1) * BINS / 2) - 0.5).clamp(0, BINS - 1)
    low = at.floor().long().clamp(max=BINS - 2)
    share = (at - low)[:, None, :, None]
    index = low[:, None, :, None].expand_as(profiles)
    return profiles.gather(2, index) * (1 - share) + profiles.gather(2, index + 1) * share


def _disturbed(profiles: Tensor) -> Tensor:
    """In other light, with other colours and noise."""
    n = len(profiles)
    colors, differences = profiles[..., :3], profiles[..., 3:]
    colors = colors ** torch.exp(GAMMA * torch.randn(n, 1, 1, 1))
    colors = colors * torch.exp(LIGHT * torch.randn(n, 1, 1, 1) + BALANCE * torch.randn(n, 1, 1, 3))
    if torch.rand(()) < OTHER_COLORS:
        colors = colors[..., torch.randperm(3)]
    if torch.rand(()) < GREY:
        colors = colors.mean(dim=-1, keepdim=True).expand(-1, -1, -1, 3)
    colors = colors + NOISE * torch.rand(n, 1, 1, 1) ** 2 * torch.randn_like(colors)
    return torch.cat([colors, differences], dim=3)
