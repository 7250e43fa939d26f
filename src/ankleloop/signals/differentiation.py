"""Velocity of a recorded signal at the recording rate, and the kernels of all filters as plain sums."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ankleloop.arguments import check_number
from ankleloop.errors import DataError
from ankleloop.signals.decimation import (
    convolve_strided,
    decimation_factor,
    decimation_margin,
    decimation_taps,
    design_lowpass,
)

# Band of the velocity at the input of the static nonlinearity [Hz]; less where the sampling rate is low.
VELOCITY_PASSBAND, VELOCITY_STOPBAND = 150.0, 250.0


def _velocity_taps(rate: float, shift: float) -> tuple[np.ndarray, int]:
    """Taps of the wide differentiator, delayed by a fraction of a sample, and their half length."""
    stopband = min(VELOCITY_STOPBAND, 0.5 * rate)
    passband = min(VELOCITY_PASSBAND, 0.6 * stopband)
    return design_lowpass(float(rate), passband, stopband, 1, float(shift))


def _check_rate_and_delay(rate: float, delay: float) -> tuple[float, float]:
    return (
        check_number("differentiate", "rate", rate, "Hz", gt=0, le=1e9),
        check_number("differentiate", "delay", delay, "s", ge=-1000, le=1000),
    )


def differentiation_margin(rate: float, delay: float = 0.0) -> tuple[int, int]:
    """Recorded samples that `differentiate` needs before and after each sample of its result."""
    rate, delay = _check_rate_and_delay(rate, delay)
    half = _velocity_taps(rate, 0.0)[1]
    whole = round(delay * rate)
    return half + whole, half - whole


def differentiate(x: ArrayLike, rate: float, delay: float = 0.0) -> np.ndarray:
    """Velocity of a recorded signal through a wide differentiator (150 Hz), delayed.

    The delay need not be a whole number of samples: its fractional part is part of the kernel.

    Shapes: x (N,); returns (N,).
    """
    rate, delay = _check_rate_and_delay(rate, delay)
    x = np.asarray(x, dtype=float)
    whole = round(delay * rate)
    taps, half = _velocity_taps(rate, round(delay * rate - whole, 9))
    if x.size < taps.size + abs(whole):
        raise DataError(
            f"a record of {x.size} samples is too short to differentiate: it takes at least {taps.size + abs(whole)}."
        )
    velocity = convolve_strided(x - x.mean(), taps, 0, 1, x.size - taps.size + 1)
    # velocity[k] belongs to sample k + half; a delay of `whole` samples moves it to k + half + whole.
    index = np.clip(np.arange(x.size) - half - whole, 0, velocity.size - 1)
    return velocity[index]


def filter_kernels(rate: float, identification_rate: float, delay: float) -> dict[str, np.ndarray]:
    """Kernels of `decimate` and `differentiate` as plain sums, for programs that do without them.

    Each signal at a recorded sample n is the sum of kernel · x(n - lag) over the lags.
    """
    rate, delay = _check_rate_and_delay(rate, delay)
    factor = decimation_factor(rate, identification_rate)
    half = decimation_margin(factor)
    rows = [decimation_taps(factor, derivative) for derivative in range(3)]
    kernels = [
        np.pad(taps, half - length) * identification_rate**derivative for derivative, (taps, length) in enumerate(rows)
    ]
    whole = round(delay * rate)
    taps, length = _velocity_taps(rate, round(delay * rate - whole, 9))
    return {
        "decimation_kernel": np.array(kernels),
        "decimation_lag": np.arange(-half, half + 1),
        "velocity_kernel": taps,
        "velocity_lag": np.arange(-length, length + 1) + whole,
    }
