"""All benchmarks, one after the other; what was finished is not done again.

    make bench                  all of it (under 30 minutes on two cores)
    make bench QUICK=1          a little of each (under 3 minutes); writes nothing

A benchmark counts as finished for the state of code and weights that it ran with. Ctrl-C and a
second call go on where it was stopped.
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import time
from pathlib import Path

from remember import FOLDER, state
from report import SKIPPED

HERE = Path(__file__).resolve().parent
#: Time and memory are measured first, before anything warms the machine up.
SCRIPTS = (
    "speed",
    "rectify",
    "experiment",
    "robustness",
    "reading",
    "pose",
    "positions",
    "labels",
    "annotated",
    "segmentation",
    "outlines",
)


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="a little of each; writes nothing")
    parser.add_argument("--again", action="store_true", help="also what was finished before")
    arguments = parser.parse_args()
    now, failed = state(), []
    for script in SCRIPTS:
        done = FOLDER / "done" / f"{script}-{now}"
        if done.exists() and not (arguments.quick or arguments.again):
            print(f"{script}: finished before ({done.read_text(encoding='utf-8').strip()})")
            continue
        print(f"\n=== {script}", flush=True)
        started = time.monotonic()
        command = [sys.executable, str(HERE / f"{script}.py"), *["--quick"] * arguments.quick]
        code = subprocess.run(command, check=False).returncode
        seconds = f"{time.monotonic() - started:.0f} s"
        print(f"=== {script}: {seconds}" + (f", exit code {code}" if code else ""), flush=True)
        if code and code != SKIPPED:
            failed.append(script)
        elif not (code or arguments.quick):
            done.parent.mkdir(parents=True, exist_ok=True)
            done.write_text(f"{seconds}\n", encoding="utf-8")
    if failed:
        print(f"failed: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    raise SystemExit(main())
