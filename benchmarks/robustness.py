"""All ways side by side, and what fronto survives: one thing varied at a time.

make bench                                all benchmarks
python benchmarks/robustness.py           this one; --quick: few photos, writes nothing
"""

from __future__ import annotations

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")

import argparse
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

import spoil
from fronto import Camera
from fronto.synth import PAPER_CAMERA, Layout
from remember import each
from report import markdown_table, write_between, write_csv, write_json
from scenes import LOOKS, Case, car_panel, hall_panel, take, turned
from ways import WAYS, judge

ROOT = Path(__file__).resolve().parent.parent
TILT_DEG, DISTANCE_M, SIDE_M = 25.0, 0.3, 0.03
#: Rivals are named as in the issue: (a) to (d).
RIVALS = ("paper", "paper, as printed", "grid-EM style", "vanishing points", "panel quadrilateral")
FEW = ("fronto", "fronto, buttons alone", "paper", "layout known (bound)")
PHOTOS, FEWER, QUICK = 10, 4, 1


@dataclass(frozen=True)
class Factor:
    """One thing that is varied, its levels, and how a photo with it is taken."""

    name: str
    unit: str
    levels: tuple[float, ...]
    photo: Callable[[float, int], Case]
    ways: tuple[str, ...] = FEW
    photos: int = FEWER


def panel(k: int) -> Layout:
    """Hall and car panels in turn."""
    return car_panel(3, 4) if k % 2 else hall_panel(SIDE_M, 0.045, 3)


def usual(name: str, level: float, k: int, **options: Any) -> Case:
    """A photo of the usual kind, but for what `options` say."""
    # Not of the level: the same panels and views at all levels of a factor.
    rng = np.random.default_rng([sum(name.encode()), k])
    tilt = options.pop("tilt_deg", TILT_DEG)
    rotation = turned(tilt, rng.uniform(0, 360), rng.uniform(-10, 10))
    layout = options.pop("layout", panel(k))
    distance = options.pop("distance_m", DISTANCE_M)
    return take(rng, layout, rotation, distance, look=LOOKS[k % len(LOOKS)], **options)


def tilt(level: float, k: int) -> Case:
    return usual("tilt", level, k, tilt_deg=level)


def size(level: float, k: int) -> Case:
    return usual("size", level, k, distance_m=PAPER_CAMERA.focal_px * SIDE_M / level)


def number(level: float, k: int) -> Case:
    columns = {1: 1, 2: 1, 3: 1, 6: 2, 12: 3, 20: 4, 30: 5}[int(level)]
    rows = int(level) // columns
    layout = hall_panel(SIDE_M, 0.045, rows) if columns == 1 else car_panel(columns, rows)
    return usual("number", level, k, layout=layout)


def blur(level: float, k: int) -> Case:
    return usual("blur", level, k, spoil=spoil.blur(level))


def noise(level: float, k: int) -> Case:
    return usual("noise", level, k, noise=level)


def jpeg(level: float, k: int) -> Case:
    return usual("jpeg", level, k, spoil=spoil.jpeg(int(level)))


def brightness(level: float, k: int) -> Case:
    return usual("brightness", level, k, spoil=spoil.brightness(level))


def occlusion(level: float, k: int) -> Case:
    return usual("occlusion", level, k, spoil=spoil.occlusion(level / 100))


def bent(k1: float) -> Camera:
    lens = [k1, 0.0, 0.0, 0.0, 0.0]
    return Camera.from_matrix(PAPER_CAMERA.matrix, 640, 480, distortion=lens)


def lens(level: float, k: int) -> Case:
    return usual("lens", level, k, camera=bent(level), told=PAPER_CAMERA)


def lens_told(level: float, k: int) -> Case:
    return usual("lens", level, k, camera=bent(level))


def focal(level: float, k: int) -> Case:
    f = PAPER_CAMERA.focal_px * (1 + level / 100)
    told = Camera.from_matrix([[f, 0, 320], [0, f, 240], [0, 0, 1]], 640, 480)
    return usual("focal", level, k, told=told)


ALL = tuple(WAYS)
FACTORS = (
    Factor("tilt", "degrees", (0, 10, 20, 30, 40, 50, 60), tilt, ALL, PHOTOS),
    Factor("size of a button", "px", (10, 15, 20, 30, 45, 60), size, ALL, PHOTOS),
    Factor("number of buttons", "", (1, 2, 3, 6, 12, 20, 30), number, ALL, PHOTOS),
    Factor("blur", "σ, px", (0, 0.5, 1, 2, 3, 4), blur),
    Factor("noise", "σ, grey levels", (0, 5, 10, 20, 40), noise),
    Factor("JPEG quality", "", (95, 60, 30, 15, 8), jpeg),
    Factor("light", "times", (0.1, 0.25, 0.5, 1, 1.5, 2), brightness),
    Factor("hidden", "% of the middle", (0, 5, 10, 20, 35), occlusion),
    Factor("lens, k1, not told", "", (0, -0.05, -0.1, -0.2, -0.3), lens),
    Factor("lens, k1, told", "", (0, -0.05, -0.1, -0.2, -0.3), lens_told),
    Factor("focal length told wrong", "%", (-20, -10, -5, 0, 5, 10, 20), focal),
)
COMPARED = tuple(f for f in FACTORS if f.ways == ALL)
OTHERS = tuple(f for f in FACTORS if f.ways != ALL)


def measure(factor: int, level: float, k: int) -> list[dict[str, Any]]:
    chosen = FACTORS[factor]
    case = chosen.photo(level, k)
    rows = []
    for way in chosen.ways:
        try:
            answer = WAYS[way](case)
        except ModuleNotFoundError:  # of a package that is not there
            continue
        kind = {"factor": chosen.name, "level": level, "photo": k, "way": way}
        rows.append(kind | judge(case, answer))
    return rows


@dataclass(frozen=True)
class Curve:
    """One way over the levels of a factor: errors, and which are ok, (levels, photos)."""

    levels: np.ndarray
    error: np.ndarray
    ok: np.ndarray

    @property
    def median(self) -> np.ndarray:
        return np.median(self.error, axis=1)

    @property
    def share(self) -> np.ndarray:
        return self.ok.mean(axis=1)


def curves(rows: list[dict[str, Any]], factor: Factor) -> dict[str, Curve]:
    found = {}
    for way in factor.ways:
        mine = [r for r in rows if r["factor"] == factor.name and r["way"] == way]
        if not mine:
            continue
        at = [[r for r in mine if r["level"] == level] for level in factor.levels]
        error = np.array([[r["rotation_deg"] for r in level] for level in at])
        ok = np.array([[r["ok"] for r in level] for level in at])
        found[way] = Curve(np.array(factor.levels), error, ok)
    return found


def table(rows: list[dict[str, Any]], factor: Factor) -> str:
    """Median rotation errors; of fronto also the share of ok."""
    lines = []
    for way, curve in curves(rows, factor).items():
        label = f"{factor.name}{', ' + factor.unit if factor.unit else ''}"
        cells = {
            f"{level:g}": f"{error:.2f}" + (f" ({100 * ok:.0f} %)" if way == "fronto" else "")
            for level, error, ok in zip(curve.levels, curve.median, curve.share, strict=True)
        }
        lines.append({label: way, **cells})
    return markdown_table(lines)


def not_ahead(rows: list[dict[str, Any]]) -> list[str]:
    """Where a rival's median error is below fronto's."""
    found = []
    for factor in COMPARED:
        drawn = curves(rows, factor)
        for rival in RIVALS:
            if rival not in drawn:
                found.append(f"{rival}: not measured, its package is not installed")
                continue
            for k, level in enumerate(factor.levels):
                ours, theirs = drawn["fronto"].median[k], drawn[rival].median[k]
                if theirs <= ours:
                    found.append(
                        f"{factor.name} {level:g}: {rival} {theirs:.2f}°, fronto {ours:.2f}°"
                    )
    return sorted(set(found))


def summary(rows: list[dict[str, Any]]) -> str:
    """All photos of the compared factors: one line a way, for the README."""
    names = {factor.name for factor in COMPARED}
    lines = []
    for way in WAYS:
        mine = [r for r in rows if r["way"] == way and r["factor"] in names]
        if not mine:
            continue
        error = np.array([r["rotation_deg"] for r in mine])
        ok = np.array([r["ok"] > 0 for r in mine])
        trusted = error[ok]
        lines.append(
            {
                "way": way,
                "rotation error, median": f"{np.median(error):.2f}°",
                "mean": f"{error.mean():.1f}°",
                "trusted": f"{100 * ok.mean():.0f} %",
                "of those: median": f"{np.median(trusted):.2f}°" if ok.any() else "–",
                "95th percentile": f"{np.quantile(trusted, 0.95):.1f}°" if ok.any() else "–",
            }
        )
    return markdown_table(lines)


def draw(rows: list[dict[str, Any]], factors: tuple[Factor, ...], path: Path, columns: int) -> None:
    import matplotlib as mpl

    mpl.use("Agg")
    import matplotlib.pyplot as plt

    lines = -(-len(factors) // columns)
    fig, axes = plt.subplots(
        2 * lines, columns, figsize=(4.4 * columns, 4.4 * lines), layout="constrained",
        squeeze=False, height_ratios=[2.2, 1] * lines,
    )  # fmt: skip
    for axis in axes.flat:
        axis.set_visible(False)
    for place, factor in enumerate(factors):
        line, column = divmod(place, columns)
        error, share = axes[2 * line, column], axes[2 * line + 1, column]
        for k, (way, curve) in enumerate(curves(rows, factor).items()):
            color = f"C{ALL.index(way)}"
            width = 2.4 if way == "fronto" else 1.2
            low, high = np.quantile(curve.error, (0.25, 0.75), axis=1)
            x = np.arange(len(curve.levels)) + 0.03 * k
            error.plot(x, curve.median, "o-", ms=3, color=color, lw=width, label=way)
            error.fill_between(x, low, high, color=color, alpha=0.12, lw=0)
            if way.startswith("fronto"):
                spread = np.sqrt(curve.share * (1 - curve.share) / curve.ok.shape[1])
                share.plot(x, curve.share, "o-", ms=3, color=color, lw=width)
                share.fill_between(
                    x, curve.share - spread, curve.share + spread, color=color, alpha=0.2, lw=0
                )
        error.set(yscale="log", title=factor.name, ylim=(0.02, 100))
        error.set_xticks(range(len(factor.levels)), [f"{v:g}" for v in factor.levels])
        error.grid(alpha=0.3)
        share.set_xticks(range(len(factor.levels)), [f"{v:g}" for v in factor.levels])
        share.set(ylim=(-0.05, 1.05), xlabel=f"{factor.name} ({factor.unit})".replace(" ()", ""))
        share.grid(alpha=0.3)
        if column == 0:
            error.set_ylabel("rotation error (degrees)")
            share.set_ylabel("share ok")
        error.set_visible(True)
        share.set_visible(True)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    fig.legend(handles, labels, loc="outside lower center", ncols=4)
    path.parent.mkdir(parents=True, exist_ok=True)
    fig.savefig(path, dpi=90)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="few photos; writes nothing")
    quick = parser.parse_args().quick
    calls = []
    for number_of, factor in enumerate(FACTORS):
        levels = factor.levels[1::3] if quick else factor.levels
        photos = QUICK if quick else factor.photos
        calls += [(number_of, level, k) for level in levels for k in range(photos)]
    rows = [row for rows in each(measure, calls, title="all ways") for row in rows]
    shown = FACTORS
    if quick:
        shown = tuple(replace(factor, levels=factor.levels[1::3]) for factor in FACTORS)
    tables = {factor.name: table(rows, factor) for factor in shown}
    if quick:
        print("\n\n".join(tables.values()), "\n\nnothing written")
        return
    behind = not_ahead(rows)
    verdict = (
        "fronto's median error is below that of every other way but the bound at every tilt, size "
        "and number of buttons."
        if not behind
        else "Where another way's median error is not above fronto's:\n\n"
        + "\n".join(f"- {line}" for line in behind)
    )
    medians = "Median rotation error, degrees; of fronto also the share of ok photos:"
    compared = [medians, *(tables[factor.name] for factor in COMPARED), verdict]
    write_between(ROOT / "docs" / "results.md", "ways", "\n\n".join(compared))
    count = sum(len(factor.levels) * factor.photos for factor in COMPARED)
    write_between(
        ROOT / "README.md",
        "bench:ways",
        f"{summary(rows)}\n\n{count} rendered photos: tilts of 0 to 60°, buttons of 10 to 60 px, "
        "panels of 1 to 30 buttons; the camera given.",
    )
    others = [medians, *(tables[factor.name] for factor in OTHERS)]
    write_between(ROOT / "docs" / "results.md", "robustness", "\n\n".join(others))
    print("\n\n".join([*compared, *others]))
    images = ROOT / "docs" / "images"
    draw(rows, COMPARED, images / "ways.png", 3)
    draw(rows, OTHERS, images / "robustness.png", 4)
    write_csv(ROOT / "benchmarks" / "results" / "robustness.csv", rows)
    write_json(
        ROOT / "benchmarks" / "results" / "robustness.json",
        {
            "median_rotation_error_deg": {
                factor.name: {
                    way: dict(zip(map(str, factor.levels), curve.median.tolist(), strict=True))
                    for way, curve in curves(rows, factor).items()
                }
                for factor in FACTORS
            },
            "not_ahead": behind,
        },
    )


if __name__ == "__main__":
    main()
