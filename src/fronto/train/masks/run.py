"""A whole run: from renders and labelled outlines to a mask head beside its network's file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

from fronto._version import __version__
from fronto.datasets.records import LabeledImage
from fronto.engine import Engine
from fronto.errors import InputError
from fronto.train.masks.fit import MaskFit
from fronto.train.masks.network import MaskNetwork, MaskOptions
from fronto.train.runs import check_run

__all__ = ["MaskTrainOptions", "publish_masks", "train_masks"]

#: Pictures in one file of patches.
IN_ONE = 250
#: Share of each file that is not learned from.
HELD_OUT = 0.03
#: Options that decide which patches are collected.
COLLECTED = ("photos", "renders", "twins", "relief", "seed", "patches")
#: Which patches these make: another number for other ones.
PATCHES = 2


@dataclass(frozen=True)
class MaskTrainOptions:
    """A training run.

    Parameters
    ----------
    pictures
        How many pictures the network is shown before training begins.
    renders
        Share of rendered panels among them, 0 to 1; the others are photos with outlines.
    twins
        Share of the renders whose plates look like the buttons beside them, 0 to 1.
    relief
        Share of the renders whose buttons may stand out of the panel, or lie in holes, 0 to 1.
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

    pictures: int = 9000
    renders: float = 1.0
    twins: float = 0.2
    relief: float = 0.5
    seed: int = 0
    fit: MaskFit = field(default_factory=MaskFit)
    network: MaskOptions = field(default_factory=MaskOptions)

    def __post_init__(self) -> None:
        shares = (("renders", self.renders), ("twins", self.twins), ("relief", self.relief))
        for name, share in shares:
            if not 0 <= share <= 1:
                raise InputError(name, f"expected a share from 0 to 1, got {share:g}")
        if self.pictures < 1:
            raise InputError("pictures", f"expected 1 or more, got {self.pictures}")


def train_masks(
    photos: Sequence[LabeledImage],
    engine: Engine,
    run: Path,
    options: MaskTrainOptions | None = None,
    *,
    progress: bool = True,
) -> MaskNetwork:
    """Train a mask head, or go on where the run in this folder stopped.

    Parameters
    ----------
    photos
        Photos with labelled outlines; none trains on renders only.
    engine
        The network that the head is for.
    run
        Folder of the run: ``patches-*.npz``, ``last.pt``, ``metrics.csv``, ``options.json``.
    options
        How to train.
    progress
        Whether progress bars with the time left are shown.

    Returns
    -------
    The head with averaged weights, in evaluation mode.

    Raises
    ------
    InputError
        If there are no photos with outlines for their share of the pictures, or the folder
        holds a run for another network or of another head.
    """
    import torch

    from fronto.files import json_bytes, write_bytes
    from fronto.train.masks.collect import collect, labelled, rendered
    from fronto.train.masks.fit import fit_masks, load_masks
    from fronto.train.masks.pool import Pool
    from fronto.train.masks.validate import mask_validation
    from fronto.train.pools import collected, divided, joined, read_pool
    from fronto.train.runs import same_network

    options = options or MaskTrainOptions()
    outlined = [p for p in photos if any(o.polygon is not None for o in p.objects)]
    if options.renders < 1 and not outlined:
        raise InputError(
            "photos", "expected photos with labelled outlines, got none", "train on renders only"
        )
    if (run / "last.pt").exists():
        found = load_masks(run / "last.pt").options
        same_network(run / "last.pt", asdict(found), asdict(options.network))
    values = {"fronto": __version__, "photos": len(outlined), "weights": engine.digest}
    values["patches"] = PATCHES
    values |= asdict(options)
    check_run(run, values, ("weights", *COLLECTED))
    run.mkdir(parents=True, exist_ok=True)
    write_bytes(run / "options.json", json_bytes(values))
    sources = []
    if options.renders > 0:
        sources.append((rendered(options.twins, options.relief), options.renders))
    if options.renders < 1:
        sources.append((labelled(outlined), 1 - options.renders))
    files = collected(
        run,
        lambda seed: collect(engine, sources, seed=seed),
        pictures=options.pictures,
        in_one=IN_ONE,
        seed=options.seed,
        progress=progress,
    )
    pools = [divided(read_pool(file, Pool), HELD_OUT) for file in files]
    held_out = joined([first for first, _ in pools])
    torch.manual_seed(options.fit.seed)
    return fit_masks(
        MaskNetwork(options.network),
        joined([rest for _, rest in pools]),
        run,
        options.fit,
        validate=mask_validation(held_out) if len(held_out) else None,
        progress=progress,
    )


def publish_masks(
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
    from fronto.train.masks.export import export_masks
    from fronto.train.masks.fit import load_masks

    networks = [load_masks(run / "last.pt") for run in runs]
    for run in runs:
        check_run(run, {"weights": engine.digest}, ("weights",))
    return export_masks(networks, engine, directory, {"version": __version__, **metadata})
