"""How long each stage of fronto and every other way take, what memory, and how both grow.

    make bench                                all benchmarks
    python benchmarks/speed.py                this one; --quick: few rounds, writes nothing

What is compared is timed in turns in one loop, so that all see the machine in the same mood;
ratios are medians of the ratios within single rounds.
"""

from __future__ import annotations

import argparse
import pickle
import subprocess
import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from PIL import Image

from fronto import Rectifier, RectifierOptions, estimate_pose, segment
from fronto.images import as_rgb
from fronto.outlines.straight import straight_segments
from fronto.panelfile import write_panel
from fronto.scales import first_look
from fronto.segmentation import default_engine
from fronto.segments import Segments
from fronto.synth import PAPER_CAMERA, Layout
from fronto.synth.render import render_panel
from report import describe_machine, write_between, write_csv, write_json
from scenes import Case, car_panel, hall_panel, turned
from timing import (
    BEYOND,
    growth_table,
    medians,
    milliseconds,
    peak_mb,
    records,
    repeated,
    shown,
    stage_table,
    timed,
    way_table,
)
from ways import WAYS

ROOT = Path(__file__).resolve().parent.parent
HALL, CAR = "hall, 3 buttons", "car, 20 buttons"
SCENES = {HALL: (hall_panel(0.03, 0.045, 3), 0.30), CAR: (car_panel(4, 5), 0.35)}
TILT_DEG, TOWARDS_DEG, ROLL_DEG = 25.0, 200.0, 3.0
#: From here the largest panel is whole in the photo.
BUTTONS_DISTANCE_M = 0.4
#: Buttons of 12 px at 640x480: larger photos are looked at again in tiles.
AFAR_M = 0.8
SIZES = ((320, 240), (640, 480), (1280, 960), (2560, 1920), (4000, 3000))
#: Columns and rows.
BUTTONS = ((1, 1), (1, 3), (2, 3), (3, 4), (4, 5), (5, 6), (6, 10))
QUICK_SIZES, QUICK_BUTTONS = SIZES[:2], BUTTONS[:5:4]
ROUNDS, FEWER = 15, 5
#: Samples of a pixel along each side; of large photos fewer, which time cannot tell.
SUPERSAMPLING, MOST_SAMPLES = 2, 5_000_000

NETWORK, DEFAULT, FILES = "network alone", "default", "read, default, write"
#: The default's own timings, and what they are called here.
OWN = {
    "segment": "segment",
    "outline": "outline",
    "pose": "pose with lines",
    "warp": "warp",
    "second_look": "second look",
    "total": DEFAULT,
}
_FIRST = RectifierOptions(second_look=False, rectified_look=False)
WHOLES = {
    "first look without lines (`--fast --no-lines`)": replace(_FIRST, lines=False),
    "first look (`--fast`)": _FIRST,
}
ORDER = (
    NETWORK, "read", "segment", "outline", "pose, buttons alone", "straight segments",
    "pose with lines", "warp", "second look", "write", *WHOLES, DEFAULT, FILES,
)  # fmt: skip
GROWING = ("read", "segment", "outline", "pose with lines", "warp", "second look", "write", DEFAULT)
SMALL = {"segment": "segment, small buttons", "total": "default, small buttons"}
#: They run the network themselves, and not on what a `Case` remembers.
SEGMENTING = ("fronto", "fronto, buttons alone")
IMPORTS = "imports alone"

Levels = dict[str, dict[str, float]]


def photo(layout: Layout, distance_m: float, size: tuple[int, int] = (640, 480)) -> Case:
    """A panel seen at a slant; the same scene at any size."""
    camera = PAPER_CAMERA.scaled_to(*size)
    rotation = turned(TILT_DEG, TOWARDS_DEG, ROLL_DEG)
    translation = rotation @ (distance_m * np.array([0.02, -0.03, 1.0]))
    samples = int(np.sqrt(MOST_SAMPLES / (size[0] * size[1])))
    image = render_panel(
        layout,
        camera,
        rotation,
        translation,
        rng=np.random.default_rng(6),
        supersampling=min(max(samples, 1), SUPERSAMPLING),
        noise_std=2.0,
    )
    return Case(image, camera, layout, rotation, translation, camera)


class Stages:
    """Milliseconds of all stages and of the whole, of one photo; each call is a round."""

    def __init__(
        self, case: Case, folder: Path, wholes: Mapping[str, RectifierOptions] = WHOLES
    ) -> None:
        self.case, self.folder = case, folder
        self.file = folder / "photo.jpg"
        Image.fromarray(case.image).save(self.file, quality=92)
        self.seen = first_look(case.image).image[None]
        self.default = Rectifier(camera=case.camera)
        self.wholes = {name: Rectifier(o, camera=case.camera) for name, o in wholes.items()}
        self.buttons = self.default.find(case.image)[0].buttons

    def __call__(self) -> dict[str, float]:
        image, camera, options = self.case.image, self.case.camera, self.default.options
        engine = default_engine()
        times = {NETWORK: milliseconds(lambda: engine.run(self.seen))}
        times["read"] = milliseconds(lambda: as_rgb(self.file))
        panel = self.default(image)
        times |= {name: panel.timing_ms[key] for key, name in OWN.items()}
        times["pose, buttons alone"] = milliseconds(
            lambda: estimate_pose(self.buttons, camera, correlation=options.correlation)
        )
        times["straight segments"] = milliseconds(lambda: straight_segments(image))
        times["write"] = milliseconds(lambda: write_panel(panel, image, self.folder, "panel"))
        for name, rectifier in self.wholes.items():
            times[name] = milliseconds(partial(rectifier, image))
        times[FILES] = times["read"] + times[DEFAULT] + times["write"]
        return {name: times[name] for name in ORDER if name in times}


def with_small(stages: Stages, afar: Case) -> Callable[[], dict[str, float]]:
    """Rounds of both: the stages, and the default on a photo in which the buttons are small."""
    rectifier = Rectifier(camera=afar.camera)

    def measure() -> dict[str, float]:
        own = rectifier(afar.image).timing_ms
        return stages() | {name: own[key] for key, name in SMALL.items()}

    return measure


class Ways:
    """Milliseconds of every way on one photo, from nothing and beyond the segmentation.

    `masks`: whether a way starts from the masks; those of missing packages are not there.
    `silent`: those that have no answer to this photo.
    """

    def __init__(self, case: Case) -> None:
        self.case = case
        self.masks: dict[str, bool] = {}
        self.silent: set[str] = set()
        for name, way in WAYS.items():
            new = self.fresh()
            try:
                answer = way(new)
            except ModuleNotFoundError:
                continue
            self.masks[name] = "segments" in vars(new)
            if not answer.answered:
                self.silent.add(name)

    def fresh(self, **known: Any) -> Case:
        """A copy that remembers the truth, and otherwise what is said."""
        new = replace(self.case)
        vars(new).update(known, corners_px=self.case.corners_px)
        return new

    def __call__(self) -> dict[str, float]:
        found: list[Segments] = []
        shared = milliseconds(lambda: found.append(segment(self.case.image)))
        times = {}
        for name, masks in self.masks.items():
            case = self.fresh(segments=found[0]) if masks else self.fresh()
            alone = milliseconds(partial(WAYS[name], case))
            times[name] = alone + shared if masks else alone
            times[name + BEYOND] = alone - shared if name in SEGMENTING else alone
        return times


def memory_mb(name: str, case: Case) -> float:
    """Peak of a fresh process that does one photo in one way; NaN where a package is missing."""
    line = [sys.executable, __file__, "--memory", name]
    known = pickle.dumps(replace(case))  # a copy: without what the case remembers
    done = subprocess.run(line, input=known, capture_output=True, check=False)
    if done.returncode and b"ModuleNotFoundError" not in done.stderr:
        raise SystemExit(f"memory of {name}: {done.stderr.decode(errors='replace')}")
    return float("nan") if done.returncode else float(done.stdout)


def say_memory(name: str) -> None:
    case = pickle.loads(sys.stdin.buffer.read())
    if name != IMPORTS:
        WAYS[name](case)
    print(peak_mb())


def draw(series: dict[str, tuple[list[float], Levels]], path: Path) -> None:
    """Growth side by side, both axes logarithmic."""
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    fig, axes = plt.subplots(1, len(series), figsize=(11, 5.4), layout="constrained", sharey=True)
    colors = {name: f"C{k}" for k, name in enumerate(GROWING)} | {DEFAULT: "black"}
    # Dashed in the colour of the same with larger buttons.
    colors |= {name: colors[OWN[key]] for key, name in SMALL.items()}
    for axis, (label, (x, levels)) in zip(axes, series.items(), strict=True):
        for name in next(iter(levels.values())):
            axis.loglog(
                x,
                [row[name] for row in levels.values()],
                "s--" if name in SMALL.values() else "o-",
                ms=4,
                lw=2.4 if name == DEFAULT else 1.4,
                color=colors[name],
                label=name,
            )
        axis.set_xticks(x, [f"{value:.2g}" for value in x])
        axis.minorticks_off()
        axis.set_xlabel(label, fontsize=12)
        axis.grid(alpha=0.3)
    axes[0].set_ylabel("milliseconds, median", fontsize=12)
    axes[0].yaxis.set_major_formatter("{x:g}")
    fig.legend(*axes[0].get_legend_handles_labels(), loc="outside lower center", ncols=5)
    path.parent.mkdir(parents=True, exist_ok=True)
    fig.savefig(path, dpi=110)
    plt.close(fig)


def measure(quick: bool) -> None:
    rounds, fewer = (1, 1) if quick else (ROUNDS, FEWER)
    sizes, buttons = (QUICK_SIZES, QUICK_BUTTONS) if quick else (SIZES, BUTTONS)
    cases = {name: photo(layout, distance) for name, (layout, distance) in SCENES.items()}
    asked = (IMPORTS, "fronto") if quick else (IMPORTS, *WAYS)
    memory = {name: memory_mb(name, cases[CAR]) for name in asked}
    memory_of_size, by_size, by_buttons = {}, {}, {}
    with TemporaryDirectory() as temporary:
        folder = Path(temporary)
        stages = {n: timed(repeated(Stages(c, folder), rounds), NETWORK) for n, c in cases.items()}
        rounds_of = {n: Ways(cases[n]) for n in ((HALL,) if quick else (HALL, CAR))}
        silent = {n: one.silent for n, one in rounds_of.items()}
        ways = {n: timed(repeated(one, fewer, warm=True), "fronto") for n, one in rounds_of.items()}
        for columns, rows in buttons:
            case = photo(car_panel(columns, rows), BUTTONS_DISTANCE_M)
            times = repeated(Stages(case, folder, {}), fewer)
            by_buttons[str(columns * rows)] = timed(times, NETWORK)
        layout, distance = SCENES[CAR]
        for size in sizes:
            near, afar = photo(layout, distance, size), photo(layout, AFAR_M, size)
            level = f"{size[0]}x{size[1]}"
            times = repeated(with_small(Stages(near, folder, {}), afar), fewer)
            by_size[level] = timed(times, NETWORK)
            memory_of_size[level] = float("nan") if quick else memory_mb("fronto", near)
    size_levels = medians(by_size, (*GROWING, *SMALL.values()))
    button_levels = medians(by_buttons, GROWING)
    with_memory = {
        level: row | {"peak memory, MB": memory_of_size[level]}
        for level, row in size_levels.items()
    }
    machine = (
        f"Measured on {describe_machine()}; medians of {rounds} rounds, of {fewer} for other ways "
        "and for growth. *Over the network*: times the bare run of the network on the same photo "
        "in the same round."
    )
    beyond = (
        "Every way with the segmentation that it starts from, and beyond it (ways that use none "
        "have the same figure twice); memory of a fresh process with the car panel, "
        f"{shown(memory[IMPORTS])} MB of it for imports."
    )
    growth = (
        "Milliseconds against the photo's size, of the car panel. *Small buttons*: from "
        f"{AFAR_M:g} m, so that large photos are looked at again in tiles."
    )
    parts = [machine, stage_table("640x480", stages), beyond]
    parts += [way_table(WAYS, ways, silent, memory)]
    parts += [growth, growth_table("photo", with_memory)]
    parts += ["Milliseconds against the number of buttons, at 640x480:"]
    parts += [growth_table("buttons", button_levels)]
    text = "\n\n".join(parts)
    print(text)
    if quick:
        print("nothing written")
        return
    megapixels = [width * height / 1e6 for width, height in sizes]
    counts = [float(columns * rows) for columns, rows in buttons]
    draw(
        {
            "photo, megapixels": (megapixels, size_levels),
            "buttons (640x480)": (counts, button_levels),
        },
        ROOT / "docs" / "images" / "speed.png",
    )
    tables = {"stages": stages, "ways": ways, "size": by_size, "buttons": by_buttons}
    figures = [row for table, scenes in tables.items() for row in records(table, scenes)]
    results = ROOT / "benchmarks" / "results"
    write_csv(results / "speed.csv", figures)
    peaks = {"ways": memory, "size": memory_of_size}
    write_json(results / "speed.json", {"figures": figures, "peak_memory_mb": peaks})
    picture = "![Time against image size and number of buttons](images/speed.png)"
    write_between(ROOT / "docs" / "results.md", "speed", f"{text}\n\n{picture}")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="few rounds; writes nothing")
    parser.add_argument("--memory", metavar="WAY", help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.memory is None:
        measure(arguments.quick)
    else:
        say_memory(arguments.memory)


if __name__ == "__main__":
    main()
