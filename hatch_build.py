"""Build hook: compile the C kernels of ``fronto.native`` into one shared library.

The library is plain C99 called through ctypes, so it needs neither Python's
headers nor NumPy's, and one wheel per platform serves every Python version.
A C compiler is taken from ``CC`` or the PATH; on a machine without one, pip
fetches the ``ziglang`` package, which brings a compiler of its own.
"""

from __future__ import annotations

import os
import shlex
import shutil
import subprocess
import sys
import sysconfig
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface

FLAGS = ["-O3", "-std=c99", "-fno-math-errno", "-fno-trapping-math", "-ffp-contract=off"]
SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")


def system_compiler() -> list[str] | None:
    """The compiler named by CC, else the first one on the PATH, else None."""
    if os.environ.get("CC"):
        return shlex.split(os.environ["CC"])
    for name in ("cc", "gcc", "clang"):
        if shutil.which(name):
            return [name]
    return None


def compiler() -> list[str]:
    """The system's compiler, else Zig's; its default would be the building machine's own CPU."""
    return system_compiler() or [sys.executable, "-m", "ziglang", "cc", "-mcpu=baseline"]


class NativeBuildHook(BuildHookInterface):  # type: ignore[misc]
    def dependencies(self) -> list[str]:
        return [] if system_compiler() else ["ziglang>=0.13"]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        folder = Path(self.root, "src", "fronto", "native")
        library = folder / f"_kernels{SUFFIX}"
        sources = sorted(str(path) for path in folder.glob("*.c"))
        command = [*compiler(), *FLAGS, "-shared", "-o", str(library), *sources]
        if sys.platform != "win32":
            command += ["-fPIC", "-fvisibility=hidden", "-lm"]
        try:
            subprocess.run(command, check=True, capture_output=True, text=True)
        except (OSError, subprocess.CalledProcessError) as error:
            detail = getattr(error, "stderr", "") or str(error)
            raise RuntimeError(
                f"fronto: the C kernels did not compile with {command[0]!r}; "
                f"set CC to a working C99 compiler.\n{detail}"
            ) from error
        build_data["pure_python"] = False
        platform = sysconfig.get_platform().replace("-", "_").replace(".", "_")
        build_data["tag"] = f"py3-none-{platform}"
        relative = library.relative_to(Path(self.root)).as_posix()
        build_data.setdefault("artifacts", []).append(relative)
