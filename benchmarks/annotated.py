"""How straight real panels come out: annotated outlines in, annotated lines as judges.

    python benchmarks/annotated.py --data FOLDER

FOLDER holds `images/` and `labels/` (one JSON a photo: outlines, and segments known to be
horizontal or vertical on the wall, which the solver never sees). The cameras are unknown.
"""

from __future__ import annotations

import argparse
import json
from pathlib import Path

import numpy as np

from fronto import Camera, estimate_pose
from fronto.evaluate import axis_angles_deg
from fronto.outlinefile import read_outlines
from report import SKIPPED, markdown_table, write_between

ROOT = Path(__file__).resolve().parent.parent


def longer_side(camera: Camera) -> int:
    return max(camera.width_px, camera.height_px)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--data", type=Path, default=ROOT.parent / "shared" / "data" / "annotated")
    parser.add_argument("--quick", action="store_true", help="write nothing")
    arguments = parser.parse_args()
    folder = arguments.data / "labels"
    if not folder.is_dir():
        print(f"{folder.parent.name}: no annotated photos here, nothing measured")
        raise SystemExit(SKIPPED)
    rows = []
    for path in sorted(folder.glob("*.json")):
        label = json.loads(path.read_text(encoding="utf-8"))
        outlines = read_outlines(path).outlines
        camera = Camera.default(label["width"], label["height"])
        pose = estimate_pose(outlines, camera)
        before = estimate_pose([], camera)
        off = np.abs(axis_angles_deg(pose, label["horizontal"], label["vertical"]))
        raw = np.abs(axis_angles_deg(before, label["horizontal"], label["vertical"]))
        rows.append((path.stem, len(outlines), pose, raw.mean(), off.mean(), off.max()))
    table = [
        {
            "photo": stem,
            "sure buttons": str(n),
            "status": pose.status,
            "before °": f"{raw:.2f}",
            "after, mean °": f"{off:.2f}",
            "after, worst °": f"{worst:.2f}",
            "f / longer side": f"{pose.camera.focal_px / longer_side(pose.camera):.2f}",
        }
        for stem, n, pose, raw, off, worst in rows
    ]
    two = [(raw, off) for _, n, _, raw, off, _ in rows if n >= 2]
    ok = [off for _, _, pose, _, off, _ in rows if pose.status == "ok"]
    raw, off = np.array(two).T
    text = (
        f"{len(two)} photos with two or more sure buttons: {np.median(off):.2f}° off in the median "
        f"photo, {np.quantile(off, 0.9):.2f}° at the 90th percentile, {off.max():.2f}° at worst "
        f"(before: {np.median(raw):.2f}°, {np.quantile(raw, 0.9):.2f}°, {raw.max():.2f}°). "
        f"{len(ok)} photos with status ok: {np.median(ok):.2f}°, {np.quantile(ok, 0.9):.2f}°, "
        f"{max(ok):.2f}°.\n\n" + markdown_table(table)
    )
    print(text)
    if arguments.quick:
        print("nothing written")
        return
    write_between(ROOT / "docs" / "benchmarks.md", "annotated", text)


if __name__ == "__main__":
    main()
