"""How many processor cores there are to use."""

from __future__ import annotations

import math
import os
from collections.abc import Iterator
from pathlib import Path

__all__ = ["usable_cores"]


def usable_cores(root: Path = Path("/")) -> int:
    """Cores that this process may use: its affinity, and the quota of its control groups.

    A container that is limited to two of 64 cores still sees 64; a thread on each would
    make it wait for its quota most of the time.

    Parameters
    ----------
    root
        Where /proc and /sys are.
    """
    if hasattr(os, "sched_getaffinity"):  # Linux
        cores = len(os.sched_getaffinity(0))
    else:
        cores = os.cpu_count() or 1
    for quota in _quotas(root):
        cores = min(cores, math.ceil(quota))
    return max(cores, 1)


def _quotas(root: Path) -> Iterator[float]:
    """Processors that each control group above this process allows (cgroups 2 and 1)."""
    try:
        lines = (root / "proc/self/cgroup").read_text().splitlines()
    except OSError:  # no Linux
        return
    for line in lines:
        _, controllers, group = line.split(":", 2)
        if controllers and "cpu" not in controllers.split(","):
            continue
        base = root / "sys/fs/cgroup" / ("cpu" if controllers else "")
        inner = base / group.lstrip("/")
        for folder in (inner, *inner.parents):
            try:
                if controllers:
                    quota = (folder / "cpu.cfs_quota_us").read_text()
                    period = (folder / "cpu.cfs_period_us").read_text()
                else:
                    quota, period = (folder / "cpu.max").read_text().split()
                if quota != "max" and int(quota) > 0:
                    yield int(quota) / int(period)
            except (OSError, ValueError, ZeroDivisionError):
                pass  # the root group states no quota, and a container does not see them all
            if folder == base:
                break
