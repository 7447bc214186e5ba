"""Results of single photos, remembered on disk: an interrupted benchmark goes on where it was.

What is remembered holds for one state of the code, its weights and the benchmark alone.
"""

from __future__ import annotations

import hashlib
import os
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Any

from joblib import Memory, Parallel, delayed
from tqdm import tqdm

ROOT = Path(__file__).resolve().parent.parent
FOLDER = ROOT / "out" / "bench"
#: Whatever decides on a result.
PARTS = ("src/fronto", "benchmarks", "examples")
ENDINGS = {".py", ".c", ".h", ".onnx", ".yaml", ".png"}


def state() -> str:
    """A digest of the code and the weights that are there now."""
    digest = hashlib.sha256()
    for part in PARTS:
        for path in sorted((ROOT / part).rglob("*")):
            if path.suffix in ENDINGS:
                digest.update(str(path.relative_to(ROOT)).encode())
                digest.update(path.read_bytes())
    return digest.hexdigest()[:16]


def _at(state: str, name: str, call: tuple[Any, ...], function: Callable[..., Any]) -> Any:
    """`function(*call)`, remembered under the state, the function's name and the call."""
    return function(*call)


def each(
    function: Callable[..., Any],
    calls: Iterable[tuple[Any, ...]],
    *,
    jobs: int | None = None,
    title: str = "",
) -> list[Any]:
    """`function` of each call, in order, over several processes; known results are not redone."""
    listed = list(calls)
    # A script's own functions cannot be hashed in another process; their names can.
    once = Memory(FOLDER, verbose=0).cache(_at, ignore=["function"])
    now, name = state(), f"{Path(function.__code__.co_filename).stem}.{function.__name__}"
    work = Parallel(n_jobs=jobs or os.cpu_count() or 1, return_as="generator")
    results = work(delayed(once)(now, name, call, function) for call in listed)
    return list(tqdm(results, total=len(listed), desc=title, disable=None))
