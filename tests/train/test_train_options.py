"""Options of a run: read from TOML, and refused by file and field."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("torch")

from fronto.errors import InputError
from fronto.train.fit import FitOptions
from fronto.train.network import NetworkOptions
from fronto.train.options import TrainOptions, read_options


def write(folder: Path, text: str) -> Path:
    path = folder / "run.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_what_is_left_out_is_the_default(tmp_path: Path) -> None:
    assert read_options(write(tmp_path, "# nothing")) == TrainOptions()
    found = read_options(
        write(tmp_path, "renders = 1\n[fit]\nsteps = 50\nrate = 1e-4\n[network]\nrates = [2, 3, 4]")
    )
    assert found.renders == 1
    assert found.fit == FitOptions(steps=50, rate=1e-4)
    assert found.network == NetworkOptions(rates=(2, 3, 4))


@pytest.mark.parametrize(
    ("text", "field"),
    [
        ("[fit\n", "line 1"),
        ("epochs = 3", "epochs"),
        ("[fit]\nlearning_rate = 1", "fit.learning_rate"),
        ("[network]\nwidth = 1", "network.width"),
        ("fit = 3", "fit"),
        ("[fit]\nsteps = '50'", "fit.steps"),
        ("[fit]\nsteps = 1.5", "fit.steps"),
        ("[fit]\nsteps = true", "fit.steps"),
        ("[fit]\nsteps = 0", "fit.steps"),
        ("[fit]\nsize = 100", "fit.size"),
        ("[fit]\nrate = 0", "fit.rate"),
        ("[fit]\nrate = nan", "fit.rate"),
        ("[fit]\naverage = 1", "fit.average"),
        ("[fit]\nsteps = 2024-01-01", "fit.steps"),
        ("renders = 1.5", "renders"),
        ("reuse = 0", "reuse"),
        ("[network]\nrates = [6, 12]", "network.rates"),
        ("[network]\nrates = [6, 12, 0]", "network.rates"),
        ("[network]\noutput_stride = 32", "network.output_stride"),
        ("[network]\nchannels = 1", "network.channels"),
        ("[network]\nblocks = 18", "network.blocks"),
        ("[fit]\nfrozen = -1", "fit.frozen"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, text: str, field: str) -> None:
    path = write(tmp_path, text)
    with pytest.raises(InputError) as caught:
        read_options(path)
    assert str(path) in str(caught.value)
    assert field in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_missing_file_and_one_that_is_no_text(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.toml"):
        read_options(tmp_path / "none.toml")
    (tmp_path / "bytes.toml").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(InputError, match=r"bytes\.toml"):
        read_options(tmp_path / "bytes.toml")


def test_options_are_checked_however_they_are_made() -> None:
    with pytest.raises(InputError, match="workers"):
        TrainOptions(fit=FitOptions(workers=-1))
    with pytest.raises(InputError, match="decay"):
        TrainOptions(fit=FitOptions(decay=float("inf")))
