"""Simulated panels and cameras with exact ground truth, shared by tests and benchmarks."""

from fronto.synth.layouts import (
    Layout,
    LayoutButton,
    car_layout,
    circle_layout,
    hall_layout,
    imprecise,
)
from fronto.synth.scene import PAPER_CAMERA, Scene, observe, sample_scene

__all__ = [
    "PAPER_CAMERA",
    "Layout",
    "LayoutButton",
    "Scene",
    "car_layout",
    "circle_layout",
    "hall_layout",
    "imprecise",
    "observe",
    "sample_scene",
]
