"""Round trips through every format, and hand-written files of each."""

from __future__ import annotations

import base64
import json
import math
import tempfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from PIL import Image

from fronto.datasets.coco import read_coco, write_coco
from fronto.datasets.cvat import read_cvat, write_cvat
from fronto.datasets.labelme import read_labelme, write_labelme
from fronto.datasets.opening import open_dataset
from fronto.datasets.records import LABELS, LabeledImage, LabeledObject, polygon_box
from fronto.datasets.yolo import read_yolo, write_yolo
from fronto.errors import InputError

WIDTH, HEIGHT = 40, 30
Reader = Callable[..., list[LabeledImage]]


def photo(path: Path, width: int = WIDTH, height: int = HEIGHT) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    Image.new("RGB", (width, height)).save(path)
    return path


def write(path: Path, content: Any) -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
    return path


def refused(reader: Reader, path: Path, *words: str, split: str | None = None) -> None:
    with pytest.raises(InputError) as caught:
        reader(path, split)
    message = str(caught.value)
    assert "\n" not in message
    for word in words:
        assert word in message


@st.composite
def objects(draw: st.DrawFn) -> LabeledObject:
    """An object within the photo, its polygon convex."""
    x, y = draw(st.floats(0.5, 25)), draw(st.floats(0.5, 15))
    w, h = draw(st.floats(0.5, 12)), draw(st.floats(0.5, 12))
    polygon = None
    if draw(st.booleans()):
        t = np.sort([*draw(st.lists(st.floats(0, 1), max_size=6)), 0, 2, 4, 5])
        polygon = np.stack([x + w / 2 * (1 + np.cos(t)), y + h / 2 * (1 + np.sin(t))], axis=1)
    text = st.text(st.characters(codec="utf-8", exclude_categories=["C", "Z"]), max_size=4)
    return LabeledObject(
        draw(st.sampled_from(LABELS)),
        (x, y, x + w, y + h) if polygon is None else polygon_box(polygon),
        polygon,
        draw(text) or "name",
        draw(text),
        draw(st.booleans()),
        draw(st.booleans()),
    )


def same(found: LabeledObject, item: LabeledObject) -> None:
    assert found.category == item.category
    np.testing.assert_allclose(found.box, item.box, atol=1e-9)
    assert (found.polygon is None) == (item.polygon is None)
    if found.polygon is not None and item.polygon is not None:
        np.testing.assert_allclose(found.polygon, item.polygon, atol=1e-9)


@pytest.mark.parametrize(
    ("reader", "writer"),
    [(read_coco, write_coco), (read_labelme, write_labelme), (read_cvat, write_cvat)],
)
@settings(derandomize=True, deadline=None, max_examples=25)
@given(items=st.lists(objects(), max_size=4))
def test_round_trip(
    reader: Reader, writer: Callable[..., None], items: list[LabeledObject]
) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        paths = [photo(folder / "x" / "a.png"), photo(folder / "y" / "a.png")]
        images = [
            LabeledImage(paths[0], WIDTH, HEIGHT, tuple(items)),
            LabeledImage(paths[1], WIDTH, HEIGHT, ()),
        ]
        writer(images, folder / "out")
        for again in (reader(folder / "out"), open_dataset(folder / "out")):
            assert [(image.width, image.height) for image in again] == [(WIDTH, HEIGHT)] * 2
            first, second = sorted(again, key=lambda image: len(image.path.stem))
            assert first.path.is_file()
            assert second.objects == ()
            assert len(first.objects) == len(items)
            for found, item in zip(first.objects, items, strict=True):
                same(found, item)
                for field in ("name", "text", "ignore", "truncated"):
                    assert getattr(found, field) == getattr(item, field)
        with pytest.raises(InputError):
            writer(images, folder / "out")  # nothing is overwritten


@settings(derandomize=True, deadline=None, max_examples=25)
@given(items=st.lists(objects(), min_size=1, max_size=4), detect=st.booleans())
def test_round_trip_of_yolo(items: list[LabeledObject], detect: bool) -> None:
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        image = LabeledImage(photo(folder / "a.png"), WIDTH, HEIGHT, tuple(items))
        write_yolo([image], folder / "out", kind="detect" if detect else "segment")
        write_yolo([image], folder / "out", split="val", kind="segment")
        kept = [item for item in items if not item.ignore]
        (again,) = open_dataset(folder / "out", "train")
        assert [item.category for item in again.objects] == [item.category for item in kept]
        for found, item in zip(again.objects, kept, strict=True):
            assert found.polygon is None if detect else found.polygon is not None
            np.testing.assert_allclose(found.box, item.box, atol=1e-8)
            if item.polygon is not None and not detect:
                assert found.polygon is not None
                np.testing.assert_allclose(found.polygon, item.polygon, atol=1e-8)
        assert len(read_yolo(folder / "out")) == 2
        with pytest.raises(InputError):
            write_yolo([image], folder / "out", split="val")


def test_yolo_is_cut_at_the_border(tmp_path: Path) -> None:
    beyond = LabeledObject("up", (-5.5, 9.5, 9.5, 99.5), None, "up")
    outside = LabeledObject("up", (-9, -9, -3, -3), None, "up")
    image = LabeledImage(photo(tmp_path / "a.png"), WIDTH, HEIGHT, (beyond, outside))
    for kind in ("segment", "detect"):
        write_yolo([image], tmp_path / kind, kind=kind)
        ((found,),) = [image.objects for image in read_yolo(tmp_path / kind)]
        np.testing.assert_allclose(found.box, (-0.5, 9.5, 9.5, 29.5), atol=1e-9)
        for line in (tmp_path / kind / "labels/train/a.txt").read_text().splitlines():
            assert all(0 <= float(value) <= 1 for value in line.split()[1:])


# COCO


def coco(**change: Any) -> dict[str, Any]:
    annotation = {"id": 1, "image_id": 7, "category_id": 3, "bbox": [3, 4, 5, 6], "iscrowd": 0}
    annotation.update(change)
    return {
        "info": {"year": 2024},
        "images": [{"id": 7, "file_name": "a.png", "width": WIDTH, "height": HEIGHT}],
        "annotations": [annotation],
        "categories": [{"id": 3, "name": "B1"}, {"id": 4, "name": "led"}],
    }


def test_coco_by_hand(tmp_path: Path) -> None:
    photo(tmp_path / "a.png")
    path = tmp_path / "labels.json"
    ((found,),) = [image.objects for image in read_coco(write(path, coco()))]
    # The pixels 3..7 by 4..9.
    assert found.box == (2.5, 3.5, 7.5, 9.5)
    assert (found.category, found.name, found.text, found.polygon) == ("number", "B1", "B1", None)
    assert not found.ignore

    square = [3, 4, 8, 4, 8, 10, 3, 10]
    ((found,),) = [i.objects for i in read_coco(write(path, coco(segmentation=[square])))]
    assert found.polygon is not None
    assert found.polygon.tolist() == [[2.5, 3.5], [7.5, 3.5], [7.5, 9.5], [2.5, 9.5]]

    pieces = [square, [3, 14, 8, 14, 8, 20, 3, 20]]
    ((found,),) = [i.objects for i in read_coco(write(path, coco(segmentation=pieces)))]
    assert found.box == (2.5, 3.5, 7.5, 19.5)

    mask = np.zeros((HEIGHT, WIDTH), bool)
    mask[4:10, 3:8] = True
    flat = mask.T.ravel()
    edges = np.flatnonzero(np.diff(flat)) + 1
    counts = np.diff([0, *edges, flat.size]).tolist()
    for run_lengths in (counts, compressed(counts)):
        segmentation = {"size": [HEIGHT, WIDTH], "counts": run_lengths}
        write(path, coco(segmentation=segmentation, iscrowd=1, bbox=None))
        ((found,),) = [image.objects for image in read_coco(path)]
        assert found.box == (2.5, 3.5, 7.5, 9.5)
        assert found.ignore

    assert read_coco(write(path, coco(category_id=4)))[0].objects == ()


def compressed(counts: list[int]) -> str:
    """COCO's run lengths as a string, written here as its definition reads."""
    text = ""
    for index, count in enumerate(counts):
        value = count - counts[index - 2] if index > 2 else count
        more = True
        while more:
            bits, value = value & 31, value >> 5
            more = value != (-1 if bits & 16 else 0)
            text += chr(48 + bits + 32 * more)
    return text


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"image_id": 8}, ["annotations[0].image_id"]),
        ({"category_id": 8}, ["annotations[0].category_id"]),
        ({"bbox": [3, 4, 5]}, ["annotations[0].bbox"]),
        ({"bbox": [3, 4, 0, 6]}, ["annotations[0]", "box"]),
        ({"bbox": None}, ["annotations[0]", "bbox"]),
        ({"segmentation": [[1, 2, 3, 4]]}, ["annotations[0]", "segmentation"]),
        ({"segmentation": [[1, 2, 3, 4, 5, 6, 7]]}, ["annotations[0]", "segmentation"]),
        ({"segmentation": {"size": [3, 3], "counts": [9]}}, ["segmentation.size", "40"]),
        ({"segmentation": {"size": [30, 40], "counts": [9]}}, ["annotations[0]", "mask"]),
        ({"segmentation": {"size": [30, 40], "counts": "c2"}}, ["annotations[0]", "mask"]),
    ],
)
def test_wrong_coco(tmp_path: Path, change: dict[str, Any], words: list[str]) -> None:
    photo(tmp_path / "a.png")
    path = write(tmp_path / "labels.json", coco(**change))
    refused(read_coco, path, "labels.json", *words)


def test_coco_of_other_photos(tmp_path: Path) -> None:
    path = write(tmp_path / "labels.json", coco())
    refused(read_coco, path, "images[0]", "'a.png'")
    photo(tmp_path / "a.png", HEIGHT, WIDTH)
    refused(read_coco, path, "images[0]", "30x40", "40x30")
    values = coco()
    values["categories"][0]["name"] = "bicycle"
    photo(tmp_path / "a.png")
    refused(read_coco, write(path, values), "'bicycle'")
    refused(read_coco, write(path, '{"images": [], "annotations": [}'), "line 1", "column 32")


@pytest.mark.parametrize(
    ("train", "val", "photos"),
    [
        ("annotations/instances_train2017.json", "annotations/instances_val2017.json", "{}2017"),
        ("train/_annotations.coco.json", "valid/_annotations.coco.json", "{}"),
        ("train.json", "val.json", "images/{}"),
        ("annotations/train.json", "annotations/val.json", "images"),
    ],
)
def test_layouts_of_coco(tmp_path: Path, train: str, val: str, photos: str) -> None:
    second = "valid" if val.startswith("valid/") else "val"
    for labels, split in ((train, "train"), (val, second)):
        values = coco()
        values["images"][0]["file_name"] = f"{split}.png"
        write(tmp_path / labels, values)
        photo(tmp_path / photos.format(split) / f"{split}.png")
    assert [i.path.stem for i in open_dataset(tmp_path)] == ["train", second]
    assert [i.path.stem for i in open_dataset(tmp_path, "train")] == ["train"]
    for name in ("val", "valid", "validation"):
        assert [i.path.stem for i in open_dataset(tmp_path, name)] == [second]
    refused(read_coco, tmp_path, "'test'", split="test")
    assert [i.path.stem for i in open_dataset(tmp_path / train)] == ["train"]


# LabelMe


def labelme(*shapes: dict[str, Any]) -> dict[str, Any]:
    return {
        "version": "5.5.0", "flags": {}, "imagePath": "..\\a.png", "imageData": None,
        "imageHeight": HEIGHT, "imageWidth": WIDTH,
        "shapes": [{"label": "up", "flags": {}, "group_id": None, **shape} for shape in shapes],
    }  # fmt: skip


def png(mask: np.ndarray) -> str:
    return base64.b64encode(cv2.imencode(".png", mask.astype(np.uint8) * 255)[1]).decode()


def test_labelme_by_hand(tmp_path: Path) -> None:
    photo(tmp_path / "a.png")
    shapes = [
        {"shape_type": "rectangle", "points": [[8, 10], [3, 4]]},
        {"shape_type": "polygon", "points": [[3, 4], [8, 4], [8, 10]], "flags": {"ignore": True}},
        {"shape_type": "circle", "points": [[10, 12], [13, 16]], "flags": {"truncated": True}},
        {"shape_type": "mask", "points": [[3, 4], [7, 9]], "mask": png(np.ones((6, 5)))},
        {"shape_type": "line", "points": [[3, 4], [7, 9]], "label": "light"},
    ]
    path = write(tmp_path / "labels" / "a.json", labelme(*shapes))
    (image,) = read_labelme(tmp_path)
    box, polygon, circle, mask = image.objects
    assert (box.box, box.polygon) == ((2.5, 3.5, 7.5, 9.5), None)
    assert polygon.polygon is not None
    assert polygon.polygon.tolist() == [[2.5, 3.5], [7.5, 3.5], [7.5, 9.5]]
    assert [item.ignore for item in image.objects] == [False, True, False, False]
    assert circle.truncated
    assert circle.polygon is not None
    assert circle.polygon.shape == (72, 2)
    np.testing.assert_allclose(np.hypot(*(circle.polygon - (9.5, 11.5)).T), 5)
    assert mask.box == (2.5, 3.5, 7.5, 9.5)
    assert open_dataset(path)[0].path == image.path


@pytest.mark.parametrize(
    "shape",
    [
        {"shape_type": "line", "points": [[3, 4], [8, 4]]},
        {"shape_type": "circle", "points": [[3, 4]]},
        {"shape_type": "circle", "points": [[3, 4], [3, 4]]},
        {"shape_type": "rectangle", "points": [[3, 4], [3, 4]]},
        {"shape_type": "polygon", "points": [[3, 4], [8, 4]]},
        {"shape_type": "polygon", "points": []},
        {"shape_type": "polygon", "points": [[3, 4, 5]]},
        {"shape_type": "mask", "points": [[3, 4], [7, 9]]},
        {"shape_type": "mask", "points": [[3, 4], [7, 9]], "mask": "abc"},
        {"shape_type": "mask", "points": [[3, 4], [7, 9]], "mask": "aGVsbG8="},
        {"shape_type": "mask", "points": [[3, 4], [7, 9]], "mask": png(np.zeros((3, 3)))},
    ],
)
def test_wrong_labelme(tmp_path: Path, shape: dict[str, Any]) -> None:
    photo(tmp_path / "a.png")
    good = {"shape_type": "rectangle", "points": [[8, 10], [3, 4]]}
    write(tmp_path / "labels" / "a.json", labelme(good, shape))
    refused(open_dataset, tmp_path, "a.json", "shapes[1]")


def test_labelme_of_another_size(tmp_path: Path) -> None:
    photo(tmp_path / "a.png", 41, 30)
    write(tmp_path / "labels" / "a.json", labelme())
    refused(read_labelme, tmp_path, "a.json", "imageWidth", "41x30")


# CVAT

CVAT = """<?xml version="1.0" encoding="utf-8"?>
<annotations><version>1.1</version>
<image id="0" name="set/a.png" width="40" height="30" subset="Train">{}</image>
<image id="1" name="b.png" width="40" height="30" subset="Validation"></image>
</annotations>"""


def cvat(folder: Path, shapes: str) -> Path:
    photo(folder / "images" / "set" / "a.png")
    photo(folder / "images" / "b.png")
    return write(folder / "annotations.xml", CVAT.format(shapes))


def test_cvat_by_hand(tmp_path: Path) -> None:
    cvat(
        tmp_path,
        """<tag label="hall"/>
        <box label="G" occluded="0" xtl="3.0" ytl="4.0" xbr="8.0" ybr="10.0" z_order="0">
          <attribute name="text">G</attribute><attribute name="ignore">true</attribute></box>
        <box label="up" xtl="10" ytl="10" xbr="20" ybr="14" rotation="90.0"/>
        <polygon label="down" points="3.0,4.0;8.0,4.0;8.0,10.0"/>
        <ellipse label="alarm" cx="10.5" cy="12.5" rx="3" ry="6" rotation="90"/>
        <mask label="stop" rle="2, 4, 6" left="3" top="4" width="4" height="3"/>
        <polyline label="indicator" points="1,2;3,4"/>""",
    )
    image, empty = open_dataset(tmp_path)
    assert empty.objects == ()
    box, turned, polygon, ellipse, mask = image.objects
    assert (box.box, box.category, box.text, box.ignore) == (
        (2.5, 3.5, 7.5, 9.5),
        "number",
        "G",
        True,
    )
    assert box.polygon is None
    np.testing.assert_allclose(turned.box, (12.5, 6.5, 16.5, 16.5))
    assert turned.polygon is not None
    # Clockwise: what was its upper left corner is now at the right.
    np.testing.assert_allclose(turned.polygon[0], (16.5, 6.5))
    assert polygon.box == (2.5, 3.5, 7.5, 9.5)
    np.testing.assert_allclose(ellipse.box, (4, 9, 16, 15))
    # Rows of four: pixels 2, 3 of the first and 0, 1 of the second.
    assert mask.box == (2.5, 3.5, 6.5, 5.5)
    assert [i.path.name for i in read_cvat(tmp_path, "train")] == ["a.png"]
    assert [i.path.name for i in open_dataset(tmp_path / "annotations.xml", "val")] == ["b.png"]
    refused(read_cvat, tmp_path, "'test'", split="test")


@pytest.mark.parametrize(
    ("shape", "word"),
    [
        ('<box label="up" xtl="1" ytl="2" xbr="3"/>', "ybr"),
        ('<box label="up" xtl="1" ytl="nan" xbr="3" ybr="4"/>', "ytl"),
        ('<box label="up" xtl="1" ytl="2" xbr="1" ybr="4"/>', "box"),
        ('<polygon label="up" points="1,2;3,4"/>', "polygon"),
        ('<polygon label="up"/>', "polygon"),
        ('<polygon label="up" points="1,2;3,4;5,x"/>', "points"),
        ('<polygon label="up" points="1,2;3,4;5"/>', "points"),
        ('<ellipse label="up" cx="1" cy="1" rx="0" ry="0"/>', "ellipse"),
        ('<mask label="up" rle="2,inf" left="0" top="0" width="2" height="2"/>', "rle"),
        ('<mask label="up" rle="2,1" left="0" top="0" width="2" height="2"/>', "mask"),
        ('<mask label="up" rle="2,1" left="0" top="0" width="2000000" height="2"/>', "mask"),
        ('<polyline label="up" points="1,2;3,4"/>', "polyline"),
    ],
)
def test_wrong_cvat(tmp_path: Path, shape: str, word: str) -> None:
    cvat(tmp_path, shape)
    refused(open_dataset, tmp_path, "annotations.xml", "set/a.png", word)


def test_cvat_refuses_entities_and_other_files(tmp_path: Path) -> None:
    path = cvat(tmp_path, "")
    bomb = '<!DOCTYPE a [<!ENTITY a "lol"><!ENTITY b "&a;&a;&a;">]><annotations>&b;</annotations>'
    refused(read_cvat, write(path, bomb), "DOCTYPE")
    refused(read_cvat, write(path, "<annotations><image></annotations>"), "line 1", "column")
    refused(read_cvat, write(path, "<annotations><track/></annotations>"), "tracks")
    refused(read_cvat, write(path, "<html/>"), "<html>")
    refused(read_cvat, write(path, '<annotations><image id="0"/></annotations>'), "name")


# YOLO


def test_yolo_by_hand(tmp_path: Path) -> None:
    photo(tmp_path / "images" / "a.png")
    photo(tmp_path / "images" / "empty.png")
    photo(tmp_path / "images" / "none.png")
    write(tmp_path / "data.yaml", "names: [up, 12, led]\nnc: 3\n")
    # The pixels 3..7 by 4..9 of 40 by 30, once as a box, once as a polygon.
    box = f"1 {5.5 / 40!r} {7 / 30!r} {5 / 40!r} {6 / 30!r}"
    polygon = f"0 {3 / 40!r} {4 / 30!r} {8 / 40!r} {4 / 30!r} {8 / 40!r} {10 / 30!r}"
    write(tmp_path / "labels" / "a.txt", f"{box}\n\n{polygon}\n2 0.5 0.5 0.1 0.1\n")
    write(tmp_path / "labels" / "empty.txt", "")
    image, *others = open_dataset(tmp_path)
    assert [other.objects for other in others] == [(), ()]
    first, second = image.objects
    np.testing.assert_allclose(first.box, (2.5, 3.5, 7.5, 9.5))
    assert (first.category, first.text, first.polygon) == ("number", "12", None)
    assert second.polygon is not None
    np.testing.assert_allclose(second.polygon, [[2.5, 3.5], [7.5, 3.5], [7.5, 9.5]])
    assert math.isclose(second.box[3], 9.5)


@pytest.mark.parametrize(
    ("layout", "names"),
    [
        ("{}/images", "names: {0: down, 1: up}"),
        ("images/{}", "names: [down, up]"),
        ("{}/images", "train: ../train/images\nval: ../valid/images\nnames: [down, up]"),
        ("images/{}", "path: .\ntrain: images/train\nval: [images/valid]\nnames: [down, up]"),
        ("images/{}", "train: train.txt\nval: valid.txt\nnames: [down, up]"),
        ("images/{}", "path: nowhere\ntrain: images/train\nval: images/valid\nnames: [down, up]"),
    ],
)
def test_layouts_of_yolo(tmp_path: Path, layout: str, names: str) -> None:
    write(tmp_path / "data.yaml", names)
    for split in ("train", "valid"):
        folder = layout.format(split)
        photo(tmp_path / folder / f"{split}.png")
        labels = folder.replace("images", "labels")
        write(tmp_path / labels / f"{split}.txt", "1 0.5 0.5 0.1 0.1")
        if "train.txt" in names:
            write(tmp_path / f"{split}.txt", f"./{folder}/{split}.png\n")
    for path in (tmp_path, tmp_path / "data.yaml"):
        assert [i.path.stem for i in open_dataset(path, "train")] == ["train"]
        assert [i.path.stem for i in open_dataset(path, "val")] == ["valid"]
        assert [i.path.stem for i in open_dataset(path, "valid")] == ["valid"]
        found = open_dataset(path)
        assert sorted(i.path.stem for i in found) == ["train", "valid"]
        assert [i.objects[0].category for i in found] == ["up", "up"]
        refused(read_yolo, path, "'test'", split="test")


def test_names_of_yolo_in_a_text_file_beside_the_labels(tmp_path: Path) -> None:
    photo(tmp_path / "a.png")
    write(tmp_path / "classes.txt", "down\nup\n")
    write(tmp_path / "a.txt", "1 0.5 0.5 0.1 0.1\n")
    assert [item.category for item in open_dataset(tmp_path)[0].objects] == ["up"]


@pytest.mark.parametrize(
    "line",
    ["2 0.5 0.5 0.1 0.1", "-1 0.5 0.5 0.1 0.1", "0.5 0.5 0.5 0.1 0.1", "0 0.5 0.5 0.1",
     "0 0.5 0.5 0.1 0.1 0.2", "0 0.5 0.5 0 0.1", "0 120 90 30 20", "0 nan 0.5 0.1 0.1",
     "up 0.5 0.5 0.1 0.1", "0"],
)  # fmt: skip
def test_wrong_yolo(tmp_path: Path, line: str) -> None:
    photo(tmp_path / "images" / "a.png")
    write(tmp_path / "data.yaml", "names: [up, down]")
    write(tmp_path / "labels" / "a.txt", f"0 0.5 0.5 0.1 0.1\n{line}\n")
    refused(open_dataset, tmp_path, "a.txt", "line 2")


@pytest.mark.parametrize(
    "content", ["names: up", "names: {a: up}", "[1, 2]", "names: [up", "a: \x01", "nc: 3"]
)
def test_wrong_names_of_yolo(tmp_path: Path, content: str) -> None:
    photo(tmp_path / "images" / "a.png")
    write(tmp_path / "data.yaml", content)
    write(tmp_path / "labels" / "a.txt", "0 0.5 0.5 0.1 0.1\n")
    refused(open_dataset, tmp_path, "data.yaml")


def test_yolo_without_labels(tmp_path: Path) -> None:
    photo(tmp_path / "images" / "a.png")
    write(tmp_path / "data.yaml", "names: [up, down]")
    refused(open_dataset, tmp_path, "no label file")


# Any


def test_nothing_there(tmp_path: Path) -> None:
    photo(tmp_path / "a.png")
    refused(open_dataset, tmp_path, "COCO", "LabelMe", "CVAT", "YOLO", "data.yaml")
    refused(open_dataset, tmp_path / "a.png", "COCO")
    refused(open_dataset, tmp_path / "none", "none")
    refused(open_dataset, write(tmp_path / "b.json", {"a": 1}), "COCO")
    refused(open_dataset, write(tmp_path / "c.json", [1, 2]), "COCO")
