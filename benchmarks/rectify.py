"""From a photo alone to the head-on view: how right, how sure of itself, how fast.

    make bench            all of it (a few minutes)
    python benchmarks/rectify.py --quick      few of each kind; writes nothing

`--data` holds `annotated` (photos with lines known to be horizontal or vertical); where it is
missing nothing is written.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np

from fronto import Panel, Rectifier, RectifierOptions
from fronto.evaluate import axis_angles_deg, rotation_error_deg
from fronto.segmentation import default_engine
from fronto.synth.photo import render_photo
from report import SKIPPED, Target, describe_machine, markdown_table, rounded, write_between

ROOT = Path(__file__).resolve().parent.parent
DATA = ROOT.parent / "shared" / "data"
RENDERS, QUICK, BATCH = 150, 8, 120
#: None that anything was tuned on.
FIRST_SEED = 210_000
WAYS = {
    "buttons alone": RectifierOptions(lines=False, rectified_look=False),
    "and lines of the photo": RectifierOptions(rectified_look=False),
    "and the second look (default)": RectifierOptions(),
}
DEFAULT = "and the second look (default)"


@dataclass
class Outcomes:
    """Statuses and errors, degrees, of many photos; NaN where there is no rotation."""

    statuses: list[str] = field(default_factory=list)
    errors: list[float] = field(default_factory=list)

    def add(self, panel: Panel, error: float) -> None:
        known = panel.status in ("ok", "uncertain")
        self.statuses.append(panel.status)
        self.errors.append(error if known else float("nan"))

    @property
    def ok(self) -> np.ndarray:
        pairs = zip(self.statuses, self.errors, strict=True)
        return np.array([error for status, error in pairs if status == "ok"])

    @property
    def share(self) -> float:
        return len(self.ok) / len(self.statuses)

    def quantile(self, q: float) -> float:
        return float(np.quantile(self.ok, q)) if len(self.ok) else float("nan")

    @property
    def median(self) -> float:
        return float(np.nanmedian(self.errors))

    def row(self, name: str) -> dict[str, str]:
        return {
            "": name,
            "photos": str(len(self.statuses)),
            "ok": f"{100 * self.share:.0f} %",
            "uncertain": str(self.statuses.count("uncertain")),
            "none": str(sum(s in ("degenerate", "no_buttons") for s in self.statuses)),
            "all, median": f"{self.median:.2f}°",
            "ok, median": f"{self.quantile(0.5):.2f}°",
            "95th percentile": f"{self.quantile(0.95):.2f}°",
            "worst": f"{self.quantile(1.0):.2f}°",
        }


def renders(count: int) -> dict[str, Outcomes]:
    outcomes = {name: Outcomes() for name in WAYS}
    several = Outcomes()
    for k in range(count):
        photo = render_photo(np.random.default_rng(FIRST_SEED + k))
        for name, options in WAYS.items():
            panel = Rectifier(options, camera=photo.camera)(photo.image)
            error = rotation_error_deg(panel.pose.rotation, photo.rotation)
            outcomes[name].add(panel, error)
        if sum(o.category != "plate" for o in photo.objects) >= 3:
            several.add(panel, error)
    return outcomes | {"default, panels of three buttons or more": several}


def annotated(folder: Path) -> dict[str, Outcomes]:
    outcomes = {name: Outcomes() for name in WAYS}
    for path in sorted((folder / "labels").glob("*.json")):
        label = json.loads(path.read_text(encoding="utf-8"))
        image = next((folder / "images").glob(f"{path.stem}.*"))
        for name, options in WAYS.items():
            panel = Rectifier(options)(image)
            angles = axis_angles_deg(panel.pose, label["horizontal"], label["vertical"])
            outcomes[name].add(panel, float(np.abs(angles).mean()))
    return outcomes


def milliseconds(work: Callable[[], object]) -> float:
    started = time.perf_counter()
    work()
    return 1e3 * (time.perf_counter() - started)


def command(*arguments: object) -> float:
    """Seconds of a whole process."""
    line = [sys.executable, "-m", "fronto", *map(str, arguments)]
    return milliseconds(lambda: subprocess.run(line, check=False, capture_output=True)) / 1e3


def pictures(count: int) -> Iterator[np.ndarray]:
    """Renders of 640 x 480 pixels."""
    seed = FIRST_SEED + 10_000
    while count:
        image = render_photo(np.random.default_rng(seed)).image
        seed += 1
        if image.shape == (480, 640, 3):
            count -= 1
            yield image


def speed(count: int) -> dict[str, float]:
    images = list(pictures(count))
    engine = default_engine()
    ways = {
        "first look": Rectifier(RectifierOptions(second_look=False, rectified_look=False)),
        "default": Rectifier(),
    }
    times: dict[str, list[float]] = {"network": [], **{name: [] for name in ways}}
    for image in images:
        # Side by side, so that all see the machine in the same mood.
        times["network"].append(milliseconds(lambda image=image: engine.run(image[None])))
        for name, rectifier in ways.items():
            times[name].append(milliseconds(lambda image=image, r=rectifier: r(image)))
    figures = {f"{name}_ms": float(np.median(values)) for name, values in times.items()}
    for name in ways:
        ratios = np.array(times[name]) / np.array(times["network"])
        figures[f"{name}_ratio"] = float(np.median(ratios))
    with TemporaryDirectory() as folder:
        base = Path(folder)
        (base / "in").mkdir()
        for k, image in enumerate(images):
            cv2.imwrite(str(base / "in" / f"{k}.jpg"), image[..., ::-1])
        for name, more in (("batch_fast", ["--fast"]), ("batch", [])):
            seconds = command("rectify", base / "in", "-o", base / name, "-q", *more)
            figures[f"{name}_per_s"] = len(images) / seconds
        one = [command("rectify", base / "in" / "0.jpg", "-o", base / "one") for _ in range(5)]
        figures["one_photo_s"] = float(np.median(one))
    figures["help_s"] = float(np.median([command("--help") for _ in range(5)]))
    return figures


def targets(photos: Outcomes | None, rendered: Outcomes, figures: dict[str, float]) -> list[Target]:
    nan = float("nan")
    worst = photos.quantile(1.0) if photos else nan
    return [
        Target("annotated photos, nothing given: median of all", photos.median if photos else nan,
               0.5, True, ".2f", "°"),
        Target("90th percentile of ok", photos.quantile(0.9) if photos else nan, 2, True, ".2f",
               "°"),
        Target("worst ok", worst, 5, True, ".2f", "°"),
        Target("share of ok", 100 * photos.share if photos else nan, 75, form=".0f", unit=" %"),
        Target("renders, camera given: median of ok", rendered.quantile(0.5), 0.8, True, ".2f",
               "°"),
        Target("95th percentile of ok", rendered.quantile(0.95), 3, True, ".2f", "°"),
        Target("share of ok", 100 * rendered.share, 85, form=".0f", unit=" %"),
        Target("pipeline over bare network, first look", figures["first look_ratio"], 1.35, True,
               ".2f"),
        Target("photos a second from files (--fast)", figures["batch_fast_per_s"], 12,
               form=".1f"),
        Target("fronto --help", figures["help_s"], 0.3, True, ".2f", " s"),
        Target("fronto rectify of one photo, whole process", figures["one_photo_s"], 1.5, True,
               ".2f", " s"),
    ]  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="few of each kind; write nothing")
    parser.add_argument("--data", type=Path, default=DATA)
    arguments = parser.parse_args()
    figures = speed(QUICK if arguments.quick else BATCH)
    rendered = renders(QUICK if arguments.quick else RENDERS)
    folder = arguments.data / "annotated"
    photos = annotated(folder) if folder.is_dir() else None
    reached = targets(photos[DEFAULT] if photos else None, rendered[DEFAULT], figures)
    speeds = markdown_table([{"": name, "figure": f"{v:.3g}"} for name, v in figures.items()])
    texts = [
        markdown_table([target.row() for target in reached]),
        "Renders, the camera given; errors of the rotation:",
        markdown_table([o.row(name) for name, o in rendered.items()]),
    ]
    if photos is not None:
        texts += [
            "Annotated photos, nothing given; mean angle by which lines miss the axes:",
            markdown_table([o.row(name) for name, o in photos.items()]),
        ]
    texts += [f"Speed ({describe_machine()}):", speeds]
    text = "\n\n".join(texts)
    print(text)
    if arguments.quick or photos is None:
        print("nothing written")
        raise SystemExit(0 if arguments.quick else SKIPPED)
    write_between(ROOT / "docs" / "rectify.md", "rectify", text)
    record = {"machine": describe_machine(), "speed": figures}
    for kind, outcomes in (("renders", rendered), ("annotated", photos)):
        record[kind] = {
            name: {"status": o.statuses, "error_deg": o.errors} for name, o in outcomes.items()
        }
    out = ROOT / "benchmarks" / "results" / "rectify.json"
    content = json.dumps(rounded(record), indent=1, ensure_ascii=False).replace("NaN", "null")
    out.write_text(content + "\n", "utf-8")


if __name__ == "__main__":
    main()
