"""(c) Vanishing points of line segments: the package lu-vp-detect, given the focal length.

Lu, Yao, Li, Liu and Zhang, "2-Line Exhaustive Searching for Real-Time Vanishing Point Estimation
in Manhattan World", WACV 2017, in Phan's Python version (https://pypi.org/project/lu-vp-detect,
1.0.4). It names a GUI build of OpenCV as what it needs, but runs on any: install it by
`pip install --no-deps`.
"""

from __future__ import annotations

from itertools import permutations, product

import cv2
import numpy as np
import numpy.typing as npt

from fronto import Camera
from fronto.pose.rotation import nearest_rotation
from scenes import Case, FloatArray, Image
from ways.answer import Answer
from ways.pinhole import pinhole_image

Lines = npt.NDArray[np.float32]

#: Shorter segments are left out: pixels where the photo's longer side has `LONGER_SIDE_PX`.
LENGTH_PX, LONGER_SIDE_PX = 30.0, 640
#: Beyond that the shorter ones are left out, too: the package looks at all pairs.
MOST_LINES = 1000
#: The package draws pairs of lines until enough of them meet: if hardly any do, it never ends.
LEAST_MEETING = 0.02
#: As in the package: lines whose crossing has a smaller third coordinate are parallel.
PARALLEL = 1e-8
SEED = 1
#: A line runs along a direction if it points past the vanishing point by less than that.
ALONG_DEG = 2.0
MOST_TILT_DEG = 75.0

SIGNED_PERMUTATIONS = tuple(
    np.diag(signs) @ np.eye(3)[list(order)]
    for order in permutations(range(3))
    for signs in product((1.0, -1.0), repeat=3)
)


def _square_pixels(camera: Camera) -> FloatArray:
    """The matrix (3, 3) that the package assumes: one focal length."""
    matrix = np.array(camera.matrix)
    matrix[:2, :2] = camera.focal_px * np.eye(2)
    return matrix


def vanishing_rotation(vps: FloatArray, camera: Camera, normal: int | None = None) -> FloatArray:
    """The rotation (3, 3) whose rows are the panel's axes, from three vanishing directions.

    `vps`: (3, 3), rows about orthogonal and in any order, as the package has them. `normal`: which
    one is the panel's normal, where that is known. What is left open of which direction is whose
    axis, and its sign, is such that the camera is as upright and frontal as can be.
    """
    axes = vps @ _square_pixels(camera).T @ np.linalg.inv(camera.matrix).T
    axes = axes / np.linalg.norm(axes, axis=1, keepdims=True)
    turned = [S @ axes for S in SIGNED_PERMUTATIONS if normal is None or S[2, normal] != 0]
    return nearest_rotation(max((V for V in turned if np.linalg.det(V) > 0), key=np.trace))


def _normal(vps: FloatArray, ends: Lines, camera: Camera) -> int | None:
    """Which direction is the normal's: the one along which the least length of lines runs.

    A panel has lines along its rows and columns only; where it is seen at more than 45 degrees,
    the most frontal plane is another one. None: the lines tell nothing.
    """
    first, last = ends[:, None, :2].astype(np.float64), ends[:, None, 2:].astype(np.float64)
    points = vps @ _square_pixels(camera).T
    # From a line's middle to the vanishing points, which may be at infinity.
    towards = points[:, :2] - points[:, 2:] * (first + last) / 2
    along = last - first
    length = np.linalg.norm(along, axis=2)
    sine = np.abs(along[..., 0] * towards[..., 1] - along[..., 1] * towards[..., 0])
    sine = sine / np.maximum(length * np.linalg.norm(towards, axis=2), 1e-12)
    runs = sine.min(axis=1) < np.sin(np.radians(ALONG_DEG))
    if not runs.any():
        return None
    total = np.bincount(sine.argmin(axis=1)[runs], length[runs, 0], minlength=3)
    facing = np.abs(vps[:, 2]) > np.cos(np.radians(MOST_TILT_DEG)) * np.linalg.norm(vps, axis=1)
    return int(np.where(facing, total, np.inf).argmin())


def _segments(grey: Image, length_px: float) -> Lines:
    """Ends x, y, x, y of the segments that the package looks at, (n, 4)."""
    found = cv2.createLineSegmentDetector(0).detect(grey)[0]
    ends = np.zeros((0, 4), np.float32) if found is None else found.reshape(-1, 4)
    lengths = np.hypot(ends[:, 2] - ends[:, 0], ends[:, 3] - ends[:, 1])
    order = np.argsort(-lengths, kind="stable")[:MOST_LINES]
    return np.asarray(ends[np.sort(order[lengths[order] >= length_px])], np.float32)


def _meeting(ends: Lines) -> float:
    """The share of pairs of lines that are not parallel."""
    if len(ends) < 2:
        return 0.0
    ones = np.ones((len(ends), 1), np.float32)
    lines = np.cross(np.hstack([ends[:, :2], ones]), np.hstack([ends[:, 2:], ones]))
    crossed = np.outer(lines[:, 0], lines[:, 1])
    apart = np.abs(crossed - crossed.T) >= PARALLEL
    return float(apart[np.triu_indices(len(ends), 1)].mean())


def vanishing(case: Case) -> Answer:
    """All segments of the photo; the camera's focal length and principal point are given.

    Raises ModuleNotFoundError where the package is not installed.
    """
    from lu_vp_detect import VPDetection

    camera = case.camera
    grey = cv2.cvtColor(pinhole_image(case), cv2.COLOR_RGB2GRAY)
    length = LENGTH_PX * max(grey.shape) / LONGER_SIDE_PX
    ends = _segments(np.asarray(grey, np.uint8), length)
    if len(ends) < 3 or _meeting(ends) < LEAST_MEETING:
        return Answer(camera, reason=f"{len(ends)} line segments, too few of which meet")
    # By the constructor: the setter of the principal point sets the length instead.
    middle = np.array(camera.matrix[:2, 2], np.float32)
    detection = VPDetection(length, middle, camera.focal_px, SEED)

    def given(_: Image) -> Lines:
        detection._VPDetection__lines = ends
        return ends

    # The package asks the same detector, but cannot read what OpenCV 5 answers.
    detection._VPDetection__detect_lines = given
    try:
        with np.errstate(all="ignore"):
            vps = np.asarray(detection.find_vps(grey), np.float64)
        rotation = vanishing_rotation(vps, camera, _normal(vps, ends, camera))
    except (ValueError, IndexError, ArithmeticError, cv2.error) as error:
        return Answer(camera, reason=f"lu-vp-detect: {' '.join(str(error).split())}")
    return Answer(camera, rotation)
