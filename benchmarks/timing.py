"""Wall time in turns, peak memory, and tables of both."""

from __future__ import annotations

import re
import sys
import time
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from report import markdown_table

#: What ways take without the segmentation that they start from: named after the way.
BEYOND = ", beyond segmentation"

Times = dict[str, list[float]]


def milliseconds(work: Callable[[], object]) -> float:
    started = time.perf_counter()
    work()
    return 1e3 * (time.perf_counter() - started)


def repeated(measure: Callable[[], dict[str, float]], rounds: int, *, warm: bool = False) -> Times:
    """Milliseconds, round by round; unless it is warm, after a round that does not count."""
    if not warm:
        measure()
    taken = [measure() for _ in range(rounds)]
    return {name: [one[name] for one in taken] for name in taken[0]}


@dataclass(frozen=True)
class Timed:
    """Of one thing: milliseconds, and the median ratio to another in the same round."""

    median_ms: float
    best_ms: float
    ratio: float
    rounds: int


Scenes = dict[str, dict[str, Timed]]


def timed(times: Times, to: str) -> dict[str, Timed]:
    other = np.array(times[to])
    return {
        name: Timed(
            float(np.median(values)),
            float(min(values)),
            float(np.median(np.array(values) / other)),
            len(values),
        )
        for name, values in times.items()
    }


def medians(scenes: Scenes, names: Iterable[str]) -> dict[str, dict[str, float]]:
    wanted = list(names)
    return {
        scene: {name: things[name].median_ms for name in wanted} for scene, things in scenes.items()
    }


def peak_mb() -> float:
    """The most memory that this process has held, megabytes."""
    status = Path("/proc/self/status")
    # Before ru_maxrss, which on Linux begins at that of the process that started this one.
    held = re.search(r"VmHWM:\s*(\d+) kB", status.read_text()) if status.exists() else None
    if held is not None:
        return 1024 * int(held[1]) / 1e6
    import resource

    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    return (1 if sys.platform == "darwin" else 1024) * peak / 1e6


def shown(value: float) -> str:
    """Three digits where there are as many before or after the point; a dash for none."""
    if not np.isfinite(value):
        return "–"
    size = abs(value)
    return f"{value:.{0 if size >= 100 else 1 if size >= 10 else 2}f}"


def stage_table(label: str, scenes: Scenes) -> str:
    lines = []
    for name in next(iter(scenes.values())):
        line = {label: name}
        for scene, stages in scenes.items():
            one = stages[name]
            line[f"{scene}: ms"] = shown(one.median_ms)
            line[f"{scene}: best"] = shown(one.best_ms)
            line[f"{scene}: over the network"] = shown(one.ratio)
        lines.append(line)
    return markdown_table(lines)


def way_table(
    names: Iterable[str], scenes: Scenes, silent: dict[str, set[str]], memory: dict[str, float]
) -> str:
    """All ways, also those that could not be measured; those `silent` in a scene refused it."""
    lines = []
    for name in names:
        line = {"way": name}
        for scene, ways in scenes.items():
            whole, beyond = ways.get(name), ways.get(name + BEYOND)
            line[f"{scene}: ms"] = shown(whole.median_ms) if whole else "not installed"
            line[f"{scene}: beyond segmentation"] = shown(beyond.median_ms) if beyond else "–"
            ratio = "no answer" if name in silent[scene] else shown(whole.ratio) if whole else "–"
            line[f"{scene}: over fronto"] = ratio
        line["peak memory, MB"] = shown(memory.get(name, float("nan")))
        lines.append(line)
    return markdown_table(lines)


def growth_table(label: str, levels: dict[str, dict[str, float]]) -> str:
    """Levels as rows, what grows as columns; below, how many times as much the last one takes."""
    values = list(levels.values())
    first, last = values[0], values[-1]
    times = {name: last[name] / first[name] if first[name] > 0 else np.nan for name in first}
    rows = levels | {"last over first": times}
    return markdown_table(
        [
            {label: level, **{name: shown(v) for name, v in row.items()}}
            for level, row in rows.items()
        ]
    )


def records(table: str, scenes: Scenes) -> list[dict[str, Any]]:
    """A flat row for each figure."""
    return [
        {"table": table, "scene": scene, "name": name, **vars(one)}
        for scene, things in scenes.items()
        for name, one in things.items()
    ]
