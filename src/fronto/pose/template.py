"""A known layout: positions and sizes of a panel's buttons in millimetres."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from fronto.errors import InputError
from fronto.pose.bundle import FIRST_GROUP, Model, Observations, Solution
from fronto.pose.structure import ALIGN_STD, numbered, typical_width
from fronto.shapes import FloatArray, Outline

__all__ = [
    "Template",
    "TemplateButton",
    "contradictions",
    "match_template",
    "template_groups",
    "templated_model",
]

#: Farther off its place than this, in button widths, a button contradicts the template.
MISPLACED = 0.15
#: So does a size whose logarithm misses by more than this.
MISSIZED = 0.1
#: Standard deviation of the logarithm of a known size: outlines have bezels.
SIZE_STD = 0.02


@dataclass(frozen=True)
class TemplateButton:
    """One button of a known panel.

    Parameters
    ----------
    x_mm, y_mm
        Centre, x right and y down on the panel, from any origin.
    width_mm, height_mm
        Size, or None where it is not known; of a circle both are the diameter.
    label
        What is printed on it; used to find it among the outlines.
    """

    x_mm: float
    y_mm: float
    width_mm: float | None = None
    height_mm: float | None = None
    label: str = ""

    def __post_init__(self) -> None:
        if not (np.isfinite(self.x_mm) and np.isfinite(self.y_mm)):
            raise InputError(f"template button {self.label!r}", "expected finite x_mm and y_mm")
        for name, value in (("width_mm", self.width_mm), ("height_mm", self.height_mm)):
            if value is not None and not (np.isfinite(value) and value > 0):
                raise InputError(
                    f"template button {self.label!r}", f"expected a positive {name}, got {value}"
                )


@dataclass(frozen=True)
class Template:
    """A known panel."""

    buttons: tuple[TemplateButton, ...]

    def __post_init__(self) -> None:
        positions = np.array([(b.x_mm, b.y_mm) for b in self.buttons]).reshape(-1, 2)
        if len(positions) < 2 or np.ptp(positions, axis=0).max() <= 0:
            raise InputError(
                "template",
                "expected at least two buttons at different positions",
                "leave the template out if the layout is not known",
            )
        sizes = np.array([(b.width_mm or 0.0, b.height_mm or 0.0) for b in self.buttons])
        apart = np.abs(positions[:, None] - positions)
        room = 0.5 * (sizes[:, None] + sizes)
        overlap = (apart < 0.99 * room).all(axis=2) & ~np.eye(len(positions), dtype=bool)
        if overlap.any():
            first, second = np.argwhere(overlap)[0]
            raise InputError(
                f"template buttons {first} and {second}",
                "expected buttons side by side, got overlapping ones",
                "check that positions and sizes are in the same unit, millimetres",
            )


def match_template(template: Template, outlines: Sequence[Outline]) -> list[TemplateButton | None]:
    """The template's button of each outline.

    By label where labels and texts are there and unique; otherwise by order, which needs
    as many outlines as template buttons. Outlines without a partner get None.

    Raises
    ------
    InputError
        If fewer than two outlines find a partner.
    """
    by_label = {b.label: b for b in template.buttons if b.label}
    texts = Counter(o.text for o in outlines if o.text)
    if len(by_label) == len(template.buttons) and texts:
        matched = [
            by_label.get(o.text) if o.text and texts[o.text] == 1 else None for o in outlines
        ]
        if sum(b is not None for b in matched) < 2:
            raise InputError(
                "template",
                f"fewer than two outlines carry the text of a template label {sorted(by_label)}",
                "give the outlines' texts, or leave the labels out and list both in one order",
            )
        return matched
    if len(outlines) != len(template.buttons):
        raise InputError(
            "template",
            f"{len(template.buttons)} buttons for {len(outlines)} outlines and no labels to "
            "match them by",
            "give labels and texts, or list both in the same order",
        )
    return list(template.buttons)


def template_groups(
    seen: Observations, matched: Sequence[TemplateButton | None]
) -> npt.NDArray[np.intp]:
    """Group of each button (n,): those that the template gives one size, by shape."""
    keys = [
        (int(kind), None if b is None else (b.width_mm, b.height_mm))
        for kind, b in zip(seen.kind, matched, strict=True)
    ]
    return numbered(np.array([keys.index(key) for key in keys]))


def templated_model(
    model: Model, xy: FloatArray, width: float, matched: Sequence[TemplateButton | None]
) -> tuple[Model, FloatArray]:
    """Tie each matched button to scale * (x_mm, y_mm) + offset.

    Parameters
    ----------
    xy, width
        As of `fronto.pose.structure.tied_model`.

    Returns
    -------
    The model, its last three latents being scale (pivot depths per mm) and offset, and
    their initial values (3,).
    """
    known = [k for k, button in enumerate(matched) if button is not None]
    mm = np.array([(b.x_mm, b.y_mm) for b in matched if b is not None])
    xy = xy[known]
    spread = mm - mm.mean(axis=0)
    scale = float((spread * (xy - xy.mean(axis=0))).sum() / (spread**2).sum())
    if scale <= 0:
        scale = float(np.linalg.norm(xy - xy.mean(axis=0)) / np.linalg.norm(spread))
    offset = xy.mean(axis=0) - scale * mm.mean(axis=0)

    tie_index = np.full_like(model.tie_index, -1)
    tie_coef, tie_isd = np.zeros_like(model.tie_coef), np.zeros_like(model.tie_isd)
    for axis in range(2):
        tie_index[known, 2 * axis] = 0
        tie_coef[known, 2 * axis] = mm[:, axis]
        tie_index[known, 2 * axis + 1] = 1 + axis
        tie_coef[known, 2 * axis + 1] = 1.0
        tie_isd[known, axis] = np.sqrt(2) / (ALIGN_STD * width)
    size_scale = np.zeros_like(model.size_scale)
    for group in range(len(size_scale)):
        members = [b for k, b in enumerate(matched) if b and model.group[k] == group]
        for axis, name in enumerate(("width_mm", "height_mm")):
            sizes = [value for b in members if (value := getattr(b, name)) is not None]
            if sizes and len(sizes) == len(members):
                size_scale[group, axis] = np.median(sizes)
    tied = replace(
        model,
        tie_index=tie_index,
        tie_coef=tie_coef,
        tie_isd=tie_isd,
        latents=3,
        size_scale=size_scale,
        size_isd=1 / SIZE_STD,
        scale_latent=0,
    )
    return tied, np.array([scale, offset[0], offset[1]])


def contradictions(model: Model, solution: Solution) -> list[str]:
    """Why the solution does not fit the template that it was tied to, in words."""
    first = FIRST_GROUP + 2 * len(model.square_isd)
    latents = solution.parameters[first:]
    scale = float(latents[model.scale_latent])
    width = typical_width(model, solution)
    reasons = []
    index, coef = model.tie_index.reshape(-1, 2, 2), model.tie_coef.reshape(-1, 2, 2)
    off = np.abs(solution.xy - (coef * latents[index]).sum(axis=2)).max(axis=1)
    off[index[:, 0, 0] < 0] = 0.0
    worst = int(off.argmax())
    if off[worst] > MISPLACED * width:
        reasons.append(
            f"outlines {worst} lies {off[worst] / scale:.0f} mm off its place in the template"
        )
    known = model.size_scale
    sizes = solution.parameters[FIRST_GROUP:first].reshape(-1, 2)
    with np.errstate(divide="ignore"):
        missed = np.where(known > 0, sizes - np.log(scale * known), 0.0)
    if np.abs(missed).max() > MISSIZED:
        ratio = float(np.exp(missed.flat[np.abs(missed).argmax()]))
        reasons.append(f"buttons are {ratio:.2g} times the size that the template states")
    return reasons
