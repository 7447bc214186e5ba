"""What the label reader sees: each button or plate, cut head-on from the photo itself.

A detour over the rectified picture would resample twice, and that picture may be small. Each
crop has its own way into the photo; where the photo has more pixels than the crop, they are
averaged, so that nothing aliases.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from fronto.errors import InputError
from fronto.images import as_rgb
from fronto.labels.alphabet import CROP_PX, CROP_SCALE
from fronto.labels.layout import panel_boxes
from fronto.shapes import FloatArray, Outline

if TYPE_CHECKING:
    from fronto.results import PanelPose

__all__ = ["crops"]

Pixels = npt.NDArray[np.uint8]

#: Up to this many photo pixels for each pixel of the crop one sample is enough.
NEAR_ONE = 1.25
#: More is not averaged: outlines larger than any photo, or seen nearly edge-on.
MAX_HALVINGS, MAX_SUPERSAMPLING = 6, 16
#: Pixels around what a crop shows that samples may need for interpolation.
REACH_PX = 2
#: Where a crop is mapped to the photo exactly, from -1 at one edge to 1 at the other: extrema of
#: a Chebyshev polynomial, between which interpolation does not oscillate.
NODES = -np.cos(np.pi * np.arange(7) / 6)
SQUARE = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]], np.float32)


def crops(
    photo: npt.NDArray[Any], outlines: Sequence[Outline], pose: PanelPose | None = None
) -> Pixels:
    """Cut buttons or plates out of a photo, upright and head-on, for the label reader.

    A crop shows the upright box around its outline on the panel, enlarged by 1.06 about its
    centre and brought to 48 x 48 pixels (wide buttons are squeezed). Without a pose, and
    where the pose or the lens model does not reach the box, a quad is straightened by its own
    corners, and of an ellipse the box in the photo is taken.

    Parameters
    ----------
    photo
        Shape (h, w, 3), uint8, RGB, or another array that `fronto.images.as_rgb` takes.
    outlines
        Of buttons or plates, in the photo's pixels as it is (lens distortion and all).
    pose
        The panel's; used where it is "ok" or "uncertain".

    Returns
    -------
    Shape (n, 48, 48, 3), uint8, RGB, read-only. Beyond the photo's border its edge pixels go on.

    Raises
    ------
    InputError
        If the photo is no array of pixels, or of another size than the pose's camera.
    """
    if not isinstance(photo, np.ndarray):
        raise InputError(
            "photo",
            f"expected an array of shape (h, w, 3), got {type(photo).__name__}",
            "fronto.images.as_rgb reads files and Pillow images",
        )
    pixels = as_rgb(photo)
    if pose is not None and pose.status not in ("ok", "uncertain"):
        pose = None
    _check_size(pixels, pose)
    cut = np.empty((len(outlines), CROP_PX, CROP_PX, 3), np.uint8)
    if outlines:
        for k, sampling in enumerate(_samplings(outlines, pose, pixels)):
            cut[k] = sampling.run(pixels)
    cut.setflags(write=False)
    return cut


@dataclass(frozen=True, eq=False)
class _Sampling:
    """How one crop is taken from the photo.

    Parameters
    ----------
    low, high
        x, y of the part of the photo that it needs: low included, high not.
    halvings
        How often this part is halved before it is sampled.
    counts
        Samples for each of the crop's pixels, along x and y.
    matrix
        Shape (3, 3): sample -> pixel of the halved part, without the lens.
    nodes
        Shape (2, 7, 7): x and y of the `NODES` in the halved part, where a lens bends the crop.
    """

    low: list[int]
    high: list[int]
    halvings: int
    counts: list[int]
    matrix: FloatArray
    nodes: FloatArray | None

    def run(self, pixels: Pixels) -> npt.NDArray[Any]:
        """Take the crop (48, 48, 3)."""
        import cv2

        nx, ny = self.counts
        part = self._part(pixels)
        if self.nodes is None:
            samples = cv2.warpPerspective(
                part,
                self.matrix,
                (nx * CROP_PX, ny * CROP_PX),
                flags=cv2.INTER_LINEAR | cv2.WARP_INVERSE_MAP,
                borderMode=cv2.BORDER_REPLICATE,
            )
        else:
            x, y = (_basis(ny) @ self.nodes @ _basis(nx).T).astype(np.float32)
            samples = cv2.remap(part, x, y, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        if nx * ny > 1:
            samples = cv2.resize(samples, (CROP_PX, CROP_PX), interpolation=cv2.INTER_AREA)
        return samples

    def _part(self, pixels: Pixels) -> npt.NDArray[Any]:
        import cv2

        part: npt.NDArray[Any] = pixels[self.low[1] : self.high[1], self.low[0] : self.high[0]]
        factor = 2**self.halvings
        below, right = -part.shape[0] % factor, -part.shape[1] % factor
        if below or right:  # at the photo's border
            part = cv2.copyMakeBorder(part, 0, below, 0, right, cv2.BORDER_REPLICATE)
        for _ in range(self.halvings):
            half = (part.shape[1] // 2, part.shape[0] // 2)
            part = cv2.resize(part, half, interpolation=cv2.INTER_AREA)
        return part


def _check_size(pixels: Pixels, pose: PanelPose | None) -> None:
    size = (pixels.shape[1], pixels.shape[0])
    if pose is not None and size != (pose.camera.width_px, pose.camera.height_px):
        raise InputError(
            "photo",
            f"expected the size of the pose's camera, {pose.camera.width_px}x"
            f"{pose.camera.height_px}, got {size[0]}x{size[1]}",
            "give the photo that the panel was found in, upright and not scaled",
        )


def _samplings(
    outlines: Sequence[Outline], pose: PanelPose | None, pixels: Pixels
) -> Iterator[_Sampling]:
    matrices, places, curved = _into_photo(outlines, pose)
    spacing = _spacing(places)
    halvings = np.log2(np.clip(spacing.min(axis=1), 1, 2**MAX_HALVINGS)).astype(int)
    factors = 2**halvings
    spacing /= factors[:, None]
    counts = np.minimum(np.ceil(spacing - 1e-6), MAX_SUPERSAMPLING).astype(int)
    counts[spacing <= NEAR_ONE] = 1

    size = np.array([pixels.shape[1], pixels.shape[0]])
    reach = REACH_PX * factors[:, None]
    low = np.clip(np.floor(places.min(axis=(1, 2))) - reach, 0, size - 1).astype(int)
    high = np.clip(np.ceil(places.max(axis=(1, 2))) + reach + 1, low + 1, size).astype(int)
    # Sides that can be halved: most parts need no padding then, and no copy.
    high = np.minimum(high + (low - high) % factors[:, None], size)

    # The centre of the photo's first pixel is at 0, and so are those of part, crop and samples.
    shift = (0.5 - low) / factors[:, None] - 0.5
    to_part = _scalings(1 / factors[:, None], shift)
    total = to_part @ matrices @ _scalings(1 / counts, 0.5 / counts - 0.5)
    nodes = np.moveaxis(places / factors[:, None, None, None] + shift[:, None, None], 3, 1)
    for k in range(len(outlines)):
        yield _Sampling(
            low[k].tolist(),
            high[k].tolist(),
            int(halvings[k]),
            counts[k].tolist(),
            total[k],
            nodes[k] if curved[k] else None,
        )


def _scalings(factors: FloatArray, shifts: FloatArray) -> FloatArray:
    """Matrices (n, 3, 3) that scale x and y by factors (n, 2) or (n, 1), then shift by (n, 2)."""
    matrices = np.zeros((len(shifts), 3, 3))
    matrices[:, [0, 1], [0, 1]] = factors
    matrices[:, :2, 2] = shifts
    matrices[:, 2, 2] = 1
    return matrices


def _into_photo(
    outlines: Sequence[Outline], pose: PanelPose | None
) -> tuple[FloatArray, FloatArray, npt.NDArray[np.bool_]]:
    """How crops are mapped to the photo.

    Returns
    -------
    Homographies (n, 3, 3) from a crop's pixels to the photo's, undistorted ones where the last
    says so; the photo's pixels (n, 7, 7, 2) at the `NODES`, lens included; and for which a lens
    bends the crop (n,).
    """
    curved = np.full(len(outlines), pose is not None and pose.camera.distorted)
    if pose is None:
        matrices = np.stack([_by_outline(outline) for outline in outlines])
        places = _at_nodes(matrices)
    else:
        back = pose.camera.matrix @ pose.rotation.T
        matrices = back @ _onto_boxes(panel_boxes(outlines, pose))
        places = _at_nodes(matrices)
        if pose.camera.distorted:
            places = pose.camera.distort_points(places.reshape(-1, 2)).reshape(places.shape)
    for way in (_by_outline, _by_box):
        for k in np.flatnonzero(~np.isfinite(places).all(axis=(1, 2, 3))).tolist():
            matrices[k], curved[k] = way(outlines[k]), False
            places[k] = _at_nodes(matrices[k : k + 1])[0]
    return matrices, places, curved


def _by_outline(outline: Outline) -> FloatArray:
    """Crop pixel -> photo pixel (3, 3) by a quad's corners, or an ellipse's box."""
    import cv2

    if outline.corners_px is None:
        return _by_box(outline)
    # About the middle, since OpenCV takes single precision.
    middle = outline.corners_px.mean(axis=0)
    corners = (outline.corners_px - middle).astype(np.float32)
    matrix = np.array(cv2.getPerspectiveTransform(SQUARE, corners), dtype=np.float64)
    matrix[:2] += np.outer(middle, matrix[2])
    return np.asarray(matrix @ _onto_boxes(np.array([[-1.0, -1, 1, 1]]))[0])


def _by_box(outline: Outline) -> FloatArray:
    """Crop pixel -> photo pixel (3, 3) by the box around the outline in the photo."""
    return np.asarray(_onto_boxes(np.array([outline.box_px]))[0])


def _onto_boxes(boxes: FloatArray) -> FloatArray:
    """Crop pixel -> point of the plane (n, 3, 3) that boxes x0, y0, x1, y1 (n, 4) lie on."""
    scales = CROP_SCALE / CROP_PX * (boxes[:, 2:] - boxes[:, :2])
    return _scalings(scales, (boxes[:, :2] + boxes[:, 2:] - (CROP_PX - 1) * scales) / 2)


def _at_nodes(matrices: FloatArray) -> FloatArray:
    """Where crops (n, 3, 3) have their nodes (n, 7, 7, 2), y first; NaN behind the horizon."""
    along = (CROP_PX * NODES + CROP_PX - 1) / 2
    x, y = np.meshgrid(along, along)
    points = np.stack([x.ravel(), y.ravel(), np.ones(x.size)])
    mapped = matrices @ points
    w = np.where(mapped[:, 2] > 0, mapped[:, 2], np.nan)
    flat = np.swapaxes(mapped[:, :2] / w[:, None], 1, 2)
    return np.asarray(flat.reshape(-1, len(NODES), len(NODES), 2))


def _spacing(places: FloatArray) -> FloatArray:
    """The photo's pixels for each of the crop's, along x and y, where they are most: (n, 2)."""
    step = np.diff(NODES) * CROP_PX / 2
    along_y, along_x = np.diff(places, axis=1), np.diff(places, axis=2)
    return np.stack(
        [
            (np.hypot(along_x[..., 0], along_x[..., 1]) / step).max(axis=(1, 2)),
            (np.hypot(along_y[..., 0], along_y[..., 1]) / step[:, None]).max(axis=(1, 2)),
        ],
        axis=1,
    )


@cache
def _basis(count: int) -> FloatArray:
    """What each node has in each of a crop's samples, `count` a pixel: (48 count, 7).

    The polynomial through the nodes. Positions through a lens with strong distortion are right
    to 2e-6 pixels in a button 90 pixels wide, and to 0.002 in one of 220.
    """
    from numpy.polynomial.chebyshev import chebvander

    at = (2 * np.arange(count * CROP_PX) + 1) / (count * CROP_PX) - 1
    degree = len(NODES) - 1
    basis = np.asarray(chebvander(at, degree) @ np.linalg.inv(chebvander(NODES, degree)))
    basis.setflags(write=False)
    return basis
