"""A whole run: from labelled photos to a relation head beside its network's file."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING

from fronto._version import __version__
from fronto.datasets.records import LabeledImage
from fronto.engine import Engine
from fronto.errors import InputError
from fronto.train.relations.fit import RelationFit
from fronto.train.relations.network import RelationNetwork, RelationOptions
from fronto.train.runs import check_run
from fronto.train.shown import COLLECTED, ShownOptions

if TYPE_CHECKING:
    from fronto.train.data import Source

__all__ = ["RelationTrainOptions", "publish_relations", "train_relations"]

#: Pictures in one file of candidates.
IN_ONE = 400


@dataclass(frozen=True)
class RelationTrainOptions(ShownOptions):
    """A training run: `fronto.train.shown.ShownOptions`, and how it is trained.

    Parameters
    ----------
    fit
        Steps, learning rate, ...
    network
        How large the head is; its `features` are the network's.
    """

    fit: RelationFit = field(default_factory=RelationFit)
    network: RelationOptions = field(default_factory=RelationOptions)


def train_relations(
    photos: Sequence[LabeledImage],
    engine: Engine,
    run: Path,
    options: RelationTrainOptions | None = None,
    *,
    held_out: Sequence[LabeledImage] = (),
    progress: bool = True,
) -> RelationNetwork:
    """Train a relation head, or go on where the run in this folder stopped.

    Parameters
    ----------
    photos
        Labelled photos; none trains on renders only.
    engine
        The network that the head is for.
    run
        Folder of the run: ``pictures-*.npz``, ``last.pt``, ``metrics.csv``, ``options.json``.
    options
        How to train.
    held_out
        Photos to evaluate on at checkpoints.
    progress
        Whether progress bars with the time left are shown.

    Returns
    -------
    The head with averaged weights, in evaluation mode.

    Raises
    ------
    InputError
        If there are no photos for their share of the pictures, or the folder holds a run for
        another network or of another head.
    """
    import torch

    from fronto.files import json_bytes, write_bytes
    from fronto.train.relations.fit import fit_relations, load_relations
    from fronto.train.relations.pool import Picture, read_pool
    from fronto.train.relations.validate import relation_validation
    from fronto.train.runs import same_network

    options = options or RelationTrainOptions()
    if options.network.features != engine.channels:
        raise InputError(
            "network.features", f"expected {engine.channels}, got {options.network.features}"
        )
    sources = options.sources(photos)
    network = RelationNetwork(options.network)
    if (run / "last.pt").exists():
        found = load_relations(run / "last.pt").options
        same_network(run / "last.pt", asdict(found), asdict(options.network))
    values = {"fronto": __version__, "photos": len(photos), "weights": engine.digest}
    values |= asdict(options)
    check_run(run, values, ("weights", *COLLECTED))
    run.mkdir(parents=True, exist_ok=True)
    write_bytes(run / "options.json", json_bytes(values))
    pictures: list[Picture] = []
    for file in _collected(engine, sources, run, options, progress):
        pictures += read_pool(file)
    torch.manual_seed(options.fit.seed)
    return fit_relations(
        network,
        pictures,
        run,
        options.fit,
        validate=relation_validation(engine, held_out) if held_out else None,
        progress=progress,
    )


def publish_relations(
    runs: Sequence[Path], engine: Engine, directory: Path, metadata: Mapping[str, str]
) -> Path:
    """Write the head of a run as ONNX, to lie beside its network's file.

    Parameters
    ----------
    runs
        Folder of the run; of several runs with other seeds the mean is taken.
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
        If a folder holds no such run, one for another network, or one of another head.
    """
    from fronto.train.relations.export import export_relations
    from fronto.train.relations.fit import load_relations
    from fronto.train.runs import same_network

    networks = [load_relations(run / "last.pt") for run in runs]
    for run, network in zip(runs, networks, strict=True):
        same_network(run / "last.pt", asdict(network.options), asdict(networks[0].options))
        check_run(run, {"weights": engine.digest}, ("weights",))
    return export_relations(networks, engine, directory, {"version": __version__, **metadata})


def _collected(
    engine: Engine,
    sources: Sequence[tuple[Source, float]],
    run: Path,
    options: RelationTrainOptions,
    progress: bool,
) -> list[Path]:
    """The files of candidates; those that the run has are not made again."""
    from tqdm import tqdm

    from fronto.train.relations.collect import collect
    from fronto.train.relations.pool import write_pool

    counts = [min(IN_ONE, options.pictures - k) for k in range(0, options.pictures, IN_ONE)]
    files = [run / f"pictures-{k:03d}-{count}.npz" for k, count in enumerate(counts)]
    missing = [k for k, file in enumerate(files) if not file.exists()]
    total = sum(counts[k] for k in missing)
    with tqdm(total=total, unit="picture", disable=not progress) as bar:
        for k in missing:
            seed = 10_000 * options.seed + k
            found = []
            pictures = collect(engine, sources, size=options.size, seed=seed)
            for picture in itertools.islice(pictures, counts[k]):
                found.append(picture)
                bar.update()
            write_pool(files[k], found)
    return files
