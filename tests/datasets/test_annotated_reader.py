"""The project's own annotations: quads and ellipses as polygons, unsure ones ignored."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image

from fronto.datasets.annotated import read_annotated
from fronto.datasets.opening import open_dataset
from fronto.errors import InputError

CORNERS = [[10, 10], [20, 11], [20.5, 19], [9, 20]]
QUAD = {"shape": "quad", "corners": CORNERS, "category": "number", "text": "4"}
ELLIPSE = {"cx": 30, "cy": 20, "a": 8, "b": 4, "angle_deg": 90}


def annotated(folder: Path, *buttons: dict[str, Any], width: int = 60) -> Path:
    for name in ("images", "labels"):
        (folder / name).mkdir()
    Image.new("RGB", (60, 40)).save(folder / "images" / "a.jpg")
    values = {"image": "a.jpg", "width": width, "height": 40, "buttons": list(buttons)}
    (folder / "labels" / "a.json").write_text(json.dumps(values))
    return folder


def test_by_hand(tmp_path: Path) -> None:
    ellipse = {"shape": "ellipse", "ellipse": ELLIPSE, "category": "open", "text": ""}
    annotated(tmp_path, {**QUAD, "truncated": True, "odd": True}, {**ellipse, "unsure": True})
    (image,) = open_dataset(tmp_path)
    assert (image.path.name, image.width, image.height) == ("a.jpg", 60, 40)
    quad, other = image.objects
    assert quad.polygon is not None
    assert quad.polygon.tolist() == CORNERS
    assert quad.box == (9, 10, 20.5, 20)
    assert (quad.category, quad.text, quad.ignore, quad.truncated) == ("number", "4", False, True)
    assert other.polygon is not None
    assert other.polygon.shape == (72, 2)
    np.testing.assert_allclose(other.box, (26, 12, 34, 28))
    assert (other.category, other.text, other.ignore) == ("open", "", True)


@pytest.mark.parametrize(
    "button",
    [
        {**QUAD, "shape": "ellipse"},
        {**QUAD, "corners": CORNERS[:3]},
        {**QUAD, "corners": CORNERS[::-1]},
        {**QUAD, "category": "led"},
        {**QUAD, "shape": "circle"},
        {"shape": "ellipse", "category": "up", "ellipse": {**ELLIPSE, "a": 2}},
    ],
)
def test_wrong_ones(tmp_path: Path, button: dict[str, Any]) -> None:
    annotated(tmp_path, QUAD, button)
    with pytest.raises(InputError, match=r"a\.json.*buttons\[1\]"):
        read_annotated(tmp_path)


def test_another_size(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"a\.json.*60x40"):
        read_annotated(annotated(tmp_path, QUAD, width=40))


def test_the_annotated_photos() -> None:
    folder = Path(__file__).parents[3] / "shared/data/annotated"
    if not folder.is_dir():
        pytest.skip("the annotated photos are not here")
    images = open_dataset(folder)
    items = [item for image in images for item in image.objects]
    assert len(images) == 20
    assert len(items) == 202
    assert sum(item.polygon is not None and len(item.polygon) == 72 for item in items) == 105
    assert sum(item.ignore for item in items) == 26
