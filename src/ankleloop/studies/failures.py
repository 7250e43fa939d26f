"""Words of what fails in a job: where it was, and why."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

from ankleloop.errors import DataError, UnstableLoopError


def describe_error(error: BaseException) -> str:
    """The message of an error in one line, with its type where that says more than the message, or what to do."""
    kind, text = type(error).__name__, str(error)
    if hasattr(error, "ename") and hasattr(error, "evalue"):  # of a notebook: that in its cell
        kind, text = error.ename, error.evalue
    message = " ".join(text.split())
    if isinstance(error, MemoryError):
        return (
            f"out of memory ({message or 'no message'}): run the same command again with fewer jobs at a time "
            "(--cores 1), or on a machine with more memory. What other jobs have finished is kept."
        )
    if kind in (DataError.__name__, UnstableLoopError.__name__):
        return message
    return f"{kind}: {message or 'no message'}"


@contextmanager
def locate_errors(place: str) -> Iterator[None]:
    """Note on every error of the block where it was: job, file, study, point, trial or method."""
    try:
        yield
    except Exception as error:
        error.add_note(place)
        raise
