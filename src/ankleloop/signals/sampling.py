"""Sampling rates: as stated, and as computed from the times of a record."""

from __future__ import annotations

import numpy as np
from numba import njit
from numpy.typing import ArrayLike

from ankleloop.errors import DataError

__all__ = ["check_same_rate", "compute_rate", "format_samples", "parse_rate"]

RATE_TOLERANCE = 1e-3  # two statements of one sampling rate may differ by this fraction


def parse_rate(value: ArrayLike, *, source: str) -> float:
    """Convert a sampling rate to a positive float.

    Parameters
    ----------
    value : array_like
        A single number [Hz].
    source : str
        Name of the data in error messages.

    Returns
    -------
    float
        Sampling rate [Hz].

    Raises
    ------
    DataError
        If it is not a single positive number.

    Examples
    --------
    >>> parse_rate([1000], source="trial")
    1000.0
    """
    try:
        rate = float(np.asarray(value).item())
    except (TypeError, ValueError):
        raise DataError(f"{source}: sampling_rate is {value!r}: pass a single number in Hz.") from None
    if not (np.isfinite(rate) and rate > 0):
        raise DataError(f"{source}: sampling_rate is {rate:g} Hz: pass a positive number of samples per second.")
    return rate


def compute_rate(time: np.ndarray, *, source: str, name: str = "time") -> float:
    """Compute the sampling rate of regular times.

    Parameters
    ----------
    time : ndarray, shape (N,)
        Times of the samples [s].
    source, name : str
        Names of the data and of the times in error messages.

    Returns
    -------
    float
        Sampling rate [Hz].

    Raises
    ------
    DataError
        For a single sample, a time that is not finite, a gap, a duplicate or jitter; the message names the sample.

    Examples
    --------
    >>> compute_rate(np.arange(1000) / 1000.0, source="trial")
    1000.0
    """
    if time.size < 2:
        raise DataError(f"{source}: {name} has {time.size} sample: a trial needs at least 2.")
    faults = np.flatnonzero(~np.isfinite(time))
    if faults.size:
        raise DataError(
            f"{source}: {name} is not finite at sample {faults[0]} ({format_samples(faults.size)} in all): repair it."
        )
    mean = (time[-1] - time[0]) / (time.size - 1)
    # Times in single precision are off by up to N·eps steps; half a step or more is a fault all the same.
    tolerance = min(0.01 + float(np.finfo(np.float32).eps) * time.size, 0.5)
    if mean > 0 and _irregularity(time, mean) < 0.49 * tolerance * mean:
        return _round_rate(1.0 / mean)  # if all steps are that close to the mean, they are close to the median, too
    steps = np.diff(time)
    median = float(np.median(steps))
    faults = np.flatnonzero((np.abs(steps - median) > tolerance * abs(median)) | (steps <= 0))
    if faults.size:
        first = faults[0] + 1
        raise DataError(
            f"{source}: {name} is irregular at sample {first} ({time[first]:g} s): it steps by {steps[first - 1]:g} s "
            f"where {median:g} s is usual ({format_samples(faults.size)} in all): cut the trial there or resample it; "
            "if the times are only rounded, write them with more digits."
        )
    return _round_rate(1.0 / mean)


def _round_rate(rate: float) -> float:
    """Nine digits hide the rounding of times, so that 1 ms steps give 1000 Hz and not 1000.0000000000001."""
    return float(f"{rate:.9g}")


@njit(cache=True)
def _irregularity(time, mean):
    """Largest deviation of a step from their mean."""
    largest = 0.0
    for k in range(time.size - 1):
        largest = max(largest, abs(time[k + 1] - time[k] - mean))
    return largest


def check_same_rate(stated_rate: float, measured_rate: float, *, source: str, name: str = "time") -> None:
    """Refuse a stated sampling rate that contradicts the times.

    Parameters
    ----------
    stated_rate, measured_rate : float
        Sampling rate as stated, and as computed from the times [Hz].
    source, name : str
        Names of the data and of the times in error messages.

    Raises
    ------
    DataError
        If they differ by more than a thousandth.

    Examples
    --------
    >>> check_same_rate(1000.0, 1000.5, source="trial")
    """
    if abs(measured_rate - stated_rate) > RATE_TOLERANCE * stated_rate:
        raise DataError(
            f"{source}: the sampling rate is stated as {stated_rate:.9g} Hz, but {name} runs at {measured_rate:.9g} "
            "Hz: correct the one that is wrong."
        )


def format_samples(count: int) -> str:
    """Number of samples in words.

    Examples
    --------
    >>> format_samples(1), format_samples(2)
    ('1 sample', '2 samples')
    """
    return f"{count} sample" + ("s" if count != 1 else "")
