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

import numpy as np
import numpy.typing as npt

from fronto.errors import InputError
from fronto.shapes import FloatArray, frozen_array

__all__ = ["decode"]

#: Characters that a beginning may go on with at each step; those less probable are not tried.
TRIED = 5
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
        Beginnings that are kept at each step.
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
        below 1.
    """
    for name, value in (("width", width), ("best", best)):
        if value < 1:
            raise InputError(name, f"expected a whole number from 1, got {value}")
    steps = _checked(probabilities, alphabet)
    if not len(steps):
        return ()
    codes, found = _search(steps, width)
    found = np.where(found > 0, _exact(steps, codes), 0)
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
    return np.asarray(steps / total)


def _search(steps: FloatArray, width: int) -> tuple[Codes, FloatArray]:
    """Texts (N, width) as whole numbers, and their probabilities, 0 for those not in use.

    The digits of a number to the base 1 + len(alphabet) are the classes of a text's characters:
    its last digit is the last character, and what stands before is its beginning.
    """
    n, count, classes = steps.shape
    base, full = np.uint64(classes), np.uint64(_full(classes))
    tried = min(TRIED, classes - 1)
    likely = 1 + np.argpartition(-steps[..., 1:], tried - 1, axis=2)[..., :tried]
    codes = np.zeros((n, width), np.uint64)
    closed, open_ = np.zeros((2, n, width))  # the paths that end in a blank, and the others
    closed[:, 0] = 1
    for t in range(count):
        step, characters = steps[:, t], likely[:, t]
        last, parent, total = (codes % base).astype(np.intp), codes // base, closed + open_
        said = np.take_along_axis(step, last, 1) * (last > 0)

        # The same text again: a blank, or its last character once more ...
        stay_closed, stay_open = total * step[:, :1], open_ * said
        # ... or a shorter one (axis 2) that is kept, too, and becomes this one (axis 1). A
        # character stands twice in a text only where a blank comes in between.
        twice = last[:, :, None] == last[:, None, :]
        grown = np.where(twice, closed[:, None, :], total[:, None, :])
        grown *= parent[:, :, None] == codes[:, None, :]
        stay_open += grown.sum(axis=2) * said * (total > 0)

        # A new text: one (axis 1) with one more character (axis 2).
        twice = last[:, :, None] == characters[:, None, :]
        grown = np.where(twice, closed[:, :, None], total[:, :, None])
        grown *= np.take_along_axis(step, characters, 1)[:, None, :]
        grown[codes >= full] = 0
        longer = codes[:, :, None] * base + characters[:, None, :].astype(np.uint64)
        grown, longer = grown.reshape(n, -1), longer.reshape(n, -1)
        kept = (longer[:, :, None] == codes[:, None, :]) & (total > 0)[:, None, :]
        grown[kept.any(axis=2)] = 0

        worth = np.concatenate([stay_closed + stay_open, grown], axis=1)
        order = np.argpartition(-worth, width - 1, axis=1)[:, :width]
        codes = np.take_along_axis(np.concatenate([codes, longer], axis=1), order, 1)
        nothing = np.zeros_like(grown)
        closed = np.take_along_axis(np.concatenate([stay_closed, nothing], axis=1), order, 1)
        open_ = np.take_along_axis(np.concatenate([stay_open, grown], axis=1), order, 1)
    return codes, closed + open_


def _exact(steps: FloatArray, codes: Codes) -> FloatArray:
    """Probabilities (N, K) of texts (N, K) over all paths: the forward variables of Graves et al.

    Run from the last step to the first, since a number gives its last character first.
    """
    n, count, classes = steps.shape
    digits = []
    rest = codes
    while rest.any():
        digits.append((rest % np.uint64(classes)).astype(np.intp))
        rest = rest // np.uint64(classes)
    # States: the characters with blanks around them; beyond a text's end more blanks, unused.
    states = np.zeros((n, codes.shape[1], 2 * len(digits) + 1), np.intp)
    for k, digit in enumerate(digits):
        states[..., 2 * k + 1] = digit
    leap = (states[..., 2:] > 0) & (states[..., 2:] != states[..., :-2])
    said = np.take_along_axis(steps[:, ::-1], states.reshape(n, 1, -1), 2)
    said = said.reshape(n, count, *states.shape[1:])
    forward = np.zeros(states.shape)
    forward[..., :2] = said[:, 0, :, :2]
    for t in range(1, count):
        came = forward.copy()
        came[..., 1:] += forward[..., :-1]
        came[..., 2:] += forward[..., :-2] * leap
        forward = came * said[:, t]
    end = 2 * (states[..., 1::2] > 0).sum(axis=2)[..., None]
    blank, character = (np.take_along_axis(forward, np.maximum(end - k, 0), 2) for k in (0, 1))
    return np.asarray((blank + np.where(end > 0, character, 0))[..., 0])


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
