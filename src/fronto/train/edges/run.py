"""A whole run: from renders to an edge head beside its network's file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

from fronto._version import __version__
from fronto.engine import Engine
from fronto.errors import InputError
from fronto.train.edges.fit import EdgeFit
from fronto.train.edges.network import EdgeNetwork, EdgeOptions
from fronto.train.runs import check_run

__all__ = ["EdgeTrainOptions", "publish_edges", "train_edges"]

#: Pictures in one file of outlines.
IN_ONE = 250
#: Share of each file that is not learned from.
HELD_OUT = 0.03
#: Options that decide what is collected.
COLLECTED = ("twins", "relief", "photos", "files", "seed")


@dataclass(frozen=True)
class EdgeTrainOptions:
    """A training run.

    Parameters
    ----------
    pictures
        How many pictures the network is shown before training begins.
    twins
        Share of the renders whose plates look like the buttons beside them, 0 to 1.
    relief
        Share of the renders whose buttons may stand out of the panel, or lie in holes, 0 to 1.
    photos
        Share of photos among the pictures, where there are any, 0 to 1.
    seed
        Of the pictures.
    fit
        Steps, learning rate, ...
    network
        How large the head is.

    Raises
    ------
    InputError
        Naming the field that is out of range.
    """

    pictures: int = 10_000
    twins: float = 0.08
    relief: float = 0.4
    photos: float = 0.2
    seed: int = 0
    fit: EdgeFit = field(default_factory=EdgeFit)
    network: EdgeOptions = field(default_factory=EdgeOptions)

    def __post_init__(self) -> None:
        for name in ("twins", "relief", "photos"):
            share = getattr(self, name)
            if not 0 <= share <= 1:
                raise InputError(name, f"expected a share from 0 to 1, got {share:g}")
        if self.pictures < 1:
            raise InputError("pictures", f"expected 1 or more, got {self.pictures}")


def train_edges(
    engine: Engine,
    run: Path,
    options: EdgeTrainOptions | None = None,
    *,
    photos: Sequence[Path] = (),
    progress: bool = True,
) -> EdgeNetwork:
    """Train an edge head, or go on where the run in this folder stopped.

    Parameters
    ----------
    engine
        The network that the head is for, with its mask head.
    run
        Folder of the run: ``patches-*.npz``, ``last.pt``, ``metrics.csv``, ``options.json``.
    options
        How to train.
    photos
        Files of photos of panels, to look at beside the renders.
    progress
        Whether progress bars with the time left are shown.

    Returns
    -------
    The head with averaged weights, in evaluation mode.

    Raises
    ------
    InputError
        If the network has no mask head, a photo cannot be read, or the folder holds a run for
        another network, of other pictures or of another head.
    """
    import torch

    from fronto.files import json_bytes, write_bytes
    from fronto.train.edges.collect import Shares, collect
    from fronto.train.edges.fit import fit_edges, load_edges
    from fronto.train.edges.pool import EdgePool
    from fronto.train.edges.validate import edge_validation
    from fronto.train.pools import collected, divided, joined, read_pool
    from fronto.train.runs import same_network

    options = options or EdgeTrainOptions()
    if engine.masks is None:
        raise InputError(
            f"weights {engine.path}",
            "expected a network with a mask head, whose masks are what is refined, got none",
            "train one first (fronto masks)",
        )
    if (run / "last.pt").exists():
        found = load_edges(run / "last.pt").options
        same_network(run / "last.pt", asdict(found), asdict(options.network))
    values: dict[str, object] = {"fronto": __version__, "weights": engine.digest}
    values |= asdict(options) | {"files": len(photos)}
    check_run(run, values, ("weights", *COLLECTED))
    run.mkdir(parents=True, exist_ok=True)
    write_bytes(run / "options.json", json_bytes(values))
    shares = Shares(options.twins, options.relief, options.photos)
    files = collected(
        run,
        lambda seed: collect(engine, shares, photos, seed=seed),
        pictures=options.pictures,
        in_one=IN_ONE,
        seed=options.seed,
        progress=progress,
    )
    pools = [divided(read_pool(file, EdgePool), HELD_OUT) for file in files]
    held_out = joined([first for first, _ in pools])
    torch.manual_seed(options.fit.seed)
    return fit_edges(
        EdgeNetwork(options.network),
        joined([rest for _, rest in pools]),
        run,
        options.fit,
        validate=edge_validation(held_out) if len(held_out) else None,
        progress=progress,
    )


def publish_edges(
    runs: Sequence[Path], engine: Engine, directory: Path, metadata: Mapping[str, str]
) -> Path:
    """Write the head of a run as ONNX, to lie beside its network's file.

    Parameters
    ----------
    runs
        Folder of the run; of several the heads' mean is taken.
    engine
        The network that it was trained for.
    directory
        Folder to write to; made where missing.
    metadata
        Put into the file: license, training_data, ...

    Returns
    -------
    The file.

    Raises
    ------
    InputError
        If a folder holds no such run, or one for another network.
    """
    from fronto.train.edges.export import export_edges
    from fronto.train.edges.fit import load_edges

    networks = [load_edges(run / "last.pt") for run in runs]
    for run in runs:
        check_run(run, {"weights": engine.digest}, ("weights",))
    return export_edges(networks, engine, directory, {"version": __version__, **metadata})
