"""What segmentation hands on: one mask per button or plate, with its category."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt

from fronto.categories import CATEGORIES, PLATE
from fronto.errors import InputError

__all__ = ["Segment", "Segments"]

FloatMask = npt.NDArray[np.float32]
#: Quad, ellipse, another shape.
FORMS = 3


@dataclass(frozen=True, eq=False)
class Segment:
    """One button or plate in a photo.

    Parameters
    ----------
    category
        A name of `fronto.categories.CATEGORIES` except "background".
    confidence
        How sure it is that something of this kind is there, 0 to 1.
    box_px
        Edges x0, y0, x1, y1 in the photo (pixel centres at whole numbers, so the box of
        pixels 3 to 7 is 2.5 to 7.5). It may be larger than the mask: around a button and a
        ring, or the label beside it, which is then a plate of its own.
    origin_px
        Column and row in the photo of the probability's top-left pixel.
    probability
        Shape (h, w), float32: that a pixel belongs to it; read-only. The mask is where it
        is above one half, and the outline runs where it would be exactly that.
    scores
        Probability of each category, in the order of `CATEGORIES`; () where unknown.
    truncated
        Whether it touches the photo's border.
    forms
        Probability of being a quad, an ellipse, another shape (`fronto.maskhead.FORMS`), as a
        mask head sees it; () where nobody has told.

    Raises
    ------
    InputError
        If the category is none, or the shapes of the arrays or of `forms` do not fit.
    """

    category: str
    confidence: float
    box_px: tuple[float, float, float, float]
    origin_px: tuple[int, int]
    probability: FloatMask
    scores: tuple[float, ...] = ()
    truncated: bool = False
    forms: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if self.category not in CATEGORIES[1:]:
            expected = ", ".join(CATEGORIES[1:])
            raise InputError("category", f"expected one of {expected}, got {self.category!r}")
        probability = np.array(self.probability, dtype=np.float32)
        if probability.ndim != 2 or probability.size == 0:
            raise InputError(
                "probability", f"expected an array (h, w), got shape {probability.shape}"
            )
        if not np.isfinite(probability).all():
            raise InputError("probability", "expected finite numbers, got NaN or infinity")
        if self.forms and len(self.forms) != FORMS:
            raise InputError("forms", f"expected {FORMS} probabilities, got {len(self.forms)}")
        probability.setflags(write=False)
        object.__setattr__(self, "probability", probability)

    @property
    def mask(self) -> npt.NDArray[np.bool_]:
        """Shape (h, w): the pixels that belong to it, from `origin_px` on."""
        return self.probability > 0.5

    @property
    def is_button(self) -> bool:
        """Whether it can be pressed; plates cannot."""
        return self.category != PLATE

    @property
    def center_px(self) -> tuple[float, float]:
        """The box's centre in the photo."""
        x0, y0, x1, y1 = self.box_px
        return (x0 + x1) / 2, (y0 + y1) / 2


@dataclass(frozen=True, eq=False)
class Segments:
    """The buttons and plates of one photo, surest first.

    Parameters
    ----------
    width_px, height_px
        The photo's size.
    segments
        What was found.
    notes
        Remarks: on the photo's scale, say.
    timing_ms
        Milliseconds of each step.
    """

    width_px: int
    height_px: int
    segments: tuple[Segment, ...]
    notes: tuple[str, ...] = ()
    timing_ms: dict[str, float] = field(default_factory=dict)

    def __iter__(self) -> Iterator[Segment]:
        return iter(self.segments)

    def __len__(self) -> int:
        return len(self.segments)

    @property
    def buttons(self) -> tuple[Segment, ...]:
        """What can be pressed."""
        return tuple(s for s in self.segments if s.is_button)

    @property
    def plates(self) -> tuple[Segment, ...]:
        """Labels beside buttons, which nobody presses."""
        return tuple(s for s in self.segments if not s.is_button)

    def instance_map(self) -> npt.NDArray[np.int32]:
        """Shape (height_px, width_px): 1 + index of the segment at each pixel, 0 = none."""
        result = np.zeros((self.height_px, self.width_px), np.int32)
        for k in reversed(range(len(self.segments))):
            x, y = self.segments[k].origin_px
            mask = self.segments[k].mask
            result[y : y + mask.shape[0], x : x + mask.shape[1]][mask] = k + 1
        return result

    def category_map(self) -> npt.NDArray[np.uint8]:
        """Shape (height_px, width_px): index into `CATEGORIES` of each pixel."""
        numbers = [0, *(CATEGORIES.index(s.category) for s in self.segments)]
        return np.asarray(np.array(numbers, np.uint8)[self.instance_map()])

    @classmethod
    def from_masks(
        cls,
        masks: npt.ArrayLike | Sequence[npt.ArrayLike],
        categories: Sequence[str] | None = None,
    ) -> Segments:
        """Segments from somebody else's masks.

        Parameters
        ----------
        masks
            Shape (n, height, width): one mask per button, bool or probabilities 0 to 1.
        categories
            Category of each; None: all "other".

        Raises
        ------
        InputError
            If shapes or values do not fit; masks without a pixel are refused, too.
        """
        array = np.asarray(masks)
        if array.ndim != 3 or array.dtype.kind not in "bf":
            raise InputError(
                "masks",
                "expected an array (n, height, width) of bool or of probabilities, got "
                f"{array.dtype} of shape {array.shape}",
                "compare your label image with each label: labels[None] == ids[:, None, None]",
            )
        names = ["other"] * len(array) if categories is None else list(categories)
        if len(names) != len(array):
            raise InputError("categories", f"expected {len(array)} names, got {len(names)}")
        height, width = array.shape[1:]
        found = tuple(
            cls._from_mask(k, mask.astype(np.float32), name)
            for k, (mask, name) in enumerate(zip(array, names, strict=True))
        )
        return cls(width, height, found)

    @staticmethod
    def _from_mask(index: int, probability: FloatMask, category: str) -> Segment:
        if not (np.isfinite(probability).all() and (abs(probability - 0.5) <= 0.5).all()):
            raise InputError(f"masks[{index}]", "expected probabilities from 0 to 1")
        inside = probability > 0.5
        rows, columns = np.flatnonzero(inside.any(axis=1)), np.flatnonzero(inside.any(axis=0))
        if len(rows) == 0:
            raise InputError(f"masks[{index}]", "expected a pixel above 0.5, got none")
        height, width = probability.shape
        y0, y1, x0, x1 = int(rows[0]), int(rows[-1]), int(columns[0]), int(columns[-1])
        top, left = max(0, y0 - 2), max(0, x0 - 2)
        return Segment(
            category,
            1.0,
            (x0 - 0.5, y0 - 0.5, x1 + 0.5, y1 + 0.5),
            (left, top),
            probability[top : y1 + 3, left : x1 + 3],
            truncated=x0 == 0 or y0 == 0 or x1 == width - 1 or y1 == height - 1,
        )
