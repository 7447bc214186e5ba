"""How a training run is described: a TOML file, checked field by field.

Every field may be left out::

    renders = 0.5           # share of rendered panels among the training pictures

    [fit]
    steps = 20000
    batch = 8

    [network]               # of a network that starts from nothing or from a bare backbone
    channels = 128
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from pathlib import Path

from fronto.errors import InputError
from fronto.tomlfile import read_toml
from fronto.train.fit import FitOptions
from fronto.train.network import NetworkOptions

__all__ = ["TrainOptions", "read_options"]

#: Least values of whole numbers in "fit".
LEAST = {
    "steps": 1,
    "batch": 1,
    "size": 64,
    "warmup": 0,
    "frozen": 0,
    "seed": 0,
    "workers": 0,
    "save_every": 1,
}
#: The network halves its input four times.
MULTIPLE = 16


@dataclass(frozen=True)
class TrainOptions:
    """A training run.

    Parameters
    ----------
    renders
        Share of rendered panels among the training pictures, 0 to 1.
    reuse
        How often each render is used, with other cuts and disturbances, on average.
    pixels
        Photos are scaled to this many pixels, as for inference.
    plates
        Share of the photos drawn that have plates, where there are any, 0 to 1.
    fit
        Steps, learning rate, ...
    network
        Of a network that starts from nothing or a bare backbone; None: that of the weights
        it starts from, or the package's own.

    Raises
    ------
    InputError
        Naming the field that is out of range.
    """

    renders: float = 0.4
    reuse: int = 4
    pixels: int = 640 * 480
    plates: float = 0.2
    fit: FitOptions = field(default_factory=FitOptions)
    network: NetworkOptions | None = None

    def __post_init__(self) -> None:
        for name, share in (("renders", self.renders), ("plates", self.plates)):
            if not 0 <= share <= 1:
                raise InputError(name, f"expected a share from 0 to 1, got {share:g}")
        for name, value, least in (("reuse", self.reuse, 1), ("pixels", self.pixels, 4096)):
            if value < least:
                raise InputError(name, f"expected {least} or more, got {value}")
        _check_fit(self.fit)
        if self.network is not None:
            _check_network(self.network)


def read_options(path: Path) -> TrainOptions:
    """Read options from a TOML file.

    Raises
    ------
    InputError
        Naming the file and the field: no TOML, an unknown field, a wrong type or value.
    """
    return read_toml(path, TrainOptions)


def _check_fit(fit: FitOptions) -> None:
    for name, least in LEAST.items():
        value = getattr(fit, name)
        if value < least:
            raise InputError(f"fit.{name}", f"expected {least} or more, got {value}")
    if fit.size % MULTIPLE:
        raise InputError("fit.size", f"expected a multiple of {MULTIPLE}, got {fit.size}")
    if not (math.isfinite(fit.rate) and fit.rate > 0):
        raise InputError("fit.rate", f"expected a number above 0, got {fit.rate:g}")
    if not (math.isfinite(fit.decay) and fit.decay >= 0):
        raise InputError("fit.decay", f"expected 0 or more, got {fit.decay:g}")
    if not 0 <= fit.average < 1:
        raise InputError("fit.average", f"expected 0 or more and below 1, got {fit.average:g}")


def _check_network(network: NetworkOptions) -> None:
    for name, value in (("channels", network.channels), ("decoder", network.decoder)):
        if value < 2:
            raise InputError(f"network.{name}", f"expected 2 or more, got {value}")
    if network.output_stride not in (8, 16):
        raise InputError("network.output_stride", f"expected 8 or 16, got {network.output_stride}")
    if not 14 <= network.blocks <= 17:
        raise InputError("network.blocks", f"expected 14 to 17, got {network.blocks}")
    if min(network.rates) < 1:
        raise InputError("network.rates", f"expected 1 or more each, got {min(network.rates)}")
