"""Sampling rates: as stated, and as computed from the times of a record."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ankleloop.errors import DataError
from ankleloop.options import describe_limits, show_value

LOWEST_RATE, HIGHEST_RATE = 0.001, 1e9  # Hz
RATE_TOLERANCE = 1e-3  # two statements of one sampling rate may differ by this fraction
FEW_STEPS = 1000  # about as many show the usual one


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
        sample = irregular[0]
        raise DataError(
            f"{source}: {name} is irregular at sample {sample} ({times[sample]:g} s): it steps by "
            f"{steps[sample - 1]:g} s where {usual_step:g} s is usual: cut the trial there or resample it; if the "
            "times are only rounded, write them with more digits."
        )
    step = (times[-1] - times[0]) / (size - 1)
    # Nine digits hide the rounding of times, so that 1 ms steps give 1000 Hz and not 1000.0000000000001.
    return float(f"{1.0 / step:.9g}")


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
