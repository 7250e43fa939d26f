"""The errors that ankleloop raises about its input, and words of what fails in a job: where it was, and why."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from typing import Any


class RemediedError(Exception):
    """An error that knows the options that would help.

    Parameters
    ----------
    message : str
        What is wrong, where, and what to do.
    remedy : mapping of str to object, optional
        Values of options by name, as `read_trial` and the commands have them: None where only the user knows the value.
    """

    def __init__(self, message: str, remedy: Mapping[str, Any] | None = None) -> None:
        super().__init__(message)
        self.remedy = dict(remedy or {})


class DataError(RemediedError, ValueError):
    """Data that cannot be used: the message says what is wrong, where, and what to do.

    Its `remedy` has the options that would help, with their values: None where only the user knows the value.

    Examples
    --------
    >>> from ankleloop import new_trial
    >>> new_trial(position=[0.0, 0.1, float("nan")], torque=[0.0, 1.0, 2.0], sampling_rate=1000.0)
    Traceback (most recent call last):
      ...
    ankleloop.errors.DataError: trial: position is not finite at sample 2 (0.002 s), 1 sample in all: cut the trial ...
    >>> DataError("a.csv: there is no sampling rate.", remedy={"sampling_rate": None}).remedy
    {'sampling_rate': None}
    """


class UnstableLoopError(ValueError):
    """A simulated loop that diverges: the message names the parameters that make it unstable.

    Examples
    --------
    >>> from ankleloop import simulate
    >>> try:
    ...     simulate(seed=1, duration=2.0, reflex_gain=200.0)
    ... except UnstableLoopError as error:
    ...     print("reflex_gain" in str(error))
    True
    """


class ResourceError(RemediedError, RuntimeError):
    """Disk, memory or time that is short: it stops a job, and says nothing about the data."""


# Of data and numerical routines: LinAlgError, DataError and UnstableLoopError are ValueErrors, FloatingPointError is an
# ArithmeticError. Where many records are processed, such an error refuses its record alone; mistakes in the program
# (TypeError, KeyError, AttributeError) stop the job.
NUMERICAL_ERRORS = (ValueError, ArithmeticError)


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
    if kind in ("DataError", "ResourceError", "UnstableLoopError"):
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
