"""A whole run: from labelled photos to a verifier beside its network's file."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field
from pathlib import Path

from fronto._version import __version__
from fronto.datasets.records import LabeledImage
from fronto.engine import Engine
from fronto.train.runs import check_run
from fronto.train.shown import COLLECTED, ShownOptions
from fronto.train.verifier.fit import VerifierFit
from fronto.train.verifier.network import VerifierNetwork, VerifierOptions

__all__ = ["VerifierTrainOptions", "publish_verifier", "train_verifier"]

#: Pictures in one file of patches.
IN_ONE = 400
#: Share of each file that is not learned from.
HELD_OUT = 0.02


@dataclass(frozen=True)
class VerifierTrainOptions(ShownOptions):
    """A training run: `fronto.train.shown.ShownOptions`, and how it is trained.

    Parameters
    ----------
    fit
        Steps, learning rate, ...
    network
        How large the verifier is.
    """

    renders: float = 0.2
    twins: float = 0.5
    size: int = 512
    fit: VerifierFit = field(default_factory=VerifierFit)
    network: VerifierOptions = field(default_factory=VerifierOptions)


def train_verifier(
    photos: Sequence[LabeledImage],
    engine: Engine,
    run: Path,
    options: VerifierTrainOptions | None = None,
    *,
    start: Path | None = None,
    progress: bool = True,
) -> VerifierNetwork:
    """Train a verifier, or go on where the run in this folder stopped.

    It starts from the first blocks of the network's own backbone, or of another one.

    Parameters
    ----------
    photos
        Labelled photos; none trains on renders only.
    engine
        The network whose finds it judges.
    run
        Folder of the run: ``patches-*.npz``, ``last.pt``, ``metrics.csv``, ``options.json``.
    options
        How to train.
    start
        MobileNetV2 weights (``.npz``, as `fronto.train.start.load_backbone` takes them) for the
        blocks that are trained; None: the network's own. A backbone that has learned by heart what
        the photos show has less to say of others.
    progress
        Whether progress bars with the time left are shown.

    Returns
    -------
    The verifier with averaged weights, in evaluation mode.

    Raises
    ------
    InputError
        If there are no photos for their share of the pictures, the starting weights are none, or
        the folder holds a run for another network, from other weights or of another verifier.
    """
    import torch

    from fronto.files import json_bytes, write_bytes
    from fronto.train.export import load_onnx
    from fronto.train.network import Network, NetworkOptions
    from fronto.train.pools import collected, divided, joined, read_pool
    from fronto.train.runs import same_network
    from fronto.train.start import load_backbone
    from fronto.train.verifier.collect import collect
    from fronto.train.verifier.fit import fit_verifier, load_verifier
    from fronto.train.verifier.pool import VerifierPool
    from fronto.train.verifier.validate import verifier_validation

    options = options or VerifierTrainOptions()
    sources = options.sources(photos)
    torch.manual_seed(options.fit.seed)
    network = VerifierNetwork(options.network)
    network.start_from(load_onnx(engine.path).backbone)
    if start is not None:
        other = Network(NetworkOptions())
        load_backbone(other, start)
        network.start_from(other.backbone, first=options.network.frozen)
    if (run / "last.pt").exists():
        found = load_verifier(run / "last.pt").options
        same_network(run / "last.pt", asdict(found), asdict(options.network))
    values = {"fronto": __version__, "photos": len(photos), "weights": engine.digest}
    values["start"] = None if start is None else hashlib.sha256(start.read_bytes()).hexdigest()[:8]
    values |= asdict(options)
    check_run(run, values, ("weights", "start", *COLLECTED))
    run.mkdir(parents=True, exist_ok=True)
    write_bytes(run / "options.json", json_bytes(values))
    files = collected(
        run,
        lambda seed: collect(engine, sources, size=options.size, seed=seed),
        pictures=options.pictures,
        in_one=IN_ONE,
        seed=options.seed,
        progress=progress,
    )
    pools = [divided(read_pool(file, VerifierPool), HELD_OUT) for file in files]
    held_out = joined([first for first, _ in pools])
    # Once more: collecting has drawn numbers, unless the files were there.
    torch.manual_seed(options.fit.seed)
    return fit_verifier(
        network,
        joined([rest for _, rest in pools]),
        run,
        options.fit,
        validate=verifier_validation(held_out) if len(held_out) else None,
        progress=progress,
    )


def publish_verifier(
    runs: Sequence[Path], engine: Engine, directory: Path, metadata: Mapping[str, str]
) -> Path:
    """Write the verifier of a run as ONNX, to lie beside its network's file.

    Parameters
    ----------
    runs
        Folder of the run; of several the verifiers' mean is taken.
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
    from fronto.train.verifier.export import export_verifier
    from fronto.train.verifier.fit import load_verifier

    networks = [load_verifier(run / "last.pt") for run in runs]
    for run in runs:
        check_run(run, {"weights": engine.digest}, ("weights",))
    return export_verifier(networks, engine, directory, {"version": __version__, **metadata})
