import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from fronto import Camera, InputError
from fronto.synth import (
    PAPER_CAMERA,
    Layout,
    LayoutButton,
    car_layout,
    circle_layout,
    hall_layout,
    observe,
    sample_scene,
)

scenes = settings(derandomize=True, deadline=None, max_examples=60)
seeds = st.integers(0, 10**6)
LAYOUTS = {
    "hall": hall_layout,
    "car": car_layout,
    "round car": lambda rng: car_layout(rng, shape="ellipse"),
    "circles": circle_layout,
}


def scene_of(seed, layout=hall_layout, **options):
    return sample_scene(np.random.default_rng(seed), layout, **options)


def rectified(pixels, scene):
    """True pixels (..., 2) on the panel's plane in metres, by the true rotation."""
    flat = np.asarray(pixels).reshape(-1, 2)
    rays = np.column_stack([flat, np.ones(len(flat))]) @ np.linalg.inv(scene.camera.matrix).T
    plane = rays @ scene.rotation.T
    return (plane[:, :2] / plane[:, 2:] * scene.translation[2]).reshape(np.shape(pixels))


# --- layouts


@scenes
@given(seeds)
def test_layouts_are_what_they_say(seed):
    hall = hall_layout(np.random.default_rng(seed))
    assert 2 <= len(hall.buttons) <= 3
    assert np.ptp(hall.centers[:, 0]) == 0
    car = car_layout(np.random.default_rng(seed))
    assert 12 <= len(car.buttons) <= 20
    assert 2 <= len(np.unique(car.centers[:, 0])) <= 4
    assert len({b.text for b in car.buttons}) == len(car.buttons)
    for layout in (hall, car, circle_layout(np.random.default_rng(seed))):
        sides = {(b.width, b.height) for b in layout.buttons}
        assert len(sides) == 1
        side = sides.pop()[0]
        assert 0.025 <= side <= 0.035
        # No two touch.
        gap = np.abs(layout.centers[:, None] - layout.centers).max(axis=2)
        np.fill_diagonal(gap, np.inf)
        assert gap.min() > 1.2 * side


def test_layout_choices():
    rng = np.random.default_rng(1)
    assert len(hall_layout(rng, 3).buttons) == 3
    assert hall_layout(rng, 2, 0.04).buttons[0].width == 0.04
    assert len(car_layout(rng, 14).buttons) == 14
    assert {b.shape for b in car_layout(rng, shape="ellipse").buttons} == {"ellipse"}
    assert len(circle_layout(rng, 12).buttons) == 12


def test_corners_by_hand():
    layout = Layout("two", (LayoutButton(0.1, 0.2, 0.04, 0.02), LayoutButton(0, 0, 0.02, 0.02)))
    expected = [[0.08, 0.19], [0.12, 0.19], [0.12, 0.21], [0.08, 0.21]]
    np.testing.assert_allclose(layout.corners[0], expected)
    np.testing.assert_allclose(layout.centers, [[0.1, 0.2], [0, 0]])


# --- truth


@pytest.mark.parametrize("name", ["hall", "car"])
def test_true_corners_rectify_to_equal_upright_squares(name):
    @scenes
    @given(seeds)
    def run(seed):
        scene = scene_of(seed, LAYOUTS[name])
        np.testing.assert_allclose(scene.rotation @ scene.rotation.T, np.eye(3), atol=1e-12)
        corners = np.array([o.corners_px for o in scene.truth])
        np.testing.assert_allclose(scene.corners_px, corners, atol=1e-9)
        plane = rectified(corners, scene)
        side = scene.layout.buttons[0].width
        steps = np.broadcast_to([[side, 0], [0, side], [-side, 0]], (len(corners), 3, 2))
        np.testing.assert_allclose(np.diff(plane, axis=1), steps, atol=1e-9)
        expected = scene.layout.corners + scene.translation[:2]
        np.testing.assert_allclose(plane, expected, atol=1e-9)
        np.testing.assert_allclose(scene.plane_corners, expected / scene.translation[2], atol=1e-12)

    run()


@pytest.mark.parametrize("name", ["round car", "circles"])
def test_true_ellipses_are_the_images_of_circles(name):
    @scenes
    @given(seeds)
    def run(seed):
        scene = scene_of(seed, LAYOUTS[name])
        for outline, button in zip(scene.truth, scene.layout.buttons, strict=True):
            plane = rectified(outline.ellipse_px.points(40), scene) - scene.translation[:2]
            radius = np.linalg.norm(plane - [button.x, button.y], axis=1)
            np.testing.assert_allclose(radius, button.width / 2, rtol=1e-6)

    run()


@pytest.mark.parametrize("name", LAYOUTS)
def test_everything_is_in_the_photo_and_in_range(name):
    @scenes
    @given(seeds)
    def run(seed):
        scene = scene_of(seed, LAYOUTS[name], max_angle_deg=25, distance_m=(0.4, 0.6))
        assert scene.corners_px.min() >= 0
        assert (scene.corners_px.max(axis=(0, 1)) <= [639, 479]).all()
        assert 0.4 <= np.linalg.norm(scene.translation) <= 0.6
        # In the paper's signs: R[0, 2] = -sin θ_y, and tan θ_z = R[0, 1] / R[0, 0].
        assert abs(np.degrees(np.arcsin(scene.rotation[0, 2]))) <= 25
        assert abs(np.degrees(np.arctan2(scene.rotation[0, 1], scene.rotation[0, 0]))) <= 25
        assert scene.outlines == scene.truth
        assert scene.outlier is None

    run()


@scenes
@given(seeds)
def test_options_of_the_view(seed):
    oblique = scene_of(seed, max_oblique_deg=30)
    ray = oblique.rotation @ [0, 0, 1]
    center = oblique.translation / np.linalg.norm(oblique.translation)
    assert center[2] >= np.cos(np.radians(30)) - 1e-12
    assert ray[2] > 0

    large = scene_of(seed, min_side_px=40)
    sides = np.linalg.norm(np.diff(large.corners_px, axis=1), axis=2)
    assert sides.min() >= 40

    middle = scene_of(seed, spread=0.0)
    seen = middle.translation @ middle.rotation
    np.testing.assert_allclose(seen[:2] / seen[2], (-0.5 / 320, -0.5 / 320), atol=1e-9)


def test_other_cameras():
    camera = Camera.from_fov(60, 1920, 1080)
    scene = scene_of(3, camera=camera)
    assert scene.camera is camera
    assert (scene.corners_px.max(axis=(0, 1)) <= [1919, 1079]).all()
    side = scene.layout.buttons[0].width
    first = rectified(scene.truth[0].corners_px, scene)
    assert first[1, 0] - first[0, 0] == pytest.approx(side)


# --- observations


@pytest.mark.parametrize("name", LAYOUTS)
def test_seeds_reproduce(name):
    def draw(seed):
        rng = np.random.default_rng(seed)
        return observe(rng, sample_scene(rng, LAYOUTS[name]), 0.3, outlier_share=0.5)

    def numbers(scene):
        return [
            o.corners_px.tolist() if o.corners_px is not None else o.ellipse_px
            for o in scene.outlines
        ]

    first, again, other = draw(5), draw(5), draw(6)
    assert numbers(first) == numbers(again)
    assert first.outlier == again.outlier
    assert numbers(first) != numbers(other)


@pytest.mark.parametrize("sigma", [0.3, 1.0])
def test_corner_noise(sigma):
    rng = np.random.default_rng(1)
    scene = scene_of(1, car_layout, min_side_px=12)
    noise = []
    for _ in range(100):
        seen = observe(rng, scene, sigma, outlier_share=0.0)
        assert seen.outlier is None
        for outline, true in zip(seen.outlines, scene.truth, strict=True):
            noise.append(outline.corners_px - true.corners_px)
            assert outline.std_px == sigma
    noise = np.array(noise).reshape(-1, 8)
    # At least 9600 numbers: 1 % of the deviation is one and a half of its own deviations.
    assert noise.std() == pytest.approx(sigma, rel=0.03)
    assert abs(noise.mean()) < 0.05 * sigma
    assert np.abs(np.corrcoef(noise.T) - np.eye(8)).max() < 0.12


def test_ellipse_noise():
    # One circle of radius 30 px seen frontally: 188.5 edge points of σ = 0.5 each.
    layout = Layout("one", (LayoutButton(0, 0, 0.03, 0.03, "ellipse"),))
    scene = sample_scene(
        np.random.default_rng(0),
        lambda rng: layout,
        max_angle_deg=0,
        distance_m=(0.16, 0.16),
        spread=0.0,
    )
    true = scene.truth[0].ellipse_px
    assert true.a == pytest.approx(30, rel=1e-4)
    rng = np.random.default_rng(2)
    seen = [observe(rng, scene, 0.5, outlier_share=0).outlines[0] for _ in range(2000)]
    centers = np.array([o.ellipse_px.center for o in seen]) - true.center
    expected = 0.5 * np.sqrt(2 / (2 * np.pi * 30))
    np.testing.assert_allclose(centers.std(axis=0), expected, rtol=0.06)
    assert seen[0].std_px == pytest.approx(expected, rel=1e-3)
    axes = np.array([(o.ellipse_px.a, o.ellipse_px.b) for o in seen])
    # σ/√N for the radius; stretch and shear of σ√(2/N) each part the axes by 2 hypot(.,.),
    # of mean 2 √(π/2).
    assert axes.mean(axis=1).std() == pytest.approx(0.5 / np.sqrt(60 * np.pi), rel=0.06)
    assert np.diff(-axes, axis=1).mean() == pytest.approx(np.sqrt(2 * np.pi) * expected, rel=0.06)


def test_exact_observations():
    for layout in (hall_layout, circle_layout):
        rng = np.random.default_rng(4)
        scene = observe(rng, sample_scene(rng, layout), 0.0, outlier_share=0.0)
        for outline, true in zip(scene.outlines, scene.truth, strict=True):
            if true.corners_px is None:
                assert outline.ellipse_px == true.ellipse_px
            else:
                np.testing.assert_array_equal(outline.corners_px, true.corners_px)
            assert outline.std_px == 0.01


@pytest.mark.parametrize("name", LAYOUTS)
def test_outlier_share(name):
    scene = scene_of(8, LAYOUTS[name], min_side_px=15)
    rng = np.random.default_rng(8)
    drawn = [observe(rng, scene, 0.01) for _ in range(600)]
    outliers = [s for s in drawn if s.outlier is not None]
    # 0.1 of 600 with a deviation of √(600 · 0.1 · 0.9) = 7.3.
    assert 38 <= len(outliers) <= 82
    off = []
    for seen in outliers:
        for k, (outline, true) in enumerate(zip(seen.outlines, seen.truth, strict=True)):
            x0, y0, x1, y1 = true.box_px
            reach = np.abs(np.subtract(outline.box_px, (x0, y0, x1, y1))).max()
            if k == seen.outlier:
                off.append(reach / np.sqrt((x1 - x0) * (y1 - y0)))
            else:
                assert reach < 0.1
    # Shifts are Gaussian, so that a few outliers are small ones.
    assert np.median(off) > 0.1
    assert all(observe(rng, scene, 0.3, outlier_share=1.0).outlier is not None for _ in range(20))


def test_outliers_hit_every_button():
    scene = scene_of(2, lambda rng: hall_layout(rng, 3))
    rng = np.random.default_rng(0)
    hit = [observe(rng, scene, 0.3, outlier_share=1.0).outlier for _ in range(60)]
    assert set(hit) == {0, 1, 2}


@pytest.mark.parametrize(
    ("options", "named"),
    [
        ({"min_side_px": 1000.0}, "min_side_px"),
        ({"max_oblique_deg": 0.0}, "max_oblique_deg"),
        ({"distance_m": (0.01, 0.02)}, "distance_m"),
    ],
)
def test_views_that_cannot_be_are_refused(options, named):
    with pytest.raises(InputError, match=named):
        scene_of(1, **options)


@pytest.mark.parametrize("sigma", [np.nan, np.inf])
def test_noise_without_a_number_is_refused(sigma):
    with pytest.raises(InputError, match="sigma_px"):
        observe(np.random.default_rng(0), scene_of(1), sigma, outlier_share=0)


class Mirroring:
    """A source of noise that puts every quad's corners in the wrong order."""

    def integers(self, high):
        return 2  # of three buttons the last one; of the kinds of outliers the misshapen one

    def uniform(self):
        return 0.0

    def normal(self, mean, std, size):
        return std * 1e6 * np.array([[0.0, 0.0], [0.0, 1.0], [1.0, 1.0], [1.0, 0.0]])


def test_outliers_that_cannot_be_are_refused():
    scene = scene_of(2, lambda rng: hall_layout(rng, 3))
    with pytest.raises(InputError, match="outlier_share"):
        observe(Mirroring(), scene, 0.0, outlier_share=1.0)


def test_the_papers_camera():
    expected = [[320, 0, 320], [0, 320, 240], [0, 0, 1]]
    np.testing.assert_array_equal(PAPER_CAMERA.matrix, expected)
    assert (PAPER_CAMERA.width_px, PAPER_CAMERA.height_px) == (640, 480)
