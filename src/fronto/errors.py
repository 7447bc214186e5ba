"""Exceptions for wrong input; a result that cannot be trusted is a status, not an exception."""

from __future__ import annotations

__all__ = ["FrontoError", "InputError"]


class FrontoError(Exception):
    """Base class of every exception that fronto raises on purpose."""


class InputError(FrontoError, ValueError):
    """Input that cannot be used as it is.

    The message is one line that names the thing, what was expected, what was
    found and what to do about it. The command line prints it and exits with 2.

    Parameters
    ----------
    thing
        What is wrong: a file with the field in it, or an argument.
    expected
        What was expected and what was found instead.
    remedy
        What the user can do.
    """

    def __init__(self, thing: str, expected: str, remedy: str = "") -> None:
        self.thing = thing
        self.expected = expected
        self.remedy = remedy
        message = f"{thing}: {expected}"
        if remedy:
            message += f"; {remedy}"
        # A file name that is no Unicode reaches Python with lone surrogates, which no file or
        # terminal takes.
        printable = message.encode("utf-8", "replace").decode("utf-8")
        super().__init__(" ".join(printable.split()))

    def __reduce__(self) -> tuple[type[InputError], tuple[str, str, str]]:
        return type(self), (self.thing, self.expected, self.remedy)
