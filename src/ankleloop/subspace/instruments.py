"""Instrumental variables of the MOESP family: past signals that are uncorrelated with the future noise."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ankleloop.errors import DataError
from ankleloop.subspace.hankel import block_hankel
from ankleloop.subspace.options import Instruments
from ankleloop.subspace.records import merge_hankel, remove_means

__all__ = ["INSTRUMENT_SIGNALS", "fit_reference_response", "predict_from_reference", "select_channels"]

SIGNALS = ("input", "output", "reference")
INSTRUMENT_SIGNALS: dict[Instruments, tuple[str, ...]] = {
    "none": (),
    "past-input": ("input",),
    "past-input-output": ("input", "output"),
    "past-reference": ("reference",),
}


def select_channels(instruments: Instruments, sizes: tuple[int, int, int]) -> np.ndarray:
    """Select the channels that instruments consist of, from records of inputs, outputs and reference side by side."""
    signals = INSTRUMENT_SIGNALS[instruments]
    if "reference" in signals and not sizes[2]:
        raise DataError("past-reference instruments need a reference: pass the external command of the loop.")
    return np.flatnonzero(np.repeat([name in signals for name in SIGNALS], sizes))


def fit_reference_response(
    signals: Sequence[np.ndarray], references: Sequence[np.ndarray], leads: int = 15, lags: int = 80
) -> np.ndarray:
    """Finite response of signals to leads and lags of the reference, by least squares.

    The leads are needed because zero-phase filters leak the future into the past.

    Shapes: signals (N, m), references (N, q); returns (leads + lags + 1, q, m).
    """
    taps, q = leads + lags + 1, references[0].shape[1]
    columns = sum(max(0, record.shape[0] - taps + 1) for record in references)
    if columns < taps * q:
        samples = " + ".join(str(record.shape[0]) for record in references)
        raise DataError(
            f"a record of {samples} samples is too short to predict its inputs from {taps} leads and lags "
            "of the reference: record longer, or use input_matrices='least-squares'."
        )
    regressors = merge_hankel(references, 0, taps, taps).T
    # Each lag loses its own mean: an offset of the signal would leak through small differences between these means.
    regressors = regressors - regressors.mean(axis=0)
    target = np.concatenate([record[lags : record.shape[0] - leads] for record in signals if record.shape[0] >= taps])
    # Rows run from the oldest lag to the furthest lead; the response reads the other way.
    return np.linalg.lstsq(regressors, target - target.mean(axis=0), rcond=1e-10)[0].reshape(taps, q, -1)[::-1]


def predict_from_reference(
    signals: Sequence[np.ndarray], references: Sequence[np.ndarray], leads: int = 15, lags: int = 80
) -> list[np.ndarray]:
    """Predict signals from leads and lags of the reference: the prediction is free of noise that is fed back.

    Shapes: signals (N, m), references (N, q); returns (N, m).
    """
    response = fit_reference_response(signals, references, leads, lags)
    taps = response[::-1].reshape(-1, response.shape[2])
    edges = ((lags, leads), (0, 0))
    return [
        block_hankel(np.pad(record, edges), 0, leads + lags + 1, record.shape[0]).T @ taps
        for record in remove_means(references)
    ]
