"""Exceptions of calfsocket: what went wrong, where, what is allowed, what to do."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

#: Characters of a line; input that is quoted may be a whole file.
_LONGEST = 1000


class CalfsocketError(Exception):
    """Base of every error that calfsocket raises on purpose; its text is for the user."""


class InputError(CalfsocketError, ValueError):
    """The user's input cannot be used; nothing was solved.

    Its text is one line that can be printed, whatever of the input is quoted in it.
    """

    def __init__(self, text: str) -> None:
        readable = "".join(mark if mark.isprintable() else ascii(mark)[1:-1] for mark in text)
        if len(readable) > _LONGEST:
            readable = f"{readable[: _LONGEST // 2]} ... {readable[-_LONGEST // 2 :]}"
        super().__init__(readable)


@contextmanager
def error_context(path: Path | str, place: str = "") -> Iterator[None]:
    """Name the file, and the place in it, in front of an `InputError` that the body raises."""
    try:
        yield
    except InputError as error:
        raise InputError(f"{path}: {place + ': ' if place else ''}{error}") from None


class SolveError(CalfsocketError, RuntimeError):
    """An equilibrium was not found."""


class ConvergenceError(SolveError):
    """The full load was not reached.

    Attributes
    ----------
    result : Result or None
        The last equilibrium of a simulation; None where no simulation failed.
    """

    def __init__(self, text: str, result: Any = None) -> None:
        super().__init__(text)
        self.result = result


class WriteError(CalfsocketError, OSError):
    """A file cannot be written: the disk is full, say; what stood there before is whole."""


def in_one_line(error: BaseException) -> str:
    """Return an error in one line; one that the package did not raise itself with its type."""
    text = " ".join(str(error).split())
    if isinstance(error, MemoryError):
        return f"out of memory{text and ': '}{text}; use a coarser mesh or fewer ranks at a time"
    if isinstance(error, CalfsocketError):
        return text
    return f"{type(error).__name__}: {text}" if text else type(error).__name__
