"""The fields of a calibration file: ROS camera_info, OpenCV, Kalibr and fronto's own."""

from __future__ import annotations

import reprlib
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, cast

from fronto.camera.distortion import DistortionModel
from fronto.errors import InputError

__all__ = ["FileCamera", "read_fields"]

# Spellings of a field, compared without case, "_" and "-".
MATRIX = ("camera_matrix", "K", "matrix", "intrinsics", "intrinsic_matrix", "camera_intrinsics")
DISTORTION = (
    "distortion_coefficients",
    "distortion_coeffs",
    "dist_coeffs",
    "dist_coefs",
    "D",
    "distortion",
    "dist",
)
PROJECTION = ("projection_matrix", "P")
WIDTH = ("image_width", "width_px", "width")
HEIGHT = ("image_height", "height_px", "height")
SIZE = ("image_size", "img_size", "resolution")

#: Models by the names of ROS (REP 104 and image_proc), OpenCV and Kalibr.
MODELS = {
    "": None,
    "none": "none",
    "plumb_bob": "plumb_bob",
    "radtan": "plumb_bob",
    "rational_polynomial": "rational_polynomial",
    "equidistant": "equidistant",
    "fisheye": "equidistant",
}
MOST_NUMBERS = 16
COMPLETE = "give all that the calibration states, and no more"


@dataclass(frozen=True)
class FileCamera:
    """What a file states about a camera, not yet checked for being one."""

    kind: str
    matrix: list[list[float]]
    size: tuple[int, int] | None = None
    distortion: tuple[float, ...] = ()
    model: DistortionModel | None = None
    focal_std: float = 0.0
    name: str = ""


def read_fields(fields: Mapping[str, Any], *, projection: bool, name: str | None) -> FileCamera:
    """Find the camera among the fields of a file.

    Parameters
    ----------
    fields
        The file's content.
    projection
        Take ROS's projection matrix and no distortion.
    name
        Which camera of a Kalibr chain.

    Raises
    ------
    InputError
        Naming the field.
    """
    chain = {
        str(key): value
        for key, value in fields.items()
        if isinstance(value, Mapping) and _find(value, "camera_model") is not None
    }
    if _find(fields, "camera_model") is not None:
        chain = {"cam0": fields}
    if chain:
        if projection:
            raise InputError(
                "projection_matrix", "expected one, a Kalibr file has none", "leave projection out"
            )
        return _kalibr(chain, name)
    if name is not None:
        raise InputError(
            "name", "expected a Kalibr file with several cameras, got one camera", "leave it out"
        )
    return _single(fields, projection=projection)


def _kalibr(chain: Mapping[str, Any], name: str | None) -> FileCamera:
    chosen = name if name is not None else ("cam0" if "cam0" in chain else next(iter(chain)))
    if chosen not in chain:
        raise InputError(
            f"camera {chosen}", f"no such camera, the file has {_short(sorted(chain))}"
        )
    fields = chain[chosen]
    model = _word(fields, "camera_model")
    if model != "pinhole":
        raise InputError(
            f"{chosen} camera_model",
            f"expected pinhole, got {model or 'nothing'}",
            "calibrate with pinhole-radtan or pinhole-equi",
        )
    fx, fy, cx, cy = _numbers(_need(fields, "intrinsics"), f"{chosen} intrinsics", 4)
    coefficients = _optional_numbers(fields, f"{chosen} ")
    kind = _model(fields, len(coefficients), f"{chosen} ")
    matrix = [[fx, 0.0, cx], [0.0, fy, cy], [0.0, 0.0, 1.0]]
    return FileCamera("Kalibr file", matrix, _size(fields), coefficients, kind, name=chosen)


def _single(fields: Mapping[str, Any], *, projection: bool) -> FileCamera:
    ros = _find(fields, "distortion_model", "projection_matrix", "P") is not None
    own = _find(fields, "width_px") is not None
    kind = "fronto file" if own else "ROS camera_info file" if ros else "OpenCV file"
    deviation = _find(fields, "focal_std")
    focal_std = 0.0 if deviation is None else _number(deviation[1], "focal_std")
    if projection:
        flat = _numbers(_need(fields, *PROJECTION), PROJECTION[0], 12)
        matrix = [flat[0:3], flat[4:7], flat[8:11]]
        coefficients: tuple[float, ...] = ()
        model: DistortionModel | None = "none"
    else:
        flat = _numbers(_need(fields, *MATRIX), MATRIX[0], 9)
        matrix = [flat[0:3], flat[3:6], flat[6:9]]
        coefficients = _optional_numbers(fields)
        model = _model(fields, len(coefficients))
    size, shift = _region(fields, _size(fields))
    for row, offset, factor in zip(matrix, *shift, strict=False):
        row[2] -= offset
        if factor != 1:
            row[:] = row[0] / factor, row[1] / factor, (row[2] + 0.5) / factor - 0.5
    return FileCamera(kind, matrix, size, coefficients, model, focal_std)


def _region(
    fields: Mapping[str, Any], size: tuple[int, int] | None
) -> tuple[tuple[int, int] | None, tuple[tuple[float, float], tuple[float, float]]]:
    """Find the size that ROS's region of interest and binning leave, their shift and factor.

    K and P belong to the full image; the region is cut from it, then binned
    (sensor_msgs/CameraInfo). Zeros mean: the full image, no binning.
    """
    binning = tuple(
        max(1, _whole(found[1], key)) if (found := _find(fields, key)) else 1
        for key in ("binning_x", "binning_y")
    )
    offset = (0.0, 0.0)
    roi = _find(fields, "roi")
    if roi is not None and isinstance(roi[1], Mapping):
        left, top, width, height = (
            _whole(found[1], f"roi {key}") if (found := _find(roi[1], key)) else 0
            for key in ("x_offset", "y_offset", "width", "height")
        )
        if width and height:
            offset, size = (float(left), float(top)), (width, height)
    if size is not None:
        size = size[0] // binning[0], size[1] // binning[1]
    return size, (offset, (float(binning[0]), float(binning[1])))


def _model(fields: Mapping[str, Any], count: int, prefix: str = "") -> DistortionModel | None:
    flag = _find(fields, "fisheye_model")
    if flag is not None and _number(flag[1], "fisheye_model") != 0:
        return "equidistant"
    word = _word(fields, "distortion_model")
    if word not in MODELS:
        raise InputError(
            f"{prefix}distortion_model",
            "expected plumb_bob, rational_polynomial, equidistant, fisheye, radtan or none, "
            f"got {word[:40]!r}",
            "calibrate with one of them, or undistort the photo and state none",
        )
    if count == 0 and word != "equidistant":
        return "none"
    return cast("DistortionModel | None", MODELS[word])


def _size(fields: Mapping[str, Any]) -> tuple[int, int] | None:
    width, height = _find(fields, *WIDTH), _find(fields, *HEIGHT)
    if width is not None and height is not None:
        return _whole(width[1], width[0]), _whole(height[1], height[0])
    if width is not None or height is not None:
        missing = WIDTH[0] if width is None else HEIGHT[0]
        raise InputError(missing, "missing, the file states only the other side", "add it")
    both = _find(fields, *SIZE)
    if both is None:
        return None
    across, down = _numbers(both, both[0], 2)
    return _whole(across, both[0]), _whole(down, both[0])


def _find(fields: Mapping[str, Any], *names: str) -> tuple[str, Any] | None:
    """Find the first of the names, as it is spelt in the file, and its value."""
    spelt = {_bare(key): key for key in fields if isinstance(key, str)}
    for name in names:
        if _bare(name) in spelt:
            key = spelt[_bare(name)]
            return key, fields[key]
    return None


def _bare(key: str) -> str:
    return key.lower().replace("_", "").replace("-", "")


def _need(fields: Mapping[str, Any], *names: str) -> tuple[str, Any]:
    found = _find(fields, *names)
    if found is None:
        keys = _short([str(key)[:30] for key in fields])
        raise InputError(
            names[0], f"missing field, the file has {keys}", "add it or give another file"
        )
    return found


def _word(fields: Mapping[str, Any], name: str) -> str:
    found = _find(fields, name)
    if found is None or found[1] is None:
        return ""
    return str(found[1]).strip().lower() if isinstance(found[1], str) else _short(found[1])


def _optional_numbers(fields: Mapping[str, Any], prefix: str = "") -> tuple[float, ...]:
    found = _find(fields, *DISTORTION)
    return () if found is None else tuple(_numbers(found, prefix + found[0]))


def _numbers(found: tuple[str, Any], field: str, count: int | None = None) -> list[float]:
    """Flatten a list, a list of rows, numbers in a text, or {rows, cols, data}.

    Never deeper, and never more than a camera has: a YAML file can nest references so that
    walking through them takes forever.
    """
    value = found[1]
    shape = None
    if isinstance(value, Mapping):
        rows, cols = _find(value, "rows"), _find(value, "cols")
        if rows is not None and cols is not None:
            shape = _whole(rows[1], f"{field} rows"), _whole(cols[1], f"{field} cols")
        value = _need(value, "data")[1]
    if value is None:
        value = []
    if isinstance(value, str):
        value = value.replace(",", " ").split()
    if not isinstance(value, list):
        raise InputError(field, f"expected numbers, got {_short(value)}")
    flat: list[Any] = []
    for item in value[: MOST_NUMBERS + 1]:
        flat.extend(item[: MOST_NUMBERS + 1] if isinstance(item, list) else [item])
    many = f"more than {MOST_NUMBERS}" if len(flat) > MOST_NUMBERS else str(len(flat))
    wanted = count if shape is None else shape[0] * shape[1]
    if len(flat) > MOST_NUMBERS or (wanted is not None and len(flat) != wanted):
        raise InputError(
            field,
            f"expected {wanted or 'at most ' + str(MOST_NUMBERS)} numbers, got {many}",
            COMPLETE,
        )
    if count is not None and len(flat) != count:
        raise InputError(field, f"expected {count} numbers, got {many}", COMPLETE)
    return [_number(item, field) for item in flat]


def _number(value: object, field: str) -> float:
    if isinstance(value, (int, float, str)) and not isinstance(value, bool):
        try:
            return float(value)
        except (ValueError, OverflowError):
            pass
    raise InputError(field, f"expected a number, got {_short(value)}")


def _short(value: object) -> str:
    return reprlib.repr(value)[:200]


def _whole(value: object, field: str) -> int:
    number = _number(value, field)
    if not number.is_integer():
        raise InputError(field, f"expected a whole number, got {number:g}")
    return int(number)
