from __future__ import annotations

import csv
import math
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

sys.path.insert(0, str(Path(__file__).parents[2] / "benchmarks"))

from report import write_csv
from timing import (
    BEYOND,
    Timed,
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

positive = st.floats(0.01, 1e5)


def cells(table: str) -> list[list[str]]:
    """Rows of a table, its header first."""
    lines = [line.strip("| ").split(" | ") for line in table.splitlines()]
    return [lines[0], *lines[2:]]


def test_repeated_drops_the_first_round_unless_warm() -> None:
    count = iter(range(100))

    def measure() -> dict[str, float]:
        return {"a": float(next(count))}

    assert repeated(measure, 3) == {"a": [1, 2, 3]}
    assert repeated(measure, 2, warm=True) == {"a": [4, 5]}


def test_ratio_is_that_of_the_same_round() -> None:
    # A slow round is slow for both; the ratio of medians would be 3.
    both = timed({"network": [10, 100, 20], "whole": [20, 200, 60]}, "network")
    assert both["network"] == Timed(20, 10, 1, 3)
    assert both["whole"] == Timed(60, 20, 2, 3)


@given(st.lists(st.tuples(positive, positive), min_size=1, max_size=9), st.floats(0.1, 10))
@settings(derandomize=True, deadline=None)
def test_ratio_does_not_depend_on_the_machines_speed(
    rounds: list[tuple[float, float]], factor: float
) -> None:
    a, b = (list(values) for values in zip(*rounds, strict=True))
    plain = timed({"a": a, "b": b}, "a")["b"]
    slowed = timed({"a": [factor * v for v in a], "b": [factor * v for v in b]}, "a")["b"]
    assert slowed.ratio == pytest.approx(plain.ratio)
    assert slowed.median_ms == pytest.approx(factor * plain.median_ms)
    assert plain.best_ms <= plain.median_ms


@pytest.mark.parametrize(
    ("value", "text"),
    [(0.0049, "0.00"), (1.234, "1.23"), (12.34, "12.3"), (1234.5, "1234"), (-12.34, "-12.3")],
)
def test_numbers_have_three_digits(value: float, text: str) -> None:
    assert shown(value) == text


def test_no_number_is_a_dash() -> None:
    assert {shown(math.nan), shown(math.inf)} == {"–"}


def test_stage_table_has_a_line_a_stage_and_three_columns_a_scene() -> None:
    stages = {"read": Timed(2, 1, 0.5, 3), "warp": Timed(4, 3, 1.5, 3)}
    header, *lines = cells(stage_table("640x480", {"hall": stages, "car": stages}))
    assert len(header) == 1 + 2 * 3
    assert len(set(header)) == len(header)
    assert lines == [
        ["read", *["2.00", "1.00", "0.50"] * 2],
        ["warp", *["4.00", "3.00", "1.50"] * 2],
    ]


def test_way_table_names_ways_that_could_not_be_measured() -> None:
    ways = {
        "fronto": Timed(50, 40, 1, 2),
        f"fronto{BEYOND}": Timed(20, 10, 0.4, 2),
        "lattice": Timed(31, 30, 0.6, 2),
        f"lattice{BEYOND}": Timed(1, 1, 0.02, 2),
    }
    memory = {"fronto": 200.0, "lattice": 150.0, "other": math.nan}
    table = way_table(["fronto", "lattice", "other"], {"hall": ways}, {"hall": {"lattice"}}, memory)
    assert cells(table)[1:] == [
        ["fronto", "50.0", "20.0", "1.00", "200"],
        ["lattice", "31.0", "1.00", "no answer", "150"],
        ["other", "not installed", "–", "–", "–"],
    ]


def test_growth_ends_with_the_ratio_of_last_and_first() -> None:
    levels = {"small": {"a": 2.0, "b": 0.0}, "middle": {"a": 3.0, "b": 1.0}}
    table = growth_table("photo", levels | {"large": {"a": 20.0, "b": 5.0}})
    assert cells(table)[0] == ["photo", "a", "b"]
    assert [line[0] for line in cells(table)[1:4]] == ["small", "middle", "large"]
    assert cells(table)[-1][1:] == ["10.0", "–"]
    assert cells(growth_table("photo", {"one": {"a": 2.0}}))[-1][1:] == ["1.00"]


def test_medians_are_those_asked_for() -> None:
    things = {"a": Timed(1, 0, 1, 1), "b": Timed(2, 0, 1, 1), "c": Timed(3, 0, 1, 1)}
    names = (name for name in "cb")
    wanted = {"c": 3, "b": 2}
    assert medians({"x": things, "y": things}, names) == {"x": wanted, "y": wanted}


def test_records_come_back_from_csv(tmp_path: Path) -> None:
    scenes = {"hall": {"read": Timed(2.5, 1.5, 0.25, 3)}, "car": {"read": Timed(4, 3, 1, 3)}}
    rows = records("stages", scenes)
    write_csv(tmp_path / "speed.csv", rows)
    with (tmp_path / "speed.csv").open(encoding="utf-8", newline="") as file:
        read = list(csv.DictReader(file))
    assert [row["scene"] for row in read] == ["hall", "car"]
    assert float(read[0]["median_ms"]) == 2.5
    assert float(read[0]["ratio"]) == 0.25
    assert {row["rounds"] for row in read} == {"3"}


def test_milliseconds_pass() -> None:
    import time

    assert 5 <= milliseconds(lambda: time.sleep(0.005)) < 5000


def test_peak_memory_covers_what_is_held() -> None:
    before = peak_mb()
    held = np.ones(25_000_000)  # 200 MB
    assert peak_mb() >= max(200.0, before)
    del held
    assert peak_mb() >= 200.0
