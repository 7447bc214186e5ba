"""Rendered panels as labelled photos."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from fronto.datasets.records import LabeledImage, LabeledObject, polygon_box

if TYPE_CHECKING:
    from fronto.synth.photo import PanelPhoto

__all__ = ["labeled_render"]


def labeled_render(photo: PanelPhoto, path: Path) -> LabeledImage:
    """The exact labels of a rendered panel.

    Parameters
    ----------
    photo
        What `fronto.synth.photo.render_photo` gives.
    path
        Where its picture lies, or a name for it.
    """
    objects = tuple(
        LabeledObject(
            o.category,
            polygon_box(o.polygon_px),
            o.polygon_px,
            o.category,
            text=o.text,
            truncated=o.outline.truncated,
        )
        for o in photo.objects
    )
    return LabeledImage(path, photo.image.shape[1], photo.image.shape[0], objects)
