"""Round and rectangular buttons told apart on drawn photos."""

from __future__ import annotations

from pathlib import Path

import cv2
import numpy as np
import pytest

from fronto.datasets.forms import with_forms
from fronto.datasets.records import LabeledImage, LabeledObject


def photo(folder: Path, shapes: str, *, stretch: float = 1.0) -> LabeledImage:
    """A row of buttons: o round, s rectangular, with a letter that has edges, too."""
    rng = np.random.default_rng(3)
    width, height = 60 * len(shapes) + 20, round(80 * stretch)
    image = np.full((height, width, 3), (90, 100, 110), np.uint8)
    objects = []
    for k, shape in enumerate(shapes):
        x, y, rx, ry = 45 + 60 * k, height // 2, 20, round(20 * stretch)
        if shape == "o":
            cv2.ellipse(image, (x, y), (rx, ry), 0, 0, 360, (180, 175, 170), -1, cv2.LINE_AA)
        else:
            cv2.rectangle(image, (x - rx, y - ry), (x + rx, y + ry), (180, 175, 170), -1)
        cv2.putText(image, "8", (x - 8, y + 8), cv2.FONT_HERSHEY_SIMPLEX, 0.8, (30, 30, 30), 2)
        box = (x - rx - 0.5, y - ry - 0.5, x + rx + 0.5, y + ry + 0.5)
        objects.append(LabeledObject("number", box, None, "8"))
    noisy = np.clip(image + rng.normal(0, 4, image.shape), 0, 255).astype(np.uint8)
    path = folder / f"{shapes}.png"
    cv2.imwrite(str(path), noisy)
    return LabeledImage(path, width, height, tuple(objects))


@pytest.mark.parametrize("stretch", [0.8, 1.0, 1.3])
@pytest.mark.parametrize(("shape", "form"), [("o", "round"), ("s", "square")])
def test_a_panel_of_one_kind(tmp_path: Path, shape: str, form: str, stretch: float) -> None:
    (found,) = with_forms([photo(tmp_path, 5 * shape, stretch=stretch)])
    assert [o.form for o in found.objects] == 5 * [form]


def test_the_odd_one_out_is_left_alone(tmp_path: Path) -> None:
    (found,) = with_forms([photo(tmp_path, "ooooos")])
    assert [o.form for o in found.objects] == 5 * ["round"] + [""]


def test_what_cannot_be_asked_is_left_alone(tmp_path: Path) -> None:
    image = photo(tmp_path, "ooo")
    outline = np.array([(25.0, 20.0), (65, 20), (65, 60), (25, 60)])
    objects = (
        LabeledObject("number", image.objects[0].box, outline, "8"),
        LabeledObject("plate", image.objects[1].box, None, "plate"),
        LabeledObject("number", (100.0, 20.0, 106.0, 26.0), None, "small"),
        LabeledObject("number", image.objects[2].box, None, "unsure", ignore=True),
        LabeledObject("number", (-5.0, 20.0, 35.0, 60.0), None, "cut"),
    )
    given = LabeledImage(image.path, image.width, image.height, objects)
    (found,) = with_forms([given])
    assert found is given
