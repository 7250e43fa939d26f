"""Responses of signals to leads and lags of a reference: what it explains of them is free of fed-back torque.

Zero-phase decimation needs leads, a lightly damped load long lags.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import linalg

from ankleloop.errors import DataError
from ankleloop.signals.decimation import PASSBAND, convolve, decimate, decimation_taps
from ankleloop.signals.spectra import smooth

LEADS, LAGS = 0.15, 0.80  # s
RIDGE = 1e-3  # of the power of the source: it settles what lies beyond the pass band
RESOLUTION = 0.8  # Hz: width over which the noise spectrum is smoothed
DISCARDED = 1e-6  # of the largest eigenvalue of the reference's covariance: beyond the pass band there is nothing
ROWS_PER_LAG = 4  # at least
CHUNK = 20_000  # rows whose leads and lags are in memory at a time


# For each record leads and lags of the reference, shape (rows, shifts), and signals at the same samples less their
# means, shape (rows, channels).
Parts = Sequence[tuple[np.ndarray, np.ndarray]]


@dataclass(frozen=True, eq=False)
class ReferenceProjection:
    """Signals of records, and what the reference does not explain of them."""

    # Shape (rows, channels): for each record the channels less their means, without the ends that leads and lags
    # touch.
    signals: list[np.ndarray]
    residuals: list[
        np.ndarray
    ]  # shape (rows, channels): what the common response to the reference leaves
    rows: int  # samples of all records
    shrinkage: float  # share of a residual's power that the fit to the reference leaves in it


def project_on_reference(
    references: Sequence[np.ndarray], channels: Sequence[np.ndarray], rate: float
) -> ReferenceProjection:
    """Least-squares response of signals to leads and lags of the reference, common to all records.

    Only samples count whose leads and lags lie within their record. So no sample of a record depends on what came
    before it, and several short records are worth one long one.

    Shapes: references (N,), channels (N, channels).
    """
    parts = _cut_records(
        references, channels, round(LEADS * rate), round(LAGS * rate), ROWS_PER_LAG
    )
    coefficients, rank = _fit_response(parts)
    signals = [signal for _, signal in parts]
    rows = sum(map(len, signals))
    return ReferenceProjection(signals, _residuals(parts, coefficients), rows, 1.0 - rank / rows)


def unseen_share(
    references: Sequence[np.ndarray], signals: Sequence[np.ndarray], rate: float
) -> float:
    """Share of the variance of signals that the reference predicts in the half of the samples that was not fitted.

    Shapes: references, signals (N,).
    """
    parts = _cut_records(
        references, signals, round(LEADS * rate), round(LAGS * rate), 2 * ROWS_PER_LAG
    )
    pairs = [[np.split(x, [len(x) // 2]) for x in part] for part in parts]
    halves = [
        [(shifted[half], _centre(signal[half])) for shifted, signal in pairs] for half in (0, 1)
    ]
    residual = 0.0
    for training, test in (halves, halves[::-1]):
        residual += sum(
            float(np.sum(part**2)) for part in _residuals(test, _fit_response(training)[0])
        )
    return 1.0 - residual / sum(float(np.sum(signal**2)) for half in halves for _, signal in half)


def predict_from_reference(
    signals: Sequence[np.ndarray], references: Sequence[np.ndarray], leads: int = 15, lags: int = 80
) -> list[np.ndarray]:
    """Predict signals from leads and lags of the reference: the prediction is free of noise that is fed back.

    Shapes: signals (N, m), references (N, q); returns (N, m).
    """
    coefficients, _ = _fit_response(
        _cut_records(references, signals, leads, lags, references[0].shape[1])
    )
    padded = [np.pad(_centre(record), ((lags, leads), (0, 0))) for record in references]
    return [lag_matrix(record, leads, lags) @ coefficients for record in padded]


def lag_matrix(x: np.ndarray, leads: int, lags: int) -> np.ndarray:
    """Leads and lags of signals at all samples that have them: x(t + leads), …, x(t), …, x(t - lags) in row t.

    A product with it is a response with the taps h(-leads), …, h(lags). One signal gives a view, several a copy with
    the columns of one signal after those of the other.

    Shapes: x (N,) or (N, q); returns (N - leads - lags, q (leads + lags + 1)).
    """
    windows = np.lib.stride_tricks.sliding_window_view(x, leads + lags + 1, axis=0)[..., ::-1]
    return windows.reshape(len(windows), -1)


def _centre(x: np.ndarray) -> np.ndarray:
    return x - x.mean(axis=0)


def _cut_records(
    references: Sequence[np.ndarray],
    signals: Sequence[np.ndarray],
    leads: int,
    lags: int,
    rows_per_tap: int,
) -> Parts:
    """Leads and lags of the references of each record that is longer than these, and the signals."""
    taps = leads + lags + 1
    pairs = [pair for pair in zip(references, signals, strict=True) if len(pair[0]) > taps]
    parts = [
        (lag_matrix(r, leads, lags), _centre(signal[lags : len(r) - leads])) for r, signal in pairs
    ]
    rows, needed = sum(len(signal) for _, signal in parts), rows_per_tap * taps
    if rows < needed:
        raise DataError(
            f"{rows} samples remain beside {taps} leads and lags of the reference, and {needed} are needed: record "
            "longer."
        )
    return parts


def _generate_rows(
    shifted: np.ndarray, signal: np.ndarray
) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Leads and lags less their means, and signals, some rows at a time: all at once would not fit in a long record."""
    mean = shifted.mean(axis=0)
    for start in range(0, len(shifted), CHUNK):
        yield shifted[start : start + CHUNK] - mean, signal[start : start + CHUNK]


def _fit_response(parts: Parts) -> tuple[np.ndarray, int]:
    """Coefficients of the leads and lags, and their rank; directions without excitation are left out."""
    gram = products = np.zeros(1)
    for part in parts:
        for chunk, signal in _generate_rows(*part):
            gram, products = gram + chunk.T @ chunk, products + chunk.T @ signal
    values, vectors = np.linalg.eigh(gram)
    excited = values > DISCARDED * values[-1]
    directions = vectors[:, excited] / np.sqrt(values[excited])
    return directions @ (directions.T @ products), int(excited.sum())


def _residuals(parts: Parts, coefficients: np.ndarray) -> list[np.ndarray]:
    """What coefficients of the leads and lags leave of the signals."""
    return [
        np.concatenate([signal - chunk @ coefficients for chunk, signal in _generate_rows(*part)])
        for part in parts
    ]


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
    noise, taps = np.ones(passband.size), np.zeros(size)
    for _ in range(2):
        weight = np.where(passband, 1.0 / np.maximum(noise, 1e-12 * noise[passband].max()), 0.0)
        autocorrelation = np.fft.irfft(weight * np.abs(spectrum) ** 2, size)[: shifts.size]
        autocorrelation[0] *= 1.0 + RIDGE
        products = np.fft.irfft(weight * spectrum.conj() * target, size)[shifts]
        taps[shifts] = linalg.solve_toeplitz(autocorrelation, products)
        noise = smooth(np.abs(target - np.fft.rfft(taps) * spectrum) ** 2, RESOLUTION * size / rate)
    return taps[shifts]


def apply_response(taps: np.ndarray, x: np.ndarray, leads: int) -> np.ndarray:
    """What a response explains of a signal, at all samples of its source.

    The source counts less its mean, so that it is zero beyond its ends.

    Shapes: taps (leads + lags + 1,), x (N,); returns (N,).
    """
    response = convolve(x - x.mean(), taps)
    return response[leads : leads + x.size]


def predict_decimated(
    y: np.ndarray, reference: np.ndarray, grid: tuple[int, int, int], rate: float
) -> np.ndarray:
    """Part of a decimated signal that the recorded reference explains, at the recording rate.

    Beyond its ends the reference is taken to equal its mean.

    Shapes: y (N,), reference (samples,); returns (samples,).
    """
    factor = grid[0]
    taps = fit_finite_response(y, decimate(reference, *grid), rate / factor)
    recorded_taps = np.zeros(factor * (taps.size - 1) + 1)
    recorded_taps[::factor] = taps
    lowpass, half = decimation_taps(factor, 0)
    leads = half + factor * round(LEADS * rate / factor)
    return apply_response(convolve(recorded_taps, lowpass), reference, leads)
