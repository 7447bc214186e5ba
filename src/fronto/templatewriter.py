"""Template files (docs/files.md) from a result: the layout of a panel, for its next photo."""

from __future__ import annotations

import json
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from fronto.errors import InputError
from fronto.files import write_bytes
from fronto.metric import KnownLength
from fronto.pose.structure import chains
from fronto.pose.template import Template, TemplateButton
from fronto.positions import SET_ASIDE, locate
from fronto.results import Button, Panel
from fronto.shapes import FloatArray

__all__ = ["panel_template", "template_yaml", "write_template"]

#: Sizes whose logarithms differ by less than this are written as one.
SAME_SIZE = 0.05
#: Positions and sizes are written to a tenth of a millimetre, pitches, which add up, finer.
DIGITS, PITCH_DIGITS = 1, 3
#: A grid with more gaps than this, a button, is easier to read as a list.
MAX_GAPS = 3
#: Rows (columns) of a grid are farther apart than this.
LEAST_STEP_MM = 10.0
#: Labels that YAML's reader takes for none.
NO_LABELS = ("", "~", "null")

IntArray = npt.NDArray[np.intp]


def panel_template(
    panel: Panel,
    known: KnownLength | None = None,
    *,
    tolerance_mm: float = 1.0,
    allow_uncertain: bool = False,
    **fields: Any,
) -> Template:
    """The layout of a result's panel, in millimetres.

    Buttons that line up within `tolerance_mm` are put in one row or column exactly, equal
    distances between those are made equal, and sizes that are about the same one size.
    Outlines that the pose has set aside are left out; and where some buttons have a label,
    those that have none, the same as another one, or one that was only inferred: a template
    finds buttons by all their labels, or by their order alone.

    Parameters
    ----------
    panel
        The result.
    tolerance_mm
        How far buttons of one row or column are from where they should be, at most.
    known, allow_uncertain, fields
        As of :func:`fronto.positions.locate`.

    Returns
    -------
    The layout; its origin is the leftmost and uppermost centre.

    Raises
    ------
    InputError
        If the pose is not ok, the length does not apply, or fewer than two buttons are left.
    """
    if not (np.isfinite(tolerance_mm) and tolerance_mm >= 0):
        raise InputError("tolerance_mm", f"expected millimetres, 0 or more, got {tolerance_mm}")
    located = locate(panel, known, allow_uncertain=allow_uncertain, **fields)
    if not located:
        reasons = "; ".join(located.reasons)
        raise InputError("panel", f"expected an ok pose, got {reasons}", "take another photo")
    kept = _kept([b for b in panel.buttons if located.of(b.id) is not None])
    if len(kept) < 2:
        raise InputError(
            "panel",
            f"expected two buttons or more for a template, got {len(kept)} that fit and have a "
            "label of their own",
            "take another photo, or name the buttons",
        )
    scale = 1e3 * (located.plane_distance_m or 0.0)
    corners = scale * panel.pose.plane_corners[[button.id for button in kept]]
    centers = corners.mean(axis=1)
    across, down = corners[:, 1] - corners[:, 0], corners[:, 3] - corners[:, 0]
    sizes = np.stack([np.hypot(*across.T), np.hypot(*down.T)], axis=1)
    sizes = _same_sizes(sizes, np.array([b.outline.shape == "ellipse" for b in kept]))
    places = np.stack([_snapped(values, tolerance_mm) for values in centers.T], axis=1)
    return Template(
        tuple(
            TemplateButton(float(x), float(y), float(width), float(height), _label(button))
            for button, (x, y), (width, height) in zip(kept, places, sizes, strict=True)
        )
    )


def template_yaml(template: Template, name: str = "") -> str:
    """A template file's content: a grid of labels where the layout is one, else a list.

    Parameters
    ----------
    template
        The layout. What the file says is rounded to a tenth of a millimetre.
    name
        For people.
    """
    lines = ["schema: fronto.template/1"]
    if name:
        lines.append(f"name: {_quoted(name)}")
    grid = _grid(template)
    if grid is not None:
        return "\n".join([*lines, *grid]) + "\n"
    lines.append("buttons:")
    for button in template.buttons:
        fields = [f"label: {_quoted(button.label)}"] if button.label else []
        for key in ("x_mm", "y_mm", "width_mm", "height_mm"):
            value = getattr(button, key)
            if value is not None:
                fields.append(f"{key}: {_number(value, DIGITS)}")
        lines.append(f"  - {{{', '.join(fields)}}}")
    return "\n".join(lines) + "\n"


def write_template(
    panel: Panel,
    path: str | Path,
    known: KnownLength | None = None,
    *,
    tolerance_mm: float = 1.0,
    allow_uncertain: bool = False,
    **fields: Any,
) -> Template:
    """Write the layout of a result's panel, for `--template` with its next photo.

    Parameters
    ----------
    panel
        The result.
    path
        The file (YAML); its folder must exist.
    known, tolerance_mm, allow_uncertain, fields
        As of `panel_template`.

    Returns
    -------
    The layout, as the file has it but for rounding.

    Raises
    ------
    InputError
        As of `panel_template`, or if the file cannot be written.
    """
    template = panel_template(
        panel, known, tolerance_mm=tolerance_mm, allow_uncertain=allow_uncertain, **fields
    )
    write_bytes(Path(path), template_yaml(template, panel.image).encode())
    return template


def _label(button: Button) -> str:
    label = "" if button.label_source == "inferred" else button.label or button.outline.text
    return "" if label in NO_LABELS else label


def _kept(buttons: list[Button]) -> list[Button]:
    fitting = [button for button in buttons if button.weight >= SET_ASIDE]
    counts = Counter(map(_label, fitting))
    if set(counts) <= {""}:
        return fitting
    return [b for b in fitting if _label(b) and counts[_label(b)] == 1]


def _same_sizes(sizes: FloatArray, round_ones: npt.NDArray[np.bool_]) -> FloatArray:
    """Widths and heights (n, 2), equal where they are about so."""
    labels = round_ones.astype(np.intp)
    for logs in np.log(sizes).T:
        labels = labels * len(sizes) + chains(logs, SAME_SIZE)
    result = np.empty_like(sizes)
    for label in np.unique(labels):
        result[labels == label] = np.median(sizes[labels == label], axis=0)
    return result


def _snapped(values: FloatArray, tolerance: float) -> FloatArray:
    """Coordinates (n,), from 0, equal where they are so within the tolerance.

    So are the steps between neighbouring lines, if all are.
    """
    lines = chains(values, tolerance)
    means = np.array([values[lines == line].mean() for line in range(int(lines.max()) + 1)])
    snapped = np.where(np.abs(values - means[lines]) <= tolerance, means[lines], values)
    index, step = _steps(means, tolerance)
    if index is not None:
        regular = (float((means - index * step).mean()) + index * step)[lines]
        if (np.abs(regular - values) <= tolerance).all():
            snapped = regular
    return np.asarray(snapped - snapped.min())


def _steps(lines: FloatArray, tolerance: float) -> tuple[IntArray | None, float]:
    """Whole numbers of one step that lines (k,), in order, are from the first; and the step."""
    if len(lines) < 2:
        return np.zeros(len(lines), np.intp), 0.0
    index = np.rint((lines - lines[0]) / np.diff(lines).min()).astype(np.intp)
    centred = index - index.mean()
    step = float(centred @ lines / (centred @ centred))
    off = lines - lines.mean() - step * centred
    return (index, step) if np.abs(off).max() <= tolerance else (None, step)


def _grid(template: Template) -> list[str] | None:
    """Lines of the grid form; None where the layout has other places, sizes or no labels."""
    buttons = template.buttons
    sizes = {(button.width_mm, button.height_mm) for button in buttons}
    half = 0.5 * 10**-DIGITS
    cells, steps = [], []
    for axis in ("x_mm", "y_mm"):
        values = np.array([getattr(button, axis) for button in buttons])
        lines = chains(values, half)
        means = np.array([values[lines == line].mean() for line in range(int(lines.max()) + 1)])
        index, step = _steps(means, half)
        if index is None or 0 < step < LEAST_STEP_MM:
            return None
        cells.append(index[lines])
        steps.append(step)
    columns, rows = int(cells[0].max()) + 1, int(cells[1].max()) + 1
    labels = [button.label for button in buttons]
    if not all(labels) or len(sizes) > 1 or columns * rows > (1 + MAX_GAPS) * len(buttons):
        return None
    table = [[""] * columns for _ in range(rows)]
    for column, row, label in zip(*cells, labels, strict=True):
        if table[row][column]:
            return None
        table[row][column] = label
    # One row, or one column, has any pitch the other way.
    across, down = steps[0] or steps[1], steps[1] or steps[0]
    result = ["rows:"]
    result += [f"  - [{', '.join(map(_quoted, line))}]" for line in table]
    result.append(f"pitch_mm: [{_number(across, PITCH_DIGITS)}, {_number(down, PITCH_DIGITS)}]")
    width, height = next(iter(sizes))
    if width is not None and height is not None:
        result.append(f"size_mm: [{_number(width, DIGITS)}, {_number(height, DIGITS)}]")
    return result


def _number(value: float, digits: int) -> str:
    text = f"{value:.{digits}f}".rstrip("0").rstrip(".")
    return "0" if text == "-0" else text


def _quoted(text: str) -> str:
    """A double-quoted YAML scalar, which JSON's strings are."""
    return json.dumps("".join(c if c.isprintable() else "?" for c in text), ensure_ascii=False)
