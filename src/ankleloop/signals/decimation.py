"""Decimation and differentiation with one and the same zero-phase low-pass, sampled exactly.

Every channel of a trial goes through the same kernel, so linear relations between position, velocity, acceleration
and torque survive decimation. A derivative is taken by the derivative of that kernel: it is exact wherever the
kernel passes anything at all, which a difference of samples is not.
"""

from functools import lru_cache

import numpy as np
from numba import njit
from scipy.fft import irfft, next_fast_len, rfft

from ankleloop.errors import DataError

__all__ = [
    "convolve",
    "decimate",
    "decimation_factor",
    "decimation_margin",
    "differentiate",
    "differentiation_margin",
    "lowpass",
]

# Fractions of the identification rate: flat to 38 Hz and nothing left at the 50 Hz Nyquist frequency of 100 Hz data.
PASSBAND, STOPBAND = 0.38, 0.50
# Velocity ahead of the static nonlinearity has to stay wide: 150 Hz, or what the sampling rate allows.
VELOCITY_PASSBAND, VELOCITY_STOPBAND = 150.0, 250.0
ATTENUATION_DB = 90.0


def decimation_factor(sampling_rate, identification_rate):
    """Whole number of recorded samples per identified sample.

    Parameters
    ----------
    sampling_rate, identification_rate : float
        Rates of the record and of the identification [Hz].

    Returns
    -------
    int
        The factor.

    Raises
    ------
    DataError
        If the sampling rate is not a whole multiple of the identification rate.

    Examples
    --------
    >>> decimation_factor(1000.0, 100.0)
    10
    """
    if not (np.isfinite(identification_rate) and identification_rate > 0):
        raise DataError(f"identification_rate must be positive and finite, got {identification_rate} Hz.")
    ratio = sampling_rate / identification_rate
    factor = round(ratio)
    if factor < 1 or abs(ratio - factor) > 1e-6 * factor:
        raise DataError(
            f"the sampling rate ({sampling_rate:g} Hz) is not a whole multiple of the identification rate "
            f"({identification_rate:g} Hz): choose an identification_rate that divides it, "
            f"for example {sampling_rate / max(1, int(np.ceil(ratio - 1e-9))):.12g} Hz, or resample the record."
        )
    return factor


@lru_cache(maxsize=64)
def _lowpass(rate, passband, stopband, derivative=0, shift=0.0):
    """Taps of a Kaiser low-pass, differentiated and delayed by a fraction of a sample, and their half length.

    The derivative and the shift are applied to the spectrum of the taps: they act on the band-limited kernel itself.
    """
    # Kaiser's formulas (1974), by hand: importing scipy.signal takes longer than most jobs of the workflow.
    half = int(np.ceil((ATTENUATION_DB - 7.95) / (2.285 * 2 * np.pi * (stopband - passband) / rate) + 1)) // 2 + 1
    window = np.kaiser(2 * half + 1, 0.1102 * (ATTENUATION_DB - 8.7))
    taps = window * np.sinc((passband + stopband) / rate * np.arange(-half, half + 1))
    taps /= taps.sum()
    if derivative == 0 and shift == 0.0:
        return taps, half
    # Differentiated taps ring a little beyond the kernel they come from; a quarter more length holds that.
    wide = half + max(8, half // 4)
    size = int(2 ** np.ceil(np.log2(8 * wide)))
    padded = np.zeros(size)
    padded[: 2 * half + 1] = taps
    omega = 2j * np.pi * np.fft.rfftfreq(size, 1.0 / rate)
    spectrum = np.fft.rfft(np.roll(padded, -half)) * omega**derivative * np.exp(-omega * shift / rate)
    kernel = np.roll(np.fft.irfft(spectrum, size), wide)[: 2 * wide + 1]
    kernel.setflags(write=False)
    return kernel, wide


@lru_cache(maxsize=64)
def _decimation_taps(factor, derivative):
    # Design at unit identification rate, so that one cached design serves every rate.
    taps, half = _lowpass(float(factor), PASSBAND, STOPBAND, derivative)
    padded = -(-half // factor) * factor  # whole decimated samples
    taps = np.pad(taps, padded - half)
    taps.setflags(write=False)
    return taps, padded


def decimation_margin(factor):
    """Recorded samples at either end that the decimation kernels need (the widest of them).

    Parameters
    ----------
    factor : int
        Decimation factor.

    Returns
    -------
    int
        Half length of the kernel in recorded samples.

    Examples
    --------
    >>> decimation_margin(10) % 10
    0
    """
    return _decimation_taps(factor, 1)[1]


def decimate(x, factor, first, count, *, rate=1.0, derivative=0):
    """Decimate a signal, or a derivative of it, through the zero-phase low-pass of the identification.

    The kernel is flat to 0.38 and stops at 0.50 of the decimated rate; its derivatives are exact.

    Parameters
    ----------
    x : array_like, shape (N,) or (channels, N)
        Recorded signals.
    factor : int
        Recorded samples per decimated sample.
    first, count : int
        Recorded index of the first decimated sample, and how many to make. All of them have to lie
        `decimation_margin` samples inside the record: edges are never padded.
    rate : float
        Sampling rate of `x` [Hz]; the unit of time of the derivative.
    derivative : int
        0, 1 or 2.

    Returns
    -------
    ndarray, shape (count,) or (channels, count)
        The signal at samples ``first + factor * arange(count)``.

    Raises
    ------
    DataError
        If the record is too short for the samples asked for.

    Examples
    --------
    >>> t = np.arange(2000) / 1000.0
    >>> v = decimate(t**2, 10, 500, 3, rate=1000.0, derivative=1)
    >>> np.allclose(v, 2 * t[[500, 510, 520]])
    True
    """
    x = np.asarray(x, dtype=float)
    taps, half = _decimation_taps(factor, derivative)
    start, stop = first - half, first + factor * (count - 1) + half + 1
    if count < 1 or start < 0 or stop > x.shape[-1]:
        raise DataError(
            f"a record of {x.shape[-1]} samples is too short: decimation by {factor} needs samples "
            f"{start} to {stop - 1}. Record longer, or raise the identification rate."
        )
    if derivative:
        # Constants are in the null space of a derivative: taking them out first keeps the rounding small.
        x = x - x.mean(axis=-1, keepdims=True)
    found = _filtered(x, taps, start, factor, count)
    return found * (rate / factor) ** derivative if derivative else found


def _filtered(x, taps, start, factor, count):
    """Every `factor`-th sample from `start` on of the convolution that is complete, of one signal or of several."""
    rows = np.ascontiguousarray(x.reshape(-1, x.shape[-1]))
    return _products(rows, np.ascontiguousarray(taps[::-1]), start, factor, count).reshape(*x.shape[:-1], count)


# Sums may be reordered, so that the compiler makes several terms at a time.
@njit(cache=True, fastmath={"contract", "reassoc"})
def _products(rows, weights, start, factor, count):
    """Weighted sums of `weights.size` samples at every `factor`-th one, two at a time: each weight is loaded once."""
    out = np.empty((rows.shape[0], count))
    n = weights.size
    for c in range(rows.shape[0]):
        x = rows[c, start:]
        for i in range(0, count - 1, 2):
            first, second = x[i * factor : i * factor + n], x[(i + 1) * factor : (i + 1) * factor + n]
            a, b = 0.0, 0.0
            for k in range(n):
                a += weights[k] * first[k]
                b += weights[k] * second[k]
            out[c, i], out[c, i + 1] = a, b
        if count % 2:
            last = x[(count - 1) * factor : (count - 1) * factor + n]
            a = 0.0
            for k in range(n):
                a += weights[k] * last[k]
            out[c, count - 1] = a
    return out


def lowpass(x, factor):
    """The low-pass of `decimate` without the decimation; the signal counts as its mean beyond its ends.

    Parameters
    ----------
    x : ndarray, shape (N,)
        Recorded signal.
    factor : int
        Factor of the decimation whose low-pass it is.

    Returns
    -------
    ndarray, shape (N,)
        Low-passed signal without its mean.

    Examples
    --------
    >>> bool(np.abs(lowpass(np.ones(2000), 10)).max() < 1e-12)
    True
    """
    x = np.asarray(x, dtype=float)
    taps, half = _decimation_taps(factor, 0)
    return convolve(x - x.mean(), taps)[half : half + x.size]


def convolve(x, taps):
    """Full convolution of a long signal by Fourier transforms.

    Parameters
    ----------
    x : ndarray, shape (N,)
        The signal.
    taps : ndarray, shape (M,)
        Impulse response.

    Returns
    -------
    ndarray, shape (N + M - 1,)

    Examples
    --------
    >>> convolve(np.array([1.0, 2.0]), np.array([1.0, 1.0])).round(12).tolist()
    [1.0, 3.0, 2.0]
    """
    length = x.size + taps.size - 1
    size = next_fast_len(length, real=True)
    return irfft(rfft(x, size) * rfft(taps, size), size)[:length]


def _velocity_taps(rate, shift):
    stopband = min(VELOCITY_STOPBAND, 0.5 * rate)
    passband = min(VELOCITY_PASSBAND, 0.6 * stopband)
    return _lowpass(float(rate), passband, stopband, 1, float(shift))


def differentiation_margin(rate, delay=0.0):
    """Recorded samples that `differentiate` needs before and after each sample it makes.

    Parameters
    ----------
    rate : float
        Sampling rate [Hz].
    delay : float
        Delay [s].

    Returns
    -------
    tuple of int
        Samples before, samples after.

    Examples
    --------
    >>> before, after = differentiation_margin(1000.0, 0.040)
    >>> before - after
    80
    """
    half = _velocity_taps(rate, 0.0)[1]
    whole = round(delay * rate)
    return half + whole, half - whole


def differentiate(x, rate, delay=0.0):
    """Velocity of a recorded signal through a wide differentiator (150 Hz), delayed.

    The delay need not be a whole number of samples: the rest is part of the kernel.

    Parameters
    ----------
    x : array_like, shape (N,)
        Signal at the recording rate.
    rate : float
        Sampling rate [Hz].
    delay : float
        Delay [s].

    Returns
    -------
    ndarray, shape (N,)
        Derivative [unit of x / s]. Samples nearer to an edge than `differentiation_margin` repeat the nearest
        sample that is complete.

    Raises
    ------
    DataError
        If the record is shorter than the kernel.

    Examples
    --------
    >>> t = np.arange(1000) / 1000.0
    >>> v = differentiate(np.sin(20 * t), 1000.0, delay=0.0405)
    >>> np.allclose(v[500], 20 * np.cos(20 * (t[500] - 0.0405)), rtol=1e-4)
    True
    """
    x = np.asarray(x, dtype=float)
    whole = round(delay * rate)
    taps, half = _velocity_taps(rate, round(delay * rate - whole, 9))
    if x.size < taps.size + abs(whole):
        raise DataError(
            f"a record of {x.size} samples is too short to differentiate: it takes at least {taps.size + abs(whole)}."
        )
    complete = _filtered(x - x.mean(), taps, 0, 1, x.size - taps.size + 1)
    # complete[k] belongs to sample k + half; a delay of `whole` samples moves it to k + half + whole.
    index = np.clip(np.arange(x.size) - half - whole, 0, complete.size - 1)
    return complete[index]
