from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from conftest import circle_image, paper_rotation
from fronto import Camera, InputError, Outline, PanelPose
from fronto.labels.crops import crops

QUICK = settings(derandomize=True, deadline=None, max_examples=20)
K = [[500.0, 0, 310], [0, 480, 245], [0, 0, 1]]
PLAIN = Camera.from_matrix(K, 640, 480)
BARREL = Camera.from_matrix(K, 640, 480, distortion=(-0.25, 0.08, 0.002, -0.001))
FISHEYE = Camera.from_matrix(
    [[250.0, 0, 310], [0, 250, 245], [0, 0, 1]],
    640,
    480,
    distortion=(0.05, -0.01, 0.002, 0),
    distortion_model="equidistant",
)
#: What a crop's pixels show of the box of sides 2 around (0, 0): their centres.
ALONG = 1.06 * (2 * np.arange(48) + 1 - 48) / 48


@dataclass
class Scene:
    """A picture on a plane, drawn by going back along each pixel's ray."""

    camera: Camera
    rotation: np.ndarray
    #: Half width and height of the box on the plane at depth 1, and its centre.
    half: tuple[float, float]
    center: tuple[float, float]

    @property
    def pose(self):
        return pose_of(self.camera, self.rotation)

    def photo(self, picture):
        """Only around the box: rays of all pixels take long."""
        x0, y0, x1, y1 = np.round(self.quad.box_px).astype(int)
        pad = 10 + max(x1 - x0, y1 - y0) // 10
        x, y = np.arange(x0 - pad, x1 + pad + 1), np.arange(y0 - pad, y1 + pad + 1)
        x, y = x[(x >= 0) & (x < self.camera.width_px)], y[(y >= 0) & (y < self.camera.height_px)]
        pixels = np.stack(np.meshgrid(x, y), axis=-1).reshape(-1, 2)
        seen = self.camera.rays(pixels) @ self.rotation.T
        u, v = ((seen[:, :2] / seen[:, 2:] - self.center) / self.half).T
        photo = np.zeros((self.camera.height_px, self.camera.width_px, 3), np.uint8)
        photo[y[0] : y[-1] + 1, x[0] : x[-1] + 1] = bytes_of(picture(u, v)).reshape(
            len(y), len(x), 3
        )
        return photo

    def project(self, points):
        """Box coordinates, -1 to 1, to the photo."""
        plane = np.array(points) * self.half + self.center
        rays = np.column_stack([plane, np.ones(len(plane))]) @ self.rotation
        return self.camera.project(rays)

    @property
    def quad(self):
        return Outline.quad(self.project([[-1, -1], [1, -1], [1, 1], [-1, 1]]))


def pose_of(camera, rotation, status="ok"):
    return PanelPose(
        status=status,
        reasons=(),
        solver="refine",
        rotation=rotation,
        covariance=np.zeros((3, 3)),
        camera=camera,
        plane_corners=np.zeros((0, 4, 2)),
        residual_px=np.zeros(0),
        weight=np.zeros(0),
    )


def scene(camera=PLAIN, angles=(0, 0, 0), half=(0.06, 0.06), at_px=(350.0, 220.0)):
    """A box whose centre is seen at a pixel; half its sides at depth 1 of the panel frame."""
    rotation = paper_rotation(*angles)
    ray = rotation @ camera.rays([at_px])[0]
    return Scene(camera, rotation, half, tuple(ray[:2] / ray[2]))


def bytes_of(values):
    return np.clip(np.rint(values), 0, 255).astype(np.uint8)


def smooth(u, v):
    """Red tells x, green y, and blue is a wave."""
    return np.stack(
        [127 + 90 * u, 127 + 90 * v, 127 + 60 * np.sin(1.5 * u + 0.4) * np.cos(1.5 * v)], axis=-1
    )


HEAD_ON = smooth(*np.meshgrid(ALONG, ALONG))


def assert_head_on(crop, *, most=1.7, mean=0.6, bias=0.3):
    """Photo and crop are rounded to bytes, 0.25 each in the mean; each halving rounds up once."""
    off = crop - HEAD_ON
    assert np.abs(off).max() <= most
    assert np.abs(off).mean() <= mean
    assert np.abs(off.mean(axis=(0, 1))).max() <= bias


class TestHeadOn:
    @pytest.mark.parametrize("camera", [PLAIN, BARREL, FISHEYE], ids=["plain", "barrel", "fisheye"])
    @pytest.mark.parametrize("half", [0.025, 0.06, 0.12, 0.22], ids="half {}".format)
    @pytest.mark.parametrize("angles", [(0, 0, 0), (20, -30, 10), (-35, 25, -40)], ids=str)
    def test_with_pose(self, camera, half, angles):
        s = scene(camera, angles, (half, half))
        (crop,) = crops(s.photo(smooth), [s.quad], s.pose)
        tiny, large = camera is FISHEYE and half < 0.05, half > 0.1  # 12 pixels, 100 and more
        assert_head_on(crop, most=2.4 if tiny else 1.7, bias=0.6 if large else 0.3)

    @pytest.mark.parametrize("half", [(0.2, 0.05), (0.03, 0.15), (0.4, 0.04)], ids=str)
    def test_wide_and_tall_boxes_are_squeezed(self, half):
        s = scene(angles=(15, -20, 5), half=half)
        (crop,) = crops(s.photo(smooth), [s.quad], s.pose)
        assert_head_on(crop)

    @pytest.mark.parametrize("pose", [None, "degenerate", "no_buttons"])
    @pytest.mark.parametrize("half", [0.04, 0.15])
    def test_quads_without_pose_are_straightened_by_their_corners(self, pose, half):
        s = scene(angles=(20, -30, 10), half=(half, half))
        if pose is not None:
            pose = pose_of(PLAIN, np.full((3, 3), np.nan), pose)
        (crop,) = crops(s.photo(smooth), [s.quad], pose)
        assert_head_on(crop, bias=0.5)

    def test_an_uncertain_pose_is_used(self):
        s = scene(BARREL, (20, -30, 10), (0.2, 0.2), (520.0, 100.0))
        photo = s.photo(smooth)
        (crop,) = crops(photo, [s.quad], pose_of(BARREL, s.rotation, "uncertain"))
        assert_head_on(crop, bias=0.5)
        # Its corners alone tell nothing of the bent sides: the test would see it.
        (alone,) = crops(photo, [s.quad])
        assert np.abs(alone - HEAD_ON).max() > 2.5

    @pytest.mark.parametrize("half", [0.04, 0.09, 0.13, 0.2])
    @pytest.mark.parametrize("camera", [PLAIN, BARREL], ids=["plain", "barrel"])
    def test_takes_all_of_the_photo_that_it_needs(self, monkeypatch, camera, half):
        s = scene(camera, half=(half, half), at_px=(480.0, 130.0))
        photo = np.random.default_rng(7).integers(0, 256, (480, 640, 3), dtype=np.uint8)
        enough = crops(photo, [s.quad], s.pose)
        monkeypatch.setattr("fronto.labels.crops.REACH_PX", 8)
        more = crops(photo, [s.quad], s.pose)
        assert np.abs(enough.astype(int) - more).max() <= 1

    def test_circles(self):
        s = scene(angles=(20, -30, 10), half=(0.1, 0.1))
        ellipse = circle_image(*s.center, 0.1, s.rotation, np.array([0, 0, 1]), PLAIN.matrix)
        outline = Outline("ellipse", ellipse_px=ellipse)
        (crop,) = crops(s.photo(smooth), [outline], s.pose)
        # Of a box by points on the ellipse: up to half a percent narrower.
        assert_head_on(crop, most=2.2, mean=0.8, bias=0.5)

    def test_ellipses_without_pose_show_their_box(self):
        photo = np.zeros((100, 120, 3), np.uint8)
        y, x = np.mgrid[:100, :120]
        photo[..., 0], photo[..., 1] = 2 * x, 2 * y
        (crop,) = crops(photo, [Outline.ellipse(60, 50, 30, 20)])
        np.testing.assert_allclose(crop[24, :, 0], 2 * (60 + 30 * ALONG), atol=1.01)
        np.testing.assert_allclose(crop[:, 24, 1], 2 * (50 + 20 * ALONG), atol=1.01)

    def test_several_come_in_their_order(self):
        s = scene(angles=(10, 20, 0))
        photo = s.photo(smooth)
        x, y = s.quad.center_px
        outlines = [s.quad, Outline.ellipse(x, y, 20, 10), Outline.quad(s.quad.corners_px + 9)]
        together = crops(photo, outlines, s.pose)
        for outline, crop in zip(outlines, together, strict=True):
            np.testing.assert_array_equal(crops(photo, [outline], s.pose)[0], crop)
        assert not np.array_equal(together[0], together[2])


class TestAliasing:
    """What is finer than a crop's pixels is averaged, not picked from."""

    @pytest.mark.parametrize("side", [75, 130, 200, 330, 800])
    @pytest.mark.parametrize("pose", [True, False])
    def test_stripes_become_grey(self, side, pose):
        photo = np.zeros((1000, 1000, 3), np.uint8)
        photo[:, ::2] = 200
        camera = Camera.from_fov(60, 1000, 1000)
        box = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * side + 90.3
        (crop,) = crops(photo, [Outline.quad(box)], pose_of(camera, np.eye(3)) if pose else None)
        # From 2 photo pixels a pixel on nothing is left; before, what an exact average leaves.
        assert np.ptp(crop) <= (6 if side > 100 else 90)
        assert crop.mean() == pytest.approx(100, abs=2)

    @pytest.mark.parametrize("side", [100, 150, 200, 400])
    def test_noise_is_averaged(self, side):
        photo = np.random.default_rng(1).integers(0, 256, (500, 500, 3), dtype=np.uint8)
        corners = np.array([[10, 20], [side, 10], [side + 30, side + 40], [20, side]])
        (crop,) = crops(photo, [Outline.quad(corners)])
        averaged = 74 * 48 / side
        assert crop.std() < 1.25 * averaged

    def test_edges_stay_sharp(self):
        """A black disc on white is antialiased within four pixels of the crop."""
        s = scene(angles=(10, -20, 5), half=(0.2, 0.2))
        radius = np.hypot(*np.meshgrid(ALONG, ALONG))
        photo = s.photo(lambda u, v: np.repeat(255.0 * (np.hypot(u, v)[:, None] > 0.6), 3, axis=1))
        (crop,) = crops(photo, [s.quad], s.pose)
        step = ALONG[1] - ALONG[0]
        assert (crop[radius < 0.6 - 2 * step] == 0).all()
        assert (crop[radius > 0.6 + 2 * step] == 255).all()

    @pytest.mark.parametrize("half", [(0.5, 0.02), (0.02, 0.4)], ids=str)
    def test_along_one_side_only(self, half):
        """Stripes across a long button: averaged along it, sharp across."""
        s = scene(half=half, at_px=(310.0, 245.0))
        long = int(half[1] > half[0])
        photo = np.zeros((480, 640, 3), np.uint8)
        stripes = np.moveaxis(photo, 1 - long, 0)
        stripes[::2] = 200
        (crop,) = crops(photo, [s.quad], s.pose)
        assert np.ptp(crop) <= 200 / 11  # an average over 11 pixels leaves one of 11


class TestBorder:
    def test_the_edge_goes_on(self):
        photo = np.full((60, 80, 3), 50, np.uint8)
        photo[:, 0] = 200, 100, 0
        photo[0, 1:] = 0, 0, 250
        box = np.array([[-20.5, 10.5], [19.5, 10.5], [19.5, 50.5], [-20.5, 50.5]])
        (left,) = crops(photo, [Outline.quad(box)])
        x = -0.5 + 20 * ALONG
        assert (left[:, x < -0.5] == [200, 100, 0]).all()
        assert (left[:, x > 1.5] == 50).all()
        (top,) = crops(photo, [Outline.quad(np.add(box, (40, -30)))])
        assert (top[0.5 + 20 * ALONG < -0.5] == [0, 0, 250]).all()

    @pytest.mark.parametrize("side", [30, 200])
    @pytest.mark.parametrize("corner", [(-300, -300), (900, 20), (50, 900), (1e6, -1e6)], ids=str)
    def test_outside_there_is_the_nearest_edge(self, side, corner):
        photo = np.random.default_rng(2).integers(0, 256, (480, 640, 3), dtype=np.uint8)
        box = np.array([[0, 0], [1, 0], [1, 1], [0, 1]]) * side + corner
        (crop,) = crops(photo, [Outline.quad(box)], pose_of(PLAIN, np.eye(3)))
        beside = np.array(corner) < 0, np.array(corner) > [640, 480]
        if sum(beside[0] | beside[1]) == 2:
            nearest = photo[-1 if beside[1][1] else 0, -1 if beside[1][0] else 0]
            assert (crop == (nearest if side < 100 else crop[0, 0])).all()
        else:  # a column or row of the edge goes on
            assert (np.ptp(crop, axis=int(beside[1][0])) <= 1).all()

    def test_large_ones_at_the_border_are_halved_in_place(self):
        """The sides of what is halved are odd there; nothing moves for that."""
        side = 201
        y, x = np.mgrid[:side, :side]
        photo = np.stack([x, y, 0 * x], axis=-1).astype(np.uint8)
        edge = side - 0.5
        box = [[-0.5, -0.5], [edge, -0.5], [edge, edge], [-0.5, edge]]
        (crop,) = crops(photo, [Outline.quad(box)])
        shown = np.clip(100 + 100.5 * ALONG, 0, 200)
        np.testing.assert_allclose(crop[24, 2:-2, 0], shown[2:-2], atol=1.6)
        np.testing.assert_allclose(crop[2:-2, 24, 1], shown[2:-2], atol=1.6)

    @pytest.mark.parametrize("axes", [(1e7, 1e7), (1e7, 1e-3), (5000, 3)], ids=str)
    def test_absurd_outlines_do_no_harm(self, axes):
        photo = np.full((60, 80, 3), 50, np.uint8)
        assert (crops(photo, [Outline.ellipse(40, 30, *axes, 30)]) == 50).all()


class TestWherePoseOrLensEnd:
    def test_behind_the_horizon_the_outline_counts(self):
        photo = np.random.default_rng(6).integers(0, 256, (480, 640, 3), dtype=np.uint8)
        turned = pose_of(PLAIN, paper_rotation(0, 89.0, 0))
        outline = Outline.quad([[20, 100], [120, 100], [120, 200], [20, 200]])
        other = Outline.quad([[520, 100], [620, 100], [620, 200], [520, 200]])
        hidden = [
            np.array_equal(crops(photo, [o], turned), crops(photo, [o])) for o in (outline, other)
        ]
        assert sorted(hidden) == [False, True]

    def test_beyond_the_lens_model_the_outline_counts(self):
        # k1 = -0.3 folds at a radius of 1.054: the photo's corners show nothing.
        camera = Camera.from_matrix(
            [[300.0, 0, 320], [0, 300, 240], [0, 0, 1]], 640, 480, distortion=(-0.3, 0, 0, 0)
        )
        photo = np.random.default_rng(3).integers(0, 256, (480, 640, 3), dtype=np.uint8)
        outline = Outline.quad([[10, 10], [60, 10], [60, 60], [10, 60]])
        pose = pose_of(camera, np.eye(3))
        np.testing.assert_array_equal(crops(photo, [outline], pose), crops(photo, [outline]))

    def test_slivers_are_cut_by_their_box(self):
        """A quad that its own corners would take behind the horizon of its plane."""
        photo = np.full((200, 300, 3), 70, np.uint8)
        outline = Outline.quad([[100, 99.9], [100.2, 100], [100.1, 180], [20, 100]])
        assert (crops(photo, [outline]) == 70).all()


@QUICK
@given(
    st.integers(-60, 60),
    st.integers(-60, 60),
    st.lists(st.floats(-8, 8), min_size=8, max_size=8),
    st.sampled_from([20, 50, 90]),
)
def test_moves_with_the_photo(dx, dy, bends, side):
    photo = np.random.default_rng(4).integers(0, 256, (400, 400, 3), dtype=np.uint8)
    corners = 150 + np.array([[0, 0], [side, 0], [side, side], [0, side]])
    corners = corners + np.reshape(bends, (4, 2)) * side / 50
    moved = np.roll(photo, (dy, dx), axis=(0, 1))
    one = crops(photo, [Outline.quad(corners)]).astype(int)
    other = crops(moved, [Outline.quad(np.add(corners, (dx, dy)))]).astype(int)
    assert np.abs(one - other).max() <= 1


def test_result_is_fixed_bytes():
    photo = np.zeros((60, 80, 3), np.uint8)
    found = crops(photo, [Outline.ellipse(40, 30, 10, 10)] * 3)
    assert (found.shape, found.dtype) == ((3, 48, 48, 3), np.uint8)
    with pytest.raises(ValueError, match="read-only"):
        found[0] = 1
    assert crops(photo, []).shape == (0, 48, 48, 3)
    assert crops(photo, [], pose_of(Camera.from_fov(60, 80, 60), np.eye(3))).shape[0] == 0


def test_other_pictures_are_taken_as_rgb():
    grey = np.random.default_rng(5).integers(0, 256, (60, 80), dtype=np.uint8)
    outline = Outline.ellipse(40, 30, 10, 10)
    expected = crops(np.repeat(grey[..., None], 3, axis=2), [outline])
    np.testing.assert_array_equal(crops(grey, [outline]), expected)


@pytest.mark.parametrize(
    ("photo", "word"),
    [
        ("hall.jpg", "photo"),
        (np.zeros((480, 640, 3), np.int64), "image"),
        (np.zeros((640, 480, 3), np.uint8), "480x640"),
    ],
)
def test_wrong_input_is_named(photo, word):
    with pytest.raises(InputError, match=word):
        crops(photo, [Outline.ellipse(40, 30, 10, 10)], pose_of(PLAIN, np.eye(3)))
