"""A whole run: from labelled photos to a context head beside its reader's file."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass, field
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

from fronto._version import __version__
from fronto.datasets.records import LabeledImage
from fronto.engine import Engine, ReaderEngine
from fronto.errors import InputError
from fronto.train.context.fit import ContextFit
from fronto.train.context.network import ContextNetwork, ContextOptions
from fronto.train.runs import check_run

if TYPE_CHECKING:
    from fronto.rectifier import Rectifier

__all__ = ["ContextTrainOptions", "publish_context", "train_context"]

#: Photos in one file of examples.
IN_ONE = 200


@dataclass(frozen=True)
class ContextTrainOptions:
    """A training run.

    Parameters
    ----------
    passes
        How often each photo is read before training begins: first as it is, then made worse in
        another way each time.
    workers
        Processes that read photos; 0: none beside this one.
    seed
        Of what is done to the photos.
    fit
        Steps, learning rate, ...
    network
        How large the head is.

    Raises
    ------
    InputError
        Naming the field that is out of range.
    """

    passes: int = 6
    workers: int = 0
    seed: int = 0
    fit: ContextFit = field(default_factory=ContextFit)
    network: ContextOptions = field(default_factory=ContextOptions)

    def __post_init__(self) -> None:
        for name, least in (("passes", 1), ("workers", 0)):
            if getattr(self, name) < least:
                raise InputError(name, f"expected {least} or more, got {getattr(self, name)}")


def train_context(
    photos: Sequence[LabeledImage],
    run: Path,
    options: ContextTrainOptions | None = None,
    *,
    reader: ReaderEngine | None = None,
    engine: Engine | None = None,
    held_out: Sequence[LabeledImage] = (),
    progress: bool = True,
) -> ContextNetwork:
    """Train a context head, or go on where the run in this folder stopped.

    Parameters
    ----------
    photos
        Labelled photos of whole panels.
    run
        Folder of the run: ``panels-*.npz``, ``last.pt``, ``metrics.csv``, ``options.json``.
    options
        How to train.
    reader, engine
        What reads the labels, and what finds the buttons; None: those in the package.
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
        If there are no photos, nothing to read on them, or the folder holds a run for other
        networks or photos, or of another head.
    """
    import torch

    from fronto.files import json_bytes, write_bytes
    from fronto.train.context.collect import known_labels
    from fronto.train.context.examples import Example, read_examples
    from fronto.train.context.fit import fit_context, load_context, stated_options
    from fronto.train.context.validate import context_validation
    from fronto.train.runs import same_network

    options = options or ContextTrainOptions()
    if not photos:
        raise InputError("photos", "expected labelled photos, got none")
    paths = ((reader or ReaderEngine()).path, (engine or Engine()).path)
    made_of = {
        "photos": len(photos),
        "labels": _short(repr([(i.path.name, i.objects) for i in photos]).encode()),
        "reader": _short(paths[0].read_bytes()),
        "engine": _short(paths[1].read_bytes()),
        "seed": options.seed,
    }
    values = {"fronto": __version__, **asdict(options), **made_of}
    check_run(run, values, tuple(made_of))
    labels = known_labels(photos)
    if (run / "last.pt").exists():
        found = stated_options(load_context(run / "last.pt"))
        wanted = asdict(options.network) | {"labels": list(labels)}
        same_network(run / "last.pt", found, wanted)
    run.mkdir(parents=True, exist_ok=True)
    write_bytes(run / "options.json", json_bytes(values))
    jobs = [
        _Job(
            run / f"panels-{number:02d}-{start:05d}.npz",
            tuple(photos[start : start + IN_ONE]),
            labels,
            *paths,
            None if number == 0 else (options.seed, number, start),
        )
        for number in range(options.passes)
        for start in range(0, len(photos), IN_ONE)
    ]
    _collect([job for job in jobs if not job.file.exists()], options.workers, progress)
    examples: list[Example] = [e for job in jobs for e in read_examples(job.file)]
    if not examples:
        raise InputError("photos", f"expected buttons on them, found none on {len(photos)}")
    torch.manual_seed(options.fit.seed)
    return fit_context(
        ContextNetwork(labels, options.network),
        examples,
        run,
        options.fit,
        validate=context_validation(held_out, *paths) if held_out else None,
        progress=progress,
    )


def publish_context(
    runs: Sequence[Path], reader: ReaderEngine, directory: Path, metadata: Mapping[str, str]
) -> Path:
    """Write the head of a run as ONNX, to lie beside its reader's file.

    Parameters
    ----------
    runs
        Folder of the run; of several runs with other seeds the mean is taken.
    reader
        The reader that it was trained for.
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
        If a folder holds no such run, one for another reader, or one of another head.
    """
    from fronto.train.context.export import export_context
    from fronto.train.context.fit import load_context, stated_options
    from fronto.train.runs import same_network

    networks = [load_context(run / "last.pt") for run in runs]
    for run, network in zip(runs, networks, strict=True):
        same_network(run / "last.pt", stated_options(network), stated_options(networks[0]))
        check_run(run, {"reader": reader.digest}, ("reader",))
    return export_context(networks, reader, directory, {"version": __version__, **metadata})


@dataclass(frozen=True)
class _Job:
    """Some photos to read, and the file to write what they say to."""

    file: Path
    photos: tuple[LabeledImage, ...]
    labels: tuple[str, ...]
    reader: Path
    engine: Path
    seed: tuple[int, ...] | None


def _short(content: bytes) -> str:
    import hashlib

    return hashlib.sha256(content).hexdigest()[:8]


def _collect(jobs: Sequence[_Job], workers: int, progress: bool) -> None:
    """Write the files of examples; those that the run has are not made again."""
    from tqdm import tqdm

    total = sum(len(job.photos) for job in jobs)
    with tqdm(total=total, unit="photo", disable=not progress) as bar:
        for count in _done(jobs, workers):
            bar.update(count)


def _done(jobs: Sequence[_Job], workers: int) -> Iterator[int]:
    """Do jobs; of each that is done, its number of photos."""
    import multiprocessing
    from concurrent.futures import ProcessPoolExecutor, as_completed

    if not workers:
        yield from map(_read, jobs)
        return
    # Forked while threads of PyTorch or OpenCV run, a worker would wait for them for ever.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(workers, context, _one_thread) as pool:
        for future in as_completed([pool.submit(_read, job) for job in jobs]):
            yield future.result()


def _one_thread() -> None:
    """Each worker has a core of its own."""
    import cv2
    import torch

    cv2.setNumThreads(1)
    torch.set_num_threads(1)


@cache
def _tools(reader: Path, engine: Path) -> tuple[Rectifier, ReaderEngine]:
    from fronto.rectifier import Rectifier
    from fronto.rectifieroptions import RectifierOptions

    found = Rectifier(RectifierOptions(read_labels=False), engine=Engine(engine, threads=1))
    return found, ReaderEngine(reader, threads=1)


def _read(job: _Job) -> int:
    import numpy as np

    from fronto.labels.reader import LabelReader
    from fronto.train.context.collect import examples_of
    from fronto.train.context.examples import write_examples

    rectifier, engine = _tools(job.reader, job.engine)
    reader = LabelReader(engine)
    found = []
    for k, photo in enumerate(job.photos):
        rng = None if job.seed is None else np.random.default_rng([*job.seed, k])
        found += examples_of(photo, rectifier, reader, job.labels, rng)
    write_examples(job.file, found)
    return len(job.photos)
