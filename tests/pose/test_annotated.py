"""Real photos with outlines drawn by hand: the lines that were not used must come out straight."""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from fronto import Camera, Outline, PanelPose, estimate_pose

LABELS = Path(__file__).parents[3] / "shared" / "data" / "annotated" / "labels"


@dataclass(frozen=True)
class Photo:
    """One annotated photo and what came of its sure outlines."""

    name: str
    buttons: int
    pose: PanelPose
    off_deg: np.ndarray


def outline_of(button):
    more = {"text": button["text"], "truncated": bool(button.get("truncated"))}
    if button["shape"] == "ellipse":
        return Outline.ellipse(**button["ellipse"], **more)
    return Outline.quad(button["corners"], odd=bool(button.get("odd")), **more)


def off_axis_deg(segments, pose, axis):
    """How far rectified segments (n, 4) are from their axis, degrees in [-90, 90)."""
    if not len(segments):
        return np.zeros(0)
    K = pose.camera.matrix
    points = np.concatenate([np.reshape(segments, (-1, 2, 2)), np.ones((len(segments), 2, 1))], 2)
    plane = points @ (K @ pose.rotation @ np.linalg.inv(K)).T
    ends = plane[..., :2] / plane[..., 2:]
    dx, dy = (ends[:, 1] - ends[:, 0]).T
    angle = np.degrees(np.arctan2(dy, dx)) - 90 * axis
    return (angle + 90) % 180 - 90


@pytest.fixture(scope="module")
def photos():
    files = sorted(LABELS.glob("*.json"))
    if not files:
        pytest.skip("the annotated photos are not next to the repository (shared/data/annotated)")
    result = []
    for file in files:
        label = json.loads(file.read_text(encoding="utf-8"))
        sure = [outline_of(b) for b in label["buttons"] if not b.get("unsure")]
        pose = estimate_pose(sure, Camera.default(label["width"], label["height"]))
        off = [
            off_axis_deg(label[key], pose, axis)
            for axis, key in enumerate(("horizontal", "vertical"))
        ]
        result.append(Photo(label["image"], len(sure), pose, np.concatenate(off)))
    return result


def test_horizontals_and_verticals_come_out_straight(photos):
    off = {p.name: np.abs(p.off_deg).mean() for p in photos if p.buttons >= 2 and len(p.off_deg)}
    assert len(off) >= 10
    values = np.array(list(off.values()))
    assert np.median(values) <= 0.4, off
    assert np.quantile(values, 0.9) <= 1.2, off
    assert values.max() < 5.0, off


def test_no_photo_is_flipped(photos):
    for photo in photos:
        assert np.abs(photo.off_deg).max(initial=0.0) < 20.0, photo.name


def test_trusted_photos_are_straight(photos):
    trusted = [p for p in photos if p.pose.status == "ok"]
    assert len(trusted) >= len(photos) / 2
    for photo in trusted:
        assert np.abs(photo.off_deg).mean() < 1.5, photo.name


def test_single_buttons_are_not_trusted(photos):
    single = [p for p in photos if p.buttons == 1]
    assert single
    for photo in single:
        assert photo.pose.status in ("uncertain", "degenerate"), photo.name


def test_photos_without_sure_buttons(photos):
    for photo in photos:
        assert (photo.pose.status == "no_buttons") == (photo.buttons == 0), photo.name
