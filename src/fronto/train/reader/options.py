"""How a reader's training run is described: a TOML file, checked field by field.

Every field may be left out::

    renders = 0.4           # share of rendered crops among the training crops
    beside = 0.1            # share of crops put beside a rendered knob
    threads = 2

    [fit]
    steps = 10000
    batch = 128

    [network]
    stages = [32, 48, 96]
"""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

from fronto.errors import InputError
from fronto.tomlfile import read_toml
from fronto.train.reader.fit import ReaderFit
from fronto.train.reader.network import ReaderOptions

__all__ = ["ReaderTrainOptions", "read_reader_options"]


@dataclass(frozen=True)
class ReaderTrainOptions:
    """A training run.

    Parameters
    ----------
    renders
        Share of rendered crops among the training crops, 0 to 1.
    beside
        Share of crops, of both, that are put beside a rendered knob as one button, 0 to 1; none
        where `renders` is 0.
    reuse
        How often each render is used, with other cuts and disturbances, on average.
    threads
        Threads that PyTorch trains with; 0: as it chooses.
    fit
        Steps, learning rate, ...
    network
        Its widths.

    Raises
    ------
    InputError
        Naming the field that is out of range.
    """

    renders: float = 0.4
    beside: float = 0.1
    reuse: int = 5
    threads: int = 0
    fit: ReaderFit = field(default_factory=ReaderFit)
    network: ReaderOptions = field(default_factory=ReaderOptions)

    def __post_init__(self) -> None:
        for name, share in (("renders", self.renders), ("beside", self.beside)):
            if not 0 <= share <= 1:
                raise InputError(name, f"expected a share from 0 to 1, got {share:g}")
        for name, value, least in (("reuse", self.reuse, 1), ("threads", self.threads, 0)):
            if value < least:
                raise InputError(name, f"expected {least} or more, got {value}")
        for name, width in (
            ("stem", self.network.stem),
            ("stages", min(self.network.stages)),
            ("kinds", self.network.kinds),
        ):
            if width < 1:
                raise InputError(f"network.{name}", f"expected 1 or more, got {width}")


def read_reader_options(path: Path) -> ReaderTrainOptions:
    """Read options from a TOML file.

    Raises
    ------
    InputError
        Naming the file and the field: no TOML, an unknown field, a wrong type or value.
    """
    return read_toml(path, ReaderTrainOptions)
