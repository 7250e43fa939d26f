"""Sampling rates: as stated, and as computed from the times of a record."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator

import numpy as np
from numpy.typing import ArrayLike

from ankleloop.errors import DataError
from ankleloop.options import describe_limits, show_value

MOST_STEPS = 20_000_000  # whose median is computed
LOWEST_RATE, HIGHEST_RATE = 0.001, 1e9  # Hz
RATE_TOLERANCE = 1e-3  # two statements of one sampling rate may differ by this fraction


def parse_rate(value: ArrayLike, *, source: str) -> float:
    """Convert a sampling rate to a positive float."""
    try:
        number = np.asarray(value).item()
        rate = np.nan if isinstance(number, bool) else float(number)
    except (TypeError, ValueError, OverflowError):
        raise DataError(f"{source}: sampling_rate is {show_value(value)}: pass a single number in Hz.") from None
    if not LOWEST_RATE <= rate <= HIGHEST_RATE:
        limits = describe_limits("Hz", ge=LOWEST_RATE, le=HIGHEST_RATE)
        raise DataError(
            f"{source}: sampling_rate must be a number of samples per second {limits}, got {show_value(value)}."
        )
    return rate


def compute_rate(time: np.ndarray, *, source: str, name: str = "time") -> float:
    """Compute the sampling rate of regular times.

    Shapes: time (N,).
    """
    if time.size < 2:
        raise DataError(f"{source}: {name} has {time.size} sample: a trial needs at least 2.")
    return compute_rate_of_parts(lambda: [time], time.size, (time[0], time[-1]), source=source, name=name)


def compute_rate_of_parts(
    parts: Callable[[], Iterable[np.ndarray]],
    size: int,
    ends: tuple[float, float],
    *,
    source: str,
    name: str = "time",
) -> float:
    """Compute the sampling rate of regular times that are read in parts: the same rate, and the same faults."""
    mean = (ends[1] - ends[0]) / (size - 1)
    faults, first, deviation = 0, -1, 0.0
    for start, times, steps in _generate_steps(parts()):
        bad = np.flatnonzero(~np.isfinite(times))
        first = start + int(bad[0]) if bad.size and not faults else first
        faults += bad.size
        if not faults:
            deviation = max(deviation, float(np.max(np.abs(steps - mean), initial=0.0)))
    if faults:
        raise DataError(
            f"{source}: {name} is not finite at sample {first} ({format_samples(faults)} in all): repair it."
        )
    # Times in single precision are off by up to N·eps steps; half a step or more is a fault all the same.
    tolerance = min(0.01 + float(np.finfo(np.float32).eps) * size, 0.5)
    # If all steps are close to their mean, they are close to the median, too.
    if not (mean > 0 and deviation < 0.49 * tolerance * mean):
        _check_steps(parts, size, tolerance, source, name)
    # Nine digits hide the rounding of times, so that 1 ms steps give 1000 Hz and not 1000.0000000000001.
    return float(f"{1.0 / mean:.9g}")


def _generate_steps(parts: Iterable[np.ndarray]) -> Iterator[tuple[int, np.ndarray, np.ndarray]]:
    """Number of the first sample of each part, its times, and its steps with that from the part before."""
    start, last = 0, np.empty(0)
    for times in parts:
        yield start, times, np.diff(times, prepend=last)
        start, last = start + times.size, times[-1:].copy() if times.size else last


def _check_steps(
    parts: Callable[[], Iterable[np.ndarray]], size: int, tolerance: float, source: str, name: str
) -> None:
    """Refuse times of which a step differs from their median by more than a tolerance."""
    stride = -(-size // MOST_STEPS)
    median = float(np.median(np.concatenate([steps[::stride] for _, _, steps in _generate_steps(parts())])))
    faults, first = 0, ""
    for start, times, steps in _generate_steps(parts()):
        bad = np.flatnonzero((np.abs(steps - median) > tolerance * abs(median)) | (steps <= 0))
        if bad.size and not faults:
            k = int(bad[0]) + times.size - steps.size
            first = f"sample {start + k} ({times[k]:g} s): it steps by {steps[bad[0]]:g} s"
        faults += bad.size
    if faults:
        raise DataError(
            f"{source}: {name} is irregular at {first} where {median:g} s is usual ({format_samples(faults)} in all): "
            "cut the trial there or resample it; if the times are only rounded, write them with more digits."
        )


def check_same_rate(stated_rate: float, measured_rate: float, *, source: str, name: str = "time") -> None:
    """Refuse a stated sampling rate that contradicts the times."""
    if abs(measured_rate - stated_rate) > RATE_TOLERANCE * stated_rate:
        raise DataError(
            f"{source}: the sampling rate is stated as {stated_rate:.9g} Hz, but {name} runs at {measured_rate:.9g} "
            "Hz: correct the one that is wrong."
        )


def format_samples(count: int) -> str:
    """Number of samples in words."""
    return f"{count} sample" + ("s" if count != 1 else "")


def match_times(grid: np.ndarray, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Samples that two regular series of times of one rate have in common.

    Shapes: grid (N,), time (M,); returns rows, common (K,).
    """
    tolerance = 0.25 * (grid[-1] - grid[0]) / max(grid.size - 1, 1)
    rows = np.searchsorted(grid, time - tolerance)
    common = np.flatnonzero(rows < grid.size)
    common = common[np.abs(grid[rows[common]] - time[common]) <= tolerance]
    return rows[common], common
