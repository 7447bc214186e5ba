"""From probabilities at each step along a label to texts and their probabilities.

Connectionist temporal classification (Graves et al., ICML 2006): at each step the network says
one character or the blank; a text is what remains of a path when repeated characters are
merged and blanks left out. Many paths make one text, and its probability is their sum. The
search keeps the most probable beginnings, each with the paths that end in a blank apart from
those that end in its last character (Graves and Jaitly, ICML 2014, Algorithm 1, without a
language model). It loses paths on its way, so the texts that it comes up with are then summed
over all paths.
"""

from __future__ import annotations

import ctypes
from functools import cache
from typing import Any

import numpy as np
import numpy.typing as npt

from fronto.errors import InputError
from fronto.native import address, library
from fronto.shapes import FloatArray, frozen_array

__all__ = ["decode"]

#: Characters that a beginning may go on with at each step; those less probable are not tried.
TRIED = 5
#: Most beginnings that can be kept: the compiled search has room for no more.
MOST_WIDTH = 128
#: How far the probabilities of a step may be from 1 in sum: what half precision makes of them.
SUM_TOLERANCE = 0.01

Codes = npt.NDArray[np.uint64]


def decode(
    probabilities: npt.ArrayLike, alphabet: str, *, width: int = 8, best: int = 5
) -> tuple[tuple[tuple[str, float], ...], ...]:
    """Texts that the steps along labels may mean.

    Parameters
    ----------
    probabilities
        Shape (N, T, 1 + len(alphabet)): of the blank and of each character, at T steps.
    alphabet
        The characters.
    width
        Beginnings that are kept at each step, up to 128.
    best
        Texts that are told of each of the N, at most `width`.

    Returns
    -------
    For each of the N its texts, "" may be among them, and their probabilities, most probable
    first. The probabilities are exact; a text may be missing, mostly an improbable one. Texts
    have at most as many characters as 64 bits tell apart, 12 of the package's alphabet; where
    only longer ones are possible, there are none.

    Raises
    ------
    InputError
        If the probabilities are of another shape, or no probabilities, or if a number is
        out of range.
    """
    for name, value in (("width", width), ("best", best)):
        if value < 1:
            raise InputError(name, f"expected a whole number from 1, got {value}")
    if width > MOST_WIDTH:
        raise InputError("width", f"expected {MOST_WIDTH} or less, got {width}")
    steps = _checked(probabilities, alphabet)
    if not len(steps):
        return ()
    codes, found = _search(steps, width)
    order = np.argsort(-found, axis=1, kind="stable")[:, :best]
    codes, found = np.take_along_axis(codes, order, 1), np.take_along_axis(found, order, 1)
    return tuple(
        tuple(
            (_text(code, alphabet), probability)
            for code, probability in zip(texts, values, strict=True)
            if probability > 0
        )
        for texts, values in zip(codes.tolist(), found.tolist(), strict=True)
    )


def _checked(probabilities: npt.ArrayLike, alphabet: str) -> FloatArray:
    """Float64 (N, T, classes), of sum 1 at each step."""
    thing = "probabilities"
    steps = frozen_array(probabilities, (-1, -1, 1 + len(alphabet)), thing)
    if not (alphabet and steps.shape[1]):
        raise InputError(
            thing,
            f"expected at least one step and one character, got {steps.shape[1]} and "
            f"{len(alphabet)}",
        )
    total = steps.sum(axis=2, keepdims=True)
    if steps.size and (steps.min() < 0 or np.abs(total - 1).max() > SUM_TOLERANCE):
        raise InputError(
            thing,
            "expected numbers from 0 whose sum at each step is 1, "
            f"got sums from {total.min():g} to {total.max():g}, the least {steps.min():g}",
            "give what comes out of a softmax",
        )
    return np.ascontiguousarray(steps / total)


def _search(steps: FloatArray, width: int) -> tuple[Codes, FloatArray]:
    """Texts (N, width) as whole numbers, and their probabilities, 0 for those not in use.

    The digits of a number to the base 1 + len(alphabet) are the classes of a text's characters:
    its last digit is the last character, and what stands before is its beginning.
    """
    n, count, classes = steps.shape
    codes, found = np.zeros((n, width), np.uint64), np.zeros((n, width))
    _kernel()(
        n,
        count,
        classes,
        address(steps, np.float64),
        width,
        min(TRIED, classes - 1),
        _full(classes),
        address(codes, np.uint64),
        address(found, np.float64),
    )
    return codes, found


@cache
def _kernel() -> Any:
    kernel = library().fronto_ctc_search
    kernel.argtypes = [
        *([ctypes.c_int] * 3),
        ctypes.c_void_p,
        *([ctypes.c_int] * 2),
        ctypes.c_uint64,
        *([ctypes.c_void_p] * 2),
    ]
    kernel.restype = None
    return kernel


def _full(classes: int) -> int:
    """From this number on a text has no room for another digit in 64 bits."""
    smallest = 1
    while smallest * classes**2 <= 2**64:
        smallest *= classes
    return smallest


def _text(code: int, alphabet: str) -> str:
    characters = []
    while code:
        code, digit = divmod(code, 1 + len(alphabet))
        characters.append(alphabet[digit - 1])
    return "".join(reversed(characters))
