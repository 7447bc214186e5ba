"""A whole run: from labelled photos to a reader, and from its folder to the exported file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from pathlib import Path

from fronto._version import __version__
from fronto.datasets.records import LabeledImage
from fronto.errors import InputError
from fronto.train.reader.network import ReaderNetwork
from fronto.train.reader.options import ReaderTrainOptions

__all__ = ["publish_reader", "train_reader"]


def train_reader(
    photos: Sequence[LabeledImage],
    run: Path,
    options: ReaderTrainOptions | None = None,
    *,
    held_out: Sequence[LabeledImage] = (),
    fonts: Sequence[Path] | None = None,
    progress: bool = True,
) -> ReaderNetwork:
    """Train a label reader, or go on where the run in this folder stopped.

    Parameters
    ----------
    photos
        Photos whose boxes' names say what they carry; none trains on renders only.
    run
        Folder of the run: ``last.pt``, ``metrics.csv``, ``options.json``.
    options
        How to train.
    held_out
        Photos to evaluate on at checkpoints.
    fonts
        Folders of fonts for the renders; None: those of packages that are installed
        (`fronto.train.reader.fonts.installed_fonts`).
    progress
        Whether a progress bar with the time left is shown.

    Returns
    -------
    The network with averaged weights, in evaluation mode.

    Raises
    ------
    InputError
        If there are no photos for their share of the crops, the folder holds a run of
        another network, or a folder of fonts has none.
    """
    import torch

    from fronto.files import json_bytes, write_bytes
    from fronto.train.reader.data import BesideCrops, CropSource, PhotoCrops, RenderedCrops
    from fronto.train.reader.fit import fit_reader
    from fronto.train.reader.fonts import Typefaces, installed_fonts
    from fronto.train.reader.validate import reading_validation

    options = options or ReaderTrainOptions()
    if options.threads:
        torch.set_num_threads(options.threads)
    fonts = installed_fonts() if fonts is None else fonts
    sources: list[tuple[CropSource, float]] = []
    rendered = RenderedCrops(fonts, options.reuse)
    if options.renders > 0:
        sources.append((rendered, options.renders))
    if options.renders < 1:
        if not photos:
            raise InputError(
                "photos", "expected labelled photos, got none", "or train on renders = 1 only"
            )
        sources.append((PhotoCrops(photos), 1 - options.renders))
    if options.beside > 0 and options.renders > 0:
        rest = [(source, share * (1 - options.beside)) for source, share in sources]
        sources = [*rest, (BesideCrops(sources, rendered), options.beside)]
    torch.manual_seed(options.fit.seed)
    run.mkdir(parents=True, exist_ok=True)
    values = {
        "fronto": __version__,
        "photos": len(photos),
        "fonts": sorted(file.name for file in Typefaces(fonts).files) if options.renders else [],
        **asdict(options),
    }
    write_bytes(run / "options.json", json_bytes(values))
    return fit_reader(
        ReaderNetwork(options.network),
        sources,
        run,
        options.fit,
        validate=reading_validation(held_out) if held_out else None,
        progress=progress,
    )


def publish_reader(
    run: Path,
    directory: Path,
    held_out: Sequence[LabeledImage],
    metadata: Mapping[str, str],
    *,
    name: str = "fronto-read",
) -> tuple[Path, dict[str, float]]:
    """Calibrate the reader of a run and write it as ONNX.

    Its temperatures are fitted on every other one of the held-out photos by name.

    Parameters
    ----------
    run
        Folder of the run.
    directory
        Folder to write to; made where missing.
    held_out
        Photos that it was not trained on.
    metadata
        Put into the file: license, training_data, ...
    name
        Beginning of the file's name.

    Returns
    -------
    The file, and `fronto.train.reader.validate.reading_figures` of the other held-out photos;
    with ``calibration_before`` for the calibration error without temperatures.

    Raises
    ------
    InputError
        If the folder holds no reader's run, or there are too few photos to calibrate on.
    """
    from fronto.train.reader.calibrate import fit_temperatures, halves
    from fronto.train.reader.export import export_reader
    from fronto.train.reader.fit import load_reader
    from fronto.train.reader.validate import held_out_crops, reading_figures

    network = load_reader(run / "last.pt")
    fitted, judged = halves(held_out_crops(held_out))
    temperatures = fit_temperatures(network, fitted)
    figures = reading_figures(network, judged, temperatures)
    figures["calibration_before"] = reading_figures(network, judged)["calibration"]
    stated = {"version": __version__, **metadata}
    return export_reader(network, directory, name, stated, temperatures), figures
