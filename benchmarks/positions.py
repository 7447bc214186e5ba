"""Where buttons are in metres: how right, and whether the stated deviations hold.

    make bench            all of it (three minutes)
    python benchmarks/positions.py --quick      a twentieth of it; writes nothing

Simulated views from 0.5 m with the paper's camera, each angle uniform in ±40°, corner noise of
0.3 px, one outlier button in a tenth of the scenes (not counted: nobody knows where it is); and
pictures of the same panels, of which nothing is known but the camera and the pitch.
"""

from __future__ import annotations

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import argparse
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from fronto import Camera, Outline, PanelPose, Rectifier, estimate_pose
from fronto.metric import UnfitLength
from fronto.positions import Positions, locate
from fronto.synth import (
    Layout,
    Scene,
    car_layout,
    hall_layout,
    imprecise,
    observe,
    sample_scene,
)
from fronto.synth.render import render_panel
from report import Target, describe_machine, markdown_table, write_between, write_json
from scenes import LOOKS

ROOT = Path(__file__).resolve().parent.parent
DISTANCE_M, SIGMA_PX = 0.5, 0.3
CHI2_95_3 = 7.815  # 95 % quantile of χ² with three degrees of freedom
MAIN, RENDERS = "car, pitch", "renders, pitch"
#: Of a depth image: standard deviation of a pixel, share without depth.
DEPTH_NOISE, DEPTH_HOLES = 0.004, 0.2

LayoutMaker = Callable[[np.random.Generator], Layout]
Lengths = Callable[[np.random.Generator, Scene], dict[str, Any]]


@dataclass
class Errors:
    """Of buttons of ok results, metres; `known` counts those with positions."""

    scenes: int = 0
    ok: int = 0
    known: int = 0
    total: list[float] = field(default_factory=list)
    lateral: list[float] = field(default_factory=list)
    covered: list[float] = field(default_factory=list)

    def add(self, located: Positions, truth: dict[int, np.ndarray]) -> None:
        self.known += bool(located)
        for position in located.positions:
            true = truth.get(position.button)
            if true is None:
                continue
            error = position.center_m - true
            ray = true / np.linalg.norm(true)
            self.total.append(float(np.linalg.norm(error)))
            self.lateral.append(float(np.linalg.norm(error - (error @ ray) * ray)))
            chi2 = error @ np.linalg.solve(position.covariance, error)
            self.covered.append(float(chi2 < CHI2_95_3))

    def row(self, name: str) -> dict[str, str]:
        def mm(values: list[float], q: float, digits: int) -> str:
            return f"{1e3 * np.quantile(values, q):.{digits}f}" if values else "-"

        return {
            "": name,
            "scenes": str(self.scenes),
            "ok": f"{100 * self.ok / self.scenes:.0f} %",
            "with positions": f"{100 * self.known / max(self.ok, 1):.0f} %",
            "buttons": str(len(self.total)),
            "error, median mm": mm(self.total, 0.5, 1),
            "95th percentile": mm(self.total, 0.95, 1),
            "lateral, median mm": mm(self.lateral, 0.5, 2),
            "95 % ellipsoid holds": f"{np.mean(self.covered):.3f}" if self.covered else "-",
        }


def centers_m(scene: Scene) -> np.ndarray:
    """True centres in the camera frame, (n, 3)."""
    flat = np.concatenate([scene.layout.centers, np.zeros((len(scene.layout.buttons), 1))], axis=1)
    return np.asarray((flat + scene.translation) @ scene.rotation)


def nominal_pitch(layout: Layout) -> tuple[float | None, float | None]:
    """Between neighbouring columns and rows, as it was meant before `imprecise`."""
    steps: list[float | None] = []
    for values in layout.centers.T:
        ordered = np.sort(values)
        lines = np.split(ordered, np.flatnonzero(np.diff(ordered) > 0.01) + 1)
        means = [float(line.mean()) for line in lines]
        steps.append((means[-1] - means[0]) / (len(means) - 1) if len(means) > 1 else None)
    return steps[0], steps[1]


def pitch(_: np.random.Generator, scene: Scene) -> dict[str, Any]:
    return {"pitch_m": nominal_pitch(scene.layout)}


def pitch_down(_: np.random.Generator, scene: Scene) -> dict[str, Any]:
    return {"pitch_m": (None, nominal_pitch(scene.layout)[1])}


def size(_: np.random.Generator, scene: Scene) -> dict[str, Any]:
    return {"button_size_m": scene.layout.buttons[0].width}


def middle(rng: np.random.Generator, scene: Scene) -> dict[str, Any]:
    """The depth of the panel's middle, 1 % off."""
    point = scene.translation @ scene.rotation
    x, y = scene.camera.project(point[None])[0]
    return {"depth": (float(x), float(y), float(point[2] * rng.normal(1, 0.01)))}


def depth_image(rng: np.random.Generator, scene: Scene) -> dict[str, Any]:
    """A depth image in millimetres with noise, holes and a common error of 0.3 %."""
    camera = scene.camera
    x, y = np.meshgrid(np.arange(camera.width_px), np.arange(camera.height_px))
    facing = camera.rays(np.stack([x.ravel(), y.ravel()], axis=1)) @ scene.rotation[2]
    depth = np.where(facing > 0.05, scene.translation[2] / np.maximum(facing, 0.05), 0.0)
    depth = depth * rng.normal(1, 0.003) + rng.normal(0, DEPTH_NOISE, depth.shape)
    depth[rng.uniform(size=depth.shape) < DEPTH_HOLES] = 0
    millimetres = np.rint(1e3 * depth.clip(0, 60)).astype(np.uint16)
    return {"depth": millimetres.reshape(x.shape), "std_m": 0.003 * DISTANCE_M}


def circles(rng: np.random.Generator) -> Layout:
    return car_layout(rng, shape="ellipse")


def as_made(rng: np.random.Generator) -> Layout:
    return imprecise(rng, car_layout(rng), 0.0002)


def hall3(rng: np.random.Generator) -> Layout:
    return hall_layout(rng, 3)


@dataclass(frozen=True)
class Cell:
    """One row of the table."""

    name: str
    layout: LayoutMaker
    lengths: Lengths
    scenes: int = 200
    known_focal: bool = True


CELLS = [
    Cell(MAIN, car_layout, pitch, 1000),
    Cell("car, pitch of the columns only", car_layout, pitch_down),
    Cell("car, places and sizes 0.2 mm off, pitch", as_made, pitch),
    Cell("car, circles, pitch", circles, pitch),
    Cell("car, button size", car_layout, size),
    Cell("car, depth at a pixel, 1 %", car_layout, middle),
    Cell("car, depth image", car_layout, depth_image, 100),
    Cell("car, focal length unknown, pitch", car_layout, pitch, known_focal=False),
    Cell("hall, 3 buttons, pitch", hall3, pitch),
    Cell("hall, 3 buttons, button size", hall3, size),
]


def view(rng: np.random.Generator, layout: LayoutMaker) -> Scene:
    return sample_scene(rng, layout, distance_m=(DISTANCE_M, DISTANCE_M))


def simulated(cell: Cell, index: int, share: float) -> Errors:
    rng = np.random.default_rng([2027, index])
    errors = Errors()
    for _ in range(max(int(share * cell.scenes), 30)):
        scene = observe(rng, view(rng, cell.layout), SIGMA_PX)
        lengths = cell.lengths(rng, scene)
        camera = scene.camera
        if not cell.known_focal:
            camera = Camera.default(camera.width_px, camera.height_px)
        pose = estimate_pose(scene.outlines, camera)
        truth = {k: c for k, c in enumerate(centers_m(scene)) if k != scene.outlier}
        count(errors, pose, list(scene.outlines), lengths, truth)
    return errors


def count(
    errors: Errors,
    pose: PanelPose,
    outlines: list[Outline],
    lengths: dict[str, Any],
    truth: dict[int, np.ndarray],
) -> None:
    errors.scenes += 1
    if pose.status != "ok":
        return
    errors.ok += 1
    try:
        errors.add(locate(pose, outlines=outlines, **lengths), truth)
    except UnfitLength:
        return


def rendered(photos: int, ways: dict[str, Lengths], seed: int) -> dict[str, Errors]:
    """Pictures, from which the network finds the buttons; the same for each way to measure."""
    rng = np.random.default_rng(seed)
    errors = {name: Errors() for name in ways}
    for k in range(photos):
        scene = view(rng, car_layout)
        image = render_panel(
            scene.layout, scene.camera, scene.rotation, scene.translation,
            rng=rng, look=LOOKS[k % len(LOOKS)], noise_std=2.0,
        )  # fmt: skip
        panel = Rectifier(camera=scene.camera)(image)
        outlines = [button.outline for button in panel.buttons]
        for name, lengths in ways.items():
            truth = matched(scene, outlines)
            count(errors[name], panel.pose, outlines, lengths(rng, scene), truth)
    return errors


def matched(scene: Scene, outlines: list[Outline]) -> dict[int, np.ndarray]:
    """True centres of the outlines that lie on a button."""
    truth = np.array([outline.center_px for outline in scene.truth])
    boxes = np.array([outline.box_px for outline in scene.truth])
    reach = 0.35 * np.sqrt((boxes[:, 2:] - boxes[:, :2]).prod(axis=1))
    result = {}
    for k, outline in enumerate(outlines):
        apart = np.linalg.norm(truth - outline.center_px, axis=1)
        nearest = int(apart.argmin())
        if apart[nearest] < reach[nearest]:
            result[k] = centers_m(scene)[nearest]
    return result


def targets(main: Errors, renders: Errors) -> list[Target]:
    rows = []
    for name, errors in ((MAIN, main), (RENDERS, renders)):
        total, lateral = (1e3 * np.array(v) for v in (errors.total, errors.lateral))
        held = float(np.mean(errors.covered))
        rows += [
            Target(f"{name}: error, median", float(np.median(total)), 3, True, ".2f", " mm"),
            Target("95th percentile", float(np.quantile(total, 0.95)), 8, True, ".2f", " mm"),
            Target("lateral, median", float(np.median(lateral)), 0.5, True, ".2f", " mm"),
            Target("95 % ellipsoid holds, at least", held, 0.9),
            Target("95 % ellipsoid holds, at most", held, 0.99, True),
        ]
    return rows


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a twentieth; writes nothing")
    parser.add_argument("--only", default="", help="run only cells whose name contains this")
    arguments = parser.parse_args()
    share = 0.05 if arguments.quick else 1.0
    results: dict[str, Errors] = {}
    for index, cell in enumerate(CELLS):
        if arguments.only in cell.name:
            results[cell.name] = simulated(cell, index, share)
            print(results[cell.name].row(cell.name), flush=True)
    if arguments.only in RENDERS:
        ways = {RENDERS: pitch, "renders, button size": size}
        results |= rendered(4 if arguments.quick else 60, ways, 2028)
    table = markdown_table([errors.row(name) for name, errors in results.items()])
    print("\n" + table)
    if arguments.only:
        return
    reached = targets(results[MAIN], results[RENDERS])
    goals = markdown_table([target.row() for target in reached])
    print("\n" + goals)
    if arguments.quick:
        return
    text = f"{goals}\n\n{table}\n\nMachine: {describe_machine()}."
    write_between(ROOT / "docs" / "positions.md", "positions", text)
    record = {name: errors.row(name) for name, errors in results.items()}
    write_json(ROOT / "benchmarks" / "results" / "positions.json", {"cells": record})


if __name__ == "__main__":
    main()
