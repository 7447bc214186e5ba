"""What is printed on finds, as far as their categories go: the label reader's word on them.

The network sees a label as a few cells; the reader sees 48 x 48 pixels of it. It tells an arrow
from a bell better, and prints from blanks. Which text it is, is told later, on the head-on view
(`fronto.labels`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from fronto.categories import CATEGORIES
from fronto.finds import Find
from fronto.labels.alphabet import CROP_PX, CROP_SCALE
from fronto.patches import photo_patch, region
from fronto.shapes import FloatArray

if TYPE_CHECKING:
    from fronto.engine import ReaderEngine

__all__ = ["Prints", "named", "read_prints"]

#: Kinds of what is read, and the category of a button that shows it.
CATEGORY = {
    "text": "number",
    "up": "up",
    "down": "down",
    "open": "open",
    "close": "close",
    "alarm": "alarm",
    "stop": "stop",
    "keyhole": "keyhole",
}
#: Crops in one call: what memory there is sets no limit to the number of finds.
AT_ONCE = 64
#: No category is less probable to the network than this.
FLOOR = 0.05


@dataclass(frozen=True, eq=False)
class Prints:
    """What is read on N finds.

    Parameters
    ----------
    categories
        Shape (N, 9): probability that it shows what buttons of each category do; the categories
        between background and plate, in the order of `CATEGORIES`. What is left to 1 shows
        nothing of that: it is blank, or cannot be read.
    """

    categories: FloatArray

    @property
    def keyholes(self) -> FloatArray:
        """Shape (N,): probability of being a keyhole."""
        return np.asarray(self.categories[:, CATEGORIES.index("keyhole") - 1])

    @property
    def printed(self) -> FloatArray:
        """Shape (N,): probability of bearing a print."""
        return np.asarray(self.categories.sum(axis=1) - self.keyholes)


def read_prints(finds: Sequence[Find], rgb: npt.NDArray[np.uint8], reader: ReaderEngine) -> Prints:
    """Read finds, one or more, where they are in the photo (h, w, 3), uint8, RGB."""
    parts = [region(find.box, CROP_SCALE) for find in finds]
    crops = np.stack([photo_patch(rgb, part, CROP_PX) for part in parts])
    kinds = np.concatenate(
        [reader.run(crops[k : k + AT_ONCE]).kind for k in range(0, len(crops), AT_ONCE)]
    )
    categories = np.zeros((len(finds), len(CATEGORIES) - 2))
    for kind, category in CATEGORY.items():
        categories[:, CATEGORIES.index(category) - 1] += kinds[:, reader.kinds.index(kind)]
    return Prints(categories)


def named(finds: Sequence[Find], prints: Prints) -> list[Find]:
    """Finds with the category that is likeliest by their looks and by their prints.

    Of a blank button, or one that cannot be read, the looks decide: those of a plate beside it,
    say. Plates stay plates.
    """
    result = []
    for find, read in zip(finds, prints.categories, strict=True):
        scores = find.instance.scores.copy()
        total = float(scores[1:-1].sum())
        if find.instance.plate or total <= 0:
            result.append(find)
            continue
        looks = scores[1:-1] / total
        both = np.maximum(looks, FLOOR) * (read + max(1 - float(read.sum()), 0.0) * looks)
        scores[1:-1] = total * both / both.sum()
        category = CATEGORIES[1 + int(np.argmax(both))]
        instance = replace(find.instance, scores=scores)
        result.append(replace(find, instance=instance, category=category))
    return result
