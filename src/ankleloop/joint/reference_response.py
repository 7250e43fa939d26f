"""Response of a signal to leads and lags of the reference: what the reference explains is free of fed-back torque."""

from __future__ import annotations

import numpy as np
from scipy import linalg

from ankleloop.errors import DataError
from ankleloop.signals.decimation import PASSBAND, convolve, decimate, lowpass
from ankleloop.signals.spectra import smooth

__all__ = ["explained_share", "fit_finite_response", "predict_from_reference"]

LEADS, LAGS = 0.15, 0.80  # s: zero-phase decimation needs leads, a lightly damped load long lags
RIDGE = 1e-3  # of the power of the source: it settles what lies beyond the pass band
RESOLUTION = 0.8  # Hz: width over which the noise spectrum is smoothed


def fit_finite_response(
    y: np.ndarray, x: np.ndarray, rate: float, leads: float = LEADS, lags: float = LAGS
) -> np.ndarray:
    r"""Finite response of a signal to leads and lags of another, by weighted least squares.

    The normal equations are made of correlations, so the length of the record hardly counts. They are solved twice: the
    second time every frequency is weighted by the inverse spectrum of the residual of the first solution.

    Shapes: y, x (N,); returns (leads + lags + 1,).
    """
    shifts = np.arange(-round(leads * rate), round(lags * rate) + 1)
    if y.size < 4 * shifts.size:
        raise DataError(
            f"the record of {y.size / rate:.3g} s is too short for a response to {shifts.size / rate:.3g} s of the "
            f"reference: record at least {4 * shifts.size / rate:.3g} s."
        )
    size = int(2 ** np.ceil(np.log2(y.size + shifts.size)))
    spectrum, target = np.fft.rfft(x - x.mean(), size), np.fft.rfft(y - y.mean(), size)
    passband = np.fft.rfftfreq(size) <= PASSBAND
    taps = _solve_correlations(spectrum, target, passband.astype(float), shifts, size)
    circular = np.zeros(size)
    circular[shifts] = taps
    residual = target - np.fft.rfft(circular) * spectrum
    noise = smooth(np.abs(residual) ** 2, RESOLUTION * size / rate)
    weight = np.where(passband, 1.0 / np.maximum(noise, 1e-12 * noise[passband].max()), 0.0)
    return _solve_correlations(spectrum, target, weight / weight.max(), shifts, size)


def _solve_correlations(
    spectrum: np.ndarray, target: np.ndarray, weight: np.ndarray, shifts: np.ndarray, size: int
) -> np.ndarray:
    """Solve the normal equations of weighted correlations, a Toeplitz system."""
    autocorrelation = np.fft.irfft(weight * np.abs(spectrum) ** 2, size)[: shifts.size]
    autocorrelation[0] *= 1.0 + RIDGE
    return linalg.solve_toeplitz(autocorrelation, np.fft.irfft(weight * spectrum.conj() * target, size)[shifts])


def _respond(x: np.ndarray, taps: np.ndarray, leads: int) -> np.ndarray:
    """Output of a finite response that begins some samples ahead, on the samples of the input."""
    return convolve(x, taps)[leads:][: x.size]


def predict_from_reference(y: np.ndarray, reference: np.ndarray, grid: tuple[int, int, int], rate: float) -> np.ndarray:
    """Part of a decimated signal that the recorded reference explains, at the recording rate.

    Shapes: y (N,), reference (samples,); returns (samples,).
    """
    factor = grid[0]
    taps = fit_finite_response(y, decimate(reference, *grid), rate / factor)
    recorded_taps = np.zeros(factor * (taps.size - 1) + 1)
    recorded_taps[::factor] = taps
    return _respond(lowpass(reference, factor), recorded_taps, factor * round(LEADS * rate / factor))


def _residual(y: np.ndarray, x: np.ndarray, taps: np.ndarray, rate: float) -> np.ndarray:
    response = _respond(x - x.mean(), taps, round(LEADS * rate))
    return (y - y.mean() - response)[taps.size : -taps.size]


def explained_share(y: np.ndarray, x: np.ndarray, rate: float) -> float:
    """Share of a signal's variance that another one predicts in the half of the record that was not fitted.

    Shapes: y, x (N,).
    """
    halves = np.array_split(np.arange(y.size), 2)
    residual = total = 0.0
    for training, test in (halves, halves[::-1]):
        taps = fit_finite_response(y[training], x[training], rate)
        target = y[test] - y[test].mean()
        residual += np.sum(_residual(y[test], x[test], taps, rate) ** 2)
        total += np.sum(target[taps.size : -taps.size] ** 2)
    return float(1.0 - residual / total)
