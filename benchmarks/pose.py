"""Rotation error, rectification error, honesty and speed of the pose solvers, side by side.

    make bench            the whole table (about eight minutes)
    python benchmarks/pose.py --quick      a twentieth of it

Scenes: `fronto.synth` (the paper's camera, each angle uniform in ±40°, 0.3-0.8 m, Gaussian
corner noise, one outlier button in a tenth of the scenes). Both solvers see the same
scenes in one process; times are medians of single calls on one thread.
"""

from __future__ import annotations

import os

for variable in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
    os.environ.setdefault(variable, "1")

import argparse
import json
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from fronto import Camera, estimate_pose
from fronto.evaluate import aspect_errors, edge_angles_deg, rotation_error_deg
from fronto.evaluate.rectification import rectified_points
from fronto.pose.criteria import cos_norm
from fronto.pose.rotation import rotation_log
from fronto.results import PanelPose
from fronto.synth import (
    PAPER_CAMERA,
    Layout,
    LayoutButton,
    Scene,
    car_layout,
    circle_layout,
    hall_layout,
    imprecise,
    observe,
    sample_scene,
)
from report import describe_machine, markdown_table, write_between

ROOT = Path(__file__).resolve().parent.parent
LayoutMaker = Callable[[np.random.Generator], Layout]
CHI2_95_3 = 7.815  # 95 % quantile of χ² with three degrees of freedom


@dataclass(frozen=True)
class Cell:
    """One row of the table: a kind of scene at one noise level."""

    name: str
    layout: LayoutMaker
    sigma_px: float
    scenes: int
    grid_scenes: int
    target: str = ""
    min_side_px: float = 0.0
    spread: float = 1.0
    known_focal: bool = True
    square: bool = True


def hall3(rng: np.random.Generator) -> Layout:
    return hall_layout(rng, 3)


def circles4(rng: np.random.Generator) -> Layout:
    return circle_layout(rng, 4)


def circles_car(rng: np.random.Generator) -> Layout:
    return car_layout(rng, shape="ellipse")


def circles3(rng: np.random.Generator) -> Layout:
    places = [(0.0, k * 0.05) for k in (-1, 0, 1)]
    return Layout("hall", tuple(LayoutButton(x, y, 0.03, 0.03, "ellipse") for x, y in places))


def as_made(layout: LayoutMaker) -> LayoutMaker:
    """Panels whose buttons are 0.2 mm off in place and size."""
    return lambda rng: imprecise(rng, layout(rng), 0.0002)


CELLS = [
    Cell("hall, 3 buttons", hall3, 0.3, 1000, 150, "1.4 / 4.5"),
    Cell("hall, 3 buttons", hall3, 0.5, 500, 150),
    Cell("hall, 3 buttons", hall3, 1.0, 500, 150),
    Cell("hall, 2-3 buttons", hall_layout, 0.3, 1000, 0),
    Cell("hall, sides >= 60 px", hall3, 0.3, 500, 150, "0.4 / 0.9", min_side_px=60),
    Cell("hall, photo's middle half", hall3, 0.3, 1000, 0, spread=0.5),
    Cell("hall, squareness unknown", hall3, 0.3, 500, 0, square=False),
    Cell("hall, 0.2 mm off", as_made(hall3), 0.3, 500, 0),
    Cell("hall, sides >= 60 px, 0.2 mm off", as_made(hall3), 0.3, 500, 0, min_side_px=60),
    Cell("car, 12-20 buttons", car_layout, 0.3, 1000, 50, "0.5 / 1.6"),
    Cell("car, 12-20 buttons", car_layout, 0.5, 500, 50, "0.7 / 2.8"),
    Cell("car, 12-20 buttons", car_layout, 1.0, 500, 50),
    Cell("car, 0.2 mm off", as_made(car_layout), 0.3, 500, 0),
    Cell("hall, 3 circles", circles3, 0.3, 500, 0),
    Cell("circles, 4", circles4, 0.3, 500, 0, "0.6 / 3.3"),
    Cell("circles, 12-20", circles_car, 0.3, 500, 0, "0.25 / 0.9"),
    Cell("car, focal length unknown", car_layout, 0.3, 500, 0, known_focal=False),
]


def measure(scene: Scene, pose: PanelPose, seconds: float) -> dict[str, float]:
    quads = [k for k, o in enumerate(scene.truth) if o.corners_px is not None]
    true_corners = scene.corners_px
    row = {
        "rotation_deg": rotation_error_deg(pose.rotation, scene.rotation),
        "edge_deg": float(np.abs(edge_angles_deg(pose, true_corners)).mean()),
        "aspect": float(np.abs(aspect_errors(pose, true_corners, 1.0)).mean()),
        "cos_true": float(cos_norm(rectified_points(pose, true_corners))),
        "ok": float(pose.status == "ok"),
        "ambiguous": float(bool(pose.alternatives)),
        "ms": 1e3 * seconds,
        "covered": np.nan,
        "cos_noisy": np.nan,
    }
    if quads:
        noisy = np.array([scene.outlines[k].corners_px for k in quads])
        row["cos_noisy"] = float(cos_norm(rectified_points(pose, noisy)))
    if np.isfinite(pose.covariance).all():
        w = rotation_log(pose.rotation.T @ scene.rotation)
        row["covered"] = float(w @ np.linalg.solve(pose.covariance, w) < CHI2_95_3)
    return row


def run(cell: Cell, index: int, share: float) -> dict[str, dict[str, np.ndarray]]:
    rng = np.random.default_rng([2026, index])
    count, grid_count = max(int(cell.scenes * share), 30), int(np.ceil(cell.grid_scenes * share))
    results: dict[str, list[dict[str, float]]] = {"refine": [], "grid": []}
    for k in range(count):
        scene = sample_scene(rng, cell.layout, min_side_px=cell.min_side_px, spread=cell.spread)
        scene = observe(rng, scene, cell.sigma_px)
        camera = scene.camera
        if not cell.known_focal:
            camera = Camera.default(camera.width_px, camera.height_px)
        for solver in ("refine", "grid"):
            if solver == "grid" and k >= grid_count:
                continue
            options = {"square": cell.square} if solver == "refine" else {}
            start = time.perf_counter()
            pose = estimate_pose(scene.outlines, camera, solver=solver, **options)
            seconds = time.perf_counter() - start
            results[solver].append(measure(scene, pose, seconds))
    return {
        solver: {key: np.array([row[key] for row in rows]) for key in rows[0]}
        for solver, rows in results.items()
        if rows
    }


def pair(values: np.ndarray, digits: int = 2) -> str:
    return f"{np.median(values):.{digits}f} / {np.quantile(values, 0.95):.{digits}f}"


def mean(values: np.ndarray, digits: int = 3) -> str:
    values = values[np.isfinite(values)]
    return f"{values.mean():.{digits}f}" if len(values) else "-"


def summary(cell: Cell, solver: str, r: dict[str, np.ndarray]) -> dict[str, str]:
    ok = r["ok"] > 0
    refine = solver == "refine"
    return {
        "scenes": cell.name,
        "σ px": f"{cell.sigma_px:g}",
        "solver": solver,
        "n": str(len(ok)),
        "rotation error °": pair(r["rotation_deg"]),
        "target": cell.target if refine else "",
        "edge angle °": pair(r["edge_deg"]),
        "aspect error %": pair(100 * r["aspect"], 1),
        "‖Cos‖ true": f"{np.median(r['cos_true']):.3f}",
        "‖Cos‖ seen": "-" if np.isnan(r["cos_noisy"]).all() else f"{np.median(r['cos_noisy']):.3f}",
        "95 % covers": mean(r["covered"]) if refine else "-",
        "two poses": mean(r["ambiguous"]) if refine else "-",
        "ok": mean(r["ok"]) if refine else "-",
        "worst ok °": f"{r['rotation_deg'][ok].max():.1f}" if ok.any() else "-",
        "ok > 10°": str(int((r["rotation_deg"][ok] > 10).sum())) if refine else "-",
        "ms": f"{np.median(r['ms']):.2f}",
    }


def speed(share: float) -> list[dict[str, str]]:
    """Times at the sizes that the targets name, solvers in turn on the same scenes."""
    rows = []
    rng = np.random.default_rng(7)
    panels: dict[str, LayoutMaker] = {
        "hall, 3 buttons": hall3,
        "car, 20 buttons": lambda r: car_layout(r, 20),
        "car, 20 circles": lambda r: car_layout(r, 20, shape="ellipse"),
    }
    for name, layout in panels.items():
        solvers = ("refine",) if "circles" in name else ("refine", "grid")
        times: dict[str, list[float]] = {"refine": [], "grid": []}
        for k in range(max(int(300 * share), 30)):
            scene = observe(rng, sample_scene(rng, layout), 0.3)
            for solver in solvers:
                if solver == "grid" and k >= 5:
                    continue
                options = {"square": True} if solver == "refine" else {}
                start = time.perf_counter()
                estimate_pose(scene.outlines, PAPER_CAMERA, solver=solver, **options)
                times[solver].append(1e3 * (time.perf_counter() - start))
        refine = np.median(times["refine"])
        grid = np.median(times["grid"]) if times["grid"] else np.nan
        rows.append(
            {
                "scenes": name,
                "refine ms": f"{refine:.2f}",
                "fastest refine ms": f"{min(times['refine']):.2f}",
                "grid ms": f"{grid:.0f}" if times["grid"] else "-",
                "grid / refine": f"{grid / refine:.0f}" if times["grid"] else "-",
            }
        )
    return rows


def figure(results: list[tuple[Cell, dict[str, dict[str, np.ndarray]]]], path: Path) -> None:
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    fig, (left, right) = plt.subplots(1, 2, figsize=(11, 4.2), layout="constrained")
    shown = [item for item in results if "grid" in item[1] and item[0].sigma_px in (0.3, 1.0)]
    for k, (cell, solvers) in enumerate(shown):
        for solver, style in (("refine", "-"), ("grid", ":")):
            error = np.sort(solvers[solver]["rotation_deg"])
            left.plot(
                np.maximum(error, 0.02),
                (np.arange(len(error)) + 1) / len(error),
                style,
                color=f"C{k}",
                label=f"{cell.name}, σ {cell.sigma_px:g} px" if solver == "refine" else None,
            )
    left.set(xscale="log", xlabel="rotation error (degrees)", ylabel="share of scenes")
    left.set_title("refine (solid) and the paper's grid search (dotted)")
    left.grid(alpha=0.3)
    left.legend(fontsize=8, loc="lower right")
    grid = [s["grid"] for _, s in shown]
    cos = np.concatenate([g["cos_noisy"] for g in grid])
    error = np.concatenate([g["rotation_deg"] for g in grid])
    right.loglog(np.maximum(error, 0.02), cos, ".", label="grid search")
    refine = [s["refine"] for _, s in shown]
    cos = np.concatenate([g["cos_noisy"][:60] for g in refine])
    error = np.concatenate([g["rotation_deg"][:60] for g in refine])
    right.loglog(np.maximum(error, 0.02), cos, ".", label="refine")
    right.set(xlabel="rotation error (degrees)", ylabel="‖Cos‖₂ of the seen corners")
    right.set_title("A small ‖Cos‖₂ does not mean a right rotation")
    right.grid(alpha=0.3)
    right.legend(fontsize=8)
    path.parent.mkdir(parents=True, exist_ok=True)
    fig.savefig(path, dpi=110)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--quick", action="store_true", help="a twentieth of the scenes; writes nothing"
    )
    parser.add_argument("--only", default="", help="run only cells whose name contains this")
    arguments = parser.parse_args()
    share = 0.05 if arguments.quick else 1.0

    results, table = [], []
    for index, cell in enumerate(CELLS):
        if arguments.only not in cell.name:
            continue
        solvers = run(cell, index, share)
        results.append((cell, solvers))
        rows = [summary(cell, solver, r) for solver, r in solvers.items()]
        table += rows
        for row in rows:
            print(", ".join(f"{key} {value}" for key, value in row.items() if value), flush=True)
    speeds = speed(share)
    text = markdown_table(table) + "\n\n" + markdown_table(speeds)
    print("\n" + text)
    if arguments.quick or arguments.only:
        return
    figure(results, ROOT / "docs" / "images" / "pose_benchmark.png")
    machine = describe_machine()
    out = ROOT / "benchmarks" / "results" / "pose.json"
    out.parent.mkdir(exist_ok=True)
    record = {"machine": machine, "table": table, "speed": speeds}
    out.write_text(json.dumps(record, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    write_between(ROOT / "docs" / "benchmarks.md", "pose", f"{text}\n\nMachine: {machine}.")
    short = ("scenes", "σ px", "solver", "rotation error °", "edge angle °", "ok", "ok > 10°", "ms")
    targeted = {row["scenes"] for row in table if row["target"]}
    shown = [row for row in table if row["scenes"] in targeted and row["σ px"] == "0.3"]
    brief = [{key: row[key] for key in short} for row in shown]
    write_between(ROOT / "README.md", "bench", markdown_table(brief))


if __name__ == "__main__":
    main()
