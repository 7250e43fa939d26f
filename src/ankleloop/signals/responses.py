r"""Responses of signals to leads and lags of a source: least squares, and what a response explains.

.. math:: y(t) = \sum_{k=-leads}^{lags} h(k) \, x(t - k) + v(t)

What a reference explains of a signal is free of torque that is fed back. Zero-phase decimation needs leads, a lightly
damped load long lags.

There is one estimator, least squares of the taps h, and two ways to its normal equations:

- from the matrix of leads and lags (`lag_matrix`), for several records and several channels: the taps are common to all
  records, and only samples count whose leads and lags lie within their record (`project_on_reference`, `unseen_share`,
  `predict_from_reference`);
- from correlations, for one signal: the length of a record hardly counts, and frequencies may have weights
  (`fit_finite_response`, `predict_decimated`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from scipy import linalg
from scipy.fft import irfft, rfft

from ankleloop.errors import DataError
from ankleloop.signals.decimation import PASSBAND, convolve, decimate, decimation_taps
from ankleloop.signals.spectra import smooth

RESPONSE_LEADS = 0.15  # s
RESPONSE_LAGS = 0.80  # s
ROWS_PER_TAP = 4  # at least
UNEXCITED = 1e-6  # of the largest eigenvalue of the source's covariance: beyond the pass band there is nothing
SOURCE_RIDGE = 1e-3  # of the power of the source: it settles what lies beyond the pass band
RESPONSE_NOISE_RESOLUTION = 0.8  # Hz: width over which the noise spectrum is smoothed
NOISE_FLOOR = 1e-12  # of the largest noise in the pass band


class LaggedRecord(NamedTuple):
    """Leads and lags of the source in a record, and the signals at the same samples, all less their means."""

    lagged: np.ndarray  # shape (rows, taps)
    signals: np.ndarray  # shape (rows,) or (rows, channels)


@dataclass(frozen=True, eq=False)
class ReferenceProjection:
    """Signals of records, and what the reference does not explain of them."""

    # Shape (rows, channels): for each record the channels less their means, without the ends that leads and lags
    # touch.
    signals: list[np.ndarray]
    # Shape (rows, channels): what the common response to the reference leaves.
    residuals: list[np.ndarray]
    rows: int  # samples of all records
    shrinkage: float  # share of a residual's power that the fit to the reference leaves in it


def lag_matrix(x: np.ndarray, leads: int, lags: int) -> np.ndarray:
    """Leads and lags of signals at all samples that have them: x(t + leads), …, x(t), …, x(t - lags) in row t.

    A product with it is a response with the taps h(-leads), …, h(lags). One signal gives a view, several a copy with
    the columns of one signal after those of the other.

    Shapes: x (N,) or (N, q); returns (N - leads - lags, q (leads + lags + 1)).
    """
    windows = np.lib.stride_tricks.sliding_window_view(x, leads + lags + 1, axis=0)
    return windows[..., ::-1].reshape(len(windows), -1)


def project_on_reference(
    references: Sequence[np.ndarray], channels: Sequence[np.ndarray], rate: float
) -> ReferenceProjection:
    """Least-squares response of signals to leads and lags of the reference, common to all records.

    Only samples count whose leads and lags lie within their record. So no sample of a record depends on what came
    before it, and several short records are worth one long one.

    Shapes: references (N,), channels (N, channels).
    """
    leads, lags = _usual_reach(rate)
    records = _lag_records(references, channels, leads, lags, ROWS_PER_TAP)
    taps, rank = _fit_response(records)
    signals = [record.signals for record in records]
    rows = sum(map(len, signals))
    residuals = [signals - lagged @ taps for lagged, signals in records]
    return ReferenceProjection(signals, residuals, rows, shrinkage=1.0 - rank / rows)


def unseen_share(
    references: Sequence[np.ndarray], signals: Sequence[np.ndarray], rate: float
) -> float:
    """Share of the variance of signals that the reference predicts in the half of the samples that was not fitted.

    Shapes: references, signals (N,).
    """
    leads, lags = _usual_reach(rate)
    records = _lag_records(references, signals, leads, lags, 2 * ROWS_PER_TAP)
    first = [_cut_rows(record, slice(None, len(record.signals) // 2)) for record in records]
    second = [_cut_rows(record, slice(len(record.signals) // 2, None)) for record in records]
    unexplained = 0.0
    total = 0.0
    for training, unseen in ((first, second), (second, first)):
        taps, _ = _fit_response(training)
        for lagged, signal in unseen:
            unexplained += np.sum((signal - lagged @ taps) ** 2)
            total += np.sum(signal**2)
    return float(1.0 - unexplained / total)


def _usual_reach(rate: float) -> tuple[int, int]:
    """Leads and lags of the reference [samples]."""
    return round(RESPONSE_LEADS * rate), round(RESPONSE_LAGS * rate)


def count_taps(rate: float) -> int:
    """Number of leads and lags of the usual response to a reference.

    >>> count_taps(100.0)
    96
    """
    leads, lags = _usual_reach(rate)
    return leads + 1 + lags


def _cut_rows(record: LaggedRecord, rows: slice) -> LaggedRecord:
    """A part of a record."""
    return LaggedRecord(*(_centre(part[rows]) for part in record))


def predict_from_reference(
    signals: Sequence[np.ndarray], references: Sequence[np.ndarray], leads: int = 15, lags: int = 80
) -> list[np.ndarray]:
    """Predict signals from leads and lags of the reference: the prediction is free of noise that is fed back.

    Shapes: signals (N, m), references (N, q); returns (N, m).
    """
    channels = references[0].shape[1]
    taps, _ = _fit_response(_lag_records(references, signals, leads, lags, channels))
    padded = [np.pad(_centre(reference), ((lags, leads), (0, 0))) for reference in references]
    return [lag_matrix(reference, leads, lags) @ taps for reference in padded]


def fit_finite_response(
    signals: Sequence[np.ndarray],
    sources: Sequence[np.ndarray],
    rate: float,
    leads: float = RESPONSE_LEADS,
    lags: float = RESPONSE_LAGS,
) -> np.ndarray:
    r"""Finite response of signals to leads and lags of others, common to all records, by weighted least squares.

    The normal equations are made of correlations, so the length of a record hardly counts. They are solved twice: the
    second time every frequency is weighted by the inverse spectrum of the residual of the first solution.
    `predict_from_reference` fits over samples instead: for several channels at once, without weights, and without what
    correlations add at the ends of a record; its taps are others, by more than rounding.

    Shapes: signals, sources (N,), of each record; returns (leads + lags + 1,).
    """
    shifts = np.arange(-round(leads * rate), round(lags * rate) + 1)
    sizes = [signal.size for signal in signals]
    if sum(sizes) < 4 * shifts.size:
        raise DataError(
            f"the record of {sum(sizes) / rate:.3g} s is too short for a response to {shifts.size / rate:.3g} s of "
            f"the reference: record at least {4 * shifts.size / rate:.3g} s."
        )
    size = int(2 ** np.ceil(np.log2(max(sizes) + shifts.size)))
    source_spectra = np.array([rfft(_centre(source), size) for source in sources])
    signal_spectra = np.array([rfft(_centre(signal), size) for signal in signals])
    passband = np.fft.rfftfreq(size) <= PASSBAND
    taps = np.zeros(size)
    taps[shifts] = _solve_correlations(
        source_spectra, signal_spectra, passband.astype(float), shifts
    )
    residuals = signal_spectra - rfft(taps) * source_spectra
    power = np.sum(np.abs(residuals) ** 2, axis=0)
    noise = smooth(power, RESPONSE_NOISE_RESOLUTION * size / rate)
    floor = NOISE_FLOOR * noise[passband].max()
    weights = np.where(passband, 1.0 / np.maximum(noise, floor), 0.0)
    return _solve_correlations(source_spectra, signal_spectra, weights, shifts)


def apply_response(taps: np.ndarray, x: np.ndarray, leads: int) -> np.ndarray:
    """What a response explains of a signal, at all samples of its source.

    The source counts less its mean, so that it is zero beyond its ends.

    Shapes: taps (leads + lags + 1,), x (N,); returns (N,).
    """
    response = convolve(x - x.mean(), taps)
    return response[leads : leads + x.size]


def predict_decimated(
    signals: Sequence[np.ndarray],
    references: Sequence[np.ndarray],
    grids: Sequence[tuple[int, int, int]],
    rate: float,
) -> list[np.ndarray]:
    """Part of decimated signals that the recorded references explain, at the recording rate, by one response.

    Beyond its ends a reference is taken to equal its mean.

    Shapes: signals (N,), references (samples,), of each record; returns (samples,).
    """
    factor = grids[0][0]
    pairs = zip(references, grids, strict=True)
    decimated = [decimate(reference, *grid) for reference, grid in pairs]
    taps = fit_finite_response(signals, decimated, rate / factor)
    recorded_taps = np.zeros(factor * (taps.size - 1) + 1)
    recorded_taps[::factor] = taps
    lowpass, half = decimation_taps(factor, 0)
    response = convolve(recorded_taps, lowpass)
    leads = half + factor * round(RESPONSE_LEADS * rate / factor)
    return [apply_response(response, reference, leads) for reference in references]


def _centre(x: np.ndarray) -> np.ndarray:
    """Signals less their means."""
    return x - x.mean(axis=0)


def _lag_records(
    sources: Sequence[np.ndarray],
    signals: Sequence[np.ndarray],
    leads: int,
    lags: int,
    rows_per_tap: int,
) -> list[LaggedRecord]:
    """Leads and lags of the source, and the signals, of each record that is longer than these."""
    taps = leads + lags + 1
    records = []
    for source, signal in zip(sources, signals, strict=True):
        if len(source) > taps:
            inner = signal[lags : len(source) - leads]
            lagged = lag_matrix(source, leads, lags)
            records.append(LaggedRecord(_centre(lagged), _centre(inner)))
    rows = sum(len(record.signals) for record in records)
    needed = rows_per_tap * taps
    if rows < needed:
        raise DataError(
            f"{rows} samples remain beside {taps} leads and lags of the reference, and {needed} are needed: record "
            "longer."
        )
    return records


def _fit_response(records: Sequence[LaggedRecord]) -> tuple[np.ndarray, int]:
    """Taps that are common to the records, and their rank; directions without excitation are left out."""
    gram = np.sum([lagged.T @ lagged for lagged, _ in records], axis=0)
    products = np.sum([lagged.T @ signals for lagged, signals in records], axis=0)
    values, vectors = np.linalg.eigh(gram)
    excited = values > UNEXCITED * values[-1]
    directions = vectors[:, excited] / np.sqrt(values[excited])
    return directions @ (directions.T @ products), int(excited.sum())


def _solve_correlations(
    sources: np.ndarray, signals: np.ndarray, weights: np.ndarray, shifts: np.ndarray
) -> np.ndarray:
    """Taps by normal equations of correlations, from the spectra of the sources and of the signals of all records.

    Shapes: sources, signals (records, F), weights (F,), shifts (taps,); returns (taps,).
    """
    size = 2 * (weights.size - 1)
    power = np.sum(weights * np.abs(sources) ** 2, axis=0)
    autocorrelation = irfft(power, size)[: shifts.size]
    autocorrelation[0] *= 1.0 + SOURCE_RIDGE
    cross = np.sum(weights * sources.conj() * signals, axis=0)
    products = irfft(cross, size)[shifts]
    return linalg.solve_toeplitz(autocorrelation, products)
