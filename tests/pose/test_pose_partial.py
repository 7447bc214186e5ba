"""Quads of which some sides are not seen: the seen ones count, the others do not mislead."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import fronto
from fronto.pose.rotation import angle_between, rotation_from_angles

K = [[400.0, 0, 319.5], [0, 400, 239.5], [0, 0, 1]]
ROTATION = rotation_from_angles(*np.radians([18.0, -14.0, 6.0]))


def scene(rows: int = 3, columns: int = 2) -> list[fronto.Outline]:
    """A small keypad, seen exactly."""
    square = np.array([(-1, -1), (1, -1), (1, 1), (-1, 1)]) * 0.016
    outlines = []
    for i in range(rows):
        for j in range(columns):
            corners = square + 0.05 * np.array([j - (columns - 1) / 2, i - (rows - 1) / 2])
            points = np.column_stack([corners, np.full(4, 0.45)])
            seen = (points - (0, 0, 0.45)) @ ROTATION + (0, 0, 0.45)
            pixels = seen @ np.array(K).T
            outlines.append(fronto.Outline.quad(pixels[:, :2] / pixels[:, 2:], std_px=0.3))
    return outlines


def error_deg(outlines: list[fronto.Outline]) -> float:
    pose = fronto.estimate_pose(outlines, fronto.Camera.from_matrix(K, 640, 480))
    return float(np.degrees(angle_between(pose.rotation, ROTATION)))


def cut(outline: fronto.Outline, share: float) -> fronto.Outline:
    """Its right part gone: the right side stands where the photo ends."""
    corners = np.array(outline.corners_px)
    corners[1] += share * (corners[0] - corners[1])
    corners[2] += share * (corners[3] - corners[2])
    return replace(outline, corners_px=corners, truncated=True, seen=(True, False, True, True))


@pytest.mark.parametrize("share", [0.2, 0.5])
def test_a_cut_button_does_not_mislead(share: float) -> None:
    outlines = scene()
    outlines[1] = cut(outlines[1], share)
    outlines[3] = cut(outlines[3], share)
    assert error_deg(outlines) < 0.3


def test_cut_buttons_alone_fix_the_pose_by_their_seen_sides() -> None:
    outlines = [cut(o, 0.4) for o in scene(4, 1)]
    said_whole = [replace(o, seen=(True, True, True, True)) for o in outlines]
    assert error_deg(outlines) < min(2.0, error_deg(said_whole))


def test_the_seen_sides_of_a_cut_button_help() -> None:
    noise = np.random.default_rng(4)
    outlines = [
        replace(o, corners_px=np.array(o.corners_px) + noise.normal(0, 0.4, (4, 2)))
        for o in scene(1, 2)
    ]
    blind = [*outlines[:1], replace(cut(outlines[1], 0.3), seen=(False, False, False, True))]
    sighted = [*outlines[:1], cut(outlines[1], 0.3)]
    camera = fronto.Camera.from_matrix(K, 640, 480)
    spread = [
        np.sqrt(np.trace(fronto.estimate_pose(o, camera).covariance)) for o in (sighted, blind)
    ]
    assert spread[0] < spread[1]
