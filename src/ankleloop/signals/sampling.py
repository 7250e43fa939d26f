"""Sampling rates: as stated, and as computed from the times of a record."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ankleloop.errors import DataError
from ankleloop.options import describe_limits, show_value

LOWEST_RATE, HIGHEST_RATE = 0.001, 1e9  # Hz
RATE_TOLERANCE = 1e-3  # two statements of one sampling rate may differ by this fraction
FEW_STEPS = 1000  # about as many show the usual one
# A clock behind jitter is seen in blocks of so many samples, in so many of them at least.
CLOCK_BLOCK = 100
SHORTEST_BLOCK = 10
FEWEST_BLOCKS = 6
SMALLEST_SHIFT = 0.5  # sample: a smaller one leaves all samples where they are
MANY_SHIFTS = 12
# About six standard deviations of the difference of two medians: by how all differ, and by independent samples.
SHIFT_DEVIATIONS = 9.0  # median absolute differences
MEDIAN_DEVIATIONS = 16.0  # median absolute deviations of a sample over √N


def parse_rate(value: ArrayLike, *, source: str) -> float:
    """Convert a sampling rate to a positive float."""
    try:
        number = np.asarray(value).item()
        rate = np.nan if isinstance(number, bool) else float(number)
    except (TypeError, ValueError, OverflowError):
        rate = np.nan
    if not LOWEST_RATE <= rate <= HIGHEST_RATE:
        limits = describe_limits("Hz", ge=LOWEST_RATE, le=HIGHEST_RATE)
        raise DataError(
            f"{source}: sampling_rate must be a single number of samples per second {limits}, got {show_value(value)}."
        )
    return rate


def compute_rate(times: np.ndarray, *, source: str, name: str = "time") -> float:
    """Compute the sampling rate of regular times, shape (N,)."""
    size = times.size
    if size < 2:
        raise DataError(f"{source}: {name} has {size} sample: a trial needs at least 2.")
    # Times in single precision are off by up to N·eps steps; half a step or more is a fault all the same.
    tolerance = min(0.01 + float(np.finfo(np.float32).eps) * size, 0.5)
    with np.errstate(all="ignore"):  # of what is refused
        steps = np.diff(times)
        some_steps = steps[:: steps.size // FEW_STEPS | 1]
        usual_step = float(np.median(np.nan_to_num(some_steps)))
        is_regular = np.abs(steps - usual_step) <= tolerance * abs(usual_step)
    irregular = np.flatnonzero(~is_regular | (steps <= 0)) + 1
    missing = np.flatnonzero(~np.isfinite(times))
    if missing.size and missing[0] <= irregular[0]:
        raise DataError(f"{source}: {name} is not finite at sample {missing[0]}: repair it.")
    if irregular.size:
        raise irregular_error(times, int(irregular[0]), usual_step, source=source, name=name)
    step = (times[-1] - times[0]) / (size - 1)
    # Nine digits hide the rounding of times, so that 1 ms steps give 1000 Hz and not 1000.0000000000001.
    return float(f"{1.0 / step:.9g}")


def irregular_error(
    times: np.ndarray, sample: int, usual_step: float, *, source: str, name: str
) -> DataError:
    """The error that says where times are irregular, and what to do."""
    step = times[sample] - times[sample - 1]
    advice = "cut the trial there"
    if step < 0:
        advice = "another sequence begins there: cut the file into two"
    return DataError(
        f"{source}: {name} is irregular at sample {sample} ({times[sample]:g} s): it steps by {step:g} s where "
        f"{usual_step:g} s is usual: {advice}."
    )


@dataclass(frozen=True)
class Clock:
    """An even clock behind times.

    Parameters
    ----------
    rate : float
        Sampling rate [Hz].
    jitter : float
        Standard deviation of the times from the clock [samples].
    shift : int or None
        Sample at which the times shift and do not return: a gap, or another sequence; None without any.
    largest : int or None
        Sample whose time is furthest from the clock.
    """

    rate: float
    jitter: float
    shift: int | None = None
    largest: int | None = None


def fit_clock(times: np.ndarray) -> Clock | None:
    """Fit an even clock to times that jitter, shape (N,); None where there are too few, or none are finite.

    Deviations that return are jitter, a shift that lasts is a gap: medians of the times over blocks that are two apart
    differ by half a sample, and by much more than such medians usually do.
    """
    block = min(CLOCK_BLOCK, times.size // FEWEST_BLOCKS)
    if block < SHORTEST_BLOCK or not np.isfinite(times).all():
        return None
    lag = min(10 * block, times.size // 4)  # long beside pieces of samples that have one stamp
    step = float(np.median(times[lag:] - times[:-lag])) / lag
    if step <= 0.0:
        return None
    late = times / step - np.arange(times.size)  # samples
    blocks = late[: times.size // block * block].reshape(-1, block)
    medians = np.median(np.vstack([blocks, late[-block:]]), axis=1)
    shifts = np.abs(medians[2:] - medians[:-2])
    spread = float(np.median(np.abs(blocks - medians[:-1, None]))) / np.sqrt(block)
    limit = max(SMALLEST_SHIFT, MEDIAN_DEVIATIONS * spread)
    if shifts.size >= MANY_SHIFTS:  # of few, a gap is in most
        limit = max(limit, SHIFT_DEVIATIONS * float(np.median(shifts)))
    shift = None
    if np.any(shifts > limit):
        first = int(np.argmax(shifts > limit)) * block
        steps = np.abs(np.diff(late[first : first + 3 * block + 1]))
        shift = first + int(np.argmax(steps)) + 1
    index = np.arange(times.size)
    slope, start = np.polyfit(index, times, 1)
    deviations = (times - start - slope * index) / slope
    largest = int(np.argmax(np.abs(deviations)))
    return Clock(rate_of_interval(float(slope)), float(np.std(deviations)), shift, largest)


def rate_of_interval(interval: float) -> float:
    """Sampling rate [Hz] of an interval [s] that may be of single precision: a whole number, where it is one."""
    rate = 1.0 / interval
    whole = float(round(rate))
    return whole if abs(rate - whole) <= 1e-5 * rate else rate


def check_same_rate(
    stated_rate: float, measured_rate: float, *, source: str, name: str = "time"
) -> None:
    """Refuse a stated sampling rate that contradicts the times."""
    if abs(measured_rate - stated_rate) > RATE_TOLERANCE * stated_rate:
        raise DataError(
            f"{source}: the sampling rate is stated as {stated_rate:.9g} Hz, but {name} runs at {measured_rate:.9g} "
            "Hz: correct the one that is wrong, or pass sampling_rate.",
            remedy={"sampling_rate": None},
        )


def format_samples(count: int) -> str:
    """Number of samples in words."""
    return f"{count} sample" + ("s" if count != 1 else "")


def match_times(grid: np.ndarray, time: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Samples that two regular series of times of one rate have in common.

    Shapes: grid (N,), time (M,); returns rows, common (K,).
    """
    tolerance = 0.25 * (grid[-1] - grid[0]) / max(grid.size - 1, 1)
    rows = np.minimum(np.searchsorted(grid, time - tolerance), grid.size - 1)
    common = np.flatnonzero(np.abs(grid[rows] - time) <= tolerance)
    return rows[common], common
