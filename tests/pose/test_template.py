import numpy as np
import pytest

from fronto import InputError, Outline, Template, TemplateButton, estimate_pose
from fronto.pose.template import match_template
from fronto.synth import LayoutButton

SQUARE = np.array([[0, 0], [20, 0], [20, 20], [0, 20]], dtype=float)

#: Spread irregularly, sizes in two kinds.
PANEL = (
    LayoutButton(-0.04, -0.06, 0.03, 0.03, text="3"),
    LayoutButton(0.04, -0.06, 0.03, 0.03, text="4"),
    LayoutButton(-0.04, 0.0, 0.03, 0.03, text="1"),
    LayoutButton(0.04, 0.0, 0.03, 0.03, text="2"),
    LayoutButton(0.0, 0.055, 0.05, 0.025, text="open"),
)


def template_of(buttons, *, labels=True, sizes=True, origin=(200.0, -30.0)):
    return Template(
        tuple(
            TemplateButton(
                1e3 * b.x + origin[0],
                1e3 * b.y + origin[1],
                1e3 * b.width if sizes else None,
                1e3 * b.height if sizes else None,
                b.text if labels else "",
            )
            for b in buttons
        )
    )


def outlines_of(*texts):
    return [Outline.quad(np.add(SQUARE, [0, 40 * k]), text=text) for k, text in enumerate(texts)]


# --- matching


def test_by_label_in_any_order():
    template = Template(tuple(TemplateButton(0, 30 * k, label=c) for k, c in enumerate("abc")))
    matched = match_template(template, outlines_of("c", "", "a", "z"))
    assert [b and b.label for b in matched] == ["c", None, "a", None]


def test_a_text_seen_twice_is_no_match():
    template = Template(tuple(TemplateButton(0, 30 * k, label=c) for k, c in enumerate("abc")))
    matched = match_template(template, outlines_of("a", "b", "a", "c"))
    assert [b and b.label for b in matched] == [None, "b", None, "c"]


def test_by_order_without_labels_or_texts():
    plain = Template(tuple(TemplateButton(0, 30 * k) for k in range(3)))
    assert match_template(plain, outlines_of("x", "y", "")) == list(plain.buttons)
    labelled = Template(tuple(TemplateButton(0, 30 * k, label=c) for k, c in enumerate("abc")))
    assert match_template(labelled, outlines_of("", "", "")) == list(labelled.buttons)


def test_mismatches():
    labelled = Template(tuple(TemplateButton(0, 30 * k, label=c) for k, c in enumerate("abc")))
    plain = Template(tuple(TemplateButton(0, 30 * k) for k in range(3)))
    for template, texts in [
        (labelled, "xyz"),
        (labelled, "axy"),
        (plain, "ab"),
        (plain, "abcd"),
    ]:
        with pytest.raises(InputError, match="template"):
            match_template(template, outlines_of(*texts))


# --- values


@pytest.mark.parametrize(
    "values",
    [
        (np.nan, 0),
        (0, np.inf),
        (0, 0, 0.0, 10),
        (0, 0, -1, 10),
        (0, 0, 10, np.nan),
        (0, 0, np.inf),
    ],
)
def test_bad_template_buttons(values):
    with pytest.raises(InputError, match="template button"):
        TemplateButton(*values)


@pytest.mark.parametrize("places", [[], [(0, 0)], [(5, 5), (5, 5)]])
def test_templates_need_two_positions(places):
    with pytest.raises(InputError, match="template"):
        Template(tuple(TemplateButton(*place) for place in places))


# --- poses


@pytest.mark.parametrize("labels", [True, False])
@pytest.mark.parametrize("angles", [(20, -25, 8), (-30, 10, -20), (0, 0, 0)])
def test_depth_and_rotation_of_exact_outlines(view, labels, angles):
    panel = view(PANEL, angles, at_px=(360, 220), std_px=0.01)
    pose = estimate_pose(panel.outlines, panel.camera, template=template_of(PANEL, labels=labels))
    assert pose.status == "ok"
    assert panel.error_deg(pose) < 0.02
    # Distance from the camera to the plane: the third coordinate of any panel point.
    assert pose.plane_depth_m == pytest.approx(panel.translation[2], rel=1e-3)
    half = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) / 2
    sizes = np.array([[b.width, b.height] for b in PANEL])[:, None]
    places = np.array([[b.x, b.y] for b in PANEL])[:, None] + half * sizes
    expected = (places + panel.translation[:2]) / panel.translation[2]
    np.testing.assert_allclose(pose.plane_corners, expected, atol=2e-4)


def test_label_matching_needs_no_order(view):
    panel = view(PANEL, (20, -25, 8), std_px=0.01)
    shuffled = [panel.outlines[k] for k in (3, 0, 4, 1, 2)]
    pose = estimate_pose(shuffled, panel.camera, template=template_of(PANEL))
    assert panel.error_deg(pose) < 0.02
    assert pose.plane_depth_m == pytest.approx(panel.translation[2], rel=1e-3)


def test_noise(view):
    without, with_template, depth = [], [], []
    rng = np.random.default_rng(4)
    for seed in range(40):
        panel = view(PANEL, rng.uniform(-30, 30, 3), at_px=rng.uniform([280, 200], [360, 280]))
        panel = panel.noisy(seed, 0.4)
        pose = estimate_pose(panel.outlines, panel.camera, template=template_of(PANEL))
        plain = estimate_pose(panel.outlines, panel.camera)
        with_template.append(panel.error_deg(pose))
        without.append(panel.error_deg(plain))
        depth.append(abs(pose.plane_depth_m / panel.translation[2] - 1))
        assert plain.plane_depth_m is None
    assert np.median(with_template) < 0.8 * np.median(without)
    assert np.median(depth) < 0.01
    assert max(depth) < 0.04


def test_positions_alone_give_the_depth(view):
    panel = view(PANEL, (20, -25, 8)).noisy(2, 0.2)
    template = template_of(PANEL, sizes=False)
    pose = estimate_pose(panel.outlines, panel.camera, template=template)
    assert pose.plane_depth_m == pytest.approx(panel.translation[2], rel=0.01)


def test_circles_with_a_template(view):
    buttons = tuple(
        LayoutButton(b.x, b.y, b.height, b.height, "ellipse", text=b.text) for b in PANEL
    )
    panel = view(buttons, (20, -25, 8), std_px=0.01)
    pose = estimate_pose(panel.outlines, panel.camera, template=template_of(buttons))
    assert panel.error_deg(pose) < 0.05
    assert pose.plane_depth_m == pytest.approx(panel.translation[2], rel=1e-3)


def test_outlines_that_the_template_lacks_do_not_disturb(view):
    panel = view(PANEL, (20, -25, 8)).noisy(3, 0.1)
    template = template_of(PANEL[:4])  # no "open"
    pose = estimate_pose(panel.outlines, panel.camera, template=template)
    assert panel.error_deg(pose) < 1.0
    assert pose.plane_depth_m == pytest.approx(panel.translation[2], rel=0.01)


def test_templates_that_do_not_match(view):
    panel = view(PANEL, (20, -25, 8))
    other = Template(tuple(TemplateButton(0, 30 * k, label=c) for k, c in enumerate("xyz")))
    plain = template_of(PANEL[:3], labels=False)
    for template in (other, plain):
        with pytest.raises(InputError, match="template"):
            estimate_pose(panel.outlines, panel.camera, template=template)
