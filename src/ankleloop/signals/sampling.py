"""Sampling rates: what is stated, and what the times of a record say."""

import numpy as np
from numba import njit

from ankleloop.errors import DataError

__all__ = ["as_rate", "check_same_rate", "in_samples", "rate_from_time"]

RATE_TOLERANCE = 1e-3  # two statements of one sampling rate may differ by this fraction


def as_rate(value, *, source):
    """Turn a sampling rate [Hz] into a positive float."""
    try:
        rate = float(np.asarray(value).item())
    except (TypeError, ValueError):
        raise DataError(f"{source}: sampling_rate is {value!r}: pass a single number in Hz.") from None
    if not (np.isfinite(rate) and rate > 0):
        raise DataError(f"{source}: sampling_rate is {rate:g} Hz: pass a positive number of samples per second.")
    return rate


def rate_from_time(time, *, source, name="time"):
    """Compute the sampling rate [Hz] of times [s], shape (N,); a gap, a duplicate or jitter is a DataError."""
    if time.size < 2:
        raise DataError(f"{source}: {name} has {time.size} sample: a trial needs at least 2.")
    bad = np.flatnonzero(~np.isfinite(time))
    if bad.size:
        raise DataError(
            f"{source}: {name} is not finite at sample {bad[0]} ({in_samples(bad.size)} in all): repair it."
        )
    mean = (time[-1] - time[0]) / (time.size - 1)
    # Times kept in single precision are off by up to N·eps steps; half a step or more is a fault all the same.
    allowed = min(0.01 + np.finfo(np.float32).eps * time.size, 0.5)
    if mean > 0 and _irregularity(time, mean) < 0.49 * allowed * mean:
        return _nine_digits(1.0 / mean)  # all steps being that close to the mean, none is far from the usual one
    steps = np.diff(time)
    usual = float(np.median(steps))
    tolerance = allowed * abs(usual)
    bad = np.flatnonzero((np.abs(steps - usual) > tolerance) | (steps <= 0))
    if bad.size:
        first = bad[0] + 1
        raise DataError(
            f"{source}: {name} is irregular at sample {first} ({time[first]:g} s): it steps by {steps[first - 1]:g} s "
            f"where {usual:g} s is usual ({in_samples(bad.size)} in all): cut the trial there or resample it; if the "
            "times are only rounded, write them with more digits."
        )
    return _nine_digits(1.0 / mean)


def _nine_digits(rate):
    """Nine digits hide the rounding of times, so that 1 ms steps give 1000 Hz and not 1000.0000000000001."""
    return float(f"{rate:.9g}")


@njit(cache=True)
def _irregularity(time, mean):
    """Largest deviation of a step from their mean."""
    largest = 0.0
    for k in range(time.size - 1):
        largest = max(largest, abs(time[k + 1] - time[k] - mean))
    return largest


def check_same_rate(stated, measured, *, source, name="time"):
    """Refuse a stated sampling rate [Hz] that contradicts the one of the time axis."""
    if abs(measured - stated) > RATE_TOLERANCE * stated:
        raise DataError(
            f"{source}: the sampling rate is stated as {stated:.9g} Hz, but {name} runs at {measured:.9g} Hz: "
            "correct the one that is wrong."
        )


def in_samples(count):
    """A number of samples in words."""
    return f"{count} sample" + ("s" if count != 1 else "")
