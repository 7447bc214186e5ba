"""What does not fit is not called ok: imprecise panels, wrong templates, contradictions."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from fronto import (
    Camera,
    InputError,
    LineSegment,
    Outline,
    Template,
    TemplateButton,
    estimate_pose,
)
from fronto.evaluate import rotation_error_deg
from fronto.pose.rotation import rotation_from_angles, rotation_log
from fronto.synth import (
    PAPER_CAMERA,
    Layout,
    LayoutButton,
    Scene,
    car_layout,
    hall_layout,
    imprecise,
    observe,
    sample_scene,
)

CHI2_95_3 = 7.815


def scenes(seed: int, count: int, layout, sigma: float = 0.3, **options) -> list[Scene]:
    rng = np.random.default_rng(seed)
    return [
        observe(rng, sample_scene(rng, layout, **options), sigma, outlier_share=0.0)
        for _ in range(count)
    ]


@pytest.mark.parametrize("side", [0.0, 60.0])
def test_deviations_hold_on_panels_as_they_are_made(side: float) -> None:
    # 0.2 mm off in place and size: beside 0.3 px that counts on large buttons only.
    def layout(rng: np.random.Generator) -> Layout:
        return imprecise(rng, hall_layout(rng, 3), 0.0002)

    covered = []
    for scene in scenes(1, 120, layout, min_side_px=side):
        pose = estimate_pose(scene.outlines, scene.camera, square=True)
        w = rotation_log(pose.rotation.T @ scene.rotation)
        covered.append(w @ np.linalg.solve(pose.covariance, w) < CHI2_95_3)
    assert np.mean(covered) >= 0.88


def test_outlines_on_another_edge_all_around() -> None:
    # Each button's bezel or gap instead of its face: 3 px off, but hardly another form.
    rng = np.random.default_rng(3)
    off, stated, covered = [], [], []
    for scene in scenes(4, 40, lambda rng: car_layout(rng, 4), 0.25, min_side_px=40):
        outlines = []
        for o in scene.outlines:
            if o.corners_px is None:
                outlines.append(o)
                continue
            a, b, c, d = o.corners_px
            u, v = (b + c - a - d) / 2, (c + d - a - b) / 2
            out = [rng.normal(0, 3) * w / np.linalg.norm(w) / 2 for w in (u, v)]
            grown = o.corners_px + np.array([-1, 1, 1, -1])[:, None] * out[0]
            grown = grown + np.array([-1, -1, 1, 1])[:, None] * out[1]
            outlines.append(Outline.quad(grown, std_px=1.6, category=o.category))
        pair = []
        for form in (None, 0.3):
            formed = [o if o.corners_px is None else replace(o, form_std_px=form) for o in outlines]
            pose = estimate_pose(formed, scene.camera)
            assert pose.status in ("ok", "uncertain")
            w = rotation_log(pose.rotation.T @ scene.rotation)
            pair.append((np.degrees(np.linalg.norm(w)), float(max(pose.std_deg))))
        covered.append(w @ np.linalg.solve(pose.covariance, w) < CHI2_95_3)
        off.append([error for error, _ in pair])
        stated.append([std for _, std in pair])
    plain, formed_ = np.median(off, axis=0)
    assert formed_ < 0.7 * plain
    assert np.median(stated, axis=0)[1] < 0.6 * np.median(stated, axis=0)[0]
    assert np.mean(covered) >= 0.8


@pytest.mark.parametrize("true", [0.15, 0.3, 0.4])
def test_residuals_tell_how_large_errors_are(true: float) -> None:
    # 0.3 px are stated: what the outlines miss the panel by shows that it is less, or more.
    stated, covered = [], []
    for scene in scenes(5, 60, lambda rng: car_layout(rng), true):
        outlines = [replace(o, std_px=0.3) for o in scene.outlines]
        pose = estimate_pose(outlines, scene.camera)
        w = rotation_log(pose.rotation.T @ scene.rotation)
        covered.append(w @ np.linalg.solve(pose.covariance, w) < CHI2_95_3)
        stated.append(pose.sigma_px)
    assert np.mean(covered) >= 0.88
    assert 0.7 * true < np.median(stated) < 1.5 * true


def test_of_one_button_no_residual_tells_much() -> None:
    # One quad has a single residual more than what is solved for.
    (scene,) = scenes(6, 1, lambda rng: hall_layout(rng, 1), 0.0, min_side_px=60)
    pair = [estimate_pose(scene.outlines, scene.camera, square=s) for s in (False, True)]
    assert all(pose.sigma_px > 0.5 * 0.3 for pose in pair)


def test_without_tolerance_large_buttons_promise_too_much() -> None:
    def layout(rng: np.random.Generator) -> Layout:
        return imprecise(rng, hall_layout(rng, 3), 0.0002)

    (scene,) = scenes(2, 1, layout, min_side_px=60)
    exact = estimate_pose(scene.outlines, scene.camera, square=True, tolerance=0)
    real = estimate_pose(scene.outlines, scene.camera, square=True)
    assert max(exact.std_deg) < 0.9 * max(real.std_deg)
    with pytest.raises(InputError, match="tolerance"):
        estimate_pose(scene.outlines, scene.camera, tolerance=-0.1)


def test_columns_of_different_sizes_do_not_bend_an_ok_pose() -> None:
    # 30 mm beside 31.5 mm: one shared size would make the larger ones look closer.
    places = [(x, y) for y in (-0.05, 0.0, 0.05) for x in (-0.03, 0.03)]
    sizes = [0.030, 0.0315] * 3
    panel = Layout(
        "car", tuple(LayoutButton(*xy, w, w) for xy, w in zip(places, sizes, strict=True))
    )
    errors, trusted = [], []
    for scene in scenes(3, 60, lambda rng: panel, sigma=0.1):
        pose = estimate_pose(scene.outlines, scene.camera)
        errors.append(rotation_error_deg(pose.rotation, scene.rotation))
        trusted.append(pose.status == "ok")
    assert np.median(errors) < 1.0
    assert max(np.array(errors)[trusted]) < 5.0
    assert np.mean(trusted) > 0.5


def template_of(layout: Layout, factor: float = 1.0, size: float = 1.0) -> list[TemplateButton]:
    return [
        TemplateButton(
            1e3 * factor * b.x, 1e3 * factor * b.y, 1e3 * size * b.width, 1e3 * size * b.height
        )
        for b in layout.buttons
    ]


def test_a_template_that_fits_gives_the_depth_and_one_that_does_not_is_not_ok() -> None:
    for scene in scenes(4, 20, car_layout):
        right = template_of(scene.layout)
        pose = estimate_pose(scene.outlines, scene.camera, template=Template(tuple(right)))
        assert pose.status == "ok"
        assert pose.plane_depth_m == pytest.approx(scene.translation[2], rel=0.02)

        swapped = [right[-1], *right[1:-1], right[0]]
        wider = template_of(scene.layout, factor=1.3)
        for wrong in (swapped, wider):
            pose = estimate_pose(scene.outlines, scene.camera, template=Template(tuple(wrong)))
            assert pose.status != "ok"
            assert pose.plane_depth_m is None
            assert any("template" in reason for reason in pose.reasons)
        smaller = tuple(template_of(scene.layout, size=0.5))
        pose = estimate_pose(scene.outlines, scene.camera, template=Template(smaller))
        assert pose.status != "ok"


def test_a_template_in_two_units_is_refused() -> None:
    (scene,) = scenes(7, 1, car_layout)
    with pytest.raises(InputError, match="overlapping"):
        Template(tuple(template_of(scene.layout, size=1000.0)))


CONTRADICTING = {
    "three": (
        0.1,
        (-36.2, -2.3, -13.2),
        [
            (393.21, 166.61, 7.67, 5.23, -179.8),
            (402.46, 183.85, 8.21, 5.51, -176.94),
            (412.75, 202.91, 6.2, 4.42, 179.9),
        ],
    ),
    "four": (
        0.05,
        (36.5, 3.4, 29.9),
        [
            (464.65, 396.45, 7.7, 4.5, -167.52),
            (485.11, 408.54, 7.85, 4.2, -166.59),
            (453.38, 406.03, 7.18, 3.98, -165.0),
            (469.78, 417.6, 7.42, 4.12, -165.25),
        ],
    ),
}


@pytest.mark.parametrize("name", CONTRADICTING)
def test_few_circles_one_of_them_wrong_are_right_or_not_ok(name: str) -> None:
    # A pose 92° (44°) off explains them with small residuals.
    std, angles, ellipses = CONTRADICTING[name]
    pose = estimate_pose([Outline.ellipse(*e, std_px=std) for e in ellipses], PAPER_CAMERA)
    error = rotation_error_deg(pose.rotation, rotation_from_angles(*np.radians(angles)))
    assert pose.status != "ok" or error < 3.0


def test_few_buttons_do_not_tell_an_unknown_focal_length() -> None:
    guess = Camera.default(640, 480)
    for scene in scenes(5, 40, hall_layout):
        assert estimate_pose(scene.outlines, guess, square=True).status != "ok"


def test_lens_distortion_needs_its_focal_length() -> None:
    camera = Camera.from_matrix(PAPER_CAMERA.matrix, 640, 480, [-0.2, 0.05, 0, 0])
    quad = Outline.quad([[300, 220], [340, 220], [340, 260], [300, 260]])
    assert estimate_pose([quad], camera).status == "uncertain"
    with pytest.raises(InputError, match="focal length"):
        estimate_pose([quad], camera.with_focal(320.0, 0.3))


def test_what_lies_outside_the_lens_model_is_named() -> None:
    camera = Camera.from_matrix(
        [[400, 0, 400], [0, 400, 300], [0, 0, 1]], 800, 600, [-0.3, 0, 0, 0]
    )
    middle = Outline.quad([[380, 280], [420, 280], [420, 320], [380, 320]])
    corner = Outline.quad([[20, 20], [60, 20], [60, 60], [20, 60]])
    with pytest.raises(InputError, match=r"outlines 1.*lens model plumb_bob"):
        estimate_pose([middle, corner], camera)
    line = LineSegment("horizontal", np.array([[0.0, 0.0], [400.0, 10.0]]))
    with pytest.raises(InputError, match=r"lines 0.*lens model plumb_bob"):
        estimate_pose([middle], camera, lines=[line])


def test_lines_that_do_not_fit_are_told() -> None:
    (scene,) = scenes(8, 1, car_layout)
    first, last = scene.corners_px[0], scene.corners_px[1]
    along = LineSegment("horizontal", np.array([first[0], last[1]]))
    wrong = LineSegment("vertical", np.array([first[0], last[1]]))
    good = estimate_pose(scene.outlines, scene.camera, lines=[along])
    assert good.notes == ()
    mixed = estimate_pose(scene.outlines, scene.camera, lines=[along, wrong])
    assert any("1 of 2 lines" in note for note in mixed.notes)


def test_a_tilted_single_button_comes_with_its_mirror_image() -> None:
    def one(rng: np.random.Generator) -> Layout:
        return Layout("hall", (LayoutButton(0, 0, 0.035, 0.035),))

    told = []
    for scene in scenes(6, 30, one, distance_m=(0.3, 0.4)):
        pose = estimate_pose(scene.outlines, scene.camera, square=True)
        assert pose.status != "ok"
        found = [pose, *pose.alternatives]
        told.append(min(rotation_error_deg(p.rotation, scene.rotation) for p in found) < 12.0)
    assert np.mean(told) > 0.8


@pytest.mark.parametrize(("columns", "status"), [(1, "uncertain"), (4, "ok")])
def test_one_round_button_needs_lines_of_either_axis(columns: int, status: str) -> None:
    # An oval one, seen from in front, is a round one seen from below; rows do not contradict that.
    camera, shift = PAPER_CAMERA, np.array([0.0, 0.0, 0.12])
    rotation = rotation_from_angles(np.radians(40.0), np.radians(20.0), 0.0)
    t = 2 * np.pi * np.arange(64) / 64
    rim = 0.015 * np.column_stack([np.cos(t), np.sin(t), np.zeros(64)])
    (cx, cy), (width, height), angle = cv2.fitEllipse(
        camera.project((rim + shift) @ rotation).astype(np.float32)
    )
    turned = 90.0 if height > width else 0.0
    button = Outline.ellipse(
        cx, cy, max(width, height) / 2, min(width, height) / 2, angle + turned, std_px=0.2
    )
    ends = np.array(
        [
            [[[-0.06, y], [0.06, y]] for y in (-0.04, -0.03, 0.03, 0.04)],
            [[[x, -0.04], [x, 0.04]] for x in (-0.06, -0.04, 0.04, 0.06)],
        ]
    )
    lines = []
    for axis, count in ((0, 4), (1, columns)):
        for line in ends[axis][:count]:
            points = (np.column_stack([line, np.zeros(2)]) + shift) @ rotation
            lines.append(LineSegment(("horizontal", "vertical")[axis], camera.project(points), 0.3))
    pose = estimate_pose([button], camera, lines=lines)
    assert pose.status == status
    assert max(pose.std_deg) < 2.5
    assert rotation_error_deg(pose.rotation, rotation) < 2
