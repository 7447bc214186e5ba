"""The compiled kernels: plain C99 next to this file, built by ``hatch_build.py``, called by ctypes.

Why not a just-in-time compiler: the first call would wait for it, and it would be the
largest dependency by far. Why not a Python extension: a plain shared library needs no
Python headers to build and serves every Python version.
"""

from __future__ import annotations

import ctypes
import functools
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import numpy.typing as npt

__all__ = ["address", "library"]

_SUFFIX = {"win32": ".dll", "darwin": ".dylib"}.get(sys.platform, ".so")


@functools.cache
def library() -> ctypes.CDLL:
    """Load the shared library, once.

    Raises
    ------
    ImportError
        If it was never built, or for another platform.
    """
    path = Path(__file__).with_name(f"_kernels{_SUFFIX}")
    try:
        return ctypes.CDLL(str(path))
    except OSError as error:
        raise ImportError(
            f"fronto's compiled kernels cannot be loaded from {path} ({error}); "
            "install the package (pip install . or pip install -e .), do not run it from "
            "a bare source tree"
        ) from error


def address(array: npt.NDArray[Any], dtype: type) -> int:
    """Where an array's values are, for the compiled side, which trusts their type and order."""
    assert array.flags.c_contiguous
    assert array.dtype == dtype
    return int(array.ctypes.data)
