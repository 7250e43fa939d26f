"""Position without fed-back torque: what the reference explains."""

import numpy as np
from scipy import linalg

from ankleloop.errors import DataError
from ankleloop.signals.decimation import PASSBAND, convolve, decimate, lowpass
from ankleloop.signals.spectra import smoothed

__all__ = ["explained_by", "finite_response", "share_explained", "unexplained"]

LEADS, LAGS = 0.15, 0.80  # s: zero-phase decimation needs leads, a lightly damped load long lags
RIDGE = 1e-3  # of the power of the source: it settles what lies beyond the pass band
RESOLUTION = 0.8  # Hz: width over which the noise spectrum is smoothed


def finite_response(y, x, rate, leads=LEADS, lags=LAGS):
    r"""Finite response of a signal to leads and lags of another, by weighted least squares.

    The normal equations are made of correlations, so the length of the record hardly counts. They are solved twice: the
    second time every frequency is weighted by the inverse of the spectrum of what the first solution left.

    Parameters
    ----------
    y, x : ndarray, shape (N,)
        The signal, and what it responds to.
    rate : float
        Sampling rate [Hz]; frequencies above the pass band of the decimation do not count.
    leads, lags : float
        Time ahead of and behind the present [s].

    Returns
    -------
    ndarray, shape (leads + lags + 1,)
        Response, from the furthest lead to the oldest lag.

    Raises
    ------
    DataError
        If the record is shorter than four times the leads and lags.

    Examples
    --------
    >>> x = np.random.default_rng(1).standard_normal(4000)
    >>> taps = finite_response(np.roll(x, 3), x, 100.0, leads=0.02, lags=0.05)
    >>> int(np.argmax(taps)) - 2
    3
    """
    shifts = np.arange(-round(leads * rate), round(lags * rate) + 1)
    if y.size < 4 * shifts.size:
        raise DataError(
            f"the record of {y.size / rate:.3g} s is too short for a response to {shifts.size / rate:.3g} s of the "
            f"reference: record at least {4 * shifts.size / rate:.3g} s."
        )
    size = int(2 ** np.ceil(np.log2(y.size + shifts.size)))
    spectrum, target = np.fft.rfft(x - x.mean(), size), np.fft.rfft(y - y.mean(), size)
    inside = np.fft.rfftfreq(size) <= PASSBAND
    taps = _correlated(spectrum, target, inside.astype(float), shifts, size)
    circular = np.zeros(size)
    circular[shifts] = taps
    left = target - np.fft.rfft(circular) * spectrum
    noise = smoothed(np.abs(left) ** 2, RESOLUTION * size / rate)
    weight = np.where(inside, 1.0 / np.maximum(noise, 1e-12 * noise[inside].max()), 0.0)
    return _correlated(spectrum, target, weight / weight.max(), shifts, size)


def _correlated(spectrum, target, weight, shifts, size):
    """Solve the normal equations of weighted correlations, a Toeplitz system."""
    own = np.fft.irfft(weight * np.abs(spectrum) ** 2, size)[: shifts.size]
    own[0] *= 1.0 + RIDGE
    return linalg.solve_toeplitz(own, np.fft.irfft(weight * spectrum.conj() * target, size)[shifts])


def _responded(x, taps, ahead):
    """Answer of a finite response that begins some samples ahead, where the signal is."""
    return convolve(x, taps)[ahead:][: x.size]


def explained_by(y, source, grid, rate, leads=LEADS, lags=LAGS):
    """Part of a decimated signal that a recorded source explains, at the recording rate.

    Parameters
    ----------
    y : ndarray, shape (N,)
        Decimated signal.
    source : ndarray, shape (samples,)
        Source at the recording rate.
    grid : tuple of int
        Factor, first recorded sample and number of the decimated samples.
    rate : float
        Recording rate [Hz].
    leads, lags : float
        Time ahead of and behind the present [s].

    Returns
    -------
    ndarray, shape (samples,)
        Low-passed as the decimation does, without its mean.
    """
    factor = grid[0]
    taps = finite_response(y, decimate(source, *grid), rate / factor, leads, lags)
    spread = np.zeros(factor * (taps.size - 1) + 1)
    spread[::factor] = taps
    return _responded(lowpass(source, factor), spread, factor * round(leads * rate / factor))


def unexplained(y, x, rate, leads=LEADS, lags=LAGS):
    """What leads and lags of another signal leave of a signal.

    Parameters
    ----------
    y, x : ndarray, shape (N,)
        The signal, and what may explain it, decimated alike.
    rate : float
        Sampling rate [Hz].
    leads, lags : float
        Time ahead of and behind the present [s].

    Returns
    -------
    ndarray, shape (M,)
        Without the ends that the response touches.
    """
    taps = finite_response(y, x, rate, leads, lags)
    return _left(y, x, taps, round(leads * rate))


def _left(y, x, taps, ahead):
    return (y - y.mean() - _responded(x - x.mean(), taps, ahead))[taps.size : -taps.size]


def share_explained(y, x, rate, leads=LEADS, lags=LAGS):
    """Share of a signal's variance that another one predicts in the half of the record that was not fitted.

    Parameters
    ----------
    y, x : ndarray, shape (N,)
        The signal, and what may explain it.
    rate : float
        Sampling rate [Hz].
    leads, lags : float
        Time ahead of and behind the present [s].

    Returns
    -------
    float
        1 if all of it is explained; 0 or less if nothing is.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> x, other = rng.standard_normal((2, 4000))
    >>> share_explained(np.roll(x, 2), x, 100.0) > 0.7, share_explained(other, x, 100.0) < 0.05
    (True, True)
    """
    halves = np.array_split(np.arange(y.size), 2)
    ahead = round(leads * rate)
    left = total = 0.0
    for fitted, judged in (halves, halves[::-1]):
        taps = finite_response(y[fitted], x[fitted], rate, leads, lags)
        target = y[judged] - y[judged].mean()
        left += np.sum(_left(y[judged], x[judged], taps, ahead) ** 2)
        total += np.sum(target[taps.size : -taps.size] ** 2)
    return float(1.0 - left / total)
