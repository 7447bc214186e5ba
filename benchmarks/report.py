"""What the benchmarks share: tables, and writing them where the documents show them."""

from __future__ import annotations

import csv
import json
import math
import os
import platform
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

#: The exit code of a benchmark that lacks what it needs, and has written nothing.
SKIPPED = 3


def markdown_table(rows: list[dict[str, str]]) -> str:
    keys = list(rows[0])
    lines = ["| " + " | ".join(keys) + " |", "|" + "---|" * len(keys)]
    lines += ["| " + " | ".join(row[key] for key in keys) + " |" for row in rows]
    return "\n".join(lines)


def describe_machine() -> str:
    model = platform.processor() or platform.machine()
    info = Path("/proc/cpuinfo")
    if info.exists():
        found = re.search(r"model name\s*:\s*(.+)", info.read_text(encoding="utf-8"))
        model = found.group(1) if found else model
    return (
        f"{model}, {os.cpu_count()} cores, {platform.system()}, "
        f"Python {platform.python_version()}, NumPy {np.__version__}"
    )


def write_between(path: Path, name: str, text: str) -> None:
    """Replace what stands between `<!-- name:begin -->` and `<!-- name:end -->` in a file."""
    begin, end = f"<!-- {name}:begin -->", f"<!-- {name}:end -->"
    content = path.read_text(encoding="utf-8")
    if begin not in content or end not in content:
        raise SystemExit(f"{path}: expected the marks {begin} and {end}")
    head, rest = content.split(begin, 1)
    tail = rest.split(end, 1)[1]
    path.write_text(f"{head}{begin}\n{text}\n{end}{tail}", encoding="utf-8")


@dataclass(frozen=True)
class Target:
    """A figure, and what it is to be: at least, or at most, a value."""

    figure: str
    value: float
    wanted: float
    at_most: bool = False
    form: str = ".3f"
    unit: str = ""

    @property
    def reached(self) -> bool:
        return self.value <= self.wanted if self.at_most else self.value >= self.wanted

    def row(self) -> dict[str, str]:
        measured = not math.isnan(self.value)
        sign = "≤" if self.at_most else "≥"
        return {
            "": self.figure,
            "measured": f"{self.value:{self.form}}{self.unit}" if measured else "not measured",
            "target": f"{sign} {self.wanted:g}{self.unit}",
            "reached": ("yes" if self.reached else "**no**") if measured else "–",
        }


def rounded(value: Any) -> Any:
    """Numbers to six digits, however deep."""
    if isinstance(value, dict):
        return {key: rounded(item) for key, item in value.items()}
    if isinstance(value, (list, tuple)):
        return [rounded(item) for item in value]
    return float(f"{value:.6g}") if isinstance(value, float) else value


def write_csv(path: Path, rows: list[dict[str, Any]]) -> None:
    """One line for each row, columns as in the first."""
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rounded(rows))


def write_json(path: Path, record: dict[str, Any]) -> None:
    """A record, with the machine that it was measured on; NaN becomes null."""
    path.parent.mkdir(parents=True, exist_ok=True)
    content = {"machine": describe_machine(), **rounded(record)}
    text = json.dumps(_without_nan(content), indent=1, ensure_ascii=False, allow_nan=False)
    path.write_text(text + "\n", encoding="utf-8")


def _without_nan(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _without_nan(item) for key, item in value.items()}
    if isinstance(value, list):
        return [_without_nan(item) for item in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
