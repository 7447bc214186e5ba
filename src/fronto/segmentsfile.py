"""Segments of a photo as JSON (schema ``fronto.segments/1``), as pictures, and as labels."""

from __future__ import annotations

import contextlib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from fronto.categories import CATEGORIES
from fronto.contours import level_contour
from fronto.datasets.records import LabeledImage, LabeledObject
from fronto.errors import InputError
from fronto.files import json_bytes, make_folder, write_bytes
from fronto.segments import Segment, Segments
from fronto.shapes import FloatArray

__all__ = [
    "SCHEMA",
    "SegmentFiles",
    "labeled_image",
    "segment_names",
    "segment_polygon",
    "segments_to_dict",
    "write_segments",
]

SCHEMA = "fronto.segments/1"
#: Digits after the point of pixels (and of probabilities, one more).
DIGITS = 2


@dataclass(frozen=True)
class SegmentFiles:
    """The files of one photo's segments."""

    json: Path
    map: Path
    overlay: Path


def segment_polygon(segment: Segment) -> FloatArray:
    """Outer contour of a segment where its probability is one half.

    Returns
    -------
    Shape (n, 2): pixels of the photo, clockwise as seen.

    Raises
    ------
    InputError
        If its mask is empty.
    """
    return np.asarray(level_contour(segment.probability) + segment.origin_px)


def segments_to_dict(segments: Segments, image: str = "", weights: str = "") -> dict[str, Any]:
    """Plain values of a photo's segments.

    ``segments`` lists them, surest first: ``id`` (their number in the instance map, from 1),
    ``category``, ``confidence`` and ``scores`` (of each category) from 0 to 1, ``box_px``
    (edges x0, y0, x1, y1), ``area_px`` (pixels of the mask), ``polygon_px`` (the mask's outer
    contour at probability 0.5, clockwise; null where the mask is empty) and ``truncated``
    (touches the photo's border). Pixels are those of the photo upright, the centre of its
    top-left pixel being (0, 0).

    Parameters
    ----------
    segments
        What `fronto.segmentation.segment` found.
    image
        The photo's name.
    weights
        The name of the network's file.

    Returns
    -------
    Lists, dicts, strings, numbers, booleans and None only.
    """
    return {
        "schema": SCHEMA,
        "image": image.encode("utf-8", "replace").decode("utf-8"),
        "width_px": segments.width_px,
        "height_px": segments.height_px,
        "weights": weights,
        "categories": list(CATEGORIES[1:]),
        "notes": list(segments.notes),
        "segments": [_segment(k, s) for k, s in enumerate(segments.segments, 1)],
        "timing_ms": {step: round(float(ms), 3) for step, ms in segments.timing_ms.items()},
    }


def _segment(number: int, segment: Segment) -> dict[str, Any]:
    mask = segment.mask
    scores = zip(CATEGORIES, segment.scores, strict=False)
    return {
        "id": number,
        "category": segment.category,
        "confidence": round(float(segment.confidence), DIGITS + 1),
        "box_px": [round(float(edge), DIGITS) for edge in segment.box_px],
        "area_px": int(np.count_nonzero(mask)),
        "truncated": bool(segment.truncated),
        "scores": {name: round(float(score), DIGITS + 1) for name, score in scores},
        "polygon_px": np.round(segment_polygon(segment), DIGITS).tolist() if mask.any() else None,
    }


def segment_names(stem: str) -> tuple[str, str, str]:
    """Name the files of one photo's segments: the JSON, the instance map, the overlay."""
    return f"{stem}.segments.json", f"{stem}.segments.png", f"{stem}.overlay.png"


def write_segments(
    segments: Segments,
    image: npt.NDArray[np.uint8],
    directory: str | Path,
    stem: str,
    *,
    name: str = "",
    weights: str = "",
) -> SegmentFiles:
    """Write STEM.segments.json, STEM.segments.png and STEM.overlay.png.

    The PNG is the instance map: 16 bits, 0 for none and k for the segment with the id k.
    Each file appears in one piece, the JSON last.

    Parameters
    ----------
    segments
        What was found.
    image
        The photo, shape (h, w, 3), uint8, RGB.
    directory
        Made if missing.
    stem
        Usually the photo's name without its suffix.
    name, weights
        Names of the photo and of the network's file, for the JSON.

    Raises
    ------
    InputError
        If the image is of another type, or a file cannot be written.
    """
    from fronto.draw_segments import draw_segments
    from fronto.imageio import write_png

    folder = Path(directory)
    json_file, instances, overlay = (folder / name for name in segment_names(stem))
    drawing = draw_segments(image, segments)
    content = json_bytes(segments_to_dict(segments, name, weights))
    make_folder(folder)
    try:
        write_png(instances, segments.instance_map().astype(np.uint16))
        write_png(overlay, drawing)
        write_bytes(json_file, content)
    except InputError:
        # An older JSON must not describe the newer pictures.
        with contextlib.suppress(OSError):
            json_file.unlink(missing_ok=True)
        raise
    return SegmentFiles(json_file, instances, overlay)


def labeled_image(segments: Segments, photo: Path) -> LabeledImage:
    """Segments as labels of a data set, to be corrected by hand or trained on.

    Segments whose mask is empty are labelled by their boxes.

    Parameters
    ----------
    segments
        What was found.
    photo
        The photo's file.
    """
    objects = tuple(
        LabeledObject(
            s.category,
            s.box_px,
            segment_polygon(s) if s.mask.any() else None,
            s.category,
            truncated=s.truncated,
        )
        for s in segments
    )
    return LabeledImage(photo, segments.width_px, segments.height_px, objects)
