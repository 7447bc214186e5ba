"""A result as JSON (schema ``fronto.panel/1``, docs/result.md) and as files."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from fronto.errors import InputError
from fronto.files import json_bytes, make_folder, write_bytes
from fronto.results import SCHEMA, Button, Panel, PanelPose, Plate
from fronto.shapes import Ellipse

__all__ = [
    "PanelFiles",
    "button_to_dict",
    "output_names",
    "panel_to_dict",
    "panel_to_json",
    "write_panel",
]

#: With these a pose has a rotation worth stating.
DETERMINED = ("ok", "uncertain")


@dataclass(frozen=True)
class PanelFiles:
    """The files of one result.

    Parameters
    ----------
    json, overlay, rectified
        The files; `rectified` is None where there is no head-on picture.
    values
        What the JSON says, as of `panel_to_dict`.
    """

    json: Path
    overlay: Path
    rectified: Path | None
    values: dict[str, Any]


def panel_to_dict(
    panel: Panel, rectified_file: str | None = None, run: str | None = None
) -> dict[str, Any]:
    """Plain values of a result, the contract of docs/result.md.

    Parameters
    ----------
    panel
        The result.
    rectified_file
        Name of the file with the rectified picture, where there is one.
    run
        A digest of the settings, where there is one: `fronto rectify --resume` compares it.

    Returns
    -------
    Lists, dicts, strings, numbers, booleans and None only; None for NaN and infinity.
    """
    view = panel.view
    values: dict[str, Any] = {
        "schema": SCHEMA,
        "image": panel.image,
        "width_px": panel.width_px,
        "height_px": panel.height_px,
        "status": panel.status,
        "reasons": panel.reasons,
        "notes": (*panel.notes, *panel.pose.notes),
        "camera": panel.pose.camera.to_dict(),
        "pose": _pose(panel.pose),
        "homography": None if view is None else view.homography,
        "homography_domain": "undistorted" if panel.pose.camera.distorted else "source",
        "rectified": None,
        "buttons": [_button(button) for button in panel.buttons],
        "plates": [_plate(plate) for plate in panel.plates],
        "timing_ms": {stage: round(value, 3) for stage, value in panel.timing_ms.items()},
    }
    if run is not None:
        values["run"] = run
    if view is not None:
        values["rectified"] = {
            "file": rectified_file,
            "width_px": view.width_px,
            "height_px": view.height_px,
            "crop": view.crop,
            "scale": view.scale,
        }
    plain: dict[str, Any] = _plain(values)
    return plain


def panel_to_json(panel: Panel, rectified_file: str | None = None, run: str | None = None) -> bytes:
    """`panel_to_dict` as strictly valid JSON, UTF-8."""
    return json_bytes(panel_to_dict(panel, rectified_file, run))


def output_names(stem: str) -> tuple[str, str, str]:
    """Name the files of one result: the JSON, the overlay, the rectified picture."""
    return f"{stem}.json", f"{stem}.overlay.png", f"{stem}.rectified.png"


def write_panel(
    panel: Panel,
    image: npt.NDArray[Any],
    directory: str | Path,
    stem: str,
    *,
    run: str | None = None,
    pictures: Mapping[str, npt.NDArray[Any]] | None = None,
) -> PanelFiles:
    """Write STEM.json, STEM.overlay.png and, where there is a view, STEM.rectified.png.

    Each appears in one piece, the JSON last. Without a view an older STEM.rectified.png
    is removed, so that no picture stands beside a result that has none.

    Parameters
    ----------
    panel
        The result.
    image
        The photo (h, w, 3), RGB, or grey (h, w) or (h, w, 1); uint8 or uint16.
    directory
        Made if missing.
    stem
        Usually the photo's name without its suffix.
    run
        As of `panel_to_dict`.
    pictures
        Further ones, to be written as STEM.KEY.png.

    Raises
    ------
    InputError
        If the image is of another type, or a file cannot be written.
    """
    from fronto.draw import button_names, draw_overlay
    from fronto.imageio import write_png

    folder = Path(directory)
    json_file, overlay, rectified = (folder / name for name in output_names(stem))
    drawing = draw_overlay(
        _eight_bit(image),
        panel.pose,
        [button.outline for button in panel.buttons],
        button_names(panel.buttons),
    )
    make_folder(folder)
    if panel.view is None:
        with contextlib.suppress(OSError):
            rectified.unlink(missing_ok=True)
    try:
        if panel.view is not None:
            write_png(rectified, panel.view.image)
        write_png(overlay, drawing)
        for key, picture in (pictures or {}).items():
            write_png(folder / f"{stem}.{key}.png", picture)
        name = None if panel.view is None else rectified.name
        values = panel_to_dict(panel, name, run)
        write_bytes(json_file, json_bytes(values))
    except InputError:
        # An older JSON must not describe the newer pictures.
        with contextlib.suppress(OSError):
            json_file.unlink(missing_ok=True)
        raise
    return PanelFiles(json_file, overlay, None if panel.view is None else rectified, values)


def _eight_bit(image: npt.NDArray[Any]) -> npt.NDArray[Any]:
    return (image >> 8).astype(np.uint8) if image.dtype == np.uint16 else image


def _pose(pose: PanelPose) -> dict[str, Any]:
    return {
        "solver": pose.solver,
        **_rotation(pose),
        "covariance_rad2": pose.covariance,
        "cos_norm": pose.cos_norm,
        "final_cr": pose.final_cr,
        "sigma_px": pose.sigma_px,
        "focal_std": pose.focal_std,
        "aspect_std": pose.aspect_std,
        "plane_depth_m": pose.plane_depth_m,
        "cost": pose.cost,
        "alternatives": [
            {**_rotation(other), "focal_px": other.camera.focal_px, "cost": other.cost}
            for other in pose.alternatives
            if other.status in DETERMINED
        ],
        "stopped": pose.stopped,
    }


def _rotation(pose: PanelPose) -> dict[str, Any]:
    # A rotation that the outlines do not determine would be taken for one.
    known = pose.status in DETERMINED
    return {
        "rotation": pose.rotation if known else None,
        "angles_deg": pose.angles_deg if known else None,
        "std_deg": pose.std_deg if known else (None, None, None),
        "normal": pose.normal if known else None,
    }


def _plate(plate: Plate) -> dict[str, Any]:
    outline = plate.outline
    return {
        "corners_px": outline.corners_px,
        "ellipse_px": _ellipse(outline.ellipse_px),
        "box_px": outline.box_px,
        "confidence": outline.confidence,
        "corner_std_px": outline.std_px,
        "label": plate.label or None,
        "label_confidence": plate.label_confidence,
        "button": plate.button,
    }


def _button(button: Button) -> dict[str, Any]:
    outline = button.outline
    return {
        "id": button.id,
        "category": outline.category,
        "confidence": outline.confidence,
        "shape": outline.shape,
        "corners_px": outline.corners_px,
        "ellipse_px": _ellipse(outline.ellipse_px),
        "box_px": outline.box_px,
        "center_px": outline.center_px,
        "corner_std_px": outline.std_px,
        "form_std_px": outline.form_std_px,
        "odd": outline.odd,
        "truncated": outline.truncated,
        "seen": outline.seen,
        "shape_confidence": outline.shape_confidence,
        "rectified_corners_px": button.rectified_corners_px,
        "rectified_ellipse_px": _ellipse(button.rectified_ellipse_px),
        "rectified_center_px": button.rectified_center_px,
        "residual_px": button.residual_px,
        "weight": button.weight,
        "label": button.label or None,
        "label_confidence": button.label_confidence,
        "label_source": button.label_source,
        "label_guesses": button.label_guesses,
        "position_m": button.position_m,
        "position_std_m": button.position_std_m,
        "press_normal": button.press_normal,
        "lit": button.lit,
    }


def button_to_dict(button: Button) -> dict[str, Any]:
    """Plain values of one button, as `panel_to_dict` has them."""
    plain: dict[str, Any] = _plain(_button(button))
    return plain


def _ellipse(ellipse: Ellipse | None) -> dict[str, float] | None:
    if ellipse is None:
        return None
    return {name: getattr(ellipse, name) for name in ("cx", "cy", "a", "b", "angle_deg")}


def _plain(value: Any) -> Any:
    """JSON's own types, None for what is no finite number."""
    if type(value) is float:  # most of them
        return value if math.isfinite(value) else None
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, str):
        # A file name that is no Unicode reaches Python with lone surrogates.
        return value.encode("utf-8", "replace").decode("utf-8")
    if isinstance(value, (bool, np.bool_)):
        return bool(value)
    if isinstance(value, (int, np.integer)):
        return int(value)
    if isinstance(value, (float, np.floating)):
        return float(value) if math.isfinite(value) else None
    return value
