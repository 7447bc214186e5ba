"""Learning curves, from the ``metrics.csv`` of training runs."""

from __future__ import annotations

import csv
from collections.abc import Sequence
from pathlib import Path

from fronto.errors import InputError
from fronto.files import read_bytes

__all__ = ["draw_curves", "read_metrics"]

MAX_BYTES = 100_000_000
#: Columns that are no figure of the network.
LEFT_OUT = ("step", "seconds")
#: Of a panel, inches; panels in a row.
PANEL, COLUMNS = (4.0, 2.8), 3


def read_metrics(run: Path) -> dict[str, list[float]]:
    """Read the columns of a run's ``metrics.csv``, "step" among them.

    Raises
    ------
    InputError
        If the file is missing or no such table.
    """
    path = run / "metrics.csv" if run.is_dir() else run
    thing = f"metrics {path}"
    text = read_bytes(path, thing, MAX_BYTES).decode("utf-8", "replace")
    header, *rows = csv.reader(text.splitlines())
    if "step" not in header:
        raise InputError(thing, "expected a column named step, found none", "name a run's folder")
    columns: dict[str, list[float]] = {name: [] for name in header}
    for number, row in enumerate(rows, 2):
        try:
            values = [float(cell) for cell in row]
            pairs = list(zip(header, values, strict=True))
        except ValueError:
            raise InputError(
                f"{thing}, line {number}",
                f"expected {len(header)} numbers, got {','.join(row)[:60]}",
                "remove that line",
            ) from None
        for name, value in pairs:
            columns[name].append(value)
    return columns


def draw_curves(runs: Sequence[Path], output: Path) -> None:
    """Draw the figures of one or more runs over their steps, a panel for each figure.

    Parameters
    ----------
    runs
        Folders of runs, or their ``metrics.csv``.
    output
        The picture; its suffix says the format.

    Raises
    ------
    InputError
        If a table cannot be read, or the picture cannot be written.
    """
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    tables = {str(run): read_metrics(run) for run in runs}
    names = list(dict.fromkeys(n for t in tables.values() for n in t if n not in LEFT_OUT))
    rows = -(-len(names) // COLUMNS)
    figure = Figure(figsize=(PANEL[0] * COLUMNS, PANEL[1] * max(rows, 1)), layout="constrained")
    FigureCanvasAgg(figure)
    for k, name in enumerate(names):
        axes = figure.add_subplot(rows, COLUMNS, k + 1)
        for run, table in tables.items():
            if name in table:
                axes.plot(table["step"], table[name], label=Path(run).name)
        axes.set(title=name, xlabel="step")
        axes.grid(alpha=0.3)
        if k == 0 and len(tables) > 1:
            axes.legend()
    try:
        figure.savefig(output, dpi=120)
    except (OSError, ValueError) as error:
        raise InputError(
            f"output file {output}",
            f"expected a .png or .svg file to write, got: {error}",
            "choose another name",
        ) from None
