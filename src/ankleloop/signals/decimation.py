"""Decimation of signals, and of their derivatives, by the same zero-phase low-pass, sampled exactly.

Every channel of a trial goes through the same kernel, so linear relations between position, velocity, acceleration
and torque survive decimation. A derivative is the convolution with the derivative of that kernel: unlike a difference
of samples, it is exact at all frequencies that the kernel passes.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike
from scipy.fft import irfft, next_fast_len, rfft

from ankleloop.errors import DataError
from ankleloop.kernels import as_samples, kernel

# Fractions of the identification rate: for 100 Hz data, flat to 38 Hz and zero from the Nyquist frequency of 50 Hz on.
PASSBAND = 0.38
STOPBAND = 0.50
ATTENUATION_DB = 90.0
USUAL_RATE = 100.0  # of an identification [Hz]
# Band of the velocity at the input of the static nonlinearity [Hz]; less where the sampling rate is low.
VELOCITY_PASSBAND = 150.0
VELOCITY_STOPBAND = 250.0


def usual_rate(sampling_rate: float) -> float:
    """The whole division of a sampling rate [Hz] that is nearest to 100 Hz."""
    factor = max(1, int(sampling_rate / USUAL_RATE))
    rates = (sampling_rate / factor, sampling_rate / (factor + 1))
    return min(rates, key=lambda rate: abs(rate - USUAL_RATE))


def decimation_factor(sampling_rate: float, identification_rate: float) -> int:
    """Number of recorded samples per identified sample."""
    ratio = sampling_rate / identification_rate
    factor = round(ratio)
    if factor < 1 or abs(ratio - factor) > 1e-6 * factor:
        divisor = max(1, int(np.ceil(ratio - 1e-9)))
        raise DataError(
            f"the sampling rate ({sampling_rate:g} Hz) is not a whole multiple of the identification rate "
            f"({identification_rate:g} Hz): choose an identification_rate that divides it, "
            f"for example {sampling_rate / divisor:.12g} Hz, or resample the record."
        )
    return factor


def design_lowpass(
    rate: float, passband: float, stopband: float, derivative: int = 0, shift: float = 0.0
) -> tuple[np.ndarray, int]:
    """Taps of a Kaiser low-pass, differentiated and delayed by a fraction of a sample, and their half length.

    The derivative and the shift are applied to the spectrum of the taps: they act on the band-limited kernel itself.

    Shapes: returns taps (2 half + 1,).
    """
    # Kaiser's formulas (1974), because importing scipy.signal takes longer than most jobs of the workflow.
    transition = 2 * np.pi * (stopband - passband) / rate
    order = np.ceil((ATTENUATION_DB - 7.95) / (2.285 * transition) + 1)
    half = int(order) // 2 + 1
    beta = 0.1102 * (ATTENUATION_DB - 8.7)
    times = np.arange(-half, half + 1)
    taps = np.kaiser(2 * half + 1, beta) * np.sinc((passband + stopband) / rate * times)
    taps /= taps.sum()
    if derivative == 0 and shift == 0.0:
        return taps, half
    # The differentiated kernel rings beyond the length of the kernel itself: a quarter of its length is added.
    half_length = half + max(8, half // 4)
    size = int(2 ** np.ceil(np.log2(8 * half_length)))
    padded = np.pad(taps, (0, size - taps.size))
    s = 2j * np.pi * np.fft.rfftfreq(size, 1.0 / rate)
    spectrum = np.fft.rfft(np.roll(padded, -half))
    spectrum = spectrum * s**derivative * np.exp(-s * shift / rate)
    centred = np.fft.irfft(spectrum, size)
    return np.roll(centred, half_length)[: 2 * half_length + 1], half_length


@lru_cache(maxsize=64)
def decimation_taps(factor: int, derivative: int) -> tuple[np.ndarray, int]:
    """Taps of the decimation, and their half length in whole decimated samples.

    Shapes: returns taps (2 half + 1,).
    """
    # Design at unit identification rate, so that one cached design serves every rate.
    taps, half = design_lowpass(factor, PASSBAND, STOPBAND, derivative)
    half_length = -(-half // factor) * factor
    return np.pad(taps, half_length - half), half_length


def decimation_margin(factor: int) -> int:
    """Recorded samples that the widest decimation kernel needs on either side of a decimated sample."""
    return decimation_taps(factor, 1)[1]


def decimate(
    x: ArrayLike, factor: int, first: int, count: int, *, rate: float = 1.0, derivative: int = 0
) -> np.ndarray:
    """Decimate a signal, or a derivative of it, through the zero-phase low-pass of the identification.

    The kernel is flat to 0.38 and stops at 0.50 of the decimated rate; its derivatives are exact.

    Shapes: x (N,); returns (count,).
    """
    signal = np.asarray(x, dtype=float)
    taps, half = decimation_taps(factor, derivative)
    start = first - half
    stop = first + factor * (count - 1) + half + 1
    if count < 1 or start < 0 or stop > signal.shape[-1]:
        raise DataError(
            f"a record of {signal.shape[-1]} samples is too short: decimation by {factor} needs samples "
            f"{start} to {stop - 1}. Record longer, or raise the identification rate."
        )
    if derivative:
        # Constants are in the null space of a derivative: removing them first keeps the rounding small.
        signal = signal - signal.mean(axis=-1, keepdims=True)
    decimated = convolve_strided(signal, taps, start, factor, count)
    return decimated * (rate / factor) ** derivative


def convolve_strided(
    x: np.ndarray, taps: np.ndarray, start: int, stride: int, count: int
) -> np.ndarray:
    """Samples of the convolution of one signal or of several: only those that need nothing beyond the ends.

    Shapes: x (N,), taps (M,); returns (count,).
    """
    rows = as_samples(x.reshape(-1, x.shape[-1]))
    weights = np.ascontiguousarray(taps[::-1])
    samples = _sum_products(rows, weights, start, stride, count)
    return samples.reshape(*x.shape[:-1], count)


# Sums may be reordered, so that the compiler adds several terms at a time.
@kernel(fastmath={"contract", "reassoc"})
def _sum_products(rows, weights, start, stride, count):
    """Weighted sums that begin every `stride` samples."""
    out = np.empty((rows.shape[0], count))
    for c in range(rows.shape[0]):
        for i in range(count):
            piece = rows[c, start + i * stride :][: weights.size]
            total = 0.0
            for k in range(weights.size):
                total += weights[k] * piece[k]
            out[c, i] = total
    return out


def convolve(x: np.ndarray, taps: np.ndarray) -> np.ndarray:
    """Full convolution of a long signal by Fourier transforms.

    Shapes: x (N,), taps (M,); returns (N + M - 1,).
    """
    length = x.size + taps.size - 1
    size = next_fast_len(length, real=True)
    spectrum = rfft(x, size) * rfft(taps, size)
    return irfft(spectrum, size)[:length]


@lru_cache(maxsize=64)
def velocity_taps(rate: float, delay: float) -> tuple[np.ndarray, int, int]:
    """Taps of the wide differentiator, delayed by a fraction of a sample, their half length, and the whole samples."""
    stopband = min(VELOCITY_STOPBAND, 0.5 * rate)
    passband = min(VELOCITY_PASSBAND, 0.6 * stopband)
    whole = round(delay * rate)
    fraction = round(delay * rate - whole, 9)
    taps, half = design_lowpass(rate, passband, stopband, derivative=1, shift=fraction)
    return taps, half, whole


def differentiation_margin(rate: float, delay: float = 0.0) -> tuple[int, int]:
    """Recorded samples that `differentiate` needs before and after each sample of its result."""
    _, half, whole = velocity_taps(rate, delay)
    return half + whole, half - whole


def differentiate(x: ArrayLike, rate: float, delay: float = 0.0) -> np.ndarray:
    """Velocity of a recorded signal through a wide differentiator (150 Hz), delayed.

    The delay need not be a whole number of samples: its fractional part is part of the kernel.

    Shapes: x (N,); returns (N,).
    """
    signal = np.asarray(x, dtype=float)
    taps, half, whole = velocity_taps(rate, delay)
    needed = taps.size + abs(whole)
    if signal.size < needed:
        raise DataError(
            f"a record of {signal.size} samples is too short to differentiate: it takes at least {needed}."
        )
    count = signal.size - taps.size + 1
    velocity = convolve_strided(signal - signal.mean(), taps, start=0, stride=1, count=count)
    # velocity[k] belongs to sample k + half; a delay of `whole` samples moves it to k + half + whole.
    index = np.arange(signal.size) - half - whole
    return velocity[np.clip(index, 0, count - 1)]
