"""Responses of signals to leads and lags of a reference: what it explains of them is free of fed-back torque.

Zero-phase decimation needs leads, a lightly damped load long lags.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from ankleloop.errors import DataError
from ankleloop.signals.decimation import PASSBAND, convolve, decimate, lowpass
from ankleloop.signals.spectra import smooth

LEADS, LAGS = 0.15, 0.80  # s
RIDGE = 1e-3  # of the power of the source: it settles what lies beyond the pass band
RESOLUTION = 0.8  # Hz: width over which the noise spectrum is smoothed
DISCARDED = 1e-6  # of the largest eigenvalue of the reference's covariance: beyond the pass band there is nothing
ROWS_PER_LAG = 4  # at least
CHUNK = 20_000  # rows whose leads and lags are in memory at a time


@dataclass(frozen=True, eq=False)
class ReferenceProjection:
    """Signals of records, and what the reference does not explain of them."""

    # Shape (rows, channels): for each record the channels less their means, without the ends that leads and lags
    # touch.
    signals: list[np.ndarray]
    residuals: list[np.ndarray]  # shape (rows, channels): what the common response to the reference leaves
    rank: int  # independent directions of the leads and lags

    @property
    def rows(self) -> int:
        """Samples of all records."""
        return sum(len(part) for part in self.signals)

    @property
    def shrinkage(self) -> float:
        """Share of a residual's power that the fit to the reference leaves in it."""
        return 1.0 - self.rank / self.rows


def project_on_reference(
    references: Sequence[np.ndarray], channels: Sequence[np.ndarray], rate: float
) -> ReferenceProjection:
    """Least-squares response of signals to leads and lags of the reference, common to all records.

    Only samples count whose leads and lags lie within their record. So no sample of a record depends on what came
    before it, and several short records are worth one long one.

    Shapes: references (N,), channels (N, channels).
    """
    parts = _cut_records(references, channels, rate)
    coefficients, rank = _fit_response(parts)
    residuals = [part.signal - part.response(coefficients) for part in parts]
    return ReferenceProjection([part.signal for part in parts], residuals, rank)


def unseen_share(references: Sequence[np.ndarray], signals: Sequence[np.ndarray], rate: float) -> float:
    """Share of the variance of signals that the reference predicts in the half of the samples that was not fitted.

    Shapes: references, signals (N,).
    """
    parts = _cut_records(references, [signal[:, None] for signal in signals], rate, halves=2)
    pairs = [part.split() for part in parts]
    halves = [pair[0] for pair in pairs], [pair[1] for pair in pairs]
    residual = 0.0
    for training, test in (halves, halves[::-1]):
        coefficients, _ = _fit_response(training)
        residual += sum(float(np.sum((part.signal - part.response(coefficients)) ** 2)) for part in test)
    return 1.0 - residual / sum(float(np.sum(part.signal**2)) for half in halves for part in half)


def fit_lagged_response(
    references: Sequence[np.ndarray], signals: Sequence[np.ndarray], leads: int, lags: int
) -> np.ndarray:
    """Finite response of signals to leads and lags of references, by least squares.

    Shapes: references (N, q), signals (N, m); returns (leads + lags + 1, q, m), from the furthest lead to the oldest
    lag.
    """
    parts = _align(references, signals, leads, lags)
    coefficients, _ = _fit_response(parts)
    # Leads and lags of each reference run from the oldest lag to the furthest lead.
    return np.moveaxis(coefficients.reshape(references[0].shape[1], leads + lags + 1, -1)[:, ::-1], 0, 1)


@dataclass(frozen=True, eq=False)
class _Part:
    """Leads and lags of the reference, shape (rows, shifts), and signals at the same samples less their means."""

    shifted: np.ndarray
    signal: np.ndarray

    def chunks(self) -> Iterator[tuple[np.ndarray, slice]]:
        """Leads and lags less their means in chunks of rows: all of them at once would not fit in a long record."""
        mean = self.shifted.mean(axis=0)
        for start in range(0, len(self.signal), CHUNK):
            rows = slice(start, start + CHUNK)
            yield self.shifted[rows] - mean, rows

    def response(self, coefficients: np.ndarray) -> np.ndarray:
        """What coefficients of the leads and lags explain of the signals."""
        return np.concatenate([shifted @ coefficients for shifted, _ in self.chunks()])

    def split(self) -> tuple[_Part, _Part]:
        """The two halves of the rows."""
        middle = len(self.signal) // 2
        first, second = (
            _Part(self.shifted[rows], self.signal[rows] - self.signal[rows].mean(axis=0))
            for rows in (slice(None, middle), slice(middle, None))
        )
        return first, second


def _align(references: Sequence[np.ndarray], signals: Sequence[np.ndarray], leads: int, lags: int) -> list[_Part]:
    """Leads and lags of the references of each record that is longer than these, and the signals."""
    parts = []
    for reference, values in zip(references, signals, strict=True):
        rows = len(reference) - leads - lags
        if rows > 1:
            windows = np.lib.stride_tricks.sliding_window_view(reference, leads + lags + 1, axis=0)
            signal = values[lags : lags + rows]
            parts.append(_Part(windows.reshape(rows, -1), signal - signal.mean(axis=0)))
    return parts


def _cut_records(
    references: Sequence[np.ndarray], channels: Sequence[np.ndarray], rate: float, halves: int = 1
) -> list[_Part]:
    """The parts of records, of which enough has to remain beside the response."""
    leads, lags = round(LEADS * rate), round(LAGS * rate)
    parts = _align(references, channels, leads, lags)
    length, needed = sum(len(part.signal) for part in parts), halves * ROWS_PER_LAG * (leads + lags + 1)
    if length < needed:
        raise DataError(
            f"{length / rate:.3g} s remain beside the response to {(leads + lags) / rate:.3g} s of the reference, and "
            f"{needed / rate:.3g} s are needed: record longer."
        )
    return parts


def _fit_response(parts: Sequence[_Part]) -> tuple[np.ndarray, int]:
    """Coefficients of the leads and lags, and their rank; directions without excitation are left out."""
    shifts, channels = parts[0].shifted.shape[1], parts[0].signal.shape[1]
    gram, products = np.zeros((shifts, shifts)), np.zeros((shifts, channels))
    for part in parts:
        for shifted, rows in part.chunks():
            gram += shifted.T @ shifted
            products += shifted.T @ part.signal[rows]
    values, vectors = np.linalg.eigh(gram)
    excited = values > DISCARDED * values[-1]
    directions = vectors[:, excited] / np.sqrt(values[excited])
    return directions @ (directions.T @ products), int(excited.sum())


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


def predict_decimated(y: np.ndarray, reference: np.ndarray, grid: tuple[int, int, int], rate: float) -> np.ndarray:
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
