"""Records of one joint split into what leads and lags of the reference explain, and the rest."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ankleloop.errors import DataError
from ankleloop.joint.reference_response import LAGS, LEADS
from ankleloop.joint.regressors import Regressors

__all__ = ["ReferenceProjection", "project_on_reference", "unseen_share"]

DISCARDED = 1e-6  # of the largest eigenvalue of the reference's covariance: beyond the pass band there is nothing
ROWS_PER_LAG = 4  # at least
CHUNK = 20_000  # rows whose leads and lags are in memory at a time


@dataclass(frozen=True, eq=False)
class ReferenceProjection:
    """Signals of records, and what the reference does not explain of them.

    Parameters
    ----------
    signals : list of ndarray, shape (rows, channels)
        For each record the channels less their means, without the ends that leads and lags touch.
    residuals : list of ndarray, shape (rows, channels)
        What the common response to the reference leaves.
    rank : int
        Independent directions of the leads and lags.
    """

    signals: list[np.ndarray]
    residuals: list[np.ndarray]
    rank: int

    @property
    def rows(self) -> int:
        """Samples of all records."""
        return sum(len(part) for part in self.signals)

    @property
    def shrinkage(self) -> float:
        """Share of a residual's power that the fit to the reference leaves in it."""
        return 1.0 - self.rank / self.rows


def project_on_reference(records: Sequence[Regressors], channels: Sequence[np.ndarray]) -> ReferenceProjection:
    """Least-squares response of signals to leads and lags of the reference, common to all records.

    Only samples count whose leads and lags lie within their record. So no sample of a record depends on what came
    before it, and several short records are worth one long one.

    Shapes: channels (N, channels).
    """
    parts = _cut_records(records, channels)
    coefficients, rank = _fit_response(parts)
    residuals = [part.signal - part.response(coefficients) for part in parts]
    return ReferenceProjection([part.signal for part in parts], residuals, rank)


def unseen_share(records: Sequence[Regressors]) -> float:
    """Share of the position's variance that the reference predicts in the half of the samples that was not fitted."""
    parts = _cut_records(records, [record.inputs[:, :1] for record in records], halves=2)
    pairs = [part.split() for part in parts]
    halves = [pair[0] for pair in pairs], [pair[1] for pair in pairs]
    residual = 0.0
    for training, test in (halves, halves[::-1]):
        coefficients, _ = _fit_response(training)
        residual += sum(float(np.sum((part.signal - part.response(coefficients)) ** 2)) for part in test)
    return 1.0 - residual / sum(float(np.sum(part.signal**2)) for half in halves for part in half)


@dataclass(frozen=True, eq=False)
class _Part:
    """Leads and lags of the reference, shape (rows, shifts), and signals at the same samples less their means."""

    shifted: np.ndarray
    signal: np.ndarray

    @property
    def mean(self) -> np.ndarray:
        """Means of the leads and lags, shape (shifts,)."""
        return self.shifted.mean(axis=0)

    def chunks(self) -> Iterator[tuple[np.ndarray, slice]]:
        """Leads and lags less their means in chunks of rows: all of them at once would not fit in a long record."""
        mean = self.mean
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


def _cut_records(records: Sequence[Regressors], channels: Sequence[np.ndarray], halves: int = 1) -> list[_Part]:
    """Leads and lags of the reference of each record that is longer than these, and the signals."""
    rate = records[0].rate
    leads, lags = round(LEADS * rate), round(LAGS * rate)
    parts = []
    for record, values in zip(records, channels, strict=True):
        rows = record.torque.size - leads - lags
        if rows > 1 and record.reference is not None:
            shifted = np.lib.stride_tricks.sliding_window_view(record.reference, leads + lags + 1)
            signal = values[lags : lags + rows]
            parts.append(_Part(shifted, signal - signal.mean(axis=0)))
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
