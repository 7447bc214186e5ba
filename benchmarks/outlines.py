"""How exact outlines are: on drawn buttons, on renders and photos through the network; how fast.

    make bench            all of it (a few minutes)
    python benchmarks/outlines.py --quick      few of each kind; writes nothing

`--data` holds `annotated` (outlines of photos); where it is missing nothing is written.
"""

from __future__ import annotations

import argparse
import json
import math
import time
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from drawn import Drawing, buttons_drawn
from fronto import Camera, Outline, Outlines, Segments, estimate_pose, outline, segment
from fronto.evaluate import axis_angles_deg, rotation_error_deg
from fronto.grouping import overlaps
from fronto.images import as_rgb
from fronto.outlinefile import read_outlines
from fronto.synth.photo import render_photo
from report import SKIPPED, Target, describe_machine, markdown_table, rounded, write_between

ROOT = Path(__file__).resolve().parent.parent
DATA = ROOT.parent / "shared" / "data"
SIDES, RADII = (15, 30, 60), (0.0, 0.10, 0.25)
RENDERS, QUICK = 200, 30
#: None that anything was tuned on.
FIRST_SEED = 70_000
WAYS = ("hough", "masks", "photo")
#: Poses that are ok and no further off are good; and by how much they get better or worse.
RIGHT_DEG, CHANGED_DEG = 2.0, 0.5
SIZES = ((0, 20, "below 20 px"), (20, 40, "20 to 40 px"), (40, 1e9, "above 40 px"))


def found(segments: Segments, image: np.ndarray, way: str, *, lines: bool = False) -> Outlines:
    if way == "hough":
        return outline(segments, corners="hough")
    return outline(segments, image if way == "photo" else None, lines=lines)


@dataclass
class Errors:
    """Deviations of what was found from the truth."""

    corners: list[float] = field(default_factory=list)
    relative: list[float] = field(default_factory=list)
    normalised: list[float] = field(default_factory=list)
    ellipses: list[float] = field(default_factory=list)
    ellipses_normalised: list[float] = field(default_factory=list)
    iou: list[float] = field(default_factory=list)
    sizes: list[float] = field(default_factory=list)
    shapes: list[tuple[str, str]] = field(default_factory=list)
    missed: int = 0

    def add(self, truth: Outline, seen: Outline | None) -> None:
        if seen is None:
            self.missed += 1
            return
        x0, y0, x1, y1 = truth.box_px
        size = math.sqrt((x1 - x0) * (y1 - y0))
        self.shapes.append((form(truth), form(seen)))
        if self.shapes[-1] == ("quad", "quad"):
            off = seen.corners_px - truth.corners_px
            self.corners.append(float(np.sqrt(np.mean(off**2))))
            self.relative.append(float(np.sqrt(np.mean((off**2).sum(axis=1)))) / size)
            self.normalised.append(self.corners[-1] / seen.std_px)
            self.sizes.append(size)
        elif self.shapes[-1] == ("ellipse", "ellipse"):
            a, b = truth.ellipse_px, seen.ellipse_px
            off = np.array([a.cx - b.cx, a.cy - b.cy, a.a - b.a, a.b - b.b])
            self.ellipses.append(float(np.sqrt(np.mean(off**2))))
            self.ellipses_normalised.append(self.ellipses[-1] / seen.std_px)
            self.iou.append(overlap(a.points(128), b.points(128)))


def form(o: Outline) -> str:
    return "odd" if o.odd else o.shape


def overlap(first: np.ndarray, second: np.ndarray) -> float:
    """Intersection over union of two convex polygons."""
    a, b = first.astype(np.float32), second.astype(np.float32)
    shared = cv2.intersectConvexConvex(a, b)[0]
    return float(shared / (cv2.contourArea(a) + cv2.contourArea(b) - shared))


def matched(errors: Errors, truths: list[Outline], seen: Outlines, least: float = 0.5) -> None:
    """Compare each true outline with the one found that overlaps it the most."""
    boxes = np.array([o.box_px for o in seen.buttons]).reshape(-1, 4)
    for truth in truths:
        shared = overlaps(np.array(truth.box_px), boxes) if len(boxes) else np.zeros(0)
        best = int(shared.argmax()) if len(shared) else -1
        hit = best >= 0 and shared[best] >= least and not seen.buttons[best].truncated
        errors.add(truth, seen.buttons[best] if hit else None)


def root_mean_square(values: list[float]) -> float:
    return float(np.sqrt(np.mean(np.square(values)))) if values else math.nan


def drawn_text(count: int) -> tuple[str, dict[str, float]]:
    """Exact masks of drawn buttons: all three ways side by side."""
    rows, figures = [], {}
    for side in SIDES:
        for radius in RADII:
            errors = {way: Errors() for way in WAYS}
            for k in range(count):
                drawing = buttons_drawn(np.random.default_rng([side, k]), side, radius)
                compare(drawing, errors)
            rms = {way: root_mean_square(e.corners) for way, e in errors.items()}
            for way, value in rms.items():
                figures[f"{way}_{side}_{radius:g}"] = value
            rows.append(
                {
                    "side": f"{side} px",
                    "radius": f"{100 * radius:.0f} %",
                    "Hough": f"{rms['hough']:.2f}",
                    "lines on the mask's edges": f"{rms['masks']:.2f}",
                    "and on the photo's": f"{rms['photo']:.2f}",
                }
            )
    for radius_px in (10, 20, 40):
        errors = {way: Errors() for way in WAYS[1:]}
        for k in range(count):
            rng = np.random.default_rng([radius_px, 7, k])
            compare(buttons_drawn(rng, 2 * radius_px, None), errors)
        rms = {way: root_mean_square(e.ellipses) for way, e in errors.items()}
        figures |= {f"{way}_circle_{radius_px}": value for way, value in rms.items()}
        rows.append(
            {
                "side": f"circle, radius {radius_px} px",
                "radius": "",
                "Hough": "",
                "lines on the mask's edges": f"{rms['masks']:.2f}",
                "and on the photo's": f"{rms['photo']:.2f}",
            }
        )
    return markdown_table(rows), figures


def compare(drawing: Drawing, errors: dict[str, Errors]) -> None:
    for way, e in errors.items():
        matched(e, drawing.truths, found(drawing.segments, drawing.image, way))


@dataclass(frozen=True, eq=False)
class Scene:
    """A photo through the network, and what is known of it."""

    image: np.ndarray
    truths: list[Outline]
    segments: Segments
    camera: Camera
    rotation: np.ndarray | None = None
    horizontal: list[list[float]] = field(default_factory=list)
    vertical: list[list[float]] = field(default_factory=list)


def rendered(count: int) -> Iterator[Scene]:
    for k in range(count):
        photo = render_photo(np.random.default_rng(FIRST_SEED + k))
        truths = [
            o.outline
            for o in photo.objects
            if o.category != "plate" and not o.outline.truncated and o.visible > 0.98
        ]
        yield Scene(photo.image, truths, segment(photo.image), photo.camera, photo.rotation)


def annotated(folder: Path) -> Iterator[Scene]:
    for path in sorted((folder / "labels").glob("*.json")):
        label = json.loads(path.read_text(encoding="utf-8"))
        image = as_rgb(folder / "images" / label["image"])
        truths = [o for o in read_outlines(path).outlines if not o.truncated]
        yield Scene(
            image,
            truths,
            segment(image),
            Camera.default(label["width"], label["height"]),
            None,
            label["horizontal"],
            label["vertical"],
        )


@dataclass
class Poses:
    """Rotation or axis errors of one way, degrees, and whether each was called ok."""

    errors: list[float] = field(default_factory=list)
    ok: list[bool] = field(default_factory=list)

    def row(self, name: str, before: Poses) -> dict[str, str]:
        """A line of the table; `before` is what it is compared with."""
        e, ok = np.array(self.errors), np.array(self.ok)
        good = e[ok]
        was = np.array(before.errors)
        right = np.array(before.ok) & (was < RIGHT_DEG)
        changed = [int((right & (sign * (e - was) > CHANGED_DEG)).sum()) for sign in (1, -1)]
        lost, gained = int((right & ~ok).sum()), int((~right & ok & (e < RIGHT_DEG)).sum())
        return {
            "": name,
            "median °": f"{np.median(e):.2f}",
            "90 % °": f"{np.percentile(e, 90):.2f}",
            "called ok": f"{100 * ok.mean():.0f} %",
            "of those: median °": f"{np.median(good):.2f}" if len(good) else "–",
            "95 % °": f"{np.percentile(good, 95):.2f}" if len(good) else "–",
            "worst °": f"{good.max():.2f}" if len(good) else "–",
            "good before, worse / better now": f"{changed[0]} / {changed[1]} of {right.sum()}",
            "good ones lost / gained": f"{lost} / {gained}",
        }


def posed(scene: Scene, outlines: Outlines, poses: Poses) -> None:
    pose = estimate_pose(outlines.buttons, scene.camera, lines=outlines.lines)
    if pose.status in ("no_buttons", "degenerate"):
        pose = estimate_pose([], scene.camera)
    if scene.rotation is not None:
        poses.errors.append(rotation_error_deg(pose.rotation, scene.rotation))
    else:
        off = axis_angles_deg(pose, scene.horizontal, scene.vertical)
        poses.errors.append(float(np.abs(off).mean()))
    poses.ok.append(pose.status == "ok")


def through_network(scenes: Iterator[Scene]) -> tuple[dict[str, Errors], dict[str, Poses]]:
    errors = {way: Errors() for way in WAYS}
    poses = {name: Poses() for name in ("masks alone", "with the photo", "and its lines")}
    for scene in scenes:
        ways = {way: found(scene.segments, scene.image, way) for way in WAYS}
        for way, outlines in ways.items():
            matched(errors[way], scene.truths, outlines)
        posed(scene, ways["masks"], poses["masks alone"])
        posed(scene, ways["photo"], poses["with the photo"])
        lined = found(scene.segments, scene.image, "photo", lines=True)
        posed(scene, lined, poses["and its lines"])
    return errors, poses


def poses_table(poses: dict[str, Poses]) -> str:
    """Each way, compared with the one in the row above it."""
    before = [next(iter(poses.values())), *poses.values()]
    pairs = zip(poses.items(), before, strict=False)
    return markdown_table([found.row(name, other) for (name, found), other in pairs])


def sizes_table(errors: dict[str, Errors]) -> str:
    rows = []
    for low, high, name in SIZES:
        row = {"corner RMS, median": name}
        for way in WAYS:
            e = errors[way]
            values = [c for c, s in zip(e.corners, e.sizes, strict=True) if low <= s < high]
            row[way] = f"{np.median(values):.2f} px ({len(values)})" if values else "–"
        rows.append(row)
    return markdown_table(rows)


def shapes_table(errors: Errors) -> str:
    names = ("quad", "ellipse", "odd")
    rows = []
    for truth in names:
        row = {"is": truth}
        for seen in names:
            row[f"called {seen}"] = str(errors.shapes.count((truth, seen)))
        rows.append(row)
    return markdown_table(rows)


def honest(values: list[float]) -> float:
    """Size of normalised residuals: the RMS without the tenth that is furthest off."""
    if not values:
        return math.nan
    kept = np.sort(values)[: max(1, int(0.9 * len(values)))]
    return float(np.sqrt(np.mean(kept**2)))


def speed() -> dict[str, float]:
    drawing = buttons_drawn(np.random.default_rng(0), 40, 0.1, columns=5, rows=4)
    drawn = as_drawn(drawing.segments)
    times: dict[str, list[float]] = {way: [] for way in (*WAYS, "edges")}
    # In turns: what else the machine does slows all of them alike.
    for _ in range(100):
        for way, values in times.items():
            given = drawn if way == "edges" else drawing.segments
            started = time.perf_counter()
            found(given, drawing.image, "photo" if way == "edges" else way)
            values.append(1e3 * (time.perf_counter() - started))
    medians = {f"{way}_ms": float(np.median(values)) for way, values in times.items()}
    return medians | {f"{way}_best_ms": min(values) for way, values in times.items()}


def as_drawn(segments: Segments) -> Segments:
    """The same quads' masks as if a mask head had drawn them: an edge head is asked about these."""
    parts = tuple(replace(s, forms=(0.98, 0.01, 0.01)) for s in segments.segments)
    return replace(segments, segments=parts)


def speed_text(figures: dict[str, float]) -> str:
    return markdown_table(
        [
            {
                "20 buttons of 40 px": name,
                "median ms": f"{figures[f'{way}_ms']:.1f}",
                "best ms": f"{figures[f'{way}_best_ms']:.1f}",
            }
            for way, name in (
                ("hough", "Hough"),
                ("masks", "masks alone"),
                ("photo", "with the photo"),
                ("edges", "with the photo and the edge head"),
            )
        ]
    )


def targets(
    drawn: dict[str, float],
    renders: dict[str, Errors],
    photos: dict[str, Errors] | None,
    figures: dict[str, float],
) -> list[Target]:
    sharp = [drawn[f"masks_{s}_{r:g}"] for s in (30, 60) for r in (0.0, 0.1)]
    refined = [drawn[f"photo_{s}_{r:g}"] for s in (30, 60) for r in (0.0, 0.1)]
    rounds = [drawn[f"{way}_circle_{r}"] for way in WAYS[1:] for r in (10, 20, 40)]
    e = renders["photo"]
    median = float(np.median(e.corners)) if e.corners else math.nan
    nan = math.nan
    return [
        Target("drawn, side ≥ 30 px, radius ≤ 10 %, masks: worst corner RMS", max(sharp), 0.4,
               True, ".2f", " px"),
        Target("the same with the photo", max(refined), 0.2, True, ".2f", " px"),
        Target("drawn circles, radius ≥ 10 px: centre and axes", max(rounds), 0.15, True, ".2f",
               " px"),
        Target("renders through the network: median corner RMS", median, 0.6, True, ".2f", " px"),
        Target("the same: normalised residuals of quads, RMS without the worst tenth",
               honest(e.normalised), 1.4, True, ".2f"),
        Target("the same, of ellipses", honest(e.ellipses_normalised), 1.4, True, ".2f"),
        Target("annotated photos: median corner RMS, of the side",
               100 * float(np.median(photos["photo"].relative)) if photos else nan, 6, True, ".1f",
               " %"),
        Target("annotated photos: median IoU of ellipses",
               float(np.median(photos["photo"].iou)) if photos else nan, 0.9),
        Target("20 buttons", figures["photo_ms"], 5, True, ".1f", " ms"),
        Target("20 buttons with the edge head", figures["edges_ms"], 5, True, ".1f", " ms"),
    ]  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="few of each kind; write nothing")
    parser.add_argument("--data", type=Path, default=DATA)
    arguments = parser.parse_args()
    figures = speed()
    drawn_table, drawn = drawn_text(3 if arguments.quick else 10)
    renders, render_poses = through_network(rendered(QUICK if arguments.quick else RENDERS))
    folder = arguments.data / "annotated"
    photos, photo_poses = None, None
    if folder.is_dir():
        photos, photo_poses = through_network(annotated(folder))
    reached = [t.row() for t in targets(drawn, renders, photos, figures)]
    texts = {
        "outline-targets": markdown_table(reached),
        "outline-drawn": drawn_table,
        "outline-renders": sizes_table(renders) + "\n\n" + shapes_table(renders["photo"]),
        "outline-speed": speed_text(figures),
        "outline-lines": poses_table(render_poses),
    }
    if photos is not None and photo_poses is not None:
        texts["outline-photos"] = sizes_table(photos) + "\n\n" + shapes_table(photos["photo"])
        texts["outline-photo-lines"] = poses_table(photo_poses)
    print("\n\n".join(f"{name}\n{text}" for name, text in texts.items()))
    if arguments.quick or photos is None:
        print("nothing written")
        raise SystemExit(0 if arguments.quick else SKIPPED)
    write(texts, {"machine": describe_machine(), "drawn": drawn, "speed": figures})


def write(texts: dict[str, str], record: dict[str, Any]) -> None:
    page = ROOT / "docs" / "outlines.md"
    for name, text in texts.items():
        write_between(page, name, text)
    record["tables"] = {name: text.splitlines() for name, text in texts.items()}
    out = ROOT / "benchmarks" / "results" / "outlines.json"
    out.write_text(json.dumps(rounded(record), indent=1, ensure_ascii=False) + "\n", "utf-8")


if __name__ == "__main__":
    main()
