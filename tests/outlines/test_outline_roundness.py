"""What blurred masks do not tell the photo tells: round or square, circle or pill."""

from __future__ import annotations

from collections import Counter

import cv2
import numpy as np
import pytest
from panelforms import circle, pill, quad, view
from panelmaker import panel

from fronto import Segment, Segments
from fronto.outlines.edges import edge_points
from fronto.outlines.kinds import find_shapes
from fronto.outlines.roundness import roundness

PLAIN = view()


def blob(made, other) -> Segments:
    """Masks half way between two forms and blurred, as a network has of small buttons."""
    mixed = []
    for one, two in zip(made.segments().segments, other.segments().segments, strict=True):
        size = np.maximum(one.probability.shape, two.probability.shape)
        pads = [np.zeros(size + 8, np.float32) for _ in range(2)]
        low = np.minimum(one.origin_px, two.origin_px)
        for pad, part in zip(pads, (one, two), strict=True):
            x, y = np.array(part.origin_px) - low + 3
            h, w = part.probability.shape
            pad[y : y + h, x : x + w] = part.probability
        soft = cv2.GaussianBlur((pads[0] + pads[1]) / 2, (0, 0), 2.0)
        x0, y0 = low - 3
        box = (x0 - 0.5, y0 - 0.5, x0 + soft.shape[1] - 0.5, y0 + soft.shape[0] - 0.5)
        mixed.append(Segment("number", 0.9, box, (int(x0), int(y0)), soft))
    return Segments(made.width, made.height, tuple(mixed))


def kinds(made, other, image):
    points = edge_points(blob(made, other).segments, made.width, made.height)
    return Counter(find_shapes(points, image).kind)


def both(side, seed=0):
    """The same panel with squares and with circles that touch them from within."""
    rngs = [np.random.default_rng(seed) for _ in range(2)]
    return [panel(r, m, side=side, to_px=PLAIN) for r, m in zip(rngs, (quad, circle), strict=True)]


@pytest.mark.parametrize("side", [20, 26, 40])
@pytest.mark.parametrize("light", [0.0, 0.6])
def test_the_same_blobs_are_what_the_photo_shows(side, light):
    squares, circles = both(side)
    seen = circles.picture(light=light)
    assert kinds(squares, circles, seen) == {"ellipse": 12}
    seen = squares.picture(light=light)
    assert kinds(squares, circles, seen) == {"quad": 12}


def test_labels_on_the_faces_do_not_matter():
    squares, circles = both(26)
    for made, kind in ((squares, "quad"), (circles, "ellipse")):
        image = made.picture()
        for form in made.forms:
            x, y = form.edge(8, 8).mean(axis=0)
            at = (round(x) - 6, round(y) + 5)
            cv2.putText(image, "8", at, cv2.FONT_HERSHEY_SIMPLEX, 0.5, (20, 20, 20), 2)
        assert kinds(squares, circles, image) == {kind: 12}


def test_masks_alone_decide_where_the_photo_shows_nothing():
    squares, circles = both(26)
    flat = np.full((squares.height, squares.width, 3), 90, np.uint8)
    assert kinds(squares, circles, flat) == kinds(squares, circles, None)


def test_sharp_masks_are_believed():
    squares, circles = both(30)
    points = edge_points(squares.segments().segments, squares.width, squares.height)
    assert Counter(find_shapes(points, circles.picture()).kind) == {"quad": 12}


def strengths(made, size=(20.0, 20.0), axes=(10.0, 10.0)):
    """Of the buttons of a panel, against a rectangle and an ellipse of these sizes."""
    centers = np.array([form.edge(8, 8).mean(axis=0) for form in made.forms])
    n, half = len(centers), np.array(size) / 2
    inverse = np.zeros((n, 3, 3))
    inverse[:, 0, 0], inverse[:, 1, 1], inverse[:, 2, 2] = 1 / half[0], 1 / half[1], 1
    inverse[:, :2, 2] = -centers / half
    frames = np.tile(np.diag(axes), (n, 1, 1))
    halves, sizes = np.tile(half, (n, 1)), np.full(n, np.sqrt(np.prod(size)))
    return roundness(made.picture(), inverse, halves, centers, frames, sizes)


def test_each_form_is_clearest_as_itself():
    squares, circles = both(20)
    assert (strengths(squares).argmax(axis=1) == 0).all()
    quads, ellipses, pills_too = strengths(circles).T
    assert (ellipses > quads + 0.1).all()
    # As long as wide, a pill is a circle.
    np.testing.assert_allclose(pills_too, ellipses, atol=0.02)
    pills = panel(np.random.default_rng(0), pill, side=20, to_px=PLAIN)
    edge = pills.forms[0].edge(8, 8)
    size = np.ptp(edge, axis=0)
    found = strengths(pills, tuple(size), tuple(size / 2 * 1.1))
    assert (found.argmax(axis=1) == 2).all()
    assert (found.max(axis=1) == 0).all()


def test_nothing_to_compare():
    image = np.zeros((50, 50, 3), np.uint8)
    nan = np.full((1, 2), np.nan)
    found = roundness(image, np.full((1, 3, 3), np.nan), nan, nan, nan[:, None] * nan, nan[0, :1])
    assert (found == 0).all()
    none = np.zeros((0, 2))
    assert roundness(
        image, np.zeros((0, 3, 3)), none, none, np.zeros((0, 2, 2)), np.zeros(0)
    ).shape == (0, 3)
