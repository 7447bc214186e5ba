"""Ten thousand random and adversarial masks: no exception, no warning, finite numbers."""

import numpy as np
import pytest

from fronto import InputError, Segment, Segments, outline
from fronto.outlines.edges import edge_points
from fronto.outlines.kinds import find_shapes
from fronto.outlines.subpixel import refine

WIDTH, HEIGHT, GROUP = 48, 40, 40
MASKS = 10_000
CATEGORIES = ("up", "number", "plate", "other")


def empty(rng, h, w):
    return np.full((h, w), rng.choice([0, 0.3, 0.5]))


def full(rng, h, w):
    return np.full((h, w), rng.choice([0.51, 1]))


def specks(rng, h, w):
    return rng.random((h, w)) < rng.uniform(0.001, 0.3)


def noise(rng, h, w):
    return rng.random((h, w))


def few_values(rng, h, w):
    return rng.choice([0, 0.5, np.nextafter(np.float32(0.5), np.float32(1)), 1], (h, w))


def checkers(rng, h, w):
    y, x = np.mgrid[:h, :w] // rng.integers(1, 4)
    return (x + y) % 2


def stripes(rng, h, w):
    y, x = np.mgrid[:h, :w]
    return (x * rng.integers(0, 3) + y * rng.integers(0, 3)) % rng.integers(2, 6) == 0


def comb(rng, h, w):
    mask = np.zeros((h, w))
    mask[:, :: rng.integers(2, 5)] = 1
    mask[: rng.integers(1, 4)] = 1
    return np.rot90(mask, 2 * rng.integers(2))


def spiral(rng, h, w):
    y, x = np.mgrid[:h, :w] - np.array([h, w])[:, None, None] / 2
    turn = np.arctan2(y, x) / (2 * np.pi)
    return (np.hypot(x, y) / rng.uniform(3, 8) - turn) % 1 < rng.uniform(0.2, 0.8)


def ring(rng, h, w):
    y, x = np.mgrid[:h, :w] - rng.uniform(0, 1, 2)[:, None, None] * [[[h]], [[w]]]
    r = np.hypot(x, y) / rng.uniform(2, 15)
    return (r < 1) & (r > rng.uniform(0, 1))


def box(rng, h, w):
    mask = np.zeros((h, w))
    y, x = np.sort(rng.integers(0, h + 1, 2)), np.sort(rng.integers(0, w + 1, 2))
    mask[y[0] : y[1], x[0] : x[1]] = rng.choice([0.501, 0.7, 1])
    return mask


def line(rng, h, w):
    y, x = np.mgrid[:h, :w]
    a, b = rng.normal(0, 1, 2)
    return np.abs(a * (x - w / 2) + b * (y - h / 2)) < rng.uniform(0.3, 1.5)


def blob(rng, h, w):
    import cv2

    return cv2.GaussianBlur(
        rng.random((h, w)), (0, 0), rng.uniform(0.8, 3), borderType=cv2.BORDER_REFLECT
    )


def half_plane(rng, h, w):
    y, x = np.mgrid[:h, :w]
    slope = rng.normal(0, 1, 2)
    return np.clip(
        0.5 + (slope[0] * (x - w / 2) + slope[1] * (y - h / 2)) / rng.uniform(1, 20), 0, 1
    )


def two(rng, h, w):
    return np.maximum(box(rng, h, w), ring(rng, h, w))


MAKERS = (
    empty, full, specks, noise, few_values, checkers, stripes, comb, spiral, ring, box, line, blob,
    half_plane, two,
)  # fmt: skip


def segment(rng):
    """A mask somewhere in the photo, often at its border, of any shape from 1x1 on."""
    h, w = rng.integers(1, HEIGHT + 1), rng.integers(1, WIDTH + 1)
    if rng.random() < 0.1:
        h, w = rng.choice([[1, w], [h, 1], [1, 1], [2, 2], [HEIGHT, WIDTH]])
    x, y = rng.integers(0, WIDTH - w + 1), rng.integers(0, HEIGHT - h + 1)
    probability = np.asarray(rng.choice(MAKERS)(rng, h, w), np.float32)
    edges = (x - 0.5, y - 0.5, x + w - 0.5, y + h - 0.5)
    return Segment(rng.choice(CATEGORIES), 0.5, edges, (int(x), int(y)), probability)


def check(found, count):
    both = (*found.buttons, *found.plates)
    assert len(both) <= count
    assert len(found.buttons) == len(found.from_image)
    for o in both:  # that quads are convex and ordered, `Outline` itself checks
        assert np.isfinite([o.std_px, o.shape_confidence, *o.box_px]).all()
        assert o.std_px > 0
        assert 0 <= o.shape_confidence <= 1
    assert all(0 <= share <= 1 for share in found.from_image)
    for k in found.lines:
        assert np.isfinite(k.ends_px).all()


@pytest.mark.parametrize("part", range(5))
def test_ten_thousand_masks(part):
    rng = np.random.default_rng(part)
    outlined = 0
    for group in range(MASKS // GROUP // 5):
        segments = Segments(WIDTH, HEIGHT, tuple(segment(rng) for _ in range(GROUP)))
        photo = None
        if group % 2:
            photo = rng.integers(0, 256, (HEIGHT, WIDTH, 3)).astype(np.uint8)
        fine = outline(segments, photo)
        check(fine, GROUP)
        check(outline(segments, photo, corners="hough"), GROUP)
        outlined += len(fine.buttons)
    assert outlined > 200  # not all of them are refused


@pytest.mark.parametrize("make", MAKERS)
def test_one_mask_alone(make):
    rng = np.random.default_rng(7)
    for h, w in [(1, 1), (1, 40), (40, 1), (2, 3), (7, 7), (HEIGHT, WIDTH)]:
        probability = np.asarray(make(rng, h, w), np.float32)
        alone = Segment("up", 1.0, (0, 0, w, h), (0, 0), probability)
        segments = Segments(WIDTH, HEIGHT, (alone,))
        for way in ("subpixel", "hough"):
            found = outline(segments, np.zeros((HEIGHT, WIDTH), np.uint8), corners=way)
            check(found, 1)
            assert len(found.buttons) + len(found.left_out) == 1


def test_thousands_of_specks_in_a_large_mask():
    rng = np.random.default_rng(8)
    mask = np.zeros((1, 300, 400), bool)
    mask[0, ::4, ::5] = True
    mask[0, 100:130, 100:140] = True
    found = outline(Segments.from_masks(mask | (rng.random(mask.shape) < 0.02)))
    check(found, 1)


def test_many_small_masks_at_once():
    rng = np.random.default_rng(9)
    masks = []
    for _ in range(1500):
        x, y = rng.integers(0, WIDTH - 4), rng.integers(0, HEIGHT - 4)
        probability = (rng.random((4, 4)) < 0.8).astype(np.float32)
        masks.append(Segment("up", 1.0, (x, y, x + 3, y + 3), (int(x), int(y)), probability))
    found = outline(Segments(WIDTH, HEIGHT, tuple(masks)))
    check(found, 1500)
    assert len(found.buttons) + len(found.left_out) == 1500


@pytest.mark.parametrize("shape", [(1, 1, 3), (2, 3, 3), (1, 40, 1), (16, 16, 3)])
def test_photos_of_a_few_pixels(shape):
    rng = np.random.default_rng(10)
    segments = tuple(segment(rng) for _ in range(GROUP))
    points = edge_points(segments, WIDTH, HEIGHT)
    shapes = find_shapes(points)
    found = refine(rng.integers(0, 256, shape).astype(np.uint8), shapes, points.size, points.blur)
    assert found.lines.shape == (GROUP, 4, 3)
    assert found.shape.shape == (GROUP, 5)
    assert not found.from_image[points.size < 6].any()


@pytest.mark.parametrize("shape", [(1, 1), (2, 3), (1, 1, 3), (2, 3, 3)])
def test_such_photos_are_refused_by_name(shape):
    mask = Segment("up", 1.0, (-0.5, -0.5, 0.5, 0.5), (0, 0), np.ones((1, 1), np.float32))
    with pytest.raises(InputError) as caught:
        outline(Segments(shape[1], shape[0], (mask,)), np.zeros(shape, np.uint8))
    assert caught.value.thing == "image"
